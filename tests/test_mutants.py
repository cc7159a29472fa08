"""The mutants that judge the test suite: what is drawn, and that a toy's are caught or not."""

from __future__ import annotations

import ast
import random
import shutil
import subprocess
from pathlib import Path

import pytest

from benchmarks.trials.mutants.draw import (
    differs,
    draw,
    draw_rules,
    moved,
    mutant_of,
    spread,
)
from benchmarks.trials.mutants.judge import (
    CAUGHT,
    EQUIVALENT,
    GOT_AWAY,
    UNSOUND,
    Record,
    batches,
    judge,
    keep_record,
    read_records,
)
from benchmarks.trials.mutants.kinds import KINDS, Change, changes
from benchmarks.trials.mutants.mutant import Mutant, chapter_of, read_mutants, write_mutants
from benchmarks.trials.mutants.rules import rules
from benchmarks.trials.mutants.source import code_lines, product_files
from benchmarks.trials.mutants.suite_map import Candidate, SuiteMap, record
from benchmarks.trials.mutants.table import Part, page

SOURCE = b'''"""1 + 1 in a docstring."""

from __future__ import annotations

LIMIT = 3

class Film:
    """2 films."""

    thickness: float = 4.0 * 5
    layers: int = 1  # pragma: kept

    def __repr__(self) -> str:
        return str(6 + 6)

def area(width: "7", height: float = 8.0) -> float:
    """9 * 9."""
    if width < 0 and not height:
        raise ValueError(f"{width + 10} is negative" + str(11))
    text = f"{12 * width}" + "\xc3\xa9"
    total = 0.0
    for _ in range(13):
        total += width * (
            # * is no operator here
            height)
    print(text, total)
    total = pow(width, -height)
    return total if total is not None else max(width, height)
'''

#: Rules: two constants and four conditions. A bound of the cost is none, nor is a text.
JUDGING = b'''"""A verdict."""

#: Probability from which a cause is named.
SURE = 0.9
#: As many are asked. A bound of
#: the cost.
_ASKED = 8
#: Fewest readings.
FEWEST = 3
WORDS = "sure"


def verdict(causes, doubt, best=None):
    """The verdict."""
    sure = [cause for cause in causes if cause > SURE]
    few = len(sure) < FEWEST
    if best is None or few or doubt and not sure:
        return "ambiguous"
    return "named"
'''

#: A product with two functions that a test checks, and one that nothing runs.
TOY = {
    "toy/__init__.py": "",
    "toy/sums.py": '''"""Sums."""
from functools import cache


def double(x):
    return 2 * x


def absolute(x):
    if x < 0:
        return -x
    return x


@cache
def slow(x):
    return x + 3


def unused(x):
    return x - 1


def endless(x):
    while x > 0:
        x = x - 1
    return x
''',
    "conftest.py": '''import pytest
from toy.sums import absolute


@pytest.fixture(scope="session")
def five():
    return absolute(-5)
''',
    "test_toy.py": '''import subprocess, sys
from toy.sums import absolute, double, endless, slow


def test_fixture(five):
    assert five > 0


def test_other_side():
    assert absolute(4) == 4


def test_kept():
    slow(1)


def test_kept_again():
    assert slow(1) == 4


def test_child():
    code = "from toy.sums import double; print(double(2))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True,
                          text=True).stdout == "4\\n"


def test_fails_by_itself():
    assert not double(1)


def test_ends():
    assert endless(2) == 0
''',
    "pytest.ini": "[pytest]\nmarkers = study\n",
}


def found(kind: str) -> list[Change]:
    return [change for change in changes(SOURCE) if change.kind == kind]


def pairs(kind: str) -> set[tuple[str, str]]:
    return {(change.old, change.new) for change in found(kind)}


