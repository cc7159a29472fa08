"""Ten tasks of docs/howto/tasks.md: the terminal, Python and the text have the same numbers."""

from __future__ import annotations

import re
import runpy
import shlex
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.support.costs import dear
from tympan.base.units import any_quantity
from tympan.cli import main

TEXT = (Path(__file__).parent.parent / "docs/howto/tasks.md").read_text(encoding="utf-8")
#: The film of all tasks, then the tasks.
FIRST, *TASKS = re.split(r"^## \d+\. ", TEXT, flags=re.MULTILINE)
#: Lines of a screen, and characters of a line.
LINES, LENGTH = 25, 100

#: What the terminal says of each bold number of a task; Python prints the first one first.
SAID: Mapping[int, tuple[str, ...]] = {
    1: (r"deflection +(\S+ mm)", r"loss of tension (\S+ kV)"),
    2: (r"deflection +(\S+ mm)",),
    3: (r"misses the readings by (\S+ µm)",),
    4: (r"blocked force (\S+ mN)", r"stroke (\S+ mm)"),
    5: (r": (\S+ %) reach it",),
    6: (r"stroke +\S+ mm +(\S+ mm)", r"thickness +(\S+ mm)", r"radius +(\S+ mm)"),
    7: (r"α1 = (\S+)",),
    8: (r"\n +5\.01 +\S+ +\S+ +(\S+ s)", r"gain × ([\d.]+)"),
    9: (r"\n1\. .*stroke (\S+ mm)",),
    10: (r"mu = (\S+ kPa)",),
}
#: Processor seconds of both screens.
SECONDS: Mapping[int, float] = {
    2: 9, 3: 10, 5: 17, 6: 7, 7: 6, 8: 12, 9: 7,
}


def blocks(task: str, language: str) -> list[str]:
    """Blocks of a task in one language, without those that are files."""
    return re.findall(rf"(?<!`:\n\n)```{language}\n(.*?)```", task, re.DOTALL)


def write_files(task: str, folder: Path) -> None:
    """Write the files that a task names right above their blocks."""
    folder.mkdir()
    for name, text in re.findall(r"^`(\S+)`:\n\n```\w+\n(.*?)```", task, re.DOTALL | re.MULTILINE):
        (folder / name).write_text(text, encoding="utf-8")


def number(text: str) -> tuple[float, float]:
    """A number in SI, and half of its last digit."""
    match = re.fullmatch(r"([\d.]+(?:e-?\d+)?) ?(\D*)", text)
    assert match, text
    value, unit = match.groups()
    if not unit or unit == "%":
        scale = 0.01 if unit else 1.0
    else:
        found = any_quantity(f"1 {unit}")
        assert found is not None, text
        scale = found[0]
    digits = len(value.partition("e")[0].partition(".")[2])
    return float(value) * scale, 0.5 * 10.0**-digits * scale


def run_shell(screen: str) -> None:
    for line in screen.splitlines():
        program, *words = shlex.split(line)
        if program == "python":
            runpy.run_path(*words)
        else:
            assert program == "tympan"
            assert main(words) == 0


def test_screens_are_short() -> None:
    assert len(TASKS) == 10
    for task in TASKS:
        screens = [*blocks(task, "sh"), *blocks(task, "python")]
        assert len(screens) == 2
        for screen in screens:
            lines = screen.splitlines()
            assert len(lines) <= LINES
            assert max(map(len, lines)) <= LENGTH, task.partition("\n")[0]


@pytest.mark.parametrize("count", [dear(count, seconds=SECONDS[count], name=str(count))
                                   if count in SECONDS else count for count in SAID])
def test_a_task_gives_the_numbers_of_its_text(
        count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    task = TASKS[count - 1]
    stated = re.findall(r"\*\*(.*?)\*\*", task)
    shell, = blocks(task, "sh")
    python, = blocks(task, "python")
    for name in ("sh", "py"):
        write_files(FIRST + task, tmp_path / name)
    monkeypatch.chdir(tmp_path / "sh")
    run_shell(shell)
    printed = capsys.readouterr().out
    found = [re.search(pattern, printed) for pattern in SAID[count]]
    said = [match and match[1] for match in found]
    assert all(said), printed
    monkeypatch.chdir(tmp_path / "py")
    exec(python, {})
    first = re.search(r"\d\S*?\d*(?: um\b)?(?=[\s,}])", capsys.readouterr().out)
    assert first
    for text, shown in zip(stated, said, strict=True):
        value, half = number(text)
        assert number(shown)[0] == pytest.approx(value, rel=0, abs=1.01 * half)
    value, half = number(said[0])
    assert number(first[0])[0] == pytest.approx(value, rel=0, abs=1.01 * half)
