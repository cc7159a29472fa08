"""Tries a program on the verdict cases: what it says against what is hidden.

    python -m benchmarks.trials.verdict_cases [CASE ...]
        [--program "tympan diagnose {dataset} -o {output} --json"]

The program prints what ``tympan diagnose --json`` prints.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.trials.verdict_cases.made import FOLDER

PROGRAM = f"{sys.executable} -m tympan diagnose {{dataset}} -o {{output}} --json"


def right(said: Mapping[str, Any], expected: Mapping[str, Any]) -> bool:
    """Whether a verdict is one of those expected, with the causes hidden.

    A verdict that names must name these alone; one that cannot decide must list them.
    """
    listed = [cause["effect"] for cause in said["causes"]]
    hidden = expected["causes"]
    if said["verdict"] not in expected["verdict"]:
        return False
    if said["verdict"] == "named":
        return sorted(listed[: len(hidden)]) == sorted(hidden)
    return said["verdict"] != "ambiguous" or set(hidden) <= set(listed)


def within(said: Mapping[str, Any], expected: Mapping[str, Any]) -> list[bool]:
    """Of each value hidden whether the limits stated hold it."""
    stated = {cause["effect"]: cause["parameters"] for cause in reversed(said["causes"])}
    hold = []
    for effect, parameters in expected["parameters"].items():
        for name, hidden in parameters.items():
            if name in (limits := stated.get(effect, {})):
                low, high = limits[name]["low"], limits[name]["high"]
                hold.append((low is None or low <= hidden["value"])
                            and (high is None or hidden["value"] <= high))
    return hold


def said_by(program: str, dataset: Path) -> dict[str, Any]:
    """What a program prints about a dataset."""
    with tempfile.TemporaryDirectory() as output:
        words = [part.format(dataset=dataset, output=output) for part in shlex.split(program)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{dataset.name}: {done.stderr.strip()}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def main() -> None:
    """Print a line for each case and how many were right; exit status 1 if one was not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--program", default=PROGRAM)
    options = parser.parse_args()
    folders = [folder for folder in sorted(FOLDER.iterdir())
               if not options.cases or folder.name in options.cases]
    wrong = 0
    print(f"{'case':22}{'verdict':13}{'causes':48}{'limits hold':13}{'s':>5}")
    for folder in folders:
        began = time.perf_counter()
        said = said_by(options.program, folder)
        expected = json.loads((folder / "expected.json").read_text(encoding="utf-8"))
        correct, hold = right(said, expected), within(said, expected)
        wrong += not correct
        causes = ", ".join(cause["effect"] for cause in said["causes"])
        print(f"{folder.name:22}{said['verdict']:13}{causes[:46]:48}{sum(hold)} of {len(hold):<8}"
              f"{time.perf_counter() - began:5.1f}{'' if correct else '  WRONG'}", flush=True)
    print(f"{len(folders) - wrong} of {len(folders)} right")
    raise SystemExit(min(wrong, 1))


if __name__ == "__main__":
    main()
