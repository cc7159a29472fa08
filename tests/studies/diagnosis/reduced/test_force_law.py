"""Force laws against the axisymmetric equations and finite elements; their derivatives; exact
scalings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.rig import Rig
from tympan.studies.case import Case, solve
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reading_table import States, rows
from tympan.studies.diagnosis.reduced.films_at_rest import resting_place
from tympan.studies.diagnosis.reduced.force_law import _cardinal, _floater_hormann
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.sampling import FINE
from tympan.studies.diagnosis.reduced.simulation import Simulation

MASSES, VOLTAGES = (0.0179, 0.02245), (0.0, 3.5e3, 5e3, 6.5e3)


def _table(specimen: int = 0):
    mass, voltage = (grid.ravel() for grid in np.meshgrid(MASSES, VOLTAGES, indexing="ij"))
    return rows(States.of(np.full(len(mass), specimen), mass, voltage), "displacement", 1e-5)


def _by_equations(film: axisymmetric.Film, table, gravity: float) -> np.ndarray:
    return np.array([axisymmetric.solve_load(film, mass * gravity, voltage).deflection
                     for mass, voltage in zip(table.mass, table.voltage, strict=True)])


@pytest.mark.parametrize(("cause", "size", "changed"), [
    (None, 0.0, {}),
    ("permittivity_stretch", 0.2, {"permittivity_exponent": 0.2}),
    ("permittivity_stretch", -0.3, {"permittivity_exponent": -0.3}),
    ("prestretch_loss", 0.035, {"prestretch": 5**0.5 * (1 - 0.035)}),
])
def test_it_gives_the_deflections_of_the_axisymmetric_equations(three_shapes: Simulation, cause,
                                                                size, changed) -> None:
    """Equations that share nothing with the finite elements.

    Stiffness and permittivity are others than the laws were made with, which cost the laws nothing.
    """
    film = three_shapes.setup.specimens[0].membrane
    stiffness, permittivity = 1.12, 0.94
    material = axisymmetric.Ogden(tuple(stiffness * mu for mu in film.material.mu),
                                  tuple(film.material.alpha))
    values = {"inner": 10e-3, "outer": 45e-3, "thickness": film.thickness,
              "prestretch": film.prestretch[0],
              "material": material,
              "relative_permittivity": permittivity * film.relative_permittivity} | changed
    hypothesis = () if cause is None else (Cause(cause, "circular" if cause == "prestretch_loss"
                                                 else None),)
    unknowns = np.array([np.log(stiffness), np.log(permittivity), *([size] if cause else [])])
    table = _table()
    predicted = three_shapes.predict(hypothesis, unknowns, table)
    exact = _by_equations(axisymmetric.Film(**values), table, three_shapes.setup.rig.gravity)
    assert predicted == pytest.approx(exact, rel=4e-4)
    assert np.ptp(exact) > 0.3e-3


@pytest.mark.parametrize(("hypothesis", "sizes"), [
    ((Cause("electrode_margin"), Cause("prestretch_anisotropy")), (2.5e-3, 0.025)),
    ((Cause("plate_eccentricity"), Cause("unaccounted_mass")), (1.5e-3, 1e-3, 1.5e-3)),
    ((Cause("strain_stiffening"), Cause("electrode_stiffness")), (0.15, 800.0)),
    ((Cause("parallel_spring"), Cause("voltage_sag")), (6.0, 20e3**-2)),
])
def test_pairs_of_effects_agree_with_finite_elements_on_a_finer_mesh(three_shapes: Simulation,
                                                                     hypothesis, sizes
                                                                     ) -> None:
    unknowns = np.array([0.05, -0.08, *sizes])
    setup = three_shapes.extended(hypothesis, unknowns)
    table = _table(specimen=1)
    predicted = three_shapes.predict(hypothesis, unknowns, table)
    plain = three_shapes.predict((), unknowns[:2], table)
    for row in (3, 6):
        result = solve(Case(setup.specimens[1], mass=float(table.mass[row]),
                            voltage=float(table.voltage[row]), rig=setup.rig), FINE)
        assert predicted[row] == pytest.approx(result.reading_m, abs=3e-6)
        assert abs(plain[row] - result.reading_m) > 5e-6


def test_stiffness_and_permittivity_scale_exactly(three_shapes: Simulation) -> None:
    """The setup with a film of the scaled law is the simulation with these factors, by finite
    elements."""
    film = three_shapes.setup.specimens[0].membrane
    stiffer = replace(film, material=scaled(film.material, 1.3), relative_permittivity=5.0)
    specimen = replace(three_shapes.setup.specimens[0], membrane=stiffer)
    result = solve(Case(specimen, mass=0.02245, voltage=6e3), FINE)
    unknowns = np.log([1.3, 5.0 / film.relative_permittivity])
    table = rows(States.of([0], [0.02245], [6e3]), "displacement", 1e-5)
    assert three_shapes.predict((), unknowns, table)[0] == pytest.approx(result.deflection_m,
                                                                         rel=1e-4)
    seen = rows(States.of([0], [0.02245], [6e3]), "capacitance", 1e-12)
    assert three_shapes.predict((), unknowns, seen)[0] == pytest.approx(result.capacitance_F,
                                                                        rel=1e-4)


@pytest.mark.parametrize("hypothesis", [
    (), (Cause("strain_stiffening"), Cause("prestretch_loss", "elliptical-large")),
    (Cause("electrode_stiffness"), Cause("parallel_spring")),
    (Cause("sensor_gain"), Cause("drift")),
], ids=str)
def test_derivatives_are_those_of_the_predictions(three_shapes: Simulation, hypothesis) -> None:
    deviations = [item.deviation for cause in hypothesis for item in cause.effect.parameters]
    unknowns = np.array([0.1, 0.05, *(0.7 * deviation for deviation in deviations)])
    table = _table(specimen=2)
    jacobian = Prediction(three_shapes, hypothesis, unknowns, table).jacobian
    for number, scale in enumerate([1.0, 1.0, *deviations]):
        step = np.zeros(len(unknowns))
        step[number] = 1e-3 * scale
        around = [three_shapes.predict(hypothesis, unknowns + sign * step, table)
                  for sign in (1, -1)]
        difference = (around[0] - around[1]) / (2e-3 * scale)
        assert jacobian[:, number] == pytest.approx(difference, rel=1e-4,
                                                    abs=1e-5 * np.abs(difference).max() + 1e-12)


def test_past_pull_in_there_is_no_equilibrium(three_shapes: Simulation) -> None:
    film = three_shapes.setup.specimens[0].membrane
    soft = np.array([np.log(0.75), 0.1])
    material = axisymmetric.Ogden(tuple(0.75 * mu for mu in film.material.mu),
                                  tuple(film.material.alpha))
    oracle = axisymmetric.Film(10e-3, 45e-3, film.thickness, film.prestretch[0], material,
                               np.exp(0.1) * film.relative_permittivity)
    limit = axisymmetric.pull_in_voltage(oracle, 0.0179 * Rig().gravity)
    table = rows(States.of([0, 0], [0.0179, 0.0179], [0.9 * limit, 1.03 * limit]), "displacement",
                 1e-5)
    predicted = three_shapes.predict((), soft, table)
    assert np.isfinite(predicted[0])
    assert np.isnan(predicted[1])


def test_beyond_what_is_possible_predictions_go_on_without_a_jump(three_shapes: Simulation
                                                                  ) -> None:
    """Softer and softer films: past pull-in and past the laws' reach heaves grow on and on."""
    table = _table()
    softer = [Prediction(three_shapes, (), np.array([share, 0.3]), table)
              for share in np.linspace(0.5, -1.5, 400)]
    shown = np.array([prediction.extended for prediction in softer])
    possible = np.array([prediction.possible for prediction in softer])
    assert possible[0].all()
    assert not possible[-1].any()
    assert np.all(np.diff(possible.astype(int), axis=0) <= 0)
    assert np.all(np.diff(shown, axis=0) > 0)
    assert np.diff(shown, axis=0).max() < 8e-3
    assert all(prediction.complete == prediction.possible.all() for prediction in softer)
    assert np.all(softer[-1].short)


