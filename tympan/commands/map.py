"""``tympan map``: α and stroke over aspect ratio and plate size, and the formula for α₁."""

from __future__ import annotations

import argparse

from tympan.geometry.errors import InputError
from tympan.options import JSON, WORKERS, command, finish, output, show


@command("map",
         output(required=True), WORKERS, JSON)
def run(options: argparse.Namespace) -> None:
    """α and stroke of ellipses by aspect ratio and plate size; a formula for α."""
    from tympan.progress import bar
    from tympan.studies.alpha.map import MapSettings, alpha_map

    if options.workers < 1:
        raise InputError("must be at least 1", key="--workers", given=options.workers)
    settings = MapSettings()
    with bar(len(settings.grid()) + settings.inside + settings.outside) as progress:
        result = alpha_map(settings, options.workers, progress)
    finish(options, result, show)
