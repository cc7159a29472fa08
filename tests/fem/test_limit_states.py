"""Limit states between two points of a way, whatever steps along it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tympan.fem.results.limit_states import LIMIT_STATES, begun, passed


def point(tension: float = 1.0, share: float = 0.5, firmness: float = 1.0, growth: float = 1.0,
          given_way: float = 1.0) -> Any:
    """A film of two nodes, the second one at these numbers."""
    pressed = SimpleNamespace(stress_2=np.array([2.0, tension]))
    fields = SimpleNamespace(breakdown_share=np.array([0.1, share]))
    return SimpleNamespace(pressed=pressed, fields=fields, firmness=np.array([2.0, firmness]),
                           least_stress=min(2.0, tension), growth=growth, given_way=given_way)


@pytest.mark.parametrize(("change", "kinds"), [
    ({}, []),
    ({"tension": -0.1}, ["tension"]),
    ({"share": 1.1, "growth": -1.0}, ["breakdown", "pull_in"]),
    ({"firmness": -1.0, "given_way": -1.0}, ["instability"]),
    ({"given_way": -1.0}, ["instability"]),
    ({"given_way": 0.0}, []),
])
def test_states_whose_sign_changes_are_passed_once_each(change: dict[str, float],
                                                        kinds: list[str]) -> None:
    after = point(**change)
    found = list(passed(point(), after, lambda sign: after))
    assert [state.kind for state, _, _ in found] == kinds
    assert [state.kind for state, _, _ in passed(after, point(), lambda sign: after)] == kinds


def test_a_sign_that_is_not_found_leaves_its_state_to_the_next_one() -> None:
    after = point(firmness=-1.0, given_way=-1.0)
    (state, sign, _), = passed(point(), after, lambda sign: None if sign.local else after)
    assert (state.kind, sign.local) == ("instability", False)
    assert not list(passed(point(), after, lambda sign: None))


def test_only_states_of_a_place_are_begun() -> None:
    assert begun(point(growth=-1.0)) == []
    there = point(tension=0.0, share=2.0, growth=-1.0)
    assert begun(there) == [LIMIT_STATES["tension"], LIMIT_STATES["breakdown"]]
