"""What a judgement rests on: evidence, tests against noise, classes; each against something
computed another way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import kstest, multivariate_t

from tests.support.costs import dear
from tests.support.trials import design, every_cause, few_causes, read
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import NUISANCE
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause, hypotheses_of
from tympan.studies.diagnosis.inference import residual_tests
from tympan.studies.diagnosis.inference.identifiability import (
    classes_of,
    detectable_effects,
    signatures,
)
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.patterns import reading_patterns
from tympan.studies.diagnosis.reading_table import ReadingTable, rows
from tympan.studies.diagnosis.reduced.growth import refined
from tympan.studies.diagnosis.reduced.simulation import Simulation

NAMES = ("circular", "elliptical-small", "elliptical-large")
SIGMA = 20e-6
MASS = Cause("unaccounted_mass")


@pytest.fixture(scope="module")
def overweight(three_shapes: Simulation) -> tuple[ReadingTable, Judgement]:
    """Readings of loads that are 3 g heavier than stated, and what is said of them."""
    table = read(three_shapes, design(SIGMA), (MASS,), [3e-3], seed=1)
    return table, judge(three_shapes, table, every_cause(three_shapes))


def _sampled(simulation: Simulation, cause: Cause, table: ReadingTable
             ) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns and the logarithms of their weights, by importance sampling, no parabola assumed."""
    centre = fit(simulation, (cause,), table)
    width = np.diag(centre.precision) ** -0.5
    scaled = np.linalg.inv(centre.precision * width * width[:, None])
    proposal = multivariate_t(centre.unknowns / width, 1.5 * scaled, df=5, seed=7)
    size_prior = cause.effect.parameters[0].prior
    drawn, logs = proposal.rvs(3000) * width, []
    for unknowns in drawn:
        prior = size_prior.logpdf(unknowns[2]) - 0.5 * np.sum((unknowns[:2] / NUISANCE) ** 2)
        if prior > -np.inf:
            residual = (table.value - simulation.predict((cause,), unknowns, table)) / table.sigma
            likelihood = -0.5 * np.sum(residual**2) - np.log(2 * np.pi * NUISANCE.prod())
            logs.append(likelihood + prior - proposal.logpdf(unknowns / width)
                        + np.log(width).sum())
        else:
            logs.append(-np.inf)
    return drawn, np.array(logs)


@pytest.mark.parametrize(("cause", "size"), [(Cause("prestretch_loss", "circular"), 0.006),
                                             (Cause("electrode_margin"), 0.0),
                                             (Cause("voltage_sag"), 3e-9),
                                             (Cause("sensor_zero"), 40e-6)])
def test_evidence_is_the_integral_and_limits_its_quantiles(
        three_shapes: Simulation, cause: Cause, size: float) -> None:
    """Also where the most probable size is at its limit; relative to the nominal model's, the same
    grid aside."""
    table = read(three_shapes, design(SIGMA, voltages=5), (cause,), [size], seed=4)
    drawn, logs = _sampled(three_shapes, cause, table)
    fitted = fit(three_shapes, (cause,), table)
    assert fitted.evidence == pytest.approx(logsumexp(logs) - np.log(len(logs)), abs=0.1)
    order = np.argsort(drawn[:, 2])
    below = np.cumsum(np.exp(logs[order] - logs.max()))
    _, *limits = interval(fitted, 2)
    shares = np.interp(limits, drawn[order, 2], below / below[-1])
    at_bound = fitted.unknowns[2] == fitted.bounds[0, 2]
    assert shares == pytest.approx((0.0, 0.95) if at_bound else (0.025, 0.975), abs=0.02)


