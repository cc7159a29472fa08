"""Meshes and solved films kept on disk, so that the same specimens take less time again.

In one SQLite file, ``films.sqlite`` in the folder ``$TYMPAN_CACHE``, else
``$XDG_CACHE_HOME/tympan``, else ``~/.cache/tympan``; with an empty ``TYMPAN_CACHE``, or without a
home folder, nothing is kept.

Nothing in it is trusted. Each row has a checksum of its table, key and content: a row that does
not match, or whose content cannot be read, counts as none and is removed. A file with other tables
than these, or that SQLite finds damaged, is removed, and a new one begun. What is no regular file
of this user (a link, a folder, a pipe) is left alone, and nothing is kept. So it is where another
process holds its lock for more than a second.
"""

from __future__ import annotations

import os
import sqlite3
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, lru_cache
from hashlib import blake2b, sha256
from importlib.metadata import PackageNotFoundError, version
from inspect import getfile
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

#: How long to wait for another process that writes, once in the life of a process [s].
_PATIENCE = 1.0

#: How a table is made. What a file's tables must be to the letter: other versions have others.
_TABLE = "CREATE TABLE {} (key BLOB PRIMARY KEY, content BLOB, checksum BLOB)"

#: Most bytes of a row, as many as the largest mesh or film has and some more.
_LARGEST = 20_000_000

#: Bytes of a checksum: that of damage is the same once in 2^128 times.
_CHECKSUM = 16

#: Ends of the names of a file and of those that SQLite may have left beside it.
_BESIDE = ("", "-journal", "-wal", "-shm")

#: What SQLite reports where a file is not damaged but cannot be read or written: it stays.
_ELSEWHERE = frozenset({
    sqlite3.SQLITE_AUTH, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_FULL, sqlite3.SQLITE_INTERRUPT,
    sqlite3.SQLITE_IOERR, sqlite3.SQLITE_NOMEM, sqlite3.SQLITE_PERM, sqlite3.SQLITE_READONLY})

#: The packages whose sources decide what a film's mesh and solution are, here and of others.
_ROOT = Path(__file__).parents[2]
_SOLVERS = ("base", "fem", "geometry")
_MESHERS = ("cadquery-ocp", "gmsh")


@dataclass(frozen=True)
class Store:
    """Contents by their :func:`digest` in a table of the file; above ``most`` the oldest go."""

    table: str
    most: int

    def read(self, key: bytes, made: Callable[[bytes], T]) -> T | None:
        """Object that ``made`` makes of the content under a key; None where there is none.

        A content of which it makes nothing (None, or an exception) is removed.
        """
        rows = self._executed(f"SELECT content, checksum FROM {self.table} WHERE key = ?", (key,))
        for content, checksum in rows:
            if isinstance(content, bytes) and checksum == self._checksum(key, content):
                with suppress(Exception):  # whatever a content of another kind raises
                    if (value := made(content)) is not None:
                        return value
            self._executed(f"DELETE FROM {self.table} WHERE key = ?", (key,))
        return None

    def keep(self, key: bytes, content: bytes) -> None:
        """Keep a content under a key."""
        if len(content) < _LARGEST:
            self._executed(f"INSERT OR REPLACE INTO {self.table} VALUES (?, ?, ?)",
                           (key, content, self._checksum(key, content)))

    def _checksum(self, key: bytes, content: bytes) -> bytes:
        parts = blake2b(self.table.encode() + key, digest_size=_CHECKSUM)
        parts.update(content)
        return parts.digest()

    def _executed(self, statement: str, values: tuple[object, ...]) -> list[Any]:
        """A statement's rows, none where the file cannot be used; a damaged file is begun anew."""
        file = cache_file()
        if file is None or file in _given_up():
            return []
        for _ in range(2):
            try:
                if not _usable(file):
                    return []
                return self._rows(file, statement, values)
            except (sqlite3.Error, _Foreign) as error:
                code = getattr(error, "sqlite_errorcode", None)
                kind = None if code is None else code & 0xFF
                if kind in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                    _given_up().add(file)
                # A byte of the head may say of any file that it is only to be read.
                said = kind == sqlite3.SQLITE_READONLY and os.access(file, os.W_OK)
                if kind in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, *_ELSEWHERE) and not said:
                    return []
                for name in (file.name + end for end in _BESIDE):
                    with suppress(OSError):
                        file.with_name(name).unlink()
            except (OSError, MemoryError):
                return []
        return []

    def _rows(self, file: Path, statement: str, values: tuple[object, ...]) -> list[Any]:
        with closing(sqlite3.connect(file, timeout=_PATIENCE)) as connection, connection:
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 2 * _LARGEST)
            # A loss of power may damage the file, which would be found out. No file beside it.
            connection.execute("PRAGMA synchronous = OFF")
            connection.execute("PRAGMA journal_mode = MEMORY")
            tables = dict(connection.execute("SELECT name, sql FROM sqlite_master "
                                             "WHERE name NOT LIKE 'sqlite_autoindex_%'"))
            if any(made != _TABLE.format(name) for name, made in tables.items()):
                raise _Foreign
            if self.table not in tables:
                connection.execute(_TABLE.format(self.table))
            rows = connection.execute(statement, values).fetchall()
            if statement.startswith("INSERT"):
                connection.execute(f"DELETE FROM {self.table} WHERE rowid <= "
                                   f"(SELECT max(rowid) FROM {self.table}) - ?", (self.most,))
            return rows


class _Foreign(Exception):
    """The tables of a file are another version's, or another program's."""


@cache
def _given_up() -> set[Path]:
    """Files that another process held too long; this one goes on without."""
    return set()


def _usable(file: Path) -> bool:
    """Whether a file is a regular one of this user, or may be begun, its folder made if need be."""
    try:
        status = file.lstat()
    except FileNotFoundError:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        return True
    return stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid()


def cache_file() -> Path | None:
    """File of contents that are kept, None where they are not."""
    folder = os.environ.get("TYMPAN_CACHE")
    if folder is None:
        home = os.environ.get("XDG_CACHE_HOME", "")
        if not os.path.isabs(home):  # as its specification has it
            try:
                account = Path("~").expanduser()
            except RuntimeError:  # neither HOME nor a user of this number
                return None
            if account == Path("/") or not account.is_dir():  # a service's, or a container's
                return None
            home = str(account / ".cache")
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
    elif type(value) is tuple and all(type(item) is float for item in value):
        yield repr(value).encode()  # as of a single number: of points on curves there are thousands
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
