"""LQG of a steered plate about its wanted motion, with integral action at rest and at a frequency.

A Kalman filter estimates how far the plate's motion and creep are from the wanted ones, and places
added to the asked ones: they walk at random, and swing at the frequency of the reference with an
amplitude that walks. A linear quadratic regulator takes the plate back, and the added places are
subtracted. So no error of the film's gain remains, neither at rest nor at that frequency
(:mod:`tympan.studies.lumped.control.lqg` does the same for one voltage at rest).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_discrete_are

from tympan.base.arrays import Array
from tympan.studies.lumped.steered.loop import Feedback, SteeredLoop

#: Weights of the asked place to try, over that of the error.
_WEIGHTS = np.geomspace(1e-2, 1e2, 5)
#: Variances to try of what acts on the plate at each sample, over the reading's.
_SHAKEN = np.geomspace(1e-4, 1e1, 6)
#: Variances of the random walks' steps to try, over the reading's variance.
_WALKS = np.geomspace(1e-6, 1e0, 7)


def lqg_candidates(plant: SteeredLoop, scale: Array, angle: float) -> Iterator[Feedback]:
    """Yield feedbacks for a plant, by their weights.

    ``scale``: range of the places; ``angle``: by which the reference turns in a sample [rad].
    """
    unit = np.diag(1 / scale**2)
    regulators = [_regulator(plant, unit, weight) for weight in _WEIGHTS]
    added = _Added.of(len(scale), angle)
    filters = [_filter(plant, added, scale, *noise) for noise in product(_SHAKEN, _WALKS)]
    for regulator, (moved, walked) in product(regulators, filters):
        yield _joined(plant, added, regulator, moved, walked)


def _regulator(plant: SteeredLoop, unit: Array, weight: float) -> Array:
    """Compute K of v = −K x that minimises e² + weight v², in units of the places' scales."""
    a, b, c = plant.a, plant.b, plant.c
    left = solve_discrete_are(a, b, c.T @ unit @ c, weight * unit)
    return np.asarray(np.linalg.solve(weight * unit + b.T @ left @ b, b.T @ left @ a))


@dataclass(frozen=True, eq=False)
class _Added:
    """Places that are added to the asked ones: w⁺ = R w, ``seen`` @ w is added."""

    turned: Array
    seen: Array

    @classmethod
    def of(cls, count: int, angle: float) -> _Added:
        """Add for each place a constant, and a swing that turns by an angle [rad] a sample."""
        cos, sin = np.cos(angle), np.sin(angle)
        one = np.array([[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]])
        unit, seen = np.eye(count), np.array([[1.0, 1.0, 0.0]])
        return cls(np.asarray(np.kron(one, unit), float), np.asarray(np.kron(seen, unit), float))


def _filter(plant: SteeredLoop, added: _Added, scale: Array, shaken: float, walk: float
            ) -> tuple[Array, Array]:
    """Compute a Kalman filter's gains of the state and of the added places."""
    size, count = plant.b.shape
    more, square = len(added.turned), np.diag(scale**2)
    noise = np.zeros((size + more, size + more))
    a, c = np.zeros_like(noise), np.zeros((count, size + more))
    a[:size, :size], a[:size, size:], c[:, :size] = plant.a, plant.b @ added.seen, plant.c
    a[size:, size:] = added.turned
    noise[:size, :size] = shaken * plant.b @ square @ plant.b.T
    noise[size:, size:] = walk * np.kron(np.eye(more // count), square)
    spread = solve_discrete_are(a.T, c.T, noise, square)
    gain = np.linalg.solve(c @ spread @ c.T + square, c @ spread).T
    return gain[:size], gain[size:]


def _joined(plant: SteeredLoop, added: _Added, regulator: Array, moved: Array, walked: Array
            ) -> Feedback:
    """Join filter and regulator; the memory is the predicted state and what is added."""
    a, b, c = plant.a, plant.b, plant.c
    (size, count), more = b.shape, len(added.turned)
    seen, slowed = np.eye(size) - moved @ c, a - b @ regulator
    return Feedback(
        a=np.block([[slowed @ seen, np.zeros((size, more))],
                    [-added.turned @ walked @ c, added.turned]]),
        b=np.vstack([slowed @ moved, added.turned @ walked]),
        c=np.hstack([added.seen @ walked @ c - regulator @ seen, -added.seen]),
        d=-added.seen @ walked - regulator @ moved,
        g=np.vstack([b, np.zeros((more, count))]),
        rest=np.vstack([np.linalg.solve(np.eye(size) - a, b), np.zeros((more, count))]))
