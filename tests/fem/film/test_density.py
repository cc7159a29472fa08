"""Laws and the film's energy density: derivatives by the complex step, invariance, and behaviour at
equal stretches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.laws import SAMPLES
from tests.support.specimens import NEO_HOOKE, ROOT5, circular, skewed
from tympan.base.errors import InputError
from tympan.fem.film.admissibility import checked, inadmissible_stretch
from tympan.fem.film.density import (
    FilmDensity,
    Maxwell,
    maxwell,
    plane_stress,
    principal_stretches,
    virtual_work,
)
from tympan.fem.film.laws import LAWS, Ogden
from tympan.fem.film.library import MATERIALS

STEP = 1e-30
MATERIALS_TO_TEST = {
    "neo-Hooke": NEO_HOOKE,
    "Ogden 3 terms": Ogden((8e3, 9e3, -20.0), (1.3, 2.3, -2.0)),
    "Ogden stiff": Ogden((30e3, 2e3), (1.3, 5.5)),
    "Maxwell": Maxwell(5e3, 2.0),
    "Maxwell, falling permittivity": Maxwell(5e3, 1.4),
    **{name: sample.law for name, sample in SAMPLES.items()},
    **{name: entry.material for name, entry in MATERIALS.items()},
}
EQUAL = [(1.0, 1.0, 0.0), (1.0, 1.0 + 1e-16, 0.0), (1.0, 1.0 + 1e-9, 3e-10),
         (1.0, 1.0 + 1e-6, -2e-6),
         (1.0, 1.0 + 1.9e-5, 0.0), (1.0, 1.0 + 2.1e-5, 0.0), (1.0, 1.001, 1e-4)]
GENERAL = [(1.3, 0.9, 0.2), (0.7, 2.0, -0.4), (4.0, 1.0, 1.0)]


def test_every_registered_law_is_covered() -> None:
    assert {type(law).law for law in MATERIALS_TO_TEST.values() if hasattr(law, "law")} == set(LAWS)


@pytest.mark.parametrize("law", MATERIALS_TO_TEST.values(), ids=MATERIALS_TO_TEST)
@pytest.mark.parametrize("stretches", [(2.2, 2.2), (3.0, 1.7), (0.8, 1.5)])
def test_derivatives_in_the_stretches(law, stretches) -> None:
    l1, l2 = stretches
    _, w1, w2, w11, w12, w22 = law.derivatives(l1, l2)
    first = law.derivatives(l1 + 1j * STEP, l2)
    second = law.derivatives(l1, l2 + 1j * STEP)
    got = np.array([w1, w2, w11, w12, w12, w22])
    exact = np.array([first[0].imag, second[0].imag, first[1].imag, first[2].imag, second[1].imag,
                      second[2].imag])
    assert np.allclose(got, exact / STEP, rtol=1e-13)


@pytest.mark.parametrize("law", MATERIALS_TO_TEST.values(), ids=MATERIALS_TO_TEST)
@pytest.mark.parametrize("c", EQUAL + GENERAL)
def test_stress_and_tangent_are_derivatives_of_the_energy(law, c) -> None:
    """S = ∂ψ/∂E and D = ∂S/∂E in Voigt form: C₁₁ = 2E₁₁ + 1, C₁₂ = γ; also at and near equal
    stretches."""
    prestretch = (ROOT5, ROOT5)
    density = plane_stress(law, c, prestretch)
    scale = np.abs(density.tangent).max()
    for k, weight in enumerate((2.0, 2.0, 1.0)):
        moved = [value + 1j * STEP * weight * (index == k) for index, value in enumerate(c)]
        by_step = plane_stress(law, tuple(np.complex128(value) for value in moved), prestretch,
                               tangent=False)
        if np.hypot((c[0] - c[1]) / 2, c[2]) > 0:
            assert by_step.energy.imag / STEP == pytest.approx(density.stress[k], rel=1e-11,
                                                               abs=1e-11 * scale)
            assert np.allclose(by_step.stress.imag / STEP, density.tangent[:, k], rtol=0,
                               atol=1e-9 * scale)
    assert np.allclose(density.tangent, density.tangent.T, rtol=0, atol=1e-14 * scale)


@pytest.mark.parametrize("law", MATERIALS_TO_TEST.values(), ids=MATERIALS_TO_TEST)
@pytest.mark.parametrize("c", EQUAL + GENERAL)
def test_power_is_the_stress_times_the_change_of_strain(law, c) -> None:
    change, prestretch = np.array([0.3, -0.2, 0.4]), (ROOT5, ROOT5)
    points = tuple(np.full(1, value) for value in c)
    work = virtual_work(points, tuple(np.full((1, 1), value) for value in change), prestretch,
                        np.full(1, 2.0))
    density = plane_stress(law, points, prestretch)
    expected = 2 * (density.stress[0] @ (change / [2, 2, 1]))
    assert work(law) == pytest.approx(expected, rel=1e-11,
                                      abs=1e-13 * np.abs(density.tangent).max())


@pytest.mark.parametrize("law", MATERIALS_TO_TEST.values(), ids=MATERIALS_TO_TEST)
def test_tangent_at_exactly_equal_stretches_is_the_limit(law) -> None:
    here = plane_stress(law, (1.0, 1.0, 0.0), (ROOT5, ROOT5)).tangent
    near = plane_stress(law, (1.0 + 1e-4, 1.0 - 1e-4, 0.0), (ROOT5, ROOT5)).tangent
    assert np.allclose(here, near, rtol=0, atol=1e-3 * np.abs(here).max())
    centred = plane_stress(law, (1.0 + 1e-3, 1.0 - 1e-3, 0.0), (ROOT5, ROOT5)).stress
    # Central difference of the stress in the direction that splits the stretches: E₁₁ = −E₂₂ =
    # 5e-4.
    assert (centred[0] - centred[1]) / 1e-3 == pytest.approx(here[0, 0] - here[0, 1], rel=1e-4)


@pytest.mark.parametrize("law", MATERIALS_TO_TEST.values(), ids=MATERIALS_TO_TEST)
def test_stress_is_continuous_where_the_divided_difference_takes_over(law) -> None:
    split = np.linspace(0.8e-5, 1.2e-5, 41)
    stress = plane_stress(law, (1 + split, 1 - split, 0 * split), (ROOT5, ROOT5),
                          tangent=False).stress
    bend = np.diff(stress[:, 0], 2)
    assert np.abs(bend).max() < 1e-13 * np.abs(stress).max() + 1e-12


angles = st.floats(0, 2 * np.pi)
stretches = st.floats(0.6, 1.8)


@given(angles, stretches, stretches)
def test_isotropy_under_equal_prestretch(angle: float, a: float, b: float) -> None:
    """Turning C turns S and leaves the energy; ψ depends on the principal stretches alone."""
    law = MATERIALS_TO_TEST["Ogden 3 terms"]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = turn @ np.diag([a * a, b * b]) @ turn.T
    straight = plane_stress(law, (a * a, b * b, 0.0), (2.0, 2.0), tangent=False)
    density = plane_stress(law, (turned[0, 0], turned[1, 1], turned[0, 1]), (2.0, 2.0),
                           tangent=False)
    s11, s22, s12 = density.stress
    assert density.energy == pytest.approx(straight.energy, rel=1e-12)
    back = turn.T @ np.array([[s11, s12], [s12, s22]]) @ turn
    assert np.allclose(back, np.diag(straight.stress[:2]),
                       atol=1e-9 * np.abs(straight.stress).max())


def test_prestress_is_design_s_true_stress() -> None:
    """σ = λ ∂W/∂λ − ε₀ε_r E² at the flat state, E = U/(T λ₃), by hand for neo-Hooke."""
    film = FilmDensity(circular(), 3000.0**2, 1.0)
    stress = film((1.0, 1.0, 0.0)).stress
    elastic = 25e3 * (5 - 1 / 25)
    field = 3000 / (1e-3 / 5)
    assert np.allclose(stress, [elastic - 8.8541878128e-12 * 4.7 * field**2] * 2 + [0], rtol=1e-9)


def test_falling_permittivity_is_unchanged_at_the_flat_state() -> None:
    flat, falling = circular(), circular(permittivity_exponent=0.7)
    at_rest = [maxwell(s, 1e6).derivatives(ROOT5, ROOT5)[0] for s in (flat, falling)]
    stretched = [maxwell(s, 1e6).derivatives(ROOT5 * 1.1, ROOT5 * 1.1)[0] for s in (flat, falling)]
    assert at_rest[0] == pytest.approx(at_rest[1], rel=1e-12)
    assert stretched[1] / stretched[0] == pytest.approx(1.21**-0.7, rel=1e-12)


def test_electrode_stiffness_is_stress_free_at_the_flat_state() -> None:
    specimen = skewed()
    covered, bare = (FilmDensity(specimen, 0.0, mask) for mask in (1.0, 0.0))
    rest = (1.0, 1.0, 0.0)
    assert np.allclose(covered(rest).stress, bare(rest).stress, rtol=1e-14)
    stretched = (1.2, 1.2, 0.0)
    extra = covered(stretched).stress - bare(stretched).stress
    assert np.allclose(extra[:2], 1.5e3 * (1 - 1.2**-3), rtol=1e-12)


def test_principal_stretches_include_the_prestretch() -> None:
    assert principal_stretches((4.0, 1.0, 0.0), (2.0, 3.0)) == pytest.approx((4.0, 3.0))


#: Neo-Hookean modulus [Pa] within which every film of the library is, stretched by the factor
#: beside it along both axes.
STIFFNESS = {"vhb": (10e3, 30e3, ROOT5), "ecoflex": (10e3, 30e3, ROOT5),
             "elastosil": (0.25e6, 0.45e6, 1.2), "sylgard": (0.6e6, 1.1e6, 1.1),
             "natural": (0.3e6, 0.5e6, 1.2)}


@pytest.mark.parametrize("name", MATERIALS)
def test_library_is_admissible_and_cited(name: str) -> None:
    entry = MATERIALS[name]
    low, high, stretch = STIFFNESS[name.partition("-")[0]]
    assert checked(entry.material) is entry.material
    assert any(character.isdigit() for character in entry.source + entry.caveat)
    force = entry.material.derivatives(stretch, stretch)[1]
    assert low < force * stretch / (stretch**2 - stretch**-4) < high


def test_default_material_follows_its_source() -> None:
    """Foo et al. 2012: Gent, μ 18 kPa, J_lim 110; biaxial stress within the 4 % its entry states.
    """
    grid = np.linspace(1.8, 3.2, 29)
    l1, l2 = (axis.ravel() for axis in np.meshgrid(grid, grid))
    l3 = 1 / (l1 * l2)
    gent = 18e3 * (l1**2 - l3**2) / (1 - (l1**2 + l2**2 + l3**2 - 3) / 110)
    ogden = l1 * MATERIALS["vhb-4910"].material.derivatives(l1, l2)[1]
    assert np.abs(ogden / gent - 1).max() < 0.041


def test_softening_laws_are_refused_with_the_stretch() -> None:
    falling = Ogden((20e3, -500.0), (2.0, 4.0))
    stretch = inadmissible_stretch(falling)
    assert stretch is not None
    with pytest.raises(InputError, match="falls at"):
        checked(falling)
    # True equibiaxial stress of that law peaks where 20e3·2 λ² = 500·4 λ⁴ (tails aside), λ ≈ 4.47;
    # shear earlier.
    assert 2 < stretch[0] < 4.6


def test_conventions() -> None:
    ours = Ogden.from_abaqus((20e3, 1e3), (2.0, 4.0))
    assert ours == Ogden((20e3, 500.0), (2.0, 4.0))
