"""Hundreds of random specimens solved, checked and told in a table.

    python -m benchmarks.trials.robustness [--count 500] [--seed 1] [--workers 1] [-o
    docs/robustness.md]

Every case is solved in a process of its own with a limit on its time; an equilibrium's forces are
summed again (tests/oracles/balance.py), and a sample of all statuses is reached from another
direction (other_direction.py).
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import re
import resource
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from benchmarks.trials.other_direction import Verdict, along_heaves, oracle, voltage_first
from benchmarks.trials.random_specimens import Drawn, design
from tests.oracles.balance import Balance, balance
from tympan.base.errors import InputError
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.membrane.model import Model
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings, build_model, equilibrate

Result = TypeVar("Result")
Case = TypeVar("Case")
Kept = TypeVar("Kept", bound="Trial")

MESH = MeshSettings().refined(0.5)
SECONDS = 60.0  #: of processor time, the longest a search may take
#: Seconds on the clock, with the checks from other directions, after which a case counts as
#: hanging.
PATIENCE = 1800.0
#: Largest left-over force or moment over the largest nodal force; with gas, whose follower load is
#: summed by another quadrature here; and slope of the potential.
UNBALANCED, UNBALANCED_GAS, STEEP = 1e-7, 1e-4, 1e-7


@dataclass(frozen=True)
class Record:
    """What became of a case.

    ``status`` is the outcome's, or "refused" (by the mesher: input that is wrong), "raised" or
    "hung"; ``words`` its advice or the error. ``again``: solved on the default mesh, since on the
    coarse one something was wrong. ``kind``: of a limit. ``past``: what a search beyond the limit
    voltage took, meshing left out, over one that ends at 95 % of it.
    """

    number: int
    refused: int
    status: str
    words: str = ""
    seconds: float = 0.0
    gas: bool = False
    balance: Balance | None = None
    verdicts: tuple[Verdict, ...] = ()
    case: str = ""
    again: bool = False
    kind: str | None = None
    past: float | None = None

    @property
    def balanced(self) -> bool:
        """Whether a reported equilibrium is one."""
        limit = UNBALANCED_GAS if self.gas else UNBALANCED
        return self.balance is None or (self.balance.worst < limit and self.balance.slope < STEEP)

    @property
    def wrong(self) -> str:
        """What is wrong with this case; empty where nothing is."""
        differing = [f"{verdict.way}: {verdict.words}, error {verdict.error:.2g}"
                     for verdict in self.verdicts
                     if verdict.says == "differs"]
        faults = [self.status] * (self.status in ("raised",
                                                  "hung")) + ["unbalanced"] * (not self.balanced)
        faults += ["no advice"] * (self.status in ("no_equilibrium", "not_converged")
                                   and not self.words)
        return "; ".join([*faults, *differing])


def _kind(outcome: Outcome) -> str | None:
    """How a film ends that has no equilibrium; None where it has one, or no limit was found."""
    if outcome.limit is None:
        return None
    return "thinning" if outcome.thins else "pull_in"


def judged(drawn: Drawn, mesh: MeshSettings = MESH, sample: int = 1) -> Record:
    """A case solved and checked; every ``sample``-th from the other directions that cost as much as
    the search."""
    settings = Settings(mesh)
    meshing, _ = _timed(lambda: build_model(drawn.case.specimen, settings, drawn.case.rig.loading))
    search, (model, outcome) = _timed(lambda: equilibrate(drawn.case, settings))
    seconds = meshing + search
    record = Record(drawn.number, drawn.refused, outcome.status, outcome.advice, seconds,
                    drawn.case.rig.gas_pressure != 0, case=str(drawn), kind=_kind(outcome))
    if outcome.limited == "voltage" and outcome.limit is not None:
        share = 0.95 * outcome.limit**0.5 / drawn.case.film_voltage
        inner = replace(drawn.case, voltage=share * drawn.case.voltage)
        # Both on the same mesh, whose tables the first search has made.
        within, _ = _timed(lambda: equilibrate(inner, settings))
        beyond, _ = _timed(lambda: equilibrate(drawn.case, settings))
        record = replace(record, past=beyond / within)
    if outcome.status == "equilibrium":
        record = replace(record, balance=balance(model, outcome.state))
    record = replace(record, verdicts=tuple(_verdicts(model, drawn, outcome, sample)))
    finer = MeshSettings()
    return replace(judged(drawn, finer, sample),
                   again=True) if record.wrong and mesh != finer else record


def _timed(work: Callable[[], Result]) -> tuple[float, Result]:
    """Processor time, and what came of it."""
    began = time.process_time()
    result = work()
    return time.process_time() - began, result


def _verdicts(model: Model, drawn: Drawn, outcome: Outcome, sample: int) -> Iterator[Verdict]:
    if outcome.status == "not_converged":
        return
    if drawn.plain:
        yield oracle(model, drawn, outcome)
    if drawn.number % sample == 0:
        yield voltage_first(model, drawn, outcome)
        if outcome.status == "no_equilibrium":
            yield along_heaves(model, drawn, outcome)


class Trial(Protocol):
    """What became of one of many: its number, status in a word, why, and what is wrong, if so."""

    number: int
    status: str
    words: str
    seconds: float
    case: str

    @property
    def wrong(self) -> str: ...


@dataclass(frozen=True)
class Judge(Generic[Case, Kept]):
    """How one of many is judged, and what is kept of one that has no record of its own.

    That is "refused" for wrong input, "raised" or "hung". Both functions are found by name in
    another process.
    """

    judged: Callable[[Case], Kept]
    failed: Callable[[Case, str, str], Kept]

    def __call__(self, case: Case) -> Kept:
        """The record, whatever happens."""
        try:
            return self.judged(case)
        except InputError as error:
            return self.failed(case, "refused", str(error))
        except Exception as error:
            return self.failed(case, "raised", f"{error!r} {traceback.format_exc()[-800:]}")


def _failed(drawn: Drawn, status: str, words: str) -> Record:
    return Record(drawn.number, drawn.refused, status, words, case=str(drawn))


def _serve(pipe: Connection, judge: Judge[Case, Kept]) -> None:
    while True:
        pipe.send(judge(pipe.recv()))


class Worker(Generic[Case, Kept]):
    """A process that judges cases, started again where a case has hung."""

    def __init__(self, judge: Judge[Case, Kept]) -> None:
        self._judge = judge
        self._start()

    def judge(self, case: Case) -> Kept:
        """The case's record, also where it raises, hangs or kills its process."""
        self.pipe.send(case)
        words = f"no answer within {PATIENCE:g} s"
        try:
            if self.pipe.poll(PATIENCE):
                return self.pipe.recv()
        except EOFError:
            words = "the process died"
        self.stop()
        self._start()
        return self._judge.failed(case, "hung", words)

    def stop(self) -> None:
        """End the process."""
        self.process.terminate()
        self.process.join()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other, self._judge), daemon=True)
        self.process.start()
        other.close()


