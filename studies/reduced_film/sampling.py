"""Motions in steps as samples: values at even or later times, the last period of a loop."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tympan.fem.transient.dense_output import spline
from tympan.studies.signals import Signal, nominal

Array = NDArray[np.float64]

#: A loop that drifts by less than this share of its range counts as closed: less cannot be seen in
#: a figure.
_CLOSED = 0.01
#: Points of a loop, enough for a smooth line.
_POINTS = 401

#: Points of Gauss's rule between two times of a motion: exact where the voltage is straight, to
#: 1e-9 where a step is a quarter of a sine.
_GAUSS = 6

#: What is added to the squares of least squares: where voltages hardly differ these say nothing,
#: and a guess stays near the last value.
_ALIKE = 1e-10
#: The square of a voltage that is none [V²], so that nothing is divided by 0.
_NO_VOLTAGE = 1e-12


def in_time(time: Array, values: Array, when: Array) -> Array:
    """Values at some times [s] of those at others, where a time that stands twice is a jump.

    Along the first axis, by cubic splines between the jumps; at a jump what comes after it. Nan
    beyond the last.
    """
    result = np.full((len(when), *values.shape[1:]), np.nan)
    parts = _between_jumps(time)
    starts = time[[part.start for part in parts]]
    of = np.where(when <= time[-1], np.searchsorted(starts, when, "right") - 1, -1)
    order = np.argsort(of, kind="stable")
    ends = np.searchsorted(of[order], np.arange(len(parts) + 1))
    for number in np.flatnonzero(np.diff(ends)).tolist():
        within = order[ends[number]:ends[number + 1]]
        part = parts[number]
        result[within] = spline(time[part], values[part])(when[within])
    return result


def rates(time: Array, values: Array) -> Array:
    """How fast values change at their times, by the splines of :func:`in_time` [1/s].

    At a jump before and after it; the jump itself has no rate.
    """
    return np.concatenate([spline(time[part], values[part])(time[part], 1)
                           for part in _between_jumps(time)])


def extremes(time: Array, values: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """When [s] values are smallest and how small, when largest and how large, between times too.

    By the splines of :func:`in_time`, of values of shape (times,); the first time of several.
    """
    when, what = [time], [values]
    for part in _between_jumps(time):
        curve = spline(time[part], values[part])
        turns = curve.derivative().roots(extrapolate=False)
        # Where it is constant any time is a root, which is told by one that is no number.
        turns = turns[np.isfinite(turns)]
        when.append(turns)
        what.append(curve(turns))
    times, heights = np.concatenate(when), np.concatenate(what)
    low, high = (int(np.lexsort((times, sign * heights))[0]) for sign in (1, -1))
    return (float(times[low]), float(heights[low])), (float(times[high]), float(heights[high]))


def _between_jumps(time: Array) -> list[slice]:
    """Of ascending times, one that stands twice being a jump."""
    starts = (np.flatnonzero(np.diff(time) == 0) + 1).tolist()
    return [slice(*ends) for ends in zip([0, *starts], [*starts, len(time)], strict=True)]


def last_loop(name: str, signal: Signal, period: float, time: Array, deflection: Array
              ) -> tuple[pd.DataFrame, float, list[str]]:
    """The last period [s] of a motion, ∮ y du [V m], and a warning where it does not close.

    The area is positive where the deflection lags behind.
    """
    when = np.linspace(time[-1] - period, time[-1], _POINTS)
    u, y = nominal(signal, when), in_time(time, deflection, when)
    warnings = []
    if abs(y[-1] - y[0]) > _CLOSED * np.ptp(y):
        warnings.append(f"the last period ends {1e6 * (y[-1] - y[0]):+.3g} um from where it "
                        "began: the film still creeps; more periods (--count) close the loop")
    area = _enclosed(signal, float(when[0]), time, deflection) - float(u[-1] * y[-1] - u[0] * y[0])
    return pd.DataFrame({"specimen": name, "voltage": u, "deflection": y}), area, warnings


def _enclosed(signal: Signal, begin: float, time: Array, deflection: Array) -> float:
    """∫ u dy [V m] from a time [s] on, by the motion's own splines; at jumps of mean voltage."""
    nodes, weights = np.polynomial.legendre.leggauss(_GAUSS)
    parts, total = _between_jumps(time), 0.0
    for part, following in zip(parts, [*parts[1:], None], strict=True):
        times = np.unique(np.maximum(time[part], begin))
        if len(times) > 1:
            half = np.diff(times)[:, None] / 2
            at = times[:-1, None] + half + half * nodes
            rates = spline(time[part], deflection[part])(at, 1)
            total += float((half * weights * nominal(signal, at) * rates).sum())
        if following is not None and time[following.start] > begin:
            jump = deflection[following.start] - deflection[part.stop - 1]
            piece = int(np.searchsorted(signal.breaks, time[following.start])) - 1
            ends = [signal.within(number, time[following.start]) for number in (piece, piece + 1)]
            total += float(jump * np.mean(ends))
    return total


def by_voltages(time: Array, squared: Array, values: Array, later: Array, ahead: Array) -> Array:
    """Values at later times from the last one on, by how they went with U², U⁴ and time.

    ``squared``: U² [V²] at the times, shape (..., times), and ``ahead`` at the later ones; values
    have the shape (..., times, n), times no unit. By least squares.
    """
    largest = max(squared.max(), ahead.max(), _NO_VOLTAGE)
    terms, last = _terms(time, squared / largest), values[..., -1:, :]
    change = terms - terms[..., -1:, :]
    following = _terms(later, ahead / largest) - terms[..., -1:, :]
    turned = change.swapaxes(-1, -2)
    shares = np.linalg.solve(turned @ change + _ALIKE * np.eye(3), turned @ (values - last))
    return np.asarray(last + following @ shares)


def _terms(time: Array, squared: Array) -> Array:
    """What values are taken to be a sum of, shape (..., times, 3)."""
    terms = np.empty((*squared.shape, 3))
    terms[..., 0], terms[..., 1], terms[..., 2] = time, squared, squared * squared
    return terms
