"""Rays from a place within an outline, and where they leave it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from tympan.base.arrays import Array, Mask

#: Places on a ray that are tested for lying inside. A part of an outline that is thinner than the
#: distance from one place to the next may be missed. Set by trial.
_SOUGHT = 400
#: Halvings of the interval that holds the edge, down to rounding errors.
_HALVINGS = 50


class Bounded(Protocol):
    """An object with an inside, such as an outline or a plate."""

    def level(self, x: Array, y: Array) -> Array:
        """Negative inside, zero on the edge [m]."""


def exits(inside: Bounded, centre: Array, way: Array, far: float) -> Array:
    """Distances at which rays first leave an outline [m], shape (n,).

    ``centre`` has shape (2, 1), ``way`` (2, n); ``far`` is a distance beyond the outline [m].
    """
    radius = np.linspace(0, far, _SOUGHT)[:, None]
    first = outside(inside, centre, way, far).argmax(axis=0)
    low, high = radius[first - 1, 0], radius[first, 0]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        beyond = inside.level(*(centre + way * middle)) > 0
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return np.asarray((low + high) / 2)


def outside(inside: Bounded, centre: Array, way: Array, far: float) -> Mask:
    """Test whether places on rays, from the centre to ``far``, lie outside, shape (places, n)."""
    radius = np.linspace(0, far, _SOUGHT)[:, None]
    return inside.level(*(centre[:, None] + way[:, None] * radius)) > 0
