"""Experiments beyond the force laws: what is foreseen is what films show, and it decides."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.strata import lines as film_lines
from benchmarks.trials.strata import steps
from benchmarks.trials.strata.evidence import by_elements, cross, write_dataset
from benchmarks.trials.synthetic_trials import FINEST, Truth
from tests.support.trials import design, read
from tympan.geometry.outlines import Circle, Stadium
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.data.dataset import read_dataset
from tympan.studies.data.effort import Effort
from tympan.studies.diagnosis.calibration import calibrated
from tympan.studies.diagnosis.diagnose import diagnose
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.next_experiment.experiments import MENU, Readout
from tympan.studies.diagnosis.next_experiment.solved_experiments import (
    SOLVED,
    SolvedExperiment,
    film_line,
    larger_plate,
    longer,
    other_shape,
    strips,
)
from tympan.studies.diagnosis.reading_table import States, rows
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.simulation import Simulation

SIGMA = 10e-6
DWELL = MENU[-1]


def readout_of(simulation: Simulation, hypothesis: tuple[Cause, ...], sizes: list[float]
               ) -> tuple[Readout, Fit]:
    """Readings with effects in them, and the fit of these."""
    table = read(simulation, design(SIGMA, voltages=4), hypothesis, sizes, seed=1)
    nominal = fit(simulation, (), table)
    return (Readout(simulation, table, nominal),
            fit(simulation, hypothesis, table, nominal.unknowns))


def test_a_shape_that_is_known_reads_what_its_force_law_says(three_shapes: Simulation) -> None:
    """Values within 2 µm of millimetres, and derivatives by all unknowns within a fiftieth."""
    readout, fitted = readout_of(three_shapes, (Cause("parallel_spring"),), [6.0])

    def same(specimen: Specimen) -> Specimen:
        return replace(specimen, name="another shape")

    experiment = SolvedExperiment("", lambda readout: other_shape(readout, same), "make")
    outlook = experiment.outlook(readout, [fitted], Effort(make=7200.0))
    assert outlook is not None
    number = int(readout.states.specimen[np.lexsort((readout.states.voltage,
                                                     readout.states.mass))[-1]])
    voltage = np.unique(readout.states.voltage)[[0, 2, 3]]
    table = rows(States.of([number] * 3, np.full(3, 22.45e-3), voltage), "displacement", SIGMA)
    law = three_shapes.prediction(fitted.hypothesis, fitted.unknowns, table)
    assert outlook.values[0] == pytest.approx(law.values, abs=2e-6)
    assert outlook.jacobians[0] == pytest.approx(law.jacobian, rel=0.02, abs=1e-6)
    assert outlook.noise.sigma == pytest.approx(SIGMA)
    assert outlook.work == 7200 + 300 + 120 + 3 * 20


def test_strips_are_those_of_the_law(three_shapes: Simulation) -> None:
    """Uniaxial and equibiaxial stress by the film's energy, 5 % stiffer than stated."""
    readout, fitted = readout_of(three_shapes, (Cause("unaccounted_mass"),), [1e-3])
    outlook = SolvedExperiment("{stretch}", strips, "coupons").outlook(readout, [fitted], Effort())
    assert outlook is not None
    film = three_shapes.setup.specimens[0].membrane
    top = 1.2 * max(film.prestretch)
    along = np.linspace(1, top, 4)[1:]
    slopes = [film.material.derivatives(along, across)[1] for across in (along**-0.5, along)]
    assert outlook.values[0] == pytest.approx(
        np.exp(fitted.unknowns[0]) * np.real(np.concatenate(slopes)), rel=1e-9)
    assert outlook.jacobians[0][:, 0] == pytest.approx(outlook.values[0], rel=0.02)
    assert not outlook.jacobians[0][:, 1:].any(), "no strip knows of voltage and mass"
    assert outlook.what == f"{top:.2g}"


def test_other_shapes_are_built_where_they_can_be(three_shapes: Simulation) -> None:
    specimen = three_shapes.setup.specimens[0]
    long, wide = longer(specimen), larger_plate(specimen)
    assert long is not None
    assert wide is not None
    assert long.frame.semi_axes == pytest.approx(np.multiply(specimen.frame.semi_axes, (1.5, 1)))
    assert wide.needed_plate().outline.semi_axes == pytest.approx(
        np.multiply(specimen.needed_plate().outline.semi_axes, 1.6))
    full = replace(specimen, plate=Plate(Circle(0.9 * min(specimen.frame.semi_axes))))
    assert larger_plate(full) is None, "no plate is larger than its frame"
    assert longer(replace(specimen, frame=Stadium((45e-3, 30e-3)))) is None


