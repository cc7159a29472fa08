"""``tympan export``: parts for laser cutting or printing, the film, its mesh and its equations."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.base.errors import InputError
from tympan.options import (
    MESH,
    SPECIMEN,
    argument,
    command,
    naming_options,
    option_name,
    output,
    parse_quantities,
    parse_quantity,
    read_settings,
    read_voltages,
)

if TYPE_CHECKING:
    from tympan.geometry.specimen import Specimen
    from tympan.studies.case import Settings

#: Sizes of the parts by the field of ``geometry.cad.sizes.PartOptions``: default, meaning.
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
         argument("--inp", action="store_true",
                  help="instead: the prestretched film and plate as input of CalculiX or Abaqus"),
         argument("--mass", help='with --inp: loads to put on, such as "10 g, 20 g", a step each'),
         argument("--voltage", help='with --inp: voltages under the last of them, such as "3 kV"'),
         argument("--pressure", help='with --inp: of a gas below film and plate, such as "50 Pa"'),
         example='oval.toml -o parts --screw "4 mm"',
         also=("cad", "mesh", "dxf", "stl"))
def export(options: argparse.Namespace) -> None:
    """Write frame, clamp, plate and film as STEP, DXF and SVG; mesh; or finite-element input."""
    from tympan.geometry.cad.sizes import PartOptions
    from tympan.studies.export import export
    from tympan.studies.shipped import load_named

    specimen, settings = load_named(options.specimen), read_settings(options)
    with naming_options(options):
        settings.require_elements()
    if options.inp:
        print(_export_input(options, specimen, settings))
        return
    for name in ("mass", "voltage", "pressure"):
        if getattr(options, name) is not None:
            raise InputError("is for finite-element input: --inp must be given too",
                             key=f"--{name}", given=getattr(options, name))
    sizes = {name: parse_quantity(getattr(options, name), "length", option_name(name))
             for name in SIZES}
    with naming_options(options):
        chosen = PartOptions(**sizes)
    for file in export(specimen, settings.mesh, options.output, chosen):
        print(file)


def _export_input(options: argparse.Namespace, specimen: Specimen, settings: Settings) -> Path:
    from tympan.studies.export import export_input

    masses = parse_quantities(options.mass or "", "mass", "--mass")
    voltages = read_voltages(options)
    pressure = parse_quantity(options.pressure or "0 Pa", "stress", "--pressure")
    with naming_options(options):
        return export_input(specimen, settings.mesh, options.output, masses, voltages.film,
                            pressure, voltages.segments)
