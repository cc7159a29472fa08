"""Stored result: figures computed again, numbers beside the paper's, and why they differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.paper import published
from tympan.paper.figures import INTERVAL, VOLTAGES, ZOOM, Criterion, Replica, criteria
from tympan.paper.findings import findings, sentences
from tympan.paper.missing_parameters import (
    allowed,
    other_fits,
    smallest_worst,
    worst_misfit,
)
from tympan.paper.published import MASSES, NAMES, ranges
from tympan.studies.alpha import alpha
from tympan.studies.columns import Column, read_own_sheet
from tympan.studies.files import from_json, read_json, remove, to_json, write_csv, write_json
from tympan.studies.lumped.linear import linearise
from tympan.studies.study import default_study

#: Columns of the curves' files: labels of a curve, then its abscissa and ordinate.
CURVES = {
    "static": ("mass_g", "specimen", "voltage_kV", "distance_mm"),
    "step": ("mass_g", "specimen", "t_s", "distance_mm"),
    "random": ("mass_g", "specimen", "t_s", "distance_mm"),
    "hysteresis": ("offset_kV", "amplitude_kV", "specimen", "voltage_kV", "distance_mm"),
    "signal": ("t_s", "voltage_kV"),
    "misfit": ("relative_permittivity", "alpha_1", "worst_mm"),
}
_READINGS = {"rest": "from 0 to 7 kV at rest", "levels": "at the ends of figure 14's levels"}
_UNITS = {"largest swing": ("%", 100.0), "whole change": ("%", 100.0), "length": ("um", 1e6)}


@dataclass(frozen=True, eq=False)
class PaperResult:
    """Content of paper.json, and ``curves`` by file and by the labels in its first columns.

    A curve is an array of abscissa and ordinate, shape (2, points).
    """

    numbers: dict[str, Any]
    curves: Mapping[str, Mapping[tuple[str, ...], Array]]

    @classmethod
    def of(cls, replica: Replica, seconds: float) -> PaperResult:
        """Build numbers and curves of a replica; ``seconds`` is the time it took."""
        curves: dict[str, dict[tuple[str, ...], Array]] = {name: {} for name in CURVES}
        for name, cells, across, up in _curves(replica):
            key = tuple(cell if isinstance(cell, str) else f"{cell:.12g}" for cell in cells)
            curves[name][key] = np.stack((across, up))
        return cls(paper_numbers(replica, seconds), curves)

    def json(self) -> dict[str, Any]:
        """Build the JSON object, without curves."""
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write the tables, the curves and, last, paper.json to a folder."""
        remove(folder, "paper.json", "paper.html")
        for name, curves in self.curves.items():
            write_csv(folder / f"{name}.csv", CURVES[name], (
                (*cells, x, "" if np.isnan(y) else y)
                for cells, curve in curves.items() for x, y in curve.T.tolist()))
        for name in ("table_2", "settling"):
            rows = self.numbers[name]["rows"]
            write_csv(folder / f"{name}.csv", rows[0], (row.values() for row in rows))
        write_json(folder / "paper.json", self.numbers)

    @classmethod
    def load(cls, folder: Path) -> PaperResult:
        """Load a saved result; raise an InputError for missing or damaged parts."""
        file = folder / "paper.json"
        content = from_json(dict[str, Any], read_json(file), file)
        if not {"lost", "chosen", "table_2", "settling", "hysteresis", "findings"} <= set(content):
            raise InputError("cannot be read: something is missing; run tympan lumped paper again",
                             file=file)
        return cls(content, {name: _read_curves(folder / f"{name}.csv", columns)
                             for name, columns in CURVES.items()})


def _read_curves(file: Path, columns: Sequence[str]) -> dict[tuple[str, ...], Array]:
    *labels, across, up = columns
    rows = pd.DataFrame(read_own_sheet(file, [
        *map(Column.labels, labels), Column(across), Column(up, required=False)]))
    parts = rows.groupby(labels, sort=False) if labels else [((), rows)]
    return {key: part[[across, up]].to_numpy().T for key, part in parts}


