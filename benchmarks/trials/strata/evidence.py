"""Readings at rest with taps and lines over the films, without noise, and the datasets they make.

By finite elements on other, finer meshes, or of circular specimens by the membrane's differential
equations and Bessel's functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.trials.axisymmetric_readings import pulled, round_ramps
from benchmarks.trials.synthetic_trials import (
    Design,
    Truth,
    look_alike,
    ramp_states,
    readings,
    scaled,
)
from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import State
from tympan.fem.results.places import Places
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_content, toml
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import write_sheet
from tympan.studies.data.dataset import FILES
from tympan.studies.modes import heaving_frequency

#: SI values by column name, shape (rows,) each.
Columns = dict[str, Any]

#: Standard deviation of a tap's frequency as a share, and of the zero of a line [m].
TAPPED, LINE_ZERO = 0.003, 0.2e-3
#: Displacements at which a tester reads its gauge [m], and its standard deviation [N].
PULLED, GAUGED = np.linspace(-1.5e-3, 6e-3, 16), 2e-3

_NONE: Numbers = np.zeros(0, np.int64)


def cross(specimen: Specimen, count: int = 46) -> Array:
    """Places on a line along x and on one along y across the frame [m], shape (2 count, 2)."""
    places = np.zeros((2, count, 2))
    for axis, half in enumerate(specimen.frame.semi_axes):
        places[axis, :, axis] = np.linspace(-0.97 * half, 0.97 * half, count)
    return places.reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class ReadingPlan:
    """A design, and in which of its rows plates are tapped and films scanned, at which places.

    ``voltages``: at which a tester pulls the plate of every film [V].
    """

    design: Design
    tapped: Numbers = field(default_factory=lambda: _NONE)
    scanned: Numbers = field(default_factory=lambda: _NONE)
    places: Callable[[Specimen], Array] = cross
    voltages: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is read of a plan without noise: ``deflections`` as the sensor shows them [m], (rows,),
    by row ``frequencies`` [Hz] and ``heights`` at the places [m], by the number of a specimen and
    the voltage ``forces`` [N]."""

    deflections: Array
    frequencies: dict[int, float]
    heights: dict[int, Array]
    forces: dict[tuple[int, float], Array] = field(default_factory=dict)


def evidence(plan: ReadingPlan, truth: Truth) -> Evidence | None:
    """What is read if that is the truth; None where a state has no equilibrium or a film cannot be
    built, as in :func:`~benchmarks.trials.synthetic_trials.readings`."""
    limits = [item.limits for cause in truth.hypothesis for item in cause.effect.parameters]
    if any(not low <= size <= high
           for size, (low, high) in zip(truth.sizes, limits, strict=True)):
        return None
    try:
        return by_equations(plan, truth) if truth.means == "equations" else by_elements(plan, truth)
    except InputError:
        return None


def by_equations(plan: ReadingPlan, truth: Truth) -> Evidence | None:
    """Of circular specimens."""
    deflections = readings(plan.design, truth)
    if deflections is None:
        return None
    frequencies, heights = dict[int, float](), dict[int, Array]()
    for ramp in round_ramps(plan.design, truth):
        specimen = _specimen(plan.design, ramp.rows)
        for number, row in enumerate(ramp.rows.tolist()):
            if row in plan.tapped:
                if ramp.swinging <= 0:
                    return None
                frequencies[row] = float(ramp.frequencies[number])
            if row in plan.scanned:
                heights[row] = ramp.heights(number, np.hypot(*plan.places(specimen).T))
    forces = dict[tuple[int, float], Array]()
    for number, specimen in enumerate(plan.design.setup.specimens):
        for voltage in plan.voltages:
            force = pulled(specimen, truth, voltage, PULLED)
            if force is None:
                return None
            forces[number, voltage] = force
    return Evidence(deflections, frequencies, heights, forces)


def by_elements(plan: ReadingPlan, truth: Truth) -> Evidence | None:
    """By the whole field model on the truth's mesh."""
    design, states = plan.design, plan.design.table.states
    law = design.setup.specimens[0].membrane.material
    if truth.means == "another law":
        law, _ = look_alike(law)
    deflections = np.empty(len(states))
    frequencies, heights = dict[int, float](), dict[int, Array]()
    for ramp in design.ramps():
        rig, model, solved = ramp_states(design, truth, scaled(law, truth.stiffness), ramp)
        if solved is None:
            return None
        for row, state in zip(ramp.tolist(), solved, strict=True):
            deflections[row] = rig.reading(state.plate.deflection, float(states.elapsed[row]))
            if row in plan.tapped:
                frequency = _tapped(rig, model, state, float(states.mass[row]))
                if frequency is None:
                    return None
                frequencies[row] = frequency
            if row in plan.scanned:
                heights[row] = seen_heights(model, state, plan.places(_specimen(design, ramp)))
    return Evidence(deflections, frequencies, heights)


