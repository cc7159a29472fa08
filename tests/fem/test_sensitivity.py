"""Gradients of results: against differences of solved equilibria, and exact identities of
similarity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.models import deflection_gradient, model
from tests.support.specimens import circular, elliptical, skewed
from tympan.base.errors import InputError
from tympan.base.paths import numbers
from tympan.fem.derivatives.quantities import FUNCTIONALS, named_functional
from tympan.fem.derivatives.residual_derivative import Stiffness
from tympan.fem.derivatives.sensitivity import (
    LOAD_NAMES,
    film_names,
    gradient,
    gradient_many,
    nearby_tangent,
    parameters,
    shape_names,
    solve_adjoint,
)
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.biases import Magnet, Spring
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model

FORCE, VOLTAGE, PRESSURE = 0.2, 3000.0, 20.0
LOADING = Loading((Spring(4.0), Magnet(0.05, 20e-3, 8e-3)), (1e-3, -2e-3), gravity=9.81)
NAMES = (*film_names(skewed()), *LOAD_NAMES, *numbers(LOADING, "loading"), *shape_names(skewed()))


@pytest.fixture(scope="module")
def solved(skewed_model: Model):
    film = replace(skewed_model, loading=LOADING)
    solution = equilibrium(film, FORCE, VOLTAGE, PRESSURE).solution
    return film, solution, gradient_many(film, solution, FUNCTIONALS, parameters(film))


def test_every_number_of_the_model_is_a_parameter(solved) -> None:
    film, _, _ = solved
    assert sorted(parameters(film)) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_gradients_are_the_limit_of_differences(solved, name: str) -> None:
    """Central differences of re-solved equilibria, order two: the error falls fourfold when the
    step halves."""
    film, solution, exact = solved
    value = parameters(film)[name].value(film, solution.state) or 1e-3
    errors = []
    for step in (4e-3 * abs(value), 2e-3 * abs(value)):
        ends = []
        for change in (step, -step):
            other, start = parameters(film)[name].changed(film, solution.state, change)
            resolved = newton(other, start)
            assert resolved.converged
            ends.append([each.value(other, resolved.state) for each in FUNCTIONALS.values()])
        slopes = [exact[label][name] for label in FUNCTIONALS]
        errors.append(np.subtract(*ends) / (2 * step) - slopes)
    for label, before, after in zip(FUNCTIONALS, *np.abs(errors), strict=True):
        # Where stiffening and thinning nearly cancel, what cancels is the scale.
        size = abs(FUNCTIONALS[label].value(film, solution.state) / value)
        scale = max(abs(exact[label][name]), 0.01 * size)
        assert after < 2e-4 * scale, label
        assert before / after > 3.5 or after < 1e-7 * size, label


@pytest.fixture(scope="module")
def uneven() -> Model:
    """Thicker on one side, and heavy."""
    film = skewed()
    return replace(model(replace(film, membrane=replace(
        film.membrane, thickness_gradient=(0.2, 0.1), density=960.0)), refine=0.7, order=2),
        loading=LOADING)


@pytest.mark.parametrize("name", [
    "membrane.thickness_gradient.0", "membrane.thickness_gradient.1", "membrane.density",
    "membrane.prestretch.0", "frame.semi_axes.0", "plate.outline.radius", "plate.offset.1",
    "electrode.margin_frame", "electrode.margin_plate"])
def test_gradients_of_an_uneven_film_are_the_limit_of_differences(uneven: Model, name: str) -> None:
    """What is thicker stays where it is as lengths change, and is pulled down more."""
    solution = equilibrium(uneven, FORCE, VOLTAGE, PRESSURE).solution
    heave, parameter = FUNCTIONALS["heave"], parameters(uneven)[name]
    exact = gradient_many(uneven, solution, {"": heave}, {name: parameter})[""][name]
    step, ends = 2e-3 * parameter.value(uneven, solution.state), []
    for change in (step, -step):
        other, start = parameter.changed(uneven, solution.state, change)
        ends.append(heave.value(other, newton(other, start).state))
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(exact, rel=1e-4)


def test_the_factors_of_the_solve_suffice(solved, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is factorised, and the adjoint solution solves the equilibrium's own tangent; without
    refinement not."""
    film, solution, exact = solved
    fresh = Tangent(film, film.linearised(solution.state), solution.state)
    right = FUNCTIONALS["heave"].slope(film, solution.state)
    truth, stale = fresh.respond(right)[0], solution.tangent.respond(right)[0]

    def refuse(*_: object) -> None:
        raise AssertionError("a gradient must not factorise")

    monkeypatch.setattr(Tangent, "__init__", refuse)
    adjoint = solve_adjoint(Stiffness(film, solution.state), nearby_tangent(film, solution),
                            right)[0]
    assert np.abs(adjoint - truth).max() < 1e-9 * np.abs(truth).max()
    assert np.abs(stale - truth).max() > 1e-6 * np.abs(truth).max()
    assert deflection_gradient(film, solution,
                          ["force"])["force"] == pytest.approx(exact["heave"]["force"], rel=1e-12)


