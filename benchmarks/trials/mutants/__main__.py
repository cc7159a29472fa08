"""Draw mutants, map a suite, judge the mutants by it, write their table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.trials.mutants.draw import chapter_lines, draw
from benchmarks.trials.mutants.judge import CAUGHT, judge, read_records
from benchmarks.trials.mutants.mutant import read_mutants, write_mutants
from benchmarks.trials.mutants.suite_map import SuiteMap, record, said
from benchmarks.trials.mutants.table import page

ROOT = Path(__file__).parents[3]


def _draw(options: argparse.Namespace) -> int:
    mutants = draw(options.tree, options.count, options.seed)
    write_mutants(options.mutants, mutants)
    for mutant in mutants:
        print(f"{mutant.number:3} {mutant.file}:{mutant.line} {mutant.function}, {mutant.kind}\n"
              f"      {mutant.before}\n    → {mutant.after}")
    lines = sum(chapter_lines(options.tree).values())
    print(f"{len(mutants)} mutants of {lines} lines of code, seed {options.seed}")
    return 0


def _map(options: argparse.Namespace) -> int:
    status = record(options.tree, options.folder, options.pytest)
    print(said(status, options.folder))
    return 0


def _judge(options: argparse.Namespace) -> int:
    mutants = read_mutants(options.mutants)
    if options.only:
        mutants = [mutant for mutant in mutants if mutant.number in options.only]
    if options.got_away_in:
        caught = {found.mutant for found in read_records(options.keep)
                  if found.suite == options.got_away_in and found.end == CAUGHT}
        mutants = [mutant for mutant in mutants if mutant.key not in caught]
    numbers = {mutant.key: mutant.number for mutant in mutants}
    for found in judge(mutants, options.tree, SuiteMap.read(options.map), options.keep,
                       suite=options.suite, left_out=options.left_out, limit=options.seconds,
                       workers=options.workers):
        print(f"{numbers[found.mutant]:3} {found.end}, {found.ran} of {found.candidates} tests, "
              f"{found.seconds:.0f} s: {found.by or found.why}", flush=True)
    return 0


def _table(options: argparse.Namespace) -> int:
    text = page(read_mutants(options.mutants), read_records(options.keep))
    if options.output is None:
        print(text)
    else:
        options.output.write_text(text, encoding="utf-8")
    return 0


def main() -> int:
    """Run one of the four commands."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.mutants",
                                     description="Make small faults, and see which tests fail.")
    commands = parser.add_subparsers(required=True)

    drawing = commands.add_parser("draw", help="draw mutants at random and write them to a file")
    drawing.set_defaults(run=_draw)
    drawing.add_argument("--count", type=int, default=60)
    drawing.add_argument("--seed", type=int, default=2026)

    mapping = commands.add_parser(
        "map", help="run tests and record what each of them runs; further calls add to the map; "
                    "options stand before the folder")
    mapping.set_defaults(run=_map)
    mapping.add_argument("folder", type=Path, help="new, or one of an earlier call")
    mapping.add_argument("pytest", nargs="*", help="options and files for pytest, after --")

    judging = commands.add_parser("judge", help="run the tests that may notice each mutant")
    judging.set_defaults(run=_judge)
    judging.add_argument("--map", type=Path, required=True, help="folder of the map")
    judging.add_argument("--suite", default="after", help="name of the suite in the table")
    judging.add_argument("--left-out", action="store_true",
                         help="only tests that the suite's markers leave out, such as study")
    judging.add_argument("--got-away-in", metavar="SUITE", default="",
                         help="only mutants that no test of this suite caught")
    judging.add_argument("--only", type=int, nargs="+", metavar="NUMBER", help="only these mutants")
    judging.add_argument("--seconds", type=float, default=600.0,
                         help="processor time for a mutant")
    judging.add_argument("--workers", type=int, default=1)

    tabling = commands.add_parser("table", help="write the table of all records")
    tabling.set_defaults(run=_table)
    tabling.add_argument("-o", "--output", type=Path, help="file; otherwise it is printed")

    for command in (drawing, judging, tabling):
        command.add_argument("mutants", type=Path, help="file of the mutants")
    for command in (drawing, mapping, judging):
        command.add_argument("--tree", type=Path, default=ROOT, help="tree of files")
    for command in (judging, tabling):
        command.add_argument("--keep", type=Path, required=True,
                             help="file of the records; judging goes on where it was interrupted")
    options = parser.parse_args()
    return int(options.run(options))


if __name__ == "__main__":
    sys.exit(main())
