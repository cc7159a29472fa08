"""A drawing of a known shape, and how it is judged."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.geometry.outlines import OUTLINES, Outline, area, check_outline, perimeter

Rng = np.random.Generator


@dataclass(frozen=True)
class Truth:
    """Area [mm²] and perimeter [mm] of the shape."""

    area: float
    length: float


@dataclass(frozen=True)
class Case:
    """What a program wrote.

    Parameters
    ----------
    name
        The feature of the program.
    write
        Writes the file, with numbers from a generator, and returns the truth.
    keys
        Of the specimen file, beside shape and file.
    within
        Relative error that is allowed.
    refused
        Pattern of the message, where the drawing is refused at first.
    advice
        Keys to add then. The message has to name each of them; "" is the value in the message.
    redraw
        Writes the file as the message advises, where no key helps.
    large
        Takes seconds.
    """

    name: str
    write: Callable[[Path, Rng], Truth]
    keys: Mapping[str, object] = field(default_factory=dict)
    suffix: str = "dxf"
    within: float = 1e-6
    refused: str = ""
    advice: Mapping[str, object] = field(default_factory=dict)
    redraw: Callable[[Path, Rng], Truth] | None = None
    large: bool = False

    def fault(self, folder: Path, seed: int) -> tuple[str, str]:
        """What is wrong, "" if nothing; and the message of a refusal."""
        file = folder / f"drawing.{self.suffix}"
        truth = self.write(file, np.random.default_rng(seed))
        if not self.refused:
            return self._compared(self._read(folder, {}), truth), ""
        try:
            self._read(folder, {})
        except InputError as error:
            said = str(error)
        else:
            return "was read", ""
        if not re.search(self.refused, said):
            return "other message", said
        followed = {}
        for key, value in self.advice.items():
            match = re.search(rf'\b{key} = "([^"]+)"', said)
            if not (match if value == "" else re.search(rf"\b{key}\b", said)):
                return f"does not name {key}", said
            followed[key] = value or match[1]
        if self.redraw:
            self.redraw(file, np.random.default_rng(seed))
        return self._compared(self._read(folder, followed), truth), said

    def _read(self, folder: Path, more: Mapping[str, object]) -> Outline:
        keys = {"shape": self.suffix, "file": f"drawing.{self.suffix}"} | dict(self.keys)
        outline: Outline = OUTLINES.read(Table(folder / "a.toml", keys | dict(more), "frame"))
        check_outline(outline, "frame")
        return outline

    def _compared(self, outline: Outline, truth: Truth) -> str:
        errors = (1e6 * area(outline) / truth.area - 1, 1e3 * perimeter(outline) / truth.length - 1)
        return "" if max(map(abs, errors)) <= self.within else (
            f"area off by {errors[0]:.2g}, perimeter by {errors[1]:.2g}")


CASES = list[Case]()


def case(name: str, **more: object) -> Callable:
    """Register a function that writes a drawing."""
    def registered(write: Callable) -> Callable:
        CASES.append(Case(name, write, **more))
        return write

    return registered
