"""Read an input as its kind, within its time."""

from __future__ import annotations

import signal
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from benchmarks.trials.fuzz import kinds
from benchmarks.trials.fuzz.contents import DATASET, SPECIMENS, STATIC
from benchmarks.trials.python_words import words_of_python
from tympan.geometry.outlines import drawings


@st.composite
def inputs(draw: st.DrawFn, only: str = "") -> tuple[str, bytes]:
    """The name of a kind with a word in it, and a content that was changed in a few places."""
    name = draw(st.sampled_from(sorted(name for name in kinds() if only in name)))
    kind = kinds()[name]
    content = draw(st.sampled_from(kind.contents))
    for _ in range(draw(st.integers(1, 3))):
        content = kind.change(draw, content)
    return name, content


class Hang(BaseException):
    """Reading took too long; no library takes it for one of its own errors."""


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """At most so much processor time."""
    def end(*_: Any) -> None:
        raise Hang(f"more than {seconds} s of processor time")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@cache
def _import_libraries(name: str) -> None:
    """What a first reading imports is no part of its time."""
    from tympan.geometry.cad import parts
    from tympan.geometry.outlines import dxf

    assert parts
    assert dxf
    for kind in ("design", name):
        with tempfile.TemporaryDirectory() as scratch, suppress(*kinds()[kind].refusals):
            _read(kind, kinds()[kind].contents[0], Path(scratch))


def survive(name: str, content: bytes) -> None:
    """Read a content as its kind; drawings in this process, which shows what they raise."""
    _import_libraries(name)
    kind = kinds()[name]
    with tempfile.TemporaryDirectory() as scratch, _limited(kind.seconds):
        said = ""
        try:
            _read(name, content, Path(scratch))
        except kind.refusals as refusal:
            said = str(refusal)
    assert kind.spoken or not words_of_python(said), said


def _read(name: str, content: bytes, folder: Path) -> None:
    kind = kinds()[name]
    apart, drawings.read_apart = drawings.read_apart, drawings.record
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for file, text in (("oval.toml", SPECIMENS["oval"]), ("dataset.toml", DATASET),
                               ("static.csv", STATIC)):
                (folder / file).write_text(text, encoding="utf-8")
            (folder / kind.file).parent.mkdir(exist_ok=True)
            (folder / kind.file).write_bytes(content)
            kind.read(folder)
    finally:
        drawings.read_apart = apart