@pytest.mark.study(seconds=4)
def test_noise_alone_gives_uniform_probabilities(three_shapes: Simulation) -> None:
    table = read(three_shapes, design(SIGMA), (), [], seed=0)
    nominal = fit(three_shapes, (), table)
    columns = reading_patterns.patterns(table, NAMES, table.value)
    tests = residual_tests.ResidualTests.of(nominal.jacobian, reading_patterns.over(columns, table))
    generator = np.random.default_rng(2)
    p_values = []
    for _ in range(120):
        noise = generator.standard_normal(len(table))
        residual = noise - (nominal.jacobian
                            @ np.linalg.lstsq(nominal.jacobian, noise, rcond=None)[0])
        p_values.append(tests(residual, generator).p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01
    line = 3.0 * (table.specimen - 1.0) * (table.voltage / 6.5e3) ** 2
    assert tests(residual + line, generator).p_value < 1e-3


def test_a_factor_at_its_bound_takes_up_nothing(three_shapes: Simulation) -> None:
    """A film that hardly answers to voltage is wrong, though more of the same would show it so."""
    table = design(1e-6)
    readings = three_shapes.predict((), np.array([0.05, np.log(0.01)]), table)
    noise = 1e-6 * np.random.default_rng(5).standard_normal(len(table))
    judged = judge(three_shapes, table.with_values(readings + noise), [Cause("sensor_zero")])
    assert judged.nominal.stopped.tolist() == [False, True]
    assert judged.nominal.chi_squared > 4 * len(table)
    assert judged.test.p_value < 1e-6
    assert judged.verdict == "unexplained"


@pytest.mark.study(seconds=15)
def test_the_noise_is_found_though_misstated_and_not_what_is_smooth(
        three_shapes: Simulation, overweight: tuple[ReadingTable, Judgement]) -> None:
    table, as_stated = overweight
    nominal = fit(three_shapes, (), table)
    assert np.sqrt(nominal.chi_squared / len(table)) > 2
    misstated = [judge(three_shapes, table.with_sigma(share * table.sigma),
                       every_cause(three_shapes)) for share in (1 / 1.5, 1.5)]
    for judged in (as_stated, *misstated):
        assert judged.table.sigma.mean() == pytest.approx(SIGMA, rel=0.2)
        assert judged.named == (MASS,)


def test_exact_aliases_are_known_before_any_data(three_shapes: Simulation) -> None:
    """Permittivity, and so an amplifier's gain, is refitted; with one mass the stiffness takes up a
    load as well."""
    table = design(SIGMA)
    causes = every_cause(three_shapes)
    invisible, _ = classes_of(signatures(three_shapes, table, np.zeros(2), causes))
    assert Cause("amplifier_gain") in invisible
    # Of it only the product of what radius and hoop stretch beyond the mounted film is left.
    assert Cause("second_invariant") in invisible
    assert Cause("unaccounted_mass") not in invisible
    one_mass = table[table.mass == table.mass[0]]
    assert Cause("unaccounted_mass") in classes_of(
        signatures(three_shapes, one_mass, np.zeros(2), causes))[0]


def test_what_is_said_to_be_seen_is_seen_and_what_is_not_is_not(three_shapes: Simulation) -> None:
    """The size at which an effect should reach Δχ² = 25, put into exact readings, does: the refit
    done in full."""
    table = design(SIGMA)
    causes = every_cause(three_shapes)
    signs = signatures(three_shapes, table, np.zeros(2), causes)
    for cause, effect in zip(signs, detectable_effects(signs), strict=True):
        parameters, seen = cause.effect.parameters, effect.seen_from
        nearby = seen is not None and seen < 3 * effect.prior_width
        if not nearby or len(parameters) > 1 or cause.name in ("voltage_sag",
                                                               "strain_stiffening"):
            continue
        unit = parameters[0].value(parameters[0].size(parameters[0].width)) / effect.prior_width
        exact = table.with_values(three_shapes.predict((cause,), np.array([0.0, 0.0, seen * unit]),
                                                       table))
        assert fit(three_shapes, (), exact).chi_squared == pytest.approx(25.0, rel=0.5), effect


def test_intervals_begin_at_the_limit_a_value_lies_on(three_shapes: Simulation) -> None:
    """Readings without noise of what no spring can be: one of negative stiffness."""
    spring, table = (Cause("parallel_spring"),), design(SIGMA)
    none, some = (three_shapes.predict(spring, np.array([0.0, 0.0, size]), table)
                  for size in (0.0, 10.0))
    value, low, high = interval(fit(three_shapes, spring, table.with_values(2 * none - some)), 2)
    assert value == low == 0
    assert 0 < high < 10


def test_pairs_never_hold_one_effect_on_two_specimens() -> None:
    causes = [Cause("prestretch_loss", "a"), Cause("prestretch_loss", "b"), Cause("drift")]
    assert [len(hypothesis) for hypothesis in hypotheses_of(causes)] == [1, 1, 1, 2, 2]


@pytest.mark.study(seconds=14)
def test_an_effect_out_of_the_question_is_tried_all_the_same(three_shapes: Simulation) -> None:
    """10 g that nobody weighed are ten times the usual.

    Without that cause in the list something else is said, with it the attempt finds it and calls it
    implausible.
    """
    mass = Cause("unaccounted_mass")
    table = read(three_shapes, design(SIGMA, masses=(17.9e-3, 14e-3)), (mass,), [-4e-3], seed=5)
    # On the way up a plate that rubs is as good as a lighter load.
    others = [cause for cause in every_cause(three_shapes)
              if cause.name not in ("unaccounted_mass", "friction")]
    judged = judge(three_shapes, table, others)
    assert judged.verdict != "nothing"
    judged = judge(three_shapes, table, [*others, mass])
    best = max(judged.weighed.alone, key=judged.explained)
    assert best.hypothesis == (mass,)
    assert best.surprise(mass) > 2.0
    assert judged.explained(best) > 0.97
    assert best.unknowns[2] == pytest.approx(-4e-3, rel=0.1)


def test_ratios_of_strokes(three_shapes: Simulation) -> None:
    table = design(SIGMA)
    values = three_shapes.predict((), np.zeros(2), table)
    read_ = table.with_values(np.where(table.specimen == 2, 1.1, 1.0) * values)
    by_words = {ratio.what: ratio for ratio in ratios(read_, values, NAMES)}
    assert by_words["elliptical-large over circular at 17.9 g"].read == pytest.approx(
        1.1 * by_words["elliptical-large over circular at 17.9 g"].simulated)
    assert by_words["22.45 g over 17.9 g, circular"].off_by_noise == pytest.approx(0.0, abs=1e-7)
    assert abs(by_words["elliptical-large over circular at 22.45 g"].off_by_noise) > 3


@pytest.mark.study(seconds=4)
@pytest.mark.parametrize("among", [partial(few_causes, more=("prestretch_loss",)),
                                   dear(every_cause, seconds=15)])
def test_order_of_rows_and_causes_changes_no_verdict(
        three_shapes: Simulation, among: Callable[[Simulation], list[Cause]]) -> None:
    cause = Cause("prestretch_loss", "elliptical-large")
    table = read(three_shapes, design(SIGMA), (cause,), [0.015], seed=8)
    generator = np.random.default_rng(0)
    mixed = table[generator.permutation(len(table))]
    causes = among(three_shapes)
    first = judge(three_shapes, table, causes)
    second = judge(three_shapes, mixed, [causes[k] for k in generator.permutation(len(causes))],
                   seed=9)
    assert first.named == second.named == (cause,)
    assert first.posterior is not None
    assert second.posterior is not None
    assert second.posterior.of_causes()[cause] == pytest.approx(first.posterior.of_causes()[cause],
                                                               abs=1e-3)
    assert replace(first.posterior).wrong == pytest.approx(second.posterior.wrong, abs=1e-5)


def test_without_any_effect_to_think_of_a_misfit_is_unexplained(
        three_shapes: Simulation, overweight: tuple[ReadingTable, Judgement]) -> None:
    judged = judge(three_shapes, overweight[0], ())
    assert judged.verdict == "unexplained"
    assert judged.posterior is not None
    assert judged.posterior.discrepancy > 0.99
    assert judged.chosen is None


@pytest.mark.parametrize("share", [0.1, 3.0])
def test_a_channel_of_other_noise_than_assumed_makes_no_misfit(three_shapes: Simulation,
                                                               share: float) -> None:
    """Of capacitances whose noise is a tenth of, or three times what is assumed."""
    lengths = design(SIGMA)
    channel = rows(lengths.states, "capacitance", 1.0)
    exact = three_shapes.predict((), np.zeros(2), channel)
    channel = channel.with_values(exact).with_sigma(np.full(len(exact), 0.01 * exact.max()))
    generator = np.random.default_rng(3)
    noise = share * channel.sigma * generator.standard_normal(len(exact))
    table = lengths.with_values(three_shapes.predict((), np.zeros(2), lengths)
                              + SIGMA * generator.standard_normal(len(lengths)))
    both = table.joined(channel.with_values(exact + noise))
    judged = judge(three_shapes, both, every_cause(three_shapes))
    assert judged.verdict == "nothing"
    factor = judged.table.sigma / both.sigma
    assert np.median(factor[both.lengths]) == pytest.approx(1.0, abs=0.25)
    assert np.median(factor[~both.lengths]) == pytest.approx(share, rel=0.3)


@pytest.mark.study(seconds=8)
def test_a_cause_that_only_its_size_speaks_against_is_suspected(three_shapes: Simulation) -> None:
    """Plates 8.5 mm off centre, whose own readings a film stretched unevenly shows as well."""
    plate = (Cause("plate_eccentricity"),)
    unknowns = np.array([0.05, -0.03, 8.5e-3, 0.0])
    exact = refined(three_shapes, plate, unknowns)
    table = design(SIGMA)
    noise = SIGMA * np.random.default_rng(4).standard_normal(len(table))
    judged = judge(three_shapes, table.with_values(exact.predict(plate, unknowns, table) + noise),
                   [*plate, Cause("prestretch_anisotropy"), Cause("sensor_zero")])
    assert judged.verdict == "ambiguous"
    assert plate[0] in judged.weighed.suspects
    alone = next(fit for fit in judged.weighed.alone if fit.hypothesis == plate)
    assert alone.surprise(plate[0]) == pytest.approx(8.5, rel=0.1)
    assert judged.simulation is not three_shapes


@pytest.mark.study(seconds=11)
def test_what_is_named_is_so_for_every_scale_of_the_priors(
        three_shapes: Simulation, overweight: tuple[ReadingTable, Judgement]) -> None:
    table, judged = overweight
    assert judged.named == (MASS,)
    assert set(judged.weighed.robust.values()) == {(MASS,)}
    assert min(judged.weighed.robust) <= 1 / 3
    assert max(judged.weighed.robust) >= 10
    for scale in (0.2, 5.0):
        assert judge(three_shapes, table, every_cause(three_shapes), widen=scale).named == (MASS,)