def test_what_can_be_changed() -> None:
    assert {chapter_of("studies/diagnosis/inference/a/b.py"), chapter_of("tympan/cli.py")
            } == {"studies/diagnosis/inference", "tympan"}
    assert pairs("operator") == {
        ("*", "/"), ("<", "<="), ("<", ">="), ("and", "or"), ("not", ""), ("+=", "-="), ("-", ""),
        ("is not", "is")}
    numbers = {change.old for change in found("constant")}
    assert numbers == {"4.0", "5", "8.0", "0", "0.0", "13"}
    assert ("5", "(-5)") in pairs("constant")
    assert pairs("branch") == {
        ("width < 0 and not height", "False"),
        ("width < 0 and not height", "not (width < 0 and not height)"),
        ("total is not None", "not (total is not None)")}
    assert pairs("swapped arguments") == {("text, total", "total, text"),
                                          ("width, -height", "-height, width")}
    dropped = [old for old, new in pairs("dropped line") if new == "pass"]
    # The first assignments of names stay: without them nothing would run.
    assert sorted(text.partition("(")[0] for text in dropped) == [
        "print", "total += width * ", "total = pow"]
    assert {change.function for change in changes(SOURCE)} == {"Film.thickness", "area"}


def test_a_rule_is_a_constant_or_a_part_of_a_condition() -> None:
    assert {(change.function, change.old, change.new) for change in rules(JUDGING)} == {
        ("SURE", "0.9", "1000 * (0.9)"), ("SURE", "0.9", "(0.9) / 1000"),
        ("FEWEST", "3", "1000 * (3)"), ("FEWEST", "3", "0"),
        ("verdict", "cause > SURE", "True"), ("verdict", "cause > SURE", "False"),
        ("verdict", "len(sure) < FEWEST", "True"), ("verdict", "len(sure) < FEWEST", "False"),
        ("verdict", "few", "False"), ("verdict", "doubt", "True"), ("verdict", "not sure", "True")}
    for change in rules(JUDGING):
        assert differs(JUDGING, mutant_of("verdict.py", JUDGING, change))


def test_rules_are_drawn_from_some_files(tmp_path: Path) -> None:
    (tmp_path / "judge").mkdir()
    for name in ("judge/verdict.py", "judge.py", "other.py"):
        (tmp_path / name).write_bytes(JUDGING)
    scope = ("judge", "judge.py", "judge/verdict.py")
    assert product_files(tmp_path, scope) == ["judge.py", "judge/verdict.py"]
    mutants = draw_rules(tmp_path, 9, 5, scope)
    assert mutants == draw_rules(tmp_path, 9, 5, scope)
    # Of each rule one change at most.
    assert len({(mutant.file, mutant.function, mutant.start) for mutant in mutants}) == 9
    assert {mutant.file for mutant in mutants} == {"judge.py", "judge/verdict.py"}
    assert all(moved(mutant, b"# new\n" + JUDGING) for mutant in mutants)


@pytest.mark.parametrize("kind", KINDS)
def test_a_mutant_compiles_and_differs_in_one_place(kind: str) -> None:
    lines = SOURCE.decode().splitlines()
    for change in found(kind):
        mutant = mutant_of("film.py", SOURCE, change)
        assert differs(SOURCE, mutant), mutant
        changed = mutant.apply(SOURCE)
        end = change.start + len(change.old.encode())
        assert changed[:change.start] == SOURCE[:change.start]
        assert changed[change.start + len(change.new.encode()):] == SOURCE[end:]
        assert mutant.before.startswith(" ".join(lines[mutant.line - 1].split()))
        assert ast.get_docstring(ast.parse(changed)) == "1 + 1 in a docstring."


def test_a_mutant_is_not_put_into_another_file() -> None:
    mutant = mutant_of("film.py", SOURCE, found("branch")[0])
    with pytest.raises(ValueError, match="not the one that mutant 1 was drawn from"):
        mutant.apply(b"\n" + SOURCE)