def study(count: int, seed: int, sample: int, workers: int,
          keep: Callable[[list[Record]], None] = lambda records: None) -> list[Record]:
    """All cases judged, progress on standard error; ``keep`` gets what is done after every 25."""
    judge = Judge(partial(judged, sample=sample), _failed)
    return judged_by(judge, design(count, seed), workers, keep)


def judged_by(judge: Judge[Case, Kept], cases: Iterable[Case], workers: int,
              keep: Callable[[list[Kept]], None] = lambda records: None, every: int = 25
              ) -> list[Kept]:
    """Cases judged in processes of their own; what is done is kept after ``every`` so many."""
    free = [Worker(judge) for _ in range(workers)]
    done: list[Kept] = []

    def judge_one(case: Case) -> Kept:
        worker = free.pop()
        record = worker.judge(case)
        free.append(worker)
        print(f"{record.number:4d} {record.status:14s} {record.seconds:6.1f} s  {record.wrong}",
              file=sys.stderr)
        if record.wrong or record.status == "not_converged":
            print(f"     {record.words} | {record.case}", file=sys.stderr, flush=True)
        done.append(record)
        if len(done) % every == 0:
            keep(sorted(done, key=lambda entry: entry.number))
        return record

    with ThreadPoolExecutor(workers) as pool:
        records = list(pool.map(judge_one, cases))
    for worker in free:
        worker.stop()
    return records


