"""Every registered flow of viscous branches: its viscosity, its integration, its file."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.support.flowing_film import SAMPLES, film, path, rate
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.fem.film.flows import ShearThinning
from tympan.fem.film.library import load_specimen
from tympan.fem.film.memory import Memory, incompressible
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.specimen import FLOWS, ConstantFlow, FlowLaw


def marched(flow: FlowLaw, steps: int, end: float = 4.0) -> Memory:
    """By equal steps; where each ends is foreseen along the straight line of the one before."""
    memory, times = Memory.relaxed(film(flow), path(0.0)), np.linspace(0.0, end, steps + 1)
    for number, (begin, finish) in enumerate(pairwise(times)):
        before = path(times[max(0, number - 1)])
        ahead = 2 * path(begin) - before if number else path(begin)
        memory = memory.step(path(begin), finish - begin, ahead).after(path(finish))
    return memory


def test_every_flow_is_held_to_this() -> None:
    assert set(SAMPLES) == set(FLOWS)
    assert all(flow.flow == name for name, flow in SAMPLES.items())


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_a_dashpot_at_rest_has_the_viscosity_of_its_time(flow: FlowLaw) -> None:
    assert flow.relative_viscosity(3.0, 0.0) == pytest.approx(1.0, rel=1e-12)
    stretches, stresses = np.meshgrid(np.linspace(3, 50, 20), np.geomspace(1e-3, 1e12, 20))
    assert np.all(np.asarray(flow.relative_viscosity(stretches, stresses)) > 0)


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_a_homogeneous_film_flows_by_its_equation_with_second_order(flow: FlowLaw) -> None:
    exact = solve_ivp(lambda time, viscous: rate(path(time), viscous, flow), (0.0, 4.0),
                      incompressible(path(0.0)), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    misses = [np.abs(marched(flow, steps).viscous[:, 0] - exact).max() for steps in (80, 160, 320)]
    assert -np.diff(np.log2(misses)) == pytest.approx([2.0, 2.0], abs=0.15)
    assert misses[-1] < 1e-3


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_the_update_has_this_derivative(flow: FlowLaw) -> None:
    """By the complex step and by differences, of C_v at the end of a step and of its potential."""
    step = marched(flow, 20).step(path(4.0), 0.4, path(4.4))
    c, tiny, small = path(4.4), 1e-30, 1e-6
    _, stress, _ = step.density(c)
    for number, weight in enumerate((2.0, 2.0, 1.0)):
        unit = np.eye(3)[number]
        exact = np.imag(step.after(c + 1j * tiny * unit).viscous) / tiny
        ends = [step.after(c + sign * small * unit).viscous for sign in (1, -1)]
        assert exact == pytest.approx((ends[0] - ends[1]) / (2 * small), rel=1e-6, abs=1e-8)
        slope = np.imag(step.density(c + 1j * tiny * unit, tangent=False)[0]) / tiny
        assert weight * slope == pytest.approx(float(stress[number]), rel=1e-9)


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_what_a_held_film_stores_less_is_heat(flow: FlowLaw) -> None:
    memory, c, duration = marched(flow, 20), path(4.3), 1e-4
    after = memory.step(c, duration, c).after(c)
    stored = (memory.energy(c) - after.energy(c)) / duration
    assert stored == pytest.approx((memory.dissipation(c) + after.dissipation(c)) / 2, rel=1e-6)
    assert stored > 0


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_a_film_held_since_it_was_stretched_relaxes_by_its_equation(flow: FlowLaw) -> None:
    for age in (0.5, 20.0):
        made = Memory.mounted(film(flow, mounted=age), (2,)).viscous[:, 0, 1]
        exact = solve_ivp(lambda _, viscous: rate((4.0, 2.25, 0.0), viscous, flow), (0.0, age),
                          np.array([1.0, 1.0, 0.0, 1.0]), "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        assert made == pytest.approx(exact, rel=1e-7, abs=1e-9)
    old = Memory.mounted(film(flow, mounted=1e6), (1,)).viscous[:, 0, 0]
    assert old == pytest.approx(incompressible((4.0, 2.25, 0.0)), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("limit", [ShearThinning(1e12, 2.0), ShearThinning(1e3, 2.0, 1.0)],
                         ids=["no stress reaches it", "nothing falls"])
def test_shear_thinning_has_a_constant_viscosity_as_its_limit(limit: FlowLaw) -> None:
    exact = marched(ConstantFlow(), 40).viscous
    assert marched(limit, 40).viscous == pytest.approx(exact, rel=1e-9)


def test_stress_makes_a_film_relax_sooner_and_stretch_later() -> None:
    c, start = path(1.0), path(0.0)

    def left(flow: FlowLaw) -> float:
        memory = Memory.relaxed(film(flow), start)
        return float(memory.step(start, 1.0, c).after(c).energy(c)[()])

    usual = left(ConstantFlow())
    assert left(ShearThinning(1e3, 1.0)) < 0.9 * usual
    assert left(ShearThinning(1e12, 1.0, stretch_gain=1.0)) > 1.05 * usual


@pytest.mark.parametrize("flow", SAMPLES.values(), ids=SAMPLES)
def test_files_say_it(flow: FlowLaw, tmp_path: Path) -> None:
    specimen = circular()
    specimen = replace(specimen, membrane=replace(specimen.membrane, branches=film(flow).branches))
    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(specimen), encoding="utf-8")
    assert load_specimen(file) == specimen
    assert ('flow = "shear_thinning"' in file.read_text()) == (flow != ConstantFlow())


@pytest.mark.parametrize(("key", "value"), [
    ("flow", '"runny"'), ("thinning_stress", '"0 Pa"'), ("thinning_stress", '"1 s"'),
    ("thinning_exponent", "0"), ("least_viscosity", "1.5"), ("stretch_gain", "-1")])
def test_flows_that_cannot_be_are_refused(key: str, value: str, tmp_path: Path) -> None:
    specimen = circular()
    branches = film(SAMPLES["shear_thinning"]).branches
    specimen = replace(specimen, membrane=replace(specimen.membrane, branches=branches))
    lines = [f"{key} = {value}" if line.startswith(f"{key} =") else line
             for line in specimen_to_toml(specimen).splitlines()]
    file = tmp_path / "film.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=key) as refusal:
        load_specimen(file)
    assert str(file) in str(refusal.value)
