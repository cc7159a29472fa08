"""A cache that is damaged, foreign, held or out of reach: the same numbers as without one."""

from __future__ import annotations

import os
import pickle
import resource
import sqlite3
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.geometry.mesh import from_bytes, to_bytes
from tympan.geometry.mesher import MeshSettings
from tympan.studies.kept import meshes
from tympan.studies.kept.store import Store, _meshers, cache_file

COARSE = MeshSettings(order=2, around_plate=6)
FILM = circular()
PLANES = frozenset("xy")
#: Where :class:`Touch` leaves a file if it is unpickled.
TOUCHED = "unpickled"


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache with a mesh and a row of another table."""
    monkeypatch.setenv("TYMPAN_CACHE", str(tmp_path / "cache"))
    meshes.film_part(FILM, COARSE, PLANES)
    Store("other", 9).keep(b"key", b"content")
    return tmp_path / "cache" / "films.sqlite"


@pytest.fixture
def meshed(monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """One entry for each film that is meshed from now on."""
    calls: list[None] = []
    mesh_film = meshes.mesh_film

    def counted(*arguments: object) -> object:
        calls.append(None)
        return mesh_film(*arguments)

    monkeypatch.setattr(meshes, "mesh_film", counted)
    return calls


def mesh() -> bytes:
    part = meshes.film_part(FILM, COARSE, PLANES)
    return part.doflocs.tobytes() + part.t.tobytes()


def without_cache() -> bytes:
    before = os.environ["TYMPAN_CACHE"]
    os.environ["TYMPAN_CACHE"] = ""
    try:
        return mesh()
    finally:
        os.environ["TYMPAN_CACHE"] = before


def edited(*statements: str) -> Callable[[Path], object]:
    """Change a cache by SQL."""
    def edit(file: Path) -> None:
        with closing(sqlite3.connect(file)) as connection, connection:
            for statement in statements:
                connection.execute(statement)

    return edit


def content(change: Callable[[bytes], object], honest: bool = False) -> Callable[[Path], object]:
    """Change the content of the mesh's row, if ``honest`` with the checksum that belongs to it."""
    def edit(file: Path) -> None:
        with closing(sqlite3.connect(file)) as connection, connection:
            (key, old), = connection.execute("SELECT key, content FROM meshes")
            new = change(old)
            connection.execute("UPDATE meshes SET content = ?", (new,))
            if honest:
                assert isinstance(new, bytes)
                connection.execute("UPDATE meshes SET checksum = ?",
                                   (meshes.MESHES._checksum(key, new),))

    return edit


def scaled(old: bytes) -> bytes:
    part = from_bytes(old)
    part.doflocs[:] *= 1.01
    return to_bytes(part)


def flipped(old: bytes, place: int) -> bytes:
    return old[:place] + bytes([old[place] ^ 1]) + old[place + 1:]


class Touch:
    def __reduce__(self) -> tuple[object, ...]:
        return Path(TOUCHED).touch, ()


def numpy_pickle(_: bytes) -> bytes:
    """An archive of arrays as NumPy pickles them."""
    from io import BytesIO

    stream = BytesIO()
    np.savez(stream, doflocs=np.array([Touch()], dtype=object), t=np.zeros((3, 1)), order=2)
    return stream.getvalue()


