"""``tympan lumped export``: a lumped model for a controller."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.geometry.errors import InputError
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
    """A lumped model for a controller: as C99, FMU, or two transfer functions."""
    from tympan.progress import say
    from tympan.studies.case import Case
    from tympan.studies.lumped.export.c_source import export_c
    from tympan.studies.lumped.model_file import read_model

    if options.fmu and options.slow_fast:
        raise InputError("must be one of --fmu and --slow-fast", key="--slow-fast", given="both")
    if (options.fmu or options.slow_fast) != (options.mass is not None):
        raise InputError("must be given with --fmu or --slow-fast, and only with them: the C takes "
                         "any mass", key="--mass", given=options.mass)
    model = read_model(options.model)
    if options.fmu:
        from tympan.studies.lumped.export.fmu import export_fmu

        mass = parse_quantity(options.mass, "mass", "--mass")
        print(export_fmu(model, options.output, mass))
        for words in Case(model.specimen, mass=mass).remarks:
            say(f"warning: {words}")
        return
    if options.slow_fast:
        from tympan.studies.lumped.export.slow_fast import export_slow_fast

        print(export_slow_fast(model, options.output,
                               parse_quantity(options.mass, "mass", "--mass")))
        return
    for file in export_c(model, options.output):
        print(file)
