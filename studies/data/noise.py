"""Noise of a dataset's readings: as stated, from repeats, and from the rounding of a display."""

from __future__ import annotations

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.findings import step_of
from tympan.studies.data.ramps import groups, ramps
from tympan.studies.estimation.noise import Noise

#: Step of a display over the noise from which rounding counts: a finer step adds less than a third
#: of the noise's variance.
_COARSE = 2.0


def repeat_groups(readings: Sheet) -> Numbers:
    """Assign group numbers to readings of equal specimen, mass, voltage, direction and run."""
    return groups(readings.specimen, readings.mass, readings.voltage, readings.direction,
                  readings.run, readings.drive)


def repeat_noise(dataset: Dataset) -> Noise | None:
    """Estimate the standard deviation of a reading [m] from repeats of those without a sigma.

    Repeats are those within a run; without any, those of several runs are used, without the zeros
    of these if they have moved. None where nothing repeats, and where repeats agree to the last
    digit: that is rounding and no measure of noise.
    """
    readings = dataset.static
    if readings is None:
        return None
    plain = np.isnan(readings.sigma) & ~dataset.unused
    scatter = Noise.pooled(readings.displacement[plain], repeat_groups(readings)[plain])
    if scatter is None and dataset.run_zeros is not None and plain.all():
        scatter = dataset.run_zeros.scatter
    rounding = 1e-12 * np.abs(readings.displacement).max()
    return scatter if scatter is not None and scatter.size > rounding else None


def ramp_scatter(dataset: Dataset) -> Noise | None:
    """Estimate the standard deviation of a reading [m] about ramps' curves; at least rounding.

    None where no ramp has more readings than its curve has coefficients.
    """
    readings = dataset.static
    if readings is None:
        return None
    curves = list(ramps(readings, np.flatnonzero(~dataset.unused)))
    freedom = sum(len(curve.rows) - curve.columns.shape[1] for curve in curves)
    if not freedom:
        return None
    squares = sum(float(curve.off @ curve.off) for curve in curves)
    rounding = step_of(readings.displacement) / 12**0.5
    return Noise.of_one(float(np.hypot((squares / freedom) ** 0.5, rounding)), float(freedom))


def coarse_step(dataset: Dataset) -> float:
    """Find the step of the display [m] of static readings, where it exceeds their noise.

    0 where it does not, or their noise is not known.
    """
    noise = _of_one(dataset)
    step = 0.0 if dataset.static is None else step_of(dataset.static.displacement)
    return step if step > _COARSE * noise else 0.0


def stated_ratio(dataset: Dataset) -> Noise | None:
    """Compute the scatter of repeats over the standard deviation stated for them; ideally 1."""
    readings = dataset.static
    if readings is None:
        return None
    sigma = _own_or(readings, dataset.noise or np.nan)
    stated = np.isfinite(sigma) & ~dataset.unused
    values, groups = readings.displacement[stated], repeat_groups(readings)[stated]
    return Noise.pooled(values, groups, sigma[stated])


def stated_noise(dataset: Dataset) -> float | None:
    """Find the standard deviation of a deflection that the files state [m]; None if they do not.

    It is the root mean square where readings have several. That of a range is used as written, or
    computed as that of the difference of two readings.
    """
    noise = dataset.noise or np.nan
    sigmas = [np.empty(0)]
    if dataset.static is not None:
        sigmas.append(_own_or(dataset.static, noise)[~dataset.unused])
    if dataset.ranges is not None:
        sigmas.append(_own_or(dataset.ranges, np.sqrt(2) * noise))
    every = np.concatenate(sigmas)
    known = every[np.isfinite(every)]
    if not len(known):
        return dataset.noise
    return float(known[0] if np.ptp(known) == 0 else np.sqrt(np.mean(known**2)))


def reading_sigma(dataset: Dataset) -> Array:
    """Find each static reading's standard deviation [m]: stated, of repeats, or nan."""
    return np.empty(0) if dataset.static is None else _own_or(dataset.static, _of_one(dataset))


def range_sigma(dataset: Dataset) -> Array:
    """Find each range's standard deviation [m]: its own, or that of a difference of readings."""
    difference = np.sqrt(2) * _of_one(dataset)
    return np.empty(0) if dataset.ranges is None else _own_or(dataset.ranges, difference)


def _of_one(dataset: Dataset) -> float:
    """Find the standard deviation of other readings [m]: the dataset's, of repeats, or nan."""
    if dataset.noise is not None:
        return dataset.noise
    estimated = repeat_noise(dataset)
    return np.nan if estimated is None else estimated.size


def _own_or(readings: Sheet, sigma: float) -> Array:
    return np.where(np.isnan(readings.sigma), sigma, readings.sigma)
