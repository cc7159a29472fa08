"""The page of grammar, and what it is made from: ``python -m tests.support.grammar`` writes it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import tympan
from tests.support import python_doors
from tympan.base.fields import Field, fields_of
from tympan.commands import COMMANDS
from tympan.grammar import BY_QUESTION, LOADS, SUBJECTS, WORDS
from tympan.options import FormerOption
from tympan.studies.data.dataset import Dataset
from tympan.studies.design import requirements
from tympan.studies.design.requirements import RequirementsFile
from tympan.studies.study import StudyFile
from tympan.studies.sweep.plan import Sample, SweepFile

PAGE = Path(__file__).parents[2] / "docs" / "grammar.md"

BEGINNING = Path(__file__).with_name("grammar.txt").read_text(encoding="utf-8")


#: Files that ask, by what they are called, with the class that declares their keys.
FILES: dict[str, type] = {"STUDY.toml": StudyFile, "SWEEP.toml": SweepFile,
                          "[sample] of a sweep": Sample, "REQUIREMENTS.toml": RequirementsFile,
                          "dataset.toml": Dataset}
#: Former keys of such files.
FORMER_KEYS = {"REQUIREMENTS.toml": requirements.FORMER_KEYS}


def keys() -> dict[str, list[tuple[str, Field]]]:
    """Every key of the files that ask, with the files that have it."""
    found = dict[str, list[tuple[str, Field]]]()
    for file, declared in FILES.items():
        for field in fields_of(declared):
            found.setdefault(field.key, []).append((file, field))
    return found


def former_options() -> Iterator[tuple[str, str, str]]:
    """Yield each option that commands still take under a former name: command, then, now."""
    for command in COMMANDS:
        parser: Any = argparse.ArgumentParser()
        for add in command.arguments:
            add(parser)
        yield from ((command.name, action.option_strings[0], action.now)
                    for action in parser._actions if isinstance(action, FormerOption))


def functions() -> dict[str, Any]:
    """The public functions by their names."""
    plain = {name: getattr(tympan, name) for name in tympan.__all__ if name.islower()
             and name != "lumped" and callable(getattr(tympan, name))}
    return plain | {f"lumped.{name}": getattr(tympan.lumped, name)
                    for name in vars(type(tympan.lumped)) if not name.startswith("_")}


def former_arguments() -> Iterator[tuple[str, str, str]]:
    """Yield each argument that functions still take another way: function, then, now."""
    for name, function in functions().items():
        former, placed, rest = function.former
        yield from ((name, f"{old}=", f"{new}=") for old, new in former.items())
        yield from ((name, f"{each} by its place", f"{each}=") for each in placed)
        if rest:
            yield name, "further values by their place", f"{rest}=[...]"


@cache
def spoken() -> dict[str, list[tuple[str, Any]]]:
    """Every name with the commands that have it, and its default there."""
    found = dict[str, list[tuple[str, Any]]]()
    for command in COMMANDS:
        for action in python_doors.options(command.name):
            name = action.option_strings[-1] if action.option_strings else action.dest
            word = name.lstrip("-").replace("-", "_")
            found.setdefault(word, []).append((command.name, action.default))
    return found


def doors() -> Iterator[str]:
    """Yield the rows of a table of all commands, with their functions."""
    yield from ("| command | Python | what it does |", "|---|---|---|")
    for command in COMMANDS:
        name = python_doors.NAMES.get(command.name, command.name).replace(" ", ".")
        function = "" if command.name in python_doors.WITHOUT else f"`tympan.{name}`"
        yield f"| `tympan {command.name}` | {function} | {command.summary} |"


def page() -> str:
    """The page."""
    rows = [BEGINNING, "## Commands and functions", "",
            "[Commands as Python functions](python-commands.md) lists the options of each. Where "
            "no function stands, there is none.", "", *doors(),
            "| `tympan data --draft` | `tympan.draft` | draft a dataset.toml for a table |",
            "| `tympan diagnose --plan` | `tympan.plan` | list what such readings can show |", "",
            "## Words", "",
            "A default stands here where it is the same in every question.", "",
            "| word | meaning | SI unit | default | commands | files |",
            "|---|---|---|---|---|---|"]
    for name in sorted(WORDS, key=lambda name: (name not in LOADS, name not in SUBJECTS, name)):
        word, commands = WORDS[name], [command for command, _ in spoken().get(name, [])]
        where = (", ".join(commands) if 0 < len(commands) <= 6 else
                 f"{len(commands)} commands" if commands else "Python")
        default = ("" if word.default in (BY_QUESTION, None, "", False) else
                   "yes" if word.default is True else str(word.default))
        files = ", ".join(file for file, _ in keys().get(name, []))
        where = "" if where == "Python" and files else where
        rows.append(f"| `{name}` | {word.meaning} | {word.unit} | {default} | {where} | {files} |")
    rows += ["", "## Former names", "",
             "They work until the next minor version ([what is public](public.md)). Each use "
             "prints one line with the name of now.", "",
             "| where | formerly | now |", "|---|---|---|"]
    rows += [f"| `tympan {where}` | `{then}` | `{now}` |" for where, then, now in former_options()]
    rows += [f"| `tympan {command.name.rpartition(' ')[0]} {then}`".replace("  ", " ")
             + f" | the command | `tympan {command.name}` |"
             for command in COMMANDS for then in command.formerly]
    rows += [f"| {file} | `{then}` | `{now}` |"
             for file, renamed in FORMER_KEYS.items() for then, now in renamed.items()]
    rows += [f"| `tympan.{where}` | {_code(then)} | `{now}` |"
             for where, then, now in former_arguments()]
    return "\n".join([*rows, ""])


def _code(words: str) -> str:
    return f"`{words}`" if words.endswith("=") else words


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
