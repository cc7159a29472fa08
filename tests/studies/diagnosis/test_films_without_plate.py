"""Readings of the centre of films without plate, held by gas in place of a tester."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.oracles.axisymmetric import neo_hooke
from tests.oracles.inflation import Disc, Loads, minimise
from tests.support.datasets import write_dataset
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Electrode, Film, Specimen
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated, with_masses
from tympan.studies.diagnosis.diagnose import conclude
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
