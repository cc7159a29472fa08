"""What a controller drives: a voltage held for a time, and where the plate is then."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from tympan.fem.transient.collocation import radau
from tympan.geometry.errors import Failure
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import settle, squared_at

Array = NDArray[np.float64]

#: Stages of a step: order 7, so that a step of a radian of the swing errs by 1e-6.
_STAGES = 4
#: Most of a swing in a step [rad].
_RADIANS = 1.0
#: Newton's corrections of a step at most; it takes two or three.
_CORRECTIONS = 6
#: The last correction [m]: of what is left after it the square counts.
_LAST = 1e-9


class Plant(Protocol):
    """A film with its plate at a moment; one, or several at once."""

    @property
    def deflection(self) -> Any:
        """Deflection [m]."""

    def after(self, voltage: Any, duration: float) -> Self:
        """The same after a nominal voltage [V] was held for a time [s]."""


@dataclass(frozen=True, eq=False)
class LumpedPlant:
    """The lumped model of an actuator, or of an array of them, in a state.

    ``past``: the length of its last step [s], and the states at its start and its stages.
    """

    actuator: Actuator
    state: Array
    past: tuple[float, Array] | None = None

    @classmethod
    def resting(cls, actuator: Actuator, voltage: float = 0.0) -> LumpedPlant:
        """The plant at rest at a voltage [V]."""
        y = settle(lambda at: actuator.balance(at, voltage), actuator.flat)
        if not np.isfinite(y).all():
            raise Failure(f"the film does not rest at {voltage / 1e3:g} kV")
        return cls(actuator, actuator.rest(y))

    @property
    def deflection(self) -> Array:
        return np.asarray(self.state[..., 0])

    def holds(self, deflection: Any, voltage: Any) -> Any:
        """Whether a nominal voltage [V] holds a deflection [m], or pulls beyond it, as it crept."""
        needed = squared_at(self.actuator, deflection, self.state[..., 2:])
        return needed <= self.actuator.rig.film_voltage(voltage) ** 2

    def after(self, voltage: Any, duration: float) -> LumpedPlant:
        """Step by Radau's rule, as finely as the swing needs."""
        held = np.asarray(voltage)
        if self.past and self.past[0] == duration:
            return self._stepped(held, duration)
        slopes = self.actuator.linear(self.state, held)[1]
        swing = np.sqrt(np.abs(slopes[..., 1, 0]).max())
        count = max(1, int(np.ceil(duration * swing / _RADIANS)))
        plant = self
        for _ in range(count):
            plant = plant._stepped(held, duration / count)
        return plant

    def _stepped(self, voltage: Any, duration: float) -> LumpedPlant:
        rule, state, size = radau(_STAGES), self.state, self.state.shape[-1]
        weights = duration * rule.matrix
        # Stages first: actuators broadcast behind them.
        stages = np.tensordot(rule.beyond(1.0), self.past[1], 1) \
            if self.past and self.past[0] == duration else np.repeat(state[None], _STAGES, 0)
        identity = np.eye(_STAGES * size)
        for _ in range(_CORRECTIONS):
            rates, slopes = self.actuator.linear(stages, voltage)
            missed = stages - state - np.tensordot(weights, rates, 1)
            matrix = np.einsum("ij,j...kl->...ikjl", weights, slopes)
            matrix = identity - matrix.reshape(*matrix.shape[:-4], *identity.shape)
            flat = np.moveaxis(missed, 0, -2).reshape(*state.shape[:-1], -1, 1)
            moved = np.linalg.solve(matrix, flat).reshape(*state.shape[:-1], _STAGES, size)
            stages = stages - np.moveaxis(moved, -2, 0)
            if not np.abs(moved[..., 0]).max() > _LAST:
                break
        return replace(self, state=stages[-1],
                       past=(duration, np.concatenate([state[None], stages])))
