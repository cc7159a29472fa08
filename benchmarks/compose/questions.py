"""Questions that commands answer of a film on a rig, as command lines.

A command that reads a specimen is asked as its options allow: what is common is in
:data:`COMMON`, what it needs besides in :data:`WAYS`. A command that reads a plan has a writer in
:data:`PLANS`. The others are in :data:`ELSEWHERE`; a test names a command that is nowhere.
"""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from benchmarks.compose.concepts import Asked
from tympan.base.fields import Content
from tympan.commands import COMMANDS
from tympan.fem.toml_writer import toml
from tympan.options import Command

#: Folder of a question's own that its results go to.
MADE = "made"
#: Divisor of element sizes: whether a question is answered does not hang on the mesh, and doors are
#: compared on the same one.
_REFINE = "0.5"
#: Masses of a lumped model beside the first one, over that.
_SECOND = 1.25
#: Key that plans vary, as TOML has a dotted key.
_THICKNESS = '"membrane.thickness"'
#: Bound that every film keeps, so that the search knows frequencies.
_SLOWEST = "0.01 Hz"
#: Thickness between which designs vary, over the film's own.
_VARIED = (0.8, 1.5)

#: Further words of commands, by the name of the question. ``{mass}``, ``{second}`` and
#: ``{voltage}`` are those of the film; words with a mass that it has not are left out.
WAYS: Mapping[str, Mapping[str, str]] = {
    "solve": {"solve": "", "after": '--after "10 s"'},
    "curve": {"curve": ""},
    "force": {"force": '--voltage "0 kV, {voltage}" --to "8 mm" --points 9 --mass "{mass}"',
              "loop": '--to "5 mm" --points 6 --rate "1 mm/s" --cycles 2'},
    "sense": {"sense": '--voltage "0 kV, {voltage}"'},
    "tolerance": {"tolerance": "--films 256"},
    "path": {"path": "", "path mass": "--along mass", "path charge": "--along charge",
             "path pressure": "--along pressure", "path in time": '--rate "200 V/s"'},
    "transient": {"transient": '--signal step --high "{voltage}" --duration "2 s"',
                  "swing": '--signal sine --high "{voltage}" --duration "1 s" --swing'},
    "design": {"design": f"-o {MADE}"},
    "export": {"export": "", "export input": '--inp --mass "{mass}" --voltage "{voltage}"'},
    "lumped build": {"lumped build": '--mass "{mass},{second}" --count 5'},
    "lumped simulate": {"lumped simulate": '--signal step --high "{voltage}" --duration "2 s"'},
    "lumped linearise": {"lumped linearise": '--voltage "{voltage}"'},
    "lumped control": {"lumped control": '--supply "{voltage}" --duration "20 s"'},
}

#: Options of :data:`COMMON` that a question does not take, though its command knows them.
LEFT_OUT: Mapping[str, frozenset[str]] = {
    "export": frozenset({"mass", "voltage"}),
    "limits": frozenset({"voltage"}),  # which are names of segments alone
    "lumped build": frozenset({"voltage"}),  # which needs a range
    "path in time": frozenset({"voltage"})}  # a loop begins at none

#: Commands that ask nothing of a film on a rig, and why.
ELSEWHERE: Mapping[str, str] = {
    "outlines": "of registered outlines", "map": "of ellipses", "report": "draws what is stored",
    "compare": "of what is stored",
    "explore": "serves until it is ended", "draw": "reads a specimen alone",
    "study": "asks solve, curve, force and alpha",
    "materials": "of the library", "material show": "of the library", "effects": "a list",
    "doctor": "of the installation",
    "steer": "needs segments", "lumped steer": "needs segments",
    "data": "of readings", "diagnose": "of readings",
    "material fit": "of readings", "lumped identify": "of readings",
    "lumped export": "of a model", "lumped paper": "of the source paper's actuators"}


@dataclass(frozen=True)
class Question:
    """A question and its command line; none where it has to wait for another one's answer."""

    name: str
    line: Callable[[Asked, Path], list[str] | None]


def _quantity(value: float, unit: str, factor: float) -> str:
    return f"{value * factor:.6g} {unit}"


def mass_of(asked: Asked, share: float = 1.0) -> str:
    """Mass on the plate as an option has it; empty without plate."""
    return "" if asked.mass is None else _quantity(share * asked.mass, "g", 1e3)


def voltage_of(asked: Asked) -> str:
    """Voltage as an option has it."""
    return _quantity(asked.voltage, "kV", 1e-3)


def _if(value: str | Path | None, option: str) -> list[str]:
    return [option, str(value)] if value else []


