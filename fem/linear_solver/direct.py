"""Direct solution of sparse symmetric systems; what depends on the sparsity is done once.

SciPy's SuperLU in an order by nested dissection is the default. MKL's PARDISO takes its place above
``PARDISO_PAYS`` unknowns where pypardiso is installed (the extra ``fast``). ``docs/scaling.md``
has what was measured.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from tympan.fem.linear_solver.pardiso import Pardiso, PardisoFactors
from tympan.fem.linear_solver.superlu import SuperLU, SuperLUFactors

Array = NDArray[Any]

#: What all symmetric matrices with one sparsity have in common; a factorised one of them.
Analysis = SuperLU | Pardiso
Factorisation = SuperLUFactors | PardisoFactors

#: Unknowns above which PARDISO is faster than SuperLU over a path of a few factorisations.
PARDISO_PAYS = 20_000


def analyse(indices: Array, indptr: Array, order: Array | None = None) -> Analysis:
    """Analysis for the fastest solver installed.

    Parameters
    ----------
    indices, indptr
        Sparsity in compressed columns, rows ascending, both triangles, the diagonal included.
    order
        Unknowns in an order of elimination that fills in little; by default minimum degree.
    """
    if len(indptr) - 1 >= PARDISO_PAYS and find_spec("pypardiso") is not None:
        return Pardiso(indices, indptr)
    return SuperLU(indices, indptr, order)


def factorise(matrix: csc_matrix, analysis: Analysis | None = None) -> Factorisation:
    """Factorise a sparse symmetric matrix, best with the analysis of its sparsity at hand.

    Raises
    ------
    RuntimeError
        If the matrix is singular.

    Examples
    --------
    >>> import numpy as np
    >>> factors = factorise(csc_matrix([[2.0, 1.0], [1.0, -3.0]]))
    >>> factors.solve(np.array([3.0, -2.0])), factors.negative
    (array([1., 1.]), 1)
    """
    return (analysis or analyse(matrix.indices, matrix.indptr)).factorise(matrix)
