"""Viscous branches fitted to tests in time, together with the law at rest.

What a branch pulls with at given stretches is its modulus times what its time alone determines. So
stress is linear in the moduli as in a law's linear constants, and the times are found as a law's
shape constants are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.memory import Memory, incompressible
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Material, ViscousBranch
from tympan.studies.data.coupon import Coupons
from tympan.studies.estimation.identifiability import Noise, covariance, profile
from tympan.studies.estimation.least_squares import LeastSquares, minima, seeded_starts
from tympan.studies.material.families import Family, largest_excess

Array = NDArray[Any]

#: Longest step over a branch's time, largest change of a stretch in one, most between two readings.
_LONGEST, _LARGEST, _MOST = 0.1, 0.02, 200

#: Derivatives by the logarithm of a time look so far.
_ASIDE = 1e-4

#: Shortest and longest time of a branch, over the readings' shortest interval and longest run.
_SHORTEST, _SLOWEST = 0.3, 10.0

#: Starts of the search for each shape constant.
_STARTS = 4

#: Stress in a search is in units of so much of the readings; limits are met to such a share.
_FINE, _MET = 1e-8, 1e-3

#: More branches must foretell runs held out better by this factor.
_BETTER = 0.95


@dataclass(frozen=True, eq=False)
class BranchFit:
    """A law at rest with branches fitted to runs in time.

    ``values`` are the law's linear constants [Pa], the branches' moduli [Pa], the law's shape
    constants, and the logarithms of the branches' times [ln s]; ``limits`` their 95 % limits, None
    where the readings set none. ``rmse`` of the residuals and, by run, of readings foretold by a
    fit to the other runs [Pa].
    """

    family: Family
    count: int
    values: Array
    limits: tuple[tuple[float | None, float | None], ...]
    covariance: Array
    noise: Noise
    rmse: float
    held_out: dict[str, float]

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of the values; a branch's time in seconds."""
        numbers = range(1, self.count + 1)
        return (*self.family.linear, *(f"branch_{n}.modulus" for n in numbers), *self.family.shape,
                *(f"branch_{n}.time" for n in numbers))

    @property
    def material(self) -> Material:
        """The law at rest."""
        linear, shape = len(self.family.linear), len(self.family.shape)
        first = self.values[: linear]
        last = self.values[linear + self.count :][:shape]
        return self.family.material(np.concatenate([first, last]))

    @property
    def branches(self) -> tuple[ViscousBranch, ...]:
        """The branches."""
        moduli = self.values[len(self.family.linear) :][: self.count].tolist()
        times = np.exp(self.values[len(self.values) - self.count :]).tolist()
        return tuple(ViscousBranch(*pair) for pair in zip(moduli, times, strict=True))

    @property
    def foretold(self) -> float:
        """Root mean square of what held-out runs are missed by [Pa], every run counting alike."""
        return float(np.sqrt(np.mean(np.square(list(self.held_out.values())))))

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        constants = {}
        for number, (name, value, (low, high)) in enumerate(
                zip(self.constants, self.values.tolist(), self.limits, strict=True)):
            if number >= len(self.values) - self.count:
                value, low, high = (None if x is None else float(np.exp(x))
                                    for x in (value, low, high))
                unit = "s"
            else:
                unit = "Pa" if number < len(self.family.linear) + self.count else "1"
            constants[name] = {"value": value, "low": low, "high": high, "unit": unit}
        return {"name": self.family.name, "branches": self.count, "constants": constants,
                "rmse_Pa": self.rmse, "held_out_rmse_Pa": self.held_out,
                "notes": list(self.notes())}

    def notes(self) -> Iterator[str]:
        """What the readings do not determine."""
        for name, (low, high) in zip(self.constants, self.limits, strict=True):
            sides = " and ".join(side for side, limit in (("lower", low), ("upper", high))
                                 if limit is None)
            if sides:
                yield f"{name} is poorly determined: the readings set no {sides} limit"
        spread = np.sqrt(np.diag(self.covariance))
        for first, second in combinations(range(len(self.values)), 2):
            product = spread[first] * spread[second]
            if np.isfinite(product) and abs(self.covariance[first, second]) > 0.98 * product > 0:
                yield (f"{self.constants[first]} and {self.constants[second]} are poorly "
                       "determined apart")


