"""The sampled loop of a controller and small motions about a rest: response, margins, poles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from tympan.base.arrays import Array
from tympan.studies.lumped.control.controller import LinearLaw

Complex = NDArray[np.complex128]

#: Number of frequencies of a response. They resolve a swing of 1 % damping to a hundredth.
_FREQUENCIES = 1500
#: Lowest frequency over the highest that the sampling allows: far below any creep.
_LOWEST = 1e-6


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A plant about a rest, x⁺ = A x + b v, y = c x, once an interval [s]; or an array of plants.

    v is the deflection [m] at rest under the applied voltage, so that y = v at rest.
    """

    a: Array
    b: Array
    c: Array
    interval: float

    @classmethod
    def of(cls, a: Array, b: Array, interval: float, sensor_lag: float = 0.0) -> SampledLoop:
        """Sample small motions ẋ = A x + b v with a sensor's lag [s]; samples hold the voltage."""
        seen = 0
        if sensor_lag:
            seen = a.shape[-1]
            wide = [*[(0, 0)] * (a.ndim - 2), (0, 1), (0, 1)]
            a, b = np.pad(a, wide), np.pad(b, [*wide[:-1], (0, 0)])
            a[..., -1, 0], a[..., -1, -1] = 1 / sensor_lag, -1 / sensor_lag
        size = a.shape[-1]
        whole = np.zeros((*a.shape[:-2], size + 1, size + 1))
        whole[..., :-1, :-1], whole[..., :-1, -1:] = a, b
        passed = expm(interval * whole)
        return cls(passed[..., :-1, :-1], passed[..., :-1, -1:], np.eye(size)[[seen]], interval)

    def response(self, z: Complex) -> Complex:
        """Compute the transfer function y/v at points of the z-plane."""
        size = len(self.a)
        matrices = z[:, None, None] * np.eye(size) - self.a
        return np.asarray((self.c @ np.linalg.solve(matrices, np.broadcast_to(
            self.b, (len(z), size, 1))))[:, 0, 0])


def frequencies(interval: float) -> Array:
    """Space frequencies [rad/s] up to the sampling's highest."""
    return np.geomspace(_LOWEST, 1.0, _FREQUENCIES) * np.pi / interval


def closed_poles(plant: SampledLoop, law: LinearLaw) -> Array:
    """Compute the magnitudes of the closed loop's poles, for one plant or an array of plants."""
    a, b, c, d, _ = law.arrays
    b, size, shape = b[:, 1:], len(a), plant.a.shape[:-2]
    loop = np.block([
        [plant.a + d[1] * plant.b @ plant.c, plant.b * c],
        [np.broadcast_to(b @ plant.c, (*shape, size, plant.a.shape[-1])),
         np.broadcast_to(a, (*shape, size, size))]])
    return np.asarray(np.abs(np.linalg.eigvals(loop)))


@dataclass(frozen=True)
class RunMargins:
    """Margins of loops: the worst of each.

    ``gain`` is the factor by which the loop's gain may grow, ``phase`` [°] the phase margin,
    ``delay`` [s] the delay that may be added, ``sensitivity`` the largest |1/(1 + L)|. A margin
    without a limit is infinite.
    """

    gain: float
    phase: float
    delay: float
    sensitivity: float

    @classmethod
    def of(cls, loops: Sequence[Complex], omega: Array) -> RunMargins:
        """Compute the margins of open loops L at frequencies [rad/s]."""
        found = np.array([cls._one(loop, omega) for loop in loops])
        gain, phase, delay = found[:, :3].min(axis=0).tolist()
        return cls(gain, phase, delay, float(found[:, 3].max()))

    @staticmethod
    def _one(loop: Complex, omega: Array) -> tuple[float, float, float, float]:
        turned = np.flatnonzero((np.diff(np.sign(loop.imag)) != 0)
                                & (loop.real[1:] < 0) & (loop.real[:-1] < 0))
        gain = min((1 / abs(loop[i:i + 2].real.mean()) for i in turned
                    if abs(loop[i:i + 2].real.mean()) < 1), default=np.inf)
        unit = np.flatnonzero(np.diff(np.sign(np.abs(loop) - 1)) != 0)
        phases = np.abs(180 + np.degrees(np.angle(loop[unit])) % -360)
        delays = np.radians(phases) / omega[unit]
        return (float(gain), float(phases.min(initial=np.inf)), float(delays.min(initial=np.inf)),
                float((1 / np.abs(1 + loop)).max()))
