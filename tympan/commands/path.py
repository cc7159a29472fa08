"""``tympan path``: one specimen's equilibria through pull-in and along the unstable branch."""

from __future__ import annotations

import argparse

from tympan.options import (
    JSON,
    argument,
    case_arguments,
    command,
    output,
    read_case,
    read_settings,
    show,
)


@command("path",
         *case_arguments(mass="on the plate at the start", voltage="across the film at the start"),
         argument("--along", choices=("voltage", "charge", "mass", "pressure"), default="voltage",
                  help="what grows; gas pressure acts below film and plate"),
         output(
                "also store the stations (CSV), a picture (PNG, SVG), the numbers, fields and "
                "critical mode at each limit point (VTU)"), JSON)
def run(options: argparse.Namespace) -> None:
    """Equilibria through limit points, stable or not, by arc length."""
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
        print(f"{event.what:<13} {event.value_text:<14} deflection "
              f"{event.station.deflection_m * 1e3:.4f} mm")
    for warning in result.warnings:
        print(warning)
