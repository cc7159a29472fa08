"""``tympan sensitivity``: how results answer to every number of specimen, rig and load."""

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
    parser = command(commands, "sensitivity", _run,
                     "exact derivatives of results by every number that enters them")
    specimen_argument(parser)
    parser.add_argument("--mass", required=True, help='on the plate, such as "17.9 g"')
    parser.add_argument("--voltage", default="0 kV",
                        help='across the film, such as "3.5 kV" (default: %(default)s)')
    parser.add_argument("--of", default="heave", metavar="NAMES",
                        help="results, with commas between: heave, tilt, reaction, capacitance, energy, max_stretch, "
                             "max_true_stress, max_field (default: %(default)s); past pull-in, the pull-in load")
    parser.add_argument("--rig", type=Path, metavar="RIG.toml",
                        help="gravity, spring, amplifier and what else acts")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.fem.film.library import load_specimen
    from tympan.studies.case import Case
    from tympan.studies.sensitivity import sensitivity

    specimen = load_specimen(options.specimen)
    case = Case(specimen, parse_quantity(options.mass, "mass", "--mass"),
                parse_quantity(options.voltage, "voltage", "--voltage"), read_rig(options.rig))
    names = tuple(name.strip() for name in options.of.split(","))
    result = sensitivity(case, read_settings(options), names)
    if options.json:
        show(result.json(), True)
        return
    show({key: value for key, value in result.json().items() if key != "quantities"}, False)
    for found in result.quantities:
        _table(found)


def _table(found: Any) -> None:
    """What changes it most, first; what is zero has no per cent of itself, and comes last."""
    answers = sorted(found.answers, key=lambda answer: -abs(answer.elasticity or 0.0))
    width = max(len(answer.parameter) for answer in answers)
    print(f"\n{found.quantity}  {found.value:.6g} {found.unit}\n"
          f"{'if this grows by 1 %':<{width}}  {'from':<18}  {'it changes by':<14}  derivative")
    for answer in answers:
        share = "" if answer.elasticity is None else f"{answer.elasticity:+.4f} %"
        start = f"{answer.value:.6g} {_shown(answer.unit)}"
        print(f"{answer.parameter:<{width}}  {start:<18}  {share:<14}  {answer.derivative:+.6g} {_shown(found.unit)}"
              f" per {answer.unit}")


def _shown(unit: str) -> str:
    return "" if unit == "1" else unit
