"""Readings of the centre of films without plate, held by gas in place of a tester."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.oracles import axisymmetric
from tests.oracles.axisymmetric import neo_hooke
from tests.oracles.inflation import Disc, Loads, minimise
from tests.support.datasets import SPECIMEN, write_dataset
from tympan.base.errors import InputError
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.data.checks import summary
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated, with_masses
from tympan.studies.diagnosis.diagnose import conclude
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.reading_table import States, rows
from tympan.studies.effects import Setup

OUTER, THICKNESS, MU, STRETCH, PERMITTIVITY = 45e-3, 1e-3, 20e3, 2.0, 4.7
DISC = Disc(0.0, OUTER, THICKNESS, STRETCH, neo_hooke(MU), PERMITTIVITY)
FILM = Specimen("disc", Circle(OUTER), None, Film(
    thickness=THICKNESS, prestretch=(STRETCH, STRETCH), material=NeoHooke(MU),
    relative_permittivity=PERMITTIVITY))
VOLTAGES = np.linspace(0.0, 5e3, 9)
HEAD = """name = "bulge"
noise = "5 um"
[[specimen]]
name = "disc"
[specimen.frame]
shape = "circle"
radius = "45 mm"
[specimen.membrane]
thickness = "1 mm"
prestretch = [2, 2]
relative_permittivity = 4.7
[specimen.membrane.material]
law = "neo_hooke"
mu = "20 kPa"
[rig]
gas_pressure = "80 Pa"
"""


def exact(pressure: float, voltages: np.ndarray, film: Disc = DISC, weight: float = 0.0
          ) -> np.ndarray:
    """Deflections of the centre, positive downwards; gas lifts, and weight pulls down."""
    return np.array([-minimise(film, Loads(pressure, 0.0, voltage, -weight)).apex
                     for voltage in voltages.tolist()])


@pytest.mark.parametrize("pressure", [80.0, -80.0])
@pytest.mark.parametrize("grease", [0.0, 0.2], ids=["weightless", "with grease"])
def test_reduced_centres_are_those_of_the_axisymmetric_equations(pressure: float, grease: float
                                                                 ) -> None:
    """Stiffness and permittivity, fitted to exact readings, are as stated."""
    gravity = 9.80665
    # Grease is a weight per mounted area, the equations' one per virgin area.
    values = exact(pressure, VOLTAGES, weight=grease * gravity * STRETCH**2)
    specimen = replace(FILM, electrode=Electrode(mass=grease))
    states = States.of([0] * len(VOLTAGES), np.zeros(len(VOLTAGES)), VOLTAGES)
    table = rows(states, "displacement", 1e-6).with_values(values)
    found = calibrated(Setup((specimen,), Rig(gas_pressure=pressure)), table)
    assert np.exp(found.fit.unknowns) == pytest.approx([1.0, 1.0], abs=1e-3 if grease else 3e-4)
    shown = with_masses(found.simulation).predict((), np.zeros(2), table)
    # What weighs acts along the load, gas across the film.
    assert shown == pytest.approx(values, rel=2e-3 if grease else 2e-4)


def table(values: np.ndarray, mass: str = "") -> str:
    lines = ["specimen,voltage_kV,displacement_mm" + ",mass_g" * bool(mass)]
    lines += [f"disc,{voltage / 1e3},{1e3 * value:.6f}" + f",{mass}" * bool(mass)
              for voltage, value in zip(VOLTAGES.tolist(), values.tolist(), strict=True)]
    return "\n".join(lines) + "\n"


def test_a_film_without_plate_has_no_column_of_masses(tmp_path: Path) -> None:
    values = np.linspace(-6e-3, -9e-3, len(VOLTAGES))
    read = [read_dataset(write_dataset(tmp_path / f"d{mass}", HEAD, (), static=table(values, mass)))
            for mass in ("", "0")]
    assert all(data.static is not None and not data.static.mass.any() for data in read)
    with pytest.raises(InputError, match=r"line 2, column 4 .*must be 0 or left out: a mass hangs"):
        read_dataset(write_dataset(tmp_path / "loaded", HEAD, (), static=table(values, "17.9")))


def test_a_tester_s_forces_need_a_plate(tmp_path: Path) -> None:
    values = np.linspace(-6e-3, -9e-3, len(VOLTAGES))
    folder = write_dataset(tmp_path / "d", HEAD, (), static=table(values),
                           force="specimen,voltage_kV,displacement_mm,force_mN\ndisc,0,1,20\n")
    with pytest.raises(InputError, match=r"has no plate, which force\.csv is read of: leave it"):
        conclude(read_dataset(folder))


def test_a_sag_of_the_voltage_is_named_on_a_bulge_of_the_equations(tmp_path: Path) -> None:
    sag = 9e3
    seen = VOLTAGES / (1 + (VOLTAGES / sag) ** 2)
    film = replace(DISC, relative_permittivity=1.05 * PERMITTIVITY,
                   material=neo_hooke(0.93 * MU))
    values = exact(80.0, seen, film) + 5e-6 * np.random.default_rng(3).standard_normal(9)
    found = conclude(read_dataset(write_dataset(tmp_path / "d", HEAD, (), static=table(values))))
    result = found.diagnosis()
    assert "voltage_sag" in [cause.effect for cause in result.causes[:2]]
    assert result.verdict in ("named", "ambiguous")
    assert "plate" not in result.next_experiment.what


@pytest.mark.parametrize("stiffness", [0.9, 1.08, 1.3])
def test_a_plate_above_gas_whose_film_is_stiffer_is_that_of_the_equations(stiffness: float) -> None:
    """The gas lifts a stiffer film no more: readings of the equations are those of the factors."""
    pressure, inner, mass = 80.0, 10e-3, 25e-3
    film = axisymmetric.Film(inner, OUTER, THICKNESS, STRETCH, neo_hooke(stiffness * MU),
                             PERMITTIVITY)
    plated = replace(FILM, plate=Plate(Circle(inner)))
    values = np.array([-minimise(film, Loads(pressure, np.pi * inner**2 * pressure - mass * 9.80665,
                                             voltage)).apex for voltage in VOLTAGES.tolist()])
    states = States.of([0] * len(VOLTAGES), np.full(len(VOLTAGES), mass), VOLTAGES)
    table = rows(states, "displacement", 1e-6).with_values(values)
    found = calibrated(Setup((plated,), Rig(gas_pressure=pressure)), table)
    assert np.exp(found.fit.unknowns) == pytest.approx([stiffness, 1.0], rel=3e-3)


def test_what_goes_against_the_gas_is_a_sign(tmp_path: Path) -> None:
    values = np.linspace(6e-3, 9e-3, len(VOLTAGES))
    folder = write_dataset(tmp_path / "d", HEAD, (), static=table(values))
    with pytest.raises(InputError, match=r"the centre of disc goes the wrong way: .* lifts it"):
        conclude(read_dataset(folder))


def test_ranges_of_a_film_that_gas_lifts_are_negative(tmp_path: Path) -> None:
    low, high = exact(80.0, VOLTAGES[[0, 2]]), exact(80.0, VOLTAGES[[3, 8]])
    lines = [f"disc,{VOLTAGES[0] / 1e3},{VOLTAGES[end] / 1e3},{1e3 * (value - low[0]):.5f}"
             for end, value in ((2, low[1]), (3, high[0]), (8, high[1]))]
    text = "specimen,voltage_min_kV,voltage_max_kV,range_mm\n" + "\n".join(lines) + "\n"
    data = read_dataset(write_dataset(tmp_path / "d", HEAD, (), range=text))
    assert data.ranges is not None
    assert (data.ranges.range < 0).all()
    pressed = HEAD.replace("80 Pa", "-80 Pa")
    with pytest.raises(InputError, match=r"range_mm\): given '-.*': must not be negative"):
        read_dataset(write_dataset(tmp_path / "pressed", pressed, (), range=text))


def test_films_with_and_without_plate_share_stiffness_and_gas(tmp_path: Path) -> None:
    pressure, inner, mass, stiffness = 80.0, 10e-3, 25e-3, 1.08
    plate = replace(FILM, name="plate", plate=Plate(Circle(inner)))
    law = neo_hooke(stiffness * MU)
    bare = exact(pressure, VOLTAGES, replace(DISC, material=law))
    film = axisymmetric.Film(inner, OUTER, THICKNESS, STRETCH, law, PERMITTIVITY)
    loaded = np.array([-minimise(film, Loads(
        pressure, np.pi * inner**2 * pressure - mass * 9.80665, voltage)).apex
        for voltage in VOLTAGES.tolist()])
    count = len(VOLTAGES)
    states = States.of([0] * count + [1] * count, [0.0] * count + [mass] * count,
                       np.tile(VOLTAGES, 2))
    values = rows(states, "displacement", 1e-6).with_values(np.r_[bare, loaded])
    rig = Rig(gas_pressure=pressure, weight_offset=(0.0, 0.0))
    found = calibrated(Setup((FILM, plate), rig), values)
    assert np.exp(found.fit.unknowns) == pytest.approx([stiffness, 1.0], rel=3e-3)


def test_nothing_that_acts_on_a_plate_is_a_cause_without_one() -> None:
    states = States.of([0] * len(VOLTAGES), np.zeros(len(VOLTAGES)), VOLTAGES)
    setup = Setup((FILM,), Rig(gas_pressure=80.0))
    there = {cause.name for cause in PreparedReadings(
        setup, rows(states, "displacement", 1e-6), ()).causes}
    assert not there & {"friction", "unaccounted_mass", "parallel_spring", "plate_eccentricity"}
    assert {"voltage_sag", "electrode_margin", "electrode_mass"} <= there


def test_masses_are_left_blank_row_by_row(tmp_path: Path) -> None:
    head = HEAD.replace('[rig]', '') .replace('gas_pressure = "80 Pa"\n', "")
    head += SPECIMEN.format(name="A") + '[rig]\ngas_pressure = "80 Pa"\n'
    text = "specimen,mass_g,voltage_kV,displacement_mm\n"
    data = read_dataset(write_dataset(tmp_path / "d", head, (), static=text
                                      + "disc,,0,-6\nA,20,0,2\n"))
    assert data.static is not None
    assert data.static.mass.tolist() == [0.0, 0.02]
    with pytest.raises(InputError, match=r"line 3, column 2 .*the film has a plate"):
        read_dataset(write_dataset(tmp_path / "e", head, (), static=text
                                   + "disc,,0,-6\nA,,0,2\n"))


def test_a_draft_asks_for_the_gas_and_for_no_mass(tmp_path: Path) -> None:
    film = HEAD.partition("[[specimen]]")[2].partition("[rig]")[0].replace("[specimen.", "[")
    (tmp_path / "film.toml").write_text(film, encoding="utf-8")
    (tmp_path / "Test 7.csv").write_text(table(np.linspace(-6e-3, -9e-3, len(VOLTAGES))))
    text = tympan.draft(tmp_path / "Test 7.csv").read_text(encoding="utf-8")
    assert "mass" not in text
    assert 'sign = "down" }  # CORRECT THIS: gas from below lifts' in text
    file = tmp_path / "dataset.toml"
    file.write_text(text.replace('"? Pa"', '"80 Pa"').replace("CORRECT THIS: ", ""))
    read = read_dataset(tmp_path)
    assert read.static is not None
    assert read.static.displacement[0] == pytest.approx(-6e-3)
    assert summary(read)["masses_kg"] == []
