"""One name for each limit state: what commands print has it, and JSON has the key in it."""

from __future__ import annotations

import argparse
import ast
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tympan
from tests.support.specimens import circular
from tympan.commands.lines import limits_text
from tympan.explore.numbers import limit_rows
from tympan.fem.results.limit_states import LIMIT_STATES, LimitState
from tympan.options import print_record
from tympan.reports.figures.curve import VoltageCurve
from tympan.studies.case import Limit, Limits
from tympan.studies.design.result import DesignedFilm, DesignResult
from tympan.studies.films.first_limits import LAW_RANGE, kinds, label_of
from tympan.studies.force.result import ForceLimit
from tympan.studies.limits import LimitsResult
from tympan.studies.limits.curve import CurveResult, MassCurve
from tympan.studies.path import Event, PathResult, Station
from tympan.studies.sweep.asked import QUESTIONS as ASKED
from tympan.studies.tolerance.result import (
    Chance,
    FilmFailure,
    FilmLimits,
    ToleranceResult,
)

#: Other words for what happens at a limit, by its key: such a sentence must have the key's, too.
VERBS = {
    "snap_through": r"\bsnap(s|ped)? through",
    "snap_back": r"\bsnap(s|ped)? back",
    "tension": r"\b(los(es?|ing|t) (its )?tautness|goes slack)",
    "breakdown": r"\b(break(s|ing)?|broke(n)?) down",
    "instability": r"\bg(ives?|ave|iving|iven) way",
    "pull_in": r"\bpull(s|ed|ing)? in\b(?! the| each)",
}
ALL = [*LIMIT_STATES.values()]
SHARE = Chance(probability=0.31, low=0.3, high=0.32)


def limits_of_all_kinds() -> Limits:
    return Limits({state.kind: Limit(kind=state.kind, voltage_V=1e3 + 100 * number, x_m=1e-3,
                                     y_m=0.0) for number, state in enumerate(ALL)}, ended="ended")


def failures() -> tuple[FilmFailure, ...]:
    return tuple(FilmFailure(kind=kind, before_V=3e3, share=SHARE) for kind in kinds())


def printed(command: str, capsys: pytest.CaptureFixture[str], **given: object) -> str:
    options = argparse.Namespace(command=command, json=False, mass="1 g")
    record = given.pop("record", {"warnings": []})
    print_record(options, record, **given)
    return capsys.readouterr().out


def of_limits(capsys: pytest.CaptureFixture[str]) -> str:
    found = LimitsResult(specimen="film", mass_kg=1e-3, limits=limits_of_all_kinds())
    return printed("limits", capsys, record=found.json(), text=limits_text, limits=found.limits,
                   plate=True, pressure=0.0)


def of_curve(capsys: pytest.CaptureFixture[str]) -> str:
    curve = SimpleNamespace(mass_kg=1e-3, stroke_m=None, limits=limits_of_all_kinds(), banded=(),
                            drive="")
    return printed("curve", capsys, result=SimpleNamespace(
        specimen="film", curves=[curve], asked=lambda mass: ()))


def of_path(capsys: pytest.CaptureFixture[str]) -> str:
    station = Station(values={"deflection_m": 1e-3}, force_N=0.1, voltage_V=1e3, pressure_Pa=0.0,
                      charge_C=0.0, stable=True, tense=True, unbalanced=0.0)
    events = tuple(Event(what=state.kind, value=1e3, unit="V", x_m=0.0, y_m=0.0, spread=0.0,
                         station=station) for state in ALL)
    path = PathResult(specimen="film", mass_kg=0.0, voltage_V=0.0, along="voltage", unit="V",
                      stations=(station,), events=events, dofs=1, wall_s=1.0, warnings=())
    assert [event["what"] for event in path.json()["events"]] == [*LIMIT_STATES]
    return printed("path", capsys, result=path)


def of_force(capsys: pytest.CaptureFixture[str]) -> str:
    return "\n".join(ForceLimit(kind=state.kind, displacement_m=0.0, force_N=0.0).words
                     for state in ALL)


def of_sweep(capsys: pytest.CaptureFixture[str]) -> str:
    best = SimpleNamespace(equilibria=1, cases=1, at_V=None, kept={}, ends=(), rows=[
        {"specimen": "film", "limited": {}, "beyond": [*LIMIT_STATES]}])
    text = printed("sweep", capsys, record={"table": "sweep.nc", "best": best},
                   states=LIMIT_STATES)
    return text + "\n".join(ASKED["limits"].columns.values())


def of_tolerance(capsys: pytest.CaptureFixture[str]) -> str:
    limits = FilmLimits(films=100, highest_V=5e3, kinds=dict.fromkeys(kinds(), 0.2))
    found = ToleranceResult(
        specimen="film", mass_kg=1e-3, voltage_V=3e3, films=100, seed=1, tolerances=(),
        reached=SHARE, fails=failures(), quantities={}, limits=limits, error=None, made_s=1.0,
        wall_s=2.0)
    assert [each["kind"] for each in found.json()["fails"]] == [*kinds()]
    return printed("tolerance", capsys, result=found, quantities={}, label_of=label_of)


