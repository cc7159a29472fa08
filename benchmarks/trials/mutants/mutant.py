"""A mutant, and the files that hold many."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath

#: Folders in a chapter's name: studies/diagnosis/inference has three, fem/equilibrium two.
_DEPTH = 3


def chapter_of(file: str) -> str:
    """Chapter of a file: its package with at most two folders below."""
    return "/".join(PurePosixPath(file).parent.parts[:_DEPTH])


#: What makes a mutant another one than all others: its file, its place there [bytes], the text at
#: that place, and the text in its stead.
Key = tuple[str, int, str, str]


@dataclass(frozen=True)
class Mutant:
    """One changed place of one file.

    ``before`` and ``after`` are the changed line, for readers. ``old`` is the text of the file's
    bytes from ``start`` on, in whose place ``new`` stands.
    """

    number: int
    file: str
    line: int
    function: str
    kind: str
    before: str
    after: str
    start: int
    old: str
    new: str

    @property
    def chapter(self) -> str:
        """Its chapter."""
        return chapter_of(self.file)

    @property
    def key(self) -> Key:
        """What makes it another mutant than all others."""
        return self.file, self.start, self.old, self.new

    def apply(self, source: bytes) -> bytes:
        """Put it into the source of its file.

        Raises
        ------
        ValueError
            When the file has another text at this place.
        """
        end = self.start + len(self.old.encode())
        if source[self.start:end] != self.old.encode():
            raise ValueError(f"{self.file}:{self.line}: the file is not the one that mutant "
                             f"{self.number} was drawn from; draw again, or use that tree")
        return source[:self.start] + self.new.encode() + source[end:]


def write_mutants(file: Path, mutants: Iterable[Mutant]) -> None:
    """Write one mutant a line."""
    file.write_text("".join(json.dumps(asdict(mutant)) + "\n" for mutant in mutants),
                    encoding="utf-8")


def read_mutants(file: Path) -> list[Mutant]:
    """Read what ``write_mutants`` wrote."""
    return [Mutant(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]
