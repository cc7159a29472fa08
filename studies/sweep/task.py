"""The unit of a sweep: one specimen on a rig under all its masses and voltages."""

from __future__ import annotations

import hashlib
import json
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache, cached_property
from importlib import metadata
from itertools import chain
from typing import Any, get_args

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import Failure, InputError
from tympan.base.fields import write
from tympan.base.process.folder import temporary_folder
from tympan.base.process.threads import one_thread
from tympan.fem.equilibrium.ramp import Status
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, CaseResult, Settings, build_model, solve_grid
from tympan.studies.film_surface import FilmSurface, film_surface
from tympan.studies.sweep.asked import QUESTIONS, Ask, AskedCase, Record, SolvedCase
from tympan.studies.variables import VARIABLES

#: Revision of the results. Raise it whenever a change of mesher or solver changes results: finished
#: cases of earlier revisions are then not reused.
REVISION = 3

#: Status of a case that could not be tried: its film cannot be built or meshed, or its process
#: died.
FAILED = "failed"

#: Status of a case that is not solved yet.
WAITING = "waiting"

#: Division of an element's edges in files for other programs: it is cut into the square of this
#: many triangles, so that curves look smooth.
_FINE = 6
#: Division of an element's edges for small pictures of the sweep's page.
_COARSE = 4

#: Lock for gmsh, which has one state per process: several threads of a cluster's worker take turns.
_TURN = threading.Lock()

_STATUSES = {*get_args(Status), FAILED}

Row = dict[str, Any]


@cache
def solver() -> str:
    """Name the solver: version and revision."""
    return f"tympan {metadata.version('tympan')} revision {REVISION}"


@dataclass(frozen=True)
class TaskResult:
    """A row per case, masses first, and the fields of a task's equilibria by case id, as VTU.

    ``answers`` has the records of every question, masses first too.
    """

    rows: list[Row]
    answers: dict[str, list[Record]]
    wall_s: float = 0.0
    fields: dict[str, bytes] = field(default_factory=dict)

    def packed(self) -> PackedResult:
        """Pack its rows and answers, without ids, wall time and fields."""
        values = np.array([[np.nan if row[name] is None else row[name] for row in self.rows]
                            for name in numbers()], dtype=float)
        texts = {name: tuple(sys.intern(row[name] or "") for row in self.rows)
                 for name in TEXTS[:-1]}
        warnings = tuple(sys.intern(WARNINGS_JOINED.join(row["warnings"])) for row in self.rows)
        return PackedResult(values, texts | {"warnings": warnings}, self.answers)

    def answers_all(self, task: SweepTask) -> bool:
        """Test whether it has all rows and answers of a task."""
        return ([row.get("id") for row in self.rows] == list(task.ids)
                and all({"id", *columns()} == row.keys() and row["status"] in _STATUSES
                        for row in self.rows)
                and all(map(_of_its_kind, chain(self.rows, *self.answers.values())))
                and {name: len(records) for name, records in self.answers.items()} == {
                    name: len(task.ids) // QUESTIONS[name].every(task.loads)
                    for name in task.ask.names})


@dataclass(frozen=True, eq=False)
class PackedResult:
    """A task's result in little memory: ``numbers`` of :func:`numbers`, (columns, rows).

    Missing numbers are nan. ``texts`` are by column; a row's warnings are joined with " | ".
    """

    numbers: Array
    texts: Mapping[str, tuple[str, ...]]
    answers: Mapping[str, list[Record]]

    @property
    def cases(self) -> int:
        """Number of its rows."""
        return len(self.texts["status"])