def _curves(replica: Replica) -> Iterator[tuple[str, tuple[Any, ...], Array, Array]]:
    """Yield all curves: the file, labels, abscissa and ordinate."""
    names = [(f"{1e3 * mass:g}", name) for mass in MASSES for name in NAMES]
    for cells, y in zip(names, replica.static.reshape(len(names), -1), strict=True):
        yield "static", cells, 1e-3 * VOLTAGES, 1e3 * y
    for stem, traces in (("step", replica.steps), ("random", replica.random)):
        for cells, (time, y) in zip(names, chain(*traces), strict=True):
            yield stem, cells, time, 1e3 * y
    sines = [(1e-3 * offset, 1e-3 * amplitude, name)
             for offset, amplitude in published.SINES for name in NAMES]
    for sine, (volts, y) in zip(sines, chain(*replica.loops), strict=True):
        yield "hysteresis", sine, 1e-3 * volts, 1e3 * y
    yield "signal", (), replica.signal.time, 1e-3 * replica.signal.voltage
    permittivities, alphas = np.linspace(7.0, 10.0, 61), np.linspace(0.0, 1.0, 41)
    worst = worst_misfit(permittivities, alphas)
    for value, row in zip(permittivities.tolist(), worst, strict=True):
        yield "misfit", (value,), alphas, 1e3 * row


def paper_numbers(replica: Replica, seconds: float) -> dict[str, Any]:
    """List all numbers of the result, without the curves."""
    gaps = np.array([[loop_gap(y) for _, y in row] for row in replica.loops])
    growth = 100 * (gaps[:, -1] / gaps[:, 0] - 1)
    settled = criteria(replica.decays)
    return {
        "lost": {
            **replica.missing.json(), "reading": replica.reading,
            "readings": {name: fit.json() for name, fit in replica.fits.items()},
            "others": {name: fit.json() for name, fit in other_fits().items()},
            "smallest_worst": smallest_worst().json(), "within_twice": allowed(),
        },
        "chosen": _chosen(replica),
        "table_2": {"rows": _table_2(replica), "why": _why_ranges(replica)},
        "settling": {"rows": [_settling(criterion) for criterion in settled],
                     "why": _why_settling(replica, settled)},
        "hysteresis": {
            "rows": [{"offset_kV": 1e-3 * offset, "amplitude_kV": 1e-3 * amplitude,
                      "specimen": name, "range_um": 1e6 * float(np.ptp(y)),
                      "gap_percent": float(100 * gap)}
                     for (offset, amplitude), row, row_gaps
                     in zip(published.SINES, replica.loops, gaps, strict=True)
                     for name, (_, y), gap in zip(NAMES, row, row_gaps, strict=True)],
            "period_s": replica.period,
            "why": sentences("hysteresis", low=100 * gaps[0, [0, -1]], high=100 * gaps[1, [0, -1]],
                             growth=_ends(growth))},
        "alpha": list(_weights()),
        "findings": findings(replica),
        "seconds": seconds,
    }


def _weights() -> Iterator[dict[str, Any]]:
    """Yield α of the paper's ellipses at its loads, from circles of the film, cones and fields."""
    study = default_study()
    for specimen in study.specimens:
        found = alpha(specimen, study.settings, study.alpha, study.rig)
        if len(found.circles) > 1:
            for basis, weights in (*found.by_basis.items(), ("from_fields", found.from_fields)):
                yield {"specimen": found.specimen, "basis": basis, **to_json(weights)}


def _chosen(replica: Replica) -> list[str]:
    levels, given = replica.signal.voltage, replica.choices
    others = "; ".join(f"{_READINGS[name]}: {fit.permittivity:.3f} and {fit.alpha[0]:.3f}, "
                       f"{fit.rms_mm:.3f} mm left" for name, fit in replica.fits.items())
    period = ", at which the linear model of the circle lags most about 3.5 kV"
    seed = f", the first one that comes within {given.near:g} V of both ends"
    return [
        *sentences("missing", missing=replica.missing, reading=_READINGS[replica.reading],
                   others=others),
        *sentences("step", zoom=ZOOM, interval_ms=1e3 * INTERVAL),
        *sentences("period", period=replica.period, mass_g=1e3 * MASSES[0],
                   why=period if given.period is None else ""),
        *sentences("levels", count=given.levels, seed=replica.seed, switch=published.SWITCH,
                   why=seed if given.seed is None else "",
                   low=levels.min() / 1e3, high=levels.max() / 1e3)]


