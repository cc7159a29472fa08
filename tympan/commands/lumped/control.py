"""``tympan lumped control`` and ``steer``: closed loops of the deflection, and of tilts."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.base.errors import InputError
from tympan.commands.lumped.response import ACTUATORS, read_case
from tympan.commands.signal import voltages, wave_of
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


@command("lumped control", *ACTUATORS,
         *voltages(argument("--high", help="after the step; upper end (default: half of the "
                                           "supply)")),
         argument("--interval", default="10 ms", help="sampling interval of the controller"),
         argument("--supply", default="7 kV", metavar="VOLTAGE",
                  help="highest voltage of the supply; the lowest is 0"),
         argument("--sensor-lag", metavar="TIME",
                  help="time by which the sensor lags, by a factor e (default: the rig's)"),
         argument("--method", choices=("pi", "lqg"), default="pi",
                  help="PI behind two lags, or LQG: a Kalman filter that knows the plate's swing, "
                       "with a linear quadratic regulator"),
         argument("--sensor", choices=("deflection", "capacitance"), default="deflection",
                  help="what is read; the deflection is told from a capacitance by that of the "
                       "model"),
         argument("--fmu", action="store_true",
                  help="with -o: store the controller as FMU 2.0, too, with its C source and a "
                       "library"),
         output("store the run (CSV), the controller with its margins (JSON) and as C99, and a "
                "picture (PNG, SVG)"), JSON, MESH,
         example='oval.toml --mass "17.9 g" --high "3 kV" --duration "2 s" --supply "5 kV" '
                 "-o control", also=("pid", "controller", "feed-forward"))
def lumped_control(options: argparse.Namespace) -> None:
    """Design a controller with feed-forward: its margins, and a run compared to one without it.

    The plate is to follow the equilibrium deflections of the signal's voltages. The controller is
    designed on the lumped model, linearised from no voltage to the supply's.
    """
    from tympan.progress import bar
    from tympan.studies.lumped.control.run import ControlSettings, controlled, supplied

    if options.fmu and not options.output:
        raise InputError("must be given to say where the FMU goes", key="-o")
    case = read_case(options)
    with naming_options(options):
        settings = ControlSettings(
            supply=parse_quantity(options.supply, "voltage", "--supply"),
            interval=parse_quantity(options.interval, "time", "--interval"),
            sensor_lag=None if options.sensor_lag is None
            else parse_quantity(options.sensor_lag, "time", "--sensor-lag"),
            method=options.method, sensor=options.sensor, fmu=options.fmu)
    _, signal = wave_of(options, len(options.specimens) + len(options.model), settings.usual_high)
    with naming_options(options), bar(4 * len(case.specimens)) as progress:
        chosen = supplied(case, settings, read_settings(options), progress)
    with naming_options(options), bar(len(chosen.actuators)) as progress:
        result = controlled(chosen, signal, settings, progress)
    finish(options, result)


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
