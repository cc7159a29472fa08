"""Scatter of the numbers of a film and its rig: a file's tolerances, or defaults with reasons.

A scatter has two parts: from film to film, and from batch to batch. Films of one batch (one roll,
one jig, one amplifier) share the second part.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from scipy.special import erf, gamma

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks, checks_types, field_at, read
from tympan.base.paths import at, with_numbers
from tympan.base.toml_reader import Rule, Table
from tympan.fem.film.library import MATERIALS, material_name
from tympan.geometry.specimen import Specimen
from tympan.studies.films.box import STIFFNESS, varying
from tympan.studies.wanted import Bound, table_bounds, wanted_bounds

_SHARE: Rule = (lambda x: 0 <= x <= 0.3, "must be a relative standard deviation from 0 to 0.3")
_SHAPE: Rule = (lambda x: x == 0 or 2 <= x <= 200, "must be 0 or from 2 to 200")
_AREA: Rule = (lambda x: 1e-10 <= x <= 10, "must be from 1e-4 mm^2 to 10 m^2")
_LENGTH: Rule = (lambda x: 0 <= x <= 0.1, "must be a standard deviation from 0 to 10 cm")

#: Factor on the load, a scattering number besides those of the specimen.
LOAD = "load"
#: Factor on the film's voltage, a scattering number besides those of the specimen.
AMPLIFIER = "amplifier"
#: Factor on the film's electric strength, a scattering number besides those of the specimen.
STRENGTH = "strength"
#: Scattering numbers that are not parameters of a family of films.
FACTORS = (LOAD, AMPLIFIER, STRENGTH)

#: Standard deviations at which the distribution is cut off: a workshop rejects films beyond.
_FARTHEST = 3.0
#: Standard deviation of the standard normal distribution when it is cut off there.
_WIDTH = float(1 - (2 / np.pi) ** 0.5 * _FARTHEST * np.exp(-_FARTHEST**2 / 2)
               / erf(_FARTHEST / 2**0.5)) ** 0.5

#: Most lengths of an outline that scatter independently: drawn outlines have hundreds.
_MOST_LENGTHS = 6
#: Weibull's shape where it is not known. Source for this distribution of the strength of films, and
#: for its fall with the area: Taine, Andritsch, Saeedi, Morshuis, Smart Mater. Struct. 32, 105021
#: (2023), on silicone. Only its abstract was read, which has no numbers. So the shape is our
#: choice: the library's sources say that strengths scatter by tens of per cent at most, and a shape
#: of 10 gives 12 %.
_SHAPE_ASSUMED = 10.0
#: Table of a tolerances file with the bounds that films must keep.
_WANT = "want"
#: Tolerances that tilt the plate. The deflection of a film that is its own mirror image changes
#: with their square alone, so that there they scatter only where they are given.
_TILTING = ("offset", "gradient")
#: Words on that.
_BY_SQUARE = ("where the film is its own mirror image the deflection changes with its square: "
              "there give [{}] for the scatter of tilts, or where the gap is narrow")
#: Largest default scatter of a length over the gap: a film of 1 mm is not cut with an error of
#: 0.1 mm.
_OF_GAP = 0.01


@asks
@dataclass(frozen=True)
class Scatter:
    """Relative standard deviations (of the logarithm) of a number."""

    film: Annotated[float, Key("from film to film", rule=_SHARE)] = 0.0
    batch: Annotated[float, Key("from batch to batch: films of one batch share it",
                                rule=_SHARE)] = 0.0


@asks
@dataclass(frozen=True)
class LengthScatter:
    """Standard deviations of a length."""

    film: Annotated[float, Key("from film to film", "length", _LENGTH)] = 0.0
    batch: Annotated[float, Key("from batch to batch: films of one batch share it", "length",
                                _LENGTH)] = 0.0


@asks
@dataclass(frozen=True)
class ShareScatter:
    """Standard deviations of a share of a film's thickness."""

    film: Annotated[float, Key("from film to film", rule=_SHARE)] = 0.0
    batch: Annotated[float, Key("from batch to batch: films of one batch share it",
                                rule=_SHARE)] = 0.0


