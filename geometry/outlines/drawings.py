"""Drawings from outside, read in a process of their own with limits of time and memory.

The libraries that read them are made for files that CAD wrote: of others they may crash, or never
end, and the process they are in with them.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.pieces import MOST_PIECES, PIECES, Piece
from tympan.geometry.read_file import file_bytes
from tympan.geometry.system import missing_library
from tympan.geometry.toml_reader import Table

#: Limits of the process: memory [bytes], its own time [s], and that on the clock.
_MEMORY, _SECONDS, _PATIENCE = 4 << 30, 20, 120

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
    record = _apart(kind, file, layer)
    if "library" in record:
        raise missing_library(ImportError(record["library"]))
    if "error" in record:
        raise InputError(record["error"])
    table = Table("", record, plain=True)
    try:
        return tuple(map(PIECES.read, table.tables("pieces")))
    except InputError as error:
        raise InputError(f"{error.key}: given {error.given!r}: {error.allowed}") from None


def _apart(kind: str, file: str, layer: str) -> dict[str, Any]:
    """The record of a drawing, made in a process of its own."""
    code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import answer; answer()"
    try:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False,
                              input=json.dumps([kind, file, layer]).encode(), timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        raise InputError(f"cannot be read within {_PATIENCE} s") from None
    if done.returncode:
        raise InputError(f"cannot be read: it is damaged, or takes more than {_SECONDS} s or "
                         f"{_MEMORY >> 30} GB to read")
    record: dict[str, Any] = json.loads(done.stdout)
    return record


def answer() -> None:
    """In the process: the pieces of the drawing on standard input as JSON on standard output."""
    import resource

    # What the libraries print must not be taken for the answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "w") as output:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        kind, file, layer = json.load(sys.stdin)
        for limit, most in ((resource.RLIMIT_AS, _MEMORY), (resource.RLIMIT_CPU, _SECONDS),
                            (resource.RLIMIT_CORE, 0)):
            resource.setrlimit(limit, (most, most))
        json.dump(_record(kind, file, layer), output)


def _record(kind: str, file: str, layer: str) -> dict[str, Any]:
    try:
        _few(_curves(Path(file).read_bytes()) if (kind, layer) == ("dxf", "*") else 0)
        pieces = _read(kind, Path(file), layer)
        _few(len(pieces))
        return {"pieces": [PIECES.write(piece, plain=True) for piece in pieces]}
    except InputError as error:
        return {"error": str(error)}
    except ImportError as error:
        return {"library": str(error)}
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


def _read(kind: str, file: Path, layer: str) -> list[Piece]:
    if kind == "dxf":
        from tympan.geometry.outlines.dxf import dxf_pieces

        return dxf_pieces(file, layer)
    from tympan.geometry.outlines.step import step_pieces

    return step_pieces(file)