def test_similarity_ties_the_derivatives_together() -> None:
    """The heave over the size depends on F/(mu T b), eps U²/(mu T²) and a/b alone; logarithmic
    slopes cancel."""
    film = model(circular())
    outcome = equilibrium(film, FORCE, VOLTAGE)
    values = {"force": FORCE, "voltage": VOLTAGE, "membrane.material.mu.0": 25e3,
              "membrane.thickness": 1e-3,
              "membrane.relative_permittivity": 4.7, "frame.radius": 45e-3,
              "plate.outline.radius": 10e-3}
    slope = deflection_gradient(film, outcome, list(values))
    heave = outcome.state.plate.deflection
    log = {name: slope[name] * value / heave for name, value in values.items()}
    assert log["voltage"] == pytest.approx(2 * log["membrane.relative_permittivity"], rel=1e-9)
    assert log["membrane.material.mu.0"] == pytest.approx(-log["force"] - log["voltage"] / 2,
                                                          rel=1e-8)
    assert log["membrane.thickness"] == pytest.approx(-log["force"] - log["voltage"], rel=1e-8)
    assert log["frame.radius"] + log["plate.outline.radius"] == pytest.approx(1 - log["force"],
                                                                              abs=1e-8)


def test_a_quarter_answers_like_the_whole() -> None:
    quarter, whole = (model(elliptical(60e-3), symmetry=symmetry, refine=0.7, order=2)
                      for symmetry in (True, False))
    odd = "offset", "arm", "gradient"
    even = [name for name in parameters(quarter) if not any(word in name for word in odd)]
    labels = {name: quantity for name, quantity in FUNCTIONALS.items()
              if name != "tilt" and not quantity.odd}
    answers = []
    for film in (quarter, whole):
        by_name, outcome = parameters(film), equilibrium(film, FORCE, VOLTAGE)
        answers.append(gradient_many(film, outcome, labels, by_name))
    for label, quantity in labels.items():
        for name in even:
            value = by_name[name].value(whole, outcome.state) or 1.0
            size = float(abs(quantity.value(whole, outcome.state)) / abs(value))
            assert answers[0][label][name] == pytest.approx(answers[1][label][name], rel=1e-6,
                                                            abs=1e-8 * size), name
    assert answers[0]["heave"]["plate.offset.0"] == answers[0]["heave"]["loading.arm.1"] == 0
    heave = answers[1]["heave"]
    assert abs(heave["plate.offset.0"]) < 1e-6 * abs(heave["frame.semi_axes.0"])


def test_what_has_no_derivative_is_refused(solved) -> None:
    film, solution, _ = solved
    with pytest.raises(InputError, match=r"membrane\.material\.mu\.0"):
        deflection_gradient(film, solution.state, ["membrane.colour"])
    with pytest.raises(InputError, match="heave, tilt"):
        named_functional("beauty")
    quarter = model(elliptical(60e-3), refine=0.7, order=2)
    outcome = equilibrium(quarter, FORCE, 0.0)
    with pytest.raises(InputError, match="does not tilt"):
        gradient(quarter, outcome, FUNCTIONALS["tilt"], ["force"])
    with pytest.raises(InputError, match="zero all over"):
        gradient(quarter, outcome, FUNCTIONALS["max_field"], ["force"])
    none = replace(outcome, status="no_equilibrium")
    with pytest.raises(InputError, match="no equilibrium"):
        gradient(quarter, none, FUNCTIONALS["heave"], ["force"])
