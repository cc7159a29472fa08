"""Running sweeps: tables, resuming, failures, other orders and other processes."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import tympan
from tests.support.sweeps import CHEAP, Lethal, finished, read, table, written
from tympan.base.errors import Failure, InputError
from tympan.base.process.folder import alone
from tympan.studies.alpha import alpha
from tympan.studies.case import Case, solve
from tympan.studies.force import ForceCase, force
from tympan.studies.limits import limits
from tympan.studies.lumped.build import build
from tympan.studies.modes import modes
from tympan.studies.parallel import processes, serial
from tympan.studies.sweep import run as shelf
from tympan.studies.sweep.plan import Sweep
from tympan.studies.sweep.run import run_sweep
from tympan.studies.sweep.task import SweepTask


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[Sweep, Path]:
    """A sweep run without interruption."""
    folder = tmp_path_factory.mktemp("whole")
    sweep = read(folder)
    run_sweep(sweep, folder / "out", serial)
    return sweep, folder / "out"


def alike(cases: xr.Dataset, other: xr.Dataset) -> None:
    xr.testing.assert_identical(cases, other)


def test_every_row_is_what_solving_that_case_alone_gives(whole) -> None:
    sweep, folder = whole
    cases = table(folder)
    for entry in sweep.entries[::3]:
        for mass, number in zip(entry.masses, (0, 1), strict=True):
            alone = solve(Case(entry.task.specimen, mass=mass, voltage=entry.voltages[-1]), CHEAP)
            row = cases.sel(specimen=entry.name).isel(mass=number, voltage=-1)
            for name in ("deflection_m", "capacitance_F", "max_true_stress_Pa", "energy_J", "dofs"):
                assert float(row[name]) == pytest.approx(getattr(alone, name), rel=1e-7), name
            assert row["status"] == alone.status


def test_the_three_files_hold_the_same_with_units(whole) -> None:
    _, folder = whole
    cases = table(folder)
    assert cases["deflection_m"].attrs["units"] == "m"
    assert cases["plate.radius"].attrs["units"] == "m"
    assert cases["max_field_V_per_m"].attrs["units"] == "V/m"
    rows = pd.read_csv(folder / "sweep.csv")
    pd.testing.assert_frame_equal(rows[["deflection_m", "plate.radius_m", "mass_kg"]],
                                  pd.read_parquet(folder / "sweep.parquet")[["deflection_m",
                                                                             "plate.radius_m",
                                                                             "mass_kg"]],
                                  check_exact=True)
    row = rows.iloc[17]
    place = cases.sel(specimen=row["specimen"]).isel(mass=1, voltage=2)
    assert (row["mass_kg"], row["voltage_V"]) == (float(place["mass"]),
                                                  float(place["voltage"])) == (22.45e-3, 4e3)
    assert row["deflection_m"] == float(place["deflection_m"])


GRID = """
specimen = "oval.toml"
mass = "17.9 g"
voltage = ["0 kV", "2.5 kV", "5 kV"]
[grid]
"plate.radius" = ["1 cm", "12 mm"]
"frame.semi_axes" = [["6 cm", "4.5 cm"], ["5 cm", "4.5 cm"]]
[list]
"rig.spring" = ["0 N/m", "5 N/m"]
"""


def test_loads_and_keys_of_the_grid_are_indices(tmp_path) -> None:
    """As xarray's own users take them: by value, as an abscissa, nearest, by label."""
    sweep = read(tmp_path, GRID)
    run_sweep(sweep, tmp_path / "out", serial)
    cases = table(tmp_path / "out")
    assert dict(cases.sizes) == {"specimen": 2, "plate.radius": 2, "frame.semi_axes": 2, "mass": 1,
                                 "voltage": 3}
    place = {"plate.radius": 0.012, "frame.semi_axes": "6 cm, 4.5 cm", "specimen": "oval-1"}
    line = cases["deflection_m"].sel(place).squeeze()
    assert line.dims == ("voltage",)
    [drawn] = line.plot(x="voltage")
    assert drawn.get_xdata().tolist() == [0, 2500, 5000]
    [entry] = [entry for entry in sweep.entries if entry.name == "oval-1"
               and entry.task.specimen.plate.outline.radius == 0.012
               and entry.task.specimen.frame.semi_axes[0] == 0.06]
    case = Case(entry.task.specimen, mass="17.9 g", voltage="5 kV", rig=entry.task.rig)
    assert float(line.sel(voltage=5000)) == pytest.approx(solve(case, CHEAP).deflection_m, rel=1e-7)
    assert line.sel(voltage=4e3, method="nearest") == line.sel(voltage=5000)
    assert cases.sel({"plate.radius": slice(0.009, 0.011)}).sizes["plate.radius"] == 1
    assert cases["rig.spring"].dims == ("specimen",)
    assert cases["frame.semi_axes.0"].sel({"frame.semi_axes": "5 cm, 4.5 cm"}) == 0.05
    assert cases["plate.radius"].attrs["units"] == "m"
    rows = pd.read_csv(tmp_path / "out" / "sweep.csv")
    row = rows[(rows["plate.radius_m"] == 0.012) & (rows["frame.semi_axes.0_m"] == 0.06)
               & (rows["rig.spring_N_per_m"] == 5) & (rows["voltage_V"] == 5e3)]
    assert row["deflection_m"].tolist() == [float(line.sel(voltage=5000))]


