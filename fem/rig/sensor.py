"""Displacement sensor: what it shows at a deflection, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import Key, takes_units
from tympan.base.toml_reader import NON_NEGATIVE
from tympan.fem.rig.gain import GAIN


@takes_units
@dataclass(frozen=True, kw_only=True)
class Sensor:
    """Displacement sensor; the defaults are ideal."""

    sensor_gain: Annotated[float, Key("k: readings are (1+k) y", rule=GAIN)] = 0.0
    sensor_zero: Annotated[float, Key("what the sensor shows at no deflection", "length")] = 0.0
    drift: Annotated[float, Key("how fast readings wander", "speed")] = 0.0
    sensor_lag: Annotated[float, Key("in which the sensor follows, by a factor e", "time",
                                     NON_NEGATIVE)] = 0.0

    @property
    def sensor_slope(self) -> float:
        """Change of the reading per change of the deflection."""
        return 1 + self.sensor_gain

    def reading(self, deflection: Any, elapsed: Any = 0.0) -> Any:
        """Compute the sensor's reading [m] at a deflection [m] and a time since the start [s]."""
        return self.sensor_slope * deflection + self.sensor_zero + self.drift * elapsed

    def deflection(self, reading: Any, elapsed: Any = 0.0) -> Any:
        """Find the deflection [m] at a reading [m] and a time since the start [s].

        Examples
        --------
        >>> sensor = Sensor(sensor_gain=0.25, sensor_zero=1.0, drift=0.5)
        >>> sensor.deflection(sensor.reading(3.0, 2.0), 2.0)
        3.0
        """
        return (reading - self.sensor_zero - self.drift * elapsed) / self.sensor_slope

    def lagged(self, shown: Any, before: Any, now: Any, duration: float) -> Any:
        """Let what the sensor shows follow a value that moves linearly, for a duration [s].

        The value moves from ``before`` to ``now``; the result is exact.
        """
        if not self.sensor_lag:
            return now
        behind = (now - before) / duration * self.sensor_lag
        return now - behind + (shown - before + behind) * exp(-duration / self.sensor_lag)

    def recorded(self, time: Array, deflection: Array) -> Array:
        """Compute the readings [m] of a motion at times [s]; between samples it is linear.

        The sensor lags, and begins at rest. Deflections [m] and readings have the shape (times,).
        """
        read = np.asarray(self.reading(deflection, time))
        shown = read.copy()
        for number, duration in enumerate(np.diff(time).tolist(), 1):
            shown[number] = self.lagged(shown[number - 1], read[number - 1], read[number], duration)
        return shown