def test_a_mutant_is_found_in_a_file_that_has_changed_elsewhere() -> None:
    for change in changes(SOURCE):
        mutant = mutant_of("film.py", SOURCE, change)
        there = moved(mutant, b"# new\n" + SOURCE)
        assert there is not None
        assert there.line == mutant.line + 1
        assert there.apply(b"# new\n" + SOURCE) == b"# new\n" + mutant.apply(SOURCE)
        assert moved(mutant, b"") is None


def test_lines_of_code_are_counted() -> None:
    assert code_lines(b'"""A\nB"""\n\n# comment\nx = (1,\n     2)  # two\n') == 2


def test_chapters_are_drawn_in_proportion_to_their_lines() -> None:
    lines = {"a": 100, "b": 250, "c": 650, "d": 3}
    for seed in range(20):
        drawn = spread(lines, 20, random.Random(seed))
        assert len(drawn) == 20
        for chapter, own in lines.items():
            assert abs(drawn.count(chapter) - 20 * own / 1003) < 1


def test_a_draw_is_reproducible(tmp_path: Path) -> None:
    write_toy(tmp_path)
    mutants = draw(tmp_path, 12, 5, ("toy",))
    assert mutants == draw(tmp_path, 12, 5, ("toy",))
    assert mutants != draw(tmp_path, 12, 6, ("toy",))
    assert len({mutant.key for mutant in mutants}) == 12
    write_mutants(tmp_path / "mutants.jsonl", mutants)
    assert read_mutants(tmp_path / "mutants.jsonl") == mutants


def test_batches_grow_and_end_at_the_limit() -> None:
    candidates = [Candidate(str(number), 0, 4.0) for number in range(9)]
    candidates.insert(2, Candidate("long", 0, 99.0))
    cut = list(batches(candidates, lambda tests: 4.0 * len(list(tests)), 30.0))
    assert cut == [["0", "1"], ["2", "3", "4", "5", "6"]]


def write_toy(folder: Path) -> None:
    for name, text in TOY.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def toy_mutant(old: str, new: str, after: str) -> Mutant:
    """A mutant of the toy: a text behind another."""
    source = TOY["toy/sums.py"].encode()
    start = source.index(old.encode(), source.index(after.encode()))
    return mutant_of("toy/sums.py", source, Change("operator", after, start, old, new))


