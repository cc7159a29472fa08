"""Branches fitted to tests in time: against their equation, and constants that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tympan.geometry.errors import InputError
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.material.families import FAMILIES
from tympan.studies.material.relaxation import branch_stress, fewest, fit_branches

RATES = (0.05, 0.01, 0.002)
LAW, BRANCHES = 13.4e3, ((31.2e3, 6.5), (11.6e3, 140.0))


def cycles(mode: str = "uniaxial", top: float = 2.5, readings: int = 31) -> Coupons:
    """Up and down at several rates, each a run, then relaxation at once held; without stress."""
    parts = []
    for rate in RATES:
        half = (top - 1) / rate
        time = np.linspace(0, 2 * half, 2 * readings - 1)
        parts.append((f"{rate:g}/s", time, 1 + rate * np.minimum(time, 2 * half - time)))
    hold = np.geomspace(1.0, 1000.0, readings)
    parts.append(("hold", hold, np.full(readings, 2.0)))
    names, times, stretches = zip(*parts, strict=True)
    count = [len(time) for time in times]
    every = sum(count)
    return Coupons(np.full(every, mode), np.concatenate(stretches), np.zeros(every),
                   np.full(every, ""), np.repeat(names, count), np.concatenate(times))


def with_stress(coupons: Coupons, noise: float, seed: int) -> Coupons:
    l1, l2 = coupons.in_plane
    rest = FAMILIES["neo_hooke"].stress(l1, l2, np.array([LAW]))
    moduli, times = np.array(BRANCHES).T
    stress = rest + branch_stress(coupons, times) @ moduli
    stress += noise * np.random.default_rng(seed).standard_normal(len(stress))
    return Coupons(coupons.mode, coupons.stretch, stress, coupons.specimen, coupons.run,
                   coupons.time)


@pytest.mark.parametrize("mode", MODES)
def test_branches_pull_as_their_equation_says(mode: str) -> None:
    """ȧ = (C − ⅓ (C : C_v⁻¹) a)/τ of every principal a of C_v, by another integrator."""
    coupons, tau = cycles(mode), 6.5
    power = MODES[mode]
    stress = branch_stress(coupons, np.array([tau]))[:, 0]
    for run in ("0.05/s", "0.01/s", "hold"):
        part = coupons.run == run
        time, stretch = coupons.time[part], coupons.stretch[part]

        def squares(at: float, time=time, stretch=stretch) -> np.ndarray:
            l1 = np.interp(at, time, stretch)
            return np.array([l1, l1**power, l1 ** (-1 - power)]) ** 2

        def flow(at: float, a: np.ndarray, squares=squares) -> np.ndarray:
            c = squares(at)
            return (c - (c / a).sum() / 3 * a) / tau

        done = solve_ivp(flow, (0.0, time[-1]), np.ones(3), "DOP853", t_eval=time, rtol=1e-10,
                         atol=1e-12, max_step=1.0)
        c = np.array([squares(at) for at in time]).T
        exact = (c[0] / done.y[0] - c[2] / done.y[2]) / stretch
        assert stress[part] == pytest.approx(exact, abs=2e-3 * np.abs(exact).max())


def test_known_constants_come_back_within_their_limits() -> None:
    fit = fit_branches(with_stress(cycles(), 300.0, 0), FAMILIES["neo_hooke"], 2, hold_out=False)
    truth = [LAW, *(modulus for modulus, _ in BRANCHES), *(np.log(time) for _, time in BRANCHES)]
    for value, (low, high), true in zip(fit.values, fit.limits, truth, strict=True):
        assert low is not None
        assert high is not None
        assert low < value < high
        assert low - (high - low) / 2 < true < high + (high - low) / 2
    assert fit.rmse == pytest.approx(300.0, rel=0.15)


def test_runs_held_out_say_how_many_branches() -> None:
    coupons = with_stress(cycles(readings=16), 200.0, 1)
    fits = [fit_branches(coupons, FAMILIES["neo_hooke"], count) for count in (0, 1, 2, 3)]
    assert fewest(fits).count == 2
    assert set(fits[0].held_out) == {"0.05/s", "0.01/s", "0.002/s", "hold"}


@pytest.mark.study
def test_limits_hold_as_often_as_they_say() -> None:
    """95 % of 100 seeded coupons; 5 constants each."""
    truth = [LAW, *(modulus for modulus, _ in BRANCHES), *(np.log(time) for _, time in BRANCHES)]
    inside = []
    for seed in range(100):
        fit = fit_branches(with_stress(cycles(), 300.0, seed), FAMILIES["neo_hooke"], 2,
                           hold_out=False)
        inside += [(low is None or low <= true) and (high is None or true <= high)
                   for (low, high), true in zip(fit.limits, truth, strict=True)]
    assert 0.92 <= np.mean(inside) <= 0.98


def test_readings_need_their_times() -> None:
    coupons = cycles()
    timeless = Coupons(coupons.mode, coupons.stretch, coupons.stress, coupons.specimen, coupons.run,
                       np.full(len(coupons), np.nan))
    with pytest.raises(InputError, match="every reading"):
        fit_branches(timeless, FAMILIES["neo_hooke"], 1)
