"""Films without plate: meshes without hole, inflation, modes, voltage; against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0, j1, jn_zeros

from tests.oracles.axisymmetric import neo_hooke
from tests.oracles.inflation import (
    Disc,
    Loads,
    highest_pressure,
    minimise,
    pull_in,
    voltage_at,
)
from tests.support.models import model
from tympan.base.errors import InputError
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.laws import NeoHooke
from tympan.fem.results.fields import whole
from tympan.fem.rig import GAS_SIGN, Rig
from tympan.fem.vibration.air import air_volumes
from tympan.geometry.outlines import Circle, Ellipse, Outline, Polygon, RoundedRectangle
from tympan.geometry.specimen import Electrode, Film, Plate, Region, Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, solve
from tympan.studies.limits import limits
from tympan.studies.modes import modes
from tympan.studies.path import path
from tympan.studies.sensitivity import sensitivity
from tympan.studies.signals import Pieces
from tympan.studies.transient import TransientCase, history

B, T, MU, ROOT5, DENSITY, EPS = 45e-3, 1e-3, 20e3, 5**0.5, 1000.0, 4.7 * 8.8541878128e-12
#: As good as none: fall acceleration is positive.
STILL = Rig(gravity=1e-9)
MOUNTED = T / ROOT5**2
ROUND, COVERED = Circle(B), Electrode()
#: Of the flat film [Pa].
STRESS = MU * (ROOT5**2 - ROOT5**-4)


def film(frame: Outline = ROUND, prestretch: float = ROOT5, density: float = DENSITY,
         electrode: Electrode = COVERED) -> Specimen:
    return Specimen("film", frame, None,
                    Film(T, (prestretch, prestretch), NeoHooke(MU), 4.7, density=density),
                    electrode)


def oracle(prestretch: float = ROOT5) -> Disc:
    return Disc(0.0, B, T, prestretch, neo_hooke(MU), 4.7)


def whole_disc() -> Discretisation:
    part = model(film())
    return whole(part, part.mounted())[0].discretisation


def under(pressure: float, **rig: float) -> Rig:
    return Rig(gravity=rig.pop("gravity", 1e-9), gas_pressure=pressure, **rig)


@pytest.mark.parametrize(("frame", "area"), [
    (Circle(B), np.pi * B**2), (Ellipse((60e-3, 45e-3)), np.pi * 60e-3 * 45e-3),
    (Polygon(((-3e-2, -2e-2), (3e-2, -2e-2), (3e-2, 2e-2), (-3e-2, 2e-2))), 24e-4),
    (Polygon(((-2e-2, -2e-2), (4e-2, -1e-2), (0.0, 3e-2))), 14e-4)])
@pytest.mark.parametrize("electrode", [
    Electrode(), Electrode(outline=Region(Circle(8e-3), (2e-3, 1e-3)))])
def test_a_mesh_without_hole(frame: Outline, area: float, electrode: Electrode) -> None:
    film_model = model(film(frame, electrode=electrode))
    mesh = film_model.discretisation
    assert not len(mesh.plate_nodes)
    assert mesh.weights.sum() * mesh.mirrored == pytest.approx(area, rel=1e-6)
    assert film_model.centre_node in mesh.connectivity[:, :3]
    assert np.abs(mesh.reference[film_model.centre_node]).max() < 1e-12
    if not electrode.everywhere:
        covered = (mesh.weights * mesh.covered).sum() * mesh.mirrored
        assert covered == pytest.approx(np.pi * 8e-3**2, rel=1e-5)


@pytest.mark.parametrize(("pressure", "voltage", "error"), [
    (0.01, 0.0, 3e-8), (50.0, 0.0, 3e-8), (200.0, 0.0, 3e-8), (100.0, 5000.0, 3e-7)])
def test_inflated_when_prestretched(pressure: float, voltage: float, error: float) -> None:
    result = solve(Case(film(), voltage=voltage, rig=under(pressure)), Settings())
    exact = minimise(oracle(), Loads(pressure, voltage=voltage)).apex
    assert result.deflection_m == pytest.approx(-exact, rel=error)  # up, against the weight
    assert result.reaction_N is None
    assert result.tilt_rad is None
    assert result.warnings == (GAS_SIGN,)


def test_creeps_from_what_its_branch_resists_to_its_law() -> None:
    """Just mounted, a branch adds its modulus to the law's; after twenty of its times, nothing.

    Under gas and voltage, both put on at once.
    """
    fresh, loads = film(density=0.0), Loads(100.0, voltage=5000.0)
    branched = replace(fresh, membrane=replace(
        fresh.membrane, branches=(ViscousBranch(30e3, 1.0),), mounted=0.0))
    signal = Pieces(np.array([0.0, 20.0]), np.full(2, loads.voltage))
    done = history(TransientCase(branched, signal, mass=0.0, rig=under(loads.pressure)), Settings())
    for number, modulus in ((0, MU + 30e3), (-1, MU)):
        exact = minimise(Disc(0.0, B, T, ROOT5, neo_hooke(modulus), 4.7), loads).apex
        assert done.deflection[number] == pytest.approx(-exact, rel=1e-5)
    assert done.stopped is None
    assert abs(done.balance.unexplained_J) < 1e-4 * done.balance.heat_J
    with pytest.raises(InputError, match=r"--swing.*no plate that swings"):
        TransientCase(branched, signal, mass=0.0, inertia=True)
    with pytest.raises(InputError, match="no plate to carry it"):
        TransientCase(branched, signal, mass=1e-3)
    with pytest.raises(InputError, match=r"--swing.*the guide holds the plate"):
        TransientCase(replace(branched, plate=Plate(Circle(1e-2))), signal, mass=1e-3, inertia=True,
                      rig=Rig(guide="fixed"))


@pytest.mark.parametrize("pressure", [20.0, 300.0, -20.0])
def test_inflated_from_slack(pressure: float) -> None:
    """Residual tension of a film that may wrinkle is what differs."""
    result = solve(Case(film(prestretch=1.0), rig=under(pressure)), Settings())
    exact = minimise(oracle(1.0), Loads(abs(pressure))).apex
    assert result.deflection_m == pytest.approx(-np.copysign(exact, pressure), rel=3e-7)


def test_a_small_pressure_bulges_by_its_tension() -> None:
    """w = p a²/(4 N) of a circle with the tension N per length, up."""
    result = solve(Case(film(), rig=under(0.01)), Settings())
    assert result.deflection_m == pytest.approx(-0.01 * B**2 / (4 * STRESS * MOUNTED), rel=1e-6)


def test_sags_by_its_own_weight() -> None:
    """As under the pressure of the mounted film's weight per area."""
    result = solve(Case(film(density=50.0), rig=Rig(gravity=9.80665)), Settings())
    pressure = 50.0 * 9.80665 * MOUNTED
    assert result.deflection_m == pytest.approx(pressure * B**2 / (4 * STRESS * MOUNTED), rel=1e-4)


