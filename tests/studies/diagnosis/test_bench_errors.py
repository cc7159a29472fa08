"""Errors of voltages and the scatter of films count as what they do to readings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.datasets import HEAD, write_dataset
from tests.support.trials import design, every_cause
from tympan.base.errors import InputError
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.bench_errors import with_film_scatter, with_voltage_errors
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation

NOISE, VOLTS, SHARE = 10e-6, 40.0, 0.05


def ranges(simulation: Simulation) -> ReadingTable:
    """Deflections, and after them how far some plates move from their first voltage."""
    table = design(NOISE, voltages=6)
    last = np.arange(5, len(table), 6)
    moved = replace(table[last], kind=np.full(len(last), "range"), since=last - 5)
    # Of the same states, which joining would double.
    table = replace(table, noise=table.noise.joined(moved.noise), **{
        name: np.concatenate([getattr(table, name), getattr(moved, name)])
        for name in ("kind", "state", "since", "value", "order", "run", "file", "line", "point")})
    return table.with_values(simulation.predict((), np.zeros(2), table))


def covariance(table: ReadingTable) -> np.ndarray:
    """Of all errors, without each reading's own."""
    whole = table.noise.coloured(np.eye(len(table)))
    return np.asarray(whole @ whole.T - NOISE**2 * np.eye(len(table)))


def test_voltages_that_are_off_are_the_scatter_they_make(three_shapes: Simulation) -> None:
    """Also of ranges, which share a state with deflections: by readings at 2,000 sets of voltages.
    """
    table = ranges(three_shapes)
    nominal = fit(three_shapes, (), table, np.zeros(2))
    random, states = np.random.default_rng(1), table.states
    errors = np.stack([three_shapes.predict((), nominal.unknowns, replace(table, states=replace(
        states, voltage=np.abs(states.voltage + VOLTS * random.normal(size=len(states)))))) - (
            table.value) for _ in range(400)])
    found = covariance(with_voltage_errors(table, VOLTS, three_shapes, nominal))
    drawn = np.cov(errors.T)
    charged = table.voltage > 1e3
    size = np.sqrt(np.diag(found))[charged]
    assert size == pytest.approx(np.sqrt(np.diag(drawn))[charged], rel=0.15)
    assert size.max() > 3 * NOISE
    both = np.outer(size, size)
    assert (found[np.ix_(charged, charged)] / both) == pytest.approx(
        drawn[np.ix_(charged, charged)] / both, abs=0.25)


def test_films_that_differ_share_their_own_factors(three_shapes: Simulation) -> None:
    """A film's readings are off together, by the slopes of its factors; those of others are not."""
    table = ranges(three_shapes)
    nominal = fit(three_shapes, (), table, np.zeros(2))
    found = covariance(with_film_scatter(table, SHARE, three_shapes, nominal))
    step, same = 1e-4, table.specimen[:, None] == table.specimen
    slopes = np.stack([(three_shapes.predict((), nominal.unknowns + step * side, table)
                        - three_shapes.predict((), nominal.unknowns - step * side, table)
                        ) / (2 * step) for side in np.eye(2)], axis=1)
    assert found == pytest.approx(np.where(same, SHARE**2 * slopes @ slopes.T, 0.0),
                                  abs=1e-3 * np.abs(found).max())


def judged(simulation: Simulation, table: ReadingTable) -> Judgement:
    return judge(simulation, table, every_cause(simulation))


@pytest.mark.study(seconds=13)
def test_noise_is_as_stated_where_voltages_are_off(three_shapes: Simulation) -> None:
    """Without, all readings count as noisier; with, a zero is better known for those at 0 V."""
    table, random = design(NOISE), np.random.default_rng(3)
    states = table.states
    off = replace(states, voltage=np.abs(states.voltage + VOLTS * random.normal(size=len(states))))

    def read(hypothesis: tuple[Cause, ...], sizes: list[float]) -> ReadingTable:
        values = three_shapes.predict(hypothesis, np.array([0.05, -0.03, *sizes]),
                                      replace(table, states=off))
        return table.with_values(values + NOISE * random.normal(size=len(table)))

    def counted(read: ReadingTable) -> ReadingTable:
        return with_voltage_errors(read, VOLTS, three_shapes,
                                   fit(three_shapes, (), read, np.zeros(2)))

    null = read((), [])
    assert judged(three_shapes, null).test.noise > 1.4
    as_stated = judged(three_shapes, counted(null))
    assert as_stated.verdict == "nothing"
    assert as_stated.test.noise == pytest.approx(1.0, abs=0.2)
    zero = (Cause("sensor_zero"),)
    moved = read(zero, [1e-4])
    without, with_them = (judged(three_shapes, table) for table in (moved, counted(moved)))
    assert with_them.named == zero
    fits = [one.posterior.fit_of(zero) for one in (without, with_them) if one.posterior]
    assert fits[1].deviations[2] < 0.9 * fits[0].deviations[2]
    assert abs(fits[1].unknowns[2] - 1e-4) < 3 * fits[1].deviations[2]


def test_films_that_differ_are_no_misfit(three_shapes: Simulation) -> None:
    table, random = design(NOISE), np.random.default_rng(5)
    values = np.zeros(len(table))
    for specimen in range(3):
        rows = table.specimen == specimen
        values[rows] = three_shapes.predict((), SHARE * random.normal(size=2), table)[rows]
    null = table.with_values(values + NOISE * random.normal(size=len(table)))
    nominal = fit(three_shapes, (), null, np.zeros(2))
    assert nominal.chi_squared > 10 * len(null)
    assert judged(three_shapes, with_film_scatter(null, SHARE, three_shapes, nominal)
                  ).verdict == "nothing"


@pytest.mark.parametrize("line", ['voltage_noise = "-1 V"', "film_scatter = 1.5"])
def test_sizes_that_cannot_be_are_refused(tmp_path: Path, line: str) -> None:
    written = write_dataset(tmp_path / "data", HEAD + line + "\n",
                            static="specimen,mass_g,voltage_kV,displacement_mm\nA,18,0,2\n")
    with pytest.raises(InputError, match=line.split()[0]):
        read_dataset(written)
