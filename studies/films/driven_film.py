"""A reduced film with its loads: force, voltage signal, and everything else on its plate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.circuit import Circuit, highest_voltage
from tympan.fem.equilibrium.newton import Budget
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.biases import Bias
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.transient.collocation import CollocationRule, radau
from tympan.studies.films.film import FilmLoads, ReducedFilm
from tympan.studies.signals import JointSignal, Signal, Supplied

#: Stages of a step of one run. The number of calls determines its cost, so many stages are cheap.
_STAGES = 5
#: Stages of a step of several runs, whose cost is arithmetic, or of a plate with inertia or damper.
_FEWER = 4

#: Factor on the accuracy of an oscillation: over many periods errors of phase add up.
PHASES = 2.0

#: Last correction of a state over the root of a step's error: the error after a correction is its
#: square.
_CLOSER = 0.2
#: Largest value of the last correction of a state, relative to the gap. Set by trial.
_NEAR = 2e-3

#: Error of a step, relative to the gap between plate and frame.
ERROR = 1e-4
#: Weight in the error of a voltage's change over the highest voltage, if a resistance charges the
#: film; the deflection over the gap has weight 1. It is the same as for finite elements.
_CHARGE = 0.1

@dataclass(frozen=True, eq=False)
class ReducedMoment:
    """A reduced film at a time [s]: q, loads, memory, velocity of the amplitudes of its plate.

    ``voltage``: signed voltage across a film that charges through a resistance [V]. Values belong
    to one run, or are arrays of several runs.
    """

    time: float
    q: Array
    loads: FilmLoads
    recall: Callable[[], Memory]
    velocity: Any = 0.0
    voltage: Any = 0.0

    @property
    def memory(self) -> Memory:
        """Memory of the branches, computed at first use."""
        return self.recall()

    @property
    def deflection(self) -> Any:
        """Deflection of the plate [m]."""
        return self.q[..., 0]


@dataclass(frozen=True, eq=False)
class DrivenFilm:
    """A reduced film under a force [N] and a source's voltage signal, or several runs.

    Several runs have forces of shape (runs,), or signals
    :class:`~tympan.studies.signals.JointSignal`; all runs have the same steps.

    ``biases``: mechanisms on the plate. ``plate``: the rigid plate; None if it has no
    inertia. ``damper``: damper on the plate [N s/m]. ``error``: error of a step, relative to the
    gap between plate and frame. ``budget``: work left to the motion; None sets no limit.
    ``circuit``: circuit between source and film; without a resistance the film has the source's
    voltage.
    """

    film: ReducedFilm
    force: Any
    signal: Signal | Supplied | JointSignal
    biases: tuple[Bias, ...] = ()
    plate: RigidPlate | None = None
    damper: float = 0.0
    error: float = ERROR
    budget: Budget | None = None
    circuit: Circuit = field(default_factory=Circuit)

    @property
    def begin(self) -> ReducedMoment:
        """Relaxed equilibrium under force and first voltage; ``flat`` if the film has an age.

        Raises
        ------
        NoBalance
            If there is no equilibrium.
        """
        film, time = self.tabulated, float(self.signal.breaks[0])
        if film.specimen.membrane.mounted is not None:
            return self.flat
        voltage = self.signal.first * (self.circuit.share if self.charges else 1.0)
        loads = FilmLoads(self.force, voltage**2, self.biases)
        q = film.at_rest(loads, self.last)
        memory, charging = film.relaxed(q), voltage if self.charges else 0.0
        return ReducedMoment(time, q, loads, lambda: memory, voltage=charging)

    @property
    def flat(self) -> ReducedMoment:
        """Flat film with the age that it states, before the loads are applied."""
        film, time = self.film, float(self.signal.breaks[0])
        runs = np.broadcast_shapes(np.shape(self.force), np.shape(self.signal.first))
        memory = Memory.mounted(film.specimen.membrane, (*runs, len(film.volumes)))
        q, none = np.zeros((*runs, film.count)), FilmLoads(0.0, 0.0)
        return ReducedMoment(time, q, none, lambda: memory, voltage=np.zeros(runs))

    @property
    def tabulated(self) -> ReducedFilm:
        """The film with its law in a table."""
        return self.film.tabulated

    @cached_property
    def rule(self) -> CollocationRule:
        """Collocation rule of a step."""
        several = np.ndim(self.force) or np.ndim(self.signal.first)
        return radau(_FEWER if several or self.led else _STAGES)

    @property
    def charges(self) -> bool:
        """Whether the film charges through a resistance."""
        return self.circuit.resistance > 0

    def unknowns(self, moment: ReducedMoment) -> Array:
        """Collect the unknowns of a step at a moment.

        They are q and, if the film charges through a resistance, its voltage scaled to a length.
        The scale makes errors of the voltage comparable with errors of q.
        """
        if not self.charges:
            return moment.q
        length = np.asarray(moment.voltage) / self.volts_per_length
        return np.concatenate([moment.q, length[..., None]], -1)

    @cached_property
    def volts_per_length(self) -> float:
        """Voltage [V] that is equivalent to a unit of deflection [m] in a step."""
        return self._highest / (_CHARGE * self.gap)

    @cached_property
    def _highest(self) -> float:
        """Highest voltage of the source [V]."""
        return highest_voltage(self.signal)

    @cached_property
    def led(self) -> int:
        """Number of amplitudes whose motion inertia or a damper control."""
        return int(self.damper > 0) if self.plate is None else self.film.led

    @cached_property
    def inertia(self) -> Array:
        """Mass matrix of the amplitudes that are led [kg]."""
        return (np.zeros((self.led, self.led)) if self.plate is None
                else self.film.inertia(self.plate))

    @cached_property
    def gap(self) -> float:
        """Gap between plate and frame [m]."""
        return self.film.specimen.gap

    @cached_property
    def last(self) -> float:
        """Correction of a state, relative to the gap, after which the iteration ends."""
        return min(_NEAR, _CLOSER * float(np.sqrt(self.closeness)))

    @cached_property
    def closeness(self) -> float:
        """Error of a step, relative to the gap; smaller for a plate with mass."""
        return self.error / (1.0 if self.plate is None else PHASES)
