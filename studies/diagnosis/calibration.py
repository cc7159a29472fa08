"""Calibration: force laws that reach as far as readings and nominal fit need, and that fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.base.progress import PartsDone
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, build_model
from tympan.studies.diagnosis.evidence.kind import FEWEST
from tympan.studies.diagnosis.evidence.scans import COMPONENTS
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import nominal_fit, nominal_fits
from tympan.studies.diagnosis.hypothesis import FACTORS
from tympan.studies.diagnosis.reading_table import SLOPES, ReadingTable, States, evenly_chosen
from tympan.studies.diagnosis.reduced.axes import with_shares
from tympan.studies.diagnosis.reduced.film_memory import FilmMemory
from tympan.studies.diagnosis.reduced.films_at_rest import FilmsAtRest
from tympan.studies.diagnosis.reduced.force_law import ForceLaw
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.sampling import (
    FiniteElements,
    NotSampled,
    coarse,
    fine,
    force_laws,
    nominal_law,
)
from tympan.studies.diagnosis.reduced.scans import scanned_exactly
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.reduced.swinging import SwingingMasses
from tympan.studies.effects import Setup
from tympan.studies.modes import heave_frequency

#: Reach of a force law beyond what the readings need, as factors on deflection and U²: effects and
#: larger factors move films further out.
_ROOM = (1.3, 1.15)
#: Factors on deflection and U² for a film that hardly reaches its range: with less deflection it
#: bears more voltage. They are less than one because laws are valid a little beyond their range.
_TIGHT = (0.95, 0.95)
#: Share of the needed range that is enough, for the same reason.
_ENOUGH = 0.94

#: Largest deflection of a force law, as a share of the gap between plate and frame. It limits the
#: sampled range.
_LARGEST = 1.5
#: Least deflection of a force law, as a share of the gap. A film that cannot be solved up to it
#: has no law.
_LEAST = 0.01
#: Deflection of a law where no reading says how far it must reach, as a share of the gap. Set by
#: trial.
_UNKNOWN = 0.2
#: Least U² of a force law [V²], 100 V, so that films read without voltage have a law too.
_QUIET = 1e4

#: Number of times that the film memory is computed again about the fit that uses it.
_REMEMBERED = 2

#: Most rounds in which laws grow. It limits the cost.
_ROUNDS = 8
#: Largest factor by which a law grows in one round: further out the fit that judges its reach is
#: only a guess.
_GROWTH = 2.0

#: Number of equilibria checked with finite elements on a fine mesh, about 0.1 s each.
_STATES_CHECKED = 6

#: Number of frequencies checked on a fine mesh: each takes an equilibrium and its modes.
_FREQUENCIES_CHECKED = 4

#: Number of scans checked on a fine mesh: each takes an equilibrium and the places of all its
#: points.
_SCANS_CHECKED = 4

#: Reasons why a reading is left out: the force law ends before it, or the film pulls in before it.
_REASONS = ("the film cannot be solved so far out",
            "a film that fits the other readings has no equilibrium there")
_SLACK = "loss of tension there: the film may wrinkle, so that what it does is less certain"


@dataclass(frozen=True, eq=False)
class Calibration:
    """The nominal simulation over the range of the readings, its two factors fitted.

    The factors are those on stiffness and permittivity. ``table``: the readings that films of some
    stiffness and permittivity can show; ``remarks``: which readings were left out, and why, and
    which are of wrinkled films.
    """

    simulation: Simulation
    fit: Fit
    table: ReadingTable
    remarks: tuple[str, ...] = ()


def calibrated(setup: Setup, table: ReadingTable) -> Calibration:
    """Fit the nominal simulation to the readings; leave out those that it cannot reach.

    Raise an :class:`InputError` when the films cannot be solved, or too few readings are left.
    """
    simulation = reaching(setup, table, lambda simulation: _safest(simulation, table).unknowns)
    simulation = with_masses(simulation)
    fit = nominal_fit(simulation, table)
    if len(table.states.in_time):
        # The film memory is computed about the films as fitted.
        for _ in range(_REMEMBERED):
            factors = np.exp(fit.unknowns[FACTORS]).tolist()
            memory = FilmMemory.of(setup, table, coarse(setup.formula), *factors)
            simulation = replace(simulation, memory=memory)
            fit = nominal_fit(simulation, table)
            if not any(specimen.membrane.branches for specimen in setup.specimens):
                break
    if fit.possible:
        doubtful = by_ramp(setup, table, slack(simulation, fit, table))
        return Calibration(simulation, fit, table,
                           tuple(f"{place}: {_SLACK}" for place in doubtful))
    reasons = _reasons(simulation, table)
    kept = table[reasons == ""].compact()
    remarks = [f"{place} left out: {reason}"
               for reason in np.unique(reasons[reasons != ""]).tolist()
               for place in by_ramp(setup, table, reasons == reason)]
    if len(kept) < FEWEST:
        raise InputError(f"less than {FEWEST} are left that films of some stiffness and "
                         "permittivity can show: are masses, voltages and sizes right?",
                         key="readings", given="; ".join(remarks))
    rest = calibrated(setup, kept)
    return replace(rest, remarks=(*remarks, *rest.remarks))


def with_masses(simulation: Simulation) -> Simulation:
    """Add the film masses that move with the plates to a simulation, if every film has a plate."""
    films = [specimen for specimen in simulation.setup.specimens if isinstance(specimen, Specimen)]
    if simulation.masses is not None or len(films) < len(simulation.setup.specimens):
        return simulation
    return replace(simulation, masses=SwingingMasses.of(
        simulation.setup, coarse(simulation.setup.formula)))


def _safest(simulation: Simulation, table: ReadingTable) -> Fit:
    """Fit the nominal model to as many readings, from low voltages on, as it can reach."""
    fits = list(nominal_fits(simulation, table))
    return next((fit for fit in reversed(fits) if fit.possible), fits[0])


def _reasons(simulation: Simulation, table: ReadingTable) -> NDArray[np.str_]:
    """Give the reason why each row must be left out so that a fit reaches all others, else "".

    First the rows that films fitted to low voltages cannot reach; then, ramp by ramp, the rows of
    the highest voltages.
    """
    fit, reasons = _safest(simulation, table), np.full(len(table), "", "<U99")
    while True:
        prediction = Prediction(simulation, (), fit.unknowns, table)
        out = prediction.impossible_rows
        if (reasons != "").any():
            out &= reasons == ""
            out &= table.voltage >= _highest(table, out)[table.ramp]
        reasons[out] = np.where(prediction.short[table.state[out]], *_REASONS)
        stay = table[reasons == ""].compact()
        if len(stay) < FEWEST:
            return reasons
        fit = nominal_fit(simulation, stay)
        if fit.possible:
            return reasons
        if not out.any():
            reasons[reasons == ""] = np.where(
                table.voltage[reasons == ""] == table.voltage[reasons == ""].max(), _REASONS[1], "")


def _highest(table: ReadingTable, rows: Mask) -> Array:
    """Find the highest voltage of some rows of each ramp."""
    highest = np.zeros(int(table.ramp.max()) + 1)
    np.maximum.at(highest, table.ramp[rows], table.voltage[rows])
    return highest


def reaching(setup: Setup, table: ReadingTable, unknowns_of: Callable[[Simulation], Array]
             ) -> Simulation:
    """Sample a simulation without effects up to all that a table needs, or to the films' limits.

    ``unknowns_of`` gives the unknowns of the nominal hypothesis at which the reach of a simulation
    is judged. Raise an :class:`InputError` when a film cannot be solved.
    """
    names = [specimen.name for specimen in setup.specimens]
    needed = _needed(setup, table)
    room = np.repeat(np.array([_ROOM]).T, len(names), axis=1)
    slopes = bool(np.isin(table.kind, SLOPES).any())
    solver = FiniteElements(bool(table.scans), slopes)
    laws: dict[tuple[str, float, float], ForceLaw] = {}
    for _ in range(_ROUNDS):
        asked = list(zip(names, *(room * needed).tolist(), strict=True))
        for reach in asked:
            if reach not in laws:
                laws[reach] = _nominal_law(setup, solver, *reach)
        simulation = Simulation(setup, tuple(laws[reach] for reach in asked))
        have = np.array([[law.grid.deflection, law.grid.voltage_squared]
                         for law in simulation.laws]).T
        wanted = _needed(setup, table, FilmsAtRest(simulation, (), unknowns_of(simulation),
                                                   table.states))
        lacking, ended = _ENOUGH * wanted > have, have < 0.99 * room * needed
        # A film at less deflection bears more voltage.
        narrowed = (lacking & ended).any(0) & (room[0] > _TIGHT[0])
        growing = lacking & ~ended
        if not (narrowed.any() or growing.any()):
            break
        room = np.where(narrowed, np.array([_TIGHT]).T, room)
        needed = np.where(growing | (narrowed & (wanted < needed)),
                          np.minimum(wanted, _GROWTH * have), needed)
    return simulation


def _nominal_law(setup: Setup, solver: FiniteElements, name: str, deflection: float,
                 voltage_squared: float) -> ForceLaw:
    """Sample a force law without effects up to a deflection [m] and U² [V²], or film limit."""
    least = _LEAST * setup.specimen(name).gap
    while True:
        try:
            return nominal_law(setup, name, deflection, voltage_squared, solver)
        except NotSampled as error:
            if deflection <= least:
                raise InputError(f"the nominal film cannot be solved: {error}", key="specimen",
                                 given=name) from None
            deflection = max(0.7 * deflection, least)


def _needed(setup: Setup, table: ReadingTable, rest: FilmsAtRest | None = None) -> Array:
    """Find the deflections and U² that readings or equilibria need, shape (2, specimens)."""
    states, needed = table.states, []
    squared = np.asarray(setup.rig.film_voltage(states.voltage, states.voltage_direction)) ** 2
    if rest is not None:
        squared = rest.voltage_squared
    for number, specimen in enumerate(setup.specimens):
        read = table.value[(table.specimen == number) & (table.kind == "displacement")]
        there = states.specimen == number
        read = np.r_[read, states.deflection[there]]
        if rest is not None:
            # Where U² is beyond reach the deflection is not known.
            sought = there & (rest.possible | rest.short) & (rest.voltage_squared <= rest.top)
            read = rest.extended_deflection[sought]
        read = np.abs(read[np.isfinite(read)])
        largest = float(read.max()) if len(read) else _UNKNOWN * specimen.gap
        needed.append((np.clip(largest, _LEAST * specimen.gap, _LARGEST * specimen.gap),
                       max(_QUIET, squared[there].max(initial=0.0))))
    return np.array(needed).T


def by_ramp(setup: Setup, table: ReadingTable, rows: Mask) -> list[str]:
    """List the origins of rows ramp by ramp: file, lines, specimen, mass, voltages."""
    words = []
    for ramp in np.unique(table.ramp[rows]):
        some = table[rows & (table.ramp == ramp)]
        lines = ", ".join(str(line) for line in np.unique(some.line))
        low, high = 1e-3 * some.voltage.min(), 1e-3 * some.voltage.max()
        voltages = f"{high:.4g} kV" if low == high else f"{low:.4g} to {high:.4g} kV"
        plural, name = "s" if "," in lines else "", setup.specimens[some.specimen[0]].name
        words.append(f"{some.file[0]} line{plural} {lines} ({name}, {1e3 * some.mass[0]:.4g} g, "
                     f"{voltages})")
    return words


def with_effects(calibration: Simulation, progress: PartsDone,
                 workers: int) -> Simulation:
    """Add the effects of the library to a simulation."""
    grids = [law.grid for law in calibration.laws]
    solver = calibration.laws[0].solver
    assert isinstance(solver, FiniteElements)
    return replace(calibration, laws=force_laws(calibration.setup, grids, workers, progress,
                                                solver))


def law_error(simulation: Simulation, fit: Fit, table: ReadingTable) -> float:
    """Find the largest error [m] of reduced deflections at a fit, against a fine mesh.

    Some of the states are checked, from small to large deflections; states that the finite elements
    do not reach are left out.
    """
    setup = simulation.extended(fit.hypothesis, fit.unknowns)
    states = table.states.at_rest
    rest = FilmsAtRest(simulation, fit.hypothesis, fit.unknowns, states)
    free = np.flatnonzero(np.isnan(states.deflection))
    order = free[np.argsort(rest.deflection[free])]
    rig, worst = setup.rig, 0.0
    place, way = rest.came
    for state in place[evenly_chosen(order, _STATES_CHECKED)].tolist():
        model = build_model(read_film(setup, states, state), fine(setup.formula), rig.loading)
        voltage = rig.film_voltage(float(states.voltage[state]),
                                   float(states.voltage_direction[state]))
        force = rig.force(float(states.mass[state]), model.plate_area)
        force = rig.rubbed(force, float(way[state]))
        outcome = equilibrium(model, force, voltage, rig.gas_pressure)
        if outcome.status == "equilibrium":
            deflection = float(rest.deflection[state])
            worst = max(worst, abs(model.deflection(outcome.state) - deflection))
    return worst


def frequency_error(simulation: Simulation, fit: Fit, table: ReadingTable) -> float:
    """Find the largest relative error of reduced frequencies at a fit, against finite elements.

    Some of the readings are checked, from low to high; states that the finite elements do not reach
    are left out.
    """
    if "frequency" not in table.kind:
        return 0.0
    setup, rows = simulation.extended(fit.hypothesis, fit.unknowns), table.rows_of
    shown, worst = simulation.predict(fit.hypothesis, fit.unknowns, table), 0.0
    order = rows["frequency"][np.argsort(shown[rows["frequency"]])]
    for row in evenly_chosen(order, _FREQUENCIES_CHECKED):
        case = Case(read_film(setup, table.states, int(table.state[row])),
                    mass=float(table.mass[row]), voltage=float(table.voltage[row]), rig=setup.rig)
        exact = heave_frequency(case, fine(setup.formula))
        if exact is not None:
            worst = max(worst, abs(float(shown[row]) / exact - 1))
    return worst


def slope_error(simulation: Simulation, fit: Fit, table: ReadingTable) -> float:
    """Find the largest error of reduced slopes of the plates at a fit, against a fine mesh.

    Some of the states in which slopes were read are checked, from small to large ones; states that
    the finite elements do not reach are left out.
    """
    rows = np.flatnonzero(np.isin(table.kind, SLOPES))
    if not len(rows):
        return 0.0
    setup, worst = simulation.extended(fit.hypothesis, fit.unknowns), 0.0
    shown = simulation.predict(fit.hypothesis, fit.unknowns, table)
    order = rows[np.argsort(np.abs(shown[rows]))]
    for row in evenly_chosen(order[np.isfinite(shown[order])], _STATES_CHECKED).tolist():
        state = int(table.state[row])
        model = build_model(read_film(setup, table.states, state), fine(setup.formula),
                            setup.rig.loading)
        outcome = equilibrium(model, setup.rig.force(float(table.mass[row]), model.plate_area),
                              setup.rig.film_voltage(float(table.voltage[row])),
                              setup.rig.gas_pressure)
        if outcome.status == "equilibrium":
            slope = outcome.state.plate.slope[SLOPES.index(str(table.kind[row]))]
            worst = max(worst, abs(float(slope) - float(shown[row])))
    return worst


def film_error(simulation: Simulation, fit: Fit, table: ReadingTable) -> dict[str, float]:
    """Find the largest error of each component of scans at a fit [m], against a fine mesh.

    Some scans are checked, from small to large deflections; states that the finite elements do not
    reach are left out.
    """
    if not table.scans:
        return {}
    setup, worst = simulation.extended(fit.hypothesis, fit.unknowns), dict[str, float]()
    shown = simulation.predict(fit.hypothesis, fit.unknowns, table)
    states = np.array([table.state[table.scan == number][0] for number in np.unique(table.scan)
                       if number >= 0], np.int64)
    for state in evenly_chosen(states[np.argsort(fit.deflection[states])], _SCANS_CHECKED):
        rows = np.flatnonzero((table.state == state) & (table.point >= 0))
        specimen = read_film(setup, table.states, int(state))
        exact = scanned_exactly(specimen, setup.rig, float(table.mass[rows[0]]), float(
            table.voltage[rows[0]]), table.scans[table.scan[rows[0]]], fine(setup.formula))
        for kind in COMPONENTS if exact is not None else ():
            some = rows[table.kind[rows] == kind]
            if len(some) and exact is not None:
                point = table.point[some] - table.first_points[table.scan[some[0]]]
                error = table.noise[some].apart(exact[COMPONENTS.index(kind), point] - shown[some])
                worst[kind] = max(worst.get(kind, 0.0), float(np.abs(error).max()))
    return worst


def read_film(setup: Setup, states: States, number: int) -> Specimen:
    """Take the specimen of a state, with the state's voltages on its segments."""
    specimen = setup.specimens[int(states.specimen[number])]
    electrode = specimen.electrode
    shares = states[np.array([number])].shares_of(electrode)[0].tolist()
    return replace(specimen, electrode=electrode.with_shares(shares))


