"""Newton's method for equilibria of the film and its plate, with error-oriented damping."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from fem.model import Linearised, Model
from fem.plate import HEAVE, PlateMotion

Array = NDArray[np.float64]

#: Which of the three is solved for while the other two are given.
Unknown = Literal["heave", "force", "voltage"]


@dataclass(frozen=True, eq=False)
class State:
    """A configuration of film and plate: node positions [m], plate motion, U² [V²], force on the plate [N].

    ``force`` is the whole plate's, also on a model that meshes only a part of it.
    """

    positions: Array
    plate: PlateMotion
    voltage_squared: float = 0.0
    force: float = 0.0

    @classmethod
    def mounted(cls, model: Model, voltage_squared: float = 0.0) -> State:
        """The flat film with the plate at rest."""
        return cls(model.reference.copy(), PlateMotion.rest(), voltage_squared)


@dataclass(frozen=True)
class NewtonSettings:
    """Convergence and damping; all dimensionless.

    ``correction``: largest allowed last correction, relative to the frame. ``residual``: largest allowed unbalanced
    nodal force, relative to the largest nodal reaction. ``iterations``: limit on tangents. ``damping``: smallest
    step taken before giving up.
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


class Tangent:
    """A factorised tangent with the plate and the unknown as border (block elimination).

    The columns are the plate's freedoms, the heave replaced by the force or U² when one of them is unknown.
    """

    def __init__(self, model: Model, part: Linearised, unknown: Unknown, state: State, spring: float) -> None:
        self.model, self.unknown = model, unknown
        self._lu = _factorise(part.inner)
        self._border, corner = part.border, part.corner.copy()
        freedoms = model.plate_freedoms
        self._row = freedoms.index(HEAVE)
        corner[self._row, self._row] += spring / model.mirrored
        self._influence = np.asarray(self._lu.solve(part.border))
        self._schur = corner - part.border.T @ self._influence
        self._bordered, self._columns = self._schur, self._influence
        if unknown != "heave":
            inner, plate = self.parameter(state, unknown)
            response = self._lu.solve(inner)
            self._columns = self._influence.copy()
            self._columns[:, self._row] = response
            self._bordered = self._schur.copy()
            self._bordered[:, self._row] = plate - part.border.T @ response

    @property
    def plate_stable(self) -> bool:
        """Whether the stiffness of the plate's freedoms, the film condensed out, is positive definite."""
        return bool(np.linalg.eigvalsh((self._schur + self._schur.T) / 2)[0] > 0)

    @property
    def heave_stiffness(self) -> float:
        """dF/dw of the whole plate [N/m] at constant voltage, everything else following."""
        return float(self.model.mirrored / np.linalg.inv(self._schur)[self._row, self._row])

    @property
    def wrinkling(self) -> int:
        """Number of negative eigenvalues of the film with the plate held, by Sylvester's law from the pivots."""
        return int(np.count_nonzero(self._lu.U.diagonal() < 0))

    def parameter(self, state: State, name: Unknown) -> tuple[Array, Array]:
        """Derivative of the residual (free components, plate) by the force or by U²."""
        if name == "force":
            plate = np.zeros(len(self.model.plate_freedoms))
            plate[self._row] = -1 / self.model.mirrored
            return np.zeros(self._border.shape[0]), plate
        forces = self.model.voltage_forces(state.positions)
        return forces[self.model.free], self.model.plate_forces(forces, state.plate)

    def solve(self, inner: Array, plate: Array, unknown: Unknown | None = None) -> tuple[Array, Array]:
        """Corrections (free components, bordered unknowns) for a right-hand side.

        ``unknown="heave"`` solves for the heave whatever the tangent was made for.
        """
        bordered, columns = (self._schur, self._influence) if unknown == "heave" else (self._bordered, self._columns)
        particular = self._lu.solve(inner)
        border = np.linalg.solve(bordered, plate - self._border.T @ particular)
        return particular - columns @ border, border

    def raised(self, change: float) -> tuple[Array, Array]:
        """Right-hand side that makes up for a change of the heave [m] by the unknown and everything else."""
        corner = self._schur[:, self._row] + self._border.T @ self._influence[:, self._row]
        return -change * self._border[:, self._row], -change * corner


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
    state, damping = _consistent(model, guess), 1.0
    tangent: Tangent | None = None
    advice = "the iteration limit was reached: start closer or take smaller steps"
    for iteration in range(1, settings.iterations + 1):
        part = model.linearised(state.positions, state.plate, state.voltage_squared)
        residual = _residual(model, state, part.forces, part.plate, spring)
        try:
            tangent = Tangent(model, part, unknown, state, spring)
            correction = tangent.solve(-residual[0], -residual[1])
        except (RuntimeError, np.linalg.LinAlgError):
            return Solution(state, False, iteration, np.inf, None, "the tangent is singular: a limit point is near")
        length = _length(model, correction, unknown)
        if not np.isfinite(length):
            return Solution(state, False, iteration, np.inf, tangent, "the correction is not finite")
        damping = min(1.0, 4 * damping)
        while True:
            trial = _moved(model, state, correction, damping, unknown)
            forces = model.forces(trial.positions, trial.voltage_squared)
            step = _residual(model, trial, forces, model.plate_forces(forces, trial.plate), spring)
            if np.isfinite(forces).all():
                simplified = tangent.solve(-step[0], -step[1])
                after = _length(model, simplified, unknown)
                if after <= (1 - damping / 4) * length or after < settings.correction:
                    break
            damping /= 2
            if damping < settings.damping:
                return Solution(state, False, iteration, _balance(residual, part.forces), tangent,
                                "no step reduces the error: a limit point or a loss of tension is near")
        state = trial
        if damping == 1.0 and after < settings.correction:
            state = _moved(model, state, simplified, 1.0, unknown)
            forces = model.forces(state.positions, state.voltage_squared)
            final = _residual(model, state, forces, model.plate_forces(forces, state.plate), spring)
            balance = _balance(final, forces)
            if balance < settings.residual:
                return Solution(state, True, iteration, balance, tangent)
    return Solution(state, False, settings.iterations, _balance(residual, part.forces), tangent, advice)


