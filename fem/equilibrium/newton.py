"""Newton's method for equilibria of the film and its plate, with error-oriented damping."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.constraints import Constraint, Equation, length
from tympan.fem.equilibrium.subspace import FULL, Subspace
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State

Array = NDArray[np.float64]

#: Why Newton's method stops where the law gives no stress.
STRAINED = "the film would be strained beyond what its material can reach"


@dataclass(frozen=True)
class NewtonSettings:
    """Convergence and damping; all dimensionless.

    ``correction``: largest allowed last correction, relative to the frame. ``residual``: largest
    allowed unbalanced force, relative to the largest nodal reaction. ``iterations``: limit on
    tangents. ``damping``: smallest step taken before giving up.
    """

    correction: float = 1e-7
    residual: float = 1e-8
    iterations: int = 25
    damping: float = 1e-3


@dataclass(frozen=True, eq=False)
class Solution:
    """What Newton ended with; ``advice`` says why when it did not converge."""

    state: State
    converged: bool
    iterations: int
    residual: float
    tangent: Tangent | None
    advice: str = ""
    _predictions: dict[Load, Prediction] = field(default_factory=dict, repr=False)

    @property
    def stable(self) -> bool:
        """Whether the state is stable under the given loads, as :attr:`Tangent.stable` says."""
        return self.tangent is not None and self.tangent.stable

    @property
    def wrinkling(self) -> int:
        """In how many directions the film, its plate held, has lost its stiffness."""
        return 0 if self.tangent is None else self.tangent.wrinkling

    def prediction(self, model: Model, load: Load) -> Prediction:
        """By the last iterate's tangent, which is close enough; kept, without the factors."""
        made = self._predictions.get(load)
        if made is None or made.model is not model:
            assert self.tangent is not None
            response = self.tangent.respond(_negative(model.by_load(self.state, load)))
            made = self._predictions[load] = Prediction(model, self.state, load, response)
        return made

    def release(self) -> None:
        """Drop a large film's factors before the next are made: two would double the memory."""
        if self.tangent is not None:
            self.tangent.release()


def newton(model: Model, guess: State, free: tuple[Load, ...] = (),
           constraints: tuple[Constraint, ...] = (),
           settings: NewtonSettings = NewtonSettings(), subspace: Subspace = FULL) -> Solution:
    """Solve for the equilibrium near a guess.

    Parameters
    ----------
    guess
        Start; its loads are given, but for those that are free.
    free
        Loads to be found, one for each constraint.
    constraints
        Equations in place of the free loads: a deflection, a charge, a length along the path.
    subspace
        Which motions of the film are allowed.

    Notes
    -----
    Damping and convergence are those of NLEQ-ERR (Deuflhard, *Newton Methods for Nonlinear
    Problems*, 2004, §3.3.3): a step is accepted when the simplified correction at its end is
    shorter than the correction that led there. The test compares displacements with displacements,
    so it does not depend on units or on the stiffness of the film.
    """
    problem = _Problem(model, free, constraints, subspace)
    state = replace(guess, positions=model.place(guess.positions, guess.plate))
    damping, balance = 1.0, np.inf
    tangent: Tangent | None = None
    for iteration in range(1, settings.iterations + 1):
        with np.errstate(all="ignore"):  # a prediction may overshoot; what comes of it is looked at
            part = model.linearised(state)
        if not np.isfinite(part.forces).all():
            return Solution(state, False, iteration, np.inf, None,
                            f"{STRAINED}: take smaller steps")
        equations = problem.equations(state)
        residual = problem.residual(state, part.forces, equations)
        balance = problem.balance(residual, part.forces)
        tangent = None  # two at once would double the memory
        try:
            tangent = Tangent(model, part, state, free, equations, subspace)
            correction = tangent.solve(_negative(residual))
        except (RuntimeError, ValueError, np.linalg.LinAlgError):
            return Solution(state, False, iteration, balance, None,
                            "the tangent is singular: a limit point is near")
        step = _damped(problem, state, tangent, correction, min(1.0, 4 * damping), settings)
        if step is None:
            return Solution(state, False, iteration, balance, tangent,
                            "no step reduces the error: a limit point or a loss of tension is near")
        state, simplified, damping = step
        if damping == 1.0 and problem.length(simplified) < settings.correction:
            state = problem.moved(state, simplified, 1.0)
            forces = model.nodal_forces(state)
            balance = problem.balance(problem.residual(state, forces, problem.equations(state)),
                                      forces)
            if balance < settings.residual:
                return Solution(state, True, iteration, balance, tangent)
    return Solution(state, False, settings.iterations, balance, tangent,
                    "the iteration limit was reached: start closer or take smaller steps")


