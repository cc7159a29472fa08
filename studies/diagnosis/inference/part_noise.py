"""Noise of readings that was found before, each part's by its own scatter.

A part that few readings tell has a noise that may well be another: what is tested against it is
tested with its degrees of freedom, however well that of other parts is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PartNoise:
    """Noise that was found before, of each part of the readings by itself.

    ``part``: the number of the part that each reading is of, shape (rows,); ``freedom``: degrees of
    freedom with which each part's noise is known, shape (parts,).
    """

    part: NDArray[np.int64]
    freedom: Array

    @classmethod
    def of_all(cls, count: int, freedom: float) -> PartNoise:
        """Of readings that have one noise in common."""
        return cls(np.zeros(count, np.int64), np.array([freedom]))

    def drawn(self, generator: np.random.Generator, count: int) -> Array:
        """Variances of the parts as they may be found where they are 1, shape (parts, count)."""
        freedom = self.freedom[:, None]
        return np.asarray(generator.chisquare(freedom, (len(freedom), count)) / freedom)

    def shares(self, columns: Array) -> Array:
        """What each part has of the squares of columns, shape (parts,)."""
        squares = np.bincount(self.part, np.sum(columns**2, axis=1), len(self.freedom))
        return np.asarray(squares / squares.sum())

    def freedom_of(self, shares: Array) -> float:
        """Degrees of freedom of a variance that is a sum of the parts' by their shares.

        By Satterthwaite (Biometrics Bulletin 2, 110, 1946): those of one variance that scatters as
        much.
        """
        return float(1 / np.sum(shares**2 / self.freedom))
