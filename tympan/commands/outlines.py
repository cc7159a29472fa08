"""``tympan outlines``: the registered outlines, and α of each with its held-out error."""

from __future__ import annotations

import argparse
from typing import Any

from tympan.options import (
    Subcommands,
    command,
    json_argument,
    mesh_argument,
    output_argument,
    print_json,
    read_settings,
)


def add(commands: Subcommands) -> None:
    """The command's options."""
    parser = command(commands, "outlines", _run,
                     "α of every registered outline with its held-out error")
    output_argument(parser, required=True)
    json_argument(parser)
    mesh_argument(parser)


def _run(options: argparse.Namespace) -> None:
    from tympan.geometry.outlines import examples
    from tympan.progress import bar
    from tympan.reports.figures.outlines import draw_outlines
    from tympan.studies.alpha.table import HEADER, OutlineTable, outline_table

    with bar(len(examples())) as progress:
        result = outline_table(read_settings(options), progress=progress)
    result.save(options.output)
    draw_outlines(OutlineTable.load(options.output), options.output)
    table = result.json()["outlines"]
    if options.json:
        print_json(result.json())
        return
    names = HEADER[:-1]
    widths = [max(9 if number else 17, len(name)) for number, name in enumerate(names)]
    for cells in ([*names], *([_cell_text(line[name]) for name in names] for line in table)):
        print("  ".join(f"{cell:<{width}}"
                        for cell, width in zip(cells, widths, strict=True)).rstrip())


def _cell_text(value: Any) -> str:
    return value if isinstance(value, str) else "-" if value is None else f"{value:.4g}"
