"""Laws with viscous branches fitted to coupon tests in time.

Stress is linear in the moduli of branches, as in a law's linear constants. The times are found as a
law's shape constants are, from the best of all choices on a grid. The number of branches is chosen
by runs held out: all of one stretch level, or all of one rate, never single readings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from math import comb
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.geometry.specimen import ViscousBranch
from tympan.studies.data.coupon import Coupons
from tympan.studies.estimation.correlation import CorrelatedSpread, akaike, independent_count
from tympan.studies.estimation.least_squares import LeastSquares, minima, seeded_starts
from tympan.studies.estimation.profile import profile
from tympan.studies.material.families import FAMILIES, LawFamily, largest_excess
from tympan.studies.material.fit import (
    NOTES,
    LawFit,
    ParameterLimits,
    far_off,
    judged,
    named_family,
    open_constants,
    useless_constant,
    with_simpler,
)
from tympan.studies.material.relaxation import BranchStress
from tympan.studies.material.time_in_runs import time_in_runs

#: Most branches tried.
MOST_BRANCHES = 4

#: Number of times per factor e of the grid on which a search begins. Branches closer in time can
#: hardly be distinguished.
_COARSE = 1.2
#: Number of the grid's best choices from which fits begin if the law has no shape constants. Set by
#: trial.
_BEST = 3

#: Searches per shape constant of a law, on all readings. Set by trial.
_STARTS = 10
#: The same without held-out runs: those are many fits, and none of them is the result.
_FEWER = 6

#: Factor within which stretch levels (over 1) and loads are equal: testers do not repeat them more
#: accurately.
_SAME_LEVEL = 1.15
#: Factor within which rates are equal. Testers repeat them less accurately than levels.
_SAME_RATE = 1.25

#: Relative variation within which a stress, or a stretch over its level, is constant.
_STEADY = 0.02
#: Excess of the stretch over 1 below which a run is not stretched.
_UNSTRETCHED = 1e-6
#: Unit of stress in a search, as a share of the readings.
_FINE = 1e-6

#: Distance of the logarithm of a time from a bound within which it is at it: searches end before.
_AT_BOUND = 1e-3
#: Distance between the logarithms of two times within which readings cannot distinguish them.
_SAME_TIME = 0.05

#: Stiffness of branches at the end of the longest test, over that at rest, that deserves a note.
_CARRIED = 0.05
#: Excess of the stretch over 1 at which stiffness is compared.
_SMALL = 1e-3


@dataclass(frozen=True, eq=False)
class BranchFit:
    """A law at rest and its branches, fitted together.

    ``values`` are the moduli [Pa] and times [s] of the branches, ``limits`` their 95 % limits, None
    where the tests set none. The law's own are in ``law``, whose ``held_out`` is by stretch level
    and rate. ``foretold`` is the root mean square error [Pa] over these, each with the same weight,
    None where nothing could be held out; ``tried`` is that by number of branches. ``correlation``
    is that of neighbouring residuals. ``stress`` and ``half`` are the predicted readings and half
    their 95 % band, linearised [Pa]. ``idle``: a branch is no larger than the scatter of a reading,
    or two have the same time. ``at_bound``: a branch's time is at the bound of what the tests can
    show.
    """

    law: LawFit
    values: AnyArray
    limits: tuple[ParameterLimits, ...]
    foretold: float | None
    correlation: float
    stress: AnyArray
    half: AnyArray
    tried: dict[int, float | None]
    idle: bool = False
    at_bound: bool = False

    @property
    def count(self) -> int:
        """Number of branches."""
        return len(self.values) // 2

    @property
    def constants(self) -> int:
        """Number of constants of law and branches."""
        return len(self.law.values) + len(self.values)

    @property
    def branches(self) -> tuple[ViscousBranch, ...]:
        """Branches with a modulus above 0, the fastest first."""
        pairs = zip(*np.split(self.values, 2), strict=True)
        return tuple(ViscousBranch(float(modulus), float(time)) for modulus, time in pairs
                     if modulus > 0)

    def json(self) -> dict[str, Any]:
        """Write the fit as a JSON object: that of a law, with the branches."""
        moduli, times = ([{"value": float(value), "low": low, "high": high, "unit": unit}
                          for value, (low, high) in pairs]
                         for unit, pairs in zip(("Pa", "s"), self._halves, strict=True))
        return self.law.json() | {
            "branches": [{"modulus": modulus, "time": time}
                         for modulus, time in zip(moduli, times, strict=True)],
            "held_out_Pa": self.foretold, "correlation": self.correlation,
            "held_out_Pa_by_branches": {str(count): value for count, value in self.tried.items()}}

    @property
    def _halves(self) -> list[list[tuple[float, ParameterLimits]]]:
        pairs = list(zip(self.values.tolist(), self.limits, strict=True))
        return [pairs[:self.count], pairs[self.count:]]


def compare_in_time(coupons: Coupons, names: Sequence[str] | None = None,
                    noise: float | None = None, branches: int | None = None
                    ) -> tuple[BranchFit, ...]:
    """Fit laws with branches, the one that predicts held-out runs best first.

    Without ``names`` these are all laws with at most one shape constant (branches leave little for
    more). Each has the number of branches that held-out runs choose unless it is given; none where
    the runs do not separate time from stretch. Where no run can be held out, laws are ordered by
    Akaike's criterion; those far from the others in an untested mode come last. ``noise`` is the
    standard deviation of a reading [Pa], estimated where None.

    Raises
    ------
    InputError
        When a name is unknown, times do not ascend or the readings are too few.
    """
    if np.abs(coupons.stretch - 1).max() < _UNSTRETCHED:
        raise InputError("none of the readings is stretched", key="stretch",
                         given=coupons.stretch_range[1])
    stress = BranchStress.of(coupons)
    simple = (name for name, family in FAMILIES.items() if len(family.shape) < 2)
    families = [named_family(name, len(coupons), 2 * (branches or 0))
                for name in dict.fromkeys(names or simple)]
    if branches is None and not time_in_runs(coupons, stress).shown:
        branches = 0

    def fitted(family: LawFamily) -> BranchFit:
        return _chosen(TimedTests(coupons, stress, family), noise, branches)

    fits = with_simpler([fitted(family) for family in families], fitted, lambda fit: fit.law)
    return _ranked(coupons, fits, noise)


def _ranked(coupons: Coupons, fits: Sequence[BranchFit], noise: float | None
            ) -> tuple[BranchFit, ...]:
    """Rank fits, best first; criteria count the independent readings of the most accurate fit."""
    correlation = min(fits, key=lambda fit: fit.law.rmse).correlation
    count = independent_count(len(coupons), correlation)
    far = far_off(coupons, [fit.law for fit in fits])
    fits = [replace(fit, law=replace(
        fit.law, far=far.get(fit.law.family.name, ""), foretold=fit.foretold,
        criterion=akaike(fit.law.rmse**2, count, fit.constants, noise))) for fit in fits]

    def key(fit: BranchFit) -> tuple[Any, ...]:
        order = fit.law.criterion if fit.foretold is None else fit.foretold
        return bool(fit.law.far), fit.foretold is None, order, fit.constants

    return tuple(sorted(fits, key=key))


def branch_lines(branches: Sequence[ViscousBranch]) -> str:
    """Write the ``[[membrane.branch]]`` tables of a specimen file.

    Examples
    --------
    >>> print(branch_lines([ViscousBranch(31.2e3, 6.5)]), end="")
    <BLANKLINE>
    [[membrane.branch]]
    modulus = "31.2 kPa"
    time = "6.5 s"
    """
    return "".join(f'\n[[membrane.branch]]\nmodulus = "{branch.modulus / 1e3:.10g} kPa"\n'
                   f'time = "{branch.time:.10g} s"\n' for branch in branches)


def held_out_groups(coupons: Coupons) -> dict[str, AnyArray]:
    """Mask the readings held out together: runs of a stretch level, of a rate, of a creep load.

    A kind with only one group is left out: no reading of the kind would remain.
    """
    levels, rates, loads = {}, {}, {}
    for name, run in coupons.timed_runs.items():
        stretch, stress = coupons.stretch[run], coupons.stress[run]
        level = float(np.abs(stretch - 1).max())
        if level < _UNSTRETCHED:
            continue
        if np.ptp(stress) < _STEADY * np.abs(stress).max():
            loads[name] = float(np.mean(stress))
            continue
        levels[name] = level
        if np.ptp(stretch) > _STEADY * level:
            rates[name] = _rate(coupons.time[run], stretch)
    groups = _alike(levels, _SAME_LEVEL, lambda size: f"stretch level {1 + size:.3g}")
    groups |= _alike(rates, _SAME_RATE, lambda size: f"rate {size:.2g}/s")
    groups |= _alike(loads, _SAME_LEVEL, lambda size: f"creep under {size / 1e3:.3g} kPa")
    masks = {}
    for label, members in groups.items():
        masks[label] = np.zeros(len(coupons), bool)
        masks[label][np.concatenate([coupons.timed_runs[name] for name in members])] = True
    return masks


def _rate(time: AnyArray, stretch: AnyArray) -> float:
    """Compute the mean rate of stretching along the path [1/s], without its rests."""
    steps, path = np.diff(time), np.abs(np.diff(stretch))
    moving = steps > 0
    steps, path = steps[moving], path[moving]
    return float(np.sum(path**2 / steps) / max(path.sum(), 1e-300))


def _alike(sizes: dict[str, float], factor: float, label: Any) -> dict[str, list[str]]:
    """Group runs of about the same size, by the label of its mean; none if all are equal."""
    order = sorted(sizes, key=lambda name: sizes[name])
    groups: list[list[str]] = []
    for name in order:
        if groups and sizes[name] <= factor * sizes[groups[-1][-1]]:
            groups[-1].append(name)
        else:
            groups.append([name])
    if len(groups) < 2:
        return {}
    return {label(float(np.mean([sizes[name] for name in group]))): group for group in groups}


@dataclass(frozen=True, eq=False)
class TimedTests:
    """Readings and a law to fit to those in ``rows``, with branches whose stress is tabulated.

    Unknowns are the law's linear constants [Pa], its shape constants, moduli [Pa] and logarithms
    of times [s] of branches.
    """

    coupons: Coupons
    stress: BranchStress
    family: LawFamily
    rows: Any = ...

    @cached_property
    def _stretches(self) -> tuple[AnyArray, AnyArray]:
        l1, l2 = self.coupons.in_plane
        return l1[self.rows], l2[self.rows]

    @cached_property
    def read(self) -> AnyArray:
        """Measured stress [Pa], shape (rows,)."""
        return np.asarray(self.coupons.stress[self.rows])

    @cached_property
    def size(self) -> float:
        """Root mean square stress [Pa]."""
        return float(np.sqrt(np.mean(self.read**2))) or 1.0

    @property
    def laws(self) -> int:
        """Number of the law's constants."""
        return len(self.family.constants)

    def names(self, count: int) -> list[str]:
        """Name the unknowns with a number of branches."""
        numbers = range(1, count + 1)
        return [*self.family.constants, *(f"branch {number} modulus" for number in numbers),
                *(f"branch {number} time" for number in numbers)]

    def units(self, count: int) -> list[str]:
        """List the units of the unknowns, times themselves instead of their logarithms."""
        return (["Pa"] * len(self.family.linear) + ["1"] * len(self.family.shape)
                + ["Pa"] * count + ["s"] * count)

    def natural(self, values: AnyArray) -> AnyArray:
        """Convert the unknowns: times themselves instead of their logarithms."""
        law, moduli, times = self.split(values)
        return np.concatenate([law, moduli, np.exp(times)])

    def predict(self, values: AnyArray) -> AnyArray:
        """Predict the nominal stress [Pa]."""
        law, moduli, times = self.split(values)
        return np.asarray(self.family.stress(*self._stretches, law)
                          + self.stress.columns(times)[self.rows] @ moduli)

    def jacobian(self, values: AnyArray) -> AnyArray:
        """Differentiate the prediction by the unknowns."""
        law, moduli, times = self.split(values)
        return np.hstack([self.family.jacobian(*self._stretches, law),
                          self.stress.columns(times)[self.rows],
                          self.stress.slopes(times)[self.rows] * moduli])

    def residual(self, values: AnyArray) -> AnyArray:
        """Subtract measured from predicted stress [Pa]."""
        return self.predict(values) - self.read

    def problem(self, count: int, unit: float) -> LeastSquares:
        """Set up least squares for a number of branches, stress in units of ``unit`` [Pa]."""
        linear, shaped = len(self.family.linear), len(self.family.shape)
        least, most = self.family.bounds(largest_excess(*self.coupons.in_plane))
        fast, slow = self.stress.bounds
        low = [-np.inf] * linear + [least] * shaped + [0.0] * count + [fast] * count
        high = [np.inf] * linear + [most] * shaped + [np.inf] * count + [slow] * count
        return LeastSquares.of(
            lambda values: (self.residual(values) / unit, self.jacobian(values) / unit),
            np.array(low), np.array(high), tuple(range(linear)))

    def best(self, count: int, starts: int) -> AnyArray:
        """Find the best minimum with a number of branches, these ordered by their times."""
        shaped = len(self.family.shape)
        least, most = self.family.starts(largest_excess(*self.coupons.in_plane))
        shapes = seeded_starts(least, most, shaped, starts * max(1, shaped))
        each = _BEST if len(shapes) == 1 else 1
        begin = np.array([values for shape in shapes
                          for values in self._scanned(count, shape, each)])
        ends = minima(self.problem(count, _FINE * self.size), begin)
        law, moduli, times = self.split(ends[0])
        order = np.argsort(times)
        return np.concatenate([self.family.ordered(law), moduli[order], times[order]])

    def split(self, values: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Split unknowns into the law's constants, moduli, and times or their logarithms."""
        law, branches = np.split(values, [self.laws])
        moduli, times = np.split(branches, 2)
        return law, moduli, times

    def _scanned(self, count: int, shape: AnyArray, best: int) -> Iterator[AnyArray]:
        """Scan choices of times on a grid; yield the unknowns of the ``best`` ones."""
        linear = len(self.family.linear)
        fast, slow = self.stress.bounds
        inner = max(int(_COARSE * (slow - fast)), count)
        grid = np.linspace(fast, slow, inner + 2)[1:-1]
        columns = np.hstack([self.family.columns(*self._stretches, shape),
                             self.stress.columns(grid)[self.rows]])
        scale = np.linalg.norm(columns, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        columns = columns / scale
        products, against = columns.T @ columns, columns.T @ self.read
        choices = np.array(list(combinations(range(len(grid)), count)), int)
        choices = choices.reshape(comb(len(grid), count), count)
        of_law = np.tile(np.arange(linear), (len(choices), 1))
        every = np.hstack([of_law, linear + choices])
        # A trace on the diagonal keeps choices solvable that the readings cannot distinguish.
        trace = 1e-10 * np.eye(linear + count)
        matrix = products[every[:, :, None], every[:, None, :]] + trace
        sides = against[every]
        linears = np.linalg.solve(matrix, sides[..., None])[..., 0]
        cost = self.read @ self.read - np.sum(sides * linears, axis=1)
        positive = (linears[:, linear:] > 0).all(axis=1)
        cost = np.where(positive, cost, np.inf)
        lowest = np.where(np.arange(linear + count) < linear, -np.inf, 0.0)
        for index in np.argsort(cost)[:best]:
            constants = np.maximum(linears[index] / scale[every[index]], lowest)
            yield np.concatenate([constants[:linear], shape, constants[linear:],
                                  grid[choices[index]]])


def _chosen(tests: TimedTests, noise: float | None, branches: int | None) -> BranchFit:
    """Fit with the fewest branches that predict held-out runs as well as any number tried.

    That is within one standard error of the least mean square (Breiman, Friedman, Olshen and Stone,
    *Classification and Regression Trees*, 1984, §3.4.3).
    """
    groups = held_out_groups(tests.coupons)
    if branches is None and not groups:
        return _by_criterion([fit_branches(tests, count, noise) for count in _counts(tests)], noise)
    counts = _counts(tests) if branches is None else range(branches, branches + 1)
    errors = {count: _held_out(tests, count, groups) for count in counts}
    foretold = {count: _overall(error) for count, error in errors.items()}
    overall = {count: error for count, error in foretold.items() if error is not None}
    chosen = max(counts)
    if overall:
        best = min(overall, key=lambda count: overall[count])
        squares = np.square([error for error in errors[best].values() if error is not None])
        enough = np.sqrt(squares.mean() + squares.std(ddof=1) / len(squares) ** 0.5)
        chosen = next(count for count, error in overall.items() if error <= enough)
    fit = fit_branches(tests, chosen, noise, errors[chosen])
    while branches is None and fit.idle:
        chosen -= 1
        fit = fit_branches(tests, chosen, noise, errors[chosen])
    return replace(fit, foretold=foretold[chosen], tried=foretold)


def _counts(tests: TimedTests) -> range:
    """List the numbers of branches to try: at most a third as many constants as readings."""
    most = (len(tests.read) // 3 - tests.laws) // 2
    return range(max(min(MOST_BRANCHES, most), 0) + 1)


def _by_criterion(fits: Sequence[BranchFit], noise: float | None) -> BranchFit:
    """Choose a fit by Akaike's criterion, where nothing can be held out.

    The count of readings is that of independent ones with the most branches. A fit with an idle
    branch, or one whose time is at its bound, is left out: nothing else supports it.
    """
    last = fits[-1]
    count = independent_count(len(last.stress), last.correlation)

    def criterion(fit: BranchFit) -> float:
        least = 1e-9 * float(np.abs(fit.stress).max())
        return akaike(max(fit.law.rmse, least) ** 2, count, fit.constants, noise)

    useful = [fit for fit in fits if not (fit.idle or fit.at_bound)]
    best = min(useful, key=criterion)
    if len(fits) == 1:
        return best
    notes = (*best.law.notes, NOTES["nothing_held_out"])
    return replace(best, law=replace(best.law, notes=notes))


def _overall(errors: dict[str, float | None]) -> float | None:
    values = [np.nan if error is None else error for error in errors.values()]
    overall = float(np.sqrt(np.mean(np.square(values)))) if values else np.nan
    return overall if np.isfinite(overall) else None


def _held_out(tests: TimedTests, count: int, groups: dict[str, AnyArray]) -> dict[str,
              float | None]:
    """Compute the root mean square error [Pa] on each group after a fit to the others."""
    errors: dict[str, float | None] = {}
    for label, tested in groups.items():
        values = replace(tests, rows=~tested).best(count, _FEWER)
        missed = replace(tests, rows=tested).residual(values)
        errors[label] = float(np.sqrt(np.mean(missed**2))) if np.isfinite(missed).all() else None
    return errors


def fit_branches(tests: TimedTests, count: int, noise: float | None = None,
                 errors: Mapping[str, float | None] | None = None) -> BranchFit:
    """Fit a law with a number of branches; ``errors`` are those on held-out runs [Pa]."""
    values = tests.best(count, _STARTS)
    residual, jacobian = tests.residual(values), tests.jacobian(values)
    # Exact readings get the noise of rounding.
    floor = 1e-9 * tests.size
    seen = np.where(np.abs(residual) > floor, residual, floor)
    errors_of = CorrelatedSpread.of(jacobian, seen, list(tests.coupons.series.values()), noise)
    natural = tests.natural(values)
    limits = _limits(tests, values, errors_of)
    law = _law_at_rest(tests, natural, limits, errors_of, residual, jacobian, errors or {})
    notes = (*open_constants(tests.names(count), tests.units(count), natural, limits,
                             errors_of.covariance), *_notes(tests.coupons, law, errors_of),
             *_extrapolated(tests, natural), *_bound_notes(tests, values))
    return BranchFit(law=replace(law, notes=notes), values=natural[tests.laws:],
                     limits=limits[tests.laws:], foretold=None,
                     correlation=errors_of.correlation, stress=tests.predict(values),
                     half=errors_of.halves(jacobian), tried={},
                     idle=_idle(tests, values, errors_of.noise.size),
                     at_bound=any(_bound_notes(tests, values)))


def _idle(tests: TimedTests, values: AnyArray, sigma: float) -> bool:
    """Check for a branch smaller than the scatter of one reading, or two with the same time."""
    _, moduli, times = tests.split(values)
    sizes = np.linalg.norm(tests.stress.columns(times)[tests.rows] * moduli, axis=0)
    return bool((sizes < sigma).any() or (np.diff(times) < _SAME_TIME).any())


def _bound_notes(tests: TimedTests, values: AnyArray) -> Iterator[str]:
    """Note each branch whose time is at a bound of what the tests can show."""
    for number, time in enumerate(tests.split(values)[2], 1):
        for side, bound in zip(("less", "more"), tests.stress.bounds, strict=True):
            if abs(time - bound) < _AT_BOUND:
                yield NOTES["branch_at_bound"].format(number=number, side=side,
                                                      bound=float(np.exp(bound)))


def _extrapolated(tests: TimedTests, values: AnyArray) -> Iterator[str]:
    """Note that the modulus at rest lies beyond the tests, without readings at rest or late."""
    law, moduli, times = tests.split(values)
    ends = [float(tests.coupons.time[run[-1]]) for run in tests.coupons.timed_runs.values()]
    if not len(moduli) or np.isnan(tests.coupons.time).any():
        return
    strip = np.array([1 + _SMALL])
    rest = float(tests.family.stress(strip, strip**-0.5, law)[0]) / (3 * _SMALL)
    carried = float(moduli @ np.exp(-max(ends) / times))
    if carried > _CARRIED * abs(rest):
        yield NOTES["extrapolated"].format(longest=max(ends), share=100 * carried / abs(rest))


def _limits(tests: TimedTests, values: AnyArray, noise: CorrelatedSpread
            ) -> tuple[ParameterLimits, ...]:
    """Find 95 % limits by profiles, for correlated errors; none for a law without meaning."""
    count = (len(values) - tests.laws) // 2
    if judged(tests.family, values[:tests.laws], tests.coupons)[1] is None:
        return ((None, None),) * len(values)
    problem, limits = tests.problem(count, noise.noise.size), []
    for index, reach in enumerate((noise.quantiles * noise.widening).tolist()):
        line = profile(problem, values, index, reach)
        low, high = line.low, line.high
        if index >= tests.laws + count:
            low, high = (None if end is None else float(np.exp(end)) for end in (low, high))
        limits.append((low, high))
    return tuple(limits)


def _law_at_rest(tests: TimedTests, values: AnyArray, limits: tuple[ParameterLimits, ...],
                 noise: CorrelatedSpread, residual: AnyArray, jacobian: AnyArray,
                 errors: Mapping[str, float | None]) -> LawFit:
    law = slice(0, tests.laws)
    _, material, failing = judged(tests.family, values[law], tests.coupons)
    mean = float(residual @ residual) / len(residual)
    independent = independent_count(len(residual), noise.correlation)
    lengths = np.linalg.norm(jacobian, axis=0)
    condition = np.linalg.cond(jacobian / lengths) if lengths.all() else np.inf
    return LawFit(
        family=tests.family, material=material, values=values[law], limits=limits[law],
        covariance=noise.covariance[law, law], noise=noise.noise_of(law),
        rmse=mean**0.5,
        criterion=akaike(mean, independent, len(values)),
        condition=float(min(condition, 1e300)), held_out=dict(errors),
        range=tests.coupons.stretch_range, inadmissible=failing,
        dropped=useless_constant(tests.family, values[law], tests.coupons, noise.noise.size))


def _notes(coupons: Coupons, law: LawFit, noise: CorrelatedSpread) -> Iterator[str]:
    if law.dropped:
        yield law.dropped
    if law.material is None:
        yield NOTES["no_meaning"]
    if law.inadmissible is not None:
        yield NOTES["inadmissible"].format(at=law.inadmissible, range=law.range)
    if noise.correlation > 0.5:
        yield NOTES["alike"].format(correlation=noise.correlation, readings=len(coupons),
                                    independent=round(float(noise.noise.freedom[0])))
