"""Processor seconds of questions over every kind of film, here and in another checkout, in turn.

    python -m benchmarks.compose.paired TREE [--every 1] [--repeats 2] [-o docs/question-times.md]
        [question ...]

TREE is a working tree of another version. Both have all modules imported and their meshes kept on
disk; each question runs in a process of its own, forked from there. Of the repeats, which the two
take by turns, the least counts, so that other work on the machine matters little.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.compose.concepts import alone, concepts, write_drawings
from benchmarks.compose.questions import questions

ROOT = Path(__file__).parents[2]
#: Questions whose times are compared unless others are named.
_ASKED = ("solve", "limits", "curve")
#: Program of a server: this version's, also for a checkout that has none.
_SERVER = Path(__file__).with_name("answering.py")


class Server:
    """A checkout that answers questions."""

    def __init__(self, tree: Path, folder: Path) -> None:
        self.folder = folder
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(_SERVER)], cwd=tree, text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(tree), "TYMPAN_CACHE": str(folder / "cache")})

    def seconds(self, words: list[str], name: str) -> float | None:
        """Measure the processor seconds of a command line; None if it does not answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps([words, str(self.folder / name)]), file=self._process.stdin, flush=True)
        status, seconds = json.loads(self._process.stdout.readline())
        return None if status else float(seconds)

    def end(self) -> None:
        """End the process."""
        self._process.communicate()


@dataclass(frozen=True)
class Times:
    """Processor seconds of one question of one film, before and now."""

    film: str
    question: str
    before: float
    now: float

    @property
    def ratio(self) -> float:
        """Seconds now over those before."""
        return self.now / self.before


def measured(tree: Path, folder: Path, asked: Iterable[str], every: int, repeats: int
             ) -> list[Times]:
    """Measure questions of every so many films; print each as it comes."""
    write_drawings(folder)
    servers = [Server(place, folder / name) for place, name in ((tree, "before"), (ROOT, "now"))]
    found = []
    chosen = [question for question in questions() if question.name in set(asked)]
    for combination in alone(concepts())[::every]:
        film = combination.write(folder)
        for question in chosen:
            name = f"{combination.stem}-{question.name.replace(' ', '_')}"
            words = question.line(film, folder / name)
            if words is None:
                continue
            runs = [[server.seconds(words, name) for server in servers] for _ in range(repeats)]
            if any(None in run for run in runs):
                continue
            found.append(Times(combination.name, question.name, *map(min, zip(*runs, strict=True))))
            print(f"{found[-1].film}: {found[-1].question} {found[-1].before:.2f} s before, "
                  f"{found[-1].now:.2f} s now", file=sys.stderr, flush=True)
    for server in servers:
        server.end()
    return found


def table(found: Iterable[Times]) -> list[str]:
    """Write a table with a line for each question."""
    by_question: dict[str, list[Times]] = {}
    for times in found:
        by_question.setdefault(times.question, []).append(times)
    lines = ["| question | films | median before | now | ratio | longest before | now | "
             "largest ratio of a film |", "|---|---|---|---|---|---|---|---|"]
    for question, rows in by_question.items():
        before, now = ([getattr(row, name) for row in rows] for name in ("before", "now"))
        slowest, least = max(rows, key=lambda row: row.before), max(rows, key=lambda row: row.ratio)
        middle = statistics.median(before), statistics.median(now)
        lines.append(
            f"| `{question}` | {len(rows)} | {middle[0]:.2f} s | {middle[1]:.2f} s | "
            f"{middle[1] / middle[0]:.2f} | {slowest.before:.2f} s ({slowest.film}) | "
            f"{max(now):.2f} s | {least.ratio:.2f} ({least.film}) |")
    return lines


def commit(tree: Path) -> str:
    """Name the commit of a working tree and its day."""
    words = ["git", "log", "-1", "--format=%h of %cs"]
    return subprocess.run(words, cwd=tree, check=True, capture_output=True,
                          text=True).stdout.strip()


def main() -> int:
    """Print the table, or write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compose.paired",
                                     description="Compare the times of two versions.")
    parser.add_argument("tree", type=Path)
    parser.add_argument("questions", nargs="*", default=_ASKED)
    parser.add_argument("--every", type=int, default=1, help="ask every so many of the films")
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, help="page with the table")
    options = parser.parse_intermixed_args()
    with TemporaryDirectory() as folder:
        found = measured(options.tree.resolve(), Path(folder), options.questions, options.every,
                         options.repeats)
    text = "\n".join([
        "# Times of questions, before and now", "",
        "Processor seconds of a command, imports and meshing left out, over films and rigs of "
        "every kind (`python -m benchmarks.compose.paired`). Both versions were asked in turn: "
        f"before is {commit(options.tree)}, now {commit(ROOT)}. Of each question the table has the "
        "median film, and the one that took longest.", "",
        *table(found), ""])
    if options.output:
        options.output.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
