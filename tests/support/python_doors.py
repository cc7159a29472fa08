"""Every command and option beside its Python: ``python -m tests.support.python_doors`` writes it.

An option has the argument of its name; what has not is listed here with the
words that say the same in Python, or with the reason why there is nothing.
"""

from __future__ import annotations

import argparse
import inspect
from pathlib import Path
from typing import Any

import tympan
from tympan.cli import build_parser
from tympan.commands import COMMANDS
from tympan.options import FormerOption

PAGE = Path(__file__).parents[2] / "docs" / "python-commands.md"

#: Commands without a door, and why.
WITHOUT = {
    "doctor": "looks at the installation; ask it where something does not work",
    "explore": "serves a live page until Ctrl-C; a script has the numbers by the other doors",
    "outlines": "finds α of tympan's outlines with the source paper's film; of your own film see "
                "`tympan.alpha`",
    "map": "finds α of ellipses with the source paper's film; of your own film see `tympan.alpha`",
    "lumped paper": "computes the source paper's figures and tables again, not a film of yours",
}
#: What an option is in Python, of every command that has it.
COMMON = {
    "specimen": "the name of its file, or a `Specimen` made in Python",
    "specimens": "likewise, of each",
    "model": "`NAME.lumped.toml`, or a model of `lumped.build`",
    "json": "`result.json()`",
    "output": "`result.save(FOLDER)`",
    "refine": "`settings=tympan.Settings(tympan.MeshSettings().refined(2))`",
    "formula": "`settings=tympan.Settings(formula=\"cone\")`",
    "rig": '`rig="rig.toml"`, a `Rig` made in Python, or a dictionary of its keys',
    "animate": '`result.plot("NAME.gif")`',
}
#: The same, of one command.
OWN = {
    ("transient", "specimens"): "a `Specimen`, or several in a list",
    ("alpha", "basis"): '`result.json("cone")`',
    ("study", "output"): "`result.save(FOLDER)`",
    ("sweep", "output"): "`folder=`, where finished cases are kept",
    ("sweep", "best"): '`result.best("stroke")`',
    ("sweep", "under"): '`result.best("stroke", under="max_true_stress < 131 kPa")`',
    ("draw", "output"): "`target=` a file or axes",
    ("export", "output"): "`folder=`",
    ("effects", "markdown"): "prints a page of these docs",
    ("materials", "json"): "the answer itself",
    ("effects", "json"): "the answer itself",
    ("material show", "material"): "`name`",
    ("data", "draft"): "`tympan.draft(FILE)`",
    ("data", "kind"): "`tympan.draft(FILE, kind=...)`",
    ("data", "target"): "`tympan.draft(FILE, target=...)`",
    ("data", "json"): "the answer itself",
    ("diagnose", "plan"): "`tympan.plan(DATASET)`",
    ("diagnose", "formula"): "`formula=\"cone\"`",
    ("material fit", "coupons"): "`tympan.fit_material(FILE, ...)`",
    ("material fit", "mass"): "`film=tympan.Case(specimen, mass=...)`",
    ("material fit", "voltage"): "`film=tympan.Case(specimen, voltage=...)`",
    ("lumped linearise", "save"): "`result.save(FILE)`",
    ("lumped export", "output"): "`folder=`",
    ("lumped identify", "no_limits"): "`limits=False`",
}
#: Where names differ: a command of a group of two words.
NAMES = {"material show": "show_material", "material fit": "fit_material"}


def door(command: str) -> Any:
    """The Python function of a command, by its name; "lumped build" is lumped.build."""
    found: Any = tympan
    if (first := command.split()[0]) not in tympan.__all__ and command not in NAMES:
        # A package below tympan that something has imported is no door.
        raise AttributeError(first)
    for part in NAMES.get(command, command).split():
        found = getattr(found, part)
    return found


def options(command: str) -> list[argparse.Action]:
    """The arguments and options of a command; not under their former names."""
    parser: Any = build_parser()
    for part in command.split():
        groups, = (action for action in parser._actions
                   if isinstance(action, argparse._SubParsersAction))
        parser = groups.choices[part]
    return [action for action in parser._actions
            if action.dest != "help" and not isinstance(action, FormerOption)]


def arguments(command: str) -> dict[str, inspect.Parameter]:
    """The arguments of a command's function, those that it hands on among them."""
    function = door(command)
    listed = dict(inspect.signature(inspect.unwrap(function)).parameters)
    for item in list(listed.values()):
        if item.kind is item.VAR_KEYWORD:
            words = item.annotation.removeprefix("Unpack[").removesuffix("]")
            more = getattr(inspect.getmodule(inspect.unwrap(function)), words)
            listed |= {name: inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY)
                       for name in more.__annotations__}
    return listed


def argument(command: str, option: str) -> str | None:
    """The argument that an option is: of its name; ``from_`` where Python has a word of its own."""
    names = arguments(command)
    return next((name for name in (option, f"{option}_")
                 if name in names), None)


def in_python(command: str, option: str) -> str | None:
    """What an option is in Python; None where nothing is known."""
    if (command, option) in OWN:
        return OWN[command, option]
    name = argument(command, option)
    if name is not None and option not in COMMON:
        return f"`{name}=`"
    return COMMON.get(option)


def page() -> str:
    """The page of every command."""
    rows = ["# Commands as Python functions", "",
            "Every command has its function in `import tympan`, by the same names. Where an option "
            "is something else in Python, the table says what.",
            "Quantities are SI numbers or texts with their unit.", ""]
    for command in COMMANDS:
        if command.name in WITHOUT:
            rows += [f"## {command.name}", "", f"No function: it {WITHOUT[command.name]}.", ""]
            continue
        name = ".".join(NAMES.get(command.name, command.name).split())
        rows += [f"## {command.name}", "", f"`tympan.{name}`", "", "| option | Python |",
                 "|---|---|"]
        rows += [f"| `{action.option_strings[-1] if action.option_strings else action.dest}` | "
                 f"{in_python(command.name, action.dest)} |" for action in options(command.name)]
        rows.append("")
    return "\n".join(rows)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