#: Words of options that several commands have, by the option's name.
COMMON: Mapping[str, Callable[[Asked], list[str]]] = {
    "mass": lambda asked: _if(mass_of(asked), "--mass"),
    "voltage": lambda asked: ["--voltage", voltage_of(asked)],
    "rig": lambda asked: _if(asked.rig, "--rig"),
    "workers": lambda asked: ["--workers", "1"],
    "refine": lambda asked: ["--refine", _REFINE],
    "json": lambda asked: ["--json"]}


def sweep_plan(asked: Asked) -> Content:
    """Sweep of the film and a thicker one, with what doors are compared by."""
    thickness = asked.specimen.membrane.thickness
    return {"specimen": asked.film.name, **_mass(asked), **_rig(asked),
            "voltage": ["0 kV", voltage_of(asked)], "ask": ["limits", "modes"],
            "grid": {_THICKNESS: [_quantity(thickness, "mm", 1e3),
                                            _quantity(_SECOND * thickness, "mm", 1e3)]}}


def requirements(asked: Asked) -> Content:
    """Requirements of the largest stroke by thickness."""
    varied = [_quantity(share * asked.specimen.membrane.thickness, "mm", 1e3) for share in _VARIED]
    rig = asked.combination.content("rig")
    frequency = {"frequency": _SLOWEST} if asked.specimen.plate else {}
    return {"specimen": asked.film.name, **_mass(asked), "voltage": voltage_of(asked),
            "want": {"stroke": "largest", **frequency}, "vary": {_THICKNESS: varied},
            **({"rig": rig} if asked.rig else {})}


def _mass(asked: Asked) -> Content:
    return {"mass": mass_of(asked)} if mass_of(asked) else {}


def _rig(asked: Asked) -> Content:
    return {"rig": asked.rig.name} if asked.rig else {}


#: Writers of plans by what the command calls its file.
PLANS: Mapping[str, Callable[[Asked], Content]] = {
    "SWEEP.toml": sweep_plan, "REQUIREMENTS.toml": requirements}

#: Questions of the best film that `design` found, and their further words, to compare it with.
OF_DESIGN: Mapping[str, tuple[str, bool]] = {
    "best solve": ("solve", True), "best limits": ("limits", False), "best modes": ("modes", True)}


def questions() -> Iterator[Question]:
    """All questions, in the order of commands; those of a design's best film follow it."""
    for command in COMMANDS:
        if command.name in ELSEWHERE:
            continue
        for name, words in WAYS.get(command.name, {command.name: ""}).items():
            yield Question(name, _asking(command, words, LEFT_OUT.get(name, frozenset())))
        if command.name == "design":
            for name, (asked, charged) in OF_DESIGN.items():
                yield Question(name, _asking_best(asked, charged))


def _asking(command: Command, words: str, left_out: frozenset[str]
            ) -> Callable[[Asked, Path], list[str]]:
    def line(asked: Asked, folder: Path) -> list[str]:
        first, options = options_of(command)
        plan = asked.film
        if first in PLANS:
            plan = asked.film.with_suffix(f".{first}")
            plan.write_text(toml(PLANS[first](asked)), encoding="utf-8")
        further = _further(asked, words)
        common = [word for name, made in COMMON.items()
                  if name in options and name not in left_out and f"--{name}" not in further
                  for word in made(asked)]
        where = ["-o", MADE] if "output" in options and options["output"].required else []
        return [*command.name.split(), str(plan), *further, *common, *where]

    return line


def _asking_best(command: str, charged: bool) -> Callable[[Asked, Path], list[str] | None]:
    def line(asked: Asked, folder: Path) -> list[str] | None:
        made = folder.parent / "design" / MADE
        if not (made / "design.json").exists():
            return None
        best = json.loads((made / "design.json").read_text(encoding="utf-8"))["films"][0]
        return [command, str(made / best["specimen_file"]), "--rig", str(made / best["rig_file"]),
                "--mass", f"{best['mass_kg']!r} kg",
                *(["--voltage", f"{best['voltage_V']!r} V"] if charged else []),
                "--refine", _REFINE, "--json"]

    return line


@cache
def options_of(command: Command) -> tuple[str, dict[str, argparse.Action]]:
    """First argument as its help calls it, and the options by name."""
    parser = argparse.ArgumentParser()
    for argument in command.arguments:
        argument(parser)
    first = next((str(action.metavar) for action in parser._actions if not action.option_strings),
                 "")
    return first, {action.dest: action for action in parser._actions if action.option_strings}


def _further(asked: Asked, words: str) -> list[str]:
    """Further words for a film; an option whose value names a mass goes where it has none."""
    found, values = list[str](), {"mass": mass_of(asked), "second": mass_of(asked, _SECOND),
                                  "voltage": voltage_of(asked)}
    for word in shlex.split(words):
        if "{mass}" in word and not values["mass"]:
            found.pop()
        else:
            found.append(word.format(**values))
    return found
