"""Variables that a test alone registers are shown wherever a state of a film is shown."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import trapezoid

import tympan
from tests.oracles import axisymmetric
from tests.support.specimens import ROOT5, ROUND, circular, specimen_toml
from tests.support.tolerances import STILL
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.geometry.mesher import MeshSettings
from tympan.reports.schema import class_keys
from tympan.studies.case import Case, CaseResult, Settings, solve
from tympan.studies.design.design import design
from tympan.studies.design.requirements import Requirements
from tympan.studies.parallel import serial
from tympan.studies.path import PathResult, Station, path
from tympan.studies.sweep import reduced
from tympan.studies.sweep.plan import read_sweep
from tympan.studies.sweep.run import run_sweep
from tympan.studies.tolerance.bands import banded
from tympan.studies.tolerance.given import Scatter
from tympan.studies.transient import FieldResponse
from tympan.studies.variables import VARIABLES, Variable

SOFT, MASS, VOLTAGE = circular(NeoHooke(15e3)), 17.9e-3, 3e3
SOFT_TOML = specimen_toml("soft", ROUND, 'material = { law = "neo_hooke", mu = "15 kPa" }', ROOT5)
ORACLE = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
COARSE = Settings(MeshSettings().refined(0.5))
REFINE = ["--refine", "0.5"]
#: Tolerances of the thickness alone.
UNEVEN = replace(STILL, thickness=Scatter(film=0.05))
MEAN, APART = "mean_thickness_m", "stretches_apart"


@pytest.fixture(autouse=True, scope="module")
def strangers() -> Iterator[None]:
    """A mean over the electrode, and the largest value of a field that is none of the program's."""
    VARIABLES.register(Variable(
        MEAN, "mean thickness of the film under the electrode", "length",
        lambda states: states.mean(lambda film: film.thickness, covered=True)))
    VARIABLES.register(Variable(
        APART, "largest difference of the principal stretches", "",
        lambda states: states.largest(lambda film: film.stretch_1 - film.stretch_2)))
    yield
    del VARIABLES[MEAN], VARIABLES[APART]


def exact(voltage: float, thickness: float = 1e-3) -> tuple[float, float]:
    """Both by the axisymmetric equations; the mean is over the mounted annulus."""
    film = axisymmetric.solve_load(replace(ORACLE, thickness=thickness), MASS * 9.80665, voltage)
    r = np.linspace(ORACLE.inner, ORACLE.outer, 4001)
    first, second = film.lambda1(r), film.lambda2(r)
    mean = trapezoid(thickness / (first * second) * r, r) / trapezoid(r, r)
    return float(mean), float(np.abs(first - second).max())


