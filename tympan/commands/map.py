"""``tympan map``: α and stroke over aspect ratio and plate size, and the formula for α₁."""

from __future__ import annotations

import argparse

from tympan.options import (
    Subcommands,
    command,
    json_argument,
    output_argument,
    show,
    workers_argument,
)


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "map", _run,
                     "α and stroke of ellipses by aspect ratio and plate size; a formula for α")
    output_argument(parser, required=True)
    workers_argument(parser)
    json_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.geometry.errors import InputError
    from tympan.progress import bar
    from tympan.reports.figures.map import draw_map
    from tympan.studies.alpha.map import AlphaMap, alpha_map
    from tympan.studies.alpha.map_readings import MapSettings

    if options.workers < 1:
        raise InputError("must be at least 1", key="--workers", given=options.workers)
    settings = MapSettings()
    with bar(len(settings.grid()) + settings.inside + settings.outside) as progress:
        result = alpha_map(settings, options.workers, progress)
    result.save(options.output)
    draw_map(AlphaMap.load(options.output), options.output)
    show(result.json(), options.json)
