"""Commands about α, the weights of the circles that represent a shape."""

from __future__ import annotations

import argparse
from dataclasses import replace

from tympan.options import (
    JSON,
    MESH,
    RIG,
    SPECIMEN,
    WORKERS,
    argument,
    command,
    finish,
    naming_options,
    output,
    print_record,
    read_mounted,
    read_settings,
    read_workers,
)


@command("alpha", SPECIMEN,
         argument("--circles", type=int, default=2, metavar="N", help="how many"),
         argument("--radii", default="semi_axes", metavar="CHOICE",
                  help="of the circles: semi_axes (the frame's half extents and between them), "
                       "sectors (the frame's distance in as many parts of the full angle) or fit"),
         argument("--basis", choices=("membrane", "cone", "cone_scaled"), default="membrane",
                  help=argparse.SUPPRESS),
         argument("--uncertainty", action="store_true",
                  help="also how far α changes with the mesh, the material and the range of "
                       "loads"), RIG, JSON, MESH,
         example="oval.toml --circles 2")
def alpha(options: argparse.Namespace) -> None:
    """Compute the weights of the circular actuators that represent a shape."""
    from tympan.progress import bar
    from tympan.studies.alpha import AlphaSettings, alpha, uncertainty

    with naming_options(options):
        chosen = AlphaSettings(circles=options.circles, radii=options.radii)
    specimen, rig = read_mounted(options)
    settings = read_settings(options)
    with naming_options(options), bar(14 if options.uncertainty else 2) as progress:
        result = alpha(specimen, settings, chosen, rig, progress)
        if options.uncertainty:
            result = replace(result, uncertainty=uncertainty(specimen, settings, chosen, rig,
                                                             result, progress))
    print_record(options, result.json(options.basis))


@command("outlines", output(required=True), JSON, MESH,
         example="-o outlines")
def outlines(options: argparse.Namespace) -> None:
    """Compute α of every registered outline with the source paper's film, and held-out errors."""
    from tympan.geometry.outlines import examples
    from tympan.progress import bar
    from tympan.studies.alpha.table import outline_table
    from tympan.studies.study import default_study

    paper = default_study()
    film = paper.specimens[0].membrane
    with bar(len(examples())) as progress:
        result = outline_table(film, paper.alpha, read_settings(options), progress)
    finish(options, result)


@command("map", output(required=True), WORKERS, JSON,
         example="-o map")
def alpha_map(options: argparse.Namespace) -> None:
    """Map α and stroke of ellipses of the source paper's film, by aspect ratio and plate size.

    A formula for α is fitted to them.
    """
    from tympan.paper.loads import MAP
    from tympan.progress import bar
    from tympan.studies.alpha.map import alpha_map
    from tympan.studies.shipped import actuators

    film = actuators()[0].membrane
    with bar(sum(map(len, MAP.places().values()))) as progress:
        result = alpha_map(film, MAP, read_workers(options), progress)
    finish(options, result)
