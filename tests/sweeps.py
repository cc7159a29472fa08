"""Small sweeps for the tests, and a process that is killed over one again and again.

    python tests/sweeps.py SWEEP.toml DIR SEED KILLS

runs the sweep in children that are killed after random times, then once to its end, and prints what stood after each.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from geometry.mesher import MeshSettings
from studies.cases import Settings
from studies.sweep.plan import Sweep, read_sweep
from studies.sweep.pool import here
from studies.sweep.run import run
from studies.sweep.shelf import Shelf

CHEAP = Settings(MeshSettings(order=2).refined(0.6))

OVAL = """
name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "4.5 cm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
material = "vhb-4910"
"""

SWEEP = """
specimen = "oval.toml"
mass = ["17.9 g", "22.45 g"]
voltage = { from = "0 kV", to = "4 kV", count = 3 }
[sample]
method = "sobol"
count = 8
seed = 3
[sample.ranges]
"frame.semi_axes.0" = ["4.6 cm", "7.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"""


def written(folder: Path, text: str = SWEEP, **files: str) -> Path:
    """A sweep file, its specimen, and further files beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in {"oval": OVAL, "SWEEP": text, **files}.items():
        folder.joinpath(f"{name}.toml").write_text(content)
    return folder / "SWEEP.toml"


def read(folder: Path, text: str = SWEEP, **files: str) -> Sweep:
    """The sweep of a text, cheap to solve."""
    return read_sweep(written(folder, text, **files), CHEAP)


def finished(sweep: Sweep, folder: Path) -> dict[str, tuple[int, int]]:
    """Finished tasks, each with what changes when its file is written again."""
    shelf, found = Shelf(folder), {}
    for entry in sweep.entries:
        if entry.task is not None and shelf.get(entry.task) is not None:
            seen = next(folder.glob(f"tasks/*/{entry.task.id}.json")).stat()
            found[entry.task.id] = seen.st_ino, seen.st_mtime_ns
    return found


def _killed(sweep: Sweep, folder: Path, seconds: float) -> None:
    """A child of a process that has meshed nothing yet: gmsh's threads would not survive the fork."""
    child = os.fork()
    if not child:
        run(sweep, folder, here)
        os._exit(0)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def main() -> None:
    """Kill, go on, and print a JSON list: the finished tasks after every kill and at the end."""
    file, folder, seed, kills = sys.argv[1:]
    sweep = read_sweep(Path(file), CHEAP)
    random = np.random.default_rng(int(seed))
    stood = []
    for _ in range(int(kills)):
        _killed(sweep, Path(folder), random.uniform(0.0, 0.5))
        stood.append(finished(sweep, Path(folder)))
    run(sweep, Path(folder), here)
    print(json.dumps([*stood, finished(sweep, Path(folder))]))


if __name__ == "__main__":
    main()
