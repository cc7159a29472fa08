"""Values along time by how they went with the voltage and time."""

from __future__ import annotations

import numpy as np

from tympan.base.arrays import Array

#: What is added to the squares of least squares: where voltages hardly differ these say nothing,
#: and a guess stays near the last value.
_ALIKE = 1e-10
#: The square of a voltage that is none [V²], so that nothing is divided by 0.
_NO_VOLTAGE = 1e-12


def by_voltages(time: Array, squared: Array, values: Array, later: Array, ahead: Array) -> Array:
    """Values at later times from the last one on, by how they went with U², U⁴ and time.

    ``squared``: U² [V²] at the times, shape (..., times), and ``ahead`` at the later ones; values
    have the shape (..., times, n), times no unit. By least squares.
    """
    largest = max(squared.max(), ahead.max(), _NO_VOLTAGE)
    terms, last = _terms(time, squared / largest), values[..., -1:, :]
    change = terms - terms[..., -1:, :]
    following = _terms(later, ahead / largest) - terms[..., -1:, :]
    turned = change.swapaxes(-1, -2)
    shares = np.linalg.solve(turned @ change + _ALIKE * np.eye(3), turned @ (values - last))
    return np.asarray(last + following @ shares)


def _terms(time: Array, squared: Array) -> Array:
    """Terms that values are taken to be a sum of, shape (..., times, 3)."""
    terms = np.empty((*squared.shape, 3))
    terms[..., 0], terms[..., 1], terms[..., 2] = time, squared, squared * squared
    return terms
