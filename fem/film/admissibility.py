"""Where a solved film is stretched to where its law fails."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True)
class FailedCriterion:
    """Where a criterion fails worst: mounted position [m], stretches, and the share of points."""

    criterion: str
    position: tuple[float, float]
    stretches: tuple[float, float]
    share: float

    def __str__(self) -> str:
        x, y = (1e3 * value for value in self.position)
        return (f"the film's law fails {self.criterion} at {100 * self.share:.2g} % of the "
                f"film's points, worst at x {x:.1f} mm, y {y:.1f} mm, where the stretches are "
                f"{self.stretches[0]:.3f} and {self.stretches[1]:.3f}")


def failures(material: Material, position: Array, l1: Array, l2: Array) -> list[FailedCriterion]:
    """The criteria that an elastic law fails at the stretches a state visits.

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
    >>> fails[0].stretches, fails[0].share
    ((8.0, 2.0), 0.5)
    """
    result = []
    for criterion, margin in CRITERIA.items():
        margins = margin(material, l1, l2)
        bad = ~(margins > 0)
        if bad.any():
            worst = int(np.argmin(np.where(bad, np.nan_to_num(margins, nan=-np.inf), np.inf)))
            x, y = position[worst, :2]
            result.append(FailedCriterion(criterion, (float(x), float(y)),
                                  (float(l1[worst]), float(l2[worst])),
                                  float(bad.mean())))
    return result