@asks
@dataclass(frozen=True)
class StrengthScatter:
    """Weibull's distribution of a film's electric strength, whose median is the stated strength.

    Of films with electrodes of area A the share exp(−ln 2 · (A/area) (E/E_b)^shape) bears a field
    E, where E_b is the stated strength: the weakest place decides.
    """

    shape: Annotated[float, Key("Weibull's shape, such as 10: the larger, the less it scatters; 0: "
                                "it does not", rule=_SHAPE)]
    area: Annotated[float | None, Key("of the electrodes that the strength was measured with",
                                      "area", _AREA, default="this film's")] = None

    @property
    def deviation(self) -> float:
        """Relative standard deviation."""
        first, second = (gamma(1 + power / self.shape) for power in (1, 2))
        return float(np.sqrt(second / first**2 - 1))

    def median(self, electrode: float) -> float:
        """Compute the factor on the strength of films with electrodes of some area [m²]."""
        return 1.0 if self.area is None else float((self.area / electrode) ** (1 / self.shape))


@checks_types
@dataclass(frozen=True)
class Tolerances:
    """Scatter of a film and its rig, as in a tolerances file; missing keys have defaults."""

    thickness: Annotated[Scatter | None, Key("of the virgin film",
                                             default="the library's, of batches")] = None
    stiffness: Annotated[Scatter | None, Key("of the whole law",
                                             default="the library's, of batches")] = None
    permittivity: Annotated[Scatter | None, Key("of the film",
                                                default="the library's, of batches")] = None
    prestretch: Annotated[Scatter | None, Key("of each axis by itself",
                                              default="0.01 from film to film")] = None
    frame: Annotated[LengthScatter | None, Key(
        "each length of the frame's outline by itself",
        default="0.1 mm from film to film, at most 1 % of the gap")] = None
    plate: Annotated[LengthScatter | None, Key(
        "each length of the plate's outline by itself",
        default="0.1 mm from film to film, at most 1 % of the gap")] = None
    offset: Annotated[LengthScatter | None, Key(
        "of the plate's centre along x and y",
        default="0.25 mm from film to film, at most 1 % of the gap, where the film is not its own "
                "mirror image; else none")] = None
    margin: Annotated[LengthScatter | None, Key(
        "of each uncovered band that the electrode has",
        default="0.5 mm from film to film, at most 1 % of the gap")] = None
    load: Annotated[Scatter | None, Key("mass on the plate",
                                        default="0.005 from film to film")] = None
    amplifier: Annotated[Scatter | None, Key("factor on the voltage",
                                             default="0.01 of batches")] = None
    strength: Annotated[StrengthScatter | None, Key(
        "electric strength", default="shape 10, from film to film")] = None
    gradient: Annotated[ShareScatter | None, Key(
        "of thickness_gradient along x and y: by which share the virgin film is thicker where it "
        "reaches the frame's half extent than in the middle",
        default="0.02 from film to film, where the film is not its own mirror image; else none"
        )] = None

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """Read the tolerances of a TOML file; :func:`asked_bounds` reads its table [want]."""
        return cls.from_table(Table.read(file, "tolerances"))

    @classmethod
    def from_table(cls, table: Table) -> Self:
        """Read tolerances from a table, as from a file."""
        rest = {key: value for key, value in table.data.items() if key != _WANT}
        return read(cls, replace(table, data=rest, asked={_WANT}))


def tolerances_under(table: Table, key: str, default: Tolerances | None = None
                     ) -> Tolerances | None:
    """Read tolerances under a key: their tables or the name of a file; "none" gives None."""
    given = table.value(key, None)
    if given is None or given == "none":
        return default if given is None else None
    if isinstance(given, str):
        return Tolerances.read(table.beside(key))
    return Tolerances.from_table(table.table(key))


def asked_bounds(file: PathLike[str] | str | Mapping[str, Any] | None,
                 want: Mapping[str, object] | str = ""
                 ) -> tuple[Bound, ...]:
    """Read bounds from the table [want] of a tolerances file, if there is one, and from ``want``.

    ``file``: its name, or its tables. For a quantity in ``want`` the file's bounds are ignored.
    """
    table = (Table("tolerances", file or {}) if file is None or isinstance(file, Mapping)
             else Table.read(Path(file), "tolerances"))
    of_file = table_bounds(table.table(_WANT, {}))
    asked = wanted_bounds(want) if want else ()
    names = {bound.name for bound in asked}
    return (*(bound for bound in of_file if bound.name not in names), *asked)


