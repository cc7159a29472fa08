"""Specimens of a sweep that differ only in numbers, solved together by one family of reduced films.

For many specimens of one kind, a family of films (:mod:`tympan.studies.films.family`) is cheaper
than finite elements for each. Rows without a guaranteed accuracy come from finite elements: those
without tension everywhere or near to its loss, beyond a limit, or with too large an error.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.base.errors import InputError
from tympan.base.paths import at
from tympan.base.points import drawn_points
from tympan.base.process.threads import one_thread
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, breakdown_warning, remarks_on
from tympan.studies.films.box import Box, kind_of
from tympan.studies.films.family import FilmFamily, require_reducible
from tympan.studies.films.population import FilmGrid, Population
from tympan.studies.films.states import FilmStates
from tympan.studies.sweep.asked import QUESTIONS, Record
from tympan.studies.sweep.strokes import TENSE
from tympan.studies.sweep.task import (
    BY_REDUCED,
    Row,
    SweepTask,
    TaskResult,
    columns,
    json_digest,
)
from tympan.studies.variables import variables_of

#: Cost of the specimens, in equilibria, from which a family is worth making. The mesh of each
#: specimen counts as several equilibria. Making a family takes as long as about 1000 equilibria by
#: finite elements.
_WORTH = 3000
#: Number of equilibria that cost as much as a mesh.
_MESH = 8

#: Specimens that are solved together: few enough that finished cases are stored often.
_TOGETHER = 50
#: Largest relative error of a row by reduced films; other rows are left to finite elements.
EXACT = 1e-4

#: Why rows come from finite elements though there is a reduced film.
_SLACK = "the film has lost tension, or nearly so"
_INEXACT = "the reduced film is not exact enough by its estimated error"

#: Why finite elements solve films that a family could.
UNSTABLE = ("some films of these ranges are unstable in themselves, as at an electrode's edge, "
            "which reduced films do not show")

#: Share of random films that must be exact in a family; below it each half gets one of its own.
_WIDE = 0.7
#: Number of these random films.
_TRIED = 64
#: Their seed, which is arbitrary.
_SEED = 5

#: Most batches of one family, which is sent with each of them, before the batches become larger.
_MOST_BATCHES = 500


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
        """Describe the family of tasks whose specimens are of one kind."""
        box = Box.of([task.specimen for task in tasks])
        forces = [force for task in tasks for force in forces_of(task)]
        voltages = [abs(voltage) for task in tasks for voltage in film_voltages_of(task)]
        if any(QUESTIONS[name].change for name in tasks[0].ask.names):
            voltages.append(0.0)
        named = zip(box.names, box.low.tolist(), box.high.tolist(), strict=True)
        return cls(replace(box.specimen, name="family"), tuple(named), (min(forces), max(forces)),
                   (min(voltages), max(voltages)), tasks[0].rig, tasks[0].settings)

    def made(self) -> FilmFamily | str:
        """Make the family, or say why it cannot be made."""
        names, low, high = zip(*self.box, strict=True)
        box = Box(self.specimen, names, np.array(low), np.array(high))
        try:
            with one_thread():
                family = FilmFamily.over(box, self.force, self.voltage, self.rig, self.settings)
        except InputError as error:
            return f"no reduced film can be made: {InputError(error.allowed, key=error.key)}"
        return UNSTABLE if family.unstable else family

    def halved(self, tasks: list[SweepTask]) -> tuple[list[SweepTask], ...]:
        """Divide tasks at the middle of the widest range; none if a half has too few."""
        def relative(number: int) -> float:
            _, low, high = self.box[number]
            return (high - low) / max(abs(low), abs(high))

        widest = max(range(len(self.box)), key=relative)
        name, low, high = self.box[widest]
        values = [at(task.specimen, name.split(".")) for task in tasks]
        halves = ([task for task, value in zip(tasks, values, strict=True)
                   if (value > (low + high) / 2) == upper] for upper in (False, True))
        found = tuple(halves)
        enough = all(half and len(half) * _cost(half[0]) >= _WORTH for half in found)
        return found if enough else ()


def forces_of(task: SweepTask) -> list[float]:
    """Compute the forces on the plate of a task's film [N], one for each mass."""
    rig, plate_area = task.rig, task.specimen.plate_area
    return [float(rig.rubbed(rig.force(mass, plate_area))) for mass in task.masses]


def film_voltages_of(task: SweepTask) -> list[float]:
    """Compute the voltages across a task's film [V]."""
    return [float(task.rig.film_voltage(voltage)) for voltage in task.voltages]


