"""The command as people and programs use it: JSON, exit statuses, standard output, start-up."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.support.checks.json_schema import printed_record
from tests.support.costs import dear
from tests.support.specimens import ROUND, SOFT, specimen_toml
from tympan.cli import main
from tympan.reports.rebuild import KINDS
from tympan.studies.shipped import FILES as ACTUATORS

SOLVE_KEYS = {"specimen", "mass_kg", "voltage_V", "status", "deflection_m", "reaction_N",
              "capacitance_F",
              "max_stretch", "max_true_stress_Pa", "max_field_V_per_m", "tilt_rad", "dofs",
              "wall_s", "warnings"}
ALPHA_KEYS = {"specimen", "circles", "alpha", "basis", "fit_error", "held_out_error", "from_fields",
              "warnings"}
SOFT_FILM = specimen_toml("soft", ROUND, SOFT, 2.2360679775)


def printed(capsys: pytest.CaptureFixture[str]) -> dict:
    out, err = capsys.readouterr()
    assert err == ""
    assert out.count("\n") == 1
    return printed_record(out)


@pytest.mark.parametrize("name", ACTUATORS)
def test_solve_json(name: str, capsys) -> None:
    assert main(["solve", str(ACTUATORS[name]), "--mass", "17.9 g", "--voltage", "3.5 kV",
                 "--json"]) == 0
    result = printed(capsys)
    assert set(result) >= SOLVE_KEYS
    assert result["status"] == "equilibrium"
    assert result["specimen"] == name
    assert 2e-3 < result["deflection_m"] < 4e-3
    assert result["reaction_N"] == pytest.approx(17.9e-3 * 9.80665, rel=1e-6)
    # A parallel plate of the mounted film: ε₀ ε_r A/t, a little more when stretched.
    area = np.pi * (4.5e-2 * {"circular": 4.5e-2, "elliptical-small": 6e-2,
                              "elliptical-large": 7.5e-2}[name] - 1e-4)
    assert result["capacitance_F"] == pytest.approx(8.8541878e-12 * 4.7 * area / 0.2e-3, rel=0.01)
    assert result["max_field_V_per_m"] == pytest.approx(3500 / 0.2e-3, rel=0.03)
    assert result["warnings"] == []


def test_solve_past_pull_in(tmp_path, capsys) -> None:
    file = tmp_path / "soft.toml"
    file.write_text(SOFT_FILM)
    assert main(["solve", str(file), "--mass", "17.9 g", "--voltage", "7 kV", "--json"]) == 0
    result = printed(capsys)
    assert result["status"] == "no_equilibrium"
    assert result["deflection_m"] is None
    assert any("loss of tension at 6.6" in words for words in result["warnings"])
    # It loses tension and thins without bound at once; kept from wrinkling it would pull in later.
    assert (result["first"], result["limit"]["kind"]) == ("tension", "instability")
    limits = result["limits"]
    assert 6.6e3 < limits["tension"]["voltage_V"] == limits["instability"]["voltage_V"] < 6.7e3
    assert limits["pull_in"] is None
    assert main(["limits", str(file), "--mass", "17.9 g", "--beyond", "--json"]) == 0
    assert limits["instability"]["voltage_V"] < printed(capsys)["pull_in"]["voltage_V"] < 7e3


def test_stroke_is_the_deflection_less_that_without_voltage(capsys, tmp_path: Path) -> None:
    loaded = [str(ACTUATORS["circular"]), "--mass", "17.9 g", "--refine", "0.5"]
    deflections = []
    for voltage in ("0 kV", "4 kV"):
        assert main(["solve", *loaded, "--voltage", voltage, "--json"]) == 0
        result = printed(capsys)
        deflections.append(result["deflection_m"])
    assert result["stroke_m"] == pytest.approx(deflections[1] - deflections[0], rel=1e-9)
    assert main(["curve", *loaded, "--voltage", "4 kV", "--json", "-o", str(tmp_path)]) == 0
    curve, = printed(capsys)["curves"]
    with (tmp_path / "circular-curve.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    asked, = (row for row in rows if row["asked"] == "1")
    assert float(asked["stroke_mm"]) == pytest.approx(1e3 * result["stroke_m"], rel=1e-6)
    within = [float(row["stroke_mm"]) for row in rows if row["asked"] == "0" and not row["beyond"]]
    assert 1e3 * curve["stroke_m"] == pytest.approx(max(within), rel=1e-9)
    assert main(["curve", *loaded, "--voltage", "4 kV, 30 kV"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert f"at 4 kV         deflection {1e3 * deflections[1]:.4g} mm" in lines
    assert any(line.startswith("at 30 kV        no equilibrium, beyond ") for line in lines)


def test_solve_prints_what_its_user_needs(capsys, tmp_path: Path) -> None:
    """No unknowns, seconds or share of slack film; a reading where it is not the deflection."""
    loaded = [str(ACTUATORS["circular"]), "--mass", "17.9 g", "--refine", "0.5"]
    assert main(["solve", *loaded]) == 0
    text = capsys.readouterr().out
    assert "deflection" in text
    assert not re.search(r"^(dofs|wall|slack|reading|stroke)", text, re.MULTILINE)
    rig = tmp_path / "rig.toml"
    rig.write_text('sensor_zero = "30 um"')
    assert main(["solve", *loaded, "--rig", str(rig)]) == 0
    assert re.search(r"^reading  ", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.parametrize(("name", "basis"), [
    ("circular", "membrane"), ("elliptical-small", "cone"),
    dear("circular", "cone", seconds=1), dear("elliptical-small", "membrane", seconds=1),
    dear("elliptical-large", "membrane", seconds=1), dear("elliptical-large", "cone", seconds=1)])
def test_alpha_json(name: str, basis: str, capsys) -> None:
    assert main(["alpha", str(ACTUATORS[name]), "--basis", basis, "--json"]) == 0
    result = printed(capsys)
    assert set(result) >= ALPHA_KEYS
    assert result["basis"] == basis
    assert sum(result["alpha"]) == pytest.approx(1)
    assert len(result["alpha"]) == len(result["circles"]) == len(result["from_fields"]["alpha"])
    assert len(result["circles"]) == (1 if name == "circular" else 2)


def test_alpha_of_other_numbers_of_circles(capsys) -> None:
    assert main(["alpha", str(ACTUATORS["elliptical-large"]), "--circles", "3", "--radii",
                 "sectors", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert len(result["circles"]) == len(result["alpha"]) == len(result["ranges"]) == 3
    assert result["radii"] == "sectors"


def test_alpha_refuses_too_many_circles(capsys) -> None:
    assert main(["alpha", str(ACTUATORS["circular"]), "--circles", "7"]) == 2
    assert "--circles: given 7: must be from 1 to 6" in capsys.readouterr().err


def test_solve_stores_fields_and_numbers(tmp_path, capsys) -> None:
    assert main(["solve", str(ACTUATORS["circular"]), "--mass", "17.9 g", "--refine", "0.5", "-o",
                 str(tmp_path / "new" / "folder")]) == 0
    assert "deflection  " in capsys.readouterr().out
    folder = tmp_path / "new" / "folder"
    assert sorted(file.name for file in folder.glob("[!.]*")) == [
        "circular.json", "circular.png", "circular.svg", "circular.vtu"]
    mesh = meshio.read(folder / "circular.vtu")
    stored = json.loads((folder / "circular.json").read_text())
    assert mesh.point_data["deflection"].max() == pytest.approx(stored["deflection_m"], rel=1e-9)
    assert mesh.points[:, 2].min() == pytest.approx(-stored["deflection_m"], rel=1e-9)
    assert mesh.point_data["stress_1"].max() == pytest.approx(stored["max_true_stress_Pa"],
                                                              rel=1e-3)


def test_a_result_that_does_not_exist_leaves_no_old_fields(tmp_path, capsys) -> None:
    file = tmp_path / "soft.toml"
    file.write_text(SOFT_FILM)
    drawn = ["soft.json", "soft.png", "soft.svg", "soft.vtu"]
    for voltage, names in (("3 kV", drawn), ("20 kV", ["soft.json"])):
        assert main(["solve", str(file), "--mass", "17.9 g", "--voltage", voltage, "--refine",
                     "0.5", "-o", str(tmp_path / "out")]) == 0
        assert sorted(item.name for item in (tmp_path / "out").glob("[!.]*")) == names
    assert "no_equilibrium" in capsys.readouterr().out


@pytest.mark.parametrize(("mass", "prestretch"), [
    ("17.9 g", "0.5, 0.5"), ("0.001 g", "0.99, 0.99"), ("0 g", "1, 1"),
    dear("17.9 g", "0.99, 0.99", seconds=2), dear("17.9 g", "1, 1", seconds=2),
    dear("0.001 g", "0.5, 0.5", seconds=1), dear("0.001 g", "1, 1", seconds=1),
    dear("0 g", "0.5, 0.5", seconds=1), dear("0 g", "0.99, 0.99", seconds=1)])
def test_slack_films_end_with_a_status(tmp_path, capsys, prestretch: str, mass: str) -> None:
    file = tmp_path / "slack.toml"
    file.write_text(SOFT_FILM.replace("2.2360679775, 2.2360679775", prestretch))
    assert main(["solve", str(file), "--mass", mass, "--json"]) == 0
    result = printed(capsys)
    assert result["status"] == ("equilibrium" if mass == "17.9 g" else "not_converged")
    if result["status"] == "equilibrium":
        assert result["reaction_N"] == pytest.approx(result["mass_kg"] * 9.80665, rel=1e-6,
                                                     abs=1e-9)
    else:
        assert result["limits"]["ended"] == result["warnings"][0]
        assert "slack when mounted" in result["warnings"][0]
        assert "prestretch or load it more" in result["warnings"][0]


def test_study_into_a_file_is_one_message(tmp_path, capsys) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert main(["study", "-o", str(blocked)]) == 2
    assert "cannot be written: Not a directory" in capsys.readouterr().err


def test_rig_reaches_the_solver(tmp_path, capsys) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('spring = "10 N/m"\n')
    deflections = []
    for extra in ([], ["--rig", str(rig)]):
        assert main(["solve", str(ACTUATORS["circular"]), "--mass", "17.9 g", "--json",
                     *extra]) == 0
        deflections.append(printed(capsys)["deflection_m"])
    assert deflections[1] < 0.95 * deflections[0]


def test_an_output_that_cannot_be_written_is_one_message(tmp_path, capsys) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert main(["solve", str(ACTUATORS["circular"]), "--mass", "1 g", "-o", str(blocked)]) == 2
    err = capsys.readouterr().err
    assert "cannot be written" in err
    assert err.count("\n") == 1


def test_export_writes_parts_that_can_be_read_back(tmp_path, capsys) -> None:
    import cadquery as cq

    assert main(["export", str(ACTUATORS["elliptical-small"]), "-o", str(tmp_path)]) == 0
    files = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert sorted(file.suffix
                  for file in files) == [".dxf"] * 4 + [".step"] * 4 + [".svg"] * 4 + [".vtu"]
    assert all(file.stat().st_size > 300 for file in files)
    film = cq.importers.importStep(str(tmp_path / "elliptical-small-film.step"))
    assert film.val().Area() == pytest.approx(np.pi * (60 * 45 - 100), rel=1e-6)
    plate = cq.importers.importStep(str(tmp_path / "elliptical-small-plate.step"))
    assert plate.val().Volume() == pytest.approx(np.pi * (100 - 1.6**2) * 2, rel=1e-6)


def test_materials_lists_sources(capsys) -> None:
    assert main(["materials"]) == 0
    listed = capsys.readouterr().out
    for source in ("Foo", "Koh", "Huang"):
        assert source in listed
    assert main(["materials", "--json"]) == 0
    assert "vhb-4910" in printed(capsys)


def test_help_is_quick_and_imports_nothing_heavy() -> None:
    """CPU time of ``tympan --help`` after a first call, and modules after building the parser."""
    command = [sys.executable, "-m", "tympan", "--help"]
    subprocess.run(command, capture_output=True, check=True)
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    after = os.times()
    assert "solve" in done.stdout
    cpu = (after.children_user - before.children_user
           + after.children_system - before.children_system)
    assert cpu < 0.5
    code = "import sys, tympan.cli; tympan.cli.build_parser(); print('\\n'.join(sys.modules))"
    listed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                            check=True)
    modules = set(listed.stdout.split())
    heavy = {"numpy", "scipy", "skfem", "meshio", "cadquery", "OCP", "gmsh", "vtk", "vtkmodules",
             "pyvista",
             "matplotlib", "pint", "tqdm", "jinja2"}
    assert not modules & heavy


def test_usage_errors_end_with_status_2(capsys) -> None:
    for arguments in ([], ["solve"]):
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        assert stop.value.code == 2
    assert "usage: tympan" in capsys.readouterr().err


@pytest.mark.parametrize(("line", "words"), [
    ("xyz", "given 'xyz': unknown command: known are solve, "),
    ("sovle oval.toml", "given 'sovle': unknown command: did you mean 'solve'? known are "),
    ("optimize", "did you mean 'design'?"), ("simulate oval.toml", "did you mean 'solve'?"),
    ("material fitt x", "given 'fitt': unknown command: did you mean 'fit'?"),
    ("solve oval.toml --masss 3", "given '--masss': unknown option: did you mean --mass? known"),
    ("solve oval.toml --masss=3", "given '--masss': unknown option: did you mean --mass? known"),
    ("solve oval.toml 3 kV", "given '3': is one argument too many; values with blanks need quo"),
    ("solve oval.toml --direction upp", "--direction: given 'upp': must be one of down, up; did y"),
])
def test_a_slip_of_the_pen_is_asked_about(line: str, words: str, capsys) -> None:
    assert main(line.split()) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1


def test_missing_system_library_is_named(monkeypatch, capsys) -> None:
    """As on a machine without libGLU: gmsh's import raises what the loader says."""
    from tympan.studies.case import discretised, meshed

    meshed.cache_clear()
    discretised.cache_clear()
    monkeypatch.setenv("TYMPAN_CACHE", "")
    monkeypatch.setitem(sys.modules, "gmsh", None)

    def no_gmsh(name: str, *arguments: object, **options: object) -> object:
        if name == "gmsh":
            raise OSError("libGLU.so.1: cannot open shared object file: No such file or directory")
        return real(name, *arguments, **options)

    import builtins

    real = builtins.__import__
    monkeypatch.setattr(builtins, "__import__", no_gmsh)
    assert main(["solve", str(ACTUATORS["circular"]), "--mass", "1 g"]) == 1
    assert "Debian package libglu1-mesa" in capsys.readouterr().err


def test_time_is_reported_truly(capsys) -> None:
    began = time.perf_counter()
    assert main(["solve", str(ACTUATORS["circular"]), "--mass", "17.9 g", "--json"]) == 0
    assert 0 < printed(capsys)["wall_s"] < time.perf_counter() - began


def test_report_says_what_it_rebuilds(tmp_path, capsys) -> None:
    assert main(["report", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"tympan: {tmp_path}: holds none of study.json, ")
    assert message.count("\n") == 1
    assert all(f"tympan {command}" in message for command in KINDS)
