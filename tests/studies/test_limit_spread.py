"""Shares of a limit's mesh error that its elements do not show, and where they apply."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.fem.film.laws import NeoHooke
from tympan.fem.results.limit_states import BREAKDOWN, INSTABILITY, TENSION, LimitState, Sign
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, equilibrate
from tympan.studies.limits import rise
from tympan.studies.walk.film_point import FilmPoint
from tympan.studies.walk.spread import CORRECTIONS, Passage, missed, spread

COARSE = Settings(MeshSettings().refined(0.5))


def film(edge: bool = True, thins: bool = False, wrinkled: bool = False, thinned: bool = False,
         wrinkles: bool = True) -> Any:
    """A film of which this is known."""
    mesh = SimpleNamespace(electrode_edge=SimpleNamespace(every=np.arange(3)))
    result = SimpleNamespace(
        model=SimpleNamespace(wrinkles=wrinkles, discretisation=mesh), thins=thins,
        wrinkled=wrinkled, thinned=thinned, on_electrode_edge=lambda state: edge)
    result.behind = result
    return result


WHOLE = Sign(lambda point: 1.0, needs="tangent", local=False)


@pytest.mark.parametrize(("state", "sign", "films", "factor", "share"), [
    (TENSION, TENSION.signs[0], [film()] * 4, 1.0, 0.0),
    (BREAKDOWN, BREAKDOWN.signs[0], [film(thins=True)] * 4, 1.0, 0.4),
    (INSTABILITY, INSTABILITY.signs[0], [film(edge=False)] * 4, 1.0, 0.0),
    (INSTABILITY, INSTABILITY.signs[0], [film()] * 4, 2.5, 0.8),
    (INSTABILITY, INSTABILITY.signs[0], [film(), film(wrinkled=True), film(), film()], 2.5, 0.0),
    (INSTABILITY, INSTABILITY.signs[0],
     [film(), film(wrinkled=True), film(thins=True, wrinkled=True), film(thinned=True)], 1.5, 0.0),
    (INSTABILITY, WHOLE, [film()] * 4, 1.0, 0.0),
    (INSTABILITY, WHOLE, [film(), film(), film(wrinkles=False), film()], 2.5, 0.0),
])
def test_each_correction_has_its_place(state: LimitState, sign: Sign, films: list[Any],
                                       factor: float, share: float) -> None:
    """First, before, here and after."""
    first, before, here, after = films
    passage = Passage(state, sign, first, before, here, after)
    found = [each for each in CORRECTIONS if each.applies(passage)]
    assert np.prod([each.factor for each in found]) == factor
    assert sum(each.share for each in found) == share


@pytest.fixture(scope="module")
def lost() -> Passage:
    """Loss of tension of a round film covered everywhere."""
    case = Case(circular(NeoHooke(15e3)), mass=17.9e-3)
    risen = rise(case, COARSE)
    first, *_, before, here = (stop.film for stop in risen.stops if stop.film.model.wrinkles)
    return Passage(TENSION, TENSION.signs[0], first, before, here, here)


def test_an_error_in_the_margin_is_one_in_the_voltage_by_the_pace(
        lost: Passage, monkeypatch: pytest.MonkeyPatch) -> None:
    error, sign = missed(lost), lost.sign
    low, high = lost.before.voltage, lost.here.voltage
    pace = (high - low) / abs(sign.value(lost.before) - sign.value(lost.here))
    assert spread(lost, lambda film: film.voltage) == pytest.approx(error * pace / high)
    assert spread(lost, lambda film: 0.0) == 0.0
    whole = replace(lost, sign=WHOLE)
    assert spread(whole, lambda film: film.voltage) == missed(whole)
    monkeypatch.setattr(FilmPoint, "coarser", None)
    assert 0 < missed(replace(lost, here=replace(lost.here))) < error


def test_a_film_without_coarser_elements_has_its_jumps_alone() -> None:
    case = Case(circular(), mass=17.9e-3)
    linear = Settings(MeshSettings(order=1).refined(0.5))
    model, outcome = equilibrate(case, linear)
    point = FilmPoint(model, cast(Any, SimpleNamespace(state=outcome.state)))
    assert point.coarser is None
