"""Newton's method by one tangent, that of another state near or far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.models import model
from tests.support.specimens import circular
from tympan.fem.equilibrium import tangent as tangents
from tympan.fem.equilibrium.constraints import held_charge, held_plate
from tympan.fem.equilibrium.newton import NewtonSettings, newton, simplified_newton, tangent_at
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
