"""``tympan lumped``: the paper's lumped model in its subcommands."""

from __future__ import annotations

from tympan.commands.lumped import build, identify, paper, simulate
from tympan.options import Subcommands, command_group


def add(commands: Subcommands) -> None:
    """The command and its subcommands."""
    kinds = command_group(commands, "lumped", "the paper's lumped model: a mass on circles of film")
    for subcommand in (simulate, identify, build, paper):
        subcommand.add(kinds)
