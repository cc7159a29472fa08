"""Charge of a reduced film in a collocated time step, with a series resistance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.film.staged_memory import StagedFlow
from tympan.studies.films.driven_film import DrivenFilm, ReducedMoment

#: Step of the voltage for the derivative of the forces with respect to U². It is the voltage
#: equivalent of this deflection over the gap.
_MORE = 1e-2


@dataclass(frozen=True, eq=False)
class Charging:
    """A film that charges through its circuit in a step from a moment.

    Its charge C U at a stage is the charge at the start plus the charge that has flowed in since
    then. ``source``: voltages of the source at the stages [V]. ``weights``: weights of the stages'
    rates in each stage [s], shape (stages, stages). The unknowns x of a stage are q and the film's
    voltage, scaled to a length.
    """

    motion: DrivenFilm
    moment: ReducedMoment
    source: Array
    weights: Array

    def voltage(self, x: Array) -> Array:
        """Compute the voltage across the film at the stages [V], shape (..., stages)."""
        return np.asarray(x[..., -1] * self.motion.volts_per_length)

    def missing(self, x: Array) -> Array:
        """Compute the charge balance as a length [m], shape (..., stages).

        It is the charge of the film minus the initial charge and the charge that has flowed in.
        """
        voltage, before = self.voltage(x), np.asarray(self.moment.voltage)
        begun = self._capacity(self.moment.q, before) * before
        flown = self.motion.circuit.current(self.source, voltage) @ self.weights.T
        charge = self._capacity(x[..., :-1], voltage) * voltage
        return np.asarray((charge - begun[..., None] - flown) / self._unit)

    def coupled(self, stiffness: Array, x: Array, pull: Array, flow: StagedFlow) -> Array:
        """Compute the tangent of film and circuit.

        Its shape is (..., stages, unknowns, stages, unknowns). ``stiffness``, ``pull`` and ``flow``
        are those of the film alone at x.
        """
        voltage, motion = self.voltage(x), self.motion
        *runs, stages, count = pull.shape
        every = np.arange(stages)
        # The pull is almost linear in U²; its slope is −½ ∂C/∂q.
        more = (_MORE * motion.volts_per_length * motion.gap) ** 2
        stronger, _ = motion.tabulated.staged_forces(x[..., :-1], voltage**2 + more, flow)
        by_squared = (stronger - pull) / more
        matrix = np.zeros((*runs, stages, count + 1, stages, count + 1))
        matrix[..., :count, :, :count] = stiffness
        by_voltage = 2 * voltage[..., None] * by_squared
        matrix[..., every, :count, every, -1] = (
            np.moveaxis(by_voltage, -2, 0) * motion.volts_per_length)
        matrix[..., every, -1, every, :count] = -by_voltage / self._unit
        lost = motion.circuit.conductance * self.weights
        capacity = self._capacity(x[..., :-1], voltage)
        by_own_voltage = lost + capacity[..., None] * np.eye(stages)
        matrix[..., :, -1, :, -1] = by_own_voltage * motion.volts_per_length / self._unit
        return matrix

    def _capacity(self, q: Array, voltage: Array) -> Any:
        """Compute the capacitance of the film [F]."""
        return self.motion.film.capacitance(q, voltage**2)

    @cached_property
    def _unit(self) -> float:
        """Charge that is equivalent to a deflection of 1 m [C]."""
        motion = self.motion
        return float(motion.film.capacitance(motion.film.flat)) * motion.volts_per_length
