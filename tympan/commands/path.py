"""``tympan path``: one specimen's equilibria through pull-in and along the unstable branch."""

from __future__ import annotations

import argparse

from tympan.options import (
    Subcommands,
    case_arguments,
    command,
    json_argument,
    output_argument,
    read_case,
    read_settings,
    show,
)


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "path", _run,
                     "equilibria through limit points, stable or not, by arc length")
    case_arguments(parser, mass="on the plate at the start",
                   voltage="across the film at the start")
    parser.add_argument("--along", choices=("voltage", "charge", "mass", "pressure"),
                        default="voltage",
                        help="what grows; gas pressure acts below film and plate "
                             "(default: %(default)s)")
    output_argument(parser, "also store the stations (CSV), a picture (PNG, SVG), the numbers, "
                            "fields and critical mode at each limit point (VTU)")
    json_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.progress import bar
    from tympan.studies.path import path

    case = read_case(options)
    with bar(1) as progress:
        result = path(case, read_settings(options), options.along, progress=progress)
    if options.output is not None:
        from tympan.reports.figures.path import draw_path

        result.save(options.output)
        draw_path(result, options.output)
    if options.json:
        show(result.json(), True)
        return
    for event in result.events:
        print(f"{event.what:<13} {event.value_text:<14} "
              f"deflection {event.station.deflection_m * 1e3:.4f} mm")
    for warning in result.warnings:
        print(warning)
