"""Loops of force–displacement curves, which no film at rest has, by the axisymmetric equations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.oracles.axisymmetric import solve_deflection, solve_load
from tests.support.datasets import HEAD, write_dataset
from tests.support.library import library_of
from tests.support.specimens import circular, reference_film
from tympan.fem.toml_writer import specimen_to_toml
from tympan.reports.diagnosis.page import build_diagnosis_page, gain_words
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import diagnose
from tympan.studies.diagnosis.result import CHANNELS, Diagnosis

FILM = reference_film(circular().membrane.material)
#: Noise of a force and of a displacement, as stated [N, m].
FORCE, LENGTH = 0.5e-3, 10e-6
DISPLACEMENTS = np.linspace(0.5e-3, 6e-3, 23)
WAYS = [*((at, 1.0) for at in DISPLACEMENTS), *((at, -1.0) for at in DISPLACEMENTS[-2::-1])]


def judged(folder: Path, half: float, written: bool = True, shuffled: bool = False,
           zero: float = 0.0, stated: float = 1.0) -> Diagnosis:
    """The verdict on a loop of twice ``half`` [N], its ways ``written`` or not.

    ``zero`` of the gauge [N]; ``stated`` noise of displacements over the true one.
    """
    noise = np.random.default_rng(0)
    forces = [[voltage, 1e3 * at, 1e3 * (solve_deflection(FILM, at, 1e3 * voltage).force
                                         + way * half + zero + FORCE * noise.standard_normal()),
               "out" if way > 0 else "back"] for voltage in (0.0, 3.0) for at, way in WAYS]
    heaves = [[mass, voltage, 1e3 * (solve_load(FILM, 9.81e-3 * mass, 1e3 * voltage).deflection
                                     + LENGTH * noise.standard_normal())]
              for mass in (10.0, 20.0) for voltage in (0.0, 1.0, 2.0, 2.5, 3.0, 3.5, 4.0)]
    if shuffled:
        forces = [forces[k] for k in noise.permutation(len(forces))]
    film = specimen_to_toml(circular()).replace("\n[", "\n[specimen.")
    write_dataset(folder, HEAD + "[[specimen]]\n" + film, ())
    _csv(folder / "force.csv", "voltage_kV,displacement_mm,force_mN,direction,sigma_mN", [
        [*row[:3], row[3] if written else "", 1e3 * FORCE] for row in forces])
    _csv(folder / "static.csv", "mass_g,voltage_kV,displacement_mm,sigma_um", [
        [*row, 1e6 * LENGTH * stated] for row in heaves])
    with library_of("gauge_zero", "strain_stiffening"):
        return diagnose(read_dataset(folder))


def _csv(file: Path, head: str, rows: Sequence[Sequence[float | str]]) -> None:
    name = circular().name
    file.write_text("\n".join([f"specimen,{head}", *(
        ",".join(map(str, [name, *row])) for row in rows)]) + "\n")


@pytest.mark.study(seconds=3, only=("True",))
@pytest.mark.parametrize("written", [True, False])
def test_a_loop_is_no_noise(written: bool, tmp_path: Path) -> None:
    """Of 12 mN, σ 0.5 mN: told as one, though the ways are not written; σ of lengths stays."""
    result = judged(tmp_path, 6e-3, written)
    assert result.verdict == "unexplained"
    assert "forces differ on the way out and back by about 12 mN" in result.headline
    force, = result.misfit.others
    assert (force.kind, force.unit, force.readings) == ("force", "mN", 90)
    assert force.baseline_rmse == pytest.approx(6.0, rel=0.05)
    assert result.misfit.noise == pytest.approx(1e6 * LENGTH, rel=0.3)


def test_without_a_loop_the_same_readings_agree(tmp_path: Path) -> None:
    result = judged(tmp_path, 0.0)
    assert (result.verdict, result.cannot_tell) == ("nothing", "")


def test_scatter_far_beyond_the_stated_noise_is_no_agreement(tmp_path: Path) -> None:
    """Rows in no order, without their ways: the loop is scatter of twelve times the noise."""
    result = judged(tmp_path, 6e-3, written=False, shuffled=True)
    assert result.headline == (
        "Cannot tell whether the simulation agrees, because the readings of force scatter "
        f"{result.cannot_tell.split('scatter ')[1]}.")
    times = float(result.cannot_tell.split("scatter ")[1].split()[0])
    assert times == pytest.approx(6e-3 / FORCE, rel=0.2)
    assert result.misfit.noise == pytest.approx(1e6 * LENGTH, rel=0.3)
    assert result.next_experiment is not None
    assert "direction of each reading" in result.next_experiment.what


@pytest.mark.parametrize("stated", [0.1, 0.2])
def test_lengths_have_a_noise_of_their_own_beside_many_forces(stated: float, tmp_path: Path
                                                              ) -> None:
    """Stated too small, it is told as that: forces do not hide it, and no cause is made of it."""
    result = judged(tmp_path, 0.0, stated=stated)
    assert result.verdict == "nothing"
    assert "the readings of displacement scatter" in result.cannot_tell
    times = float(result.cannot_tell.split("scatter ")[1].split()[0])
    assert times == pytest.approx(1 / stated, rel=0.2)
    assert result.misfit.noise == pytest.approx(1e6 * LENGTH, rel=0.3)


def test_a_noise_that_is_stated_too_large_hides_errors_and_is_told(tmp_path: Path) -> None:
    result = judged(tmp_path, 0.0, stated=5.0)
    assert (result.verdict, result.cannot_tell) == ("nothing", "")
    (told,) = [words for words in result.warnings if "times less" in words]
    assert told.startswith("the readings of displacement scatter")
    assert float(told.split("scatter ")[1].split()[0]) == pytest.approx(5.0, rel=0.2)


def test_forces_have_curves_residuals_and_a_gain(tmp_path: Path) -> None:
    """A gauge that shows 20 mN too much: its curve is in the tables, on the page, and gained on."""
    result = judged(tmp_path / "data", 0.0, zero=20e-3)
    assert [str(cause.effect) for cause in result.causes if cause.named] == ["gauge_zero"]
    assert result.gain is not None
    (gain,) = result.gain.others
    assert (gain.kind, gain.unit) == ("force", "mN")
    # Forces under 3 kV, held out with all voltages above 2.5 kV: the permittivity is extrapolated.
    assert gain.noise == pytest.approx(1e3 * FORCE, rel=0.3)
    assert gain.noise < gain.rmse_after < 4 * gain.noise
    assert gain.rmse_before > 5 * gain.rmse_after
    assert f"{gain.rmse_after:.3g} mN where the" in gain_words(result)
    curve = result.tables[CHANNELS]
    there = (curve["kind"] == "force") & (curve["voltage"] == 3e3) & (curve["direction"] > 0)
    expected = [1e3 * (solve_deflection(FILM, at, 3e3).force + 20e-3)
                for at in curve["displacement"][there]]
    assert curve["extended"][there] == pytest.approx(expected, abs=2.0)
    result.save(tmp_path / "result")
    again = Diagnosis.load(tmp_path / "result")
    assert again.tables[CHANNELS]["high"] == pytest.approx(curve["high"])
    (page,) = build_diagnosis_page(again, tmp_path / "result")
    assert {"forces.svg", "force_residuals.svg"} <= {
        file.name for file in (tmp_path / "result").iterdir()}
    assert "Force–displacement curves" in page.read_text(encoding="utf-8")
