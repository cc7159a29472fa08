"""``tympan optimise``: the frame and plate with the largest stroke under limits."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from tympan.options import command, mesh_argument, read_settings, show


def add(commands: Any) -> None:
    """The command's options."""
    parser = command(commands, "optimise", _run,
                     "lengths of frame and plate with the largest stroke under limits")
    parser.add_argument("file", type=Path, nargs="?", metavar="OPTIMISE.toml",
                        help="the problem; left out: the paper's large ellipse at equal frame area and perimeter")
    parser.add_argument("-o", "--output", type=Path, default=Path("optimum"), metavar="DIR",
                        help="for optimum*.toml, optimum.json, path.csv, optimum.png (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.progress import bar
    from tympan.studies.optimise import output as stored
    from tympan.studies.optimise.optimise import optimise
    from tympan.studies.optimise.problem import default_problem, read_problem

    problem = default_problem() if options.file is None else read_problem(options.file)
    with bar(len(problem.held) * (len(problem.starts) + 1)) as progress:
        result = optimise(problem, read_settings(options), progress=progress)
    stored.write(result, options.output)
    if result.optima:
        from tympan.reports.figures.optimum import draw

        draw(result, options.output)
    record = stored.record(result)
    if options.json:
        show(record, True)
        return
    for run in record["failed"]:
        print(f"equal {run['held']}, start {run['start']}: {run['reason']}")
    for found in record["optima"]:
        _table(found, record)
    print(f"\n{options.output}")


def _table(found: dict[str, Any], record: dict[str, Any]) -> None:
    print(f"equal frame {found['held']}: {found['status']}")
    for key, value in found["variables"].items():
        print(f"  {key:<24}{value:.6g}{'  at its bound' if key in found['at_bounds'] else ''}")
    gain = "" if found["gain"] is None else f"  {found['gain']:+.1%} over {record['reference']['specimen']}"
    print(f"  {'stroke':<24}{1e3 * found['stroke_m']:.5g} mm{gain}")
    for name, limit in found["limits"].items():
        unit = "" if limit["unit"] == "1" else f" {limit['unit']}"
        active = f"  active: {limit['multiplier']:.3g} % of stroke per % of it" if limit["active"] else ""
        print(f"  {name:<24}{limit['value']:.5g} of {limit['bound']:.5g}{unit}{active}")
    if found["finer"]["stroke_m"] is None:
        print(f"  on a finer mesh: {found['finer']['reason']}")
    else:
        print(f"  {'on a mesh twice as fine':<24}{1e3 * found['finer']['stroke_m']:.5g} mm")
    print(f"  {'starts apart':<24}{found['starts_apart_stroke']:.2g} of the stroke")
    for warning in found["warnings"]:
        print(f"  {warning}")
