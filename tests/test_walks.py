"""The walks of docs/walks.md are those that the program goes."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name
from types import FrameType
from typing import Any

import pytest

import tympan
from tests.support.costs import dear
from tests.support.datasets import write_dataset
from tests.support.specimens import specimen_toml

PAGE = (Path(__file__).parents[1] / "docs/walks.md").read_text(encoding="utf-8")
#: Words that are read aloud in two minutes.
TWO_MINUTES = 300
#: Readings of one film [mm] under 10 g and 20 g, at voltages of 0 to 4 kV.
READ = {10: (1.46, 1.50, 1.60, 1.78, 2.05), 20: (2.83, 2.89, 3.05, 3.35, 3.85)}


def walks() -> dict[str, tuple[str, list[tuple[str, str]]]]:
    """The text and the steps of each walk, module and function, by the function that goes it."""
    found = {}
    for text in PAGE.split("\n## ")[1:]:
        door = re.search(r"`tympan\.(\w+)\(", text)
        assert door is not None
        found[door[1]] = text, re.findall(r"^\d+\. `([\w.]+): ([\w.]+)`", text, re.M)
    return found


WALKS = walks()


def solve(folder: Path) -> Any:
    file = folder / "oval.toml"
    # A film that no other test meshes: its mesh is not kept.
    frame = 'shape = "ellipse"\nsemi_axes = ["61.3 mm", "41.7 mm"]'
    file.write_text(specimen_toml(frame=frame), encoding="utf-8")
    return tympan.solve(tympan.load(file), mass="17.9 g", voltage="3.5 kV")


def design(folder: Path) -> Any:
    file = folder / "oval.toml"
    file.write_text(specimen_toml(), encoding="utf-8")
    requirements = folder / "requirements.toml"
    requirements.write_text('specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "3.5 kV"\n'
                            '[want]\nstroke = "largest"\nfrequency = "7 Hz"\n'
                            '[vary]\n"membrane.prestretch" = [2.0, 2.5]\n', encoding="utf-8")
    return tympan.design(requirements)


def diagnose(folder: Path) -> Any:
    lines = [f"A,{mass},{voltage},{read}" for mass, reads in READ.items()
             for voltage, read in enumerate(reads)]
    static = "\n".join(["specimen,mass_g,voltage_kV,displacement_mm", *lines, ""])
    return tympan.diagnose(write_dataset(folder / "data", specimens=("A",), static=static))


def first_calls(walk: Callable[[Path], Any], folder: Path, steps: list[tuple[str, str]]
                ) -> list[tuple[str, str]]:
    """Go a walk and list its steps in the order in which they are first called."""
    named = {(module.replace(".", "/"), name): (module, name) for module, name in steps}
    met: dict[tuple[str, str], None] = {}

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event != "call":
            return
        code = frame.f_code
        inside = code.co_filename.rpartition("/tympan/")[2].removesuffix(".py")
        step = named.get((f"tympan/{inside}", code.co_qualname))
        if step is not None:
            met.setdefault(step)

    sys.setprofile(note)
    try:
        walk(folder)
    finally:
        sys.setprofile(None)
    return list(met)


@pytest.mark.parametrize("door", WALKS)
def test_every_step_is_there_and_two_minutes_are_enough(door: str) -> None:
    text, steps = WALKS[door]
    assert len(steps) > 5
    for module, name in steps:
        step = resolve_name(f"{module}:{name}")
        assert callable(step) or isinstance(step, property)
    assert len(text.split()) <= TWO_MINUTES


@pytest.mark.parametrize("walk", [solve, design, dear(diagnose, seconds=15)])
def test_a_walk_is_gone_in_this_order(walk: Callable[[Path], Any], tmp_path: Path,
                                      monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TYMPAN_CACHE", str(tmp_path / "kept"))
    _, steps = WALKS[walk.__name__]
    assert first_calls(walk, tmp_path, steps) == steps
