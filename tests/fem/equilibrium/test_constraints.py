"""Equations in place of loads: derivatives, a held plate, a charge kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.axisymmetric import RitzExpansion, fold_point
from tests.oracles.unstable_branch import SOFT, WEIGHT, branch_points, voltage_at
from tests.support.models import loaded, model
from tests.support.specimens import circular, reference_film
from tympan.fem.equilibrium.constraints import (
    Constraint,
    arc_length,
    difference,
    held_charge,
    held_plate,
    length,
)
from tympan.fem.equilibrium.newton import moved, newton
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.equilibrium.subspace import SmoothSubspace
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model


def arc(film: Model) -> Constraint:
    """A direction in all unknowns from a state a little before."""
    rng = np.random.default_rng(5)
    direction = (rng.normal(size=film.discretisation.free_count),
                 np.array([1e-3, 2e-3, 3e-3, 0.1, -0.2, 0.3]))
    return arc_length(loaded(film), direction, 1e-3)


@pytest.mark.parametrize("name", ["heave", "charge", "arc"])
def test_equations_derivatives(skewed_model: Model, name: str) -> None:
    """Second order of what remains of the miss without its linear part, free loads included."""
    film = skewed_model
    control = {"heave": held_plate(3e-3), "charge": held_charge(1e-6), "arc": arc(film)}[name]
    state = loaded(film)
    at = control(film, state)
    rng = np.random.default_rng(1)
    inner = 1e-3 * rng.normal(size=film.discretisation.free_count)
    plate = np.array([1e-3, -1e-3, 2e-3, 0.2, 0.3, -0.2])
    slope = at.by_motion[0] @ inner + at.by_motion[1] @ plate + at.by_load.get("voltage", 0.0) * 2e6
    errors = []
    for step in (0.02, 0.01):
        there = moved(film, state, (inner, plate), step, {"voltage": 2e6})
        errors.append(abs(control(film, there).miss - at.miss - step * slope))
    assert errors[1] <= max(errors[0] / 3.5, 1e-12 * abs(slope))


def test_a_charge_gives_the_state_of_its_voltage() -> None:
    film = model(circular(SOFT))
    charged = equilibrium(film, WEIGHT, 5000.0).solution
    charge = film.capacitance(charged.state) * 5000.0
    start = equilibrium(film, WEIGHT, 4000.0).state
    solution = newton(film, start, ("voltage",), (held_charge(charge),))
    assert solution.converged
    assert np.sqrt(solution.state.voltage_squared) == pytest.approx(5000.0, rel=1e-9)
    assert np.allclose(solution.state.positions, charged.state.positions, atol=1e-10)


def test_a_heave_is_the_one_asked_for_also_with_an_offset_weight(skewed_model: Model) -> None:
    film = replace(skewed_model, loading=Loading(arm=(2e-3, 1e-3)))
    outcome = held(film, 6e-3, 2000.0)
    assert outcome.status == "equilibrium"
    assert outcome.state.plate.deflection == pytest.approx(6e-3, abs=1e-12)
    again = equilibrium(film, outcome.state.force, 2000.0).state
    assert again.plate.deflection == pytest.approx(6e-3, rel=1e-7)


def test_charge_passes_the_voltage_s_limit() -> None:
    """Charge grows along the whole branch, the voltage only to its limit.

    Beyond it the states are those of the Ritz method, unstable at constant voltage.
    """
    film = model(circular(SOFT))
    smooth = SmoothSubspace.of(film, 0)
    points = branch_points(film, smooth, longest=6e-3)
    last = next(index for index, point in enumerate(points) if point.rate < 0)
    below = points[last - 6].state
    voltage = np.sqrt(below.voltage_squared)
    charge = film.capacitance(below) * voltage
    fold = fold_point(RitzExpansion(reference_film(SOFT), 40), WEIGHT)
    state, near, seen = below, (fold.c, fold.q), []
    for share in (1.0, 1.02, 1.04, 1.05, 1.06):
        solution = newton(film, state, ("voltage",), (held_charge(share * charge),),
                          subspace=smooth)
        assert solution.converged
        state = solution.state
        seen.append((state, solution.tangent.negative))
    voltages = [each[0].voltage_squared for each in seen]
    heaves = [each[0].plate.deflection for each in seen]
    assert heaves == sorted(heaves)
    assert max(voltages) <= fold.q * (1 + 2e-5)  # the mesh makes U² at the limit 1.04e-5 larger
    beyond = [each for each in seen if each[0].plate.deflection > fold.deflection]
    assert len(beyond) >= 2
    assert voltages[-1] < voltages[-2]
    for state, negative in beyond:
        near, expected = reference_count(state.plate.deflection, near)
        assert np.sqrt(near[1]) == pytest.approx(np.sqrt(state.voltage_squared), rel=1e-4)
        assert negative == expected == 1


def reference_count(heave: float,
                    near: tuple[np.ndarray, float]) -> tuple[tuple[np.ndarray, float], int]:
    """State of the Ritz method at a heave, and its negative eigenvalues at constant voltage."""
    ritz = RitzExpansion(reference_film(SOFT), 40)
    c, q = near = voltage_at(reference_film(SOFT), heave, WEIGHT, near, 40)
    hessian = ritz.derivatives(c, heave, q)[2]
    return near, int((np.linalg.eigvalsh(hessian) < 0).sum())


def test_an_arc_has_its_length(skewed_model: Model) -> None:
    from tympan.fem.equilibrium.arc_length import Branch

    branch = Branch(replace(skewed_model, loading=Loading(arm=(2e-3, 1e-3))), "force")
    start = equilibrium(branch.model, 0.1, 2000.0).state
    before = next(branch.points(start))
    for step in (1e-3, 1e-2):
        after = branch.at(before, step)
        assert arc_length(before.state, before.direction, step)(branch.model, after.state).miss \
            == pytest.approx(0, abs=1e-7 * step + 1e-10)
        chord = length(branch.model, difference(branch.model, after.state, before.state))
        assert step <= chord * (1 + 1e-6)
        assert chord == pytest.approx(step, rel=1e-2)
    assert length(branch.model, before.direction) == pytest.approx(1, rel=1e-12)
    moved_state = replace(before.state, force=9.0)
    assert difference(branch.model, moved_state, before.state)[0].max() == 0
