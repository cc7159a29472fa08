"""``tympan alpha``: weights of the circular actuators that stand for a shape."""

from __future__ import annotations

import argparse

from tympan.options import (
    Subcommands,
    command,
    json_argument,
    mesh_argument,
    read_rig,
    read_settings,
    rig_argument,
    show,
    specimen_argument,
)


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "alpha", _run,
                     "weights of the circular actuators that stand for a shape")
    specimen_argument(parser)
    parser.add_argument("--circles", type=int, default=2, metavar="N",
                        help="how many (default: %(default)s)")
    parser.add_argument("--radii", default="semi_axes", metavar="CHOICE",
                        help="of the circles: semi_axes (the frame's half extents and between "
                             "them), sectors (the frame's distance in as many parts of the full "
                             "angle) or fit (default: %(default)s)")
    parser.add_argument("--basis", choices=("membrane", "cone", "cone_scaled"), default="membrane",
                        help="circles solved as membranes, as the paper's cones, or as cones "
                             "scaled to the membrane")
    parser.add_argument("--uncertainty", action="store_true",
                        help="also how far α changes with the mesh, the material and the range of "
                             "loads")
    rig_argument(parser)
    json_argument(parser)
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.fem.film.library import load_specimen
    from tympan.geometry.errors import InputError
    from tympan.progress import bar
    from tympan.studies.alpha import AlphaSettings, alpha, uncertainty

    try:
        chosen = AlphaSettings(circles=options.circles, radii=options.radii)
    except InputError as error:
        raise InputError(error.allowed, key=f"--{error.key}", given=error.given) from None
    specimen, rig = load_specimen(options.specimen), read_rig(options.rig)
    settings = read_settings(options)
    with bar(14 if options.uncertainty else 2) as progress:
        result = alpha(specimen, settings, chosen, rig, progress)
        answer = result.json(options.basis)
        if options.uncertainty:
            spread = uncertainty(specimen, settings, chosen, rig, result, progress)
            answer["uncertainty"] = spread.json()
    show(answer, options.json)
