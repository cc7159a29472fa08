"""The map of a suite: which blocks of the product each test runs, and how long it takes."""

from __future__ import annotations

import hashlib
import json
import marshal
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.trials.mutants.blocks import Block, block_at, instrument
from benchmarks.trials.mutants.mutant import Mutant, chapter_of
from benchmarks.trials.mutants.source import PRODUCT, product_files
from benchmarks.trials.mutants.tree import environment, pytest_command

#: Why a test may notice a mutant, the surest first.
REASONS = ("runs the block", "shares a fixture, a file or a kept result with one that does",
           "runs the file of code that runs at import", "runs the chapter of such code",
           "was named beforehand")
#: Number of the reason of a test that the user named, and the map does not.
NAMED = 4
#: Processor time of a test that a map does not have [s]: a dear one is above it.
_UNKNOWN = 30.0
#: A context that so large a share of all tests uses tells nothing about who shares with whom.
_COMMON = 0.2


def digest(source: bytes) -> str:
    """Short name of a file's content."""
    return hashlib.sha256(source).hexdigest()[:16]


def prepare(tree: Path, folder: Path, product: Sequence[str] = PRODUCT) -> None:
    """Write the product's code with its recording lines into a folder, once.

    Raises
    ------
    ValueError
        When the folder is that of another state of the product.
    """
    files = {file: (tree / file).read_bytes() for file in product_files(tree, product)}
    digests = {file: digest(source) for file, source in files.items()}
    known = folder / "files.json"
    if known.exists():
        if json.loads(known.read_text(encoding="utf-8"))["digests"] != digests:
            raise ValueError(f"{folder}: the product has changed since this map was begun; "
                             "name a new folder")
        return
    for name in ("codes", "traces"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    blocks: dict[str, list[list[int]]] = {}
    count = 0
    for number, (file, source) in enumerate(files.items()):
        name = file if file.startswith("tympan/") or "tympan" not in product else f"tympan/{file}"
        code, found = instrument(source, str(tree.resolve() / name), count)
        (folder / "codes" / str(number)).write_bytes(marshal.dumps(code))
        blocks[file] = [[block.start, block.end] for block in found]
        count += len(found)
    codes = {str((tree / file).resolve()): number for number, file in enumerate(files)}
    (folder / "index.json").write_text(json.dumps(
        {"tops": list(product), "codes": codes, "blocks": count}), encoding="utf-8")
    known.write_text(json.dumps({"digests": digests, "blocks": blocks}), encoding="utf-8")


def record(tree: Path, folder: Path, options: Sequence[str],
           product: Sequence[str] = PRODUCT) -> int:
    """Run pytest with its options and add what it did to a map; the status of pytest."""
    folder = folder.resolve()
    prepare(tree, folder, product)
    status = subprocess.run(
        pytest_command(*options), cwd=tree, check=False,
        env=environment(tree.resolve(), TYMPAN_MUTANTS_MAP=str(folder),
                        TYMPAN_MUTANTS_LOG=str(folder / "log"))).returncode
    gather(folder)
    return status


def gather(folder: Path) -> None:
    """Make the map of what was recorded so far: ``tests.json`` and ``runs.npz``."""
    blocks = json.loads((folder / "index.json").read_text(encoding="utf-8"))["blocks"]
    runs: dict[str, np.ndarray[Any, Any]] = {}
    for file in (folder / "traces").glob("*.trace"):
        _add_trace(runs, file.read_text(encoding="utf-8"), blocks)
    contexts: dict[str, dict[str, Any]] = {}
    for file in sorted(folder.glob("log-*"), key=lambda file: file.stat().st_mtime):
        if file.is_file() and file.suffix != ".current":
            for line in file.read_text(encoding="utf-8").splitlines():
                entry = json.loads(line)
                if "context" in entry:
                    _merge(contexts, entry)
    names = list(dict.fromkeys([*contexts, *runs]))
    bits = np.array([np.packbits(runs[name]) if name in runs
                     else np.zeros(-(-blocks // 8), np.uint8) for name in names])
    np.savez_compressed(folder / "runs.npz", bits=bits)
    (folder / "tests.json").write_text(json.dumps({"names": names, "contexts": contexts}),
                                       encoding="utf-8")


def _add_trace(runs: dict[str, np.ndarray[Any, Any]], text: str, blocks: int) -> None:
    for part in text.split("=")[1:] if "\n=" not in text else ("\n" + text).split("\n=")[1:]:
        name, _, numbers = part.partition("\n")
        ran = runs.setdefault(name, np.zeros(blocks, bool))
        if numbers:
            ran[np.array(numbers.split(), int)] = True


def _merge(contexts: dict[str, dict[str, Any]], entry: dict[str, Any]) -> None:
    """Add an entry of a context, which may have gone on in several tests."""
    name = entry.pop("context")
    there = contexts.setdefault(name, {"seconds": 0.0, "runs": 0, "uses": []})
    there.update(entry, uses=sorted({*there["uses"], *entry["uses"]}),
                 seconds=there["seconds"] + entry["seconds"], runs=there["runs"] + entry["runs"])


@dataclass(frozen=True)
class Candidate:
    """A test that may notice a mutant: why (a number of ``REASONS``) and its seconds."""

    test: str
    reason: int
    seconds: float


@dataclass(frozen=True)
class SuiteMap:
    """What each test runs.

    ``contexts`` has the tests and what they share, ``bits`` a row of packed blocks for each of
    ``names``.
    """

    names: tuple[str, ...]
    contexts: dict[str, dict[str, Any]]
    bits: np.ndarray[Any, Any] = field(repr=False)
    blocks: dict[str, list[Block]] = field(repr=False)
    digests: dict[str, str] = field(repr=False)

    @classmethod
    def read(cls, folder: Path) -> SuiteMap:
        """Read the map of a folder."""
        tests = json.loads((folder / "tests.json").read_text(encoding="utf-8"))
        files = json.loads((folder / "files.json").read_text(encoding="utf-8"))
        with np.load(folder / "runs.npz") as stored:
            bits = stored["bits"]
        return cls(tuple(tests["names"]), tests["contexts"], bits,
                   {file: [Block(*block) for block in blocks]
                    for file, blocks in files["blocks"].items()}, files["digests"])

    @classmethod
    def empty(cls) -> SuiteMap:
        """A map without tests, for mutants whose tests are named."""
        return cls((), {}, np.zeros((0, 0), np.uint8), {}, {})

    @cached_property
    def tests(self) -> list[str]:
        """Every test, also one that failed while it was recorded: the judge looks again."""
        return [name for name, context in self.contexts.items() if "fixtures" in context]

    @cached_property
    def shared(self) -> dict[str, frozenset[str]]:
        """Contexts that each test shares with others: fixtures, and functions that keep results."""
        fixtures: dict[str, list[str]] = {}
        for name in self.contexts:
            if name.startswith("fixture "):
                fixtures.setdefault(name.rpartition("::")[2], []).append(name)
        return {test: self._closure(
            [fixture for argument in self.contexts[test]["fixtures"]
             for fixture in fixtures.get(argument, ())
             if test.startswith(fixture.removeprefix("fixture ").rpartition("::")[0])]
            + self.contexts[test]["uses"]) for test in self.tests}

    def _closure(self, names: Iterable[str]) -> frozenset[str]:
        """Contexts and all that they use."""
        found: set[str] = set()
        left = list(names)
        while left:
            name = left.pop()
            if name not in found and name in self.contexts:
                found.add(name)
                left += self.contexts[name]["uses"]
        return frozenset(found)

    @cached_property
    def _first(self) -> dict[str, int]:
        """Number of each file's first block."""
        first, count = {}, 0
        for file, blocks in self.blocks.items():
            first[file], count = count, count + len(blocks)
        return first

    def _mean(self, names: Iterable[str]) -> float:
        """Processor time of contexts, each run once [s]."""
        return float(sum(self.contexts[name]["seconds"] / self.contexts[name]["runs"]
                         for name in names if name in self.contexts))

    def seconds(self, test: str) -> float:
        """Processor time of a test by itself, with what it shares [s]."""
        if test not in self.contexts:
            return _UNKNOWN
        return self._mean([test, *self.shared.get(test, ())])

    def total(self, tests: Iterable[str]) -> float:
        """Processor time of tests in one process, where what they share is made once [s]."""
        tests = list(tests)
        together = frozenset[str]().union(*(self.shared.get(test, ()) for test in tests))
        return self._mean([*tests, *together])

    def _ran(self, numbers: Iterable[int]) -> set[str]:
        """Contexts that ran one of these blocks."""
        ran = np.zeros(len(self.names), bool)
        for number in numbers:
            ran |= (self.bits[:, number // 8] >> (7 - number % 8)) & 1 != 0
        return {name for name, yes in zip(self.names, ran, strict=True) if yes}

    def _tests(self, contexts: set[str]) -> set[str]:
        """Tests that are, or use, one of these contexts."""
        return {test for test in self.tests if test in contexts or self.shared[test] & contexts}

    def _numbers(self, file: str) -> range:
        return range(self._first[file], self._first[file] + len(self.blocks[file]))

    def candidates(self, mutant: Mutant) -> list[Candidate]:
        """Tests that may notice a mutant, those of the surest reason first, then the cheapest.

        Code of a block that ran while tests were collected may matter to every test that imports
        it, as does a field's default. An empty map has none.
        """
        if not self.blocks:
            return []
        block = block_at(self.blocks[mutant.file], mutant.start)
        contexts = set() if block is None else self._ran([self._first[mutant.file] + block])
        groups = [self._tests(contexts - {""})]
        groups.append(self._beside(groups[0]))
        if block is None or "" in contexts:
            groups.append(self._tests(self._ran(self._numbers(mutant.file)) - {""}))
            groups.append(self._tests(self._ran(
                number for file in self.blocks if chapter_of(file) == mutant.chapter
                for number in self._numbers(file)) - {""}))
        found: dict[str, Candidate] = {}
        for reason, tests in enumerate(groups):
            for test in sorted(tests, key=lambda test: (self.seconds(test), test)):
                found.setdefault(test, Candidate(test, reason, self.seconds(test)))
        return list(found.values())

    def _beside(self, tests: set[str]) -> set[str]:
        """Tests of the same files, and those that use the same things."""
        files = {test.partition("::")[0] for test in tests}
        things = frozenset[str]().union(*(self.shared[test] for test in tests))
        things -= self._common
        return {test for test in self.tests
                if test.partition("::")[0] in files or self.shared[test] & things}

    @cached_property
    def _common(self) -> frozenset[str]:
        """Contexts that so many tests use that they tell nothing."""
        counts: dict[str, int] = {}
        for names in self.shared.values():
            for name in names:
                counts[name] = counts.get(name, 0) + 1
        return frozenset(name for name, count in counts.items()
                         if count > _COMMON * len(self.tests) + 1)


def said(status: int, folder: Path) -> str:
    """Summary of a map in a sentence."""
    suite = SuiteMap.read(folder)
    failed = [name for name, context in suite.contexts.items() if context.get("failed")]
    seconds = sum(context["seconds"] for context in suite.contexts.values())
    return (f"{len(suite.tests)} tests, {seconds:.0f} s of processor time, "
            f"{sum(map(len, suite.blocks.values()))} blocks; status of pytest {status}"
            + "".join(f"\nfailed while it was recorded: {name}" for name in failed))


