"""``tympan modes``: natural frequencies about a loaded, actuated state."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    argument,
    case_arguments,
    command,
    output,
    parse_quantity,
    read_case,
    read_settings,
    show,
)

if TYPE_CHECKING:
    from tympan.studies.modes import ModesResult


@command("modes",
         *case_arguments(mass="of the plate with its weight", voltage="held across the film"),
         argument("--point-mass", default="0 g", metavar="MASS",
                  help="part of the mass that sits in the plate's centre; the rest is spread "
                       "evenly over the plate"),
         argument("--count", type=int, default=6, metavar="N", help="how many"),
         output("also store shapes (VTU), a picture (PNG, SVG) and the numbers"), JSON)
def run(options: argparse.Namespace) -> None:
    """Natural frequencies and shapes under one load and voltage."""
    from tympan.studies.modes import modes

    if not 1 <= options.count <= 100:
        raise InputError("must be from 1 to 100", key="--count", given=options.count)
    case = read_case(options)
    point_mass = parse_quantity(options.point_mass, "mass", "--point-mass")
    result = modes(case, read_settings(options), options.count, point_mass)
    if options.output is not None:
        from tympan.reports.figures.modes import draw_modes

        result.save(options.output)
        draw_modes(result, options.output)
    _show(result, options.json)


def _show(result: ModesResult, as_json: bool) -> None:
    values = result.json()
    if as_json:
        show(values, True)
        return
    del values["modes"], values["plate_inertia_kg_m2"]
    show(values, False)
    for number, mode in enumerate(result.modes, start=1):
        print(f"{number:>3}  {mode.speed:<14}  {mode.name:<16}  {100 * mode.film_share:.0f} % of "
              "the motion's energy in the film")
