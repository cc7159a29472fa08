"""``tympan lumped export``: a lumped model for a controller."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import argument, command, output


@command("lumped export", argument("model", type=Path, metavar="MODEL.lumped.toml"),
         output(required=True), example="lumped/oval.lumped.toml -o controller")
def lumped_export(options: argparse.Namespace) -> None:
    """A lumped model as C99 for a controller: rates of its state, deflection, capacitance."""
    from tympan.studies.lumped.export_c import export_c
    from tympan.studies.lumped.model_file import read_model

    for file in export_c(read_model(options.model), options.output):
        print(file)
