"""How long commands take from the shell and back, start and end of the process included.

    python -m benchmarks.start_up [--before TREE] [--repeats 3] [--only study,solve]

Every command runs in a process of its own, on the small files below: with nothing kept on disk by
earlier runs ("first"), then once more ("again"); of some times that, the least counts. TREE is a
working tree of another version, to compare with; what it cannot do is "-".
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
MEMBRANE = """
[membrane]
thickness = "1 mm"
prestretch = [3, 3]
relative_permittivity = 4.7
material = "vhb-4910"
"""
ROUNDED = """
name = "rounded"
[frame]
shape = "rounded_rectangle"
semi_axes = ["40 mm", "25 mm"]
corner_radius = "8 mm"
[plate]
shape = "stadium"
semi_axes = ["12 mm", "8 mm"]
""" + MEMBRANE
FILM = """
name = "film"
[frame]
shape = "rounded_rectangle"
semi_axes = ["40 mm", "25 mm"]
corner_radius = "8 mm"
[plate]
shape = "rounded_rectangle"
semi_axes = ["12 mm", "8 mm"]
corner_radius = "3 mm"
""" + MEMBRANE.replace("1 mm", "0.5 mm")
ROUND = """
name = "round"
[frame]
shape = "circle"
radius = "45 mm"
[plate]
shape = "circle"
radius = "1 cm"
""" + MEMBRANE
HALVES = """
[[electrode.segment]]
name = "A"
sector = ["-90 deg", "90 deg"]
[[electrode.segment]]
name = "B"
sector = ["90 deg", "270 deg"]
"""
THIRDS = "".join(f"""
[[electrode.segment]]
name = "{name}"
sector = ["{start} deg", "{start + 120} deg"]
""" for name, start in zip("ABC", (0, 120, 240), strict=True))
BRANCH = """
[[membrane.branch]]
modulus = "31.2 kPa"
time = "6.5 s"
"""
STUDY = """
specimens = ["film.toml"]
mass = "20 g"
"""
SWEEP = """
specimen = "rounded.toml"
mass = "20 g"
voltage = "3 kV"
[grid]
"membrane.prestretch.0" = [2.9, 3.0]
"""
REQUIREMENTS = """
specimen = "round.toml"
mass = "20 g"
voltage = "2 kV"
tolerances = "none"
[want]
stroke = "largest"
gap = "25 mm"
[vary]
"plate.radius" = ["8 mm", "14 mm"]
"""
DATASET = 'name = "readings"\n[[specimen]]' + ROUND.replace("\n[", "\n[specimen.")
READINGS = "".join(f"round,{mass},{kilovolts},{0.12 * mass + 0.02 * kilovolts**2}\n"
                   for mass in (15, 20) for kilovolts in (0, 1, 2, 3, 4))
TESTS = "".join(f"uniaxial,{stretch},{20 * (stretch - stretch**-2)}\n"
                for stretch in (1.2, 1.4, 1.6, 1.9, 2.1, 2.5, 2.8))
FILES = {"rounded.toml": ROUNDED, "round.toml": ROUND, "film.toml": FILM, "STUDY.toml": STUDY,
         "SWEEP.toml": SWEEP, "REQUIREMENTS.toml": REQUIREMENTS,
         "viscous.toml": ROUND + BRANCH, "halves.toml": ROUND + HALVES,
         "thirds.toml": ROUND.replace("vhb-4910", "vhb-4910-viscous") + THIRDS,
         "coupon.csv": f"mode,stretch,nominal_stress_kPa\n{TESTS}",
         "readings/dataset.toml": DATASET,
         "readings/static.csv": f"specimen,mass_g,voltage_kV,displacement_mm\n{READINGS}"}

#: A small piece of work for each command; of those that work for minutes, and of the page, what
#: they are called with.
WORK = """
--help
solve --help
solve rounded.toml --mass 20g --voltage 3kV
limits rounded.toml --mass 20g
curve rounded.toml --mass 20g -o curve
tolerance rounded.toml --mass 17.9g --voltage 2kV --films 100 -o tolerance
steer halves.toml --mass 17.9g --voltage "A = 1 kV, 2 kV, B = 0 kV"
sense rounded.toml --voltage 0kV,2kV --to 4mm --points 5 -o sense
force rounded.toml --voltage 0kV,2kV --to 4mm --mass 20g -o force
path rounded.toml --mass 20g
modes rounded.toml --mass 20g --voltage 3kV
sensitivity rounded.toml --mass 20g --voltage 3kV
transient viscous.toml --mass 20g --signal step --high 3kV
response viscous.toml --mass 20g --voltage 3kV
alpha rounded.toml
study STUDY.toml -o study
sweep SWEEP.toml -o swept --workers 1
design REQUIREMENTS.toml -o design
outlines --help
map --help
draw rounded.toml -o drawing
explore --help
export rounded.toml -o parts
compare solved solved
report solved
materials
material show vhb-4910
effects
doctor
data readings
diagnose --help
material fit coupon.csv
lumped build round.toml -o built
lumped simulate --model models/round.lumped.toml --mass 20g --signal step --high 3kV
lumped linearise --model models/round.lumped.toml --mass 20g
lumped control --model models/round.lumped.toml --mass 20g --high 2kV --supply 3kV --duration 1s
lumped steer thirds.toml --mass 15g --tilt 1mrad --frequency 4Hz --turns 1 --refine 0.5
lumped identify readings --model models/round.lumped.toml --no-limits
lumped export models/round.lumped.toml -o controller
lumped paper --help
"""
COMMANDS = tuple(tuple(line.split()) for line in WORK.split("\n") if line)
#: What some of that starts from.
MADE = ("solve rounded.toml --mass 20g -o solved", "lumped build round.toml -o models")


@dataclass(frozen=True)
class Times:
    """Wall and processor time of a process [s]."""

    wall: float
    processor: float


def times(tree: Path, folder: Path, command: tuple[str, ...]) -> Times | None:
    """Of one command by a tree's sources; None where it does not have it."""
    before, began = os.times(), time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "tympan", *command], cwd=folder, check=False,
                          capture_output=True, env=os.environ | {
                              "PYTHONPATH": str(tree), "TYMPAN_CACHE": str(folder / "kept")})
    after = os.times()
    busy = (after.children_user - before.children_user
            + after.children_system - before.children_system)
    if done.returncode and tree == ROOT:
        raise SystemExit(f"{' '.join(command)}: {done.stderr.decode()}")
    return None if done.returncode else Times(time.perf_counter() - began, busy)