def of_design(capsys: pytest.CaptureFixture[str]) -> str:
    film = DesignedFilm(specimen="film", status="impossible", specimen_file="film-1.toml",
                        rig_file="", mass_kg=1e-3, voltage_V=3e3, aim=-0.1, numbers={},
                        quantities=(), reached=SHARE, fails=failures())
    found = DesignResult(name="wanted", status="impossible", best="", share=0.95, films=(film,),
                         wall_s=1.0)
    assert [each["kind"] for each in found.json()["films"][0]["fails"]] == [*kinds()]
    return printed("design", capsys, result=found)


def of_explore(capsys: pytest.CaptureFixture[str]) -> str:
    curve = MassCurve(mass_kg=1e-3, limits=limits_of_all_kinds())
    followed = SimpleNamespace(off=None, readings=None, circles=None, curve=CurveResult(
        specimen="film", dofs=1, wall_s=1.0, table={}, curves=(curve,)))
    return "\n".join(f"{row['key']} {row['name']}" for row in limit_rows(followed))


OF = {"limits": of_limits, "curve": of_curve, "path": of_path, "force": of_force,
      "sweep": of_sweep, "tolerance": of_tolerance, "design": of_design, "explore": of_explore}
#: Films of a family snap nowhere: a plate on a mechanism has none.
REDUCED = ("tolerance", "design")


@pytest.mark.parametrize("command", OF)
def test_a_command_prints_the_one_name_of_each_limit(
        command: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = OF[command](capsys)
    for state in ALL:
        if command in REDUCED and state.kind not in kinds():
            continue
        assert state.label in text, state.kind
        assert not re.search(VERBS[state.kind], text), state.kind
    if command in REDUCED:
        assert label_of(LAW_RANGE) in text


def test_the_name_has_the_words_of_the_key() -> None:
    assert all(state.kind.replace("_", "-") in state.label for state in ALL)
    assert len({state.label for state in ALL}) == len(ALL)
    assert {*VERBS} == {*LIMIT_STATES}
    with pytest.raises(ValueError, match="must contain 'pull-in'"):
        LimitState("pull_in", "collapse", "collapse", np.asarray, np.asarray, (), "x")


def test_words_of_a_curve_and_of_a_stored_path_are_the_registry_s() -> None:
    reached = limits_of_all_kinds()
    curve = VoltageCurve(1.0, reached, np.arange(3.0), np.arange(3.0), np.zeros(0), (), np.zeros(0))
    assert reached.pull_in is not None
    words = f"pull-in at {reached.pull_in.voltage_V / 1e3:g} kV"
    assert curve.end == f"snap-through at 1 kV (the limit), {words}"
    assert reached.pull_in.words == words


def texts() -> Iterator[tuple[str, str]]:
    """Every text of the program that a reader may see, with its file; no docstring or comment."""
    root = Path(tympan.__file__).parent
    parts = ("base", "tables", "fem", "geometry", "studies", "reports", "commands", "explore", ".")
    for file in sorted(file for part in parts for file in (root / part).rglob("*")
                       if part != "." or file.parent == root):
        if file.suffix in (".txt", ".html", ".js", ".toml"):
            yield from ((str(file), line) for line in file.read_text("utf-8").splitlines())
        elif file.suffix == ".py":
            yield from ((str(file), text) for text in _strings(ast.parse(file.read_text("utf-8"))))


def _strings(tree: ast.AST) -> Iterator[str]:
    """Texts of a module, those with values in them whole."""
    docstrings = {id(node.body[0].value) for node in ast.walk(tree) if isinstance(
        node, ast.Module | ast.ClassDef | ast.FunctionDef) and node.body
        and isinstance(node.body[0], ast.Expr)}
    inner = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)
             for part in ast.walk(node) if part is not node}
    for node in ast.walk(tree):
        if id(node) in docstrings or id(node) in inner:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "{}"
                          for part in node.values)


def test_no_text_of_the_program_has_another_word_alone() -> None:
    """Of a limit it is said what it does in a sentence that has its key's word, too."""
    count, wrong = 0, []
    for file, text in texts():
        count += 1
        wrong += [(file, text.strip()) for kind, verb in VERBS.items()
                  if re.search(verb, text) and LIMIT_STATES[kind].word not in text]
    assert count > 5000
    assert not wrong


def test_a_film_that_ends_says_so_by_the_registry_s_name() -> None:
    """Messages of the solver stand below the registry, and are told to be its own here."""
    film = circular()
    coarse = tympan.Settings(tympan.MeshSettings().refined(0.5))
    with pytest.raises(tympan.InputError, match="branch can start: loss of tension at"):
        tympan.path(film, mass="17.9 g", voltage="30 kV", settings=coarse)
