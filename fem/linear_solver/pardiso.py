"""MKL's PARDISO through the library that pypardiso finds; imported only where that is installed.

It runs on one thread unless the environment variable MKL_NUM_THREADS says otherwise.
"""

from __future__ import annotations

import ctypes
import os
import weakref
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

Array = NDArray[Any]

_SYMMETRIC_INDEFINITE = -2
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1

#: Settings other than zero, numbered from 0: not the defaults; nested dissection; pivots below
#: 1e-10 are perturbed; pivots of order 1 and 2; indices from zero.
_SETTINGS = {0: 1, 1: 2, 9: 10, 20: 1, 34: 1}
#: Where PARDISO reports how many pivots it perturbed and how many were negative.
_PERTURBED, _NEGATIVE = 13, 22

#: Where a call needs no values, or no indices.
_NOTHING, _NONE = np.zeros(1), np.zeros(1, dtype=np.int32)


class Pardiso:
    """Analyses of one sparsity, each good for one factorisation at a time.

    A factorisation that nothing refers to any more gives its analysis back, so along a path there
    are as many as tangents alive at once.
    """

    def __init__(self, indices: Array, indptr: Array) -> None:
        column = np.repeat(np.arange(len(indptr) - 1, dtype=np.int32), np.diff(indptr))
        # The lower triangle by columns is the upper one by rows, which is what PARDISO reads.
        self._lower = indices >= column
        counts = np.bincount(column[self._lower], minlength=len(indptr) - 1)
        self._rows = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        self._columns = indices[self._lower].astype(np.int32)
        self._idle: list[_Handle] = []

    def factorise(self, matrix: csc_matrix) -> PardisoFactors:
        """Factorise a matrix of this sparsity; raises RuntimeError if it is singular."""
        handle = self._idle.pop() if self._idle else _Handle(self._rows, self._columns)
        handle.factorise(matrix.data[self._lower])
        factors = PardisoFactors(handle)
        weakref.finalize(factors, _give_back, self._idle, handle)
        return factors


class PardisoFactors:
    """Factors held by the library."""

    def __init__(self, handle: _Handle) -> None:
        self._handle = handle

    def solve(self, right: Array) -> Array:
        """Solution for right-hand sides of shape (n,) or (n, k)."""
        return self._handle.solve(right)

    @property
    def perturbed(self) -> bool:
        """Whether a pivot was too small and replaced, so that the factors are of another matrix."""
        return bool(self._handle.settings[_PERTURBED])

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues, by Sylvester's law from the pivots."""
        return int(self._handle.settings[_NEGATIVE])


class _Handle:
    """One analysis inside the library, and the factors last made with it."""

    def __init__(self, rows: Array, columns: Array) -> None:
        self.settings = np.zeros(64, dtype=np.int32)
        self.settings[list(_SETTINGS)] = list(_SETTINGS.values())
        self._address = np.zeros(64, dtype=np.int64)
        self._rows, self._columns, self._data = rows, columns, np.ones(len(columns))
        self._call(_ANALYSE)
        weakref.finalize(self, _pardiso, self._address, self.settings, _RELEASE).atexit = False

    def factorise(self, data: Array) -> None:
        """Factorise the upper triangle given by rows."""
        self._data = data
        self._call(_FACTORISE)

    def solve(self, right: Array) -> Array:
        """Solution for right-hand sides of shape (n,) or (n, k)."""
        columns = np.array(right, dtype=float, order="F")
        solution = np.empty_like(columns, order="F")
        if columns.size:
            self._call(_SOLVE, columns, solution, columns.size // len(columns))
        return solution

    def _call(self, phase: int, right: Array = _NOTHING, solution: Array = _NOTHING,
              count: int = 1) -> None:
        matrix = self._data, self._rows, self._columns
        error = _pardiso(self._address, self.settings, phase, matrix, right, solution, count)
        if error:
            raise RuntimeError(f"PARDISO gave up with error {error}; -4 means a singular matrix")


def _give_back(idle: list[_Handle], handle: _Handle) -> None:
    """Keep one analysis ready; more are released with their factors."""
    if not idle:
        idle.append(handle)


def _pardiso(address: Array, settings: Array, phase: int,
             matrix: tuple[Array, Array, Array] = (_NOTHING, _NONE, _NONE),
             right: Array = _NOTHING, solution: Array = _NOTHING, count: int = 1) -> int:
    """Call the library with arrays of exactly the types it wants; its error code."""
    data, rows, columns = matrix

    def number(value: int) -> Any:
        return ctypes.byref(ctypes.c_int32(value))

    def pointer(array: Array) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    error = ctypes.c_int32(0)
    _library().pardiso(
        pointer(address), number(1), number(1), number(_SYMMETRIC_INDEFINITE), number(phase),
        number(len(rows) - 1), pointer(data), pointer(rows), pointer(columns), pointer(_NONE),
        number(count), pointer(settings), number(0), pointer(right), pointer(solution),
        ctypes.byref(error))
    return error.value


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    from pypardiso import PyPardisoSolver

    # Its own handle of the library: pypardiso's expects other argument types.
    library = ctypes.CDLL(PyPardisoSolver().libmkl._name)
    library.pardiso.restype = None
    # One thread: bitwise the same result every time, and workers of a sweep do not wait for each
    # other's threads.
    if "MKL_NUM_THREADS" not in os.environ:
        library.MKL_Set_Num_Threads(1)
    return library
