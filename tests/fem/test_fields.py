"""Recovered fields: Fig. 4's claims, balances, and agreement with the axisymmetric ODE away from
the plate too."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.support.models import model
from tests.support.specimens import NEO_HOOKE, ROOT5, circular, elliptical, skewed
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.library import MATERIALS
from tympan.fem.results.fields import Fields, cell_fields, edge_fields
from tympan.geometry.mesh import ELEMENTS
from tympan.studies.study import line_profile

DEFAULT = MATERIALS["vhb-4910"].material
LOAD = 17.9e-3 * 9.80665


@pytest.fixture(scope="module")
def loaded() -> dict[str, tuple]:
    """The paper's three actuators under 17.9 g."""
    specimens = {"circle": circular(DEFAULT), "small": elliptical(60e-3, DEFAULT),
                 "large": elliptical(75e-3, DEFAULT)}
    return {name: (model(item), equilibrium(model(item), LOAD, 0.0).state)
            for name, item in specimens.items()}


def at_plate(fields: Fields) -> np.ndarray:
    """Largest principal stress where a line meets the plate [Pa]."""
    radius = np.linalg.norm(fields.position[:, :2], axis=1)
    return fields.stress_1[np.isclose(radius, 10e-3, rtol=1e-6)]


def flat_stress() -> float:
    return ROOT5 * float(DEFAULT.derivatives(ROOT5, ROOT5)[1])


def test_circle_is_axisymmetric_to_one_percent(loaded) -> None:
    """Both in the stress and in what the load adds to it, which is the harder one."""
    _, fields = line_profile(*loaded["circle"], "plate")
    assert np.ptp(fields.stress_1) < 0.01 * fields.stress_1.mean()
    added = fields.stress_1 - flat_stress()
    assert np.ptp(added) < 0.01 * added.mean()


def test_ellipses_carry_more_on_the_short_axis_and_the_large_one_more_so(loaded) -> None:
    """Fig. 4: at the plate the stress is larger on the short axis (y) than on the long one (x)."""
    ratios = {}
    for name, pair in loaded.items():
        short, long = (at_plate(line_profile(*pair, axis)[1]) for axis in "yx")
        assert len(short) == len(long) == 4 or len(short) == len(long) == 2
        ratios[name] = short.mean() / long.mean()
        added = (short.mean() - flat_stress()) / (long.mean() - flat_stress())
        if name == "circle":
            assert added == pytest.approx(1, abs=0.01)
        else:
            assert added > 1.02
    assert ratios["large"] > ratios["small"] > 1.0001 > ratios["circle"]


def test_deflection_grows_from_circle_to_large_ellipse(loaded) -> None:
    heaves = [loaded[name][1].plate.deflection for name in ("circle", "small", "large")]
    assert heaves == sorted(heaves)
    assert heaves[1] > 1.05 * heaves[0]
    assert heaves[2] > 1.02 * heaves[1]


def test_vertical_traction_around_the_plate_carries_the_weight(loaded) -> None:
    for pair in loaded.values():
        fields, weights = edge_fields(*pair, "plate", 12, quadrature=True)
        force = (fields.plate_traction * weights[:, None]).sum(axis=0)
        assert force == pytest.approx([0, 0, LOAD], rel=1e-3, abs=1e-6)


def test_profiles_follow_the_ode_from_plate_to_frame() -> None:
    film = model(circular(NEO_HOOKE))
    state = held(film, 15e-3, 3000.0).state
    exact = axisymmetric.solve_deflection(
        axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(25e3), 4.7), 15e-3,
        3000.0)
    _, fields = line_profile(film, state, "y")
    radius = np.abs(fields.position[:, 1]).clip(10e-3, 45e-3)
    assert np.allclose(fields.displacement[:, 2], exact.z(radius), atol=2e-6)
    assert np.allclose(fields.stress_radial, exact.total1(radius), rtol=4e-3)
    assert np.allclose(fields.stress_circumferential, exact.total2(radius), rtol=2e-3)
    assert np.allclose(fields.stretch_1, exact.lambda1(radius), rtol=2e-3)
    assert np.allclose(fields.stretch_2, exact.lambda2(radius), rtol=1e-3)
    # Radial is meridional: no shear by symmetry, and the principal pair is that pair.
    assert np.abs(fields.stress_shear).max() < 2e-3 * fields.stress_1.max()


def test_fields_are_consistent_with_each_other(skewed_model) -> None:
    outcome = equilibrium(skewed_model, 0.2, 3000.0)
    [fields] = cell_fields(skewed_model, [outcome.state], ELEMENTS[2].doflocs.T)
    film = skewed().membrane
    assert np.allclose(fields.thickness * fields.stretch_1 * fields.stretch_2, film.thickness,
                       rtol=1e-12)
    assert np.allclose(fields.stress_1 + fields.stress_2,
                       fields.stress_radial + fields.stress_circumferential)
    covered = fields.electric_field > 0
    assert 0.3 < covered.mean() < 0.9
    assert np.allclose(fields.electric_field[covered] * fields.thickness[covered], 3000.0,
                       rtol=1e-12)
    assert np.all(fields.maxwell_stress[~covered] == 0)
    jp = 2.4 * 2.1
    permittivity = 8.8541878128e-12 * 4.7 * (fields.stretch_1 * fields.stretch_2 / jp) ** -0.3
    # −λ ∂ψ/∂λ of −½ ε E² with ε falling as J^(−n) is ε E² (1 − n/2).
    expected = (1 - 0.15) * permittivity * fields.electric_field**2
    assert np.allclose(fields.maxwell_stress, expected, rtol=1e-9)


def test_principal_stress_by_hand_where_the_axes_are_known() -> None:
    """Flat anisotropic film: σ = λ ∂W/∂λ along x and y."""
    specimen = circular(NEO_HOOKE, prestretch=(2.5, 2.0))
    film = model(specimen)
    state = equilibrium(film, 0.0, 0.0).state
    _, fields = line_profile(film, state, "x")
    l3 = 1 / 5
    assert np.allclose(fields.stress_1, 25e3 * (2.5**2 - l3**2), rtol=1e-9)
    assert np.allclose(fields.stress_2, 25e3 * (2.0**2 - l3**2), rtol=1e-9)
    assert np.allclose(fields.stress_radial, fields.stress_1, rtol=1e-9)


def test_asking_for_an_edge_that_is_not_there_says_which_are(loaded) -> None:
    with pytest.raises(ValueError, match="frame"):
        edge_fields(*loaded["circle"], "rim")
