"""Shares of a variance: Sobol's indices of groups of inputs, by Saltelli's design.

A. Saltelli and others, Comput. Phys. Commun. 181, 259 (2010): two samples A and B of all inputs,
and for each group of inputs one that has this group of B and all else of A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: Standard deviations of a share within its limits of 95 %.
_LIMITS = 1.96


@dataclass(frozen=True, eq=False)
class Design:
    """Samples of inputs, uniform from 0 to 1, shape (samples, size, inputs): A, B, each group's.

    ``groups``: which inputs each has, (groups, inputs).
    """

    uniform: Array
    groups: NDArray[np.bool_]

    @classmethod
    def drawn(cls, groups: Sequence[Sequence[bool]], count: int, seed: int) -> Design:
        """Design of about so many points: Sobol's sequence, whose length is a power of two."""
        from scipy.stats import qmc  # half a second, also for who draws no films

        chosen = np.array(groups, dtype=bool)
        inputs = chosen.shape[1]
        power = max(4, round(np.log2(count / (len(chosen) + 2))))
        sequence = qmc.Sobol(2 * inputs, seed=np.random.default_rng(seed))
        first, second = np.split(sequence.random_base2(power), 2, axis=1)
        mixed = [np.where(group, second, first) for group in chosen]
        return cls(np.array([first, second, *mixed]), chosen)

    @property
    def points(self) -> Array:
        """All points, (samples × size, inputs)."""
        return self.uniform.reshape(-1, self.uniform.shape[2])

    def part(self, share: float) -> tuple[Design, NDArray[np.int64]]:
        """The first of the points, a power of two's part of them, and their numbers."""
        samples, size, _ = self.uniform.shape
        count = max(16, round(share * size))
        numbers = size * np.arange(samples)[:, None] + np.arange(count)
        return replace(self, uniform=self.uniform[:, :count]), numbers.ravel()

    def shares(self, values: Array, seed: int = 0) -> Shares:
        """Shares of the variance of values at all points; nan where there is none.

        A row with such a point stands as the mean everywhere, which is as if it were not there.
        """
        from scipy.stats import sobol_indices

        table = np.asarray(values, dtype=float).reshape(len(self.uniform), -1).copy()
        there = np.isfinite(table).all(0)
        table[:, ~there] = table[:2, there].mean()
        found = sobol_indices(n=table.shape[1], func={
            "f_A": table[:1], "f_B": table[1:2], "f_AB": table[2:, None, :]}, rng=seed)
        alone, total = np.atleast_1d(found.first_order), np.atleast_1d(found.total_order)
        # Of the ratio that a share is, by each row's part in it; Sobol's points do better.
        first, second, *mixed = table - table[:2].mean()
        variance = (first**2 + second**2) / 2
        parts = second * (np.array(mixed) - first) - alone[:, None] * variance
        off = _LIMITS * parts.std(1) / (variance.mean() * table.shape[1] ** 0.5)
        return Shares(alone, total, alone - off, alone + off)


@dataclass(frozen=True, eq=False)
class Shares:
    """Shares of each group: ``alone``, with limits of 95 %, and in ``total`` with interactions."""

    alone: Array
    total: Array
    low: Array
    high: Array
