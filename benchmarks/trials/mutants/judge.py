"""Judge mutants: run the tests that may notice each, until one does."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from benchmarks.trials.mutants.draw import moved
from benchmarks.trials.mutants.mutant import Key, Mutant
from benchmarks.trials.mutants.suite_map import NAMED, REASONS, Candidate, SuiteMap, digest
from benchmarks.trials.mutants.tree import STOP, End, collected, copy_tree, run_tests

#: Expected time of the first batch of tests, some starts of pytest; each next one is as long again
#: as all before [s].
_BATCH = 10.0
#: A change of a file's time, so that no compiled code of another state of it is taken for this [s].
_LATER = 1000.0
#: Ends of a mutant.
GOT_AWAY, CAUGHT, ABSENT = "got away", "caught", "not in this tree"
#: Not judged by tests: a person has found that it does what the program does, and says why.
EQUIVALENT = "equivalent"
#: No named tests.
EMPTY: Mapping[Key, Sequence[str]] = {}
#: Said of a mutant of which no test can tell anything.
UNSOUND = "the tests that run it fail without it, too"
#: Stands for a test where the mutant lets none be collected.
IMPORT = "the import of its file"


@dataclass(frozen=True)
class Record:
    """How a mutant ended in a suite.

    ``suite`` is a name that the user gave. ``end`` is "caught", "got away", "equivalent", or "not
    in this tree" where the place to be changed is missing; ``why`` says how.
    ``by`` is the test that failed or hung. Of ``candidates`` that may notice it ``ran`` were run,
    in so many ``seconds`` of processor time.
    """

    suite: str
    mutant: Key
    end: str
    why: str
    by: str
    ran: int
    candidates: int
    seconds: float

    @classmethod
    def of_json(cls, content: dict[str, Any]) -> Record:
        """Read one."""
        file, start, old, new = content["mutant"]
        return cls(**(content | {"mutant": (file, start, old, new)}))


def read_records(file: Path) -> list[Record]:
    """Read the records of a file, none where it is not there; a line that was cut off is removed.
    """
    if not file.exists():
        return []
    whole, _, cut = file.read_text(encoding="utf-8").rpartition("\n")
    if cut:
        file.write_text(whole + "\n" if whole else "", encoding="utf-8")
    return [Record.of_json(json.loads(line)) for line in whole.splitlines()]


def keep_record(file: Path, record: Record) -> None:
    """Add a record to a file, in place of an earlier one of the same mutant and suite."""
    records = read_records(file)
    others = [one for one in records if (one.suite, one.mutant) != (record.suite, record.mutant)]
    lines = "".join(json.dumps(asdict(one)) + "\n" for one in [*others, record])
    written = file.with_name(f"{file.name}.new")
    written.write_text(lines, encoding="utf-8")
    written.replace(file)


def batches(candidates: Sequence[Candidate], total: Callable[[Iterable[str]], float],
            limit: float) -> Iterator[list[str]]:
    """Tests in batches of growing expected time, until all together reach a limit [s]."""
    batch: list[str] = []
    size, spent = _BATCH, 0.0
    for candidate in candidates:
        if candidate.seconds > limit - spent:
            continue
        together = total([*batch, candidate.test])
        if batch and together > min(size, limit - spent):
            yield batch
            spent += total(batch)
            size, batch = 2 * size, []
            if candidate.seconds > limit - spent:
                continue
        batch.append(candidate.test)
    if batch:
        yield batch


class Copy:
    """A copy of the tree in which mutants live, one at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextmanager
    def mutated(self, mutant: Mutant) -> Iterator[None]:
        """Have a mutant in the copy; what was compiled before is not taken for it."""
        file = self.folder / mutant.file
        source, times = file.read_bytes(), file.stat()
        file.write_bytes(mutant.apply(source))
        os.utime(file, (times.st_atime, times.st_mtime + _LATER))
        try:
            yield
        finally:
            file.write_bytes(source)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))