def slack(simulation: Simulation, fit: Fit, table: ReadingTable) -> Mask:
    """Mark readings of states in which the nominal film at a fit has lost tension somewhere.

    A film loses more tension the higher its voltage is, so these are the last readings of a ramp.
    """
    setup = simulation.extended(fit.hypothesis, fit.unknowns)
    rest = FilmsAtRest(simulation, fit.hypothesis, fit.unknowns, table.states)
    seen = np.sqrt(rest.voltage_squared * rest.stiffness / rest.permittivity)
    settings = coarse(setup.formula)
    # Segments with different shares: a mesh for any pattern of voltages.
    models = [build_model(with_shares(specimen), settings, setup.rig.loading)
              for specimen in setup.specimens]
    beyond = np.zeros(len(table), bool)
    for ramp in range(int(table.ramp.max()) + 1):
        rows = np.flatnonzero(table.ramp == ramp)
        for row in rows[np.argsort(-seen[table.state[rows]])].tolist():
            state, model = table.state[row], models[table.specimen[row]]
            model = replace(model, specimen=read_film(setup, table.states, int(state)))
            film = held(model, float(rest.extended_deflection[state]), float(seen[state]))
            if film.status == "equilibrium" and model.in_tension(film.state):
                break
            beyond[row] = True
    return beyond
