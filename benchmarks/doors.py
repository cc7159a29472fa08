"""Command line and ``import tympan``: the same solves take the same time by both.

    python -m benchmarks.doors [--pairs 6]

Each row in two processes, one after the other and in turns: commands of ``tympan``, and scripts
that import it, with no variable set that limits threads. The times of all pairs are printed, and
their ratio; the exit status is 1 where the medians differ by more than a tenth.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.start_up import FILM, ROUND, ROUNDED

#: How much longer one door may take than the other.
MOST = 1.1
#: Variables that would limit the threads from outside.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
#: What both doors do: the command's arguments, and the script. It leaves as the command does,
#: without taking apart what was imported, and collects garbage as seldom.
BEGIN = "import gc, os, tympan; gc.set_threshold(20_000, 50)\n"
END = "\nprint(result.json(), flush=True); os._exit(0)"
DOORS = {
    "solve, ellipse": (
        ("solve", "oval.toml", "--mass", "17.9 g", "--voltage", "3.5 kV", "--json"),
        'result = tympan.solve(tympan.load("oval.toml"), mass="17.9 g", voltage="3.5 kV")'),
    "solve, rounded": (
        ("solve", "rounded.toml", "--mass", "20 g", "--voltage", "2 kV", "--json"),
        'result = tympan.solve(tympan.load("rounded.toml"), mass="20 g", voltage="2 kV")'),
    "force, circle": (
        ("force", "round.toml", "--voltage", "0 kV, 2 kV", "--to", "5 mm", "--json"),
        'result = tympan.force(tympan.load("round.toml"), to="5 mm", voltage=["0 kV", "2 kV"])'),
    "curve, circle": (
        ("curve", "round.toml", "--mass", "20 g", "--json"),
        'result = tympan.curve(tympan.load("round.toml"), mass="20 g")'),
    "path, circle": (
        ("path", "round.toml", "--mass", "20 g", "--json"),
        'result = tympan.path(tympan.load("round.toml"), mass="20 g")'),
    "modes, film": (
        ("modes", "film.toml", "--mass", "20 g", "--voltage", "2 kV", "--json"),
        'result = tympan.modes(tympan.load("film.toml"), mass="20 g", voltage="2 kV")'),
}
OVAL = ROUND.replace('name = "round"', 'name = "oval"').replace(
    'shape = "circle"\nradius = "45 mm"', 'shape = "ellipse"\nsemi_axes = ["75 mm", "45 mm"]', 1)


@dataclass(frozen=True)
class Spent:
    """Seconds on the clock and of processors."""

    clock: float
    processor: float


def spent(command: Sequence[str], folder: Path) -> Spent:
    """Of a process."""
    environment = {name: value for name, value in os.environ.items() if name not in THREADS}
    before, began = os.times(), time.perf_counter()
    subprocess.run([sys.executable, *command], cwd=folder, check=True, capture_output=True,
                   env=environment | {"PYTHONPATH": str(Path(__file__).parents[1]),
                                      "TYMPAN_CACHE": ""})
    clock, after = time.perf_counter() - began, os.times()
    return Spent(clock, after.children_user + after.children_system - before.children_user
                 - before.children_system)


def pairs_of(name: str, folder: Path, count: int) -> list[tuple[Spent, Spent]]:
    """Times of the command and of the script, each first in half of the pairs."""
    arguments, script = DOORS[name]
    command, door = ["-m", "tympan", *arguments], ["-c", BEGIN + script + END]
    pairs = []
    for number in range(count + 1):
        if number % 2:
            first = spent(command, folder)
            pairs.append((first, spent(door, folder)))
        else:
            second = spent(door, folder)
            pairs.append((spent(command, folder), second))
    return pairs[1:]  # the first one compiles, and reads from disk


def main() -> int:
    """Print the table; 1 where a door is slower than allowed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pairs", type=int, default=6)
    options = parser.parse_args()
    slower = []
    print(f"load {os.getloadavg()[0]:.1f}; medians of {options.pairs} pairs [s]")
    print(f"{'':16}{'of processors':>24}{'ratio':>8}{'on the clock':>24}{'ratio':>8}")
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for text in (ROUND, ROUNDED, FILM, OVAL):
            folder.joinpath(f"{text.split(chr(34))[1]}.toml").write_text(text, encoding="utf-8")
        for name in DOORS:
            pairs = pairs_of(name, folder, options.pairs)
            cells = ""
            for unit in ("processor", "clock"):
                command, door = (median(getattr(pair[place], unit) for pair in pairs)
                                 for place in (0, 1))
                ratio = median(getattr(door, unit) / getattr(command, unit)
                               for command, door in pairs)
                cells += f"{f'{command:.2f}, {door:.2f}':>24}{ratio:>8.2f}"
                if not 1 / MOST < ratio < MOST:
                    slower.append(f"{name}, {unit}")
            print(f"{name:16}{cells}", flush=True)
    print(f"{len(slower)} of {2 * len(DOORS)} ratios differ by more than a tenth"
          + "".join(f"; {words}" for words in slower))
    return int(bool(slower))


if __name__ == "__main__":
    sys.exit(main())
