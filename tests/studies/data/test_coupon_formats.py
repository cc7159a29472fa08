"""Coupons in the formats of published data: recognised, read alike by every command, or refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tympan.cli import main
from tympan.studies.data.coupon import read_coupons
from tympan.studies.data.dataset import read_dataset

FILM = """name = "published"
[[specimen]]
name = "strip"
frame = { shape = "circle", radius = "1 cm" }
[specimen.membrane]
prestretch = [1, 1]
thickness = "0.5 mm"
relative_permittivity = 4.7
material = { law = "neo_hooke", mu = "20 kPa" }
"""
HEAD = "id;description;temp;vel;stretch;stress"
CYCLE = f"{HEAD}\n7;20°C, up;293,15;0,1;1;0\n7;20°C, up;293,15;0,1;1,5;21111,1\n" \
        "7;20°C, up;293,15;0,1;1,2;10111,1\n8;60°C;333,15;0,05;1;0\n8;60°C;333,15;0,05;1,1;5000\n"


def written(folder: Path, **texts: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "dataset.toml").write_text(FILM, encoding="utf-8")
    for name, text in texts.items():
        stem, _, suffix = name.rpartition("__")
        (folder / f"{stem}.{suffix}").write_text(text, encoding="latin-1")
    return folder


def pairs(power: float) -> str:
    """A sheet of 0.4 MPa, mode by its second stretch."""
    return "".join(f"  {0.4 * (x - x ** (-3 - 2 * power)):.4f}    {x:.4f}\n"
                   for x in (1.1, 1.3, 1.6, 2.0))


def test_a_digitised_table_is_read_with_its_units_and_times(tmp_path: Path) -> None:
    file = written(tmp_path, cycles__csv=CYCLE) / "cycles.csv"
    coupons = read_coupons(file)
    assert set(coupons.mode) == {"uniaxial"}
    assert coupons.run.tolist() == ["cycles 7"] * 3 + ["cycles 8"] * 2
    assert coupons.stretch.tolist() == [1, 1.5, 1.2, 1, 1.1]
    assert coupons.stress[1] == 21111.1
    assert coupons.degrees == pytest.approx([20, 20, 20, 60, 60])
    assert coupons.time == pytest.approx([0, 5, 8, 0, 2])
    assert coupons.line.tolist() == [2, 3, 4, 5, 6]
    charged = written(tmp_path, under_pure_shear__csv="id;description;temp;voltage;vel;stretch;"
                      "stress\n3;x;296,15;6000;0,2;1;0\n") / "under_pure_shear.csv"
    assert read_coupons(charged).mode.tolist() == ["pure_shear"]
    assert read_coupons(charged).volts.tolist() == [6e3]
    plain = written(tmp_path, slow__csv="id,stretch,stress\n1,2,35000\n") / "slow.csv"
    assert np.isnan(read_coupons(plain).time).all()


def test_modes_in_the_names_of_files_are_one_set_of_tests(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = written(tmp_path / "d", rubber_uniaxial__txt=pairs(-0.5),
                     rubber_equibiaxial__txt=pairs(1.0), rubber_pure_shear__txt=pairs(0.0))
    files = sorted(map(str, folder.glob("*.txt")))
    assert main(["material", "fit", *files, "--law", "neo_hooke", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["readings"] == {"uniaxial": 4, "equibiaxial": 4, "pure_shear": 4}
    assert said["fits"][0]["constants"]["mu"]["value"] == pytest.approx(0.4e6, rel=1e-3)
    coupons = read_dataset(folder).coupons
    assert coupons is not None
    assert set(coupons.specimen) == {"rubber"}
    assert main(["data", str(folder), "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [file["readings"] for file in listed["files"]] == [None, 4, 4, 4]
    assert any("pairs of nominal stress in MPa" in words for words in listed["warnings"])


def test_published_files_are_diagnosed_as_coupon_csv_is(tmp_path: Path) -> None:
    from tympan.studies.diagnosis.evidence.coupon_readings import coupon_readings

    stretch = np.linspace(1.05, 2.5, 12)
    stress = 20e3 * (stretch - stretch**-2)
    digitised = "id,stretch,stress\n" + "".join(
        f"1,{x:.6f},{s:.4f}\n" for x, s in zip(stretch, stress, strict=True))
    usual = "mode,stretch,nominal_stress_Pa\n" + "".join(
        f"uniaxial,{x:.6f},{s:.4f}\n" for x, s in zip(stretch, stress, strict=True))
    published, plain = (coupon_readings(read_dataset(folder)).table for folder in (
        written(tmp_path / "a", slow__csv=digitised), written(tmp_path / "b", coupon__csv=usual)))
    assert published.value.tolist() == plain.value.tolist()
    assert set(published.file.tolist()) == {"slow.csv"}


@pytest.mark.parametrize(("name", "text", "message"), [
    ("cycles__csv", CYCLE.replace("0,05;1,1", "0;1,1"),
     "cycles.csv: line 6, column 4 (vel): given '0': must be positive"),
    ("cycles__csv", CYCLE.replace("333,15;0,05;1,1", "warm;0,05;1,1"),
     "cycles.csv: line 6, column 3 (temp): given 'warm': must be a number"),
    ("cycles__csv", CYCLE.replace("1,5;21111,1", "1,5"),
     "cycles.csv: line 3: given '5 cells': must have 6 cells"),
    ("spectra__csv", "id;freq;dielec\n1;°;4,9\n", "a line with mode, stretch"),
    ("spectra__csv", "id;freq;dielec\n1;0,1;4,9\n",
     "spectra.csv: line 1: given 'id, freq, dielec': has no heading that is known: expected is"),
    ("a_uniaxial__txt", "1 1.1\n1 2 3\n", "a_uniaxial.txt: line 2: given '5 cells'"),
    ("strips__txt", "0.1 1.1\n0.2 1.3\n", "a line with mode, stretch, nominal_stress_kPa"),
])
def test_what_no_reader_knows_is_refused_with_what_was_expected(
        name: str, text: str, message: str, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    stem, _, suffix = name.rpartition("__")
    folder = written(tmp_path, **{name: text})
    assert main(["material", "fit", str(folder / f"{stem}.{suffix}")]) == 2
    assert message in capsys.readouterr().err


def test_a_file_beside_readings_that_nobody_reads_is_said_with_what_is_read(
        tmp_path: Path) -> None:
    folder = written(tmp_path, slow__csv="id,stretch,stress\n1,2,35000\n",
                     spectra__csv="id;freq;dielec\n1;0,1;4,9\n")
    remark, = (words for words in read_dataset(folder).remarks if "spectra.csv" in words)
    assert "coupon.csv" in remark
    assert "digitised tests of VHB tape" in remark