def _table_2(replica: Replica) -> list[dict[str, Any]]:
    read, ours = ranges(), {"at_rest": replica.rest_ranges, "at_levels": replica.level_ranges,
                            "all_samples": replica.random_ranges}
    return [{
        "mass_g": 1e3 * mass, "specimen": name, "paper_mm": 1e3 * float(read[row, column]),
        **{f"{key}_mm": 1e3 * float(values[row, column]) for key, values in ours.items()},
        **{f"{key}_less_paper_mm": 1e3 * float((values - read)[row, column])
           for key, values in ours.items()},
        "paper_percent": float(published.PERCENTAGES[row, column]),
        **{f"{key}_percent": float(100 * values[row, column] / values[row, 0])
           for key, values in ours.items()},
    } for row, mass in enumerate(MASSES) for column, name in enumerate(NAMES)]


def _settling(criterion: Criterion) -> dict[str, Any]:
    unit, factor = _UNITS[criterion.kind]
    threshold = f"{factor * criterion.threshold:.3g}"
    words = f"{threshold} um" if unit == "um" else f"{threshold} % of the {criterion.kind}"
    cells = {f"{name}_{1e3 * mass:g}g_s": float(criterion.times[row, column])
             for row, mass in enumerate(MASSES) for column, name in enumerate(NAMES)}
    return {"criterion": words, "threshold": factor * criterion.threshold, "unit": unit, **cells,
            "rms_s": criterion.rms}


def loop_gap(deflection: Array) -> float:
    """Compute the largest gap between both branches of a sine's period, over its range.

    The samples begin at phase 0 and are even; the branches meet the same voltage at φ and π − φ.
    """
    count = len(deflection)
    back = (count // 2 - np.arange(count)) % count
    return float(np.abs(deflection - deflection[back]).max() / np.ptp(deflection))


def _why_ranges(replica: Replica) -> list[str]:
    read, spans = ranges(), {}
    for name, ours in (("levels", replica.level_ranges), ("rest", replica.rest_ranges),
                       ("whole", replica.random_ranges)):
        light, heavy = (f"{row.min():+.2f} to {row.max():+.2f} mm" for row in 1e3 * (ours - read))
        spans[name] = f"{light} (17.9 g) and {heavy} (22.45 g)"
    shares = 100 * replica.level_ranges / replica.level_ranges[:, :1] - published.PERCENTAGES
    return sentences("table 2", **spans, light=_ends(shares[0]), heavy=_ends(shares[1]))


def _why_settling(replica: Replica, settled: list[Criterion]) -> list[str]:
    nearest = min(settled, key=lambda criterion: criterion.rms)
    seen = next(criterion for criterion in settled if criterion.kind == "length")
    rates = -np.array([[linearise(actuator, published.STEP[1]).poles[-1].real
                        for actuator in replica.missing.actuators(mass)] for mass in MASSES])
    times, theirs = nearest.times, published.SETTLING
    slow = [NAMES[int(np.argmax(row))] for row in (*times, *theirs)]
    shapes = "the order of the shapes is not the paper's"
    if len(set(slow)) == 1:
        shapes = f"the {slow[0]} is the slowest under both masses here and there"
    return sentences("settling", criterion=_settling(nearest)["criterion"], rms=nearest.rms,
                     off=_ends(times - theirs), seen=_ends(seen.times),
                     longer=int(np.sum(seen.times < theirs)), light=_ends(rates[0]),
                     heavy=_ends(rates[1]), shorter=100 * (1 - float(np.mean(times[1] / times[0]))),
                     change=100 * (float(np.mean(theirs[1] / theirs[0])) - 1), shapes=shapes)


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())
