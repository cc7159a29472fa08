"""``tympan lumped export``: a lumped model for a controller."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.geometry.errors import InputError
from tympan.options import argument, command, output, parse_quantity


@command("lumped export", argument("model", type=Path, metavar="MODEL.lumped.toml"),
         argument("--fmu", action="store_true",
                  help="instead: FMU 2.0 for model exchange, its C source and a library inside"),
         argument("--mass", help='with --fmu: on the plate, such as "17.9 g"'),
         output(required=True), example="lumped/oval.lumped.toml -o controller")
def lumped_export(options: argparse.Namespace) -> None:
    """A lumped model for a controller: rates of its state, deflection, capacitance; C99 or FMU."""
    from tympan.studies.lumped.export.c_source import export_c
    from tympan.studies.lumped.model_file import read_model

    if options.fmu != (options.mass is not None):
        raise InputError("must be given with --fmu, and only with it: the C takes any mass",
                         key="--mass", given=options.mass)
    model = read_model(options.model)
    if options.fmu:
        from tympan.studies.lumped.export.fmu import export_fmu

        print(export_fmu(model, options.output, parse_quantity(options.mass, "mass", "--mass")))
        return
    for file in export_c(model, options.output):
        print(file)
