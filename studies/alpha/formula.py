"""A formula for α₁ of ellipses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[Any]

#: Radius of the circle whose film is as stiff as that of an endless strip with a small plate in its
#: middle, over the strip's half width: its conformal radius.
_STRIP = 4 / np.pi


@dataclass(frozen=True)
class Formula:
    """α₁(A, q), A = r₂/r₁, q = r/r₁, with four constants c.

    A film under small tension changes pulls like 1/ln(R/r), so one circle of radius s r₁ is as
    stiff as the ellipse: α₁ = (1/ln(s/q) − 1/ln(A/q)) / (1/ln(1/q) − 1/ln(A/q)), with s = 1 + (4/π
    − 1)(1 − A^−p) between the circle (1) and the endless strip (4/π), and p = c₀ + c₁ ln A + c₂ ln²
    A + c₃ q³ ln A. It holds for A and q in ``aspects`` and ``ratios``.
    """

    constants: tuple[float, ...]
    aspects: tuple[float, float]
    ratios: tuple[float, float]

    def __call__(self, aspect: Array, ratio: Array) -> Array:
        """α₁, whether or not the formula holds there.

        Examples
        --------
        >>> formula = Formula((1.83, 0.84, -0.49, -1.44), (1.1, 2.5), (0.1, 0.6))
        >>> round(float(formula(75 / 45, 10 / 45)), 2)
        0.61
        """
        logarithm = np.log(aspect)
        power = np.stack([np.ones_like(logarithm), logarithm, logarithm**2, ratio**3 * logarithm],
                         -1) @ self.constants
        radius = 1 + (_STRIP - 1) * (1 - aspect**-power)
        same, short, long = (1 / np.log(size / ratio) for size in (radius, 1.0, aspect))
        return np.asarray((same - long) / (short - long))

    def holds(self, aspect: float, ratio: float) -> bool:
        """Whether a place is in the range of what it was fitted to."""
        return (self.aspects[0] <= aspect <= self.aspects[1]
                and self.ratios[0] <= ratio <= self.ratios[1])

    def words(self) -> str:
        """The formula with its numbers, to be copied."""
        first, *others = self.constants
        c1, c2, c3 = (f"{constant:+.4f}" for constant in others)
        return (f"p = {first:.4f} {c1} ln A {c2} ln² A {c3} q³ ln A;  s = 1 + (4/π − 1)(1 − "
                "A^−p);  α₁ = (1/ln(s/q) − 1/ln(A/q)) / (1/ln(1/q) − 1/ln(A/q));  A = r₂/r₁, q = "
                "r/r₁")


def fit_formula(aspect: Array, ratio: Array, weight: Array) -> Formula:
    """The formula nearest to α₁ in the mean square, its constants rounded to the places it prints.

    ``aspect``, ``ratio`` and α₁, ``weight``, have shape (readings,).
    """
    aspects, ratios = ((float(item.min()), float(item.max())) for item in (aspect, ratio))
    fit = least_squares(
        lambda constants: Formula(tuple(constants), aspects, ratios)(aspect, ratio) - weight,
        np.array([2.0, 0.0, 0.0, 0.0]), xtol=1e-14, ftol=1e-14)
    return Formula(tuple(round(float(constant), 4) for constant in fit.x), aspects, ratios)
