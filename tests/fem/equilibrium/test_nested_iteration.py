"""Large films from elements of half the order: the same equilibria, the same ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.laws import SAMPLES
from tests.support.models import model, pressed_model, structured_quarter
from tests.support.specimens import circular, elliptical, skewed
from tympan.fem.equilibrium import solve
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Electrode, Plate, Specimen

SPECIMENS: dict[str, Specimen] = {
    "quarter": circular(), "half": replace(elliptical(60e-3),
                                           plate=Plate(Circle(10e-3), (8e-3, 0.0))),
    "whole": skewed(), "bands": replace(elliptical(60e-3), electrode=Electrode(3e-3, 2e-3))}


@pytest.fixture
def nested(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Outcome | None]]:
    """What nested iterations came to, of films of any size."""
    outcomes: list[Outcome | None] = []
    search = solve._nested

    def recorded(*arguments: object) -> Outcome | None:
        outcomes.append(search(*arguments))
        return outcomes[-1]

    monkeypatch.setattr(solve, "_LARGE", 0)
    monkeypatch.setattr(solve, "_nested", recorded)
    return outcomes


def plainly(film: Model, *loads: float) -> Outcome:
    """The equilibrium without nested iteration."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solve, "_nested", lambda *_: None)
        return equilibrium(film, *loads)


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("name", SPECIMENS)
def test_equilibria_are_the_same(name: str, order: int, nested: list[Outcome | None]) -> None:
    film = model(SPECIMENS[name], order=order)
    fast, plain = equilibrium(film, 0.17, 3.5e3), plainly(film, 0.17, 3.5e3)
    assert nested[-1] is fast
    assert fast.state.plate.deflection == pytest.approx(plain.state.plate.deflection, rel=1e-8)
    apart = np.abs(fast.state.positions - plain.state.positions).max()
    assert apart < 1e-7 * film.size


def test_an_inflated_film_and_a_free_plate_that_tilts(nested: list[Outcome | None]) -> None:
    dome = model(replace(circular(), plate=None))
    tilting = replace(model(skewed()), loading=Loading(guide="free", arm=(1e-3, 0.0)))
    for film, loads in ((dome, (0.0, 1e3, 100.0)), (tilting, (0.17, 3e3))):
        fast, plain = equilibrium(film, *loads), plainly(film, *loads)
        assert nested[-1] is fast
        assert film.deflection(fast.state) == pytest.approx(film.deflection(plain.state), rel=1e-8)


def test_limits_are_those_of_the_film_and_not_of_coarser_elements(nested: list[Outcome | None]
                                                                   ) -> None:
    """Between both limits the coarser film, which is stiffer, has an equilibrium, this one none."""
    film = pressed_model(circular())
    limit = plainly(film, 0.17, 20e3)
    coarse = replace(film, discretisation=film.discretisation.of_order(1))
    stiffer = plainly(coarse, 0.17, 20e3)
    assert not limit.thins
    assert not stiffer.thins
    assert limit.limit is not None
    assert stiffer.limit is not None
    assert stiffer.limit > 1.001 * limit.limit
    for share in (0.01, 0.3, 0.9):
        between = (limit.limit + share * (stiffer.limit - limit.limit)) ** 0.5
        outcome = equilibrium(film, 0.17, between)
        assert plainly(coarse, 0.17, between).status == "equilibrium"
        assert nested[-1] is None
        assert outcome.status == "no_equilibrium"
        assert outcome.limit == pytest.approx(limit.limit, rel=1e-6)
    within = (0.97 * limit.limit) ** 0.5
    fast, plain = equilibrium(film, 0.17, within), plainly(film, 0.17, within)
    assert fast.status == plain.status == "equilibrium"
    assert fast.state.plate.deflection == pytest.approx(plain.state.plate.deflection, rel=1e-7)


def test_a_wrinkled_film_is_followed_on_its_own_elements(nested: list[Outcome | None]) -> None:
    """A fifth of it is wrinkled."""
    film = model(circular(SAMPLES["separable"].law, prestretch=(1.4, 1.4)))
    plain, fast = plainly(film, 0.49, 4717.0), equilibrium(film, 0.49, 4717.0)
    assert plain.status == "equilibrium"
    assert not film.in_tension(plain.state)
    assert nested[-1] is None
    assert fast.state.plate.deflection == plain.state.plate.deflection


def test_small_films_are_solved_by_themselves() -> None:
    film = model(circular())
    assert film.discretisation.free_count < solve._LARGE
    outcome = equilibrium(film, 0.17, 3e3)
    assert outcome.state.plate.deflection == plainly(film, 0.17, 3e3).state.plate.deflection


@pytest.mark.parametrize("order", [2, 3, 4])
def test_fields_of_the_coarser_elements_are_interpolated_to_the_last_digit(order: int) -> None:
    """Polynomials of the coarser order in each triangle's own coordinates; boundaries stay."""
    fine = structured_quarter(order, 3, 3).discretisation
    for lower in range(1, order):
        coarse = fine.of_order(lower)
        rng = np.random.default_rng(lower)
        values = rng.normal(size=(len(coarse.reference), 3))
        nodal = fine.interpolated(coarse, values)
        again = coarse.interpolated(fine, nodal)
        assert np.allclose(again, values, atol=1e-13)
        for name in ("plate", "frame", "axis_x", "axis_y"):
            places = coarse.reference[coarse.boundary_nodes(name), :2]
            assert len(places) == lower * 3 + 1
