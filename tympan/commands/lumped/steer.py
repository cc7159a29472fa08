"""``tympan lumped steer``: a closed loop that leads a plate's normal along a circle or a path."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.base.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    RIG,
    SPECIMEN,
    argument,
    command,
    finish,
    naming_options,
    output,
    parse_quantity,
    read_mounted,
    read_settings,
)


@command("lumped steer", SPECIMEN,
         argument("--mass", help='of plate, hook and weight, such as "15 g"'),
         RIG,
         argument("--tilt", default="3 mrad", help="radius of the circle that the plate's normal "
                                                   "draws"),
         argument("--frequency", default="1 Hz", help="turns a second, for which the controller is "
                                                      "designed"),
         argument("--turns", type=float, default=2.0, metavar="N", within=(1, 10_000),
                  help="turns of the circle, after one in which it grows"),
         argument("--supply", default="2.8 kV", metavar="VOLTAGE",
                  help="highest voltage of a segment; the lowest is 0"),
         argument("--interval", default="10 ms", help="sampling interval of the controller"),
         argument("--method", choices=("pi", "lqg"), default="lqg",
                  help="PI of each channel, or LQG: a Kalman filter that knows motion and creep, "
                       "with a linear quadratic regulator"),
         argument("--reference", type=Path, metavar="FILE",
                  help="CSV file of another path: t_s with one or more of deflection_mm, "
                       "tilt_x_mrad, tilt_y_mrad"),
         argument("--fmu", action="store_true",
                  help="with -o: store model and controller as FMU 2.0, too, with their C source "
                       "and a library"),
         output("also store the runs (CSV), the numbers (JSON), model and controller as C99, and a "
                "picture (PNG, SVG)"), JSON, MESH,
         example='quarters.toml --mass "15 g" --tilt "3 mrad" --supply "2.8 kV" -o steered',
         also=("mimo", "tilt control", "steering mirror"))
def lumped_steer(options: argparse.Namespace) -> None:
    """Design a controller that tilts the plate by its segments, and run it on the film in time.

    The plate's normal draws a circle, or follows a path. The output compares three runs: with the
    static inverse alone, with the feed-forward of the motion alone, and with feedback.
    """
    from tympan.progress import bar
    from tympan.studies.case import NO_MASS
    from tympan.studies.lumped.steered.run import SteerSettings, steer

    if options.fmu and not options.output:
        raise InputError("must be given to say where the FMUs go", key="-o")
    specimen, rig = read_mounted(options, driven=False)
    if options.mass is None:
        raise InputError(NO_MASS, key="--mass")
    with naming_options(options):
        settings = SteerSettings(
            mass=parse_quantity(options.mass, "mass", "--mass"),
            tilt=parse_quantity(options.tilt, "angle", "--tilt"),
            frequency=parse_quantity(options.frequency, "frequency", "--frequency"),
            turns=options.turns,
            supply=parse_quantity(options.supply, "voltage", "--supply"),
            interval=parse_quantity(options.interval, "time", "--interval"),
            method=options.method, reference=options.reference, fmu=options.fmu)
        with bar(4) as progress:
            result = steer(specimen, settings, rig, read_settings(options), progress)
    finish(options, result)
