"""Specimens of a sweep that differ in numbers alone, solved together by a reduced film of all.

Where there are many of one kind, their family of films
(:mod:`tympan.studies.films.family`) is cheaper than finite elements for each. The rows it cannot
vouch for come from finite elements: those without tension everywhere or near to losing it, beyond a
limit, or with too large an error.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import area
from tympan.geometry.process.threads import one_thread
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, breakdown_warning
from tympan.studies.films.box import Box, kind_of
from tympan.studies.films.family import FamilyStates, FilmFamily, require_reducible
from tympan.studies.sweep.task import (
    BY_REDUCED,
    COLUMNS,
    Row,
    SweepTask,
    TaskResult,
    digest_of,
)

Array = NDArray[Any]

#: The largest error of a row's deflection, as a share of it, that is not left to finite elements.
EXACT = 1e-4

#: How far a film's least tension is from none in a row that is not left to finite elements, over
#: its largest stress: between nodes it may be less than at these.
_TENSE = 0.01

#: Equilibria and, for each specimen, meshes, which cost as much as so many, from which on a family
#: is worth its making: that takes as long as finite elements of some 1000 of them.
_WORTH = 3000
#: Equilibria that cost as much as a mesh.
_MESH = 8

#: Specimens that are solved together, so that what is finished is kept often enough.
_TOGETHER = 50


@dataclass(frozen=True)
class Kin:
    """A family to be made: its films' box about a specimen, loads on the films, rig and settings.

    ``box``: name, lowest and highest value of each number.
    """

    specimen: Specimen
    box: tuple[tuple[str, float, float], ...]
    force: tuple[float, float]
    voltage: tuple[float, float]
    rig: Rig
    settings: Settings

    @classmethod
    def of(cls, tasks: list[SweepTask]) -> Kin:
        """The family of some tasks whose specimens are of one kind."""
        box = Box.of([task.specimen for task in tasks])
        forces = [force for task in tasks for force in forces_of(task)]
        voltages = [abs(voltage) for task in tasks for voltage in film_voltages_of(task)]
        named = zip(box.names, box.low.tolist(), box.high.tolist(), strict=True)
        return cls(replace(box.specimen, name="family"), tuple(named), (min(forces), max(forces)),
                   (min(voltages), max(voltages)), tasks[0].rig, tasks[0].settings)

    @property
    def family(self) -> FilmFamily | None:
        """The family, None where it cannot be made; each process makes it once."""
        return _family(self)


@lru_cache(maxsize=4)
def _family(kin: Kin) -> FilmFamily | None:
    names, low, high = zip(*kin.box, strict=True)
    box = Box(kin.specimen, names, np.array(low), np.array(high))
    try:
        return FilmFamily.over(box, kin.force, kin.voltage, kin.rig, kin.settings)
    except InputError:
        return None


def forces_of(task: SweepTask) -> list[float]:
    """Forces on the plate of a task's film [N], one for each mass."""
    plate = task.specimen.needed_plate()
    return [Case(task.specimen, mass=mass, rig=task.rig).force(area(plate.outline))
            for mass in task.masses]


def film_voltages_of(task: SweepTask) -> list[float]:
    """Voltages across a task's film [V]."""
    return [float(task.rig.film_voltage(voltage)) for voltage in task.voltages]


def in_families(tasks: list[SweepTask | None]) -> list[SweepTask | None]:
    """The tasks of a sweep; those that a reduced film may solve know their family."""
    groups = defaultdict[object, list[int]](list)
    for number, task in enumerate(tasks):
        if task is not None and _reducible(task):
            groups[kind_of(task.specimen), task.rig, task.settings].append(number)
    result = list(tasks)
    for numbers in groups.values():
        members = [task for number in numbers if (task := tasks[number]) is not None]
        if len(members) * (_MESH + len(members[0].ids)) < _WORTH:
            continue
        kin = Kin.of(members)
        if not kin.box:
            continue
        for number, task in zip(numbers, members, strict=True):
            result[number] = replace(task, kin=kin, family=kin_id(kin))
    return result


def kin_id(kin: Kin) -> str:
    """Hash of a family: rows of another one differ by as much as both are off."""
    return digest_of(repr(kin))


def _reducible(task: SweepTask) -> bool:
    """Whether a reduced film has all that is asked of a task."""
    specimen = task.specimen
    if task.fields or task.figures or task.ask.names or specimen.plate is None:
        return False
    try:
        require_reducible(specimen, task.rig)
    except InputError:
        return False
    # A line of the electrode within the film may give way by itself.
    return specimen.electrode.everywhere


