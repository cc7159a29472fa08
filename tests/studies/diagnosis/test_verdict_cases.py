"""The verdict cases: a program's answers are judged rightly, and folders are those of their script.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from benchmarks.trials.verdict_cases.__main__ import PROGRAM, right, said_by, within
from benchmarks.trials.verdict_cases.evidence_cases import (
    EVIDENCE_CASES,
    EvidenceCase,
    write_evidence,
)
from benchmarks.trials.verdict_cases.made import (
    CASES,
    COUPON_CASES,
    FOLDER,
    CouponCase,
    write,
    write_coupons,
)
from tests.support.costs import dear
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import diagnose

SPRING = {"effect": "parallel_spring",
          "parameters": {"k": {"value": 4.1, "unit": "N/m", "low": 3.9, "high": 4.3}}}
ZERO = {"effect": "sensor_zero",
        "parameters": {"y_0": {"value": 1.0, "unit": "um", "low": 0.0, "high": 2.0}}}


def expected(name: str) -> dict[str, object]:
    content: dict[str, object] = json.loads((FOLDER / name / "expected.json").read_text())
    return content


@pytest.mark.parametrize(("case", "verdict", "causes", "correct"), [
    ("spring", "named", [SPRING, ZERO], True), ("spring", "named", [ZERO, SPRING], False),
    ("spring", "ambiguous", [SPRING, ZERO], False), ("spring", "nothing", [], False),
    ("two", "named", [ZERO, SPRING], True), ("two", "named", [ZERO], False),
    ("two", "ambiguous", [SPRING], False), ("sagging-supply", "ambiguous", [SPRING], False),
    ("nothing", "nothing", [], True), ("nothing", "named", [SPRING], False),
    ("knocked", "unexplained", [ZERO], True), ("knocked", "named", [ZERO], False)])
def test_answers_are_judged(case: str, verdict: str, causes: list[dict[str, object]],
                            correct: bool) -> None:
    assert right({"verdict": verdict, "causes": causes}, expected(case)) is correct


def test_limits_are_held_against_what_is_hidden() -> None:
    assert within({"causes": [SPRING]}, expected("spring")) == [True]
    assert within({"causes": [SPRING]}, expected("stiff-spring")) == [False]
    assert within({"causes": [ZERO]}, expected("spring")) == []


def test_another_program_is_tried_the_same_way(tmp_path: Path) -> None:
    program = tmp_path / "guess.py"
    program.write_text("import json\nprint(json.dumps({'verdict': 'nothing', 'causes': []}))\n")
    said = said_by(f"{sys.executable} {program} {{dataset}}", FOLDER / "spring")
    assert not right(said, expected("spring"))


@pytest.mark.study(seconds=32)
def test_the_program_itself_is_right_where_nothing_is_hidden() -> None:
    assert right(said_by(PROGRAM, FOLDER / "nothing"), expected("nothing"))


@pytest.mark.parametrize("name", ["spring", "knocked", "softer-film"])
def test_a_folder_is_what_its_script_makes(tmp_path: Path, name: str) -> None:
    case, = (case for case in CASES if case.name == name)
    write(case, tmp_path / name)
    assert (tmp_path / name / "expected.json").read_text() == (
        FOLDER / name / "expected.json").read_text()
    made, kept = (read_dataset(folder / name) for folder in (tmp_path, FOLDER))
    assert (made.specimens, made.rig, made.noise) == (kept.specimens, kept.rig, kept.noise)
    lines = [(folder / name / "static.csv").read_text().splitlines()
             for folder in (tmp_path, FOLDER)]
    assert lines[0][0] == lines[1][0]
    for pair in zip(*(part[1:] for part in lines), strict=True):
        new, old = (line.split(",") for line in pair)
        assert new[:3] == old[:3]
        assert float(new[3]) == pytest.approx(float(old[3]), abs=1e-6)


def test_there_is_a_folder_for_every_case() -> None:
    assert sorted(case.name for case in (*CASES, *COUPON_CASES, *EVIDENCE_CASES)) == sorted(
        folder.name for folder in FOLDER.iterdir())


#: Processor seconds of the coupons whose verdict takes long; others have verdicts of that kind.
DEAR = {"coupons-second-invariant": 15, "coupons-falling": 10, "coupons-warm": 8}


@pytest.mark.parametrize("case", [
    dear(case, seconds=DEAR[case.name], name=case.name) if case.name in DEAR
    else pytest.param(case, id=case.name) for case in COUPON_CASES])
def test_a_folder_of_coupons_is_what_its_script_makes_and_is_judged_rightly(
        tmp_path: Path, case: CouponCase) -> None:
    write_coupons(case, tmp_path / case.name)
    for file in (tmp_path / case.name).iterdir():
        assert file.read_text() == (FOLDER / case.name / file.name).read_text()
    assert right(diagnose(read_dataset(FOLDER / case.name)).json(), expected(case.name))


@pytest.mark.parametrize("case", EVIDENCE_CASES, ids=lambda case: case.name)
def test_a_folder_of_more_evidence_is_what_its_script_makes(tmp_path: Path,
                                                            case: EvidenceCase) -> None:
    """To a hundredth of its noise, and what is expected says what was hidden."""
    write_evidence(case, tmp_path / case.name)
    made, kept = (read_dataset(folder / case.name) for folder in (tmp_path, FOLDER))
    assert (made.specimens, made.rig, made.noise) == (kept.specimens, kept.rig, kept.noise)
    assert set(made.tables) == set(kept.tables)
    for name in ("static", "transients", "fields", "frequencies"):
        new, old = getattr(made, name), getattr(kept, name)
        assert (new is None) == (old is None)
        if new is not None:
            column = "frequency" if name == "frequencies" else "displacement"
            assert new[column] == pytest.approx(old[column], rel=1e-6, abs=1.1e-7)
    assert case.expected == expected(case.name)


@pytest.mark.parametrize("name", [
    pytest.param(case.name, marks=() if case.name == "steps-nothing" else pytest.mark.study)
    for case in EVIDENCE_CASES])
def test_more_evidence_is_judged_rightly(name: str) -> None:
    said = diagnose(read_dataset(FOLDER / name)).json()
    assert right(said, expected(name))
    assert all(within(said, expected(name)))