def _specimen(design: Design, rows: Numbers) -> Specimen:
    return design.setup.specimens[int(design.table.states.specimen[rows[0]])]


def _tapped(rig: Rig, model: Model, state: State, mass: float) -> float | None:
    """The frequency of the plate up and down among all modes [Hz], if there is one."""
    whole = rig.moving_mass(mass)
    if whole <= 0:
        return None
    plate = RigidPlate.uniform(model.specimen.needed_plate().outline, whole, 0.0, rig.weight_offset)
    return heaving_frequency(model, state, plate)


def seen_heights(model: Model, state: State, places: Array) -> Array:
    """What a laser above places of the table sees [m]: where the film's points went is sought."""
    plate = model.specimen.needed_plate()
    film, outside, rim = places.copy(), np.zeros(len(places), bool), plate.points(720).T
    for _ in range(30):
        moved = Places.of(model.discretisation, film).displacement(model, state)
        film = places - moved[:, :2]
        outside = plate.level(*film.T) < 0
        film[outside] = rim[cdist(film[outside], rim).argmin(axis=1)]
    shown = Places.of(model.discretisation, film).displacement(model, state)[:, 2]
    # The plate is a plane through its centre: z = w + n·r with r from where the centre stands.
    turn, centre = state.plate.rotation, model.centre + state.plate.translation
    away = places - centre[:2]
    flat = np.linalg.solve(turn[:2, :2], away.T).T
    on_plate = plate.outline.level(*flat.T) <= 0
    return np.where(on_plate, centre[2] + flat @ turn[2, :2], shown)


def sheets(plan: ReadingPlan, read: Evidence, noise: float, random: np.random.Generator | None,
           zero: float = LINE_ZERO) -> dict[str, Columns]:
    """Columns of every file that a plan makes, with noise of a standard deviation [m].

    Without ``random`` there is none, though it is stated.
    """
    def scatter(*shape: int) -> Array:
        return np.zeros(shape) if random is None else random.standard_normal(shape)

    table = plan.design.table
    rows = np.arange(len(table))
    files: dict[str, Columns] = {"static.csv": {
        **_states(plan, rows), "displacement": read.deflections + noise * scatter(len(table)),
        "order": table.order, "elapsed": table.states.elapsed}}
    if len(plan.tapped):
        frequency = np.array([read.frequencies[row] for row in plan.tapped.tolist()])
        files["frequency.csv"] = {
            **_states(plan, plan.tapped), "mode": ["heave"] * len(plan.tapped),
            "frequency": frequency * (1 + TAPPED * scatter(len(frequency))),
            "sigma": TAPPED * frequency}
    if len(plan.scanned):
        lines = [read.heights[row] for row in plan.scanned.tolist()]
        places = [plan.places(_specimen(plan.design, plan.scanned[[k]]))
                  for k in range(len(plan.scanned))]
        shown = [line + zero * scatter(1) + noise * scatter(len(line)) for line in lines]
        x, y = np.concatenate(places).T
        files["field.csv"] = {
            **_states(plan, np.repeat(plan.scanned, [len(line) for line in lines])),
            "x": x, "y": y, "displacement": np.concatenate(shown)}
    if read.forces:
        force = np.array(list(read.forces.values()))
        names = [specimen.name for specimen in plan.design.setup.specimens]
        runs = [(names[number], voltage) for number, voltage in read.forces]
        files["force.csv"] = {
            "specimen": np.repeat([name for name, _ in runs], len(PULLED)).tolist(),
            "voltage": np.repeat([voltage for _, voltage in runs], len(PULLED)),
            "displacement": np.tile(PULLED, len(runs)),
            "run": np.repeat([f"{number}" for number in range(len(runs))], len(PULLED)).tolist(),
            "force": (force + GAUGED * scatter(*force.shape)).ravel(),
            "sigma": np.full(force.size, GAUGED)}
    return files


def _states(plan: ReadingPlan, rows: Numbers) -> Columns:
    states, names = plan.design.table.states, [
        specimen.name for specimen in plan.design.setup.specimens]
    return {"specimen": [names[number] for number in states.specimen[rows].tolist()],
            "mass": states.mass[rows], "voltage": states.voltage[rows]}


def write_dataset(folder: Path, design: Design, files: Mapping[str, Columns], noise: float,
                  **head: Any) -> Path:
    """A dataset's folder of these files, with more keys at its head."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.toml").write_text(toml({
        "name": design.name, "noise": f"{1e6 * noise:.6g} um", **head,
        "specimen": [specimen_content(specimen) for specimen in design.setup.specimens]}),
        encoding="utf-8")
    for name, columns in files.items():
        write_sheet(folder / name, [column for column in FILES[name] if column.name in columns],
                    columns)
    return folder
