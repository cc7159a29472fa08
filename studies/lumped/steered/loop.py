"""The sampled loop of a steered plate: small motions about a rest, feedback, sensitivity, poles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from tympan.base.arrays import Array
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.model import SteeredModel

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Feedback:
    """w = C s + D e and s⁺ = A s + B e + G (v' − v): places added to the asked ones.

    e = y − r is the error of the reading. v' are the places that the supply can hold, v those asked
    for. ``rest``: the memory of a plate that has rested with an error.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    g: Array
    rest: Array

    def response(self, z: Complex) -> Complex:
        """Compute the transfer matrices w/e at points of the z-plane, (points, n, n)."""
        return response(self.a, self.b, self.c, z) + self.d


@dataclass(frozen=True, eq=False)
class SteeredLoop:
    """Small motions about a rest, x⁺ = A x + B v, y = C x, once an interval.

    v are the asked places at rest, y the readings.
    """

    a: Array
    b: Array
    c: Array

    @classmethod
    def of(cls, model: SteeredModel, squared: Array, inverse: SteeredInverse, interval: float
           ) -> SteeredLoop:
        """Sample a model about its equilibrium at U² of the segments [V²]."""
        linear = model.linearise(squared)
        size, count = linear.b.shape[0], linear.c.shape[0]
        asked = np.linalg.pinv(linear.gain * inverse.supply**2) * inverse.supply**2
        whole = np.zeros((size + count, size + count))
        whole[:size, :size], whole[:size, size:] = linear.a, linear.b @ asked
        passed = expm(interval * whole)
        return cls(passed[:size, :size], passed[:size, size:], linear.c)

    def response(self, z: Complex) -> Complex:
        """Compute the transfer matrices y/v at points of the z-plane, (points, n, n)."""
        return response(self.a, self.b, self.c, z)

    def largest_pole(self, feedback: Feedback) -> float:
        """Find the largest magnitude of the closed loop's poles; below 1 it is stable."""
        loop = np.block([[self.a + self.b @ feedback.d @ self.c, self.b @ feedback.c],
                         [feedback.b @ self.c, feedback.a]])
        return float(np.abs(np.linalg.eigvals(loop)).max())


def response(a: Array, b: Array, c: Array, z: Complex) -> Any:
    """Compute C (z − A)⁻¹ B at points of the z-plane."""
    matrices = z[:, None, None] * np.eye(len(a)) - a
    return np.asarray(c @ np.linalg.solve(matrices, np.broadcast_to(b, (len(z), *b.shape))))


def sensitivities(plant: Complex, feedback: Complex, scale: Array) -> Complex:
    """Compute (1 − P W)⁻¹ of responses, places in units of their ``scale``, (points, n, n)."""
    difference = (np.eye(len(scale)) - plant @ feedback) * scale / scale[:, None]
    return np.asarray(np.linalg.inv(difference))
