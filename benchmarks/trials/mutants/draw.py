"""Draw mutants: over all chapters in proportion to their lines, or rules of some files."""

from __future__ import annotations

import ast
import random
from collections.abc import Sequence
from pathlib import Path

from benchmarks.trials.mutants.kinds import KINDS, Change, changes
from benchmarks.trials.mutants.mutant import Mutant, chapter_of
from benchmarks.trials.mutants.rules import rules
from benchmarks.trials.mutants.source import PRODUCT, code_lines, product_files


def chapter_lines(tree: Path, product: Sequence[str] = PRODUCT) -> dict[str, int]:
    """Lines of code of each chapter."""
    lines: dict[str, int] = {}
    for file in product_files(tree, product):
        chapter = chapter_of(file)
        lines[chapter] = lines.get(chapter, 0) + code_lines((tree / file).read_bytes())
    return lines


def spread(lines: dict[str, int], count: int, random_numbers: random.Random) -> list[str]:
    """Chapters of so many mutants: equal steps through all lines, from a random first one.

    A chapter gets its exact share, rounded up or down.
    """
    step = sum(lines.values()) / count
    at = step * random_numbers.random()
    drawn: list[str] = []
    passed = 0
    for chapter, own in lines.items():
        passed += own
        while len(drawn) < count and at < passed:
            drawn.append(chapter)
            at += step
    return drawn


def draw(tree: Path, count: int, seed: int, product: Sequence[str] = PRODUCT) -> list[Mutant]:
    """Draw mutants, reproducibly.

    The kinds are as even as the chapters allow. Within a chapter and a kind every place is
    equally likely.
    """
    random_numbers = random.Random(seed)
    chapters = spread(chapter_lines(tree, product), count, random_numbers)
    kinds = (KINDS * (count // len(KINDS) + 1))[:count]
    deck = random_numbers.sample(kinds, count)
    files = product_files(tree, product)
    possible: dict[str, list[tuple[str, Change]]] = {
        chapter: [(file, change) for file in files if chapter_of(file) == chapter
                  for change in changes((tree / file).read_bytes())]
        for chapter in dict.fromkeys(chapters)}
    drawn: list[Mutant] = []
    for chapter in chapters:
        mutant = None
        while possible[chapter] and mutant is None:
            there = {change.kind for _, change in possible[chapter]}
            # The first kind of the deck that this chapter has.
            kind = next((kind for kind in deck if kind in there), "")
            kind = kind or random_numbers.choice(sorted(there))
            file, change = _one([item for item in possible[chapter] if item[1].kind == kind],
                                random_numbers)
            possible[chapter].remove((file, change))
            source = (tree / file).read_bytes()
            mutant = mutant_of(file, source, change, len(drawn) + 1)
            if differs(source, mutant):
                drawn.append(mutant)
                if kind in deck:
                    deck.remove(kind)
            else:
                mutant = None
    return drawn


def draw_rules(tree: Path, count: int, seed: int, scope: Sequence[str]) -> list[Mutant]:
    """Draw rules of some folders and files, reproducibly, and one change of each.

    Every rule is equally likely.
    """
    random_numbers = random.Random(seed)
    places: dict[tuple[str, str, int], list[Change]] = {}
    for file in product_files(tree, scope):
        for change in rules((tree / file).read_bytes()):
            places.setdefault((file, change.function, change.start), []).append(change)
    drawn: list[Mutant] = []
    for place in random_numbers.sample(sorted(places), len(places)):
        change = random_numbers.choice(places[place])
        source = (tree / place[0]).read_bytes()
        mutant = mutant_of(place[0], source, change, len(drawn) + 1)
        if len(drawn) < count and differs(source, mutant):
            drawn.append(mutant)
    return drawn


def _one(possible: list[tuple[str, Change]], random_numbers: random.Random) -> tuple[str, Change]:
    """A random place, then a random change there."""
    places = sorted({(file, change.start) for file, change in possible})
    place = random_numbers.choice(places)
    return random_numbers.choice([item for item in possible if (item[0], item[1].start) == place])


def mutant_of(file: str, source: bytes, change: Change, number: int = 1) -> Mutant:
    """The mutant that a change of a file makes."""
    end = change.start + len(change.old.encode())
    changed = source[:change.start] + change.new.encode() + source[end:]
    return Mutant(number, file, source.count(b"\n", 0, change.start) + 1, change.function,
                  change.kind, _line(source, change.start, end),
                  _line(changed, change.start, change.start + len(change.new.encode())),
                  change.start, change.old, change.new)


def moved(mutant: Mutant, source: bytes) -> Mutant | None:
    """The mutant in a file that has changed elsewhere; nothing where its line is not there once."""
    end = mutant.start + len(mutant.old.encode())
    if (source[mutant.start:end] == mutant.old.encode()
            and _line(source, mutant.start, end) == mutant.before):
        return mutant
    same = [other for change in [*changes(source), *rules(source)]
            if (change.kind, change.function, change.old, change.new) == (
                mutant.kind, mutant.function, mutant.old, mutant.new)
            and (other := mutant_of(mutant.file, source, change, mutant.number)).before
            == mutant.before and other.after == mutant.after]
    return same[0] if len(same) == 1 else None


def _line(source: bytes, start: int, end: int) -> str:
    """The lines around a place as one."""
    first = source.rfind(b"\n", 0, start) + 1
    last = source.find(b"\n", end)
    return " ".join(source[first:last if last >= 0 else None].decode().split())


def differs(source: bytes, mutant: Mutant) -> bool:
    """Whether a mutant compiles, to another program than its source."""
    changed = mutant.apply(source)
    try:
        compile(changed, mutant.file, "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return False
    return ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))
