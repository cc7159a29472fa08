"""Draw mutants, map a suite, judge the mutants by it, write their table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.trials.mutants.draw import chapter_lines, draw, draw_rules
from benchmarks.trials.mutants.judge import (
    ABSENT,
    CAUGHT,
    EQUIVALENT,
    IMPORT,
    Record,
    judge,
    keep_record,
    read_records,
)
from benchmarks.trials.mutants.mutant import Key, Mutant, read_mutants, write_mutants
from benchmarks.trials.mutants.source import PRODUCT
from benchmarks.trials.mutants.suite_map import SuiteMap, record, said
from benchmarks.trials.mutants.table import Part, page

ROOT = Path(__file__).parents[3]


def _draw(options: argparse.Namespace) -> int:
    scope = options.scope or PRODUCT
    drawn = draw_rules if options.rules else draw
    mutants = drawn(options.tree, options.count, options.seed, scope)
    write_mutants(options.mutants, mutants)
    for mutant in mutants:
        print(f"{mutant.number:3} {mutant.file}:{mutant.line} {mutant.function}, {mutant.kind}\n"
              f"      {mutant.before}\n    → {mutant.after}")
    lines = sum(chapter_lines(options.tree, scope).values())
    print(f"{len(mutants)} mutants of {lines} lines of code, seed {options.seed}")
    return 0


def _map(options: argparse.Namespace) -> int:
    status = record(options.tree, options.folder, options.pytest)
    print(said(status, options.folder))
    return 0


def _asked(options: argparse.Namespace) -> list[Mutant]:
    """Mutants of a file, or only those whose numbers are given."""
    return [mutant for mutant in read_mutants(options.mutants)
            if not options.only or mutant.number in options.only]


def _named(options: argparse.Namespace, mutants: list[Mutant]) -> dict[Key, list[str]]:
    """Tests named on the command line, and those that caught a mutant when it was last judged."""
    numbers = {mutant.number: mutant.key for mutant in mutants}
    named: dict[Key, list[str]] = {}
    for pair in options.by or ():
        number, _, test = pair.partition("=")
        named.setdefault(numbers[int(number)], []).append(test)
    if options.again:
        for found in read_records(options.keep):
            if found.suite == options.suite and found.by not in ("", IMPORT):
                named.setdefault(found.mutant, [found.by])
    return named


def _judge(options: argparse.Namespace) -> int:
    mutants = _asked(options)
    if options.again:
        ended = {found.mutant for found in read_records(options.keep)
                 if found.suite == options.suite and found.end in (ABSENT, EQUIVALENT)}
        mutants = [mutant for mutant in mutants if mutant.key not in ended]
    if options.got_away_in:
        caught = {found.mutant for found in read_records(options.keep)
                  if found.suite == options.got_away_in and found.end == CAUGHT}
        mutants = [mutant for mutant in mutants if mutant.key not in caught]
    named = _named(options, mutants)
    files = options.tests
    if options.map is None:
        mutants = [mutant for mutant in mutants if mutant.key in named]
        files = files or sorted({test.partition("::")[0] for mutant in mutants
                                 for test in named[mutant.key]})
    numbers = {mutant.key: mutant.number for mutant in mutants}
    suite_map = SuiteMap.empty() if options.map is None else SuiteMap.read(options.map)
    for found in judge(mutants, options.tree, suite_map, options.keep,
                       suite=options.suite, left_out=options.left_out, limit=options.seconds,
                       workers=options.workers, options=files or (), named=named,
                       again=options.again):
        print(f"{numbers[found.mutant]:3} {found.end}, {found.ran} of {found.candidates} tests, "
              f"{found.seconds:.0f} s: {found.by or found.why}", flush=True)
    return 0


def _equivalent(options: argparse.Namespace) -> int:
    for mutant in _asked(options):
        keep_record(options.keep, Record(options.suite, mutant.key, EQUIVALENT, options.why, "",
                                         0, 0, 0.0))
    return 0


def _table(options: argparse.Namespace) -> int:
    text = page([Part(title, read_mutants(mutants), read_records(keep)) for title, mutants, keep
                 in zip(options.titles, options.mutants, options.keep, strict=True)])
    if options.output is None:
        print(text)
    else:
        options.output.write_text(text, encoding="utf-8")
    return 0


def main() -> int:
    """Run one of the commands."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.mutants",
                                     description="Make small faults, and see which tests fail.")
    commands = parser.add_subparsers(required=True)

    drawing = commands.add_parser("draw", help="draw mutants at random and write them to a file")
    drawing.set_defaults(run=_draw)
    drawing.add_argument("--count", type=int, default=60)
    drawing.add_argument("--seed", type=int, default=2026)
    drawing.add_argument("--scope", nargs="+", metavar="PATH",
                         help="folders and files of the program; otherwise all of it")
    drawing.add_argument("--rules", action="store_true",
                         help="conditions switched off and constants moved far off")

    mapping = commands.add_parser(
        "map", help="run tests and record what each of them runs; further calls add to the map; "
                    "options stand before the folder")
    mapping.set_defaults(run=_map)
    mapping.add_argument("folder", type=Path, help="new, or one of an earlier call")
    mapping.add_argument("pytest", nargs="*", help="options and files for pytest, after --")

    judging = commands.add_parser("judge", help="run the tests that may notice each mutant")
    judging.set_defaults(run=_judge)
    judging.add_argument("--map", type=Path,
                         help="folder of the map; without one only tests that are named are run")
    judging.add_argument("--by", nargs="+", metavar="NUMBER=TEST",
                         help="tests to run first, each for the mutant of a number")
    judging.add_argument("--again", action="store_true",
                         help="judge mutants that have a record too, by the test that caught each "
                              "if no other is named; new records take the place of the old ones")
    judging.add_argument("--tests", nargs="+", metavar="PATH",
                         help="files and folders of tests that count; otherwise all that pytest "
                              "runs by itself. With them no dear test is drawn")
    judging.add_argument("--left-out", action="store_true",
                         help="only tests that the suite's markers leave out, such as study")
    judging.add_argument("--got-away-in", metavar="SUITE", default="",
                         help="only mutants that no test of this suite caught")
    judging.add_argument("--seconds", type=float, default=600.0,
                         help="processor time for a mutant")
    judging.add_argument("--workers", type=int, default=1)

    marking = commands.add_parser("equivalent", help="record that mutants change nothing")
    marking.set_defaults(run=_equivalent)
    marking.add_argument("--why", required=True, help="the reason, in a sentence")

    tabling = commands.add_parser("table", help="write the page of all records: a part for each "
                                                "file of mutants, with its file of records")
    tabling.set_defaults(run=_table)
    tabling.add_argument("--titles", nargs="+", required=True, help="a heading for each part")
    tabling.add_argument("-o", "--output", type=Path, help="file; otherwise it is printed")

    for command in (drawing, judging, marking):
        command.add_argument("mutants", type=Path, help="file of the mutants")
    tabling.add_argument("mutants", type=Path, nargs="+", help="files of mutants")
    for command in (judging, marking):
        command.add_argument("--only", type=int, nargs="+", metavar="NUMBER",
                             required=command is marking, help="only these mutants")
        command.add_argument("--suite", default="after", help="name of the suite in the table")
        command.add_argument("--keep", type=Path, required=True,
                             help="file of the records; judging goes on where it was interrupted")
    for command in (drawing, mapping, judging):
        command.add_argument("--tree", type=Path, default=ROOT, help="tree of files")
    tabling.add_argument("--keep", type=Path, nargs="+", required=True,
                         help="files of records, in the order of the mutants")
    options = parser.parse_args()
    return int(options.run(options))


if __name__ == "__main__":
    sys.exit(main())
