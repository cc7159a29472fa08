"""A replica of the paper's figures as stored: ours beside the paper's, and why they differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.studies.files import remove, write_csv, write_json
from tympan.studies.lumped.linear import linearise
from tympan.studies.paper import published
from tympan.studies.paper.published import MASSES, NAMES, ranges
from tympan.studies.replica.figures import INTERVAL, VOLTAGES, ZOOM, Criterion, Replica, criteria
from tympan.studies.replica.findings import findings, sentences
from tympan.studies.replica.missing_parameters import (
    allowed,
    other_fits,
    smallest_worst,
    worst_misfit,
)

Array = NDArray[np.float64]
_READINGS = {"rest": "from 0 to 7 kV at rest", "levels": "at the ends of figure 14's levels"}
_UNITS = {"largest swing": ("%", 100.0), "whole change": ("%", 100.0), "length": ("um", 1e6)}


def store(replica: Replica, seconds: float, folder: Path) -> dict[str, Any]:
    """Write folder/paper.json, the tables and the curves; answers what paper.json holds.

    paper.json comes last, so its presence means the rest is complete.
    """
    remove(folder, "paper.json", "paper.html")
    content = paper_numbers(replica, seconds)
    write_curves(replica, folder)
    for name in ("table_2", "settling"):
        rows = content[name]["rows"]
        write_csv(folder / f"{name}.csv", rows[0], (row.values() for row in rows))
    write_json(folder / "paper.json", content)
    return content


def write_curves(replica: Replica, folder: Path) -> None:
    """The curves as CSV files, from which the figures are drawn."""
    names = [(f"{1e3 * mass:g}", name) for mass in MASSES for name in NAMES]
    shapes, distance = ("mass_g", "specimen"), "distance_mm"
    rests = replica.static.reshape(len(names), -1)
    _write_curves(folder / "static.csv", (*shapes, "voltage_kV", distance), names,
                  [(1e-3 * VOLTAGES, 1e3 * y) for y in rests])
    for stem, traces in (("step", replica.steps), ("random", replica.random)):
        _write_curves(folder / f"{stem}.csv", (*shapes, "t_s", distance), names,
                      [(time, 1e3 * y) for row in traces for time, y in row])
    _write_curves(folder / "hysteresis.csv",
                  ("offset_kV", "amplitude_kV", "specimen", "voltage_kV", distance),
                  [(1e-3 * offset, 1e-3 * amplitude, name)
                   for offset, amplitude in published.SINES for name in NAMES],
                  [(1e-3 * volts, 1e3 * y) for row in replica.loops for volts, y in row])
    _write_curves(folder / "signal.csv", ("t_s", "voltage_kV"), [()],
                  [(replica.signal.time, 1e-3 * replica.signal.voltage)])
    permittivities, alphas = np.linspace(7.0, 10.0, 61), np.linspace(0.0, 1.0, 41)
    _write_curves(folder / "misfit.csv", ("relative_permittivity", "alpha_1", "worst_mm"),
                  [(value,) for value in permittivities.tolist()],
                  [(alphas, 1e3 * row) for row in worst_misfit(permittivities, alphas)])


def _write_curves(file: Path, header: Sequence[str], names: Sequence[tuple[Any, ...]],
                  curves: Sequence[tuple[Array, Array]]) -> None:
    write_csv(file, header, ((*name, x, "" if np.isnan(y) else y)
                             for name, curve in zip(names, curves, strict=True)
                             for x, y in zip(*(axis.tolist() for axis in curve), strict=True)))


def paper_numbers(replica: Replica, seconds: float) -> dict[str, Any]:
    """Everything but the curves."""
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
        "findings": findings(replica),
        "seconds": seconds,
    }


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
    """Largest distance between rising and falling branch of a sine's period over its range.

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
