"""MKL's PARDISO by pypardiso; imported only where it is installed.

It runs on one thread unless the environment variable MKL_NUM_THREADS says otherwise.
"""

from __future__ import annotations

import os
import weakref
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from tympan.base.arrays import AnyArray

_SYMMETRIC_INDEFINITE = -2

#: The phase in which PARDISO orders a matrix and finds the pattern of its factors, in the numbers
#: of its manual.
_ANALYSE = 11
#: The phase in which it factorises the matrix.
_FACTORISE = 22
#: The phase in which it solves by the factors.
_SOLVE = 33

#: Settings, numbered from 1: no defaults; nested dissection; pivots below 1e-10 are perturbed;
#: pivots of order 1 and 2.
_SETTINGS = {1: 1, 2: 2, 10: 10, 21: 1}

#: Index of the report of perturbed pivots.
_PERTURBED = 14
#: Index of the report of negative pivots.
_NEGATIVE = 23


class Pardiso:
    """Analyses of one sparsity, each for one factorisation at a time.

    A factorisation that nothing refers to any more returns its analysis. So a path needs as many
    analyses as it has tangents at once.
    """

    def __init__(self, indices: AnyArray, indptr: AnyArray) -> None:
        column = np.repeat(np.arange(len(indptr) - 1, dtype=np.int32), np.diff(indptr))
        # PARDISO reads the upper triangle by rows, which equals the lower one by columns.
        self._lower = indices >= column
        counts = np.bincount(column[self._lower], minlength=len(indptr) - 1)
        self._rows = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        self._columns = indices[self._lower].astype(np.int32)
        self.idle: list[Any] = []
        weakref.finalize(self, _release, self.idle).atexit = False

    def factorise(self, matrix: csc_matrix) -> PardisoFactors:
        """Factorise a matrix of this sparsity; raises RuntimeError if it is singular."""
        upper = csr_matrix((matrix.data[self._lower], self._columns, self._rows), matrix.shape)
        solver = self.idle.pop() if self.idle else _analysed(upper)
        factors = PardisoFactors(solver, upper)
        weakref.finalize(factors, _give_back, weakref.ref(self), solver).atexit = False
        _call(solver, _FACTORISE, upper)
        return factors


class PardisoFactors:
    """Factors held by the library."""

    def __init__(self, solver: Any, upper: csr_matrix) -> None:
        self._solver, self._upper = solver, upper

    def solve(self, right: AnyArray) -> AnyArray:
        """Solve for right-hand sides of shape (n,) or (n, k)."""
        columns = np.array(right, dtype=float, order="F")
        return _call(self._solver, _SOLVE, self._upper, columns) if columns.size else columns

    @property
    def perturbed(self) -> bool:
        """Whether a pivot was too small and replaced, so that the factors are of another matrix."""
        return bool(self._solver.get_iparm(_PERTURBED))

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues, by Sylvester's law from the pivots."""
        return int(self._solver.get_iparm(_NEGATIVE))


def _analysed(upper: csr_matrix) -> Any:
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=_SYMMETRIC_INDEFINITE)
    for number, value in _SETTINGS.items():
        solver.set_iparm(number, value)
    # One thread gives bitwise the same result every time, and workers of a sweep do not wait for
    # each other's threads.
    if "MKL_NUM_THREADS" not in os.environ:
        solver.libmkl.MKL_Set_Num_Threads(1)
    _call(solver, _ANALYSE, upper)
    return solver


def _call(solver: Any, phase: int, upper: csr_matrix, right: AnyArray | None = None) -> AnyArray:
    from pypardiso.pardiso_wrapper import PyPardisoError

    solver.set_phase(phase)
    try:
        return np.asarray(solver._call_pardiso(upper, np.zeros(1) if right is None else right))
    except PyPardisoError as error:
        raise RuntimeError(f"PARDISO gave up with error {error.value}; -4 means a singular "
                           "matrix") from None


def _give_back(analysis: weakref.ref[Pardiso], solver: Any) -> None:
    """Keep one analysis ready; more are released with their factors."""
    pardiso = analysis()
    if pardiso is not None and not pardiso.idle:
        pardiso.idle.append(solver)
    else:
        _release([solver])


def _release(solvers: list[Any]) -> None:
    for solver in solvers:
        solver.free_memory(everything=True)
