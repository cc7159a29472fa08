"""``tympan alpha``: weights of the circular actuators that stand for a shape."""

from __future__ import annotations

import argparse

from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    RIG,
    SPECIMEN,
    argument,
    command,
    read_rig,
    read_settings,
    show,
)


@command("alpha", SPECIMEN,
         argument("--circles", type=int, default=2, metavar="N", help="how many"),
         argument("--radii", default="semi_axes", metavar="CHOICE",
                  help="of the circles: semi_axes (the frame's half extents and between them), "
                       "sectors (the frame's distance in as many parts of the full angle) or fit"),
         argument("--basis", choices=("membrane", "cone", "cone_scaled"), default="membrane",
                  help="circles solved as membranes, as the paper's cones, or as cones scaled to "
                       "the membrane"),
         argument("--uncertainty", action="store_true",
                  help="also how far α changes with the mesh, the material and the range of "
                       "loads"), RIG, JSON, MESH)
def run(options: argparse.Namespace) -> None:
    """Weights of the circular actuators that stand for a shape."""
    from tympan.fem.film.library import load_specimen
    from tympan.progress import bar
    from tympan.studies.alpha import AlphaSettings, alpha, uncertainty
    from tympan.studies.files import to_json

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
            answer["uncertainty"] = to_json(uncertainty(specimen, settings, chosen, rig, result,
                                                        progress))
    show(answer, options.json)
