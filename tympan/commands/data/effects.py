"""``tympan effects``: what a diagnosis looks for, with units and priors."""

from __future__ import annotations

import argparse

from tympan.options import Subcommands, command, print_json


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "effects", _run,
                     "list the effects a model may leave out, with units and priors")
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--json", action="store_true", help="print one JSON object")
    kind.add_argument("--markdown", action="store_true", help="print the page docs/effects.md")


def _run(options: argparse.Namespace) -> None:
    from tympan.studies.effects import listing

    if options.json:
        print_json(listing.listing())
    else:
        print(listing.markdown() if options.markdown else listing.text(),
              end="" if options.markdown else "\n")
