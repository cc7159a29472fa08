"""Films in time against the axisymmetric equations, which are solved by other means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.creeping import CREEPS, EXACT, FORCE, MASS, TIMES, film, moved, stepped
from tympan.fem.results.fields import edge_fields
from tympan.fem.rig import Rig
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.outlines import Ellipse
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, solve
from tympan.studies.transient import TransientCase, begun, history, solve_after


def test_the_equations_give_the_references() -> None:
    """Of design.md, found by finite elements in the radius with Runge and Kutta's method."""
    assert 1e3 * EXACT.history((0.0, 0.0), (FORCE, 0.0), TIMES) == pytest.approx(
        [2.08046196, 2.08371222, 2.10257622, 2.11461561, 2.11725919], abs=2e-8)
    assert 1e3 * EXACT.history((FORCE, 0.0), (FORCE, 7e3), TIMES) == pytest.approx(
        [3.97638413, 4.00097386, 4.15764154, 4.28768234, 4.34206996], abs=2e-8)
    times = 1e-3 * np.array([10, 20, 50, 100, 200, 300])
    assert 1e3 * EXACT.swing(MASS, FORCE, 3500.0, times) == pytest.approx(
        [2.17852, 2.33599, 2.70598, 2.12816, 2.15817, 2.20574], abs=6e-6)


def test_a_film_creeps_under_weight_and_voltage() -> None:
    signal = stepped(0.0, 7e3, TIMES)
    fine = StepSettings(error=1e-6)
    done = moved(CREEPS, signal, steps=fine)
    exact = EXACT.history((FORCE, 0.0), (FORCE, 7e3), TIMES)
    assert done.at(done.deflection, np.r_[0.0, TIMES]) == pytest.approx(exact, rel=1e-6)
    loaded = moved(CREEPS, stepped(0.0, 0.0, TIMES), rest=0.0, steps=fine)
    exact = EXACT.history((0.0, 0.0), (FORCE, 0.0), TIMES)
    assert loaded.at(loaded.deflection, np.r_[0.0, TIMES]) == pytest.approx(exact, rel=1e-6)
    usual = moved(CREEPS, signal)
    assert len(usual.time) < 40
    assert usual.at(usual.deflection, np.r_[0.0, TIMES]) == pytest.approx(
        EXACT.history((FORCE, 0.0), (FORCE, 7e3), TIMES), rel=3e-6)


def test_a_plate_swings() -> None:
    """Also between the moments that are computed, and closely at once after the jump."""
    times = 1e-3 * np.r_[np.linspace(0.02, 2.0, 34), np.linspace(5.0, 150.0, 60)]
    exact = EXACT.swing(MASS, FORCE, 3500.0, times)
    misses = []
    for error in (1e-5, 1e-6, 1e-7):
        done = moved(CREEPS, stepped(0.0, 3500.0, times[-1:]), inertia=True,
                     steps=StepSettings(error=error))
        misses.append(np.abs(done.at(done.deflection, times) - exact).max())
    assert misses[0] < 1e-6
    assert misses[1] < 3e-8
    assert misses[2] < 5e-9


def test_fast_branches_and_slow_ones_leave_the_film_elastic() -> None:
    """At once at its rest, or for ever where a stiffer film would be."""
    end = np.array([1.0])
    at_rest = solve(Case(film(), mass=MASS, voltage=5e3), Settings()).deflection_m
    fast = moved(film(ViscousBranch(200e3, 1e-6)), stepped(0.0, 5e3, end))
    assert fast.deflection[-1] == pytest.approx(at_rest, rel=1e-7)
    slow = moved(film(ViscousBranch(200e3, 1e9)), stepped(0.0, 5e3, end))
    assert np.ptp(slow.deflection) < 1e-9
    assert slow.deflection[-1] < 0.985 * at_rest
    none = moved(film(), stepped(0.0, 5e3, end))
    assert none.deflection[-1] == pytest.approx(at_rest, rel=1e-9)


