"""Workbooks, the cache, and packages of users' own."""

from __future__ import annotations

import io
import os
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hypothesis import strategies as st
from openpyxl import Workbook

from benchmarks.trials.fuzz.contents import SIGNAL
from benchmarks.trials.fuzz.kind import Kind, changed_bytes, changed_text, register
from tympan.base.fields import Registry
from tympan.base.plugins import _loaded, load_plugins
from tympan.studies.kept.store import Store
from tympan.studies.signals import read_signal


def _workbook(*sheets: str) -> bytes:
    """The table of a signal on sheets of these names."""
    book, content = Workbook(), io.BytesIO()
    book.remove(book.active)
    for name in sheets:
        sheet = book.create_sheet(name)
        for line in SIGNAL.splitlines():
            sheet.append([float(cell) if cell[0].isdigit() else cell for cell in line.split(",")])
    book.save(content)
    return content.getvalue()


def _changed_workbook(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes of the archive, or of a part, change; the part's checksum belongs to it."""
    way = draw(st.sampled_from(("archive", "text", "text", "bytes")))
    try:
        old = zipfile.ZipFile(io.BytesIO(content))
        parts = {name: old.read(name) for name in old.namelist()}
    except Exception:  # as an earlier change left it
        way = "archive"
    if way == "archive" or not parts:
        return changed_bytes(draw, content)
    name = draw(st.sampled_from(sorted(parts)))
    parts[name] = (changed_text if way == "text" else changed_bytes)(draw, parts[name])
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new:
        for part, text in parts.items():
            new.writestr(part, text)
    return packed.getvalue()


#: What the cache holds, by key.
_ROWS = {bytes([number]): 99 * bytes([number + 1]) for number in range(3)}


@contextmanager
def _cache(folder: Path) -> Iterator[Store]:
    before = os.environ.get("TYMPAN_CACHE")
    os.environ["TYMPAN_CACHE"] = str(folder)
    try:
        yield Store("films", 2)
    finally:
        if before is None:
            del os.environ["TYMPAN_CACHE"]
        else:
            os.environ["TYMPAN_CACHE"] = before


def _sound_cache() -> bytes:
    with tempfile.TemporaryDirectory() as folder, _cache(Path(folder)) as store:
        for key, content in _ROWS.items():
            store.keep(key, content)
        return (Path(folder) / "films.sqlite").read_bytes()


def _read_cache(folder: Path) -> None:
    """What is read is what was kept, or nothing; what is kept then is read."""
    with _cache(folder) as store:
        for key, content in _ROWS.items():
            assert store.read(key, bytes) in (None, content)
        store.keep(b"new", b"content")
        assert store.read(b"new", bytes) == b"content"


MODULE = """import os, sys, logging, warnings, signal, locale
print('A')
os.write(1, b'B')
sys.stderr.write('C')
os.chdir('/')
os.environ['HOME'] = 'x'
os.environ.pop('PATH')
logging.basicConfig(stream=sys.stdout, level=0)
warnings.simplefilter('error')
signal.signal(2, signal.SIG_IGN)
sys.stdout = None
sys.argv[:] = []
sys.exit(0)
raise KeyboardInterrupt
"""
POINTS = "[tympan.laws]\nodd = odd_law\nother = odd_law:attribute [extra]\n"
METADATA = "Metadata-Version: 2.1\nName: odd\nVersion: 1\n"


def _read_package(folder: Path) -> None:
    """The process is as it was before; nothing of the package is registered."""
    info = folder / "odd-1.dist-info"
    info.mkdir()
    for file, text in ((folder / "odd_law.py", MODULE), (info / "METADATA", METADATA),
                       (info / "entry_points.txt", POINTS)):
        changed = folder / f"changed-{file.name}"
        file.write_bytes(changed.read_bytes() if changed.exists() else text.encode())
    before = _process()
    sys.path.insert(0, str(folder))
    kinds: Registry[object] = Registry("law")
    try:
        load_plugins("tympan.laws", kinds)
    finally:
        sys.path.remove(str(folder))
        sys.modules.pop("odd_law", None)
        _loaded().clear()
    assert _process() == before
    assert not kinds
    kinds.whole()


def _process() -> list[object]:
    return [Path.cwd(), dict(os.environ), sys.stdout, sys.stderr, sys.argv[:], print]


register("workbook", Kind("signal.xlsx", (_workbook("signal"), _workbook("notes", "Signal")),
                          lambda folder: read_signal(folder / "signal.xlsx"),
                          change=_changed_workbook))
register("cache", Kind("films.sqlite", (_sound_cache(),), _read_cache, change=changed_bytes,
                       refusals=()))
for _name, _content in (("odd_law.py", MODULE), ("entry_points.txt", POINTS),
                        ("METADATA", METADATA)):
    register(f"package {_name}", Kind(f"changed-{_name}", (_content.encode(),), _read_package,
                                      refused=True, spoken=True))
