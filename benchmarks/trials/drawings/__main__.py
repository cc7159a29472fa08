"""Read every drawing with several seeds: a line for each that is read wrong, and counts."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.trials.drawings import CASES
from tympan.base.errors import InputError


def main() -> int:
    """1 where a drawing is read wrong, or refused without advice that works."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.drawings",
                                     description="Read drawings of known shapes.")
    parser.add_argument("--seeds", type=int, default=3, help="shapes of each kind")
    parser.add_argument("--small", action="store_true", help="leave out those that take seconds")
    options = parser.parse_args()
    wrong = 0
    cases = [case for case in CASES if not (case.large and options.small)]
    for case in cases:
        faults, said = [], ""
        for seed in range(1 if case.large else options.seeds):
            with tempfile.TemporaryDirectory() as folder:
                try:
                    fault, said = case.fault(Path(folder), seed)
                except InputError as error:
                    fault = f"refused: {error}"
            faults += [f"seed {seed}: {fault}"] * bool(fault)
        wrong += bool(faults)
        verdict = "; ".join(faults) or ("refused, then read as advised" if said else "read")
        print(f"{case.suffix:5s} {case.name:45s} {verdict}", flush=True)
    print(f"{len(cases)} kinds of drawings, {wrong} of them wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
