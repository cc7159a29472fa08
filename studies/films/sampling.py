"""Extrapolation of values along time as functions of voltage and time."""

from __future__ import annotations

import numpy as np

from tympan.base.arrays import Array

#: Regularisation of the least squares. Nearly equal voltages contain no information, and the
#: extrapolation then stays near the last value.
_ALIKE = 1e-10
#: Squared voltage [V²] that replaces zero, to avoid a division by 0.
_NO_VOLTAGE = 1e-12


def by_voltages(time: Array, squared: Array, values: Array, later: Array, ahead: Array) -> Array:
    """Extrapolate values to later times as functions of U², U⁴ and time, by least squares.

    ``squared``: U² [V²] at the times, shape (..., times). ``ahead``: U² at the later times. Values
    have the shape (..., times, n); times have no unit.
    """
    largest = max(squared.max(), ahead.max(), _NO_VOLTAGE)
    terms, last = _terms(time, squared / largest), values[..., -1:, :]
    change = terms - terms[..., -1:, :]
    following = _terms(later, ahead / largest) - terms[..., -1:, :]
    turned = change.swapaxes(-1, -2)
    shares = np.linalg.solve(turned @ change + _ALIKE * np.eye(3), turned @ (values - last))
    return np.asarray(last + following @ shares)


def _terms(time: Array, squared: Array) -> Array:
    """Compute the terms of the extrapolation, shape (..., times, 3)."""
    terms = np.empty((*squared.shape, 3))
    terms[..., 0], terms[..., 1], terms[..., 2] = time, squared, squared * squared
    return terms
