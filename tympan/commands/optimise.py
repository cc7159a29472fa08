"""``tympan optimise``: the frame and plate with the largest stroke under limits."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from tympan.options import JSON, MESH, argument, command, output, read_settings, show


@command("optimise",
         argument("file", type=Path, nargs="?", metavar="OPTIMISE.toml",
                  help="the problem; left out: the paper's large ellipse at equal frame area and "
                       "perimeter"),
         output("for optimum*.toml, optimum.json, path.csv, optimum.png and .svg",
                default=Path("optimum")), JSON, MESH)
def run(options: argparse.Namespace) -> None:
    """Lengths of frame and plate with the largest stroke under limits."""
    from tympan.progress import bar
    from tympan.studies.optimise.problem import default_problem, read_problem
    from tympan.studies.optimise.result import OptimiseResult, optimise

    problem = default_problem() if options.file is None else read_problem(options.file)
    with bar(len(problem.held) * (len(problem.starts) + 1)) as progress:
        result = optimise(problem, read_settings(options), progress=progress)
    result.save(options.output)
    if result.specimens:
        from tympan.reports.figures.optimum import draw_optimum

        draw_optimum(OptimiseResult.load(options.output), options.output)
    record = result.json()
    if options.json:
        show(record, True)
        return
    for run in record["failed"]:
        print(f"equal {run['held']}, start {run['start']}: {run['reason']}")
    for optimum in record["optima"]:
        _show_optimum(optimum, record["reference"]["specimen"])
    print(f"\n{options.output}")


def _show_optimum(optimum: dict[str, Any], reference: str) -> None:
    print(f"equal frame {optimum['held']}: {optimum['status']}")
    for key, value in optimum["variables"].items():
        bound = "  at its bound" if key in optimum["at_bounds"] else ""
        print(f"  {key:<24}{value:.6g}{bound}")
    gain = "" if optimum["gain"] is None else f"  {optimum['gain']:+.1%} over {reference}"
    print(f"  {'stroke':<24}{1e3 * optimum['stroke_m']:.5g} mm{gain}")
    for name, limit in optimum["limits"].items():
        unit = "" if limit["unit"] == "1" else f" {limit['unit']}"
        active = (f"  active: {limit['multiplier']:.3g} % of stroke per % of it"
                  if limit["active"] else "")
        print(f"  {name:<24}{limit['value']:.5g} of {limit['bound']:.5g}{unit}{active}")
    finer = optimum["finer"]
    if finer["stroke_m"] is None:
        print(f"  on a finer mesh: {finer['reason']}")
    else:
        print(f"  {'on a mesh twice as fine':<24}{1e3 * finer['stroke_m']:.5g} mm")
    print(f"  {'starts apart':<24}{optimum['starts_apart_stroke']:.2g} of the stroke")
    for warning in optimum["warnings"]:
        print(f"  {warning}")
