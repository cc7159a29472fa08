"""Cited material constants, by name; and names that are refused, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fem.breakdown import read_strength
from fem.laws import REGISTRY as LAWS
from fem.laws import Gent, Ogden, checked
from geometry.errors import InputError
from geometry.specimen import Material, Specimen, read_specimen
from geometry.tables import Table


@dataclass(frozen=True)
class Entry:
    """A material of the library: its constants, where they come from and what to beware of.

    Where a caveat says so, the constants are those the literature quotes from the source, not read in it again.
    """

    material: Material
    source: str
    caveat: str


DEFAULT = "vhb-4910"

MATERIALS: dict[str, Entry] = {
    DEFAULT: Entry(
        Ogden((18.4e3, 210.0), (2.0, 4.0)),
        "Foo, Cai, Koh, Bauer, Suo, J. Appl. Phys. 111, 034102 (2012): relaxed spring of VHB, a Gent law with μ 18 kPa "
        "and J_lim 110, here as two Ogden terms fitted to its biaxial stress",
        "within 4 % of that Gent spring for in-plane stretches from 1.8 to 3.2; at the mounted stretch √5 as stiff "
        "as 19.5 kPa neo-Hooke. Sources on VHB 4910 differ by a factor of 1.7, and the tape creeps: in the first "
        "seconds after loading it is up to three times stiffer. Constants as quoted from the source, not read in it "
        "again",
    ),
    "vhb-4910-gent": Entry(
        Gent(18e3, 110.0),
        "Foo, Cai, Koh, Bauer, Suo, J. Appl. Phys. 111, 034102 (2012): relaxed spring of VHB, the Gent law itself",
        "the relaxed tape only: it creeps, and in the first seconds after loading it is up to three times stiffer. "
        "Constants as quoted from the source, not read in it again",
    ),
    "vhb-4910-neo-hooke": Entry(
        Ogden((20e3,), (2.0,)),
        "neo-Hookean modulus implied by the actuators' measured ranges (17.9 g and 22.45 g, 0 to 7 kV) with a "
        "membrane instead of a cone",
        "one number: it does not stiffen at large stretch",
    ),
    "vhb-4910-long-time": Entry(
        Ogden((13.5e3,), (2.0,)),
        "Kumar, Lopez-Pamies, C. R. Mecanique 344 (2016): leading term 13.54 kPa of the equilibrium branch fitted to "
        "Hossain, Vu, Steinmann, Comput. Mater. Sci. 59 (2012)",
        "fully relaxed, after hours; the small second term is left out. Constants as quoted from the source, not read "
        "in it again",
    ),
}

REFUSED: dict[str, str] = {
    "paper-table-1": "these are constants of the lumped model only (Eq. 8, referred to the prestretched state): their "
    "stress falls with stretch, by 277 kPa per unit stretch at 1, so a membrane made of them has no "
    "stable shape; use a library material instead",
}


def read_material(table: Table, key: str) -> Material:
    """The material under a key: a name of the library, or a table with ``law`` and its constants."""
    value = table.value(key)
    if isinstance(value, str):
        if value in REFUSED:
            raise table.error(key, f"cannot be a membrane material: {REFUSED[value]}", value)
        return table.choice(key, MATERIALS).material
    constants = table.table(key)
    try:
        material = checked(constants.choice("law", LAWS)(constants))
    except InputError as error:
        if error.file is not None:
            raise
        where = constants.path(error.key) if error.key else constants.where
        raise InputError(error.allowed, file=table.file, key=where, given=error.given) from None
    constants.done()
    return material


def load_specimen(file: Path | str) -> Specimen:
    """The specimen of a TOML file (design §4), its material from the laws and the library known here."""
    return read_specimen(file, read_material, read_strength)
