"""Whole verdicts on a bench whose readings are straight in all that is unknown: half a second each.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.straight_bench import StraightBench, design, readings
from tympan.studies.diagnosis.explanations.labels import other_labels
from tympan.studies.diagnosis.explanations.relabelled import relabelling_of
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference import verdict
from tympan.studies.diagnosis.inference.nominal import one_sided
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests
from tympan.studies.diagnosis.inference.verdict import (
    Judgement,
    Wandering,
    judge,
    probability_with_noise,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import SCATTER

BENCH = StraightBench()
NAMES = tuple(specimen.name for specimen in BENCH.setup.specimens)
ZERO, DRIFT, SAG, MASS = map(Cause, ("sensor_zero", "drift", "voltage_sag", "unaccounted_mass"))
FEW = (ZERO, DRIFT, SAG, MASS)


def judged(sizes: dict[Cause, float], causes: tuple[Cause, ...] = FEW, seed: int = 0) -> Judgement:
    return judge(BENCH, readings(sizes, seed=seed), causes)


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_is_nothing(seed: int) -> None:
    found = judged({}, seed=seed)
    assert (found.verdict, found.named, found.posterior) == ("nothing", (), None)


@pytest.mark.parametrize("cause", FEW, ids=str)
def test_an_effect_of_three_usual_sizes_is_named(cause: Cause) -> None:
    found = judged({cause: 3.0})
    assert (found.verdict, found.named) == ("named", (cause,))
    assert found.chosen is not None
    assert found.chosen.surprise(cause) == pytest.approx(3.0, rel=0.1)


def test_two_effects_are_named_together() -> None:
    found = judged({ZERO: 3.0, SAG: 2.0})
    assert (found.verdict, set(found.named)) == ("named", {ZERO, SAG})


def test_three_effects_are_more_than_is_known() -> None:
    found = judged({ZERO: 4.0, SAG: 3.0, DRIFT: -4.0})
    assert (found.verdict, found.named) == ("unexplained", ())


def test_effects_that_do_the_same_are_told_as_one_class_and_none_is_named() -> None:
    alike = Cause("hysteresis"), Cause("electrode_margin")
    found = judged({alike[0]: 4.0}, (*FEW, *alike))
    assert (found.verdict, found.named) == ("ambiguous", ())
    assert found.misfit.indistinguishable == (alike,)
    assert set(alike) <= set(found.weighed.suspects)


def test_what_stiffness_makes_up_for_is_not_seen() -> None:
    found = judged({Cause("sensor_gain"): 3.0}, (*FEW, Cause("sensor_gain")))
    assert (found.verdict, found.misfit.invisible) == ("nothing", (Cause("sensor_gain"),))


@pytest.mark.parametrize(("softer", "expected"), [(1.6, "nothing"), (2.2, "unexplained")])
def test_a_film_as_soft_as_none_is_unexplained_however_well_it_fits(softer: float, expected: str
                                                                    ) -> None:
    """One film in a thousand has a factor of e^1.86, 3.7 deviations of what is known beforehand."""
    found = judge(BENCH, readings({}, factors=(-softer, 0.0)), FEW)
    assert (found.verdict, found.unusual) == (expected, expected == "unexplained")
    assert found.test.p_value > 0.1


def test_one_odd_specimen_of_three_is_told() -> None:
    table = readings({})
    odd = table.specimen == 1
    softer = table.with_values(np.where(odd, 1.3 * table.value - 2e-4, table.value))
    found = judge(BENCH, softer, (DRIFT,))
    assert (found.verdict, found.weighed.odd_specimen) == ("unexplained", NAMES[1])
    # Of two nobody can say which is the odd one.
    two = softer[softer.specimen < 2].compact()
    assert judge(BENCH, two, (DRIFT,)).weighed.odd_specimen == ""


def test_readings_that_are_off_by_themselves_do_not_count() -> None:
    table = readings({})
    values = table.value.copy()
    values[[5, 20]] += 40 * table.sigma[0]
    found = judge(BENCH, table.with_values(values), FEW)
    assert found.verdict == "nothing"
    assert np.flatnonzero(found.table.noise.off).tolist() == [5, 20]
    assert found.test_of_all is not None
    assert found.test_of_all.p_value < found.test.p_value


def exchanged(table: ReadingTable, specimen: int) -> ReadingTable:
    """The masses of a specimen stand for each other."""
    states = table.states
    first, second = np.unique(states.mass).tolist()
    mass = np.where(states.specimen == specimen, first + second - states.mass, states.mass)
    return replace(table, states=replace(states, mass=mass))


def test_exchanged_labels_are_found() -> None:
    found = judge(BENCH, exchanged(readings({}), 2), FEW)
    assert found.verdict != "nothing"
    labels = other_labels(found)
    assert labels is not None
    assert (labels.column, labels.part.specimen) == ("mass", NAMES[2])
    assert labels.after < 2 * len(found.table) < labels.before
    assert other_labels(judged({ZERO: 3.0})) is None


def test_exchanged_labels_are_found_beside_an_effect() -> None:
    found = judge(BENCH, exchanged(readings({SAG: 4.0}), 2), FEW)
    labels = other_labels(found)
    assert labels is not None
    assert labels.hypothesis == (SAG,)
    assert labels.after < 2 * len(found.table)


@pytest.mark.parametrize(("apart", "found"), [(0.1e-3, False), (1e-3, True)])
def test_labels_that_hardly_matter_are_not_told_though_they_fit_better(apart: float, found: bool
                                                                       ) -> None:
    """Exchanged, loads 0.1 g apart explain less than 30 more of χ²."""
    table = exchanged(readings({}, design(masses=(20e-3, 20e-3 + apart))), 2)
    fitted = nominal_fit(BENCH, table)
    assert (relabelling_of(BENCH, table, fitted) is not None) == found


def test_a_name_is_worth_nothing_where_the_noise_may_be_all_there_is() -> None:
    found = judged({DRIFT: 0.8})
    assert found.named == (DRIFT,)
    as_it_is, louder, far_louder = (probability_with_noise(found, factor)
                                    for factor in (1.0, 1.5, 3.0))
    assert found.posterior is not None
    assert as_it_is == pytest.approx(found.posterior.of_causes()[DRIFT], abs=0.01)
    assert louder is not None
    assert 0.9 < louder < 1.0
    assert far_louder == 0.0
    assert probability_with_noise(judged({}), 1.5) is None
    unnamed = replace(found, weighed=replace(found.weighed, named=()))
    assert probability_with_noise(unnamed, 1.5) is None


def test_a_slip_is_found_that_two_effects_hide() -> None:
    table = readings({ZERO: 4.0, SAG: 3.0})
    values = table.value.copy()
    values[8] += 60 * table.sigma[0]
    found = judge(BENCH, table.with_values(values), FEW)
    assert (found.verdict, set(found.named)) == ("named", {ZERO, SAG})
    assert np.flatnonzero(found.table.noise.off).tolist() == [8]


def of_unstated_noise(table: ReadingTable) -> ReadingTable:
    """The readings, where nobody says what their noise is."""
    return table.with_noise(replace(table.noise, source=SCATTER, freedom=0 * table.noise.freedom))


@pytest.mark.parametrize(("sizes", "no_sensor", "expected"), [
    ({DRIFT: 2.0}, True, "named"), ({DRIFT: 2.0}, False, "ambiguous"),
    ({ZERO: 4.0, SAG: 3.0, DRIFT: -4.0}, False, "unexplained")])
def test_nothing_is_named_where_it_may_be_the_sensor(
        sizes: dict[Cause, float], no_sensor: bool, expected: str,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdict, "_wandering", lambda *given: Wandering(40e-6, no_sensor))
    found = judge(BENCH, of_unstated_noise(readings(sizes)), FEW)
    assert (found.verdict, found.sensor.size, found.sensor.excluded) == (expected, 40e-6, no_sensor)
    assert found.named == ((DRIFT,) if expected == "named" else ())


def test_a_cause_that_is_much_more_probable_than_a_sensor_s_errors_is_named() -> None:
    found = judge(BENCH, of_unstated_noise(readings({DRIFT: 2.0})), FEW)
    assert (found.verdict, found.named) == ("named", (DRIFT,))
    assert 10e-6 < found.sensor.size < 200e-6
    assert found.sensor.excluded


def test_errors_of_a_sensor_that_wanders_are_no_cause_where_nobody_states_the_noise() -> None:
    """Readings one after the other are off alike, as a sensor's that wanders are."""
    generator, table = np.random.default_rng(5), design(voltages=11)
    errors = [0.0]
    for step in generator.standard_normal(len(table)):
        errors.append(0.9 * errors[-1] + (1 - 0.9**2) ** 0.5 * step)
    values = readings({}, table, noise=0.0).value + 60e-6 * np.array(errors[1:])
    stated = table.with_values(values)
    found = [judge(BENCH, read, FEW) for read in (stated, of_unstated_noise(stated))]
    assert [one.sensor.possible for one in found] == [False, True]
    assert found[1].named == ()
    assert 10e-6 < found[1].sensor.size < 200e-6