def in_families(tasks: list[SweepTask | None]) -> list[SweepTask | None]:
    """Add the family to all tasks of a sweep that a reduced film may solve, or why none may."""
    groups = defaultdict[object, list[int]](list)
    for number, task in enumerate(tasks):
        if task is not None:
            groups[kind_of(task.specimen), task.rig, task.settings].append(number)
    result = list(tasks)
    for numbers in groups.values():
        members = [task for number in numbers if (task := tasks[number]) is not None]
        if len(members) * _cost(members[0]) < _WORTH:
            continue
        reasons = [_irreducible(task) for task in members]
        alike = [task for task, why in zip(members, reasons, strict=True) if not why]
        kin = Kin.of(alike) if alike else None
        for number, task, why in zip(numbers, members, reasons, strict=True):
            if why:
                result[number] = replace(task, why=why)
            elif kin is not None and kin.box:
                result[number] = replace(task, kin=kin, family=kin_id(kin))
    return result


def _cost(task: SweepTask) -> int:
    """Compute the cost, in equilibria, of a task's part that a family can answer."""
    answers = [QUESTIONS[name].equilibria for name in task.ask.names]
    return _MESH + len(task.ids) * (1 + sum(answers))


def kin_id(kin: Kin) -> str:
    """Hash a family: rows of different families differ by the errors of both."""
    return json_digest(repr(kin))


def _irreducible(task: SweepTask) -> str:
    """Say why a reduced film cannot answer all questions of a task; "" if it can."""
    specimen = task.specimen
    left = [name for name in task.ask.names
            if QUESTIONS[name].of_states and QUESTIONS[name].by_family is None]
    asked = ["fields"] * task.fields + ["figures"] * task.figures + left
    if asked:
        return f"{' and '.join(asked)} of a film need its own finite elements"
    try:
        require_reducible(specimen, task.rig)
    except InputError as error:
        return str(InputError(error.allowed, key=error.key))
    return ""


@dataclass(frozen=True)
class Batch:
    """Tasks of one family, solved together; a task without a family is a batch of its own."""

    tasks: tuple[SweepTask, ...]
    family: FilmFamily | None = None

    @property
    def cases(self) -> int:
        """Number of their rows."""
        return sum(len(task.ids) for task in self.tasks)

    def run(self) -> dict[str, TaskResult]:
        """Solve the tasks; give results by the tasks' ids."""
        family = self.family
        if family is None:
            return {task.id: task.run() for task in self.tasks}
        with one_thread():
            began = time.perf_counter()
            rows = np.array([family.box.row(task.specimen) for task in self.tasks])
            grid = FilmGrid(Population.alike(family, self.tasks[0].rig, rows),
                            masses=np.array([task.masses for task in self.tasks]),
                            voltages=np.array([task.voltages for task in self.tasks]))
            answers = {name: answer(grid) for name in self.tasks[0].ask.names
                       if (answer := QUESTIONS[name].by_family) is not None}
            made = _rows(self.tasks, family, grid.states)
            why = unsure(grid.states)
            for name, films in answers.items():
                missing = np.array([[record is None for record in film] for film in films])
                why[missing & (why == "")] = f"{_INEXACT} of {name}"
            took = (time.perf_counter() - began) / len(self.tasks)
        return {task.id: _completed(task, made[number], {
            name: films[number] for name, films in answers.items()}, why[number], took)
                for number, task in enumerate(self.tasks)}


def unsure(states: FilmStates, allowed: float = EXACT) -> AnyArray:
    """Say why states have no guaranteed accuracy of the family, (films, states); "" where sure.

    ``allowed``: largest error of the deflection, relative.
    """
    # Comparisons with missing states are false.
    exact = states.error <= allowed * np.abs(states.deflection)
    tense = ~(states.tension <= TENSE * states.stress)  # a film without fields has no stress
    return np.select([~states.holds & states.slack, ~states.holds, ~states.sound, ~tense, ~exact],
                     [_SLACK, "the reduced film finds no equilibrium, or the film is outside its "
                      "ranges", "the film is outside the range of its law, or soft in itself",
                      _SLACK, f"{_INEXACT} of the deflection"], "").astype(object)


