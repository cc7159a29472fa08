"""Derivatives of the heave: against differences of solved equilibria, and exact identities of similarity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import circular, model, skewed

from fem.loading import Loading, Spring
from fem.model import Model
from fem.newton import newton
from fem.paths import equilibrium
from fem.sensitivity import heave_gradient, parameters
from geometry.errors import InputError

FORCE, VOLTAGE, LOADING = 0.2, 3000.0, Loading((Spring(4.0),), gravity=9.81)


def changed(specimen, path: str, factor: float):  # type: ignore[no-untyped-def]
    """The specimen with one number multiplied."""
    def visit(value, keys):  # type: ignore[no-untyped-def]
        if not keys:
            return value * factor
        if isinstance(value, tuple):
            index = int(keys[0])
            return tuple(visit(item, keys[1:]) if number == index else item for number, item in enumerate(value))
        return replace(value, **{keys[0]: visit(getattr(value, keys[0]), keys[1:])})

    return visit(specimen, path.split("."))


@pytest.fixture(scope="module")
def solved(skewed_model: Model):
    film = skewed_model.with_loading(LOADING)
    return film, equilibrium(film, FORCE, VOLTAGE).solution


@pytest.mark.parametrize("name", parameters(skewed()))
def test_gradient_is_the_limit_of_differences(solved, name: str) -> None:
    """Central differences of re-solved equilibria, order two: the error falls fourfold when the step halves."""
    film, solution = solved
    exact = heave_gradient(film, solution.state, [name])[name]
    errors = []
    for step in (4e-3, 2e-3):
        heaves, value = [], 1.0
        for factor in (1 + step, 1 - step):
            state, other = solution.state, film
            if name == "force":
                value, state = FORCE, replace(state, force=FORCE * factor)
            elif name == "voltage":
                value, state = VOLTAGE, replace(state, voltage_squared=(VOLTAGE * factor) ** 2)
            else:
                value = np.real(_value(film.specimen, name))
                other = film.with_specimen(changed(film.specimen, name, factor))
            found = newton(other, state)
            assert found.converged
            heaves.append(found.state.plate.heave)
        errors.append(abs((heaves[0] - heaves[1]) / (2 * step * value) - exact))
    # Where stiffening and thinning nearly cancel, what cancels is the scale.
    scale = max(abs(exact), 0.01 * solution.state.plate.heave / value)
    assert errors[1] < 2e-4 * scale
    assert errors[0] / errors[1] > 3.5 or errors[1] < 1e-7 * scale


def _value(specimen, path: str):  # type: ignore[no-untyped-def]
    value = specimen
    for key in path.split("."):
        value = value[int(key)] if isinstance(value, tuple) else getattr(value, key)
    return value


def test_similarity_ties_the_derivatives_together() -> None:
    """The heave depends on F/(mu T) and eps U^2/(mu T^2) alone: logarithmic derivatives must cancel accordingly."""
    film = model(circular())
    state = equilibrium(film, FORCE, VOLTAGE).state
    names = ["force", "voltage", "membrane.material.mu.0", "membrane.thickness", "membrane.relative_permittivity"]
    slope = heave_gradient(film, state, names)
    log = dict(zip(names, (slope[name] * value for name, value in zip(
        names, (FORCE, VOLTAGE, 25e3, 1e-3, 4.7), strict=True)), strict=True))
    assert log["voltage"] == pytest.approx(2 * log["membrane.relative_permittivity"], rel=1e-9)
    assert log["membrane.material.mu.0"] == pytest.approx(-log["force"] - log["voltage"] / 2, rel=1e-6)
    assert log["membrane.thickness"] == pytest.approx(-log["force"] - log["voltage"], rel=1e-6)


def test_unknown_parameters_are_named(solved) -> None:
    film, solution = solved
    with pytest.raises(InputError, match=r"membrane\.material\.mu\.0"):
        heave_gradient(film, solution.state, ["membrane.colour"])
