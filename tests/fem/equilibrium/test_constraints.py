"""Equations in place of loads: derivatives, a held plate, a charge kept, and stability at constant
charge."""

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
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE


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


def constant(film: Model, state, subspace, kept: str) -> np.ndarray:
    """The dense tangent within some motions: at given loads, at constant charge, or with the heave
    held."""
    tangent = subspace.reduced(film.linearised(state))
    whole = np.block([[tangent.inner, tangent.border], [tangent.border.T, tangent.corner]])
    if kept == "charge":  # E + Q²/2C has the Hessian of E − ½CU² and (U²/C) ∇C ∇Cᵀ
        inner, plate = subspace.project(film.by_load(state, "voltage"))
        slope = -2 * film.discretisation.mirrored * np.concatenate([inner, plate])
        whole += (np.outer(slope, slope) * state.voltage_squared
                  / film.capacitance(state) / film.discretisation.mirrored)
    if kept == "heave":
        row = len(tangent.inner) + film.plate_freedoms.index(HEAVE)
        whole = np.delete(np.delete(whole, row, 0), row, 1)
    return np.linalg.eigvalsh((whole + whole.T) / 2)


@pytest.mark.parametrize(("waves", "beyond"), [(0, (1, 0, 0)), (2, (2, 1, 1))])
def test_closed_stability_is_the_dense_matrix_s(waves: int, beyond: tuple[int, int, int]) -> None:
    """Counts along the branch through pull-in and beyond, against eigenvalues of the matrices
    written out."""
    film = model(circular(SOFT))
    subspace = SmoothSubspace.of(film, waves)
    seen = set()
    for point in branch_points(film, subspace)[::2]:
        part = film.linearised(point.state)
        free = {"charge": ("voltage", held_charge(0.0)), "heave": ("force", held_plate(0.0))}
        counts = {}
        for kept, (load, control) in free.items():
            equation = control(film, point.state)
            tangent = Tangent(film, part, point.state, (load,), [equation], subspace)
            counts[kept] = tangent.negative_closed
            assert counts[kept] == (constant(film, point.state, subspace, kept) < 0).sum()
            assert tangent.negative == (constant(film, point.state, subspace, "") < 0).sum()
        seen.add((tangent.negative, counts["charge"], counts["heave"]))
    assert (0, 0, 0) in seen
    assert beyond in seen  # with two waves the held film itself gives way beside the heave


def test_charge_passes_the_voltage_s_limit_and_is_stable_where_the_ode_is() -> None:
    """Charge grows along the whole branch, the voltage only to its limit; stability at constant
    charge goes on.

    The reference has the Hessian of the Ritz method's energy at constant charge, at its own states.
    """
    film = model(circular(SOFT))
    smooth = SmoothSubspace.of(film, 0)
    points = branch_points(film, smooth)
    last = next(index for index, point in enumerate(points) if point.rate < 0)
    below = points[last - 2].state
    voltage = np.sqrt(below.voltage_squared)
    charge = film.capacitance(below) * voltage
    fold = fold_point(RitzExpansion(reference_film(SOFT), 40), WEIGHT)
    state, near, seen = below, (fold.c, fold.q), []
    for share in (1.0, 1.02, 1.04, 1.06, 1.075, 1.085):
        solution = newton(film, state, ("voltage",), (held_charge(share * charge),),
                          subspace=smooth)
        assert solution.converged
        state = solution.state
        seen.append((state, solution.tangent.negative, solution.tangent.negative_closed))
    voltages = [each[0].voltage_squared for each in seen]
    heaves = [each[0].plate.deflection for each in seen]
    assert heaves == sorted(heaves)
    assert max(voltages) <= fold.q * (1 + 1e-5)
    beyond = [each for each in seen if each[0].plate.deflection > fold.deflection]
    assert len(beyond) >= 2
    assert voltages[-1] < voltages[-2]
    for state, negative, closed in beyond:
        near, given, kept = reference_counts(state.plate.deflection, near)
        assert np.sqrt(near[1]) == pytest.approx(np.sqrt(state.voltage_squared), rel=1e-4)
        assert (negative, closed) == (given, kept) == (1, 0)


def reference_counts(heave: float,
                     near: tuple[np.ndarray, float]) -> tuple[tuple[np.ndarray, float], int, int]:
    """State of the Ritz method at a heave; its negative eigenvalues at constant voltage and at
    constant charge."""
    ritz = RitzExpansion(reference_film(SOFT), 40)
    c, q = near = voltage_at(reference_film(SOFT), heave, WEIGHT, near, 40)
    value, _, hessian, mixed = ritz.derivatives(c, heave, q)
    capacitance = 2 * (ritz.derivatives(c, heave, 0.0)[0] - value) / q
    kept = hessian + q / capacitance * np.outer(2 * mixed, 2 * mixed)
    return near, int((np.linalg.eigvalsh(hessian) < 0).sum()), int((np.linalg.eigvalsh(kept)
                                                                    < 0).sum())


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
