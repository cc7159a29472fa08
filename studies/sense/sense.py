"""Capacitance of a film with displaced plate, and the deflection determined from it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import Failure, InputError
from tympan.base.fields import Key, asks
from tympan.base.progress import Progress
from tympan.base.toml_reader import Rule, one_of
from tympan.fem.derivatives.quantities import named_functional
from tympan.fem.derivatives.sensitivity import gradient_many, parameters
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.model import Model
from tympan.fem.results.segments import segment_capacitances
from tympan.fem.rig import MASS_RULE, VOLTAGE_RULE, Rig, Supply
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, build_models, solve_grid
from tympan.studies.driven import in_proportion, require_different
from tympan.studies.force.follow import FollowedForce, at_displacement
from tympan.studies.force.force import ROOM, ForceCase, followed_curves, left_out
from tympan.studies.limits.loads import usual_masses
from tympan.studies.segments import Driven
from tympan.studies.sense.inverse import Inverse, SampledCurve, fit_inverse
from tympan.studies.sense.plate import LEAST, PlateSense, plate_sense
from tympan.studies.sense.result import SenseCurve, SensedState, SenseResult

#: Rows of the table of each voltage by default.
USUAL_POINTS = 21
#: Standard deviation of a capacitance over it: a good bridge at the speed of a control loop.
USUAL_NOISE = 1e-3
_NOISE: Rule = (lambda x: 0 < x <= 0.1, "must be above 0 and at most 0.1")
_TILT: Rule = (lambda x: 1e-6 <= x <= 0.5, "must be from 0.001 mrad to 500 mrad")
_COUNTS: Rule = (lambda x: 5 <= x <= 1000, "must be a whole number from 5 to 1000")

#: Number of voltages at which the first deflection is solved, by Chebyshev's points of the square.
_FIRSTS = 12
#: Least number of rows of a curve.
_FEWEST = 5

#: Relative change of prestretch and permittivity whose effect is listed.
_PERCENT = 0.01
_PRESTRETCH = ("membrane.prestretch.0", "membrane.prestretch.1")
_PERMITTIVITY = "membrane.relative_permittivity"
#: Slope of the capacitance, over it and by the film's size, below which it is rounding.
_FLAT = 1e-9


@asks
@dataclass(frozen=True)
class SenseCase:
    """A specimen whose capacitance determines its deflection, at nominal voltages [V].

    Voltages of the segments of an electrode by name, ``segment_voltages``, are a set for each of
    the ``voltages``. Deflections are those from ``start`` to ``to`` [m]; without ``to`` a little
    further than the ``masses`` [kg] deflect the plate, and without these further than typical ones
    do.
    """

    specimen: Specimen
    _: KW_ONLY
    voltages: Annotated[tuple[float, ...], Key("nominal voltages", "voltage", VOLTAGE_RULE)] = (
        0.0,)
    segment_voltages: tuple[Mapping[str, float], ...] = ()
    masses: Annotated[tuple[float, ...], Key("loads on the plate", "mass", MASS_RULE,
                                             name="mass")] = ()
    start: Annotated[float, Key("first deflection", "length", name="from")] = 0.0
    to: Annotated[float | None, Key("last deflection", "length")] = None
    points: Annotated[int, Key("rows of the table of each voltage", rule=_COUNTS)] = USUAL_POINTS
    sensing: Annotated[tuple[str, ...], Key(
        "segments whose capacitances give deflection and tilts of the plate; three at least",
        default="all of three or more")] = ()
    tilt: Annotated[float | None, Key(
        "largest tilt along x and y that they sense", "angle", _TILT,
        default="one that moves the plate's edge by a tenth of the last deflection")] = None
    noise: Annotated[float | None, Key(
        "standard deviation of the capacitance of a segment, over it", rule=_NOISE,
        default="0.001")] = None
    rig: Rig = Rig()

    if TYPE_CHECKING:
        def __init__(self, specimen: Specimen, *, voltages: Sequence[float | str] = ...,
                     segment_voltages: Sequence[Mapping[str, float]] = ...,
                     masses: Sequence[float | str] = ..., start: float | str = ...,
                     to: float | str | None = ..., points: int = ...,
                     sensing: Sequence[str] = ..., tilt: float | str | None = ...,
                     noise: float | None = ..., rig: Rig = ...) -> None: ...

    def __post_init__(self) -> None:
        self.specimen.needed_plate()
        require_different(self.voltages, self.segment_voltages)
        in_proportion(self.specimen, self.voltages, self.segment_voltages)  # known names
        if not self.sensing:
            return
        known = self.specimen.electrode.names
        for name in self.sensing:
            if name not in known:
                raise InputError(one_of(name, dict.fromkeys(known)) if known else
                                 "must be left out: the electrode has no segments", key="sensing",
                                 given=name)
        if len({*self.sensing}) < LEAST or len({*self.sensing}) < len(self.sensing):
            raise InputError("must be three different segments at least: deflection and two tilts "
                             "are three numbers", key="sensing", given=", ".join(self.sensing))
        if self.rig.guide != "free":
            raise InputError("must be left out: the guide keeps the plate from tilting",
                             key="sensing", given=", ".join(self.sensing))

    @property
    def films(self) -> list[tuple[Specimen, tuple[float, ...]]]:
        """Specimens with the shares of each proportion of voltages, and their voltages [V]."""
        return in_proportion(self.specimen, self.voltages, self.segment_voltages)

    @property
    def steps(self) -> int:
        """Number of times that :func:`sense` reports progress."""
        return sum(len(voltages) * (1 + bool(self.readers)) + (len(voltages) > 1)
                   for _, voltages in self.films)

    @property
    def readers(self) -> tuple[str, ...]:
        """Segments whose capacitances are read; none where they do not give the plate's tilts."""
        names = self.sensing or self.specimen.electrode.names
        return names if len(names) >= LEAST and self.rig.guide == "free" else ()


