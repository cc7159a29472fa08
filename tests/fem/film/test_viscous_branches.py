"""Viscous branches at a point: their equation, its integration, what they store and pull with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.support.specimens import NEO_HOOKE
from tympan.fem.film.memory import Memory, determinant, incompressible, inner, inverse
from tympan.geometry.specimen import Film, ViscousBranch

BRANCHES = ViscousBranch(3e4, 2.0), ViscousBranch(1e5, 20.0)
FILM = Film(1e-3, (2.0, 1.5), NEO_HOOKE, 4.7, branches=BRANCHES)
STRETCH = st.floats(0.4, 4.0)
SHEAR = st.floats(-0.5, 0.5)


def strain(first: Any, second: Any, shear: Any) -> tuple[Any, Any, Any]:
    """A C in the plane, for a shear relative to what would make it singular."""
    return first**2, second**2, shear * first * second


def path(time: float) -> tuple[Any, Any, Any]:
    """A C that stretches, shears and comes back."""
    return strain(2.0 + 0.8 * np.sin(time), 1.5 + 0.3 * np.cos(2 * time), 0.3 * np.sin(1.7 * time))


def evolution(time: float, flat: Any, branch: ViscousBranch) -> Any:
    """Ċ_v = (C − ⅓ (C : C_v⁻¹) C_v)/τ, of the four components."""
    full = incompressible(path(time))
    return (full - inner(full, inverse(flat)) * flat / 3) / branch.time


def marched(steps: int, end: float = 6.0) -> Memory:
    """By equal steps along the path, from rest at its beginning."""
    memory = Memory.relaxed(FILM, path(0.0))
    for number in range(steps):
        flow = memory.step(path(number * end / steps), end / steps)
        memory = flow.after(path((number + 1) * end / steps))
    return memory


def test_branches_flow_by_their_equation_with_second_order() -> None:
    for number, branch in enumerate(FILM.branches):
        exact = solve_ivp(evolution, (0.0, 6.0), incompressible(path(0.0)), "DOP853",
                          args=(branch,), rtol=1e-12, atol=1e-13).y[:, -1]
        misses = [np.abs(marched(steps).viscous[:, number] - exact).max()
                  for steps in (40, 80, 160)]
        orders = -np.diff(np.log2(misses))
        assert orders == pytest.approx([2.0, 2.0], abs=0.1)
        assert misses[-1] < 2e-3


def test_what_a_branch_pulls_with_is_that_of_its_equation_at_the_steps_end() -> None:
    """S of μ/2 (C : C_v⁻¹ − 3) at the C_v that the step leaves."""
    memory, c = marched(7), np.array(path(6.3))
    flow = memory.step(path(6.0), 0.3)
    after = flow.after(c)

    def stored(c: Any) -> Any:
        return after.energy(c)

    step = 1e-30
    slopes = [2 * np.imag(stored(c + 1j * step * unit)) / step for unit in np.eye(3)]
    slopes[2] = slopes[2] / 2  # by C₁₂, which stands twice in C
    assert flow.density(c)[1] == pytest.approx(np.array(slopes), rel=1e-10)


@settings(deadline=None, max_examples=40)
@given(STRETCH, STRETCH, SHEAR, st.floats(1e-3, 50.0))
def test_a_steps_potential_has_these_derivatives(first: float, second: float, shear: float,
                                                 duration: float) -> None:
    flow = marched(5).step(path(6.0), duration)
    c, step = np.array(strain(first, second, shear), complex), 1e-30
    _, stress, tangent = flow.density(c.real)
    assert tangent is not None
    assert tangent == pytest.approx(np.swapaxes(tangent, 0, 1), rel=1e-12)
    weights = np.array([2.0, 2.0, 1.0])  # of ∂/∂E, C₁₂ and C₂₁ together
    for number, weight in enumerate(weights):
        moved = c.copy()
        moved[number] += 1j * step
        energy, there, _ = flow.density(moved, tangent=False)
        assert weight * np.imag(energy) / step == pytest.approx(stress[number], rel=1e-8, abs=1e-4)
        assert weight * np.imag(there) / step == pytest.approx(tangent[:, number], rel=1e-8,
                                                               abs=1e-3)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(STRETCH, STRETCH, SHEAR, st.floats(1e-6, 1e6)), min_size=1, max_size=5))
def test_any_steps_leave_c_v_positive_and_incompressible(
        steps: list[tuple[float, float, float, float]]) -> None:
    memory, before = Memory.relaxed(FILM, path(0.0)), path(0.0)
    for first, second, shear, duration in steps:
        c = strain(first, second, shear)
        memory = memory.step(before, duration).after(c)
        before = c
    v11, v22, v12, v33 = memory.viscous
    assert determinant(memory.viscous) == pytest.approx(np.ones(2), rel=1e-9)
    assert (v11 > 0).all()
    assert (v33 > 0).all()
    assert (v11 * v22 > v12**2).all()


@settings(deadline=None, max_examples=40)
@given(STRETCH, STRETCH, SHEAR, st.floats(0.0, np.pi))
def test_a_turned_film_pulls_in_turned_directions(first: float, second: float, shear: float,
                                                  angle: float) -> None:
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])

    def turned(c: Any) -> Any:
        full = turn @ np.array([[c[0], c[2]], [c[2], c[1]]]) @ turn.T
        return full[0, 0], full[1, 1], full[0, 1]

    begin, end = path(0.3), strain(first, second, shear)
    energy, stress, _ = Memory.relaxed(FILM, begin).step(begin, 3.0).density(end)
    other, there, _ = Memory.relaxed(FILM, turned(begin)).step(turned(begin), 3.0).density(
        turned(end))
    assert other == pytest.approx(energy, rel=1e-9, abs=1e-6)
    assert there == pytest.approx(np.array(turned(stress)), rel=1e-8, abs=1e-5)


def test_slow_branches_are_springs_and_fast_ones_are_not_there() -> None:
    before, c = path(0.0), path(1.0)
    spring = Film(1e-3, (2.0, 1.5), NEO_HOOKE, 4.7, branches=(ViscousBranch(3e4, 1e12),))
    memory = Memory.relaxed(spring, before)
    energy, stress, _ = memory.step(before, 1.0).density(c)
    assert energy == pytest.approx(memory.energy(c), rel=1e-9)
    assert np.abs(stress).max() > 1e3
    fast = Film(1e-3, (2.0, 1.5), NEO_HOOKE, 4.7, branches=(ViscousBranch(3e4, 1e-9),))
    energy, stress, _ = Memory.relaxed(fast, before).step(before, 1.0).density(c)
    assert np.abs(stress).max() < 1e-3


def test_a_film_held_since_it_was_stretched_relaxes_by_its_equation() -> None:
    """From C_v = 1; at last nothing is left, and at first all of it."""
    first, second = FILM.prestretch
    flat = incompressible((first**2, second**2, 0.0))
    for age in (0.0, 0.7, 5.0, 1e6):
        memory = Memory.mounted(Film(1e-3, FILM.prestretch, NEO_HOOKE, 4.7,
                                     branches=FILM.branches, mounted=age), (3,))
        assert memory.viscous.shape == (4, 2, 3)
        for number, branch in enumerate(FILM.branches):
            if age > 1e3:
                exact = flat
            else:
                exact = solve_ivp(lambda _, v, branch=branch: (
                    flat - inner(flat, inverse(v)) * v / 3) / branch.time, (0.0, age),
                    np.array([1.0, 1.0, 0.0, 1.0]), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
            assert memory.viscous[:, number, 1] == pytest.approx(exact, rel=1e-7, abs=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.lists(st.tuples(STRETCH, STRETCH, SHEAR, st.floats(1e-2, 1e2)), min_size=1, max_size=4))
def test_no_cycle_gains_energy(corners: list[tuple[float, float, float, float]]) -> None:
    """Work done on a film that was at rest, round a closed path, is never negative."""
    start = np.array(path(0.0))
    points = [start, *(np.array(strain(*corner[:3])) for corner in corners), start]
    times = [*(corner[3] for corner in corners), 1.0]
    memory, work, moved, fine = Memory.relaxed(FILM, start), 0.0, 0.0, 120
    before = start
    for target, duration in zip(points[1:], times, strict=True):
        origin = before
        for share in np.linspace(0.0, 1.0, fine + 1)[1:]:
            c = origin + share * (target - origin)
            flow = memory.step(before, duration / fine)
            low = memory.step(before, 0.0).density(before, tangent=False)[1]
            high = flow.density(c, tangent=False)[1]
            strain_step = (c - before) / 2 * np.array([1, 1, 2])
            part = float((low + high) / 2 @ strain_step)
            work, moved = work + part, moved + abs(part)
            memory, before = flow.after(c), c
    assert work > -1e-3 * moved


def test_what_a_held_film_stores_less_is_heat() -> None:
    memory, c, duration = marched(7), np.array(path(6.3)), 1e-4
    after = memory.step(c, duration).after(c)
    dissipated = (memory.energy(c) - after.energy(c)) / duration
    heat = (memory.dissipation(c) + after.dissipation(c)) / 2
    assert dissipated == pytest.approx(heat, rel=1e-6)
