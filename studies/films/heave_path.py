"""A film at rest without voltage by its heave: where motions begin, how far a jump leads.

A film that rests under a weight has one freedom, its heave, which the other shapes follow; so it is
a curve, and that is smooth. Along it are also known how stiff the film is, at once and at rest,
and what a voltage does to it, so that where one that jumps leads is nearly known without the film.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Degree of the polynomials by the heave. Set by trial.
DEGREE = 8
#: How precisely they give q, over the highest heave. Otherwise there is no path, and motions begin
#: without it.
PRECISION = 1e-8

#: Corrections by Newton's method of a heave that begins on the line between two samples. Set by
#: trial.
_CORRECTIONS = 2
#: Iterations of creep: it is a guess, that Newton's method corrects.
_CREEPS = 4

#: What counts as no heave by U² [m/V²].
_NONE = 1e-30

_DEGREES = np.arange(DEGREE + 1.0)


@dataclass(frozen=True, eq=False)
class HeaveSamples:
    """A film held at ``heaves`` [m] at rest without voltage: the ``force`` for it [N], q [m].

    ``stiffer`` [N/m]: by how much branches make it so at once, the other shapes free; ``pull``
    [N/V²]: the force against heave of a voltage by its square; ``moved`` [m/V²] and ``bent``
    [m/V⁴]: q at once by U² and by U⁴. Shapes (heaves,) and (heaves, shapes).
    """

    heaves: Array
    force: Array
    stiffer: Array
    pull: Array
    q: Array
    moved: Array
    bent: Array


@dataclass(frozen=True, eq=False)
class HeavePath:
    """What :class:`HeaveSamples` say by a heave y up to ``samples``' last [m], from 0 on.

    ``rows``: coefficients by powers of 2 y/highest − 1, (degree + 1, columns), of force and its
    slope, ``stiffer``, the slope of ``pull``, q, ``moved``, ``bent``.
    """

    samples: HeaveSamples
    rows: Array

    @classmethod
    def of(cls, samples: HeaveSamples, checks: HeaveSamples) -> HeavePath | None:
        """Through samples, from 0 to the highest heave.

        None where checks are far off, or the force does not grow with the heave.
        """
        highest = samples.heaves[-1]
        values = np.column_stack([samples.force, samples.stiffer, samples.pull, samples.q,
                                  samples.moved, samples.bent])
        force, stiffer, pull, *others = np.linalg.solve(_powers(samples.heaves, highest), values).T
        rows = [force, _slope(force, highest), stiffer, _slope(pull, highest), *others]
        path = cls(samples, np.stack(rows, axis=1))
        gap = path._at(checks.heaves)[:, path._shapes] - checks.q
        grows = bool((np.diff(samples.force) > 0).all())
        return path if grows and np.abs(gap).max() < PRECISION * highest else None

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

    def jump(self, heave: Any, before: Any, after: Any, spring: float, flown: Array) -> Array:
        """How far U² [V²] nearly leads q from a heave [m], shape (..., stages, shapes).

        ``flown``, (stages, stages): what of a change at a stage branches have followed at another.
        Nowhere if it leads off the path.
        """
        here, count = self._at(heave), self.samples.q.shape[1]
        relaxed, stiffer, pull_slope = here[..., 1], here[..., 2], here[..., 3]
        moved, bent = here[..., -2 * count:-count], here[..., -count:]
        change = _so_far(moved, bent, after)
        if np.any(before):
            change -= _so_far(moved, bent, before)
        if spring:
            stiff = relaxed + stiffer
            change *= np.asarray(stiff / (stiff + spring))[..., None]
        change = np.repeat(change[..., None, :], len(flown), -2)
        change[..., 0] *= _creep(stiffer / (relaxed + stiffer + spring - pull_slope * after), flown)
        ahead = change[..., 0] + np.asarray(heave)[..., None]
        within = ((ahead >= 0) & (ahead <= self.highest)).all(-1)
        if not within.all():
            change = np.where(within[..., None, None], change, 0.0)
        return np.asarray(change)

    @property
    def highest(self) -> float:
        """Heave [m]."""
        return float(self.samples.heaves[-1])

    @property
    def _shapes(self) -> slice:
        return slice(4, 4 + self.samples.q.shape[1])

    def _at(self, heave: Any) -> Array:
        return np.asarray(_powers(heave, self.highest) @ self.rows)


def _so_far(moved: Array, bent: Array, squared: Any) -> Array:
    """How far U² leads q at once, by its first two derivatives; the heave grows exponentially.

    So does that of a film that softens on its way to pull-in, nearly.
    """
    squared = np.asarray(squared)[..., None]
    change = (moved + bent * squared) * squared
    heave = moved[..., 0]
    rate = bent[..., 0] * squared[..., 0] / np.maximum(heave, _NONE)
    change[..., 0] = heave * squared[..., 0] * np.exp(np.minimum(rate, 1.0))
    return np.asarray(change)


def _creep(share: Any, flown: Array) -> Array:
    """How far a change goes at stages over how far at once, (..., stages).

    By the branches' share of the stiffness at once: r = 1 + share · flown r, by a few iterations.
    """
    share, creep = np.asarray(share)[..., None], np.ones(len(flown))
    for _ in range(_CREEPS):
        creep = 1 + share * (creep @ flown.T)
    return np.asarray(creep)


def _powers(heave: Any, highest: float) -> Array:
    share = np.asarray(2 / highest * heave - 1)
    return np.asarray(share[..., None] ** _DEGREES)


def _slope(row: Array, highest: float) -> Array:
    """Of a polynomial by its heave."""
    return np.append(row[1:] * np.arange(1.0, len(row)), 0.0) * 2 / highest
