"""``tympan solve``: one specimen under one load and voltage."""

from __future__ import annotations

import argparse

from tympan.options import (
    Subcommands,
    case_arguments,
    command,
    json_argument,
    output_argument,
    parse_quantity,
    read_case,
    read_settings,
    show,
)


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "solve", _run, "one specimen under one load and voltage",
                     more="Deflection is positive downwards, along the load.")
    case_arguments(parser)
    parser.add_argument("--elapsed", default="0 s", metavar="TIME",
                        help="since the run began, for a rig whose readings drift "
                             "(default: %(default)s)")
    parser.add_argument("--direction", choices=("up", "down"), default="",
                        help="which way the voltage was reached, for a film that lags behind it "
                             "(default: not known)")
    output_argument(parser, "also store the fields (VTU) and the numbers")
    json_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from dataclasses import replace

    from tympan.fem.rig import DIRECTIONS
    from tympan.studies.case import solve

    case = replace(read_case(options),
                   elapsed=parse_quantity(options.elapsed, "time", "--elapsed"),
                   direction=DIRECTIONS[options.direction])
    result = solve(case, read_settings(options), film=options.output is not None)
    if options.output is not None:
        result.save(options.output)
    show(result.json(), options.json)
