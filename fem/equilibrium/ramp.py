"""Equilibria under load and voltage: adaptive ramps, and what lies at their end when there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from tympan.fem.equilibrium.arc_length import ArcSettings, Branch, Point
from tympan.fem.equilibrium.constraints import Heave, difference, length
from tympan.fem.equilibrium.newton import (
    STRAINED,
    NewtonSettings,
    Prediction,
    Solution,
    moved,
    newton,
)
from tympan.fem.equilibrium.subspace import Motions, SmoothMotions
from tympan.fem.equilibrium.tangent import EVERY, Tangent
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.plate import HEAVE
from tympan.fem.membrane.state import Load, State

#: A natural step may miss its prediction by a share of its motion, and its end's rate must explain
#: a share of it, but for motions that are small beside the frame. A film stiffening with the cube
#: of its motion has 1/3 of it explained.
_SURPRISE, _EXPLAINED, _UNNOTICED = 0.6, 0.2, 1e-4

Status = Literal["equilibrium", "no_equilibrium", "not_converged"]

_WRINKLED = ("the film has lost tension: it would wrinkle before the load is reached, and what it does then depends on "
             "the mesh")
_UNFOLLOWED = "the path could not be followed: the film has lost tension and would wrinkle, or strains without bound"

_WORDS: dict[Load, str] = {"force": "load", "voltage": "voltage", "pressure": "pressure"}


@dataclass(frozen=True)
class PathSettings:
    """Steps of a ramp.

    ``first``: first step as a share of the ramp; ``handover``: step, relative to the load or U²
    reached, below which the ramp is followed by its arc length instead; ``shortest``: step of a
    held plate at which to give up; ``reach``: heave, relative to the frame's half extent, at which
    a search for equilibrium ends; ``smooth``: numbers of waves around the plate, and degrees
    between plate and frame, of smooth motions tried in turn where the film has lost tension,
    ``annular`` those degrees where it is axisymmetric; ``unbalanced``: nodal force that these may
    leave at a limit point, relative to the largest, if the mesh is to resolve it; ``agreement``:
    load, or U², relative to itself, by which limits that it does not resolve may differ between two
    kinds of smooth motions, and must be exceeded.
    """

    newton: NewtonSettings = field(default_factory=NewtonSettings)
    arc: ArcSettings = field(default_factory=ArcSettings)
    first: float = 1.0
    handover: float = 1e-2
    shortest: float = 2e-4
    reach: float = 1.5
    smooth: tuple[tuple[int, int], ...] = ((4, 14), (6, 6), (4, 10), (2, 14))
    annular: tuple[int, ...] = (14, 10, 20)
    unbalanced: float = 1e-2
    agreement: float = 2e-2

    def motions(self, model: Model) -> Iterator[SmoothMotions]:
        """The smooth motions of a model: without waves where it is axisymmetric."""
        kinds = [(0, degree) for degree in self.annular] if model.axisymmetric else self.smooth
        return (SmoothMotions.of(model, *kind) for kind in kinds)


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a search for an equilibrium ended.

    ``solution`` is the equilibrium, or the last one before the ramp ended. With status
    "no_equilibrium" the film pulled in: ``limit`` is the largest U² [V²], force [N] or pressure
    [Pa], as ``limited`` says, that has an equilibrium on this path, and ``critical`` the point of
    the branch where it has it. ``spread``: where the mesh does not resolve that, how far the limits
    found with other smooth motions are from it, relative.
    """

    status: Status
    solution: Solution
    advice: str = ""
    limit: float | None = None
    limited: Load | None = None
    critical: Point | None = None
    spread: float = 0.0

    @property
    def state(self) -> State:
        """The state of the solution."""
        return self.solution.state


