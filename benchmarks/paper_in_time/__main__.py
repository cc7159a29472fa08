"""``python -m benchmarks.paper_in_time -o docs``: ``paper-in-time.md`` and its figures."""

from __future__ import annotations

import argparse
import shutil
import tempfile
from functools import partial
from pathlib import Path

from benchmarks.paper_in_time.compare import compare
from benchmarks.paper_in_time.figure import compose, compose_steps
from benchmarks.paper_in_time.page import page
from tympan.reports import look


def main() -> None:
    """Write the page and draw its figures."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("-o", type=Path, dest="output", required=True, metavar="DIR")
    output = parser.parse_args().output
    output.mkdir(parents=True, exist_ok=True)
    comparison = compare()
    (output / "paper-in-time.md").write_text(page(comparison), encoding="utf-8")
    drawn = {"paper-in-time": partial(compose, comparison),
             "paper-steps": partial(compose_steps, comparison.steps)}
    with tempfile.TemporaryDirectory() as folder:
        for name, draw in drawn.items():
            picture, *_ = look.save_figure(Path(folder), name, draw)
            shutil.copy(picture, output)


if __name__ == "__main__":
    main()
