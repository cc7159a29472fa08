"""Readings that are equilibria of some film can be judged, however soft, stiff or near its limit;
what no film can show is left out by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.random_designs import RandomDesign, random_design, written
from benchmarks.trials.synthetic_trials import MASSES, Truth, design_of, paper
from tests.oracles import axisymmetric
from tests.support.costs import dear
from tests.support.library import among
from tests.support.specimens import reference_film
from tympan.base.errors import InputError
from tympan.fem.film.laws import Ogden
from tympan.fem.film.laws.stiffened import scaled
from tympan.studies.case import Case, solve
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import Calibration, calibrated, law_error
from tympan.studies.diagnosis.diagnose import diagnose, judge_dataset
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.sampling import FINE
from tympan.studies.effects import Setup

DOZEN = range(100, 112)
#: Of these the suite runs a third: a circle and a rectangle of a Gent rubber, a superellipse with
#: its tilt, ellipses with their film's voltage, and a stadium beside a superellipse and a circle.
FEW = (101, 102, 104, 110)


def _prepared(drawn: RandomDesign, folder: Path) -> PreparedReadings:
    made = written(drawn, folder)
    assert made is not None
    return prepared_readings(read_dataset(made))


@pytest.mark.study(seconds=4, only=("106", "108"))
@pytest.mark.parametrize("number", [*FEW, *(dear(number, seconds=6) for number in DOZEN
                                            if number not in FEW)])
def test_any_film_is_calibrated_by_its_own_equilibria(number: int, tmp_path: Path) -> None:
    """Stiffness off by 0.4 to 2.5, to 97 % of the limit: the truth is within noise, all is kept."""
    drawn = random_design(number)
    readings = _prepared(drawn, tmp_path)
    nominal = calibrated(readings.setup, readings.table)
    assert len(nominal.table) == len(readings.table)
    error = law_error(nominal.simulation, nominal.fit, nominal.table)
    assert error < max(0.3 * drawn.noise, 5e-6)
    residual = nominal.fit.residual * nominal.table.sigma
    lengths = nominal.table.lengths
    assert np.sqrt(np.mean(residual[lengths] ** 2)) < 2 * np.hypot(drawn.noise, error)
    factors = np.log([drawn.truth.stiffness, drawn.truth.permittivity])
    widths = np.sqrt(np.diag(nominal.fit.covariance))
    assert np.all(np.abs(nominal.fit.unknowns - factors) < 5 * widths + 0.02)


@pytest.mark.study
@pytest.mark.parametrize("number", DOZEN)
def test_any_design_is_diagnosed(number: int, tmp_path: Path) -> None:
    made = written(random_design(number), tmp_path)
    assert made is not None
    assert diagnose(read_dataset(made)).verdict in ("nothing", "ambiguous", "named", "unexplained")


@pytest.fixture(scope="module")
def circle() -> Setup:
    """The paper's circular actuator."""
    setup = paper().setup
    return replace(setup, specimens=setup.specimens[:1])


def _read(setup: Setup, voltages: list[float], heaves: list[float]) -> ReadingTable:
    states = States.of([0] * len(voltages), [MASSES[0]] * len(voltages), voltages)
    return rows(states, "displacement", 1e-5, np.array(heaves), file="static.csv",
                line=np.arange(2, 2 + len(voltages)))


def _calibrated(setup: Setup, voltages: list[float], heaves: list[float]) -> Calibration:
    return calibrated(setup, _read(setup, voltages, heaves))


@pytest.mark.parametrize("stiffness", [0.7, 1.4])
def test_a_film_weighs_the_same_however_stiff_it_is(circle: Setup, stiffness: float) -> None:
    """Readings of finite elements with a film of 1 kg/m² mounted, a reduced one of which would be
    70 and 120 µm off if its weight grew with its stiffness."""
    heavy = circle.with_films(lambda film: replace(film, density=5e3))
    true = heavy.with_films(lambda film: replace(film, material=scaled(film.material, stiffness)))
    voltages = np.linspace(0.0, 3.5e3, 6).tolist()
    heaves = [solve(Case(true.specimens[0], mass=MASSES[0], voltage=voltage), FINE).deflection_m
              for voltage in voltages]
    nominal = _calibrated(heavy, voltages, heaves)
    assert law_error(nominal.simulation, nominal.fit, nominal.table) < 5e-7
    assert np.exp(nominal.fit.unknowns[:2]) == pytest.approx([stiffness, 1.0], rel=1e-3)


