"""Ask every question of every film and rig; 1 where one fails or is refused without a reason.

    python -m benchmarks.compose FOLDER [--pairs N --seed S] [--only WORD] [--again] [question ...]

Each concept of :mod:`benchmarks.compose.concepts` alone, or N drawn pairs and triples. Answers are
kept in FOLDER; a run goes on from its ``log.jsonl``. ``--again`` asks again what was refused or
failed, ``--table`` asks nothing and prints what is kept.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from benchmarks.compose.answering import preload
from benchmarks.compose.ask import Log, ask
from benchmarks.compose.concepts import alone, concepts, drawn, missing, write_drawings
from benchmarks.compose.doors import differences
from benchmarks.compose.questions import questions
from benchmarks.compose.table import allowed, counts, refusals

#: Processor seconds from which on an answer is printed.
_LONG = 20.0


def main() -> int:
    """Print what ended otherwise, then counts, refusals and differences between doors."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compose",
                                     description="Ask every question of every film and rig.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("questions", nargs="*", help="these alone")
    parser.add_argument("--pairs", type=int, default=0, metavar="N",
                        help="pairs and triples instead, drawn at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", metavar="WORD", help="combinations with this word")
    parser.add_argument("--again", action="store_true",
                        help="ask again what was refused or failed")
    parser.add_argument("--table", action="store_true", help="ask nothing, print what is kept")
    options = parser.parse_intermixed_args()
    began, folder = time.time(), options.folder.resolve()
    files = folder / "in"
    files.mkdir(parents=True, exist_ok=True)
    os.environ["TYMPAN_CACHE"] = str(folder / "cache")
    for name in missing():
        print(f"{name} has no example: benchmarks/compose/examples.toml")
    write_drawings(files)
    every = concepts()
    chosen = alone(every)
    if options.pairs:
        chosen, refused = drawn(every, options.pairs, options.seed, files)
        print(f"seed {options.seed}: {len(chosen)} combinations, {refused} others may not be")
    chosen = [combination for combination in chosen if options.only in combination.name]
    every_question = [question for question in questions()
                      if not options.questions or question.name in options.questions]
    log, reasons = Log(folder / "log.jsonl"), allowed()
    if not options.table:
        preload()
        for combination in chosen:
            asked = combination.write(files)
            for question in every_question:
                before = log.rows.get((combination.name, question.name))
                if before and not (options.again and (before.refused or before.failed)):
                    continue
                row = ask(question, asked,
                          folder / "out" / combination.stem / question.name.replace(" ", "_"))
                if row is None:
                    continue
                log.add(row)
                if row.refused or row.failed or row.seconds > _LONG:
                    print(f"{row.case}: {row.question}: {row.status} {row.seconds} s {row.said}",
                          flush=True)
    cases = {combination.name for combination in chosen}
    rows = [row for row in log if row.case in cases
            and row.question in {question.name for question in every_question}]
    meant = [row for row in rows if row.refused and any(each.covers(row) for each in reasons)]
    others = [row for row in rows if row.refused and row not in meant]
    print("\n".join(["", *counts(rows), "", "refused without a reason in docs/composition.md",
                     *refusals(others), "", f"refused with a reason there: {len(meant)}",
                     "", *differences(folder / "out", [combination.stem for combination in chosen]),
                     f"{time.time() - began:.0f} s"]))
    return int(bool(others) or any(row.failed for row in rows))


if __name__ == "__main__":
    sys.exit(main())