def test_held_at_its_centre_by_a_pressure() -> None:
    film_model = model(film(density=0.0))
    outcome = held(film_model, 3e-3)
    again = equilibrium(film_model, 0.0, 0.0, outcome.state.pressure)
    assert outcome.status == "equilibrium"
    assert outcome.state.pressure < 0  # the centre is sucked down
    assert film_model.deflection(again.state) == pytest.approx(3e-3, rel=1e-6)


def test_a_balloon_bears_most_at_its_limit_point() -> None:
    result = path(Case(film(prestretch=1.0), rig=under(20.0)), Settings(), "pressure")
    limit = next(event for event in result.events if event.what == "pull_in")
    pressure, apex = highest_pressure(oracle(1.0), 1.2, 3.0)
    assert limit.value == pytest.approx(pressure, rel=1e-6)
    assert limit.station.deflection_m == pytest.approx(-apex, rel=1e-3)
    beyond = solve(Case(film(prestretch=1.0), rig=under(1.001 * pressure)), Settings())
    assert beyond.status == "no_equilibrium"
    assert f"{pressure:.4g} Pa" in beyond.warnings[0]


def test_modes_of_a_circle_are_those_of_a_drum() -> None:
    """f = j_mn c/(2π a), c² = σ/ρ; in pairs where there are nodal diameters."""
    result = modes(Case(film(), rig=STILL), Settings(), 20)
    transverse = [mode for mode in result.modes if mode.name.startswith("film (")]
    speed = np.sqrt(STRESS / DENSITY)
    for mode in transverse:
        order, circles = map(int, mode.name.strip("film ()").split(","))
        exact = jn_zeros(order, circles + 1)[-1] * speed / (2 * np.pi * B)
        assert mode.frequency_Hz == pytest.approx(exact, rel=3e-5)
    names = [mode.name for mode in transverse]
    assert names[:6] == ["film (0, 0)", *2 * ["film (1, 0)"], *2 * ["film (2, 0)"], "film (0, 1)"]
    assert result.plate_mass_kg is None
    assert result.film_mass_kg == pytest.approx(DENSITY * MOUNTED * np.pi * B**2, rel=1e-6)


