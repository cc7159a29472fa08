"""Equilibria under load and voltage: adaptive ramps, and what lies at their end if not one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from tympan.fem.equilibrium.arc_length import ArcSettings, Branch, PathPoint
from tympan.fem.equilibrium.constraints import difference, held_plate, length
from tympan.fem.equilibrium.newton import STRAINED, NewtonSettings, Solution, moved, newton
from tympan.fem.equilibrium.subspace import FULL, SmoothSubspace, Subspace
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, Load, State

#: A natural step may miss its prediction by a share of its motion, and its end's rate must explain
#: a share of it, but for motions that are small beside the frame. A film stiffening with the cube
#: of its motion has 1/3 of it explained.
_SURPRISE, _EXPLAINED, _UNNOTICED = 0.6, 0.2, 1e-4

#: How far the plate of a film that is slack when mounted is pushed out, relative to the frame's
#: half extent.
_PUSHED = 0.2

Status = Literal["equilibrium", "no_equilibrium", "not_converged"]

_WRINKLED = ("the film has lost tension: it would wrinkle before the load is reached, and what it "
             "does then depends on the mesh")
_UNFOLLOWED = ("the path could not be followed: the film has lost tension and would wrinkle, or "
               "strains without bound")


@dataclass(frozen=True)
class PathSettings:
    """Steps of a ramp.

    ``first``: first step as a share of the ramp; ``handover``: step, relative to the load or U²
    reached, below which the ramp is followed by its arc length instead; ``shortest``: step of a
    held plate at which to give up; ``reach``: deflection, relative to the frame's half extent, at
    which a search for equilibrium ends; ``smooth``: numbers of waves around the plate, and degrees
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

    def subspaces(self, model: Model) -> Iterator[SmoothSubspace]:
        """Smooth motions of a model: without waves where it is axisymmetric."""
        kinds = [(0, degree) for degree in self.annular] if model.axisymmetric else self.smooth
        return (SmoothSubspace.of(model, *kind) for kind in kinds)


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
    critical: PathPoint | None = None
    spread: float = 0.0

    @property
    def state(self) -> State:
        """The state of the solution."""
        return self.solution.state


def equilibrium(model: Model, force: float, voltage: float, pressure: float = 0.0,
                start: Solution | None = None,
                settings: PathSettings = PathSettings()) -> Outcome:
    """The equilibrium under a force on the plate [N], a voltage [V] and a gas pressure [Pa].

    Force and gas, which is below film and plate, push along the load. ``start`` is a converged
    solution; by default the flat mounted film, loaded first and then charged. An "equilibrium" is
    stable under these loads and connected to the start without passing a limit point.
    """
    solution = start or _first(model, settings)
    outcome = Outcome("equilibrium" if solution.converged else "not_converged", solution,
                      solution.advice)
    targets: dict[Load, float] = {"force": force, "pressure": pressure, "voltage": voltage**2}
    # A film mounted slack starts pushed out by a force, which it may lose only once the gas holds
    # it.
    pushed = start is None and solution.state.force != 0
    order: tuple[Load, ...] = ("force", "pressure", "voltage")
    for load in ("pressure", "force", "voltage") if pushed else order:
        if outcome.status == "equilibrium":
            outcome = Ramp(model, load, targets[load], settings).run(outcome.solution)
    return outcome


def _first(model: Model, settings: PathSettings) -> Solution:
    """The flat mounted film; or, where that is slack, the film with the plate pushed out.

    An unstressed flat membrane has no stiffness across its plane, so its load path cannot start
    there.
    """
    flat = newton(model, model.mounted(), settings=settings.newton)
    if flat.converged and flat.stable and model.in_tension(flat.state):
        return flat
    if HEAVE not in model.plate_freedoms:
        return replace(flat, converged=False,
                       advice="the film is slack when mounted, and its plate cannot move")
    # A cone from the frame to the lifted plate.
    cone, deflection = model.mounted(), _PUSHED * model.size
    x, y, _ = cone.positions.T
    to_frame, to_plate = (np.abs(edge.level(x, y))
                          for edge in (model.specimen.frame, model.specimen.plate))
    cone.positions[:, 2] = deflection * to_frame / (to_frame + to_plate)
    guess = replace(cone, plate=cone.plate.raised_to(deflection))
    solution = newton(model, guess, ("force",), (held_plate(deflection),), settings.newton)
    if solution.converged and solution.state.force > 0:
        return solution
    advice = "the film is slack when mounted, and still when the plate is pushed out"
    return replace(solution, converged=False, advice=advice)


