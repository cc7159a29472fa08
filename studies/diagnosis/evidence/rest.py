"""Plates in equilibrium: static.csv and range.csv, with the channels read beside displacements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.checks import clock_runs_back, findings
from tympan.studies.data.dataset import CHANNELS, Dataset
from tympan.studies.data.noise import range_sigma, reading_sigma
from tympan.studies.data.segment_columns import capacitances_of, shares_of
from tympan.studies.diagnosis.evidence.kind import (
    CHANNEL,
    FilmsUnderLoads,
    PlateEvidence,
    Split,
    numbers_of,
)
from tympan.studies.diagnosis.history import staircase
from tympan.studies.diagnosis.reading_table import (
    LENGTHS,
    OF_SEGMENTS,
    SLOPES,
    ReadingTable,
    States,
    rows,
)
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Observable

#: Least noise of a tilt [rad]. No source.
TILT = 1e-4

#: Share of the largest voltage up to which the extended model is fitted before it is tested above.
LOW_VOLTAGES = 0.7


class Rest(PlateEvidence):
    """Displacements of plates in equilibrium, differences of two, and channels read with them.

    Displacements in other files, of plates in time, are predicted here, too.
    """

    files = ("static.csv", "range.csv")
    kinds = (*LENGTHS, *CHANNELS, *OF_SEGMENTS)
    alone = True

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        tables, remarks = list[ReadingTable](), list[str]()
        if dataset.static is not None:
            tables += _static(dataset.static, setup, reading_sigma(dataset), ~dataset.unused)
            remarks += [finding.what for finding in findings(dataset)]
        if dataset.ranges is not None:
            tables.append(_ranges(dataset.ranges, setup, range_sigma(dataset)))
        return tables, remarks

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        table, rig = films.table, films.rig
        at, since = table.state[rows], table.since[rows]
        if kind == "range":
            return np.asarray(rig.reading(deflection[at]) - rig.reading(deflection[since]))
        if kind == "capacitance":
            return films.capacitance(deflection)[at]
        if kind == "tilt":
            return films.tilt(deflection)[at]
        if kind in SLOPES:
            return films.slope(SLOPES.index(kind), deflection)[at]
        if kind in OF_SEGMENTS:
            return self._of_segments(films, OF_SEGMENTS.index(kind), at, deflection)
        if kind == "film_voltage":
            # A probe reads what the supply gives, without the film's lag.
            return np.asarray(rig.film_voltage(table.states.voltage))[at]
        shown = np.array(rig.reading(deflection[at], table.states.elapsed[at]))
        late = since >= 0
        jump = deflection[at[late]] - deflection[since[late]]
        shown[late] -= rig.sensor_slope * films.behind[at[late]] * jump
        return shown

    def _of_segments(self, films: FilmsUnderLoads, number: int, at: Numbers, deflection: Array
                     ) -> Array:
        """Predict the capacitance at the lead of the segment of this number."""
        shown = np.full(len(at), np.nan)
        specimens = films.table.states.specimen[at]
        for specimen in np.unique(specimens).tolist():
            rows = specimens == specimen
            shown[rows] = films.segment_capacitance(specimen, number, deflection)[at[rows]]
        return shown

    def shares(self, films: FilmsUnderLoads, rows: Mask) -> tuple[Array, Array]:
        """Compute the shares of both states' deflections that rows read, with the sensor's gain."""
        table = films.table
        ranges, late = table.kind[rows] == "range", films.behind[table.state[rows]]
        return np.where(ranges, 1.0, 1 - late), np.where(ranges, -1.0, late)

    def splits(self, setup: Setup, table: ReadingTable
               ) -> tuple[list[Split], dict[str, Array]]:
        specimens = setup.specimens
        frames = [(specimen.frame, specimen.plate) for specimen in specimens]
        shape = np.array([frames.index(frame) for frame in frames])[table.specimen]
        # Displacement-controlled plates carry no mass that could be held out.
        mass = np.where(np.isnan(table.states.deflection[table.state]), table.mass, np.nan)
        edge = LOW_VOLTAGES * float(np.abs(table.voltage).max(initial=0.0))
        splits: list[Split] = []
        for number in np.unique(shape):
            names = [specimen.name for specimen, frame in zip(specimens, frames, strict=True)
                     if frame == frames[number]]
            splits.append(("shape", " and ".join(names), shape == number))
        if len(np.unique(shape)) < len(np.unique(table.specimen)):
            splits += [("specimen", specimens[number].name, table.specimen == number)
                       for number in np.unique(table.specimen)]
        splits += [("mass", f"{1e3 * value:.5g} g", mass == value)
                   for value in np.unique(mass[np.isfinite(mass)]).tolist()]
        splits.append(("voltage", f"above {edge / 1e3:.3g} kV", np.abs(table.voltage) > edge))
        levels = {"shape": shape, "specimen": table.specimen, "mass": table.ramp,
                  "voltage": np.abs(table.voltage)}
        return splits, levels

    def observables(self, table: ReadingTable) -> set[Observable]:
        states = table.states
        there = {Observable.ELAPSED: np.ptp(states.elapsed) > 0,
                 Observable.DIRECTION: np.any(states.voltage_direction != 0),
                 Observable.TIME: len(states.in_time),
                 Observable.SLOPE: np.isin(table.kind, SLOPES).any()}
        return {quantity for quantity, told in there.items() if told}


def _static(readings: Sheet, setup: Setup, sigma: Array, used: Mask
            ) -> list[ReadingTable]:
    direction = (readings.direction == "up") * 1.0 - (readings.direction == "down")
    elapsed = np.nan_to_num(readings.elapsed) * (clock_runs_back(readings) is None)
    states = States.of(numbers_of(setup, readings.specimen), readings.mass, readings.voltage,
                       elapsed, direction, np.unique(readings.run, return_inverse=True)[1],
                       shares_of(readings, setup.specimens))
    ordered = np.isfinite(readings.order).all()
    turn = np.argsort(readings.order, kind="stable") if ordered else np.arange(len(readings))
    states = _held(states, readings.dwell, turn)
    origin = readings.order, readings.run, readings.file.name, readings.line
    tables = [rows(states, "displacement", sigma, readings.displacement, *origin)[used]]
    read = {kind: readings[kind] for kind in CHANNELS}
    read |= dict(zip(OF_SEGMENTS, capacitances_of(readings, setup.specimens), strict=False))
    for kind, values in read.items():
        if (seen := np.isfinite(values)).any():
            noise = CHANNEL * float(np.abs(values).max(where=seen, initial=0.0))
            given = np.zeros(len(readings), bool)
            if kind in ("tilt", *SLOPES):
                noise = max(noise, TILT)
                # Sizes without sign; noise about 0 keeps its sign, or it would look like a tilt.
                if kind == "tilt":
                    values = np.where(np.abs(values) > 3 * noise, np.abs(values), values)
                given = np.isfinite(readings.sigma_tilt)
            sigmas = np.where(given, readings.sigma_tilt, noise)
            tables.append(rows(states, kind, sigmas, values, *origin, given=given)[seen])
    if ordered:
        tables = [table.reached(turn) for table in tables]
    return tables


def _held(states: States, dwell: Array, turn: Numbers) -> States:
    """Add the history of their runs to states, where all rows state how long they were held."""
    passages, place = states.passage, np.arange(len(states))
    for run in states[turn].of_run:
        reached = turn[run]
        if np.isfinite(dwell[reached]).all():
            place[reached] = len(passages) + np.arange(len(reached))
            passages = passages.joined(staircase(states.voltage[reached], dwell[reached]))
    return replace(states, passage=passages[place])


def _ranges(ranges: Sheet, setup: Setup, sigma: Array) -> ReadingTable:
    # The difference from the lowest voltage to the highest one.
    specimen = np.array(2 * numbers_of(setup, ranges.specimen))
    mass, voltage = np.tile(ranges.mass, 2), np.r_[ranges.voltage_min, ranges.voltage_max]
    states = States.of(specimen, mass, voltage, run=np.tile(np.arange(len(ranges)), 2))
    states = _held(states, np.tile(ranges.dwell, 2), np.arange(len(states)))
    table = rows(states[len(ranges) + np.arange(len(ranges))], "range", sigma, ranges.range,
                 file=ranges.file.name, line=ranges.line)
    return replace(table, states=states, state=len(ranges) + table.state, since=table.state)
