"""PI by channel of a steered plate: each place read has a controller of its own.

The static inverse decouples the channels at rest. Each gets the PI controller behind two lags that
:mod:`tympan.studies.lumped.control.design` finds for one voltage, with the largest integral gain
that is robust while the other channels are open. All gains are then lowered together until the
whole loop is as robust.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from tympan.base.arrays import Array
from tympan.studies.lumped.control.design import SENSITIVITY, PiGains, pi_gains
from tympan.studies.lumped.steered.loop import (
    Feedback,
    SteeredLoop,
    frequencies,
    sensitivities,
    swings,
)

#: Factors on all gains to try, until the whole loop is robust. One step is as the design's, 8 %.
_LOWERED = 1.08 ** -np.arange(40.0)


def pi_by_channel(plants: Sequence[SteeredLoop], scale: Array, interval: float
                  ) -> Feedback | None:
    """Find the PI controllers of plants; None where none is stable and robust on all of them."""
    z = np.exp(1j * frequencies(plants, interval, fine=True) * interval)
    responses = [plant.response(z) for plant in plants]
    swing = float(swings(plants[:1], interval).min())
    found = []
    for channel in range(len(scale)):
        alone = [SteeredLoop(plant.a, plant.b[:, [channel]], plant.c[[channel]])
                 for plant in plants]
        own = np.array([response[:, channel, channel] for response in responses])
        tried = sorted(pi_gains(own, z, interval, swing), reverse=True)
        best = next((gains for gains in tried if gains.integral and _stable(
            alone, _channel(gains, interval))), None)
        if best is None:
            return None
        found.append(best)
    for factor in _LOWERED.tolist():
        feedback = _joined([_channel(gains.lowered(factor), interval) for gains in found])
        own = feedback.response(z)
        largest = max(np.linalg.norm(sensitivities(each, own, scale), 2, axis=(1, 2)).max()
                      for each in responses)
        if largest <= SENSITIVITY and _stable(plants, feedback):
            return feedback
    return None


def _stable(plants: Sequence[SteeredLoop], feedback: Feedback) -> bool:
    return max(plant.largest_pole(feedback) for plant in plants) < 1


def _channel(gains: PiGains, interval: float) -> Feedback:
    """Make the feedback of one channel: two lags of the error, and the integral."""
    left, kept = 1 - gains.share(interval), gains.share(interval)
    # Rows over memory (two lags, the integral) and the error.
    unit = np.eye(4)
    first = left * unit[0] + kept * unit[3]
    second = left * unit[1] + kept * first
    summed = unit[2] - gains.integral * interval * second
    asked = summed - gains.proportional * second
    rows = np.array([first, second, summed])
    return Feedback(a=rows[:, :3], b=rows[:, 3:], c=asked[None, :3], d=asked[None, 3:],
                    g=unit[2, :3, None], rest=np.array([[1.0], [1.0], [0.0]]))


def _joined(channels: Sequence[Feedback]) -> Feedback:
    return Feedback(**{name: block_diag(*(getattr(each, name) for each in channels))
                       for name in ("a", "b", "c", "d", "g", "rest")})
