"""Cited material constants, by name; and names that are refused, with the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tympan.fem.film.breakdown import read_strength
from tympan.fem.film.laws import (
    LAWS,
    STRETCH_RANGE,
    Gent,
    NeoHooke,
    Ogden,
    PrestretchedOgden,
    Separable,
    checked,
)
from tympan.geometry.errors import InputError
from tympan.geometry.fields import Special
from tympan.geometry.specimen import Film, Material, Specimen, read_specimen
from tympan.geometry.toml_reader import POSITIVE, Table


@dataclass(frozen=True)
class LibraryMaterial:
    """A material of the library: its constants, where they come from and what to beware of.

    Where a caveat says so, the constants are those the literature quotes from the source, not read
    in it again. ``density`` [kg/m³] and ``relative_permittivity`` are the film's where known, with
    ``film_source``.
    """

    material: Material
    source: str
    caveat: str
    density: float | None = None
    relative_permittivity: float | None = None
    film_source: str = ""


DEFAULT = "vhb-4910"

_VHB = ("density 960 kg/m³: 3M's data sheet; relative permittivity 4.7: Wissler, Mazza, Sens. "
        "Actuators A 138 (2007), "
        "falling to about 2.6 at large prestretch by others; both as commonly quoted, not read "
        "again")

MATERIALS: dict[str, LibraryMaterial] = {
    DEFAULT: LibraryMaterial(
        Ogden((18.4e3, 210.0), (2.0, 4.0)),
        "Foo, Cai, Koh, Bauer, Suo, J. Appl. Phys. 111, 034102 (2012): relaxed spring of VHB, a "
        "Gent law with μ 18 kPa "
        "and J_lim 110, here as two Ogden terms fitted to its biaxial stress",
        "within 4 % of that Gent spring for in-plane stretches from 1.8 to 3.2; at the mounted "
        "stretch √5 as stiff "
        "as 19.5 kPa neo-Hooke. Sources on VHB 4910 differ by a factor of 1.7, and the tape "
        "creeps: in the first "
        "seconds after loading it is up to three times stiffer. Constants as quoted from the "
        "source, not read in it "
        "again",
        960.0, 4.7, _VHB,
    ),
    "vhb-4910-gent": LibraryMaterial(
        Gent(18e3, 110.0),
        "Foo, Cai, Koh, Bauer, Suo, J. Appl. Phys. 111, 034102 (2012): relaxed spring of VHB, the "
        "Gent law itself",
        "the relaxed tape only: it creeps, and in the first seconds after loading it is up to "
        "three times stiffer. "
        "Constants as quoted from the source, not read in it again",
        960.0, 4.7, _VHB,
    ),
    "vhb-4910-neo-hooke": LibraryMaterial(
        Ogden((20e3,), (2.0,)),
        "neo-Hookean modulus implied by the actuators' measured ranges (17.9 g and 22.45 g, 0 to 7 "
        "kV) with a "
        "membrane instead of a cone",
        "one number: it does not stiffen at large stretch",
        960.0, 4.7, _VHB,
    ),
    "vhb-4910-long-time": LibraryMaterial(
        Ogden((13.5e3,), (2.0,)),
        "Kumar, Lopez-Pamies, C. R. Mecanique 344 (2016): leading term 13.54 kPa of the "
        "equilibrium branch fitted to "
        "Hossain, Vu, Steinmann, Comput. Mater. Sci. 59 (2012)",
        "fully relaxed, after hours; the small second term is left out. Constants as quoted from "
        "the source, not read "
        "in it again",
        960.0, 4.7, _VHB,
    ),
    "vhb-4905": LibraryMaterial(
        NeoHooke(13.4e3),
        "equilibrium branch 13.4 ± 0.24 kPa of the neo-Hookean viscoelastic fit in "
        "github.com/miguelmaso/"
        "2026-ViscousPolyconvex (README), to the cyclic tests of Liao, Hossain, Yao, Mehnert, "
        "Steinmann, Int. J. "
        "Non-Linear Mech. 118, 103263 (2020)",
        "constant read in the fit's README; the tests' paper was not read. Fully relaxed: the same "
        "fit adds 31.2 kPa "
        "that relaxes in 6.5 s and 11.6 kPa in 140 s. One number: it does not stiffen at large "
        "stretch. 4905 is the "
        "acrylic of 4910 at half the thickness (0.5 mm)",
        960.0, 4.7, _VHB,
    ),
    "ecoflex-00-30": LibraryMaterial(
        Ogden((14.17e3, 346.0), (2.0722, 3.8807)),
        "silicone Ecoflex 00-30 (Smooth-On): fitted with `tympan material fit` to 40 readings, "
        "stretch 1.1 to 6, of "
        "the tensile test in github.com/LucMarechal/Soft-Robotics-Materials-Database (Marechal, "
        "Balland, Lindenroth, "
        "Petrou, Kontovounisios, Bello, Soft Robotics 8, 284 (2021))",
        "one uniaxial test at 450 mm/min with strain from the crosshead, first loading (softening "
        "on later ones is not "
        "in it); root mean square misfit 0.28 kPa. No equibiaxial test: the stress of a mounted "
        "film is the law's "
        "extrapolation. Readings taken from the database's file; the paper was not read. No "
        "permittivity given",
        1070.0, None, "density: Smooth-On's data sheet, as commonly quoted, not read",
    ),
}

_TABLE_1 = ((13.4e3, 34.8e3, 35.8e3), (-410.0, -113e3, -34.2e3), (2.0, 4.0, 6.0), 5**0.5)

#: The refused constants as laws, to be examined; no film can be made of them.
EXAMINED: dict[str, Material] = {
    "paper-table-1": Separable(*_TABLE_1),
    "paper-table-1-thickness": PrestretchedOgden(*_TABLE_1),
}

REFUSED: dict[str, str] = {
    "paper-table-1": "these are constants of the lumped model only "
    "(Eq. 8, referred to the prestretched state): their "
    "stress falls with stretch, by 277 kPa per unit stretch at 1, so a membrane made of them has "
    "no "
    "stable shape; use a library material instead, and `tympan material show paper-table-1` to see "
    "it",
    "paper-table-1-thickness": "constants of the lumped model only "
    "(Eq. 8, with γ on the thickness): their stress "
    "falls with stretch where the film is mounted; `tympan material show paper-table-1-thickness` "
    "shows it",
}


def read_material(table: Table, key: str) -> Material:
    """The material under a key: a name of the library, or a table with ``law`` and its constants.

    ``range`` in the table are the in-plane stretches the law is meant for, such as those of the
    tests it was fitted to: it must be admissible over them, by default over
    :data:`tympan.fem.film.laws.STRETCH_RANGE`. What a solution visits beyond is checked there
    (:mod:`tympan.fem.film.admissibility`) and told in its warnings.
    """
    name = table.value(key)
    if isinstance(name, str) and name in REFUSED:
        raise table.error(key, f"cannot be a membrane material: {REFUSED[name]}", name)
    return _read(table, key, checked)


def examine_material(table: Table, key: str) -> Material:
    """The material under a key, admissible or not, also of the refused names: to look at only."""
    name = table.value(key)
    if isinstance(name, str) and name in EXAMINED:
        return EXAMINED[name]
    return _read(table, key, lambda material, *_: material)


def _read(table: Table, key: str, check: Callable[..., Material]) -> Material:
    if isinstance(table.value(key), str):
        return table.choice(key, MATERIALS).material
    constants = table.table(key)
    low, high = constants.numbers("range", STRETCH_RANGE, POSITIVE, 2)
    if not low < high <= 20:
        raise constants.error("range", "must be two stretches, the smaller first, at most 20",
                              [low, high])
    material = LAWS.read(constants)
    try:
        return check(material, low, high)
    except InputError as error:
        raise error.located(file=table.file, key=constants.where) from None


#: Readers of what of a film a file may also name.
READERS: Special = {(Film, "material"): read_material, (Film, "strength"): read_strength}


def load_specimen(source: Table | Path | str) -> Specimen:
    """The specimen of a TOML file or table, with the laws and the library known here."""
    return read_specimen(source, READERS)