def test_modes_of_a_rectangle() -> None:
    """f_mn = c/2 √((m/a)² + (n/b)²)."""
    corners = ((-3e-2, -2e-2), (3e-2, -2e-2), (3e-2, 2e-2), (-3e-2, 2e-2))
    result = modes(Case(film(Polygon(corners)), rig=STILL), Settings(), 16)
    speed = np.sqrt(STRESS / DENSITY)
    exact = sorted(speed / 2 * np.hypot(m / 6e-2, n / 4e-2) for m in range(1, 6)
                   for n in range(1, 6))
    transverse = [mode.frequency_Hz for mode in result.modes if mode.name != "film, in plane"]
    assert len(transverse) > 5
    assert transverse == pytest.approx(exact[:len(transverse)], rel=1e-4)


def test_a_voltage_takes_tension_off_a_flat_film() -> None:
    """f(U) = f(0) √(1 − (U/U_t)²), U_t where ε E² is the film's stress; nothing moves."""
    slackening = np.sqrt(STRESS / EPS) * MOUNTED
    reached = limits(Case(film(), rig=STILL), Settings())
    assert reached.tension is not None
    assert reached.pull_in is None
    assert reached.tension.voltage_V == pytest.approx(slackening, rel=1e-6)
    still, charged = (modes(Case(film(), voltage=voltage, rig=STILL), Settings(), 1).modes[0]
                      for voltage in (0.0, 0.8 * slackening))
    assert charged.frequency_Hz == pytest.approx(0.6 * still.frequency_Hz, rel=1e-5)
    assert charged.name == "film (0, 0)"


def test_an_electrode_of_a_third_of_the_radius_pulls_in() -> None:
    """Flat: homogeneous within, beside it what the equations say; to where the voltage is most.

    There short waves of the edge grow, too: one of the two is the limit, at one voltage.
    """
    spot = film(density=0.0, electrode=Electrode(outline=Region(Circle(B / 3))))
    flat = EPS * np.pi * (B / 3) ** 2 / MOUNTED
    for growth in (1.1, 1.3):
        voltage = voltage_at(oracle(), B / 3, growth * ROOT5)
        result = solve(Case(spot, voltage=voltage, rig=STILL), Settings())
        # The electrode keeps its virgin volume: capacitance grows with the square of its area.
        assert result.capacitance_F == pytest.approx(flat * growth**4, rel=2e-4)
        assert result.deflection_m == 0.0
    most = pull_in(oracle(), B / 3, 5.0)[0]
    reached = limits(Case(spot, rig=STILL), Settings()).limit
    assert reached is not None
    assert reached.kind in ("instability", "pull_in")
    assert reached.voltage_V == pytest.approx(most, rel=2e-4)
    assert solve(Case(spot, voltage=1.001 * most, rig=STILL), Settings()).status != "equilibrium"


def test_margins_and_outlines_give_the_same_electrode() -> None:
    parts = (Electrode(margin_frame=2 * B / 3), Electrode(outline=Region(Circle(B / 3))))
    first, second = (solve(Case(film(electrode=part), voltage=4e3, rig=under(50.0)), Settings())
                     for part in parts)
    assert first.deflection_m == pytest.approx(second.deflection_m, rel=1e-6)


