"""Stress of viscous branches in coupon tests, by their time: integrated once, then tabulated.

The stretches of a test are known (in a creep test they are the readings), so the stress of a branch
is its modulus times a function of its time alone. This function is computed here for times on a
logarithmic grid, all tests and all times in one march. It is smooth, so that a fit gets any time,
with its derivative, from a spline.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from tympan.base.arrays import AnyArray
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.memory import Memory
from tympan.geometry.specimen import Film, ViscousBranch
from tympan.studies.data.coupon import MODES, Coupons

#: Duration [s] and final stretch of every step; the step that ends at every reading.
March = tuple[AnyArray, AnyArray, AnyArray]

#: Number of times per factor e of the grid on which branches are tabulated. Set by trial.
_DENSITY = 5.0
#: Degree of the spline between times of the grid: it follows smooth functions with few times.
_DEGREE = 5

#: Shortest time of a branch, over the shortest interval between readings that strain the film. A
#: shorter one has relaxed at all of them.
_SHORTEST = 0.3
#: Longest time of a branch, over the longest test. A longer one is a part of the law.
_SLOWEST = 3.0

#: Least shortest time over the longest, even if readings almost coincide.
_SPAN = 1e-9

#: Largest change of a stretch's logarithm in a step of the integration. Set by trial.
_LARGEST = 0.05
#: Largest error of a step's end over the size of the stress before extrapolation, which leaves only
#: its square.
_EXACT = 5e-5
#: Most halvings of the steps, to bound the cost.
_HALVINGS = 6

#: Factor by which the rate of stretching must change for steps to begin small.
_TURN = 1.5


@dataclass(frozen=True, eq=False)
class BranchStress:
    """Nominal stress of branches of unit modulus in the readings of coupons.

    ``spline`` maps the logarithm of a time [s] to readings, shape (readings,); it is 0 in readings
    without time, which are taken at rest. ``error`` is that of the integration, over the largest
    stress.
    """

    spline: BSpline
    error: float

    @classmethod
    def of(cls, coupons: Coupons, shortest: float | None = None, longest: float | None = None
           ) -> BranchStress:
        """Tabulate branches of times [s], by default all that the tests can show."""
        fast, slow = time_range(coupons)
        low, high = np.log(shortest or fast), np.log(longest or slow)
        count = max(int(_DENSITY * (high - low)) + 2, _DEGREE + 2)
        grid = np.linspace(low, high, count)
        stress, error = integrate_branches(coupons, np.exp(grid))
        return cls(make_interp_spline(grid, stress.T, _DEGREE), error)

    @property
    def bounds(self) -> tuple[float, float]:
        """Logarithms of the shortest and the longest time."""
        return float(self.spline.t[0]), float(self.spline.t[-1])

    @cached_property
    def _slope(self) -> BSpline:
        return self.spline.derivative()

    def columns(self, log_times: AnyArray) -> AnyArray:
        """Interpolate stress over modulus at logarithms of times, shape (readings, branches)."""
        return np.asarray(self.spline(log_times)).T

    def slopes(self, log_times: AnyArray) -> AnyArray:
        """Differentiate the columns by the logarithms, shape (readings, branches)."""
        return np.asarray(self._slope(log_times)).T


def time_range(coupons: Coupons) -> tuple[float, float]:
    """Find shortest and longest time of a branch that tests can show [s]."""
    intervals, ends = [], []
    for part in coupons.timed_runs.values():
        time = np.append(0.0, coupons.time[part])
        steps = np.diff(time)
        intervals.append(steps[steps > 0].min(initial=np.inf))
        ends.append(time[-1])
    fast, slow = _SHORTEST * float(min(intervals)), _SLOWEST * float(max(ends))
    return max(fast, _SPAN * slow), slow


def integrate_branches(coupons: Coupons, times: AnyArray) -> tuple[AnyArray, float]:
    """Integrate stress over modulus of branches of times [s], (readings, times), and its error.

    A test's film is unstretched before its time 0, stretched at once there to its first reading,
    and evenly between readings. Steps are of second order and extrapolated by halving them, which
    is repeated until little changes; the error, over the largest stress, is that before
    extrapolation.
    """
    runs = list(coupons.timed_runs.values())
    coarse = _marched(coupons, runs, times, 1)
    for halving in range(1, _HALVINGS + 1):
        fine = _marched(coupons, runs, times, 2**halving)
        largest = max(np.abs(fine).max(), 1e-300)
        error = float(np.abs(fine - coarse).max() / largest) / 3
        result, coarse = fine + (fine - coarse) / 3, fine
        if error < _EXACT:
            break
    return result, error


def _marched(coupons: Coupons, runs: list[AnyArray], times: AnyArray, fineness: int) -> AnyArray:
    """Integrate stresses with steps divided by ``fineness``, all tests together."""
    marches = [_march(coupons, run, float(times.min()), fineness) for run in runs]
    durations, along = (np.stack(padded, axis=1) for padded in _side_by_side(marches))
    powers = np.array([MODES[str(coupons.mode[run[0]])] for run in runs])
    across = along**powers
    one, none = np.ones(len(runs)), np.zeros(len(runs))
    memory = Memory.relaxed(_unit_film(times), (one, one, none))
    pull = np.empty((len(along), len(times), len(runs)))
    before = _strain(one, one)
    for row, duration in enumerate(durations):
        now = _strain(along[row], across[row])
        memory = memory.step(before, duration).after(now)
        before = now
        thickness = along[row] ** 3 * across[row] ** 2 * memory.viscous[3]
        pull[row] = along[row] / memory.viscous[0] - 1 / thickness
    result = np.zeros((len(coupons), len(times)))
    for number, (run, (_, _, ends)) in enumerate(zip(runs, marches, strict=True)):
        result[run] = pull[ends, :, number]
    return result


def _side_by_side(marches: list[March]) -> tuple[list[AnyArray], list[AnyArray]]:
    """Pad durations and stretches to equal lengths: a test that is over stays as it is."""
    length = max(len(durations) for durations, *_ in marches)
    return ([np.pad(durations, (0, length - len(durations))) for durations, *_ in marches],
            [np.pad(along, (0, length - len(along)), "edge") for _, along, _ in marches])


def _march(coupons: Coupons, run: AnyArray, shortest: float, fineness: int) -> March:
    """Divide a test into steps: their durations [s], final stretches, and which end at readings.

    The first one is the sudden stretch at time 0.
    """
    time, stretch = np.append(0.0, coupons.time[run]), coupons.stretch[run]
    stretch = np.append(stretch[0], stretch)
    durations, along, ends = [np.zeros(1)], [stretch[:1]], []
    rate, last = np.inf, 0
    for duration, begin, end in zip(np.diff(time), stretch, stretch[1:], strict=False):
        turned, rate = rate, (end - begin) / duration if duration > 0 else np.inf
        shares = _shares(np.log(end / begin), duration / shortest if _turns(turned, rate) else 0.0,
                         fineness)
        durations.append(np.diff(shares) * duration)
        along.append(begin + shares[1:] * (end - begin))
        last += len(shares) - 1
        ends.append(last)
    return np.concatenate(durations), np.concatenate(along), np.array(ends)


def _turns(before: float, after: float) -> bool:
    """Check whether the rate of stretching changes much."""
    small, large = sorted((abs(before), abs(after)))
    return (before < 0) != (after < 0) or large > _TURN * small


def _shares(change: float, slowness: float, fineness: int) -> AnyArray:
    """Compute the shares of an interval at which its steps end, from 0 to 1.

    After a change of rate, steps double from the shortest time of a branch on.
    """
    halvings = int(np.ceil(np.log2(max(slowness, 1.0))))
    ends = np.append(0.0, 2.0 ** -np.arange(halvings, -1, -1))
    parts = fineness * max(1, int(np.ceil(abs(change) / _LARGEST)))
    lengths = np.diff(ends)[:, None]
    within = ends[:-1, None] + lengths * np.arange(parts) / parts
    return np.append(within, 1.0)


def _unit_film(times: AnyArray) -> Film:
    """Make an unstretched film with branches of unit modulus."""
    branches = tuple(ViscousBranch(1.0, time) for time in times.tolist())
    return Film(1e-3, (1.0, 1.0), NeoHooke(1.0), 1.0, branches=branches)


def _strain(along: AnyArray, across: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    return along**2, across**2, np.zeros_like(along)
