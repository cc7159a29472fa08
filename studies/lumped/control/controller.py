"""PI controller of a plate's deflection, with feed-forward by the inverse of the static curve."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from string import Template
from typing import Annotated, Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from tympan.geometry.errors import Failure
from tympan.geometry.fields import Key
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest, squared_at
from tympan.studies.lumped.export.c_source import identifier

Array = NDArray[np.float64]

#: Degrees of the inverse that are tried.
_DEGREES = (4, 6, 8, 12, 16, 24)
#: Error of the inverse over the highest voltage squared: far below what films scatter.
_FINE = 1e-6
#: Deflections between which the error of the inverse is looked for.
_BETWEEN = 400


@dataclass(frozen=True, kw_only=True)
class StaticInverse:
    """U² of the supply as a Chebyshev series of the deflection at rest, between its ends."""

    lowest_m: Annotated[float, Key("deflection at rest without voltage")]
    highest_m: Annotated[float, Key("deflection at rest at the supply's voltage")]
    coefficients_V2: Annotated[tuple[float, ...], Key(
        "Chebyshev coefficients of U² in t = (2 y − lowest − highest) / (highest − lowest)")]

    @classmethod
    def of(cls, actuator: Actuator, supply: float) -> StaticInverse:
        """The inverse from 0 to a supply's voltage [V].

        Raises
        ------
        Failure
            Where no series follows the curve.
        """
        low, high = (rest(actuator, voltage) for voltage in (0.0, supply))

        def squared(t: Array) -> Array:
            film = squared_at(actuator, (low + high + t * (high - low)) / 2)
            return np.array([actuator.rig.nominal_voltage(each) ** 2
                             for each in np.sqrt(np.maximum(film, 0.0)).tolist()])

        between = np.linspace(-1, 1, _BETWEEN)
        for degree in _DEGREES:
            series: Array = np.asarray(chebyshev.chebinterpolate(squared, degree))  # type: ignore[type-var]
            error = np.abs(chebyshev.chebval(between, series) - squared(between)).max()
            if error < _FINE * supply**2:
                return cls(lowest_m=low, highest_m=high, coefficients_V2=tuple(series.tolist()))
        raise Failure(f"no series of degree {degree} follows the static curve up to "
                      f"{supply / 1e3:g} kV: choose a lower --supply")

    def squared(self, deflection: Any) -> Any:
        """U² [V²] that holds a deflection [m] at rest; by Clenshaw's rule, as the C has it."""
        t = (2 * deflection - self.lowest_m - self.highest_m) / (self.highest_m - self.lowest_m)
        after = before = 0.0 * t
        for coefficient in self.coefficients_V2[:0:-1]:
            after, before = 2 * t * after - before + coefficient, after
        return t * after - before + self.coefficients_V2[0]


@dataclass(frozen=True, eq=False)
class ControllerState:
    """Memory of a controller: reference and reading behind both lags, the integral, all [m]."""

    reference: tuple[Any, Any]
    reading: tuple[Any, Any]
    integral: Any

    @classmethod
    def resting(cls, reference: Any, reading: Any) -> ControllerState:
        """Memory after so long a rest that all lags are over."""
        return cls((reference, reference), (reading, reading), 0.0 * (reference + reading))


@dataclass(frozen=True, kw_only=True)
class Controller:
    """Voltage from a wanted and a read deflection, once a sampling interval.

    Both pass two equal lags, so that the plate's swing is neither excited nor answered. The
    controller asks for a deflection at rest, y = r + K_p e + K_i ∫ e dt, and the static inverse
    tells its voltage: so the loop has the same gain at rest at any deflection. Beyond the supply y
    is cut, and the integral is what it then must have been.
    """

    inverse: Annotated[StaticInverse, Key("voltage squared by deflection at rest")]
    supply_V: Annotated[float, Key("highest voltage of the supply; the lowest is 0")]
    interval_s: Annotated[float, Key("sampling interval")]
    filter_s: Annotated[float, Key("time of each of the two lags; 0 for none")]
    proportional: Annotated[float, Key("K_p, as deflection asked for per deflection missing")]
    integral_per_s: Annotated[float, Key("K_i")]

    @property
    def share(self) -> float:
        """What a lag takes in an interval of the way that is left to it."""
        return float(-np.expm1(-self.interval_s / self.filter_s)) if self.filter_s else 1.0

    @property
    def feedback(self) -> tuple[Array, Array, Array]:
        """s⁺ = A s + b y and v = c s⁺: what is asked for by a reading y, with nothing wanted [m].

        The memory s is the reading behind either lag, and the integral.
        """
        p, gain = self.share, self.integral_per_s * self.interval_s
        first, second = np.array([1 - p, 0.0, 0.0, p]), np.array([0.0, 1 - p, 0.0, 0.0])
        second += p * first
        rows = np.array([first, second, np.array([0.0, 0.0, 1.0, 0.0]) - gain * second])
        return rows[:, :3], rows[:, 3:], np.array([[0.0, -self.proportional, 1.0]])

    def c_source(self, name: str) -> str:
        """The same as functions of C99, named after a specimen."""
        text = resources.files("tympan.studies.lumped.control").joinpath("source.txt")
        inverse = self.inverse
        return Template(text.read_text(encoding="utf-8")).substitute(
            title=name, name=identifier(name), interval=repr(self.interval_s),
            series=", ".join(map(repr, inverse.coefficients_V2)), lowest=repr(inverse.lowest_m),
            highest=repr(inverse.highest_m), supply=repr(float(self.supply_V)),
            proportional=repr(self.proportional), share=repr(self.share),
            gain=repr(self.integral_per_s * self.interval_s))

    def voltage(self, state: ControllerState, reference: Any, reading: Any
                ) -> tuple[Any, ControllerState]:
        """Voltage [V] until the next sample, and the memory then; deflections [m], of any shape."""
        wanted, read = (self._lagged(*each) for each in (
            (state.reference, reference), (state.reading, reading)))
        error = wanted[1] - read[1]
        integral = state.integral + self.integral_per_s * self.interval_s * error
        ahead = wanted[1] + self.proportional * error
        given = np.clip(ahead + integral, self.inverse.lowest_m, self.inverse.highest_m)
        voltage = np.sqrt(np.clip(self.inverse.squared(given), 0.0, self.supply_V**2))
        held = np.where(given == ahead + integral, integral, given - ahead)
        return voltage, ControllerState(wanted, read, held)

    def _lagged(self, before: tuple[Any, Any], value: Any) -> tuple[Any, Any]:
        first = before[0] + self.share * (value - before[0])
        return first, before[1] + self.share * (first - before[1])
