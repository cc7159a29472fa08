"""A film that wrinkles: derivatives, continuity and convexity of the tension field; a plate on it
against an ODE."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import tympan.fem.film.density
from tests.oracles.axisymmetric import energy_derivatives
from tests.oracles.laws import SAMPLES
from tests.support.models import model
from tests.support.specimens import NEO_HOOKE, circular, reference_film
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.density import Maxwell
from tympan.fem.film.tension_field import TensionField, total

KAPPA = 20.0
#: Stretches that are taut, wrinkled and slack in a film whose natural state is the virgin one.
PLACES = [(1.5, 1.3), (1.1, 1.02), (1.5, 0.7), (2.0, 0.4), (1.2, 0.91), (0.9, 0.8), (0.7, 0.5),
          (0.95, 0.95)]


def virgin(law) -> float:
    """Stretch at which a law is free of stress: 1, or that of laws referred to the mounted film."""
    def stress(stretch: float) -> float:
        return float(law.derivatives(np.array(stretch), np.array(stretch))[1])

    return 1.0 if abs(stress(1.0)) < 1.0 else float(brentq(stress, 1.01, 2.5))


def kind(law, l1: float, l2: float) -> str:
    """What a film without voltage does, by uniaxial tension worked out on its own."""
    free = virgin(law)

    def across(width: float) -> float:
        return float(law.derivatives(np.array(l1), np.array(width))[2]) - KAPPA * width

    if float(law.derivatives(np.array(l1), np.array(l2))[2]) >= KAPPA * l2:
        return "taut"
    width = brentq(across, l2, 2 * max(l1, free))
    return "slack" if width > l1 else "wrinkled"


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_derivatives_in_every_regime_are_the_complex_step_s(name: str) -> None:
    law = SAMPLES[name].law
    field, free, step = TensionField((law,), KAPPA), virgin(law), 1e-30
    seen = set()
    for along, across in PLACES:
        l1, l2 = along * free, across * free
        seen.add(kind(law, l1, l2))
        exact = field.derivatives(np.array(l1), np.array(l2))
        first = field.derivatives(np.array(l1 + 1j * step), np.array(l2 + 0j))
        second = field.derivatives(np.array(l1 + 0j), np.array(l2 + 1j * step))
        got = [value.imag / step for value in (first[0], second[0], first[1], second[1], second[2])]
        scale = float(abs(law.derivatives(np.array(free), np.array(free))[3]))
        assert np.allclose(got, exact[1:], rtol=1e-9, atol=1e-9 * scale), (along, across)
    assert seen == {"taut", "wrinkled", "slack"}


@pytest.mark.parametrize("voltage_part", [0.02, 0.2])
def test_derivatives_with_a_low_voltage(voltage_part: float) -> None:
    """By the stretches and by U², at a field that takes a part of the film's modulus."""
    law, step = SAMPLES["neo_hooke"].law, 1e-30
    charge = voltage_part * 20e3

    def at(l1, l2, amount):  # type: ignore[no-untyped-def]
        field = TensionField((law, Maxwell(amount, 2.0)), KAPPA)
        return field.derivatives(np.array(l1), np.array(l2))

    for l1, l2 in ((1.5, 1.3), (1.5, 0.7), (0.9, 0.8)):
        exact = at(l1, l2, charge)
        by_l1, by_l2 = at(l1 + 1j * step, l2, charge), at(l1, l2 + 1j * step, charge)
        got = [part.imag / step for part in (by_l1[0], by_l2[0], by_l1[1], by_l2[1], by_l2[2])]
        assert np.allclose(got, exact[1:], rtol=1e-9, atol=1e-5)
        by_voltage = at(l1, l2, charge + 1j * step)
        ahead, back = at(l1, l2, charge * 1.0001), at(l1, l2, charge * 0.9999)
        for index in (0, 1):
            slope = (ahead[index] - back[index]) / (2e-4 * charge)
            assert by_voltage[index].imag / step == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_energy_and_stress_are_continuous_between_regimes(name: str) -> None:
    """Along lines through all three, no jump: changes fall with the step."""
    law = SAMPLES[name].law
    field, free = TensionField((law,), KAPPA), virgin(law)
    for start, end in (((1.5, 1.3), (1.5, 0.3)), ((1.6, 0.7), (0.8, 0.6)),
                       ((1.2, 1.19), (0.8, 0.79))):
        jumps = []
        for count in (2000, 4000):
            share = np.linspace(0, 1, count + 1)
            l1, l2 = ((1 - share) * a + share * b for a, b in zip(start, end, strict=True))
            values = np.stack(field.derivatives(free * l1, free * l2)[:3])
            jumps.append(np.abs(np.diff(values)).max(axis=1))
        assert np.allclose(jumps[1], jumps[0] / 2, rtol=0.05)


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_a_wrinkling_film_is_convex_and_in_tension(name: str) -> None:
    """Without voltage: no compression, a positive tangent where loose, and never more energy than
    the film's own."""
    law = SAMPLES[name].law
    field, free = TensionField((law,), KAPPA), virgin(law)
    l1, l2 = (grid.ravel() * free for grid in np.meshgrid(np.linspace(0.5, 1.8, 40),
                                                          np.linspace(0.3, 1.8, 40)))
    l1, l2 = np.maximum(l1, l2), np.minimum(l1, l2)
    plain = law.derivatives(l1, l2)
    w, w1, w2, w11, w12, w22 = field.derivatives(l1, l2)
    assert (np.minimum(w1 / l1, w2 / l2) > 0.999 * KAPPA).all()
    # The envelope keeps ½κ(λ₁² + λ₂²) apart, which the film has in its energy already.
    reached = np.isfinite(plain[0])
    assert (w <= plain[0] + 1e-9 * np.abs(plain[0][reached]).max())[reached].all()
    loose = ~(plain[2] >= KAPPA * l2)
    assert loose.any()
    assert (w11[loose] > 0).all()
    assert (w11 * w22 - w12**2)[loose].min() > 0


