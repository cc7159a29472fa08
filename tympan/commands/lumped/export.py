"""``tympan lumped export``: a lumped model for a controller."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import argument, command, output, parse_quantity


@command("lumped export", argument("model", type=Path, metavar="MODEL.lumped.toml"),
         argument("--fmu", action="store_true",
                  help="instead: FMU 2.0 for model exchange and co-simulation, with its C source "
                       "and a library"),
         argument("--slow-fast", action="store_true",
                  help="instead: a polynomial of the voltage before a slow pole and zero and a "
                       "fast pair, with the errors that leaves"),
         argument("--mass", help='with --fmu or --slow-fast: on the plate, such as "17.9 g"'),
         output(required=True), example="lumped/oval.lumped.toml -o controller")
def lumped_export(options: argparse.Namespace) -> None:
    """Write a lumped model for a controller: as C99, FMU, or two transfer functions."""
    from tympan.progress import say
    from tympan.studies.case import Case
    from tympan.studies.lumped.export import export, require_form
    from tympan.studies.lumped.model_file import read_model

    mass = None if options.mass is None else parse_quantity(options.mass, "mass", "--mass")
    require_form(mass, options.fmu, options.slow_fast)
    model = read_model(options.model)
    for file in export(model, options.output, mass, options.fmu, options.slow_fast):
        print(file)
    warned = Case(model.specimen, mass=mass).remarks if mass is not None and options.fmu else ()
    for words in warned:
        say(f"warning: {words}")