def test_air_on_both_sides_by_closed_forms() -> None:
    """Of a piston 2 · 8/3 ρ a³, and 2 · 4/15 ρ a⁵ where it rocks about a diameter; of a drum
    2 · 2πρ ∫ W² dk with its Hankel transform W(k)."""
    disc = whole_disc()
    x, y, _ = disc.reference.T
    root = jn_zeros(0, 1)[0]
    shapes = np.stack([np.ones_like(x), x, j0(root * np.hypot(x, y) / B)])
    volumes = air_volumes(film(), disc, shapes)
    # Of what jumps at the frame the shortest waves are missing.
    assert volumes[0, 0] == pytest.approx(2 * 8 / 3 * B**3, rel=2e-4)
    assert volumes[1, 1] == pytest.approx(2 * 4 / 15 * B**5, rel=6e-4)

    def transformed(k: float) -> float:
        # ∫ J0(j r/a) J0(k r) r dr from 0 to a, where J0(j) = 0; in units of the radius.
        return root * j1(root) * j0(k) / (root**2 - k**2)

    exact = quad(lambda k: transformed(k) ** 2, 0, 200, limit=400)[0]
    assert volumes[2, 2] == pytest.approx(4 * np.pi * B**3 * exact, rel=1e-6)
    assert volumes == pytest.approx(volumes.T)
    assert np.abs(volumes[1, [0, 2]]).max() < 1e-12 * B**4


def test_air_slows_a_film() -> None:
    """By its mass over the film's where the shape is the same; Rayleigh's quotient is above."""
    alone, airy = (modes(Case(film(), rig=replace(STILL, air=air)), Settings(), 3)
                   for air in (0.0, 1.2))
    disc = whole_disc()
    shape = j0(jn_zeros(0, 1)[0] * np.hypot(*disc.reference[:, :2].T) / B)
    air = 1.2 * float(air_volumes(film(), disc, shape[None])[0, 0])
    mass = DENSITY * MOUNTED * np.pi * B**2 * j1(jn_zeros(0, 1)[0]) ** 2
    quotient = alone.modes[0].frequency_Hz / np.sqrt(1 + air / mass)
    assert 0.995 * quotient < airy.modes[0].frequency_Hz <= quotient * (1 + 1e-6)
    assert airy.modes[0].name == "film (0, 0)"


def test_derivatives_of_the_centre() -> None:
    case = Case(film(), voltage=2e3, rig=under(100.0))
    by = sensitivity(case, Settings()).quantities["heave"].by

    def apex(specimen: Specimen) -> float:
        outcome = solve(replace(case, specimen=specimen), Settings())
        assert outcome.deflection_m is not None
        return outcome.deflection_m

    step = 1e-4
    wider, narrower = (apex(film(Circle(B * (1 + sign * step)))) for sign in (1, -1))
    assert by["frame.radius"].derivative == pytest.approx(
        (wider - narrower) / (2 * step * B), rel=1e-5)
    thick, thin = (apex(replace(film(), membrane=replace(film().membrane,
                                                         thickness=T * (1 + sign * step))))
                   for sign in (1, -1))
    assert by["membrane.thickness"].derivative == pytest.approx(
        (thick - thin) / (2 * step * T), rel=1e-5)


@pytest.mark.parametrize("rig", [{"spring": 1.0}, {"unaccounted_mass": 1e-3}, {"guide": "level"},
                                 {"friction": 0.1}, {"plate_pressure": 10.0}])
def test_what_acts_on_a_plate_has_no_place(rig: dict[str, float]) -> None:
    with pytest.raises(InputError, match="no plate"):
        Case(film(), rig=Rig(**rig))


def test_refused_without_a_plate() -> None:
    with pytest.raises(InputError, match="no plate to carry it"):
        Case(film(), mass=1e-3)
    with pytest.raises(InputError, match=r"electrode\.margin_plate.*no plate"):
        film(electrode=Electrode(margin_plate=1e-3))
    with pytest.raises(InputError, match="between the frame and its centre"):
        film(electrode=Electrode(margin_frame=B))
    notched = ((-3e-2, -3e-2), (3e-2, -3e-2), (3e-2, 3e-2), (0.0, -1e-2), (-3e-2, 3e-2))
    with pytest.raises(InputError, match="contain its centre"):
        film(Polygon(notched))
    Specimen("with", Polygon(notched), Plate(Circle(2e-3), (0.0, -2e-2)), film().membrane)


def test_its_centre_stays_where_an_outline_is_far_from_round() -> None:
    slot = film(RoundedRectangle((80e-3, 8e-3), 4e-3))
    result = solve(Case(slot, rig=under(0.1)), Settings())
    # A long strip: w = p b²/(2 N).
    assert result.deflection_m == pytest.approx(-0.1 * 8e-3**2 / (2 * STRESS * MOUNTED),
                                                rel=2e-3)
    assert isinstance(model(slot).discretisation, Discretisation)
