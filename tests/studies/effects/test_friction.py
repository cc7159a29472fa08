"""The plate rubs: it stays where it is until more than the friction is missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from benchmarks.trials.synthetic_trials import Truth, design_of, readings
from tests.oracles.axisymmetric import Film, Ogden, solve_deflection
from tests.support.datasets import HEAD, write_dataset
from tests.support.trials import design, every_cause, read
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import (
    classes_of,
    distance,
    signatures,
)
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.readings import averaged, prepared_readings
from tympan.studies.diagnosis.reduced.films_at_rest import play
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.simulation import Simulation

SIGMA = 20e-6
MASS, GRAVITY = 17.9e-3, 9.80665
RUBS = Cause("friction")
LIGHTER = Cause("unaccounted_mass")
#: Up, down, up a little, at rest, down.
WANDER = 1e3 * np.array([0, 2, 4, 5.5, 6.5, 6, 5, 3, 1, 0, 1, 3, 3, 5, 4.8, 0])
LOOP = np.concatenate([np.linspace(0, 6.5e3, 8), np.linspace(6.5e3, 0, 8)[1:]])


def table_of(voltages: np.ndarray, specimens: int = 1, masses: tuple[float, ...] = (MASS,)
             ) -> ReadingTable:
    """One run after the other, in their order."""
    number, mass, voltage = (axis.ravel() for axis in np.meshgrid(
        range(specimens), masses, voltages, indexing="ij"))
    states = States.of(number.astype(np.int64), mass, voltage)
    return replace(rows(states, "displacement", SIGMA), order=np.arange(float(len(states))))


def unknowns(*sizes: float) -> np.ndarray:
    return np.array([0.0, 0.0, *sizes])


@pytest.mark.parametrize("friction", [2e-3, 10e-3])
def test_it_sticks_and_slips_as_a_plate_moved_by_the_missing_force(
        three_shapes: Simulation, friction: float) -> None:
    """The membrane's equations with the plate held; it is moved only by what friction leaves."""
    specimen = three_shapes.setup.specimens[0]
    law = specimen.membrane.material
    film = Film(10e-3, 45e-3, specimen.membrane.thickness, specimen.membrane.prestretch[0],
                Ogden(tuple(np.ravel(law.mu)), tuple(np.ravel(law.alpha))),
                specimen.membrane.relative_permittivity)
    deflection, deflections = 0.0, []
    for voltage in WANDER.tolist():
        def missing(at: float, voltage: float = voltage) -> float:
            return MASS * GRAVITY - (solve_deflection(film, at, voltage).force if at else 0.0)

        if missing(deflection) > friction:
            deflection = brentq(lambda at: missing(at) - friction, deflection, 6e-3, xtol=1e-9)
        elif missing(deflection) < -friction:
            deflection = brentq(lambda at: missing(at) + friction, 1e-4, deflection, xtol=1e-9)
        deflections.append(deflection)
    table = table_of(WANDER)
    assert Prediction(three_shapes, (RUBS,), unknowns(friction), table).deflection == pytest.approx(
        deflections, abs=5e-7)


def test_films_under_loads_rub_the_same(three_shapes: Simulation) -> None:
    """Finite elements, ramps of other meshes, on an ellipse."""
    setup = replace(three_shapes.setup, specimens=three_shapes.setup.specimens[2:])
    lone = replace(three_shapes, setup=setup, laws=three_shapes.laws[2:])
    table = table_of(WANDER[::2])
    truth = Truth(1.0, 1.0, (RUBS,), (6e-3,))
    by_loads = readings(design_of("one", setup, table.states), truth)
    assert by_loads is not None
    assert lone.predict((RUBS,), unknowns(6e-3), table) == pytest.approx(by_loads, abs=5e-7)


@pytest.mark.parametrize("friction", [0.0, 1e-3, 20e-3])
@pytest.mark.parametrize("others", [(), (Cause("parallel_spring"),)])
def test_derivatives_are_those_of_differences(three_shapes: Simulation, friction: float,
                                              others: tuple[Cause, ...]) -> None:
    """Also where a plate stands at the deflection of the state before; without friction, above."""
    table, hypothesis = table_of(WANDER, 2), (RUBS, *others)
    centre = np.array([0.05, -0.03, friction, *(4.0 for _ in others)])
    jacobian = Prediction(three_shapes, hypothesis, centre, table).jacobian

    def at(number: int, step: float) -> np.ndarray:
        moved = centre.copy()
        moved[number] += step
        return three_shapes.predict(hypothesis, moved, table)

    for number, step in enumerate([1e-4, 1e-4, 1e-7, 1e-3][: len(centre)]):
        if number == 2 and friction == 0:
            slope = (4 * at(2, step) - 3 * at(2, 0.0) - at(2, 2 * step)) / (2 * step)
        else:
            slope = (at(number, step) - at(number, -step)) / (2 * step)
        assert np.abs(jacobian[:, number] - slope).max() < 1e-4 * np.abs(slope).max()


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=12), st.floats(0, 0.5),
       st.sampled_from([1.0, -1.0]))
