"""Profiles of the likelihood against closed forms and linearised limits, and what is called not
determined."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.lumped import clean
from tympan.base.errors import InputError
from tympan.reports.figures.identification import _prefix, draw_correlations, draw_profiles
from tympan.studies.estimation.identifiability import identifiability
from tympan.studies.estimation.least_squares import LeastSquares, minimise
from tympan.studies.estimation.noise import Noise
from tympan.studies.estimation.profile import profile
from tympan.studies.identify.static import identify_static
from tympan.studies.lumped.actuator import paper_cones

QUANTILE = 1.959964


def box(size: int, low: float = -1e3, high: float = 1e3) -> tuple[np.ndarray, np.ndarray]:
    return np.full(size, low), np.full(size, high)


def linear(count: int = 30) -> tuple[LeastSquares, np.ndarray]:
    rng = np.random.default_rng(2)
    matrix = rng.standard_normal((count, 3)) * [20.0, 30.0, 50.0]
    matrix[:, 2] += 2 * matrix[:, 0]
    read = matrix @ [1.0, -0.5, 0.25] + rng.standard_normal(count)
    return LeastSquares.of(lambda z: (matrix @ z - read, matrix), *box(3)), matrix


def test_profile_of_a_linear_problem_is_its_linear_limit() -> None:
    misfit, matrix = linear()
    best = minimise(misfit, np.zeros(3)).unknowns
    spread = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    for index in range(3):
        line = profile(misfit, best, index, QUANTILE)
        assert line.low == pytest.approx(best[index] - QUANTILE * spread[index],
                                         abs=0.02 * spread[index])
        assert line.high == pytest.approx(best[index] + QUANTILE * spread[index],
                                          abs=0.02 * spread[index])
        inside = np.abs(line.values - best[index]) > 0
        straight = (line.values - best[index])[inside] / spread[index]
        assert line.rise[inside] == pytest.approx(straight, rel=0.01)


def test_profile_of_a_reciprocal_is_its_closed_form_and_longer_upwards() -> None:
    """A deflection of 1/k with noise σ: the limits of k are 1/(d ± qσ), not d⁻¹ ± qσ/d²."""
    deflection, sigma = 2.0, 0.2
    misfit = LeastSquares.of(lambda z: ((1 / z - deflection) / sigma, -np.diag(1 / z**2) / sigma),
                    *box(1, 1e-3))
    line = profile(misfit, np.array([1 / deflection]), 0, QUANTILE)
    expected = [1 / (deflection + side * QUANTILE * sigma) for side in (1, -1)]
    assert [line.low, line.high] == pytest.approx(expected, rel=2e-3)
    half = QUANTILE * sigma / deflection**2
    assert line.high is not None
    assert line.high - 1 / deflection > 1.15 * half


def test_a_stiffness_from_few_rough_readings_is_limited_like_a_reciprocal() -> None:
    """A film's stiffness: at 1 µm both limits agree; at 0.4 mm the profile reaches further up and
    less far down."""
    base = clean()
    ratios = []
    for noise in (1e-6, 4e-4):
        specimens = tuple(
            replace(specimen, membrane=replace(specimen.membrane, relative_permittivity=8.5))
            for specimen in base.specimens)
        fit = identify_static(replace(base, actuators=paper_cones(specimens), noise=noise,
                                      law="film", alpha="shared"))
        stiffness = fit.judgement.constants[0]
        assert stiffness.name == "stiffness"
        assert stiffness.value == pytest.approx(1.0, rel=1e-6)
        assert None not in (stiffness.low, stiffness.high,
                            stiffness.linear_low, stiffness.linear_high)
        ratios.append([
            (stiffness.high - stiffness.value) / (stiffness.linear_high - stiffness.value),
            (stiffness.value - stiffness.low) / (stiffness.value - stiffness.linear_low)])
    assert ratios[0] == pytest.approx([1.0, 1.0], abs=0.01)
    assert ratios[1][0] > 1.03
    assert ratios[1][1] < 0.97


def test_limits_of_a_constant_among_others_nobody_sees() -> None:
    """One mass up to 4 kV: five of nine directions are unseen, and no fit behind a profile gets
    lost along them."""
    base = clean()
    for seed in range(6):
        noise = 1e-6 * np.random.default_rng(seed).standard_normal(len(base.mass))
        read = base.displacement + noise
        kept = (base.mass < 0.02) & (base.voltage < 4.1e3)
        few = replace(base, which=base.which[kept], mass=base.mass[kept],
                      voltage=base.voltage[kept],
                      displacement=read[kept])
        judgement = identify_static(replace(few, alpha="shared")).judgement
        assert judgement.determined == 3
        assert judgement.undetermined == [f"{name}_{i}" for name in ("beta", "gamma")
                                          for i in (1, 2, 3)]
        for constant, truth, least in zip(judgement.constants[-2:], (8.5, 0.45), (0.1, 0.002),
                                          strict=True):
            assert constant.low is not None
            assert constant.high is not None
            width = constant.high - constant.low
            assert constant.low - 0.5 * width < truth < constant.high + 0.5 * width
            assert least < width < 10 * least


def test_what_one_side_leaves_open_or_nobody_sees_has_no_limits() -> None:
    """Saturating towards its upper bound, exp(−5) against a noise of 0.1; and a pair seen only as
    its sum."""
    names = [("a", "1"), ("b", "1")]
    saturating = LeastSquares.of(lambda z: (np.array([np.exp(-z[0]) - np.exp(-1.5), z[1]]) / 0.1,
                                   np.array([[-np.exp(-z[0]), 0.0], [0.0, 1.0]]) / 0.1),
                        *box(2, -5.0, 5.0))
    judgement = identifiability(saturating, np.array([1.5, 0.0]), names, QUANTILE, np.ones(2))
    assert profile(saturating, np.array([1.5, 0.0]), 0, QUANTILE).low is not None
    assert judgement.undetermined == ["a"]
    summed = LeastSquares.of(lambda z: (np.array([z.sum(), z.sum() - 0.02]) / 0.1,
                                        np.ones((2, 2)) / 0.1), *box(2))
    judgement = identifiability(summed, np.array([0.0, 0.01]), names, QUANTILE, np.ones(2))
    assert judgement.undetermined == ["a", "b"]
    assert judgement.determined == 1


def test_profiles_beyond_their_budget_give_way_to_linear_limits() -> None:
    misfit, matrix = linear()
    names = [(name, "1") for name in "abc"]
    spread = QUANTILE * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    best = minimise(misfit, np.zeros(3)).unknowns
    whole, cut = (identifiability(misfit, best, names, QUANTILE, np.ones(3), most=most)
                  for most in (600, 0))
    assert [constant.by for constant in whole.constants] == 3 * ["profile"]
    assert [constant.by for constant in cut.constants][1:] == 2 * ["linear"]
    for constant, value, half in zip(cut.constants, best, spread, strict=True):
        assert (constant.low, constant.high) == pytest.approx((value - half, value + half), rel=0.1)


def test_relations_are_the_combinations_in_the_constants_own_units() -> None:
    """A sum read as 0.02 of two that are not known apart, in scales of 1 and 10; and a product."""
    scales = np.array([1.0, 10.0])
    summed = LeastSquares.of(lambda z: (np.array([z.sum() - 0.04, z.sum()]) / 0.1,
                                        np.ones((2, 2)) / 0.1), *box(2))
    names = [("a", "Pa"), ("b", "Pa")]
    for scale, value, formula in ((scales, 0.02, "a + 0.1 b"), (None, np.exp(0.02), "a b")):
        judgement = identifiability(summed, np.array([0.005, 0.015]), names, QUANTILE, scale)
        assert judgement.undetermined == ["a", "b"]
        (relation,) = judgement.relations
        assert relation.formula == formula
        assert relation.value == pytest.approx(value, rel=1e-9)
        half = QUANTILE * 0.1 / np.sqrt(2)
        ends = (0.02 - half, 0.02 + half)
        assert (relation.low, relation.high) == pytest.approx(
            ends if scale is not None else tuple(np.exp(ends)), rel=1e-9)


def test_a_search_that_cannot_begin_is_refused() -> None:
    nowhere = LeastSquares.of(lambda z: (np.full(3, np.nan), np.ones((3, 1))), *box(1))
    with pytest.raises(InputError, match="does not hold"):
        minimise(nowhere, np.zeros(1))


def test_noise_that_cannot_explain_the_misfit_gives_way_to_it() -> None:
    assert Noise.left(100.0, 100, 0.9, widen=True).size == 0.9
    assert Noise.left(100.0, 100, 0.1, widen=True).size == 1.0
    assert Noise.left(100.0, 100, 0.1).size == 0.1
    assert Noise.left(100.0, 10).quantile > Noise.left(100.0, 10, 1.0).quantile


@pytest.mark.parametrize(("largest", "unit", "expected"), [
    (2e6, "Pa", (1e6, "M")), (2e4, "Pa", (1e3, "k")), (20.0, "Pa", (1.0, "")),
    (2e6, "1", (1.0, ""))])
def test_a_prefix_leaves_numbers_below_a_thousand(largest: float, unit: str,
                                                  expected: tuple[float, str]) -> None:
    assert _prefix(largest, unit) == expected


def test_pictures(tmp_path: Path) -> None:
    fit = identify_static(clean())
    assert [constant.name for constant in fit.judgement.constants][-2:] == [
        "alpha_1[elliptical-small]", "alpha_1[elliptical-large]"]
    for file in (*draw_profiles(fit.judgement, tmp_path),
                 *draw_correlations(fit.judgement, tmp_path)):
        assert file.stat().st_size > 10_000
