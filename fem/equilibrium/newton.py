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

#: Message if the law gives no stress.
STRAINED = "the film would be strained beyond what its material can reach"

#: Correction, relative to the frame, that changes the film's forces no more than rounding does.
_STILL = 1e-12

#: Largest predicted error after a correction longer than allowed, as a share of the largest allowed
#: correction.
_LEFT = 1e-3

#: Largest number of corrections by the tangent of another state. If more are needed, a new tangent
#: costs less.
_SIMPLIFIED = 5
#: Largest ratio of a correction by the tangent of another state to the previous one: five
#: corrections then gain three digits. If corrections decrease more slowly, a new tangent costs
#: less.
_SHORTER = 0.25


#: Cost of a simplified correction, relative to that of a tangent.
_CORRECTION = 0.2

#: Message if the search has used all its work, and advice what to do then.
EXHAUSTED = "the search took more work than it may"
LIGHTER = "a smaller load or a coarser mesh (--refine 0.5) takes less"

#: Part of a tangent's work that does not grow with the film, in unknowns. A tangent takes some 2
#: ms, and another 2 ms for every 500 unknowns.
_FIXED = 500

#: Largest work of a search: number of tangents times their unknowns plus ``_FIXED``; some 15 s.
WORK = 2.5e6


class Budget:
    """Work that is left to a search, in the unit of :data:`WORK`; it is machine-independent.

    All calls of Newton's method in a search share one budget, so that the search ends.
    """

    def __init__(self, work: float) -> None:
        self.left = work

    @property
    def spent(self) -> bool:
        """Whether no work is left."""
        return self.left <= 0

    def part(self, work: float) -> Budget:
        """Create a separate budget of some work, at most what is left in this one."""
        return Budget(min(work, self.left))


def tangent_work(model: Model, subspace: Subspace = FULL) -> float:
    """Compute the work of a tangent and its factorisation.

    Within a subspace the work includes the products with its columns.
    """
    return (model.unknowns + _FIXED) * subspace.work


@dataclass(frozen=True)
class NewtonSettings:
    """Settings for convergence and damping; all are dimensionless.

    ``correction``: largest allowed last correction, relative to the frame. ``residual``: largest
    allowed unbalanced force, relative to the largest nodal reaction. ``iterations``: largest number
    of tangents. ``damping``: smallest damping factor before the method gives up. ``longest``:
    correction, relative to the frame, above which the method gives up. ``budget``: work left to the
    search that this call belongs to; None sets no limit.
    """

    correction: float = 1e-7
    residual: float = 1e-8
    iterations: int = 25
    damping: float = 1e-3
    longest: float = 1e3
    budget: Budget | None = field(default=None, compare=False, repr=False)

    def spend(self, work: float) -> bool:
        """Subtract work from the budget; return whether some was left before."""
        if self.budget is None:
            return True
        self.budget.left -= work
        return self.budget.left + work > 0


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of Newton's method; ``advice`` names the reason if it did not converge."""

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
        """Compute the state's :meth:`Model.thinning_margin`, once for each model."""
        if model not in self._margins:
            self._margins[model] = model.thinning_margin(self.state)
        return self._margins[model]

    def predicted(self, model: Model, load: Load, value: float) -> State:
        """Predict the state at another value of a load by the tangent (Euler's predictor).

        The tangent of the last iterate is accurate enough. The result is stored, so that later
        predictions need no factors.
        """
        loads = {load: value}
        return moved(model, self.state.under(**loads), self.rate(model, load),
                     value - self.state.load(load))

    def rate(self, model: Model, load: Load) -> Parts:
        """Compute the motion of film and plate per unit of a load, along the path."""
        if (model, load) not in self._responses:
            assert self.tangent is not None
            film, plate = self.tangent.respond(model.by_load(self.state, load))
            self._responses[model, load] = -film, -plate
        return self._responses[model, load]

    def release(self) -> None:
        """Release a large film's factors before the next ones: two would double the memory."""
        if self.tangent is not None:
            self.tangent.release()


