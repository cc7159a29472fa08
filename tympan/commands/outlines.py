"""``tympan outlines``: the registered outlines, and α of each with its held-out error."""

from __future__ import annotations

import argparse
from typing import Any

from tympan.options import JSON, MESH, command, finish, output, read_settings


@command("outlines", output(required=True), JSON, MESH)
def run(options: argparse.Namespace) -> None:
    """α of every registered outline with its held-out error."""
    from tympan.geometry.outlines import examples
    from tympan.progress import bar
    from tympan.studies.alpha.table import outline_table

    with bar(len(examples())) as progress:
        result = outline_table(read_settings(options), progress=progress)
    finish(options, result, _show)


def _show(record: dict[str, Any]) -> None:
    from tympan.studies.alpha.table import HEADER

    names = HEADER[:-1]
    widths = [max(9 if number else 17, len(name)) for number, name in enumerate(names)]
    rows = [[_cell_text(row[name]) for name in names] for row in record["outlines"]]
    for cells in (names, *rows):
        print("  ".join(f"{cell:<{width}}"
                        for cell, width in zip(cells, widths, strict=True)).rstrip())


def _cell_text(value: Any) -> str:
    return value if isinstance(value, str) else "-" if value is None else f"{value:.4g}"
