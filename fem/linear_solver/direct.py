"""Direct solution of sparse symmetric systems; work that depends on the sparsity is done once.

SciPy's SuperLU in an order by nested dissection is the default. MKL's PARDISO takes its place above
``PARDISO_PAYS`` unknowns where pypardiso is installed (the extra ``fast``). ``docs/scaling.md`` has
the measurements.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from tympan.base.arrays import AnyArray
from tympan.base.extras import installed
from tympan.base.system import silent
from tympan.fem.linear_solver.pardiso import Pardiso, PardisoFactors

#: Unknowns above which PARDISO is faster than SuperLU over a path of a few factorisations.
PARDISO_PAYS = 20_000

#: Largest multiplier of an elimination whose pivots' signs are trusted: a larger one has cost too
#: many digits.
_GROWTH = 1e6

#: Order up to which eigenvalues are computed where pivots are not trusted.
_DENSE = 300


@dataclass(frozen=True)
class SuperLU:
    """SciPy's sparse LU with pivots on the diagonal, which amounts to LDLᵀ.

    Unknowns are eliminated in their own order if that is ``ordered`` for little fill-in, else by
    minimum degree.
    """

    ordered: bool = False

    def factorise(self, matrix: csc_matrix) -> SuperLUFactors:
        """Factorise; rows are exchanged only where a pivot is exactly zero."""
        spec = "NATURAL" if self.ordered else "MMD_AT_PLUS_A"
        with silent():  # SuperLU prints when memory is short, besides raising
            factors = splu(matrix, permc_spec=spec, diag_pivot_thresh=0.0,
                           options={"SymmetricMode": True})
        return SuperLUFactors(factors, matrix)


@dataclass(frozen=True, eq=False)
class SuperLUFactors:
    """Factors by SuperLU, with their matrix."""

    factors: Any
    matrix: csc_matrix

    def solve(self, right: AnyArray) -> AnyArray:
        """Solve for right-hand sides of shape (n,) or (n, k)."""
        return np.asarray(self.factors.solve(right))

    @cached_property
    def negative(self) -> int:
        """Number of negative eigenvalues.

        SciPy copies the factors to show their pivots, and keeps the copy as long as the factors.
        """
        lower, pivots = self.factors.L, self.factors.U.diagonal()
        reach = np.maximum(np.maximum.reduceat(lower.data, lower.indptr[:-1]),
                           -np.minimum.reduceat(lower.data, lower.indptr[:-1]))
        position = np.argsort(self.factors.perm_c)
        doubtful = (reach > _GROWTH) | (self.factors.perm_r[position] != np.arange(len(pivots)))
        if not doubtful.any():
            return int(np.count_nonzero(pivots < 0))
        return _negative_eigenvalues(self.matrix, position[doubtful])


def _negative_eigenvalues(matrix: csc_matrix, last: AnyArray) -> int:
    """Count those of the unknowns but the ``last``, and of their Schur complement (Haynsworth)."""
    count = matrix.shape[0]
    if count <= _DENSE or len(last) == count:
        return int(np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0))
    rest = np.setdiff1d(np.arange(count), last)
    factors = SuperLU().factorise(csc_matrix(matrix[rest][:, rest]))
    coupling = matrix[rest][:, last].toarray()
    complement = matrix[last][:, last].toarray() - coupling.T @ factors.solve(coupling)
    values = np.linalg.eigvalsh((complement + complement.T) / 2)
    return factors.negative + int(np.count_nonzero(values < 0))


@dataclass(frozen=True)
class NoFactors:
    """Factors of a matrix without rows: the film of a plate alone has no unknowns."""

    negative: int = 0

    def solve(self, right: AnyArray) -> AnyArray:
        """Solve for right-hand sides of shape (0,) or (0, k)."""
        return right


#: Common data of all symmetric matrices with one sparsity; and one of them, factorised.
Analysis = SuperLU | Pardiso
Factorisation = SuperLUFactors | PardisoFactors | NoFactors


def analyse(indices: AnyArray, indptr: AnyArray, ordered: bool = False) -> Analysis:
    """Analyse a sparsity for the fastest solver installed.

    ``indices`` and ``indptr`` are the sparsity in compressed columns, rows ascending, both
    triangles, with the diagonal; ``ordered`` says that the unknowns' own order has little fill-in.
    """
    if len(indptr) - 1 >= PARDISO_PAYS and installed("pypardiso"):
        return Pardiso(indices, indptr)
    return SuperLU(ordered)


def factorise(matrix: csc_matrix, analysis: Analysis | None = None) -> Factorisation:
    """Factorise a sparse symmetric matrix, best with a given analysis of its sparsity.

    A singular matrix is a RuntimeError.

    Examples
    --------
    >>> import numpy as np
    >>> factors = factorise(csc_matrix([[2.0, 1.0], [1.0, -3.0]]))
    >>> factors.solve(np.array([3.0, -2.0])), factors.negative
    (array([1., 1.]), 1)
    """
    if not matrix.shape[0]:
        return NoFactors()
    factors = (analysis or analyse(matrix.indices, matrix.indptr)).factorise(matrix)
    if isinstance(factors, PardisoFactors) and factors.perturbed:
        # SuperLU exchanges rows instead of perturbing pivots.
        return SuperLU().factorise(matrix)
    return factors
