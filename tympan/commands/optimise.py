"""``tympan optimise``: the frame and plate with the largest stroke under limits."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import JSON, MESH, argument, command, finish, output, read_settings


@command("optimise",
         argument("file", type=Path, nargs="?", metavar="OPTIMISE.toml",
                  help="the problem; left out: the paper's large ellipse at equal frame area and "
                       "perimeter"),
         output("for optimum*.toml, optimum.json, path.csv, optimum.png and .svg",
                default=Path("optimum")), JSON, MESH)
def optimise(options: argparse.Namespace) -> None:
    """Lengths of frame and plate with the largest stroke under limits."""
    from tympan.progress import bar
    from tympan.studies.optimise.optimise import optimise
    from tympan.studies.optimise.problem import default_problem, read_problem

    problem = default_problem() if options.file is None else read_problem(options.file)
    with bar(len(problem.held) * (len(problem.starts) + 1)) as progress:
        result = optimise(problem, read_settings(options), progress=progress)
    finish(options, result)
