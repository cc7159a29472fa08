"""The main job: what it stores, that a file is never half there, and its own input."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pytest

from tympan.base.errors import InputError
from tympan.base.process.folder import MANIFEST
from tympan.geometry.mesher import MeshSettings
from tympan.studies import files as store
from tympan.studies import study
from tympan.studies.alpha import AlphaSettings, LoadGrid
from tympan.studies.case import Case, Settings
from tympan.studies.limits import limits
from tympan.studies.tolerance.given import LengthScatter, Scatter, Tolerances

SMALL = {"curves": LoadGrid((17.9e-3,), (0.0, 3000.0, 12000.0)),
         "alpha": AlphaSettings(LoadGrid((17.9e-3,), (0.0, 3000.0)), LoadGrid((20e-3,), (1000.0,))),
         "settings": Settings(MeshSettings(order=3).refined(0.7))}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[study.Study, Path, list[str]]:
    folder = tmp_path_factory.mktemp("study")
    plan = study.default_study()
    plan = replace(plan, specimens=plan.specimens[::2], sources=plan.sources[::2], **SMALL)
    steps: list[str] = []
    study.run_study(plan, steps.append).save(folder)
    return plan, folder, steps


def test_loads_of_a_fit_and_those_held_out_are_read_as_such() -> None:
    """As they stand in the shipped file."""
    alpha = study.default_study().alpha
    assert alpha.fit is not None
    assert alpha.held_out is not None
    assert alpha.fit.masses == pytest.approx((17.9e-3, 22.45e-3))
    assert alpha.held_out.masses == pytest.approx((12e-3, 20e-3, 25e-3))


def table(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_default_is_the_paper_s_three_actuators() -> None:
    plan = study.default_study()
    assert [item.name for item in plan.specimens] == ["circular", "elliptical-small",
                                                      "elliptical-large"]
    assert (plan.mass, plan.voltage) == (17.9e-3, 0.0)


def test_everything_is_stored(finished) -> None:
    plan, folder, steps = finished
    assert len(steps) == plan.steps
    names = {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()
             and file.name != MANIFEST}
    assert names == {"alpha.json", "study.json"} | {
        f"{kind}/{name}.{suffix}" for name in ("circular", "elliptical-large")
        for kind, suffix in (("fields", "vtu"), ("lines", "csv"), ("curves", "csv"))} | {
        f"forces/{name}-force.{suffix}" for name in ("circular", "elliptical-large")
        for suffix in ("csv", "json")}
    record = json.loads((folder / "study.json").read_text())
    assert record["settings"]["mesh"]["order"] == 3
    assert [item["result"]["status"] for item in record["specimens"]] == ["equilibrium"] * 2
    weights = json.loads((folder / "alpha.json").read_text())
    assert set(weights[1]["bases"]) == {"membrane", "cone", "cone_scaled"}


def test_stored_fields_cover_the_whole_film(finished) -> None:
    plan, folder, _ = finished
    for specimen in plan.specimens:
        mesh = meshio.read(folder / "fields" / f"{specimen.name}.vtu")
        mounted = mesh.points - mesh.point_data["displacement"]
        assert mounted[:, 0].min() == pytest.approx(-specimen.frame.semi_axes[0], rel=1e-9)
        assert mounted[:, 1].max() == pytest.approx(specimen.frame.semi_axes[1], rel=1e-9)
        a, b, c = (mounted[mesh.cells_dict["triangle"][:, corner], :2] for corner in range(3))
        area = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))).sum() / 2
        assert area == pytest.approx(np.pi * (np.prod(specimen.frame.semi_axes) - 1e-4), rel=5e-3)


def test_stored_lines_end_at_plate_and_frame(finished) -> None:
    _, folder, _ = finished
    rows = table(folder / "lines" / "elliptical-large.csv")
    for line, reach in (("x", 75.0), ("y", 45.0)):
        distance = np.array([float(row["distance_mm"]) for row in rows if row["line"] == line])
        assert np.all(np.diff(distance) >= -1e-9)
        assert distance[[0, -1]] == pytest.approx([-reach, reach])
        assert np.abs(distance).min() == pytest.approx(10.0)
    around = np.array([float(row["distance_mm"]) for row in rows if row["line"] == "plate"])
    assert around[-1] == pytest.approx(2 * np.pi * 10, rel=2e-2)


def test_curves_end_where_the_film_does(finished) -> None:
    plan, folder, _ = finished
    rows = table(folder / "curves" / "circular.csv")
    asked, way = ([row for row in rows if row["asked"] == number] for number in "10")
    assert [row["status"] for row in asked] == ["equilibrium", "equilibrium", "no_equilibrium"]
    assert float(asked[1]["deflection_mm"]) > float(asked[0]["deflection_mm"]) > 2
    assert asked[2]["deflection_mm"] == ""
    record = json.loads((folder / "study.json").read_text())["specimens"][0]
    told = record["curves"]["curves"][0]["limits"]
    assert told["pull_in"] is None
    assert 1e3 * float(way[-1]["voltage_kV"]) == pytest.approx(told["instability"]["voltage_V"])
    reached = limits(Case(plan.specimens[0], mass=17.9e-3), plan.settings)
    assert reached.instability is not None
    assert told["instability"]["voltage_V"] == pytest.approx(
        reached.instability.voltage_V, rel=1e-4)


def test_forces_cross_the_weight_where_the_curve_says(finished) -> None:
    """At the highest voltage that it bears: the stroke is that of deflection against voltage."""
    _, folder, _ = finished
    for specimen in study.StudyResult.load(folder).specimens:
        asked = [row["deflection_mm"] for row in table(
            folder / "curves" / f"{specimen.name}.csv") if row["asked"] == "1"]
        deflection = [float(cell) for cell in asked[:2]]
        assert specimen.force is not None
        assert [curve.voltage_V for curve in specimen.force.curves] == [0.0, 3000.0]
        stroke = specimen.force.loads[0].stroke_m
        assert 1e3 * stroke == pytest.approx(deflection[1] - deflection[0], rel=1e-6)


def test_a_film_without_prestretch_has_no_force_curve_from_its_slack_shape(finished) -> None:
    plan, folder, _ = finished
    specimen = plan.specimens[0]
    slack = replace(specimen, membrane=replace(specimen.membrane, prestretch=(1.0, 1.0)))
    curves = study.StudyResult.load(folder).specimens[0].curves
    assert study._force(plan, slack, curves) is None


def test_a_study_that_cannot_be_saved_whole_is_seen_to_be_unfinished(finished, tmp_path) -> None:
    _, folder, _ = finished
    store.write_text(tmp_path / "study.json", "{}")
    (tmp_path / "lines").write_text("where a folder should be")
    with pytest.raises(InputError, match="cannot be written"):
        study.StudyResult.load(folder).save(tmp_path)
    assert not (tmp_path / "study.json").exists()
    assert {file.name for file in tmp_path.rglob(".*")} == {MANIFEST}


def test_what_is_loaded_is_saved_as_it_was(finished, tmp_path) -> None:
    _, folder, _ = finished
    study.StudyResult.load(folder).save(tmp_path)
    for file in sorted(folder.rglob("*.json")) + sorted(folder.rglob("*.csv")):
        assert (tmp_path / file.relative_to(folder)).read_text() == file.read_text()


def test_a_film_without_force_curve_leaves_none_of_an_earlier_run(finished, tmp_path) -> None:
    _, folder, _ = finished
    first = study.StudyResult.load(folder).specimens[0]
    first.save(tmp_path)
    replace(first, force=None).save(tmp_path)
    assert first.with_files(tmp_path, "specimens[0]").force is None


def test_a_load_without_picture_is_said(finished) -> None:
    plan, _, _ = finished
    with pytest.raises(InputError, match=r"circular.*no picture at 17.9 g and 12 kV.*thins"):
        study.run_study(replace(plan, voltage=12e3))


def test_atomic_write_keeps_the_old_file_when_writing_fails(tmp_path) -> None:
    file = tmp_path / "result.json"
    store.write_text(file, "old")

    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left"):
        store.write_atomically(file, fail)
    assert file.read_text() == "old"
    assert {item.name for item in tmp_path.iterdir()} == {"result.json", MANIFEST}


def test_a_file_of_somebody_else_is_neither_replaced_nor_removed(tmp_path) -> None:
    file = tmp_path / "material.toml"
    file.write_text("mine")
    for replacing in (partial(store.write_text, file, "ours"),
                      partial(store.remove, tmp_path, file.name)):
        with pytest.raises(InputError, match=r"material\.toml: is there already"):
            replacing()
    assert file.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [file]


STUDY = """
name = "mine"
specimens = ["a.toml"]
mass = "20 g"
[curves]
mass = ["20 g"]
voltage = ["0 kV", "1 kV"]
[rig]
gravity = "9.81 m/s^2"
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('["a.toml"]', "[]", "specimens: given []: must be a specimen: its file"),
        ('["a.toml"]', '["a.toml", "a.toml"]', "different names"),
        ('["a.toml"]', '["b.toml"]', "b.toml: cannot be read"),
        ('mass = "20 g"\n[', 'mess = "20 g"\n[', "mess: unknown key: did you mean 'mass'"),
        ('["0 kV", "1 kV"]', '["1 kV", "0 kV"]',
         "curves.voltage: given ['1 kV', '0 kV']: must ascend"),
        ("gravity", "gravitas", "rig.gravitas: unknown key"),
    ],
)
def test_study_files(tmp_path, old, new, words) -> None:
    source = study.default_study().sources[0]
    (tmp_path / "a.toml").write_text(source)
    file = tmp_path / "study.toml"
    file.write_text(STUDY)
    plan = study.read_study(file)
    assert (plan.name, plan.mass, plan.rig.gravity) == ("mine", 20e-3, 9.81)
    assert plan.curves == LoadGrid((20e-3,), (0.0, 1000.0))
    assert plan.alpha == AlphaSettings()
    file.write_text(STUDY.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        study.read_study(file)
    assert words in str(error.value)


@pytest.mark.study(seconds=5)
def test_bands_of_films_that_scatter_are_stored_with_results_curves_and_forces(
        tmp_path: Path) -> None:
    plan = study.default_study()
    given = Tolerances(thickness=Scatter(batch=0.03))
    plan = replace(plan, specimens=plan.specimens[:1], sources=plan.sources[:1], tolerances=given,
                   **SMALL)
    study.run_study(plan).save(tmp_path)
    stored, = study.StudyResult.load(tmp_path).specimens
    band = stored.result.bands["deflection_m"]
    assert stored.result.deflection_m is not None
    assert band.low < stored.result.deflection_m < band.high
    first, *_ = stored.curves.curves
    assert len(first.banded) > 10
    assert stored.force is not None
    assert all(len(curve.banded) > 10 for curve in stored.force.curves)
    with pytest.raises(InputError, match="margin: must be left out"):
        study.run_study(replace(plan, tolerances=Tolerances(margin=LengthScatter(film=1e-4))))