def test_a_load_of_the_list_goes_with_the_specimen_one_of_the_grid_is_an_index(tmp_path) -> None:
    text = ('specimen = "oval.toml"\n[grid]\nvoltage = ["0 kV", "1 kV"]\n'
            '[list]\nmass = ["20 g", "10 g"]\n"plate.radius" = ["8 mm", "9 mm"]')
    run_sweep(read(tmp_path, text), tmp_path / "out", serial)
    cases = table(tmp_path / "out")
    assert dict(cases.sizes) == {"specimen": 2, "voltage": 2}
    assert cases["mass"].values.tolist() == [0.02, 0.01]
    assert (cases["deflection_m"].sel(voltage=1000).diff("specimen") < 0).all()


ASKED = """
specimen = "oval.toml"
mass = "22.45 g"
voltage = ["0 kV", "4 kV"]
ask = ["alpha", "limits", "modes", "lumped", "force"]
figures = true
[list]
plate = [{ shape = "circle", radius = "1 cm" },
         { shape = "ellipse", semi_axes = ["5 cm", "1 cm"] }]
"""


def test_what_is_asked_stands_in_the_table_and_fails_alone(tmp_path) -> None:
    """Beside the same things asked of the specimen itself."""
    sweep = read(tmp_path, ASKED)
    run_sweep(sweep, tmp_path / "out", serial)
    cases, task = table(tmp_path / "out"), sweep.entries[0].task
    first = cases.isel(specimen=0)
    weights = alpha(task.specimen, CHEAP)
    assert [float(first[f"alpha_{number}"]) for number in (1, 2)] == pytest.approx(
        weights.by_basis["membrane"].alpha, abs=1e-9)
    assert float(first["alpha_held_out_error"]) == pytest.approx(
        weights.by_basis["membrane"].held_out_error)
    assert first["circle_2_m"].attrs["units"] == "m"
    assert first["alpha_1"].dims == ()
    swinging = modes(Case(task.specimen, mass="22.45 g", voltage="4 kV"), CHEAP)
    row = first.sel(mass=22.45e-3, voltage=4e3)
    assert [float(row[name]) for name in ("heave_Hz", "tilt_1_Hz", "tilt_2_Hz")] == pytest.approx(
        [mode.frequency_Hz for name in ("heave", "tilt") for mode in swinging.modes
         if mode.name.startswith(name)])
    assert cases["heave_Hz"].attrs["units"] == "Hz"
    pulled = force(ForceCase(task.specimen, voltages=(0.0, 4e3), masses=(22.45e-3,), to=6e-3),
                   CHEAP)
    for name in ("blocked_force_N", "work_J"):
        assert float(row[name]) == pytest.approx(getattr(pulled, name), rel=1e-5)
    assert float(row["coupling"]) == pytest.approx(pulled.loads[0].coupling, rel=1e-5)
    assert np.isnan(float(first["work_J"].sel(mass=22.45e-3, voltage=0.0)))
    assert row["work_J"].attrs["units"] == "J"
    model = build(task.specimen, CHEAP).model
    assert float(first["lumped_stiffness"]) == pytest.approx(model.stiffness)
    assert float(first["lumped_flat_capacitance_F"]) == pytest.approx(model.flat_capacitance)
    reached = limits(Case(task.specimen, mass="22.45 g"), CHEAP)
    assert np.isnan(first["pull_in_V"]).all()
    assert float(first["last_equilibrium_V"].sel(mass=22.45e-3)) == pytest.approx(
        reached.instability.voltage_V)
    assert float(first["tension_x_m"].sel(mass=22.45e-3)) == pytest.approx(reached.tension.x_m)
    assert set(cases["status"].values.ravel()) == {"equilibrium"}
    assert np.isnan(cases["alpha_1"].values[1])
    assert "circle" in str(cases["alpha_warnings"].values[1])
    assert np.isfinite(cases["heave_Hz"].values).all()
    assert {file.stem for file in (tmp_path / "out" / "fields").iterdir()} == set(
        cases["id"].values[:, 0, 0])
    assert run_sweep(sweep, tmp_path / "out", serial).kept == 4
    alike(table(tmp_path / "out"), cases)


