"""The sentences of ``words.txt`` with numbers in them."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any


def sentences(key: str, **values: Any) -> list[str]:
    """The paragraphs of a section, filled; values may have attributes and indices."""
    return [paragraph.format(**values) for paragraph in _sections()[key]]


@cache
def _sections() -> dict[str, list[str]]:
    """Paragraphs, each on one line, by the section they stand in: ``[key]`` above them."""
    text = resources.files("tympan.studies.replica").joinpath("words.txt")
    sections: dict[str, list[str]] = {}
    for block in text.read_text(encoding="utf-8").strip().split("\n\n"):
        first, *lines = block.splitlines()
        if first.startswith("["):
            paragraphs = sections[first.strip("[]")] = []
        else:
            lines = [first, *lines]
        if lines:
            paragraphs.append(" ".join(lines))
    return sections
