"""Newton's method for equilibria of the film and its plate, with error-oriented damping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.constraints import Constraint, length
from tympan.fem.equilibrium.subspace import FULL, Subspace
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State

#: Why Newton's method stops where the law gives no stress.
STRAINED = "the film would be strained beyond what its material can reach"

#: A correction, relative to the frame, that changes the film's forces no more than rounding does.
_STILL = 1e-12

#: Share of the largest allowed correction that may be foretold to be left after a longer one.
_LEFT = 1e-3

#: Most corrections by the tangent of another state. If more are needed, a new tangent costs less.
_SIMPLIFIED = 5
#: Each of these corrections must be this much shorter than the one before: five then gain three
#: digits. If they shrink more slowly, a new tangent costs less.
_SHORTER = 0.25


#: Cost of a simplified correction, relative to that of a tangent.
_CORRECTION = 0.2

#: Why Newton's method stops where the search that calls it has done its work, and what to do then.
EXHAUSTED = "the search took more work than it may"
LIGHTER = "a smaller load or a coarser mesh (--refine 0.5) takes less"

#: What of a tangent's work does not grow with the film, in unknowns: a tangent takes some 2 ms, and
#: as much again for each so many unknowns.
_FIXED = 500

#: Work that a search may take, in tangents times their unknowns and what does not grow with them:
#: some 15 s.
WORK = 2.5e6


class Budget:
    """Work left to a search, in that of tangents; the same on every machine.

    All of a search's calls of Newton's method draw on one budget, so that it ends.
    """

    def __init__(self, work: float) -> None:
        self.left = work

    @property
    def spent(self) -> bool:
        """Whether none is left."""
        return self.left <= 0

    def part(self, work: float) -> Budget:
        """Separate budget of so much work, no more than this one has left."""
        return Budget(min(work, self.left))


def tangent_work(model: Model, subspace: Subspace = FULL) -> float:
    """Work of a tangent of a film, its factors included; within a subspace that of its products."""
    return (model.unknowns + _FIXED) * subspace.work


@dataclass(frozen=True)
class NewtonSettings:
    """Convergence and damping; all dimensionless.

    ``correction``: largest allowed last correction, relative to the frame. ``residual``: largest
    allowed unbalanced force, relative to the largest nodal reaction. ``iterations``: limit on
    tangents. ``damping``: smallest step taken before giving up; ``longest``: correction, relative
    to the frame, at which it does so too. ``budget``: work left to the search that this is part of;
    without one there is no limit.
    """

    correction: float = 1e-7
    residual: float = 1e-8
    iterations: int = 25
    damping: float = 1e-3
    longest: float = 1e3
    budget: Budget | None = field(default=None, compare=False, repr=False)

    def spend(self, work: float) -> bool:
        """Draw on the budget; whether there was some left."""
        if self.budget is None:
            return True
        self.budget.left -= work
        return self.budget.left + work > 0


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of Newton's method; ``advice`` says why when it did not converge."""

    state: State
    converged: bool
    iterations: int
    tangent: Tangent | None
    advice: str = ""
    _responses: dict[tuple[Model, Load], Parts] = field(default_factory=dict, repr=False)
    _margins: dict[Model, float] = field(default_factory=dict, repr=False)

    @property
    def stable(self) -> bool:
        """Whether the state is stable under the given loads, as :attr:`Tangent.stable` says."""
        return self.tangent is not None and self.tangent.stable

    @property
    def wrinkling(self) -> int:
        """Number of directions in which the film, its plate held, has lost its stiffness."""
        return 0 if self.tangent is None else self.tangent.wrinkling

    def thinning_margin(self, model: Model) -> float:
        """Margin of the state by :meth:`Model.thinning_margin`; it is kept."""
        if model not in self._margins:
            self._margins[model] = model.thinning_margin(self.state)
        return self._margins[model]

    def predicted(self, model: Model, load: Load, value: float) -> State:
        """The state at another value of a load along the path's tangent: Euler's predictor.

        By the last iterate's tangent, which is close enough; what it says is kept, without factors.
        """
        loads = {load: value}
        return moved(model, self.state.under(**loads), self.rate(model, load),
                     value - self.state.load(load))

    def rate(self, model: Model, load: Load) -> Parts:
        """Motion of film and plate per unit of a load, along the path."""
        if (model, load) not in self._responses:
            assert self.tangent is not None
            film, plate = self.tangent.respond(model.by_load(self.state, load))
            self._responses[model, load] = -film, -plate
        return self._responses[model, load]

    def release(self) -> None:
        """Drop a large film's factors before the next are made: two would double the memory."""
        if self.tangent is not None:
            self.tangent.release()


