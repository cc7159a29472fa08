"""Outlines from drawings: ``shape = "dxf"`` and ``shape = "step"``, read once and kept as pieces."""

from __future__ import annotations

from pathlib import Path

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.shapes.drawn import Drawn, joined
from tympan.geometry.toml_reader import Table


def _from_dxf(table: Table) -> Drawn:
    """Read ``file``, ``layer`` and ``curve``."""
    return _read(table, table.text("layer", "*"))


def _from_step(table: Table) -> Drawn:
    """Read ``file`` and ``curve``."""
    return _read(table, None)


def _read(table: Table, layer: str | None) -> Drawn:
    file = Path(table.file).parent / table.text("file")
    which = table.choice("curve", {"outer": "outer", "inner": "inner", "only": None}, "only")
    # CAD is needed for drawings alone.
    from tympan.geometry.outlines.drawings import dxf_pieces, step_pieces

    if not file.is_file():
        raise table.error("file", "is no file", str(file))
    try:
        return joined(step_pieces(file) if layer is None else dxf_pieces(file, layer), which)
    except InputError as error:
        raise InputError(error.allowed, file=table.file, key=table.path("file"),
                         given=str(file)) from None


#: Readers by shape.
FILES = {"dxf": _from_dxf, "step": _from_step}