def test_running_again_solves_nothing_and_a_damaged_file_only(whole, tmp_path) -> None:
    sweep, folder = whole
    shutil.copytree(folder, tmp_path / "out")
    before = finished(sweep, tmp_path / "out")
    damaged, gone, wrong, text, *_ = sorted((tmp_path / "out" / "tasks").rglob("*.json"))
    content = damaged.read_text()
    damaged.write_text(content.replace("equilibrium", "Equilibrium", 1))
    gone.write_bytes(b"")
    rows = json.loads(text.read_text().split("\n")[1])["rows"]
    for file, others in ((wrong, [1]), (text, [row | {"deflection_m": "deep"} for row in rows])):
        body = json.dumps(json.loads(file.read_text().split("\n")[1]) | {"rows": others})
        file.write_text(f"{hashlib.sha256(body.encode()).hexdigest()}\n{body}\n")
    asked: list[str] = []

    def noted(function, tasks):
        asked.extend(tasks)
        return serial(function, tasks)

    summary = run_sweep(sweep, tmp_path / "out", noted)
    assert sorted(asked) == [damaged.stem, gone.stem, wrong.stem, text.stem]
    assert (summary.solved, summary.kept) == (24, 24)
    alike(table(tmp_path / "out"), table(folder))
    after = finished(sweep, tmp_path / "out")
    assert {number for number in after if after[number] != before[number]} == set(asked)
    asked.clear()
    run_sweep(sweep, tmp_path / "out", noted)
    assert not asked


def test_a_longer_sample_takes_over_what_is_finished(whole, tmp_path) -> None:
    _, folder = whole
    shutil.copytree(folder, tmp_path / "out")
    longer = read(tmp_path, written(tmp_path).read_text().replace("count = 8", "count = 9"))
    summary = run_sweep(longer, tmp_path / "out", serial)
    assert (summary.solved, summary.kept) == (6, 48)


def backwards(function, tasks):
    return serial(function, dict(reversed(tasks.items())))


@pytest.mark.study(seconds=5)
def test_order_and_processes_change_nothing(whole, tmp_path) -> None:
    sweep, folder = whole
    run_sweep(sweep, tmp_path / "backwards", backwards)
    alike(table(tmp_path / "backwards"), table(folder))
    run_sweep(sweep, tmp_path / "two", partial(processes, workers=2))
    alike(table(tmp_path / "two"), table(folder))


