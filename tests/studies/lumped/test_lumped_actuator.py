"""The paper's lumped model: its equations, statics and linearisation against other ways of
computing them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.lumped_model import equations
from tests.support.lumped import MODELS, OVAL, free_energy
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.fem.rig import Rig
from tympan.paper.table1 import paper_actuators
from tympan.studies.circles import ConeCircle
from tympan.studies.lumped.actuator import (
    BORROWED,
    Actuator,
    flat_capacitance,
)
from tympan.studies.lumped.equilibria import pull_in, rest, roots
from tympan.studies.lumped.linear import linearise

EVERY = pytest.mark.parametrize("actuator", MODELS.values(), ids=MODELS.keys())


def test_rates_are_the_papers_equations() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        state = rng.uniform([1e-4, -0.1, 0, 0], [8e-3, 0.1, 0.02, 0.02])
        u = rng.uniform(0, 7e3)
        assert MODELS["paper"].linear(state, u)[0] == pytest.approx(
            equations(state, u, (0.4, 0.6), 17.9e-3, 8.5), rel=1e-10)


@EVERY
def test_derivatives_by_complex_step(actuator: Actuator) -> None:
    rng = np.random.default_rng(2)
    for _ in range(5):
        state = np.concatenate([[rng.uniform(1e-3, 9e-3), rng.uniform(-0.1, 0.1)],
                                rng.uniform(0, 0.02, actuator.count)])
        u = rng.uniform(500, 5e3)
        steps = 1e-30j * np.eye(len(state))
        numeric = np.array([actuator.linear(state + step, u)[0].imag for step in steps]).T / 1e-30
        assert actuator.linear(state, u)[1] == pytest.approx(numeric, rel=1e-10, abs=1e-10)
        by_u = actuator.linear(state + 0j, u + 1e-30j)[0].imag / 1e-30
        assert actuator.by_voltage(state, u) == pytest.approx(by_u, rel=1e-10)


@EVERY
def test_forces_derive_from_the_energy(actuator: Actuator) -> None:
    """∂energy/∂y is the force of a film at rest and of its branches; by ε₁ it is what drives Eq.
    (9)."""
    state = np.concatenate([[4e-3, 0.0], np.full(actuator.count, 3e-3)])
    u, step = 3e3, 1e-30
    slope = free_energy(actuator, state + step * 1j * np.eye(len(state))[0], u).imag / step
    assert slope == pytest.approx(-actuator.moved * actuator.linear(state, u)[0][1], rel=1e-9)
    for part in (actuator.elastic, actuator.electric):
        energy, force, stiffness = part(4e-3 + step * 1j)
        assert energy.imag / step == pytest.approx(force.real, rel=1e-10)
        assert force.imag / step == pytest.approx(stiffness.real, rel=1e-10)


def test_at_rest_it_is_the_mixture_of_cones() -> None:
    short, long = ConeCircle(OVAL, 45e-3), ConeCircle(OVAL, 75e-3)
    actuator = Actuator.of(OVAL, 17.9e-3, (0.7, 0.3))
    for y, u in ((1e-3, 0.0), (4e-3, 3e3)):
        assert actuator.balance(y, u)[0] + actuator.load == pytest.approx(
            0.7 * short.force(y, u) + 0.3 * long.force(y, u), rel=1e-12)
        assert actuator.capacitance(y) == pytest.approx(
            0.7 * short.capacitance(y) + 0.3 * long.capacitance(y), rel=1e-12)


def test_capacitance_of_the_straight_cone_by_hand() -> None:
    """Eq. (1) of a film whose area grows and whose thickness shrinks by √s."""
    y, flat = 5e-3, 8.8541878128e-12 * 4.7 * np.pi * (45e-3**2 - 10e-3**2) / 0.2e-3
    assert ConeCircle(circular(), 45e-3).capacitance(y) == pytest.approx(
        flat * (1 + (y / 35e-3) ** 2), rel=1e-9)


@EVERY
@pytest.mark.parametrize("voltage", [0.0, 3e3, 5.5e3])
def test_roots_against_brute_force(actuator: Actuator, voltage: float) -> None:
    fine = np.linspace(0, actuator.reach, 300_001)
    values = actuator.balance(fine, voltage)[0]
    crossing = np.flatnonzero(values[:-1] * values[1:] < 0)
    heaves, stiffness = roots(actuator, voltage)
    assert len(heaves) == len(crossing) > 0
    for root, stiff, index in zip(heaves, stiffness, crossing, strict=True):
        assert fine[index] <= root <= fine[index + 1]
        assert (stiff > 0) == (values[index] < 0)


def test_pull_in_is_where_two_roots_meet() -> None:
    """Below it a stable and an unstable rest, at it one that touches, above it neither; against a
    fine grid."""
    actuator = Actuator.of(paper_actuators(8.5)[0], 17.9e-3)
    voltage, y = pull_in(actuator) or (np.nan, np.nan)
    below, stiffness = roots(actuator, voltage * (1 - 1e-7))
    above, _ = roots(actuator, voltage * (1 + 1e-7))
    assert (stiffness[:2] > 0).tolist() == [True, False]
    assert below[0] < y < below[1]
    assert len(above) == len(below) - 2
    fine = np.linspace(1e-3, 1.1 * y, 100_001)
    squared = (actuator.elastic(fine)[1] - actuator.load) / -actuator.electric(fine)[1]
    assert voltage == pytest.approx(np.sqrt(squared.max()), rel=1e-8)
    assert np.abs(roots(actuator, voltage)[0] - y).min() < 1e-6
    with pytest.raises(InputError, match="pull-in is at"):
        rest(actuator, voltage * 1.01)


def test_capacitance_and_energy_of_equation_1() -> None:
    circle, _, large = paper_actuators(4.7)
    surfaces = (60.5e-4, 102.9e-4)  # Table 1
    for specimen, surface in zip((circle, large), surfaces, strict=True):
        by_hand = 8.854e-12 * 4.7 * surface / 200e-6
        assert flat_capacitance(specimen) == pytest.approx(by_hand, rel=1e-3)
    assert flat_capacitance(circle) < flat_capacitance(large)
    by_hand = 0.5 * 8.854e-12 * 4.7 * 60.5e-4 / 200e-6 * 7e3**2
    assert flat_capacitance(circle) * 7e3**2 / 2 == pytest.approx(by_hand, rel=1e-3)
    assert Actuator.of(circle, 17.9e-3).capacitance(0.0) == pytest.approx(flat_capacitance(circle),
                                                                          rel=1e-6)


def test_electric_force_is_less_than_that_of_half_c_u_squared() -> None:
    """The whole cone's ½Cu² pulls (r₁ + r)/2r times as hard as Eq. (5), which takes the film at the
    plate's edge."""
    actuator = MODELS["paper"]
    short = replace(actuator.circles, radius=actuator.circles.radius[:1])
    single = replace(actuator, circles=short, weights=(1.0,))
    y, step = 3e-3, 1e-6
    by_energy = -(single.capacitance(y + step) - single.capacitance(y - step)) / (4 * step)
    assert by_energy / single.electric(y)[1] == pytest.approx((4.5 + 1) / 2, rel=1e-6)


def test_linear_model_is_a_control_system() -> None:
    import control

    linear = linearise(MODELS["tape"], 3e3)
    system = linear.to_control()
    assert isinstance(system, control.StateSpace)
    slope = (rest(MODELS["tape"], 3001.0) - rest(MODELS["tape"], 2999.0)) / 2
    assert linear.gain == pytest.approx(slope, rel=1e-5)
    assert float(np.real(np.squeeze(control.dcgain(system)))) == pytest.approx(slope, rel=1e-5)
    assert np.all(linear.poles.real < 0)


@pytest.mark.parametrize(("change", "words"), [
    ({"weights": (0.5, 0.6)}, "add up to 1"), ({"weights": (1.0,)}, "2 numbers"),
    ({"mass": 0.0}, "mass to move"),
    ({"rig": Rig(guide="fixed")}, "must let the plate move"),
])
def test_what_is_no_model_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(MODELS["paper"], **change)


def test_viscous_constants_that_would_make_energy_are_refused() -> None:
    with pytest.raises(InputError, match="negative"):
        replace(BORROWED, k1=-1.0)