def sense(case: SenseCase, settings: Settings,
          progress: Progress = lambda words: None) -> SenseResult:
    """Displace the plate at each voltage; fit and test the deflection from capacitance.

    There is one inverse for each proportion of the segments' voltages.
    """
    began = time.perf_counter()
    specimen, rig = case.specimen, case.rig
    masses = case.masses or (usual_masses(specimen, settings, rig) if case.to is None else ())
    states = _states(case, settings, masses)
    # Where nothing weighs on the film itself, states above its plane mirror those below.
    even = not (rig.gas_pressure or any(rig.weight_offset) or specimen.membrane.density
                or specimen.electrode.mass)
    displaced = ForceCase(specimen, voltages=case.voltages, segment_voltages=case.segment_voltages,
                          start=case.start, points=2 * case.points - 1, rig=rig,
                          to=_last_deflection(case, [*chain(*states)], even))
    models = build_models([film for film, _ in case.films], settings,
                          replace(rig.loading, biases=()))
    path = settings.bounded(models[0], loads=len(case.voltages)).path
    parts = [_fitted(displaced, model, voltages, path, progress)
             for model, (_, voltages) in zip(models, case.films, strict=True)]
    place = min(part.place for part in parts)
    highest = min((state.displacement_m for state in chain(*states)), default=0.0)
    mirrored = even and place == 0 and highest < 0
    plates = list(_plates(case, settings, displaced.last, progress))
    starts = [part.place for part in parts if part.first]
    ambiguous = _ambiguous(highest if mirrored else None, max(starts, default=None))
    sensed = [_sensed(state, part.inverse, mirrored)
              for part, several in zip(parts, states, strict=True) for state in several]
    return SenseResult(
        specimen=specimen.name, inverse=parts[0].inverse,
        other_inverses=tuple(part.inverse for part in parts[1:]),
        table_error_m=max(part.table_error for part in parts),
        curves=tuple(sorted(chain(*(part.curves for part in parts)), key=_voltage)),
        states=tuple(sorted(sensed, key=lambda state: (masses.index(state.mass_kg),
                                                       state.voltage_V))),
        plates=tuple(sorted((plate for plate in plates if plate is not None), key=_voltage)),
        dofs=models[0].unknowns, wall_s=time.perf_counter() - began,
        warnings=(*left_out(displaced), *ambiguous, *_unsensed(plates),
                  *Case.greatest(specimen, masses, case.voltages, rig).remarks))


def _voltage(part: Driven) -> float:
    return part.voltage_V


@dataclass(frozen=True, eq=False)
class _Part:
    """Film sensed in one proportion of its segments' voltages.

    Its curves begin at their row ``first``, of a deflection ``place`` [m].
    """

    curves: list[SenseCurve]
    inverse: Inverse
    table_error: float
    first: int
    place: float


