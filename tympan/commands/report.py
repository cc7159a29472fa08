"""``tympan report``: the figures and pages of a folder drawn again."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import Subcommands, command


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "report", _run,
                     "rebuild a run's figures and report from what it stored")
    parser.add_argument("folder", type=Path, metavar="DIR")


def _run(options: argparse.Namespace) -> None:
    from tympan.reports.rebuild import rebuild

    for file in rebuild(options.folder):
        print(file)
