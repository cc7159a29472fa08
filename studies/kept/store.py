"""Meshes and solved films kept on disk, so that equal specimens take less time again.

They are in one SQLite file, ``films.sqlite`` in the folder ``$TYMPAN_CACHE``, else
``$XDG_CACHE_HOME/tympan``, else ``~/.cache/tympan``. With an empty ``TYMPAN_CACHE``, or without a
home folder, nothing is kept.

Nothing in the file is trusted. Each row has a checksum of its table, key and content. A row that
does not match, or whose content cannot be read, is ignored and removed. A file with other tables,
or that SQLite finds damaged, is removed, and a new one is begun. A path that is no regular file of
this user (a link, a folder, a pipe) is left alone, and nothing is kept. Nothing is kept either
where another process holds the file's lock for more than a second.
"""

from __future__ import annotations

import os
import re
import sqlite3
import stat
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, lru_cache
from hashlib import blake2b, sha256
from inspect import getfile
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

#: Longest wait for another process that writes, once in the life of a process [s].
_PATIENCE = 1.0

#: Statement that makes a table. A file's tables must match it exactly: other versions have others.
_TABLE = "CREATE TABLE {} (key BLOB PRIMARY KEY, content BLOB, checksum BLOB)"

#: Most bytes of a row: the size of the largest mesh or film, and some more.
_LARGEST = 20_000_000

#: Bytes of a checksum: damaged content has the same checksum once in 2^128 times.
_CHECKSUM = 16

#: Suffixes of the database file and of files that SQLite may have left with it.
_BESIDE = ("", "-journal", "-wal", "-shm")

#: SQLite's codes for a file that is not damaged but cannot be read or written: the file stays.
_ELSEWHERE = frozenset({
    sqlite3.SQLITE_AUTH, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_FULL, sqlite3.SQLITE_INTERRUPT,
    sqlite3.SQLITE_IOERR, sqlite3.SQLITE_NOMEM, sqlite3.SQLITE_PERM, sqlite3.SQLITE_READONLY})

#: Root of tympan's packages, and the packages whose sources decide a film's mesh, and its solution:
#: tympan's own, and distributions of others, by the names of their folders of metadata.
_ROOT = Path(__file__).parents[2]
MESHING = ("base", "geometry")
_SOLVING = (*MESHING, "fem")
_MESHERS = re.compile(r"(cadquery[-_]ocp|gmsh)-.*\.(dist|egg)-info")


@dataclass(frozen=True)
class Store:
    """Contents by their :func:`digest` in a table of the file; above ``most`` the oldest go."""

    table: str
    most: int

    def read(self, key: bytes, made: Callable[[bytes], T]) -> T | None:
        """Make an object from the content under a key by ``made``; None where there is no content.

        A content that ``made`` cannot use (None, or an exception) is removed.
        """
        rows = self._executed(f"SELECT content, checksum FROM {self.table} WHERE key = ?", (key,))
        for content, checksum in rows:
            if isinstance(content, bytes) and checksum == self._checksum(key, content):
                with suppress(Exception):  # a content of another kind may raise anything
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
        """Execute a statement; no rows where the file is unusable; replace a damaged file."""
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
                # A byte of the header may mark any file as read-only.
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
            # A loss of power may damage the file; the checks find that. MEMORY: one file only.
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
    """A file whose tables are another version's, or another program's."""


@cache
def _given_up() -> set[Path]:
    """Collect files that another process held too long; this process works without them."""
    return set()


def _usable(file: Path) -> bool:
    """Test whether a file is a regular one of this user, or may be created; make its folder."""
    try:
        status = file.lstat()
    except FileNotFoundError:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        return True
    return stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid()


def cache_file() -> Path | None:
    """Find the file of kept contents; None where nothing is kept."""
    folder = os.environ.get("TYMPAN_CACHE")
    if folder is None:
        home = os.environ.get("XDG_CACHE_HOME", "")
        if not os.path.isabs(home):  # as the XDG specification requires
            try:
                account = Path("~").expanduser()
            except RuntimeError:  # neither HOME nor a user of this number
                return None
            if account == Path("/") or not account.is_dir():  # a service's, or a container's
                return None
            home = str(account / ".cache")
        folder = str(Path(home) / "tympan")
    return Path(folder) / "films.sqlite" if folder else None


def digest(*parts: object, sources: tuple[str, ...] = _SOLVING) -> bytes:
    """Compute a key of everything a solution depends on, and of the ``sources`` of packages.

    A TypeError where a part has a type that may hold more than its known value.
    """
    whole = sha256(_sources(sources))
    for part in parts:
        for piece in _pieces(part):
            whole.update(len(piece).to_bytes(8, "big") + piece)
    return whole.digest()


@lru_cache
def _sources(packages: tuple[str, ...]) -> bytes:
    whole = sha256()
    for package in packages:
        for file in sorted((_ROOT / package).rglob("*.py")):
            whole.update(file.read_bytes())
    for name in _meshers():
        whole.update(name.encode())
    return whole.digest()


def _meshers() -> list[str]:
    """List the installed meshers with their versions, ``gmsh-4.15.2.dist-info``.

    :mod:`importlib.metadata` would import the package email and read their whole descriptions.
    """
    found = []
    for folder in sys.path:
        with suppress(OSError):  # such as an archive, or a folder that is no longer there
            found += [name for name in os.listdir(folder or ".") if _MESHERS.fullmatch(name)]
    return sorted(found)


@lru_cache
def _source_of(kind: type) -> bytes:
    """Read the file of a law or outline of a user's package; ours are in :func:`_sources`."""
    if kind.__module__.partition(".")[0] == "tympan":
        return b""
    with suppress(TypeError, OSError):
        return Path(getfile(kind)).read_bytes()
    raise TypeError(f"the source of {kind.__qualname__} is not known")


def _pieces(value: object) -> Iterator[bytes]:
    """Yield a value as bytes that are the same only for the same value."""
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
        yield repr(value).encode()  # at once, not by number: curves have thousands of points
    elif isinstance(value, tuple | list | frozenset):
        items = [b"".join(_pieces(item)) for item in value]
        yield str([len(item) for item in items]).encode()
        yield from sorted(items) if isinstance(value, frozenset) else items
    elif isinstance(value, Mapping):
        yield from _pieces(tuple(value.items()))
    elif value is None or isinstance(value, bool | int | float | complex | str | np.generic):
        # The repr is the shortest text that reads as the same number.
        yield repr(value).encode()
    else:
        raise TypeError(f"a {type(value).__name__} has no bytes")
