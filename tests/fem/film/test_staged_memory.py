"""Branches over the stages of a long step, against their equation solved by other means."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.support.flowing_film import MODULUS, SAMPLES, film, path, rate
from tympan.fem.film.memory import Memory, incompressible, of_thickness
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.transient.collocation import radau
from tympan.geometry.specimen import FlowLaw


def settled(flow: FlowLaw, memory: Memory, begin: float, duration: float, stages: int
            ) -> tuple[StagedFlow, np.ndarray]:
    """A step along the path, iterated until it is what it says, and C at its stages."""
    rule = radau(stages)
    c = path(begin + duration * rule.nodes)[:, :, None]
    staged = StagedFlow.of(memory, path(begin)[:, None], duration, rule.matrix)
    for _ in range(60):
        *_, staged = staged.stress(c)
    return staged, c


def pull(staged: StagedFlow, c: np.ndarray) -> np.ndarray:
    """S of the branches."""
    plane, thick, *_ = staged.stress(c, slopes=False)
    return plane + of_thickness(c, thick, tangent=False)[0]


def begun(flow: FlowLaw) -> Memory:
    """Not relaxed at C: there a viscosity need not be smooth."""
    return Memory.relaxed(film(flow), path(-0.6)[:, None])


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
@pytest.mark.parametrize("stages", [2, 3])
def test_a_homogeneous_film_flows_by_its_equation_with_the_rules_order(flow: FlowLaw, stages: int
                                                                       ) -> None:
    exact = solve_ivp(lambda time, viscous: rate(path(time), viscous, flow), (0.0, 2.0),
                      incompressible(path(-0.6)), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    errors = []
    for steps in (8, 16, 32):
        memory = begun(flow)
        for begin in np.linspace(0.0, 2.0, steps + 1)[:-1].tolist():
            staged, c = settled(flow, memory, begin, 2.0 / steps, stages)
            memory = staged.after(c)[-1]
        errors.append(np.abs(memory.viscous[:, 0, 0] - exact).max())
    assert (-np.diff(np.log2(errors)) > 2 * stages - 1.5).all()
    assert errors[-1] < 1e-4


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_stress_derives_from_what_is_stored(flow: FlowLaw) -> None:
    """2 ∂/∂C of what the branch stores at a stage with the memory it has there."""
    staged, c = settled(flow, begun(flow), 0.0, 0.7, 3)
    stress = pull(staged, c)
    for stage, memory in enumerate(staged.after(c)):
        for number, weight in enumerate((2.0, 2.0, 1.0)):
            change = 1e-30j * np.eye(3)[number][:, None]
            slope = np.imag(memory.energy(c[:, stage] + change)) / 1e-30
            assert weight * slope == pytest.approx(stress[number, stage], rel=1e-9,
                                                   abs=1e-9 * MODULUS)


def test_slopes_are_those_of_differences() -> None:
    """By C of the stage itself anywhere, by C of the others where it is the same at all."""
    staged, c = settled(SAMPLES["constant"], begun(SAMPLES["constant"]), 0.0, 0.7, 3)
    alike = np.repeat(c[:, -1:], 3, axis=1)
    for at, others in ((c, False), (alike, True)):
        _, thick, slopes, _ = staged.stress(at)
        assert slopes is not None
        _, here = of_thickness(at, thick)
        assert here is not None
        for stage, other in [(i, j) for i in range(3) for j in range(3) if others or i == j]:
            slope = staged.weights[0, stage, other] * slopes[:, :, 0, stage, 0]
            if stage == other:
                slope = slope + here[:, :, stage, 0]
            for number, weight in enumerate((2.0, 2.0, 1.0)):
                change = np.zeros_like(c)
                change[number, other] = 1e-6
                ends = [pull(staged, at + sign * change) for sign in (1, -1)]
                exact = weight * (ends[0] - ends[1])[:, stage, 0] / 2e-6
                assert slope[:, number] == pytest.approx(exact, rel=1e-6, abs=1e-6 * MODULUS)


def test_a_branch_much_faster_than_the_step_has_forgotten() -> None:
    memory = begun(SAMPLES["constant"])
    fast = Memory(memory.moduli, 1e-9 * memory.times, memory.viscous)
    staged, c = settled(SAMPLES["constant"], fast, 0.0, 0.7, 3)
    stress = pull(staged, c)
    assert np.abs(stress).max() < 1e-6 * MODULUS
    assert staged.after(c)[-1].viscous[:, 0] == pytest.approx(incompressible(c[:, -1]), rel=1e-6)
