"""Masses against stiffness: frequencies beside readings at rest, made by the axisymmetric membrane
and Bessel's functions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.oracles import annulus_modes
from tests.oracles.readings import swinging
from tests.oracles.readings.round_actuators import Hidden
from tests.support.costs import dear
from tests.support.datasets import HEAD, write_dataset
from tests.support.models import model
from tests.support.specimens import circular
from tympan.cli import main
from tympan.fem.vibration.heave import following
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated, frequency_error
from tympan.studies.diagnosis.diagnose import judge_dataset
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.prediction import Prediction


@pytest.mark.parametrize(("plate", "near"), [(17.9e-3, 2e-6), (3e-3, 1.5e-4), (1e-3, 3e-3)])
def test_the_mass_of_a_film_is_that_of_the_flat_annulus(plate: float, near: float) -> None:
    """Against Bessel's functions, to third order in the film's share: 1.3 to 23 % of the mass."""
    a, b = swinging.SHAPES["middle"]
    film = following(model(circular(), refine=1.0), model(circular(), refine=1.0).mounted())
    for hidden in (Hidden(), Hidden(electrode=0.1)):
        exact = swinging.swinging_mass(a, b, plate, hidden)
        assert film.mass(plate, swinging.COAT, hidden.electrode) == pytest.approx(
            exact, rel=near)


@pytest.mark.parametrize(("refine", "near"), [(1.0, 1e-4), (2.0, 2e-5)])
def test_air_is_that_of_plate_and_film_together(refine: float, near: float) -> None:
    a, b = swinging.SHAPES["middle"]
    flat = model(circular(), refine=refine)
    assert following(flat, flat.mounted()).air == pytest.approx(
        annulus_modes.air_volume(a, b), rel=near)


@pytest.mark.parametrize(("hidden", "effect", "size"), [
    dear(Hidden(electrode=0.12), "electrode_mass", 0.12, seconds=19),
    dear(Hidden(added=1e-3), "added_mass", 1e-3, seconds=12),
    pytest.param(Hidden(unaccounted=5e-4), "unaccounted_mass", 5e-4, marks=pytest.mark.study),
    dear(Hidden(air=6.0), "air_mass", 6.0, seconds=12)])
def test_a_mass_is_named_by_frequencies(tmp_path: Path, hidden: Hidden, effect: str,
                                        size: float) -> None:
    """An unaccounted mass is named by taps in every run of the suite, in a trial of the study."""
    data = swinging.write(tmp_path / "d", hidden, seed=1)
    assert named(data, effect) == pytest.approx(size, rel=0.12)


def named(data: Path, effect: str) -> float:
    """The value [SI] of the effect that is named, and no other."""
    _, judgement, _ = judge_dataset(read_dataset(data))
    assert judgement.named == (Cause(effect),)
    assert judgement.chosen is not None
    parameter, = Cause(effect).effect.parameters
    return parameter.value(judgement.chosen.unknowns[2])


@pytest.mark.parametrize("electrode", [pytest.param(0.12, marks=pytest.mark.study), 0.5])
def test_heavy_grease_is_named_by_readings_at_rest_alone(tmp_path: Path, electrode: float) -> None:
    """It presses the more the larger the film is, beside the film's own weight, which is known: no
    sensor's gain does that, once the film weighs the same however stiff it is."""
    data = swinging.write(tmp_path / "d", Hidden(electrode=electrode), seed=1, swings=False)
    assert named(data, "electrode_mass") == pytest.approx(electrode, rel=0.05)


def test_at_rest_alone_it_is_not_there(tmp_path: Path) -> None:
    """Whatever swings along with the plate, readings at rest are the same to the last digit."""
    added, air = (swinging.write(tmp_path / name, hidden, seed=1, swings=False)
                  for name, hidden in (("added", Hidden(added=1e-3)), ("air", Hidden(air=6.0))))
    assert (added / "static.csv").read_bytes() == (air / "static.csv").read_bytes()
    assert (added / "dataset.toml").read_bytes() == (air / "dataset.toml").read_bytes()
    assert judge_dataset(read_dataset(added))[1].verdict == "nothing"


def test_nothing_hidden_is_nothing_found(tmp_path: Path) -> None:
    data = swinging.write(tmp_path / "d", Hidden(), seed=2)
    assert judge_dataset(read_dataset(data))[1].verdict == "nothing"


def test_reduced_frequencies_and_their_derivatives(tmp_path: Path) -> None:
    """Against the finite elements within 1e-3, and differences of themselves."""
    readings = prepared_readings(read_dataset(swinging.write(tmp_path / "d", Hidden(), seed=3)))
    nominal = calibrated(readings.setup, readings.table)
    assert frequency_error(nominal.simulation, nominal.fit, nominal.table) < 1e-3
    hypothesis = (Cause("electrode_mass"), Cause("added_mass"), Cause("air_mass"),
                  Cause("parallel_spring"))
    centre = np.array([0.05, -0.03, 0.04, 5e-4, 1.0, 2.0])
    jacobian = Prediction(nominal.simulation, hypothesis, centre, nominal.table).jacobian
    for number, step in enumerate(1e-3 * np.maximum(np.abs(centre), 1e-3)):
        ends = [nominal.simulation.predict(hypothesis, centre + sign * step * np.eye(6)[number],
                                           nominal.table) for sign in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        for kind, rows in nominal.table.rows_of.items():
            assert jacobian[rows, number] == pytest.approx(
                slope[rows], rel=2e-3, abs=1e-4 * np.abs(slope[rows]).max() + 1e-9), kind


def test_damping_widens_what_a_frequency_says(tmp_path: Path) -> None:
    rows = "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
        f"A,17.9,{kv},{2 + 0.03 * kv**2}\n" for kv in range(5))
    swings = ("specimen,mass_g,voltage_kV,mode,frequency_Hz,quality,sigma_Hz\n"
              "A,17.9,0,heave,11,,\nA,17.9,0,heave,11,2,\nA,17.9,0,heave,11,2,0.3\n")
    data = write_dataset(tmp_path / "d", 'noise = "20 um"\n' + HEAD, static=rows, frequency=swings)
    table = prepared_readings(read_dataset(data)).table
    assert table.sigma[table.kind == "frequency"] == pytest.approx([0.11, 11 / 16, 0.3])


def test_frequencies_alone_and_in_rad_per_s_get_one_message(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = "specimen,mass_g,voltage_kV,mode,frequency_Hz\n"
    alone = write_dataset(tmp_path / "a", frequency=head + "A,17.9,0,heave,11\n" * 6)
    static = "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
        f"A,17.9,{kv},{2 + 0.03 * kv**2}\n" for kv in range(5))
    fast = write_dataset(tmp_path / "b", 'noise = "20 um"\n' + HEAD, static=static,
                         frequency=head + "A,17.9,0,heave,69\n")
    for folder, words in ((alone, "must have static.csv or range.csv beside"),
                          (fast, "neither rad/s nor rpm")):
        assert main(["diagnose", str(folder), "-o", str(tmp_path / "out")]) == 2
        err = capsys.readouterr().err
        assert words in err
        assert err.count("\n") == 1
