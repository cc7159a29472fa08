"""``tympan report``: the figures and pages of a folder drawn again."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import argument, command


@command("report", argument("folder", type=Path, metavar="DIR"))
def report(options: argparse.Namespace) -> None:
    """Rebuild a run's figures and report from what it stored."""
    from tympan.reports.rebuild import rebuild

    for file in rebuild(options.folder):
        print(file)
