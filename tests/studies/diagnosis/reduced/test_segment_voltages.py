"""Force laws over the voltages of several segments, against polynomials and finite elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.trials.hidden_segments import QUARTERS
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.rig import Rig
from tympan.studies.case import build_model
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.axes import HeldFilm
from tympan.studies.diagnosis.reduced.force_law import Grid
from tympan.studies.diagnosis.reduced.sampling import COARSE, nominal_law
from tympan.studies.diagnosis.reduced.segment_voltages import SegmentVoltages
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup

SETUP = Setup((QUARTERS,), Rig())
MASS = 15e-3


@pytest.mark.parametrize("segments", [2, 3, 4, 6])
def test_nodes_determine_every_polynomial_of_the_degree(segments: int) -> None:
    """And the few among them every one of the low degree."""
    several, random = SegmentVoltages(segments), np.random.default_rng(segments)
    places = random.random((20, segments))
    weights = random.standard_normal(segments)

    def wanted(at: np.ndarray, degree: int) -> np.ndarray:
        return np.asarray((at @ weights - 0.3) ** degree)

    for nodes, degree in ((several.nodes, several.degree), (several.nodes[several.few], 2)):
        terms = slice(0, len(nodes))
        found = np.linalg.solve(several.terms(nodes)[:, terms], wanted(nodes, degree))
        assert several.terms(places)[:, terms] @ found == pytest.approx(
            wanted(places, degree), abs=1e-9)
    assert several.nodes.min() >= 0
    assert several.nodes.max() <= 1


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """The law of the film without effects, to 2.5 mm and 4 kV on any segments."""
    return Simulation(SETUP, (nominal_law(SETUP, QUARTERS.name, 2.2e-3, 3.7e3**2),))


def table_of(shares: list[list[float]], voltage: float) -> ReadingTable:
    """Deflection and slopes under one mass, with shares of a voltage on the segments."""
    states = States.of([0] * len(shares), np.full(len(shares), MASS),
                       np.full(len(shares), voltage), shares=np.array(shares))
    kinds = ("displacement", "tilt_x", "tilt_y")
    first, *others = (rows(states, kind, 1e-5) for kind in kinds)
    for other in others:
        first = first.joined(other)
    return first


def solved(shares: list[float], voltage: float) -> np.ndarray:
    """Deflection and slopes by finite elements on the mesh of the laws."""
    electrode, top = QUARTERS.electrode.driven(dict(zip("ABCD", np.multiply(shares, voltage),
                                                        strict=True)))
    model = build_model(replace(QUARTERS, electrode=electrode), COARSE)
    outcome = equilibrium(model, MASS * 9.80665, top)
    assert outcome.status == "equilibrium"
    plate = outcome.state.plate
    return np.array([plate.deflection, *plate.slope])


def test_a_law_has_the_deflection_and_the_slopes_of_finite_elements(simulation: Simulation
                                                                    ) -> None:
    """Under drawn voltages; and leads that are off or exchanged permute voltages exactly."""
    shares = [[1.0, 0.0, 0.0, 0.0], [0.3, 1.0, 0.7, 0.0], [1.0, 0.8, 0.9, 0.6]]
    table = table_of(shares, 3.6e3)
    shown = simulation.predict((), np.zeros(2), table).reshape(3, 3).T
    for found, each in zip(shown, shares, strict=True):
        exact = solved(each, 3.6e3)
        assert found[0] == pytest.approx(exact[0], abs=1.5e-6)
        assert found[1:] == pytest.approx(exact[1:], abs=2e-5)
    # A quarter turns the plate towards itself: its side is deflected further.
    assert shown[0, 1:].min() > 5e-4
    for cause, moved in ((Cause("segments_exchanged", "A and D of quarters"), [3, 1, 2, 0]),
                         (Cause("segment_open", "B of quarters"), None)):
        other = np.array(shares)
        other = other[:, moved] if moved else other * [1, 0, 1, 1]
        assert simulation.predict((cause,), np.array([0.0, 0.0, 1.0]), table) == pytest.approx(
            simulation.predict((), np.zeros(2), table_of(other.tolist(), 3.6e3)), rel=1e-12)


def test_the_capacitance_of_a_segment_is_read_at_its_lead(simulation: Simulation) -> None:
    """Exchanged leads exchange capacitances; the film without one that is off has a quarter less.
    """
    states = States.of([0], np.array([MASS]), np.array([0.0]), shares=np.ones((1, 4)))
    one, every = rows(states, "capacitance_1", 1e-13), rows(states, "capacitance", 1e-13)

    def read(table: ReadingTable, *causes: Cause) -> float:
        return float(simulation.predict(causes, np.array([0.0, 0.0] + [1.0] * len(causes)),
                                        table)[0])

    assert read(one) == pytest.approx(read(every) / 4, rel=1e-3)
    assert read(one, Cause("segment_open", "A of quarters")) == 0
    assert read(every, Cause("segment_open", "A of quarters")) == pytest.approx(
        0.75 * read(every), rel=1e-3)
    assert read(one, Cause("segments_exchanged", "A and B of quarters")) == pytest.approx(
        read(one), rel=1e-3)


def test_a_film_with_segments_is_meshed_whole() -> None:
    """Any voltages may break its symmetry, even where all are equal as stated."""
    assert QUARTERS.mirror_planes == {"x", "y"}
    film = HeldFilm.of(SETUP, QUARTERS.name)
    assert not film.specimen.mirror_planes
    assert Grid(1e-3, 1e6, True, segments=film.segments).nodes[1].shape[1] == 4