def newton(model: Model, guess: State, free: tuple[Load, ...] = (),
           constraints: tuple[Constraint, ...] = (),
           settings: NewtonSettings = NewtonSettings(), subspace: Subspace = FULL) -> Solution:
    """Solve for the equilibrium near a guess; its loads are given except the free ones.

    There is one constraint for each free load. The subspace contains the allowed motions.

    Damping and convergence are those of NLEQ-ERR (Deuflhard, *Newton Methods for Nonlinear
    Problems*, 2004, §3.3.3). A step is accepted when the simplified correction at its end is
    shorter than the correction that led there. The test compares displacements with displacements,
    so it does not depend on units or on the stiffness of the film.
    """
    problem = _Problem(model, free, constraints, settings, subspace)
    state = replace(guess, positions=model.place(guess.positions, guess.plate))
    damping = 1.0
    full: _Full | None = None
    for iteration in range(1, settings.iterations + 1):
        if not settings.spend(tangent_work(model, subspace)):
            return Solution(state, False, iteration, None, EXHAUSTED)
        full = None  # two tangents would double the memory
        try:
            full = problem.correction(state)
        except _Stuck as reason:
            return Solution(state, False, iteration, None, str(reason))
        if full.length < settings.correction:
            reached, forces = problem.last(state, full)
            if problem.balanced(reached, forces):
                return Solution(reached, True, iteration, full.tangent)
        step = problem.damped(state, full, min(1.0, 4 * damping))
        if step is None:
            return Solution(state, False, iteration, full.tangent, "no step reduces the error: a "
                            "limit point or a loss of tension is near")
        state, damping = step.state, step.damping
        near = (step.length < settings.correction
                or _left(step.length, full.length) < _LEFT * settings.correction)
        if damping == 1.0 and near:
            state = moved(model, state, step.motion, 1.0, step.loads)
            if problem.balanced(state, model.nodal_forces(state)):
                return Solution(state, True, iteration, full.tangent)
    return Solution(state, False, settings.iterations, None if full is None else full.tangent,
                    "the iteration limit was reached: start closer or take smaller steps")


class _Stuck(ArithmeticError):
    """A state without a correction; its message is advice."""


@dataclass(frozen=True, eq=False)
class _Correction:
    """Correction of a state: motion, changes of loads, and the length of the motion."""

    motion: Parts
    loads: Mapping[Load, float]
    length: float


@dataclass(frozen=True, eq=False)
class _Full(_Correction):
    """Correction by the state's own tangent, with the nodal forces at the state."""

    tangent: Tangent
    forces: Array


@dataclass(frozen=True, eq=False)
class _Step(_Correction):
    """Accepted step to a state, with the correction there by the tangent of the state before."""

    state: State
    damping: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """Equations that Newton's method solves, as :func:`newton` is called."""

    model: Model
    free: tuple[Load, ...]
    constraints: tuple[Constraint, ...]
    settings: NewtonSettings
    subspace: Subspace

    def balanced(self, state: State, forces: Array) -> bool:
        """Check whether the forces at the nodes balance."""
        residual = self.model.residual(forces, state)
        return _unbalanced(self.model, self.subspace, residual, forces) < self.settings.residual

    def correction(self, state: State) -> _Full:
        """Compute the correction of a state by its own tangent.

        Raises
        ------
        _Stuck
            If the law has no stress there, or if the tangent is singular.
        """
        model = self.model
        with np.errstate(all="ignore"):  # a prediction may overshoot
            part = model.linearised(state)
        if not np.isfinite(part.forces).all():
            raise _Stuck(f"{STRAINED}: take smaller steps")
        equations = [constraint(model, state) for constraint in self.constraints]
        try:
            tangent = Tangent(model, part, state, self.free, equations, self.subspace)
            motion, loads = tangent.correct(model.residual(part.forces, state),
                                            [equation.miss for equation in equations])
        except (RuntimeError, ValueError, np.linalg.LinAlgError):
            raise _Stuck("the tangent is singular: a limit point is near") from None
        return _Full(motion, loads, length(model, motion), tangent, part.forces)

    def last(self, state: State, full: _Full) -> tuple[State, Array]:
        """Apply a short correction as a whole; return the state with its nodal forces."""
        reached = moved(self.model, state, full.motion, 1.0, full.loads)
        still = full.length < _STILL and set(self.free) <= {"force"}
        return reached, full.forces if still else self.model.nodal_forces(reached)

    def damped(self, state: State, full: _Full, damping: float) -> _Step | None:
        """Take the largest part of a correction that brings the state nearer to the equilibrium.

        The part is at most ``damping``. None if every part is too small.
        """
        model, settings, before = self.model, self.settings, full.length
        if not (before <= settings.longest and np.isfinite(before)):
            return None
        while damping >= settings.damping:
            trial = moved(model, state, full.motion, damping, full.loads)
            # A step that is too long may collapse an element; the step is then halved.
            with np.errstate(all="ignore"):
                forces = model.nodal_forces(trial)
            if np.isfinite(forces).all():
                settings.spend(_CORRECTION * tangent_work(model))
                misses = [constraint(model, trial).miss for constraint in self.constraints]
                residual = model.residual(forces, trial)
                motion, loads = full.tangent.correct(residual, misses)
                after = length(model, motion)
                if (after <= (1 - damping / 4) * before or after < settings.correction
                        or self._descends(state, residual, full.motion)):
                    return _Step(motion, loads, after, trial, damping)
            damping /= 2
        return None

    def _descends(self, state: State, residual: Parts, motion: Parts) -> bool:
        """Check whether the potential falls along a motion of a film that wrinkles.

        The slope of the potential jumps where wrinkles begin. A decrease of the potential is then
        sufficient.
        """
        return (not self.free and _work(residual, motion) <= 0 and self.model.wrinkles
                and not self.model.in_tension(state))


