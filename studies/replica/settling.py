"""Settling times of Section 4.2: by which criterion ours come nearest to the paper's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tympan.studies.paper.published import SETTLING

Array = NDArray[np.float64]
_USUAL = (0.05, 0.02, 0.01)  # thresholds as shares that are in use
_SEEN = 1e-6  # [m], by the paper's sensor


@dataclass(frozen=True, eq=False)
class Decay:
    """Half the way [m] between neighbouring extremes, the time midway [s], the whole travel [m].

    The crossing of a threshold is interpolated between them on a logarithmic scale, as an
    oscillation dies.
    """

    time: Array
    height: Array
    travel: float

    @property
    def scales(self) -> dict[str, float]:
        """What a threshold is a share of, by the kind of criterion; a plain length in metres."""
        return {"largest swing": float(self.height.max()), "whole change": self.travel,
                "length": 1.0}

    @classmethod
    def of(cls, time: Array, deflection: Array) -> Decay:
        """Of a sampled response to a step, the extremes refined by parabolas of three samples."""
        turning = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) != 0) + 1
        before, at, after = (deflection[turning + shift] for shift in (-1, 0, 1))
        bend = before - 2 * at + after
        shift = np.where(bend != 0, (before - after) / np.where(bend != 0, 2 * bend, 1.0), 0.0)
        heights = at - (before - after) * shift / 4
        places = time[turning] + shift * (time[1] - time[0])
        return cls((places[1:] + places[:-1]) / 2 - time[0], np.abs(np.diff(heights)) / 2,
                   float(abs(deflection[-1] - deflection[0])))

    def settled(self, threshold: float) -> float:
        """When the oscillation last exceeds a threshold [m]; nan where it never does."""
        large = np.flatnonzero(self.height > threshold)
        if not len(large):
            return float("nan")
        last = int(large[-1])
        if last + 1 == len(self.height):
            return float(self.time[last])
        (high, low), (before, after) = self.height[last:last + 2], self.time[last:last + 2]
        return float(before + (after - before) * np.log(high / threshold) / np.log(high / low))


@dataclass(frozen=True, eq=False)
class Criterion:
    """A kind of criterion at one threshold: settling times [s], shape (masses, actuators)."""

    kind: str
    threshold: float
    times: Array

    @property
    def rms(self) -> float:
        """Root mean square of the difference from the paper's [s]."""
        return float(np.sqrt(np.mean((self.times - SETTLING) ** 2)))


def criteria(decays: list[list[Decay]]) -> list[Criterion]:
    """Settling times by usual criteria, what the sensor sees, and the nearest of each kind."""
    kinds = decays[0][0].scales
    return [*(settling_times(decays, kind, share) for kind in ("largest swing", "whole change")
              for share in _USUAL), settling_times(decays, "length", _SEEN),
            *(nearest(decays, kind) for kind in kinds)]


def settling_times(decays: list[list[Decay]], kind: str, threshold: float) -> Criterion:
    """Settling times by one criterion, for responses by mass and actuator."""
    return Criterion(kind, threshold, np.array(
        [[decay.settled(threshold * decay.scales[kind]) for decay in row] for row in decays]))


def nearest(decays: list[list[Decay]], kind: str) -> Criterion:
    """The threshold of a kind whose six times are nearest to the paper's, if it gives all six."""
    every = [decay for row in decays for decay in row]
    largest = min(decay.height.max() / decay.scales[kind] for decay in every)
    smallest = max(decay.height.min() / decay.scales[kind] for decay in every)
    thresholds = np.geomspace(largest, smallest, 402)[1:-1]
    return min((settling_times(decays, kind, threshold) for threshold in thresholds),
               key=lambda criterion: criterion.rms)