def judged_once(judge: Judge[Any, Kept], cases: Iterable[Any], workers: int, file: Path | None,
                read: Callable[[dict[str, Any]], Kept]) -> list[Kept]:
    """Cases judged, but for those that a file has records of, a JSON line each; it grows by each.

    Without a file all are judged; ``read`` makes a record of a line's entries.
    """
    every = {case.number: case for case in cases}
    lines = file.read_text(encoding="utf-8").splitlines() if file and file.exists() else []
    done = {record.number: record for record in map(read, map(json.loads, lines))}

    def keep(records: list[Kept]) -> None:
        if file is not None:
            text = "".join(f"{json.dumps(asdict(record))}\n" for record in
                           (*done.values(), *records))
            file.write_text(text, encoding="utf-8")

    fresh = judged_by(judge, [case for number, case in every.items() if number not in done],
                      workers, keep, every=1)
    asked = [record for record in done.values() if record.number in every]
    return sorted((*asked, *fresh), key=lambda record: record.number)


def table(records: Sequence[Record]) -> str:
    """The study in lines."""
    counts = Counter(record.status for record in records)
    lines = [f"{len(records)} specimens; {sum(record.refused for record in records)} "
             "draws before them refused as inadmissible", ""]
    lines += [f"{status:36}{counts[status]:6d}" for status in
              ("equilibrium", "no_equilibrium", "not_converged", "refused", "raised", "hung")]
    equilibria = [record for record in records if record.balance is not None]
    lines += ["", "reported equilibria"]
    for name, gas in (("without gas", False), ("with gas pressure", True)):
        group = [record for record in equilibria if record.gas == gas]
        if group:
            lines += [f"  {name}: largest unbalanced nodal force "
                      f"{max(r.balance.nodes for r in group):.1e}, "
                      f"plate force {max(r.balance.force for r in group):.1e}, moment "
                      f"{max(r.balance.moment for r in group):.1e}, slope of the potential "
                      f"{max(r.balance.slope for r in group):.1e}"]
    lines += [f"  unbalanced: {sum(not r.balanced for r in equilibria)}",
              f"  plate unstable in a motion the mirrored part cannot make: "
              f"{sum(not r.balance.plate_stable for r in equilibria)}",
              "  film pressed, with negative eigenvalues of its own: "
              f"{sum(r.balance.film_modes > 0 for r in equilibria)}"]
    kinds = Counter(record.kind for record in records)
    lines += ["", f"of those without equilibrium {kinds['pull_in']} pull in, "
              f"{kinds['thinning']} lose tension and thin without bound"]
    lines += ["",
              f"solved again on the default mesh, since on the coarse one a direction differed: "
              f"{sum(record.again for record in records)}"]
    lines += ["", f"{'from another direction':36}agrees differs silent  largest error"]
    lines += _directions(records)
    times = sorted(record.seconds for record in records)
    slowest = max(records, key=lambda record: record.seconds)
    lines += ["", f"processor time of a search: median {times[len(times) // 2]:.2f} s, 95 % below "
              f"{times[int(0.95 * len(times))]:.1f} s, "
              f"slowest {slowest.seconds:.1f} s (#{slowest.number})"]
    past = sorted(record.past for record in records if record.past is not None)
    if past:
        lines += ["of one beyond the limit voltage, over one to 95 % of it: median "
                  f"{past[len(past) // 2]:.1f}, 95 % below {past[int(0.95 * len(past))]:.0f}"]
    lines += [f"above {SECONDS:g} s: {sum(seconds > SECONDS for seconds in times)}", "",
              "why not converged"]
    reasons = Counter(record.words for record in records if record.status == "not_converged")
    lines += [f"{number:5d}  {words}" for words, number in reasons.most_common()] or ["  none"]
    lines += ["", "differing, unbalanced, raised or hung"]
    lines += [f"  #{record.number} {record.status}: {record.wrong}" for record in records
              if record.wrong] or ["  none"]
    return "\n".join(lines)


