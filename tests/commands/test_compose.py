"""Every question of every film and rig: what is asked, refused for a reason, and compared."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import pytest

from benchmarks.compose import concepts as composed
from benchmarks.compose.answering import ERRORS, OUTPUT
from benchmarks.compose.ask import Log, Row, ask
from benchmarks.compose.concepts import Asked, Combination, alone, concepts, drawn, missing
from benchmarks.compose.doors import differences
from benchmarks.compose.questions import (
    ELSEWHERE,
    MADE,
    PLANS,
    WAYS,
    Question,
    options_of,
    questions,
)
from benchmarks.compose.table import Allowed, allowed, counts, refusals
from tympan.base.fields import Key, Registry, fields_of
from tympan.cli import build_parser
from tympan.commands import COMMANDS
from tympan.fem.membrane.biases import BIASES
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen

EVERY = concepts()
#: Written in a moment; drawings are read by a process of their own.
QUICK = [each for each in EVERY if each.name.split()[-1] not in ("step", "dxf")]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    Combination(()).write(tmp_path)
    return tmp_path


@dataclass(frozen=True)
class Hook:
    """A mechanism that is registered later."""

    law: ClassVar[str] = "hook"
    pull: Annotated[float, Key("its pull", "force")]


def test_every_kind_and_key_has_an_example() -> None:
    assert missing() == []


def test_every_registry_of_a_file_is_asked() -> None:
    """Those that a specimen or rig reaches, however deep."""
    def reached(declared: Any) -> set[int]:
        found: set[int] = set()
        for field in fields_of(declared):
            if field.says.kinds is not None:
                found.add(id(field.says.kinds))
            elif hasattr(field.item, "__dataclass_fields__"):
                found |= reached(field.item)
        return found

    asked: list[Registry[Any]] = [registry for _, registry in composed.REGISTRIES.values()]
    assert reached(Specimen) | reached(Rig) == {id(registry) for registry in asked}


def test_what_is_registered_later_joins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BIASES, "hook", Hook)
    assert missing() == ["bias.hook"]
    monkeypatch.setitem(composed.EXAMPLES["bias"], "hook", {"pull": "1 N"})
    assert missing() == []
    assert "frame ellipse + bias hook" in [each.name for each in alone(concepts())]


def test_every_command_is_asked_or_says_why_not() -> None:
    named = {command.name for command in COMMANDS}
    asked = {command.name for command in COMMANDS if command.name not in ELSEWHERE}
    assert ELSEWHERE.keys() | asked == named
    assert WAYS.keys() <= asked
    for command in COMMANDS:
        if command.name in asked:
            assert options_of(command)[0].split("|")[0] in ("SPECIMEN.toml", *PLANS)
    names = [question.name for question in questions()]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("concept", QUICK, ids=lambda concept: concept.name)
def test_every_concept_changes_a_file_that_reads(concept: composed.Concept, folder: Path) -> None:
    asked = Combination((concept,)).write(folder)
    plain = Combination(()).write(folder)
    changed = Rig.read(asked.rig) if asked.rig else asked.specimen
    assert changed != (Rig() if asked.rig else plain.specimen) or concept.name in (
        "frame circle", "plate circle", "material vhb-4910", "strength power")
    assert asked.voltage > 0
    assert (asked.mass or 0) > 0 or asked.specimen.plate is None


def test_lines_are_command_lines(folder: Path) -> None:
    """Of a film with a rig and of one without plate: every option is known."""
    named = {concept.name: concept for concept in EVERY}
    for names in (("frame ellipse", "rig.spring"), ("no plate", "rig.gas_pressure")):
        asked = Combination(tuple(named[name] for name in names)).write(folder)
        for question in questions():
            line = question.line(asked, folder / question.name)
            if line is not None:
                options = build_parser().parse_args(line)
                assert getattr(options, "mass", None) is None or asked.specimen.plate


def test_draws_are_seeded_pairs_and_triples(folder: Path) -> None:
    first, _ = drawn(QUICK, 8, 3, folder)
    again, _ = drawn(QUICK, 8, 3, folder)
    assert [each.name for each in first] == [each.name for each in again]
    assert [len(each.concepts) for each in first] == [2, 3] * 4
    for each in first:
        assert len({concept.place for concept in each.concepts}) == len(each.concepts)


def test_a_question_ends_with_its_message_or_its_trace(folder: Path) -> None:
    asked = Combination(()).write(folder)

    def row(*line: str) -> Row:
        found = ask(Question("q", lambda *_: list(line)), asked, folder / "q")
        assert found is not None
        return found

    answered = row("materials", "--json")
    assert (answered.status, answered.said, answered.raised) == (0, "", False)
    refused = row("solve", str(asked.film), "--mass", "1 m")
    assert refused.refused
    assert not refused.failed
    assert refused.said.startswith("--mass: given '1 m': wrong dimension")
    missing_key = row("sweep", str(asked.film), "-o", MADE)
    assert missing_key.said.startswith("SPECIMEN.toml: ")
    assert ask(Question("q", lambda *_: None), asked, folder / "q") is None
    log = Log(folder / "log.jsonl")
    log.add(refused)
    log.add(replace(refused, status=0))
    assert [each.status for each in Log(folder / "log.jsonl")] == [0]
    assert (folder / "q" / OUTPUT).exists()
    assert (folder / "q" / ERRORS).exists()


def test_what_raises_has_failed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def raising(*_: object) -> int:
        raise KeyError("an error")

    monkeypatch.setattr("tympan.cli.main", raising)
    found = ask(Question("q", lambda *_: ["solve"]), Combination(()).write(folder), folder / "q")
    assert found is not None
    assert found.raised
    assert found.failed
    assert found.said == "KeyError: 'an error'"


def test_reasons_are_of_films_and_questions_that_there_are() -> None:
    names = {concept.name for concept in EVERY}
    asked = {question.name for question in questions()}
    rows = allowed()
    assert rows
    for row in rows:
        assert row.concepts <= names
        assert row.questions <= asked
        assert len(row.reason.split()) > 3
        assert row.message


def test_a_reason_covers_its_own_message_alone(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("## Refusals with a reason\n\n| a | b | c | d |\n|---|---|---|---|\n"
                    "| `no plate`, `x` | `force` | `no \\| way` | Nothing to be held. |\n\n"
                    "## More\n\n| `y` | `force` | `no` | z |\n")
    reason, = allowed(page)
    assert reason == Allowed(frozenset({"no plate", "x"}), frozenset({"force"}), "no | way",
                             "Nothing to be held.")
    row = Row("no plate + rig.air", "force", 2, 0.1, "no | way", False)
    assert reason.covers(row)
    for other in (replace(row, said="no | way."), replace(row, question="sense"),
                  replace(row, case="rig.air")):
        assert not reason.covers(other)
    text = "\n".join([*counts([row, replace(row, status=0, seconds=3.0)]), *refusals([row])])
    assert "force                2 asked,   1 refused,   0 failed" in text
    assert "median 3.0, most 3.0" in text
    assert "   1  no | way" in text


def test_doors_are_compared_with_the_film_itself(tmp_path: Path) -> None:
    solved = {"status": "equilibrium", "deflection_m": 2e-3, "stroke_m": 1e-3,
              "capacitance_F": 1e-9, "max_field_V_per_m": 1e7, "breakdown_margin": None}
    state = {"voltage_V": 3e3, "displacement_m": 2.02e-3, "capacitance_F": 1e-9}
    answers = {"solve": solved, "sense": {"states": [{**state, "voltage_V": 0.0}, state]},
               "sensitivity": {"status": "no_equilibrium"}, "curve": None}
    for name, answer in answers.items():
        (tmp_path / "film" / name).mkdir(parents=True)
        text = "" if answer is None else json.dumps(answer)
        (tmp_path / "film" / name / OUTPUT).write_text(text)
    lines = list(differences(tmp_path, ["film", "other"]))
    assert [line.split() for line in lines[1:]] == [
        ["sense", "deflection", "1", "1.0e-02", "1.0e-02", "film"],
        ["sense", "capacitance", "1", "0.0e+00", "0.0e+00", "film"]]


def test_loads_suit_films_of_other_thickness(folder: Path) -> None:
    named = {concept.name: concept for concept in EVERY}
    plain, half = (Combination(each).write(folder)
                   for each in ((), (named["membrane.thickness"],)))
    assert isinstance(plain, Asked)
    assert plain.mass == pytest.approx(2 * half.mass, rel=0.1)
    assert plain.voltage == pytest.approx(2 * half.voltage, rel=0.1)
