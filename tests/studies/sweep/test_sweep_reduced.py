"""Sweeps by a reduced film: against finite elements, gone on with, and when it is not asked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tests.support.costs import dear
from tympan.base.paths import at
from tympan.studies.parallel import processes, serial
from tympan.studies.sweep import reduced, strokes
from tympan.studies.sweep.cluster import cluster
from tympan.studies.sweep.plan import Sweep, read_sweep
from tympan.studies.sweep.reduced import EXACT, Kin
from tympan.studies.sweep.run import SweepResult, run_sweep, tasks_of

SPECIMEN = """name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "4.5 cm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.2360679775, 2.2360679775]
relative_permittivity = 4.7
material = "vhb-4910"
"""

SWEEP = """specimen = "oval.toml"
mass = ["17.9 g", "22.45 g"]
voltage = {{ from = "0 kV", to = "{highest} kV", count = 6 }}
[sample]
method = "sobol"
count = {count}
[sample.ranges]
"frame.semi_axes.0" = ["4.5 cm", "7.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"membrane.thickness" = ["0.9 mm", "1.1 mm"]
"""

#: Specimens that are solved by finite elements, too.
SOME = slice(None, None, 5)

#: Equilibria from which on a family is made.
WORTH = reduced._WORTH


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    """Sweeps of few specimens have a family, and several batches."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reduced, "_WORTH", 200)
        patch.setattr(reduced, "_TOGETHER", 10)
        yield


def planned(folder: Path, count: int = 24, highest: float = 7.0, exact: bool = False,
            ask: str = "") -> Sweep:
    folder.joinpath("oval.toml").write_text(SPECIMEN)
    folder.joinpath("SWEEP.toml").write_text(
        ask + SWEEP.format(count=count, highest=highest))
    return read_sweep(folder / "SWEEP.toml", exact=exact)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished sweep, in "out"."""
    folder = tmp_path_factory.mktemp("reduced")
    run_sweep(planned(folder), folder / "out", serial)
    return folder


def table(folder: Path) -> xr.Dataset:
    return xr.load_dataset(folder / "sweep.nc", engine="h5netcdf")


def test_a_reduced_table_is_that_of_finite_elements(folder: Path) -> None:
    plan = planned(folder, exact=True)
    exact = run_sweep(replace(plan, entries=plan.entries[SOME]), folder / "exact", serial).table
    assert (exact["by"] == "finite elements").all()
    assert exact["deflection_error_m"].isnull().all()
    near = table(folder / "out").isel(specimen=SOME)
    by_family = near["by"].values == "reduced"
    assert by_family.mean() > 0.9
    assert (near["status"].values == exact["status"].values).all()
    assert (near["warnings"].values == exact["warnings"].values).all()
    off = np.abs(near["deflection_m"] - exact["deflection_m"]).values
    assert np.nanmax(off / exact["deflection_m"].values) < EXACT
    assert (off[by_family] <= near["deflection_error_m"].values[by_family]).mean() >= 0.95
    apart = np.abs(near["max_true_stress_Pa"] - exact["max_true_stress_Pa"]).values[by_family]
    error = near["max_true_stress_error_Pa"].values[by_family]
    assert (apart <= error).mean() >= 0.95
    assert (error <= 0.02 * near["max_true_stress_Pa"].values[by_family]).all()
    for name, most in (("capacitance_F", 2e-5), ("reaction_N", 1e-6), ("energy_J", 2e-5),
                       ("max_stretch", 5e-3), ("max_true_stress_Pa", 1e-2),
                       ("max_field_V_per_m", 5e-3), ("breakdown_margin", 5e-3)):
        np.testing.assert_allclose(near[name], exact[name], rtol=most, err_msg=name)
    told = [name for name in exact if exact[name].notnull().any()]
    assert not [name for name in told if not near[name].notnull().any()]  # none is left blank


def test_what_is_missing_is_solved_with_the_same_numbers(folder: Path) -> None:
    before = table(folder / "out")
    files = sorted((folder / "out" / "tasks").rglob("*.json"))
    for file in files[::3]:
        file.unlink()
    again = run_sweep(planned(folder), folder / "out", serial)
    assert again.solved == 12 * len(files[::3])
    for name in before.data_vars:
        if before[name].dtype.kind == "f":
            np.testing.assert_allclose(again.table[name], before[name], rtol=1e-9, err_msg=name)
        else:
            assert (again.table[name].values == before[name].values).all()


@pytest.mark.study(seconds=24)
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning",
                            "ignore::pytest.PytestUnraisableExceptionWarning")
def test_processes_and_a_cluster_are_sent_the_family_and_give_the_same_table(
        folder: Path, tmp_path: Path) -> None:
    from distributed import LocalCluster

    before = table(folder / "out")
    run_sweep(planned(folder), tmp_path / "two", partial(processes, workers=2))
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1",
                      dashboard_address=None, silence_logs=50) as machine:
        run_sweep(planned(folder), tmp_path / "dask",
                  partial(cluster, address=machine.scheduler_address))
    for name in ("two", "dask"):
        there = table(tmp_path / name)
        xr.testing.assert_allclose(there, before, rtol=1e-9, atol=1e-15)
        assert (there["by"] == before["by"]).all()


@pytest.mark.study(seconds=20)
def test_rows_beyond_pull_in_are_those_of_finite_elements(tmp_path: Path) -> None:
    plan = planned(tmp_path, highest=11.0)
    part = replace(plan, entries=plan.entries[:1])
    result = run_sweep(part, tmp_path / "out", serial).table
    missing = result["status"] != "equilibrium"
    assert missing.any()
    assert (result["by"].where(missing, "finite elements") == "finite elements").all()
    exact = planned(tmp_path, highest=11.0, exact=True)
    known = run_sweep(replace(exact, entries=exact.entries[:1]), tmp_path / "exact", serial).table
    assert (known["status"].values == result["status"].values).all()
    np.testing.assert_allclose(result["deflection_m"], known["deflection_m"], rtol=EXACT)


@pytest.mark.study(seconds=3)
def test_limits_are_asked_of_finite_elements_beside_reduced_rows(tmp_path: Path) -> None:
    tables = []
    for exact in (False, True):
        plan = planned(tmp_path, exact=exact, ask='ask = ["limits"]\n')
        part = replace(plan, entries=plan.entries[:1])
        tables.append(run_sweep(part, tmp_path / f"out-{exact}", serial).table)
    near, known = tables
    assert (near["by"] == "reduced").mean() > 0.8
    assert known["tension_V"].notnull().all()
    for name in ("tension_V", "breakdown_V", "last_equilibrium_V", "tension_x_m"):
        np.testing.assert_array_equal(near[name], known[name])
    asked = planned(tmp_path, ask='ask = ["modes"]\n')
    assert not any(entry.task.family for entry in asked.entries if entry.task)


FORCE = """specimen = "oval.toml"
mass = "17.9 g"
voltage = {voltages}
ask = ["force"]
[sample]
method = "sobol"
count = 12
[sample.ranges]
"membrane.thickness" = ["0.9 mm", "1.1 mm"]
"""

#: What differs between the specimens, too.
MORE = '''"plate.radius" = ["8 mm", "15 mm"]
"membrane.prestretch.0" = [2.1, 2.4]
'''

#: What is asked of the force.
STROKE = ("blocked_force_N", "work_J", "ideal_work_J", "electrical_in_J", "coupling")


def forced(folder: Path, exact: bool = False,
           voltages: str = '["0 kV", "1 kV", "4 kV", "6 kV"]', more: str = MORE) -> Sweep:
    folder.joinpath("oval.toml").write_text(SPECIMEN + 'density = "960 kg/m^3"\n')
    folder.joinpath("SWEEP.toml").write_text(FORCE.format(voltages=voltages) + more)
    return read_sweep(folder / "SWEEP.toml", exact=exact)


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished sweep with force, in "out"."""
    folder = tmp_path_factory.mktemp("pulled")
    run_sweep(forced(folder), folder / "out", serial)
    return folder


@pytest.mark.study(seconds=4)
def test_the_force_of_reduced_rows_is_that_of_finite_elements(pulled: Path) -> None:
    plan, some = forced(pulled, exact=True), slice(None, None, 3)
    exact = run_sweep(replace(plan, entries=plan.entries[some]), pulled / "exact", serial).table
    assert exact.sizes["specimen"] == 4
    assert (exact["by"] == "finite elements").all()
    near = table(pulled / "out").isel(specimen=some)
    by_family = (near["by"] == "reduced").values
    assert by_family.mean() > 0.9
    assert (near["force_warnings"].values == exact["force_warnings"].values).all()
    for name in STROKE:
        known = exact[name].values
        assert np.isfinite(known[..., 1:]).all()
        assert np.isnan(known[..., 0]).all()
        np.testing.assert_allclose(near[name].values, known, rtol=EXACT, err_msg=name)
        # Of finite elements they are the same to the last digits, so these were not asked.
        assert (np.abs(near[name].values - known) > 1e-12 * known)[by_family].mean() > 0.6


#: Beams are asked for one deflection at a time.
BEAM = """[[rig.bias]]
law = "buckled_beam"
length = "40 mm"
width = "5 mm"
thickness = "0.1 mm"
modulus = "3 GPa"
compression = "0.5 mm"
middle = "2 mm"
"""


@pytest.mark.parametrize("rig", [
    pytest.param('[rig]\ngas_pressure = "40 Pa"\n', id="gas"),
    dear('[rig]\ngas_pressure = "-40 Pa"\n', seconds=5, name="vacuum"),
    dear(BEAM, seconds=5, name="beam")])
def test_the_work_of_what_acts_beside_the_weight_is_that_of_finite_elements(
        tmp_path: Path, rig: str) -> None:
    """Gas that follows the film gives energy, and so does a mechanism on the plate."""
    tables = []
    for exact in (False, True):
        plan = forced(tmp_path, exact, '["3 kV", "6 kV"]', rig)
        part = replace(plan, entries=plan.entries[:2])
        tables.append(run_sweep(part, tmp_path / f"out-{exact}", serial).table)
    near, known = tables
    assert (near["by"] == "reduced").all()
    for name in STROKE:
        np.testing.assert_allclose(near[name], known[name], rtol=EXACT, err_msg=name)


@pytest.mark.study(seconds=5)
def test_processes_give_the_same_forces(pulled: Path, tmp_path: Path) -> None:
    before = table(pulled / "out")
    run_sweep(forced(tmp_path), tmp_path / "two", partial(processes, workers=2))
    there = table(tmp_path / "two")
    assert (there["by"] == before["by"]).all()
    for name in STROKE:
        np.testing.assert_allclose(there[name], before[name], rtol=1e-9, err_msg=name)


@pytest.mark.study(seconds=4)
def test_forces_beyond_the_family_s_reach_are_those_of_finite_elements(tmp_path: Path) -> None:
    tables = []
    for exact in (False, True):
        plan = forced(tmp_path, exact, '["1 kV", "6 kV", "9 kV", "11 kV"]', more="")
        part = replace(plan, entries=plan.entries[:1])
        tables.append(run_sweep(part, tmp_path / f"out-{exact}", serial).table)
    near, known = tables
    elements = (near["by"] == "finite elements").values
    assert elements.any()
    assert not elements.all()
    assert ((near["why"] != "").values == elements).all()
    assert (known["why"] == "").all()
    assert (near["status"].values == known["status"].values).all()
    assert (known["status"] != "equilibrium").any()
    assert (near["force_warnings"].values == known["force_warnings"].values).all()
    for name in STROKE:
        np.testing.assert_allclose(near[name], known[name], rtol=EXACT, err_msg=name)
        np.testing.assert_allclose(near[name].values[elements], known[name].values[elements],
                                   rtol=1e-6, err_msg=name)


@pytest.mark.study(seconds=3)
def test_a_row_whose_force_is_not_sure_comes_from_finite_elements(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = forced(tmp_path, voltages='["1 kV", "3 kV", "4 kV", "5 kV"]')
    part = replace(plan, entries=plan.entries[:1])
    assert (run_sweep(part, tmp_path / "sure", serial).table["by"] == "reduced").all()
    monkeypatch.setattr(strokes, "ESTIMATED", 1e-9)
    table = run_sweep(part, tmp_path / "unsure", serial).table
    assert (table["by"] == "finite elements").all()
    assert table["work_J"].notnull().all()


def test_why_rows_of_many_specimens_come_from_finite_elements_is_told(tmp_path: Path) -> None:
    plan = planned(tmp_path, ask='ask = ["modes"]\n')
    part = replace(plan, entries=plan.entries[:1])
    found = run_sweep(part, tmp_path / "out", serial)
    assert found.warnings[-1] == ("12 of 12 rows come from finite elements: modes of a film need "
                                  "its own finite elements")
    assert SweepResult.load(tmp_path / "out").warnings == found.warnings


def test_a_family_that_is_too_wide_is_one_of_each_half(tmp_path: Path,
                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    """A family stands for itself here: only its ranges count."""
    tasks = [task for task in reduced.in_families([*tasks_of(planned(tmp_path)).values()]) if task]
    widths = list[float]()

    def share(kin: Kin) -> float:
        widths.append(max((high - low) / high for _, low, high in kin.box))
        return float(widths[-1] < 0.3)

    monkeypatch.setattr(Kin, "made", lambda kin: kin)
    monkeypatch.setattr(reduced, "_exact_share", share)
    made = reduced.batches({task.id: task for task in tasks})
    assert max(widths) > 0.4
    assert sorted(task.id for batch in made.values() for task in batch.tasks) == sorted(
        task.id for task in tasks)
    assert len({id(batch.family) for batch in made.values()}) > 1
    for batch in made.values():
        assert isinstance(batch.family, Kin)
        for name, low, high in batch.family.box:
            values = [at(task.specimen, name.split(".")) for task in batch.tasks]
            assert low <= min(values) <= max(values) <= high
    monkeypatch.setattr(reduced, "_WORTH", len(tasks) * reduced._cost(tasks[0]))
    whole = reduced.batches({task.id: task for task in tasks})
    assert len({id(batch.family) for batch in whole.values()}) == 1


def test_few_specimens_and_exact_ones_keep_the_ids_of_finite_elements(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reduced, "_WORTH", WORTH)
    few, exact, many = (planned(tmp_path, *arguments) for arguments in
                        ((20,), (160, 7.0, True), (160,)))
    ids = [[entry.task.id for entry in plan.entries if entry.task] for plan in (few, exact, many)]
    assert ids[0] == ids[1][:20]
    assert not set(ids[1]) & set(ids[2])