@dataclass(frozen=True)
class SweepTask:
    """A specimen on a rig, its masses [kg] and voltages [V], ascending, and further questions.

    ``fields``: store those of all equilibria. ``figures``: store the data of a picture of the first
    case. ``family`` is the id of the family of films whose reduced film may solve it, ``kin`` that
    family; without a family all is solved by finite elements, for the reason ``why`` if many
    specimens are. ``solver`` is the version that is to solve it: results of different versions must
    not be mixed in one table.
    """

    specimen: Specimen
    rig: Rig
    masses: tuple[float, ...]
    voltages: tuple[float, ...]
    settings: Settings
    fields: bool
    solver: str
    figures: bool = False
    ask: Ask = field(default_factory=Ask)
    family: str = ""
    kin: Any = field(default=None, compare=False, repr=False)
    why: str = field(default="", compare=False)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Hash of the inputs of every case and of the solver, masses first.

        The specimen's name is not hashed. Equal inputs have equal ids on any machine.
        """
        content = write(self.specimen)
        content["membrane"]["material"] = _constants(self.specimen.membrane.material)
        if self.specimen.membrane.law_range is not None:  # results warn about it
            content["membrane"]["law_range"] = self.specimen.membrane.law_range
        head = json_digest({"specimen": {**content, "name": "any"}, "rig": self.rig.record(),
                      "settings": asdict(self.settings), "solver": self.solver}
                     | ({"family": self.family} if self.family else {}))
        masses, voltages = map(json.dumps, self.masses), [*map(json.dumps, self.voltages)]
        return tuple(_digest(f'["{head}", {mass}, {voltage}]') for mass in masses
                     for voltage in voltages)

    @cached_property
    def id(self) -> str:
        """Hash of its cases and of the data that are stored of them."""
        ask = {name: value for name, value in asdict(self.ask).items() if value is not None}
        more = [self.figures, ask] if self.figures or self.ask.names else []
        return json_digest([*self.ids, self.fields, *more])

    @property
    def loads(self) -> dict[str, int]:
        """Number of masses and voltages."""
        return {"mass": len(self.masses), "voltage": len(self.voltages)}

    def run(self) -> TaskResult:
        """Solve all cases; a film that cannot be built or meshed gives failed rows, no error."""
        if self.solver != solver():
            raise Failure(f"a worker has another version: {solver()}, here {self.solver}")
        began = time.perf_counter()
        with _TURN, one_thread():  # in a cluster's worker nothing else limits the threads
            try:
                result = self._solved()
            except InputError as error:  # without the name, which equal specimens do not share
                reason = str(InputError(error.allowed, key=error.key))
                result = without_result(self.ids, self.ask, self.loads, reason)
        return replace(result, wall_s=time.perf_counter() - began)

    def _solved(self) -> TaskResult:
        model = build_model(self.specimen, self.settings, self.rig.loading)
        solution = TaskResult([], {name: [] for name in self.ask.names})
        solved = solve_grid(model, self.masses, self.voltages, self.rig, self.settings.path)
        for number, (case_id, (result, outcome)) in enumerate(zip(self.ids, solved, strict=True)):
            record = result.json()
            solution.rows.append(
                {"id": case_id} | EXACT_ROW
                | {"by": self.settings.formula or BY_ELEMENTS, "why": self.why}
                | {name: record[name] for name in of_case()})
            self._answer(solution.answers, number, SolvedCase(
                self._case(number), self.settings, self.ask, self.masses, self.voltages, model,
                outcome))
            if outcome.status == "equilibrium" and (self.fields or (self.figures and not number)):
                surface = film_surface(model, outcome.state, _FINE if self.fields else _COARSE)
                if surface is not None:
                    solution.fields[case_id] = _stored(surface)
        return solution

    def answers(self) -> dict[str, list[Record]]:
        """Answer its questions that need no equilibrium of its cases."""
        answers: dict[str, list[Record]] = {name: [] for name in self.ask.names
                                            if not QUESTIONS[name].of_states}
        if not answers:
            return answers
        with _TURN, one_thread():
            for number in range(len(self.ids)):
                self._answer(answers, number, AskedCase(self._case(number), self.settings, self.ask,
                                                        self.masses, self.voltages))
        return answers

    def _case(self, number: int) -> Case:
        mass, voltage = divmod(number, len(self.voltages))
        return Case(self.specimen, mass=self.masses[mass], voltage=self.voltages[voltage],
                    rig=self.rig)

    def _answer(self, answers: dict[str, list[Record]], number: int, asked: AskedCase) -> None:
        """Add the answers at a case, where it is the first of its loads."""
        for name, records in answers.items():
            quantity = QUESTIONS[name]
            if number % (len(self.ids) if quantity.together else quantity.every(self.loads)) == 0:
                records += quantity.records(asked)


def _of_its_kind(record: Mapping[str, Any]) -> bool:
    """Test that a record has numbers or None besides its id, status and texts of warnings."""
    return all(all(isinstance(text, str) for text in value) if name == "warnings"
               else isinstance(value, str) if name in ("id", *TEXTS)
               else value is None or isinstance(value, int | float)
               for name, value in record.items())


def without_result(ids: Sequence[str], ask: Ask, loads: Mapping[str, int], reason: str,
                   status: str = FAILED) -> TaskResult:
    """Make rows of cases, by id, and answers, with the reason why there is no result."""
    rows: list[Row] = [{**dict.fromkeys(columns()), "id": case_id, "status": status,
                        "by": "", "why": "", "warnings": [reason]} for case_id in ids]
    answers = {name: [{"warnings": [reason]}] * (len(ids) // QUESTIONS[name].every(loads))
               for name in ask.names}
    return TaskResult(rows, answers)


def _constants(law: Any) -> Any:
    """Convert a law's name and constants to plain values."""
    if isinstance(law, tuple):
        return [_constants(part) for part in law]
    if not hasattr(law, "law"):
        return float(law)
    return {"law": law.law, **{name: _constants(part) for name, part in vars(law).items()}}


