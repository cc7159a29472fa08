"""Map of the plate's deflection and tilts over the voltages of an electrode's segments.

Every combination of the voltages is an equilibrium of one film. They are solved by a family of
reduced films (:mod:`tympan.studies.films.family`) whose box has the segments' shares of the
highest voltage; a sweep of specimens that differ in these shares uses the same family. Equilibria
that it cannot guarantee are solved by finite elements as long as they are few.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from itertools import pairwise, product
from math import prod
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.process.threads import one_thread
from tympan.fem.results.limit_states import BREAKDOWN, TENSION
from tympan.fem.rig import OWN, Rig, mounted
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, SpecimenRecord, UnknownCount, WallTime, Warnings
from tympan.studies.columns import write_rows
from tympan.studies.driven import voltages_by_name
from tympan.studies.films.box import Box, share_path
from tympan.studies.films.family import FamilySettings, FilmFamily
from tympan.studies.films.population import FilmGrid, Population
from tympan.studies.films.states import FilmStates
from tympan.studies.limits.voltages import first_limit
from tympan.studies.sweep.reduced import UNSTABLE, unsure
from tympan.studies.sweep.task import BY_ELEMENTS, BY_REDUCED, SweepTask, solver
from tympan.studies.variables import variables_of

#: Settings of the family. Its films differ in voltages alone, and its shapes contain the responses
#: to all of them: few films are enough. Errors of its deflections are then below 3e-5, those of
#: its tilts below 2e-4 of the largest one.
_FAMILY = FamilySettings(error=1e-4, rounds=3, candidates=64, checks=16)
#: Most combinations of voltages; a larger number is a typing error.
_MOST = 250_000
#: Combinations that are solved where no voltage is given, at most.
_USUAL = 2500
#: Share of the first limit, all segments driven, up to which voltages then are.
_UP_TO = 0.8
#: Largest error of a deflection, and of a slope over the largest tilt, of a row by reduced films.
_ALLOWED = 1e-3
#: Most equilibria that finite elements solve in place of the family.
_BY_ELEMENTS = 60
#: Parts of each range of voltages over which one estimate of the error, the largest, is used.
_CELLS = 12
#: Combinations that are estimated together at most.
_ESTIMATED = 600
#: Number of directions in which the largest tilt is listed.
DIRECTIONS = 24
#: Number of bands of the deflection for which these are listed.
_BANDS = 5

#: Columns of the map, in the order in which they are stored; each is a variable of a state.
_SHOWN = ("deflection_m", "tilt_x_rad", "tilt_y_rad", "shift_x_m", "shift_y_m", "least_stress_Pa",
          "breakdown_margin")


@dataclass(frozen=True)
class SteerCase:
    """A specimen with segments, their ``voltages`` by name, nominal [V], and the mass [kg].

    A segment with one voltage keeps it; one without a voltage has none. Without ``voltages`` all
    segments go from 0 to a part of the film's first limit.
    """

    specimen: Specimen
    _: KW_ONLY
    voltages: Any = None
    mass: float = 0.0
    rig: Rig = OWN
    values: Mapping[str, tuple[float, ...]] = field(init=False)

    def __post_init__(self) -> None:
        specimen, rig = mounted(self.specimen, self.rig)
        object.__setattr__(self, "specimen", specimen)
        object.__setattr__(self, "rig", rig)
        names = specimen.electrode.names
        if not names:
            raise InputError("must have segments, [[electrode.segment]]: one electrode moves the "
                             "plate along one line, which tympan curve draws", key="electrode",
                             given="one electrode")
        specimen.needed_plate()
        given = {} if self.voltages is None else voltages_by_name(self.voltages, "voltage",
                                                                          shares=False)
        specimen.electrode.driven({name: max(values) for name, values in given.items()})
        for name, values in given.items():
            if min(values) < 0 or list(values) != sorted(set(values)):
                raise InputError("must ascend from 0 or more", key=f"voltage {name}",
                                 given=", ".join(f"{value:g} V" for value in values))
        object.__setattr__(self, "values", {
            name: given.get(name, (0.0,)) for name in names} if given else {})

    def ranged(self, settings: Settings) -> Mapping[str, tuple[float, ...]]:
        """List the voltages by segment; without any, those up to a part of the first limit."""
        values = self.values
        if not values:
            names = self.specimen.electrode.names
            electrode, _ = self.specimen.electrode.driven(dict.fromkeys(names, 1.0))
            film = replace(self.specimen, electrode=electrode)
            limit = first_limit(Case(film, mass=self.mass, rig=self.rig), settings)
            if limit is None:
                raise InputError("must be given: the film has no first limit", key="voltage")
            count = max(2, int(_USUAL ** (1 / len(names)) + 1e-9))
            spread = tuple(np.linspace(0.0, _UP_TO * limit.voltage_V, count).tolist())
            values = dict.fromkeys(names, spread)
        if prod(map(len, values.values())) > _MOST:
            raise InputError(f"must be at most {_MOST} combinations", key="voltage",
                             given=prod(map(len, values.values())))
        if not any(len(each) > 1 for each in values.values()):
            raise InputError("must have several values for at least one segment, such as "
                             '"A = 0 kV..4 kV in 11, B = 0 kV"', key="voltage",
                             given=str(self.voltages))
        return values


@dataclass(frozen=True, kw_only=True)
class SegmentVoltages:
    """Voltages of a segment in a map."""

    name: Annotated[str, Key("name of the segment")]
    voltage_V: Annotated[tuple[float, ...], Key("its nominal voltages, ascending; all combinations "
                                                "with those of the others are rows")]


@dataclass(frozen=True, kw_only=True)
class ReachedTilts:
    """Largest tilts of the plate while its deflection is within a band."""

    from_m: Annotated[float, Key("least deflection of the band")]
    to_m: Annotated[float, Key("largest deflection of the band")]
    tilt_rad: Annotated[tuple[float | None, ...], Key(
        "largest slope along each direction; none where no film of the band is in tension and "
        "below its strength")]


@dataclass(frozen=True, kw_only=True)
class SteerResult(SpecimenRecord):
    """Deflection and tilts of a plate over the voltages of its film's segments, SI.

    Lists have a number for each row. The last segment's voltage changes first.
    """

    ending = "-steer"
    writer = "tympan steer"
    kinds = ("csv", "json")
    drawn = ("png", "svg")

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    segments: Annotated[tuple[SegmentVoltages, ...], Key("segments in their order")]
    deflection_m: Annotated[tuple[float | None, ...], Key("deflection of each row")]
    tilt_x_rad: Annotated[tuple[float | None, ...], Key("slope of the plate along x")]
    tilt_y_rad: Annotated[tuple[float | None, ...], Key("slope of the plate along y")]
    shift_x_m: Annotated[tuple[float | None, ...], Key("motion of its centre along x")]
    shift_y_m: Annotated[tuple[float | None, ...], Key("motion of its centre along y")]
    least_stress_Pa: Annotated[tuple[float | None, ...], Key("smallest principal true stress")]
    breakdown_margin: Annotated[tuple[float | None, ...], Key(
        "smallest strength over field; none without voltage or a strength law")]
    deflection_error_m: Annotated[tuple[float | None, ...], Key(
        "error of the deflection; none by finite elements")]
    tilt_error_rad: Annotated[tuple[float | None, ...], Key(
        "error of both slopes; none by finite elements")]
    holds: Annotated[tuple[bool, ...], Key(
        "whether the film is in tension and below its electric strength")]
    ended: Annotated[tuple[str, ...], Key("limit that a row is beyond, and its segment")]
    by: Annotated[tuple[str, ...], Key("what solved a row: reduced, finite elements, or nothing")]
    why: Annotated[tuple[str, ...], Key("why no reduced film solved it")]
    directions_rad: Annotated[tuple[float, ...], Key("directions of the largest tilts, from x")]
    reached: Annotated[tuple[ReachedTilts, ...], Key(
        "largest tilts, by bands of the deflection; the first is of all deflections")]
    family_s: Annotated[float, Key("time to make the family of reduced films")]
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings = ()

    @property
    def voltages(self) -> dict[str, AnyArray]:
        """Voltage of each segment in every row [V], by its name."""
        grid = np.meshgrid(*(each.voltage_V for each in self.segments), indexing="ij")
        return {each.name: values.ravel()
                for each, values in zip(self.segments, grid, strict=True)}

    def values(self, name: str) -> AnyArray:
        """Collect the numbers of a list, nan where there is none, (rows,)."""
        return np.array([np.nan if value is None else value for value in getattr(self, name)])

    @property
    def rows(self) -> dict[str, AnyArray]:
        """A row for each combination of voltages."""
        rows: dict[str, AnyArray] = {
            f"voltage_{name}_V": values for name, values in self.voltages.items()}
        rows |= {name: self.values(name)
                 for name in (*_SHOWN, "deflection_error_m", "tilt_error_rad", "holds")}
        texts = {name: np.array(getattr(self, name), dtype=object)
                 for name in ("ended", "by", "why")}
        return rows | texts

    @property
    def solved_by(self) -> dict[str, int]:
        """Number of rows by what solved them."""
        return dict(Counter(word or "without a solution" for word in self.by))

    @property
    def ends(self) -> dict[str, int]:
        """Number of rows beyond each limit, with the segment where it begins."""
        return dict(Counter(word for word in self.ended if word))

    @property
    def largest_tilt_rad(self) -> float:
        """Largest tilt of all films in tension and below their strength [rad]."""
        tilt = np.hypot(self.values("tilt_x_rad"), self.values("tilt_y_rad"))
        return float(tilt[np.array(self.holds)].max(initial=0.0))

    @property
    def largest_errors(self) -> tuple[float, float] | None:
        """Largest errors of deflections [m] and slopes [rad]; None if none is reduced."""
        errors = [self.values(name) for name in ("deflection_error_m", "tilt_error_rad")]
        known = [own[np.isfinite(own)] for own in errors]
        return (float(known[0].max()), float(known[1].max())) if len(known[0]) else None

    def largest_tilts(self, low: float = -np.inf, high: float = np.inf) -> AnyArray:
        """Find the largest slope along each direction [rad], of deflections in a range [m].

        The directions are ``directions_rad``; values are nan where no film of the range holds.
        """
        return _largest(self.values("deflection_m"), self.values("tilt_x_rad"),
                        self.values("tilt_y_rad"), np.array(self.holds),
                        np.array(self.directions_rad), low, high)

    def save(self, folder: Path) -> None:
        """Write ``NAME-steer.json`` and ``.csv``."""
        super().save(folder)
        write_rows(folder / f"{self.specimen}-steer.csv", self.rows)


@one_thread()
def steer(case: SteerCase, settings: Settings = Settings()) -> SteerResult:
    """Solve the equilibria of a film under all combinations of its segments' voltages.

    Raises
    ------
    InputError
        When no voltage varies, or no film of the ranges has an equilibrium in tension.
    """
    began = time.perf_counter()
    values = case.ranged(settings)
    volts = np.array([*product(*values.values())])
    family = steered_family(case, settings, values)
    made = time.perf_counter() - began
    rows = _Rows.of(case, family, _solved(case, family, values, volts))
    warnings = _by_others(case, settings, rows, volts)
    holds, largest = rows.holds, rows.largest_tilt
    if family.tilted > _ALLOWED * largest:
        warnings.append(f"tilts may be off by {1e3 * family.tilted:.2g} mrad, more than "
                        f"{_ALLOWED:g} of the largest one")
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    columns: dict[str, Any] = {name: _cells(column)
                               for name, column in (rows.shown | rows.errors).items()}
    return SteerResult(
        specimen=case.specimen.name, mass_kg=case.mass,
        segments=tuple(SegmentVoltages(name=name, voltage_V=each)
                       for name, each in values.items()),
        **columns,
        holds=tuple(holds.tolist()), ended=tuple(rows.ended.tolist()), by=tuple(rows.by.tolist()),
        why=tuple(rows.why.tolist()), directions_rad=tuple(angles.tolist()),
        reached=_reached(rows.shown, holds, angles), family_s=made,
        dofs=family.ground.model.unknowns, wall_s=time.perf_counter() - began,
        warnings=tuple(warnings))


def _solved(case: SteerCase, family: FilmFamily, values: Mapping[str, tuple[float, ...]],
            volts: AnyArray) -> FilmStates:
    """Solve all combinations of voltages [V], (rows, segments), by reduced films, with errors."""
    top = float(volts.max())
    counts = [len(each) for each in values.values()]
    shares = np.zeros((len(volts), 0)) if not family.box.names else _shares(
        case.rig, volts[:, np.array(counts) > 1], top)
    films = Population.alike(family, case.rig, shares)
    grid = FilmGrid(films, masses=np.full((len(shares), 1), case.mass),
                    voltages=np.full((len(shares), 1), top))
    states = family.states(shares, grid.forces, grid.across, check=False, loose=True)
    error, off = _errors(family, grid, states, [count for count in counts if count > 1])
    return replace(states, error=error, slope_error=off)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Columns of a map, whose rows others may fill in: each array is (rows,).

    ``shown``: variables of the states; ``errors`` of reduced films. ``ended``: the limit that a row
    is beyond. ``by``: what solved it. ``why``: why no reduced film did.
    """

    shown: dict[str, AnyArray]
    errors: dict[str, AnyArray]
    ended: AnyArray
    by: AnyArray
    why: AnyArray

    @classmethod
    def of(cls, case: SteerCase, family: FilmFamily, states: FilmStates) -> _Rows:
        """Collect the columns of reduced films."""
        why = unsure(states, _ALLOWED)[:, 0]
        if family.unstable:
            why[why == ""] = UNSTABLE
        every = variables_of(states, plate=True)
        return cls({name: every[name][:, 0].copy() for name in _SHOWN},
                   {"deflection_error_m": states.error[:, 0].copy(),
                    "tilt_error_rad": states.slope_error[:, 0].copy()},
                   _ended(case.specimen, states),
                   np.where(states.holds[:, 0], BY_REDUCED, "").astype(object), why)

    @property
    def missing(self) -> AnyArray:
        """Numbers of the rows that no reduced film solved."""
        return np.flatnonzero(self.why != "")

    @property
    def holds(self) -> AnyArray:
        """Whether each film is in tension and below its electric strength."""
        holds: AnyArray = np.isfinite(self.shown["deflection_m"]) & (self.ended == "")
        return holds

    @property
    def largest_tilt(self) -> float:
        """Largest tilt of the films that hold [rad]."""
        tilt = np.hypot(self.shown["tilt_x_rad"], self.shown["tilt_y_rad"])
        return float(tilt[self.holds].max(initial=0.0))

    def fill(self, row: int, record: Mapping[str, Any]) -> None:
        """Fill in a row by finite elements: its record in a sweep."""
        for name, column in self.shown.items():
            column[row] = np.nan if record[name] is None else record[name]
        for column in self.errors.values():
            column[row] = np.nan
        solved = record["status"] == "equilibrium"
        self.by[row] = BY_ELEMENTS
        self.ended[row] = self.ended[row] if solved else "no equilibrium"
        if solved and record["slack_share"] and not self.ended[row].startswith(TENSION.label):
            self.ended[row] = TENSION.label