def newton(model: Model, guess: State, free: tuple[Load, ...] = (),
           constraints: tuple[Constraint, ...] = (),
           settings: NewtonSettings = NewtonSettings(), subspace: Subspace = FULL) -> Solution:
    """Solve for the equilibrium near a guess, whose loads are given, but for those that are free.

    There is one constraint for each free load; the subspace says which motions are allowed.

    Damping and convergence are those of NLEQ-ERR (Deuflhard, *Newton Methods for Nonlinear
    Problems*, 2004, §3.3.3): a step is accepted when the simplified correction at its end is
    shorter than the correction that led there. The test compares displacements with displacements,
    so it does not depend on units or on the stiffness of the film.
    """
    state = replace(guess, positions=model.place(guess.positions, guess.plate))
    damping = 1.0
    tangent: Tangent | None = None
    for iteration in range(1, settings.iterations + 1):
        if not settings.spend(tangent_work(model, subspace)):
            return Solution(state, False, iteration, None, EXHAUSTED)
        with np.errstate(all="ignore"):  # a prediction may overshoot; what comes of it is looked at
            part = model.linearised(state)
        if not np.isfinite(part.forces).all():
            return Solution(state, False, iteration, None, f"{STRAINED}: take smaller steps")
        equations = [constraint(model, state) for constraint in constraints]
        tangent = None  # two at once would double the memory
        try:
            tangent = Tangent(model, part, state, free, equations, subspace)
            motion, loads = tangent.correct(model.residual(part.forces, state),
                                            [equation.miss for equation in equations])
        except (RuntimeError, ValueError, np.linalg.LinAlgError):
            return Solution(state, False, iteration, None,
                            "the tangent is singular: a limit point is near")
        before, damping = length(model, motion), min(1.0, 4 * damping)
        if before < settings.correction:
            reached = moved(model, state, motion, 1.0, loads)
            still = before < _STILL and set(free) <= {"force"}
            forces = part.forces if still else model.nodal_forces(reached)
            if _unbalanced(model, subspace, reached, forces) < settings.residual:
                return Solution(reached, True, iteration, tangent)
        while True:
            if not (before <= settings.longest and np.isfinite(before)
                    and damping >= settings.damping):
                return Solution(state, False, iteration, tangent, "no step reduces the error: a "
                                "limit point or a loss of tension is near")
            trial = moved(model, state, motion, damping, loads)
            # A step too long may press an element flat; it is then halved.
            with np.errstate(all="ignore"):
                forces = model.nodal_forces(trial)
            if np.isfinite(forces).all():
                settings.spend(_CORRECTION * tangent_work(model))
                misses = [constraint(model, trial).miss for constraint in constraints]
                simplified, changes = tangent.correct(model.residual(forces, trial), misses)
                after = length(model, simplified)
                if after <= (1 - damping / 4) * before or after < settings.correction:
                    break
                # Towards less of a potential whose slope jumps where wrinkles begin: enough.
                descends = not free and _work(model.residual(forces, trial), motion) <= 0
                if descends and model.wrinkles and not model.in_tension(state):
                    break
            damping /= 2
        state = trial
        near = after < settings.correction or _left(after, before) < _LEFT * settings.correction
        if damping == 1.0 and near:
            state = moved(model, state, simplified, 1.0, changes)
            forces = model.nodal_forces(state)
            if _unbalanced(model, subspace, state, forces) < settings.residual:
                return Solution(state, True, iteration, tangent)
    return Solution(state, False, settings.iterations, tangent,
                    "the iteration limit was reached: start closer or take smaller steps")


