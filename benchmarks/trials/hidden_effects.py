"""Effects hidden in hundreds of sets of readings, and how often they are found.

    python -m benchmarks.trials.hidden_effects [--scale 1] [--seed 2026] [--workers 2] [--keep FILE]
    [--minutes M] [--only POPULATION ...] [--strata NAME=COUNT,...] [--whole] [--against FILE]
    [-o docs/hidden-effects.md]

Trials that FILE has already are not run again, so that a study may be stopped and taken up. Each
line of FILE has the commit of the program that made it. Trials of all kinds are mixed, so that one
that is stopped after some minutes has its share of each. With 0 minutes only the pages are written:
those published are of hidden-trials.jsonl in this folder. With --only, trials of these populations
alone are run; with --strata those with more evidence than readings at rest, of these kinds, so many
of each. Their page and that of messy benches are beside the other one, and each is written only if
some of its trials were run; with --whole only if all were.

With --against the verdicts are compared with those of the same trials in a file that another
version made: those that differ are printed, and how many are the same.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from math import inf
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.trials.rates.kinds import BENCH, bench_rates, rates
from benchmarks.trials.rates.page import bench_page, draw_power, page
from benchmarks.trials.rates.sizes import draw_maps, draw_sizes
from benchmarks.trials.rates.strata import strata_page, strata_rates
from benchmarks.trials.record import Record
from benchmarks.trials.strata.trials import SMOOTH, STRATA, population_of
from benchmarks.trials.trial import ALIAS_PAIRS, MAP_WIDTHS, Lab
from tympan.progress import bar

#: Trials drawn of each population; what of them is identifiable follows from the draw.
COUNTS = {"null": 200, "single": 160, "strong": 240, "pair": 120, "duo": 160, "outside": 200,
          "alias": 60, "noise": 60, "form": 30, "gain": 60, "large": 280, "large pair": 50,
          "map": len(ALIAS_PAIRS) * len(MAP_WIDTHS) ** 2, "random": 300,
          "frequencies": 60, "lines": 40, "transients": 40, "mixture": 20, "coupons": 60,
          "film": 24, "rough": 80, "rough transients": 48, "mess": 300,
          "strangers": 160, "force": 60}

#: Trials of which the published pages are.
PUBLISHED = Path(__file__).with_name("hidden-trials.jsonl")

_labs: list[Lab] = []


def _start(lab: Lab) -> None:
    _labs.append(lab)


def _run(trial: tuple[str, int]) -> tuple[str, int, list[Record]]:
    try:
        return (*trial, _labs[0].run(*trial))
    except Exception as error:  # one that fails is counted, and must not end the others
        words = f"{type(error).__name__}: {error}"
        return (*trial, [Record(*trial, "", (), 0, 0.0, 0.0, "raised", words=words)])


def lab_of(seed: int, workers: int, populations: Iterable[str] = COUNTS) -> Lab:
    """The designs, with their force laws, the dearest part, where some populations need them."""
    lab = Lab(seed, workers)
    if set(populations) - set(STRATA):
        for bench in (lab.loops, lab.circles):
            assert bench
    return lab


def order(counts: dict[str, int]) -> Iterator[tuple[str, int]]:
    """All trials, those of all populations mixed, so that a study stopped early has some of each.
    """
    every = [((number + 0.5) / count, name, number) for name, count in counts.items()
             for number in range(count)]
    return ((name, number) for _, name, number in sorted(every))


def study(lab: Lab, counts: dict[str, int], workers: int, keep: Path | None = None,
          minutes: float = inf
          ) -> list[Record]:
    """All trials run, or read from where they were kept; those still to be begun after some minutes
    left out."""
    records, done = kept(keep)
    made_by = program()
    trials = [trial for trial in order(counts) if trial not in done]
    end = time.monotonic() + 60 * minutes
    with ProcessPoolExecutor(workers, get_context("spawn"), _start,
                             (lab,)) as pool, bar(len(trials)) as step:
        # As they end: one that takes long must not keep others from being kept.
        for future in as_completed([pool.submit(_run, trial) for trial in trials]):
            name, number, trial_records = future.result()
            step(f"{name} {number}")
            records += trial_records
            if keep is not None:
                with keep.open("a", encoding="utf-8") as file:
                    rows = [record.json() for record in trial_records]
                    file.write(json.dumps({"trial": [name, number], "program": made_by,
                                           "records": rows}) + "\n")
            if time.monotonic() > end:
                pool.shutdown(cancel_futures=True)
                break
    return sorted(records, key=lambda record: (record.population, record.number))


def program() -> str:
    """The commit of this checkout, with a + where files differ from it; "unknown" without git."""
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=Path(__file__).parent, check=True,
                              capture_output=True, text=True).stdout.strip()

    try:
        return git("rev-parse", "--short=8", "HEAD") + "+" * bool(
            git("status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def programs(keep: Path, populations: Iterable[str]) -> dict[str, int]:
    """Numbers of the trials kept in a file, by the commit of the program that made them."""
    some = set(populations)
    return Counter(row.get("program", "unknown") for row in _rows(keep) if row["trial"][0] in some)


def _rows(keep: Path | None) -> list[dict[str, Any]]:
    lines = keep.read_text(encoding="utf-8").splitlines() if keep and keep.exists() else []
    return [json.loads(line) for line in lines]


def kept(keep: Path | None) -> tuple[list[Record], set[tuple[str, int]]]:
    """Records kept in a file, and the trials they are of."""
    rows = _rows(keep)
    done = {(row["trial"][0], row["trial"][1]) for row in rows}
    return [Record.of_json(content) for row in rows for content in row["records"]], done


def of_whole_pages(records: Sequence[Record], done: Iterable[tuple[str, int]],
                   counts: Mapping[str, int]) -> list[Record]:
    """Records for those pages alone of which all trials are done."""
    reached = Counter(name for name, _ in done)
    lacking = {name for name, count in counts.items() if reached[name] < count}
    tidy = set(COUNTS) - {*SMOOTH, *BENCH}
    whole = {name for group in ({*SMOOTH}, {*BENCH}, tidy) if not lacking & group for name in group}
    strata = {population_of(name, view): name for name in SMOOTH for view in STRATA[name].views}

    def page_of(population: str) -> str:
        name = strata.get(population, population)
        return name if name in COUNTS or name in BENCH else "null"

    return [record for record in records if page_of(record.population) in whole]


def write(records: Sequence[Record], about: Callable[[Iterable[str]], str], file: Path) -> None:
    """The pages that there are records for, and their pictures; ``about`` some populations."""
    strata = {population_of(name, view) for name in SMOOTH for view in STRATA[name].views}
    further = [record for record in records if record.population in strata]
    if further:
        file.with_name(f"{file.stem}-strata.md").write_text(
            strata_page(further, about(SMOOTH)), encoding="utf-8")
    if messy := [record for record in records if record.population in BENCH]:
        file.with_name(f"{file.stem}-bench.md").write_text(
            bench_page(messy, about(BENCH)), encoding="utf-8")
    if tidy := [record for record in records if record.population not in strata | {*BENCH}]:
        file.write_text(page(tidy, about(set(COUNTS) - {*SMOOTH, *BENCH})), encoding="utf-8")
        draw_power(tidy, file.with_suffix(".png"))
        draw_sizes(tidy, file.with_name(f"{file.stem}-sizes.png"))
        draw_maps(tidy, file.with_name("alias-maps.png"))


def told(records: Sequence[Record], seed: int, counts: dict[str, int],
         made_by: Mapping[str, int] | None = None) -> str:
    """Trials that were run, those that were planned, and the programs that made them."""
    done = {name: len({record.number for record in records
                       if record.population.partition(",")[0].startswith(name)})
            for name in counts}
    drawn = ", ".join(f"{count} {name}" for name, count in done.items())
    again = sum(record.again for record in records if record.population.startswith(tuple(counts)))
    lines = [f"Seed {seed}. Trials: {drawn}; drawn again for "
             f"want of an equilibrium or a film {again} times."]
    if done != counts:
        lines.append(f"**Stopped early**: {sum(done.values())} of {sum(counts.values())} trials; "
                     "`make hidden` runs them all.")
    if made_by:
        commits = ", ".join(f"{name} ({count} trials)" for name, count in made_by.items())
        lines.append(f"Made by the program at commit {commits}.")
    return "\n".join(lines)


def changed(records: Sequence[Record], before: Sequence[Record]) -> list[str]:
    """Compare verdicts and causes with those of the same trials before: a line for each change."""
    known = {(record.population, record.number): record for record in before}
    pairs = [(known[record.population, record.number], record) for record in records
             if (record.population, record.number) in known]
    if not pairs:
        return ["no trial of both"]
    others = [(old, new) for old, new in pairs if _verdict(old) != _verdict(new)]
    lines = [f"{new.population} {new.number}, {'+'.join(new.truth) or 'nothing'} hidden: "
             f"{_verdict(old)} (p {old.p_value:.3g}) before, {_verdict(new)} (p {new.p_value:.3g}) "
             "now" for old, new in others]
    wrong = [sum(record.misnamed for record in each) for each in zip(*pairs, strict=True)]
    right = [sum(bool(record.truth) and {*record.named} == {*record.truth} for record in each)
             for each in zip(*pairs, strict=True)]
    return [*lines, f"{len(pairs) - len(others)} of {len(pairs)} verdicts are the same; named: "
                    f"right {' before, '.join(map(str, right))} now, wrong "
                    f"{' before, '.join(map(str, wrong))} now"]


def _verdict(record: Record) -> str:
    return " ".join([record.verdict, *sorted(record.named)])


def main() -> None:
    """Run the study and print its rates."""
    parser = argparse.ArgumentParser(description="Hide effects in readings and have them found.")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the number of trials")
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path,
                        help="file the trials are kept in as they are done, one JSON line each")
    parser.add_argument("--minutes", type=float, default=inf,
                        help="time after which no further trial is begun")
    parser.add_argument("--only", nargs="+", choices=[*COUNTS], default=[*COUNTS],
                        metavar="POPULATION", help=f"run these alone: {', '.join(COUNTS)}")
    parser.add_argument("--strata", type=_strata, metavar="NAME=COUNT,...",
                        help=f"run these alone: {', '.join(STRATA)}; counts may be left out")
    parser.add_argument("--whole", action="store_true",
                        help="write those pages alone of which all trials are there")
    parser.add_argument("--against", type=Path,
                        help="file of trials to compare the verdicts with")
    parser.add_argument("-o", "--output", type=Path,
                        help="Markdown file to put the rates in; pictures and strata beside it")
    options = parser.parse_args()
    counts = {name: max(1, round(options.scale * count)) for name, count in COUNTS.items()}
    counts |= {name: count for name, count in (options.strata or {}).items() if count}
    asked = {name: counts[name] for name in options.strata or options.only}
    if options.minutes > 0:
        records = study(lab_of(options.seed, options.workers, asked), asked, options.workers,
                        options.keep, options.minutes)
    else:
        records, _ = kept(options.keep)

    def about(populations: Iterable[str]) -> str:
        asked = {name: counts[name] for name in counts if name in set(populations)}
        return told(records, options.seed, asked,
                    programs(options.keep, asked) if options.keep else None)

    if options.output:
        shown = of_whole_pages(records, kept(options.keep)[1], counts) if options.whole else records
        write(shown, about, options.output)
    print(about(asked), *(rate.row() for rate in (
        *rates(records), *bench_rates(records), *strata_rates(records))
                          if rate.count), sep="\n")
    if options.against:
        print(*changed(records, kept(options.against)[0]), sep="\n")
    sys.stdout.flush()


def _strata(words: str) -> dict[str, int]:
    """Numbers of trials by stratum, 0 where the usual one is meant."""
    counts = {name: int(count or 0) for name, _, count in (
        word.partition("=") for word in words.split(","))}
    if unknown := set(counts) - set(STRATA):
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}: must be of {', '.join(STRATA)}")
    return counts


if __name__ == "__main__":
    main()