def test_readings_past_every_limit_are_left_out_by_name(circle: Setup) -> None:
    """A plate that hit a stop, far past pull-in, at the last two voltages."""
    voltages, good = [0.0, 2e3, 4e3, 5e3, 6e3], [2.06e-3, 2.16e-3, 2.46e-3, 2.77e-3, 3.25e-3]
    nominal = _calibrated(circle, [*voltages, 11e3, 14e3], [*good, 20e-3, 20e-3])
    assert nominal.table.line.tolist() == [2, 3, 4, 5, 6]
    assert sorted(nominal.simulation.laws[0].grid.nodes[0])[-1] < 10e-3
    words = "; ".join(nominal.remarks)
    assert "static.csv line" in words
    assert "(circular, 17.9 g, " in words
    assert "left out: " in words
    assert nominal.fit.unknowns == pytest.approx(
        _calibrated(circle, voltages, good).fit.unknowns, abs=1e-2)


def test_when_hardly_any_reading_is_left_there_is_one_message(circle: Setup) -> None:
    voltages = [0.0, 2e3, 4e3, 5e3, 11e3, 14e3]
    with pytest.raises(InputError, match="less than 5 are left"):
        _calibrated(circle, voltages, [2.06e-3, 2.16e-3, 2.46e-3, 2.77e-3, 20e-3, 20e-3])


def test_readings_of_a_film_that_wrinkles_are_kept_and_named(tmp_path: Path) -> None:
    """0.4 times as stiff as stated, and stretched so little that it wrinkles before it thins.

    At 8 kV, 99 % of its limit, an axisymmetric film kept from wrinkling is pressed along the plate,
    but has a natural width; at the voltage before it is tense everywhere.
    """
    prestretch, mass, voltages = 1.1, 10e-3, np.linspace(0.0, 8e3, 8)
    circle = paper().setup.specimens[0]
    law = circle.membrane.material
    exact = reference_film(Ogden(tuple(0.4 * mu for mu in law.mu), law.alpha),
                           prestretch=prestretch)
    tense, pressed = (axisymmetric.solve_load(exact, mass * 9.80665, voltage)
                      for voltage in voltages[-2:])
    assert tense.total2(np.linspace(10e-3, 45e-3, 36)).min() > 0
    assert pressed.total2(10e-3) < -300
    l1, l2 = pressed.lambda1([10e-3]), pressed.lambda2([10e-3])
    assert axisymmetric.natural_width(exact, l1, l2, pressed.voltage**2) > l2

    film = replace(circle.membrane, prestretch=(prestretch, prestretch))
    setup = replace(paper().setup, specimens=(replace(circle, membrane=film),))
    states = States.of([0] * 8, [mass] * 8, voltages)
    drawn = RandomDesign(0, design_of("soft", setup, states), Truth(0.4), 5e-6)
    readings = _prepared(drawn, tmp_path)
    nominal = calibrated(readings.setup, readings.table)
    assert len(nominal.table) == 8
    assert nominal.fit.unknowns == pytest.approx(np.log([0.4, 1.0]), abs=0.01)
    assert [remark.split(" (")[0] for remark in nominal.remarks] == ["static.csv line 9"]
    assert "loss of tension" in nominal.remarks[0]


@pytest.mark.study(seconds=9)
@pytest.mark.parametrize(("cause", "sizes"), [("plate_eccentricity", (3e-3, 0.0)),
                                              dear("prestretch_anisotropy", (0.03,), seconds=28)])
@among("strain_stiffening", "prestretch_anisotropy", "plate_eccentricity", "parallel_spring",
       "sensor_gain", seconds=40)
def test_tilts_tell_a_plate_off_centre_from_an_unequal_prestretch(cause: str,
                                                                  sizes: tuple[float, ...],
                                                                  tmp_path: Path) -> None:
    """Which the heave alone cannot; made by finite elements under loads, on another mesh."""
    design = paper()
    setup = replace(design.setup, specimens=design.setup.specimens[:2])
    states = States.of(np.repeat([0, 1], 12), np.tile(np.repeat(MASSES, 6), 2),
                       np.tile(np.linspace(0, 6.5e3, 6), 4))
    truth = Truth(1.05, 0.97, (Cause(cause),), sizes)
    drawn = RandomDesign(0, design_of("tilt", setup, states), truth, 15e-6)
    _, blind, _ = judge_dataset(read_dataset(_folder(drawn, tmp_path / "heave")))
    assert not blind.named
    readings, seen, _ = judge_dataset(read_dataset(_folder(replace(
        drawn, channels=("tilt_mrad",)), tmp_path / "tilt")))
    assert [str(named) for named in seen.named] == [cause]
    assert not any("tilt" in remark for remark in readings.remarks)


def _folder(drawn: RandomDesign, folder: Path) -> Path:
    made = written(drawn, folder)
    assert made is not None
    return made
