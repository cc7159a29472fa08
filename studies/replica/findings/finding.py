"""What a finding is: a claim about the paper, and the numbers that show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Evidence:
    """One number of a finding: what it is, its value and its unit ("" for none)."""

    what: str
    value: float
    unit: str = ""


@dataclass(frozen=True)
class Finding:
    """A claim, what it means in words, and the numbers it rests on."""

    key: str
    title: str
    words: list[str]
    numbers: tuple[Evidence, ...]

    def __getitem__(self, what: str) -> float:
        """The value of a number by its name."""
        return next(number.value for number in self.numbers if number.what == what)

    def json(self) -> dict[str, Any]:
        """As stored."""
        return {"key": self.key, "title": self.title, "words": self.words,
                "numbers": [vars(number) for number in self.numbers]}
