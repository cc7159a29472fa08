"""The lumped model about an operating point, as a linear state-space model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.system import MissingLibrary
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linear:
    """ẋ = A x + B δu, δy = C x + D δu; x is (δy, δẏ, δε₁ of every circle), δy [m], δu [V]."""

    a: Array
    b: Array
    c: Array
    d: Array
    deflection: float
    voltage: float

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s], the slowest first."""
        values = np.linalg.eigvals(self.a)
        return np.asarray(values[np.argsort(np.abs(values))], dtype=np.complex128)

    @property
    def gain(self) -> float:
        """δy/δu at rest [m/V]."""
        return float((self.d - self.c @ np.linalg.solve(self.a, self.b))[0, 0])

    def to_control(self) -> Any:
        """The same as a python-control ``StateSpace``.

        Raises
        ------
        MissingLibrary
            When python-control is not installed.
        """
        try:
            import control
        except ImportError:
            raise MissingLibrary("a state-space object needs python-control: pip install "
                                 "control") from None
        circles = range(1, len(self.a) - 1)
        return control.ss(self.a, self.b, self.c, self.d, inputs=["voltage"],
                          outputs=["deflection"],
                          states=["deflection", "speed",
                                  *(f"branch_{number}" for number in circles)])

    def json(self) -> dict[str, Any]:
        """The matrices, the point and the poles."""
        return {"deflection_m": self.deflection, "voltage_V": self.voltage, "A": self.a.tolist(),
                "B": self.b.tolist(), "C": self.c.tolist(), "D": self.d.tolist(),
                "gain_m_per_V": self.gain,
                "poles_per_s": [[float(pole.real), float(pole.imag)] for pole in self.poles]}


def linearise(actuator: Actuator, voltage: float, deflection: float | None = None) -> Linear:
    """About rest at a voltage [V], by default the stable one; derivatives are exact."""
    at = rest(actuator, voltage) if deflection is None else deflection
    state = actuator.rest(at)
    seen = np.zeros((1, len(state)))
    seen[0, 0] = 1.0
    return Linear(actuator.linear(state, voltage)[1], actuator.by_voltage(state, voltage)[:, None],
                  seen, np.zeros((1, 1)), at, voltage)
