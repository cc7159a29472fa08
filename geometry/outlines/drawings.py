"""The curves of drawings from outside, as pieces of outlines."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.pieces import MOST_PIECES, PIECES, Piece
from tympan.geometry.read_file import file_bytes
from tympan.geometry.reader_process import read_apart
from tympan.geometry.system import missing_library
from tympan.geometry.toml_reader import Table

#: What DXF calls curves.
_CURVES = frozenset({b"LINE", b"ARC", b"CIRCLE", b"ELLIPSE", b"SPLINE", b"LWPOLYLINE"})

#: The head of what a DXF draws, after the definitions of its layers and blocks.
_ENTITIES = re.compile(rb"SECTION\s+2\s+ENTITIES\b")


def drawing_pieces(file: Path, kind: str, layer: str = "*") -> list[Piece]:
    """The curves of a ``dxf`` or ``step`` drawing as pieces in any order [m].

    Raises
    ------
    InputError
        When it cannot be read, within the limits or at all, or its curves are none.
    """
    digest = hashlib.sha256(file_bytes(file)).hexdigest()
    return list(_pieces(str(file), digest, kind, layer))


@lru_cache(maxsize=64)
def _pieces(file: str, digest: str, kind: str, layer: str) -> tuple[Piece, ...]:
    """The digest of its bytes tells a changed file from the one that was read."""
    answer = read_apart(kind, file, layer)
    if "library" in answer:
        raise missing_library(ImportError(answer["library"]))
    if "error" in answer:
        raise InputError(answer["error"])
    table = Table("", answer, plain=True)
    try:
        return tuple(map(PIECES.read, table.tables("pieces")))
    except InputError as error:
        raise InputError(f"{error.key}: given {error.given!r}: {error.allowed}") from None


def record(kind: str, file: str, layer: str) -> dict[str, Any]:
    """The ``pieces`` of a drawing, the ``error`` in it, or the ``library`` that is missing."""
    try:
        _few(_curves(Path(file).read_bytes()) if (kind, layer) == ("dxf", "*") else 0)
        pieces = reader(kind)(Path(file), layer)
        _few(len(pieces))
        return {"pieces": [PIECES.write(piece, plain=True) for piece in pieces]}
    except InputError as error:
        return {"error": str(error)}
    except ImportError as error:
        return {"library": str(error)}
    except MemoryError:
        raise  # ends the process, of which the message is one on its limits
    except Exception as error:  # the libraries raise whatever they meet
        reason = " ".join(str(error).split())[:200]
        return {"error": f"is no {kind.upper()} file that can be read: "
                         f"{type(error).__name__}: {reason}"}


def _few(count: int) -> None:
    if count > MOST_PIECES:
        raise InputError(f"has {count} lines, arcs and splines: at most {MOST_PIECES} make an "
                         "outline")


def _curves(dxf: bytes) -> int:
    """How many curves the text of a DXF draws, outside of blocks, before a library reads it."""
    section = _ENTITIES.search(dxf)
    drawn = dxf[section.end():] if section else b""
    lines = [line.strip() for line in drawn.splitlines()]
    return sum(code == b"0" and name in _CURVES for code, name in pairwise(lines))


def reader(kind: str) -> Callable[[Path, str], list[Piece]]:
    """What reads a layer of a drawing, with its library loaded."""
    if kind == "dxf":
        from tympan.geometry.outlines.dxf import dxf_pieces

        return dxf_pieces
    from tympan.geometry.outlines.step import step_pieces

    return lambda file, layer: step_pieces(file)
