"""Help that all questions about a film share: its loads, and the rig that it is on."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from textwrap import fill

from tympan.grammar import LOADS, WORDS
from tympan.options import Command

#: Forms of a load, as an option, a file and Python take it.
_FORMS = {
    '"17.9 g"': "one value", '"10 g, 20 g"': "several values",
    '"0 kV..5 kV"': "a range of 11 values", '"0 kV..5 kV in 6"': "a range of 6 values",
    '"80 %"': "of a voltage: a share of the film's first limit"}
#: Columns of a terminal.
_WIDTH = 79
#: Columns of names before their meaning.
_NAMES = 22


def loads_page(commands: tuple[Command, ...]) -> str:
    """Write the page; ``commands`` are all that there are."""
    from tympan.base.fields import fields_of
    from tympan.fem.rig import Rig

    names = [command.name for command in commands if takes_rig(command)]
    parts = [
        f"Loads and rig. They mean the same in {', '.join(names[:-1])} and {names[-1]}.",
        _listed((f"--{name}", WORDS[name].meaning.replace("`", "")) for name in LOADS),
        "Forms of a load. Several values are for curve, force, sense, export, lumped build and "
        "sweeps; a question about one state takes one. A voltage or a pressure that is left out is "
        "0. solve, path, modes, sensitivity and response ask for the mass of a film with a plate; "
        "other questions choose one that suits the film.",
        _listed(_FORMS.items()),
        'A rig is a file, or the table [rig] of the specimen\'s file, which --rig replaces: rig = '
        '"rig.toml" names a file there, too. Its keys (docs/reference.md has their limits):',
        _listed((field.key, field.says.meaning) for field in fields_of(Rig)),
        'example: tympan solve oval.toml --mass "17.9 g" --voltage "3.5 kV" --rig rig.toml']
    return "\n\n".join(part if part.startswith("  ") else fill(part, _WIDTH)
                       for part in parts) + "\n"


def takes_rig(command: Command) -> bool:
    """Check whether a command has the option --rig."""
    parser = argparse.ArgumentParser()
    for argument in command.arguments:
        argument(parser)
    return any("--rig" in action.option_strings for action in parser._actions)


def _listed(rows: Iterable[tuple[str, str]]) -> str:
    return "\n".join(_row(name, meaning) for name, meaning in rows)


def _row(name: str, meaning: str) -> str:
    indent = " " * _NAMES
    text = fill(meaning, _WIDTH, initial_indent=indent, subsequent_indent=indent)
    return f"  {name}".ljust(_NAMES) + text[_NAMES:] if len(name) < _NAMES - 3 else (
        f"  {name}\n{text}")