def test_equal_steps_are_of_second_order_and_what_is_gone_on_from_of_third() -> None:
    end, stiff = 30.0, replace(EXACT, branch=1e6)
    exact = stiff.history((FORCE, 0.0), (FORCE, 7e3), np.array([end]))[-1]
    case = TransientCase(film(ViscousBranch(1e6, 10.0)), stepped(0.0, 7e3, np.array([end])),
                         mass=MASS, steps=StepSettings(error=1e-6))
    transient, state, memory = begun(case, Settings())
    start = next(transient.moments(state, memory))

    def miss(count: int, doubled: bool) -> float:
        past = [start]
        for _ in range(count):
            following = (transient.step(past[-3:], 0, end / count)[0] if doubled else
                         transient.implicit_step(past[-3:], 0, end / count))
            past.append(following[0])
        return abs(past[-1].state.plate.deflection - exact)

    single = [miss(count, False) for count in (4, 8, 16)]
    assert -np.diff(np.log2(single)) == pytest.approx([2.0, 2.0], abs=0.15)
    twice = [miss(count, True) for count in (2, 4)]
    assert np.log2(twice[0] / twice[1]) > 2.6
    assert twice[1] < single[1] / 50


def test_freedoms_that_symmetry_takes_away_stay_at_rest() -> None:
    """Rounding in them would grow with each step, until it overflows."""
    whole = film(ViscousBranch(1e4, 1.0))
    aside = replace(whole, plate=replace(whole.needed_plate(), offset=(3e-3, 0.0)))
    case = TransientCase(aside, stepped(0.0, 3500.0, np.array([0.1])), mass=MASS, inertia=True)
    transient, state, memory = begun(case, Settings())
    taken = np.setdiff1d(np.arange(6), transient.model.plate_freedoms)
    moments = list(transient.moments(state, memory))
    assert len(taken) == 3
    assert len(moments) > 20
    assert max(np.abs(moment.rate).max() for moment in moments) > 1e-3
    assert all((moment.rate[taken] == 0).all() for moment in moments)
    assert all((moment.velocity[taken] == 0).all() for moment in moments)


def test_a_turned_specimen_moves_alike() -> None:
    """By a quarter of a circle, with unequal prestretches that still relax."""
    heaves = []
    for axes, prestretch in (((60e-3, 45e-3), (2.4, 2.0)), ((45e-3, 60e-3), (2.0, 2.4))):
        membrane = replace(CREEPS.membrane, prestretch=prestretch, mounted=5.0)
        turned = replace(CREEPS, frame=Ellipse(axes), membrane=membrane)
        done = moved(turned, stepped(0.0, 5e3, np.array([20.0])))
        heaves.append(done.at(done.deflection, np.linspace(0.0, 20.0, 9)))
    assert heaves[0] == pytest.approx(heaves[1], rel=2e-6)
    assert np.ptp(heaves[0]) > 1e-4


def test_a_film_mounted_a_while_ago_is_stiffer() -> None:
    """Its branches still pull with the prestretch; after long they are relaxed."""
    end = np.array([1e-3])
    heaves = []
    for age in (0.0, 5.0, 20.0, 1e5):
        specimen = replace(CREEPS, membrane=replace(CREEPS.membrane, mounted=age))
        heaves.append(moved(specimen, stepped(0.0, 0.0, end)).deflection[-1])
    assert np.all(np.diff(heaves) > 0)
    relaxed = moved(CREEPS, stepped(0.0, 0.0, end), rest=0.0).deflection[-1]
    assert heaves[-1] == pytest.approx(relaxed, rel=1e-9)


