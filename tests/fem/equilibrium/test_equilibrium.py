"""Equilibria against tables, the axisymmetric equations, orders of convergence, units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.verification.films import rim_peak
from tests.oracles import axisymmetric
from tests.support.models import model, pressed_model, structured_quarter
from tests.support.specimens import NEO_HOOKE, ROOT5, circular, elliptical, reference_film, skewed
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.newton import NewtonSettings, newton
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.equilibrium.voltage_path import voltage_path
from tympan.fem.film.laws import Ogden
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.biases import Spring
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.results.fields import edge_fields
from tympan.fem.rig import Rig
from tympan.geometry.mesh import from_flat
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.studies.case import Case, Settings, solve

STIFF = Ogden((30e3, 2e3), (1.3, 5.5))
G = 9.81

#: Exact: neo-Hooke modulus [kPa], mass [g], deflection [mm] at 0, 3.5, 5, 7 kV (None: no
#: equilibrium).
DEFLECTIONS = [
    (20, 17.9, (2.1185, 2.4307, 2.8717, 4.3843)),
    (20, 22.45, (2.6569, 3.0484, 3.6018, 5.5194)),
    (15, 17.9, (2.8245, 3.4083, 4.3477, None)),
]
#: Exact: material, heave [mm], voltage [kV], force [N], stretch and elastic stresses at the rim
#: [kPa].
HELD = [
    (NEO_HOOKE, 5, 0, 0.51826859, 2.35424, 137.6593, 124.0979),
    (NEO_HOOKE, 5, 3, 0.47914090, 2.36190, 138.5683, 124.1037),
    (NEO_HOOKE, 15, 0, 1.55855384, 3.14891, 247.3867, 124.4957),
    (STIFF, 5, 0, 1.07485662, 2.31715, 289.2795, 249.0490),
    (STIFF, 15, 0, 4.01666125, 2.74422, 624.2382, 249.7469),
]
FINEST = 4.0  #: refinement at which the tables must be met to 1e-6


@pytest.mark.parametrize(("modulus", "mass", "deflections"), DEFLECTIONS)
def test_deflection_table_at_the_default_mesh(modulus, mass, deflections) -> None:
    film = model(circular(Ogden((modulus * 1e3,), (2.0,))))
    path = list(voltage_path(film, mass * 1e-3 * G, [0.0, 3500.0, 5000.0, 7000.0]))
    for outcome, expected in zip(path, deflections, strict=True):
        if expected is None:
            assert outcome.status == "no_equilibrium"
        else:
            assert outcome.status == "equilibrium"
            assert outcome.state.plate.deflection * 1e3 == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("material", "heave", "kilovolt", "force", "stretch", "radial", "hoop"),
                         HELD)
def test_force_table_at_the_default_mesh(material, heave, kilovolt, force, stretch, radial,
                                         hoop) -> None:
    film = model(circular(material))
    outcome = held(film, heave * 1e-3, kilovolt * 1e3)
    assert outcome.status == "equilibrium"
    assert outcome.state.force == pytest.approx(force, rel=1e-4)
    assert outcome.state.force == pytest.approx(force,
                                                rel=2e-6)  # what the default mesh really does
    fields, _ = edge_fields(film, outcome.state, "plate")
    assert rim_peak(film, outcome.state) == pytest.approx(radial * 1e3, rel=5e-3)
    assert np.allclose(fields.stress_radial + fields.maxwell_stress, radial * 1e3, rtol=5e-3)
    assert np.allclose(fields.stress_circumferential + fields.maxwell_stress, hoop * 1e3, rtol=1e-3)
    assert np.allclose(fields.stretch_1, stretch, rtol=3e-3)


@pytest.mark.parametrize(("material", "heave", "kilovolt", "force"), [row[:4] for row in HELD])
def test_force_table_on_the_finest_mesh(material, heave, kilovolt, force) -> None:
    outcome = held(model(circular(material), refine=FINEST), heave * 1e-3, kilovolt * 1e3)
    exact = axisymmetric.solve_deflection(reference_film(material),
                                          heave * 1e-3, kilovolt * 1e3).force
    assert exact == pytest.approx(force, rel=2e-8)  # the table's digits
    assert outcome.state.force == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(("modulus", "mass", "kilovolt"), [
    (modulus, mass, kilovolt) for modulus, mass, row in DEFLECTIONS
    for kilovolt, deflection in zip((0, 3.5, 5, 7), row, strict=True) if deflection is not None])
def test_deflections_on_the_finest_mesh(modulus, mass, kilovolt) -> None:
    material = Ogden((modulus * 1e3,), (2.0,))
    outcome = equilibrium(model(circular(material), refine=FINEST), mass * 1e-3 * G, kilovolt * 1e3)
    exact = axisymmetric.solve_load(reference_film(material),
                                    mass * 1e-3 * G, kilovolt * 1e3).deflection
    assert outcome.state.plate.deflection == pytest.approx(exact, rel=1e-6)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    material=st.sampled_from([NEO_HOOKE, STIFF, Ogden((18.4e3, 210.0), (2.0, 4.0)),
                              Ogden((9e3, -4e3), (2.6, -1.4))]),
    inner=st.floats(5e-3, 20e-3), prestretch=st.floats(1.6, 3.5), load=st.floats(0.1, 1.5),
    share=st.floats(0, 0.6),
    exponent=st.sampled_from([0.0, 0.5]))
def test_any_annulus_follows_the_ode(material, inner, prestretch, load, share, exponent) -> None:
    """Plate size, prestretch, load (relative to one that tilts the film by about 0.2) and voltage
    drawn at random."""
    from tympan.geometry.outlines import Circle
    from tympan.geometry.specimen import Plate

    specimen = circular(material, prestretch=(prestretch, prestretch),
                        permittivity_exponent=exponent)
    specimen = replace(specimen, plate=Plate(Circle(inner)))
    reference = reference_film(material, inner=inner, prestretch=prestretch,
                               permittivity_exponent=exponent)
    force = load * 0.2 * 2 * np.pi * inner * reference.resultant()
    # Voltage as a share of the one at which the flat film goes slack.
    slack = np.sqrt(reference.resultant()
                    / (reference.resultant() - reference.resultant(1000.0))) * 1000.0
    outcome = equilibrium(model(specimen), force, share * slack)
    try:
        exact = axisymmetric.solve_load(reference, force, share * slack)
    except axisymmetric.NoEquilibrium:
        assert outcome.status != "equilibrium"
        return
    assert outcome.status == "equilibrium"
    assert outcome.state.plate.deflection == pytest.approx(exact.deflection, rel=3e-5)


@pytest.mark.parametrize(("order", "sizes", "force_rate", "stress_rate"),
                         [(1, (4, 8, 16), 1.8, 0.8), (2, (4, 8, 16), 3.5, 1.8),
                          (3, (2, 4, 8), 4.5, 2.3),
                          (4, (1, 2, 4), 6.0, 3.0)])
def test_convergence_orders(order, sizes, force_rate, stress_rate) -> None:
    """Plate force and peak rim stress; 15 mm, where the stress is hard. The theory says 2p and p.
    """
    heave = 15e-3
    exact = axisymmetric.solve_deflection(reference_film(NEO_HOOKE), heave)
    force_errors, stress_errors = [], []
    for size in sizes:
        film = structured_quarter(order, size, size)
        outcome = held(film, heave)
        assert outcome.status == "equilibrium"
        force_errors.append(abs(outcome.state.force / exact.force - 1))
        stress_errors.append(abs(rim_peak(film, outcome.state) / float(exact.sigma1(10e-3)) - 1))
    halvings = len(sizes) - 1
    assert np.log2(force_errors[0] / force_errors[-1]) / halvings >= force_rate, force_errors
    assert np.log2(stress_errors[0] / stress_errors[-1]) / halvings >= stress_rate, stress_errors


def test_the_default_mesh_s_own_convergence_with_refinement() -> None:
    """gmsh's graded meshes as users refine them: the force gains at least four digits from --refine
    1 to 4."""
    exact = axisymmetric.solve_deflection(reference_film(NEO_HOOKE), 15e-3)
    errors = []
    for refine in (1.0, 2.0, 4.0):
        film = model(circular(), refine=refine)
        state = held(film, 15e-3).state
        errors.append((abs(state.force / exact.force - 1),
                       abs(rim_peak(film, state) / exact.sigma1(10e-3) - 1)))
    force, stress = np.array(errors).T
    assert force[0] < 1e-6
    assert force[2] < 1e-9
    assert stress[0] < 5e-3
    assert np.log2(stress[0] / stress[2]) / 2 > 2.5


@pytest.mark.parametrize("specimen", [circular(), elliptical(60e-3), elliptical(75e-3)],
                         ids=lambda s: s.name)
@pytest.mark.parametrize("voltage", [0.0, 5000.0])
def test_quarter_and_full_models_agree(specimen, voltage) -> None:
    """In every number of the result, peaks included; and with a mesh of the whole that is not
    mirrored."""
    case = Case(specimen, mass=17.9e-3, voltage=voltage)
    quarter, full = (solve(case, Settings(symmetry=symmetry)) for symmetry in (True, False))
    assert full.dofs > 3 * quarter.dofs
    for name, value in quarter.json().items():
        if isinstance(value, float) and name != "wall_s":
            assert value == pytest.approx(getattr(full, name), rel=1e-8, abs=1e-12), name
    mesh = from_flat(mesh_film(specimen, MeshSettings(), frozenset()))
    free = Model(Discretisation.of(mesh), specimen)
    heave = equilibrium(free, 17.9e-3 * 9.80665, voltage).state.plate.deflection
    assert heave == pytest.approx(quarter.deflection_m, rel=1e-6)


def test_half_and_full_models_agree_for_a_plate_off_centre() -> None:
    from tympan.geometry.outlines import Circle
    from tympan.geometry.specimen import Plate

    specimen = replace(elliptical(60e-3), plate=Plate(Circle(10e-3), (10e-3, 0.0)))
    half, full = (equilibrium(model(specimen, symmetry=symmetry), 0.2, 4000.0).state
                  for symmetry in (True, False))
    assert half.plate.deflection == pytest.approx(full.plate.deflection, rel=1e-6)
    assert half.plate.tilt == pytest.approx(full.plate.tilt, rel=1e-5)
    assert half.plate.tilt > 1e-3
    assert np.allclose(half.plate.translation, full.plate.translation, atol=1e-9)


def test_si_and_mm_g_s_files_give_the_same_result(tmp_path: Path) -> None:
    """Lengths in mm, masses in g, stress in g/(mm s²), voltage in its unit of that system, kg m²/(A
    s³) = 1e9 of it."""
    template = """
