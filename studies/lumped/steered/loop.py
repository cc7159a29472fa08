"""The sampled loop of a steered plate: small motions about a rest, feedback, sensitivity, poles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from tympan.base.arrays import Array
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.model import SteeredModel

#: Number of frequencies of a loop, and the lowest over the highest that the sampling allows.
_FREQUENCIES = 120
_LOWEST = 1e-4
#: Imaginary part of a pole from which on it is a swing; creep has none.
_SWINGS = 1e-6
#: Distances of frequencies from a swing's, over it: down to the width of one of 0.01 % damping,
#: and, where a controller leaves a swing as it is, of one that only the slowest creep damps.
_ABOUT = np.geomspace(1e-4, 0.3, 24)
_NEAR = np.geomspace(1e-7, 0.3, 40)

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
        return np.asarray(response(self.a, self.b, self.c, z) + self.d)


@dataclass(frozen=True, eq=False)
class SteeredLoop:
    """Small motions about a rest, x⁺ = A x + B v, y = C x, once an interval.

    v are the asked places at rest, y the readings.
    """

    a: Array
    b: Array
    c: Array

    @classmethod
    def of(cls, model: SteeredModel, squared: Array, inverse: SteeredInverse, interval: float,
           sensor_lag: float = 0.0) -> SteeredLoop:
        """Sample a model about its equilibrium at U² of the segments [V²], with a sensor's lag [s].

        The states behind the model's are what a sensor that lags shows.
        """
        linear = model.linearise(squared)
        size, count = linear.b.shape[0], linear.c.shape[0]
        asked = np.linalg.pinv(linear.gain * inverse.supply**2) * inverse.supply**2
        shown = size + (count if sensor_lag else 0)
        whole = np.zeros((shown + count, shown + count))
        whole[:size, :size], whole[:size, shown:] = linear.a, linear.b @ asked
        c = linear.c
        if sensor_lag:
            c = np.hstack([np.zeros((count, size)), np.eye(count)])
            whole[size:shown, :size] = linear.c / sensor_lag
            whole[size:shown, size:shown] = -np.eye(count) / sensor_lag
        passed = expm(interval * whole)
        return cls(passed[:shown, :shown], passed[:shown, shown:], c)

    def response(self, z: Complex) -> Complex:
        """Compute the transfer matrices y/v at points of the z-plane, (points, n, n)."""
        return np.asarray(response(self.a, self.b, self.c, z))

    def largest_pole(self, feedback: Feedback) -> float:
        """Find the largest magnitude of the closed loop's poles; below 1 it is stable."""
        loop = np.block([[self.a + self.b @ feedback.d @ self.c, self.b @ feedback.c],
                         [feedback.b @ self.c, feedback.a]])
        return float(np.abs(np.linalg.eigvals(loop)).max())


def response(a: Array, b: Array, c: Array, z: Complex) -> Any:
    """Compute C (z − A)⁻¹ B at points of the z-plane."""
    matrices = z[:, None, None] * np.eye(len(a)) - a
    return np.asarray(c @ np.linalg.solve(matrices, np.broadcast_to(b, (len(z), *b.shape))))


def swings(plants: Sequence[SteeredLoop], interval: float) -> Array:
    """Find the frequencies of the plants' swings [rad/s]."""
    poles = np.concatenate([np.linalg.eigvals(plant.a) for plant in plants])
    return np.asarray(np.abs(np.log(poles[poles.imag > _SWINGS])) / interval)


def frequencies(plants: Sequence[SteeredLoop], interval: float, count: int = _FREQUENCIES,
                fine: bool = False) -> Array:
    """Space frequencies [rad/s] up to the sampling's highest, more of them about the swings.

    Tilts may swing with hardly any damping: a loop then passes all its values in a narrow band.
    """
    highest, width = np.pi / interval, _NEAR if fine else _ABOUT
    about = 1 + np.concatenate([-width, width])
    near = np.multiply.outer(swings(plants, interval), about).ravel()
    spread = np.geomspace(_LOWEST, 1.0, count) * highest
    return np.sort(np.concatenate([spread, near[near < highest]]))


def sensitivities(plant: Complex, feedback: Complex, scale: Array) -> Complex:
    """Compute (1 − P W)⁻¹ of responses, places in units of their ``scale``, (points, n, n)."""
    difference = (np.eye(len(scale)) - plant @ feedback) * scale / scale[:, None]
    return np.asarray(np.linalg.inv(difference))
