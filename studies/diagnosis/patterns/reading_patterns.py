"""Smooth columns of readings by voltage, mass, specimen and time, and jumps: parts not noise."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.polynomial import legendre

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.diagnosis.reading_table import ReadingTable


@dataclass(frozen=True)
class PatternWords:
    """Words for a misfit of a pattern: what is wrong, and what to check."""

    what: str
    check: str = ""
    check_all: str = ""


#: Words by the name of a pattern, or the first word of it.
PATTERNS = {name: PatternWords(**words) for name, words in tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")).items()}

#: Patterns of jumps: a misfit is one of their columns, not a combination of them. For a channel,
#: single readings are jumps too when its noise is estimated.
JUMPS = ("step", "stick", "single")

#: Patterns in which each run deviates in its own way; they explain a little of any misfit.
EACH_RUN = ("ramps", "coupon_runs")

#: Degree of polynomials in the voltage's square.
_DEGREE = 4

#: Most steps that are tried, evenly over the readings. It limits the cost.
_STEPS = 100
#: Thresholds below which a plate may stick, as shares of the largest prediction: dense enough that
#: one of them is near any real threshold.
_THRESHOLDS = np.geomspace(0.003, 0.3, 64)


def words_of(name: str) -> str:
    """Describe a misfit of a pattern in words."""
    kind = name.split()[0]
    return PATTERNS.get(name, PATTERNS[kind]).what.format(*name.split(" ", 1))


def check_of_pattern(name: str) -> str:
    """Advise what to check on the test bench where a misfit has a pattern; "" for no advice."""
    kind, _, rest = name.partition(" ")
    return PATTERNS[kind].check.format(name=rest) if kind in PATTERNS else ""


def patterns(table: ReadingTable, names: Sequence[str], predicted: Array) -> dict[str, Array]:
    """Build columns by name that a misfit may combine, in units of the readings.

    ``names``: those of the specimens; ``predicted``: readings of the nominal model. Columns of
    lengths come first, then those of every other channel.
    """
    lengths, columns = table.lengths, dict[str, Array]()
    if lengths.any():
        columns = {name: among(lengths, values) for name, values in _patterns_of_lengths(
            table[lengths], names, predicted[lengths]).items()}
    for kind, rows in table.rows_of.items():
        if not lengths[rows[0]]:
            channel, typical = table[rows], float(np.sqrt(np.mean(predicted[rows] ** 2)))
            size = np.full(len(rows), typical or float(channel.sigma.max()))
            voltage = smooth(channel.voltage**2)
            columns[f"channel {kind}"] = among(table.kind == kind, np.hstack(
                [size[:, None] * voltage, _ramps(channel, size, voltage)]))
    return columns


def among(rows: Mask, columns: Array) -> Array:
    """Place columns of some rows among all rows; zero elsewhere."""
    every = np.zeros((len(rows), columns.shape[1]))
    every[rows] = columns
    return every


def _patterns_of_lengths(table: ReadingTable, names: Sequence[str],
                         predicted: Array) -> dict[str, Array]:
    size = np.full(len(table), float(np.sqrt(np.mean(predicted**2))))
    voltage, numbers = smooth(table.voltage**2), np.unique(table.specimen)
    few = voltage[:, :3]
    columns = {"level": size[:, None] * voltage[:, :1], "voltage": size[:, None] * voltage[:, 1:]}
    for number in numbers if len(numbers) > 1 else ():
        contrast = _standard((table.specimen == number).astype(float))
        columns[f"specimen {names[number]}"] = (size * contrast)[:, None] * few
    columns["mass"] = (size * _standard(table.mass))[:, None] * few
    elapsed = np.nan_to_num(table.states.elapsed[table.state])
    for name, values in (("order", np.nan_to_num(table.order)), ("time", elapsed)):
        if np.ptp(values) > 0:
            line = _standard(values)
            columns[name] = size[:, None] * np.stack([line, line**2 - 1], 1)
    direction = table.states.direction[table.state]
    if np.ptp(direction) > 0:
        columns["direction"] = (size * direction)[:, None] * few
    columns["fitted value"] = np.stack([predicted, predicted * abs(predicted) / size.max()], 1)
    columns["ramps"] = np.concatenate([*columns.values(), _ramps(table, size, voltage)], axis=1)
    columns |= _jumps(table, size, predicted)
    return {name: values for name, values in columns.items()
            if np.abs(values).max(initial=0.0) > 0}


def over(columns: dict[str, Array], table: ReadingTable) -> dict[str, Array]:
    """Divide patterns' columns by the noise of a table."""
    return {name: table.noise.whitened(values) for name, values in columns.items()}


def smooth(squared: Array) -> Array:
    """Evaluate polynomials in a squared or unsigned variable, no more than its values support."""
    share = 2 * squared / max(float(squared.max(initial=0.0)), 1.0) - 1
    degree = max(0, min(_DEGREE, len(np.unique(squared)) - 2))
    return np.asarray(legendre.legvander(share, degree), float)


def _standard(values: Array) -> Array:
    spread = float(values.std())
    if spread <= 1e-12 * float(np.abs(values).max()):
        return 0 * values
    return np.asarray((values - values.mean()) / spread)


def _ramps(table: ReadingTable, size: Array, voltage: Array) -> Array:
    """Build a polynomial for each specimen under each mass that leaves some scatter."""
    columns = [((table.ramp == number).astype(float) * size)[:, None]
               * voltage[:, : min(voltage.shape[1], max(1, rows // 2))]
               for number, rows in enumerate(np.bincount(table.ramp).tolist())]
    return np.concatenate(columns, axis=1)


def _jumps(table: ReadingTable, size: Array, predicted: Array) -> dict[str, Array]:
    """Build shifts from a reading on, and lags of plates that stick up to a threshold."""
    read = np.flatnonzero(table.kind == "displacement")
    order = table.order[read]
    ordered = len(np.unique(order[np.isfinite(order)])) == len(read)
    turn = read[np.argsort(order if ordered else table.line[read], kind="stable")]
    first = np.unique(np.linspace(1, max(len(read) - 1, 1), _STEPS).round().astype(int))
    steps = np.zeros((len(table), len(first)))
    steps[turn] = size[turn, None] * (np.arange(len(read))[:, None] >= first)
    runs = [rows[np.argsort(table.state[rows])] for run in table.states.of_run
            if len(rows := read[np.isin(table.state[read], run)])]
    some = [runs, *([rows for rows in runs if table.specimen[rows[0]] == number]
                    for number in np.unique(table.specimen[read]))]
    thresholds = _THRESHOLDS * np.abs(predicted[read]).max(initial=0.0)
    sticks = [_stuck(predicted, rubbing, threshold) for rubbing in some for threshold in thresholds]
    return {"step": steps, "stick": np.unique(sticks, axis=0).T}


def _stuck(predicted: Array, runs: Sequence[Numbers], threshold: float) -> Array:
    """Compute the lag of plates that stay in place up to a threshold, then go all the way."""
    behind = np.zeros(len(predicted))
    for rows in runs:
        at = predicted[rows[0]]
        for row in rows[1:].tolist():
            at = predicted[row] if abs(predicted[row] - at) >= threshold else at
            behind[row] = at - predicted[row]
    return behind
