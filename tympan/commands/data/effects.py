"""``tympan effects``: what a diagnosis looks for, with units and priors."""

from __future__ import annotations

import argparse

from tympan.options import JSON, argument, command, either, print_json


@command("effects",
         either(JSON, argument("--markdown", action="store_true",
                               help="print the page docs/effects.md")))
def run(options: argparse.Namespace) -> None:
    """List the effects a model may leave out, with units and priors."""
    from tympan.studies.effects import listing

    if options.json:
        print_json(listing.listing())
    else:
        print(listing.markdown() if options.markdown else listing.text(),
              end="" if options.markdown else "\n")
