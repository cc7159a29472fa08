"""``tympan lumped``: the paper's lumped model, simulated, identified, built from the field model, and its figures."""

from __future__ import annotations

from typing import Any

from tympan.commands.lumped import (
    build as lumped_build,
)
from tympan.commands.lumped import (
    identify as lumped_identify,
)
from tympan.commands.lumped import (
    paper as lumped_paper,
)
from tympan.commands.lumped import (
    simulate as lumped_simulate,
)


def add(commands: Any) -> None:
    """The command and its subcommands."""
    words = "the paper's lumped model: a mass on circles of film"
    parser = commands.add_parser("lumped", help=words,
                                 description=words[0].upper() + words[1:] + ".")
    kinds = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for part in (lumped_simulate, lumped_identify, lumped_build, lumped_paper):
        part.add(kinds)
