"""Check that runs separate time from stretch: without that no viscous branch can be fitted.

A branch's stress depends on stretch and time. Where every stretch was reached at one time only, as
on one ramp at one rate, some elastic law has the same stress as any branch. Subtract from a
branch's stress the nearest function of stretch, another one in each mode: the rest is what runs
show of time. It comes from the same stretch after other histories (another rate, a hold, the way
back, a reading at rest).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from tympan.base.arrays import AnyArray
from tympan.studies.data.coupon import Coupons
from tympan.studies.estimation.correlation import CorrelatedSpread, independent_count
from tympan.studies.files import words_beside
from tympan.studies.material.relaxation import BranchStress

#: Sentences for the reader, by key.
WORDS = words_beside(__file__)

#: Least share of a branch's stress, root mean square, that no function of stretch may give. Two
#: ramps whose rates differ by a tenth leave that much; readings of one ramp a tenth of it.
LEAST_SHARE = 0.02
#: Number of times of branches tried, over all that the tests can show.
_TIMES = 24
#: Difference below which stretches are equal.
_SAME_STRETCH = 0.005
#: Way back, as a share of a run's range of stretch, below which it is scatter, not a turn.
_SLACK = 0.02
#: Probability that readings of an elastic film are taken for those of a viscous one.
_CHANCE = 1e-3
#: Least number of independent readings, even if residuals are much correlated: branches that
#: explain nine tenths of the rest are then no chance.
_LEAST_COUNT = 6
#: Constants of a branch: its modulus and its time.
_CONSTANTS = 2
#: Scatter of exact readings, as a share of their root mean square: that of their rounding.
_ROUNDING = 1e-6

#: Factor by which another ramp should be faster or slower: a decade shows most branches.
_OTHER_RATE = 10.0
#: Factor by which a hold should be longer than the ramp, for the same reason.
_HOLD = 10.0

#: Change of stretch below which a run is not stretched.
_UNSTRETCHED = 1e-6


@dataclass(frozen=True)
class TimeInRuns:
    """Information of runs on time apart from stretch.

    ``share`` is the largest share of a branch's stress, of any time the tests can show, that no
    function of stretch gives: 0 on one ramp. ``separable``: it is large enough. ``shown``: the
    readings change with it. ``reason`` says why no branch is fitted, "" where they are; ``needed``
    lists runs that would separate them.
    """

    share: float
    separable: bool
    shown: bool
    reason: str = ""
    needed: tuple[str, ...] = ()

    def json(self) -> dict[str, Any]:
        """Write the result as a JSON object."""
        return {"share": self.share, "separable": self.separable, "shown": self.shown,
                "reason": self.reason, "needed": list(self.needed)}


def time_in_runs(coupons: Coupons, stress: BranchStress | None = None) -> TimeInRuns:
    """Judge whether the runs of coupon tests with times separate time from stretch.

    ``stress`` is that of branches in these readings, computed where None.

    Raises
    ------
    InputError
        When times do not ascend within a run.
    """
    stress = stress or BranchStress.of(coupons)
    low, high = stress.bounds
    columns = stress.columns(np.linspace(low, high, _TIMES))
    basis = np.linalg.qr(_places(coupons))[0]
    apart = columns - basis @ (basis.T @ columns)
    lengths = np.linalg.norm(columns, axis=0)
    shares = np.linalg.norm(apart, axis=0) / np.where(lengths > 0, lengths, 1.0)
    share = float(shares.max())
    if share < LEAST_SHARE:
        return TimeInRuns(share, False, False, WORDS["not_separable"].format(
            runs=_described(coupons)), tuple(_needed(coupons)))
    read = coupons.stress - basis @ (basis.T @ coupons.stress)
    if _shown(read, apart[:, shares >= LEAST_SHARE], basis, coupons):
        return TimeInRuns(share, True, True)
    return TimeInRuns(share, True, False, WORDS["not_shown"])


def _places(coupons: Coupons) -> AnyArray:
    """Compute hat functions of stretch in each mode, shape (readings, functions).

    They are as fine as the readings of the finest monotonic piece of a run: a function of stretch
    can follow these one by one.
    """
    columns = []
    for mode in coupons.modes:
        rows = coupons.mode == mode
        knots = _knots(coupons, np.flatnonzero(rows))
        hats = np.zeros((len(coupons), len(knots)))
        hats[rows] = np.stack([np.interp(coupons.stretch[rows], knots, unit)
                               for unit in np.eye(len(knots))], axis=1)
        columns.append(hats)
    return np.hstack(columns)


def _knots(coupons: Coupons, rows: AnyArray) -> AnyArray:
    """Collect stretches of the longest monotonic piece, and beyond its ends of the next longest."""
    timed = np.isfinite(coupons.time)
    pieces = [coupons.stretch[rows[~timed[rows]]]] if not timed[rows].all() else []
    for run in coupons.timed_runs.values():
        if coupons.mode[run[0]] == coupons.mode[rows[0]]:
            pieces += _monotonic(coupons.stretch[run])
    knots = np.empty(0)
    for piece in sorted(map(np.unique, pieces), key=len, reverse=True):
        outside = piece if not len(knots) else piece[
            (piece < knots[0] - _SAME_STRETCH) | (piece > knots[-1] + _SAME_STRETCH)]
        knots = np.sort(np.append(knots, outside))
    return knots


def _monotonic(stretch: AnyArray) -> list[AnyArray]:
    """Divide a run at its turns; scatter is no turn."""
    slack = max(_SLACK * float(np.ptp(stretch)), _SAME_STRETCH)
    pieces, begin, extreme, way = [], 0, 0, 0
    for index in range(1, len(stretch)):
        ahead = stretch[index] - stretch[extreme]
        if way == 0 and abs(ahead) > slack:
            way, extreme = (1 if ahead > 0 else -1), index
        elif way * ahead > 0:
            extreme = index
        elif way and -way * ahead > slack:
            pieces.append(stretch[begin:extreme + 1])
            begin, extreme, way = extreme, index, -way
    return [*pieces, stretch[begin:]]


def _shown(read: AnyArray, branches: AnyArray, basis: AnyArray, coupons: Coupons) -> bool:
    """Check whether branches reduce the rest of the readings by more than chance.

    Branches of all times are fitted together, with moduli not below zero, so that scatter remains.
    """
    lengths = np.linalg.norm(branches, axis=0)
    moduli, remaining = nnls(branches / lengths, read)
    pulling = branches[:, moduli > 0]
    floor = _ROUNDING**2 * float(coupons.stress @ coupons.stress)
    before, after = float(read @ read) + floor, remaining**2 + floor
    if after <= 2 * floor or not pulling.shape[1]:
        return bool(before > 2 * after)
    residual = read - branches @ (moduli / lengths)
    noise = CorrelatedSpread.of(np.column_stack([basis, pulling]), residual,
                               list(coupons.series.values()))
    # Branches of all times count as one or two: their columns are much alike.
    freedom = max(len(read) - basis.shape[1] - _CONSTANTS, 0)
    count = max(independent_count(freedom, noise.correlation), min(freedom, _LEAST_COUNT))
    return bool(count * np.log(before / after) > chi2.ppf(1 - _CHANCE, _CONSTANTS))


def _described(coupons: Coupons) -> str:
    """Describe the number of runs in time and their rates."""
    runs = coupons.timed_runs.values()
    rates = sorted(rate for run in runs if (rate := _rate(coupons, run)) > 0)
    count = f"{len(runs)} run{'s' if len(runs) > 1 else ''}"
    if not rates:
        return count
    span = f"{rates[0]:.2g}/s" if rates[-1] < 1.1 * rates[0] else (
        f"{rates[0]:.2g} to {rates[-1]:.2g}/s")
    return f"{count} at {span}"


def _rate(coupons: Coupons, run: AnyArray) -> float:
    duration = float(np.ptp(coupons.time[run]))
    return float(np.ptp(coupons.stretch[run])) / duration if duration > 0 else 0.0


def _needed(coupons: Coupons) -> list[str]:
    """Propose runs that would separate time from stretch, from the longest ramp there is."""
    ramps: Sequence[AnyArray] = [run for run in coupons.timed_runs.values()
                              if np.ptp(coupons.stretch[run]) > _UNSTRETCHED
                              and np.ptp(coupons.time[run]) > 0]
    if not ramps:
        return [WORDS["any_rate"], WORDS["any_hold"]]
    longest = max(ramps, key=lambda run: float(np.ptp(coupons.time[run])))
    rate, top = _rate(coupons, longest), float(coupons.stretch[longest].max())
    return [WORDS["rate"].format(top=top, slow=rate / _OTHER_RATE, fast=rate * _OTHER_RATE),
            WORDS["hold"].format(top=top, hold=_HOLD * float(np.ptp(coupons.time[longest]))),
            WORDS["back"].format(top=top)]
