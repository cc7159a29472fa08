"""Columns of segments: voltages by name, patterns, and messages about segments that are not there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.hidden_segments import QUARTERS
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.electrode import OFF
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.data.noise import repeat_groups
from tympan.studies.data.segment_columns import capacitances_of, shares_of

ALL = "voltage_A_kV,voltage_B_kV,voltage_C_kV,voltage_D_kV"


def dataset_of(folder: Path, titles: str, *rows: str) -> Dataset:
    """A film with four segments and one in one piece, and static readings."""
    (folder / "quarters.toml").write_text(specimen_to_toml(QUARTERS), encoding="utf-8")
    (folder / "disc.toml").write_text(specimen_to_toml(circular()), encoding="utf-8")
    (folder / "dataset.toml").write_text(
        'name = "set"\nnoise = "20 um"\n[[specimen]]\nfile = "quarters.toml"\n[[specimen]]\n'
        'file = "disc.toml"\n', encoding="utf-8")
    (folder / "static.csv").write_text("\n".join([titles, *rows]) + "\n", encoding="utf-8")
    return read_dataset(folder)


def test_a_row_has_the_highest_voltage_of_its_segments(tmp_path: Path) -> None:
    """With shares by the numbers of segments; blank segments have none, and whole films their own.
    """
    data = dataset_of(tmp_path, f"specimen,mass_g,voltage_kV,{ALL},displacement_mm,tilt_x_mrad,"
                                "capacitance_B_pF",
                      "quarters,15,,4,,2,,2.1,-3.5,120", "quarters,15,3,,,,,2.2,,",
                      "circle,15,3,,,,,2.3,,", "quarters,15,4,,4,,,2.1,1,")
    static = data.static
    assert static is not None
    assert static.voltage == pytest.approx([4e3, 3e3, 3e3, 4e3])
    assert static.drive.tolist() == ["A 1, C 0.5", "", "", "B 1"]
    shares = shares_of(static, data.specimens)
    assert shares[0] == pytest.approx([1, 0, 0.5, 0])
    assert np.isnan(shares[1:3]).all()
    assert shares[3] == pytest.approx([0, 1, 0, 0])
    assert static.tilt_x[0] == pytest.approx(-3.5e-3)
    assert [read[0] for read in capacitances_of(static, data.specimens)] == pytest.approx(
        [np.nan, 120e-12, np.nan, np.nan], nan_ok=True)


def test_patterns_of_voltages_are_no_repeats(tmp_path: Path) -> None:
    """Two segments at one voltage each are two states; a blank row of segments alone has 0 V."""
    data = dataset_of(tmp_path, f"specimen,mass_g,{ALL},displacement_mm", "quarters,15,4,,,,2.1",
                      "quarters,15,,4,,,2.2", "quarters,15,4,,,,2.15", "quarters,15,,,,,1.5")
    assert data.static is not None
    assert repeat_groups(data.static).tolist() == [0, 1, 0, 2]
    assert data.static.voltage[3] == 0


@pytest.mark.parametrize(("titles", "row", "message"), [
    (f"specimen,mass_g,voltage_kV,{ALL},displacement_mm", "circle,15,3,,4,,,2.1",
     "circle has no segment B; its electrode is in one piece"),
    (f"specimen,mass_g,voltage_kV,{ALL},displacement_mm", "quarters,15,3,4,,,,2.1",
     "must be left blank, or be the highest voltage of the segments, 4 kV"),
    (f"specimen,mass_g,voltage_kV,{ALL},displacement_mm", "quarters,15,,,,,,2.1",
     "must be a number, or a segment must have a voltage"),
    (f"specimen,mass_g,{ALL},displacement_mm", "quarters,15,-4,,,,2.1",
     "must be from 0 to 1000 kV"),
])
def test_messages(tmp_path: Path, titles: str, row: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        dataset_of(tmp_path, titles, row)


def test_a_lead_takes_the_voltage_of_another_name() -> None:
    """Exchanged leads exchange voltages; one that is off leaves its segment without."""
    segments = QUARTERS.electrode.segments
    wired = [("B", "A", "C", "D"), ("A", OFF, "C", "D"), (None, None, None, None)]
    found = [QUARTERS.electrode.__class__(segments=tuple(
        segment.__class__(name=segment.name, sector=segment.sector, lead=lead)
        for segment, lead in zip(segments, leads, strict=True))) for leads in wired]
    assert [each.arriving([1.0, 0.5, 0.2, 0.1]) for each in found] == [
        [0.5, 1.0, 0.2, 0.1], [1.0, 0.0, 0.2, 0.1], [1.0, 0.5, 0.2, 0.1]]
    electrode, top = found[0].driven({"A": 3e3})
    assert (top, electrode.share(np.arange(4)).tolist()) == (3e3, [0, 1, 0, 0])
    # A quarter in the first one's place is driven, and none is where a lead alone was driven.
    assert not electrode.mirrored_in("x")
    assert found[1].driven({"B": 3e3})[0].share(np.arange(4)).tolist() == [0, 0, 0, 0]


def test_in_time_segments_keep_the_proportion_of_the_file(tmp_path: Path) -> None:
    """As a column of each, or as the film's voltage alone."""
    def read(*rows: str) -> Dataset:
        (tmp_path / "transient.csv").write_text("\n".join([
            f"specimen,mass_g,run,t_s,{ALL},displacement_mm", *rows]) + "\n", encoding="utf-8")
        return dataset_of(tmp_path, f"specimen,mass_g,{ALL},displacement_mm",
                          "quarters,15,4,,,,2.1")

    transient = read("quarters,15,1,0,,,,,1.9", "quarters,15,1,1,3,3,3,3,2.1",
                     "quarters,15,1,2,3,3,3,2.99,2.1").transients
    assert transient is not None
    assert transient.voltage == pytest.approx([0, 3e3, 3e3])
    with pytest.raises(InputError, match="in the proportion of the segments' shares") as error:
        read("quarters,15,1,0,,,,,1.9", "quarters,15,1,1,3,3,3,,2.1")
    assert "line 3" in str(error.value)
    assert "A 1, B 1, C 1, D 1" in str(error.value)