def json_digest(value: Any) -> str:
    """Hash a value that JSON can hold."""
    return _digest(json.dumps(value, sort_keys=True, default=str))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:24]


#: Source of a row solved by finite elements.
BY_ELEMENTS = "finite elements"
#: Source of a row solved by a reduced film.
BY_REDUCED = "reduced"

#: Columns of a row by finite elements that are usually the same: its source, why no reduced film
#: solved it, and empty errors of deflection and largest stress, which only reduced films have.
EXACT_ROW: Row = {"by": BY_ELEMENTS, "why": "", "deflection_error_m": None,
                  "tilt_error_rad": None, "max_true_stress_error_Pa": None}

#: Columns of texts, the list of warnings last.
TEXTS = ("status", "by", "why", "warnings")
#: Fields of a case that are no columns: inputs, what depends on time, on other cases, or was not
#: asked for; and the stroke, which a sweep's table adds from several of its rows.
_LEFT_OUT = {"specimen", "mass_kg", "voltage_V", "stroke_m", "wall_s", "film", "limits", "limit",
             "equilibria", "bands", "segments", "charge_by_voltage_F"}


def of_case() -> tuple[str, ...]:
    """List the columns of a case: its fields of ``solve --json``, with the state's variables."""
    names = chain.from_iterable(VARIABLES if item.name == "values" else (item.name,)
                                for item in fields(CaseResult))
    return tuple(name for name in names if name not in _LEFT_OUT)


def columns() -> tuple[str, ...]:
    """List all columns of a result: those of a case, and those of its source and errors."""
    return *of_case(), *EXACT_ROW


def numbers() -> tuple[str, ...]:
    """List the columns of numbers."""
    return tuple(name for name in columns() if name not in TEXTS)


#: Separator of several warnings of a row in a table.
WARNINGS_JOINED = " | "


def _stored(surface: FilmSurface) -> bytes:
    """Write a film's surface as the content of a VTU file."""
    with temporary_folder() as folder:
        file = folder / "fields.vtu"
        surface.save(file)
        return file.read_bytes()