def _fitted(case: ForceCase, model: Model, voltages: Sequence[float], path: PathSettings,
            progress: Progress) -> _Part:
    """Displace a film's plate at its voltages, and fit the deflection from capacitance."""
    # A curve between the two highest voltages tests the polynomial.
    middle = float(np.sqrt(np.mean(np.square(voltages[-2:]))))
    between = [middle] if len(voltages) > 1 else []
    alone = replace(case, specimen=model.specimen, voltages=(*voltages, *between),
                    segment_voltages=())
    every = {curve.voltage: curve for curve in followed_curves(alone, [model], path, progress)}
    first, sampled = _sampled(every, voltages)
    given = [sampled[voltage] for voltage in voltages]
    place = float(given[0].deflection[0])
    firsts = [SampledCurve(voltage, np.array([place]), np.array([capacitance])) for
              voltage, capacitance in _firsts(every[voltages[0]], place, voltages, case.rig, path)]
    tests = [sampled[voltage] for voltage in between if voltage in sampled]
    inverse = replace(fit_inverse(given, tests, firsts),
                      segment_shares=model.specimen.electrode.voltages(1.0))
    return _Part([_curve(every[each.voltage], each, first) for each in given], inverse,
                 max(map(_between_rows, given)), first, place)


def _plates(case: SenseCase, settings: Settings, last: float, progress: Progress
            ) -> Iterator[PlateSense | None]:
    """Sense deflection and tilts at each voltage; None where the film cannot be held so far."""
    films = case.films if case.readers else ()
    for film, voltage in ((film, voltage) for film, voltages in films for voltage in voltages):
        driven = Driven(voltage_V=voltage, segment_voltages_V=film.electrode.voltages(voltage))
        progress(f"{film.name}: tilts at {driven.drive}")
        yield plate_sense(film, settings, case.rig.loading, voltage,
                          float(case.rig.film_voltage(voltage)), (case.start, last), case.tilt,
                          USUAL_NOISE if case.noise is None else case.noise, case.readers)


def _unsensed(plates: Sequence[PlateSense | None]) -> Iterator[str]:
    if any(plate is None for plate in plates):
        yield ("at some voltages the film cannot be held at all deflections and tilts of the range "
               "with one inverse: ask for less of them (--to, --tilt)")


def _last_deflection(case: SenseCase, states: Sequence[SensedState], even: bool) -> float:
    """Choose the last deflection [m] of curves: the given one, or a little beyond the states."""
    if case.to is not None:
        return case.to
    if not states:
        raise InputError("must be given: under these loads and voltages there is no "
                         "equilibrium", key="to", given="none")
    deflections = [state.displacement_m for state in states]
    return ROOM * max(map(abs, deflections) if even else deflections)


def _sampled(every: Mapping[float, FollowedForce], voltages: Sequence[float]
             ) -> tuple[int, dict[float, SampledCurve]]:
    """Sample curves, by voltage, where the capacitance rises, from a first index in common."""
    stored = {voltage: curve.curve for voltage, curve in every.items() if curve.states}
    rising = {voltage: _rising(np.array(curve.displacement_m), np.array(curve.capacitance_F))
              for voltage, curve in stored.items()}
    lost = [voltage for voltage in voltages if voltage not in rising
            or rising[voltage].stop - rising[voltage].start < 2 * _FEWEST - 1]
    if lost:
        raise InputError("must be a voltage at which the capacitance rises with the deflection, or "
                         "the film ends before it does", key="voltage", given=f"{lost[0]:g} V")
    first = max(rising[voltage].start for voltage in voltages)
    # The first index is even, so that the rows of the table are those that are fitted.
    first += first % 2
    sampled = {}
    for voltage, part in rising.items():
        deflection = np.array(stored[voltage].displacement_m)[first:part.stop]
        capacitance = np.array(stored[voltage].capacitance_F)[first:part.stop]
        sampled[voltage] = SampledCurve(voltage, deflection, capacitance)
    return first, sampled


def _ambiguous(highest: float | None, first: float | None) -> Iterator[str]:
    """Warn of deflections [m] with the same capacitance: up to ``highest``, and below ``first``."""
    if highest is not None:
        yield (f"the plate rests up to {-1e3 * highest:.4g} mm above the flat film: "
               "the capacitance there is that of the same distance below, and does not "
               "tell on which side the plate is")
    if first is not None:
        yield (f"the capacitance rises from {1e3 * first:.4g} mm on: "
               "below that it does not tell the deflection")


def _sensed(state: SensedState, inverse: Inverse, mirrored: bool) -> SensedState:
    """Add the deflection that the polynomial gives for a state; ``mirrored``: with its sign."""
    sensed = float(inverse.deflection(state.capacitance_F, state.voltage_V))
    if np.isnan(sensed):
        return state
    if mirrored:
        sensed = float(np.copysign(sensed, state.displacement_m))
    return replace(state, sensed_m=sensed)


