"""Newton's method for equilibria of the film and its plate, with error-oriented damping."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import Linearised, Model
from fem.plate import HEAVE
from fem.state import State, Unknown
from fem.tangent import Parts, Tangent

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonSettings:
    """Convergence and damping; all dimensionless.

    ``correction``: largest allowed last correction, relative to the frame. ``residual``: largest allowed unbalanced
    force, relative to the largest nodal reaction. ``iterations``: limit on tangents. ``damping``: smallest step taken
    before giving up.
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

    @property
    def stable(self) -> bool:
        """Whether the plate returns when pushed, the film following, under the given force and voltage.

        A film that has lost tension may still wrinkle by itself: see :attr:`Tangent.wrinkling`.
        """
        return self.tangent is not None and self.tangent.plate_stable


def newton(model: Model, guess: State, unknown: Unknown = "heave", spring: float = 0.0,
           settings: NewtonSettings = NewtonSettings()) -> Solution:
    """Solve for the equilibrium near a guess.

    Parameters
    ----------
    guess
        Start; of (heave, force, U²) the two that are not ``unknown`` are kept.
    spring
        Stiffness of a linear spring against the heave [N/m].

    Notes
    -----
    Damping and convergence are those of NLEQ-ERR (Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, §3.3.3):
    a step is accepted when the simplified correction at its end is shorter than the correction that led there. The
    test compares displacements with displacements, so it does not depend on units or on the stiffness of the film.
    """
    problem = _Problem(model, unknown, spring)
    state = replace(guess, positions=model.place(guess.positions, guess.plate))
    damping, balance = 1.0, np.inf
    tangent: Tangent | None = None
    for iteration in range(1, settings.iterations + 1):
        with np.errstate(all="ignore"):  # a prediction may overshoot; what comes of it is looked at
            part = model.linearised(state.positions, state.plate, state.voltage_squared)
        if not np.isfinite(part.forces).all():
            return Solution(state, False, iteration, np.inf, None,
                            "the film would be strained beyond what its material can reach: take smaller steps")
        residual = problem.residual(state, part.forces)
        balance = problem.balance(residual, part.forces)
        try:
            tangent = problem.tangent(part, state)
            correction = tangent.solve(_negative(residual))
        except (RuntimeError, np.linalg.LinAlgError):
            return Solution(state, False, iteration, balance, None, "the tangent is singular: a limit point is near")
        step = _damped(problem, state, tangent, correction, min(1.0, 4 * damping), settings)
        if step is None:
            return Solution(state, False, iteration, balance, tangent,
                            "no step reduces the error: a limit point or a loss of tension is near")
        state, simplified, damping = step
        if damping == 1.0 and problem.length(simplified) < settings.correction:
            state = problem.moved(state, simplified, 1.0)
            forces = model.forces(state.positions, state.voltage_squared)
            balance = problem.balance(problem.residual(state, forces), forces)
            if balance < settings.residual:
                return Solution(state, True, iteration, balance, tangent)
    return Solution(state, False, settings.iterations, balance, tangent,
                    "the iteration limit was reached: start closer or take smaller steps")


def extrapolate(model: Model, solution: Solution, *, force: float | None = None,
                voltage_squared: float | None = None, heave: float | None = None) -> State:
    """Euler predictor: the state moved along the path's tangent to a new force, U² or heave.

    With a new heave, the force or U² that the solution's tangent has as unknown follows. The tangent belongs to the
    solution's last iterate, which is close enough for a prediction.
    """
    state, tangent = solution.state, solution.tangent
    assert tangent is not None
    if heave is not None:
        correction = tangent.solve(tangent.raised(heave - state.plate.heave))
        moved = _Problem(model, tangent.unknown, 0.0).moved(state, correction, 1.0)
        return replace(moved, plate=moved.plate.raised_to(heave))
    target = State(state.positions, state.plate,
                   state.voltage_squared if voltage_squared is None else voltage_squared,
                   state.force if force is None else force)
    right = np.zeros(int(model.free.sum())), np.zeros(len(model.plate_freedoms))
    names: tuple[tuple[Unknown, float], ...] = (
        ("force", target.force - state.force), ("voltage", target.voltage_squared - state.voltage_squared))
    for name, change in names:
        if change:
            by = tangent.parameter(state, name)
            right = right[0] - change * by[0], right[1] - change * by[1]
    return _Problem(model, "heave", 0.0).moved(target, tangent.solve(right, "heave"), 1.0)


