"""``tympan study``: the main job, specimens solved, drawn and reported."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import argument, command, output


@command("study",
         argument("file", nargs="?", type=Path, metavar="STUDY.toml",
                  help="which specimens and loads"),
         output(default=Path("out")))
def run(options: argparse.Namespace) -> None:
    """Solve specimens, draw their stress, derive α, write a report; default: the paper's three."""
    from tympan.progress import bar
    from tympan.studies.study import default_study, read_study, run_study

    study = read_study(options.file) if options.file else default_study()
    with bar(study.steps + 1) as progress:
        run_study(study, progress, options.output).save(options.output)
        progress("report")
        from tympan.reports.study.page import build_study_page

        page = build_study_page(options.output)
    print(page)
