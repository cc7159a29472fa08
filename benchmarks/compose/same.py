"""Compare the answers that two versions gave to the same questions: 1 where a number moved.

    python -m benchmarks.compose.same BEFORE AFTER [--within 1e-9]

BEFORE and AFTER are folders of ``python -m benchmarks.compose``, run with the same films, questions
and seed in two checkouts. Every JSON and CSV file of an answer is compared, number by number and
word by word. Times are left out, and what the run itself names: folders, versions, dates.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

#: Largest relative difference of two numbers that count as the same.
_WITHIN = 1e-9
#: Numbers this small [SI] are rounding: a deflection of a symmetric film to one side, say.
_NOTHING = 1e-15
#: Keys and columns that differ from run to run.
_OF_THE_RUN = re.compile(r"wall|seconds|made_s|elapsed|created|version|revision|written|sha256")
#: Keys of shares of a variance, and a share that is none but for rounding.
_SHARE = re.compile(r"\.shares\.")
_NO_SHARE = 1e-11
#: Differences that are printed.
_MOST = 40


@dataclass(frozen=True)
class Difference:
    """A value that is another in the second folder; ``apart`` relative, infinite for words."""

    place: str
    before: object
    after: object
    apart: float


def values(file: Path) -> dict[str, object]:
    """Read the leaves of a JSON or CSV file by their place in it."""
    text = file.read_text(encoding="utf-8", errors="replace")
    if file.suffix == ".csv":
        rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
        return {f"{number}.{name}": _number(cell) for number, row in enumerate(rows)
                for name, cell in row.items() if name and not _OF_THE_RUN.search(name)}
    _, _, below_hash = text.partition("\n")  # a sweep's task begins with the hash of its line
    for content in (text, below_hash):
        try:
            return dict(_leaves(json.loads(content)))
        except ValueError:
            continue
    return {"text": text}  # of a question that was refused


def _leaves(content: object, place: str = "") -> Iterator[tuple[str, object]]:
    if isinstance(content, dict):
        for name, value in content.items():
            if not _OF_THE_RUN.search(name):
                yield from _leaves(value, f"{place}.{name}")
    elif isinstance(content, list):
        for number, value in enumerate(content):
            yield from _leaves(value, f"{place}.{number}")
    else:
        yield place, content


def _number(cell: str | None) -> object:
    try:
        return float(cell or "")
    except ValueError:
        return cell


def _apart(before: object, after: object, nothing: float) -> float:
    numbers = (int, float)
    if before == after:
        return 0.0
    if not isinstance(before, numbers) or not isinstance(after, numbers):
        return float("inf")
    if before != before and after != after:  # neither is a number
        return 0.0
    largest = max(abs(before), abs(after))
    return 0.0 if largest < nothing else abs(after - before) / largest


def _without_folders(value: object, *files: Path) -> object:
    if not isinstance(value, str):
        return value
    for file in files:
        value = value.replace(str(file.parents[2]), "")
    return value


def differences(before: Path, after: Path) -> Iterator[Difference]:
    """Compare all values of two files, those first that only one of them has."""
    told, now = values(before), values(after)
    for place in [*told, *(place for place in now if place not in told)]:
        old, new = told.get(place, "absent"), now.get(place, "absent")
        old_plain, new_plain = (_without_folders(value, before, after) for value in (old, new))
        nothing = _NO_SHARE if _SHARE.search(place) else _NOTHING
        if apart := _apart(old_plain, new_plain, nothing):
            yield Difference(place, old, new, apart)


def main() -> int:
    """Print counts and the largest differences."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compose.same",
                                     description="Compare the answers of two versions.")
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--within", type=float, default=_WITHIN)
    options = parser.parse_args()
    found: list[tuple[str, Difference]] = []
    compared = alike = 0
    names = [{str(file.relative_to(folder / "out")) for file in (folder / "out").rglob("*")
              if file.suffix in (".json", ".csv")}
             for folder in (options.before, options.after)]
    for name in sorted(names[0] & names[1]):
        before, after = options.before / "out" / name, options.after / "out" / name
        compared += len(values(before))
        moved = list(differences(before, after))
        alike += not moved
        found += [(name, each) for each in moved if each.apart > options.within]
    print(f"{len(names[0] & names[1])} files, {compared} values; {alike} files alike to the digit")
    for only, side in zip_longest((names[0] - names[1], names[1] - names[0]), ("before", "after")):
        for name in sorted(only):
            print(f"only {side}: {name}")
    found.sort(key=lambda each: -each[1].apart)
    for name, each in found[:_MOST]:
        print(f"{each.apart:.1e}  {name} {each.place}: {each.before} → {each.after}")
    if len(found) > _MOST:
        print(f"and {len(found) - _MOST} more")
    return int(bool(found) or names[0] != names[1])


if __name__ == "__main__":
    sys.exit(main())
