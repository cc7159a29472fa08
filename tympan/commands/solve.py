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
    import time
    from dataclasses import replace

    from tympan.fem.results.fields import whole
    from tympan.fem.rig import DIRECTIONS
    from tympan.studies import case as cases
    from tympan.studies import files

    case = replace(read_case(options),
                   elapsed=parse_quantity(options.elapsed, "time", "--elapsed"),
                   direction=DIRECTIONS[options.direction])
    began = time.perf_counter()
    model, outcome = cases.find(case, read_settings(options))
    result = cases.summarise(case, model, outcome, time.perf_counter() - began)
    if options.output is not None:
        name = case.specimen.name
        files.remove(options.output, f"{name}.vtu", f"{name}.json")
        if outcome.status == "equilibrium":
            files.write_fields(options.output / f"{name}.vtu", *whole(model, outcome.state))
        files.write_json(options.output / f"{name}.json", result.json())
    show(result.json(), options.json)
