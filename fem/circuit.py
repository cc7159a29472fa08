"""A source of voltages, and what is between it and the film's electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.membrane.damped_rule import end_weight


class SourceSignal(Protocol):
    """A film's or source's voltage in time, smooth within pieces between ``breaks`` [s]."""

    @property
    def breaks(self) -> Array:
        """Times between which it is smooth [s], shape (pieces + 1,)."""

    @property
    def first(self) -> Any:
        """Voltage before it begins [V]."""

    def within(self, piece: Any, time: Any) -> Any:
        """Voltages [V] at times of a piece, its ends included."""


@dataclass(frozen=True)
class Circuit:
    """Circuit of source and film: a series ``resistance`` and a ``leakage`` past the film [Ω]."""

    resistance: float = 0.0
    leakage: float = np.inf

    @property
    def conductance(self) -> float:
        """Conductance of both resistances from the film [1/Ω]."""
        return 1 / self.resistance + 1 / self.leakage

    @property
    def share(self) -> float:
        """Share of the source's voltage that is across the film at rest."""
        return 1 / (1 + self.resistance / self.leakage)

    def time(self, capacitance: Any) -> Any:
        """Time in which a film of a capacitance [F] charges, by a factor e [s]."""
        return self.share * self.resistance * capacitance

    def current(self, source: Any, film: Any) -> Any:
        """Current to electrodes [A] at voltages of source and film [V]; 0 without resistance."""
        return (source - film) / self.resistance - film / self.leakage if self.resistance else 0.0

    def charged(self, charge: float, current: float, source: float, duration: float,
                capacitance: float) -> tuple[float, float]:
        """Charge of a film after a duration [s] at a voltage U of it, as Q − C U [C, F].

        By the damped trapezoidal rule of a film of a ``capacitance`` [F], from its ``charge`` [C]
        and ``current`` [A] before, under the source's voltage [V] at the end.
        """
        later = end_weight(duration * self.conductance / capacitance)
        at_no_voltage = (1 - later) * current + later * source / self.resistance
        return charge + duration * at_no_voltage, duration * later * self.conductance
