"""Readings at rest after a dwell, and steps of the voltage in time, by the axisymmetric membrane.

Slow ones of films that may creep, whose plates follow at once; fast ones of plates that swing. All
by :mod:`tests.oracles`; branches evolve by the stated law or, as "another law", by logarithms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from benchmarks.trials.strata.evidence import Columns
from benchmarks.trials.synthetic_trials import Array, Design, Truth, design_of
from tests.oracles.creep import CreepingFilm
from tests.oracles.readings.swinging_plate import SwingingPlate
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Plate, Specimen, ViscousBranch
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.effects import Setup

#: Radii of plate and frame [m], by name.
SHAPES = {"small": (8e-3, 3e-2), "middle": (1e-2, 4.5e-2), "large": (1e-2, 7e-2)}
MASSES, VOLTAGES = (1e-2, 2e-2), np.linspace(0.0, 4.5e3, 6)
FILM = Film(1e-3, (5**0.5, 5**0.5), NeoHooke(20e3), 4.7)
#: What a film that was mounted lately still remembers.
SLOW_BRANCH = ViscousBranch(30e3, 3600.0)

#: Effects that these equations have.
AT_REST = ("unaccounted_mass", "parallel_spring", "sensor_gain", "sensor_zero", "voltage_sag")
SLOW, FAST = ("creep", "mounting_age"), ("plate_damping", "series_resistance", "sensor_lag",
                                         "added_mass")
#: Damping of every plate that swings, as stated [N s/m].
DAMPED = 0.1


@dataclass(frozen=True, eq=False)
class StepPlan:
    """Readings at rest of a design, and a step to ``voltage`` [V] of every film under the heavier
    mass: from 0 V for ``before`` [s] on, ``length`` [s] long, so many samples a second.

    ``dwell``: how long every state is held before it is read [s], None where it is for ever.
    """

    design: Design
    voltage: float
    before: float
    length: float
    rate: float
    dwell: float | None = None

    @property
    def times(self) -> tuple[Array, Array]:
        """Of samples before the step, and of those after it since then [s]."""
        first, last = (np.arange(round(length * self.rate)) / self.rate + 0.5 / self.rate
                       for length in (self.before, self.length))
        return first, last


@dataclass(frozen=True, eq=False)
class StepEvidence:
    """What is read of a plan without noise [m]: ``deflections`` of the design's rows, and of every
    step its specimen's number, mass and samples."""

    deflections: Array
    steps: tuple[tuple[int, float, Array], ...]


def slow(*branches: ViscousBranch, shapes: Sequence[str] = ("middle", "large")) -> StepPlan:
    """Films of stated branches, each state held for 30 s, steps of as long."""
    return StepPlan(_design("slow", shapes, branches), 4e3, 5.0, 30.0, 20.0, 30.0)


def fast(shapes: Sequence[str] = ("small", "middle")) -> StepPlan:
    """Plates that swing and are damped as stated."""
    design = _design("fast", shapes)
    return StepPlan(replace(design, setup=replace(design.setup, rig=Rig(plate_damping=DAMPED))),
                    3.5e3, 0.4, 3.0, 1000.0)


def _design(name: str, shapes: Sequence[str], branches: tuple[ViscousBranch, ...] = ()) -> Design:
    film = replace(FILM, branches=branches)
    specimens = tuple(Specimen(shape, Circle(SHAPES[shape][1]), Plate(Circle(SHAPES[shape][0])),
                               film) for shape in shapes)
    number, mass, voltage = (axis.ravel() for axis in np.meshgrid(
        np.arange(len(specimens)), MASSES, VOLTAGES, indexing="ij"))
    return design_of(name, Setup(specimens, Rig()), States.of(number, mass, voltage))


def step_evidence(plan: StepPlan, truth: Truth) -> StepEvidence | None:
    """What is read if that is the truth; None where a state has no equilibrium."""
    limits = [item.limits for cause in truth.hypothesis for item in cause.effect.parameters]
    if any(not low <= size <= high
           for size, (low, high) in zip(truth.sizes, limits, strict=True)):
        return None
    try:
        with np.errstate(all="ignore"):
            read = _followed(plan, truth)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError):
        return None
    every = np.concatenate([read.deflections, *(samples for *_, samples in read.steps)])
    return read if np.isfinite(every).all() and np.abs(every).max() < _FAR else None


#: A plate further from where it was than this [m] is none of these equations'.
_FAR = 12e-3