def simplified_newton(model: Model, guess: State, free: tuple[Load, ...] = (),
                      constraints: tuple[Constraint, ...] = (),
                      settings: NewtonSettings = NewtonSettings(), tangent: Tangent | None = None,
                      second: tuple[Tangent, float] | None = None) -> Solution | None:
    """Solve for the equilibrium near a guess by one tangent, that of the guess if none is given.

    None where corrections do not become shorter fast enough for new tangents to cost more. What is
    left at the end is foretold from how they did (Hairer and Wanner, *Solving Ordinary Differential
    Equations II*, §IV.8). ``second`` is another tangent with the weight of its corrections: between
    two states their mean is off by the square of what that of either is.
    """
    state = replace(guess, positions=model.place(guess.positions, guess.plate))
    with np.errstate(all="ignore"):
        if tangent is None or tangent.free != free:
            if not settings.spend(tangent_work(model)):
                return None
            tangent, forces = tangent_at(model, state, free, constraints)
        else:
            tangent = tangent.adapted(model, [each(model, state) for each in constraints])
            forces = model.nodal_forces(state)
    before = settings.longest
    for iteration in range(1, _SIMPLIFIED + 1):
        if tangent is None or not np.isfinite(forces).all():
            return None
        settings.spend(_CORRECTION * tangent_work(model))
        misses = [constraint(model, state).miss for constraint in constraints]
        residual = model.residual(forces, state)
        motion, loads = tangent.correct(residual, misses)
        if second is not None:
            motion = _mean(motion, second[0].correct(residual, misses)[0], second[1])
        after = length(model, motion)
        share = after / before
        if not share <= _SHORTER:
            return None
        state = moved(model, state, motion, 1.0, loads)
        with np.errstate(all="ignore"):
            forces = model.nodal_forces(state)
        rest = after if iteration == 1 else _left(after, before)
        if (rest < settings.correction
                and _unbalanced(model, tangent.subspace, state, forces) < settings.residual):
            return Solution(state, True, iteration, tangent)
        before = after
    return None


def _left(after: float, before: float) -> float:
    """Residual after two corrections by one tangent, foretold from their lengths."""
    return after * after / (before - after) if after < before else after


def _mean(first: Parts, second: Parts, weight: float) -> Parts:
    return (first[0] + weight * (second[0] - first[0]), first[1] + weight * (second[1] - first[1]))


def tangent_at(model: Model, state: State, free: tuple[Load, ...] = (),
               constraints: tuple[Constraint, ...] = (), subspace: Subspace = FULL
               ) -> tuple[Tangent | None, Array]:
    """Tangent at a state, None where it is singular or beyond the law; and the nodal forces."""
    part = model.linearised(state)
    if not np.isfinite(part.forces).all():
        return None, part.forces
    equations = [constraint(model, state) for constraint in constraints]
    try:
        return Tangent(model, part, state, free, equations, subspace), part.forces
    except (RuntimeError, ValueError, np.linalg.LinAlgError):
        return None, part.forces


def moved(model: Model, state: State, motion: Parts, fraction: float = 1.0,
          loads: Mapping[Load, float] | None = None) -> State:
    """The state after a fraction of a motion of film and plate, and of changes of loads."""
    positions = state.positions.copy()
    positions[model.discretisation.free] += fraction * motion[0]
    freedoms = np.zeros(6)
    freedoms[list(model.plate_freedoms)] = fraction * motion[1]
    plate = state.plate.moved(freedoms)
    changed = {name: state.load(name) + fraction * change for name, change in (loads or {}).items()}
    return replace(state.under(**changed), positions=model.place(positions, plate), plate=plate)


def _work(residual: Parts, motion: Parts) -> float:
    return float(residual[0] @ motion[0] + residual[1] @ motion[1])


def _unbalanced(model: Model, subspace: Subspace, state: State, forces: Array) -> float:
    """Largest unbalanced force over the largest nodal one; moments over the half extent.

    What a plate in motion is pushed with by rounding does not count: in a step of time short enough
    that is anything.
    """
    inner, plate = subspace.project(model.residual(forces, state))
    push = np.abs(plate)
    if model.loading.swing is not None:
        rounding = model.loading.swing.rounding(model.size)[list(model.plate_freedoms)]
        push = np.maximum(push - rounding / model.discretisation.mirrored, 0.0)
    largest = max(np.abs(inner).max(initial=0.0), (push / model.arm_of_freedom).max(initial=0.0))
    return float(largest / max(np.abs(forces).max(), np.finfo(float).tiny))
