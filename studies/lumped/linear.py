"""The lumped model's small motions about a rest: state space, poles by name, gain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.extras import needs
from tympan.studies.files import write_arrays, write_csv, write_json
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest

if TYPE_CHECKING:
    from scipy.signal import StateSpace


#: Input of the model: the voltage, or its square, to which the force is proportional.
Input = Literal["U", "U2"]
INPUTS: dict[Input, tuple[str, str]] = {"U": ("voltage", "V"), "U2": ("voltage_squared", "V2")}

#: Largest imaginary part, over the pole's size, that is rounding error.
_REAL = 1e-9
#: Largest share of the plate in a motion that does not move it.
_HIDDEN = 1e-9


@dataclass(frozen=True)
class Pole:
    """A pole [1/s], for a pair the upper one, and its motion.

    ``name`` is *oscillation* of the plate on the film, *overdamped plate* where the plate does not
    swing, *charging* of the film, *creep* of the branches, *creep between circles*, which does not
    move the plate, or *pull-in*, which grows. ``share`` is the pole's part of the gain, for a pair
    that of both poles. It is None for a motion that never ends.
    """

    name: str
    value: complex
    share: float | None

    @property
    def frequency(self) -> float:
        """Frequency of an oscillation [Hz]; 0 without oscillation."""
        return float(self.value.imag / (2 * np.pi))

    @property
    def damping_ratio(self) -> float:
        return float(-self.value.real / abs(self.value)) if self.value else 0.0

    @property
    def time(self) -> float | None:
        """Time in which it falls or grows by a factor e [s]; None if it does neither."""
        return float(1 / abs(self.value.real)) if self.value.real else None

    def json(self) -> dict[str, Any]:
        return {"name": self.name, "real_per_s": self.value.real, "imaginary_per_s":
                self.value.imag, "frequency_Hz": self.frequency,
                "damping_ratio": self.damping_ratio, "time_s": self.time,
                "share_of_gain": self.share}


@dataclass(frozen=True, eq=False)
class Linear:
    """ẋ = A x + B δu, δy = C x + D δu; x is (δy, δẏ, δε₁ of every circle), δy [m], downwards.

    A film that charges through a resistance has its charge [C] as a last state.

    ``driven_by`` names the input u: the voltage [V] or its square [V²]. ``gain`` is δy/δu at rest
    [m/V or m/V²]. ``film_frequency`` [Hz] is the plate's on the film alone, its branches relaxed,
    as in :mod:`tympan.studies.modes`; the branches make the oscillation faster. ``specimen`` and
    ``mass`` [kg] identify the actuator.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    deflection: float
    voltage: float
    driven_by: Input
    gain: float
    film_frequency: float
    specimen: str
    mass: float
    charges: bool = False
    warnings: tuple[str, ...] = ()

    @property
    def states(self) -> list[str]:
        """Names of the states."""
        branches = range(1, len(self.a) - 1 - self.charges)
        return ["deflection", "speed", *(f"branch_{number}" for number in branches),
                *["charge"][:self.charges]]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of ``a`` [1/s], the slowest first."""
        values = np.linalg.eigvals(self.a)
        return np.asarray(values[np.argsort(np.abs(values))], dtype=np.complex128)

    @property
    def named_poles(self) -> tuple[Pole, ...]:
        """Poles with names, the slowest first, for a pair the upper one."""
        values, right = np.linalg.eig(self.a)
        inverse = np.linalg.pinv(right)
        taken = np.abs(right * inverse.T)  # participation of every state in every motion
        plate, charge = ((taken[rows].sum(axis=0) / taken.sum(axis=0)).tolist() for rows in (
            slice(2), slice(len(taken) - self.charges, None)))
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = -((self.c @ right)[0] * (inverse @ self.b)[:, 0] / values) / self.gain
        poles = []
        for number in np.argsort(np.abs(values), kind="stable"):
            value = complex(values[number])
            if abs(value.imag) < _REAL * abs(value):
                value = complex(value.real)
            if value.imag < 0:
                continue
            share = float(shares[number].real) * (2 if value.imag else 1)
            poles.append(Pole(_name(value, plate[number], charge[number]), value,
                              share if np.isfinite(share) else None))
        return tuple(poles)

    def to_control(self) -> Any:
        """Convert it to a python-control ``StateSpace``, if python-control is installed."""
        needs("control", "a state-space object of python-control")
        import control

        return control.ss(self.a, self.b, self.c, self.d, inputs=[INPUTS[self.driven_by][0]],
                          outputs=["deflection"], states=self.states)

    def to_scipy(self) -> StateSpace:
        """Convert it to a ``scipy.signal.StateSpace``."""
        from scipy.signal import StateSpace

        return StateSpace(self.a, self.b, self.c, self.d)

    def write_csv(self, file: Path) -> None:
        """Write A, B, C and D as one table: a row for each rate of a state, and for the output.

        The columns are the states, then the model's input.
        """
        table = np.block([[self.a, self.b], [self.c, self.d]])
        names = [*(f"rate of {state}" for state in self.states), "deflection"]
        write_csv(file, ["", *self.states, INPUTS[self.driven_by][0]],
                  [[name, *map(float, row)] for name, row in zip(names, table, strict=True)])

    def write_arrays(self, file: Path) -> None:
        """Write A, B, C, D and the other numbers by name, as NAME.mat or NAME.npz."""
        write_arrays(file, {name: np.array(value) for name, value in self.motions().items()
                            if name != "poles"})

    def json(self) -> dict[str, Any]:
        """Convert motions, specimen, mass and warnings to a JSON object."""
        return {"specimen": self.specimen, "mass_kg": self.mass, **self.motions(),
                "warnings": list(self.warnings)}

    def motions(self) -> dict[str, Any]:
        """Convert state space, poles and gain to a JSON object."""
        _, unit = INPUTS[self.driven_by]
        return {"deflection_m": self.deflection, "voltage_V": self.voltage, "input": self.driven_by,
                "states": self.states,
                "A": self.a.tolist(), "B": self.b.tolist(), "C": self.c.tolist(),
                "D": self.d.tolist(), f"gain_m_per_{unit}": self.gain,
                "film_frequency_Hz": self.film_frequency,
                "poles_per_s": [[float(pole.real), float(pole.imag)] for pole in self.poles],
                "poles": [pole.json() for pole in self.named_poles]}


@dataclass(frozen=True, eq=False)
class LinearResult:
    """The small motions of several actuators at one voltage."""

    linear: tuple[Linear, ...]

    #: Writers of the matrices of a single actuator, by file name ending.
    writers: ClassVar[Mapping[str, Callable[[LinearResult, Path], None]]] = {
        ".csv": lambda result, file: result._only.write_csv(file),
        ".npz": lambda result, file: result._only.write_arrays(file),
        ".mat": lambda result, file: result._only.write_arrays(file)}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each pole of each actuator."""
        return [{"specimen": linear.specimen, **pole.json()}
                for linear in self.linear for pole in linear.named_poles]

    def to_control(self) -> Any:
        """Convert a single actuator's motions to a python-control ``StateSpace``, if installed."""
        return self._only.to_control()

    def to_scipy(self) -> StateSpace:
        """Convert a single actuator's motions to a ``scipy.signal.StateSpace``."""
        return self._only.to_scipy()

    @property
    def _only(self) -> Linear:
        if len(self.linear) != 1:
            raise InputError("there are several: choose one by result.linear[0]", key="linear",
                             given=len(self.linear))
        return self.linear[0]

    def json(self) -> dict[str, Any]:
        return {"linear": [linear.json() for linear in self.linear]}

    def save(self, folder: Path) -> None:
        """Write linear.json."""
        write_json(folder / "linear.json", self.json())