def voltage_path(model: Model, force: float, voltages: list[float], pressure: float = 0.0,
                 settings: PathSettings = PathSettings()) -> Iterator[Outcome]:
    """Equilibria at voltages [V] under a force [N], each started from the last one found.

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


def held(model: Model, deflection: float, voltage: float = 0.0, start: Solution | None = None,
         settings: PathSettings = PathSettings()) -> Outcome:
    """The film under a voltage [V], its plate held at a deflection [m] by ``state.force`` [N]."""
    solution = start or newton(model, model.mounted(), ("force",), (held_plate(0.0),),
                               settings.newton)
    origin, squared = solution.state.plate.deflection, solution.state.voltage_squared
    advice = solution.advice
    done, step = (0.0, 1.0) if (deflection, voltage**2) != (origin, squared) else (1.0, 0.0)
    while solution.converged and done < 1:
        share = min(1.0, done + step)
        target = origin + share * (deflection - origin)
        guess, tangent = solution.state, solution.tangent
        if tangent is not None and tangent.free == ("force",):  # the force follows the deflection
            motion, loads = tangent.along()
            guess = moved(model, guess, motion, target - guess.plate.deflection, loads)
        guess = guess.under(voltage=squared + share * (voltage**2 - squared))
        solution.release()
        trial = newton(model, guess, ("force",), (held_plate(target),), settings.newton)
        if trial.converged:
            solution, done, step = trial, share, 2 * step
        elif (step := step / 2) < settings.shortest:
            advice = trial.advice
            break
    return Outcome("equilibrium" if done == 1 else "not_converged", solution, advice)


@dataclass(frozen=True)
class Ramp:
    """One load changed to a target under the others as they are."""

    model: Model
    load: Load
    target: float
    settings: PathSettings = field(default_factory=PathSettings)

    def run(self, start: Solution) -> Outcome:
        """In steps as long as Newton converges to a stable state; then by arc length."""
        origin = start.state.load(self.load)
        if self.target == origin:
            return Outcome("equilibrium", start)
        solution, in_tension, done, step = start, start, 0.0, self.settings.first
        before = abs(origin / (self.target - origin))
        while done < 1:
            share = min(1.0, done + step)
            guess = solution.predicted(self.model, self.load,
                                       origin + share * (self.target - origin))
            solution.release()
            trial = newton(self.model, guess, settings=self.settings.newton)
            if trial.converged and trial.stable and self._foreseen(solution, guess, trial):
                solution, done, step = trial, share, 2 * step
                in_tension = trial if self.model.in_tension(trial.state) else in_tension
                continue
            trial.release()
            if (step := step / 2) < max(self.settings.handover * (before + done), 1e-12):
                outcome = self._by_arc_length(solution, in_tension)
                if outcome.status == "not_converged" and trial.advice.startswith(STRAINED):
                    return replace(outcome, advice=f"{STRAINED} before the {self._word} is reached")
                return outcome
        return Outcome("equilibrium", solution)

    def _foreseen(self, last: Solution, guess: State, trial: Solution) -> bool:
        """Whether a step ended so near its prediction that it passed no limit points.

        Up to a limit point the motion grows like a square root, to at most twice the prediction,
        and ever faster. A plate that snapped to another branch went further than the predictions
        from either end say.
        """
        back = trial.predicted(self.model, self.load, last.state.load(self.load))
        missed, gone, explained = (length(self.model, difference(self.model, trial.state, state))
                                   for state in (guess, last.state, back))
        return (missed <= _SURPRISE * gone + _UNNOTICED
                and explained >= _EXPLAINED * gone - _UNNOTICED)

    def _by_arc_length(self, start: Solution, in_tension: Solution) -> Outcome:
        """With all motions while the film resists them, then with smooth ones that cannot wrinkle.

        ``in_tension``: the last solution up to ``start`` whose film is in tension everywhere.
        """
        outcome = Outcome("not_converged", start)
        wrinkles = start.wrinkling > 0
        start.release()
        if not wrinkles:
            outcome = self._along_branch(start, FULL)
            in_tension = outcome.solution
        if outcome.status != "not_converged":
            return outcome
        pull_ins: list[Outcome] = []
        advice, reached = "", False
        for subspace in self.settings.subspaces(self.model):
            # From a state with wrinkles, however few, the smooth motions would go on along a branch
            # that has them.
            trial = self._along_branch(in_tension, subspace)
            if trial.status == "no_equilibrium":
                pull_ins.append(trial)
                trial = self._confirmed(pull_ins, reached)
            if trial.status != "not_converged":
                return trial
            reached |= trial.advice == _WRINKLED
            advice = trial.advice if not advice or advice == _UNFOLLOWED else advice
        return replace(outcome, advice=advice)

    def _along_branch(self, start: Solution, subspace: Subspace) -> Outcome:
        """To where the branch reaches the target, turns back (pull-in), or cannot be followed."""
        load, target = self.load, self.target
        settings = self.settings
        branch = Branch(self.model, load, subspace=subspace, newton=settings.newton,
                        arc=settings.arc)
        sense = 1 if target >= start.state.load(load) else -1
        stable = start
        for before, after in pairwise(branch.points(start.state, sense)):
            if subspace is FULL and after.solution.wrinkling:
                break
            if sense * after.rate < 0:
                critical = branch.where(before, after, lambda point: point.rate)
                if critical is None:
                    break
                if sense * critical.state.load(load) < sense * target:
                    return self._pulled_in(stable, critical)
                after = critical  # the target is before it, if not before the point after it
            if sense * after.state.load(load) >= sense * target:
                return self._landed(stable, branch.where(
                    before, after, lambda point: point.state.load(load) - target))
            # Where the film by itself resists no more, the plate's stiffness passes a pole: its
            # sign tells nothing.
            if not after.solution.stable and after.solution.wrinkling == 0:
                return self._pulled_in(stable, after, "loses its stability")
            if after.state.plate.deflection > settings.reach * self.model.size:
                break
            if subspace is FULL:
                stable = after.solution
        return Outcome("not_converged", stable, _UNFOLLOWED)

    def _landed(self, stable: Solution, reached: PathPoint | None) -> Outcome:
        """The equilibrium at the target, of all motions, from the branch's point there."""
        if reached is not None:
            reached.solution.release()
            solution = newton(self.model, reached.state.under(**{self.load: self.target}),
                              settings=self.settings.newton)
            if solution.converged and solution.stable:
                return Outcome("equilibrium", solution)
            stable = replace(stable, advice=solution.advice)
        return Outcome("not_converged", stable, _WRINKLED)

    def _pulled_in(self, last: Solution, critical: PathPoint, verb: str = "pulls in") -> Outcome:
        return Outcome("no_equilibrium", last,
                       f"the film {verb} before the {self._word} is reached",
                       critical.state.load(self.load), self.load, critical)

    def _confirmed(self, pull_ins: list[Outcome], reached: bool) -> Outcome:
        """The last of the pull-ins in different subspaces: if the mesh or another one confirms it.

        Where it does not, the limit is the subspace's as much as the film's: two must find the
        same, short of the target by more than they may differ, and none before may have ``reached``
        it.
        """
        settings, last = self.settings, pull_ins[-1]
        unbalanced = [self.model.unbalanced(pull_in.critical.state)
                      for pull_in in pull_ins if pull_in.critical is not None]
        if unbalanced[-1] < settings.unbalanced:
            return last
        limits = np.array([pull_in.limit for pull_in in pull_ins], dtype=float)
        for other in range(len(pull_ins) - 1):
            pair = limits[[other, -1]]
            alike = np.ptp(pair) < settings.agreement * np.abs(pair).max()
            short = np.abs(self.target - pair) > settings.agreement * np.abs(pair)
            if alike and not reached and short.all():
                best = other if unbalanced[other] <= unbalanced[-1] else -1
                spread = float(np.abs(limits / limits[best] - 1).max())
                return replace(pull_ins[best], spread=spread)
        return Outcome("not_converged", last.solution,
                       f"the film has lost tension: short of the {self._word} it pulls in or "
                       "wrinkles, and which depends on the mesh; a finer one may tell")

    @property
    def _word(self) -> str:
        return "load" if self.load == "force" else self.load


def follow_branch(model: Model, start: State, load: Load, settings: PathSettings = PathSettings()
                  ) -> Iterator[tuple[Branch, PathPoint]]:
    """Points from an equilibrium on, one load growing at first, each with the branch it is on.

    With all motions until the film, its plate held, has a direction without stiffness, which in a
    membrane means that it wrinkles; from there with smooth motions.
    """
    last, sense = start, 1
    branch = Branch(model, load, newton=settings.newton, arc=settings.arc)
    for point in branch.points(start):
        if point.solution.wrinkling:
            break
        yield branch, point
        last, sense = point.state, 1 if point.rate >= 0 else -1
    for subspace in settings.subspaces(model):
        smooth = replace(branch, subspace=subspace)
        points = smooth.points(last, sense)
        # The first point is the last one again, by smooth motions.
        if next(points, None) is not None and (first := next(points, None)) is not None:
            yield smooth, first
            yield from ((smooth, point) for point in points)
            return
