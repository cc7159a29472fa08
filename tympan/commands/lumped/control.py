"""``tympan lumped control``: a closed loop of voltage and deflection."""

from __future__ import annotations

import argparse

from tympan.base.errors import InputError
from tympan.commands.lumped.response import ACTUATORS, read_case
from tympan.commands.signal import voltages, wave_of
from tympan.options import (
    JSON,
    MESH,
    argument,
    command,
    finish,
    naming_options,
    output,
    parse_quantity,
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
