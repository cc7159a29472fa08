"""Damaged manifests of folders: what tympan wrote is replaced or not, what a user wrote never."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path

from hypothesis import strategies as st

from benchmarks.trials.fuzz.kind import Kind, changed_bytes, changed_text, register
from tympan.base.errors import InputError
from tympan.base.process.folder import MANIFEST
from tympan.studies.files import write_text

_FOLDER = "results"


def _written() -> bytes:
    """The manifest of a folder with two results."""
    with tempfile.TemporaryDirectory() as scratch:
        for name in ("a.json", "b.csv"):
            write_text(Path(scratch) / name, "old")
        return (Path(scratch) / MANIFEST).read_bytes()


def _write_again(folder: Path) -> None:
    """Write a result anew; the manifest and what it is of came from elsewhere."""
    results = folder / _FOLDER
    for name, text in (("a.json", "old"), ("b.csv", "old"), ("mine.json", "mine")):
        (results / name).write_text(text, encoding="utf-8")
    there = {file.name for file in results.iterdir()}
    for name in ("a.json", "mine.json", "new.json"):
        with suppress(InputError):
            write_text(results / name, "new")
    texts = {file.name: file.read_text(encoding="utf-8") for file in results.glob("*.*")
             if file.name != MANIFEST}
    assert texts["mine.json"] == "mine", texts
    assert texts["a.json"] in ("old", "new"), texts
    assert set(texts) <= there | {"new.json"}, texts


def _changed(draw: st.DrawFn, content: bytes) -> bytes:
    return draw(st.sampled_from((changed_text, changed_bytes)))(draw, content)


register("manifest", Kind(f"{_FOLDER}/{MANIFEST}", (_written(),), _write_again, change=_changed))
