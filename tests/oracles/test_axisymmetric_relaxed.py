"""The reference with tension-field relaxation: closed form of a fully wrinkled film, two methods,
derivatives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.optimize import brentq

from tests.oracles.axisymmetric import (
    Film,
    Ogden,
    RitzExpansion,
    Solution,
    _plain,
    energy_derivatives,
    neo_hooke,
    shoot_deflection,
    solve_deflection,
)

MU = 25e3
SLACK = Film(10e-3, 45e-3, 1e-3, 0.5, neo_hooke(MU), relaxed=True)


def wrinkled_force(film: Film, mu: float, heave: float) -> float:
    """Force on a film whose meridians are all strings: straight, uniaxial, with mu (l - 1/l²) R =
    constant."""
    length = math.hypot(film.outer - film.inner, heave)
    xi, weight = legendre.leggauss(40)
    radii = film.inner + 0.5 * (film.outer - film.inner) * (1 + xi)

    def stretch(stress: float) -> float:
        return float(brentq(lambda l1: mu * (l1 - l1**-2) - stress, 1.0, 1e3))

    def excess(pull: float) -> float:
        stretches = np.array([stretch(pull / radius) for radius in radii])
        return 0.5 * (film.outer - film.inner) * float(weight
                                                       @ stretches) / film.prestretch - length

    pull = brentq(excess, 0.0, 9 * mu * film.outer, xtol=1e-14)
    return 2 * math.pi * film.thickness / film.prestretch * pull * heave / length


def ritz_force(solution: Solution) -> float:
    """By the other method, started 1 % beside the given solution.

    The kink between taut and wrinkled film keeps polynomials from being resolved to the last digit.
    """
    ritz = RitzExpansion(solution.film, 64)
    cone = 0.5 * solution.deflection * (1 - ritz.xi)
    fields = solution.r(ritz.radius) - ritz.radius, solution.z(ritz.radius) - cone
    start = 1.01 * np.concatenate([np.linalg.lstsq(ritz.bubble, field)[0] for field in fields])
    state = ritz.equilibrium(start, solution.deflection, 0.0)
    assert state is not None
    return state.force


def test_a_film_mounted_slack_hangs_in_straight_meridians() -> None:
    heave = 0.080
    exact = wrinkled_force(SLACK, MU, heave)
    solution = shoot_deflection(SLACK, heave)
    radii = np.linspace(10e-3, 45e-3, 9)
    assert (solution.lambda2(radii) < solution.lambda1(radii) ** -0.5).all()
    assert solution.force == pytest.approx(exact, rel=1e-10)
    assert ritz_force(solution) == pytest.approx(exact, rel=1e-10)


def test_two_methods_agree_where_part_of_the_film_is_wrinkled() -> None:
    film, heave = replace(SLACK, prestretch=0.6), 0.090
    solution = shoot_deflection(film, heave)
    radii = np.linspace(10e-3, 45e-3, 9)
    slack = solution.lambda2(radii) < solution.lambda1(radii) ** -0.5
    assert 0 < slack.sum() < len(radii)
    assert ritz_force(solution) == pytest.approx(solution.force, rel=1e-6)
    assert solution.force > 1.001 * wrinkled_force(film, MU, heave)


def test_derivatives_of_the_relaxed_energy() -> None:
    film = Film(10e-3, 45e-3, 1e-3, math.sqrt(5), Ogden((18.4e3, 210.0), (2.0, 4.0)), 4.7, 0.2,
                relaxed=True)
    l1, l2, q, h = np.array([2.7, 2.9, 1.5]), np.array([2.1, 2.2, 1.6]), 8600.0**2, 1e-5
    psi = energy_derivatives(film, l1, l2, q)
    assert (_plain(film, l1, l2, q).d2 < 0).tolist() == [True, True, False]
    assert psi.d2[:2].tolist() == [0.0, 0.0]
    assert (psi.value <= _plain(film, l1, l2, q).value).all()
    ahead, back = (energy_derivatives(film, l1 + step, l2, q) for step in (h, -h))
    np.testing.assert_allclose((ahead.value - back.value) / (2 * h), psi.d1, rtol=1e-7)
    np.testing.assert_allclose((ahead.d1 - back.d1) / (2 * h), psi.d11, rtol=1e-6)
    ahead, back = (energy_derivatives(film, l1, l2, q * (1 + step)) for step in (h, -h))
    np.testing.assert_allclose((ahead.d1 - back.d1) / (2 * h * q), psi.q1, rtol=1e-6)


def test_a_taut_film_is_not_changed() -> None:
    taut = Film(10e-3, 45e-3, 1e-3, math.sqrt(5), neo_hooke(MU), 4.7)
    assert solve_deflection(replace(taut, relaxed=True), 0.015,
                            4e3).force == solve_deflection(taut, 0.015, 4e3).force