@dataclass(frozen=True, eq=False)
class Prediction:
    """States moved along a path's tangent to new values of one load: Euler's predictor.

    ``response``: motion of film and plate per unit of the load.
    """

    model: Model
    origin: State
    load: Load
    response: Parts

    def at(self, value: float) -> State:
        """The state at a value of the load."""
        loads = {self.load: value}
        return moved(self.model, self.origin.under(**loads), self.response,
                     fraction=value - self.origin.load(self.load))


def moved(model: Model, state: State, correction: Parts, free: tuple[Load, ...] = (),
          fraction: float = 1.0) -> State:
    """The state after a fraction of a correction of film, plate and free loads."""
    count = len(model.plate_freedoms)
    positions = state.positions.copy()
    positions[model.discretisation.free] += fraction * correction[0]
    motion = np.zeros(6)
    motion[list(model.plate_freedoms)] = fraction * correction[1][:count]
    plate = state.plate.moved(motion)
    changes = zip(free, fraction * correction[1][count:], strict=True)
    loads = {name: state.load(name) + change for name, change in changes}
    return replace(state.under(**loads), positions=model.place(positions, plate), plate=plate)


@dataclass(frozen=True)
class _Problem:
    """Residuals and motions for one choice of what is given."""

    model: Model
    free: tuple[Load, ...]
    constraints: tuple[Constraint, ...]
    subspace: Subspace

    def equations(self, state: State) -> list[Equation]:
        """Those of the constraints."""
        return [constraint.equation(self.model, state, self.free)
                for constraint in self.constraints]

    def residual(self, state: State, forces: Array, equations: list[Equation]) -> Parts:
        """Unbalanced forces on free components and plate freedoms, and what the equations miss."""
        inner, plate = self.model.residual(forces, state)
        return inner, np.concatenate([plate, [equation.miss for equation in equations]])

    def balance(self, residual: Parts, forces: Array) -> float:
        """Largest unbalanced force over the largest nodal one; moments over the half extent."""
        count = len(self.model.plate_freedoms)
        inner, plate = self.subspace.project((residual[0], residual[1][:count]))
        plate = np.abs(plate) / np.where(np.array(self.model.plate_freedoms, dtype=int) < 3, 1.0,
                                         self.model.size)
        largest = max(np.abs(inner).max(initial=0.0), plate.max(initial=0.0))
        return float(largest / max(np.abs(forces).max(), np.finfo(float).tiny))

    def moved(self, state: State, correction: Parts, fraction: float) -> State:
        """The state after a fraction of a correction."""
        return moved(self.model, state, correction, self.free, fraction)

    def length(self, correction: Parts) -> float:
        """Length of the motion; free loads do not count, since they follow from it."""
        return length(self.model, (correction[0], correction[1][: len(self.model.plate_freedoms)]))


def _damped(problem: _Problem, state: State, tangent: Tangent, correction: Parts, damping: float,
            settings: NewtonSettings) -> tuple[State, Parts, float] | None:
    """The longest acceptable step, if any: state after it, simplified correction, damping."""
    length = problem.length(correction)
    while np.isfinite(length) and damping >= settings.damping:
        trial = problem.moved(state, correction, damping)
        # A step too long may press an element flat; it is then halved.
        with np.errstate(all="ignore"):
            forces = problem.model.nodal_forces(trial)
        if np.isfinite(forces).all():
            simplified = tangent.solve(_negative(problem.residual(trial, forces,
                                                                  problem.equations(trial))))
            after = problem.length(simplified)
            if after <= (1 - damping / 4) * length or after < settings.correction:
                return trial, simplified, damping
        damping /= 2
    return None


def _negative(residual: Parts) -> Parts:
    return -residual[0], -residual[1]