def _by_others(case: SteerCase, settings: Settings, rows: _Rows, volts: AnyArray) -> list[str]:
    """Solve missing rows by finite elements if they are few; else warn."""
    missing = rows.missing
    if len(missing) <= _BY_ELEMENTS:
        for row in missing.tolist():
            rows.fill(row, _by_elements(case, settings, volts[row]))
        return []
    lost = missing[~np.isfinite(rows.shown["deflection_m"][missing])]
    rows.ended[lost] = np.where(rows.ended[lost] == "", "no reduced film", rows.ended[lost])
    return [f"{len(missing)} of {len(volts)} rows need finite elements, which are "
            f"used for {_BY_ELEMENTS} at most: {len(lost)} have no numbers, the others "
            "those of a reduced film without wrinkles, whose errors are larger than "
            'stated; the column "why" has the reason of each']


def steered_family(case: SteerCase, settings: Settings,
                   values: Mapping[str, tuple[float, ...]]) -> FilmFamily:
    """Make the family of reduced films of a map: its parameters are the shares that vary."""
    specimen, rig = case.specimen, case.rig
    top = max(each[-1] for each in values.values())
    ends = np.array([(each[0], each[-1]) for each in values.values()])
    low, high = _shares(rig, ends, top).T
    electrode = specimen.electrode.with_shares(high.tolist())
    varied = np.flatnonzero(low < high)
    box = Box(replace(specimen, electrode=electrode),
              tuple(share_path(number) for number in varied.tolist()), low[varied], high[varied])
    force = float(rig.rubbed(rig.force(case.mass, specimen.plate_area)))
    across = abs(float(rig.film_voltage(top)))
    return FilmFamily.over(box, (force, force), (across, across), rig, settings, _FAMILY)