def test_derivatives_beyond_what_is_possible_are_those_of_what_is_shown(three_shapes: Simulation
                                                                        ) -> None:
    hypothesis, table, step = (Cause("parallel_spring"),), _table(), 1e-5
    for unknowns in np.array([[-0.35, 0.2, 2.0], [-1.0, 0.2, 2.0], [0.2, 1.5, 2.0]]):
        prediction = Prediction(three_shapes, hypothesis, unknowns, table)
        assert not prediction.complete
        for number in range(3):
            moved = step * np.eye(3)[number]
            ahead, behind = (Prediction(three_shapes, hypothesis, unknowns + way * moved,
                                        table).extended for way in (1, -1))
            difference = (ahead - behind) / (2 * step)
            assert prediction.jacobian[:, number] == pytest.approx(
                difference, rel=1e-3, abs=1e-5 * np.abs(difference).max())


@pytest.mark.parametrize("peak", [0.03, 0.4, 0.9, 0.97])
def test_a_plate_rests_where_forces_first_balance_or_hangs_at_the_limit_point(peak: float) -> None:
    """A cubic with a maximum of 1 at ``peak``, in closed form, under loads around it."""
    load = np.array([0.0, 0.5, 0.999999, 1.000001, 1.5, -0.5])

    def balance(heave: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = heave / peak
        return (share * (3 - share**2) / 2 - load, 1.5 * (1 - share**2) / peak + 0 * load)

    at, rests = resting_place(balance, np.full(6, -0.2), np.full(6, 1.0))
    assert rests.tolist() == [True, True, True, False, False, peak < 0.5]
    roots = [2 * peak * np.sin(np.arcsin(share) / 3) for share in load[:3]]
    assert at[:3] == pytest.approx(roots, rel=1e-6, abs=1e-12)
    assert at[3:5] == pytest.approx([peak, peak], rel=1e-6)
    if peak > 0.5:
        assert at[5] == -0.2


def test_a_size_next_to_nothing_is_none() -> None:
    """The weight of a node so near is 1; by its formula it would overflow."""
    nodes = np.array([0.0, 1.3, 3.0, -1.3, -3.0])
    order = np.argsort(nodes)
    weights = np.empty(5)
    weights[order] = _floater_hormann(nodes[order])
    assert _cardinal(nodes, weights, 1.4e-309).tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]
    assert np.abs(_cardinal(nodes, weights, 1e-12) - [1, 0, 0, 0, 0]).max() < 1e-11
