"""Force on the plate against its displacement: a curve for each voltage, and loads on them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key, asks, changed
from tympan.base.progress import Progress
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.base.units import drive_words
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import still_slack
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.model import Model
from tympan.fem.rig import MASS_RULE, VOLTAGE_RULE, Rig, Tester
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, build_models, solve_grid, solved_loading
from tympan.studies.driven import in_proportion, require_different
from tympan.studies.force.cycle import load_line
from tympan.studies.force.follow import FollowedForce, at_displacement, follow
from tympan.studies.force.loops import HeldMotion, loop
from tympan.studies.force.result import NOT_FOLLOWED, ForceLimit, ForceLoop, ForceResult

#: Default number of displacements of a curve, for a smooth line.
USUAL_POINTS = 61
#: Factor by which curves exceed the loads' largest deflection where no end is given.
ROOM = 1.1
#: Last displacement of a plate without loads, over its gap: usual loads deflect it by a tenth.
_FAR = 0.3
_COUNTS: Rule = (lambda x: 2 <= x <= 10_000, "must be a whole number from 2 to 10000")
_CYCLES: Rule = (lambda x: 1 <= x <= 1000, "must be a whole number from 1 to 1000")


@asks
@dataclass(frozen=True)
class ForceCase:
    """A specimen whose plate is displaced from ``start`` to ``to`` [m], at each voltage [V].

    Voltages of the segments of an electrode by name, ``segment_voltages``, are a set for each of
    the ``voltages``. ``masses`` [kg] are loads whose equilibria are found. Without ``to`` the last
    displacement is a little beyond these, or 0.3 of the gap. With a ``rate`` [m/s] the plate also
    moves out and back in time. Values may be texts with a unit.
    """

    specimen: Specimen
    _: KW_ONLY
    voltages: Annotated[tuple[float, ...], Key("nominal voltages", "voltage", VOLTAGE_RULE)] = (
        0.0,)
    segment_voltages: tuple[Mapping[str, float], ...] = ()
    start: Annotated[float, Key("first displacement", "length", name="from")] = 0.0
    to: Annotated[float | None, Key("last displacement", "length",
                                    default="a little beyond where the loads rest, or "
                                            "0.3 of the gap")] = None
    points: Annotated[int, Key("number of displacements", rule=_COUNTS)] = USUAL_POINTS
    masses: Annotated[tuple[float, ...], Key("loads on the plate", "mass", MASS_RULE,
                                             name="mass")] = ()
    rate: Annotated[float | None, Key("speed of the plate in loops; without it there are none",
                                      "speed", POSITIVE)] = None
    cycles: Annotated[int, Key("number of loops", rule=_CYCLES)] = 1
    rig: Rig = Rig()

    if TYPE_CHECKING:
        def __init__(self, specimen: Specimen, *, voltages: Sequence[float | str] = ...,
                     segment_voltages: Sequence[Mapping[str, float]] = ...,
                     start: float | str = ..., to: float | str | None = ...,
                     points: int = ...,
                     masses: Sequence[float | str] = ..., rate: float | str | None = ...,
                     cycles: int = ..., rig: Rig = ...) -> None: ...

    def __post_init__(self) -> None:
        self.specimen.needed_plate()
        if self.rig.guide == "fixed":
            raise InputError("must let the plate move: it is to be displaced", key="rig.guide",
                             given=self.rig.guide)
        if not self.voltages:
            raise InputError("must have one voltage at least", key="voltage", given="none")
        require_different(self.voltages, self.segment_voltages)
        if len(set(self.masses)) < len(self.masses):
            raise InputError("must differ from each other", key="mass",
                             given=", ".join(f"{value:g}" for value in self.masses))
        in_proportion(self.specimen, self.voltages, self.segment_voltages)  # known names
        most = PathSettings().reach * max(self.specimen.frame.semi_axes)
        for name, place in (("from", self.start), ("to", self.to)):
            if place is not None and not abs(place) <= most:
                raise InputError(f"must be within ±{1e3 * most:.4g} mm, 1.5 times the frame's half "
                                 "extent", key=name, given=f"{1e3 * place:g} mm")
        if self.to is not None and not self.start < self.to:
            raise InputError(f"must be above the first displacement, {1e3 * self.start:g} mm",
                             key="to", given=f"{1e3 * self.to:g} mm")

    @property
    def last(self) -> float:
        """Last displacement [m], which :func:`displaced` chooses where none is given."""
        if self.to is None:
            raise InputError("must be given: under these loads and voltages there is no "
                             "equilibrium", key="to")
        return self.to

    @property
    def films(self) -> list[tuple[Specimen, tuple[float, ...]]]:
        """Specimens with the shares of each proportion of voltages, and their voltages [V]."""
        return in_proportion(self.specimen, self.voltages, self.segment_voltages)

    @property
    def displacements(self) -> list[float]:
        """Displacements of the plate [m]; the first and the last are exact."""
        places: list[float] = np.linspace(self.start, self.last, self.points).tolist()
        return places


def displaced(case: ForceCase, settings: Settings) -> ForceCase:
    """Choose the last displacement where none is given: a little beyond where loads come to rest.

    Without loads it is a share of the gap between plate and frame.
    """
    if case.to is not None:
        return case
    if not case.masses:
        return replace(case, to=case.start + _FAR * case.specimen.gap)
    films = case.films
    models = build_models([film for film, _ in films], settings, case.rig.loading)
    path = settings.bounded(models[0], loads=len(case.masses) * len(case.voltages)).path
    rests = [model.deflection(outcome.state)
             for model, (_, voltages) in zip(models, films, strict=True)
             for _, outcome in solve_grid(model, case.masses, voltages, case.rig, path)
             if outcome.status == "equilibrium"]
    farthest = ROOM * max(rests, default=-inf)
    return replace(case, to=farthest if farthest > case.start else None)


def force(case: ForceCase, settings: Settings,
          progress: Progress = lambda words: None) -> ForceResult:
    """Displace the plate at each voltage, and put loads on it.

    ``progress`` is called before each voltage. The tester holds the plate's deflection: the film's
    own curve passes every limit point of load and voltage. Mechanisms of the rig between plate and
    ground belong to the load.
    """
    began = time.perf_counter()
    case = displaced(case, settings)
    rig, specimen = case.rig, case.specimen
    alone = build_models([film for film, _ in case.films], settings,
                         replace(rig.loading, biases=()))
    settings = settings.bounded(alone[0], loads=max(len(case.voltages), 1))
    path = settings.path
    curves = followed_curves(case, alone, path, progress)
    lines, short = [], dict[str, str]()
    if case.masses or rig.loading.biases:
        loading = solved_loading(rig.loading, settings)
        lines = [load_line(loading, rig, mass, curves, case.displacements, path)
                 for mass in case.masses or (0.0,)]
        short = {law: f'the mechanism "{law}" of the rig has no force at {1e3 * place:.4g} mm: '
                      "load lines end before, and nothing is extrapolated"
                 for place in (case.start, case.last) for law in loading.ended(place)}
    first = lines[0] if lines else None
    held_at, blocked = _blocked(curves, None if first is None else first.reached_at(
        curves[0].voltage, curves[0].segment_voltages), path)
    loops = [] if case.rate is None else [
        _loop(case, curve, progress) for curve in curves if curve.states]
    highest = Case.greatest(specimen, case.masses, case.voltages, rig)
    return ForceResult(
        specimen=specimen.name, curves=tuple(curve.curve for curve in curves), loads=tuple(lines),
        loops=tuple(loops),
        stroke_m=first.stroke_m if first else None, work_J=first.work_J if first else None,
        blocked_force_N=blocked, blocked_displacement_m=held_at, dofs=alone[0].unknowns,
        wall_s=time.perf_counter() - began, warnings=(
            *left_out(case), *short.values(), *highest.remarks))


def followed_curves(case: ForceCase, models: Sequence[Model], path: PathSettings,
                    progress: Progress) -> list[FollowedForce]:
    """Follow the curve at each voltage, ascending; ``models`` are those of the case's films."""
    curves = [curve for model, (_, voltages) in zip(models, case.films, strict=True)
              for curve in _followed(case, model, voltages, path, progress)]
    return sorted(curves, key=lambda curve: curve.voltage)