def _shares(rig: Rig, volts: AnyArray, top: float) -> AnyArray:
    """Compute the voltages on the film over that of the highest, from nominal ones [V]."""
    return np.asarray(np.abs(rig.film_voltage(volts)) / abs(float(rig.film_voltage(top))))


def _errors(family: FilmFamily, grid: FilmGrid, states: FilmStates, counts: list[int]
            ) -> tuple[AnyArray, AnyArray]:
    """Estimate errors of deflections [m] and slopes [rad], (films, 1) each.

    The estimate varies slowly with the voltages. It is made at the corners of cells of the map, and
    each film has the largest relative one of its cell's corners.
    """
    cells = max(1, min(_CELLS, int(_ESTIMATED ** (1 / len(counts))) - 1))
    marks = [np.unique(np.linspace(0, count - 1, cells + 1).round().astype(int))
             for count in counts]
    numbers = np.arange(len(grid.films)).reshape(counts)
    some = numbers[np.ix_(*marks)]
    at = some.ravel()
    checked = family.states(grid.films.rows[at], grid.forces[at], grid.across[at])
    with np.errstate(invalid="ignore"):
        share = (checked.error / np.abs(checked.deflection)).reshape(some.shape)
    share = np.where(np.isfinite(share), share, np.nanmax(share, initial=0.0))
    for axis, own in enumerate(marks):
        below = np.clip(np.searchsorted(own, np.arange(counts[axis]), side="right") - 1, 0,
                        max(len(own) - 2, 0))
        share = np.maximum(share.take(below, axis),
                           share.take(np.minimum(below + 1, len(own) - 1), axis))
    error = share.reshape(-1, 1) * np.abs(states.deflection)
    return error, np.where(np.isfinite(error), family.tilted, np.nan)


