"""Loss of tension: its state and area in films deformed on purpose, by the axisymmetric ODE, and in
what is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.oracles.unstable import slack_voltage
from tests.support.models import model, pressed_model
from tests.support.specimens import NEO_HOOKE, ROOT5, circular
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import Ogden
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import cell_fields, lost_tension, node_fields
from tympan.geometry.mesh import ELEMENTS
from tympan.studies.case import Case, Settings, solve, state_warnings
from tympan.studies.film_surface import film_surface

FILM = np.pi * (45e-3**2 - 10e-3**2)
SOFT = Ogden((15e3,), (2.0,))


def squeezed(made: Model, stretch: float, slope: float = 0.0, across: float = 1.0,
             voltage: float = 0.0) -> State:
    """The flat film deformed so that its mounted stretch along x is stretch + slope·x, and
    ``across`` along y."""
    reference = made.discretisation.reference
    positions = reference.copy()
    positions[:, 0] = stretch * reference[:, 0] + slope / 2 * reference[:, 0] ** 2
    positions[:, 1] *= across
    return replace(made.mounted(voltage**2), positions=positions)


def left_of(x: float, radius: float) -> float:
    """Area of a disc around the origin left of x."""
    return radius**2 * (np.pi - np.arccos(x / radius)) + x * np.sqrt(radius**2 - x**2)


@pytest.mark.parametrize("wrinkles", [False, True])
@pytest.mark.parametrize("edge", [-20e-3, 3e-3, 12e-3])
def test_area_where_one_direction_has_lost_its_tension(edge: float, wrinkles: bool) -> None:
    """σ_x = μ(λx² − λx⁻²λy⁻²) vanishes at λx = λy^(−1/2): with a stretch linear in x, along a
    straight line."""
    made = replace(model(circular(NEO_HOOKE), symmetry=False), wrinkles=wrinkles)
    slope = 2.5
    state = squeezed(made, ROOT5**-0.5 / ROOT5 - slope * edge, slope)
    exact = left_of(edge, 45e-3) - left_of(min(edge, 10e-3),
                                           10e-3) if edge > -10e-3 else left_of(edge, 45e-3)
    [loss] = lost_tension(made, [state], parts=16)
    assert loss.slack == 0
    # A film that wrinkles keeps a residual tension and so wrinkles a little sooner.
    near = 4e-3 if wrinkles else 2e-3
    assert loss.wrinkled == pytest.approx(exact, rel=near)
    assert loss.share == pytest.approx(exact / FILM, rel=near)
    [fields] = cell_fields(made, [state], ELEMENTS[4].doflocs.T)
    clear = np.abs(fields.position[:, 0] - edge) > (1e-4 if wrinkles else 1e-6)
    expected = np.where(fields.position[:, 0] < edge, Tension.WRINKLED, Tension.TAUT)
    assert np.array_equal(fields.tension[clear], expected[clear])


@pytest.mark.parametrize("wrinkles", [False, True])
@pytest.mark.parametrize("symmetry", [True, False])
def test_film_without_any_tension_is_slack(symmetry: bool, wrinkles: bool) -> None:
    made = replace(model(circular(NEO_HOOKE), symmetry=symmetry), wrinkles=wrinkles)
    loose, taut = lost_tension(made, [squeezed(made, 0.4, across=0.4), squeezed(made, 1.0)])
    assert loose.slack == pytest.approx(FILM, rel=1e-4)
    assert (loose.wrinkled, loose.share) == pytest.approx((0, 1), rel=1e-12)
    assert taut.share == 0


@pytest.mark.parametrize(("excess", "state"), [(0.999, Tension.TAUT), (1.001, Tension.SLACK)])
def test_voltage_that_takes_the_prestress_slackens_the_flat_film(excess: float,
                                                                 state: Tension) -> None:
    """ε E² = μ(λ² − λ⁻⁴) with E = U λ²/T."""
    prestress = 25e3 * (ROOT5**2 - ROOT5**-4)
    voltage = excess * np.sqrt(prestress / (8.8541878128e-12 * 4.7)) * 1e-3 / ROOT5**2
    made = model(circular(NEO_HOOKE))
    assert (node_fields(made, [squeezed(made, 1.0, voltage=voltage)])[0].tension == state).all()


def test_slack_zone_near_pull_in_is_that_of_the_ode() -> None:
    """Neo-Hooke 15 kPa under 17.9 g at 6.8 kV: a ring around the plate is pressed."""
    made = pressed_model(circular(SOFT))
    outcome = equilibrium(made, 17.9e-3 * 9.80665, 6800.0)
    film = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
    exact = axisymmetric.solve_load(film, 17.9e-3 * 9.80665, 6800.0)
    radius = np.linspace(10e-3, 45e-3, 20_001)
    loose = np.minimum(exact.total1(radius), exact.total2(radius)) <= 0
    area = np.pi * (radius[loose][-1] ** 2 - 10e-3**2)
    [loss] = lost_tension(made, [outcome.state])
    assert loss.wrinkled == pytest.approx(area, rel=5e-3)
    assert loss.share == pytest.approx(area / FILM, rel=5e-3)
    assert "wrinkles over" in state_warnings(made, outcome.state)[0]


def test_a_film_that_would_thin_ends_where_the_ode_loses_its_tension() -> None:
    """The same, wrinkling; a case of it says so."""
    reference = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
    exact = slack_voltage(reference, 17.9e-3 * 9.80665, 6750.0)
    for refine in (1.0, 2.0):
        outcome = equilibrium(model(circular(SOFT), refine=refine), 17.9e-3 * 9.80665, 6800.0)
        assert (outcome.status, outcome.thins) == ("no_equilibrium", True)
        assert np.sqrt(outcome.limit) == pytest.approx(exact, rel=5e-4)
    result = solve(Case(circular(SOFT), mass=17.9e-3, voltage=6800.0), Settings())
    assert result.warnings[0].startswith("loss of tension at 6.636 kV")


def test_taut_film_says_so() -> None:
    result = solve(Case(circular(NEO_HOOKE), mass=17.9e-3, voltage=3000.0), Settings())
    assert (result.slack_area_m2, result.slack_share, result.warnings) == (0, 0, ())


def test_warning_tells_slack_from_wrinkled() -> None:
    made = model(circular(NEO_HOOKE))
    for state, words in ((squeezed(made, 0.2), "60.5 cm² of the mounted film (100.00%), most at"),
                         (squeezed(made, 0.4, across=0.4),
                          "60.5 cm² of them slack in all directions")):
        warning, = state_warnings(made, state)
        assert words in warning


def test_stored_state(tmp_path: Path) -> None:
    made = replace(model(circular(NEO_HOOKE), refine=0.7, order=2, symmetry=False),
                   wrinkles=False)
    film_surface(made, squeezed(made, 0.45, 5.0)).save(tmp_path / "film.vtu")
    stored = meshio.read(tmp_path / "film.vtu").point_data
    assert set(np.unique(stored["tension"])) == {Tension.TAUT, Tension.WRINKLED}
    assert np.array_equal(stored["tension"] > 0, stored["stress_2"] <= 0)