def _followed(plan: StepPlan, truth: Truth) -> StepEvidence:
    sizes = _values(truth)
    states, deflections, steps = plan.design.table.states, np.empty(len(plan.design.table)), []
    gain, zero = 1 + sizes.get("sensor_gain", 0.0), sizes.get("sensor_zero", 0.0)

    def seen(nominal: float) -> float:
        return nominal / (1 + (nominal / sizes.get("voltage_sag", inf)) ** 2)

    for ramp in plan.design.ramps():
        number, mass = int(states.specimen[ramp[0]]), float(states.mass[ramp[0]])
        film = _film(plan.design.setup.specimens[number], truth, sizes)
        whole = mass + sizes.get("unaccounted_mass", 0.0)
        load, voltages = whole * plan.design.setup.rig.gravity, [
            seen(voltage) for voltage in states.voltage[ramp].tolist()]
        deflections[ramp] = _at_rest(film, load, voltages, plan.dwell)
        if mass != MASSES[-1]:
            continue
        swings = None if plan.dwell else SwingingPlate(
            film, whole + sizes.get("added_mass", 0.0),
            DAMPED + sizes.get("plate_damping", 0.0), sizes.get("series_resistance", 0.0),
            sizes.get("sensor_lag", 0.0))
        steps.append((number, mass, gain * _step(plan, film, load, seen(plan.voltage), swings)
                      + zero))
    return StepEvidence(gain * deflections + zero, tuple(steps))


def _values(truth: Truth) -> dict[str, float]:
    """Values of single parameters by effect; of creep its modulus, and its time as "time"."""
    values, sizes = dict[str, float](), iter(truth.sizes)
    for cause in truth.hypothesis:
        first, *rest = (item.value(next(sizes)) for item in cause.effect.parameters)
        values |= {cause.name: first, **dict(zip(("time",), rest, strict=False))}
    return values


def _film(specimen: Specimen, truth: Truth, sizes: dict[str, float]) -> CreepingFilm:
    branch, *_ = (*specimen.membrane.branches,
                  ViscousBranch(sizes.get("creep", 0.0), sizes.get("time", 1.0)))
    assert isinstance(specimen.membrane.material, NeoHooke)
    return CreepingFilm(
        specimen.needed_plate().outline.semi_axes[0], specimen.frame.semi_axes[0],
        specimen.membrane.thickness, specimen.membrane.prestretch[0],
        specimen.membrane.material.mu * truth.stiffness, branch.modulus, branch.time,
        specimen.membrane.relative_permittivity * truth.permittivity,
        spring=sizes.get("parallel_spring", 0.0), mounted=sizes.get("mounting_age", inf),
        logarithmic=truth.means == "another law")


def _at_rest(film: CreepingFilm, load: float, voltages: Sequence[float], dwell: float | None
             ) -> Array:
    if film.branch and dwell:
        return film.staircase(load, np.array(voltages), dwell)
    deflections, start = [], None
    for voltage in voltages:
        start, *_ = film.at_rest(load, voltage, None, start)
        deflections.append(start[-1])
    return np.array(deflections)


def _step(plan: StepPlan, film: CreepingFilm, load: float, voltage: float,
          swings: SwingingPlate | None) -> Array:
    first, last = plan.times
    if swings is not None:
        start = film.at_rest(load, 0.0, None)[0][-1]
        return np.r_[np.full(len(first), start), swings.stepped(load, voltage, last)]
    if film.branch:
        ends = np.array([plan.before]), np.array([plan.length])
        holds = [np.append(part, end) for part, end in zip((first, last), ends, strict=True)]
        read = film.followed(load, [(0.0, holds[0]), (voltage, holds[1])])
        return np.r_[read[0][:-1], read[1][:-1]]
    rest = _at_rest(film, load, (0.0, voltage), None)
    return np.repeat(rest, [len(first), len(last)])


def step_sheets(plan: StepPlan, read: StepEvidence, noise: float, random: np.random.Generator,
                exact: bool = False) -> dict[str, Columns]:
    """Columns of static.csv and transient.csv with noise [m]; ``exact``: none at rest, for the
    noise of samples is told by themselves."""
    table, names = plan.design.table, [
        specimen.name for specimen in plan.design.setup.specimens]
    states = table.states
    scatter = noise * random.standard_normal(len(table))
    static: Columns = {
        "specimen": [names[number] for number in states.specimen.tolist()], "mass": states.mass,
        "voltage": states.voltage, "order": table.order,
        "displacement": read.deflections + (0.0 if exact else scatter)}
    if plan.dwell:
        static["dwell"] = np.full(len(table), plan.dwell)
    first, last = plan.times
    time, voltage = np.r_[first, plan.before + last], np.repeat(
        [0.0, plan.voltage], [len(first), len(last)])
    count = len(read.steps)
    transient: Columns = {
        "specimen": np.repeat([names[number] for number, *_ in read.steps], len(time)).tolist(),
        "mass": np.repeat([mass for _, mass, _ in read.steps], len(time)),
        "run": ["step"] * (count * len(time)), "t": np.tile(time, count),
        "voltage": np.tile(voltage, count),
        "displacement": np.concatenate([samples for *_, samples in read.steps])
        + noise * random.standard_normal(count * len(time))}
    if plan.dwell:
        transient["rest"] = np.zeros(count * len(time))
    return {"static.csv": static, "transient.csv": transient}