def rewritten(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    return lambda file: file.write_bytes(change(file.read_bytes()))


def journal(file: Path) -> None:
    file.with_name(file.name + "-journal").write_bytes(b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7" * 600)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut in half": rewritten(lambda old: old[:len(old) // 2]),
    "first page alone": rewritten(lambda old: old[:4096]),
    "cut in the head": rewritten(lambda old: old[:60]),
    "zero bytes": rewritten(lambda _: b""),
    "zeros": rewritten(lambda old: bytes(len(old))),
    "text": rewritten(lambda _: b"no database\n" * 100),
    "head alone": rewritten(lambda _: b"SQLite format 3\0" + bytes(200)),
    "pages in disorder": rewritten(lambda old: old[:4096] + old[8192:] + old[4096:8192]),
    "said to be read-only": rewritten(lambda old: old[:18] + b"\x03" + old[19:]),
    "of another version": edited("DROP TABLE meshes",
                                 "CREATE TABLE meshes (key BLOB PRIMARY KEY, content BLOB)"),
    "number of another version": edited("PRAGMA user_version = 99"),
    "table missing": edited("DROP TABLE meshes"),
    "another program's table": edited("CREATE TABLE urls (id INTEGER)"),
    "other columns": edited("DROP TABLE meshes", "CREATE TABLE meshes (a, b, c)"),
    "column more": edited("ALTER TABLE meshes ADD COLUMN more"),
    "view": edited("ALTER TABLE meshes RENAME TO old", "CREATE VIEW meshes AS SELECT * FROM old"),
    "endless view": edited(
        "DROP TABLE meshes", "CREATE VIEW meshes AS WITH RECURSIVE n(key) AS (SELECT x'00' UNION "
        "ALL SELECT key FROM n) SELECT key, key AS content, key AS checksum FROM n"),
    "trigger": edited("CREATE TRIGGER t BEFORE DELETE ON meshes BEGIN SELECT RAISE(ABORT, 'no'); "
                      "END"),
    "own log": edited("PRAGMA journal_mode = WAL"),
    "journal of another file": journal,
    "bit in a content": content(lambda old: flipped(old, len(old) // 2)),
    "first bit of a content": content(lambda old: flipped(old, 0)),
    "scaled mesh": content(scaled),
    "checksum missing": edited("UPDATE meshes SET checksum = NULL"),
    "checksum of another row": edited("UPDATE meshes SET checksum = (SELECT checksum FROM other)"),
    "content of another row": edited("UPDATE meshes SET content = (SELECT content FROM other), "
                                     "checksum = (SELECT checksum FROM other)"),
    "text as content": edited("UPDATE meshes SET content = 'text', checksum = 'text'"),
    "no text as content": edited("UPDATE meshes SET content = CAST(x'ff' AS TEXT)"),
    "number as content": edited("UPDATE meshes SET content = 7"),
    "no content": edited("UPDATE meshes SET content = NULL"),
    "huge content": edited("UPDATE meshes SET content = zeroblob(60000000)"),
    "pickle": content(lambda _: pickle.dumps(Touch()), honest=True),
    "array that is pickled": content(numpy_pickle, honest=True),
    "empty content": content(lambda _: b"", honest=True),
    "cut content": content(lambda old: old[:-9], honest=True),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_damage_counts_as_none_and_is_mended(file: Path, meshed: list[None], tmp_path: Path,
                                             monkeypatch: pytest.MonkeyPatch,
                                             damage: Callable[[Path], object]) -> None:
    monkeypatch.chdir(tmp_path)
    expected = without_cache()
    assert len(meshed) == 1
    damage(file)
    began = time.perf_counter()
    assert mesh() == expected
    assert time.perf_counter() - began < 5
    count = len(meshed)
    assert mesh() == expected
    assert len(meshed) == count  # there is a sound row again
    assert not Path(TOUCHED).exists()
    assert [entry.name for entry in file.parent.iterdir()] == [file.name]


def test_any_bit_of_the_file_may_flip(file: Path) -> None:
    expected, sound = without_cache(), file.read_bytes()
    for place in np.random.default_rng(3).integers(0, len(sound), 60).tolist():
        file.write_bytes(flipped(sound, place))
        assert mesh() == expected, place


def replaced(file: Path, make: Callable[[Path], object]) -> Path:
    """Another file in the cache's place; where the cache is now."""
    other = file.with_name("elsewhere")
    file.rename(other)
    make(file)
    return other


IN_PLACE: dict[str, Callable[[Path], object]] = {
    "folder": Path.mkdir,
    "pipe": os.mkfifo,
    "link": lambda file: file.symlink_to("elsewhere"),
    "link to nothing": lambda file: file.symlink_to("nowhere"),
    "link to itself": lambda file: file.symlink_to(file.name),
    "device": lambda file: file.symlink_to("/dev/full"),
}


@pytest.mark.parametrize("make", IN_PLACE.values(), ids=IN_PLACE)
def test_what_is_no_file_is_left_alone(file: Path, meshed: list[None],
                                       make: Callable[[Path], object]) -> None:
    expected = without_cache()
    other = replaced(file, make)
    before, kind = other.read_bytes(), stat.S_IFMT(file.lstat().st_mode)
    assert [mesh(), mesh()] == [expected] * 2
    assert len(meshed) == 3
    assert other.read_bytes() == before
    assert stat.S_IFMT(file.lstat().st_mode) == kind
    assert {entry.name for entry in file.parent.iterdir()} == {file.name, "elsewhere"}


def test_a_file_of_another_user_is_left_alone(file: Path, meshed: list[None],
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    expected, before = without_cache(), file.read_bytes()
    monkeypatch.setattr(os, "geteuid", lambda: 4321)
    assert mesh() == expected
    assert len(meshed) == 2
    assert file.read_bytes() == before


@pytest.mark.parametrize("hold", ["BEGIN EXCLUSIVE", "BEGIN IMMEDIATE"])
def test_another_processs_lock_is_waited_for_once(file: Path, hold: str) -> None:
    """An exclusive one; below that only writing has to wait."""
    expected = without_cache()
    with closing(sqlite3.connect(file, isolation_level=None)) as holder:
        holder.execute(hold)
        began = time.perf_counter()
        assert [mesh() for _ in range(5)] == [expected] * 5
        for number in range(3):
            Store("other", 9).keep(bytes([number]), b"content")
        assert time.perf_counter() - began < 4


def test_a_file_that_cannot_be_written_serves_to_read(file: Path, meshed: list[None],
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    """Opened to read alone, since root may write anywhere."""
    expected, connect = without_cache(), sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda name, timeout: connect(
        f"file:{name}?mode=ro", timeout=timeout, uri=True))
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert mesh() == expected
    assert len(meshed) == 1
    for table in ("other", "third"):
        Store(table, 9).keep(b"new", b"content")
        assert Store(table, 9).read(b"new", bytes) is None
    assert Store("other", 9).read(b"key", bytes) == b"content"


FULL = """
import os, sys
from tympan.studies.kept.store import Store
store = Store("large", 9)
for number in range(3):
    store.keep(bytes([number]), os.urandom(300_000))
    print(store.read(bytes([number]), len))
"""


def test_a_full_disk_keeps_nothing(file: Path, meshed: list[None]) -> None:
    expected = without_cache()
    most = file.stat().st_size + 400_000
    done = subprocess.run(
        [sys.executable, "-c", FULL], capture_output=True, text=True, check=False, timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == ["300000", "None", "None"]
    assert mesh() == expected
    assert mesh() == expected
    assert len(meshed) <= 2


def test_without_a_home_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TYMPAN_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_file() == tmp_path / ".cache/tympan/films.sqlite"
    for home in ("", "/", str(tmp_path / "nowhere"), "relative"):
        monkeypatch.setenv("HOME", home)
        assert cache_file() is None
    monkeypatch.delenv("HOME")
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)  # an unknown user's number
    assert cache_file() is None
    assert mesh()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "x"))
    assert cache_file() == tmp_path / "x/tympan/films.sqlite"


def test_a_content_that_nothing_is_made_of_is_removed(file: Path) -> None:
    stored = Store("other", 9)
    assert stored.read(b"key", bytes) == b"content"
    assert stored.read(b"key", lambda _: None) is None
    assert stored.read(b"key", bytes) is None


def test_keys_have_the_versions_of_the_installed_meshers() -> None:
    assert {name.removesuffix(".dist-info").replace("_", "-") for name in _meshers()} == {
        f"{name}-{version(name)}" for name in ("cadquery-ocp", "gmsh")}
