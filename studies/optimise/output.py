"""Optima on disk: specimens for ``solve``, the way there as CSV, all numbers as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from tympan.fem.toml_writer import specimen_to_toml
from tympan.studies import files as store
from tympan.studies.optimise.design import Design
from tympan.studies.optimise.optimise import Optimised, Optimum, Run
from tympan.studies.optimise.problem import MEASURES, Problem

#: A limit is active where its value is so near to it, relative.
ACTIVE = 1e-3


def write(result: Optimised, folder: Path) -> None:
    """Write ``path.csv``, the optimal specimens, and last ``optimum.json``: where it is, the rest is complete."""
    store.remove(folder, "optimum.json", "optimum.png", "optimum.svg", "path.csv", "optimum.toml",
                 *(f"optimum-{held}.toml" for held in MEASURES))
    store.write_csv(folder / "path.csv", _header(result.problem), _rows(result))
    for optimum in result.optima:
        specimen = optimum.best.best.specimen
        assert specimen is not None
        named = replace(specimen, name=f"{result.problem.name} equal {optimum.held}")
        store.write_text(folder / specimen_file(result, optimum), specimen_to_toml(named))
    store.write_json(folder / "optimum.json", record(result))


def specimen_file(result: Optimised, optimum: Optimum) -> str:
    """Name of an optimum's specimen file."""
    return "optimum.toml" if len(result.problem.held) == 1 else f"optimum-{optimum.held}.toml"


def record(result: Optimised) -> dict[str, Any]:
    """All numbers, as a JSON object [SI]."""
    problem = result.problem
    return {
        "name": problem.name, "mass_kg": problem.mass, "voltage_V": problem.voltage,
        "limits": {limit.name: {"bound": limit.bound, "unit": limit.unit}
                   for limit in problem.limits},
        "reference": {"specimen": problem.reference.name, **_design(problem, result.reference)},
        "given": {"specimen": problem.specimen.name, **_design(problem, result.given)},
        "optima": [_optimum(result, optimum) for optimum in result.optima],
        "failed": [{"held": run.held, **_run(problem, run)} for run in result.failed]}


def _optimum(result: Optimised, optimum: Optimum) -> dict[str, Any]:
    problem, best = result.problem, optimum.best
    found = best.descent.multipliers
    assert found is not None
    share = 1 / best.best.stroke
    limits = {}
    for limit in problem.limits:
        rows = [owner == limit.name for owner in best.best.owners]
        assert best.descent.local is not None
        limits[limit.name] = {
            "bound": limit.bound, "unit": limit.unit, "value": best.best.limited[limit.name],
            "finer": _number(optimum.finer.limited.get(limit.name, np.nan)),
            "active": bool((best.descent.local.limits[rows] > -ACTIVE).any()),
            "multiplier": float(found.limits[rows].sum()) * share}
    return {
        "held": optimum.held, "specimen_file": specimen_file(result, optimum),
        "status": best.descent.status, **_design(problem, best.best), "gain": _number(optimum.gain),
        "gain_over_given": _number(optimum.gain_start), "held_multiplier": found.held * share,
        "kkt_residual": found.residual, "limits": limits,
        "at_bounds": [variable.key for variable, force in zip(problem.variables, found.bounds,
                                                              strict=True) if force],
        "finer": {**_design(problem, optimum.finer),
                  "gain": _number(optimum.finer.stroke / result.reference.stroke - 1)},
        "starts": [_run(problem, run) for run in optimum.runs],
        "starts_apart_stroke": optimum.apart,
        "starts_apart_variables": optimum.elsewhere, "warnings": list(optimum.warnings)}


def _run(problem: Problem, run: Run) -> dict[str, Any]:
    found = run.descent.multipliers
    return {"start": run.start + 1, "status": run.descent.status, "trials": run.descent.trials,
            "without_equilibrium": run.descent.missing,
            "kkt_residual": None if found is None else found.residual,
            **_design(problem, run.best)}


def _design(problem: Problem, design: Design) -> dict[str, Any]:
    frame = {} if design.specimen is None else {
        f"frame_{name}": float(measure(design.specimen.frame))
        for name, measure in MEASURES.items()}
    named = {variable.key: float(value) for variable, value in zip(problem.variables, design.values,
                                                                   strict=False)}
    return {"variables": named, "stroke_m": _number(design.stroke),
            "deflection_without_voltage_m": _number(design.rest), **frame,
            "limited": {name: _number(value) for name, value in design.limited.items()},
            "reason": design.reason}


def _header(problem: Problem) -> list[str]:
    variables = [f"{variable.key}_mm" if variable.dimension(problem.specimen) == "length" else variable.key
                 for variable in problem.variables]
    return ["held", "start", "trial", "accepted", *variables, "stroke_mm",
            *(f"{limit.name}_{limit.unit}".removesuffix("_1") for limit in problem.limits),
            "reason"]


def _rows(result: Optimised) -> Iterator[list[object]]:
    problem = result.problem
    for run in (*(run for optimum in result.optima for run in optimum.runs), *result.failed):
        for number, station in enumerate(run.stations):
            design = station.design
            values = [1e3 * float(value) if variable.dimension(problem.specimen) == "length" else float(value)
                      for variable, value in zip(problem.variables, design.values, strict=True)]
            limited = [design.limited.get(limit.name, float("nan")) for limit in problem.limits]
            yield [run.held, run.start + 1, number, int(station.accepted), *values,
                   1e3 * design.stroke, *limited,
                   design.reason]


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None
