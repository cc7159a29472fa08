"""One question in a process of its own, forked from one that has everything imported."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.compose.answering import ERRORS, forked
from benchmarks.compose.concepts import Asked
from benchmarks.compose.questions import Question


@dataclass(frozen=True)
class Row:
    """How a question ended; ``said`` is the last line of its error output, without folders.

    ``status`` 0: answered; 2: refused; anything else, or where it ``raised``: failed.
    """

    case: str
    question: str
    status: int
    seconds: float
    said: str
    raised: bool

    @property
    def refused(self) -> bool:
        """Whether its input was called wrong."""
        return self.status == 2 and not self.raised

    @property
    def failed(self) -> bool:
        """Whether it ended in no way a command should."""
        return self.raised or self.status not in (0, 2)


def ask(question: Question, asked: Asked, folder: Path) -> Row | None:
    """Ask in the question's own folder; None where it waits for an answer that is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    line = question.line(asked, folder)
    if line is None:
        return None
    status, seconds = forked(line, folder)
    errors = (folder / ERRORS).read_text("utf-8", errors="replace").strip().splitlines()
    return Row(asked.combination.name, question.name, status, round(seconds, 2),
               _plain(errors[-1], asked, folder) if errors else "",
               any(line.startswith("Traceback") for line in errors))


def _plain(said: str, asked: Asked, folder: Path) -> str:
    """What was said, with files by what they are."""
    names = {str(asked.rig): "RIG.toml", str(asked.film): "SPECIMEN.toml",
             **{str(file): file.name[len(asked.film.stem) + 1:]
                for file in asked.film.parent.glob(f"{asked.film.stem}.*.toml")
                if file != asked.rig}}
    for name, kind in sorted(names.items(), key=lambda item: -len(item[0])):
        said = said.replace(name, kind)
    return said.removeprefix("tympan: ").replace(f"{folder}/", "")


class Log:
    """Rows so far, one line of JSON each; a run goes on from them."""

    def __init__(self, file: Path) -> None:
        self.file = file
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        found = [Row(**json.loads(line)) for line in lines]
        #: The last row of each case and question.
        self.rows = {(row.case, row.question): row for row in found}

    def __iter__(self) -> Iterator[Row]:
        return iter(self.rows.values())

    def add(self, row: Row) -> None:
        """Keep a row."""
        self.rows[row.case, row.question] = row
        with self.file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(row)) + "\n")
