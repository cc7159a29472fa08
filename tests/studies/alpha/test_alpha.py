"""α: the exact simplex fit, cones against Eq. (5), and what the weights must satisfy for any shape.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from tests.support.models import model
from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate
from tympan.studies.alpha import AlphaSettings, LoadGrid, alpha, uncertainty
from tympan.studies.alpha.circles import frame_distances, part_shares, parts_of
from tympan.studies.alpha.simplex import simplex_fit, weight_ranges
from tympan.studies.case import Settings
from tympan.studies.circles import ConeCircle

DEFAULT = MATERIALS["vhb-4910"].material
FEW = AlphaSettings(LoadGrid((17.9e-3,), (0.0, 3e3)), LoadGrid((22e-3,), (1.5e3, 4.5e3)))


@given(st.integers(1, 4), st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_simplex_fit_is_the_minimum(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    forces, target = rng.uniform(0.1, 1, (8, count)), rng.uniform(0, 1.2, 8)
    weights = simplex_fit(forces, target)
    assert weights.min() >= 0
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    slow = minimize(lambda a: np.sum((forces @ a - target) ** 2), np.full(count, 1 / count),
                    bounds=[(0, 1)] * count,
                    constraints={"type": "eq", "fun": lambda a: a.sum() - 1}, method="SLSQP",
                    options={"ftol": 1e-14})
    assert np.sum((forces @ weights - target) ** 2) <= slow.fun * (1 + 1e-7) + 1e-12


def test_cone_force_by_hand() -> None:
    """Eq. (5) written out with neo-Hooke: 2π r z sin θ (σ − ε₀ε_r u² s/z₀²)."""
    specimen = circular()
    y, u, r, width = 5e-3, 3000.0, 10e-3, 35e-3
    s = 1 + (y / width) ** 2
    z0 = 1e-3 / 5
    z, sine = z0 / np.sqrt(s), y / np.sqrt(width**2 + y**2)
    sigma = 25e3 * (5 * s - 1 / (25 * s))
    maxwell = 8.8541878128e-12 * 4.7 / z0**2 * s * u**2
    force = 2 * np.pi * r * z * sine * (sigma - maxwell)
    assert ConeCircle(specimen, 45e-3).force(y, u) == pytest.approx(force, rel=1e-9)


def test_cone_is_softer_than_the_membrane_by_the_known_factor() -> None:
    """(b − a)/(a ln(b/a)) = 2.327 for small deflections of the circle."""
    specimen = circular()
    force = equilibrium(model(specimen), 1e-3, 0.0)
    ratio = 1e-3 / ConeCircle(specimen, 45e-3).force(force.state.plate.deflection, 0.0)
    assert ratio == pytest.approx(35 / (10 * np.log(4.5)), rel=1e-4)


@pytest.mark.parametrize("long", [60e-3, 75e-3])
def test_weights_of_the_paper_s_ellipses(long: float) -> None:
    result = alpha(elliptical(long, DEFAULT), Settings(), FEW)
    assert result.circles == (45e-3, long)
    for weights in [*result.by_basis.values(), result.from_fields]:
        assert sum(weights.alpha) == pytest.approx(1, abs=1e-12)
        assert min(weights.alpha) >= 0
        assert np.isfinite(weights.held_out_error)
    membrane, cone, scaled = (result.by_basis[name] for name in ("membrane", "cone", "cone_scaled"))
    # Membrane circles: the mixture is as good in force as the deflections are alike; unseen loads
    # confirm it.
    assert membrane.fit_error < 1e-3
    assert membrane.held_out_error < 1e-3
    assert 0.4 < membrane.alpha[0] < 0.8
    # Cones as the paper writes them are too soft for any mixture, which must be said.
    assert cone.alpha == (1.0, 0.0)
    assert cone.fit_error > 0.4
    assert any("Eq. (5)" in words for words in result.json("cone")["warnings"])
    assert not any("cone" in words for words in result.warnings)
    assert result.cone_scale == pytest.approx(35 / (10 * np.log(4.5)), rel=5e-3)
    assert scaled.fit_error < 1e-3
    # The share by angle is near one half, more on the short side, and never better than the fit.
    assert 0.5 < result.from_fields.alpha[0] < membrane.alpha[0]
    assert result.from_fields.fit_error >= membrane.fit_error


def test_the_mixture_reproduces_a_mixture() -> None:
    """If a shape's force were that of two circles, the weights would come back: here the circles
    themselves."""
    for radius, expected in ((45e-3, (1.0, 0.0)), (60e-3, (0.0, 1.0))):
        forces = np.array([[ConeCircle(circular(), r).force(y, u) for r in (45e-3, 60e-3)]
                           for y in (1e-3, 4e-3) for u in (0.0, 4e3)])
        target = forces[:, [45e-3, 60e-3].index(radius)]
        assert simplex_fit(forces, target) == pytest.approx(expected, abs=1e-9)


def test_a_circle_is_one_circle() -> None:
    result = alpha(circular(DEFAULT), Settings(), FEW)
    assert result.circles == (45e-3,)
    assert result.by_basis["membrane"].alpha == (1.0,)
    # Both are balanced to 1e-8 of the largest nodal force.
    assert result.by_basis["membrane"].fit_error < 5e-8
    assert "one circle" in result.warnings[0]


def test_a_spring_on_the_rig_changes_no_weight() -> None:
    """It carries some of the weight, of the shape as of its circles: the film's forces are
    compared, not the loads."""
    few = AlphaSettings(LoadGrid((17.9e-3,), (0.0, 3e3)), LoadGrid((), ()))
    free, sprung = (alpha(elliptical(75e-3), Settings(), few, Rig(spring=k)).by_basis["membrane"]
                    for k in (0.0, 20.0))
    assert sprung.alpha == pytest.approx(free.alpha, abs=1e-3)
    assert sprung.fit_error < 1e-4


@pytest.mark.parametrize("pressure", [50.0, -20.0])
def test_circles_stand_for_the_shape_under_gas_too(pressure: float) -> None:
    """Weights are those of the film without gas: what lifts the plate is another number."""
    coarse = Settings(MeshSettings(order=2).refined(0.5))
    result = alpha(elliptical(60e-3), coarse, FEW, Rig(gas_pressure=pressure))
    weights = result.by_basis["membrane"]
    assert weights.fit_error < 1e-5
    assert weights.held_out_error < 5e-3
    plain = alpha(elliptical(60e-3), coarse, FEW).by_basis["membrane"]
    assert weights.alpha[0] == pytest.approx(plain.alpha[0], abs=1e-2)


def test_a_plate_off_centre_is_no_circle_and_says_so() -> None:
    aside = replace(circular(DEFAULT), plate=Plate(Circle(10e-3), (15e-3, 0.0)))
    result = alpha(aside, Settings(), FEW)
    assert result.by_basis["membrane"].fit_error > 0.03
    assert "not a circle in its middle" in result.warnings[0]


def test_a_plate_wider_than_the_circle_is_named() -> None:
    wide = replace(elliptical(75e-3, DEFAULT),
                   plate=Plate(type(elliptical(1.0).frame)((60e-3, 10e-3))))
    with pytest.raises(InputError, match="no circle of radius 45 mm"):
        alpha(wide, Settings(), FEW)


def test_a_weightless_load_is_left_out() -> None:
    rig = Rig(unaccounted_mass=-17.9e-3)
    loads = AlphaSettings(LoadGrid((17.9e-3, 30e-3), (0.0,)), LoadGrid((17.9e-3,), (0.0,)))
    result = alpha(elliptical(60e-3, DEFAULT), Settings(), loads, rig)
    assert "hardly moves" in result.warnings[0]
    assert np.isfinite(result.from_fields.alpha).all()
    assert result.by_basis["membrane"].held_out_error is None


def test_weights_do_not_care_which_way_the_ellipse_lies() -> None:
    lying = elliptical(60e-3, DEFAULT)
    standing = replace(lying, frame=type(lying.frame)((45e-3, 60e-3)))
    a, b = (alpha(item, Settings(), FEW) for item in (lying, standing))
    assert a.circles == b.circles
    assert a.by_basis["membrane"].alpha == pytest.approx(b.by_basis["membrane"].alpha, abs=2e-4)
    assert a.from_fields.alpha == pytest.approx(b.from_fields.alpha, abs=2e-4)


def test_weights_converge_with_the_mesh() -> None:
    coarse, fine = (alpha(elliptical(75e-3, DEFAULT), Settings(MeshSettings().refined(factor)), FEW)
                    for factor in (1.0, 2.0))
    assert coarse.by_basis["membrane"].alpha == pytest.approx(fine.by_basis["membrane"].alpha,
                                                              abs=1e-4)
    assert coarse.from_fields.alpha == pytest.approx(fine.from_fields.alpha, abs=2e-4)


def test_part_shares_of_a_circle_are_halves() -> None:
    film = model(circular(DEFAULT))
    state = equilibrium(film, 0.1755, 2e3).state
    assert part_shares(film, state, parts_of(film.specimen, 2)) == pytest.approx([0.5, 0.5],
                                                                                 abs=1e-4)


def test_loads_beyond_pull_in_are_left_out_and_said() -> None:
    soft = circular(type(DEFAULT)((15e3,), (2.0,)))
    result = alpha(replace(soft, frame=elliptical(60e-3).frame), Settings(),
                   AlphaSettings(LoadGrid((17.9e-3,), (0.0, 5e3, 9e3)),
                                 LoadGrid((17.9e-3,), (9.5e3,))))
    assert any("thins without bound" in words for words in result.warnings)
    assert result.by_basis["membrane"].held_out_error is None
    assert result.by_basis["membrane"].alpha[0] > 0
    with pytest.raises(InputError, match="no equilibrium"):
        alpha(soft, Settings(),
              AlphaSettings(LoadGrid((17.9e-3,), (12e3,)), LoadGrid((17.9e-3,), (0.0,))))


def three(radii: str, count: int = 3) -> AlphaSettings:
    return replace(FEW, circles=count, radii=radii)


@pytest.mark.parametrize("radii", ["semi_axes", "sectors", "fit"])
def test_three_circles_fit_no_worse_than_their_best_two(radii: str) -> None:
    result = alpha(elliptical(75e-3, DEFAULT), Settings(), three(radii))
    assert list(result.circles) == sorted(result.circles)
    assert len(result.circles) == 3
    weights = result.by_basis["membrane"]
    assert sum(weights.alpha) == pytest.approx(1, abs=1e-12)
    assert weights.fit_error < 1e-4
    assert weights.held_out_error < 1e-3
    assert sum(result.from_fields.alpha) == pytest.approx(1, abs=1e-12)
    assert all(low - 1e-9 <= weight <= high + 1e-9
               for weight, (low, high) in zip(weights.alpha, result.ranges, strict=True))
    # Three circles have one number more than the loads tell, which must be said.
    assert result.condition > 100
    assert any("do not determine" in words for words in result.warnings)


def test_one_circle_stands_for_the_ellipse_if_its_radius_is_free() -> None:
    free, between = (alpha(elliptical(75e-3, DEFAULT), Settings(), three(radii, 1))
                     for radii in ("fit", "semi_axes"))
    assert 45e-3 < free.circles[0] < 75e-3
    assert free.by_basis["membrane"].held_out_error < 1e-3
    assert between.circles[0] == pytest.approx((45e-3 * 75e-3)**0.5)
    assert between.by_basis["membrane"].held_out_error > 0.03
    assert "no mixture of circles of 58.09 mm represents this shape" in between.warnings[0]
    assert not any("represents" in words for words in free.warnings)


def test_ranges_hold_exactly_the_mixtures_that_are_as_good() -> None:
    rng = np.random.default_rng(3)
    forces = np.sort(rng.uniform(1, 2, (6, 3)), axis=1)
    truth = np.array([0.5, 0.3, 0.2])
    target, error = forces @ truth, 0.02
    ranges = weight_ranges(forces, target, error)
    tried = rng.dirichlet(np.ones(3), 400_000)
    good = tried[(np.abs(tried @ forces.T / target - 1) <= error).all(axis=1)]
    for (low, high), column in zip(ranges, good.T, strict=True):
        assert low <= column.min() < low + 0.02
        assert high - 0.02 < column.max() <= high


def test_parts_of_an_ellipse_are_its_quarters() -> None:
    """Two parts: within 45° of the short axis and of the long one; the geometric mean over them by
    quadrature."""
    oval = elliptical(75e-3)
    parts, angle = parts_of(oval, 2), 2 * np.pi * (np.arange(7200) + 0.5) / 7200
    assert np.array_equal(parts == 0, np.abs(np.sin(angle)) > np.sqrt(0.5))
    distance = 1 / np.hypot(np.cos(angle) / 75e-3, np.sin(angle) / 45e-3)
    assert frame_distances(oval) == pytest.approx(distance, rel=1e-6)
    radii = alpha(oval, Settings(), three("sectors", 2)).circles
    assert radii == pytest.approx([np.exp(np.log(distance[parts == part]).mean())
                                   for part in (0, 1)], rel=1e-6)


def test_uncertainty_covers_mesh_material_and_loads() -> None:
    oval = elliptical(60e-3, DEFAULT)
    loads = AlphaSettings(LoadGrid((17.9e-3, 22e-3), (0.0, 3e3)), LoadGrid((20e-3,), (1.5e3,)))
    nominal = alpha(oval, Settings(), loads)
    spread = uncertainty(oval, Settings(), loads, Rig(), nominal)
    weight = nominal.by_basis["membrane"].alpha[0]
    assert list(spread) == ["mesh", "material", "loads"]
    for ranges in spread.values():
        assert ranges[0][0] <= weight <= ranges[0][1]
        assert ranges[0][0] + ranges[1][1] == pytest.approx(1, abs=1e-12)
    assert np.ptp(spread["mesh"][0]) < 1e-4
    stiff = replace(oval,
                    membrane=replace(oval.membrane, material=MATERIALS["vhb-4910-gent"].material))
    other = alpha(stiff, Settings(), loads).by_basis["membrane"].alpha[0]
    assert spread["material"][0][0] <= other <= spread["material"][0][1]


@pytest.mark.parametrize(("wrong", "words"), [
    ({"circles": 0}, "circles: given 0"),
    ({"radii": "areas"}, "must be one of semi_axes, sectors, fit"),
    ({"tolerance": 0.0}, "tolerance")])
def test_settings_refuse(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        AlphaSettings(**wrong)
