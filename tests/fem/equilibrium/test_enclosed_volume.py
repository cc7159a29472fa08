"""Volume between film, plate and frame against closed forms; gas pressure, which follows both and
lifts them, against shooting."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from tests.oracles.axisymmetric import energy_derivatives
from tests.oracles.potential import potential
from tests.support.models import loaded, model
from tests.support.specimens import NEO_HOOKE, circular, elliptical, reference_film
from tympan.fem.equilibrium.arc_length import Branch
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.loading import Loading, plate_volume
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import PlateMotion, State
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate
from tympan.studies.case import Settings, build_model

INNER, OUTER = 10e-3, 45e-3


def volume(film: Model, state: State) -> float:
    """Volume [m³] that the whole film and plate sweep along the load.

    By what the potential says a gas of 1 Pa has lost: gas lies below and is pressed out.
    """
    works = [potential(film, state.under(pressure=pressure)) for pressure in (0.0, 1.0)]
    return film.discretisation.mirrored * float(works[1] - works[0])


def raised(film: Model, height, heave: float) -> State:
    """The film lifted to a height over its mounted radius, the plate to its heave."""
    positions = film.discretisation.reference.copy()
    positions[:, 2] = height(np.hypot(*film.discretisation.reference[:, :2].T))
    plate = PlateMotion.rest().raised_to(heave)
    return State(film.place(positions, plate), plate)


def test_a_cone_s_volume() -> None:
    heave = 12e-3
    frustum = math.pi * heave / 3 * (INNER**2 + INNER * OUTER + OUTER**2)
    for symmetry in (True, False):
        film = model(circular(), symmetry=symmetry, refine=2.0)
        state = raised(film, lambda r: heave * (OUTER - r) / (OUTER - INNER), heave)
        assert volume(film, state) == pytest.approx(frustum, rel=1e-6)
        turned = state.positions.copy()
        turned[:, 2] *= -1
        below = State(turned, PlateMotion.rest().raised_to(-heave))
        assert volume(film, below) == pytest.approx(-frustum, rel=1e-6)


def test_a_spherical_cap_s_volume() -> None:
    """A cap of radius 60 mm over the frame, its top cut off flat at the plate's edge."""
    radius = 60e-3
    sunk = math.sqrt(radius**2 - OUTER**2)
    heave = math.sqrt(radius**2 - INNER**2) - sunk
    dome = 2 * math.pi / 3 * ((radius**2 - INNER**2) ** 1.5 - (radius**2 - OUTER**2) ** 1.5) \
        - math.pi * (OUTER**2 - INNER**2) * sunk
    film = model(circular(), refine=2.0)
    state = raised(film, lambda r: np.sqrt(radius**2 - r**2) - sunk, heave)
    assert volume(film, state) == pytest.approx(dome + math.pi * INNER**2 * heave, rel=1e-6)


def followers(film: Model, state: State) -> tuple[np.ndarray, np.ndarray]:
    """∫ φ n da of every node and ∫ x·n da of the film, straight from the deformation."""
    f = film.discretisation.deformation(state.positions)
    normal = np.cross(f[..., 0], f[..., 1]) * film.discretisation.basis.dx[..., None]
    forces = np.zeros_like(film.discretisation.reference)
    np.add.at(forces, film.discretisation.connectivity,
              np.einsum("epi,pl->eli", normal, film.discretisation.shapes))
    places = np.einsum("pl,eli->epi", film.discretisation.shapes,
                       state.positions[film.discretisation.connectivity])
    return forces, (places * normal).sum()


def test_divergence_theorem_with_the_plate_shifted_tilted_and_turned(skewed_model: Model) -> None:
    """3V = ∮ x·n da over film, plate and the frame's plane, the last of which adds nothing.

    At order 2 the quadrature is exact for both; the mesh's plate differs from the circle by 1e-4 of
    its area.
    """
    film, state = skewed_model, loaded(skewed_model)
    plate = state.plate
    centre, normal = film.centre + plate.translation, plate.rotation[:, 2]
    whole = followers(film, state)[1] + math.pi * INNER**2 * (centre @ normal)
    assert plate.tilt > 0.1
    assert 3 * volume(film, state) == pytest.approx(whole,
                                                    abs=3e-4 * 3 * math.pi * INNER**2 * centre[2])


