"""Solved films kept on disk, so that a second diagnosis of the same specimens takes seconds.

In one SQLite file, ``films.sqlite`` in the folder ``$TYMPAN_CACHE``, else
``$XDG_CACHE_HOME/tympan``, else ``~/.cache/tympan``; with an empty ``TYMPAN_CACHE`` nothing is
kept. A file that cannot be used is as good as none.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Films kept, some 20 MB; the oldest are dropped.
_MOST = 30_000

#: How long to wait for another process that writes [s].
_PATIENCE = 5.0

#: The packages whose sources decide what a film's solution is.
_ROOT = Path(__file__).parents[3]
_SOLVERS = ("fem", "geometry")


def cache_file() -> Path | None:
    """Where films are kept, None where they are not."""
    folder = os.environ.get("TYMPAN_CACHE")
    if folder is None:
        home = os.environ.get("XDG_CACHE_HOME") or str(Path("~/.cache").expanduser())
        folder = str(Path(home) / "tympan")
    return Path(folder) / "films.sqlite" if folder else None


def digest(*parts: object) -> bytes:
    """A key of everything a solution depends on, and of the sources that solve.

    A TypeError where a part is of a type whose value is not known to be all it is.
    """
    whole = sha256(_sources())
    for part in parts:
        for piece in _pieces(part):
            whole.update(len(piece).to_bytes(8, "big") + piece)
    return whole.digest()


def kept(key: bytes, shape: tuple[int, ...]) -> Array | None:
    """What has been kept under a key."""
    rows = _executed("SELECT numbers FROM films WHERE key = ?", (key,))
    if not rows or len(rows[0][0]) != 8 * int(np.prod(shape)):
        return None
    return np.frombuffer(rows[0][0]).reshape(shape)


def keep(key: bytes, values: Array) -> None:
    """Keep values under a key."""
    numbers = np.ascontiguousarray(values, dtype=np.float64).tobytes()
    _executed("INSERT OR REPLACE INTO films VALUES (?, ?)", (key, numbers))


def _executed(statement: str, values: tuple[object, ...]) -> list[Any]:
    """A statement's rows; none where the file cannot be used, which is removed if it is broken."""
    file = cache_file()
    if file is None:
        return []
    try:
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(file, timeout=_PATIENCE)) as connection, connection:
            # A loss of power may break the file, which would be found out.
            connection.execute("PRAGMA synchronous = OFF")
            connection.execute(
                "CREATE TABLE IF NOT EXISTS films (key BLOB PRIMARY KEY, numbers BLOB)")
            rows = connection.execute(statement, values).fetchall()
            if statement.startswith("INSERT"):
                connection.execute("DELETE FROM films WHERE rowid <= "
                                   "(SELECT max(rowid) FROM films) - ?", (_MOST,))
            return rows
    except (sqlite3.OperationalError, OSError):
        return []
    except sqlite3.DatabaseError:
        with suppress(OSError):
            file.unlink()
        return []


@lru_cache
def _sources() -> bytes:
    whole = sha256()
    for package in _SOLVERS:
        for file in sorted((_ROOT / package).rglob("*.py")):
            whole.update(file.read_bytes())
    whole.update((Path(__file__).parent / "sampling.py").read_bytes())
    return whole.digest()


def _pieces(value: object) -> Iterator[bytes]:
    """A value as bytes that are the same only for the same value."""
    yield f"{type(value).__module__}.{type(value).__qualname__}".encode()
    if is_dataclass(value):
        for item in fields(value):
            yield item.name.encode()
            yield from _pieces(getattr(value, item.name))
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, tuple | list | frozenset):
        items = [b"".join(_pieces(item)) for item in value]
        yield str([len(item) for item in items]).encode()
        yield from sorted(items) if isinstance(value, frozenset) else items
    elif isinstance(value, Mapping):
        yield from _pieces(tuple(value.items()))
    elif value is None or isinstance(value, bool | int | float | complex | str | np.generic):
        # The shortest text that reads as the same number.
        yield repr(value).encode()
    else:
        raise TypeError(f"a {type(value).__name__} has no bytes")
