"""``tympan draw``: the specimen as it was read."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import SPECIMEN, command, output, print_record


@command("draw", SPECIMEN,
         output("for NAME-specimen.png and .svg", default=Path("drawing")),
         example="oval.toml -o drawing", also=("plot", "show"))
def draw(options: argparse.Namespace) -> None:
    """Draw a specimen as it was read, with its sizes; nothing is solved."""
    from tympan.reports.figures.specimen import draw_specimen
    from tympan.studies.shipped import load_named

    specimen = load_named(options.specimen)
    options.json = False
    print_record(options, {}, specimen=specimen, drawn=draw_specimen(specimen, options.output))