def equilibrium(model: Model, force: float, voltage: float, pressure: float = 0.0,
                start: Solution | None = None,
                settings: PathSettings = PathSettings()) -> Outcome:
    """The equilibrium under a force on the plate, a gas pressure and a voltage across the film.

    Parameters
    ----------
    force
        On the plate along the load [N].
    voltage
        Across the film [V].
    pressure
        Of the gas below film and plate [Pa], pushing them along the load.
    start
        A converged solution to start from; by default the flat mounted film, loaded first and then
        charged.

    Returns
    -------
    Outcome
        "equilibrium" is stable under these loads and connected to the start without passing a limit
        point.
    """
    solution = start or _first(model, settings)
    outcome = Outcome("equilibrium" if solution.converged else "not_converged", solution,
                      solution.advice)
    targets: dict[Load, float] = {"force": force, "pressure": pressure, "voltage": voltage**2}
    # A film mounted slack starts pushed out by a force, which it may lose only once the gas holds
    # it.
    pushed = start is None and solution.state.force != 0
    order: tuple[Load, ...] = ("pressure", "force", "voltage") if pushed else ("force", "pressure",
                                                                               "voltage")
    for load in order:
        if outcome.status == "equilibrium":
            outcome = ramp(model, outcome.solution, load, targets[load], settings)
    return outcome


def _first(model: Model, settings: PathSettings) -> Solution:
    """The flat mounted film; or, where that is not taut, the film with the plate already pushed out.

    An unstressed flat membrane has no stiffness across its plane, so its load path cannot start
    there.
    """
    flat = newton(model, model.mounted(), settings=settings.newton)
    if flat.converged and flat.stable and model.in_tension(flat.state):
        return flat
    if HEAVE not in model.plate_freedoms:
        return replace(flat, converged=False,
                       advice="the film is slack when mounted, and its plate cannot move")
    x, y, _ = model.discretisation.reference.T
    to_frame, to_plate = np.abs(model.specimen.frame.level(x,
                                                           y)), np.abs(model.specimen.plate.level(x,
                                                                                                  y))
    heave = 0.2 * model.size
    positions = model.discretisation.reference.copy()
    positions[:, 2] = heave * to_frame / (to_frame + to_plate)
    pushed = replace(flat.state, positions=positions, plate=flat.state.plate.raised_to(heave))
    found = newton(model, pushed, ("force",), (Heave(heave),), settings.newton)
    if found.converged and found.state.force > 0:
        return found
    advice = "the film is slack when mounted, and still when the plate is pushed out"
    return replace(found, converged=False, advice=advice)


def voltage_path(model: Model, force: float, voltages: list[float], pressure: float = 0.0,
                 settings: PathSettings = PathSettings()) -> Iterator[Outcome]:
    """Equilibria at voltages [V] under one force, each started from the last one found.

    Voltages at or above one that has no equilibrium have none either and are not searched.
    """
    outcome: Outcome | None = None
    start: Solution | None = None
    failed = np.inf
    for voltage in voltages:
        if outcome is None or voltage < failed:
            outcome = equilibrium(model, force, voltage, pressure, start, settings)
            if outcome.status == "equilibrium":
                start = outcome.solution
            else:
                failed = voltage
        yield outcome


def held(model: Model, heave: float, voltage: float = 0.0, start: Solution | None = None,
         settings: PathSettings = PathSettings()) -> Outcome:
    """The film with the plate held at a heave [m] and a voltage [V]; ``state.force`` is what holds it [N]."""
    solution = start or newton(model, model.mounted(), ("force",), (Heave(0.0),),
                               settings.newton)
    origin, charge = solution.state.plate.heave, solution.state.voltage_squared
    advice = solution.advice
    done, step = (0.0, 1.0) if (heave, voltage**2) != (origin, charge) else (1.0, 0.0)
    while solution.converged and done < 1:
        share = min(1.0, done + step)
        target = origin + share * (heave - origin)
        guess = _lifted(model, solution,
                        target).under(voltage=charge + share * (voltage**2 - charge))
        solution.release()
        trial = newton(model, guess, ("force",), (Heave(target),), settings.newton)
        if trial.converged:
            solution, done, step = trial, share, 2 * step
        elif (step := step / 2) < settings.shortest:
            advice = trial.advice
            break
    return Outcome("equilibrium" if done == 1 else "not_converged", solution, advice)


