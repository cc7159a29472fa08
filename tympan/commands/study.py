"""``tympan study``: the main job, specimens solved, drawn and reported."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import Subcommands, command, output_argument


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "study", _run, "solve specimens, draw their stress, derive α, "
                     "write a report; by default of the paper's three")
    parser.add_argument("file", nargs="?", type=Path, metavar="STUDY.toml",
                        help="which specimens and loads")
    output_argument(parser, "default: %(default)s", default=Path("out"))


def _run(options: argparse.Namespace) -> None:
    from tympan.progress import bar
    from tympan.studies.study import default_study, read_study, run_study

    study = read_study(options.file) if options.file else default_study()
    with bar(study.steps + 1) as progress:
        run_study(study, progress).save(options.output)
        progress("report")
        from tympan.reports.study.page import build_study_page

        page = build_study_page(options.output)
    print(page)
