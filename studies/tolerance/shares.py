"""Shares of a variance: Sobol's indices of groups of inputs, by Saltelli's design.

A. Saltelli and others, Comput. Phys. Commun. 181, 259 (2010): two samples A and B of all inputs,
and for each group of inputs one sample with this group from B and all other inputs from A. That
paper lists two estimates of each index: one is exact where the group has no effect, one where it
causes the whole variance. Here an index is a mean of both, weighted by its distance from either
end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.points import drawn_points

#: Standard deviations between a share and its limits of 95 %.
_LIMITS = 1.96


@dataclass(frozen=True, eq=False)
class SaltelliDesign:
    """Samples of inputs, uniform from 0 to 1, shape (samples, size, inputs): A, B, each group's.

    ``groups``: the inputs of each group, (groups, inputs).
    """

    uniform: Array
    groups: Mask

    @classmethod
    def drawn(cls, groups: Sequence[Sequence[bool]], count: int, seed: int) -> SaltelliDesign:
        """Draw about ``count`` points of Sobol's sequence, whose length is a power of two."""
        chosen = np.array(groups, dtype=bool)
        inputs = chosen.shape[1]
        power = max(4, round(np.log2(count / (len(chosen) + 2))))
        first, second = np.split(drawn_points(2 * inputs, 2**power, seed), 2, axis=1)
        mixed = [np.where(group, second, first) for group in chosen]
        return cls(np.array([first, second, *mixed]), chosen)

    @property
    def points(self) -> Array:
        """All points, (samples × size, inputs)."""
        return self.uniform.reshape(-1, self.uniform.shape[2])

    def part(self, share: float) -> tuple[SaltelliDesign, Numbers]:
        """Take the first points, a power of two's part of them, and their numbers."""
        samples, size, _ = self.uniform.shape
        count = max(16, round(share * size))
        numbers = size * np.arange(samples)[:, None] + np.arange(count)
        return replace(self, uniform=self.uniform[:, :count]), numbers.ravel()

    def independent(self, some: Mask) -> float:
        """Count the independent films that determine a share as well as the films at all points.

        ``some``: a mask of films. The films of a row share inputs, so they are correlated. The
        variance between rows shows the effective number (Kish, *Survey Sampling*, 1965, section
        5.4). It is at least the number of rows. If the share is 0 or 1, it is two films per row,
        those that share no inputs.
        """
        table = some.reshape(len(self.uniform), -1)
        share, rows = float(table.mean()), table.shape[1]
        if share in (0.0, 1.0):
            return 2.0 * rows
        scatter = float(table.mean(0).var()) / rows
        return float(np.clip(share * (1 - share) / max(scatter, 1e-300), rows, some.size))

    def shares(self, values: Array) -> Shares:
        """Divide the variance of values at all points; a row with a nan is left out."""
        table = np.asarray(values, dtype=float).reshape(len(self.uniform), -1)
        there = np.isfinite(table).all(0)
        first, second, *others = table[:, there] - table[:2, there].mean()
        mixed, scores = np.array(others), self.uniform[:2, there] - 0.5
        # The effect of a group in B does not depend on B's other inputs. So the linear part of
        # these may be subtracted from B's values: the means stay, and scatter less.
        slopes, *_ = np.linalg.lstsq(np.concatenate(scores), np.append(first, second))
        own = second - np.where(self.groups, 0.0, slopes) @ scores[1].T
        variance = (first**2 + second**2) / 2
        alone, off = _weighted(own * (mixed - first), variance - (second - mixed) ** 2 / 2,
                               variance)
        total, _ = _weighted((first - mixed) ** 2 / 2, variance - first * (mixed - second),
                             variance)
        return Shares(alone, total, alone - off, alone + off)


def _weighted(one: Array, other: Array, variance: Array) -> tuple[Array, Array]:
    """Compute a share of the variance from two estimates, with its limits of 95 %, (groups,).

    The estimates (groups, rows) and the variance (rows,) are each row's contributions to their
    means. ``one`` is exact where the share is 0, ``other`` where it is 1.
    """
    whole = variance.mean()
    first = np.clip(one.mean(1, keepdims=True) / whole, 0.0, 1.0)
    weight = (1 - first) ** 2 / ((1 - first) ** 2 + first**2)
    parts = weight * one + (1 - weight) * other
    share = parts.mean(1) / whole
    # Error of the share as a ratio, from each row's contribution; with Sobol's points it is less.
    off = (parts - share[:, None] * variance).std(1)
    return share, _LIMITS * off / (whole * len(variance) ** 0.5)


@dataclass(frozen=True, eq=False)
class Shares:
    """Shares of each group: ``alone``, with limits of 95 %, and in ``total`` with interactions."""

    alone: Array
    total: Array
    low: Array
    high: Array