def batches(tasks: Mapping[str, SweepTask]) -> dict[str, Batch]:
    """Divide tasks into batches, by the id of their first; families are made here, once."""
    groups = defaultdict[str, list[SweepTask]](list)
    for task in tasks.values():
        groups[task.family or task.id].append(task)
    together: dict[str, Batch] = {}
    for every in groups.values():
        for family, members in _of_families(every[0].kin, every):
            size = max(_TOGETHER, len(members) // _MOST_BATCHES) if family else 1
            together |= {members[start].id: Batch(tuple(members[start:start + size]), family)
                         for start in range(0, len(members), size)}
    return together


def _of_families(kin: Any, tasks: list[SweepTask]
                 ) -> Iterator[tuple[FilmFamily | None, list[SweepTask]]]:
    """Make the family of some tasks; where it is too wide to be exact, one of each half of it."""
    family = kin.made() if isinstance(kin, Kin) and kin.box else None
    if isinstance(family, str):
        yield None, [replace(task, why=family) for task in tasks]
        return
    halves = kin.halved(tasks) if family is not None and _exact_share(family) < _WIDE else ()
    for half in halves:
        yield from _of_families(Kin.of(half), half)
    if not halves:
        yield family, tasks


def _exact_share(family: FilmFamily) -> float:
    """Compute the share of random films of a family whose deflections are exact enough."""
    rows = family.drawn(_TRIED, _SEED)
    loads = drawn_points(2, _TRIED, _SEED)
    force, voltage = (low + share * (high - low) for share, (low, high) in
                      zip(loads.T[..., None], (family.force, family.voltage), strict=True))
    with one_thread():
        states = family.states(rows, force, voltage)
    exact = states.error <= EXACT * np.abs(states.deflection)
    return float(exact[states.holds].mean()) if states.holds.any() else 0.0


def _rows(tasks: Sequence[SweepTask], family: FilmFamily, states: FilmStates) -> list[list[Row]]:
    """Make the rows of each task from the family's states; nan where it has none."""
    plate = tasks[0].specimen.plate is not None
    numbers = variables_of(states, plate=plate) | {
        "reading_m": tasks[0].rig.reading(states.deflection),
        "deflection_error_m": states.error, "tilt_error_rad": states.slope_error,
        "max_true_stress_error_Pa": states.stress_error}
    blank = dict.fromkeys(columns()) | {
        "status": "equilibrium", "dofs": family.ground.model.unknowns, "by": BY_REDUCED, "why": ""}
    near = zip(states.breakdown.tolist(), states.weakest_field.tolist(),
               states.weakest_strength.tolist(), states.weakest.tolist(), strict=True)
    made = []
    for task, warned, *values in zip(tasks, near, *map(_cells, numbers.values()), strict=True):
        rows = []
        for case_id, remark, (part, electric, strength, place), *row in zip(
                task.ids, _remarks(task), zip(*warned, strict=True), *values, strict=True):
            rows.append({**blank, **dict(zip(numbers, row, strict=True)), "id": case_id,
                         "warnings": [*breakdown_warning(part, electric, strength, *place),
                                      *remark]})
        made.append(rows)
    return made


def _cells(values: Array) -> list[list[float | None]]:
    """List values of films' states, (films, states); None for nan."""
    cells: Any = values.astype(object)
    cells[np.isnan(values)] = None
    listed: list[list[float | None]] = cells.tolist()
    return listed


def _remarks(task: SweepTask) -> Iterator[tuple[str, ...]]:
    """Yield remarks on the loads of each row, by the highest voltage."""
    highest = max(task.voltages, key=abs)
    for mass in task.masses:
        yield from repeat(remarks_on(task.specimen, task.rig, mass, highest), len(task.voltages))


def _completed(task: SweepTask, rows: list[Row], answers: dict[str, list[Record | None]],
               why: AnyArray, took: float) -> TaskResult:
    """Complete a task's rows and answers; those that are not sure come from finite elements."""
    began, count = time.perf_counter(), len(task.voltages)
    asked = replace(task.ask, names=tuple(answers))
    for start, mass in zip(range(0, len(rows), count), task.masses, strict=True):
        missing = [number for number in range(start, start + count) if why[number]]
        if not missing:
            continue
        part = replace(task, masses=(mass,), kin=None, family="", ask=asked,
                       voltages=tuple(task.voltages[number - start] for number in missing))
        solved = part.run()
        for place, number in enumerate(missing):
            rows[number] = solved.rows[place] | {"id": task.ids[number], "why": why[number]}
            for name, records in answers.items():
                records[number] = solved.answers[name][place]
    found = {name: [record for record in records if record is not None]
             for name, records in answers.items()}
    return TaskResult(rows, task.answers() | found, took + time.perf_counter() - began)
