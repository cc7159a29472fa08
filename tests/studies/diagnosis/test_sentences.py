"""What a diagnosis says first, where it says the misfit is, and what it says to do."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.trials import design, read
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reduced.simulation import Cause, Simulation
from tympan.studies.diagnosis.sentences import headline, next_step, suspects_among, where


@pytest.mark.parametrize("name", ["circular", "elliptical-small", "elliptical-large"])
@pytest.mark.parametrize(("size", "sigma"), [(0.01, 5e-6), (0.04, 20e-6), (0.1, 10e-6)])
def test_the_specimen_at_fault_is_blamed_not_one_that_the_refit_moved(
        three_shapes: Simulation, name: str, size: float, sigma: float) -> None:
    cause = Cause("prestretch_loss", name)
    judged = judge(three_shapes, read(three_shapes, design(sigma), (cause,), [size], 1), [cause])
    assert where(judged).startswith(f"{name} is off against the other specimens")


def test_no_specimen_is_blamed_for_what_all_have(three_shapes: Simulation) -> None:
    for cause, size, words in (
            ("prestretch_anisotropy", 0.03, "the specimens are off against each other"),
            ("unaccounted_mass", 1.5e-3, "the way it depends on mass is wrong"),
            ("voltage_sag", 20e3**-2.0, "the way it depends on voltage is wrong")):
        table = read(three_shapes, design(10e-6), (Cause(cause),), [size], 1)
        assert where(judge(three_shapes, table, [Cause(cause)])).split(";")[0] == words


def listed(name: str, probability: float, clear: bool = True, rival: bool = False
           ) -> dict[str, Any]:
    return {"effect": name, "headline": f"A {name}", "probability": probability, "clear": clear,
            "only_its_size": rival, "check": f"look at the {name}"}


def test_suspects_have_a_size_and_a_probability_or_nothing_but_their_size_against_them() -> None:
    causes = [listed("lead", 0.6), listed("drift", 0.3, clear=False), listed("hook", 0.01),
              listed("probe", 0.001, rival=True)]
    assert [cause["effect"] for cause in suspects_among(causes)] == ["lead", "probe"]
    assert suspects_among(causes[1:2]) == causes[1:2]


def test_headlines() -> None:
    lead, hook = listed("lead", 0.6), listed("hook", 0.3)
    assert headline("named", [lead, hook], [], "") == "A lead. A hook."
    assert headline("ambiguous", [], [lead], "") == "Probably this: A lead."
    assert headline("ambiguous", [], [lead, hook], "").endswith(
        "Either this: A lead; or a hook.")
    assert "no effect in the library explains it: here" in headline("unexplained", [], [], "here")
    assert headline("nothing", [], [], "").startswith("The simulation agrees")


def test_the_next_step_begins_with_the_direct_check() -> None:
    assert next_step("named", ["weigh it"], "hang 10 g") == (
        "weigh it; only if that shows nothing wrong: hang 10 g")
    assert next_step("ambiguous", ["weigh it", "read it", "weigh it"], "hang 10 g") == (
        "weigh it; read it; if that does not decide it: hang 10 g")
    assert next_step("named", ["weigh it"], "") == "weigh it"
    assert next_step("unexplained", [], "mount it again") == "mount it again"
