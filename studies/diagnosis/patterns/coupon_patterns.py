"""Smooth columns over coupon tests, by which what a law gets wrong is told from noise."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.diagnosis.reduced.coupon_tests import CouponTests

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

#: Degree of the polynomials in the stretch.
_DEGREE = 4


def coupon_patterns(tests: CouponTests, sigma: Array, predicted: Array) -> dict[str, Array]:
    """By name, columns a misfit of all coupons' rows may be a combination of [Pa].

    ``predicted`` is what the nominal model says of each row, ``sigma`` its own error [Pa].
    """
    coupons, reading = tests.coupons, tests.rows
    size = float(np.sqrt(np.mean(predicted**2))) or float(sigma.max())
    stretch = _legendre(coupons.stretch[reading])
    few = stretch[:, :3]
    columns = {"level": stretch[:, :1], "stretch": stretch[:, 1:]}
    modes = coupons.mode[reading]
    present = [mode for mode in MODES if mode in modes]
    for mode in present if len(present) > 1 else ():
        columns[f"mode {mode.replace('_', '-')}"] = _times(modes == mode, few)
    columns["voltage"] = _times(coupons.volts[reading] ** 2, few)
    columns["temperature"] = _times(coupons.degrees[reading], few)
    time = np.nan_to_num(coupons.time[reading])
    if np.ptp(time) > 0:
        columns["time"] = _legendre(np.log(time + np.ptp(time) / 1e3))[:, 1:]
    columns["rate"] = _times(_log_rate(coupons)[reading], few)
    columns["way"] = _times(_way(tests.leg, coupons.stretch[reading]), few)
    columns["runs"] = _runs(tests.leg, coupons.stretch[reading])
    return {f"coupon_{name}": size * values for name, values in columns.items()
            if np.abs(values).max(initial=0.0) > 0}


def _legendre(values: Array) -> Array:
    """Legendre polynomials over the range of values, no more than they tell."""
    span = float(np.ptp(values))
    degree = max(0, min(_DEGREE, len(np.unique(values.round(6))) - 2))
    share = 2 * (values - values.min()) / span - 1 if span > 0 else np.zeros_like(values)
    return np.asarray(legendre.legvander(share, degree if span > 0 else 0), float)


def _times(values: Array | NDArray[np.bool_], columns: Array) -> Array:
    """Columns times a contrast, of mean 0 and spread 1; none where values are alike."""
    contrast = np.asarray(values, float) - np.mean(values)
    spread = float(contrast.std())
    contrast = contrast / spread if spread > 1e-12 else 0 * contrast
    return np.asarray(contrast[:, None] * columns, float)


def _log_rate(coupons: Coupons) -> Array:
    """Logarithm of the mean rate of each reading's run, 0 of runs without times or that rest."""
    rate = np.zeros(len(coupons))
    for run in coupons.timed_runs.values():
        duration = float(np.ptp(coupons.time[run]))
        path = float(np.abs(np.diff(coupons.stretch[run])).sum())
        if duration > 0 and path > 1e-3:
            rate[run] = np.log(path / duration)
    return rate


def _way(run: Numbers, stretch: Array) -> Array:
    """1 on legs that come back to the virgin stretch, else 0."""
    back = np.zeros(len(run))
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        away = np.abs(stretch[rows] - 1)
        back[rows] = away[-1] < away[0]
    return back


def _runs(run: Numbers, stretch: Array) -> Array:
    """A polynomial for each leg of a run that leaves some scatter."""
    columns = []
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        along = stretch[rows]
        place = along if np.ptp(along) > 1e-3 else np.arange(len(rows), dtype=float)
        within = _legendre(place)
        within = within[:, : max(1, len(rows) // 3)]
        part = np.zeros((len(run), within.shape[1]))
        part[rows] = within
        columns.append(part)
    return np.hstack(columns)
