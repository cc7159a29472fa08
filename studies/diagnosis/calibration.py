"""The simulation of a dataset: its force laws, as far as the readings and the nominal fit need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.ramp import equilibrium
from tympan.fem.film.laws.scaled import scaled
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.case import build_model
from tympan.studies.diagnosis.inference.fit import Fit, nominal_fit
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.force_law import ForceLaw
from tympan.studies.diagnosis.reduced.hypothesis import (
    FACTORS,
    PERMITTIVITY,
    STIFFNESS,
    Hypothesis,
)
from tympan.studies.diagnosis.reduced.sampling import FINE, NotSampled, force_laws, nominal_law
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup, extended

Array = NDArray[np.float64]

#: Largest heave of a force law, as a share of the gap between plate and frame.
_LARGEST = 0.35

#: How much further than the nominal model needs the force laws reach, as factors on heave and U².
_ROOM = (1.3, 1.3)

_ROUNDS = 5


def calibrated(setup: Setup, table: ReadingTable) -> tuple[Simulation, Fit]:
    """The nominal simulation over what the readings need, with stiffness and permittivity fitted.

    Raises
    ------
    InputError
        When the films cannot be solved, or no stiffness and permittivity make equilibria of the
        states that were read.
    """
    heave, voltage_squared = _first_reach(setup, table)
    for _ in range(_ROUNDS):
        simulation = Simulation(setup, _nominal(setup, heave, voltage_squared))
        found = nominal_fit(simulation, table)
        wanted = _needed(simulation, found, table)
        have = np.array([[law.grid.heave, law.grid.voltage_squared] for law in simulation.laws]).T
        if found.possible and np.all(wanted <= 1.05 * np.array([heave, voltage_squared])):
            break
        # Never less than before: a fit held back by the reach of its laws must not take that reach
        # away.
        heave = np.maximum(heave, np.minimum(wanted[0], 2 * heave) if found.possible
                           else 1.5 * heave)
        voltage_squared = np.where(have[1] < 0.99 * voltage_squared, voltage_squared,
                          np.maximum(voltage_squared, np.minimum(wanted[1], 2 * voltage_squared)))
    if not found.possible:
        raise InputError("no stiffness and permittivity make equilibria of all states that were "
                         "read: are masses, "
                         "voltages and sizes right?", key="readings",
                         given=f"{len(table)} readings")
    return simulation, found


def with_effects(calibration: Simulation, progress: Callable[[int, int], None],
                 workers: int) -> Simulation:
    """The same simulation with the effects of the library."""
    grids = [law.grid for law in calibration.laws]
    return replace(calibration, laws=force_laws(calibration.setup, grids, workers, progress))


def _nominal(setup: Setup, heave: Array, voltage_squared: Array) -> tuple[ForceLaw, ...]:
    try:
        return tuple(nominal_law(setup, specimen.name, float(w), float(q))
                     for specimen, w, q in zip(setup.specimens, heave, voltage_squared,
                                               strict=True))
    except NotSampled as error:
        raise InputError(f"the nominal film cannot be solved: {error}", key="specimen",
                         given=", ".join(one.name for one in setup.specimens)) from None


def _first_reach(setup: Setup, table: ReadingTable) -> tuple[Array, Array]:
    """Heaves and U² to begin with, for each specimen.

    By the largest readings, or a share of the gap.
    """
    heaves, voltages_squared = [], []
    for number, specimen in enumerate(setup.specimens):
        own = (table.specimen == number) & (table.kind == "displacement")
        largest = float(np.abs(table.value[own]).max(initial=0.0))
        heaves.append(min(max(_ROOM[0] * largest, 0.01 * specimen.gap), _LARGEST * specimen.gap)
                      if own.any()
                      else 0.2 * specimen.gap)
        voltages_squared.append(_ROOM[1] * largest_voltage_squared(setup, table, number))
    return np.array(heaves), np.maximum(voltages_squared, 1e4)


def largest_voltage_squared(setup: Setup, table: ReadingTable, number: int) -> float:
    """The largest U² a specimen's film sees."""
    states, own = table.states, table.states.specimen == number
    seen = np.asarray(setup.rig.film_voltage(states.voltage[own], states.direction[own]))
    return float((seen**2).max(initial=0.0))


def _needed(simulation: Simulation, found: Fit, table: ReadingTable) -> Array:
    """Heaves and U² that the fit and its surroundings need, shape (2, specimens)."""
    heave = np.nan_to_num(simulation.heaves((), found.unknowns,
                                            table.states)) if found.possible else None
    share = 1.0
    if found.possible:
        share = float(np.exp(found.unknowns[PERMITTIVITY] - found.unknowns[STIFFNESS]))
    heaves, voltages_squared = _first_reach(simulation.setup, table)
    for number, specimen in enumerate(simulation.setup.specimens):
        own = table.states.specimen == number
        largest = largest_voltage_squared(simulation.setup, table, number)
        voltages_squared[number] = max(_ROOM[1] * share * largest, 1e4)
        if heave is not None:
            largest = max(_ROOM[0] * heave[own].max(initial=0.0), 0.01 * specimen.gap)
            heaves[number] = min(largest, _LARGEST * specimen.gap)
    return np.array([heaves, voltages_squared])


def refitted(setup: Setup, unknowns: Array) -> Setup:
    """The setup with the stiffness and the permittivity found."""
    stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()

    def change(film: Film) -> Film:
        return replace(film, material=scaled(film.material, stiffness),
                       relative_permittivity=film.relative_permittivity * permittivity)

    return setup.with_films(change)


def extended_setup(simulation: Simulation, hypothesis: Hypothesis, unknowns: Array) -> Setup:
    """The setup with stiffness, permittivity and effects as found."""
    return extended(refitted(simulation.setup, unknowns), simulation.uses(hypothesis, unknowns))


def law_error(simulation: Simulation, one: Fit, table: ReadingTable, count: int = 6) -> float:
    """Largest error of the reduced heaves [m] at a fit, against finite elements on a fine mesh.

    At ``count`` of the states, from small to large heaves; states the finite elements do not reach
    are left out.
    """
    setup = extended_setup(simulation, one.hypothesis, one.unknowns)
    free = np.flatnonzero(np.isnan(table.states.heave))
    order = free[np.argsort(one.heave[free])]
    chosen = order[np.unique(np.linspace(0, len(order) - 1, count).round().astype(int))]
    worst = 0.0
    for state in chosen.tolist():
        states = table.states
        specimen: Specimen = setup.specimens[int(states.specimen[state])]
        model = build_model(specimen, FINE, setup.rig.loading)
        voltage = setup.rig.film_voltage(float(states.voltage[state]),
                                         float(states.direction[state]))
        outcome = equilibrium(model, setup.rig.force(float(states.mass[state]), model.plate_area),
                              voltage,
                              setup.rig.gas_pressure)
        if outcome.status == "equilibrium":
            worst = max(worst, abs(outcome.state.plate.deflection - float(one.heave[state])))
    return worst


