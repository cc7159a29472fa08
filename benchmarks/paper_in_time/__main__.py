"""``python -m benchmarks.paper_in_time -o docs``: ``paper-in-time.md`` and its figure."""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

from benchmarks.paper_in_time.compare import compare
from benchmarks.paper_in_time.figure import compose
from benchmarks.paper_in_time.page import page
from tympan.reports import look


def main() -> None:
    """Write the page and draw its figure."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("-o", type=Path, dest="output", required=True, metavar="DIR")
    output = parser.parse_args().output
    comparison = compare()
    (output / "paper-in-time.md").write_text(page(comparison), encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        picture, *_ = look.save_figure(Path(folder), "paper-in-time", lambda: compose(comparison))
        shutil.copy(picture, output)


if __name__ == "__main__":
    main()