def wrinkled_force(prestretch: float, heave: float) -> float:
    """Force on the plate of a relaxed neo-Hookean film, its hoop tension never below zero; by
    shooting."""
    film = reference_film(NEO_HOOKE, prestretch=prestretch)
    mu, span = 25e3, film.log_ratio

    def parts(l1: float, l2: float) -> tuple[float, float, float, float]:
        width = l1**-0.5
        if l2 > width:
            psi = energy_derivatives(film, np.float64(l1), np.float64(l2), 0.0)
            return float(psi.d1), float(psi.d2), float(psi.d11), float(psi.d12)
        return mu * (l1 - l1**-2), 0.0, mu * (1 + 2 * l1**-3), 0.0

    def rate(x: float, y: np.ndarray) -> list[float]:
        l1, l2, slope, _ = y
        d1, d2, d11, d12 = parts(l1, l2)
        l2_x = l1 * math.cos(slope) - l2
        return [(d2 * math.cos(slope) - d1 - d12 * l2_x) / d11, l2_x, -d2 / d1 * math.sin(slope),
                -math.exp(x) * l1 * math.sin(slope) / prestretch]

    def miss(start: np.ndarray) -> np.ndarray:
        first = [start[0], prestretch, start[1], heave / film.inner]
        end = solve_ivp(rate, (0.0, span), first, rtol=1e-9, atol=1e-11, max_step=0.05).y[:, -1]
        return np.array([end[1] / prestretch - 1, end[3]])

    slope = heave / (film.outer - film.inner)
    start = np.array([1.3 * prestretch * math.hypot(1, slope), math.atan(slope)])
    for _ in range(40):
        error = miss(start)
        columns = [(miss(start + shift) - error) / 1e-6 for shift in 1e-6 * np.eye(2)]
        step = np.linalg.solve(np.column_stack(columns), error)
        start = start - step * min(1.0, 0.2 / np.abs(step).max())
        if np.abs(step).max() < 1e-9:
            break
    else:
        raise ArithmeticError("shooting did not converge")
    rim = parts(start[0], prestretch)[0]
    return 2 * math.pi * film.inner * film.thickness / prestretch * rim * math.sin(start[1])


@pytest.mark.parametrize("prestretch", [1.0, 1.05, 1.1])
def test_a_plate_on_a_film_with_little_prestretch_is_the_ode_s(prestretch: float,
                                                               monkeypatch) -> None:
    """Pushed 15 mm; the error falls with the residual tension."""
    exact = wrinkled_force(prestretch, 15e-3)
    film = replace(model(circular(prestretch=(prestretch, prestretch)), refine=2.0), wrinkles=True)
    errors = []
    for residual in (1e-3, 1e-4):
        monkeypatch.setattr(tympan.fem.film.density, "_RESIDUAL", residual)
        outcome = held(film, 15e-3)
        assert outcome.status == "equilibrium"
        errors.append(abs(outcome.state.force / exact - 1))
    assert errors[1] < 1e-3
    assert errors[1] < max(0.3 * errors[0], 2e-5), errors


def test_a_loose_film_without_natural_width_thins() -> None:
    """With c λ₁² > μ a neo-Hookean film under voltage thins without end once it is loose."""
    law, charge = SAMPLES["neo_hooke"].law, 5e3
    materials = law, Maxwell(charge, 2.0)
    field = TensionField(materials, KAPPA)
    # n⁴ = 1/(l² (1 − c l²/μ)), without residual tension.
    bound = math.sqrt(20e3 / charge)
    far = np.array(1.05 * bound), np.array(0.6)
    assert field.thinning_margin(*far) < 0
    assert field.derivatives(*far) == total(materials, *far)
    stretch = 0.9 * bound
    width = (1 / (stretch**2 * (1 - charge * stretch**2 / 20e3))) ** 0.25
    assert field.stretches(np.array(stretch), np.array(0.9 * width))[1] == pytest.approx(
        width, rel=2e-2)


def relaxed_energy(stretch: float, share: float) -> float:
    """Of a neo-Hookean film at its natural width, in moduli; ``share`` is c/μ."""
    return stretch**2 / 2 + math.sqrt(stretch**-2 - share)


@pytest.mark.parametrize("share", [0.1, 0.25])
def test_the_margin_to_thinning_is_the_relaxed_energy_s_curvature(share: float) -> None:
    field = TensionField((SAMPLES["neo_hooke"].law, Maxwell(share * 20e3, 2.0)), 1e-3)
    for stretch in np.linspace(1.1, 0.97 * share**-0.5, 9):
        step = 1e-4
        ahead, here, back = (relaxed_energy(stretch + shift, share) for shift in (step, 0, -step))
        curvature = 20e3 * (ahead - 2 * here + back) / step**2
        margin = float(field.thinning_margin(np.array(stretch), np.array(0.7)))
        if curvature > 0:
            assert margin == pytest.approx(curvature, rel=1e-4)
        else:
            assert margin < 0
