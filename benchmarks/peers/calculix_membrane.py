"""CalculiX: the film as ``tympan export --inp`` writes it, on meshes of its own, then lifted."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from annulus import triangles
from harness import PROBLEM, Peer, Solution, give_up, main

from tympan.fem.film.laws import NeoHooke
from tympan.geometry.specimen import Film
from tympan.studies.export.calculix import FlatFilm, Step, film_input
from tympan.studies.export.hyperelastic import BULK_RATIO

CCX = shutil.which("ccx") or give_up("CalculiX", "apt-get install calculix-ccx")
FILM = Film(1e-3 * PROBLEM.film_thickness, (PROBLEM.prestretch, PROBLEM.prestretch),
            NeoHooke(1e6 * PROBLEM.mu), 1.0)


def prepare(level: int) -> FlatFilm:
    """Two triangles in each cell; 4, 8, 16, ... cells across the film."""
    n_r = 4 * 2**level
    flat = triangles(PROBLEM.inner, PROBLEM.outer, n_r, 4 * n_r, order=2)
    return FlatFilm(1e-3 * flat.points, flat.cells, flat.inner, flat.outer)


def solve(film: FlatFilm) -> Solution:
    """Write the input, run CalculiX, read the total reaction of the plate when lifted."""
    lift = Step("lifted", deflection=1e-3 * PROBLEM.travel)
    with tempfile.TemporaryDirectory() as folder:
        lines = film_input("film", film, FILM, [lift])
        Path(folder, "film.inp").write_text("".join(f"{line}\n" for line in lines))
        run = subprocess.run([CCX, "film"], cwd=folder, capture_output=True, text=True, check=False,
                             env={"OMP_NUM_THREADS": "1", **os.environ})
        printed = Path(folder, "film.dat").read_text()
    if run.returncode or "*ERROR" in run.stdout:
        raise RuntimeError(run.stdout[-2000:])
    totals = re.findall(r"total force.*RIM.*time\s+(\S+)\s+\S+\s+\S+\s+(\S+)", printed)
    time, force = map(float, totals[-1])
    if abs(time - 3) > 1e-6:
        raise RuntimeError(f"CalculiX stopped at time {time} of 3")
    corners = len(np.unique(film.triangles[:, :3]))
    edge = len(film.plate) + len(film.frame)
    return Solution(3 * (2 * (len(film.points) - edge) + corners - edge // 2 + edge), force)


def version() -> str:
    """Version that ccx prints."""
    printed = subprocess.run([CCX, "-v"], capture_output=True, text=True, check=False).stdout
    return printed.split()[-1]


if __name__ == "__main__":
    notes = f"K/mu = {BULK_RATIO:.0f}; SPOOLES; with the files"
    main(Peer("CalculiX", version(), "solid C3D15, one layer", notes), prepare, solve)
