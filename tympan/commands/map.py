"""``tympan map``: α and stroke over aspect ratio and plate size, and the formula for α₁."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from tympan.options import command, show


def add(commands: Any) -> None:
    """The subcommand."""
    parser = command(commands, "map", _run,
                     "α and stroke of ellipses by aspect ratio and plate size; a formula for α")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--workers", type=int, default=2, metavar="N",
                        help="processes (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(options: argparse.Namespace) -> None:
    from tympan.geometry.errors import InputError
    from tympan.progress import bar
    from tympan.reports.figures.map import draw
    from tympan.studies.alpha.map import chart
    from tympan.studies.alpha.map_readings import MapSettings

    if options.workers < 1:
        raise InputError("must be at least 1", key="--workers", given=options.workers)
    settings = MapSettings()
    with bar(len(settings.grid()) + settings.inside + settings.outside) as progress:
        made = chart(settings, options.workers, progress)
    made.write(options.output)
    draw(made, options.output)
    show(made.record(), options.json)
