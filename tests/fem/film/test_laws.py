"""What every registered law must satisfy, identities between laws, and films of each against the
axisymmetric ODE."""

from __future__ import annotations

import tomllib
import warnings
from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.oracles import axisymmetric
from tests.oracles.laws import SAMPLES, Sample, gent, shear_modulus
from tests.support.models import deflection_gradient, model
from tests.support.specimens import ROOT5, circular
from tympan.base.errors import InputError
from tympan.base.fields import read
from tympan.base.toml_reader import Table
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.admissibility import (
    STRETCH_RANGE,
    checked,
    inadmissible_stretch,
    reachable_stretches,
)
from tympan.fem.film.laws import LAWS, ArrudaBoyce, Gent, MooneyRivlin, NeoHooke, Ogden, Yeoh
from tympan.fem.film.library import MATERIALS

STEP = 1e-30
GRID = tuple(axis.ravel() for axis in np.meshgrid(np.linspace(0.6, 3.2, 27),
                                                  np.linspace(0.6, 3.2, 27)))
each_law = pytest.mark.parametrize("sample", SAMPLES.values(), ids=SAMPLES)


def test_every_registered_law_has_a_sample() -> None:
    assert set(SAMPLES) == set(LAWS)
    assert all(type(sample.law).law == name for name, sample in SAMPLES.items())


@each_law
def test_law_is_read_from_its_lines(sample: Sample) -> None:
    table = Table("sample.toml", tomllib.loads(sample.lines), "membrane.material")
    law = read(LAWS[sample.law.law], table)
    assert type(law) is type(sample.law)
    for item in fields(law):
        got, stated = getattr(law, item.name), getattr(sample.law, item.name)
        assert got == (stated if item.name == "nominal" else pytest.approx(stated, rel=1e-14))
    assert checked(law) is law
    assert len(type(law).__doc__.strip().splitlines()) > 4


@each_law
def test_first_and_second_derivatives(sample: Sample) -> None:
    derivatives = sample.law.derivatives
    _, w1, w2, w11, w12, w22 = derivatives(*GRID)
    first = [part.imag / STEP for part in derivatives(GRID[0] + 1j * STEP, GRID[1])[:3]]
    second = [part.imag / STEP for part in derivatives(GRID[0], GRID[1] + 1j * STEP)[:3]]
    for got, exact in zip((w1, w11, w12, w2, w12, w22), (*first, second[0], *second[1:]),
                          strict=True):
        assert got.shape == GRID[0].shape
        assert np.allclose(got, exact, rtol=1e-12, atol=1e-12 * shear_modulus(sample.law))


@each_law
def test_values_are_those_of_the_reference(sample: Sample) -> None:
    ours, reference = sample.law.derivatives(*GRID), sample.reference
    scale = shear_modulus(sample.law)
    for got, name in zip(ours, ("energy", "w1", "w2"), strict=False):
        assert np.allclose(got, getattr(reference, name)(*GRID), rtol=1e-12,
                           atol=1e-11 * scale), name
    for got, name in zip(ours[3:], ("w11", "w12", "w22"), strict=True):
        assert np.allclose(got, getattr(reference, name)(*GRID), rtol=1e-8, atol=1e-8 * scale), name


@each_law
def test_symmetry(sample: Sample) -> None:
    w, w1, w2, w11, w12, w22 = sample.law.derivatives(*GRID)
    swapped = sample.law.derivatives(*GRID[::-1])
    for ours, other in zip((w, w2, w1, w22, w12, w11), swapped, strict=True):
        assert np.allclose(ours, other, rtol=1e-13, atol=1e-13 * shear_modulus(sample.law))


@each_law
def test_virgin_state(sample: Sample) -> None:
    """No energy, no stress; small strains see an incompressible solid.

    A law with a reference of its own is not free of stress when virgin.
    """
    modulus = shear_modulus(sample.law)
    if hasattr(sample.law, "reference"):
        w, w1, w2, *_ = sample.law.derivatives(sample.law.reference, sample.law.reference)
        assert abs(sample.law.derivatives(1.0, 1.0)[1]) > 0.1 * modulus
        assert w == pytest.approx(0, abs=1e-12 * modulus)
        assert w1 == w2
        return
    w, w1, w2, w11, w12, w22 = sample.law.derivatives(1.0, 1.0)
    assert (w, w1, w2) == pytest.approx((0, 0, 0), abs=1e-12 * modulus)
    assert (w11, w22, w12) == pytest.approx((4 * modulus, 4 * modulus, 2 * modulus), rel=1e-13)


@each_law
def test_prestress(sample: Sample) -> None:
    for stretch in (ROOT5, np.array([ROOT5])):
        _, w1, w2, *_ = sample.law.derivatives(stretch, stretch)
        assert ROOT5 * w1 == pytest.approx(sample.stress, rel=1e-12)
        assert ROOT5 * w2 == pytest.approx(sample.stress, rel=1e-12)
    assert ROOT5 * sample.reference.w1(ROOT5, ROOT5) == pytest.approx(sample.stress, rel=1e-12)