def _directions(records: Sequence[Record]) -> Iterator[str]:
    ways = {verdict.way: None for record in records for verdict in record.verdicts}
    for way in ways:
        for status in ("equilibrium", "no_equilibrium"):
            heard = [verdict for record in records if record.status == status
                     for verdict in record.verdicts
                     if verdict.way == way]
            says = Counter(verdict.says for verdict in heard)
            if heard:
                error = max((verdict.error for verdict in heard if verdict.says == "agrees"),
                            default=0.0)
                yield (f"  {way + ', ' + status:34}{says['agrees']:6d} {says['differs']:7d} "
                       f"{says['silent']:6d}  {error:.1e}")


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description="Solve and check random specimens.")
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sample", type=int, default=8,
                        help="every how manieth case to reach from another direction")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="Markdown file to put the table in")
    options = parser.parse_args()
    head = f"seed {options.seed}, every {options.sample}th case from other directions, mesh {MESH}"

    def keep(records: list[Record]) -> None:
        if options.output:
            early = (f"\nstopped early: {len(records)} of {options.count}"
                     if len(records) < options.count else "")
            text = f"{PAGE}\n```\n{head}{early}\n{table(records)}\n```\n"
            write_section(options.output, text)

    records = study(options.count, options.seed, options.sample, options.workers, keep)
    keep(records)
    print(table(records))
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"\npeak memory of a process {peak:.0f} MiB")


def run_study(words: str, count: int, study: Callable[[int, int, int, Path | None], list[Kept]],
              table: Callable[[list[Kept]], str], mesh: MeshSettings, page: str) -> list[Kept]:
    """A study of films by the options of its command, its table printed and put in a page."""
    parser = argparse.ArgumentParser(description=words)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="file of records, to go on from")
    parser.add_argument("-o", "--output", type=Path, help="Markdown file to put the table in")
    options = parser.parse_args()
    records = study(options.count, options.seed, options.workers, options.keep)
    text = f"seed {options.seed}, mesh {mesh}\n{table(records)}"
    if options.output:
        write_section(options.output, f"{page}\n```\n{text}\n```\n")
    print(text)
    return records


def write_section(page: Path, text: str) -> None:
    """Put a text that begins with its heading into a page, in place of what is below such a one.

    The study's is the page's first, that of the extreme films its second.
    """
    heading = text.partition("\n")[0]
    old = page.read_text(encoding="utf-8") if page.exists() else ""
    sections = re.split(r"^(?=#{1,2} )", old, flags=re.MULTILINE)
    others = [section for section in sections if section and section.partition("\n")[0] != heading]
    at = 0 if heading.startswith("# ") else len(others)
    others.insert(at, text.rstrip() + "\n")
    page.write_text("\n".join(part.rstrip() + "\n" for part in others), encoding="utf-8")


PAGE = """# Robustness on random specimens

Does every random specimen get a correct answer? This is what `make robustness` printed in one run.

What varies at random:

* frames and plates are circles and ellipses (aspect up to 3), plates off centre up to nearly
  touching the frame;
* prestretches 1.5 to 4, equal and unequal;
* every registered law and every library film, permittivity exponents;
* electrode margins, outlines and stiffness, film mass;
* springs, guides, weight offsets, gas pressure and magnets;
* masses to 100 g, voltages to 1.3 times that at which the flat film loses tension.

A quarter are annuli that the axisymmetric equations cover.

Words of the printed table:

* unbalanced: forces and moments are summed again on the whole film, by code that shares nothing
  with the solver's. They are relative to the largest nodal force;
* deflection by deflection: the load that keeps the plate at given deflections. Its maximum is
  compared with the reported limit;
* silent: that direction could not be followed, or has no answer.

A film that loses tension wrinkles. From there its energy is the relaxed one of tension-field
theory. Under voltage a wrinkled film may have no stable width, or lose it as the wrinkles grow. It
then thins without bound, and that is its limit.
"""

if __name__ == "__main__":
    main()
