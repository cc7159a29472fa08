"""Every command once, by its own example, on small inputs: what one runs before a commit.

`make check` asks for these tests; the whole suite, which holds each command to more, does not.
"""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from benchmarks.trials.signals import DATASET, FILES, STATIC
from tympan.cli import main
from tympan.commands import COMMANDS
from tympan.options import Command

pytestmark = pytest.mark.smoke

#: What makes an example quick, and shows no less of what can break.
QUICKER = {"study": "STUDY.toml", "sweep": "--refine 0.5 --workers 1", "design": "--refine 0.5",
           "outlines": "--refine 0.5", "lumped build": "--refine 0.5", "path": "--refine 0.5",
           "modes": "--refine 0.5", "lumped paper": "--levels 4",
           "material fit": "--law neo_hooke --law yeoh"}

#: Commands whose results an example begins with.
BEFORE = {"report": "study STUDY.toml -o out",
          "lumped export": "lumped build oval.toml --refine 0.5 -o lumped"}

#: Readings in time: steps that creep, of the film that the readings at rest are of.
TRANSIENT = "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n" + "".join(
    f"round,20,{run},{0.05 * number:.2f},{run * (number >= 4):g},"
    f"{1.0 + 0.06 * run**2 * (number >= 4) * (2 - 0.9 ** number):.4f}\n"
    for run in (2, 3, 4) for number in range(80))

#: Commands that are not tried here, with where they are.
ELSEWHERE = {"explore": "serves until it is ended; tests/explore",
             "map": "solves a hundred films; tests/studies"}


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_a_command_s_own_example_works(command: Command, tmp_path: Path,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    if command.name in ELSEWHERE:
        pytest.skip(ELSEWHERE[command.name])
    monkeypatch.chdir(tmp_path)
    files = {**FILES, "readings/dataset.toml": DATASET, "readings/static.csv": STATIC}
    if "--dynamic" in command.example:
        files["readings/transient.csv"] = TRANSIENT
    for name, text in files.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
    line = f"{command.name} {command.example} {QUICKER.get(command.name, '')}"
    for words in filter(None, (BEFORE.get(command.name), line)):
        assert main(shlex.split(words)) == 0, words
