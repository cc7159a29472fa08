"""Voltage supply: the voltage that the film sees at a nominal voltage, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Annotated, Any, Self

import numpy as np

from tympan.base.fields import Key, takes_units
from tympan.base.toml_reader import NON_NEGATIVE, Rule
from tympan.fem.circuit import Circuit
from tympan.fem.rig.direction import HYSTERESIS, not_turned
from tympan.fem.rig.gain import GAIN

_SAG: Rule = (lambda x: x >= 1, "must be at least 1 V; inf for none")

_LEAKAGE: Rule = (lambda x: x > 0, "must be positive; inf for none")

#: Highest nominal voltage [V] that inputs and searches may use: no such film is tested above.
MOST_VOLTAGE = 1e6

#: Rule for voltages that such a film could bear; larger ones are unit errors.
VOLTAGE_RULE: Rule = (lambda x: 0 <= x <= MOST_VOLTAGE,
                      f"must be from 0 to {MOST_VOLTAGE / 1e3:g} kV")


@takes_units
@dataclass(frozen=True, kw_only=True)
class Supply:
    """Amplifier and circuit between a nominal voltage and the film; the defaults are ideal."""

    amplifier_gain: Annotated[float, Key("k: the film sees (1+k) U", rule=GAIN)] = 0.0
    sag_voltage: Annotated[float, Key("U_s: the film sees U/(1+(U/U_s)²)", "voltage", _SAG)] = inf
    lag_voltage: Annotated[float, Key("by how much the film is behind a rising or falling voltage",
                                      "voltage", NON_NEGATIVE), HYSTERESIS] = 0.0
    series_resistance: Annotated[float, Key("through which the film charges", "resistance",
                                            NON_NEGATIVE)] = 0.0
    leakage_resistance: Annotated[float, Key("between the electrodes", "resistance",
                                             _LEAKAGE)] = inf

    @property
    def circuit(self) -> Circuit:
        """Resistances between supply and film."""
        return Circuit(self.series_resistance, self.leakage_resistance)

    @property
    def source(self) -> Self:
        """Supply without leakage: its steady film voltage is the source's voltage in time."""
        return replace(self, leakage_resistance=inf)

    def film_voltage(self, voltage: Any, direction: Any = 0.0) -> Any:
        """Compute the film's voltage [V] from a nominal one: (1+k) U/(1+(U/U_s)²) minus lag.

        A leak past the film leaves the share R_l/(R_l + R) behind the series resistance R. The lag
        never changes the sign. Arguments are numbers or arrays. ``direction`` is 1 for a rising
        voltage, -1 for a falling one, 0 if unknown.

        Examples
        --------
        >>> Supply(sag_voltage=7000.0).film_voltage(7000.0)
        3500.0
        >>> [Supply(lag_voltage=100.0).film_voltage(3000.0, direction) for direction in (1.0, -1.0)]
        [2900.0, 3100.0]
        >>> Supply(amplifier_gain=0.5).film_voltage(-1000.0)
        -1500.0
        >>> Supply(series_resistance=1e8, leakage_resistance=1e9).film_voltage(1100.0)
        1000.0
        """
        # The lag belongs to the film: it applies after the supply's effects.
        sag = voltage / self.sag_voltage
        # A product, since numbers and arrays round a power differently.
        supplied = self.circuit.share * (1 + self.amplifier_gain) * voltage / (1 + sag * sag)
        if isinstance(self.lag_voltage, float) and self.lag_voltage == 0:
            return supplied
        return not_turned(supplied, supplied - direction * self.lag_voltage)

    @property
    def most_voltage(self) -> float:
        """Nominal voltage [V], up to :data:`MOST_VOLTAGE`, with the largest film voltage.

        An amplifier with sag has its largest output at ``sag_voltage``.
        """
        return min(self.sag_voltage, MOST_VOLTAGE)

    def most_film_voltage(self, direction: float = 0.0) -> float:
        """Compute the largest film voltage [V] over all nominal voltages."""
        return float(self.film_voltage(self.most_voltage, direction))

    def nominal_voltage(self, film_voltage: Any, direction: float = 0.0) -> Any:
        """Find the lowest nominal voltage [V] for film voltages [V], numbers or arrays.

        Infinite if no nominal voltage gives a film voltage; values that are not finite stay
        unchanged. A falling voltage leaves at least the lag on the film: lower film voltages have
        nominal voltages below 0.

        Examples
        --------
        >>> Supply(sag_voltage=7000.0, amplifier_gain=0.1).film_voltage(4000.0)
        3316.923...
        >>> Supply(sag_voltage=7000.0, amplifier_gain=0.1).nominal_voltage(3316.9230769)
        3999.99...
        >>> Supply(sag_voltage=7000.0).nominal_voltage([3500.0, 3600.0])
        array([7000.,   inf])
        """
        film = np.asarray(film_voltage, dtype=float)
        supplied = (film + direction * self.lag_voltage) / self.circuit.share
        gain = 1 + self.amplifier_gain
        with np.errstate(invalid="ignore"):
            # gain U = supplied (1 + (U/U_s)²), its smaller root.
            square = gain**2 - (2 * supplied / self.sag_voltage) ** 2
            root = 2 * supplied / (gain + np.sqrt(np.maximum(square, 0.0)))
        nominal = np.where(square >= 0, root, inf)
        nominal = np.where(np.isfinite(film), nominal, film)
        return nominal if nominal.ndim else float(nominal)

    def shown_voltage(self, film_voltage: float, direction: float = 0.0) -> float:
        """Find the nominal voltage [V] that the supply displays for a film voltage [V].

        The result is limited to 0 and :attr:`most_voltage`. Rounding at the supply's largest output
        and a lag therefore cannot exceed these limits.

        Examples
        --------
        >>> Supply(sag_voltage=7000.0).shown_voltage(3500.0 * (1 + 1e-15))
        7000.0
        >>> Supply(lag_voltage=100.0).shown_voltage(50.0, direction=-1.0)
        0.0
        """
        nominal = self.nominal_voltage(film_voltage, direction)
        return float(max(min(nominal, self.most_voltage), 0.0))
