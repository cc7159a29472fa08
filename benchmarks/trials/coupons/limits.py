"""Coupons whose constants are known: how often 95 % limits hold them.

    python -m benchmarks.trials.coupons.limits [--seeds 100]

A neo-Hookean law with two branches, pulled in cycles and held, by another integrator than the
fit's, with errors of stress that are independent or last along a run; in creep, with errors of
stretch.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.signal import lfilter
from scipy.stats import binom

from tympan.base.arrays import Array
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.material.branches import BranchFit, TimedTests, fit_branches
from tympan.studies.material.families import FAMILIES
from tympan.studies.material.relaxation import BranchStress

#: Of law and branches [Pa, s], and in the order of a fit's unknowns.
LAW, BRANCHES = 13.4e3, ((31.2e3, 6.5), (11.6e3, 140.0))
TRUTH = np.array([LAW, 31.2e3, 11.6e3, 6.5, 140.0])
NAMES = "law, modulus 1, modulus 2, time 1, time 2"

#: Rates [1/s] and highest stretches of the cycles.
HISTORIES = ((0.05, 2.5), (0.01, 2.5), (0.002, 2.5), (0.05, 1.6))

#: Nominal stresses of creep tests [Pa]; errors of stress [Pa], 1 % of the largest, and of stretch.
_LOADS, _STRESS, _STRETCH = (15e3, 30e3, 45e3), 600.0, 0.004

#: Of the chances that limits hold fewer or more, those beyond which a count is no luck.
_UNLIKELY = 0.001


def coupons_of(parts: Sequence[tuple[str, Array, Array]], mode: str = "uniaxial") -> Coupons:
    """Runs by name, times [s] and stretches, without stress."""
    names, times, stretches = zip(*parts, strict=True)
    counts = [len(time) for time in times]
    every = sum(counts)
    return Coupons(np.full(every, mode), np.concatenate(stretches), np.zeros(every),
                   np.full(every, ""), np.repeat(names, counts), np.concatenate(times))


def cycles(mode: str = "uniaxial", readings: int = 16) -> Coupons:
    """Up and down at several rates and to two levels, then relaxation at once; without stress."""
    parts = []
    for rate, top in HISTORIES:
        half = (top - 1) / rate
        time = np.linspace(0, 2 * half, 2 * readings - 1)
        parts.append((f"{rate:g}/s to {top:g}", time, 1 + rate * np.minimum(time, 2 * half - time)))
    parts.append(("hold", np.geomspace(1.0, 1000.0, readings), np.full(readings, 2.0)))
    return coupons_of(parts, mode)


def by_dop853(time: Array, stretch: Array, mode: str, tau: float) -> Array:
    """Nominal stress of a branch of unit modulus: ȧ = (C − ⅓ (C : C_v⁻¹) a)/τ of the principal a.
    """
    def squares(at: float) -> Array:
        l1 = np.interp(at, time, stretch)
        return np.array([l1, l1 ** MODES[mode], l1 ** (-1 - MODES[mode])]) ** 2

    def flow(at: float, a: Array) -> Array:
        c = squares(at)
        return np.asarray((c - (c / a).sum() / 3 * a) / tau)

    a, last, states = np.ones(3), 0.0, []
    for now in time.tolist():  # each interval by itself: the rate jumps between them
        if now > last:
            a = solve_ivp(flow, (last, now), a, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        states.append(a)
        last = now
    every, c = np.array(states).T, np.array([squares(at) for at in time]).T
    return np.asarray((c[0] / every[0] - c[2] / every[2]) / stretch)


@cache
def exact(mode: str = "uniaxial", readings: int = 16) -> Coupons:
    """The cycles with the stress of the known constants, by the other integrator."""
    coupons = cycles(mode, readings)
    stress = FAMILIES["neo_hooke"].stress(*coupons.in_plane, np.array([LAW]))
    for run in coupons.timed_runs.values():
        for modulus, tau in BRANCHES:
            stress[run] += modulus * by_dop853(coupons.time[run], coupons.stretch[run], mode, tau)
    return replace(coupons, stress=stress)


def noisy(sigma: float, seed: int, correlation: float = 0.0) -> Coupons:
    """With errors [Pa] that are normal, and autoregressive along each run."""
    coupons, random = exact(), np.random.default_rng(seed)
    errors = random.standard_normal(len(coupons))
    for run in coupons.timed_runs.values():
        errors[run[1:]] *= (1 - correlation**2) ** 0.5
        errors[run] = lfilter([1.0], [1.0, -correlation], errors[run])
    return replace(coupons, stress=coupons.stress + sigma * errors)


def crept(load: float, time: Array) -> Array:
    """Stretch of a strip under constant nominal stress, by DOP853 and a root at each time."""
    moduli, taus = np.array(BRANCHES).T

    def stretch_at(a: Array) -> float:
        return float(brentq(lambda x: LAW * (x - x**-2) + np.sum(moduli * (x / a - a**0.5 / x**2))
                            - load, 1.0, 12.0, xtol=1e-13))

    def flow(_: float, a: Array) -> Array:
        x = stretch_at(a)
        return np.asarray((x**2 - (x**2 / a + 2 * a**0.5 / x) / 3 * a) / taus)

    states = solve_ivp(flow, (0, time[-1]), [1.0, 1.0], "DOP853", t_eval=time, rtol=1e-9,
                       atol=1e-10).y.T
    return np.array([stretch_at(a) for a in states])


@cache
def creep() -> Coupons:
    """Three loads put on at once, as they are."""
    time = np.append(0.0, np.geomspace(1, 1500, 39))
    base = coupons_of([(f"{load:g} Pa", time, crept(load, time)) for load in _LOADS])
    return replace(base, stress=np.repeat(_LOADS, len(time)))


@cache
def looked_up() -> BranchStress:
    """What branches of any time pull with in the cycles."""
    return BranchStress.of(cycles())


def problem_of(coupons: Coupons, law: str = "neo_hooke") -> TimedTests:
    """Of readings in the cycles."""
    return TimedTests(coupons, looked_up(), FAMILIES[law])


def pulled(seed: int, correlation: float) -> BranchFit:
    """A fit to noisy cycles."""
    return fit_branches(problem_of(noisy(_STRESS, seed, correlation)), 2)


def hung(seed: int) -> BranchFit:
    """A fit to creep whose stretch is read with errors."""
    base = creep()
    errors = _STRETCH * np.random.default_rng(seed).standard_normal(len(base))
    coupons = replace(base, stretch=base.stretch + errors)
    return fit_branches(TimedTests(coupons, BranchStress.of(coupons), FAMILIES["neo_hooke"]), 2)


def held(fit: BranchFit) -> Array:
    """Which of the true constants are within their limits, shape (5,)."""
    limits = (*fit.law.limits, *fit.limits)
    return np.array([(low is None or low < true) and (high is None or true < high)
                     for (low, high), true in zip(limits, TRUTH, strict=True)])


@dataclass(frozen=True)
class Kind:
    """Coupons by seed."""

    name: str
    fit: Callable[[int], BranchFit]


KINDS = (
    *(Kind(f"cycles, errors correlated by {correlation:g}",
           lambda seed, correlation=correlation: pulled(seed, correlation))
      for correlation in (0.0, 0.6, 0.9)),
    Kind("creep, errors of stretch", hung))


def main() -> None:
    """Print a row for each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100, help="of each kind")
    seeds = parser.parse_args().seeds
    least, most = (int(binom.ppf(share, seeds, 0.95)) for share in (_UNLIKELY, 1 - _UNLIKELY))
    print(f"{seeds} coupons of each kind; limits that hold a constant in 95 % do so {least} to "
          f"{most} times, but for one case in {1 / _UNLIKELY:.0f} on either side")
    print(f"{'':34s}{NAMES}; mean")
    for kind in KINDS:
        hits = sum(held(kind.fit(seed)).astype(int) for seed in range(seeds))
        print(f"{kind.name:34s}{', '.join(str(count) for count in hits)}; "
              f"{100 * hits.mean() / seeds:.1f} %", flush=True)


if __name__ == "__main__":
    main()