@dataclass(frozen=True)
class _Problem:
    """Residuals and motions for one choice of the unknown."""

    model: Model
    unknown: Unknown
    spring: float

    def residual(self, state: State, forces: Array) -> Parts:
        """Unbalanced forces on the free components and on the plate's freedoms."""
        plate = self.model.plate_forces(forces, state.plate)
        plate[self._heave] -= (state.force - self.spring * state.plate.heave) / self.model.mirrored
        return forces[self.model.free], plate

    def balance(self, residual: Parts, forces: Array) -> float:
        """Largest unbalanced force, moments taken over the frame's half extent, over the largest nodal reaction."""
        plate = np.abs(residual[1]) / np.where(np.array(self.model.plate_freedoms) < 3, 1.0, self.model.size)
        return float(max(np.abs(residual[0]).max(initial=0.0), plate.max()) / np.abs(forces).max())

    def tangent(self, part: Linearised, state: State) -> Tangent:
        """The tangent with this problem's unknown."""
        return Tangent(self.model, part, self.unknown, state, self.spring)

    def moved(self, state: State, correction: Parts, fraction: float) -> State:
        """The state after a fraction of a correction."""
        free, motion = correction[0], self._motion(correction)
        change = fraction * correction[1][self._heave]
        positions = state.positions.copy()
        positions[self.model.free] += fraction * free
        plate = state.plate.moved(fraction * motion)
        return State(self.model.place(positions, plate), plate,
                     state.voltage_squared + (change if self.unknown == "voltage" else 0.0),
                     state.force + (change if self.unknown == "force" else 0.0))

    def length(self, correction: Parts) -> float:
        """Motion relative to the frame, root mean square over the film plus the plate's.

        An unknown force or U² does not count: both enter linearly and follow from the motion.
        """
        motion = self._motion(correction)
        motion[:3] /= self.model.size
        return float(np.sqrt(np.mean((correction[0] / self.model.size) ** 2) + np.sum(motion**2)))

    @property
    def _heave(self) -> int:
        return self.model.plate_freedoms.index(HEAVE)

    def _motion(self, correction: Parts) -> Array:
        """The plate's motion in all six freedoms; no heave when something else is solved for in its place."""
        motion = np.zeros(6)
        motion[list(self.model.plate_freedoms)] = correction[1]
        if self.unknown != "heave":
            motion[HEAVE] = 0.0
        return motion


def _damped(problem: _Problem, state: State, tangent: Tangent, correction: Parts, damping: float,
            settings: NewtonSettings) -> tuple[State, Parts, float] | None:
    """The longest acceptable step: the state after it, the simplified correction there, and the damping; or None."""
    length = problem.length(correction)
    while np.isfinite(length) and damping >= settings.damping:
        trial = problem.moved(state, correction, damping)
        with np.errstate(all="ignore"):  # a step too long may press an element flat; it is then halved
            forces = problem.model.forces(trial.positions, trial.voltage_squared)
        if np.isfinite(forces).all():
            simplified = tangent.solve(_negative(problem.residual(trial, forces)))
            after = problem.length(simplified)
            if after <= (1 - damping / 4) * length or after < settings.correction:
                return trial, simplified, damping
        damping /= 2
    return None


def _negative(residual: Parts) -> Parts:
    return -residual[0], -residual[1]
