"""Readings that are off and errors that remember, told from readings of a known truth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.trials.mess import pink
from tympan.studies.diagnosis.inference.noise_terms import (
    Jump,
    Missed,
    Smooth,
    noise_terms,
    probability_off,
    remembers,
)
from tympan.studies.diagnosis.inference.smooth_misfit import smooth_columns
from tympan.studies.diagnosis.reading_table import States, rows
from tympan.studies.estimation.noise import Noise, NoiseMemory, Off

Array = np.ndarray

#: Six ramps of eleven voltages, as a bench with three films and two masses reads them.
RAMPS, VOLTAGES = 6, 11
COUNT = RAMPS * VOLTAGES
SIGMA = 10e-6
SHARE = np.tile(np.linspace(0, 1, VOLTAGES), RAMPS)
RAMP = np.repeat(np.arange(RAMPS), VOLTAGES)
#: Readings one after the other.
CHAIN = NoiseMemory(np.arange(COUNT), np.zeros(COUNT, np.int64), np.arange(COUNT, dtype=float),
               np.ones(COUNT))
#: What stiffness and permittivity change, and three effects: a zero, one by mass, one by voltage.
NUISANCE = 1e-3 * np.column_stack([1 + SHARE**2, SHARE**2 + 0.4 * SHARE**4])
EFFECTS = 1e-4 * np.column_stack([np.ones(COUNT), RAMP % 2 - 0.5, SHARE**6])
#: A sensor that is knocked: from some reading on, all are shifted.
STEPS = SIGMA * np.tri(COUNT)[:, 1:]
#: Three films under two masses.
TABLE = rows(States.of(RAMP // 2, np.where(RAMP % 2, 22e-3, 18e-3), 6.5e3 * SHARE), "displacement",
             SIGMA)


def correlated(random: np.random.Generator, correlation: float) -> Array:
    """First-order autoregressive errors of standard deviation 1, made by a filter."""
    fresh = random.normal(size=COUNT + 200) * (1 - correlation**2) ** 0.5
    return np.asarray(lfilter([1.0], [1.0, -correlation], fresh)[200:])


def rivals() -> Iterator[Smooth]:
    """Misfits that are smooth in voltage and mass, alike for films of a kind."""
    yield from map(Smooth, smooth_columns(TABLE))


def noise_of(errors: Array, stated: bool = True, chain: NoiseMemory | None = CHAIN) -> Noise:
    """Noise as a set of errors shows it beside the unknowns' own and an effect's."""
    noise = Noise.of(np.full(COUNT, SIGMA if stated else 1e-3),
                     "stated" if stated else "from the scatter about smooth curves")
    values = errors + NUISANCE @ [0.3, -0.2]
    models = [Missed(values, NUISANCE), *(
        Missed(values, np.column_stack([NUISANCE, effect])) for effect in EFFECTS.T)]
    return noise.plus(*noise_terms(noise, models, lambda: [Jump(STEPS), *rivals()], chain))


@pytest.mark.parametrize("stated", [True, False], ids=["stated", "nothing stated"])
@pytest.mark.parametrize("effect", [0.0, 2.0, 20.0])
def test_slips_are_told_by_their_rows_and_sizes(effect: float, stated: bool) -> None:
    """Nine in ten of 20 standard deviations and more, wherever they are; of good rows hardly any.

    Also where one is the last of its ramp, which a smooth curve would follow, and several are in
    one ramp; with an effect, which no slip is taken for.
    """
    random, found, wrong, slips = np.random.default_rng(5), 0, 0, 0
    for _ in range(20):
        off = random.choice(COUNT, random.integers(1, 6), replace=False)
        sizes = np.zeros(COUNT)
        sizes[off] = np.exp(random.uniform(np.log(2e-4), np.log(1e-3), len(off)))
        errors = SIGMA * random.normal(size=COUNT) + effect * EFFECTS[:, 0]
        told = noise_of(errors + sizes * random.choice([-1, 1], COUNT), stated)
        both = np.intersect1d(np.flatnonzero(told.off), off)
        slips, found = slips + len(off), found + len(both)
        wrong += np.count_nonzero(told.off) - len(both)
        assert told.off[both] == pytest.approx(sizes[both], abs=6 * SIGMA)
    assert found >= 0.9 * slips
    assert wrong <= 2


@pytest.mark.study(seconds=5, only=("0.8",))
@pytest.mark.parametrize("correlation", [0.0, 0.8])
def test_good_readings_are_seldom_told_off(correlation: float) -> None:
    random = np.random.default_rng(7)
    told = [noise_of(SIGMA * correlated(random, correlation)) for _ in range(100)]
    assert sum(bool(one.off.any()) for one in told) <= 3


def correlation_of(errors: Array) -> float:
    """Correlation of what errors remember, 0 if they remember nothing."""
    return max((memory.correlation for memory in noise_of(errors).memories), default=0.0)


@pytest.mark.study(seconds=5)
def test_errors_that_remember_are_told_from_such_that_do_not() -> None:
    """Where they do at 0.8, nearly always, about right; where they do not, hardly ever."""
    random = np.random.default_rng(11)
    found = [correlation_of(SIGMA * correlated(random, 0.8)) for _ in range(50)]
    assert np.mean(np.array(found) > 0) >= 0.9
    assert np.median(found) == pytest.approx(0.8, abs=0.11)
    none = [correlation_of(SIGMA * correlated(random, 0.0)) for _ in range(100)]
    assert np.count_nonzero(none) <= 2


@pytest.mark.parametrize(("size", "most"), [(3.0, 7), (10.0, 0), (30.0, 0)])
def test_a_misfit_is_not_taken_for_noise(size: float, most: int) -> None:
    """An effect that is a model, nor one that no model has: smooth in voltage, by film and mass.

    Of some three times the noise one that no model has looks like errors that remember in a third
    of all sets.
    """
    random = np.random.default_rng(13)
    known = [noise_of(SIGMA * (random.normal(size=COUNT) + size * EFFECTS[:, 2] / 1e-4))
             for _ in range(20)]
    strange = size * np.sin(3 * SHARE**2) * (1 + 0.5 * (RAMP // 2 - 1)) * (RAMP % 2 + 1)
    unknown = [noise_of(SIGMA * (random.normal(size=COUNT) + strange)) for _ in range(20)]
    assert sum(bool(one.terms) for one in known) <= 1
    assert sum(bool(one.terms) for one in unknown) <= most


@pytest.mark.parametrize("size", [5.0, 12.0, 40.0])
@pytest.mark.parametrize("left", [4, 8, 20, 33])
def test_a_sensor_that_was_knocked_is_not_taken_for_noise(size: float, left: int) -> None:
    """A shift of the last readings: neither outliers, few as they are, nor errors that remember."""
    random, knocked = np.random.default_rng(17), np.arange(COUNT) >= COUNT - left
    told = [noise_of(SIGMA * (random.normal(size=COUNT) + size * knocked)) for _ in range(10)]
    assert sum(bool(one.terms) for one in told) <= 1


def test_without_a_chain_no_error_remembers() -> None:
    errors = SIGMA * correlated(np.random.default_rng(1), 0.95)
    assert noise_of(errors, chain=None).memories == ()


def test_what_is_told_is_the_noise_that_is_weighed() -> None:
    """A reading off by itself has its size as noise; neighbours are correlated as told."""
    off = Off(np.array([4]), np.array([5e-4]))
    noise = Noise(np.full(COUNT, SIGMA)).plus(CHAIN.of(0.5, 1.0), off)
    drawn = noise.whitened(np.eye(COUNT))
    covariance = np.linalg.inv(drawn.T @ drawn)
    assert covariance[4, 4] == pytest.approx(SIGMA**2 + 25e-8)
    assert covariance[10, 11] == pytest.approx(0.5 * SIGMA**2)
    assert covariance[3, 5] == pytest.approx(0.25 * SIGMA**2)


def test_the_probability_of_a_slip_grows_with_its_size() -> None:
    """By Bayes' rule with one slip in a hundred, of any magnitude up to a thousand times noise."""
    size = np.array([0.5, 3.0, 4.0, 6.0, 50.0])
    slip = 1 / (2 * np.log(1e3) * np.maximum(size, 1.0))
    good = np.exp(-size**2 / 2) / np.sqrt(2 * np.pi)
    assert probability_off(size) == pytest.approx(0.01 * slip / (0.01 * slip + 0.99 * good))


@pytest.mark.study(seconds=5)
def test_effects_hardly_more_probable_than_errors_that_remember_are_not_preferred() -> None:
    """With 1/f noise one of many effects fits by chance; where an effect is, it is no noise."""
    effects = [SHARE**power * (ramp == RAMP) for ramp in range(6) for power in (0, 2, 6)]

    def remembered(errors: Array) -> bool:
        models = [np.column_stack([NUISANCE, *some]) for some in ([], *zip(effects, strict=True))]
        return remembers(noise_terms(Noise.of(np.full(COUNT, SIGMA), "stated"),
                                     [Missed(errors, model) for model in models], rivals, CHAIN))

    random = np.random.default_rng(17)
    assert sum(remembered(pink(random, COUNT, SIGMA)[0]) for _ in range(60)) >= 30
    assert not any(remembered(SIGMA * (random.normal(size=COUNT) + size * effect))
                   for effect in effects[:6] for size in (4.0, 6.0, 8.0))
