"""Controller of a plate's deflection, with feed-forward by the inverse of the static curve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from string import Template
from typing import Annotated, Any, Literal

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.base.errors import Failure
from tympan.base.fields import Key
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest, squared_at
from tympan.studies.lumped.export.c_source import identifier

#: Degrees of the inverse, tried in this order.
_DEGREES = (4, 6, 8, 12, 16, 24)
#: Error of the inverse over the highest voltage squared: far below the spread between films.
_FINE = 1e-6
#: Number of deflections at which the error of the inverse is checked.
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
        """Fit the inverse from 0 to a supply's voltage [V].

        Raises
        ------
        Failure
            Where no series follows the curve.
        """
        low, high = (rest(actuator, voltage) for voltage in (0.0, supply))

        def squared(t: Array) -> Array:
            film = squared_at(actuator, (low + high + t * (high - low)) / 2)
            voltage = actuator.rig.nominal_voltage(np.sqrt(np.maximum(film, 0.0)))
            return np.asarray(voltage**2)

        between = np.linspace(-1, 1, _BETWEEN)
        for degree in _DEGREES:
            series = chebyshev.Chebyshev.interpolate(squared, degree, (-1, 1)).coef
            error = np.abs(chebyshev.chebval(between, series) - squared(between)).max()
            if error < _FINE * supply**2:
                return cls(lowest_m=low, highest_m=high, coefficients_V2=tuple(series.tolist()))
        raise Failure(f"no series of degree {degree} follows the static curve up to "
                      f"{supply / 1e3:g} kV: choose a lower --supply")

    def squared(self, deflection: Any) -> Any:
        """Compute U² [V²] that holds a deflection [m] at rest, by Clenshaw's rule as in the C."""
        t = (2 * deflection - self.lowest_m - self.highest_m) / (self.highest_m - self.lowest_m)
        after = before = 0.0 * t
        for coefficient in self.coefficients_V2[:0:-1]:
            after, before = 2 * t * after - before + coefficient, after
        return t * after - before + self.coefficients_V2[0]


Rows = tuple[tuple[float, ...], ...]

#: Design method of a controller.
Method = Literal["pi", "lqg"]