def test_play_is_a_clip_from_state_to_state(middle: list[float], half: float, begun: float) -> None:
    centre = np.array(middle)
    place, way = play(centre - half, centre + half, [np.arange(len(centre))],
                      np.full(len(centre), begun))
    deflection = (centre - way * half)[place]
    before = centre[0] - begun * half
    for at, rests in zip(centre.tolist(), deflection.tolist(), strict=True):
        before = min(max(before, at - half), at + half)
        assert rests == pytest.approx(before, abs=1e-9)


def test_a_ramp_up_is_a_mass_left_out_of_account_and_a_loop_is_not(
        three_shapes: Simulation) -> None:
    """The readings of both are the same on a way up, so they are named together."""
    masses = (17.9e-3, 22.45e-3)
    up, loop = table_of(LOOP[:8], 3, masses), table_of(LOOP, 3, masses)
    lighter = unknowns(-5e-3 / GRAVITY)
    assert three_shapes.predict((RUBS,), unknowns(5e-3), up) == pytest.approx(
        three_shapes.predict((LIGHTER,), lighter, up), abs=1e-9)
    causes = every_cause(three_shapes)
    group, = (group for group in classes_of(signatures(three_shapes, up, np.zeros(2), causes))[1]
              if RUBS in group)
    assert LIGHTER in group
    signs = signatures(three_shapes, loop, np.zeros(2), [*causes, Cause("hysteresis")])
    for other in signs:
        assert other == RUBS or distance(signs[RUBS], signs[other]) > 25, other


def test_it_is_named_on_a_loop(three_shapes: Simulation) -> None:
    table = read(three_shapes, table_of(LOOP, 3, (17.9e-3, 22.45e-3)), (RUBS,), [8e-3], seed=3)
    judged = judge(three_shapes, table, every_cause(three_shapes))
    assert judged.named == (RUBS,)
    assert judged.chosen is not None
    assert judged.chosen.unknowns[2] == pytest.approx(8e-3, rel=0.1)


def test_an_order_is_taken_from_its_column(tmp_path: Path, three_shapes: Simulation) -> None:
    """Rows of a file may stand in any order, and runs begin anew; states held out keep their
    place."""
    voltages = WANDER[:10]
    lines = [f"{name},17.9,{volts / 1e3},{2 + place / 50},{place},{run}"
             for run, name in enumerate("AB") for place, volts in enumerate(voltages.tolist())]
    tables = []
    for name, turn in (("sorted", np.arange(20)), ("mixed",
                                                   np.random.default_rng(1).permutation(20))):
        static = "\n".join(["specimen,mass_g,voltage_kV,displacement_mm,order,run",
                            *(lines[k] for k in turn)])
        folder = write_dataset(tmp_path / name, HEAD + 'noise = "20 um"\n', static=static)
        prepared = prepared_readings(read_dataset(folder))
        assert RUBS in prepared.causes
        tables.append(prepared.table[np.argsort(turn)])
    first, second = (three_shapes.predict((RUBS,), unknowns(10e-3), table) for table in tables)
    assert np.array_equal(first, second)
    assert np.ptp(first[:10][voltages == 1e3]) == 0
    assert abs(first[1] - first[7]) > 50e-6
    kept = np.isin(np.arange(20), (3, 7, 12, 18))
    held_out = three_shapes.predict((RUBS,), unknowns(10e-3), tables[1][kept].compact())
    assert np.array_equal(held_out, second[kept])
    assert np.array_equal(averaged(tables[0]).states.way, tables[0].states.way)


def test_a_range_is_read_on_the_way_up(three_shapes: Simulation) -> None:
    states = States.of([0, 0], [MASS, MASS], [0.0, 6e3])
    both = three_shapes.predict((RUBS,), unknowns(5e-3), rows(states, "displacement", SIGMA))
    span = replace(rows(states[np.array([1])], "range", SIGMA), states=states,
                   state=np.array([1]), since=np.array([0]))
    shown = three_shapes.predict((RUBS,), unknowns(5e-3), span)
    lighter = three_shapes.predict((LIGHTER,), unknowns(-5e-3 / GRAVITY), span)
    assert shown == pytest.approx(both[1:] - both[:1], abs=1e-12)
    assert shown == pytest.approx(lighter, abs=1e-9)
    assert design(SIGMA).states.way.min() == 1
