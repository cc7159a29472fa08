"""What a dataset is warned of before anything is concluded from it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.support.datasets import HEAD, write_dataset
from tympan.base.errors import InputError
from tympan.studies.data.checks import dataset_warnings, slips_of_sign
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.data.findings import step_of
from tympan.studies.diagnosis.readings import prepared_readings

ROWS = "specimen,mass_g,voltage_kV,displacement_mm\n"


def written(folder: Path, shown: str = "{:.4f}", head: str = HEAD, sign: float = 1.0,
            zero: float = 0.0, repeats: int = 1) -> Dataset:
    """Two specimens under two masses, their deflections shown some way."""
    rows = [(name, mass, kv, 1e-4 * repeat) for name in ("A", "B") for mass in (17.9, 22.45)
            for kv in (0, 1.3, 2.7, 4.1, 6) for repeat in range(repeats)]
    text = "".join(f"{name},{mass},{kv}," + shown.format(
        zero + sign * (0.1063 * mass + 0.0317 * kv**2 + more)) + "\n"
        for name, mass, kv, more in rows)
    return read_dataset(write_dataset(folder, head, static=ROWS + text))


@pytest.mark.parametrize("zero", [0.0, 30.0])
def test_a_distance_is_no_deflection(tmp_path: Path, zero: float) -> None:
    upside_down = written(tmp_path / "data", sign=-1.0, zero=zero)
    assert any("displacement falls" in words for words in dataset_warnings(upside_down))
    with pytest.raises(InputError, match="the displacement falls as voltage and mass rise"):
        prepared_readings(upside_down)


def test_what_rises_with_the_mass_or_the_voltage_has_the_right_sign(tmp_path: Path) -> None:
    assert not list(slips_of_sign(written(tmp_path / "data", zero=-5.0)))
    falling = "".join(f"A,{mass},{kv},{0.1 * mass - 0.001 * kv**2}\n"
                      for mass in (17.9, 22.45) for kv in range(6))
    assert not list(slips_of_sign(read_dataset(write_dataset(tmp_path / "b", static=ROWS
                                                             + falling))))


def test_a_plate_that_rises_with_the_voltage_is_told_before_anything_is_fitted(tmp_path: Path
                                                                               ) -> None:
    rising = "".join(f"A,{mass},{kv},{0.1 * mass - 0.03 * kv**2}\n"
                     for mass in (17.9, 22.45) for kv in range(6))
    dataset = read_dataset(write_dataset(tmp_path / "data", static=ROWS + rising))
    with pytest.raises(InputError, match="the plate goes the wrong way: heavier masses pull it "
                                         "further down, but it rises with the voltage"):
        prepared_readings(dataset)


@pytest.mark.parametrize(("mass_goes", "voltage_goes", "told"), [
    (-0.1, -0.03, "the displacement of B falls as voltage and mass rise, but that of other films "
                  "rises .* Is the sign of its rows exchanged"),
    (0.1, -0.03, "the plate of B goes the wrong way.*, but that of other films rises"),
    (0.1, -0.001, None)])
def test_one_film_with_another_sign_is_told_among_others(
        tmp_path: Path, mass_goes: float, voltage_goes: float, told: str | None) -> None:
    films = ("A", 0.1, 0.03), ("B", mass_goes, voltage_goes)
    rows = "".join(f"{name},{mass},{kv},{by_mass * mass + by_voltage * kv**2}\n"
                   for name, by_mass, by_voltage in films
                   for mass in (17.9, 22.45) for kv in range(6))
    said = " ".join(slips_of_sign(read_dataset(write_dataset(tmp_path / "data",
                                                             static=ROWS + rows))))
    assert said == "" if told is None else re.search(told, said)


@pytest.mark.parametrize(("shown", "step"), [("{:.1f}", 1e-4), ("{:.2f}", 1e-5), ("{:.4f}", 1e-7)])
def test_steps_of_a_display(tmp_path: Path, shown: str, step: float) -> None:
    dataset = written(tmp_path / "data", shown)
    assert dataset.static is not None
    assert step_of(dataset.static.displacement) == pytest.approx(step)
    assert step_of(5 * dataset.static.displacement) == pytest.approx(5 * step)
    assert step_of(np.ones(3)) == 0.0


def test_readings_that_are_rounded_alike_count_as_one(tmp_path: Path) -> None:
    fine, rounded = (prepared_readings(written(
        tmp_path / shown[3], shown, 'noise = "20 um"\n' + HEAD, repeats=3)).table
        for shown in ("{:.4f}", "{:.1f}"))
    assert len(fine) == 3 * len(rounded)
    assert fine.sigma == pytest.approx(20e-6)
    assert rounded.sigma == pytest.approx(np.hypot(20e-6 / 3**0.5, 50e-6))


def test_rounding_beyond_the_noise_is_warned_of(tmp_path: Path) -> None:
    for shown, warned in (("{:.1f}", True), ("{:.2f}", False)):
        dataset = written(tmp_path / shown[3], shown, 'noise = "20 um"\n' + HEAD, repeats=2)
        assert any("in steps of" in words for words in dataset_warnings(dataset)) is warned
