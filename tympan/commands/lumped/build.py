"""``tympan lumped build``: lumped models from field models."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.base.errors import InputError
from tympan.base.units import RANGE
from tympan.options import (
    JSON,
    MESH,
    RIG,
    argument,
    command,
    finish,
    naming_options,
    output,
    parse_quantities,
    parse_quantity,
    read_mounted_all,
    read_settings,
)

if TYPE_CHECKING:
    from tympan.studies.lumped.actuator import Viscous


@command("lumped build", argument("specimens", type=Path, nargs="+", metavar="SPECIMEN.toml"),
         argument("--mass", metavar="MASS,MASS",
                  help="on the plate; the first one is fitted, the others are tested (default: "
                       "some that suit the films)"),
         argument("--voltage", metavar="FROM..TO", formerly="--voltages",
                  help='such as "0 kV..5 kV"; the lowest, the middle and the highest are fitted, '
                       "the others tested (default: up to 0.6 of the films' first limit)"),
         argument("--count", type=int, metavar="N", within=(2, 200),
                  help="of voltages between these ends (default: 11)"),
         argument("--circles", type=int, default=2, metavar="N", help="how many"),
         argument("--radii", choices=("semi_axes", "sectors", "fit"), default="semi_axes",
                  help="of the circles, as for `tympan alpha`"),
         argument("--viscous", metavar="K1,ETA1,ETA2",
                  help="of the branch and the damper of films that have no branches of their own, "
                       'such as "23.5 MPa,177.2 MPa s,62.4 kPa s" (default: these, the '
                       "paper's)"), RIG,
         output("write NAME.lumped.toml for each, build.json, statics.csv and a figure"), JSON,
         MESH,
         example="oval.toml -o lumped")
def lumped_build(options: argparse.Namespace) -> None:
    """Build the lumped model of specimens from their field model alone."""
    from tympan.progress import bar
    from tympan.studies.lumped.build import KINEMATICS, BuildResult, BuildSettings

    specimens, rig = read_mounted_all(options)
    masses = (parse_quantities(options.mass, "mass", "--mass") if options.mass is not None
              else None)
    voltages = _voltages(options) if options.voltage is not None else None
    settings = read_settings(options)
    with naming_options(options, masses="mass"):
        chosen = BuildSettings.suited(
            specimens, settings, rig, masses=masses, voltages=voltages,
            count=options.count or RANGE, circles=options.circles, radii=options.radii,
            viscous=_viscous(options.viscous))
    with bar(sum(4 + bool(item.membrane.branches) for item in specimens)) as progress:
        result = BuildResult.built(specimens, settings, chosen, rig, progress)
    finish(options, result, kinematics=KINEMATICS)


def _voltages(options: argparse.Namespace) -> tuple[float, ...]:
    from tympan.studies.lumped.build import between

    given = parse_quantities(options.voltage, "voltage", "--voltage")
    with naming_options(options):
        return between(given, options.count)


def _viscous(text: str | None) -> Viscous | None:
    from tympan.studies.lumped.actuator import Viscous

    if text is None:
        return None
    parts = text.split(",")
    if len(parts) != 3:
        raise InputError("must be a stress and two viscosities with commas between them",
                         key="--viscous", given=text)
    try:
        return Viscous(*(parse_quantity(part, kind, "--viscous")
                         for part, kind in zip(parts, ("stress", "viscosity", "viscosity"),
                                               strict=True)))
    except InputError as error:
        raise InputError(error.allowed, key="--viscous", given=error.given) from None
