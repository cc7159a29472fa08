"""``tympan path``: one specimen's equilibria through pull-in and along the unstable branch."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from tympan.options import (
    command,
    mesh_argument,
    parse_quantity,
    read_rig,
    read_settings,
    show,
    specimen_argument,
)


def add(commands: Any) -> None:
    """The command's options."""
    parser = command(commands, "path", _run,
                     "equilibria through limit points, stable or not, by arc length")
    specimen_argument(parser)
    parser.add_argument("--mass", required=True, help='on the plate at the start, such as "17.9 g"')
    parser.add_argument("--voltage", default="0 kV",
                        help="across the film at the start (default: %(default)s)")
    parser.add_argument("--along", choices=("voltage", "charge", "mass", "pressure"),
                        default="voltage",
                        help="what grows; gas pressure acts below film and plate (default: %(default)s)")
    parser.add_argument("--rig", type=Path, metavar="RIG.toml",
                        help="gravity, springs, magnets, guide, gas pressure")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR",
                        help="also store the stations (CSV), a picture (PNG), the numbers, fields and critical mode "
                             "at each limit point (VTU)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.fem.film.library import load_specimen
    from tympan.progress import bar
    from tympan.studies import path as branches
    from tympan.studies.case import Case

    specimen = load_specimen(options.specimen)
    case = Case(specimen, parse_quantity(options.mass, "mass", "--mass"),
                parse_quantity(options.voltage, "voltage", "--voltage"), read_rig(options.rig))
    with bar(1) as progress:
        result, limits = branches.branch(case, read_settings(options), options.along,
                                         progress=progress)
    if options.output is not None:
        from tympan.reports.figures.path import draw

        branches.store(options.output, result, limits)
        draw(options.output, f"{specimen.name}-path", result)
    if options.json:
        show(result.json(), True)
        return
    for event in result.events:
        print(f"{event.what:<13} {event.value_text:<14} deflection {event.station.deflection_m * 1e3:.4f} mm")
    for warning in result.warnings:
        print(warning)