def test_a_film_charges_through_a_resistance() -> None:
    """U = U₀ (1 − e^(−t/RC)) of a film that hardly moves; one half of the source's work is lost."""
    stiff = film()
    resistance = 1e9
    end = np.array([3.0])
    capacitance = solve(Case(stiff, mass=1e-3, voltage=100.0), Settings()).capacitance_F
    assert capacitance is not None
    done = history(TransientCase(stiff, stepped(0.0, 100.0, end), mass=1e-3,
                                 rig=Rig(series_resistance=resistance)), Settings())
    when = np.linspace(0.05, 3.0, 30)
    exact = 100.0 * (1 - np.exp(-when / (resistance * capacitance)))
    assert done.at(done.voltage, when) == pytest.approx(exact, abs=0.02)


@pytest.mark.study(seconds=4)
def test_a_film_that_thins_after_a_while_says_when() -> None:
    """Its branches hold it for a time where it has no equilibrium at rest."""
    limit = solve(Case(film(), mass=MASS, voltage=9.5e3), Settings())
    assert limit.status == "no_equilibrium"
    assert "thins without bound" in limit.warnings[0]
    done = moved(CREEPS, stepped(0.0, 9.5e3, np.array([1000.0])))
    assert done.stopped is not None
    assert done.stopped.kind == "thinning"
    assert 0 <= done.stopped.time < 1000.0


def test_solve_after_a_time_is_on_the_way_to_rest() -> None:
    case = Case(CREEPS, mass=MASS, voltage=7e3)
    deflections = [solve_after(case, after, Settings()).deflection_m
                   for after in (0.0, 1.0, 30.0)]
    exact = EXACT.history((FORCE, 0.0), (FORCE, 7e3), TIMES)
    assert deflections == pytest.approx(exact[[0, 1, 3]], rel=1e-5)
    assert solve_after(case, 1e4, Settings()).deflection_m == pytest.approx(
        solve(case, Settings()).deflection_m, rel=1e-5)


def test_solve_after_says_when_the_film_pulled_in() -> None:
    pulled = solve_after(Case(CREEPS, mass=MASS, voltage=12e3), 100.0, Settings())
    assert pulled.status == "no_equilibrium"
    assert "after" in pulled.warnings[0]


@pytest.mark.parametrize("specimen", [CREEPS, replace(CREEPS, frame=Ellipse((60e-3, 45e-3)))],
                         ids=["circle", "ellipse"])
def test_stresses_of_a_film_that_creeps_carry_the_load(specimen: Specimen) -> None:
    """Those at the plate's edge, of nodes' memory, on the whole film as on a meshed quarter."""
    case = TransientCase(specimen, stepped(0.0, 6e3, TIMES[:1]), mass=MASS)
    transient, state, memory = begun(case, Settings())
    *_, last = transient.moments(state, memory)
    edge, weights = edge_fields(transient.remembering(last), last.state, "plate", quadrature=True)
    assert edge.plate_traction[:, 2] @ weights == pytest.approx(FORCE, rel=2e-3)
    rest, weights = edge_fields(transient.model, last.state, "plate", quadrature=True)
    assert rest.plate_traction[:, 2] @ weights != pytest.approx(FORCE, rel=2e-3)


@pytest.mark.parametrize("inertia", [False, True])
def test_the_energy_balance_closes(inertia: bool) -> None:
    """Between jumps, and with the errors of the steps: 1e-8 of the work done."""
    rig = Rig(plate_damping=0.05) if inertia else Rig()
    signal = stepped(0.0, 5e3, np.array([0.05 if inertia else 30.0]))
    misses = []
    for error in (1e-6, 1e-8):
        done = moved(CREEPS, signal, rig=rig, inertia=inertia, steps=StepSettings(error=error))
        balance = done.balance
        work = balance.load_work_J + balance.electrical_work_J
        assert work == pytest.approx(balance.stored_J + balance.kinetic_J + balance.heat_J
                                     + balance.jumps_J + balance.unexplained_J, rel=1e-12)
        assert balance.heat_J > 0
        assert balance.jumps_J > 0
        misses.append(abs(balance.unexplained_J) / work)
    assert misses[1] < 1e-8
    assert misses[1] < misses[0] / 10
