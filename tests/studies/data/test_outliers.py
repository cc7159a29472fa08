"""Readings far off the curve of their ramp are told before any film is solved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.datasets import HEAD, write_dataset
from tympan.studies.data.checks import findings
from tympan.studies.data.dataset import read_dataset
from tympan.studies.data.outliers import outliers

NOISE, RAMPS = 10e-6, 4


def curve(share: float, count: int) -> np.ndarray:
    """Deflections [m] of a plate whose voltage goes up to a share of its fold's square."""
    squared = np.linspace(0, 1, count) ** 2
    return 2e-3 + 1e-3 * (1 - np.sqrt(1 - share * squared))


def written(folder: Path, read: list[np.ndarray], noise: float | None = NOISE) -> Path:
    rows = "".join(f"A,{18 + ramp},{6 * place / (len(values) - 1)},{1e3 * value:.7f}\n"
                   for ramp, values in enumerate(read) for place, value in enumerate(values))
    head = HEAD if noise is None else HEAD + f'noise = "{1e6 * noise} um"\n'
    return write_dataset(folder, head, ("A",),
                         static="specimen,mass_g,voltage_kV,displacement_mm\n" + rows)


def told(folder: Path, read: list[np.ndarray], noise: float | None = NOISE) -> list[int]:
    static = read_dataset(written(folder, read, noise)).static
    assert static is not None
    return [one.row for one in outliers(static, np.arange(len(static)), noise)]


def test_slips_are_told_and_good_readings_are_not(tmp_path: Path) -> None:
    """Of 0.2 to 1 mm, two of a ramp at times; anywhere but at the ramp's end."""
    random, hit, slips, wrong = np.random.default_rng(2), 0, 0, 0
    for _ in range(40):
        count = int(random.integers(9, 25))
        read = [curve(0.8, count) + NOISE * random.normal(size=count) for _ in range(RAMPS)]
        off = random.choice(count - 1, random.integers(1, 3), replace=False)
        read[1][off] += random.choice([-1, 1], len(off)) * random.uniform(2e-4, 1e-3, len(off))
        found = told(tmp_path / "data", read)
        there = set((count + off).tolist())
        hit, slips, wrong = hit + len(there & {*found}), slips + len(off), wrong + len(
            {*found} - there)
    assert hit >= 0.9 * slips
    assert wrong <= 1


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99])
@pytest.mark.parametrize("noise", [1e-7, 10e-6])
def test_a_film_near_its_fold_has_no_outliers(tmp_path: Path, share: float, noise: float) -> None:
    random = np.random.default_rng(4)
    for count in (6, 11, 30):
        read = [curve(share, count) + noise * random.normal(size=count) for _ in range(RAMPS)]
        assert told(tmp_path / "data", read, noise) == []
        assert told(tmp_path / "data", read, None) == []


def test_rounding_of_a_computer_is_no_outlier(tmp_path: Path) -> None:
    """Readings on a curve that fits them all but for a few last digits of one."""
    curved = 2e-3 + 3e-5 * np.arange(9.0) ** 2
    static = read_dataset(written(tmp_path / "data", [curved, curved])).static
    assert static is not None
    static.displacement[4] += 1e-12
    rows = np.arange(len(static))
    assert outliers(static, rows, None) == []
    static.displacement[4] += 1e-6
    assert [one.row for one in outliers(static, rows, None)] == [4]


@pytest.mark.parametrize(("factor", "words"), [
    (-1.0, "the sign is wrong"), (10.0, "ten times too large"), (0.1, "ten times too small")])
@pytest.mark.parametrize("place", [4, 10])
def test_a_sign_and_a_factor_of_ten_are_named(tmp_path: Path, factor: float, words: str,
                                              place: int) -> None:
    """Also of a ramp's last reading."""
    random = np.random.default_rng(6)
    read = [curve(0.7, 11) + NOISE * random.normal(size=11) for _ in range(RAMPS)]
    right = 1e3 * read[2][place]
    read[2][place] *= factor
    (one,) = (one for one in findings(read_dataset(written(tmp_path / "data", read)))
              if one.kind == "outlier")
    assert one.lines == (2 + 22 + place,)
    assert f"{right * factor:.4g} mm" in one.what
    assert words in one.what
    assert "notebook" in one.check
