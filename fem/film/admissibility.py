"""Where a solved film is stretched to where its law fails."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.laws import ellipticity_margin, hill_margin
from tympan.geometry.specimen import Material

Array = NDArray[np.float64]

#: What may fail, in the words of a warning, and its margin [Pa], positive where it holds.
CRITERIA = {
    "Hill's inequality (true stress must grow with stretch)": hill_margin,
    "strong ellipticity within the film": ellipticity_margin,
}


def failures(material: Material, position: Array, l1: Array, l2: Array) -> list[str]:
    """What fails of an elastic law at the stretches a state visits, where worst, and how widely.

    Parameters
    ----------
    position
        Of the points in the mounted film [m], shape (n, 2 or 3).
    l1, l2
        Principal stretches from the virgin film at the points, shape (n,).

    Examples
    --------
    >>> from tympan.fem.film.laws import Ogden
    >>> falling = Ogden((20e3, -200.0), (2.0, 4.0))
    >>> places = np.array([[0.0, 0.0], [0.01, 0.0]])
    >>> fails = failures(falling, places, np.array([2.0, 8.0]), np.array([2.0, 2.0]))
    >>> fails[0][-60:]
    'x 10.0 mm, y 0.0 mm, where the stretches are 8.000 and 2.000'
    """
    result = []
    for criterion, margin in CRITERIA.items():
        margins = margin(material, l1, l2)
        fails = ~(margins > 0)
        if fails.any():
            worst = np.argmin(np.where(fails, np.nan_to_num(margins, nan=-np.inf), np.inf))
            x, y = 1e3 * position[worst, :2]
            result.append(
                f"the film's law fails {criterion} at {100 * fails.mean():.2g} % of the film's "
                f"points, worst at x {x:.1f} mm, y {y:.1f} mm, where the stretches are "
                f"{l1[worst]:.3f} and {l2[worst]:.3f}")
    return result
