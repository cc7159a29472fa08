"""How long the sentences of a page are."""

from __future__ import annotations

import re
from collections.abc import Iterator
from statistics import mean

#: What of a Markdown page is not prose: code, comments, tables, headings, pictures.
_NO_PROSE = re.compile(r"```.*?```|<!--.*?-->|!\[.*?\]\(.*?\)|^(?: {4}|\||#).*?$",
                       re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[(.*?)\]\(.*?\)")
#: A name or a command in backticks is read as one word.
_CODE = re.compile(r"`[^`]*`")
_PARAGRAPH_ENDS = re.compile(r"\n\s*\n|\n(?=[*-] )")
_SENTENCE_ENDS = re.compile(r"(?<=[.!?:])\s+(?=[A-Z0-9*])")
#: A decimal is one word, a dash none.
_WORD = re.compile(r"[A-Za-z0-9%°µ][A-Za-z0-9%°µ'’-]*(?:\.\d+)*")
#: Words of the shortest sentence that counts; shorter ones are labels.
_SHORTEST = 3


def sentences(page: str) -> Iterator[list[str]]:
    """Words of each sentence of a page in Markdown."""
    prose = _CODE.sub("x", _LINK.sub(r"\1", _NO_PROSE.sub("", page)))
    for paragraph in _PARAGRAPH_ENDS.split(prose):
        for sentence in _SENTENCE_ENDS.split(paragraph.replace("\n", " ")):
            words = _WORD.findall(sentence)
            if len(words) >= _SHORTEST:
                yield words


def mean_length(page: str) -> float:
    """Mean number of words in a sentence of a page, 0 where it has none."""
    return mean([len(words) for words in sentences(page)] or [0])