def _ended(specimen: Specimen, states: FilmStates) -> AnyArray:
    """Say beyond which limit films are, and in which segment it begins, (films,); "" for none."""
    ended = np.full(len(states.holds), "", dtype=object)
    for state, beyond, place in ((TENSION, states.tension[:, 0] <= 0, states.loosest[:, 0]),
                                 (BREAKDOWN, states.breakdown[:, 0] >= 1, states.weakest[:, 0])):
        some = np.flatnonzero(beyond)
        names = np.array([*(f" in {name}" for name in specimen.electrode.names), " in bare film"])
        x, y = place[some].T
        found = specimen.electrode.segment_at(x, y, specimen.frame)
        ended[some] = [state.label + word for word in names[found]]
    return ended


def _by_elements(case: SteerCase, settings: Settings, volts: AnyArray) -> dict[str, Any]:
    """Solve one combination of voltages by finite elements: its row of a sweep."""
    names = case.specimen.electrode.names
    electrode, top = case.specimen.electrode.driven(dict(zip(names, volts.tolist(), strict=True)))
    task = SweepTask(replace(case.specimen, electrode=electrode), case.rig, (case.mass,), (top,),
                     settings, False, solver())
    return dict(task.run().rows[0])


def _reached(found: Mapping[str, AnyArray], holds: AnyArray, angles: AnyArray
             ) -> tuple[ReachedTilts, ...]:
    """List the largest tilts of all deflections, and of equal bands of them."""
    deflection = found["deflection_m"]
    if not holds.any():
        return ()
    low, high = float(deflection[holds].min()), float(deflection[holds].max())
    edges = np.linspace(low, high, _BANDS + 1).tolist()
    return tuple(ReachedTilts(from_m=start, to_m=end, tilt_rad=_cells(_largest(
        deflection, found["tilt_x_rad"], found["tilt_y_rad"], holds, angles, start, end)))
        for start, end in ((low, high), *pairwise(edges)))


def _largest(deflection: AnyArray, along_x: AnyArray, along_y: AnyArray, holds: AnyArray,
             angles: AnyArray, low: float, high: float) -> AnyArray:
    some = holds & (deflection >= low) & (deflection <= high)
    if not some.any():
        return np.full(len(angles), np.nan)
    slopes = (np.multiply.outer(np.cos(angles), along_x[some])
              + np.multiply.outer(np.sin(angles), along_y[some]))
    return np.asarray(slopes.max(1))


def _cells(values: AnyArray) -> tuple[float | None, ...]:
    """List numbers; None for nan."""
    return tuple(None if value != value else value for value in values.tolist())
