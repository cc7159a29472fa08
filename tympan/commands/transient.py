"""Commands about films in time."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path

from tympan.base.errors import InputError
from tympan.commands.signal import SIGNAL, wave_of
from tympan.options import (
    JSON,
    MESH,
    RIG,
    Moving,
    argument,
    case_arguments,
    command,
    finish,
    naming_options,
    output,
    parse_quantities,
    parse_quantity,
    read_case,
    read_mounted_all,
    read_settings,
)

#: Number of pictures of an animation.
_FRAMES = 48


@command("transient", argument("specimens", type=Path, nargs="+", metavar="SPECIMEN.toml"), *SIGNAL,
         argument("--mass", help="of plate, hook and weight (default: one that suits the film)"),
         argument("--rest", metavar="TIME",
                  help="under the mass and the first voltage before the signal (default: for ever, "
                       "or not at all where the film says when it was mounted)"),
         argument("--swing", action="store_true",
                  help="the plate has inertia; else it follows the film at once"),
         argument("--at", metavar="TIMES", help="also store the film at these times (VTU)"),
         argument("--states", action="store_true",
                  help="also compute all that `solve` says of a state at each sample, such as the "
                       "largest stretch; with -o as states.csv"),
         argument("--animate", action="store_true",
                  help="also draw the film as it moves, with -o (GIF; MP4 where FFmpeg is)"), RIG,
         output("write a dataset, transient.csv and dataset.toml, transient.json and figures"),
         JSON, MESH, example='oval.toml --mass "17.9 g" --signal step --high "5 kV" -o step',
         also=("step", "creep", "relaxation", "dynamic"))
def transient(options: argparse.Namespace) -> None:
    """Simulate films with viscous branches: a step, ramp, sine, random steps or a CSV file."""
    from tympan.progress import bar
    from tympan.studies.transient import responses

    mass = None if options.mass is None else parse_quantity(options.mass, "mass", "--mass")
    specimens, rig = read_mounted_all(options)
    wave, signal = wave_of(options, len(options.specimens))
    rest = None if options.rest is None else parse_quantity(options.rest, "time", "--rest")
    films = parse_quantities(options.at or "", "time", "--at")
    settings = read_settings(options)
    if options.animate and options.output is None:
        raise InputError("must be given to say where the pictures go", key="-o")
    shown = (tuple(signal.end * number / (_FRAMES - 1) for number in range(_FRAMES))
             if options.animate else ())
    with bar(len(specimens)) as progress:
        result = responses(specimens, wave, signal, settings, mass=mass, rest=rest,
                           swing=options.swing, films=(*films, *shown), rig=rig, progress=progress,
                           states=options.states)
    moving: list[Moving] = []
    if options.animate:
        from tympan.reports.figures.animation import animate

        for response in result.responses:
            frames = {time: film for time, film in response.films.items() if time in shown}
            file = options.output / f"{response.specimen}.gif"
            moving.append((file, partial(animate, response, frames)))
    finish(options, replace(result, responses=tuple(
        replace(response, films={time: film for time, film in response.films.items()
                                 if time in films}) for response in result.responses)), moving)


@command("response",
         *case_arguments(mass="of the plate with its weight", voltage="about which it swings"),
         argument("--frequency", metavar="FREQUENCIES",
                  help='such as "0.1 Hz, 1 Hz, 10 Hz" (default: from the slowest branch to far '
                       "above the plate's own frequency)"),
         argument("--sine", metavar="SEGMENTS",
                  help='how much of the oscillation each segment has, such as "A = 1, B = -1" '
                       "(default: all in the proportion of their voltages)"),
         output("also store the numbers and a picture (PNG, SVG)"), JSON,
         example='oval.toml --mass "17.9 g" --voltage "3.5 kV" -o response',
         also=("bode", "frequency-response"))
def response(options: argparse.Namespace) -> None:
    """Compute amplitude and phase of a loaded film under a small sine of the voltage."""
    from tympan.progress import bar
    from tympan.studies.driven import proportions
    from tympan.studies.response import USUAL_COUNT, response

    frequencies = parse_quantities(options.frequency or "", "frequency", "--frequency")
    if any(not 0 < frequency < 1e9 for frequency in frequencies):
        raise InputError("must be positive, below 1e9 Hz", key="--frequency",
                         given=options.frequency)
    sine = None if options.sine is None else proportions(options.sine, "--sine")
    case = read_case(options)
    with bar(len(frequencies) or USUAL_COUNT) as progress, naming_options(options):
        result = response(case, read_settings(options), tuple(frequencies), progress, sine)
    finish(options, result)
