"""Tangent of film and plate: the film's factors, bordered by plate freedoms and free loads."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from tympan.base.arrays import Array
from tympan.fem.equilibrium.constraints import Equation
from tympan.fem.equilibrium.subspace import FULL, Subspace
from tympan.fem.linear_solver.direct import factorise
from tympan.fem.membrane.model import Linearised, Model, Parts
from tympan.fem.membrane.state import Load, State

#: Number of unknowns above which a path drops its earlier factors. For smaller films they take less
#: than some 100 MB.
_LARGE = 50_000


class Tangent:
    """Tangent by block elimination; the film's matrix is factorised once.

    Rows are the film's unknowns, the plate's freedoms, and one equation for each free load. Columns
    are the film's unknowns, the plate's freedoms and the free loads. The film's matrix and its
    sparsity pattern do not depend on the free loads.
    """

    def __init__(self, model: Model, part: Linearised, state: State, free: tuple[Load, ...] = (),
                 equations: Sequence[Equation] = (), subspace: Subspace = FULL) -> None:
        self.model, self.subspace, self.state = model, subspace, state
        part = subspace.reduced(part)
        self._kept: Any = _factorise(part.inner, model)
        self._plates = len(model.plate_freedoms)
        self._border(part.border, part.corner, free, equations)

    def _border(self, border: Array, corner: Array, free: tuple[Load, ...],
                equations: Sequence[Equation]) -> None:
        """Border the factors by the plate's columns, free loads and their equations."""
        self.free, project = free, self.subspace.project
        loads = {name: project(self.model.by_load(self.state, name)) for name in free}
        rows = [project(equation.by_motion) for equation in equations]
        columns = np.column_stack([border, *(load[0] for load in loads.values())])
        self._rows = np.vstack([border.T, *(row[0] for row in rows)])
        self._corner = np.vstack([
            np.column_stack([corner, *(load[1] for load in loads.values())]),
            *(np.append(row[1], [equation.by_load.get(name, 0.0) for name in free])
              for row, equation in zip(rows, equations, strict=True))])
        self._influence = self._factor.solve(columns)
        self._schur = self._corner - self._rows @ self._influence

    def bordered(self, free: tuple[Load, ...], equations: Sequence[Equation]) -> Tangent:
        """Free other loads at the same state; the film's factors are reused."""
        result, plates = copy(self), self._plates
        result._border(self._rows[:plates].T, self._corner[:plates, :plates], free, equations)
        return result

    def adapted(self, model: Model, equations: Sequence[Equation]) -> Tangent:
        """Adapt to another step of the plate's motion, and to new derivatives by free loads.

        The film's factors are reused.
        """
        corner, plates = self._corner.copy(), self._plates
        freedoms = np.ix_(model.plate_freedoms, model.plate_freedoms)
        change = _inertia(model) - _inertia(self.model)
        corner[:plates, :plates] += change[freedoms] / model.discretisation.mirrored
        for row, equation in enumerate(equations, plates):
            corner[row, plates:] = [equation.by_load.get(name, 0.0) for name in self.free]
        if np.array_equal(corner, self._corner):
            return self
        result = copy(self)
        result.model, result._corner = model, corner
        result._schur = self._schur + (corner - self._corner)
        return result

    def release(self) -> None:
        """Drop the factors of a large film; they are computed again when needed."""
        if self.model.unknowns >= _LARGE and self.subspace is FULL:
            self._kept = None

    @property
    def at_hand(self) -> bool:
        """Whether the factors are in memory."""
        return self._kept is not None

    @property
    def _factor(self) -> Any:
        if self._kept is None:
            self._kept = _factorise(self.subspace.reduced(self.model.linearised(self.state)).inner,
                                    self.model)
        return self._kept

    @property
    def plate_stiffness(self) -> Array:
        """Stiffness of the modelled part's plate freedoms at given loads, shape (p, p).

        The film follows the plate.
        """
        schur = self._schur[: self._plates, : self._plates]
        return np.asarray((schur + schur.T) / 2)

    @property
    def stable(self) -> bool:
        """Whether film and plate return after a perturbation.

        If every node moves independently, only the plate is tested, in its freedoms: a film without
        tension wrinkles, whatever the plate does. In motions that cannot wrinkle, film and plate
        are tested together; so is a film without a plate.
        """
        if self.subspace is not FULL or self.model.specimen.plate is None:
            return self.negative == 0
        return bool((_eigenvalues(self.plate_stiffness) > 0).all())

    @cached_property
    def wrinkling(self) -> int:
        """Number of negative eigenvalues of the film with the plate held."""
        return int(self._factor.negative)

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues of film and plate at given loads."""
        return self.wrinkling + int((_eigenvalues(self.plate_stiffness) < 0).sum())

    def correct(self, residual: Parts, misses: Sequence[float]) -> tuple[Parts, dict[Load, float]]:
        """Solve for the motion and load changes that cancel the residual and the equations' misses.

        The tangent times the result is minus the residual and the misses.
        """
        inner, plate = self.subspace.project(residual)
        film, border = self._solved(-inner, -np.concatenate([plate, misses]))
        motion = self.subspace.expand((film, border[: self._plates]))
        return motion, dict(zip(self.free, border[self._plates :].tolist(), strict=True))

    def respond(self, forces: Parts) -> Parts:
        """Solve for the motion of film and plate under forces, at given loads."""
        return self.subspace.expand(self._solved(*self.subspace.project(forces)))

    def _solved(self, inner: Array, border: Array) -> Parts:
        count = len(border)
        particular = self._factor.solve(inner)
        solution = np.linalg.solve(self._schur[:count, :count],
                                   border - self._rows[:count] @ particular)
        return particular - self._influence[:, :count] @ solution, solution

    def along(self) -> tuple[Parts, dict[Load, float]]:
        """Solve for the motion and load changes per unit of the last equation's value."""
        zero = np.zeros(self.model.discretisation.free_count), np.zeros(self._plates)
        return self.correct(zero, [*np.zeros(len(self.free) - 1), -1.0])


def _inertia(model: Model) -> Array:
    """Get the stiffness that a step of the plate's motion adds, shape (6, 6)."""
    swing = model.loading.swing
    return np.zeros((6, 6)) if swing is None else swing.stiffness


def _eigenvalues(matrix: Array) -> Array:
    """Compute a symmetric matrix's eigenvalues; -inf (not stable) if it is not finite."""
    if not np.isfinite(matrix).all():
        return np.full(len(matrix), -np.inf)
    return np.asarray(np.linalg.eigvalsh(matrix), float)


def _factorise(matrix: Any, model: Model) -> Any:
    if isinstance(matrix, np.ndarray):
        return _Dense(matrix)
    return factorise(matrix, model.discretisation.unknowns.analysis)


class _Dense:
    def __init__(self, matrix: Array) -> None:
        self._matrix, self._lu = matrix, lu_factor(matrix)

    def solve(self, right: Array) -> Array:
        return np.asarray(lu_solve(self._lu, right))

    @property
    def negative(self) -> int:
        return int((np.linalg.eigvalsh((self._matrix + self._matrix.T) / 2) < 0).sum())
