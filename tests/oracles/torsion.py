"""A stretched annulus whose hub is turned: tension-field theory in one variable.

The film is neo-Hookean, W = mu/2 (l1^2 + l2^2 + l3^2 - 3), and wrinkles where its smaller stretch
would fall below the natural width l1^(-1/2) (Pipkin 1986). In polar coordinates the deformation is
r(R), theta(R); its energy, relaxed, is minimised over both on linear elements, evenly spaced in
log R. Wrinkling of a turned hub's film by tension-field theory: Reissner 1938; Mikulas, NASA TN
D-2456, 1964, finds its onset, at small strains, where the shear stress at the hub is the prestress.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from tympan.base.arrays import Array


class Turned(NamedTuple):
    """Torque on the hub [N m] and the share of the mounted film that is wrinkled."""

    torque: float
    wrinkled: float


def turned_hub(mu: float, prestretch: float, thickness: float, inner: float, outer: float,
               angle: float, count: int = 200) -> Turned:
    """A film of shear modulus ``mu`` [Pa], its hub turned by an ``angle`` [rad]; lengths in m."""
    nodes = inner * (outer / inner) ** np.linspace(0, 1, count + 1)
    middle, width = np.sqrt(nodes[1:] * nodes[:-1]), np.diff(nodes)
    area = 2 * np.pi * middle * width
    weight, square = area * thickness / prestretch**2, prestretch**2

    def energy(unknowns: Array) -> tuple[float, Array, Array]:
        """Energy [J], its derivatives by r and theta of all nodes, where it is wrinkled."""
        radius = np.concatenate([[inner], inner * unknowns[: count - 1], [outer]])
        turn = np.concatenate([[angle], unknowns[count - 1 :], [0.0]])
        r, r_slope, slope = (radius[1:] + radius[:-1]) / 2, np.diff(radius) / width, \
            np.diff(turn) / width
        c11, c22 = square * (r_slope**2 + r**2 * slope**2), square * (r / middle) ** 2
        c12 = square * r**2 * slope / middle
        mean, half = (c11 + c22) / 2, (c11 - c22) / 2
        size = np.hypot(half, c12)
        first, second = mean + size, mean - size  # squares of the stretches
        loose = second < first**-0.5
        second = np.maximum(second, first**-0.5)
        value = mu / 2 * (first + second + 1 / (first * second) - 3)
        by_first = mu / 2 * (1 - 1 / (first**2 * second))
        by_second = np.where(loose, 0.0, mu / 2 * (1 - 1 / (first * second**2)))
        by11 = weight * (by_first * (1 + half / size) + by_second * (1 - half / size)) / 2
        by22 = weight * (by_first * (1 - half / size) + by_second * (1 + half / size)) / 2
        by12 = weight * (by_first - by_second) * c12 / size
        by_r_slope = by11 * 2 * square * r_slope
        by_slope = by11 * 2 * square * r**2 * slope + by12 * square * r**2 / middle
        by_r = 2 * square * r * (by11 * slope**2 + by22 / middle**2 + by12 * slope / middle)
        by = np.zeros((2, count + 1))
        by[0, 1:] += by_r_slope / width + by_r / 2
        by[0, :-1] += by_r / 2 - by_r_slope / width
        by[1, 1:] += by_slope / width
        by[1, :-1] -= by_slope / width
        return float(weight @ value), by, loose

    def scaled(unknowns: Array) -> tuple[float, Array]:
        value, by, _ = energy(unknowns)
        return 1e3 * value, 1e3 * np.concatenate([inner * by[0, 1:-1], by[1, 1:-1]])

    inside = nodes[1:-1]
    start = angle * (inside**-2 - outer**-2) / (inner**-2 - outer**-2)
    best = minimize(scaled, np.concatenate([inside / inner, start]), jac=True, method="L-BFGS-B",
                    options={"maxiter": 20_000, "maxfun": 40_000, "ftol": 1e-15, "gtol": 1e-9,
                             "maxcor": 40})
    _, by, loose = energy(best.x)
    return Turned(float(by[1, 0]), float(area[loose].sum() / area.sum()))
