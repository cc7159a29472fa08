"""Capacitance of a film whose plate is displaced, and what can be told of the deflection by it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import Failure, InputError
from tympan.base.fields import Key, asks
from tympan.base.toml_reader import Rule
from tympan.fem.derivatives.quantities import named_functional
from tympan.fem.derivatives.sensitivity import gradient_many, parameters
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import held
from tympan.fem.results.fields import film_integrals
from tympan.fem.rig import MASSES, VOLTAGES, Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, build_model, solve_grid
from tympan.studies.force.follow import Followed, at_displacement
from tympan.studies.force.force import ForceCase, followed_curves, left_out
from tympan.studies.limits.loads import usual_masses
from tympan.studies.sense.inverse import Sampled, fit_inverse
from tympan.studies.sense.result import SenseCurve, SensedState, SenseResult

#: Rows of the table of each voltage where their number is not given.
USUAL_POINTS = 21
_COUNTS: Rule = (lambda x: 5 <= x <= 1000, "must be a whole number from 5 to 1000")

#: How much further than the loads' largest deflection curves go where no end is given.
_ROOM = 1.1
#: Voltages at which the first deflection is solved, by Chebyshev's points of their square.
_FIRSTS = 12
#: Fewest rows that a curve must have.
_FEWEST = 5

#: Share of prestretch and permittivity whose effect is told.
_PERCENT = 0.01
_PRESTRETCH = ("membrane.prestretch.0", "membrane.prestretch.1")
_PERMITTIVITY = "membrane.relative_permittivity"
#: Slope of the capacitance, over it and by the film's size, below which it is one of rounding.
_FLAT = 1e-9


@asks
@dataclass(frozen=True)
class SenseCase:
    """A specimen whose capacitance tells its deflection, at nominal voltages [V].

    Deflections are those from ``start`` to ``to`` [m]; without ``to`` a little further than the
    ``masses`` [kg] deflect the plate, and without these further than usual ones do.
    """

    specimen: Specimen
    _: KW_ONLY
    voltages: Annotated[tuple[float, ...], Key("nominal voltages", "voltage", VOLTAGES)] = (0.0,)
    masses: Annotated[tuple[float, ...], Key("loads on the plate", "mass", MASSES,
                                             name="mass")] = ()
    start: Annotated[float, Key("first deflection", "length", name="from")] = 0.0
    to: Annotated[float | None, Key("last deflection", "length")] = None
    points: Annotated[int, Key("rows of the table of each voltage", rule=_COUNTS)] = USUAL_POINTS
    rig: Rig = Rig()

    if TYPE_CHECKING:
        def __init__(self, specimen: Specimen, *, voltages: Sequence[float | str] = ...,
                     masses: Sequence[float | str] = ..., start: float | str = ...,
                     to: float | str | None = ..., points: int = ..., rig: Rig = ...) -> None: ...

    def __post_init__(self) -> None:
        self.specimen.needed_plate()


def sense(case: SenseCase, settings: Settings,
          progress: Callable[[str], None] = lambda words: None) -> SenseResult:
    """Displace the plate at each voltage; fit and judge what tells the deflection."""
    began = time.perf_counter()
    specimen, rig, voltages = case.specimen, case.rig, sorted(case.voltages)
    masses = case.masses or (usual_masses(specimen, settings, rig) if case.to is None else ())
    states = _states(case, settings, masses) if masses else []
    # Where nothing weighs on the film itself, it is above its plane as it is below.
    even = not (rig.gas_pressure or any(rig.weight_offset) or specimen.membrane.density
                or specimen.electrode.mass)
    to = case.to
    if to is None:
        if not states:
            raise InputError("must be given: under these loads and voltages there is no "
                             "equilibrium", key="to", given="none")
        to = _ROOM * max(abs(result[2]) if even else result[2] for result in states)
    # A curve between the two highest voltages judges the polynomial.
    between = [float(np.sqrt(np.mean(np.square(voltages[-2:]))))] if len(voltages) > 1 else []
    displaced = ForceCase(specimen, voltages=(*voltages, *between), start=case.start, to=to,
                     points=2 * case.points - 1, rig=rig)
    model = build_model(specimen, settings, replace(rig.loading, biases=()))
    path = settings.bounded(model, loads=len(displaced.voltages)).path
    every = {curve.voltage: curve for curve in followed_curves(displaced, model, path, progress)}
    stored = {voltage: curve.curve for voltage, curve in every.items() if curve.states}
    rising = {voltage: _rising(np.array(curve.displacement_m), np.array(curve.capacitance_F))
              for voltage, curve in stored.items()}
    lost = [voltage for voltage in voltages if voltage not in rising
            or rising[voltage].stop - rising[voltage].start < 2 * _FEWEST - 1]
    if lost:
        raise InputError("must be a voltage at which the capacitance rises with the deflection, or "
                         "the film ends before it does", key="voltage", given=f"{lost[0]:g} V")
    first = max(rising[voltage].start for voltage in voltages)
    # Even, so that the rows of the table are those that are fitted.
    first += first % 2
    sampled = {voltage: Sampled(voltage, np.array(stored[voltage].displacement_m)[first:end.stop],
                                np.array(stored[voltage].capacitance_F)[first:end.stop])
               for voltage, end in rising.items()}
    given = [sampled[voltage] for voltage in voltages]
    place = float(given[0].deflection[0])
    firsts = [Sampled(voltage, np.array([place]), np.array([capacitance]))
              for voltage, capacitance in _firsts(every[voltages[0]], place, voltages, rig, path)]
    inverse = fit_inverse(given, [sampled[voltage] for voltage in between if voltage in sampled],
                          firsts)
    curves = tuple(_curve(every[each.voltage], each, first) for each in given)
    warnings = list(left_out(displaced))
    highest = min((deflection for _, _, deflection, _ in states), default=0.0)
    mirrored = even and place == 0 and highest < 0
    if mirrored:
        warnings.append(f"the plate rests up to {-1e3 * highest:.4g} mm above the flat film: "
                        "the capacitance there is that of the same distance below, and does not "
                        "tell on which side the plate is")
    if first:
        warnings.append(f"the capacitance rises from {1e3 * given[0].deflection[0]:.4g} mm on: "
                        "below that it does not tell the deflection")
    return SenseResult(
        specimen=specimen.name, curves=curves, inverse=inverse,
        table_error_m=max(map(_between_rows, given)),
        states=tuple(SensedState(
            mass_kg=mass, voltage_V=voltage, displacement_m=deflection, capacitance_F=capacitance,
            sensed_m=None if np.isnan(told) else np.copysign(told, deflection).item()
            if mirrored else told)
            for mass, voltage, deflection, capacitance in states
            for told in [float(inverse.deflection(capacitance, voltage))]),
        dofs=model.unknowns, wall_s=time.perf_counter() - began,
        warnings=(*warnings, *Case.greatest(specimen, masses, voltages, rig).remarks))


def _states(case: SenseCase, settings: Settings, masses: Sequence[float]
            ) -> list[tuple[float, float, float, float]]:
    """Mass, voltage, deflection of the plate and capacitance of every equilibrium."""
    model = build_model(case.specimen, settings, case.rig.loading)
    path = settings.bounded(model, loads=len(masses) * len(case.voltages)).path
    return [(result.mass_kg, result.voltage_V, model.deflection(outcome.state),
             result.capacitance_F)
            for result, outcome in solve_grid(model, masses, sorted(case.voltages), case.rig, path)
            if outcome.status == "equilibrium" and result.capacitance_F is not None]


def _firsts(curve: Followed, place: float, voltages: Sequence[float], rig: Rig, path: PathSettings
            ) -> Iterator[tuple[float, float]]:
    """Capacitances of the first deflection from the lowest to the highest voltage, ascending."""
    solution = at_displacement(curve, place, path)
    low, high = voltages[0] ** 2, voltages[-1] ** 2
    if solution is None or low == high:
        return
    nodes = low + (high - low) * (1 - np.cos(np.pi * (np.arange(_FIRSTS) + 0.5) / _FIRSTS)) / 2
    for voltage in np.sqrt(nodes).tolist():
        outcome = held(curve.model, place, float(rig.film_voltage(voltage)), solution, path)
        if outcome.status != "equilibrium":
            return
        solution = outcome.solution
        yield voltage, float(film_integrals(curve.model, [solution.state])[1][0])


def _rising(deflection: Array, capacitance: Array) -> slice:
    """The points from the least capacitance to where it no longer rises."""
    first = int(np.argmin(capacitance))
    falls = np.flatnonzero(np.diff(capacitance[first:]) <= 0)
    return slice(first, first + int(falls[0]) + 1 if len(falls) else len(deflection))


def _curve(followed: Followed, sampled: Sampled, first: int) -> SenseCurve:
    """Every other point of a curve, from its first on, with what moves the sensed deflection."""
    curve = followed.curve
    rows = range(first, first + len(sampled.deflection), 2)
    moved = [_moved(followed, row) for row in rows]
    return SenseCurve(
        voltage_V=curve.voltage_V, displacement_m=tuple(curve.displacement_m[row] for row in rows),
        capacitance_F=tuple(curve.capacitance_F[row] for row in rows),
        force_N=tuple(curve.force_N[row] for row in rows),
        tense=tuple(curve.tense[row] for row in rows),
        per_capacitance_m_per_F=tuple(each[0] for each in moved),
        per_percent_prestretch_m=tuple(each[1] for each in moved),
        per_percent_permittivity_m=tuple(each[2] for each in moved), ended=curve.ended)


def _moved(followed: Followed, row: int) -> tuple[float | None, float | None, float | None]:
    """Change of the sensed deflection by capacitance, by 1 % of prestretch and of permittivity.

    A plate that is held keeps its deflection while a film changes: derivatives under a force are
    made those at a deflection by that of the force.
    """
    model, state = followed.model, followed.states[row]
    names = (*_PRESTRETCH, _PERMITTIVITY, "force")
    by = parameters(model, names)
    functionals = {name: named_functional(name) for name in ("heave", "capacitance")}
    slopes = gradient_many(model, state, functionals, by)
    heave, capacitance = slopes["heave"], slopes["capacitance"]
    if not heave["force"]:
        raise Failure("the force on the plate does not move it")
    rise = capacitance["force"] / heave["force"]
    # Where the film is flat nothing but rounding is left.
    scale = float(followed.curve.capacitance_F[row]) / model.size
    if rise <= _FLAT * scale:
        return None, None, None

    def share(name: str) -> float:
        alone = capacitance[name] - rise * heave[name]
        return _PERCENT * alone * by[name].value(model, state)

    return (1 / rise, sum(map(share, _PRESTRETCH)) / rise, share(_PERMITTIVITY) / rise)


def _between_rows(curve: Sampled) -> float:
    """Largest error of the table between its rows."""
    root = np.sqrt(np.maximum(curve.capacitance / curve.capacitance[0] - 1, 0.0))
    known = np.interp(root, root[::2], curve.deflection[::2])
    last = len(root) - (len(root) + 1) % 2
    return float(np.abs(known - curve.deflection)[:last].max())
