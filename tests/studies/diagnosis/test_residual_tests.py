"""What jumps is no noise, and no test hangs on the last digit of what it is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.trials.unmodelled_faults import Jump, Stick
from tests.support.costs import dear
from tests.support.trials import design, every_cause, few_causes
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import signatures
from tympan.studies.diagnosis.inference.projection import orthonormal
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests
from tympan.studies.diagnosis.inference.verdict import ALARM, judge
from tympan.studies.diagnosis.patterns.reading_patterns import over, patterns
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.simulation import Simulation

NAMES = ("circular", "elliptical-small", "elliptical-large")
SIGMA = 20e-6


class Bench:
    """The nominal model at the paper's three actuators, linear about nominal films."""

    def __init__(self, simulation: Simulation, sigma: float = SIGMA) -> None:
        table = design(sigma)
        table = replace(table, order=np.arange(float(len(table))))
        at_rest = Prediction(simulation, (), np.zeros(2), table)
        self.table: ReadingTable = table.with_values(at_rest.values)
        self.jacobian = at_rest.jacobian / sigma
        self.columns = over(patterns(self.table, NAMES, at_rest.values), self.table)

    def tests(self, more: dict[str, np.ndarray]) -> ResidualTests:
        return ResidualTests.of(self.jacobian, self.columns | more)

    def left(self, values: np.ndarray) -> np.ndarray:
        """Residuals of readings at the best fit."""
        residual = (values - self.table.value) / self.table.sigma
        taken = np.linalg.qr(self.jacobian)[0]
        return np.asarray(residual - taken @ (taken.T @ residual))


@pytest.fixture(scope="module")
def bench(three_shapes: Simulation) -> Bench:
    return Bench(three_shapes)


def test_plates_that_rub_are_seen(bench: Bench) -> None:
    """By tests of what is smooth alone, one in three is."""
    generator, tests, alarms = np.random.default_rng(4), bench.tests({}), []
    for _ in range(40):
        rubs = Stick(abs(generator.normal(0, 150e-6)))
        values = rubs.shown(bench.table.value, bench.table.states)
        values = values + SIGMA * generator.standard_normal(len(values))
        alarms.append(tests(bench.left(values), generator).p_value < ALARM)
    assert np.mean(alarms) > 0.6


@pytest.mark.parametrize("reading", [20, 51, 83])
def test_a_knock_is_told_with_its_reading(bench: Bench, reading: int) -> None:
    generator = np.random.default_rng(reading)
    knocked = Jump(150e-6, reading).shown(bench.table.value, bench.table.states)
    knocked = knocked + SIGMA * generator.standard_normal(len(knocked))
    result = bench.tests({})(bench.left(knocked), generator)
    assert min(result.p_values, key=lambda name: result.p_values[name]) == "step"
    assert abs(result.reading - (reading + 1)) <= 1
    assert result.words("step") == f"from reading {result.reading} on, readings are shifted"
    found = bench.table.noise.known(60.0)
    assert bench.tests({})(bench.left(knocked), generator, found).p_value < 1e-3


def test_jumps_are_no_noise(bench: Bench) -> None:
    """The scatter is found without them; without jumps, nothing is taken from it."""
    generator, tests = np.random.default_rng(8), bench.tests({})
    noise = SIGMA * generator.standard_normal((len(bench.table), 10))
    plain, *jumping = (
        np.mean([tests.noise(bench.left(values + row)) for row in noise.T]) for values in (
            bench.table.value, *(Stick(threshold).shown(bench.table.value, bench.table.states)
                                 for threshold in (80e-6, 140e-6, 250e-6, 400e-6))))
    assert plain == pytest.approx(1.0, abs=0.05)
    assert jumping == pytest.approx(np.ones(4), abs=0.5)


