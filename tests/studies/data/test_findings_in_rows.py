"""Rows as people make them: copies, a sensor's end, a zero that moved; and none of these."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.datasets import HEAD, write_dataset
from tympan.studies.data.checks import findings, summary
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.data.noise import repeat_noise
from tympan.studies.diagnosis.readings import prepared_readings

NOISE = 10e-6
TITLES = "specimen,mass_g,voltage_kV,displacement_mm,order,run\n"
STATED = 'noise = "10 um"\n' + HEAD

Row = tuple[str, float, float, float, str]


def deflection(specimen: str, mass: float, kv: float) -> float:
    """Of a weight on a spring that the voltage softens [mm]."""
    return mass / ((8.6 if specimen == "A" else 7.9) - 0.075 * kv**2)


def ramps(generator: np.random.Generator, voltages: int = 11, runs: tuple[str, ...] = ("",),
          noise: float = NOISE) -> list[Row]:
    """Both specimens under two masses, up to 6.5 kV, in each run."""
    return [(name, mass, kv, deflection(name, mass, kv) + 1e3 * noise * generator.normal(), run)
            for run in runs for name in ("A", "B") for mass in (17.9, 22.45)
            for kv in np.linspace(0, 6.5, voltages).round(3).tolist()]


def dataset(folder: Path, rows: list[Row], digits: int = 5, head: str = STATED) -> Dataset:
    text = "".join(f"{name},{mass},{kv},{read:.{digits}f},{number},{run}\n"
                   for number, (name, mass, kv, read, run) in enumerate(rows))
    return read_dataset(write_dataset(folder, head, static=TITLES + text))


def with_reads(rows: list[Row], change: Callable[..., float]) -> list[Row]:
    return [(name, mass, kv, change(number, read), run)
            for number, (name, mass, kv, read, run) in enumerate(rows)]


def test_clean_sets_have_nothing_found(tmp_path: Path) -> None:
    """100 sets of every kind of noise, display and order of reading: one may be called, at most.

    But for readings of a noise with heavy tails that are six standard deviations off.
    """
    called, far = list[int](), np.zeros(0)
    for seed in range(100):
        generator = np.random.default_rng(seed)
        runs = [("",), ("monday", "tuesday"), ("1", "2", "3")][seed % 3]
        rows = ramps(generator, int(generator.choice([4, 6, 8, 11, 15])), runs,
                     float(generator.choice([2e-6, 1e-5, 3e-5])))
        if seed % 2:
            far = tails = 1e3 * NOISE * generator.standard_t(3, len(rows))
            rows = with_reads(rows, lambda number, read, tails=tails: read + tails[number])
        if seed % 5 == 0:
            rows = [row for start in range(0, len(rows), 2) for row in rows[start: start + 2][::-1]]
        head = STATED if seed % 4 else HEAD
        made = dataset(tmp_path / "data", rows, digits=int(generator.choice([1, 2, 3, 4, 5])),
                       head=head)
        off = {number + 2 for number in np.flatnonzero(np.abs(far) > 6e3 * NOISE)} if (
            seed % 2 and seed % 5) else set[int]()
        called += [seed] if [one for one in findings(made) if not (
            one.kind == "outlier" and set(one.lines) <= off)] else []
    assert len(called) <= 1, called


@pytest.mark.parametrize("jitter", [0.0, 1e-5])
def test_pasted_rows_are_copies_and_count_once(tmp_path: Path, jitter: float) -> None:
    generator = np.random.default_rng(3)
    rows = ramps(generator)
    pasted = with_reads(rows[12:22], lambda number, read: read + generator.choice([-1, 1]) * jitter)
    made = dataset(tmp_path / "data", rows + pasted)
    (found,) = findings(made)
    assert found.kind == "copies"
    assert found.lines == tuple(range(46, 56))
    assert "lines 46 to 55 repeat lines 14 to 23" in found.what
    assert repeat_noise(made) is None
    assert len(prepared_readings(made).table) == len(rows)
    assert summary(made)["findings"][0]["lines"] == list(range(46, 56))


@pytest.mark.parametrize("order", [1, -1])
def test_a_ramp_pasted_to_another_specimen_is_a_copy(tmp_path: Path, order: int) -> None:
    rows = ramps(np.random.default_rng(4))
    reads = [read for *_, read, _ in rows[:11]][::order]
    wrong = with_reads(rows, lambda number, read: reads[number - 22] if 22 <= number < 33 else read)
    (found,) = findings(dataset(tmp_path / "data", wrong))
    assert found.kind == "copies"
    assert found.lines == tuple(range(24, 35))


@pytest.mark.parametrize("digits", [1, 2])
def test_what_a_display_rounds_alike_is_no_copy(tmp_path: Path, digits: int) -> None:
    rows = ramps(np.random.default_rng(5), runs=("1", "2", "3"))
    assert not list(findings(dataset(tmp_path / "data", rows, digits)))


def test_readings_without_noise_are_no_copies(tmp_path: Path) -> None:
    """What a simulation says twice is the same to the last digit, whatever noise is stated."""
    rows = ramps(np.random.default_rng(6), runs=("1", "2"), noise=0.0)
    assert not list(findings(dataset(tmp_path / "data", rows, digits=3)))


@pytest.mark.parametrize("jitter", [0.0, 1e-3])
def test_a_sensor_at_its_end_is_found_by_a_cluster(tmp_path: Path, jitter: float) -> None:
    generator = np.random.default_rng(7)
    rows = ramps(generator)
    end = with_reads(rows, lambda number, read: min(
        read, 3.1 + jitter * generator.uniform(-1, 1)))
    (found,) = findings(dataset(tmp_path / "data", end))
    assert found.kind == "sensor_end"
    above = [number + 2 for number, row in enumerate(rows) if row[3] > 3.11]
    assert len(above) > 5
    assert set(above) <= set(found.lines) <= {
        number + 2 for number, row in enumerate(rows) if row[3] > 3.09}
    used = prepared_readings(dataset(tmp_path / "data", end)).table
    assert len(used) == len(rows) - len(found.lines)


def test_the_zero_between_two_days_is_told_and_is_no_noise(tmp_path: Path) -> None:
    rows = ramps(np.random.default_rng(8), runs=("monday", "tuesday"))
    moved = with_reads(rows, lambda number, read: read + 0.09 * (number >= 44))
    made = dataset(tmp_path / "data", moved, head=HEAD)
    (found,) = findings(made)
    assert found.kind == "run_zero"
    assert found.lines == tuple(range(46, 90))
    assert made.run_zeros is not None
    (run, zero), = made.run_zeros.pairs()
    assert run == "tuesday"
    assert zero == pytest.approx(90e-6, abs=4 * NOISE / 22**0.5)
    noise = repeat_noise(made)
    assert noise is not None
    assert noise.size == pytest.approx(NOISE, rel=0.3)
    table = prepared_readings(made).table
    together = table.noise.total
    assert together == pytest.approx(np.hypot(noise.size, made.run_zeros.size), rel=1e-6)
    # A shift of one day against the other is hardly missed; the same of every other row is.
    day, odd = 90e-6 * (table.run == "tuesday"), 90e-6 * (np.arange(len(table)) % 2)
    missed = [float(np.sum(table.noise.whitened(shift) ** 2)) for shift in (day, odd)]
    assert missed[0] < 3 < 100 < missed[1]


def test_days_that_differ_in_more_than_a_zero_have_none(tmp_path: Path) -> None:
    """As a way up and a way down do."""
    rows = ramps(np.random.default_rng(9), runs=("up", "down"))
    wide = with_reads(rows, lambda number, read: read + 0.09 * np.sin(
        np.pi * (number % 11) / 10) * (number >= 44))
    made = dataset(tmp_path / "data", wide)
    assert made.run_zeros is None or made.run_zeros.scatter.size > 2 * NOISE
