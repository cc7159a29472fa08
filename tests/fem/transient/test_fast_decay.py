"""What decays much faster than a step: dampers and circuits, against equations and slow limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.support.creeping import (
    CREEPS,
    EXACT,
    FORCE,
    MASS,
    TIMES,
    moved,
    stepped,
)
from tympan.fem.membrane.damped_rule import end_weight
from tympan.fem.rig import Rig
from tympan.fem.transient.integrate import StepSettings
from tympan.studies.case import Settings
from tympan.studies.signals import Pieces, ramp
from tympan.studies.transient import TransientCase, begun, history

FINE = StepSettings(error=1e-6)

#: The error usually asked for [m], of a frame of 45 mm.
WITHIN = 45e-3 * StepSettings().error


def factor(decay: float, end: float) -> float:
    """Of y in a step of ẏ = −decay y of length 1."""
    return (1 - (1 - end) * decay) / (1 + end * decay)


def extrapolated(decay: float, weight: Callable[[float], float], foreseen: float) -> float:
    """Of y in a step that goes on from (4 halves − whole)/3."""
    half = factor(decay / 2, weight(foreseen / 2))
    return (4 * half**2 - factor(decay, weight(foreseen))) / 3


@pytest.mark.parametrize("wrong", [0.3, 1.0, 3.0])
def test_what_decays_within_a_step_is_forgotten(wrong: float) -> None:
    """Whole, in halves and extrapolated; also where its time is foreseen three times wrong."""
    decays = np.geomspace(1e-3, 1e9, 400)
    grown = np.array([extrapolated(decay, end_weight, wrong * decay) for decay in decays])
    assert np.all(np.abs(grown) < 1)
    assert np.abs(grown[decays > 10]).max() < 0.75
    assert np.abs(grown[decays > 1e3]).max() < 0.01
    plain = [extrapolated(decay, lambda _: 0.5, decay) for decay in decays[decays > 1e3]]
    assert min(plain) > 1.6


def driven(decay: float, step: float, count: int, foreseen: float) -> float:
    """y at the end of so many steps of ẏ = −decay (y − cos t), y = 0 at first."""
    y, time, end = 0.0, 0.0, end_weight(step * foreseen)
    for _ in range(count):
        explicit = y - step * (1 - end) * decay * (y - np.cos(time))
        time += step
        y = (explicit + step * end * decay * np.cos(time)) / (1 + step * end * decay)
    return y


def test_the_rule_is_of_second_order_and_of_fourth_extrapolated() -> None:
    """Whatever the time it is damped for."""
    decay, end = 3.0, 2.0
    exact = ((decay**2 * np.cos(end) + decay * np.sin(end))
             - decay**2 * np.exp(-decay * end)) / (1 + decay**2)
    for foreseen in (decay, 5 * decay):
        plain = np.array([driven(decay, end / count, count, foreseen) for count in (40, 80, 160)])
        assert -np.diff(np.log2(np.abs(plain - exact))) == pytest.approx([2, 2], abs=0.1)
        better = np.abs(plain[1:] + np.diff(plain) / 3 - exact)
        assert -np.diff(np.log2(better)) == pytest.approx([4], abs=0.2)


def test_a_damper_alone_holds_a_plate_without_inertia() -> None:
    """At a jump of the voltage it stays where it is, and then creeps to where it would rest."""
    damper, times = 8.0, np.r_[np.geomspace(1e-3, 1.0, 20), 2.0, 3.0]
    exact = EXACT.swing(0.0, FORCE, 7e3, times, damper)
    done = moved(CREEPS, stepped(0.0, 7e3, times[-1:]), rig=Rig(plate_damping=damper), steps=FINE)
    assert done.deflection[0] == pytest.approx(EXACT.at_rest(FORCE, 0.0, None)[0][-1], rel=1e-6)
    assert done.at(done.deflection, times) == pytest.approx(exact, rel=1e-6)


def test_a_plate_swings_little_in_a_strong_damper() -> None:
    damper, times = 4.0, np.linspace(0.02, 0.4, 20)
    exact = EXACT.swing(MASS, FORCE, 7e3, times, damper)
    done = moved(CREEPS, stepped(0.0, 7e3, times[-1:]), rig=Rig(plate_damping=damper),
                 inertia=True, steps=FINE)
    assert done.at(done.deflection, times) == pytest.approx(exact, abs=2e-8)


@pytest.mark.parametrize("rig", [
    Rig(plate_damping=1e-4), Rig(series_resistance=1e4),
    Rig(plate_damping=1e-2, series_resistance=1e6)], ids=["damper", "circuit", "both"])
def test_what_decays_at_once_leaves_creep_alone(rig: Rig) -> None:
    """Within microseconds or milliseconds: nothing rings, or asks for steps, for 100 s."""
    done = moved(CREEPS, stepped(0.0, 7e3, TIMES[-1:]), rig=rig)
    assert len(done.time) < 100
    exact = EXACT.history((FORCE, 0.0), (FORCE, 7e3), TIMES)[2:]
    assert done.at(done.deflection, TIMES[1:]) == pytest.approx(exact, abs=WITHIN)


def test_inertia_that_a_damper_stops_within_a_millisecond_leaves_it_alone() -> None:
    """For 100 s; in the first of them the plate is still on its way."""
    rig, signal = Rig(plate_damping=30.0, series_resistance=1e6), stepped(0.0, 7e3, TIMES[-1:])
    done = moved(CREEPS, signal, rig=rig, inertia=True)
    assert len(done.time) < 120
    without = moved(CREEPS, signal, rig=rig, steps=FINE)
    when = np.linspace(0.5, 100.0, 200)
    assert done.at(done.deflection, when) == pytest.approx(
        without.at(without.deflection, when), abs=2 * WITHIN)


def test_velocity_and_current_are_those_of_the_creep() -> None:
    """Not only where the plate is: heat and current follow too, and jumps leave nothing behind."""
    rig = Rig(plate_damping=1e-4, series_resistance=1e6)
    case = TransientCase(CREEPS, ramp(3e3, 6e3, 200.0), mass=MASS, rig=rig)
    transient, state, memory = begun(case, Settings())
    moments = [moment for moment in transient.moments(state, memory) if 1.0 < moment.time < 99.0]
    time = np.array([moment.time for moment in moments])
    assert len(time) < 20
    bare = history(replace(case, rig=Rig(), steps=FINE), Settings())
    before, after = time - 1e-2, time + 1e-2
    speed = (bare.at(bare.deflection, after) - bare.at(bare.deflection, before)) / 2e-2
    velocity = np.array([moment.velocity[2] for moment in moments])
    assert velocity == pytest.approx(speed, rel=0.1)
    charge = bare.capacitance * bare.voltage
    current = (bare.at(charge, after) - bare.at(charge, before)) / 2e-2
    assert np.array([moment.current for moment in moments]) == pytest.approx(current, rel=2e-3)


def test_a_damper_turns_the_work_of_a_jump_into_heat() -> None:
    """So a plate without inertia loses nothing at once but what the source loses in the film."""
    signal, misses = stepped(0.0, 5e3, np.array([3.0])), []
    for error in (1e-6, 1e-8):
        done = moved(CREEPS, signal, rig=Rig(plate_damping=5.0), steps=StepSettings(error=error))
        balance = done.balance
        assert balance.heat_J > 0
        misses.append(abs(balance.unexplained_J)
                      / (balance.load_work_J + balance.electrical_work_J))
    assert misses[1] < 1e-8
    assert misses[1] < misses[0] / 5


def test_a_damper_of_a_microsecond_turns_into_heat_what_else_is_lost_at_once() -> None:
    """Though after that the moments are far apart for 100 s."""
    signal = stepped(0.0, 5e3, np.array([100.0]))
    without = moved(CREEPS, signal).balance
    for damper in (1e-4, 0.1):
        damped = moved(CREEPS, signal, rig=Rig(plate_damping=damper), steps=FINE).balance
        less = without.jumps_J - damped.jumps_J  # all but what charging the film takes
        assert less > 10 * without.heat_J
        assert damped.heat_J - without.heat_J == pytest.approx(less, rel=0.01)
        assert abs(damped.unexplained_J) < 1e-4 * damped.electrical_work_J


def test_a_film_charges_by_a_source_of_either_sign_and_through_none() -> None:
    """From 3 kV to −3 kV as a capacitor does, since the film hardly moves; with few steps."""
    rig, times = Rig(series_resistance=1e8), np.array([0.0, 0.0, 4.0, 4.0, 8.0])
    there, back = (moved(CREEPS, Pieces(times, sign * np.array([0.0, 3e3, 3e3, -3e3, -3e3])),
                         rig=rig, steps=FINE) for sign in (1, -1))
    assert (there.deflection == back.deflection).all()
    assert (there.current == -back.current).all()
    assert len(there.time) < 150
    when = np.linspace(4.0, 6.0, 101)[1:]
    late = 1e8 * there.capacitance[-1]
    across = np.abs(-3e3 + 6e3 * np.exp(-(when - 4.0) / late))
    near = np.interp(when, there.time, there.voltage)
    far = np.abs(when - 4.0 - late * np.log(2)) > 0.1  # of 0, where the magnitude has a kink
    assert there.at(there.voltage, when)[far] == pytest.approx(across[far], abs=0.03 * 3e3)
    assert near[-1] == pytest.approx(3e3, rel=1e-4)
    assert there.deflection[-1] == pytest.approx(there.at(there.deflection, np.array([3.99]))[0],
                                                 rel=5e-3)