def fit_branches(coupons: Coupons, family: Family, count: int, noise: float | None = None,
                 hold_out: bool = True) -> BranchFit:
    """A law with so many branches.

    A run is unstretched before its first reading; where that comes after time 0 it was stretched at
    once at 0.

    Parameters
    ----------
    noise
        Standard deviation of one reading [Pa], estimated where None.
    hold_out
        Fit again without each run.

    Raises
    ------
    InputError
        Where a reading has no time, or its time does not ascend within its run.
    """
    runs = _Runs.of(coupons)
    values = _best(family, count, coupons, runs)
    missed = _missed(family, count, coupons, runs, values)
    squares = max(float(missed @ missed), len(coupons) * (1e-13 * _size(coupons)) ** 2)
    sigma = Noise.of(squares, len(coupons) - len(values), noise)
    problem = _problem(family, count, coupons, runs, max(sigma.sigma, 1e-9 * _size(coupons)))
    lines = [profile(problem, values, index, sigma.quantile, _MET) for index in range(len(values))]
    spread = covariance(sigma.sigma * problem.at(values).jacobian, sigma.sigma)
    return BranchFit(
        family, count, values, tuple((line.low, line.high) for line in lines), spread, sigma,
        float((squares / len(coupons)) ** 0.5),
        _held_out(family, count, coupons, runs) if hold_out and len(runs.names) > 1 else {})


def fewest(fits: Sequence[BranchFit]) -> BranchFit:
    """Of one law, fewest branches first: the first that more do not foretell runs better than."""
    chosen = fits[0]
    for fit in fits[1:]:
        if fit.foretold < _BETTER * chosen.foretold and min(
                branch.modulus for branch in fit.branches) > 0:
            chosen = fit
    return chosen


def branch_stress(coupons: Coupons, times: Array) -> Array:
    """Nominal stress of branches over their moduli, of these times [s], (readings, branches)."""
    return _Runs.of(coupons).stress(np.asarray(times, float))


@dataclass(frozen=True, eq=False)
class _Runs:
    """Readings by run: their numbers, times [s] and stretches, shape (readings, runs).

    Shorter runs stand still at their end.
    """

    names: tuple[str, ...]
    length: Array
    reading: NDArray[np.int64]
    time: Array
    first: Array
    second: Array
    _last: dict[bytes, Array] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, coupons: Coupons) -> _Runs:
        names = np.char.add(np.char.add(coupons.specimen.astype(str), " "),
                            coupons.run.astype(str))
        if not np.isfinite(coupons.time).all():
            raise InputError("must be given for every reading: branches are fitted in time",
                             key="t_s")
        l1, l2 = coupons.in_plane
        parts = []
        for name in dict.fromkeys(names.tolist()):
            part = np.flatnonzero(names == name)
            if (np.diff(coupons.time[part]) < 0).any() or coupons.time[part[0]] < 0:
                raise InputError("must not be negative, and ascend within a run", key="t_s",
                                 given=f"run {name.strip()!r}")
            parts.append(part)
        longest = max(map(len, parts))
        reading = np.array([np.append(part, np.full(longest - len(part), part[-1]))
                            for part in parts]).T
        return cls(tuple(name.strip() for name in dict.fromkeys(names.tolist())),
                   np.array([len(part) for part in parts]), reading, coupons.time[reading],
                   l1[reading], l2[reading])

    def stress(self, times: Array) -> Array:
        """As :func:`branch_stress`; the last one asked for is kept, as searches ask twice."""
        key = times.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = self._stress(times)
        return self._last[key]

    def _stress(self, times: Array) -> Array:
        runs, unit = self.time.shape[1], np.ones(4) - np.eye(4)[2]
        memory = Memory(np.ones(len(times)), times,
                        np.broadcast_to(unit[:, None, None], (4, len(times), runs)))
        result = np.zeros((int(self.length.sum()), len(times)))
        time = np.vstack([np.zeros(runs), self.time])
        first, second = (np.vstack([values[:1], values]) for values in (self.first, self.second))
        for row in range(1, len(time)):
            duration = time[row] - time[row - 1]
            change = np.abs(np.log(first[row] / first[row - 1])).max()
            steps = max(ceil(duration.max() / (_LONGEST * times.min())), ceil(change / _LARGEST))
            steps = min(max(steps, 1), _MOST)
            for step in range(steps):
                before, after = (_strain(first, second, row, (step + more) / steps)
                                 for more in (0, 1))
                memory = memory.step(before, duration / steps).after(after)
            c, back = incompressible(_strain(first, second, row, 1.0)), memory.viscous
            pull = (c[0] / back[0] - c[3] / back[3]) / first[row]
            counted = row - 1 < self.length
            result[self.reading[row - 1][counted]] = pull.T[counted]
        return result


def _strain(first: Array, second: Array, row: int, share: float) -> tuple[Array, Array, Array]:
    """C of every run a share of the way from one row to the next."""
    along, across = (values[row - 1] + share * (values[row] - values[row - 1])
                     for values in (first, second))
    return along**2, across**2, np.zeros_like(along)