@pytest.fixture(scope="module")
def solved() -> CaseResult:
    return solve(Case(SOFT, mass=MASS, voltage=VOLTAGE), COARSE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("soft")
    (made / "soft.toml").write_text(SOFT_TOML, encoding="utf-8")
    return made


def test_solve_shows_them_by_the_equations(solved: CaseResult) -> None:
    mean, apart = exact(VOLTAGE)
    assert solved.mean_thickness_m == pytest.approx(mean, rel=1e-5)
    assert solved.stretches_apart == pytest.approx(apart, rel=3e-2)  # a steep edge, a coarse mesh
    fine = solve(Case(SOFT, mass=MASS, voltage=VOLTAGE), Settings(MeshSettings().refined(2.0)))
    assert fine.stretches_apart == pytest.approx(apart, rel=2e-3)
    assert fine.mean_thickness_m == pytest.approx(mean, rel=1e-7)


def test_they_are_in_all_that_solve_writes(solved: CaseResult, folder: Path, tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    words = ["solve", str(folder / "soft.toml"), *REFINE, "--mass", "17.9 g", "--voltage", "3 kV"]
    assert main([*words, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed[MEAN] == pytest.approx(solved.mean_thickness_m, rel=1e-7)
    solved.save(tmp_path)
    assert CaseResult.load(tmp_path) == solved
    assert main(words) == 0
    shown = f"mean thickness +{1e3 * solved.mean_thickness_m:.5g} mm"
    assert re.search(shown, capsys.readouterr().out)
    found = tympan.solve(SOFT, settings=COARSE, mass="17.9 g", voltage="3 kV")
    assert found.mean_thickness_m == pytest.approx(printed[MEAN], rel=1e-7)
    assert found.to_xarray()[MEAN].attrs["units"] == "m"
    rows = pd.read_csv(found.save(tmp_path / "soft.csv"))
    assert rows[APART][0] == pytest.approx(solved.stretches_apart, rel=1e-7)
    for result in (CaseResult, Station):
        key, = (key for key in class_keys(result) if key.path == MEAN)
        assert (key.meaning, key.unit) == ("mean thickness of the film under the electrode", "m")


def test_a_path_s_stations_have_them(solved: CaseResult, tmp_path: Path) -> None:
    branch = path(Case(SOFT, mass=MASS, voltage=VOLTAGE), COARSE, "mass")
    first = branch.stations[0]
    assert first.mean_thickness_m == pytest.approx(solved.mean_thickness_m, rel=1e-8)
    assert first.stretches_apart == pytest.approx(solved.stretches_apart, rel=1e-7)
    branch.save(tmp_path)
    assert PathResult.load(tmp_path) == branch
    rows = pd.read_csv(tmp_path / "circle-path.csv")
    assert rows[MEAN].to_numpy() == pytest.approx(branch.rows[MEAN], rel=1e-7)


def test_a_motion_has_them_at_its_samples(solved: CaseResult, folder: Path, tmp_path: Path) -> None:
    """A film without branches is at rest at each moment."""
    assert main(["transient", str(folder / "soft.toml"), *REFINE, "--mass", "17.9 g", "--signal",
                 "ramp", "--high", "3 kV", "--duration", "10 s", "--interval", "1 s", "--states",
                 "-o", str(tmp_path)]) == 0
    response, = FieldResponse.load(tmp_path).responses
    assert response.states is not None
    top = response.states.iloc[response.states[MEAN].argmin()]
    assert top["t_s"] == 5.0
    assert top[MEAN] == pytest.approx(solved.mean_thickness_m, rel=1e-7)
    assert top[APART] == pytest.approx(solved.stretches_apart, rel=1e-6)
    rows = pd.read_csv(tmp_path / "states.csv")
    assert rows["mean_thickness_mm"][5] == pytest.approx(1e3 * solved.mean_thickness_m, rel=1e-7)
    found = tympan.transient(SOFT, signal="ramp", mass="17.9 g", high="3 kV", duration="10 s",
                             interval="1 s", states=True, settings=COARSE)
    assert found.responses[0].states[MEAN].min() == pytest.approx(top[MEAN], rel=1e-7)


@pytest.mark.parametrize("by", ["finite elements", "reduced"])
def test_sweeps_have_them_as_columns(by: str, folder: Path, tmp_path: Path,
                                     monkeypatch: pytest.MonkeyPatch) -> None:
    if by == "reduced":
        monkeypatch.setattr(reduced, "_WORTH", 1)
    (folder / "SWEEP.toml").write_text(
        'specimen = "soft.toml"\nmass = "17.9 g"\nvoltage = ["0 kV", "3 kV"]\n'
        '[grid]\n"membrane.thickness" = ["0.95 mm", "1.05 mm"]\n', encoding="utf-8")
    result = run_sweep(read_sweep(folder / "SWEEP.toml", COARSE, exact=by != "reduced"),
                       tmp_path / "out", serial)
    rows = pd.read_csv(tmp_path / "out" / "sweep.csv")
    assert set(rows["by"]) == {by}
    for _, row in rows.iterrows():
        thickness = row["membrane.thickness_m"]
        film = replace(SOFT, membrane=replace(SOFT.membrane, thickness=thickness))
        there = solve(Case(film, mass=MASS, voltage=row["voltage_V"]), COARSE)
        assert row[MEAN] == pytest.approx(there.mean_thickness_m, rel=1e-5)
        assert row[APART] == pytest.approx(there.stretches_apart, rel=1e-3)
        assert row[MEAN] == pytest.approx(exact(row["voltage_V"], thickness)[0], rel=2e-5)
    assert result.table[MEAN].attrs["units"] == "m"


def test_films_within_tolerances_have_them_and_bounds_of_them(solved: CaseResult) -> None:
    films = tympan.films_within(SOFT, tolerances=UNEVEN, mass="17.9 g", voltage="3 kV", films=64,
                                seed=3, settings=COARSE)
    means = films.under("17.9 g", "3 kV").shown(MEAN)[:, 1]
    assert films.family.box.names == ("membrane.thickness",)
    for number in (5, 40):
        thickness = float(films.rows[number, 0])
        assert means[number] == pytest.approx(exact(VOLTAGE, thickness)[0], rel=2e-5)
    bound = float(np.median(means))
    spread = tympan.tolerance(SOFT, tolerances=UNEVEN, mass="17.9 g", voltage="3 kV", films=100,
                              seed=3, want=f"mean_thickness = at most {bound} m", settings=COARSE)
    assert spread.kept.probability == pytest.approx(0.5, abs=0.1)
    told = spread.quantities[MEAN]
    assert told.nominal == pytest.approx(solved.mean_thickness_m, rel=1e-5)
    assert told.median == pytest.approx(bound, rel=2e-2)
    assert told.shares[0].name == "thickness"
    with_bands = banded(solved, SOFT, UNEVEN, tympan.Rig(), COARSE)
    assert with_bands.bands[MEAN].low < solved.mean_thickness_m < with_bands.bands[MEAN].high


def test_a_design_keeps_bounds_of_them(folder: Path) -> None:
    (folder / "wanted.toml").write_text("""
specimen = "soft.toml"
mass = "17.9 g"
voltage = "3 kV"
tolerances = "none"
[want]
stroke = "largest"
mean_thickness = "at least 0.185 mm"
[vary]
"membrane.thickness" = ["0.9 mm", "1.1 mm"]
""", encoding="utf-8")
    film = design(Requirements.read(folder / "wanted.toml"), COARSE).films[0]
    quantity, = (each for each in film.quantities if each.name == "mean_thickness")
    thickness = film.numbers["membrane.thickness"].value
    chosen = replace(SOFT, membrane=replace(SOFT.membrane, thickness=thickness))
    there = solve(Case(chosen, mass=MASS, voltage=VOLTAGE), COARSE)
    assert quantity.value == pytest.approx(there.mean_thickness_m, rel=1e-9)
    assert quantity.value == pytest.approx(0.185e-3, rel=1e-3)
    assert quantity.binding


def test_what_a_film_does_not_have_is_none() -> None:
    flat = replace(SOFT, plate=None)
    found = solve(Case(flat, rig=tympan.Rig(gas_pressure=50.0)), COARSE)
    assert found.reaction_N is None
    assert found.mean_thickness_m is not None
    with pytest.raises(AttributeError, match="no attribute 'stretch_apart'"):
        _ = found.stretch_apart
