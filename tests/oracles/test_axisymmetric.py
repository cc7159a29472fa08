"""Checks of the axisymmetric reference against published values, closed forms and a second method.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import legendre

from tests.oracles.axisymmetric import (
    EnergyFunction,
    Film,
    Material,
    NoEquilibrium,
    Ogden,
    Solution,
    neo_hooke,
    pull_in,
    pull_in_voltage,
    shoot_deflection,
    solve_deflection,
    solve_load,
)
from tympan.base.arrays import Array

A, B, T, LP, EPSR = 0.010, 0.045, 1e-3, math.sqrt(5.0), 4.7
GRAVITY = 9.81
EPS0_ROUNDED = 8.854e-12  # used by the published load-controlled values
OGDEN = Ogden((30e3, 2e3), (1.3, 5.5))
RADII = np.linspace(A, B, 15)


def film(material: Material, eps0: float = 8.8541878128e-12, exponent: float = 0.0,
         lp: float = LP) -> Film:
    return Film(A, B, T, lp, material, EPSR, exponent, eps0)


# --- published values
# -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mu", "grams", "kilovolt", "millimetre"),
    [
        (20e3, 17.9, 0.0, 2.1185),
        (20e3, 17.9, 3.5, 2.4307),
        (20e3, 17.9, 5.0, 2.8717),
        (20e3, 17.9, 7.0, 4.3843),
        (20e3, 22.45, 0.0, 2.6569),
        (20e3, 22.45, 3.5, 3.0484),
        (20e3, 22.45, 5.0, 3.6018),
        (20e3, 22.45, 7.0, 5.5194),
        (15e3, 17.9, 0.0, 2.8245),
        (15e3, 17.9, 3.5, 3.4083),
        (15e3, 17.9, 5.0, 4.3477),
    ],
)
def test_published_deflection_under_load(mu: float, grams: float, kilovolt: float,
                                         millimetre: float) -> None:
    force = grams * 1e-3 * GRAVITY
    solution = solve_load(film(neo_hooke(mu), EPS0_ROUNDED), force, kilovolt * 1e3)
    assert solution.deflection * 1e3 == pytest.approx(millimetre, abs=5.01e-5)
    assert solution.force == pytest.approx(force, rel=1e-12)
    assert solution.stable
    assert solution.stable_held


def test_published_loss_of_equilibrium() -> None:
    with pytest.raises(NoEquilibrium) as caught:
        solve_load(film(neo_hooke(15e3), EPS0_ROUNDED), 17.9e-3 * GRAVITY, 7e3)
    assert caught.value.past_limit
    assert caught.value.limit_force == pytest.approx(0.13855535, rel=1e-7)
    assert caught.value.limit_force < 17.9e-3 * GRAVITY


@pytest.mark.parametrize(
    ("material", "millimetre", "kilovolt", "force", "l1", "sigma1", "sigma2"),
    [
        (neo_hooke(25e3), 5.0, 0.0, 0.51826859, 2.35424, 137.6593, 124.0979),
        (neo_hooke(25e3), 5.0, 3.0, 0.47914090, 2.36190, 138.5683, 124.1037),
        (neo_hooke(25e3), 15.0, 0.0, 1.55855384, 3.14891, 247.3867, 124.4957),
        (OGDEN, 5.0, 0.0, 1.07485662, 2.31715, 289.2795, 249.0490),
        (OGDEN, 15.0, 0.0, 4.01666125, 2.74422, 624.2382, 249.7469),
    ],
)
def test_published_prescribed_deflection(
    material: Material,
    millimetre: float,
    kilovolt: float,
    force: float,
    l1: float,
    sigma1: float,
    sigma2: float,
) -> None:
    solution = solve_deflection(film(material), millimetre * 1e-3, kilovolt * 1e3)
    assert solution.force == pytest.approx(force, abs=5.01e-9)
    assert float(solution.lambda1(A)) == pytest.approx(l1, abs=5.01e-6)
    assert float(solution.lambda2(A)) == pytest.approx(LP, rel=1e-13)
    assert float(solution.sigma1(A)) * 1e-3 == pytest.approx(sigma1, abs=1.01e-4)
    assert float(solution.sigma2(A)) * 1e-3 == pytest.approx(sigma2, abs=1.01e-4)


# --- two methods
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("case", "deflection", "voltage"),
    [
        (film(neo_hooke(25e3)), 0.005, 0.0),
        (film(neo_hooke(25e3)), 0.005, 3e3),
        (film(neo_hooke(25e3)), 0.060, 0.0),
        (film(neo_hooke(15e3)), 0.008, 7e3),
        (film(OGDEN), 0.005, 0.0),
        (film(OGDEN), 0.020, 8e3),
        (film(OGDEN), 0.060, 0.0),
        (film(OGDEN, exponent=0.3), 0.010, 5e3),
        (film(neo_hooke(25e3), exponent=2.0), 0.010, 5e3),
        (film(neo_hooke(25e3), lp=1.0), 0.005, 0.0),
        (Film(0.001, 0.05, 0.5e-3, 3.0, OGDEN, 3.2), 0.012, 2e3),
    ],
)
def test_ritz_and_shooting_agree(case: Film, deflection: float, voltage: float) -> None:
    ritz = solve_deflection(case, deflection, voltage)
    shot = shoot_deflection(case, deflection, voltage)
    radii = np.linspace(case.inner, case.outer, 15)
    assert shot.force == pytest.approx(ritz.force, rel=1e-10)
    assert shot.energy == pytest.approx(ritz.energy, rel=1e-10)
    for name in ("lambda1", "lambda2", "r", "sigma1", "sigma2"):
        np.testing.assert_allclose(getattr(shot, name)(radii), getattr(ritz, name)(radii),
                                   rtol=1e-8)
    np.testing.assert_allclose(shot.z(radii), ritz.z(radii), rtol=0.0, atol=1e-9 * deflection)


# --- closed forms
# -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("voltage", [0.0, 6e3])
@pytest.mark.parametrize("material", [neo_hooke(25e3), OGDEN])
@pytest.mark.parametrize("exponent", [0.0, 0.5])
def test_small_deflection(material: Material, voltage: float, exponent: float) -> None:
    case = film(material, exponent=exponent)
    deflection = 1e-6
    expected = case.small_deflection_force(deflection, voltage)
    for solution in (
        solve_deflection(case, deflection, voltage),
        shoot_deflection(case, deflection, voltage),
    ):
        assert solution.force == pytest.approx(expected, rel=1e-7)
    loaded = solve_load(case, expected, voltage)
    assert loaded.deflection == pytest.approx(deflection, rel=1e-7)


def test_small_deflection_constant_of_neo_hooke() -> None:
    # true stress mu (lp^2 - lp^-4) less Maxwell stress eps (U lp^2 / T)^2, on the mounted thickness
    # T / lp^2
    mu, voltage, eps0 = 25e3, 6e3, 8.8541878128e-12
    stress = mu * (LP**2 - LP**-4) - eps0 * EPSR * (voltage * LP**2 / T) ** 2
    expected = 2.0 * math.pi * stress * T / LP**2 * 1e-4 / math.log(B / A)
    assert film(neo_hooke(mu)).small_deflection_force(1e-4, voltage) == pytest.approx(expected,
                                                                                      rel=1e-13)


def test_quadratic_energy_is_solved_exactly() -> None:
    """``W = mu / 2 (l1^2 + l2^2)`` decouples: r = R and ``F = 2 pi mu T w / ln(b / a)`` for any w.
    """
    mu, deflection = 25e3, 0.1
    material = EnergyFunction(
        lambda l1, l2: 0.5 * mu * (l1**2 + l2**2), lambda l1, l2: mu * l1, lambda l1, l2: mu * l2
    )
    solution = solve_deflection(film(material), deflection)
    log = math.log(B / A)
    assert solution.force == pytest.approx(2.0 * math.pi * mu * T * deflection / log, rel=1e-12)
    np.testing.assert_allclose(solution.r(RADII), RADII, rtol=1e-12)
    np.testing.assert_allclose(solution.z(RADII), deflection * np.log(B / RADII) / log, atol=1e-13)
    stretch = LP * np.sqrt(1.0 + (deflection / (RADII * log)) ** 2)
    np.testing.assert_allclose(solution.lambda1(RADII), stretch, rtol=1e-12)


# --- internal consistency
# ---------------------------------------------------------------------------------


def quadrature(solution: Solution, scale: float) -> tuple[Array, Array]:
    """Radii and weights [J per Pa of energy density] of a Gauss rule over the film volume."""
    xi, weight = legendre.leggauss(60)
    half = 0.5 * (solution.film.outer - solution.film.inner)
    radii = solution.film.inner + half * (1.0 + xi)
    return radii, 2.0 * math.pi * radii * half * weight * scale


def test_energy_is_the_potential_of_force_and_charge() -> None:
    case, w, voltage = film(OGDEN, exponent=0.4), 0.012, 6e3
    middle = solve_deflection(case, w, voltage)
    h = 1e-5
    slope = (
        solve_deflection(case, w + h, voltage).energy - solve_deflection(case, w - h,
                                                                         voltage).energy
    ) / (2.0 * h)
    assert slope == pytest.approx(middle.force, rel=1e-6)
    forces = [solve_deflection(case, w + s * h, voltage).force for s in (-1.0, 1.0)]
    assert (forces[1] - forces[0]) / (2.0 * h) == pytest.approx(middle.stiffness, rel=1e-6)

    radii, weight = quadrature(middle, T / LP**2)
    l1, l2 = middle.lambda1(radii), middle.lambda2(radii)
    permittivity = case.eps0 * EPSR * (l1 * l2 / LP**2) ** -0.4
    charge = float(weight @ (permittivity * (l1 * l2 / T) ** 2)) * voltage
    elastic = float(weight @ OGDEN.energy(l1, l2))
    assert middle.energy == pytest.approx(elastic - 0.5 * charge * voltage, rel=1e-11)
    h = 1.0
    slope = (
        solve_deflection(case, w, voltage + h).energy - solve_deflection(case, w,
                                                                         voltage - h).energy
    ) / (2.0 * h)
    assert -slope == pytest.approx(charge, rel=1e-6)


def test_axial_equilibrium_on_every_circle() -> None:
    solution = solve_deflection(film(OGDEN), 0.020, 8e3)
    radii, h = RADII[1:-1], 1e-6
    slope = (solution.z(radii + h) - solution.z(radii - h)) / (2.0 * h)
    sine = -slope * LP / solution.lambda1(radii)
    thickness = T / (solution.lambda1(radii) * solution.lambda2(radii))
    force = 2.0 * math.pi * solution.r(radii) * thickness * solution.total1(radii) * sine
    np.testing.assert_allclose(force, solution.force, rtol=1e-7)


def test_ogden_derivatives() -> None:
    numeric = EnergyFunction(OGDEN.energy, OGDEN.w1, OGDEN.w2)
    l1, l2, h = np.array([1.2, 2.3, 4.0]), np.array([1.9, 2.2, 1.4]), 1e-5
    for name in ("w11", "w12", "w22"):
        np.testing.assert_allclose(
            getattr(numeric, name)(l1, l2), getattr(OGDEN, name)(l1, l2), rtol=1e-9, atol=1e-6
        )
    np.testing.assert_allclose(
        (OGDEN.energy(l1 + h, l2) - OGDEN.energy(l1 - h, l2)) / (2.0 * h), OGDEN.w1(l1, l2),
        rtol=1e-8
    )
    np.testing.assert_allclose(
        (OGDEN.energy(l1, l2 + h) - OGDEN.energy(l1, l2 - h)) / (2.0 * h), OGDEN.w2(l1, l2),
        rtol=1e-8
    )


def test_energy_function_matches_ogden() -> None:
    given = EnergyFunction(OGDEN.energy, OGDEN.w1, OGDEN.w2)
    force = solve_deflection(film(OGDEN), 0.01, 5e3).force
    assert solve_deflection(film(given), 0.01, 5e3).force == pytest.approx(force, rel=1e-12)


def test_boundary_conditions_and_symmetry() -> None:
    up, down = (solve_deflection(film(OGDEN), s * 0.007, 4e3) for s in (1.0, -1.0))
    assert down.force == -up.force
    np.testing.assert_allclose(down.z(RADII), -up.z(RADII), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(up.r([A, B]), [A, B], rtol=1e-14)
    np.testing.assert_allclose(up.z([A, B]), [0.007, 0.0], rtol=0.0, atol=1e-16)
    with pytest.raises(ValueError, match="outside"):
        up.r(0.009)


def test_unloaded_film_stays_flat() -> None:
    solution = solve_load(film(neo_hooke(25e3)), 0.0, 3e3)
    assert solution.deflection == 0.0
    assert solution.force == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(solution.lambda1(RADII), LP, rtol=1e-13)
    np.testing.assert_allclose(solution.lambda2(RADII), LP, rtol=1e-13)


# --- pull-in
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mu", "grams", "voltage"),
    [(20e3, 17.9, 8122.80407), (20e3, 22.45, 7938.12952), (15e3, 17.9, 6828.82824)],
)
def test_pull_in_is_the_largest_voltage_with_equilibrium(mu: float, grams: float,
                                                         voltage: float) -> None:
    case, force = film(neo_hooke(mu), EPS0_ROUNDED), grams * 1e-3 * GRAVITY
    fold = pull_in(case, force)
    assert pull_in_voltage(case, force) == fold.voltage
    assert fold.voltage == pytest.approx(voltage,
                                         rel=1e-8)  # regression of this module, not published
    assert fold.force == pytest.approx(force, rel=1e-10)

    below = solve_load(case, force, fold.voltage * (1.0 - 1e-6))
    assert below.stable
    assert below.deflection < fold.deflection
    with pytest.raises(NoEquilibrium) as caught:
        solve_load(case, force, fold.voltage * (1.0 + 1e-6))
    assert caught.value.past_limit
    assert caught.value.limit_deflection == pytest.approx(fold.deflection, rel=1e-4)


def test_force_has_its_maximum_at_the_limit_point() -> None:
    """The shooting method, which knows no stability, sees the same maximum of F(w)."""
    case = film(neo_hooke(15e3), EPS0_ROUNDED)
    with pytest.raises(NoEquilibrium) as caught:
        solve_load(case, 1.0, 7e3)
    limit = caught.value
    h = 5e-5
    before, top, after = (shoot_deflection(case, limit.limit_deflection + s * h, 7e3).force
                          for s in (-1, 0, 1))
    assert top == pytest.approx(limit.limit_force, rel=1e-10)
    assert before < top > after
    assert not solve_deflection(case, limit.limit_deflection + h, 7e3).stable


def test_held_plate_has_a_limit_of_its_own() -> None:
    with pytest.raises(NoEquilibrium):
        solve_deflection(film(neo_hooke(15e3), EPS0_ROUNDED), 0.0095, 7e3)


def test_stiffening_film_has_no_pull_in() -> None:
    with pytest.raises(NoEquilibrium) as caught:
        pull_in(film(OGDEN), 0.5)
    assert not caught.value.past_limit


def test_unreached_force_is_told_from_pull_in() -> None:
    with pytest.raises(NoEquilibrium) as caught:
        solve_load(film(neo_hooke(25e3)), 1.0, max_deflection=0.005)
    assert not caught.value.past_limit
    assert caught.value.limit_deflection == pytest.approx(0.005)


def test_flat_film_unstable() -> None:
    with pytest.raises(NoEquilibrium, match="flat"):
        solve_load(film(neo_hooke(25e3)), 0.1, 20e3)


def test_invalid_arguments() -> None:
    with pytest.raises(ValueError, match="inner"):
        Film(0.045, 0.010, T, LP, OGDEN)
    with pytest.raises(ValueError, match="positive"):
        Film(A, B, 0.0, LP, OGDEN)
    with pytest.raises(ValueError, match="equal length"):
        Ogden((1.0, 2.0), (2.0,))
    with pytest.raises(ValueError, match="zero"):
        Ogden((1.0,), (0.0,))
    with pytest.raises(ValueError, match="pull-in"):
        pull_in_voltage(Film(A, B, T, LP, OGDEN), 0.1)
