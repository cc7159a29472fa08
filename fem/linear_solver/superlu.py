"""SciPy's SuperLU for symmetric matrices in a given order; counts negative eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

Array = NDArray[Any]

#: A multiplier of the elimination above this has cost so many digits that the pivots' signs are not
#: trusted.
_GROWTH = 1e6

#: Order up to which eigenvalues are simply computed where pivots will not do.
_DENSE = 300


@dataclass(frozen=True, eq=False)
class SuperLU:
    """SciPy's sparse LU in a given order, pivots on the diagonal: LDLᵀ in all but name."""

    indices: Array
    indptr: Array
    order: Array | None = None

    def factorise(self, matrix: csc_matrix) -> SuperLUFactors:
        """Factorise; rows are exchanged only where a pivot is exactly zero."""
        spec = "MMD_AT_PLUS_A" if self.order is None else "NATURAL"
        options = {"SymmetricMode": True}
        factors = splu(self._permuted(matrix), permc_spec=spec, diag_pivot_thresh=0.0,
                       options=options)
        return SuperLUFactors(factors, self.order, matrix)

    def _permuted(self, matrix: csc_matrix) -> csc_matrix:
        if self.order is None:
            return matrix
        source, indices, indptr = self._permutation
        return csc_matrix((matrix.data[source], indices, indptr), matrix.shape)

    @cached_property
    def _permutation(self) -> tuple[Array, Array, Array]:
        """For the permuted matrix: the place of each entry in the given one, and its sparsity."""
        count = len(self.indptr) - 1
        places = csc_matrix((np.arange(len(self.indices), dtype=np.int32), self.indices,
                             self.indptr), (count, count))
        permuted = places[:, self.order][self.order]
        permuted.sort_indices()
        return permuted.data, permuted.indices, permuted.indptr


@dataclass(frozen=True, eq=False)
class SuperLUFactors:
    """Factors by SuperLU, the order their rows and columns are in, and the matrix they are of."""

    factors: Any
    order: Array | None
    matrix: csc_matrix

    def solve(self, right: Array) -> Array:
        """Solution for right-hand sides of shape (n,) or (n, k)."""
        if self.order is None:
            return np.asarray(self.factors.solve(right))
        solution = np.empty(right.shape)
        solution[self.order] = self.factors.solve(right[self.order])
        return solution

    @cached_property
    def negative(self) -> int:
        """Number of negative eigenvalues.

        SciPy copies the factors to show their pivots, and keeps the copy as long as this.
        """
        lower, pivots = self.factors.L, self.factors.U.diagonal()
        reach = np.maximum(np.maximum.reduceat(lower.data, lower.indptr[:-1]),
                           -np.minimum.reduceat(lower.data, lower.indptr[:-1]))
        position = np.argsort(self.factors.perm_c)
        doubtful = (reach > _GROWTH) | (self.factors.perm_r[position] != np.arange(len(pivots)))
        if not doubtful.any():
            return int(np.count_nonzero(pivots < 0))
        last = position[doubtful] if self.order is None else self.order[position[doubtful]]
        return negative_eigenvalues(self.matrix, last)


def negative_eigenvalues(matrix: csc_matrix, last: Array) -> int:
    """Number of negative eigenvalues of a symmetric matrix, some unknowns eliminated last.

    By Haynsworth's additivity: those of the rest, and those of the Schur complement of the rest.
    """
    count = matrix.shape[0]
    if count <= _DENSE or len(last) == count:
        return int(np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0))
    rest = np.setdiff1d(np.arange(count), last)
    factors = SuperLU(matrix.indices, matrix.indptr).factorise(csc_matrix(matrix[rest][:, rest]))
    coupling = matrix[rest][:, last].toarray()
    complement = matrix[last][:, last].toarray() - coupling.T @ factors.solve(coupling)
    return factors.negative + int(np.count_nonzero(np.linalg.eigvalsh((complement + complement.T)
                                                                      / 2) < 0))
