"""Curves of the models between the readings, with the band that readings are expected in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.evidence.kind import Model
from tympan.studies.diagnosis.evidence.registry import TRANSIENTS
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.predictive import Predictive
from tympan.studies.diagnosis.inference.smooth_misfit import Discrepancy
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import LENGTHS, ReadingTable

Array = NDArray[np.float64]

_POINTS = 41


def curves(simulation: Model, judged: Judgement, chosen: Fit | None) -> dict[str, Array | Any]:
    """The columns of curves.csv, from no voltage to the highest one that was read.

    Hypotheses are mixed by their probabilities; the noise is the ramp's usual one. Where nothing
    explains the readings, bands are of what is ``chosen``, else of the nominal model, and count
    what it misses.
    """
    table = dense(judged.table)
    posterior, nominal = judged.posterior, judged.nominal
    fits: Sequence[Fit] = (nominal,)
    weights, beyond = np.ones(1), None
    if judged.verdict == "unexplained":
        fits = (chosen or nominal,)
        beyond = Discrepancy.of(fits[0], judged.table)
    elif posterior is not None:
        fits, weights = posterior.fits, posterior.probabilities
    low, high = Predictive.of(simulation, fits, weights, table, beyond).band(table.sigma)
    names = np.array([specimen.name for specimen in simulation.setup.specimens])
    baseline, extended = (simulation.predict(fit.hypothesis, fit.unknowns, table)
                          for fit in (nominal, chosen or nominal))
    return {"kind": table.kind, "specimen": names[table.specimen], "mass": table.mass,
            "voltage": table.voltage, "direction": table.states.direction[table.state],
            "baseline": baseline, "extended": extended, "low": low, "high": high}


def dense(table: ReadingTable) -> ReadingTable:
    """The lengths' ramps at many voltages, at rest, at the times at which these were passed.

    Ranges are from the smallest voltage of their ramp. The rows' noise is the ramp's median.
    """
    table = table[table.lengths & ~TRANSIENTS.wrote(table.file)]
    if not len(table):
        return table
    table = replace(table, states=table.states.at_rest)
    direction = table.states.direction[table.state]
    keys = [(kind, ramp, way) for kind in LENGTHS for ramp in np.unique(table.ramp)
            for way in np.unique(direction)]
    ramps = [_ramp(table[chosen]) for kind, ramp, way in keys
             if (chosen := (table.kind == kind) & (table.ramp == ramp) & (direction == way)).any()]
    return reduce(ReadingTable.joined, ramps)


def _ramp(ramp: ReadingTable) -> ReadingTable:
    """One ramp of one kind and way at many voltages."""
    first = ramp.states[ramp.state[:1]]
    start = ramp.states.voltage[ramp.since].min() if ramp.since[0] >= 0 else 0.0
    voltage = np.linspace(start, float(ramp.voltage.max()), _POINTS)
    order = np.argsort(ramp.voltage, kind="stable")
    elapsed = np.interp(voltage, ramp.voltage[order], ramp.states.elapsed[ramp.state][order])
    states = replace(first[np.zeros(_POINTS, np.int64)], voltage=voltage, elapsed=elapsed)
    rows = ramp[np.zeros(_POINTS, np.int64)]
    return replace(rows, states=states, state=np.arange(_POINTS),
                   since=np.full(_POINTS, 0 if ramp.since[0] >= 0 else -1),
                   value=np.full(_POINTS, np.nan),
                   noise=rows.noise.with_sigma(np.full(_POINTS, np.median(ramp.sigma))))