def _size(coupons: Coupons) -> float:
    return float(np.sqrt(np.mean(coupons.stress**2))) or 1.0


def _parts(family: Family, count: int, values: Array) -> tuple[Array, Array, Array]:
    """Linear constants, the moduli among them; shape constants; times [s]."""
    linear, shape = len(family.linear) + count, len(family.shape)
    return values[:linear], values[linear : linear + shape], np.exp(values[linear + shape :])


def _missed(family: Family, count: int, coupons: Coupons, runs: _Runs, values: Array) -> Array:
    """Predicted minus read stress [Pa]."""
    linear, shape, times = _parts(family, count, values)
    columns = [family.columns(*coupons.in_plane, shape)]
    if count:
        columns.append(runs.stress(times))
    return np.asarray(np.hstack(columns) @ linear - coupons.stress)


def _problem(family: Family, count: int, coupons: Coupons, runs: _Runs, unit: float
             ) -> LeastSquares:
    low, high = _bounds(family, count, coupons, runs)
    laws = len(family.linear)

    def both(values: Array) -> tuple[Array, Array]:
        linear, shape, times = _parts(family, count, values)
        rest = np.concatenate([linear[:laws], shape])
        slopes = family.jacobian(*coupons.in_plane, rest)
        stress = family.columns(*coupons.in_plane, shape) @ linear[:laws]
        columns = [slopes[:, :laws]]
        by_time = np.zeros((len(stress), 0))
        if count:
            aside = np.exp(_ASIDE)
            at, above, below = np.split(
                runs.stress(np.concatenate([times, times * aside, times / aside])), 3, axis=1)
            stress = stress + at @ linear[laws:]
            by_time = (above - below) / (2 * _ASIDE) * linear[laws:]
            columns.append(at)
        jacobian = np.hstack([*columns, slopes[:, laws:], by_time])
        return (stress - coupons.stress) / unit, jacobian / unit

    return LeastSquares.of(both, low, high, tuple(range(laws + count)))


def _bounds(family: Family, count: int, coupons: Coupons, runs: _Runs) -> tuple[Array, Array]:
    linear = np.full(len(family.linear) + count, np.inf)
    least, most = family.bounds(largest_excess(*coupons.in_plane))
    shape = np.ones(len(family.shape))
    fast, slow = _range_of_times(runs)
    low = np.concatenate([-linear, least * shape, np.full(count, np.log(_SHORTEST * fast))])
    high = np.concatenate([linear, most * shape, np.full(count, np.log(_SLOWEST * slow))])
    return low, high


def _range_of_times(runs: _Runs) -> tuple[float, float]:
    """The shortest interval between readings and the longest run [s]."""
    steps = np.diff(runs.time, axis=0)
    return float(steps[steps > 0].min(initial=np.inf)), float(runs.time.max())


def _best(family: Family, count: int, coupons: Coupons, runs: _Runs, starts: int = _STARTS
          ) -> Array:
    fast, slow = _range_of_times(runs)
    shaped = len(family.shape)
    least, most = family.starts(largest_excess(*coupons.in_plane))
    share = seeded_starts(0.0, 1.0, shaped + count, starts * max(1, shaped + count))
    shapes = least + (most - least) * share[:, :shaped]
    # Times in order: branches that change places are the same law.
    times = np.log(fast) + np.log(slow / fast) * np.sort(share[:, shaped:], axis=1)
    begin = np.hstack([np.zeros((len(share), len(family.linear) + count)), shapes, times])
    problem = _problem(family, count, coupons, runs, _FINE * _size(coupons))
    ends = minima(problem, begin)
    moduli = slice(len(family.linear), len(family.linear) + count)
    chosen = next((end for end in ends if (end[moduli] > 0).all()), ends[0])
    order = np.argsort(chosen[len(chosen) - count :])
    chosen = chosen.copy()
    chosen[moduli] = chosen[moduli][order]
    chosen[len(chosen) - count :] = chosen[len(chosen) - count :][order]
    return chosen


def _held_out(family: Family, count: int, coupons: Coupons, runs: _Runs) -> dict[str, float]:
    errors = {}
    for number, name in enumerate(runs.names):
        tested = np.zeros(len(coupons), bool)
        tested[runs.reading[: runs.length[number], number]] = True
        rest = coupons[~tested]
        values = _best(family, count, rest, _Runs.of(rest), 2)
        foretold = coupons[tested]
        missed = _missed(family, count, foretold, _Runs.of(foretold), values)
        errors[name] = float(np.sqrt(np.mean(missed**2)))
    return errors
