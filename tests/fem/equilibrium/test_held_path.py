"""A plate moved from place to place: what lies between two places is what each is by itself."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.support.models import model, pressed_model
from tests.support.specimens import circular, elliptical, reference_film
from tympan.fem.equilibrium import tangent
from tympan.fem.equilibrium.held_path import HeldSpan, held_path
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.laws import Gent, NeoHooke, Ogden
from tympan.fem.membrane.model import Model

FILMS = {"taut": circular(NeoHooke(20e3)), "ellipse": elliptical(75e-3),
         "wrinkles": circular(Gent(20e3, 60.0), prestretch=(1.4, 2.5)),
         "slack when mounted": circular(NeoHooke(20e3), prestretch=(0.9, 0.9))}


def solutions(steps: list[HeldSpan]) -> list[Solution]:
    return [solution for step in steps for solution in (*step.inner, step.span.end)]


def followed(film: Model, deflections: list[float], voltage: float = 0.0) -> list[HeldSpan]:
    start = held(film, deflections[0], voltage)
    assert start.status == "equilibrium"
    return list(held_path(film, deflections[1:], start.solution))


@pytest.mark.parametrize("name", FILMS)
def test_each_is_what_it_is_by_itself(name: str) -> None:
    # From a slack film each place takes long, so its elements are of low order.
    film = model(FILMS[name], refine=0.7, order=2 if name == "slack when mounted" else 4)
    deflections = np.linspace(25e-3, 32e-3, 15).tolist()
    steps = followed(film, deflections, 2e3)
    found = solutions(steps)
    assert len(found) == 14
    for deflection, solution in zip(deflections[1:], found, strict=True):
        alone = held(film, deflection, 2e3)
        assert film.deflection(solution.state) == pytest.approx(deflection, abs=1e-12)
        assert solution.state.force == pytest.approx(alone.state.force, rel=3e-7)


def test_most_places_need_no_tangent_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    film = model(FILMS["ellipse"])
    made = []
    factorise = tangent._factorise
    monkeypatch.setattr(tangent, "_factorise",
                        lambda *parts: made.append(None) or factorise(*parts))
    assert len(solutions(followed(film, np.linspace(0, 6e-3, 61).tolist(), 3e3))) == 60
    assert len(made) <= 20


def test_the_slope_at_an_end_is_that_of_the_force() -> None:
    film = model(FILMS["taut"])
    end = followed(film, [4e-3, 5e-3], 3e3)[-1].span.end
    assert end.tangent is not None
    exact = axisymmetric.solve_deflection(reference_film(Ogden((20e3,), (2.0,))), 5e-3, 3e3)
    assert end.tangent.along()[1]["force"] == pytest.approx(exact.stiffness, rel=1e-5)


@pytest.mark.parametrize(("voltage", "last"), [(6e3, 13e-3), (7e3, 8e-3)])
def test_a_film_kept_from_wrinkling_is_followed_beyond_where_it_would_thin(
        voltage: float, last: float) -> None:
    """At these voltages no weight of 17.9 g is carried: the load has passed its limit."""
    film = pressed_model(circular(Ogden((15e3,), (2.0,))))
    exact = reference_film(Ogden((15e3,), (2.0,)))
    for solution in solutions(followed(film, np.linspace(0, last, 9).tolist(), voltage)):
        deflection = film.deflection(solution.state)
        expected = axisymmetric.solve_deflection(exact, deflection, voltage).force
        assert solution.state.force == pytest.approx(expected, rel=1e-5)


def test_a_path_ends_where_the_law_does() -> None:
    """Gent's law locks: the last step leads to where it does, and says that it was stopped."""
    film = model(circular(Gent(20e3, 20.0), prestretch=(3.0, 3.0)), refine=0.7)
    steps = followed(film, np.linspace(0, 60e-3, 31).tolist())
    assert steps[-1].stopped
    assert not any(step.stopped for step in steps[:-1])
    assert len(solutions(steps)) < 30
