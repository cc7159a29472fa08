"""The tables of mutants, as a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from scipy.stats import binomtest

from benchmarks.trials.mutants.judge import ABSENT, CAUGHT, EQUIVALENT, Record
from benchmarks.trials.mutants.kinds import KINDS
from benchmarks.trials.mutants.mutant import Key, Mutant
from benchmarks.trials.mutants.rules import RULES

#: Letters of a changed line around its change.
_WIDTH = 60
_HEAD = """# Mutants

A mutant is a small fault that is made on purpose in the program. A test suite should notice it. A
mutant is caught when a test fails or hangs that passes without it. Only tests that always run
count: no dear ones (see CONTRIBUTING.md). An equivalent mutant does what the program does, or the
same within rounding, as a person has found. The shares leave it out.

*Before* is the suite as it was when the mutants were drawn, *after* as it is now. Some tests were
written for mutants that had got away. So the shares before say what the suite would catch of other
mutants.
"""
#: What is said of mutants drawn over all chapters, and of rules.
_DRAWN = """These mutants were drawn at random over all chapters, in proportion to their lines of
code.
"""
_RULES = """These mutants are rules, drawn at random from some files: a condition that is switched
off, or a constant that becomes zero, a thousandth or a thousand times as large. Most of the tests
that catch them were written when they had been drawn. They say that each rule has a test. They say
nothing of other rules.
"""


#: How each mutant ended in a suite.
_Ends = dict[tuple[str, Key], Record]


@dataclass(frozen=True)
class Part:
    """A part of the page: mutants that were drawn together, and how they ended."""

    title: str
    mutants: Sequence[Mutant]
    records: Sequence[Record]

    @property
    def of_rules(self) -> bool:
        """Whether its mutants are rules."""
        return all(mutant.kind in RULES for mutant in self.mutants)

    def lines(self) -> Iterator[str]:
        """Its shares caught, and each mutant with how it ended in every suite."""
        suites = list(dict.fromkeys(record.suite for record in self.records))
        ends = {(record.suite, record.mutant): record for record in self.records}
        yield from (f"## {self.title}", "", _RULES if self.of_rules else _DRAWN)
        yield from _summary(self.mutants, ends, suites, () if self.of_rules else KINDS)
        yield ""
        yield from _rows(self.mutants, ends, suites)
        yield ""


def page(parts: Sequence[Part]) -> str:
    """Markdown of some parts."""
    return "\n".join([_HEAD, *(line for part in parts for line in part.lines())])


def _rows(mutants: Sequence[Mutant], ends: _Ends, suites: Sequence[str]) -> Iterator[str]:
    yield "| | place | function | kind | change | " + " | ".join(
        f"{suite}: caught by | tests run | processor time" for suite in suites) + " |"
    yield "|---:|---|---|---|---|" + "---|---:|---:|" * len(suites)
    for mutant in mutants:
        before, after = change_words(mutant)
        cells = [str(mutant.number), f"{mutant.file}:{mutant.line}", f"`{mutant.function}`",
                 mutant.kind, f"{_code(before)} → {_code(after)}"]
        for suite in suites:
            record = ends.get((suite, mutant.key))
            cells += (["not judged", "", ""] if record is None else
                      [_by(record), "", ""] if record.end in (ABSENT, EQUIVALENT) else
                      [_by(record), f"{record.ran} of {record.candidates}",
                       f"{record.seconds:.0f} s"])
        yield "| " + " | ".join(cells) + " |"


def _by(record: Record) -> str:
    if record.end == ABSENT:
        return ABSENT
    if record.end == EQUIVALENT:
        return f"{EQUIVALENT}: {record.why}"
    if record.end != CAUGHT:
        return f"**got away**: {record.why}"
    file, _, test = record.by.partition("::")
    return f"{PurePosixPath(file).name} {_code(test)}" if test else record.by


def _code(text: str) -> str:
    """A text as code in a cell of a table."""
    quote = "``" if "`" in text else "`"
    return quote + text.replace("|", "\\|") + quote


def change_words(mutant: Mutant) -> tuple[str, str]:
    """Line before and after, cut to what is around the change."""
    same = next((number for number, (one, other) in enumerate(
        zip(mutant.before, mutant.after, strict=False)) if one != other), 0)
    first = max(0, same - _WIDTH // 2)
    return (_cut(mutant.before, first), _cut(mutant.after, first))


def _cut(text: str, first: int) -> str:
    last = first + _WIDTH
    return (("… " if first else "") + text[first:last].strip() + (" …" if text[last:] else ""))


def _summary(mutants: Sequence[Mutant], ends: _Ends, suites: Sequence[str],
             kinds: Sequence[str]) -> Iterator[str]:
    """Shares caught, also by ``kinds`` and, with these, by package; with 95 % intervals."""
    packages = list(dict.fromkeys(mutant.chapter.partition("/")[0] for mutant in mutants))
    packages = packages if kinds else []
    groups: list[tuple[str, Callable[[Mutant], bool]]] = [("all", lambda mutant: True)]
    groups += [(kind, lambda mutant, kind=kind: mutant.kind == kind)  # type: ignore[misc]
               for kind in kinds]
    groups += [(f"{package}/",
                lambda mutant, name=package: mutant.file.startswith(f"{name}/"))  # type: ignore[misc]
               for package in packages]
    yield "| mutants | " + " | ".join(f"caught {suite}" for suite in suites) + " |"
    yield "|---|" + "---|" * len(suites)
    for name, belongs in groups:
        cells = []
        for suite in suites:
            judged = [record for mutant in mutants if belongs(mutant)
                      and (record := ends.get((suite, mutant.key))) is not None
                      and record.end not in (ABSENT, EQUIVALENT)]
            cells.append(share(sum(record.end == CAUGHT for record in judged), len(judged)))
        yield f"| {name} | " + " | ".join(cells) + " |"


def share(caught: int, count: int) -> str:
    """Share in words, with Wilson's 95 % interval."""
    if not count:
        return "none judged"
    limits = binomtest(caught, count).proportion_ci(method="wilson")
    return (f"{caught} of {count}: {100 * caught / count:.0f} % "
            f"({100 * limits.low:.0f} to {100 * limits.high:.0f} %)")
