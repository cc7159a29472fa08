"""Curves of the models between the readings, with the band in which readings are expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.evidence.registry import TRANSIENTS
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.predictive import Predictive
from tympan.studies.diagnosis.inference.smooth_misfit import Discrepancy
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import (
    LENGTHS,
    OF_SEGMENTS,
    SLOPES,
    UNITS,
    ReadingTable,
)
from tympan.studies.effects import Setup

#: Points of a curve.
_POINTS = 41

#: Kinds of readings other than lengths that have curves.
OTHERS = ("force", "capacitance", "tilt", *SLOPES, *OF_SEGMENTS, "film_voltage")


def curves(simulation: ReadingModel, judged: Judgement, chosen: Fit | None,
           kinds: Sequence[str] = LENGTHS) -> dict[str, Array | Any]:
    """Build the columns of curves.csv, or of channels.csv if the ``kinds`` are not lengths.

    Curves run from zero to the highest voltage read; those of forces over the displacements.
    Hypotheses are mixed by their probabilities; the noise is the ramp's median. Where nothing
    explains the readings, bands are those of the ``chosen`` fit, else of the nominal model, and
    include its misfit.
    """
    table = dense(judged.table, kinds)
    posterior, nominal = judged.posterior, judged.nominal
    fits: Sequence[Fit] = (nominal,)
    weights, beyond = np.ones(1), None
    if judged.verdict == "unexplained":
        fits = (chosen or nominal,)
        # The misfit is known for lengths alone.
        beyond = Discrepancy.of(fits[0], judged.table) if kinds is LENGTHS else None
    elif posterior is not None:
        fits, weights = posterior.fits, posterior.probabilities
    noise = table.sigma if beyond or judged.verdict != "unexplained" else table.sigma * np.array(
        [_missed(fits[0], judged.table, kind) for kind in table.kind.tolist()])
    low, high = Predictive.of(simulation, fits, weights, table, beyond).band(noise)
    baseline, extended = (simulation.predict(fit.hypothesis, fit.unknowns, table)
                          for fit in (nominal, chosen or nominal))
    columns = {"kind": table.kind, "specimen": driven_names(simulation.setup, table),
               "mass": table.mass,
               "voltage": table.voltage, "direction": table.states.direction[table.state],
               "baseline": baseline, "extended": extended, "low": low, "high": high}
    if kinds is LENGTHS:
        return columns
    units = [UNITS[kind] for kind in table.kind.tolist()]
    per_si = np.array([unit.per_si for unit in units])
    return columns | {"displacement": table.states.deflection[table.state],
                      "unit": np.array([unit.name for unit in units], str)} | {
        name: per_si * columns[name] for name in ("baseline", "extended", "low", "high")}


def driven_names(setup: Setup, table: ReadingTable) -> NDArray[np.str_]:
    """Name the specimen of each row, with the voltages of its segments over the highest one."""
    names, states = [], table.states
    given = np.asarray(np.isfinite(states.shares).any(axis=1))
    for specimen in setup.specimens:
        shares = states.shares_of(specimen.electrode)
        names.append([", ".join([specimen.name, *(
            name if share == 1 else f"{share:.4g} {name}" for name, share in zip(
                specimen.electrode.names, row, strict=True) if share and driven)])
            for row, driven in zip(shares.tolist(), given.tolist(), strict=True)])
    every = np.array(names)
    return np.asarray(every[states.specimen[table.state], table.state])


def _missed(fit: Fit, table: ReadingTable, kind: str) -> float:
    """Compute the root mean square misfit of a kind of readings over their noise; at least 1."""
    rows = table.rows_of[kind]
    missed = (table.value - fit.predicted(table))[rows] / table.sigma[rows]
    return max(1.0, float(np.sqrt(np.mean(missed**2))))


def dense(table: ReadingTable, kinds: Sequence[str] = LENGTHS) -> ReadingTable:
    """Build ramps of some kinds of static readings at many voltages or displacements.

    Times are those at which the ramp passed these. Ranges are counted from the smallest voltage of
    their ramp. The rows' noise is the ramp's median.
    """
    table = table[np.isin(table.kind, kinds) & ~TRANSIENTS.wrote(table.file)]
    if not len(table):
        return table
    table = replace(table, states=table.states.at_rest)
    direction, held = table.states.direction[table.state], np.isfinite(
        table.states.deflection[table.state])
    # Held plates move out and back at one voltage; free ones up and down under one mass.
    ramp = np.where(held, 0, 1 + table.ramp)
    kept = np.where(held, table.voltage, 0.0)
    keys = list(dict.fromkeys(zip(table.kind.tolist(), table.specimen.tolist(), ramp.tolist(),
                                  kept.tolist(), direction.tolist(), strict=True)))
    order = {kind: number for number, kind in enumerate(kinds)}
    ramps = []
    for kind, specimen, number, voltage, way in sorted(
            keys, key=lambda key: (order[key[0]], *key[1:])):
        chosen = ((table.kind == kind) & (table.specimen == specimen) & (ramp == number)
                  & (kept == voltage) & (direction == way))
        ramps.append(_ramp(table[chosen], bool(held[chosen][0])))
    return reduce(ReadingTable.joined, ramps)


def _ramp(ramp: ReadingTable, held: bool) -> ReadingTable:
    """Build one ramp of one kind and way at many voltages, or displacements of a held plate."""
    first = ramp.states[ramp.state[:1]]
    states = replace(first[np.zeros(_POINTS, np.int64)])
    if held:
        deflection = ramp.states.deflection[ramp.state]
        path = np.linspace(deflection.min(), deflection.max(), _POINTS)
        states = replace(states, deflection=path)
    else:
        start = ramp.states.voltage[ramp.since].min() if ramp.since[0] >= 0 else 0.0
        voltage = np.linspace(start, float(ramp.voltage.max()), _POINTS)
        order = np.argsort(ramp.voltage, kind="stable")
        elapsed = np.interp(voltage, ramp.voltage[order], ramp.states.elapsed[ramp.state][order])
        states = replace(states, voltage=voltage, elapsed=elapsed)
    rows = ramp[np.zeros(_POINTS, np.int64)]
    return replace(rows, states=states, state=np.arange(_POINTS),
                   since=np.full(_POINTS, 0 if ramp.since[0] >= 0 else -1),
                   value=np.full(_POINTS, np.nan),
                   noise=rows.noise.with_own(np.full(_POINTS, np.median(ramp.sigma))))
