"""How easily a page is read: words of its sentences, and syllables of its words."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import mean

#: What of a Markdown page is not prose: code, comments, tables, headings, pictures, formulas.
_NO_PROSE = re.compile(r"```.*?```|<!--.*?-->|!\[.*?\]\(.*?\)|\$\$.*?\$\$"
                       r"|^(?: {4}|\||#|:::|:\w+:).*?$",
                       re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[(.*?)\]\(.*?\)")
#: A name, a command or a formula is read as one word.
_CODE = re.compile(r"`[^`]*`|\$[^$\n]+\$")
_PARAGRAPH_ENDS = re.compile(r"\n\s*\n|\n(?=\s*(?:[*-]|\d+\.) )")
_SENTENCE_ENDS = re.compile(r"(?<=[.!?:])[)*”\"]*\s+(?=[A-Z0-9*\"“])")
#: A decimal is one word, a dash none.
_WORD = re.compile(r"[^\W_][^\W_%°µ'’-]*(?:['’-][^\W_]+)*(?:\.\d+)*[%°]?")
#: Words whose syllables are counted: no numbers, units or symbols.
_SPOKEN = re.compile(r"[A-Za-z]{2,}(?:['’][a-z]+)?")
#: Words of the shortest sentence that counts; shorter ones are labels.
_SHORTEST = 3


def sentences(page: str) -> Iterator[list[str]]:
    """Words of each sentence of a page in Markdown."""
    prose = _CODE.sub("X", _LINK.sub(r"\1", _NO_PROSE.sub("", page)))
    for paragraph in _PARAGRAPH_ENDS.split(prose):
        for sentence in _SENTENCE_ENDS.split(paragraph.replace("\n", " ")):
            words = _WORD.findall(sentence)
            if len(words) >= _SHORTEST:
                yield words


@dataclass(frozen=True)
class Readability:
    """Mean words of a sentence, mean syllables of a word, and Flesch's reading ease from both.

    ``count`` is the number of words whose syllables were counted.
    """

    words: float
    syllables: float
    count: int = 0

    @property
    def ease(self) -> float:
        """Flesch (1948): 206.835 - 1.015 words - 84.6 syllables; 60 to 70 is plain English."""
        return 206.835 - 1.015 * self.words - 84.6 * self.syllables


def readability(text: str, syllables: Callable[[str], int]) -> Readability | None:
    """Readability of a text; None where it has no sentence."""
    found = list(sentences(text))
    spoken = [part for words in found for word in words for part in _SPOKEN.findall(word)]
    if not found or not spoken:
        return None
    return Readability(mean(map(len, found)), mean(map(syllables, spoken)), len(spoken))
