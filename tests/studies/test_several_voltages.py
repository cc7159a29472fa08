"""Several voltages of segments in different proportions, in every question that takes voltages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import tympan
from tests.support.checks.json_schema import printed_record
from tests.support.python_doors import options
from tests.support.specimens import quarters
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.commands import COMMANDS
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.mesher import MeshSettings
from tympan.grammar import BY_SEGMENT
from tympan.studies.case import Settings
from tympan.studies.driven import Voltages, in_proportion
from tympan.studies.force.result import ForceResult
from tympan.studies.limits.curve import CurveResult
from tympan.studies.sense.result import SenseResult
from tympan.studies.study import read_study, run_study

FILM = quarters(1e-3)
COARSE = Settings(mesh=MeshSettings().refined(0.5))
#: Two proportions, of which both have the same highest voltage once.
SETS = ({"A": 0.0, "B": 1e3}, {"A": 2e3, "B": 1e3}, {"B": 2e3})
#: Sets in two proportions as a text.
SEVERAL = "A = 1 kV, 2 kV, B = 1 kV"
#: What else the questions with a row for each voltage are asked.
ASKED: dict[str, dict[str, Any]] = {
    "force": {"to": "3 mm", "points": 4, "mass": "10 g"},
    # A plate that cannot tilt has no tilts to be sensed, which would take most of the time.
    "sense": {"to": "3 mm", "points": 5, "rig": {"guide": "vertical"}},
    "curve": {"mass": "20 g"},
}
#: Commands that answer several proportions.
ANSWERS = {*ASKED, "export", "steer"}
#: Relative difference of two solutions of one state: it begins elsewhere, on a mesh that is the
#: mirrored part of the whole.
SAME = 2e-5

#: Commands whose options are no voltages of segments: a sweep has a table of them, and a
#: controller sets those of all segments itself, up to its supply's.
OTHERS = {"sweep", "lumped steer"}
OPTIONS = [(command.name, action.dest) for command in COMMANDS
           for action in options(command.name)
           if action.dest in BY_SEGMENT and command.name not in OTHERS]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("film") / "four.toml"
    made.write_text(specimen_to_toml(FILM))
    return made


def asked(name: str, option: str, file: Path, given: str, folder: Path) -> list[str]:
    """Write a command line with a voltage, and what the command needs besides."""
    needed = [action for action in options(name) if action.option_strings and action.required]
    words = [*name.split(), *(["--film"] if name == "material fit" else []), str(file)]
    if name == "material fit":
        words += ["coupons.csv"]
    known = {action.dest for action in options(name)}
    words += ["--mass", "20 g"] * ("mass" in known) + ["--inp"] * ("inp" in known)
    words += ["-o", str(folder)] * (bool(needed) or name == "draw")
    return [*words, f"--{option}", given]


@pytest.mark.parametrize(("name", "option"), OPTIONS)
def test_every_option_reads_names(name: str, option: str, file: Path, tmp_path: Path, capsys
                                  ) -> None:
    assert main(asked(name, option, file, "E = 1 kV", tmp_path)) == 2
    said = capsys.readouterr().err
    assert f"--{option}" in said
    assert "must be the name of a segment: A, B, C, D" in said


@pytest.mark.parametrize(("name", "option"), [
    each for each in OPTIONS if each[0] not in ANSWERS])
def test_a_question_on_one_proportion_says_so(name: str, option: str, file: Path, tmp_path: Path,
                                              capsys) -> None:
    assert main(asked(name, option, file, SEVERAL, tmp_path)) == 2
    said = capsys.readouterr().err
    assert f"--{option}" in said
    assert "must be voltages in one proportion, or one voltage for each segment" in said


def rows_of(name: str, voltage: object) -> pd.DataFrame:
    result = getattr(tympan, name)(FILM, voltage=voltage, settings=COARSE, **ASKED[name])
    rows = result.to_pandas()
    return rows if "asked" not in rows else rows[rows["asked"] == 1]


@pytest.mark.parametrize("name", [*ASKED])
def test_a_row_among_several_is_that_asked_alone(name: str) -> None:
    """A row has the voltages of its segments."""
    every = rows_of(name, list(SETS))
    unit = "_V" if "voltage_A_V" in every else ""
    columns = [f"voltage_{segment}{unit}" for segment in "ABCD"]
    for one in SETS:
        volts = [one.get(segment, 0.0) for segment in "ABCD"]
        rows = every[(every[columns] == volts).all(axis=1)]
        alone = rows_of(name, one)
        assert len(rows) == len(alone) > 0
        for column in alone.select_dtypes("number"):
            own, other = (np.array(table[column], float) for table in (rows, alone))
            scale = every[column].abs().max()
            scale = 0.0 if np.isnan(scale) else scale
            np.testing.assert_allclose(own, other, rtol=SAME, atol=SAME * scale, err_msg=column)


@pytest.fixture(scope="module")
def pulled() -> tympan.Result[ForceResult]:
    return tympan.force(FILM, voltage=[{"A": 0.0}, *SETS], settings=COARSE, **ASKED["force"])


def test_a_force_curve_says_the_voltages_of_its_segments(pulled, tmp_path: Path) -> None:
    assert [curve.drive for curve in pulled.curves] == [
        "0 kV", "A 0 kV, B 1 kV, C 0 kV, D 0 kV", "A 0 kV, B 2 kV, C 0 kV, D 0 kV",
        "A 2 kV, B 1 kV, C 0 kV, D 0 kV"]
    pulled.save(tmp_path)
    assert (tmp_path / f"{FILM.name}-force.csv").read_text().startswith(
        "specimen,voltage_kV,voltage_A_kV,voltage_B_kV,voltage_C_kV,voltage_D_kV,displacement_mm")
    again = tympan.Result.load(tmp_path)
    assert again.curves == pulled.curves
    labels = [text.get_text() for text in again.plot().get_legend().get_texts()]
    assert {curve.drive for curve in pulled.curves} <= {*labels}


def test_energies_of_a_cycle_between_two_proportions_balance(pulled) -> None:
    """The work with the plate held at both ends is the area between the two curves."""
    line, = pulled.loads
    first, last = pulled.curves[0], pulled.curves[-1]
    places = [crossing.displacement_m for crossing in line.crossings
              if crossing.segment_voltages_V in (first.segment_voltages_V,
                                                 last.segment_voltages_V)]
    assert len(places) == 2
    fine = np.linspace(*places, 50)
    between = [tympan.force(FILM, voltage=each, settings=COARSE, from_=places[0], to=places[1],
                            points=9).curves[0] for each in ("0 kV", SETS[1])]
    forces = [np.interp(fine, curve.displacement_m, curve.force_N) for curve in between]
    area = np.trapezoid(forces[0] - forces[1], fine)
    assert line.ideal_work_J == pytest.approx(area, rel=2e-3)


def test_sense_has_an_inverse_for_each_proportion(tmp_path: Path) -> None:
    result = tympan.sense(FILM, voltage=SEVERAL, settings=COARSE, to="3 mm", points=5,
                          noise=1e-3)
    assert isinstance(result.numbers, SenseResult)
    one, other = result.inverses
    assert other.segment_shares == {"A": 1.0, "B": 0.5, "C": 0.0, "D": 0.0}
    curve = result.curves[1]
    assert result.sensed(curve.capacitance_F, "A = 2 kV, B = 1 kV")[-1] == pytest.approx(
        curve.displacement_m[-1], abs=one.error_m + other.error_m)
    capacitances = {name: values[-1] for name, values in curve.segment_capacitances_F.items()}
    assert result.sensed_plate(capacitances, {"A": 2e3, "B": 1e3})["deflection_m"] == (
        pytest.approx(curve.displacement_m[-1], rel=1e-3))
    with pytest.raises(InputError, match="must name the segments"):
        result.sensed(curve.capacitance_F, 2e3)
    with pytest.raises(InputError, match="in a proportion that was solved: A 100 %, B 100 %"):
        result.sensed(curve.capacitance_F, "A = 2 kV")
    result.save(tmp_path)
    source = (tmp_path / f"{FILM.name}-sense.c").read_text()
    assert source.count("_2_sensed_deflection(double") == 2
    assert tympan.Result.load(tmp_path).inverses == result.inverses


def test_a_curve_for_each_proportion_is_stored_and_drawn(file: Path, tmp_path: Path, capsys
                                                          ) -> None:
    assert main(["curve", str(file), "--mass", "20 g", "--voltage", SEVERAL, "--refine", "0.5",
                 "-o", str(tmp_path), "--json"]) == 0
    printed = printed_record(capsys.readouterr().out)
    found = CurveResult.load(tmp_path)
    assert [curve.load for curve in found.curves] == [
        "20 g, A 100 %, B 100 %, C 0 %, D 0 %", "20 g, A 100 %, B 50 %, C 0 %, D 0 %"]
    assert [curve["segment_shares"]["B"] for curve in printed["curves"]] == [1.0, 0.5]
    assert [[volts for volts, *_ in found.asked(curve)] for curve in found.curves] == [
        [1e3], [2e3]]
    by_function = tympan.curve(FILM, mass="20 g", voltage=SEVERAL, settings=COARSE)
    assert [curve.limits for curve in by_function.curves] == [
        curve.limits for curve in found.curves]


def test_export_has_a_step_for_each_set(file: Path, tmp_path: Path) -> None:
    assert main(["export", str(file), "--inp", "--mass", "10 g", "--voltage", SEVERAL,
                 "--refine", "0.5", "-o", str(tmp_path)]) == 0
    text = (tmp_path / f"{FILM.name}.inp").read_text()
    assert "**   4: 10 g, A 1 kV, B 1 kV, C 0 kV, D 0 kV\n" in text
    assert "**   5: 10 g, A 2 kV, B 1 kV, C 0 kV, D 0 kV\n" in text


def test_sets_of_one_proportion_are_one_film() -> None:
    volts = Voltages.read(["A = 3 kV, B = 1 kV", "B = 1 kV", "A = 0 kV", "A = 1.5 kV, B = 0.5 kV"])
    films = in_proportion(FILM, volts.film, volts.segments)
    assert [voltages for _, voltages in films] == [(0.0, 1.5e3, 3e3), (1e3,)]
    shares = [[segment.share for segment in film.electrode.segments] for film, _ in films]
    assert shares == [pytest.approx([1, 1 / 3, 0, 0]), pytest.approx([0, 1, 0, 0])]
    assert in_proportion(FILM, (2e3, 1e3)) == [(FILM, (1e3, 2e3))]
    with pytest.raises(InputError, match="differ from each other"):
        tympan.force(FILM, voltage=["A = 1 kV", "A = 1 kV, B = 0 V"])


def test_a_study_reads_voltages_by_name(file: Path, tmp_path: Path) -> None:
    (tmp_path / "four.toml").write_text(file.read_text())
    text = ('specimens = "four.toml"\nmass = "20 g"\nvoltage = "A = 3 kV, B = 1 kV"\n'
            '[curves]\nmass = ["20 g"]\nvoltage = ["A = 2 kV, B = 2 kV", "A = 3 kV"]\n')
    (tmp_path / "study.toml").write_text(text)
    plan = read_study(tmp_path / "study.toml")
    specimen, = plan.specimens
    assert plan.voltage == 3e3
    assert [segment.share for segment in specimen.electrode.segments] == [1, 1 / 3, 0, 0]
    assert plan.curves is not None
    assert plan.curves.voltages == (2e3, 3e3)
    for wrong, said in (
            (text.replace("A = 3 kV, B = 1 kV", SEVERAL), "one voltage for each"),
            (text.replace("A = 2 kV, B = 2 kV", "E = 2 kV"), "must be the name of a segment"),
            (text + '[alpha_fit]\nmass = ["20 g"]\nvoltage = "A = 1 kV"\n', "without names")):
        (tmp_path / "wrong.toml").write_text(wrong)
        with pytest.raises(InputError, match=said):
            read_study(tmp_path / "wrong.toml")


@pytest.mark.study(seconds=20)
def test_a_study_of_several_proportions_is_stored(file: Path, tmp_path: Path) -> None:
    (tmp_path / "four.toml").write_text(file.read_text())
    (tmp_path / "study.toml").write_text(
        'specimens = "four.toml"\nmass = "20 g"\nvoltage = "A = 3 kV, B = 1 kV"\n'
        '[curves]\nmass = ["20 g"]\nvoltage = ["A = 2 kV, B = 2 kV", "A = 3 kV"]\n')
    found = run_study(read_study(tmp_path / "study.toml"))
    assert found.drive == "A 3 kV, B 1 kV, C 0 kV, D 0 kV"
    found.save(tmp_path / "study")
    again = type(found).load(tmp_path / "study")
    assert [curve.drive for curve in again.specimens[0].curves.curves] == [
        "A 100 %, B 100 %, C 0 %, D 0 %", "A 100 %, B 0 %, C 0 %, D 0 %"]
    assert {*again.rows["voltage_B"]} >= {0.0, 2e3}
