"""Newton's method by one tangent, that of another state near or far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.models import model
from tests.support.specimens import circular
from tympan.fem.equilibrium import newton as newtons_method
from tympan.fem.equilibrium import tangent as tangents
from tympan.fem.equilibrium.constraints import held_charge, held_plate
from tympan.fem.equilibrium.newton import (
    NewtonSettings,
    moved,
    newton,
    simplified_newton,
    tangent_at,
)
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.rigid_plate import Swing

FORCE = 0.1755
SETTINGS = NewtonSettings()


@pytest.fixture(scope="module")
def film():
    return model(circular(NeoHooke(20e3)), refine=0.7)


def test_it_ends_where_newtons_method_does(film) -> None:
    start = equilibrium(film, FORCE, 5e3).solution
    guess = start.state.under(voltage=5.1e3**2)
    full = newton(film, guess)
    simple = simplified_newton(film, guess, tangent=start.tangent)
    assert simple.converged
    assert simple.tangent is start.tangent
    assert np.abs(simple.state.positions - full.state.positions).max() < 1e-6 * film.size
    fresh = simplified_newton(film, guess)
    assert fresh.tangent is not start.tangent
    assert np.abs(fresh.state.positions - full.state.positions).max() < 1e-6 * film.size


def test_a_load_that_is_not_given_is_found(film) -> None:
    start = equilibrium(film, FORCE, 5e3).solution
    charge = float(film.capacitance(start.state)) * 5.1e3
    simple = simplified_newton(film, start.state, ("voltage",), (held_charge(charge),))
    voltage = np.sqrt(simple.state.voltage_squared)
    assert film.capacitance(simple.state) * voltage == pytest.approx(charge, rel=1e-9)
    raised = simplified_newton(film, start.state, ("force",), (held_plate(4e-3),), tangent=
                             start.tangent)
    assert raised.state.plate.deflection == pytest.approx(4e-3, rel=1e-9)
    assert raised.tangent.free == ("force",)


def test_a_tangent_is_adapted_to_another_step_in_time(film) -> None:
    """Of a plate that swings, damped, while its film charges."""
    state = equilibrium(film, FORCE, 5e3).state
    charge = float(film.capacitance(state)) * 5e3
    tangents = []
    for step, further in ((1e-2, 1e-9), (1e-3, 3e-8)):
        swing = Swing(state.plate, *np.zeros((3, 6)), 0.02 * np.eye(6), 0.3 * np.eye(6), step)
        moving = replace(film, loading=replace(film.loading, swing=swing))
        tangents.append((moving, (held_charge(charge, further),)))
    (first, charged), (second, recharged) = tangents
    near, _ = tangent_at(first, state, ("voltage",), charged)
    fresh, _ = tangent_at(second, state, ("voltage",), recharged)
    adapted = near.adapted(second, [recharged[0](second, state)])
    assert adapted.plate_stiffness == pytest.approx(fresh.plate_stiffness, rel=1e-9)
    assert near.plate_stiffness != pytest.approx(fresh.plate_stiffness, rel=0.5)
    residual = film.residual(film.nodal_forces(state.under(voltage=0.0)), state)
    for motion, exact in zip(adapted.correct(residual, [1e-7])[0],
                             fresh.correct(residual, [1e-7])[0], strict=True):
        assert motion == pytest.approx(exact, rel=1e-7, abs=1e-12)


def test_a_tangent_from_afar_is_given_up(film) -> None:
    flat = newton(film, film.mounted())
    guess = equilibrium(film, FORCE, 5e3).state.under(voltage=6.5e3**2)
    assert simplified_newton(film, guess, tangent=flat.tangent) is None
    assert newton(film, guess).converged


def test_a_plate_is_held_further_down_by_the_tangent_at_hand(film) -> None:
    """The force of a fresh start, and the same after a way back, without new factors."""
    start = held(film, 4e-3).solution
    near = held(film, 4.2e-3, 1e3, start)
    afresh = held(film, 4.2e-3, 1e3)
    assert near.solution.tangent is start.tangent
    assert near.state.force == pytest.approx(afresh.state.force, rel=1e-7)
    far = held(film, 20e-3, 3e3, start)
    assert far.solution.tangent is not start.tangent
    assert held(film, 4e-3, 0.0, far.solution).state.force == pytest.approx(start.state.force,
                                                                            rel=1e-7)


def test_factors_of_a_large_film_are_kept_as_long_as_they_will_do(
        film, monkeypatch: pytest.MonkeyPatch) -> None:
    factorise, made = tangents._factorise, []

    def counted(*problem):
        made.append(problem)
        return factorise(*problem)

    monkeypatch.setattr(tangents, "_LARGE", 0)
    monkeypatch.setattr(tangents, "_factorise", counted)
    solution = held(film, 4e-3).solution
    for deflection in (4.1e-3, 4.2e-3, 4.3e-3):
        solution = held(film, deflection, start=solution).solution
    assert len(made) == 1


def test_between_two_states_the_mean_of_their_tangents_is_off_by_the_square(film) -> None:
    """Of what one is: half as far apart, corrections by one err half as much, by both a quarter."""
    start = equilibrium(film, FORCE, 4e3).solution
    errors = []
    for share in (0.2, 0.1, 0.05):
        middle, end = (equilibrium(film, FORCE, (1 + part * share) * 4e3, start=start).solution
                       for part in (0.5, 1.0))
        ends = [tangent_at(film, solution.state)[0] for solution in (start, end)]
        motion = 1e-6 * middle.rate(film, "voltage")[0] * middle.state.voltage_squared, np.zeros(1)
        residual = film.residual(
            film.nodal_forces(moved(film, middle.state, motion)), middle.state)
        back = [tangent.correct(residual, [])[0][0] for tangent in ends]
        squared = [solution.state.voltage_squared for solution in (start, middle, end)]
        weight = (squared[2] - squared[1]) / (squared[2] - squared[0])
        mean = weight * back[0] + (1 - weight) * back[1]
        errors.append([np.linalg.norm(correction + motion[0]) / np.linalg.norm(motion[0])
                       for correction in (back[1], mean)])
    by_one, by_both = np.log2(np.array(errors)[:-1] / np.array(errors)[1:]).T
    assert by_one == pytest.approx([1, 1], abs=0.3)
    assert by_both == pytest.approx([2, 2], abs=0.4)
    assert errors[0][1] < errors[0][0] / 5


def test_newton_ends_where_next_to_nothing_is_left(film, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tangent sooner than by its last correction, and at the same place to 1e-9."""
    start, saved = equilibrium(film, FORCE, 6e3).solution, 0
    for voltage in (6.1e3, 6.3e3, 6.48e3, 7e3):
        guess = start.predicted(film, "voltage", voltage**2)
        soon = newton(film, guess)
        with monkeypatch.context() as patch:
            patch.setattr(newtons_method, "_LEFT", 0.0)
            late = newton(film, guess)
        exact = newton(film, late.state, settings=NewtonSettings(1e-12, 1e-11))
        assert soon.converged
        assert exact.converged
        assert np.abs(soon.state.positions - exact.state.positions).max() < 1e-9 * film.size
        saved += late.iterations - soon.iterations
    assert saved >= 1
