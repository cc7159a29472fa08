"""Solutions of A(s) x = b at many s, from solutions at a few: a reduced basis, and its error.

A is symmetric, a sum of constant matrices times functions of s. The solutions at a few s span a
space; at the other s the solution within this space is found (Galerkin). The next s is where the
residual is largest, until all residuals are small (P. Benner, S. Gugercin and K. Willcox, "A survey
of projection-based model reduction methods for parametric dynamical systems", SIAM Rev. 57 (2015)
483–531). What is printed is bᵀx, and its error is rᵀ A⁻¹ r: the square of the residuals r.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from tympan.base.arrays import AnyArray
from tympan.fem.linear_solver.direct import SuperLU

#: Largest residual over the right-hand side. The error of bᵀx is its square times the ratio of
#: the stiffness against b to the least one, some 1e3.
_RESIDUAL = 1e-7

#: Part of a solution outside of the space, over the solution, below which it is rounding.
_NEW = 1e-11

#: Number of s in the first round.
_FIRST = 5

#: Height of a peak of the residuals over the highest one, above which its s is solved, too.
_PEAK = 0.1

#: Function of s that multiplies each of the matrices.
Factors = Callable[[complex], Sequence[complex]]


@dataclass(eq=False)
class FrequencySweep:
    """Symmetric matrices of one size, the functions that multiply them, and right-hand sides.

    ``right`` has shape (n, rights). The unknowns' order has little fill-in.
    """

    matrices: Sequence[csc_matrix]
    factors: Factors
    right: AnyArray

    def __post_init__(self) -> None:
        self._indices, self._indptr, self._data = _on_one_pattern(self.matrices)
        self._basis = np.zeros((len(self.right), 0))
        self._by_matrix = [np.zeros((len(self.right), 0)) for _ in self.matrices]

    def matrix(self, s: complex) -> csc_matrix:
        """Sum the matrices at s."""
        data = np.tensordot(np.asarray(self.factors(s), complex), self._data, 1)
        return csc_matrix((data, self._indices, self._indptr), shape=2 * (len(self.right),))

    def solve(self, s: complex) -> AnyArray:
        """Solve at s, and add the solutions to the space; shape (n, rights)."""
        matrix, right = self.matrix(s), self.right.astype(complex)
        factors = SuperLU(ordered=True).factorise(matrix)
        found = factors.solve(right)
        # Pivots are not exchanged: one step of refinement restores the digits that this costs.
        found += factors.solve(right - matrix @ found)
        self._add(np.hstack([found.real, found.imag]))
        return found

    def outputs(self, points: AnyArray, progress: Callable[[int], None] = lambda number: None
                ) -> AnyArray:
        """Compute bᵢᵀ x_j for all right-hand sides at many s, (points, rights, rights).

        ``progress`` is called with the number of each point before it is solved.
        """
        result = np.empty((len(points), *2 * (self.right.shape[1],)), complex)
        left = np.arange(len(points))
        chosen = np.unique(np.linspace(0, len(points) - 1, _FIRST).round().astype(int))
        while len(chosen):
            for number in chosen.tolist():
                progress(number)
                result[number] = self.right.T @ self.solve(points[number])
            left = np.setdiff1d(left, chosen)
            if not len(left):
                break
            result[left], residuals = self._within(points[left])
            chosen = left[_peaks(residuals)]
            left = left[residuals > _RESIDUAL]
        return result

    def output(self, s: complex) -> AnyArray:
        """Compute bᵢᵀ x_j at s within the space, (rights, rights)."""
        return np.asarray(self._within(np.array([s]))[0][0])

    def _within(self, points: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Solve within the space; bᵢᵀ x_j, and the largest residual over the right-hand side."""
        weights = np.array([self.factors(s) for s in points.tolist()], complex)
        small = np.tensordot(weights, [self._basis.T @ part for part in self._by_matrix], 1)
        right = self._basis.T @ self.right
        found = np.linalg.solve(small, np.broadcast_to(right, (len(points), *right.shape)))
        count = right.shape[1]
        columns = found.transpose(1, 0, 2)  # (basis, points, rights)
        left = np.tile(self.right, (1, len(points))).astype(complex)
        for number, part in enumerate(self._by_matrix):
            scaled = (weights[:, number, None] * columns).reshape(len(columns), -1)
            left -= part @ scaled.real + 1j * (part @ scaled.imag)
        norms = np.linalg.norm(left, axis=0).reshape(-1, count)
        sizes = np.linalg.norm(self.right, axis=0)
        return right.T @ found, (norms / np.where(sizes > 0, sizes, 1.0)).max(axis=1)

    def _add(self, solutions: AnyArray) -> None:
        """Add solutions to the space, by the part of each that is outside of it."""
        for column in solutions.T:
            size, new = float(np.linalg.norm(column)), column
            for _ in range(2):
                new = new - self._basis @ (self._basis.T @ new)
            beyond = float(np.linalg.norm(new))
            if not beyond > _NEW * size:
                continue
            new = (new / beyond)[:, None]
            self._basis = np.hstack([self._basis, new])
            self._by_matrix = [np.hstack([products, matrix @ new]) for products, matrix
                               in zip(self._by_matrix, self.matrices, strict=True)]


def _peaks(residuals: AnyArray) -> AnyArray:
    """Find the places of the largest residual and of other peaks near it, unless all are small."""
    beside = np.pad(residuals, 1, constant_values=-1.0)
    peak = (residuals >= beside[:-2]) & (residuals > beside[2:])
    high = residuals >= max(_PEAK * residuals.max(initial=0.0), np.nextafter(_RESIDUAL, 1.0))
    return np.flatnonzero(peak & high)


def _on_one_pattern(matrices: Sequence[csc_matrix]) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Write matrices of one size on their common sparsity: indices, indptr, (matrices, entries)."""
    size = matrices[0].shape[0]
    keys = []
    for matrix in matrices:
        matrix.sum_duplicates()
        columns = np.repeat(np.arange(size, dtype=np.int64), np.diff(matrix.indptr))
        keys.append(columns * size + matrix.indices)
    every = np.unique(np.concatenate(keys))
    data = np.zeros((len(matrices), len(every)))
    for row, key, matrix in zip(data, keys, matrices, strict=True):
        row[np.searchsorted(every, key)] = matrix.data
    ends = np.searchsorted(every, np.arange(size + 1, dtype=np.int64) * size)
    return (every % size).astype(np.int32), ends.astype(np.int32), data
