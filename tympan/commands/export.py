"""``tympan export``: parts for laser cutting or printing, the film and its mesh."""

from __future__ import annotations

import argparse

from tympan.options import (
    MESH,
    SPECIMEN,
    argument,
    command,
    naming_options,
    option_name,
    output,
    parse_quantity,
    read_settings,
)

#: Sizes of the parts by the field of ``geometry.cad.parts.PartOptions``: default, what it is.
SIZES = {
    "width": ("10 mm", "of frame and clamp ring around the film"),
    "frame_height": ("4 mm", "of the frame"),
    "clamp_height": ("2 mm", "of the clamp ring"),
    "plate_height": ("2 mm", "of the plate"),
    "screw": ("3.2 mm", "diameter of the holes"),
    "spacing": ("40 mm", "of the holes along the frame, at most"),
}


@command("export", SPECIMEN, output(required=True),
         *(argument(option_name(name), default=default, metavar="LENGTH", help=words)
           for name, (default, words) in SIZES.items()), MESH,
         example='oval.toml -o parts --screw "4 mm"')
def export(options: argparse.Namespace) -> None:
    """Frame, clamp, plate and film as STEP, DXF and SVG; the mesh."""
    from tympan.fem.film.library import load_specimen
    from tympan.geometry.cad.parts import PartOptions
    from tympan.studies.export import export

    specimen, settings = load_specimen(options.specimen), read_settings(options)
    sizes = {name: parse_quantity(getattr(options, name), "length", option_name(name))
             for name in SIZES}
    with naming_options(options):
        chosen = PartOptions(**sizes)
    for file in export(specimen, settings.mesh, options.output, chosen):
        print(file)
