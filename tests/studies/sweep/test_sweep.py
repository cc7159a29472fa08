"""Running sweeps: tables, resuming, failures, other orders and other processes."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from tests.support.sweeps import CHEAP, Lethal, finished, read, written
from tympan.geometry.errors import InputError
from tympan.studies.case import Case, solve
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


def table(folder: Path) -> xr.Dataset:
    with xr.open_dataset(folder / "sweep.nc", engine="h5netcdf") as found:
        return found.load()


def alike(one: xr.Dataset, other: xr.Dataset) -> None:
    xr.testing.assert_identical(one, other)


def test_every_row_is_what_solving_that_case_alone_gives(whole) -> None:
    sweep, folder = whole
    found = table(folder)
    for entry in sweep.entries[::3]:
        for mass, number in zip(entry.masses, (0, 1), strict=True):
            alone = solve(Case(entry.task.specimen, mass=mass, voltage=entry.voltages[-1]), CHEAP)
            row = found.sel(specimen=entry.name).isel(mass=number, voltage=-1)
            for name in ("deflection_m", "capacitance_F", "max_true_stress_Pa", "energy_J", "dofs"):
                assert float(row[name]) == pytest.approx(getattr(alone, name), rel=1e-7), name
            assert row["status"] == alone.status


def test_the_three_files_hold_the_same_with_units(whole) -> None:
    _, folder = whole
    found = table(folder)
    assert found["deflection_m"].attrs["units"] == "m"
    assert found["plate.radius_m"].attrs["units"] == "m"
    assert found["max_field_V_per_m"].attrs["units"] == "V/m"
    rows = pd.read_csv(folder / "sweep.csv")
    pd.testing.assert_frame_equal(rows[["deflection_m", "plate.radius_m", "mass_kg"]],
                                  pd.read_parquet(folder / "sweep.parquet")[["deflection_m",
                                                                             "plate.radius_m",
                                                                             "mass_kg"]],
                                  check_exact=True)
    row = rows.iloc[17]
    place = found.sel(specimen=row["specimen"]).isel(mass=1, voltage=2)
    assert (row["mass_kg"], row["voltage_V"]) == (float(place["mass_kg"]),
                                                  float(place["voltage_V"])) == (22.45e-3, 4e3)
    assert row["deflection_m"] == float(place["deflection_m"])


def test_running_again_solves_nothing_and_a_damaged_file_only(whole, tmp_path) -> None:
    sweep, folder = whole
    shutil.copytree(folder, tmp_path / "out")
    before = finished(sweep, tmp_path / "out")
    damaged, gone, *_ = sorted((tmp_path / "out" / "tasks").rglob("*.json"))
    content = damaged.read_text()
    damaged.write_text(content.replace("equilibrium", "Equilibrium", 1))
    gone.write_bytes(b"")
    asked: list[str] = []

    def noted(function, tasks):
        asked.extend(tasks)
        return serial(function, tasks)

    summary = run_sweep(sweep, tmp_path / "out", noted)
    assert sorted(asked) == [damaged.stem, gone.stem]
    assert (summary.solved, summary.kept) == (12, 36)
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
    found = table(tmp_path / "out")
    assert "plate must lie inside the frame" in str(found["warnings"][1, 0, 0].item())
    assert "pulls in" in str(found["warnings"][0, 0, 1].item())
    assert np.isnan(found["deflection_m"].values).tolist() == [[[False, True]], [[True, True]]]


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
    found = table(tmp_path / "out")
    assert (found["status"] == "failed").sum() == 6
    assert set(found["warnings"].values[2].ravel()) == {"frame, plate: cannot be meshed: too "
                                                        "little room"}


def test_another_version_on_a_worker_is_refused(whole) -> None:
    sweep, _ = whole
    foreign = replace(sweep.entries[0].task, solver="tympan 9 revision 9")
    with pytest.raises(InputError, match="same version"):
        foreign.run()


def test_a_full_disk_is_one_message_and_what_was_finished_stays(whole, tmp_path,
                                                                monkeypatch) -> None:
    sweep, folder = whole
    with monkeypatch.context() as patch:
        original, written_files = shelf.write_text, []

        def full(file: Path, text: str) -> None:
            written_files.append(file)
            if len(written_files) > 3:
                text = shelf.write_atomically(file, _no_space)
            original(file, text)

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
    with shelf.Checkpoint(tmp_path).alone(), pytest.raises(InputError, match="in use by another "
                                                                             "sweep"):
        run_sweep(whole[0], tmp_path, serial)


def test_a_process_that_dies_is_replaced_and_a_task_that_kills_is_a_row(whole, tmp_path) -> None:
    sweep, folder = whole
    entries = list(sweep.entries[:3])
    entries[1] = replace(entries[1], task=Lethal(**{name: getattr(entries[1].task, name) for name in
                                                    SweepTask.__dataclass_fields__}))
    summary = run_sweep(replace(sweep, entries=tuple(entries)), tmp_path / "out",
                  partial(processes, workers=1))
    assert summary.statuses == {"equilibrium": 12, "failed": 6}
    found, right = table(tmp_path / "out"), table(folder)
    assert "the process that solved it died" in str(found["warnings"][1, 0, 0].item())
    assert (found["deflection_m"][[0, 2]] == right["deflection_m"][[0, 2]]).all()
    # The next run may have more luck.
    three = replace(sweep, entries=sweep.entries[:3])
    assert run_sweep(three, tmp_path / "out", serial).solved == 6
    assert (table(tmp_path / "out")["deflection_m"] == right["deflection_m"][:3]).all()
