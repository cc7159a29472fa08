"""Voltage source, and the circuit between source and electrodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.membrane.damped_rule import end_weight


class SourceSignal(Protocol):
    """Voltage of a film or source in time, smooth in pieces between ``breaks`` [s]."""

    @property
    def breaks(self) -> Array:
        """Times that separate the smooth pieces [s], shape (pieces + 1,)."""

    @property
    def first(self) -> Any:
        """Voltage before the first break [V]."""

    def within(self, piece: Any, time: Any) -> Any:
        """Evaluate the voltage [V] at times of a piece; both ends belong to it."""


#: Voltage that moves no film [V].
_NO_VOLTAGE = 1e-3


def highest_voltage(signal: SourceSignal) -> float:
    """Find the largest size of a signal's voltage at the quarters of its pieces [V].

    A sine about 0 V is 0 at the ends of its pieces, which are periods; its peaks are at quarters.
    """
    begin, end = signal.breaks[:-1], signal.breaks[1:]
    pieces = np.arange(len(begin))
    times = [begin + share * (end - begin) for share in (0.0, 0.25, 0.5, 0.75)] + [end]
    sizes = [np.abs(signal.within(pieces, each)).max(initial=0.0) for each in times]
    return max(float(max(sizes)), _NO_VOLTAGE)


@dataclass(frozen=True)
class Circuit:
    """Circuit of source and film: a ``resistance`` in series, a ``leakage`` in parallel [Ω]."""

    resistance: float = 0.0
    leakage: float = np.inf

    @property
    def conductance(self) -> float:
        """Sum of both resistances' conductances, as the film sees them [1/Ω]."""
        return 1 / self.resistance + 1 / self.leakage

    @property
    def share(self) -> float:
        """Share of the source's voltage across the film in the steady state."""
        return 1 / (1 + self.resistance / self.leakage)

    def time(self, capacitance: Any) -> Any:
        """Compute the charging time constant of a film with a capacitance [F], in s."""
        return self.share * self.resistance * capacitance

    def current(self, source: Any, film: Any) -> Any:
        """Compute the electrodes' current [A] from both voltages [V]; 0 without resistance."""
        return (source - film) / self.resistance - film / self.leakage if self.resistance else 0.0

    def charged(self, charge: float, current: float, source: float, duration: float,
                capacitance: float) -> tuple[float, float]:
        """Compute a film's charge after a duration [s] as Q − C U [C, F], for its voltage U.

        The damped trapezoidal rule is applied to a film with a ``capacitance`` [F]. ``charge`` [C]
        and ``current`` [A] are the values before the step; ``source`` is the source's voltage [V]
        at its end.
        """
        later = end_weight(duration * self.conductance / capacitance)
        at_no_voltage = (1 - later) * current + later * source / self.resistance
        return charge + duration * at_no_voltage, duration * later * self.conductance
