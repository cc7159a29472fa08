"""What a path of a large film keeps: the factors of one state at a time, and what is made anew is
the same."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import pytest

from tests.support.models import deflection_gradient, model
from tests.support.specimens import circular
from tympan.fem.equilibrium import tangent
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.laws import Ogden
from tympan.fem.linear_solver.direct import factorise

FORCE = 17.9e-3 * 9.81


@pytest.fixture
def alive(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many factors were alive whenever others were about to be made."""
    counts, living = [], weakref.WeakSet[Any]()

    def counted(*arguments: Any) -> Any:
        counts.append(len(living))
        factors = factorise(*arguments)
        living.add(factors)
        return factors

    monkeypatch.setattr(tangent, "factorise", counted)
    return counts


def path() -> list[tuple[Any, ...]]:
    """An equilibrium, one further on, a film that pulls in, and a held plate."""
    film = model(circular(Ogden((15e3,), (2.0,))), order=2)
    charged = equilibrium(film, FORCE, 3e3)
    further = equilibrium(film, FORCE, 5e3, start=charged.solution)
    gone = equilibrium(film, FORCE, 7e3, start=further.solution)
    outcomes = [charged, further, gone]
    summaries = [(outcome.status, outcome.limit, *outcome.state.positions.ravel())
                 for outcome in outcomes]
    del charged, further, gone, outcomes
    last = held(film, 5e-3, 3e3, start=held(film, 4e-3).solution)
    return [*summaries, (last.status, *last.state.positions.ravel())]


def test_large_films_keep_the_factors_of_one_state(alive: list[int],
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    expected = path()
    assert max(alive) > 2
    gc.collect()  # SciPy's searches refer to themselves, and to solutions of the first path
    alive.clear()
    monkeypatch.setattr(tangent, "_LARGE", 0)
    assert path() == expected
    assert max(alive) == 0


def test_what_was_dropped_is_made_anew(alive: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    film = model(circular(), order=2)
    outcome = equilibrium(film, FORCE, 3e3)
    before, made = deflection_gradient(film, outcome, ["force", "frame.radius"]), len(alive)
    outcome.solution.release()
    deflection_gradient(film, outcome, ["force"])
    assert len(alive) == made
    monkeypatch.setattr(tangent, "_LARGE", 0)
    outcome.solution.release()
    assert deflection_gradient(film, outcome, ["force", "frame.radius"]) == before
    assert len(alive) == made + 1
