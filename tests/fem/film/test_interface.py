"""The line between two films against short waves: closed forms, and waves that are computed."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.fem.film.interface import Side, impedance, interface_margin, moduli

#: A film that is stiffer along one skew direction, at no stress.
SKEW = np.array([[5.0, 1.2, 0.7], [1.2, 2.0, 0.3], [0.7, 0.3, 1.1]])


def side(c: tuple[float, float, float], stress: tuple[float, float, float], bend: np.ndarray
         ) -> Side:
    return Side((np.array([c[0]]), np.array([c[1]]), np.array([c[2]])), np.array([stress]),
                bend[None])


def energy_of_waves(stiffness: np.ndarray, depth: float = 12.0, elements: int = 600) -> np.ndarray:
    """Half-plane under a wave of its edge of unit wave number, its film below solved for.

    Linear elements along the depth of both components' complex amplitudes, the far end held.
    """
    size = depth / elements
    q = stiffness[:, 1, :, 1]
    r = stiffness[:, 1, :, 0]
    t = stiffness[:, 0, :, 0]
    values, slopes = np.array([0.5, 0.5]), np.array([-1, 1]) / size
    full = np.zeros((2 * elements + 2,) * 2, dtype=complex)
    for number in range(elements):
        block = np.zeros((4, 4), dtype=complex)
        for i in range(2):
            for j in range(2):
                mass = size / 6 * (2 if i == j else 1)
                block[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = (
                    size * slopes[i] * slopes[j] * q + mass * t
                    + 1j * size * slopes[i] * values[j] * r
                    - 1j * size * values[i] * slopes[j] * r.T)
        full[2 * number : 2 * number + 4, 2 * number : 2 * number + 4] += block
    inner = slice(2, 2 * elements)
    return np.asarray(full[:2, :2] - full[:2, inner] @ np.linalg.solve(
        full[inner, inner], full[inner, :2]))


def of_skew() -> np.ndarray:
    stressed = side((1.3, 0.9, 0.1), (0.4, 0.2, -0.05), SKEW)
    return moduli(stressed, np.array([[np.cos(0.4), np.sin(0.4)]]))[0]


def test_an_isotropic_half_plane_has_the_impedance_of_the_closed_form() -> None:
    """2 μ/(3 − 4 ν) (2 (1 − ν) on the diagonal, ∓ i (1 − 2 ν) beside it)."""
    mu, nu = 2.0, 0.3
    lame, one = 2 * mu * nu / (1 - 2 * nu), np.eye(2)
    stiffness = lame * np.einsum("iJ,kL->iJkL", one, one) + mu * (
        np.einsum("ik,JL->iJkL", one, one) + np.einsum("iL,kJ->iJkL", one, one))
    real, imaginary = impedance(stiffness[None])
    assert real[0] == pytest.approx(4 * mu * (1 - nu) / (3 - 4 * nu) * one, abs=1e-12)
    assert imaginary[0] == pytest.approx(-2 * mu * (1 - 2 * nu) / (3 - 4 * nu), rel=1e-12)


def test_impedance_is_that_of_waves_computed_below_the_edge() -> None:
    stiffness = of_skew()
    real, imaginary = impedance(stiffness[None])
    assert np.linalg.eigvalsh(stiffness.reshape(4, 4)).min() > 0
    waves = energy_of_waves(stiffness)
    assert waves.real == pytest.approx(real[0], rel=2e-3)
    assert abs(waves[0, 1].imag) == pytest.approx(abs(imaginary[0]), rel=5e-3)


def test_impedance_does_not_depend_on_the_edge_s_direction() -> None:
    """The moduli turn with the line, and the impedance with them."""
    film = side((1.3, 0.9, 0.1), (0.4, 0.2, -0.05), SKEW)
    least = []
    for angle in (0.0, 0.7, 2.1):
        along = np.array([[np.cos(angle), np.sin(angle)]])
        real, imaginary = impedance(moduli(film, along))
        least.append((np.linalg.eigvalsh(real[0]), imaginary[0]))
    for values, imaginary in least[1:]:
        assert values == pytest.approx(least[0][0], rel=1e-6)
        assert imaginary == pytest.approx(least[0][1], rel=1e-6)


def test_a_free_edge_pressed_along_gives_way_where_computed_waves_do() -> None:
    """A membrane of W = μ (λ₁² + λ₂² + λ₁⁻² λ₂⁻²)/2, flat, beside nearly nothing."""
    def film(stretch: float) -> Side:
        across = stretch**-0.5
        l1, l2 = stretch**2, across**2
        j = l1 * l2
        # ψ(C) = (C₁₁ + C₂₂ + 1/det C)/2: S = 2 ∂ψ/∂C, D = 4 ∂²ψ/∂C∂C with det's derivatives.
        stress = (1 - 1 / (j * l1), 1 - 1 / (j * l2), 0.0)
        bend = np.array([[4 / (j * l1 * l1), 2 / (j * l1 * l2), 0],
                         [2 / (j * l1 * l2), 4 / (j * l2 * l2), 0],
                         [0, 0, 1 / (j * j)]])
        return side((l1, l2, 0.0), stress, bend)

    along = np.array([[1.0, 0.0]])
    vacuum = side((1.0, 1.0, 0.0), (0.0, 0.0, 0.0), 1e-9 * SKEW)

    def by_waves(stretch: float) -> float:
        return float(np.linalg.eigvalsh(energy_of_waves(moduli(film(stretch), along)[0]))[0])

    assert interface_margin([film(1.0), vacuum], along)[0] > 0
    assert by_waves(1.0) > 0
    low, high = 0.3, 1.0
    for _ in range(30):
        middle = (low + high) / 2
        held = interface_margin([film(middle), vacuum], along)[0] > 0
        low, high = (low, middle) if held else (middle, high)
    assert by_waves(1.02 * high) > 0 > by_waves(0.98 * high)


def test_margin_has_derivatives_by_complex_steps() -> None:
    along = np.array([[np.cos(0.4), np.sin(0.4)]])
    other = side((1.1, 1.0, 0.0), (0.1, 0.2, 0.0), 0.5 * SKEW)

    def margin(c12: complex) -> complex:
        film = Side((np.array([1.3]), np.array([0.9]), np.array([c12])),
                    np.array([[0.4, 0.2, -0.05]]), SKEW[None])
        return complex(interface_margin([film, other], along)[0])

    slope = margin(0.1 + 1e-30j).imag / 1e-30
    assert slope == pytest.approx((margin(0.1 + 1e-5) - margin(0.1 - 1e-5)).real / 2e-5, rel=1e-7)