def _followed(case: ForceCase, model: Model, voltages: Sequence[float], path: PathSettings,
              progress: Progress) -> Iterator[FollowedForce]:
    """Follow the curve at each voltage; each starts from the start of the one before."""
    displacements = case.displacements
    start: Solution | None = None
    for voltage in voltages:
        driven = drive_words(model.specimen.electrode.voltages(voltage))
        progress(f"{case.specimen.name}: {driven or f'{voltage / 1e3:g} kV'}")
        film_voltage = float(case.rig.film_voltage(voltage))
        outcome = held(model, case.start, 0.0 if start is None else film_voltage, start, path,
                       case.rig.gas_pressure)
        if start is None:
            _require_start(case, model, outcome.status == "equilibrium", outcome.solution)
            outcome = held(model, case.start, film_voltage, outcome.solution, path)
        if outcome.status != "equilibrium":
            state = outcome.state
            yield FollowedForce(model, voltage, ended=ForceLimit(
                kind=NOT_FOLLOWED, displacement_m=model.deflection(state), force_N=state.force))
            continue
        start = outcome.solution
        yield follow(model, voltage, displacements, start, path)


def _loop(case: ForceCase, curve: FollowedForce, progress: Progress) -> ForceLoop:
    assert case.rate is not None
    progress(f"{case.specimen.name}: {curve.voltage / 1e3:g} kV in time")
    motion = HeldMotion(case.start, case.last, case.rate, case.cycles, case.points)
    return loop(curve.model, curve.voltage, curve.states[0], motion)