def test_gas_pressure_is_normal_to_film_and_plate(skewed_model: Model) -> None:
    """Forces −p ∫ φ n da on free nodes, n along the load where flat; on the plate −p n A through
    its centre, and the film's on its edge."""
    film, state = skewed_model, loaded(skewed_model)
    inner, outer = film.by_load(state, "pressure")
    forces, _ = followers(film, state)
    assert np.allclose(inner, forces[film.discretisation.free],
                       rtol=0, atol=1e-13 * np.abs(forces).max())
    at_edge = forces[film.discretisation.plate_nodes]
    arms = state.positions[film.discretisation.plate_nodes] - film.centre - state.plate.translation
    push = at_edge.sum(axis=0) + film.plate_area * state.plate.rotation[:, 2]
    moment = np.cross(arms, at_edge).sum(axis=0)
    assert outer[:3] == pytest.approx(push, abs=3e-4 * film.plate_area)
    assert outer[3:] == pytest.approx(moment, abs=3e-4 * film.plate_area * INNER)


def test_plate_volume_s_derivatives() -> None:
    """A rotation by a vector, to second order."""
    plate = PlateMotion.rest().moved(np.array([1e-3, 2e-3, 5e-3, 0.3, -0.4, 0.5]))
    direction = np.array([0.3, -0.1, 0.2, 0.7, 0.5, -0.4])
    value, first, second = plate_volume(2.0, plate)
    errors = [abs(plate_volume(2.0, plate.moved(t * direction))[0] - value - t * first @ direction
                  - t * t * direction @ second @ direction / 2) for t in (0.04, 0.02)]
    assert math.log2(errors[0] / errors[1]) > 2.8
    assert value == pytest.approx(-2.0 * 5e-3 * plate.rotation[2, 2])


def shoot(rim: float, pressure: float, voltage_squared: float, force: float = 0.0,
          material=NEO_HOOKE
          ) -> tuple[float, float]:
    """How far r(b) misses b, relative; the heave [m]. From the plate's edge outwards, ``rim`` being
    λ₁ there.

    With x = ln R, ρ = R/λ_p and the slope t: (ρ T Ψ₁)' = T Ψ₂ cos t along the meridian, and across
    it ρ T Ψ₁ t' = p r λ₁ρ' − T Ψ₂ sin t; at the plate 2π ρ T Ψ₁ sin t = F + p π a².
    """
    film = reference_film(material)
    lp, thickness = film.prestretch, film.thickness

    def rate(x: float, y: np.ndarray) -> list[float]:
        l1, l2, slope, _ = y
        rho, psi = math.exp(x) / lp, energy_derivatives(film, l1, l2, voltage_squared)
        l2_x = l1 * math.cos(slope) - l2
        return [(psi.d2 * math.cos(slope) - psi.d1 - psi.d12 * l2_x) / psi.d11, l2_x,
                (pressure * rho * l1 * l2 / thickness - psi.d2 * math.sin(slope)) / psi.d1,
                l1 * rho * math.sin(slope)]

    edge = float(energy_derivatives(film, np.float64(rim), np.float64(lp), voltage_squared).d1)
    sine = (force + pressure * math.pi * INNER**2) / (2 * math.pi * INNER / lp * thickness * edge)
    start = [rim, lp, math.asin(sine), 0.0]
    path = solve_ivp(rate, (math.log(INNER), math.log(OUTER)), start, method="DOP853", rtol=1e-10,
                     atol=1e-12)
    return path.y[1, -1] / lp - 1, path.y[3, -1]


def at(pressure: float, voltage: float, guess: tuple[float, float], force: float = 0.0) -> float:
    """Heave [m] of the equilibrium whose λ₁ at the plate lies in an interval."""
    rim = brentq(lambda l1: shoot(l1, pressure, voltage**2, force)[0], *guess, xtol=1e-12)
    return shoot(rim, pressure, voltage**2, force)[1]


@pytest.mark.parametrize(("pressure", "voltage", "force", "guess"), [
    (500.0, 0.0, 0.0, (2.2, 2.5)), (500.0, 4000.0, 0.0, (2.3, 2.9)),
    (300.0, 3000.0, 0.3, (2.2, 2.9)),
    (-300.0, 2000.0, 0.0, (2.2, 2.5))])
def test_plate_and_film_under_gas_pressure_follow_the_ode(pressure, voltage, force, guess) -> None:
    # The oracle's gas pushes the way its force does, so it is below the film with the other sign.
    outcome = equilibrium(model(circular()), force, voltage, -pressure)
    assert outcome.status == "equilibrium"
    exact = math.copysign(at(abs(pressure), voltage, guess, force), pressure)
    assert outcome.state.plate.deflection == pytest.approx(exact, rel=2e-6)