def _lifted(model: Model, solution: Solution, heave: float) -> State:
    """Predictor for another heave, the force following."""
    tangent = solution.tangent
    assert tangent is not None
    if tangent.free != ("force",):
        return solution.state
    inner, border = tangent.along()
    change = heave - solution.state.plate.heave
    return moved(model, solution.state, (change * inner, change * border), tangent.free)


def ramp(model: Model, start: Solution, load: Load, target: float,
         settings: PathSettings = PathSettings()) -> Outcome:
    """Change one load to a target in steps as long as Newton converges to a stable state; then by arc length."""
    origin = start.state.load(load)
    if target == origin:
        return Outcome("equilibrium", start)
    solution, done, step = start, 0.0, settings.first
    taut = start
    already = abs(origin / (target - origin))
    ahead = Prediction.of(model, solution, load)
    while done < 1:
        share = min(1.0, done + step)
        guess = ahead.at(origin + share * (target - origin))
        solution.release()
        trial = newton(model, guess, settings=settings.newton)
        onward = Prediction.of(model, trial, load) if trial.converged and trial.stable else None
        if onward is not None and _foreseen(ahead, guess, onward):
            solution, done, step, ahead = trial, share, 2 * step, onward
            taut = trial if model.in_tension(trial.state) else taut
            continue
        trial.release()
        if (step := step / 2) < max(settings.handover * (already + done), 1e-12):
            outcome = _followed(model, solution, taut, load, target, settings)
            locked = outcome.status == "not_converged" and trial.advice.startswith(STRAINED)
            return replace(outcome,
                           advice=f"{STRAINED} before the {_WORDS[load]} is reached") if locked else outcome
    return Outcome("equilibrium", solution)


def _foreseen(ahead: Prediction, guess: State, onward: Prediction) -> bool:
    """Whether a step ended near enough to its prediction, and explains its motion, to have passed no limit points.

    Up to a limit point the motion grows like a square root, to at most twice the prediction, and
    ever faster. A plate that snapped to another branch went further than the predictions from
    either end say.
    """
    model, found, origin = onward.model, onward.origin, ahead.origin
    back = onward.at(origin.load(ahead.load))
    missed, gone, explained = (length(model, difference(model, found, state))
                               for state in (guess, origin, back))
    return missed <= _SURPRISE * gone + _UNNOTICED and explained >= _EXPLAINED * gone - _UNNOTICED


def _followed(model: Model, start: Solution, taut: Solution, load: Load, target: float,
              settings: PathSettings
              ) -> Outcome:
    """By arc length: with all motions while the film resists them, then with smooth ones that cannot wrinkle.

    ``taut`` is the last solution before ``start`` whose film is in tension everywhere.
    """
    outcome = Outcome("not_converged", start)
    wrinkles = _wrinkling(start) > 0
    start.release()
    if not wrinkles:
        outcome = _along(model, start, load, target, settings, EVERY)
        taut = outcome.solution
    if outcome.status != "not_converged":
        return outcome
    found: list[Outcome] = []
    advice, reached = "", False
    for motions in settings.motions(model):
        # From a state with wrinkles, however few, the smooth motions would go on along a branch
        # that has them.
        trial = _along(model, taut, load, target, settings, motions)
        if trial.status == "no_equilibrium":
            found.append(trial)
            trial = _assured(model, found, load, target, settings, reached)
        if trial.status != "not_converged":
            return trial
        reached |= trial.advice == _WRINKLED
        advice = trial.advice if not advice or advice == _UNFOLLOWED else advice
    return replace(outcome, advice=advice)


def _assured(model: Model, found: list[Outcome], load: Load, target: float, settings: PathSettings,
             reached: bool
             ) -> Outcome:
    """The last of the pull-ins found with different smooth motions: if the mesh resolves it, or another one is alike.

    Where it does not, the limit is the motions' as much as the film's: two kinds must find the
    same, short of the target by more than they may differ, and none before may have ``reached`` it.
    """
    *before, last = found
    if _left(model, last) < settings.unbalanced:
        return last
    for other in before:
        limits = np.array([_limit(other), _limit(last)])
        alike = np.ptp(limits) < settings.agreement * np.abs(limits).max()
        if alike and not reached and (np.abs(target - limits) > settings.agreement
                                      * np.abs(limits)).all():
            best = min(other, last, key=lambda one: _left(model, one))
            return replace(best, spread=max(abs(_limit(one) / _limit(best) - 1) for one in found))
    return Outcome("not_converged", last.solution,
                   f"the film has lost tension: short of the {_WORDS[load]} it pulls "
                   "in or wrinkles, and which depends on the mesh; a finer one may tell")