def of_library(tolerances: Tolerances, specimen: Specimen) -> Tolerances:
    """Fill in the library's tolerances of a specimen's film where tolerances leave them out.

    A film made stiffer by a factor is no longer in the library, but scatters as before.
    """
    usual = _defaults(specimen)
    known = {name: usual[name][0] for name in ("thickness", "stiffness", "permittivity")
             if getattr(tolerances, name) is None}
    return replace(tolerances, **known)


@dataclass(frozen=True)
class ScatterCause:
    """Numbers that scatter for one reason, independently, with one standard deviation.

    ``targets``: names of a family's parameters, or one of :data:`FACTORS`. ``relative``: the
    deviation is that of the logarithm; else of the number, whose ``dimension`` is "length" or "".
    ``weibull``: the distribution where it is not the normal one.
    """

    name: str
    scope: Literal["film", "batch"]
    deviation: float
    relative: bool
    targets: tuple[str, ...]
    source: str
    reason: str
    weibull: StrengthScatter | None = None
    dimension: str = ""

    @property
    def label(self) -> str:
        """Name for people."""
        return self.name + ", batch" * (self.scope == "batch")

    def moved(self, value: Any, shares: Array) -> Array:
        """Compute a scattering number at cumulative shares of the films."""
        if self.weibull is not None:
            return np.asarray(value * (-np.log1p(-shares) / np.log(2)) ** (1 / self.weibull.shape))
        from scipy.stats import truncnorm  # takes half a second; only needed to draw films

        change = self.deviation * truncnorm.ppf(shares, -_FARTHEST, _FARTHEST) / _WIDTH
        return np.asarray(value * np.exp(change) if self.relative else value + change)


def causes(specimen: Specimen, tolerances: Tolerances
           ) -> tuple[tuple[ScatterCause, ...], list[str]]:
    """Collect everything that scatters of a specimen and its rig; say what does not.

    Raises
    ------
    InputError
        When a number scatters that the specimen does not have, or so far that a film cannot be
        built, or nothing scatters.
    """
    found, words = list[ScatterCause](), list[str]()
    usual = _defaults(specimen)
    for item in fields(Tolerances):
        name, given = item.name, getattr(tolerances, item.name)
        targets = _targets(specimen, name)
        if given is not None and not targets and any(vars(given).values()):
            why = ("the electrode has no uncovered band (margin_frame, margin_plate)"
                   if name == "margin" else
                   f"the outline has no lengths that may scatter, or more than {_MOST_LENGTHS}")
            raise InputError(f"must be left out: {why}", key=name)
        scatter, source, reason = usual[name] if given is None else (given, "given", "")
        if given is None and name in _TILTING:
            targets = _unmirrored(specimen, targets)
            scatter = scatter if targets else None
        if scatter is None:
            words.append(f"{name} does not scatter: {reason}")
            continue
        if targets and isinstance(scatter, StrengthScatter):
            found += [ScatterCause(name, "film", scatter.deviation, True, targets, source, reason,
                            scatter)] if scatter.shape else []
        elif targets:
            relative = isinstance(scatter, Scatter)
            dimension = "length" if isinstance(scatter, LengthScatter) else ""
            found += [ScatterCause(name, scope, size, relative, targets, source, reason,
                                   dimension=dimension)
                      for scope in ("film", "batch") if (size := getattr(scatter, scope)) > 0]
    if not found:
        raise InputError("lets nothing scatter: give one number a standard deviation above 0",
                         key="tolerances")
    _require_films(specimen, found)
    return tuple(found), words


