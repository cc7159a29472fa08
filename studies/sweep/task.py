"""The unit of a sweep: one specimen on a rig under all its masses and voltages."""

from __future__ import annotations

import hashlib
import json
import tempfile
import threading
import time
from dataclasses import asdict, dataclass, fields
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import Any

from tympan.fem.equilibrium.ramp import voltage_path
from tympan.fem.results.fields import whole
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_writer import law_content, specimen_content
from tympan.studies.case import Case, CaseResult, Settings, build_model, summaries
from tympan.studies.files import write_fields

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
class Result:
    """What a task found: a row per case, masses first, and the fields of its equilibria by case id, as VTU."""

    rows: list[Row]
    wall_s: float
    fields: dict[str, bytes]


@dataclass(frozen=True)
class Task:
    """A specimen on a rig, its masses [kg] and voltages [V], ascending; ``fields``: whether to keep them all.

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
        """Of every case, masses first: the hash of its inputs and of the solver; the specimen's name is none of them.

        Equal inputs have equal ids on any machine.
        """
        common = {"specimen": _content(self.specimen), "rig": self.rig.record(),
                  "settings": asdict(self.settings),
                  "solver": self.solver}
        head = _hash(common)
        return tuple(_hash([head, mass, voltage]) for mass in self.masses
                     for voltage in self.voltages)

    @cached_property
    def id(self) -> str:
        """The hash of its cases and of what is kept of them."""
        return _hash([*self.ids, self.fields])

    def run(self) -> Result:
        """Solve all cases; what cannot be built or meshed is a failed row each, not an error.

        Raises
        ------
        InputError
            When this process has another version than the one that asks.
        """
        if self.solver != solver():
            raise InputError(f"workers must have the same version: there {solver()}, here {self.solver}",
                             key="--scheduler")
        began = time.perf_counter()
        with _TURN:
            try:
                rows, kept = self._solved()
            except InputError as error:
                rows, kept = self.failed(str(_nameless(error))), {}
        return Result(rows, time.perf_counter() - began, kept)

    def failed(self, reason: str) -> list[Row]:
        """Rows that say why there is no result."""
        empty: Row = dict.fromkeys(COLUMNS)
        return [{**empty, "id": number, "status": FAILED, "warnings": [reason]}
                for number in self.ids]

    def _solved(self) -> tuple[list[Row], dict[str, bytes]]:
        model = build_model(self.specimen, self.settings, self.rig.loading)
        seen = [self.rig.film_voltage(voltage) for voltage in self.voltages]
        rows: list[Row] = []
        kept: dict[str, bytes] = {}
        for mass in self.masses:
            path = voltage_path(model, self.rig.force(mass, model.plate_area), seen,
                                self.rig.gas_pressure,
                                self.settings.path)
            cases = [Case(self.specimen, mass, voltage, self.rig) for voltage in self.voltages]
            for result, outcome in summaries(cases, model, path):
                number = self.ids[len(rows)]
                rows.append({"id": number} | {name: value for name, value in result.json().items()
                                              if name in COLUMNS})
                if self.fields and outcome.status == "equilibrium":
                    kept[number] = _vtu(*whole(model, outcome.state))
        return rows, kept


def _nameless(error: InputError) -> InputError:
    """The error without the specimen's name, which equal specimens do not share."""
    return InputError(error.allowed, key=error.key)


def _vtu(model: Any, state: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fields.vtu"
        write_fields(file, model, state)
        return file.read_bytes()


def _content(specimen: Specimen) -> Any:
    """All of a specimen but its name, floats to the last digit."""
    return {**specimen_content(specimen, lambda one: law_content(one.membrane.material, {})),
            "name": "any"}


def _hash(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


#: Columns of a result beside the inputs: those of ``solve --json`` that do not depend on the clock.
COLUMNS: tuple[str, ...] = tuple(
    item.name for item in fields(CaseResult) if item.name not in ("specimen", "mass_kg",
                                                                  "voltage_V", "wall_s"))