def _states(case: SenseCase, settings: Settings, masses: Sequence[float]
            ) -> list[list[SensedState]]:
    """List every equilibrium of each film under the masses [kg], not yet sensed."""
    films = case.films
    models = build_models([film for film, _ in films], settings, case.rig.loading)
    path = settings.bounded(models[0], loads=len(masses) * len(case.voltages)).path
    return [[SensedState(mass_kg=result.mass_kg, voltage_V=result.voltage_V, sensed_m=None,
                         segment_voltages_V=film.electrode.voltages(result.voltage_V),
                         displacement_m=model.deflection(outcome.state),
                         capacitance_F=result.capacitance_F)
             for result, outcome in solve_grid(model, masses, voltages, case.rig, path)
             if outcome.status == "equilibrium" and result.capacitance_F is not None]
            for model, (film, voltages) in zip(models, films, strict=True)]


def _firsts(curve: FollowedForce, place: float, voltages: Sequence[float],
            supply: Supply, path: PathSettings) -> Iterator[tuple[float, float]]:
    """Solve the first deflection's capacitance from the lowest to the highest voltage."""
    solution = at_displacement(curve, place, path)
    low, high = voltages[0] ** 2, voltages[-1] ** 2
    if solution is None or low == high:
        return
    angles = np.pi * (np.arange(_FIRSTS) + 0.5) / _FIRSTS
    squared = low + (high - low) * (1 - np.cos(angles)) / 2
    for voltage in np.sqrt(squared).tolist():
        outcome = held(curve.model, place, float(supply.film_voltage(voltage)), solution, path)
        if outcome.status != "equilibrium":
            return
        solution = outcome.solution
        yield voltage, float(curve.model.integrals([solution.state])[1][0])


def _rising(deflection: Array, capacitance: Array) -> slice:
    """Select the points from the least capacitance to where it no longer rises."""
    first = int(np.argmin(capacitance))
    falls = np.flatnonzero(np.diff(capacitance[first:]) <= 0)
    return slice(first, first + int(falls[0]) + 1 if len(falls) else len(deflection))


def _curve(followed: FollowedForce, sampled: SampledCurve, first: int) -> SenseCurve:
    """Select every other point of a curve, with the causes that shift the sensed deflection."""
    curve = followed.curve
    rows = range(first, first + len(sampled.deflection), 2)
    moved = [_moved(followed, row) for row in rows]
    model = followed.model
    names = model.specimen.electrode.names if model.meshed else ()
    alone = segment_capacitances(model, [followed.states[row] for row in rows])
    return SenseCurve(
        voltage_V=curve.voltage_V, segment_voltages_V=curve.segment_voltages_V,
        displacement_m=tuple(curve.displacement_m[row] for row in rows),
        capacitance_F=tuple(curve.capacitance_F[row] for row in rows),
        force_N=tuple(curve.force_N[row] for row in rows),
        tense=tuple(curve.tense[row] for row in rows),
        per_capacitance_m_per_F=tuple(each[0] for each in moved),
        per_percent_prestretch_m=tuple(each[1] for each in moved),
        per_percent_permittivity_m=tuple(each[2] for each in moved), ended=curve.ended,
        segment_capacitances_F={name: tuple(values) for name, values in zip(
            names, alone.T.tolist(), strict=bool(names))})


def _moved(followed: FollowedForce, row: int) -> tuple[float | None, float | None, float | None]:
    """Compute the change of the sensed deflection by capacitance, 1 % prestretch, 1 % permittivity.

    A held plate keeps its deflection while a film changes: derivatives under a force become those
    at a deflection by the derivative by the force.
    """
    model, state = followed.model, followed.states[row]
    names = (*_PRESTRETCH, _PERMITTIVITY, "force")
    by = parameters(model, names)
    functionals = {name: named_functional(name) for name in ("heave", "capacitance")}
    slopes = gradient_many(model, state, functionals, by)
    deflection, capacitance = slopes["heave"], slopes["capacitance"]
    if not deflection["force"]:
        raise Failure("the force on the plate does not move it")
    rise = capacitance["force"] / deflection["force"]
    # Where the film is flat only rounding is left.
    scale = float(followed.curve.capacitance_F[row]) / model.size
    if rise <= _FLAT * scale:
        return None, None, None

    def share(name: str) -> float:
        alone = capacitance[name] - rise * deflection[name]
        return _PERCENT * alone * by[name].value(model, state)

    return (1 / rise, sum(map(share, _PRESTRETCH)) / rise, share(_PERMITTIVITY) / rise)


def _between_rows(curve: SampledCurve) -> float:
    """Find the largest error of the table between its rows."""
    root = np.sqrt(np.maximum(curve.capacitance / curve.capacitance[0] - 1, 0.0))
    known = np.interp(root, root[::2], curve.deflection[::2])
    last = len(root) - (len(root) + 1) % 2
    return float(np.abs(known - curve.deflection)[:last].max())
