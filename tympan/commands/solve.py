"""``tympan solve``: one specimen under one load and voltage."""

from __future__ import annotations

import argparse

from tympan.options import (
    JSON,
    argument,
    case_arguments,
    command,
    output,
    parse_quantity,
    read_case,
    read_settings,
    show,
)


@command("solve", *case_arguments(),
         argument("--elapsed", default="0 s", metavar="TIME",
                  help="since the run began, for a rig whose readings drift"),
         argument("--direction", choices=("up", "down"), default="",
                  help="which way the voltage was reached, for a film that lags behind it "
                       "(default: not known)"),
         output("also store the fields (VTU) and the numbers"), JSON)
def run(options: argparse.Namespace) -> None:
    """One specimen under one load and voltage.

    Deflection is positive downwards, along the load.
    """
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
