"""Which laws a film can be made of: true stress must grow with stretch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.specimen import Material

Array = NDArray[np.float64]

#: Stretches over which a material must be admissible: beyond them a film tears.
STRETCH_RANGE = (0.5, 6.0)


def reachable_stretches(material: Material, lowest: float = STRETCH_RANGE[0], highest: float = STRETCH_RANGE[1]
                        ) -> tuple[Array, Array]:
    """A grid of principal stretches λ₁ ≥ λ₂ in a range, the virgin state included, where W is not infinite.

    No stretch is above ``highest``, none in the plane below ``lowest``.
    """
    grid = np.append(np.geomspace(lowest, highest, 61), 1.0)
    l1, l2 = (axis.ravel() for axis in np.meshgrid(grid, grid))
    inside = (l1 >= l2) & (l1 * l2 >= 1 / highest)
    l1, l2 = l1[inside], l2[inside]
    with np.errstate(all="ignore"):
        reached = ~np.isposinf(np.real(material.derivatives(l1, l2)[0]))
    return l1[reached], l2[reached]


def inadmissible_stretch(material: Material, lowest: float = STRETCH_RANGE[0], highest: float = STRETCH_RANGE[1]
                         ) -> tuple[float, float] | None:
    """The first stretches (λ₁, λ₂) in a range where the law softens against every intuition, or None.

    Hill's inequality for incompressible solids: W must be convex in the logarithms of the stretches (Ogden,
    *Non-Linear Elastic Deformations*, §6.2.7), so that true stress grows with stretch in every direction.
    Stretches that the law cannot reach, W = +∞, are left out.
    """
    l1, l2 = reachable_stretches(material, lowest, highest)
    with np.errstate(all="ignore"):
        _, w1, w2, w11, w12, w22 = (np.broadcast_to(value, l1.shape) for value in material.derivatives(l1, l2))
        h11, h22, h12 = l1**2 * w11 + l1 * w1, l2**2 * w22 + l2 * w2, l1 * l2 * w12
        bad = ~((h11 > 0) & (h22 > 0) & (h11 * h22 - h12**2 > 0))
    if not bad.any():
        return None
    worst = np.argmin(np.where(bad, np.log(l1) ** 2 + np.log(l2) ** 2, np.inf))
    return float(l1[worst]), float(l2[worst])


def checked(material: Material) -> Material:
    """The material itself, if it is admissible over :data:`STRETCH_RANGE`, as far as it can be stretched."""
    stretch = inadmissible_stretch(material)
    if stretch is not None:
        reach = reachable_stretches(material)[0].max()
        limit = f" (of which it reaches {reach:.2g} at most)" if reach < STRETCH_RANGE[1] else ""
        raise InputError(
            "is outside its admissible range: true stress must grow with stretch (Hill's inequality) for "
            f"stretches from {STRETCH_RANGE[0]} to {STRETCH_RANGE[1]}{limit}, but it falls at "
            f"({stretch[0]:.3g}, {stretch[1]:.3g})", given=str(material))
    return material