@each_law
def test_constants_may_carry_a_complex_step(sample: Sample) -> None:
    for item in fields(sample.law):
        if item.name == "nominal":
            continue
        value = np.array(getattr(sample.law, item.name))

        def at(change, name=item.name, value=value):  # type: ignore[no-untyped-def]
            moved = value + change
            return replace(sample.law, **{name: tuple(moved) if moved.ndim
                                          else moved[()]}).derivatives(2.2, 1.4)

        step = 1e-5 * value
        difference = (np.array(at(step)) - np.array(at(-step))) / 2e-5
        assert np.allclose(np.array(at(1j * STEP * value)).imag / STEP, difference,
                           rtol=1e-7), item.name


@pytest.mark.parametrize("voltage", [0.0, 4000.0])
@each_law
def test_film_follows_the_ode(sample: Sample, voltage: float) -> None:
    force = 0.2
    outcome = equilibrium(model(circular(sample.law)), force, voltage)
    assert outcome.status == "equilibrium"
    film = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, sample.reference, 4.7)
    exact = axisymmetric.solve_load(film, force, voltage)
    assert outcome.state.plate.deflection == pytest.approx(exact.deflection, rel=3e-5)


@pytest.mark.parametrize(("law", "same", "tolerance"), [
    (Gent(20e3, 1e9), NeoHooke(20e3), 1e-7),
    (ArrudaBoyce(20e3, 1e4), NeoHooke(20e3), 1e-6),
    (Yeoh((10e3,)), NeoHooke(20e3), 1e-14),
    (Yeoh((10e3, 0.0, 0.0)), NeoHooke(20e3), 1e-14),
    (MooneyRivlin(10e3, 0.0), NeoHooke(20e3), 1e-14),
    (MooneyRivlin(8e3, 1e3), Ogden((16e3, -2e3), (2.0, -2.0)), 1e-12),
    (NeoHooke(20e3), Ogden((20e3,), (2.0,)), 1e-12),
], ids=str)
def test_reductions(law, same, tolerance) -> None:
    for ours, other in zip(law.derivatives(*GRID), same.derivatives(*GRID), strict=True):
        assert np.allclose(ours, other, rtol=tolerance, atol=20e3 * tolerance)
    assert shear_modulus(law) == pytest.approx(shear_modulus(same), rel=max(tolerance, 1e-14))


def test_arruda_boyce_stands_for_the_inverse_langevin_function() -> None:
    """2 ∂W/∂I₁ = μ λ_lock/(3 λ_c) L⁻¹(λ_c/λ_lock), λ_c = √(I₁/3); the errors are those its
    description states."""
    law = ArrudaBoyce(1.0, 5.0)
    for share, error in ((0.3, 1e-5), (0.6, 5e-3), (0.8, 0.1005)):
        inverse = brentq(lambda x, share=share: 1 / np.tanh(x) - 1 / x - share, 1e-3, 1e3)
        slope = 2 * law.energy(3 * (5 * share) ** 2 - 3)[1]
        assert 0 < 1 - slope / (inverse / (3 * share)) < error
    factor = 1 + 3 / (5 * 25) + 99 / (175 * 25**2) + 513 / (875 * 25**3) + 42039 / (67375 * 25**4)
    assert shear_modulus(law) == pytest.approx(factor, rel=1e-14)


def test_library_gent_is_the_source_s() -> None:
    law = MATERIALS["vhb-4910-gent"].material
    l1, l2 = GRID
    l3 = 1 / (l1 * l2)
    by_hand = 18e3 * (l1**2 - l3**2) / (1 - (l1**2 + l2**2 + l3**2 - 3) / 110)
    assert np.allclose(l1 * law.derivatives(l1, l2)[1], by_hand, rtol=1e-12, atol=1e-8)


@pytest.mark.parametrize("law", [Gent(20e3, 9.0), ArrudaBoyce(20e3, 2.0)], ids=str)
def test_beyond_the_locking_stretch(law) -> None:
    """I₁ = 12 is the limit of both: infinite energy, no derivatives, no warnings (which are errors
    here)."""
    limit = brentq(lambda x: 2 * x**2 + x**-4.0 - 12, 2, 3)
    stretch = np.array([1.0, 0.999 * limit, 1.001 * limit, 1e3, np.inf, np.nan])
    w, *derivatives = law.derivatives(stretch, stretch)
    assert np.isfinite(w[:2]).all()
    assert np.isposinf(w[2:]).all()
    for part in derivatives:
        assert np.isfinite(part[:2]).all()
        assert np.isnan(part[2:]).all()
    assert np.isposinf(law.derivatives(5.0, 1.0)[0])
    assert np.isinf(law.derivatives(5.0 + 1j * STEP, 1.0)[0])