def largest(load, guess: tuple[float, float]) -> float:
    """Maximum of a load over λ₁ at the plate."""
    peak = minimize_scalar(lambda rim: -load(rim), bounds=guess, method="bounded",
                           options={"xatol": 1e-5})
    return -float(peak.fun)


def test_ballooning_limit_is_the_ode_s_and_the_branch_goes_on_beyond() -> None:
    """A neo-Hookean balloon's pressure falls once it is large enough."""
    exact = largest(lambda rim: brentq(lambda p: shoot(rim, p, 0.0)[0], 800.0, 1500.0, xtol=1e-4),
                    (6.2, 7.8))
    film = model(circular())
    outcome = equilibrium(film, 0.0, 0.0, 2000.0)
    assert (outcome.status, outcome.limited) == ("no_equilibrium", "pressure")
    assert outcome.limit == pytest.approx(exact, rel=1e-5)
    assert equilibrium(film, 0.0, 0.0, 0.99 * exact).status == "equilibrium"
    falling = []
    for point in Branch(film, "pressure").points(film.mounted()):
        if point.rate < 0:
            falling.append(point)
        if len(falling) == 4:
            break
    for point in falling[1:]:
        state = point.state
        assert point.solution.tangent.negative == 1
        rim = brentq(lambda l1, p=state.pressure: shoot(l1, p, 0.0)[0], 7.0, 12.0, xtol=1e-12)
        raised = -shoot(rim, state.pressure, 0.0)[1]
        assert state.plate.deflection == pytest.approx(raised, rel=1e-4)


def test_pull_in_voltage_of_an_inflated_film() -> None:
    exact = math.sqrt(largest(
        lambda rim: brentq(lambda q: shoot(rim, 800.0, q)[0], 0.0, 6000.0**2, xtol=1.0),
        (4.0, 5.2)))
    outcome = equilibrium(model(circular()), 0.0, 9000.0, 800.0)
    assert (outcome.status, outcome.limited) == ("no_equilibrium", "voltage")
    assert math.sqrt(outcome.limit) == pytest.approx(exact, rel=1e-5)


def test_quarter_and_full_models_agree_under_pressure() -> None:
    quarter, full = (equilibrium(model(elliptical(60e-3), symmetry=symmetry), 0.1, 3000.0,
                                 300.0).state
                     for symmetry in (True, False))
    assert quarter.plate.deflection == pytest.approx(full.plate.deflection, rel=1e-8)


def test_pressure_tilts_a_plate_off_centre_and_half_agrees_with_full() -> None:
    specimen = replace(circular(), plate=Plate(Circle(INNER), (8e-3, 0.0)))
    half, full = (equilibrium(model(specimen, symmetry=symmetry), 0.0, 0.0, 400.0).state
                  for symmetry in (True, False))
    assert half.plate.tilt == pytest.approx(full.plate.tilt, rel=1e-6)
    assert half.plate.tilt > 0.01
    level = equilibrium(build_model(specimen, Settings(), Loading(guide="level")), 0.0, 0.0,
                        400.0).state
    assert level.plate.tilt == 0
    assert 0 > level.plate.deflection > half.plate.deflection


def test_a_film_mounted_slack_is_inflated() -> None:
    """Its flat state has no stiffness, and it hangs on no weight; up or down is the same."""
    film = model(circular(prestretch=(1.0, 1.0)))
    heights = {}
    for pressure in (-400.0, 400.0):
        outcome = equilibrium(film, 0.0, 0.0, pressure)
        assert outcome.status == "equilibrium"
        pushed = equilibrium(film, -math.copysign(0.1, pressure), 0.0, pressure)
        eased = equilibrium(film, 0.0, 0.0, pressure, pushed.solution)
        heights[pressure] = outcome.state.plate.deflection
        assert heights[pressure] == pytest.approx(eased.state.plate.deflection, rel=1e-6)
    assert heights[400.0] < 0
    assert heights[-400.0] == pytest.approx(-heights[400.0], rel=1e-9)


@pytest.mark.parametrize(("mass", "pressure", "sense"), [
    (17.9e-3, 50.0, 1), (17.9e-3, 400.0, -1)])
def test_a_film_mounted_slack_goes_where_weight_or_gas_pull_it(
        mass: float, pressure: float, sense: int) -> None:
    film = model(circular(prestretch=(1.0, 1.0)))
    outcome = equilibrium(film, mass * 9.80665, 0.0, pressure)
    assert outcome.status == "equilibrium"
    assert sense * outcome.state.plate.deflection > 1e-3
