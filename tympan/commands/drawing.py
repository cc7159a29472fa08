"""``tympan draw``: the specimen as it was read."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import SPECIMEN, argument, command, output, print_record


@command("draw", SPECIMEN,
         argument("--voltage", help='of the film, or of segments by their names, such as "A = 3 '
                                    'kV, B = 0 kV", for the legend of segments (default: their '
                                    'shares)'),
         output("for NAME-specimen.png and .svg", default=Path("drawing")),
         example="oval.toml -o drawing", also=("plot", "show"))
def draw(options: argparse.Namespace) -> None:
    """Draw a specimen as it was read, with its sizes; nothing is solved."""
    from tympan.base.fields import number
    from tympan.reports.figures.specimen import draw_specimen
    from tympan.studies.driven import driven
    from tympan.studies.shipped import load_named

    specimen, given = driven(load_named(options.specimen), options.voltage, "--voltage")
    voltage = None if given is None else number(given, "voltage", "--voltage")
    options.json = False
    print_record(options, {}, specimen=specimen,
                 drawn=draw_specimen(specimen, options.output, voltage))