@pytest.mark.study(seconds=7)
@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_a_toy_is_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setattr("benchmarks.trials.mutants.tree._MORE", 3.0)
    tree, keep = tmp_path / "tree", tmp_path / "records.jsonl"
    tree.mkdir()
    write_toy(tree)
    subprocess.run(["git", "init", "-q"], cwd=tree, check=True)
    record(tree, tmp_path / "map", ["-q"], ("toy",))
    suite = SuiteMap.read(tmp_path / "map")

    mutants = {
        "child": toy_mutant("*", "-", "double"),
        "fixture": toy_mutant("-x", "x", "absolute"),
        "equivalent": toy_mutant("<", "<=", "absolute"),
        "kept": toy_mutant("+", "-", "slow"),
        "unused": toy_mutant("-", "+", "unused"),
        "hang": toy_mutant("x - 1", "x + 0", "endless"),
        "import": toy_mutant("def slow", "1 / 0\ndef slow", "@cache"),
    }
    # The result that one test kept is that of the other, too.
    assert {candidate.test for candidate in suite.candidates(mutants["kept"])
            if candidate.reason == 0} == {"test_toy.py::test_kept", "test_toy.py::test_kept_again"}
    assert not suite.candidates(mutants["unused"])
    # A line that was cut off is judged again.
    keep.write_text('{"suite": "af', encoding="utf-8")
    said = list(judge(list(mutants.values()), tree, suite, keep, suite="after", workers=2))
    ends = {name: next(one for one in said if one.mutant == mutant.key)
            for name, mutant in mutants.items()}
    assert {name: (end.end, end.by) for name, end in ends.items()} == {
        "child": (CAUGHT, "test_toy.py::test_child"),
        "fixture": (CAUGHT, "test_toy.py::test_fixture"),
        "equivalent": (GOT_AWAY, ""),
        "kept": (CAUGHT, "test_toy.py::test_kept_again"),
        "unused": (GOT_AWAY, ""),
        "hang": (CAUGHT, "test_toy.py::test_ends"),
        "import": (CAUGHT, "the import of its file"),
    }
    assert ends["unused"].why == "no test runs it"
    assert ends["equivalent"].why == (
        "all candidates passed; 2 of 2 tests that run the block passed")
    assert ends["hang"].why.startswith("hung")
    assert (tree / "toy/sums.py").read_text(encoding="utf-8") == TOY["toy/sums.py"]
    # Everything is kept, and nothing is judged twice.
    assert {one.mutant for one in read_records(keep)} == {one.key for one in mutants.values()}
    assert not list(judge(list(mutants.values()), tree, suite, keep, suite="after"))


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_a_mutant_is_judged_by_a_test_that_is_named(tmp_path: Path,
                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    tree, keep = tmp_path / "tree", tmp_path / "records.jsonl"
    tree.mkdir()
    write_toy(tree)
    # The file has changed since the mutant was drawn.
    (tree / "toy/sums.py").write_text("#\n" + TOY["toy/sums.py"], encoding="utf-8")
    subprocess.run(["git", "init", "-q"], cwd=tree, check=True)
    mutant = toy_mutant("*", "/", "double")
    keep_record(keep, Record("after", mutant.key, GOT_AWAY, "no test runs it", "", 0, 0, 0.0))

    def judged(test: str, again: bool = True) -> list[Record]:
        return list(judge([mutant], tree, SuiteMap.empty(), keep, suite="after", again=again,
                          named={mutant.key: [f"test_toy.py::{test}"]}, options=["test_toy.py"]))

    assert not judged("test_child", again=False)
    passed, = judged("test_other_side")
    assert (passed.end, passed.why) == (GOT_AWAY, "the tests passed that were named")
    caught, = judged("test_child")
    assert (caught.end, caught.by, caught.why, caught.ran, caught.candidates) == (
        CAUGHT, "test_toy.py::test_child", "failed, was named beforehand", 1, 1)
    unsound, = judged("test_fails_by_itself")
    assert (unsound.end, unsound.why) == (GOT_AWAY, UNSOUND)
    with pytest.raises(ValueError, match=r"not among the tests that count: .*::test_gone"):
        judged("test_gone")
    # There is one record of a mutant, the last.
    assert [one.end for one in read_records(keep)] == [GOT_AWAY]


def test_the_table_has_every_suite() -> None:
    mutants = [mutant_of("fem/film.py", SOURCE, change) for change in changes(SOURCE)[:2]]
    records = [Record("before", mutants[0].key, CAUGHT, "failed", "tests/test_a.py::test_b[c|d]",
                      3, 9, 12.3),
               Record("after", mutants[0].key, GOT_AWAY, "all candidates passed", "", 4, 4, 15.0)]
    text = page([Part("All of it", mutants, records)])
    assert "## All of it" in text
    assert "| all | 1 of 1: 100 % (21 to 100 %) | 0 of 1: 0 % (0 to 79 %) |" in text
    assert r"test_a.py `test_b[c\|d]` | 3 of 9 | 12 s | **got away**: all candidates passed" in text
    assert "not judged" in text
    assert "| swapped arguments |" in text


def test_the_table_leaves_an_equivalent_mutant_out_of_the_shares() -> None:
    mutants = [mutant_of("verdict.py", JUDGING, change) for change in rules(JUDGING)[:3]]
    records = [Record("after", mutants[0].key, CAUGHT, "failed", "tests/test_a.py::test_b", 1, 1,
                      2.0),
               Record("after", mutants[1].key, EQUIVALENT, "rounding", "", 0, 0, 0.0)]
    text = page([Part("Rules", mutants, records)])
    assert "| all | 1 of 1: 100 % (21 to 100 %) |" in text
    assert "| equivalent: rounding |  |  |" in text
    assert "| swapped arguments |" not in text
