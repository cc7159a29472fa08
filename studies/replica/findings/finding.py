"""What a finding is: a claim about the paper, and the numbers that show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Number = dict[str, Any]


def evidence(what: str, value: float, unit: str = "") -> Number:
    """One number of a finding: what it is, its value and its unit ("" for none)."""
    return {"what": what, "value": value, "unit": unit}


@dataclass(frozen=True)
class Finding:
    """A claim, what it means in words, and the numbers it rests on."""

    key: str
    title: str
    words: list[str]
    numbers: tuple[Number, ...]

    def __getitem__(self, what: str) -> float:
        """The value of a number by its name."""
        return next(float(entry["value"]) for entry in self.numbers if entry["what"] == what)

    def json(self) -> dict[str, Any]:
        """As stored."""
        return {**vars(self), "numbers": list(self.numbers)}
