"""A lumped film that charges through a resistance, past which some of it leaks."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.support.biases import COARSE
from tests.support.lumped import MODELS
from tests.support.specimens import circular
from tympan.fem.rig import Rig
from tympan.studies.case import Case, solve
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.build import BuildSettings, build
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.model_file import STILL
from tympan.studies.lumped.plants import LumpedPlant
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import Pieces, step
from tympan.studies.transient import TransientCase, respond

#: Some 60 ms for the film, of which the leak takes a tenth of the voltage.
RIG = Rig(series_resistance=2e8, leakage_resistance=1.8e9, plate_damping=0.1)
STEPS = Pieces(np.array([0.0, 0.1, 0.1, 0.5, 0.5, 0.8]),
               np.array([1e3, 1e3, 3.5e3, 3.5e3, 0.0, 0.0]))


@pytest.fixture(params=["membrane circles", "tape"])
def slow(request: pytest.FixtureRequest) -> Actuator:
    return replace(MODELS[request.param], rig=RIG)


def test_rates_have_their_derivatives(slow: Actuator) -> None:
    state = slow.rest(3e-3, 3e3) * np.linspace(0.9, 1.1, slow.size)
    state[1] = 0.02
    slopes = slow.linear(state, 2.5e3)[1]
    assert state.shape == (slow.size,)
    for number, value in enumerate(state):
        ahead, behind = state.copy(), state.copy()
        ahead[number] += 1e-5 * value
        behind[number] -= 1e-5 * value
        change = slow.linear(ahead, 2.5e3)[0] - slow.linear(behind, 2.5e3)[0]
        found = change / (2e-5 * value)
        assert found == pytest.approx(slopes[:, number], abs=1e-7 * np.abs(slopes[:, number]).max())
    higher, lower = (slow.linear(state, volts)[0] for volts in (2.501e3, 2.499e3))
    assert (higher - lower) / 2 == pytest.approx(slow.by_voltage(state, 2.5e3), rel=1e-6)


def test_the_leak_takes_its_share_at_rest(slow: Actuator) -> None:
    """Where the film rests nothing moves; it is the rest of a film under nine tenths."""
    resting = rest(slow, 3e3)
    assert resting == pytest.approx(rest(replace(slow, rig=Rig(plate_damping=0.1)), 2.7e3))
    rates = slow.linear(slow.rest(resting, 3e3), 3e3)[0]
    assert rates == pytest.approx(np.zeros(slow.size), abs=1e-9)


def test_a_motion_is_scipys(slow: Actuator) -> None:
    """Of every piece of the signal, by another method, to 1 nm."""
    motion, state = simulate(slow, STEPS), slow.rest(rest(slow, 1e3), 1e3)
    for (begin, end), volts in zip(pairwise(STEPS.breaks), (1e3, 3.5e3, 0.0), strict=True):
        time = np.linspace(begin, end, 40, endpoint=False)
        done = solve_ivp(lambda _, at, volts=volts: slow.linear(at, volts)[0], (begin, end), state,
                         "DOP853", rtol=1e-10, atol=1e-14, t_eval=[*time, end])
        assert motion.deflection(time) == pytest.approx(done.y[0, :-1], abs=1e-9)
        state = done.y[:, -1]


@pytest.mark.parametrize("resistance", [1.0, 1e3, 1e5])
def test_a_film_that_charges_soon_moves_as_one_that_does_at_once(resistance: float) -> None:
    """To the way of the plate in the charging time, from next to nothing to a tenth of a ms."""
    model = MODELS["membrane circles"]
    late = replace(model, rig=replace(model.rig, series_resistance=resistance))
    time = np.linspace(0.1, 0.4, 300)
    apart = (simulate(late, STEPS).deflection(time) - simulate(model, STEPS).deflection(time))
    speed = np.abs(simulate(model, STEPS).state(time)[:, 1]).max()
    charging = late.rig.circuit.time(late.capacitance(0.0))
    assert np.abs(apart).max() < 1.5 * charging * speed + 2e-11


def test_small_motions_have_the_gain_at_rest_and_a_pole_that_charges(slow: Actuator) -> None:
    for voltage in (0.0, 3e3):
        linear = linearise(slow, voltage, by="U2")
        at_rest = -(linear.c @ np.linalg.solve(linear.a, linear.b))[0, 0]
        assert linear.gain == pytest.approx(at_rest, rel=1e-6)
        assert linear.states[-1] == "charge"
        assert len(linear.states) == len(linear.a)
        charging, = (pole for pole in linear.named_poles if pole.name == "charging")
        time = slow.rig.circuit.time(slow.capacitance(linear.deflection))
        assert charging.time == pytest.approx(float(time), rel=0.05)
        assert sum(pole.share or 0.0 for pole in linear.named_poles) == pytest.approx(1, rel=1e-6)


def test_a_plants_steps_are_the_motion(slow: Actuator) -> None:
    plant = LumpedPlant.resting(slow, 1e3).after(3.5e3, 0.02).after(3.5e3, 0.02).after(0.0, 0.05)
    held = Pieces(np.array([0.0, 0.04, 0.04, 0.09]), np.array([3.5e3, 3.5e3, 0.0, 0.0]))
    begun = slow.rest(rest(slow, 1e3), 1e3)
    there = simulate(slow, held, begun).deflection(np.array([0.09]))[0]
    assert float(plant.deflection) == pytest.approx(there, abs=2e-9)


def test_plate_and_charge_move_as_finite_elements_have_it() -> None:
    """At rest, and in time over a step, to 3e-3 of the stroke: swings of other frequency drift."""
    film, mass = circular(), 17.9e-3
    rig = replace(RIG, plate_damping=0.5)
    loads = BuildSettings((mass,), (0.0, 2e3, 4e3))
    model = replace(build(film, COARSE, loads, rig, in_time=False).model, viscous=STILL)
    signal = step(0.0, 4e3, 0.0, 0.3)
    case = TransientCase(film, signal, mass=mass, rig=rig, inertia=True)
    done = respond(case, COARSE, 5e-3)[0]
    time = done.samples["t"].to_numpy()
    apart = (simulate(model.actuator(mass, rig), signal).deflection(time)
             - done.samples["displacement"].to_numpy())
    assert np.abs(apart).max() < 3e-3 * np.ptp(done.samples["displacement"])
    resting = solve(Case(film, mass=mass, voltage=4e3, rig=rig), COARSE).deflection_m
    assert rest(model.actuator(mass, rig), 4e3) == pytest.approx(resting, rel=2e-4)
