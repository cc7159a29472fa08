"""A quantity that is registered here alone is asked everywhere, and answers by its formula."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from tests.support.specimens import SOFT, specimen_toml
from tests.support.sweeps import read
from tympan.fem.film.library import load_specimen
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings
from tympan.studies.design.design import design
from tympan.studies.design.requirements import Requirements
from tympan.studies.parallel import serial
from tympan.studies.sweep.run import run_sweep
from tympan.studies.tolerance.tolerance import ToleranceCase, tolerance
from tympan.studies.wanted import QUANTITIES, Quantity, wanted_bounds

SWEEP = """
specimen = "oval.toml"
mass = "17.9 g"
voltage = "2 kV"
ask = ["stored"]
"""
WANTED = """
specimen = "oval.toml"
mass = "17.9 g"
voltage = "2 kV"
tolerances = "none"
[want]
stored = "largest"
capacitance = "at least 100 pF"
[vary]
"plate.radius" = ["9 mm", "11 mm"]
"""
COARSE = Settings(MeshSettings().refined(0.5))


@pytest.fixture(autouse=True)
def stored(monkeypatch: pytest.MonkeyPatch) -> Quantity:
    """Energy of the charged film, U² C/2."""
    quantity = Quantity("stored", "energy of the charge", "energy", True,
                        lambda films: films.capacitance[:, 1] * films.voltage**2 / 2)
    monkeypatch.setitem(QUANTITIES, quantity.name, quantity)
    return quantity


def test_a_sweep_has_it_as_a_column(tmp_path: Path) -> None:
    result = run_sweep(read(tmp_path, SWEEP), tmp_path / "out", serial)
    rows = pd.read_csv(tmp_path / "out" / "sweep.csv")
    assert rows["stored_J"].to_numpy() == pytest.approx(
        rows["capacitance_F"] * rows["voltage_V"]**2 / 2, rel=1e-9)
    assert result.table["stored_J"].attrs["units"] == "J"
    assert result.best("stored", under="stored > 0.1 mJ").of == "stored_J"


def test_a_design_makes_it_largest(tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(film=SOFT), encoding="utf-8")
    (tmp_path / "wanted.toml").write_text(WANTED, encoding="utf-8")
    film = design(Requirements.read(tmp_path / "wanted.toml"), COARSE).films[0]
    found = {each.key: each for each in film.quantities}
    assert found["stored"].unit == "J"
    capacitance = found["capacitance at least"].value
    assert found["stored"].value == pytest.approx(capacitance * 2e3**2 / 2, rel=1e-9)


def test_films_that_scatter_are_held_against_a_bound_of_it(tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(film=SOFT), encoding="utf-8")
    specimen = load_specimen(tmp_path / "oval.toml")
    wanted = wanted_bounds("stored = 0.1 mJ, capacitance = at least 100 pF")
    case = ToleranceCase(specimen, mass="17.9 g", voltage="2 kV", films=100, wanted=wanted)
    bounds = tolerance(case, COARSE).wanted
    assert [bound.kept.probability for bound in bounds] == [1.0, 1.0]
    assert [bound.name for bound in bounds] == ["stored", "capacitance"]
