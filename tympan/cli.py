"""The ``tympan`` command. Nothing heavy is imported before a command needs it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from tympan.commands import COMMANDS, GROUPS
from tympan.geometry.errors import Failure, InputError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; exit status 0 done, 1 failed with a message, 2 the input is wrong."""
    try:
        options = _parser().parse_args(arguments)
        options.run(options)
    except (InputError, Failure) as error:
        print("; ".join([f"tympan: {error}", *getattr(error, "__notes__", ())]), file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tympan", description="Shape studies of dielectric-elastomer membrane actuators.",
        epilog='Quantities carry their unit: --mass "17.9 g" --voltage "3.5 kV".')
    parser.add_argument("--version", action=_Version)
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    groups = {"": commands}
    for command in COMMANDS:
        group = command.name.rpartition(" ")[0]
        if group not in groups:
            words = GROUPS[group]
            groups[group] = commands.add_parser(
                group, help=words, description=f"{words[0].upper()}{words[1:]}.",
            ).add_subparsers(title="commands", required=True, metavar="COMMAND")
        command.add(groups[group])
    return parser


class _Version(argparse.Action):
    """``--version`` without asking the package metadata on every start."""

    def __init__(self, option_strings: list[str], dest: str, **_: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"tympan {version('tympan')}")
        parser.exit()
