"""Orthonormal bases of what readings show, and what is left of columns beside them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import svd

from tympan.base.arrays import Array, Mask

#: What is left of a pattern's column, as a share, below which the readings do not tell its
#: direction.
RANK = 1e-3
#: The same of an unknown's column: a model's derivatives are exact to more digits than patterns are
#: smooth.
_MOVED = 1e-4
#: What is left of a column, over the noise, below which the readings do not tell it from nothing.
_UNSEEN = 1e-2


def told_apart(taken: Array, columns: Array) -> Mask:
    """Columns of which enough is left beside what is taken to tell their direction."""
    sizes, rest = (np.linalg.norm(part, axis=0) for part in (columns, without(taken, columns)))
    return np.asarray((rest > RANK * sizes) & (rest > _UNSEEN))


def taken_by(jacobian: Array) -> Array:
    """A basis of what a model's unknowns take up."""
    return orthonormal(jacobian, _MOVED)


def orthonormal(columns: Array, least: float = RANK) -> Array:
    """A basis of the columns' span, each of length 1, without directions they hardly tell."""
    sizes = np.linalg.norm(columns, axis=0)
    columns = columns[:, sizes > 0] / sizes[sizes > 0]
    if not columns.shape[1]:
        return columns
    try:
        basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    except np.linalg.LinAlgError:  # divide and conquer fails on rare matrices, QR steps do not
        basis, sizes, _ = svd(columns, full_matrices=False, lapack_driver="gesvd")
    return np.asarray(basis[:, sizes > least])


def beside(taken: Array, columns: Array) -> Array:
    """A basis of what columns, over the noise, show beside that of what is taken."""
    return orthonormal(without(taken, columns[:, told_apart(taken, columns)]))


def without(basis: Array, columns: Array) -> Array:
    """Columns less their part in the span of an orthonormal basis."""
    rest = columns - basis @ (basis.T @ columns)
    return np.asarray(rest - basis @ (basis.T @ rest))
