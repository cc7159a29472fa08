"""``tympan outlines``: the registered outlines, and α of each with its held-out error."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from tympan.options import command, mesh_argument, read_settings


def add(commands: Any) -> None:
    """The subcommand."""
    parser = command(commands, "outlines", _run,
                     "α of every registered outline with its held-out error")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.geometry.outlines import examples
    from tympan.progress import bar
    from tympan.reports.figures.outlines import draw
    from tympan.studies.alpha.table import HEADER, outline_table, write

    with bar(len(examples())) as progress:
        rows = list(outline_table(read_settings(options), progress=progress))
    write(rows, options.output)
    draw(rows, options.output)
    table = [dict(zip(HEADER, row.cells(), strict=True)) for row in rows]
    if options.json:
        print(json.dumps({"outlines": table}, ensure_ascii=False, allow_nan=False))
        return
    names = HEADER[:-1]
    widths = [max(9 if number else 17, len(name)) for number, name in enumerate(names)]
    for cells in ([*names], *([_cell(line[name]) for name in names] for line in table)):
        print("  ".join(f"{cell:<{width}}"
                        for cell, width in zip(cells, widths, strict=True)).rstrip())


def _cell(value: Any) -> str:
    return value if isinstance(value, str) else "-" if value is None else f"{value:.4g}"