@pytest.mark.parametrize("factor", [1.0, 1.5, 1 / 1.5])
def test_noise_alone_rarely_alarms_though_misstated(bench: Bench, factor: float) -> None:
    generator, tests = np.random.default_rng(6), bench.tests({})
    alarms = [tests(factor * bench.left(bench.table.value + SIGMA * row), generator).p_value < ALARM
              for row in generator.standard_normal((60, len(bench.table)))]
    assert np.mean(alarms) <= 0.05 + 2 * (0.05 * 0.95 / 60) ** 0.5


@pytest.mark.parametrize("seed", range(4))
def test_the_last_digits_of_columns_move_no_probability(bench: Bench, three_shapes: Simulation,
                                                        seed: int) -> None:
    generator = np.random.default_rng(seed)
    signs = {str(cause): sign for cause, sign in signatures(
        three_shapes, bench.table, np.zeros(2), every_cause(three_shapes)).items()}
    residual = bench.left(bench.table.value + SIGMA * generator.standard_normal(len(bench.table)))
    residual = residual + 2 * bench.columns["level"][:, 0] / np.abs(bench.columns["level"]).max()

    def p_value(size: float) -> float:
        def near(columns: np.ndarray) -> np.ndarray:
            moved = size * np.abs(columns).max() * generator.standard_normal(columns.shape)
            return np.asarray(columns + moved)

        columns = {name: near(values) for name, values in (bench.columns | signs).items()}
        tests = ResidualTests.of(near(bench.jacobian), columns)
        return tests(residual, np.random.default_rng(1)).p_value

    assert p_value(1e-10) == pytest.approx(p_value(0.0), abs=1e-6)


class Nowhere:
    """A simulation whose films have no equilibrium, whatever their sizes."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def __getattr__(self, name: str) -> Any:
        return getattr(self._simulation, name)

    @staticmethod
    def predict(hypothesis: Any, unknowns: Any, table: Any) -> np.ndarray:
        return np.full(len(table), np.nan)


def test_films_without_equilibrium_show_nothing_and_end_the_search(bench: Bench,
                                                                    three_shapes: Simulation
                                                                    ) -> None:
    """A fit at the end of its bounds may be of such films: halving of sizes never ended."""
    cause = Cause("sensor_zero")
    shown = signatures(cast(Any, Nowhere(three_shapes)), bench.table, np.zeros(2), [cause])
    assert not shown[cause].any()


@pytest.mark.parametrize("causes", [few_causes, dear(every_cause, seconds=33)])
def test_what_sticks_and_jumps_is_unexplained(
        three_shapes: Simulation, causes: Callable[[Simulation], list[Cause]]) -> None:
    """An effect of the library that takes some of it away leaves jumps."""
    table = Bench(three_shapes, sigma=10e-6).table
    noise = table.sigma * np.random.default_rng(3).standard_normal(len(table))
    table = table.with_values(Stick(200e-6).shown(table.value, table.states) + noise)
    judged = judge(three_shapes, table, causes(three_shapes))
    assert judged.verdict == "unexplained"
    assert judged.test.noise < 1.5
    assert fit(three_shapes, (), table).chi_squared > 1.5 * len(table)


def test_a_span_is_found_where_divide_and_conquer_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it does on one set of coupons' patterns, all of finite numbers near 1."""
    columns = np.random.default_rng(0).standard_normal((12, 5))
    usual = orthonormal(columns)

    def failing(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", failing)
    other = orthonormal(columns)
    assert other @ other.T == pytest.approx(usual @ usual.T, abs=1e-12)


def test_readings_that_are_off_do_not_hide_one_another() -> None:
    """Three of the same size: each alone is hidden by what the other two add to the scatter."""
    drawn = np.random.default_rng(4)
    ramp = np.linspace(-1.0, 1.0, 32)
    tests = ResidualTests.of(np.vander(ramp, 2), {
        "bent": np.vander(ramp, 5)[:, :3], "single": np.eye(len(ramp))}, 0.0)
    noise = drawn.normal(size=len(ramp))
    assert tests.noise(noise) == pytest.approx(1.0, abs=0.35)
    noise[[5, 18, 30]] += (10.0, -10.0, 10.0)
    assert tests.noise(noise) == pytest.approx(1.0, abs=0.35)
