"""The unit of a sweep: one specimen on a rig under all its masses and voltages."""

from __future__ import annotations

import hashlib
import json
import tempfile
import threading
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import Any

from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.fields import write
from tympan.geometry.specimen import Specimen
from tympan.studies.case import CaseResult, Settings, build_model, solve_grid
from tympan.studies.film_surface import film_surface

#: To be raised whenever a change of mesher or solver changes results: finished cases of before are
#: then not reused.
REVISION = 2

#: Of a case that could not even be tried: no film can be built or meshed, or the process that tried
#: it died.
FAILED = "failed"

#: gmsh has one state per process: where a cluster gives a process several threads, they take turns.
_TURN = threading.Lock()

Row = dict[str, Any]


@cache
def solver() -> str:
    """What solves: version and revision."""
    return f"tympan {metadata.version('tympan')} revision {REVISION}"


@dataclass(frozen=True)
class TaskResult:
    """A row per case, masses first, and the fields of a task's equilibria by case id, as VTU."""

    rows: list[Row]
    wall_s: float
    fields: dict[str, bytes]


@dataclass(frozen=True)
class SweepTask:
    """A specimen on a rig, its masses [kg] and voltages [V], ascending; ``fields``: keep them all.

    ``solver`` is who is to solve it: results of different versions must not meet in one table.
    """

    specimen: Specimen
    rig: Rig
    masses: tuple[float, ...]
    voltages: tuple[float, ...]
    settings: Settings
    fields: bool
    solver: str

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Of every case, masses first: the hash of its inputs and of the solver.

        The specimen's name is none of them. Equal inputs have equal ids on any machine.
        """
        content = write(self.specimen)
        content["membrane"]["material"] = _constants(self.specimen.membrane.material)
        head = _hash({"specimen": {**content, "name": "any"}, "rig": self.rig.record(),
                      "settings": asdict(self.settings), "solver": self.solver})
        return tuple(_hash([head, mass, voltage]) for mass in self.masses
                     for voltage in self.voltages)

    @cached_property
    def id(self) -> str:
        """The hash of its cases and of what is kept of them."""
        return _hash([*self.ids, self.fields])

    def run(self) -> TaskResult:
        """Solve all cases; what cannot be built or meshed is a failed row each, not an error."""
        if self.solver != solver():
            raise InputError(f"workers must have the same version: there {solver()}, here "
                             f"{self.solver}", key="--scheduler")
        began = time.perf_counter()
        with _TURN:
            try:
                rows, kept = self._solved()
            except InputError as error:  # without the name, which equal specimens do not share
                reason = str(InputError(error.allowed, key=error.key))
                rows, kept = failed_rows(self.ids, reason), {}
        return TaskResult(rows, time.perf_counter() - began, kept)

    def _solved(self) -> tuple[list[Row], dict[str, bytes]]:
        model = build_model(self.specimen, self.settings, self.rig.loading)
        rows: list[Row] = []
        kept: dict[str, bytes] = {}
        solved = solve_grid(model, self.masses, self.voltages, self.rig, self.settings.path)
        for case_id, (result, outcome) in zip(self.ids, solved, strict=True):
            record = result.json()
            rows.append({"id": case_id} | {name: record[name] for name in COLUMNS})
            if self.fields and outcome.status == "equilibrium":
                with tempfile.TemporaryDirectory() as folder:
                    file = Path(folder) / "fields.vtu"
                    film_surface(model, outcome.state).save(file)
                    kept[case_id] = file.read_bytes()
        return rows, kept


def failed_rows(ids: Iterable[str], reason: str) -> list[Row]:
    """Rows of cases, by id, that say why there is no result."""
    empty: Row = dict.fromkeys(COLUMNS)
    return [{**empty, "id": case_id, "status": FAILED, "warnings": [reason]} for case_id in ids]


def _constants(law: Any) -> Any:
    """A law's name and constants as plain numbers."""
    if isinstance(law, tuple):
        return [_constants(part) for part in law]
    if not hasattr(law, "law"):
        return float(law)
    return {"law": law.law, **{name: _constants(part) for name, part in vars(law).items()}}


def _hash(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


#: Columns of a result beside the inputs: those of ``solve --json`` that do not depend on the clock.
COLUMNS: tuple[str, ...] = tuple(
    item.name for item in fields(CaseResult)
    if item.name not in ("specimen", "mass_kg", "voltage_V", "wall_s", "film", "limits", "limit"))
