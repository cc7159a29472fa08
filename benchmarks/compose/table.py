"""Tables of what was asked, and the refusals that have a reason in physics."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.compose.ask import Row

#: Page with the list of refusals that are allowed.
PAGE = Path(__file__).parents[2] / "docs" / "composition.md"
#: Heading of that list.
_HEADING = "## Refusals with a reason"


@dataclass(frozen=True)
class Allowed:
    """Questions that have no meaning for a concept, with the message and the reason."""

    concepts: frozenset[str]
    questions: frozenset[str]
    message: str
    reason: str

    def covers(self, row: Row) -> bool:
        """Whether it is the refusal of a row."""
        return (row.question in self.questions and row.said == self.message
                and not self.concepts.isdisjoint(row.case.split(" + ")))


def allowed(page: Path = PAGE) -> list[Allowed]:
    """Rows of the page's table: concepts, questions, message, reason."""
    text = page.read_text(encoding="utf-8").partition(_HEADING)[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            for line in text.splitlines() if line.startswith("| `")]
    return [Allowed(_names(concepts), _names(questions), _message(message), reason)
            for concepts, questions, message, reason in rows]


def _message(cell: str) -> str:
    """Text of a cell that is code, whose quotation marks may be several."""
    quoted = re.fullmatch(r"(`+) ?(.*?) ?\1", cell)
    return (quoted[2] if quoted else cell).replace("\\|", "|")


def _names(cell: str) -> frozenset[str]:
    return frozenset(name.strip(" `") for name in cell.split(","))


def counts(rows: Iterable[Row]) -> Iterator[str]:
    """Line of each question, and of all."""
    by_question: dict[str, list[Row]] = {}
    for row in rows:
        by_question.setdefault(row.question, []).append(row)
    for question, mine in by_question.items():
        took = [row.seconds for row in mine if not row.status] or [0.0]
        refused, failed = (sum(getattr(row, how) for row in mine) for how in ("refused", "failed"))
        yield (f"{question:17s} {len(mine):4d} asked, {refused:3d} refused, {failed:3d} failed, "
               f"processor s median {median(took):.1f}, most {max(took):.1f}")
    every = [row for mine in by_question.values() for row in mine]
    yield (f"{len(every)} asked, {sum(row.refused for row in every)} refused, "
           f"{sum(row.failed for row in every)} failed, {sum(row.seconds for row in every):.0f} s")


def refusals(rows: Iterable[Row]) -> Iterator[str]:
    """Messages with their questions and concepts, the most frequent first."""
    by_message: dict[str, list[Row]] = {}
    for row in rows:
        by_message.setdefault(row.said, []).append(row)
    for message, mine in sorted(by_message.items(), key=lambda item: -len(item[1])):
        yield f"{len(mine):4d}  {message}"
        yield "      " + _counted(row.question for row in mine)
        yield "      " + _counted(row.case for row in mine)


def _counted(names: Iterable[str]) -> str:
    found = Counter(names)
    named = [f"{name} {count}" if count > 1 else name for name, count in found.most_common()]
    return ", ".join(named)