def left_out(case: ForceCase) -> list[str]:
    """List in words the parts of the rig and the film that these curves neglect."""
    words = [f"{key} of the rig acts against the way and is left out here"
             for key in case.rig.hysteresis]
    words += [f"{field.name} of the rig is left out: these curves are of a tester without errors"
              for field in changed(case.rig, Tester)]
    if case.specimen.membrane.branches and case.rate is None:
        words.append("the viscous branches are relaxed in these curves, as after a long wait; "
                     "--rate moves the plate in time (in Python rate=)")
    if case.rate is not None and case.rig.series_resistance:
        words.append("series_resistance of the rig is left out: in loops the film keeps its "
                     "voltage")
    return words


def _require_start(case: ForceCase, model: Model, found: bool, solution: Solution) -> None:
    """Raise InputError if the film has no definite shape at the first displacement."""
    if found and not still_slack(model, solution.state):
        return
    why = ("the film is slack there: it has no definite shape; prestretch it, or begin further out"
           if model.slack_when_mounted else f"no equilibrium was found there: {solution.advice}")
    raise InputError(f"must be where a curve can begin: {why}", key="from",
                     given=f"{1e3 * case.start:g} mm")


def blocked_force(model: Model, rest: Solution, voltage: float, path: PathSettings
                  ) -> float | None:
    """Compute the decrease of the force that holds a plate [N] under a film voltage [V].

    The plate is held at its deflection at ``rest``, under its load without voltage. None if the
    state with voltage is not found.
    """
    outcome = held(model, model.deflection(rest.state), voltage, rest, path)
    if outcome.status != "equilibrium":
        return None
    return float(rest.state.force - outcome.state.force)


def _blocked(curves: Sequence[FollowedForce], rest: float | None, path: PathSettings
             ) -> tuple[float | None, float | None]:
    """Find the held plate's place [m] and the force's decrease from first to last curve [N]."""
    first, last = curves[0], curves[-1]
    common = min(len(first.states), len(last.states))
    if first is last or not common:
        return None, None
    if rest is not None:
        ends = [at_displacement(curve, rest, path) for curve in (first, last)]
        if ends[0] is not None and ends[1] is not None:
            return rest, ends[0].state.force - ends[1].state.force
    same = np.isclose(first.displacement[:common], last.displacement[:common], rtol=0, atol=1e-12)
    falls = np.where(same, first.force[:common] - last.force[:common], -np.inf)
    largest = int(np.argmax(falls))
    return float(first.displacement[largest]), float(falls[largest])
