"""The simulation of a dataset: its force laws, as far as the readings and the nominal fit need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.ramp import equilibrium
from tympan.fem.film.laws.stiffened import scaled
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Film
from tympan.studies.case import build_model
from tympan.studies.diagnosis.inference.posterior import Fit, nominal_fit
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.force_law import ForceLaw
from tympan.studies.diagnosis.reduced.sampling import FINE, NotSampled, force_laws, nominal_law
from tympan.studies.diagnosis.reduced.simulation import (
    FACTORS,
    PERMITTIVITY,
    STIFFNESS,
    Hypothesis,
    Prediction,
    Simulation,
)
from tympan.studies.effects import Setup, extended

Array = NDArray[np.float64]

#: Largest heave of a force law, as a share of the gap between plate and frame.
_LARGEST = 0.35

#: How much further than the nominal model needs the force laws reach, as factors on heave and U².
_ROOM = (1.3, 1.3)

_ROUNDS = 5


def calibrated(setup: Setup, table: ReadingTable) -> tuple[Simulation, Fit]:
    """The nominal simulation over what the readings need, with stiffness and permittivity fitted.

    An :class:`InputError` when the films cannot be solved, or no stiffness and permittivity make
    equilibria of the states that were read.
    """
    heave, voltage_squared = _reach(setup, table)
    for _ in range(_ROUNDS):
        try:
            simulation = Simulation(setup, nominal_laws(setup, heave, voltage_squared))
        except NotSampled as error:
            raise InputError(f"the nominal film cannot be solved: {error}", key="specimen",
                             given=", ".join(film.name for film in setup.specimens)) from None
        fit = nominal_fit(simulation, table)
        wanted = _reach(setup, table, simulation, fit)
        reached = np.array([law.grid.voltage_squared for law in simulation.laws])
        if fit.possible and np.all(wanted <= 1.05 * np.array([heave, voltage_squared])):
            return simulation, fit
        # Never less than before: a fit held back by the reach of its laws must not take that reach
        # away.
        heave = np.maximum(heave, np.minimum(wanted[0], 2 * heave) if fit.possible else 1.5 * heave)
        further = np.maximum(voltage_squared, np.minimum(wanted[1], 2 * voltage_squared))
        voltage_squared = np.where(reached < 0.99 * voltage_squared, voltage_squared, further)
    if not fit.possible:
        raise InputError("no stiffness and permittivity make equilibria of all states that were "
                         "read: are masses, voltages and sizes right?", key="readings",
                         given=f"{len(table)} readings")
    return simulation, fit


def with_effects(calibration: Simulation, progress: Callable[[int, int], None],
                 workers: int) -> Simulation:
    """The same simulation with the effects of the library."""
    grids = [law.grid for law in calibration.laws]
    return replace(calibration, laws=force_laws(calibration.setup, grids, workers, progress))


def nominal_laws(setup: Setup, heave: Array, voltage_squared: Array) -> tuple[ForceLaw, ...]:
    """Each film's force law without effects, up to a heave [m] and a U² [V²] or less."""
    return tuple(nominal_law(setup, specimen.name, float(w), float(q))
                 for specimen, w, q in zip(setup.specimens, heave, voltage_squared, strict=True))


def largest_voltage_squared(setup: Setup, table: ReadingTable) -> Array:
    """The largest U² that each specimen's film sees, shape (specimens,)."""
    states = table.states
    seen = np.asarray(setup.rig.film_voltage(states.voltage, states.direction)) ** 2
    return np.array([seen[states.specimen == number].max(initial=0.0)
                     for number in range(len(setup.specimens))])


def _reach(setup: Setup, table: ReadingTable, simulation: Simulation | None = None,
           fit: Fit | None = None) -> Array:
    """Heaves and U² needed, shape (2, specimens): by the readings, else by a fit where possible."""
    heave, share = None, 1.0
    if simulation is not None and fit is not None and fit.possible:
        heave = np.nan_to_num(Prediction(simulation, (), fit.unknowns, table).heave)
        share = float(np.exp(fit.unknowns[PERMITTIVITY] - fit.unknowns[STIFFNESS]))
    heaves = []
    for number, specimen in enumerate(setup.specimens):
        read = table.value[(table.specimen == number) & (table.kind == "displacement")]
        if heave is not None:
            read = np.maximum(heave[table.states.specimen == number], 0.0)
        largest = max(_ROOM[0] * float(np.abs(read).max(initial=0.0)), 0.01 * specimen.gap)
        heaves.append(min(largest, _LARGEST * specimen.gap) if len(read) else 0.2 * specimen.gap)
    squared = _ROOM[1] * share * largest_voltage_squared(setup, table)
    return np.array([heaves, np.maximum(squared, 1e4)])


def extended_setup(simulation: Simulation, hypothesis: Hypothesis, unknowns: Array) -> Setup:
    """The setup with stiffness, permittivity and effects as found."""
    stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()

    def change(film: Film) -> Film:
        return replace(film, material=scaled(film.material, stiffness),
                       relative_permittivity=film.relative_permittivity * permittivity)

    return extended(simulation.setup.with_films(change), simulation.uses(hypothesis, unknowns))


def law_error(simulation: Simulation, fit: Fit, table: ReadingTable, count: int = 6) -> float:
    """Largest error of the reduced heaves [m] at a fit, against finite elements on a fine mesh.

    At ``count`` of the states, from small to large heaves; states the finite elements do not reach
    are left out.
    """
    setup = extended_setup(simulation, fit.hypothesis, fit.unknowns)
    free = np.flatnonzero(np.isnan(table.states.heave))
    order = free[np.argsort(fit.heave[free])]
    chosen = order[np.unique(np.linspace(0, len(order) - 1, count).round().astype(int))]
    rig, states, worst = setup.rig, table.states, 0.0
    place, way = Prediction(simulation, fit.hypothesis, fit.unknowns, table).came
    for state in place[chosen].tolist():
        model = build_model(setup.specimens[int(states.specimen[state])], FINE, rig.loading)
        voltage = rig.film_voltage(float(states.voltage[state]), float(states.direction[state]))
        force = rig.force(float(states.mass[state]), model.plate_area)
        force = rig.rubbed(force, float(way[state]))
        outcome = equilibrium(model, force, voltage, rig.gas_pressure)
        if outcome.status == "equilibrium":
            worst = max(worst, abs(outcome.state.plate.deflection - float(fit.heave[state])))
    return worst
