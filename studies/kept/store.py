"""Meshes and solved films kept on disk, so that the same specimens take less time again.

In one SQLite file, ``films.sqlite`` in the folder ``$TYMPAN_CACHE``, else
``$XDG_CACHE_HOME/tympan``, else ``~/.cache/tympan``; with an empty ``TYMPAN_CACHE`` nothing is
kept. A file that cannot be used is as good as none.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from inspect import getfile
from pathlib import Path
from typing import Any

import numpy as np

#: How long to wait for another process that writes [s].
_PATIENCE = 5.0

#: The packages whose sources decide what a film's mesh and solution are, here and of others.
_ROOT = Path(__file__).parents[2]
_SOLVERS = ("fem", "geometry")
_MESHERS = ("cadquery-ocp", "gmsh")


@dataclass(frozen=True)
class Store:
    """Contents by their :func:`digest` in a table of the file; above ``most`` the oldest go."""

    table: str
    most: int

    def read(self, key: bytes) -> bytes | None:
        """What has been kept under a key."""
        rows = self._executed(f"SELECT * FROM {self.table} WHERE key = ?", (key,))
        return rows[0][1] if rows else None

    def keep(self, key: bytes, content: bytes) -> None:
        """Keep a content under a key."""
        self._executed(f"INSERT OR REPLACE INTO {self.table} VALUES (?, ?)", (key, content))

    def _executed(self, statement: str, values: tuple[object, ...]) -> list[Any]:
        """A statement's rows; none where the file cannot be used; a broken one is removed."""
        file = cache_file()
        if file is None:
            return []
        try:
            if not file.exists():
                file.parent.mkdir(parents=True, exist_ok=True)
            with closing(sqlite3.connect(file, timeout=_PATIENCE)) as connection, connection:
                # A loss of power may break the file, which would be found out.
                connection.execute("PRAGMA synchronous = OFF")
                connection.execute(f"CREATE TABLE IF NOT EXISTS {self.table} "
                                   "(key BLOB PRIMARY KEY, content BLOB)")
                rows = connection.execute(statement, values).fetchall()
                if statement.startswith("INSERT"):
                    connection.execute(f"DELETE FROM {self.table} WHERE rowid <= "
                                       f"(SELECT max(rowid) FROM {self.table}) - ?", (self.most,))
                return rows
        except (sqlite3.OperationalError, OSError):
            return []
        except sqlite3.DatabaseError:
            with suppress(OSError):
                file.unlink()
            return []


def cache_file() -> Path | None:
    """Where contents are kept, None where they are not."""
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


@lru_cache
def _sources() -> bytes:
    whole = sha256()
    for package in _SOLVERS:
        for file in sorted((_ROOT / package).rglob("*.py")):
            whole.update(file.read_bytes())
    for distribution in _MESHERS:
        with suppress(PackageNotFoundError):  # it may come from elsewhere than the Python index
            whole.update(version(distribution).encode())
    return whole.digest()


@lru_cache
def _source_of(kind: type) -> bytes:
    """The file of a law or outline from a user's own package; ours are in :func:`_sources`."""
    if kind.__module__.partition(".")[0] == "tympan":
        return b""
    with suppress(TypeError, OSError):
        return Path(getfile(kind)).read_bytes()
    raise TypeError(f"the source of {kind.__qualname__} is not known")


def _pieces(value: object) -> Iterator[bytes]:
    """A value as bytes that are the same only for the same value."""
    yield f"{type(value).__module__}.{type(value).__qualname__}".encode()
    if is_dataclass(value):
        kind: Any = type(value)
        yield _source_of(kind)
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