def first_and_again(tree: Path, command: tuple[str, ...], repeats: int
                    ) -> tuple[Times | None, Times | None]:
    """The least times of first runs and of those that follow them."""
    pairs = [_twice(tree, command) for _ in range(repeats)]
    first, again = (_least([run for run in runs if run is not None])
                    for runs in zip(*pairs, strict=True))
    return first, again


def _twice(tree: Path, command: tuple[str, ...]) -> tuple[Times | None, Times | None]:
    """Times of a command in a new folder, and once more there."""
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, text in FILES.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        needed = next((made for made in MADE if made.split()[-1] in " ".join(command)), None)
        if needed is not None:
            times(ROOT, folder, tuple(needed.split()))
            shutil.rmtree(folder / "kept")
        return times(tree, folder, command), times(tree, folder, command)


def _least(runs: list[Times]) -> Times | None:
    return Times(min(run.wall for run in runs),
                 min(run.processor for run in runs)) if runs else None


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, metavar="TREE")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", metavar="NAMES", help="rows of the table, such as study,solve")
    options = parser.parse_args()
    rows = [command for command in COMMANDS
            if options.only is None or named(command) in options.only.split(",")]
    trees = ([options.before] if options.before else []) + [ROOT]
    for tree in trees:  # compile, and read from disk once
        first_and_again(tree, COMMANDS[2], 1)
    print(f"load {os.getloadavg()[0]:.1f}; seconds on the clock (of processors)")
    heads = (["before, first", "before, again"] if options.before else []) + ["first", "again"]
    print(f"{'':<18}" + "".join(f"{head:>16}" for head in heads))
    for command in rows:
        cells = [run for tree in trees for run in first_and_again(tree, command, options.repeats)]
        texts = [f"{run.wall:.2f} ({run.processor:.2f})" if run else "-" for run in cells]
        print(f"{named(command):<18}" + "".join(f"{text:>16}" for text in texts), flush=True)


def named(command: tuple[str, ...]) -> str:
    """What the table calls it: the command's words, and whether only help is asked for."""
    words = [word for word in command if not word.startswith("-")]
    count = 2 if words[:1] in (["lumped"], ["material"]) else 1
    return " ".join([*words[:count], *(["--help"] if "--help" in command else [])])


if __name__ == "__main__":
    main()
