"""Forces on plates that a tester holds, by the axisymmetric membrane, beside readings at rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.oracles.axisymmetric import solve_deflection, solve_load
from tests.support.costs import dear
from tests.support.datasets import HEAD, write_dataset
from tests.support.specimens import circular, reference_film
from tympan.base.errors import InputError
from tympan.fem.toml_writer import specimen_to_toml
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated, with_effects
from tympan.studies.diagnosis.diagnose import diagnose, plan_readings
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.film_fit import fit_film
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.simulation import Simulation

FILM = reference_film(circular().membrane.material)
HEAVES = np.arange(1, 7) * 1e-3
VOLTAGES = (0.0, 3e3)


#: A tester's run, from one side of the flat film to the other, at three voltages.
RUN, CHARGED = np.linspace(-1.5e-3, 7e-3, 18), (0.0, 3e3, 5.5e3)


def written(folder: Path, seed: int | None = None, deflections: np.ndarray = HEAVES,
            voltages: tuple[float, ...] = VOLTAGES) -> Path:
    """Deflections to 20 µm and forces to 2 mN of the specimen as it is stated."""
    random = np.random.default_rng(seed)
    scatter = 0.0 if seed is None else 1.0
    static = "specimen,mass_g,voltage_kV,displacement_mm\n"
    for mass in (17.9, 22.45):
        for kilovolts in (0, 1, 2, 3, 4, 5):
            read = solve_load(FILM, 9.80665e-3 * mass, 1e3 * kilovolts).deflection
            read += 20e-6 * scatter * random.standard_normal()
            static += f"circle,{mass},{kilovolts},{1e3 * read:.5f}\n"
    force = "specimen,voltage_kV,displacement_mm,force_mN,run,direction,sigma_mN\n"
    for voltage in voltages:
        for deflection in deflections.tolist():
            read = solve_deflection(FILM, deflection, voltage).force
            read += 2e-3 * scatter * random.standard_normal()
            force += f"circle,{voltage / 1e3},{1e3 * deflection},{1e3 * read:.5f},1,out,2\n"
    folder = write_dataset(folder, 'noise = "20 um"\n' + HEAD, (), static=static, force=force)
    (folder / "circle.toml").write_text(specimen_to_toml(circular()), encoding="utf-8")
    with (folder / "dataset.toml").open("a", encoding="utf-8") as about:
        about.write('[[specimen]]\nfile = "circle.toml"\n')
    return folder


def test_forces_are_those_of_the_membrane(tmp_path: Path) -> None:
    """Within 1e-4 of the largest, at deflections beyond all that hang; a spring adds k times them.
    """
    readings = prepared_readings(read_dataset(written(tmp_path / "d")))
    nominal = calibrated(readings.setup, readings.table)
    rows = nominal.table.rows_of["force"]
    assert len(rows) == len(HEAVES) * len(VOLTAGES)
    deflection = nominal.table.states.deflection[nominal.table.state[rows]]
    assert deflection == pytest.approx(np.tile(HEAVES, len(VOLTAGES)))
    exact = nominal.table.value[rows]
    shown = nominal.simulation.predict((), np.zeros(2), nominal.table)[rows]
    assert shown == pytest.approx(exact, abs=1e-4 * exact.max())
    spring = (Cause("parallel_spring"),)
    stiffer = nominal.simulation.predict(spring, np.array([0.0, 0.0, 4.0]), nominal.table)[rows]
    assert stiffer - shown == pytest.approx(4.0 * deflection)


def test_noise_is_stated_or_a_share(tmp_path: Path) -> None:
    folder = written(tmp_path / "d")
    table = prepared_readings(read_dataset(folder)).table
    assert table.sigma[table.kind == "force"] == pytest.approx(2e-3)
    file = folder / "force.csv"
    file.write_text(file.read_text(encoding="utf-8").replace(",1,out,2\n", ",1,out,\n"),
                    encoding="utf-8")
    table = prepared_readings(read_dataset(folder)).table
    force = table.kind == "force"
    assert table.sigma[force] == pytest.approx(0.01 * table.value[force].max())


def test_nothing_hidden_is_nothing_found(tmp_path: Path) -> None:
    found = diagnose(read_dataset(written(tmp_path / "d", seed=1)))
    assert found.verdict == "nothing"
    assert (found.tables["readings.csv"]["kind"] == "force").sum() == len(HEAVES) * len(VOLTAGES)
    assert found.gain is None or "0 g" not in " ".join(found.gain.impossible)


def test_forces_alone_are_for_a_fit(tmp_path: Path) -> None:
    """Errors of a diagnosis are lengths, of which there are none."""
    folder = written(tmp_path / "d", 2, RUN, CHARGED)
    (folder / "static.csv").unlink()
    for judge_it in (diagnose, plan_readings):
        with pytest.raises(InputError, match="material fit takes forces alone"):
            judge_it(read_dataset(folder))
    assert fit_film(read_dataset(folder)).readings == len(RUN) * len(CHARGED)


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> tuple[PreparedReadings, Simulation]:
    """Readings of the film as it is stated, and films with every effect."""
    folder = written(tmp_path_factory.mktemp("held") / "d", 4, RUN, CHARGED)
    readings = prepared_readings(read_dataset(folder))
    nominal = calibrated(readings.setup, readings.table)
    simulation = with_effects(nominal.simulation, lambda done, count: None, 1)
    return replace(readings, table=nominal.table), simulation


def by_tester(gauge_zero: float = 0.0, gauge_gain: float = 0.0, displacement_zero: float = 0.0,
              tester_compliance: float = 0.0) -> np.ndarray:
    """Forces that a tester shows of the membrane, at its own displacements, (rows,) [N].

    The plate is where tester and film are in balance: a root of one equation.
    """
    shown = []
    for voltage in CHARGED:
        for read in RUN.tolist():
            def off(plate: float, read: float = read, voltage: float = voltage) -> float:
                force = solve_deflection(FILM, plate, voltage).force
                return plate + tester_compliance * force + displacement_zero - read

            plate = brentq(off, read - 2e-3, read + 2e-3, xtol=1e-10)
            shown.append((1 + gauge_gain) * solve_deflection(FILM, plate, voltage).force
                         + gauge_zero)
    return np.array(shown)


@pytest.mark.parametrize(("effect", "size", "others"), [
    ("gauge_zero", 20e-3, ()), dear("displacement_zero", -0.3e-3, (), seconds=8),
    dear("gauge_gain", 0.05, ("sensor_gain",), seconds=8),
    dear("tester_compliance", 4e-4, ("sensor_zero",), seconds=8)])
def test_errors_of_a_tester_are_found(prepared: tuple[PreparedReadings, Simulation], effect: str,
                                      size: float, others: tuple[str, ...]) -> None:
    """By readings that the equations make, with their noise; predicted within 1e-4 of the largest.

    A gauge's gain cannot be told from the sensor's, for the film's stiffness is fitted; that is
    said, and none of them is named.
    """
    readings, simulation = prepared
    table, rows = readings.table, readings.table.rows_of["force"]
    scatter = table.value[rows] - by_tester()
    shown = by_tester(**{effect: size})
    predicted = simulation.predict((Cause(effect),), np.array([0.0, 0.0, size]), table)[rows]
    assert predicted == pytest.approx(shown, abs=1e-4 * shown.max())
    values = table.value.copy()
    values[rows] = shown + scatter
    judged = judge(simulation, table.with_values(values), readings.causes)
    assert [str(cause) for cause in judged.named] == ([] if others else [effect])
    assert {effect, *others} <= {str(cause) for cause in judged.weighed.suspects}
    assert judged.posterior is not None
    fitted = judged.posterior.fit_of((Cause(effect),))
    assert fitted is judged.posterior.fits[0]
    assert abs(fitted.unknowns[2] - size) < 3 * fitted.deviations[2]
