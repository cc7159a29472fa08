"""What may be relaxed: weaker than what was asked for, true, and told where it ends.

Films are in closed form (tests/support/closed_films.py), so that all designs of a grid are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.support.closed_films import ClosedSpace
from tests.support.costs import dear
from tests.support.specimens import circular
from tympan.base.points import drawn_points
from tympan.fem.film.breakdown import ConstantStrength
from tympan.studies.case import Settings
from tympan.studies.design.design import designed_film, sought_in
from tympan.studies.design.ranges import Vary
from tympan.studies.design.requirements import Requirements, sought
from tympan.studies.design.scatter import ScatteredFilms
from tympan.studies.design.search import Search
from tympan.studies.wanted import BREAKDOWN, TENSION, Bound, by_key

RADII = (Vary("frame.radius", ("frame.radius",), 30e-3, 60e-3, "length"),
         Vary("plate.radius", ("plate.outline.radius",), 6e-3, 15e-3, "length"))
VOLTAGE = Vary("voltage", (), 2e3, 8e3, "voltage")
#: Both senses of what can be searched for; a margin has a least value alone.
#: Variables that films in closed form do not have.
LACKING = {"max_stretch", "slack_area", "slack_share", "tilt", "energy"}
SENSES = [(name, least) for name in sought() for least in (True, False)
          if name not in LACKING
          and (least or name not in (TENSION, BREAKDOWN))]


def space(bounds: Sequence[Bound], best: str = "", voltage: float | None = None,
          scatters: bool = False) -> ClosedSpace:
    film = circular()
    film = replace(film, membrane=replace(film.membrane, strength=ConstantStrength(1e8)))
    variables = (*RADII, VOLTAGE) if voltage is None else RADII
    wanted = Requirements("wanted", (film,), 20e-3, voltage or VOLTAGE.high, {film.name: variables},
                          by_key(bounds), best)
    return ClosedSpace(film, variables, wanted, ("tension", "voltage") if scatters else ())


@cache
def grid(size: int, count: int) -> np.ndarray:
    """Shares of the ranges of so many numbers, in steps."""
    steps = np.meshgrid(*[np.linspace(0, 1, size)] * count, indexing="ij")
    return np.stack([each.ravel() for each in steps], 1)


def missed(where: ClosedSpace, size: int = 11) -> dict[str, np.ndarray]:
    """Share by which each design of a grid misses each bound, without scatter."""
    films = where.films(where.values(grid(size, len(where.variables))))
    found = Search(where, where.requirements.kept(where.specimen), "").missed(films)
    return dict(zip(where.requirements.kept(where.specimen), found.T, strict=True))


def least_missed(known: dict[str, np.ndarray], key: str) -> float:
    """What a bound is missed by at least of designs that keep all others; inf of none."""
    others = np.array([each for name, each in known.items() if name != key])
    return float(np.where((others <= 0).all(0), known[key], np.inf).min())


def random_bounds(seed: int) -> list[Bound]:
    """Three bounds that some designs keep, or none does by a little or much."""
    rng = np.random.default_rng(seed)
    where = space([])
    films = where.films(where.values(rng.random((200, 3))))
    taut = films.tension.min(1) > 0
    found = list[Bound]()
    for number in rng.choice(len(SENSES), 3, replace=False):
        name, least = SENSES[number]
        low, high = np.quantile(sought()[name].of(films)[taut], (0.02, 0.98))
        value = low + (high - low) * rng.uniform(0.2, 1.3 if least else 0.8)
        value = value if least else low + high - value
        if value > 0 and sought()[name].rule[0](value):
            found.append(Bound(name, float(value), least))
    return found


@pytest.mark.parametrize("seed", [*range(8), *(dear(seed, seconds=4) for seed in range(8, 24))])
def test_what_may_be_relaxed_is_weaker_and_true(seed: int) -> None:
    """Of random bounds of all quantities, least and largest ones."""
    where = space(random_bounds(seed))
    found, known = sought_in(where, Settings()), missed(where)
    assert found.possible or np.max([*known.values()], axis=0).min() > -1e-3
    for key, weaker in found.relaxed.items():
        asked, told = found.search.bounds[key], weaker.bound
        assert not found.possible
        assert (told.name, told.least) == (asked.name, asked.least)
        assert asked.relaxed_to(told.value) == told
        # No design of the grid keeps more, and with a little less all bounds are kept.
        assert float(asked.missed(np.array(told.value))) < least_missed(known, key) + 1e-3
        eased = replace(told, value=told.at(2e-3))
        bounds = [eased if each.key == key else each
                  for each in where.requirements.bounds.values()]
        assert sought_in(space(bounds), Settings()).possible


def copies(where: ClosedSpace, x: np.ndarray) -> ScatteredFilms:
    """Other copies of a design than those of the search."""
    search = Search(where, where.requirements.kept(where.specimen), "")
    return ScatteredFilms.of(search, where.values(x), drawn_points(where.inputs, 2048, 7))


SCATTERED = [
    # Copies of the stroke; the frame's height has none, and its least is the end of a range.
    [Bound("stroke", 2.5e-3, True), Bound("height", 90e-3, False)],
    [Bound("stroke", 2.2e-3, True), Bound("frequency", 8.0, True)],
    [Bound("deflection", 4e-3, False), Bound("stroke", 1.5e-3, True), Bound("width", 0.08, True)],
    [Bound("blocked_force", 0.13, True), Bound("max_true_stress", 350e3, False)]]


@pytest.mark.parametrize("number", range(len(SCATTERED)))
def test_what_copies_may_keep_instead_is_weaker_and_true(number: int) -> None:
    """By other copies as many keep the relaxed bounds as shall; of no design of a grid more do."""
    where = space(SCATTERED[number], voltage=5.2e3, scatters=True)
    found, share = sought_in(where, Settings()), where.requirements.share
    assert not found.possible
    assert found.relaxed
    asked = found.search.bounds
    room = np.all([each <= (np.inf if asked[key].quantity.scatters else 1e-6)
                   for key, each in missed(where, 7).items()], axis=0)
    designs = [copies(where, x) for x in grid(7, 2)[room]]
    assert max(float(each.kept({}).mean()) for each in designs) < share
    for key, weaker in found.relaxed.items():
        asked, told = found.search.bounds[key], weaker.bound
        assert asked.relaxed_to(told.value) == told
        if asked.quantity.scatters:
            best = [each.attained(asked, {}, share) or np.nan for each in designs]
            most = float(np.nanmax(best) if asked.least else np.nanmin(best))
            # 2048 copies know a quantile to some per cent of what separates them.
            assert asked.missed(np.array(told.value)) < asked.missed(np.array(most)) + 0.02
        eased = replace(told, value=told.at(0.02))
        bounds = [eased if each.key == key else each
                  for each in where.requirements.bounds.values()]
        again = sought_in(space(bounds, voltage=5.2e3, scatters=True), Settings())
        assert again.possible
        assert copies(again.search.space, again.end.x[:2]).kept({}).mean() > share - 0.015


@pytest.mark.parametrize(("bounds", "best", "scatters"), [
    ([Bound("frequency", 8.0, True)], "stroke", False),
    ([Bound("frequency", 8.0, True)], "stroke", True),
    ([Bound("height", 90e-3, False)], "stroke", False),
    ([Bound("stroke", 2e-3, True), Bound("deflection", 9e-3, False)], "frame_area", True)])
def test_what_a_relaxed_bound_gains_is_what_a_search_with_it_finds(
        bounds: list[Bound], best: str, scatters: bool) -> None:
    found = sought_in(space(bounds, best, 5e3, scatters), Settings())
    film = designed_film(found, circular())
    assert film.status == "met"
    assert film.binding
    for each in film.quantities:
        if each.relaxing is None:
            assert not each.binding or each.name in (TENSION, BREAKDOWN)
            continue
        # With the same margins, as many copies keep the bounds.
        eased = found.search.bounds[each.key].relaxed_by(0.01)
        search = replace(found.search, bounds={**found.search.bounds, each.key: eased})
        again = search.found(found.end.x[None, :2])
        gained = (again.here.value - found.aim) / abs(found.aim)
        assert each.relaxing == pytest.approx(gained, rel=0.06, abs=1e-4)
        assert each.relaxing > 1e-3


def test_that_films_bear_their_voltage_binds_and_has_no_price() -> None:
    """Nobody can ask for less than that: "1 % less strict gives 0 %" was neither right nor of use.
    """
    found = sought_in(space([], "stroke"), Settings())
    film = designed_film(found, circular())
    bears = film.quantity(TENSION)
    assert (bears.bound, bears.binding, bears.relaxing) == (1.0, True, None)
    found = sought_in(space([Bound(TENSION, 1.2, True)], "stroke"), Settings())
    margin = designed_film(found, circular()).quantity(TENSION)
    assert margin.binding
    eased = sought_in(space([Bound(TENSION, 1.188, True)], "stroke"), Settings())
    assert margin.relaxing == pytest.approx(eased.aim / found.aim - 1, rel=0.1)


def test_an_end_of_a_range_is_told_as_such() -> None:
    """Strokes are largest with the largest frame and the smallest plate that may be."""
    found = sought_in(space([Bound("stroke", 0.2, True)], voltage=4e3), Settings())
    film = designed_film(found, circular())
    assert film.status == "impossible"
    assert {key: number.end for key, number in film.numbers.items()} == {
        "frame.radius": "range", "plate.radius": "range"}
    stroke = film.quantity("stroke")
    assert stroke.attainable == pytest.approx(stroke.value, rel=1e-3)
    assert stroke.attainable_ends == {"frame.radius": "range", "plate.radius": "range"}
    assert all(number.relaxing > 0 for number in film.numbers.values())


def test_a_range_that_begins_at_0_has_no_price_by_a_share_of_that() -> None:
    offset = Vary("plate.offset.0", ("plate.offset.0",), 0.0, 1e-3, "length")
    where = space([], "frequency", 4e3)
    wanted = replace(where.requirements, variables={where.specimen.name: (*RADII, offset)})
    found = sought_in(replace(where, variables=(*RADII, offset), requirements=wanted), Settings())
    assert designed_film(found, circular()).numbers["plate.offset.0"].relaxing is None


def test_what_films_have_that_fail_is_not_told_as_0() -> None:
    """Copies that lose tension have no stroke: they are named with their share instead."""
    found = sought_in(space([Bound("stroke", 3e-3, True)], voltage=6.8e3, scatters=True),
                      Settings())
    film = designed_film(found, circular())
    stroke = film.quantity("stroke")
    lost = 1 - film.quantity(TENSION).kept.probability
    assert lost > 0.05
    assert film.status == "impossible"
    assert stroke.value > 3e-3
    assert stroke.reached is None
    assert stroke.missed
    failure, = film.fails
    assert (failure.kind, failure.before_V) == ("tension", 6.8e3)
    assert failure.share.probability == pytest.approx(lost)
    assert stroke.kept.probability <= 1 - lost
    assert "of the films loss of tension comes before 6.8 kV" in failure.words
