"""Where laws fail: Hill's inequality and strong ellipticity against brute force, Eq. (8), and what
solutions visit."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.laws import SAMPLES
from tests.support.specimens import ROOT5, circular, elliptical
from tympan.base.errors import InputError
from tympan.fem.film.admissibility import (
    checked,
    ellipticity_margin,
    failures,
    hill_margin,
    inadmissible_stretch,
)
from tympan.fem.film.laws import Ogden, PrestretchedOgden, Separable, Yeoh
from tympan.fem.results.fields import Fields, lost_tension, node_fields
from tympan.studies.case import Case, Settings, equilibrate, field_warnings, solve

BETA, GAMMA = (13.4e3, 34.8e3, 35.8e3), (-0.41e3, -113e3, -34.2e3)
TABLE_1 = {kind: kind(BETA, GAMMA, (2.0, 4.0, 6.0), ROOT5)
           for kind in (Separable, PrestretchedOgden)}
FALLING = (Ogden((20e3, -500.0), (2.0, 4.0)), Ogden((-5e3, 30e3), (3.0, 1.2)),
           Yeoh((9e3, -900.0, 20.0)),
           *TABLE_1.values())


def eq8(stretch):  # type: ignore[no-untyped-def]
    """Eq. (8) with Table 1, as printed."""
    return sum(b * stretch ** (2 * i) - g * stretch ** (-2 * i)
               for i, (b, g) in enumerate(zip(BETA, GAMMA, strict=True), start=1))


def gradient_energy(law, f):  # type: ignore[no-untyped-def]
    """W of plane deformation gradients, shape (..., 2, 2), from the singular values."""
    trace, det = (f * f).sum((-2, -1)), np.linalg.det(f)
    total, gap = np.sqrt(trace + 2 * det), np.sqrt(np.maximum(trace - 2 * det, 0))
    return law.derivatives((total + gap) / 2, (total - gap) / 2)[0]


def smallest_acoustic(law, l1: float, l2: float, count: int = 91) -> float:
    """min over unit a, n of d²W(F + s a⊗n)/ds² by differences: brute force, no formula for
    ellipticity."""
    angles = np.linspace(0, np.pi, count, endpoint=False)
    a, n = np.meshgrid(angles, angles, indexing="ij")
    rank_one = np.einsum("i...,j...->...ij", np.array([np.cos(a), np.sin(a)]),
                         np.array([np.cos(n), np.sin(n)]))
    step, f = 2e-3, np.diag([l1, l2])
    up, down = (gradient_energy(law, f + sign * step * rank_one) for sign in (1, -1))
    return float((up - 2 * gradient_energy(law, f) + down).min() / step**2)


@pytest.mark.parametrize("law", [*(sample.law for sample in SAMPLES.values()), *FALLING],
                         ids=lambda law: type(law).law)
def test_ellipticity_is_the_sign_of_every_plane_wave(law) -> None:
    random = np.random.default_rng(7)
    decided = 0
    for l1, l2 in np.exp(random.uniform(-0.5, 1.2, (60, 2))):
        if abs(l1 - l2) < 0.05:
            continue
        brute, margin = smallest_acoustic(law, l1, l2), float(ellipticity_margin(law, l1, l2))
        scale = np.abs(law.derivatives(l1, l2)[3:]).max()
        if abs(brute) > 2e-3 * scale:
            decided += 1
            assert (brute > 0) == (margin > 0), (l1, l2, brute, margin)
    assert decided > 30


@pytest.mark.parametrize("law", FALLING, ids=lambda law: type(law).law)
def test_falling_laws_fail_somewhere_in_each_sense(law) -> None:
    assert inadmissible_stretch(law) is not None
    l1, l2 = inadmissible_stretch(law, margin=ellipticity_margin) or (1.0, 1.0)
    assert l1 >= l2


@pytest.mark.parametrize("sample", SAMPLES.values(), ids=SAMPLES)
def test_ellipticity_is_continuous_at_equal_stretches(sample) -> None:
    here, near = (ellipticity_margin(sample.law, 2.0 + gap, 2.0 - gap) for gap in (0.0, 1e-4))
    assert here == pytest.approx(near, rel=1e-3)


@pytest.mark.parametrize("law", [SAMPLES["ogden"].law, *FALLING], ids=str)
def test_hill_s_inequality_is_the_growth_of_true_stress(law) -> None:
    """Δσ·Δlnλ over small steps in all directions, from the stresses alone."""
    random = np.random.default_rng(3)
    l1, l2 = np.exp(random.uniform(-0.3, 1.0, (2, 400)))
    angle, step = np.linspace(0, np.pi, 60)[:, None], 1e-5

    def stress(a, b):  # type: ignore[no-untyped-def]
        _, w1, w2, *_ = law.derivatives(a, b)
        return a * w1, b * w2

    turns = np.cos(angle) * step, np.sin(angle) * step
    ends = [stress(l1 * np.exp(s * turns[0]), l2 * np.exp(s * turns[1])) for s in (1, -1)]
    growth = sum((up - down) * turn
                 for up, down, turn in zip(*ends, turns, strict=True)).min(0) / (2 * step**2)
    margin = hill_margin(law, l1, l2)
    clear = np.abs(growth) > 5e-3 * np.abs(margin).max()
    assert clear.sum() > 20
    assert ((growth > 0) == (margin > 0))[clear].all()


@pytest.mark.parametrize("kind", TABLE_1)
def test_table_1_is_eq8_where_the_width_is_held(kind) -> None:
    law, relative = TABLE_1[kind], np.linspace(0.8, 2, 13)
    stretch = ROOT5 * relative
    assert np.allclose(stretch * law.derivatives(stretch, ROOT5)[1], eq8(relative), rtol=1e-13)
    # Paper: β and γ give 231.61 kPa at rest, falling by 277.22 kPa per unit stretch.
    assert eq8(1.0) == pytest.approx(231.61e3)
    assert hill_margin(law, ROOT5, ROOT5) < 0
    with pytest.raises(InputError, match="falls at"):
        checked(law)
    _, w1, _, w11, _, _ = law.derivatives(ROOT5, ROOT5)
    assert ROOT5 * (w1 + ROOT5 * w11) == pytest.approx(-277.22e3, rel=1e-4)


def test_readings_of_eq8_differ_across_the_film() -> None:
    across = {kind.law: float(ROOT5 * law.derivatives(1.2 * ROOT5, ROOT5)[2])
              for kind, law in TABLE_1.items()}
    assert across["separable"] == pytest.approx(231.61e3)
    assert across["prestretched_ogden"] == pytest.approx(
        sum(BETA) - sum(g / 1.2 ** (2 * i) for i, g in enumerate(GAMMA, start=1)))


def test_an_ogden_film_written_from_its_mounted_state_is_the_same_film() -> None:
    virgin = Ogden((16e3, 20.0), (2.0, 4.0))
    mounted = PrestretchedOgden((16e3 * 5, 20.0 * 25), (16e3 / 25, 20.0 / 625), (2.0, 4.0), ROOT5)
    random = np.random.default_rng(1)
    l1, l2 = random.uniform(0.7, 4, (2, 50))
    for ours, other in zip(mounted.derivatives(l1, l2)[1:], virgin.derivatives(l1, l2)[1:],
                           strict=True):
        assert np.allclose(ours, other, rtol=1e-11, atol=1e-6)


def test_visited_failure_is_found_at_its_place() -> None:
    """On a film pulled far out, a law that fails only beyond some λ₁: reported at the rim of the
    plate."""
    weak = Yeoh((12e3, -345.0))
    model, outcome = equilibrate(Case(circular(), mass=60e-3, voltage=0.0), Settings())
    assert outcome.status == "equilibrium"
    [fields] = node_fields(model, [outcome.state])
    threshold = _first_on_path(weak, fields)
    assert fields.stretch_1.min() < threshold < fields.stretch_1.max()
    film = replace(circular().membrane, material=weak)
    [failure, *_] = failures(film, fields.position, fields.stretch_1, fields.stretch_2)
    share, *place, first, _ = map(float, re.findall(r"(?<![\w.])-?\d+\.?\d*", failure))
    assert np.hypot(*place) == pytest.approx(10, rel=0.02)
    assert first == pytest.approx(fields.stretch_1.max(), rel=1e-3)
    assert share == pytest.approx(100 * (fields.stretch_1 > threshold).mean(), abs=2)
    [loss] = lost_tension(model, [outcome.state])
    [words] = [item for item in field_warnings(fields, loss, film) if "Hill" in item]
    assert "mm, where the stretches are" in words


def _first_on_path(law, fields: Fields) -> float:
    """Smallest λ₁ of the film at which a small step raises no stress, from energies alone."""
    order = np.argsort(fields.stretch_1)
    l1, l2 = fields.stretch_1[order], fields.stretch_2[order]
    step, angle = 1e-4, np.linspace(0, np.pi, 90)[:, None]

    def energy(sign: int):  # type: ignore[no-untyped-def]
        return law.derivatives(l1 * np.exp(sign * step * np.cos(angle)),
                               l2 * np.exp(sign * step * np.sin(angle)))[0]

    bend = (energy(1) - 2 * energy(0) + energy(-1)).min(0)
    return float(l1[np.flatnonzero(bend < 0)[0]])


def test_admissible_films_have_no_such_warning() -> None:
    """Beyond the range that materials are checked for on reading, there is that one warning."""
    assert solve(Case(elliptical(60e-3), mass=17.9e-3, voltage=0.0), Settings()).warnings == ()
    specimen = circular(Ogden((20e3,), (2.0,)), prestretch=(7.0, 7.0))
    warnings = solve(Case(specimen, mass=17.9e-3, voltage=0.0), Settings()).warnings
    assert [word for word in warnings if "beyond 6, to which laws are tested" not in word] == []
    assert len(warnings) == 1
