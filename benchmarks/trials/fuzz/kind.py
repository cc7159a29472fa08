"""Kinds of input, and how a content of one is changed."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hypothesis import strategies as st

from tympan.base.errors import InputError

#: What a number, a text or a line may become.
VALUES = (
    "0", "-1", "-0.0", "1e300", "-1e300", "1e-300", "1e999", "nan", "inf", "-inf", "1" * 5000,
    "9" * 30, "true", "[]", "{}", '""', '" "', '"x"', "[[[1]]]", "[" * 500, "1979-05-27", "0x10",
    '"1e300 mm"', '"-1 mm"', '"0 mm"', '"inf kV"', '"nan mm"', '"1 mm**9**9**9"', '"9**9**9 mm"',
    '"1 (mm"', '"1 kg/(m s^2)"', '"1 m^-9"', '"1 µm"', '"1 °"', '"1 degC"', '"1 dB"', '"1 V"',
    '"\\u0000"', '"../oval.toml"', '"/"', '"oval.toml"', '"a\\nb"', '"\\ud7ff"', "[plate]",
    "[a.b.c]", "[[frame]]", "a = 1", "a.b.c.d = 1", "#", ",", ";", '"', "'", "\x00", "\ufeff", "é",
    "999", "-7", "1e20", "1e10", "1e-20", "3",
)
#: Quoted texts, numbers and words.
_TOKEN = re.compile(rb'"[^"\n]*"|[-+.\w]+')

#: A content with one change, drawn.
Change = Callable[[st.DrawFn, bytes], bytes]


def changed_text(draw: st.DrawFn, content: bytes) -> bytes:
    """A value, a line or some bytes become others."""
    tokens = list(_TOKEN.finditer(content))
    lines = content.split(b"\n")
    way = draw(st.sampled_from(("value", "value", "value", "swap", "drop", "repeat", "bytes",
                                "cut")))
    if way in ("value", "swap") and tokens:
        first, second = sorted((draw(st.sampled_from(tokens)) for _ in range(2)),
                               key=lambda token: token.start())
        if way == "swap" and first.end() <= second.start():
            return (content[:first.start()] + second.group()
                    + content[first.end():second.start()] + first.group() + content[second.end():])
        value = draw(st.sampled_from(VALUES) | st.floats().map(repr) | st.text(max_size=5))
        return (content[:first.start()] + value.encode("utf-8", "surrogatepass")
                + content[first.end():])
    place = draw(st.integers(0, len(lines) - 1))
    if way == "drop":
        return b"\n".join(lines[:place] + lines[place + 1:])
    if way == "repeat":
        times = draw(st.sampled_from((1, 1, 2, 300)))
        return b"\n".join(lines[:place] + times * [lines[place]] + lines[place:])
    at = draw(st.integers(0, len(content)))
    return content[:at] if way == "cut" else content[:at] + draw(st.binary(max_size=4)) + content[
        at:]


def changed_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes become others, are left out, repeated or moved, at one place."""
    start, end = sorted(draw(st.integers(0, len(content))) for _ in range(2))
    way = draw(st.sampled_from(("flip", "flip", "flip", "insert", "cut", "drop", "repeat", "zero")))
    if way == "flip" and start < len(content):
        byte = content[start] ^ draw(st.integers(1, 255))
        return content[:start] + bytes([byte]) + content[start + 1:]
    if way == "cut":
        return content[:start]
    between = {"drop": b"", "repeat": 2 * content[start:end], "zero": bytes(end - start),
               }.get(way, draw(st.binary(max_size=8)) + content[start:end])
    return content[:start] + between + content[end:]


@dataclass(frozen=True)
class Kind:
    """A file by name, contents that can be read, and how it is read in its folder.

    ``seconds`` of processor time are enough: loads that are left out follow from the film, which
    is then solved. ``change`` is one change of a content; ``refusals`` are what reading may raise;
    contents that are ``refused`` raise it before they are changed. ``spoken``: the message has the
    words of somebody else's package.
    """

    file: str
    contents: tuple[bytes, ...]
    read: Callable[[Path], object]
    seconds: float = 2.0
    change: Change = changed_text
    refusals: tuple[type[BaseException], ...] = (InputError,)
    refused: bool = False
    spoken: bool = False


#: By name; each file of this folder adds those of its subject.
KINDS: dict[str, Kind] = {}


def register(name: str, kind: Kind) -> None:
    """Add a kind.

    Raises
    ------
    ValueError
        When there is one of this name.
    """
    if name in KINDS:
        raise ValueError(f"{name}: is registered twice")
    KINDS[name] = kind
