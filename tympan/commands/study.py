"""``tympan study``: the main job, specimens solved, drawn and reported."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import argument, command, output, save_and_draw


@command("study",
         argument("file", nargs="?", type=Path, metavar="STUDY.toml",
                  help="which specimens and loads"),
         output(default=Path("out")))
def study(options: argparse.Namespace) -> None:
    """Solve specimens, draw their stress, derive α, write a report; default: the paper's three."""
    from tympan.progress import bar
    from tympan.studies.study import default_study, read_study, run_study

    planned = read_study(options.file) if options.file else default_study()
    with bar(planned.steps + 1) as progress:
        result = run_study(planned, progress, options.output)
        progress("report")
        page, = save_and_draw(options, result)
    print(page)