@pytest.mark.parametrize(("force", "voltage"),
                         [(0.5, 0.0), (5.0, 0.0), (50.0, 0.0), (0.5, 9000.0), (5.0, 9000.0)])
def test_film_close_to_locking(force: float, voltage: float) -> None:
    """Predictions along the path overshoot the limit, where forces are not finite, and are taken
    back silently."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        outcome = equilibrium(model(circular(Gent(15e3, 12.0))), force, voltage)
    assert outcome.status == "equilibrium"
    film = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, gent(15e3, 12.0), 4.7)
    exact = axisymmetric.solve_load(film, force, voltage)
    assert outcome.state.plate.deflection == pytest.approx(exact.deflection, rel=3e-5)


def test_newton_backs_off_from_locking(monkeypatch) -> None:
    """From the flat film straight to 25 N: full steps end where forces are not finite, shorter ones
    do not."""
    film = model(circular(Gent(15e3, 12.0)))
    finite, forces = [], type(film).forces

    def watched(self, *arguments):  # type: ignore[no-untyped-def]
        result = forces(self, *arguments)
        finite.append(np.isfinite(result).all())
        return result

    monkeypatch.setattr(type(film), "forces", watched)
    assert newton(film, replace(film.mounted(), force=25.0)).converged
    assert not all(finite)


def test_a_guess_beyond_locking_is_an_answer_not_a_crash() -> None:
    film = model(circular(Gent(15e3, 12.0)))
    flat = film.mounted()
    lifted = replace(flat, plate=flat.plate.raised_to(0.2))
    solution = newton(film, lifted, ("force",), (held_plate(0.2),))
    assert not solution.converged
    assert "beyond what its material can reach" in solution.advice
    assert held(film, 0.2).status == "not_converged"


def test_locking_stretch_has_a_gradient() -> None:
    """d heave / d j_lim, by the complex step, against re-solved films."""
    heaves = {}
    for limit in (19.98, 20.0, 20.02):
        film = model(circular(Gent(15e3, limit)))
        outcome = equilibrium(film, 0.5, 3000.0)
        heaves[limit] = outcome.state.plate.deflection
        if limit == 20.0:
            exact = deflection_gradient(film, outcome.state,
                                   ["membrane.material.j_lim"])["membrane.material.j_lim"]
    assert (heaves[20.02] - heaves[19.98]) / 0.04 == pytest.approx(exact, rel=1e-4)


@dataclass(frozen=True)
class Falling:
    """A law that both locks and softens."""

    law: ClassVar[str] = "falling"
    locking: Gent
    softening: Ogden

    def derivatives(self, l1, l2):  # type: ignore[no-untyped-def]
        pairs = zip(self.locking.derivatives(l1, l2), self.softening.derivatives(l1, l2),
                    strict=True)
        return tuple(first + second for first, second in pairs)


def test_admissible_as_far_as_the_law_reaches() -> None:
    assert reachable_stretches(NeoHooke(1.0))[0].max() == STRETCH_RANGE[1]
    assert reachable_stretches(Gent(1.0, 5.0))[0].max() == pytest.approx(2.7, abs=0.1)
    assert checked(Gent(20e3, 1e-6))
    assert inadmissible_stretch(Gent(20e3, 5.0)) is None
    falling = Ogden((-500.0,), (4.0,))
    with pytest.raises(InputError, match=r"from 0\.5 to 6\.0, but it falls at"):
        checked(Falling(Gent(20e3, 1e6), falling))
    with pytest.raises(InputError, match=r"from 0\.5 to 6\.0 \(of which it reaches 4\.\d "
                                         r"at most\), but it falls at"):
        checked(Falling(Gent(20e3, 18.0), Ogden((-5e3,), (4.0,))))
    assert checked(Falling(Gent(20e3, 3.0), falling))


def test_virgin_state_alone_can_be_inadmissible() -> None:
    assert inadmissible_stretch(Falling(Gent(20e3, 1e-6), Ogden((-30e3,), (2.0,)))) == (1.0, 1.0)


@pytest.mark.parametrize(("make", "key"), [
    (lambda: NeoHooke(0.0), "mu"), (lambda: NeoHooke(float("nan")), "mu"),
    (lambda: Gent(1.0, -1.0), "j_lim"),
    (lambda: Gent(-1.0, 1.0), "mu"), (lambda: ArrudaBoyce(1.0, 1.0), "lambda_lock"),
    (lambda: Yeoh(()), "c"),
])
def test_constants_without_meaning_are_refused(make, key) -> None:
    with pytest.raises(InputError) as caught:
        make()
    assert caught.value.key == key


def test_overflow_is_no_warning() -> None:
    with pytest.raises(InputError, match="admissible"):
        checked(Ogden((1.0, -1.0), (500.0, 600.0)))