@dataclass(frozen=True)
class Batch:
    """Tasks of one family, solved together; a task of no family is a batch of its own."""

    tasks: tuple[SweepTask, ...]

    @property
    def cases(self) -> int:
        """How many rows they have."""
        return sum(len(task.ids) for task in self.tasks)

    def run(self) -> dict[str, TaskResult]:
        """Results by the tasks' ids."""
        first = self.tasks[0]
        with one_thread():
            family = first.kin.family if isinstance(first.kin, Kin) else None
        if family is None:
            return {task.id: task.run() for task in self.tasks}
        with one_thread():
            began = time.perf_counter()
            rows = [family.box.row(task.specimen) for task in self.tasks]
            loads = [np.meshgrid(forces_of(task), film_voltages_of(task), indexing="ij")
                     for task in self.tasks]
            forces, voltages = (np.array([load[part].ravel() for load in loads])
                                for part in range(2))
            states = family.states(np.array(rows), forces, voltages)
            # Of states that are none comparisons are false.
            sure = (states.holds & (states.error <= EXACT * np.abs(states.deflection))
                    & (states.tension > _TENSE * states.stress) & states.sound)
            made = [list(_rows(task, family, states, number))
                    for number, task in enumerate(self.tasks)]
            took = (time.perf_counter() - began) / len(self.tasks)
        return {task.id: _completed(task, made[number], sure[number], took)
                for number, task in enumerate(self.tasks)}


def batches(tasks: Mapping[str, SweepTask]) -> dict[str, Batch]:
    """Tasks in batches, by the id of their first."""
    groups = defaultdict[str, list[SweepTask]](list)
    for task in tasks.values():
        groups[task.family or task.id].append(task)
    return {members[start].id: Batch(tuple(members[start:start + _TOGETHER]))
            for members in groups.values() for start in range(0, len(members), _TOGETHER)}


def _rows(task: SweepTask, family: FilmFamily, states: FamilyStates, film: int) -> Iterator[Row]:
    """The rows of a task as its family has them; nan where it has none."""
    rig, specimen, highest = task.rig, task.specimen, max(task.voltages, key=abs)
    unknowns = family.ground.model.unknowns
    for number, case_id in enumerate(task.ids):
        mass = task.masses[number // len(task.voltages)]
        if number % len(task.voltages) == 0:
            remarks = list(Case(specimen, mass=mass, voltage=highest, rig=rig).remarks)
        share = float(states.breakdown[film, number])
        place = states.weakest[film, number].tolist()
        electric, strength = (float(values[film, number]) for values in (
            states.weakest_field, states.weakest_strength))
        warned = breakdown_warning(share, electric, strength, *place)
        deflection = float(states.deflection[film, number])
        yield {**dict.fromkeys(COLUMNS), "id": case_id, "status": "equilibrium",
               "deflection_m": deflection, "reading_m": float(rig.reading(deflection)),
               "reaction_N": float(states.force[film, number]),
               "capacitance_F": float(states.capacitance[film, number]),
               "max_stretch": float(states.stretch[film, number]),
               "max_true_stress_Pa": float(states.stress[film, number]),
               "max_field_V_per_m": float(states.electric[film, number]),
               "breakdown_margin": 1 / share if share else None,
               "breakdown_x_m": place[0] if share else None,
               "breakdown_y_m": place[1] if share else None,
               "slack_area_m2": 0.0, "slack_share": 0.0,
               "tilt_rad": float(states.tilt[film, number]),
               "energy_J": float(states.energy[film, number]), "dofs": unknowns,
               "warnings": [*warned, *remarks], "by": BY_REDUCED,
               "deflection_error_m": float(states.error[film, number])}


def _completed(task: SweepTask, rows: list[Row], sure: Array, took: float) -> TaskResult:
    """Rows of a task, those that are not sure by finite elements."""
    began, count = time.perf_counter(), len(task.voltages)
    for start, mass in zip(range(0, len(rows), count), task.masses, strict=True):
        missing = [number for number in range(start, start + count) if not sure[number]]
        if not missing:
            continue
        part = replace(task, masses=(mass,), kin=None, family="",
                       voltages=tuple(task.voltages[number - start] for number in missing))
        for number, row in zip(missing, part.run().rows, strict=True):
            rows[number] = row | {"id": task.ids[number]}
    return TaskResult(rows, {}, took + time.perf_counter() - began)