@dataclass(frozen=True)
class Judge:
    """Judge of mutants by the tests of a suite that may notice them.

    ``tests`` are those that count, ``limit`` is the processor time for a mutant [s]. ``unsound``
    remembers tests that fail without a mutant. ``named`` tests of a mutant are run before those of
    the map.
    """

    suite: str
    suite_map: SuiteMap
    tests: frozenset[str]
    limit: float
    unsound: set[str]
    named: Mapping[Key, Sequence[str]]

    def _candidates(self, mutant: Mutant) -> list[Candidate]:
        """Tests that may notice a mutant, in the order in which they are run."""
        mapped = {candidate.test: candidate for candidate in self.suite_map.candidates(mutant)}
        named = {test: mapped.get(test) or Candidate(test, NAMED, self.suite_map.seconds(test))
                 for test in self.named.get(mutant.key, ())}
        return [candidate for candidate in (named | mapped).values()
                if candidate.test in self.tests]

    def record(self, mutant: Mutant, copy: Copy) -> Record:
        """Judge one mutant in a copy of the tree."""
        candidates = self._candidates(mutant)
        reasons = {candidate.test: REASONS[candidate.reason] for candidate in candidates}
        ran, spent, by, why = 0, 0.0, "", ""
        left = candidates
        while left and not why:
            batch = next(batches(left, self.suite_map.total, self.limit - spent), None)
            if batch is None:
                break
            with copy.mutated(mutant):
                end = run_tests(copy.folder, batch, self.suite_map.seconds)
            spent += end.seconds
            if not end.status:
                done = set(batch)
                ran += len(batch)
            elif self._sound(end, batch, copy):
                done = set()
                ran += len(end.ran)
                by = end.test or IMPORT
                why = f"{'hung' if end.hung else 'failed'}, {reasons.get(by, 'not collected')}"
            elif end.test:
                # It fails without a mutant too: those behind have their turn.
                done = {*end.ran}
                ran += len(end.ran) - 1
            else:
                raise ValueError(f"pytest ends with status {end.status} without a mutant too; "
                                 f"make the map again: {end.said}")
            left = [candidate for candidate in left if candidate.test not in done]
        if not why:
            sound = [candidate for candidate in candidates
                     if candidate.test not in self.unsound]
            why = (_escape(sound, {candidate.test for candidate in left}, self.limit)
                   if sound or not candidates else UNSOUND)
        return Record(self.suite, mutant.key, CAUGHT if by else GOT_AWAY, why, by, ran,
                      len(candidates), round(spent, 1))

    def _sound(self, end: End, batch: Sequence[str], copy: Copy) -> bool:
        """Whether the same tests, up to the one that failed, pass without a mutant."""
        if end.test in self.unsound:
            return False
        sound = not run_tests(copy.folder, end.ran or batch[:1],
                              self.suite_map.seconds).status
        if not sound and end.test:
            self.unsound.add(end.test)
        return sound


def _escape(candidates: Sequence[Candidate], left: set[str], limit: float) -> str:
    """How a mutant got away; tests that run its block are counted apart."""
    if not candidates:
        return "no test runs it"
    if all(candidate.reason == NAMED for candidate in candidates):
        return "the tests passed that were named"
    direct = [candidate.test for candidate in candidates if not candidate.reason]
    passed = sum(test not in left for test in direct)
    ended = f"not caught within {limit:.0f} s" if left else "all candidates passed"
    return f"{ended}; {passed} of {len(direct)} tests that run the block passed"


def suite_tests(tree: Path, scratch: Path, left_out: bool, options: Sequence[str] = ()
                ) -> frozenset[str]:
    """Tests that count: those pytest runs by itself, or only those its markers leave out."""
    usual = frozenset(collected(tree, scratch, *options))
    return frozenset(collected(tree, scratch, "-m", "", *options)) - usual if left_out else usual


def judge(mutants: Sequence[Mutant], tree: Path, suite_map: SuiteMap, keep: Path, *, suite: str,
          left_out: bool = False, limit: float = 600.0, workers: int = 1,
          options: Sequence[str] = (), named: Mapping[Key, Sequence[str]] = EMPTY,
          again: bool = False) -> Iterator[Record]:
    """Judge mutants that have no record of this suite yet; each record is kept at once.

    ``options`` of pytest say which tests count. ``named`` tests of a mutant are run first. With
    ``again`` mutants with a record are judged too: their new record takes the old one's place.

    Raises
    ------
    ValueError
        When a mutant's file is not that of the map, or the tests cannot be collected, or a test
        that was named is not among those that count.
    """
    known = {record.mutant for record in read_records(keep)
             if record.suite == suite and not again}
    missing = [mutant for mutant in mutants if mutant.key not in known]
    placed: dict[Key, Mutant] = {}
    for mutant in missing:
        file = tree / mutant.file
        source = file.read_bytes() if file.exists() else b""
        there = moved(mutant, source)
        if there is None:
            record = Record(suite, mutant.key, ABSENT, "", "", 0, 0, 0.0)
            keep_record(keep, record)
            yield record
        elif suite_map.digests.get(mutant.file, digest(source)) != digest(source):
            raise ValueError(f"{mutant.file} is not the file of the map; make the map again")
        else:
            placed[mutant.key] = there
    if not placed:
        return
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        scratch = Path(name)
        # The first collection in the copy compiles it; nothing is compiled for keeps later.
        copy_tree(tree, scratch / "0")
        tests = suite_tests(scratch / "0", scratch, left_out, options)
        gone = {test for mutant in missing for test in named.get(mutant.key, ())} - tests
        if gone:
            raise ValueError(f"not among the tests that count: {', '.join(sorted(gone))}")
        # A mutant that has moved has another key than that it was drawn with.
        judging = Judge(suite, suite_map, tests, limit, set(),
                        {placed[key].key: tests for key, tests in named.items() if key in placed})
        copies: SimpleQueue[Copy] = SimpleQueue()
        for number in range(workers):
            if number:
                shutil.copytree(scratch / "0", scratch / str(number), symlinks=True)
            copies.put(Copy(scratch / str(number)))

        def one(mutant: Mutant) -> Record:
            copy = copies.get()
            try:
                return replace(judging.record(placed[mutant.key], copy), mutant=mutant.key)
            finally:
                copies.put(copy)

        with ThreadPoolExecutor(workers) as pool:
            waiting = [pool.submit(one, mutant) for mutant in missing
                       if mutant.key in placed]
            try:
                for future in as_completed(waiting):
                    keep_record(keep, future.result())
                    yield future.result()
            except BaseException:
                STOP.set()
                pool.shutdown(cancel_futures=True)
                STOP.clear()
                raise
