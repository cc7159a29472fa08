"""``tympan lumped build``: a lumped model from the field model alone, as a file to take away."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    RIG,
    argument,
    check_distinct,
    command,
    finish,
    output,
    parse_quantity,
    read_rig,
    read_settings,
)

if TYPE_CHECKING:
    from tympan.studies.lumped.actuator import Viscous

_MOST = 200


@command("lumped build", argument("specimens", type=Path, nargs="+", metavar="SPECIMEN.toml"),
         argument("--mass", default="17.9 g,22.45 g", metavar="MASS,MASS",
                  help="on the plate; the first one is fitted, the others are tested"),
         argument("--voltages", default="0 kV..5 kV", metavar="FROM..TO",
                  help="the lowest, the middle and the highest are fitted, the others tested"),
         argument("--count", type=int, default=11, metavar="N", help="of voltages"),
         argument("--circles", type=int, default=2, metavar="N", help="how many"),
         argument("--radii", choices=("semi_axes", "sectors", "fit"), default="semi_axes",
                  help="of the circles, as for `tympan alpha`"),
         argument("--viscous", metavar="K1,ETA1,ETA2",
                  help='of the branch and the damper, such as "23.5 MPa,177.2 MPa s,62.4 kPa s" '
                       "(default: these, the paper's)"), RIG,
         output("write NAME.lumped.toml for each, build.json, statics.csv and a figure"), JSON,
         MESH)
def run(options: argparse.Namespace) -> None:
    """The lumped model of specimens from their field model alone."""
    from tympan.fem.film.library import load_specimen
    from tympan.progress import bar
    from tympan.studies.alpha import AlphaSettings
    from tympan.studies.lumped.build import BuildResult, BuildSettings, build

    try:
        AlphaSettings(circles=options.circles)
    except InputError as error:
        raise InputError(error.allowed, key=f"--{error.key}", given=error.given) from None
    masses = tuple(parse_quantity(text, "mass", "--mass") for text in options.mass.split(","))
    chosen = BuildSettings(masses, _voltages(options), options.circles, options.radii,
                           _viscous(options.viscous))
    settings, rig = read_settings(options), read_rig(options.rig)
    specimens = [load_specimen(file) for file in options.specimens]
    check_distinct([specimen.name for specimen in specimens])
    with bar(4 * len(specimens)) as progress:
        models = [build(specimen, settings, chosen, rig, progress) for specimen in specimens]
    finish(options, BuildResult.of(models), _show)


def _voltages(options: argparse.Namespace) -> tuple[float, ...]:
    ends = options.voltages.split("..")
    if len(ends) != 2:
        raise InputError("must be two voltages with two dots between them, such as 0 kV..5 kV",
                         key="--voltages", given=options.voltages)
    low, high = (parse_quantity(end, "voltage", "--voltages") for end in ends)
    if not 2 <= options.count <= _MOST:
        raise InputError(f"must be from 2 to {_MOST}", key="--count", given=options.count)
    if not 0 <= low < high:
        raise InputError("must ascend, from 0 kV on", key="--voltages", given=options.voltages)
    return tuple(low + (high - low) * number / (options.count - 1)
                 for number in range(options.count))


def _viscous(text: str | None) -> Viscous:
    from tympan.studies.lumped.actuator import Viscous

    if text is None:
        return Viscous()
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


def _show(result: dict[str, Any]) -> None:
    from tympan.studies.lumped.build import KINEMATICS

    for built in result["built"]:
        print(f"{built['specimen']}: factor on the film {built['stiffness']:.5f}, on the voltage "
              f"{built['permittivity']:.5f}; flat {1e12 * built['flat_capacitance_F']:.1f} pF")
        for circle in built["circles"]:
            print(f"  circle of {1e3 * circle['radius_m']:.4g} mm: α {circle['alpha']:.4f}, "
                  f"{circle['membrane_factor']:.3f} times as stiff as the paper's cone")
        for kind, words in KINEMATICS.items():
            errors = built["deflection_error"][kind]
            print(f"  {kind:<10}deflection off by up to {_percent(errors['fitted']):<8} where "
                  f"fitted, {_percent(errors['held_out']):<8} elsewhere: {words}")
        (low, high), (slow, fast) = built["frequency_Hz"]["field"], built["frequency_Hz"]["lumped"]
        print(f"  heave {_hertz(slow)} and {_hertz(fast)} at the ends of the voltage, field model "
              f"{_hertz(low)} and {_hertz(high)}; capacitance within "
              f"{_percent(built['capacitance_error']['corrected'])}")
        for words in built["warnings"]:
            print(f"warning: {words}")


def _percent(error: float | None) -> str:
    return "-" if error is None else f"{100 * error:.3g} %"


def _hertz(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f} Hz"