@dataclass(frozen=True, kw_only=True)
class LinearLaw:
    """v = C s + D (r, y) and s⁺ = A s + B (r, y) + G (v' − v), once a sampling interval.

    s is the memory, r the wanted deflection, y the reading, v the requested deflection at rest,
    and v' its value limited to what the supply can hold.
    """

    a: Annotated[Rows, Key("A, by rows")]
    b: Annotated[Rows, Key("B, by rows")]
    c: Annotated[tuple[float, ...], Key("C")]
    d: Annotated[tuple[float, ...], Key("D")]
    g: Annotated[tuple[float, ...], Key("G")]
    rest: Annotated[Rows, Key("the memory after a long rest, per r and y, by rows")]

    @classmethod
    def of(cls, a: Array, b: Array, c: Array, d: Array, g: Array, rest: Array) -> LinearLaw:
        """Make a law from arrays."""
        return cls(**{name: _plain(part.tolist()) for name, part in (
            ("a", a), ("b", b), ("c", c), ("d", d), ("g", g), ("rest", rest))})

    @cached_property
    def arrays(self) -> tuple[Array, ...]:
        """A, B, C, D, G as arrays."""
        return tuple(np.array(part) for part in (self.a, self.b, self.c, self.d, self.g))

    def response(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Compute the transfer function v/y at points of the z-plane."""
        a, b, c, d, _ = self.arrays
        inner = np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a,
                                np.broadcast_to(b[:, 1:], (len(z), len(a), 1)))
        return np.asarray((c @ inner)[:, 0] + d[1])


@dataclass(frozen=True, kw_only=True)
class Controller:
    """Voltage from a wanted and a read deflection, once a sampling interval.

    The controller asks for a deflection at rest, and the static inverse gives its voltage. So the
    loop has the same static gain at any deflection. The voltage is limited to the supply's. The
    memory then takes the value that fits the limited voltage.
    """

    inverse: Annotated[StaticInverse, Key("voltage squared by deflection at rest")]
    supply_V: Annotated[float, Key("highest voltage of the supply; the lowest is 0")]
    interval_s: Annotated[float, Key("sampling interval")]
    method: Annotated[Method, Key("how it is designed")]
    filter_s: Annotated[float | None, Key(
        "time of each of the two lags of a PI controller; 0 for none")]
    proportional: Annotated[float | None, Key(
        "K_p of a PI controller, as deflection asked for per deflection missing")]
    integral_per_s: Annotated[float, Key("K_i; of LQG that of a slow error")]
    law: Annotated[LinearLaw, Key("what it does at a sample")]

    @property
    def resolution_V(self) -> float:
        """Voltage that the static inverse may give in place of 0: the root of its error."""
        return float(_FINE**0.5 * self.supply_V)

    @classmethod
    def pi(cls, inverse: StaticInverse, supply: float, interval: float, lag: float,
           proportional: float, integral: float) -> Controller:
        """Make a PI controller: y = r + K_p e + K_i ∫ e dt.

        Both r and the reading pass two equal lags [s]. So the plate's swing is neither excited nor
        fed back.
        """
        share = _share(interval, lag)
        # Rows over memory (two lags of either, the integral) and inputs (r, reading).
        unit = np.eye(7)
        lagged = []
        for at, given in ((0, 5), (2, 6)):
            first = (1 - share) * unit[at] + share * unit[given]
            lagged += [first, (1 - share) * unit[at + 1] + share * first]
        error = lagged[1] - lagged[3]
        summed = unit[4] + integral * interval * error
        asked = lagged[1] + proportional * error + summed
        rows = np.array([*lagged, summed])
        rest = np.zeros((5, 2))
        rest[:2, 0] = rest[2:4, 1] = 1.0
        law = LinearLaw.of(rows[:, :5], rows[:, 5:], asked[:5], asked[5:], unit[4, :5], rest)
        return cls(inverse=inverse, supply_V=supply, interval_s=interval, method="pi",
                   filter_s=lag, proportional=proportional, integral_per_s=integral, law=law)

    def c_source(self, name: str) -> str:
        """Write the controller as C99 functions, named after a specimen."""
        text = resources.files("tympan.studies.lumped.control").joinpath("source.txt")
        inverse, law = self.inverse, self.law
        parts = {key: ", ".join(map(repr, np.ravel(getattr(law, key)).tolist()))
                 for key in ("a", "b", "c", "d", "g", "rest")}
        return Template(text.read_text(encoding="utf-8")).substitute(
            parts, title=name, name=identifier(name), interval=repr(self.interval_s),
            size=len(law.c), series=", ".join(map(repr, inverse.coefficients_V2)),
            lowest=repr(inverse.lowest_m), highest=repr(inverse.highest_m),
            supply=repr(float(self.supply_V)))

    def resting(self, reference: Any, reading: Any) -> Array:
        """Compute the memory after a long rest at deflections [m] of any shape, (…, size)."""
        inputs = np.stack(np.broadcast_arrays(reference, reading), axis=-1)
        return np.asarray(inputs @ np.array(self.law.rest).T)

    def voltage(self, memory: Array, reference: Any, reading: Any) -> tuple[Any, Array]:
        """Compute the voltage [V] until the next sample and the next memory; deflections [m]."""
        a, b, c, d, g = self.law.arrays
        inputs = np.stack(np.broadcast_arrays(reference, reading), axis=-1)
        asked = memory @ c + inputs @ d
        given = np.clip(asked, self.inverse.lowest_m, self.inverse.highest_m)
        voltage = np.sqrt(np.clip(self.inverse.squared(given), 0.0, self.supply_V**2))
        return voltage, memory @ a.T + inputs @ b.T + (given - asked)[..., None] * g


#: Controller design that still needs the inverse of the static curve and the supply [V].
Made = Callable[[StaticInverse, float], Controller]


def _plain(values: Any) -> Any:
    return tuple(map(_plain, values)) if isinstance(values, list) else values


def _share(interval: float, lag: float) -> float:
    """Compute the share of the remaining way that a lag covers in an interval."""
    return float(-np.expm1(-interval / lag)) if lag else 1.0
