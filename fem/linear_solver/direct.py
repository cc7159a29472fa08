"""Direct solution of sparse symmetric systems; what depends on the sparsity is done once.

SciPy's SuperLU in an order by nested dissection is the default. MKL's PARDISO takes its place above
``PARDISO_PAYS`` unknowns where pypardiso is installed (the extra ``fast``). ``docs/scaling.md``
has what was measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from tympan.base.arrays import AnyArray
from tympan.base.system import silent
from tympan.fem.linear_solver.pardiso import Pardiso, PardisoFactors

#: Unknowns above which PARDISO is faster than SuperLU over a path of a few factorisations.
PARDISO_PAYS = 20_000

#: A multiplier of the elimination above this has cost so many digits that the pivots' signs are not
#: trusted.
_GROWTH = 1e6

#: Order up to which eigenvalues are simply computed where pivots will not do.
_DENSE = 300


@dataclass(frozen=True)
class SuperLU:
    """SciPy's sparse LU, pivots on the diagonal: LDLᵀ in all but name.

    Unknowns are eliminated in the order they have where that is ``ordered`` to fill in little, else
    by minimum degree.
    """

    ordered: bool = False

    def factorise(self, matrix: csc_matrix) -> SuperLUFactors:
        """Factorise; rows are exchanged only where a pivot is exactly zero."""
        spec = "NATURAL" if self.ordered else "MMD_AT_PLUS_A"
        with silent():  # SuperLU prints where it gets no memory, besides raising
            factors = splu(matrix, permc_spec=spec, diag_pivot_thresh=0.0,
                           options={"SymmetricMode": True})
        return SuperLUFactors(factors, matrix)


@dataclass(frozen=True, eq=False)
class SuperLUFactors:
    """Factors by SuperLU, and the matrix they are of."""

    factors: Any
    matrix: csc_matrix

    def solve(self, right: AnyArray) -> AnyArray:
        """Solution for right-hand sides of shape (n,) or (n, k)."""
        return np.asarray(self.factors.solve(right))

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
        return _negative_eigenvalues(self.matrix, position[doubtful])


def _negative_eigenvalues(matrix: csc_matrix, last: AnyArray) -> int:
    """Those of the unknowns but the ``last``, and of their Schur complement (Haynsworth)."""
    count = matrix.shape[0]
    if count <= _DENSE or len(last) == count:
        return int(np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0))
    rest = np.setdiff1d(np.arange(count), last)
    factors = SuperLU().factorise(csc_matrix(matrix[rest][:, rest]))
    coupling = matrix[rest][:, last].toarray()
    complement = matrix[last][:, last].toarray() - coupling.T @ factors.solve(coupling)
    values = np.linalg.eigvalsh((complement + complement.T) / 2)
    return factors.negative + int(np.count_nonzero(values < 0))


#: What all symmetric matrices with one sparsity have in common; a factorised one of them.
Analysis = SuperLU | Pardiso
Factorisation = SuperLUFactors | PardisoFactors


def analyse(indices: AnyArray, indptr: AnyArray, ordered: bool = False) -> Analysis:
    """Analysis for the fastest solver installed.

    ``indices`` and ``indptr``: sparsity in compressed columns, rows ascending, both triangles, the
    diagonal included; ``ordered``: whether the unknowns' own order fills in little.
    """
    if len(indptr) - 1 >= PARDISO_PAYS and find_spec("pypardiso") is not None:
        return Pardiso(indices, indptr)
    return SuperLU(ordered)


def factorise(matrix: csc_matrix, analysis: Analysis | None = None) -> Factorisation:
    """Factorise a sparse symmetric matrix, best with the analysis of its sparsity at hand.

    A singular matrix is a RuntimeError.

    Examples
    --------
    >>> import numpy as np
    >>> factors = factorise(csc_matrix([[2.0, 1.0], [1.0, -3.0]]))
    >>> factors.solve(np.array([3.0, -2.0])), factors.negative
    (array([1., 1.]), 1)
    """
    factors = (analysis or analyse(matrix.indices, matrix.indptr)).factorise(matrix)
    if isinstance(factors, PardisoFactors) and factors.perturbed:
        # SuperLU exchanges rows instead of perturbing pivots.
        return SuperLU().factorise(matrix)
    return factors
