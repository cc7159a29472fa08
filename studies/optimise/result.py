"""The result of an optimisation: numbers, designs tried, outlines on the way, best specimens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.library import load_specimen
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, remove, write_json, write_text
from tympan.studies.optimise.design import Design
from tympan.studies.optimise.optimise import Optima, Optimum, StartRun, find_optima
from tympan.studies.optimise.problem import MEASURES, OptimiseProblem
from tympan.studies.optimise.sqp import DescentSettings

#: A limit is active where its value is so near to it, relative.
ACTIVE = 1e-3

#: The columns of optimum-outlines.csv: edges of frame and plate of the reference (``held`` blank)
#: and of the designs gone to on the way to each optimum.
OUTLINES: tuple[Column, ...] = (
    Column.labels("held", required=False), Column("trial"),
    Column.labels("part", ("frame", "plate")), Column("x", "mm"), Column("y", "mm"))

TableOfColumns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class OptimiseResult:
    """``record``: all numbers [SI]; ``trials``: every design tried; ``outlines``: as OUTLINES.

    ``trials`` has the columns of path.csv, in SI: held, start, trial, accepted, the variables,
    stroke, the limited values and reason. ``specimens``: the optimal ones by file name.
    """

    record: Mapping[str, Any]
    trials: TableOfColumns
    outlines: TableOfColumns
    specimens: Mapping[str, Specimen]

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        return dict(self.record)

    def save(self, folder: Path) -> None:
        """Write ``path.csv``, ``optimum-outlines.csv``, specimens, and last ``optimum.json``."""
        remove(folder, "optimum.json", "optimum.png", "optimum.svg", "path.csv", "optimum.toml",
               "optimum-outlines.csv", *(f"optimum-{measure}.toml" for measure in MEASURES))
        write_sheet(folder / "path.csv", _trial_columns(self.record), self.trials)
        write_sheet(folder / "optimum-outlines.csv", OUTLINES, self.outlines)
        for name, specimen in self.specimens.items():
            write_text(folder / name, specimen_to_toml(specimen))
        write_json(folder / "optimum.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> OptimiseResult:
        """What was saved.

        Raises
        ------
        InputError
            When a file is missing or damaged, or is of a version that kept too little.
        """
        file = folder / "optimum.json"
        record = from_json(dict[str, Any], read_json(file), file)
        if "variables" not in record:
            raise InputError("is of a version that kept too little for a picture: run tympan "
                             "optimise again", file=file)
        files = [optimum["specimen_file"] for optimum in record["optima"]]
        return cls(record, read_own_sheet(folder / "path.csv", _trial_columns(record)),
                   read_own_sheet(folder / "optimum-outlines.csv", OUTLINES),
                   {name: load_specimen(folder / name) for name in files})


def optimise(problem: OptimiseProblem, settings: Settings = Settings(),
             descent: DescentSettings = DescentSettings(),
             progress: Callable[[str], None] = lambda words: None) -> OptimiseResult:
    """Solve a problem.

    Raises
    ------
    InputError
        When a variable's shape has no derivative.
    """
    return result_of(find_optima(problem, settings, descent, progress))


def result_of(optima: Optima) -> OptimiseResult:
    """The numbers, tables and specimens of optima."""
    problem, specimens = optima.problem, {}
    for optimum in optima.optima:
        specimen = optimum.best.best.specimen
        assert specimen is not None
        specimens[_specimen_file(optima, optimum)] = replace(
            specimen, name=f"{problem.name} equal {optimum.held}")
    record = {
        "name": problem.name, "mass_kg": problem.mass, "voltage_V": problem.voltage,
        "limits": {limit.name: {"bound": limit.bound, "unit": limit.unit}
                   for limit in problem.limits},
        "variables": {variable.key: {"low": variable.low, "high": variable.high,
                                     "dimension": variable.dimension(problem.specimen)}
                      for variable in problem.variables},
        "reference": {"specimen": problem.reference.name, **_design(problem, optima.reference)},
        "given": {"specimen": problem.specimen.name, **_design(problem, optima.given)},
        "optima": [_optimum(optima, optimum) for optimum in optima.optima],
        "failed": [{"held": run.held, **_run(problem, run)} for run in optima.failed]}
    return OptimiseResult(record, _trials(optima), _outlines(optima), specimens)


def _trial_columns(record: Mapping[str, Any]) -> tuple[Column, ...]:
    variables = [Column(name, "mm" if variable["dimension"] == "length" else "")
                 for name, variable in record["variables"].items()]
    limits = [Column(name, limit["unit"].removesuffix("1"), required=False, absent="nan")
              for name, limit in record["limits"].items()]
    return (Column.labels("held"), Column("start"), Column("trial"), Column("accepted"), *variables,
            Column("stroke", "mm", required=False, absent="nan"), *limits,
            Column.labels("reason", required=False))


def _specimen_file(optima: Optima, optimum: Optimum) -> str:
    return "optimum.toml" if len(optima.problem.held) == 1 else f"optimum-{optimum.held}.toml"


def _optimum(optima: Optima, optimum: Optimum) -> dict[str, Any]:
    problem, descent, design = optima.problem, optimum.best.descent, optimum.best.best
    multipliers, here = descent.multipliers, descent.here
    assert multipliers is not None
    assert here is not None
    share, limits = 1 / design.stroke, {}
    for limit in problem.limits:
        rows = [owner == limit.name for owner in design.owners]
        limits[limit.name] = {
            "bound": limit.bound, "unit": limit.unit, "value": design.limited[limit.name],
            "finer": _number(optimum.finer.limited.get(limit.name, np.nan)),
            "active": bool((here.limits[rows] > -ACTIVE).any()),
            "multiplier": float(multipliers.limits[rows].sum()) * share}
    return {
        "held": optimum.held, "best_start": optimum.best.start + 1,
        "specimen_file": _specimen_file(optima, optimum),
        "status": descent.status, **_design(problem, design), "gain": _number(optimum.gain),
        "gain_over_given": _number(optimum.gain_start),
        "held_multiplier": multipliers.held * share,
        "kkt_residual": multipliers.residual, "limits": limits,
        "at_bounds": [variable.key for variable, force
                      in zip(problem.variables, multipliers.bounds, strict=True) if force],
        "finer": {**_design(problem, optimum.finer),
                  "gain": _number(optimum.finer.stroke / optima.reference.stroke - 1)},
        "starts": [_run(problem, run) for run in optimum.runs],
        "starts_apart_stroke": optimum.apart,
        "starts_apart_variables": optimum.elsewhere, "warnings": list(optimum.warnings)}


def _run(problem: OptimiseProblem, run: StartRun) -> dict[str, Any]:
    multipliers = run.descent.multipliers
    return {"start": run.start + 1, "status": run.descent.status, "trials": run.descent.trials,
            "without_equilibrium": run.descent.missing,
            "kkt_residual": None if multipliers is None else multipliers.residual,
            **_design(problem, run.best)}


def _design(problem: OptimiseProblem, design: Design) -> dict[str, Any]:
    frame = {} if design.specimen is None else {
        f"frame_{name}": float(measure(design.specimen.frame))
        for name, measure in MEASURES.items()}
    variables = {variable.key: float(value) for variable, value
                 in zip(problem.variables, design.values, strict=False)}
    return {"variables": variables, "stroke_m": _number(design.stroke),
            "deflection_without_voltage_m": _number(design.rest), **frame,
            "limited": {name: _number(value) for name, value in design.limited.items()},
            "reason": design.reason}


def _trials(optima: Optima) -> TableOfColumns:
    problem = optima.problem
    runs = (*(run for optimum in optima.optima for run in optimum.runs), *optima.failed)
    rows = [{"held": run.held, "start": run.start + 1.0, "trial": float(number),
             "accepted": float(trial.accepted), "stroke": trial.stroke, "reason": trial.reason,
             **{variable.key: float(value) for variable, value
                in zip(problem.variables, trial.values, strict=True)},
             **{limit.name: trial.limited.get(limit.name, np.nan) for limit in problem.limits}}
            for run in runs for number, trial in enumerate(run.trials)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _outlines(optima: Optima) -> TableOfColumns:
    shown = [("", 0, optima.problem.reference)]
    shown += [(optimum.held, number, trial.specimen) for optimum in optima.optima
              for number, trial in enumerate(optimum.best.trials)
              if trial.accepted and trial.specimen is not None]
    edges: list[tuple[str, int, str, NDArray[Any]]] = []
    for measure, number, specimen in shown:
        offset = np.array(specimen.plate.offset)[:, None]
        edges += [(measure, number, "frame", specimen.frame.points(360)),
                  (measure, number, "plate", specimen.plate.outline.points(360) + offset)]
    x, y = np.concatenate([edge for *_, edge in edges], axis=1)
    lengths = [edge.shape[1] for *_, edge in edges]
    return {"held": np.repeat([measure for measure, *_ in edges], lengths),
            "trial": np.repeat([float(number) for _, number, *_ in edges], lengths),
            "part": np.repeat([part for _, _, part, _ in edges], lengths), "x": x, "y": y}


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None
