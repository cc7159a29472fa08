"""``tympan modes``: natural frequencies about a loaded, actuated state."""

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
    parser = command(commands, "modes", _run,
                     "natural frequencies and shapes under one load and voltage")
    specimen_argument(parser)
    parser.add_argument("--mass", required=True,
                        help='of the plate with its weight, such as "17.9 g"')
    parser.add_argument("--voltage", default="0 kV",
                        help='held across the film (default: %(default)s)')
    parser.add_argument("--point-mass", default="0 g", metavar="MASS",
                        help="part of the mass that sits in the plate's centre; the rest is spread evenly over the "
                             "plate (default: %(default)s)")
    parser.add_argument("--rig", type=Path, metavar="RIG.toml",
                        help="gravity, unaccounted mass, spring, amplifier")
    parser.add_argument("--count", type=int, default=6, metavar="N",
                        help="how many (default: %(default)s)")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR",
                        help="also store shapes (VTU), a picture (PNG) and the numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.fem.film.library import load_specimen
    from tympan.geometry.errors import InputError
    from tympan.studies import files as store
    from tympan.studies import modes as vibration
    from tympan.studies.case import Case

    if not 1 <= options.count <= 100:
        raise InputError("must be from 1 to 100", key="--count", given=options.count)
    specimen = load_specimen(options.specimen)
    case = Case(specimen, parse_quantity(options.mass, "mass", "--mass"),
                parse_quantity(options.voltage, "voltage", "--voltage"), read_rig(options.rig))
    point_mass = parse_quantity(options.point_mass, "mass", "--point-mass")
    result, found = vibration.modes(case, read_settings(options), options.count, point_mass)
    if options.output is not None:
        name = f"{specimen.name}-modes"
        store.remove(options.output, *(f"{name}.{kind}" for kind in ("vtu", "png", "json")))
        if found is not None:
            from tympan.reports.figures.modes import draw

            vibration.write_modes(options.output / f"{name}.vtu", found)
            draw(options.output, name, found, result.modes)
        store.write_json(options.output / f"{name}.json", result.json())
    _show(result, options.json)


def _show(result: Any, as_json: bool) -> None:
    values = result.json()
    if as_json:
        show(values, True)
        return
    del values["modes"], values["plate_inertia_kg_m2"]
    show(values, False)
    for number, mode in enumerate(result.modes, start=1):
        print(f"{number:>3}  {mode.speed:<14}  {mode.name:<16}  {100 * mode.film_share:.0f} % of the motion's energy "
              "in the film")