name = "annulus"
[frame]
shape = "ellipse"
semi_axes = ["{a}", "{b}"]
[plate]
shape = "circle"
radius = "{r}"
[membrane]
thickness = "{t}"
prestretch = [2.2360679775, 2.2360679775]
relative_permittivity = 4.7
[membrane.material]
law = "ogden"
mu = ["{mu}"]
alpha = [2]
"""
    si = {"a": "0.06 m", "b": "0.045 m", "r": "0.01 m", "t": "0.001 m", "mu": "20000 Pa"}
    mm = {"a": "60 mm", "b": "45 mm", "r": "10 mm", "t": "1 mm", "mu": "20000 g/mm/s^2"}
    from tympan.base.units import quantity

    deflections = []
    for number, (values, mass, voltage) in enumerate(
            [(si, "0.0179 kg", "3500 kg*m^2/A/s^3"), (mm, "17.9 g", "3.5e12 g*mm^2/A/s^3")]):
        file = tmp_path / f"{number}.toml"
        file.write_text(template.format(**values))
        case = Case(load_specimen(file), mass=quantity(mass, "mass"),
                    voltage=quantity(voltage, "voltage"))
        deflections.append(solve(case, Settings()).deflection_m)
    assert deflections[0] == pytest.approx(deflections[1], rel=1e-10)
    assert deflections[0] > 2e-3


@given(st.floats(1e-3, 200.0), st.floats(1e-3, 1e3))
@settings(max_examples=8, deadline=None, derandomize=True)
def test_similar_films_behave_alike(length: float, stiffness: float) -> None:
    """Statics depend on m g/(μ T R) and ε U²/(μ T²) alone: scaling both must not change shape or
    effort.

    From a plate of 10 um to a frame of 9 m, near both ends of what may be built.
    """
    def scaled(size: float, modulus: float) -> tuple[float, int]:
        from tympan.geometry.outlines import Circle
        from tympan.geometry.specimen import Film, Plate, Specimen

        specimen = Specimen("scaled", Circle(45e-3 * size), Plate(Circle(10e-3 * size)),
                            Film(1e-3 * size, (ROOT5, ROOT5), Ogden((modulus,), (2.0,)), 4.7))
        film = model(specimen)
        stiffness = modulus / 20e3
        solution = equilibrium(film, 0.1755 * size**2 * stiffness,
                               3000.0 * size * np.sqrt(stiffness)).solution
        return solution.state.plate.deflection / size, solution.iterations

    ours, reference = scaled(length, 20e3 * stiffness), scaled(1.0, 20e3)
    assert ours[0] == pytest.approx(reference[0], rel=1e-6)
    assert ours[1] == reference[1]


def test_reaction_balances_weight_and_spring(skewed_model: Model) -> None:
    outcome = equilibrium(replace(skewed_model, loading=Loading((Spring(5.0),))), 0.2, 3000.0)
    assert outcome.status == "equilibrium"
    state = outcome.state
    forces = skewed_model.forces(state.positions, state.voltage_squared)
    at_plate = forces[skewed_model.discretisation.plate_nodes]
    assert at_plate.sum(axis=0) == pytest.approx([0, 0, 0.2 - 5.0 * state.plate.deflection],
                                                 abs=1e-8)
    arms = (state.positions[skewed_model.discretisation.plate_nodes]
            - skewed_model.centre - state.plate.translation)
    assert np.abs(np.cross(arms, at_plate).sum(axis=0)).max() < 1e-9
    assert np.abs(forces[skewed_model.discretisation.free]).max() < 1e-8


def test_reaction_is_the_energy_s_slope_along_the_heave() -> None:
    film = model(elliptical(60e-3))
    step = 1e-5
    up, here, down = (held(film, 5e-3 + change, 3000.0).state for change in (step, 0.0, -step))
    energies = [film.energy(state.positions, state.voltage_squared) * film.discretisation.mirrored
                for state in (up, down)]
    assert (energies[0] - energies[1]) / (2 * step) == pytest.approx(here.force, rel=1e-6)


def test_newton_converges_quadratically(skewed_model: Model) -> None:
    """Distances to the solution after 1, 2, 3 tangents from a tilted, twisted start: each below C
    times the last²."""
    exact = equilibrium(skewed_model, 0.2, 3000.0).state
    plate = exact.plate.moved(np.array([2e-4, -1e-4, 3e-4, 0.02, -0.03, 0.02]))
    start = replace(exact, plate=plate)
    errors = []
    for tangents in (1, 2, 3):
        # A correction bound no step meets: Newton stops after the given number of tangents,
        # undamped.
        stopped = newton(skewed_model, start,
                         settings=NewtonSettings(correction=0.0, iterations=tangents))
        errors.append(np.abs(stopped.state.positions - exact.positions).max() / skewed_model.size)
    assert errors[0] < 1e-2
    assert errors[1] < 50 * errors[0] ** 2
    assert errors[2] < 50 * errors[1] ** 2


def test_rig_edits_act_in_the_simulation() -> None:
    specimen = circular(Ogden((20e3,), (2.0,)))
    plain = solve(Case(specimen, mass=17.9e-3, voltage=3500.0), Settings())
    heavier = solve(Case(specimen, mass=16.9e-3, voltage=3500.0,
                         rig=Rig(unaccounted_mass=1e-3)), Settings())
    boosted = solve(Case(specimen, mass=17.9e-3, voltage=3500.0 / 1.1,
                         rig=Rig(amplifier_gain=0.1)), Settings())
    sprung = solve(Case(specimen, mass=17.9e-3, voltage=3500.0, rig=Rig(spring=10.0)), Settings())
    assert heavier.deflection_m == pytest.approx(plain.deflection_m, rel=1e-9)
    assert boosted.deflection_m == pytest.approx(plain.deflection_m, rel=1e-9)
    assert sprung.deflection_m < 0.95 * plain.deflection_m
    assert sprung.reaction_N == pytest.approx(17.9e-3 * 9.80665 - 10 * sprung.deflection_m,
                                              rel=1e-6)
    shown = solve(Case(specimen, mass=17.9e-3, voltage=0.0,
                       rig=Rig(sensor_gain=0.02, sensor_zero=5e-6)), Settings())
    assert shown.reading_m == pytest.approx(1.02 * shown.deflection_m + 5e-6)


def test_pull_in_is_where_the_ode_has_it() -> None:
    """15 kPa under 17.9 g have no equilibrium at 7 kV; the limit voltage by ODE is 6828.83 V.

    Of a film that bears compression, as the ODE's does.
    """
    material = Ogden((15e3,), (2.0,))
    outcome = equilibrium(pressed_model(circular(material)), 17.9e-3 * G, 7000.0)
    assert outcome.status == "no_equilibrium"
    exact = axisymmetric.pull_in_voltage(reference_film(material), 17.9e-3 * G)
    assert np.sqrt(outcome.limit) == pytest.approx(exact, rel=1e-4)
    below = equilibrium(pressed_model(circular(material)), 17.9e-3 * G, 0.999 * exact)
    above = equilibrium(pressed_model(circular(material)), 17.9e-3 * G, 1.001 * exact)
    assert (below.status, above.status) == ("equilibrium", "no_equilibrium")


def test_unsymmetric_specimen_is_found_from_another_direction(skewed_model: Model) -> None:
    """Load then voltage (the default) and voltage then load end in the same state."""
    from tympan.fem.equilibrium.ramp import LoadRamp

    start = newton(skewed_model, skewed_model.mounted())
    charged = LoadRamp(skewed_model, "voltage", 3000.0**2).run(start)
    loaded = LoadRamp(skewed_model, "force", 0.2).run(charged.solution)
    usual = equilibrium(skewed_model, 0.2, 3000.0)
    assert loaded.status == usual.status == "equilibrium"
    assert np.allclose(loaded.state.positions, usual.state.positions, atol=1e-9)


def test_mesh_settings_say_what_they_allow() -> None:
    from tympan.base.errors import InputError

    with pytest.raises(InputError, match="1, 2, 3, 4"):
        MeshSettings(order=5)
    assert skewed().mirror_planes == frozenset()


@pytest.mark.parametrize("prestretch", [1.0, 1.0001, 1.02])
def test_films_that_are_not_taut_when_flat(prestretch) -> None:
    """An unstressed flat membrane has no stiffness across its plane; its loaded shape is found all
    the same."""
    outcome = equilibrium(model(circular(prestretch=(prestretch, prestretch))), 0.1755, 0.0)
    assert outcome.status == "equilibrium"
    exact = axisymmetric.solve_load(reference_film(NEO_HOOKE, prestretch=prestretch), 0.1755)
    assert outcome.state.plate.deflection == pytest.approx(exact.deflection, rel=1e-4)


def test_a_voltage_path_skips_only_what_is_hopeless() -> None:
    """A sagging amplifier brings the voltage back down: after a pull-in at 7 kV, 3 kV has an
    equilibrium again."""
    film = model(circular(Ogden((15e3,), (2.0,))))
    statuses = [outcome.status for outcome in voltage_path(film, 17.9e-3 * G,
                                                           [1000.0, 7000.0, 8000.0, 3000.0])]
    assert statuses == ["equilibrium", "no_equilibrium", "no_equilibrium", "equilibrium"]


def test_held_states_do_not_depend_on_where_they_start() -> None:
    film = model(elliptical(60e-3))
    start = held(film, 12e-3, 6000.0)
    there, back = held(film, 3e-3, 1000.0), held(film, 3e-3, 1000.0, start.solution)
    assert there.state.force == pytest.approx(back.state.force, rel=1e-9)


@pytest.mark.parametrize("kilovolt", [7.5, 20.0, 1000.0])
def test_voltages_far_beyond_pull_in_have_no_equilibrium(kilovolt) -> None:
    """However far: and the voltage said to be the limit stays within 1 % of the ODE's."""
    material = Ogden((15e3,), (2.0,))
    outcome = equilibrium(pressed_model(circular(material)), 17.9e-3 * G, kilovolt * 1e3)
    assert outcome.status == "no_equilibrium"
    exact = axisymmetric.pull_in_voltage(reference_film(material), 17.9e-3 * G)
    assert np.sqrt(outcome.limit) == pytest.approx(exact, rel=1e-2)


