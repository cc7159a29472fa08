"""A film at rest without voltage by its heave: where motions begin, how far a jump leads.

A film that rests under a weight has one freedom, its heave, which the other shapes follow; so it is
a curve, and that is smooth. Along it are also known how stiff the film is at once and what a
voltage does to it there, so that where loads that jump lead is nearly known without the film.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Of the polynomials, and how precisely they give q, over the highest heave.
DEGREE, PRECISION = 8, 1e-8

#: Corrections of a heave that is looked for between samples.
_CORRECTIONS = 2

_DEGREES = np.arange(DEGREE + 1.0)


@dataclass(frozen=True, eq=False)
class HeaveSamples:
    """A film held at ``heaves`` [m] at rest without voltage: the ``force`` for it [N], q [m].

    ``stiffer`` [N/m]: by how much branches make it so at once, the other shapes free; ``moved``
    [m/V²]: q at once by U², and ``pull`` [N/V²], the force against heave that does the same.
    Shapes (heaves,) and (heaves, shapes).
    """

    heaves: Array
    force: Array
    stiffer: Array
    pull: Array
    q: Array
    moved: Array


@dataclass(frozen=True, eq=False)
class HeavePath:
    """What :class:`HeaveSamples` say by a heave y up to ``samples``' last [m], from 0 on.

    ``rows``: coefficients by powers of 2 y/highest − 1, (degree + 1, columns), of force and its
    slope, ``stiffer``, ``pull`` and its slope, q, ``moved``.
    """

    samples: HeaveSamples
    rows: Array

    @classmethod
    def of(cls, samples: HeaveSamples, checks: HeaveSamples) -> HeavePath | None:
        """Through samples, from 0 to the highest heave; None where checks are far off."""
        highest = samples.heaves[-1]
        values = np.column_stack([samples.force, samples.stiffer, samples.pull, samples.q,
                                  samples.moved])
        force, stiffer, pull, *others = np.linalg.solve(_powers(samples.heaves, highest), values).T
        rows = [force, _slope(force, highest), stiffer, pull, _slope(pull, highest), *others]
        path = cls(samples, np.stack(rows, axis=1))
        gap = path._at(checks.heaves)[:, path._shapes] - checks.q
        return path if np.abs(gap).max() < PRECISION * highest else None

    def at_rest(self, force: Any, spring: float) -> Array | None:
        """q under forces [N] and a spring [N/m], shape (..., shapes); None beyond the path."""
        heaves = self.samples.heaves
        forces = self.samples.force + spring * heaves
        heave: Any = np.interp(force, forces, heaves, np.nan, np.nan)
        if np.isnan(heave).any():
            return None
        for _ in range(_CORRECTIONS):
            here = self._at(heave)
            heave = heave - (here[..., 0] + spring * heave - force) / (here[..., 1] + spring)
        return self._at(heave)[..., self._shapes]

    def jump(self, heave: Any, before: Any, after: Any, spring: float) -> Array:
        """How far U² [V²] leads q at once, nearly, from a heave [m], shape (..., shapes).

        Nowhere if it leads off the path.
        """
        here = self._at(heave)
        pull, softer = here[..., 3] * (after - before), here[..., 4] * after
        change = pull / (here[..., 1] + here[..., 2] + spring - softer)
        ahead = heave + change
        within = (ahead >= 0) & (ahead <= self.highest)
        moved = self._at(np.where(within, ahead, heave))[..., self._shapes.stop:]
        moved = moved * np.multiply(after - before, within)[..., None]
        moved[..., 0] = change * within
        return np.asarray(moved)

    @property
    def highest(self) -> float:
        """Heave [m]."""
        return float(self.samples.heaves[-1])

    @property
    def _shapes(self) -> slice:
        return slice(5, 5 + self.samples.q.shape[1])

    def _at(self, heave: Any) -> Array:
        return np.asarray(_powers(heave, self.highest) @ self.rows)


def _powers(heave: Any, highest: float) -> Array:
    share = np.asarray(2 / highest * heave - 1)
    return np.asarray(share[..., None] ** _DEGREES)


def _slope(row: Array, highest: float) -> Array:
    """Of a polynomial by its heave."""
    return np.append(row[1:] * np.arange(1.0, len(row)), 0.0) * 2 / highest