def simplified_newton(model: Model, guess: State, free: tuple[Load, ...] = (),
                      constraints: tuple[Constraint, ...] = (),
                      settings: NewtonSettings = NewtonSettings(), tangent: Tangent | None = None,
                      second: tuple[Tangent, float] | None = None) -> Solution | None:
    """Solve for the equilibrium near a guess with one tangent; default: the guess's.

    None if the corrections decrease so slowly that new tangents cost less. The remaining error is
    estimated from the ratio of the corrections (Hairer and Wanner, *Solving Ordinary Differential
    Equations II*, §IV.8). ``second`` is another tangent and the weight of its corrections. The mean
    of two states' tangents has an error of second order in that of either.
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
    if tangent is None or not np.isfinite(forces).all():
        return None
    before, residual = settings.longest, model.residual(forces, state)
    for iteration in range(1, _SIMPLIFIED + 1):
        settings.spend(_CORRECTION * tangent_work(model))
        misses = [constraint(model, state).miss for constraint in constraints]
        motion, loads = tangent.correct(residual, misses)
        if second is not None:
            motion = _mean(motion, second[0].correct(residual, misses)[0], second[1])
        after = length(model, motion)
        if not after <= _SHORTER * before:
            return None
        state = moved(model, state, motion, 1.0, loads)
        with np.errstate(all="ignore"):
            forces = model.nodal_forces(state)
        if not np.isfinite(forces).all():
            return None
        residual = model.residual(forces, state)
        rest = after if iteration == 1 else _left(after, before)
        if (rest < settings.correction
                and _unbalanced(model, tangent.subspace, residual, forces) < settings.residual):
            return Solution(state, True, iteration, tangent)
        before = after
    return None


def _left(after: float, before: float) -> float:
    """Estimate the remaining error from the lengths of two corrections with one tangent."""
    return after * after / (before - after) if after < before else after


def _mean(first: Parts, second: Parts, weight: float) -> Parts:
    return (first[0] + weight * (second[0] - first[0]), first[1] + weight * (second[1] - first[1]))


def tangent_at(model: Model, state: State, free: tuple[Load, ...] = (),
               constraints: tuple[Constraint, ...] = (), subspace: Subspace = FULL
               ) -> tuple[Tangent | None, Array]:
    """Compute the tangent (None if singular or beyond the law) and the nodal forces."""
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
    """Apply a fraction of a motion of film and plate, and of changes of loads, to a state."""
    positions = state.positions.copy()
    positions[model.discretisation.free] += fraction * motion[0]
    freedoms = np.zeros(6)
    freedoms[list(model.plate_freedoms)] = fraction * motion[1]
    plate = state.plate.moved(freedoms)
    changed = {name: state.load(name) + fraction * change for name, change in (loads or {}).items()}
    return replace(state.under(**changed), positions=model.place(positions, plate), plate=plate)


def _work(residual: Parts, motion: Parts) -> float:
    return float(residual[0] @ motion[0] + residual[1] @ motion[1])


def _unbalanced(model: Model, subspace: Subspace, residual: Parts, forces: Array) -> float:
    """Compute the largest unbalanced force relative to the largest nodal force.

    Moments are divided by the half extent. The rounding error of a moving plate's inertia force is
    subtracted: in a very short time step it has no bound.
    """
    inner, plate = subspace.project(residual)
    push = np.abs(plate)
    if model.loading.swing is not None:
        rounding = model.loading.swing.rounding(model.size)[list(model.plate_freedoms)]
        push = np.maximum(push - rounding / model.discretisation.mirrored, 0.0)
    largest = max(np.abs(inner).max(initial=0.0), (push / model.arm_of_freedom).max(initial=0.0))
    return float(largest / max(np.abs(forces).max(), np.finfo(float).tiny))
