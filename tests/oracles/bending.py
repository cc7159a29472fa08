"""A stretched strip bent in its plane: tension-field theory in one variable.

The strip is neo-Hookean, W = mu/2 (l1^2 + l2^2 + l3^2 - 3). Bent to a constant curvature its lines
along X become arcs of radii r(Y) and its lines along Y radii; where the stretch along the arcs
would fall below the natural width l2^(-1/2), it wrinkles across them. Equilibrium across the strip
is dP2/dY = k P1 with nominal forces P1, P2 per mounted length and k the angle per mounted length
along X: the sides carry the loads that keep a bent strip under tension from straightening. At
small strains moment and curvature are those of Stein and Hedgepeth, NASA TN D-813, 1961.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from tympan.base.arrays import Array


class Bent(NamedTuple):
    """Moment about the middle between the sides [N m], its radius [m], sides' loads [N/m].

    ``sides`` pull away from the strip, per mounted length; the inner side is first. ``wrinkled`` is
    the share of the width.
    """

    moment: float
    radius: float
    sides: tuple[float, float]
    wrinkled: float


@dataclass(frozen=True)
class Strip:
    """A film of shear modulus ``mu`` [Pa] and virgin thickness [m], stretched alike both ways."""

    mu: float
    prestretch: float
    thickness: float
    width: float  #: mounted, between its sides [m]

    @property
    def tension(self) -> float:
        """Nominal force per mounted length when flat [N/m]."""
        return self._nominal(self.prestretch, self.prestretch)

    def _nominal(self, stretch: float, across: float) -> float:
        """Force per mounted length along ``stretch`` [N/m]."""
        scale = self.thickness / self.prestretch
        return float(scale * self.mu * (stretch - stretch**-3 * across**-2))

    def _across(self, force: float, along: float) -> float:
        """Stretch across the strip at a force per mounted length and a stretch along it."""
        def gap(stretch: float) -> float:
            return self._nominal(stretch, max(along, stretch**-0.5)) - force
        return float(brentq(gap, 0.2, 3 * self.prestretch, xtol=1e-14))

    @cache  # noqa: B019 - a strip is a few numbers
    def bent(self, curvature: float, force: float) -> Bent:
        """By an angle per mounted length [1/m], under a force along it [N].

        Loads of the sides are the flat film's tension on average.
        """
        def slopes(_: float, state: Array) -> list[float]:
            radius, across_force = state[:2]
            along = self.prestretch * curvature * radius
            across = self._across(across_force, along)
            pull = max(self._nominal(along, across), 0.0)
            return [across / self.prestretch, curvature * pull, pull * radius, float(pull == 0)]

        def profile(unknowns: Array) -> Array:
            start = [unknowns[0] / curvature, unknowns[1] * self.tension, 0.0, 0.0]
            solution = solve_ivp(slopes, (0, self.width), start, rtol=1e-10, atol=1e-13,
                                 max_step=self.width / 100)
            return np.column_stack([start, solution.y[:, -1]])

        def miss(unknowns: Array) -> list[float]:
            (_, inner), (_, outer) = profile(unknowns)[:2].T
            return [(outer - inner) / (curvature * force) - 1,
                    (outer + inner) / (2 * self.tension) - 1]

        solution = root(miss, [1 - curvature * self.width / 2, 1.0], tol=1e-11)
        radii, across, moments, loose = profile(solution.x)
        return Bent(float(moments[1] - force * radii.mean()), float(radii.mean()),
                    (float(across[0]), float(across[1])), float(loose[1] / self.width))
