"""What acts on film and plate: weight and where it hangs, guide, bias mechanisms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.enclosed_volume import plate_volume
from tympan.fem.membrane.state import HEAVE, PlateMotion, State
from tympan.geometry.fields import Key, Registry
from tympan.geometry.toml_reader import NON_NEGATIVE, POSITIVE, Rule

Array = NDArray[Any]

_POWER: Rule = (lambda x: 1 < x <= 12, "must be above 1 and at most 12")

#: How the plate may move: freely; without tilting; up and down only; not at all.
Guide = Literal["free", "level", "vertical", "fixed"]

GUIDES: dict[Guide, frozenset[str]] = {
    "free": frozenset({"x", "y", "z", "rx", "ry", "rz"}),
    "level": frozenset({"x", "y", "z", "rz"}),
    "vertical": frozenset({"z"}),
    "fixed": frozenset(),
}

#: Among the plate's six freedoms.
_UP = np.eye(6)[HEAVE]


class Bias(Protocol):
    """A mechanism between plate and ground; its energy depends on the deflection alone."""

    law: ClassVar[str]

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        """Energy [J], its derivative [N] (positive: pushes back), its second derivative [N/m]."""


#: Bias mechanisms that rig files may name.
BIASES: Registry[Any] = Registry("law")


@BIASES.register
@dataclass(frozen=True)
class Spring:
    """A linear spring.

    Examples
    --------
    >>> Spring(8.0).derivatives(0.25)
    (0.25, 2.0, 8.0)
    """

    law: ClassVar[str] = "spring"
    stiffness: Annotated[float, Key("its stiffness", "stiffness per length", NON_NEGATIVE)]
    rest: Annotated[float, Key("heave at which it is unloaded", "length")] = 0.0

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        stretch = deflection - self.rest
        return self.stiffness * stretch**2 / 2, self.stiffness * stretch, self.stiffness


@BIASES.register
@dataclass(frozen=True)
class Magnet:
    """A magnet below the plate that pulls with F = F₀ (1 + g/d)^(−n) over the gap g = gap − w.

    Far away the pull of two dipoles falls with n = 4. The plate's negative stiffness makes the
    actuator snap through.
    """

    law: ClassVar[str] = "magnet"
    force: Annotated[float, Key("F₀ at contact", "force", POSITIVE)]
    gap: Annotated[float, Key("gap at the mounted plate", "length", POSITIVE)]
    decay: Annotated[float, Key("d", "length", POSITIVE)]
    power: Annotated[float, Key("n", rule=_POWER)] = 4.0

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        # The energy is −F₀ d/(n−1) (1 + g/d)^(1−n).
        n, d = self.power, self.decay
        near = 1 + (self.gap - deflection) / d
        if np.real(near) <= 0:  # no step may end there, nor pass the pole
            return np.nan, np.nan, np.nan
        return (-self.force * d / (n - 1) * near ** (1 - n), -self.force * near**-n,
                -self.force * n / d * near ** (-n - 1))


@dataclass(frozen=True)
class Loading:
    """What acts on film and plate besides force, voltage and gas pressure.

    ``arm``: where the force is applied, from the plate's centre in the mounted state [m]; it moves
    with the plate. ``gravity``: on the film's own mass, along the load [m/s²].
    """

    biases: tuple[Bias, ...] = ()
    arm: tuple[float, float] = (0.0, 0.0)
    guide: Guide = "free"
    gravity: float = 0.0

    def lift(self, plate: PlateMotion) -> Array:
        """Derivative of the height of the weight by the plate's six freedoms."""
        return np.asarray(plate.gradient(self._arm)[0, HEAVE])

    def on_plate(self, state: State, centre: Array, area: float) -> tuple[Any, Array, Array]:
        """Potential of what acts on the plate [J], and its derivatives by the six freedoms.

        Force, bias mechanisms, and the gas pressure on the plate's ``area`` [m²].
        """
        plate = state.plate
        biases = [bias.derivatives(plate.deflection) for bias in self.biases]
        energy, push, stiffness = np.sum([(0.0, 0.0, 0.0), *biases], axis=0)
        energy = energy - state.force * plate.positions(centre, self._arm)[0, HEAVE]
        first = push * _UP - state.force * self.lift(plate)
        weight = np.array([[0.0, 0.0, -state.force]])
        second = plate.curvature(self._arm, weight) + stiffness * np.outer(_UP, _UP)
        if state.pressure:
            volume, by, bend = plate_volume(area, plate)
            energy = energy - state.pressure * volume
            first, second = first - state.pressure * by, second - state.pressure * bend
        return energy, first, second

    @property
    def _arm(self) -> Array:
        return np.array([[*self.arm, 0.0]])