def _left(model: Model, found: Outcome) -> float:
    assert found.critical is not None
    return model.unbalanced(found.critical.state)


def _limit(found: Outcome) -> float:
    assert found.limit is not None
    return found.limit


def branch_points(model: Model, start: State, load: Load, settings: PathSettings = PathSettings()
                  ) -> Iterator[tuple[Branch, Point]]:
    """Points of the branch from an equilibrium on, one load growing at first, each with the branch it was found on.

    With all motions until the film, its plate held, has a direction without stiffness, which in a
    membrane means that it wrinkles; from there with smooth motions.
    """
    last, sense = start, 1
    branch = Branch(model, load, newton=settings.newton, arc=settings.arc)
    for point in branch.points(start):
        if _tangent_of(point).wrinkling:
            break
        yield branch, point
        last, sense = point.state, 1 if point.rate >= 0 else -1
    for motions in settings.motions(model):
        smooth = replace(branch, motions=motions)
        points = smooth.points(last, sense)
        # The first point is the last one again, by smooth motions.
        if next(points, None) is not None and (first := next(points, None)) is not None:
            yield smooth, first
            yield from ((smooth, point) for point in points)
            return


def _along(model: Model, start: Solution, load: Load, target: float, settings: PathSettings,
           motions: Motions
           ) -> Outcome:
    """To where the branch reaches the target, where it turns back (pull-in), or where it cannot be followed."""
    branch = Branch(model, load, motions=motions, newton=settings.newton, arc=settings.arc)
    sense = 1 if target >= start.state.load(load) else -1
    stable = start
    for before, after in pairwise(branch.points(start.state, sense)):
        if motions is EVERY and _tangent_of(after).wrinkling:
            break
        if sense * after.rate < 0:
            critical = branch.limit(before, after)
            if critical is None:
                break
            if sense * critical.state.load(load) < sense * target:
                return _pulled_in(stable, load, critical)
            after = critical  # the target is before it, if not before the point after it
        if sense * after.state.load(load) >= sense * target:
            reached = branch.reach(before, after, target)
            return _landed(model, stable, reached, load, target, settings)
        # Where the film by itself resists no more, the plate's stiffness passes a pole: its sign
        # tells nothing.
        if not after.solution.stable and _tangent_of(after).wrinkling == 0:
            return _pulled_in(stable, load, after, "loses its stability")
        if after.state.plate.heave > settings.reach * model.size:
            break
        if motions is EVERY:
            stable = after.solution
    return Outcome("not_converged", stable, _UNFOLLOWED)


def _landed(model: Model, stable: Solution, reached: Point | None, load: Load, target: float,
            settings: PathSettings
            ) -> Outcome:
    """The equilibrium at the target, of all motions, from the point of the branch that reaches it."""
    if reached is not None:
        reached.solution.release()
        found = newton(model, reached.state.under(**{load: target}), settings=settings.newton)
        if found.converged and found.stable:
            return Outcome("equilibrium", found)
        stable = replace(stable, advice=found.advice)
    return Outcome("not_converged", stable, _WRINKLED)


def _pulled_in(last: Solution, load: Load, critical: Point, verb: str = "pulls in") -> Outcome:
    return Outcome("no_equilibrium", last, f"the film {verb} before the {_WORDS[load]} is reached",
                   critical.state.load(load), load, critical)


def _wrinkling(solution: Solution) -> int:
    return 0 if solution.tangent is None else solution.tangent.wrinkling


def _tangent_of(point: Point) -> Tangent:
    assert point.solution.tangent is not None
    return point.solution.tangent
