"""One question in a process of its own, forked from one that has everything imported."""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import resource
import sys
import traceback
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.compose.concepts import Asked
from benchmarks.compose.questions import Question

#: Processor seconds after which a question counts as failed.
MOST_SECONDS = 150
#: A process that was ended from outside has no status of its own.
_RAISED = 99
#: Files of a question's folder.
OUTPUT, ERRORS = "out.json", "err.txt"


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


def preload() -> None:
    """Import what questions import, so that no process of one does."""
    import tympan

    for name in ("base", "tables", "geometry", "fem", "studies", "commands"):
        package = importlib.import_module(f"tympan.{name}")
        for module in pkgutil.walk_packages(package.__path__, f"tympan.{name}."):
            importlib.import_module(module.name)
    assert tympan.solve


def ask(question: Question, asked: Asked, folder: Path) -> Row | None:
    """Ask in the question's own folder; None where it waits for an answer that is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    line = question.line(asked, folder)
    if line is None:
        return None
    process = os.fork()
    if not process:
        _answer(line, folder)
    _, ended, used = os.wait4(process, 0)
    errors = (folder / ERRORS).read_text("utf-8", errors="replace").strip().splitlines()
    return Row(asked.combination.name, question.name, os.waitstatus_to_exitcode(ended),
               round(used.ru_utime + used.ru_stime, 2),
               _plain(errors[-1], asked, folder) if errors else "",
               any(line.startswith("Traceback") for line in errors))


def _answer(line: list[str], folder: Path) -> None:
    """Run a command, and leave this process."""
    status = _RAISED
    try:
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 10))
        for number, name in ((1, OUTPUT), (2, ERRORS)):
            os.dup2(os.open(name, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8", closefd=False)
                                  for number in (1, 2))
        from tympan.cli import main

        status = main(line)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:  # whatever a command raises is what is looked for
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


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