#: All that may be a little off on a rough bench.
EVERY = (*FEW, Cause("parallel_spring"), Cause("hysteresis"),
         *(Cause("prestretch_loss", name) for name in NAMES))


def on_a_rough_bench(share: float, table: ReadingTable) -> Judgement:
    """Everything off at a share of its usual size, and a large error of the zero."""
    generator = np.random.default_rng(2)
    sizes = {cause: share * abs(generator.normal()) for cause in EVERY}
    return judge(BENCH, readings(sizes | {ZERO: 15.0}, table), EVERY)


def test_small_errors_of_every_kind_leave_a_large_one_its_name() -> None:
    found = on_a_rough_bench(0.2, design(voltages=11, sigma=2e-6))
    assert (found.verdict, found.named) == ("named", (ZERO,))
    assert found.weighed.small_errors in (0.1, 0.2, 0.3)
    assert found.weighed.after is not None
    assert found.weighed.after.p_value > 0.02
    # What is said of a larger noise has small errors for noise already.
    assert probability_with_noise(found, 1.5) is None


def test_errors_that_may_well_be_large_are_no_explanation() -> None:
    """That they are small has a probability of 89 % here, by few voltages and a noise of 3 µm."""
    found = on_a_rough_bench(0.3, design(voltages=7, sigma=3e-6))
    assert (found.verdict, found.named, found.weighed.small_errors) == ("unexplained", (), None)


def test_an_effect_of_one_sign_is_not_found_with_the_other() -> None:
    assert one_sided(FEW) == {str(SAG)}
    found = judged({SAG: -3.0}, (SAG, ZERO))
    assert SAG not in found.named
    # Nor does what it would do with the wrong sign raise an alarm.
    column = np.linspace(-1.0, 1.0, 40)[:, None] ** 2
    tests = ResidualTests.of(np.ones((40, 1)), {"sag": column}, one_sided=frozenset({"sag"}))
    noise = np.random.default_rng(0).standard_normal(40)
    p_values = [tests(noise + size * column[:, 0], np.random.default_rng(1)).p_value
                for size in (4.0, -4.0)]
    assert p_values[0] < 1e-3 < 0.5 < p_values[1]
