"""How long commands take from the shell and back, start and end of the process included.

    python -m benchmarks.start_up [--before TREE] [--repeats 5]

Every command runs in a process of its own, on the specimen below: once with nothing kept on disk
by earlier runs ("first"), then some times more, of which the least counts ("again"). TREE is a
working tree of another version, to compare with.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
ROUNDED = """
name = "rounded"
[frame]
shape = "rounded_rectangle"
semi_axes = ["40 mm", "25 mm"]
corner_radius = "8 mm"
[plate]
shape = "stadium"
semi_axes = ["12 mm", "8 mm"]
[membrane]
thickness = "1 mm"
prestretch = [3, 3]
relative_permittivity = 4.7
material = "vhb-4910"
"""
LOADS = ("--mass", "20 g", "--voltage", "3 kV")
COMMANDS = (("--help",), ("solve", "--help"), ("materials",), ("effects",),
            ("solve", "rounded.toml", *LOADS), ("limits", "rounded.toml", "--mass", "20 g"),
            ("modes", "rounded.toml", *LOADS), ("sensitivity", "rounded.toml", *LOADS),
            ("alpha", "rounded.toml"), ("curve", "rounded.toml", "--mass", "20 g", "-o", "curve"))


@dataclass(frozen=True)
class Times:
    """Wall and processor time of a process [s]."""

    wall: float
    processor: float


def times(tree: Path, folder: Path, command: tuple[str, ...]) -> Times:
    """Of one command by a tree's sources."""
    before, began = os.times(), time.perf_counter()
    subprocess.run([sys.executable, "-m", "tympan", *command], cwd=folder, check=True,
                   capture_output=True,
                   env=os.environ | {"PYTHONPATH": str(tree), "TYMPAN_CACHE": str(folder / "kept"),
                                     "OPENBLAS_NUM_THREADS": "1"})
    after = os.times()
    busy = (after.children_user - before.children_user
            + after.children_system - before.children_system)
    return Times(time.perf_counter() - began, busy)


def first_and_again(tree: Path, command: tuple[str, ...], repeats: int) -> tuple[Times, Times]:
    """Times of the first run and the least of the others."""
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "rounded.toml").write_text(ROUNDED)
        first, *others = (times(tree, folder, command) for _ in range(repeats + 1))
    return first, Times(min(run.wall for run in others), min(run.processor for run in others))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, metavar="TREE")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    trees = ([options.before] if options.before else []) + [ROOT]
    for tree in trees:  # compile, and read from disk once
        first_and_again(tree, ("solve", "rounded.toml", *LOADS), 1)
    print(f"load {os.getloadavg()[0]:.1f}; seconds on the clock (of processors)")
    heads = (["before, first", "before, again"] if options.before else []) + ["first", "again"]
    print(f"{'':<12}" + "".join(f"{head:>16}" for head in heads))
    for command in COMMANDS:
        cells = [run for tree in trees for run in first_and_again(tree, command, options.repeats)]
        name = " ".join(command[:2]) if command[-1] == "--help" else command[0]
        print(f"{name:<12}" + "".join(f"{f'{run.wall:.2f} ({run.processor:.2f})':>16}"
                                      for run in cells), flush=True)


if __name__ == "__main__":
    main()