def test_an_impossible_combination_is_a_row_with_the_reason(tmp_path) -> None:
    text = ('specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = ["0 kV", "30 kV"]\n'
            '[grid]\n"plate.radius" = ["1 cm", "5 cm"]')
    summary = run_sweep(read(tmp_path, text), tmp_path / "out", serial)
    assert summary.statuses == {"equilibrium": 1, "no_equilibrium": 1, "failed": 2}
    cases = table(tmp_path / "out")
    reason = str(cases["warnings"][0, 1, 0, 0].item())
    assert reason == ("plate: given 'circle of 100 × 100 mm': the plate must lie inside the frame: "
                      "it reaches 5 mm beyond it at x 0.0 mm, y 45.0 mm")
    assert summary.failures == [f"2 cases without result: {reason}"]
    assert summary.json()["warnings"] == summary.failures
    assert "thins without bound" in str(cases["warnings"][0, 0, 0, 1].item())
    assert np.isnan(cases["deflection_m"].values).tolist() == [[[[False, True]], [[True, True]]]]


def test_an_error_in_one_specimen_is_a_row_with_its_words(whole, tmp_path, monkeypatch) -> None:
    sweep, _ = whole
    bad = sweep.entries[2].task

    def build(specimen, *rest):
        if specimen == bad.specimen:
            raise InputError("cannot be meshed: too little room", key="frame, plate",
                             given=specimen.name)
        return original(specimen, *rest)

    from tympan.studies.sweep import task

    original = task.build_model
    monkeypatch.setattr(task, "build_model", build)
    run_sweep(sweep, tmp_path / "out", serial)
    cases = table(tmp_path / "out")
    assert (cases["status"] == "failed").sum() == 6
    assert set(cases["warnings"].values[2].ravel()) == {"frame, plate: cannot be meshed: too "
                                                        "little room"}


def test_another_version_on_a_worker_is_refused(whole) -> None:
    sweep, _ = whole
    foreign = replace(sweep.entries[0].task, solver="tympan 9 revision 9")
    with pytest.raises(Failure, match="a worker has another version"):
        foreign.run()


def test_a_full_disk_is_one_message_and_what_was_finished_stays(whole, tmp_path,
                                                                monkeypatch) -> None:
    sweep, folder = whole
    with monkeypatch.context() as patch:
        original, written_files = shelf.write_text, []

        def full(file: Path, text: str, hashed: bool) -> None:
            written_files.append(file)
            if len(written_files) > 3:
                text = shelf.write_atomically(file, _no_space)
            original(file, text, hashed)

        patch.setattr(shelf, "write_text", full)
        with pytest.raises(InputError, match="cannot be written: No space left on device"):
            run_sweep(sweep, tmp_path / "out", serial)
    assert len(finished(sweep, tmp_path / "out")) == 3
    assert run_sweep(sweep, tmp_path / "out", serial).kept == 18
    alike(table(tmp_path / "out"), table(folder))


def _no_space(path: Path) -> None:
    path.write_text("half")
    raise OSError(28, "No space left on device")


def test_two_sweeps_do_not_share_a_folder(whole, tmp_path) -> None:
    with alone(tmp_path), pytest.raises(InputError, match="in use by another command"):
        tympan.sweep(written(tmp_path / "files"), folder=tmp_path)


@pytest.mark.study(seconds=20)
def test_a_process_that_dies_is_replaced_and_a_task_that_kills_is_a_row(whole, tmp_path) -> None:
    sweep, folder = whole
    entries = list(sweep.entries[:3])
    entries[1] = replace(entries[1], task=Lethal(**{name: getattr(entries[1].task, name) for name in
                                                    SweepTask.__dataclass_fields__}))
    summary = run_sweep(replace(sweep, entries=tuple(entries)), tmp_path / "out",
                  partial(processes, workers=1))
    assert summary.statuses == {"equilibrium": 12, "failed": 6}
    cases, right = table(tmp_path / "out"), table(folder)
    assert "the process that solved it died" in str(cases["warnings"][1, 0, 0].item())
    assert (cases["deflection_m"][[0, 2]] == right["deflection_m"][[0, 2]]).all()
    # The next run may have more luck.
    three = replace(sweep, entries=sweep.entries[:3])
    assert run_sweep(three, tmp_path / "out", serial).solved == 6
    assert (table(tmp_path / "out")["deflection_m"] == right["deflection_m"][:3]).all()
