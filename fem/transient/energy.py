"""Energy of a film in time, with the balance at its electrodes and its plate."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Annotated

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import Key
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, State
from tympan.fem.transient.dense_output import spline
from tympan.fem.transient.film_memory import branch_heat
from tympan.fem.transient.integrate import Moment, Transient

#: Number of Gauss points between two moments.
_POINTS = 4


@dataclass(frozen=True)
class Energy:
    """Energy of the whole film and its plate at a ``time`` [s].

    ``stored``: elastic energy, energy of branches and biases, and electrostatic energy [J].
    ``kinetic``: kinetic energy [J]. ``loss``: heat of the branches [W]. ``charge`` [C] at a
    ``voltage`` [V]. ``work``: work of weights and gas from the flat film on [J]. ``drag``: its
    square is the damper's heat [√W].
    """

    time: float
    stored: float
    kinetic: float
    loss: float
    charge: float
    voltage: float
    work: float
    drag: float

    @classmethod
    def of(cls, transient: Transient, moment: Moment) -> Energy:
        """Compute the energy of a transient at a moment."""
        model, state = transient.remembering(moment), moment.state
        mesh, squared = model.discretisation, state.voltage_squared
        voltage = float(np.sqrt(squared))
        charge = float(model.capacitance(state)) * voltage
        # The potential at constant voltage contains the electrostatic energy minus UQ.
        potential = float(model.energy(state.positions, squared)) * mesh.mirrored
        speed, plate = moment.velocity, transient.plate
        kinetic = 0.0 if plate is None else speed @ plate.matrix(state.plate) @ speed / 2
        heat = branch_heat(model, state, moment.memory)
        loaded = state.under(force=transient.force, pressure=transient.pressure)
        biases = sum(bias.derivatives(state.plate.deflection)[0] for bias in model.loading.biases)
        return cls(moment.time, potential + charge * voltage + float(biases), float(kinetic),
                   heat, charge, voltage,
                   load_work(model, loaded) + float(biases),
                   float(np.sqrt(transient.damper) * speed[HEAVE]))


@dataclass(frozen=True, kw_only=True)
class EnergyBalance:
    """Energy balance of a film over some time [J].

    The unexplained part comes from errors of the steps, or from a film without mass that snaps
    where it wrinkles.
    """

    load_work_J: Annotated[float, Key("work of the load on the plate")]
    electrical_work_J: Annotated[float, Key("work of what charges the film")]
    stored_J: Annotated[float, Key("how much more is stored in the film")]
    kinetic_J: Annotated[float, Key("how much more plate and film have by their motion")]
    heat_J: Annotated[float, Key("heat of branches, dampers and resistances")]
    jumps_J: Annotated[float, Key("what is lost at once where the voltage or the load jumps")]
    unexplained_J: Annotated[float, Key("what errors of the steps in time leave")]

    @classmethod
    def of(cls, every: Array, before: Energy) -> EnergyBalance:
        """Compute the balance from the state before the first moment on.

        Each row of ``every`` is an energy.
        """
        starts = np.flatnonzero(np.diff(every[:, 0]) == 0) + 1
        electrical = heat = smooth = 0.0
        for piece in np.split(every, starts):
            charging, dissipated = _integrals(piece) if len(piece) > 1 else (0.0, 0.0)
            change = piece[-1] - piece[0]
            electrical, heat = electrical + charging, heat + dissipated
            smooth += change[6] + charging - dissipated - change[1] - change[2]
        jumps = 0.0
        ends = chain([before], (Energy(*every[start - 1]) for start in starts))
        for end, start in zip(ends, (Energy(*every[number]) for number in [0, *starts]),
                              strict=True):
            charging = start.voltage * (start.charge - end.charge)
            electrical += charging
            jumps += (charging + (start.work - end.work)
                      - (start.stored - end.stored) - (start.kinetic - end.kinetic))
        last = Energy(*every[-1])
        return cls(load_work_J=last.work - before.work,
                   electrical_work_J=electrical, stored_J=last.stored - before.stored,
                   kinetic_J=last.kinetic - before.kinetic, heat_J=heat, jumps_J=jumps,
                   unexplained_J=smooth)


def load_work(model: Model, state: State) -> float:
    """Compute the work of constant loads on film and plate [J].

    The energy that biases store is subtracted.
    """
    on_film = model.weight[:, 2] @ state.positions[:, 2]
    if state.pressure:
        on_film = on_film + state.pressure * model.gas_volume(state)
    on_plate = -model.loading.on_plate(state, model.centre, model.plate_area)[0]
    return float(on_film * model.discretisation.mirrored + on_plate)


def _integrals(piece: Array) -> tuple[float, float]:
    """Integrate ∫U dQ and ∫(loss + drag²) dt [J] between moments, rows of energies' fields."""
    time, loss, charge, voltage, drag = piece[:, [0, 3, 4, 5, 7]].T
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    half = np.diff(time)[:, None] / 2
    at = (time[:-1, None] + half) + half * nodes
    power = spline(time, voltage)(at) * spline(time, charge)(at, 1)
    heat = spline(time, loss)(at) + spline(time, drag)(at) ** 2
    return float((power * weights * half).sum()), float((heat * weights * half).sum())