def _name(pole: complex, plate: float, charge: float) -> str:
    if pole.real > 0:
        return "pull-in"
    if charge > 0.5:
        return "charging"
    if pole.imag:
        return "oscillation"
    if plate > 0.5:
        return "overdamped plate"
    return "creep between circles" if plate < _HIDDEN else "creep"


def linearise(actuator: Actuator, voltage: float, deflection: float | None = None,
              by: Input = "U") -> Linear:
    """Linearise about rest at a voltage [V], by default the stable rest; exact derivatives.

    The film's pull is proportional to the square of the voltage, so at 0 kV a small voltage has no
    effect. There use ``by="U2"``, for the effect of the squared voltage.
    """
    at = rest(actuator, voltage) if deflection is None else deflection
    about = actuator.about(voltage) if by == "U2" else voltage
    state = actuator.rest(at, about)
    seen = np.zeros((1, len(state)))
    seen[0, 0] = 1.0
    driven = actuator.by_voltage(state, about, by == "U2")
    stiffness = float(actuator.balance(at, voltage)[1])
    return Linear(actuator.linear(state, about)[1], driven[:, None], seen, np.zeros((1, 1)), at,
                  voltage, by, float(actuator.by_rest_voltage(at, about, by == "U2") / stiffness),
                  float(np.sqrt(max(stiffness, 0.0) / actuator.moved) / (2 * np.pi)),
                  actuator.specimen.name, actuator.mass, actuator.charges)