def test_a_line_is_what_finer_films_show() -> None:
    """Of a film of another mesh and order, within 3 µm, its zero taken off."""
    plan = film_lines.plan_of(["long"])
    truth = Truth(1.05, 0.97, (Cause("prestretch_anisotropy"),), (0.04,), mesh=FINEST)
    exact = by_elements(plan, truth)
    assert exact is not None
    table = plan.design.table.with_values(exact.deflections).with_sigma(
        np.full(len(exact.deflections), 5e-6))
    nominal = calibrated(plan.design.setup, table)
    readout = Readout(nominal.simulation, nominal.table, nominal.fit)
    new = film_line(readout)
    assert new is not None
    unknowns = np.array([np.log(1.05), np.log(0.97), 0.04])
    shown = new.shown(replace(nominal.simulation, setup=new.setup).extended(
        truth.hypothesis, unknowns)).reshape(2, 2, -1)
    half = np.array([60e-3, 45e-3])
    for ramp, row in enumerate(plan.scanned[[0, -1]].tolist()):
        read_at = np.linspace(-0.97, 0.97, 46)
        lines = exact.heights[row].reshape(2, -1)
        for axis in range(2):
            seen = np.interp(np.linspace(-0.97, 0.97, 41) * half[axis], read_at * half[axis],
                             lines[axis])
            # Between places of a line that is bent; its zero is anybody's.
            away = shown[ramp, axis] - seen
            assert np.median(np.abs(away - np.median(away))) < 3e-6


@pytest.mark.study(seconds=23)
def test_a_longer_dwell_is_what_films_that_creep_do(tmp_path: Path) -> None:
    """By the axisymmetric membrane in time, within 4 µm where ten times the dwell moves 60."""
    plan = steps.slow()
    assert plan.dwell is not None
    cause, sizes = Cause("creep"), (300e3, 150.0)
    truth = Truth(1.0, 1.0, (cause,), tuple(
        item.size(value) for item, value in zip(cause.effect.parameters, sizes, strict=True)),
        "equations")
    short, long = (steps.step_evidence(replace(plan, dwell=dwell), truth)
                   for dwell in (plan.dwell, 10 * plan.dwell))
    assert short is not None
    assert long is not None
    files = steps.step_sheets(plan, short, SIGMA, np.random.default_rng(0))
    files.pop("transient.csv")
    data = write_dataset(tmp_path / "d", plan.design, files, SIGMA)
    readings = prepared_readings(read_dataset(data))
    nominal = calibrated(readings.setup, readings.table)
    readout = Readout(nominal.simulation, nominal.table, nominal.fit)
    possible = DWELL.possible(readout, [])
    assert possible is not None
    there, table = possible
    shown = there.simulation.predict((cause,), np.array([0.0, 0.0, *truth.sizes]), table)
    states = plan.design.table.states
    same = (states.specimen == table.specimen[0]) & (states.mass == table.mass[0])
    assert shown == pytest.approx(long.deflections[same], abs=4e-6)
    assert np.abs(long.deflections[same] - short.deflections[same]).max() > 60e-6
    assert "hold every voltage for 300 s" in DWELL.words(table, readings.setup)
    assert DWELL.work(there, table, Effort(waiting=0.5)) == pytest.approx(
        len(table) * 20 + 120 + 300 + 0.5 * len(table) * 300, rel=1e-3)


@pytest.mark.study
def test_what_is_recommended_decides(tmp_path: Path) -> None:
    """By deflections alone a film stretched unequally may be a plate off its centre; the line that
    is proposed names it."""
    hidden = [("prestretch_anisotropy", (0.04,), None)]
    first, second = (film_lines.write(tmp_path / name, hidden, 1, noise=5e-6, places=places)
                     for name, places in (("heaves", None), ("line", cross)))
    before = diagnose(read_dataset(first)).json()
    assert before["verdict"] == "ambiguous"
    step = before["next_experiment"]
    assert "read a laser line" in step["what"]
    menu = [item["what"] for item in step["menu"]]
    assert {part for part in ("laser line", "one more specimen", "strips")
            if any(part in what for what in menu)} == {"laser line", "one more specimen", "strips"}
    after = diagnose(read_dataset(second)).json()
    assert after["verdict"] == "named"
    assert after["causes"][0]["effect"] == "prestretch_anisotropy"


def test_all_of_the_menu_has_its_words_and_its_cost() -> None:
    named = {item.sets_up for item in (*MENU, *SOLVED)} - {""}
    assert named <= set(Effort.__dataclass_fields__)
    assert len({item.what for item in SOLVED}) == len(SOLVED)
