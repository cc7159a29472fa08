"""A branch predicted by a cubic through two points, and limits found on it."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.oracles.unstable_branch import SOFT, WEIGHT
from tests.support.models import pressed_model
from tests.support.specimens import circular
from tympan.fem.equilibrium.arc_length import ArcSettings, Branch
from tympan.fem.equilibrium.arc_segment import PathPoint, Segment
from tympan.fem.equilibrium.constraints import arc_length, difference, length
from tympan.fem.equilibrium.newton import tangent_at
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.film.breakdown import ConstantStrength
from tympan.fem.film.laws import NeoHooke
from tympan.fem.results.solved_states import SolvedStates
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, equilibrate
from tympan.studies.limits import rise
from tympan.studies.limits.voltages import first_limit
from tympan.studies.path import SMOOTH

#: Tangents that the walk of a round film to its end took when steps were short.
_TANGENTS_BEFORE = 35


@pytest.fixture(scope="module")
def branch() -> Branch:
    """Branch of a soft round film in voltage, in long steps."""
    arc = ArcSettings(first=0.03, longest=0.03)
    return Branch(pressed_model(circular(SOFT)), "voltage", arc=arc)


@pytest.fixture(scope="module")
def points(branch: Branch) -> list[PathPoint]:
    """First three points of the branch."""
    return list(islice(branch.points(equilibrium(branch.model, WEIGHT, 0.0).state), 3))


def test_a_cubic_predicts_what_lies_between(branch: Branch, points: list[PathPoint]) -> None:
    _, before, after = points
    segment = Segment(branch.model, "voltage", before, after)
    middle = segment.span / 2
    guess, line = segment.at(middle), Segment(branch.model, "voltage", before).at(middle)
    solved = branch.at(before, middle)
    assert solved is not None

    def missed(point: PathPoint) -> float:
        return length(branch.model, difference(branch.model, point.state, solved.state)) / middle

    assert missed(guess) < 1e-3
    assert missed(line) > 20 * missed(guess)
    assert guess.rate == pytest.approx(solved.rate, rel=1e-2)
    for end, step in ((before, 0.0), (after, segment.span)):
        assert np.allclose(segment.at(step).state.positions, end.state.positions, atol=1e-12)
        assert segment.at(step).rate == pytest.approx(end.rate, rel=1e-9)


def test_a_tangent_bordered_anew_is_the_one_made_so(branch: Branch, points: list[PathPoint]
                                                    ) -> None:
    model, state, direction = branch.model, points[1].state, points[1].direction
    arc = arc_length(state, direction, 0.0)
    whole, _ = tangent_at(model, state, ("voltage",), (arc,))
    plain, _ = tangent_at(model, state)
    assert whole is not None
    assert plain is not None
    (film, plate), loads = plain.bordered(("voltage",), (arc(model, state),)).along()
    (film_2, plate_2), loads_2 = whole.along()
    assert np.allclose(film, film_2, rtol=1e-9, atol=1e-12)
    assert np.allclose(plate, plate_2, rtol=1e-9)
    assert loads == pytest.approx(loads_2)
    assert plain.free == ()


def test_a_second_limit_at_one_point_costs_no_equilibrium(branch: Branch, points: list[PathPoint]
                                                          ) -> None:
    _, before, after = points
    between = branch.between(before, after)
    target = 0.3 * before.state.voltage_squared + 0.7 * after.state.voltage_squared
    first = between.where(lambda point: point.state.voltage_squared - target, "state")
    solved = dict(between.found)
    assert first is not None
    assert first.state.voltage_squared == pytest.approx(target, rel=5e-6)
    # A jump at the same place, as a film's that thins where it loses tension.
    assert between.where(lambda point: np.sign(target - point.state.voltage_squared) or 1.0,
                         "state") is first
    assert between.found == solved


def test_long_steps_find_the_limits_of_short_ones_for_less_than_half_of_the_tangents(
        monkeypatch: pytest.MonkeyPatch) -> None:
    made, whole = [0], Tangent.__init__

    def counted(self: Tangent, *given: object, **named: object) -> None:
        made[0] += 1
        whole(self, *given, **named)  # type: ignore[arg-type]

    case = Case(circular(), mass=17.9e-3)
    near = rise(case, Settings(), step=SMOOTH).limits
    monkeypatch.setattr(Tangent, "__init__", counted)
    far = rise(case, Settings()).limits
    assert made[0] <= _TANGENTS_BEFORE / 2
    assert far.first == near.first
    for one, other in zip(far.reached, near.reached, strict=True):
        assert one.kind == other.kind
        assert one.voltage_V == pytest.approx(other.voltage_V, rel=1e-5)
        assert (one.x_m, one.y_m) == pytest.approx((other.x_m, other.y_m), abs=1e-4)


def test_a_stiff_film_breaks_down_where_a_root_of_equilibria_says() -> None:
    """It hardly moves, so that a small step along its branch is a large one of the voltage."""
    film = circular(NeoHooke(1e6), prestretch=(1.2, 1.2), strength=ConstantStrength(20e6))
    case = Case(film, mass=17.9e-3)
    settings = Settings(MeshSettings().refined(0.5))

    def beyond(voltage: float) -> float:
        model, outcome = equilibrate(replace(case, voltage=voltage), settings)
        return float(SolvedStates(model, [outcome.state]).breakdown[0]) - 1

    limit = first_limit(case, settings)
    assert limit is not None
    assert limit.kind == "breakdown"
    found = brentq(beyond, 0.9 * limit.voltage_V, 1.1 * limit.voltage_V, rtol=1e-8)
    assert limit.voltage_V == pytest.approx(found, rel=1e-4)
