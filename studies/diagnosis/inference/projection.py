"""Orthonormal bases of columns over readings, and the remainder of columns outside a basis."""

from __future__ import annotations

import numpy as np
from scipy.linalg import svd

from tympan.base.arrays import Array, Mask

#: Share of a pattern's column left by projection below which the readings do not determine its
#: direction.
RANK = 1e-3
#: Share of an unknown's column left by projection below which the readings do not determine it. It
#: is smaller since derivatives of a model are more exact than patterns are smooth.
_MOVED = 1e-4
#: Remainder of a column, over the noise, below which the readings cannot separate it from zero.
_UNSEEN = 1e-2


def told_apart(taken: Array, columns: Array) -> Mask:
    """Mark columns with enough left outside the basis ``taken`` to determine their direction."""
    sizes, rest = (np.linalg.norm(part, axis=0) for part in (columns, without(taken, columns)))
    return np.asarray((rest > RANK * sizes) & (rest > _UNSEEN))


def taken_by(jacobian: Array) -> Array:
    """Build a basis of what a model's unknowns absorb."""
    return orthonormal(jacobian, _MOVED)


def orthonormal(columns: Array, least: float = RANK) -> Array:
    """Build an orthonormal basis of the columns' span, without directions they hardly determine."""
    sizes = np.linalg.norm(columns, axis=0)
    columns = columns[:, sizes > 0] / sizes[sizes > 0]
    if not columns.shape[1]:
        return columns
    try:
        basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    except np.linalg.LinAlgError:  # divide and conquer fails on rare matrices, QR steps do not
        basis, sizes, _ = svd(columns, full_matrices=False, lapack_driver="gesvd")
    return np.asarray(basis[:, sizes > least])


def basis_outside(taken: Array, columns: Array) -> Array:
    """Build a basis of columns, over the noise, outside the basis ``taken``."""
    return orthonormal(without(taken, columns[:, told_apart(taken, columns)]))


def without(basis: Array, columns: Array) -> Array:
    """Subtract from columns their part in the span of an orthonormal basis."""
    rest = columns - basis @ (basis.T @ columns)
    return np.asarray(rest - basis @ (basis.T @ rest))
