"""Errors of the test bench that several readings share, where the user states their sizes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import (
    Calibration,
    film_error,
    frequency_error,
    slope_error,
)
from tympan.studies.diagnosis.evidence.kind import PreparedReadings, ReadingModel
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import FACTORS
from tympan.studies.diagnosis.reading_table import SLOPES, ReadingTable
from tympan.studies.estimation.noise import Shared

#: Step of the voltages for the slopes, over the largest voltage. Deflections follow its square.
_STEP = 1e-3


def with_bench_errors(readings: PreparedReadings, dataset: Dataset, nominal: Calibration
                      ) -> PreparedReadings:
    """Add the errors of voltages and the spread between films, where a dataset states them.

    Noise that was estimated from the scatter of the readings contains the voltage errors already.
    """
    table, remarks = readings.table, list[str]()
    if dataset.voltage_noise and table.noise.source in ("stated", "assumed"):
        table = with_voltage_errors(table, dataset.voltage_noise, nominal.simulation,
                                    nominal.fit)
        remarks.append(f"each voltage is off by {dataset.voltage_noise:g} V or so, as stated")
    if dataset.film_scatter:
        table = with_film_scatter(table, dataset.film_scatter, nominal.simulation, nominal.fit)
        remarks.append(f"films differ by {dataset.film_scatter:.3g} in stiffness and permittivity, "
                       "as stated")
    return replace(readings, table=table, remarks=(*readings.remarks, *remarks))


def with_voltage_errors(table: ReadingTable, size: float, model: ReadingModel, fit: Fit
                        ) -> ReadingTable:
    """Add independent errors of each state's voltage, of a standard deviation [V].

    Effective variance: a voltage error moves a reading by the slope of the nominal fit times the
    error (Orear, American Journal of Physics 50, 912, 1982). Readings of one state share the error.
    Voltages of runs in time are not changed.
    """
    resting = ~np.isin(np.arange(len(table.states)), table.states.in_time)
    counted = np.isin(np.arange(len(table.states)), table.since[table.since >= 0])
    for states, column in ((resting & ~counted, table.state), (resting & counted, table.since)):
        slopes = _slopes(table, states, model, fit)
        for state in np.flatnonzero(states):
            rows = np.flatnonzero((column == state) & (slopes != 0))
            if len(rows):
                table = _with_common(table, rows, size * slopes[rows, None])
    return table


def with_film_scatter(table: ReadingTable, share: float, model: ReadingModel, fit: Fit
                      ) -> ReadingTable:
    """Add independent relative errors of each film's stiffness and permittivity."""
    factors = model.prediction((), fit.unknowns, table).jacobian[:, FACTORS]
    for specimen in np.unique(table.specimen):
        rows = np.flatnonzero((table.specimen == specimen) & factors.any(axis=1))
        if len(rows):
            table = _with_common(table, rows, share * factors[rows])
    return table


def with_model_error(table: ReadingTable, error: float, nominal: Calibration) -> ReadingTable:
    """Add the errors of the reduced model as noise.

    ``error`` of the lengths [m], the share of the frequencies, and the errors of slopes and of film
    shapes [m].
    """
    share = frequency_error(nominal.simulation, nominal.fit, table)
    errors = np.where(table.lengths, error, np.where(table.kind == "frequency", share, 0.0)
                      * table.value)
    slopes = np.isin(table.kind, SLOPES)
    if slopes.any():
        errors = np.where(slopes, slope_error(nominal.simulation, nominal.fit, table), errors)
    for kind, largest in film_error(nominal.simulation, nominal.fit, table).items():
        errors = np.where(table.kind == kind, largest, errors)
    return table.with_sigma(np.hypot(table.sigma, errors))


def _with_common(table: ReadingTable, rows: Numbers, columns: Array) -> ReadingTable:
    """Add errors that several readings share; a single reading gets more noise instead."""
    if len(rows) > 1:
        return table.with_noise(table.noise.plus(Shared.of(rows, columns)))
    sigma = table.sigma.copy()
    sigma[rows] = np.hypot(sigma[rows], np.linalg.norm(columns))
    return table.with_sigma(sigma)


def _slopes(table: ReadingTable, states: Mask, model: ReadingModel, fit: Fit) -> Array:
    """Compute the change of each reading per volt in some states at a fit; 0 where unknown."""
    step = _STEP * float(table.states.voltage.max(initial=1.0))
    sides = []
    for sign in (-1.0, 1.0):
        voltage = np.abs(table.states.voltage + sign * step * states)
        moved = replace(table, states=replace(table.states, voltage=voltage))
        sides.append(model.prediction((), fit.unknowns, moved).extended)
    return np.nan_to_num((sides[1] - sides[0]) / (2 * step))
