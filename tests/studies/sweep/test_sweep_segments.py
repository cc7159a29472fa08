"""Sweeps over the voltages of segments, and over their shares by the segments' names."""

from __future__ import annotations

from pathlib import Path

import pytest

from tympan.base.errors import InputError
from tympan.studies.sweep.plan import Sweep, read_sweep

HALVES = """
name = "halves"
[frame]
shape = "circle"
radius = "4.5 cm"
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = 2.2360679775
relative_permittivity = 4.7
material = { law = "neo_hooke", mu = "20 kPa" }
[[electrode.segment]]
name = "A"
sector = ["0 deg", "180 deg"]
[[electrode.segment]]
name = "B"
sector = ["180 deg", "360 deg"]
"""


def planned(folder: Path, more: str) -> Sweep:
    (folder / "halves.toml").write_text(HALVES)
    (folder / "SWEEP.toml").write_text(f'specimen = "halves.toml"\nmass = "17.9 g"\n{more}')
    return read_sweep(folder / "SWEEP.toml")


def driven(sweep: Sweep) -> list[tuple[float, ...]]:
    """Voltages of the segments of every film [V]."""
    return [tuple(segment.share * entry.voltages[0]
                  for segment in entry.task.specimen.electrode.segments)
            for entry in sweep.entries if entry.task]


@pytest.mark.parametrize("written", [
    'voltage = ["A = 3 kV, B = 0 kV", "A = 1 kV, B = 2 kV"]',
    'voltage = { A = ["3 kV", "1 kV"], B = ["0 kV", "2 kV"] }',
    '[grid]\nvoltage = ["A = 3 kV", "A = 1 kV, B = 2 kV"]'])
def test_voltages_by_segment_are_those_of_every_film(tmp_path: Path, written: str) -> None:
    sweep = planned(tmp_path, written)
    assert driven(sweep) == [pytest.approx((3e3, 0.0)), pytest.approx((1e3, 2e3))]
    assert [entry.choice["voltage_B"] for entry in sweep.entries] == ["0 V", "2000 V"]


def test_a_range_of_one_segment_crosses_the_grid(tmp_path: Path) -> None:
    sweep = planned(tmp_path, '''
voltage = { A = { from = "0 kV", to = "4 kV", count = 5 }, B = "1 kV" }
[grid]
"membrane.thickness" = ["1 mm", "0.9 mm"]''')
    assert driven(sweep)[::2] == [
        pytest.approx((1e3 * number, 1e3)) for number in range(5)]


@pytest.mark.parametrize("name", ["1", "B"])
def test_shares_are_keys_by_number_or_name(tmp_path: Path, name: str) -> None:
    sweep = planned(tmp_path, f'''
voltage = "2 kV"
[grid]
"electrode.segment.{name}.share" = [0.25, 0.5]''')
    assert driven(sweep) == [pytest.approx((2e3, 500.0)), pytest.approx((2e3, 1e3))]


@pytest.mark.parametrize(("written", "words"), [
    ('voltage = ["A = 3 kV", "E = 1 kV"]', "name of a segment: A, B"),
    ('voltage = ["A = 3 kV", "2 kV"]', "in all voltages, or in none"),
    ('voltage = "A = 80 %"', "must be voltages"),
    ('voltage = "2 kV"\n[grid]\n"electrode.segment.E.share" = [0.5, 1]', "by name A, B")])
def test_wrong_segments_are_named(tmp_path: Path, written: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        planned(tmp_path, written)