def test_pull_in_is_seen_from_a_start_close_to_it() -> None:
    film = pressed_model(circular(Ogden((15e3,), (2.0,))))
    statuses = [outcome.status for outcome in voltage_path(film, 17.9e-3 * G,
                                                           [6780.0, 6815.0, 6850.0])]
    assert statuses == ["equilibrium", "equilibrium", "no_equilibrium"]


@pytest.mark.parametrize("prestretch", [0.99, 0.8, 0.5])
def test_a_film_mounted_slack_hangs_on_its_load_or_is_refused(prestretch: float) -> None:
    """Without a load that tightens it, only the residual tension would hold its plate."""
    film = model(circular(prestretch=(prestretch, prestretch)), refine=0.7)
    loaded = equilibrium(film, 0.3, 0.0)
    assert loaded.status == "equilibrium"
    reference = replace(reference_film(NEO_HOOKE, prestretch=prestretch), relaxed=True)
    deflection = loaded.state.plate.deflection
    exact = axisymmetric.shoot_deflection(reference, deflection, 0.0, 1e-5)
    assert exact.force == pytest.approx(0.3, rel=2e-2)
    for force in (0.0, 1e-3):
        outcome = equilibrium(film, force, 0.0)
        assert outcome.status == "not_converged"
        assert "slack" in outcome.advice
