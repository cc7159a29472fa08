"""Run the cases: a line for each, counts for each group, and the total."""

from __future__ import annotations

import argparse
import sys

from benchmarks.trials.hostile import all_cases
from benchmarks.trials.hostile.case import Answer, Case, run


def answered(case: Case) -> Answer:
    """The answer; one that is late on a busy machine has a second try."""
    answer = run(case)
    if answer.fault(case) != "late" or answer.status < 0:
        return answer
    return min(answer, run(case), key=lambda either: either.taken)


def line(group: str, case: Case, answer: Answer) -> str:
    """What is printed of a case."""
    said = answer.error.strip().splitlines()
    verdict = answer.fault(case) or "ok"
    return (f"{group:20s} {case.name:28s} {answer.status:3d} {answer.taken:5.2f} s  "
            f"{verdict:12s} {said[-1][:150] if said else ''}").rstrip()


def main() -> int:
    """One line a case; 1 where one ends otherwise than it has to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.hostile",
                                     description="Run commands with bad input.")
    parser.add_argument("--only", default="", help="groups with this word")
    parser.add_argument("--list", action="store_true", help="count the cases, run none")
    options = parser.parse_args()
    chosen = {group: members for group, members in all_cases().items() if options.only in group}
    counts: dict[str, tuple[int, int]] = {}
    slowest = 0.0
    for group, members in chosen.items():
        faults = 0
        for case in () if options.list else members:
            answer = answered(case)
            faults += bool(answer.fault(case))
            if case.refused:
                slowest = max(slowest, answer.taken)
            print(line(group, case, answer), flush=True)
        counts[group] = len(members), faults
    print(f"\n{'group':20s} cases  wrong")
    for group, (count, faults) in counts.items():
        print(f"{group:20s} {count:5d}  {'-' if options.list else faults:>5}")
    total, wrong = (sum(column) for column in zip(*counts.values(), strict=True))
    print(f"{total} commands in {len(counts)} groups, {wrong} that end otherwise; "
          f"slowest message after {slowest:.2f} s")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