def _require_films(specimen: Specimen, found: Sequence[ScatterCause]) -> None:
    """Refuse lengths that scatter so far that a film at the ends cannot be built."""
    lengths = [cause for cause in found if cause.dimension == "length"]
    for share in (0.0, 1.0):
        ends: dict[str, Any] = {}
        for cause in lengths:
            for target in cause.targets:
                value = ends.get(target, at(specimen, target.split(".")))
                # A small frame with a large plate is the worst case.
                end = share if cause.name == "frame" else 1 - share
                ends[target] = float(cause.moved(value, np.array(end)))
        try:
            with_numbers(specimen, ends)
        except InputError as error:
            widest = max(lengths, key=lambda cause: cause.deviation)
            raise InputError(
                "is too large: three standard deviations off, a film of these tolerances cannot be "
                f"built ({error})", key=f"{widest.name}.{widest.scope}",
                given=f"{1e3 * widest.deviation:g} mm") from None


def _targets(specimen: Specimen, name: str) -> tuple[str, ...]:
    """List the numbers that a tolerance acts on; it is empty where the specimen has none."""
    known, film = varying(specimen), "membrane."
    electrode = specimen.electrode
    if name in ("frame", "plate"):
        within = "frame." if name == "frame" else "plate.outline."
        lengths = tuple(path for path in known if path.startswith(within)
                        and _is_length(specimen, path))
        return lengths if len(lengths) <= _MOST_LENGTHS else ()
    targets = {"thickness": (f"{film}thickness",), "stiffness": (STIFFNESS,),
               "permittivity": (f"{film}relative_permittivity",),
               "prestretch": (f"{film}prestretch.0", f"{film}prestretch.1"),
               "offset": ("plate.offset.0", "plate.offset.1") if specimen.plate else (),
               "gradient": (f"{film}thickness_gradient.0", f"{film}thickness_gradient.1"),
               "margin": tuple(f"electrode.{edge}" for edge in ("margin_frame", "margin_plate")
                               if getattr(electrode, edge) > 0)}
    return targets.get(name, (name,))


def _unmirrored(specimen: Specimen, targets: tuple[str, ...]) -> tuple[str, ...]:
    """Select the numbers along x or y, by their last key, in which the film is no mirror image."""
    return tuple(path for path in targets
                 if "xy"[int(path[-1])] not in specimen.mirror_planes)


def _is_length(specimen: Specimen, path: str) -> bool:
    field = field_at(specimen, tuple(path.split(".")))
    return field is not None and field.says.dimension == "length"


def _defaults(specimen: Specimen) -> dict[str, tuple[Any, str, str]]:
    """Find the default scatter of each number, or None; its source and reason."""
    name, most = material_name(specimen.membrane), _OF_GAP * specimen.gap
    known = MATERIALS[name].scatter if name is not None else None
    of_film = dict[str, tuple[Any, str, str]]()
    for key in ("thickness", "stiffness", "permittivity"):
        size = None if known is None else getattr(known, key)
        of_film[key] = (None, "library", f"the library has no source for this film; give [{key}]")
        if known is not None and size is not None:
            words = " ".join(known.source.split())
            of_film[key] = Scatter(batch=size), f"library, {name}", words
    cut = LengthScatter(film=min(1e-4, most))
    return of_film | {
        "prestretch": (Scatter(film=0.01), "assumed", "1 mm of marks 100 mm apart, set by hand"),
        "frame": (cut, "assumed", "cut or milled to 0.2 mm, as two standard deviations"),
        "plate": (cut, "assumed", "cut or milled to 0.2 mm, as two standard deviations"),
        "offset": (LengthScatter(film=min(2.5e-4, most)), "assumed", f"placed in a jig to 0.5 mm, "
                   f"as two standard deviations; {_BY_SQUARE.format('offset')}"),
        "gradient": (ShareScatter(film=0.02), "assumed", "makers of cast films and tapes state 5 "
                     "to 10 % of a whole roll, and no source says what is left across a frame; "
                     + _BY_SQUARE.format("gradient")),
        "margin": (LengthScatter(film=min(5e-4, most)), "assumed",
                   "brushed along a mask to 1 mm, as two standard deviations"),
        "load": (Scatter(film=0.005), "assumed", "0.1 g of 20 g"),
        "amplifier": (Scatter(batch=0.01), "assumed",
                      "gain known to 2 %, as two standard deviations; one amplifier drives a "
                      "batch"),
        STRENGTH: (StrengthScatter(shape=_SHAPE_ASSUMED), "assumed",
                   "Weibull's shape 10, as no source with numbers was found")}