def extrapolate(model: Model, solution: Solution, *, force: float | None = None,
                voltage_squared: float | None = None, heave: float | None = None) -> State:
    """Euler predictor: the state moved along the path's tangent to a new force, U² or heave.

    The solution's tangent belongs to its last iterate, which is close enough for a prediction.
    """
    state, tangent = solution.state, solution.tangent
    assert tangent is not None
    if heave is not None:
        return _heave_predictor(model, state, tangent, heave)
    inner = np.zeros(int(model.free.sum()))
    plate = np.zeros(len(model.plate_freedoms))
    for name, new, old in (("force", force, state.force), ("voltage", voltage_squared, state.voltage_squared)):
        if new is not None and new != old:
            by_inner, by_plate = tangent.parameter(state, name)  # type: ignore[arg-type]
            inner, plate = inner - (new - old) * by_inner, plate - (new - old) * by_plate
    moved = _moved(model, state, tangent.solve(inner, plate, "heave"), 1.0, "heave")
    return replace(moved, force=state.force if force is None else force,
                   voltage_squared=state.voltage_squared if voltage_squared is None else voltage_squared)


def _heave_predictor(model: Model, state: State, tangent: Tangent, heave: float) -> State:
    """Film and remaining unknowns after the plate is raised."""
    correction = tangent.solve(*tangent.raised(heave - state.plate.heave))
    moved = _moved(model, state, correction, 1.0, tangent.unknown)
    return _consistent(model, replace(moved, plate=moved.plate.raised_to(heave)))


def _factorise(matrix: csc_matrix):  # type: ignore[no-untyped-def]
    """LDLᵀ in all but name: symmetric ordering, no pivoting off the diagonal."""
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _consistent(model: Model, state: State) -> State:
    return replace(state, positions=model.place(state.positions, state.plate))


def _residual(model: Model, state: State, forces: Array, plate: Array, spring: float) -> tuple[Array, Array]:
    """Unbalanced forces on the free components and on the plate's freedoms."""
    plate = plate.copy()
    plate[model.plate_freedoms.index(HEAVE)] -= (state.force - spring * state.plate.heave) / model.mirrored
    return forces[model.free], plate


def _balance(residual: tuple[Array, Array], forces: Array) -> float:
    """Largest unbalanced force relative to the largest nodal reaction."""
    unbalanced = max(np.abs(residual[0]).max(initial=0), abs(residual[1][0]) if len(residual[1]) == 1
                     else np.abs(residual[1][:3]).max())
    return float(unbalanced / np.abs(forces).max())


def _moved(model: Model, state: State, correction: tuple[Array, Array], fraction: float, unknown: Unknown) -> State:
    """The state after a fraction of a correction."""
    free, border = correction
    motion = np.zeros(6)
    motion[list(model.plate_freedoms)] = border
    force, voltage_squared = state.force, state.voltage_squared
    if unknown != "heave":
        change = fraction * motion[HEAVE]
        motion[HEAVE] = 0.0
        if unknown == "force":
            force += change
        else:
            voltage_squared += change
    positions = state.positions.copy()
    positions[model.free] += fraction * free
    plate = state.plate.moved(fraction * motion)
    return State(model.place(positions, plate), plate, voltage_squared, force)


def _length(model: Model, correction: tuple[Array, Array], unknown: Unknown) -> float:
    """Motion relative to the frame, root mean square over the film plus the plate's.

    An unknown force or U² does not count: both enter linearly and follow from the motion.
    """
    free, border = correction
    motion = np.zeros(6)
    motion[list(model.plate_freedoms)] = border
    motion[:3] /= model.size
    if unknown != "heave":
        motion[HEAVE] = 0.0
    return float(np.sqrt(np.mean((free / model.size) ** 2) + np.sum(motion**2)))
