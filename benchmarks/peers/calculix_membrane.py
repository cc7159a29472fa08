"""CalculiX: one layer of 8-node hexahedra with incompatible modes, stretched, then lifted."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from annulus import Floats, Ints, quads
from harness import PROBLEM, Peer, Solution, give_up, main

CCX = shutil.which("ccx") or give_up("CalculiX", "apt-get install calculix-ccx")
# K / mu: the compressibility then costs about 2e-4 of the force, 1000 ten times that.
BULK_RATIO = 10000.0
# First and largest increment of the lift and the growth between them: the fastest of those that
# converge.
LIFT = "1e-3, 1., 1e-8, 0.12"
CONTROLS = ("*CONTROLS, PARAMETERS=TIME INCREMENTATION\n"
            "4, 8, 9, 16, 10, 4, , 5, ,\n.25, .5, .75, .85, , , 2.")


@dataclass(frozen=True)
class Film:
    """Virgin film: points (n, 3) in mm, lower layer first, hexahedra, lower nodes of both rims."""

    points: Floats
    cells: Ints
    plate: Ints
    frame: Ints


def prepare(level: int) -> Film:
    """One hexahedron through the thickness; 8, 16, 32, ... across the film."""
    n_r = 8 * 2**level
    flat = quads(PROBLEM.inner / PROBLEM.prestretch, PROBLEM.outer / PROBLEM.prestretch,
                 n_r, 4 * n_r, order=1)
    n, half = len(flat.points), PROBLEM.film_thickness / 2
    points = np.vstack([np.c_[flat.points, np.full(n, z)] for z in (-half, half)])
    return Film(points, np.hstack([flat.cells, flat.cells + n]), flat.inner, flat.outer)


def _nodes(points: Floats, first: int) -> Iterator[str]:
    """Node lines from the number `first`; CalculiX reads no more than 20 characters of a number."""
    for number, point in enumerate(points.tolist(), start=first):
        yield f"{number}, " + ", ".join(f"{x:.12g}" for x in point)


def _held(numbers: Ints, values: Floats) -> Iterator[str]:
    """Boundary lines, all three displacements (mm) of the nodes."""
    for number, row in zip(numbers.tolist(), values.tolist(), strict=True):
        for direction, value in enumerate(row, start=1):
            yield f"{number}, {direction}, {direction}, {value:.12g}"


def _hinges(lower: Ints, guides: Ints, layer: int) -> Iterator[str]:
    """Equations: the mean of the lower and the upper node of a rim moves with the guide node."""
    for node, guide in zip(lower.tolist(), guides.tolist(), strict=True):
        for k in (1, 2, 3):
            yield f"*EQUATION\n3\n{node}, {k}, 1., {node + layer}, {k}, 1., {guide}, {k}, -2."


def _step(time: str, controls: str, boundary: Iterable[str], output: str = "") -> list[str]:
    """One static step in which only the given nodes are held."""
    lines = ["*STEP, NLGEOM, INC=1000", "*STATIC", time, controls,
             "*BOUNDARY, OP=NEW", *boundary, output, "*END STEP"]
    return [line for line in lines if line]


def deck(film: Film) -> str:
    """Input file of three steps: stretch all nodes, let all but the rims go, lift the plate.

    The rims hold the mean of the lower and the upper node at guide nodes: hinged, as a membrane is.
    """
    n, layer = len(film.points), len(film.points) // 2
    rim = np.concatenate([film.plate, film.frame])
    guides = n + 1 + np.arange(len(rim))
    rim_points = film.points[rim] * [1, 1, 0]
    stretch = np.array([PROBLEM.prestretch, PROBLEM.prestretch, PROBLEM.prestretch**-2]) - 1
    mounted = rim_points * stretch
    lifted = mounted.copy()
    lifted[: len(film.plate), 2] = PROBLEM.travel
    free = np.setdiff1d(np.arange(n), rim)  # the lower rim nodes follow from the equations
    cells = (f"{k}, " + ", ".join(map(str, cell))
             for k, cell in enumerate((film.cells + 1).tolist(), start=1))
    lines = [
        *("*NODE, NSET=ALL", *_nodes(film.points, 1), *_nodes(rim_points, n + 1)),
        *("*ELEMENT, TYPE=C3D8I, ELSET=FILM", *cells),
        *("*NSET, NSET=PLATE",
          *(f"{node + 1},\n{node + layer + 1}," for node in film.plate.tolist())),
        *("*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE"),
        f"{PROBLEM.mu / 2:.12g}, {2 / (BULK_RATIO * PROBLEM.mu):.12g}",
        "*SOLID SECTION, ELSET=FILM, MATERIAL=RUBBER",
        *_hinges(rim + 1, guides, layer),
        *_step("1., 1.", "", [*_held(guides, mounted),
                              *_held(free + 1, film.points[free] * stretch)]),
        *_step("1., 1.", "", _held(guides, mounted)),
        *_step(LIFT, CONTROLS, _held(guides, lifted), "*NODE PRINT, NSET=PLATE, TOTALS=ONLY\nRF"),
    ]
    return "\n".join(lines) + "\n"


def solve(film: Film) -> Solution:
    """Write the deck, run CalculiX, read the total reaction of the plate at the end of the lift."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "film.inp").write_text(deck(film))
        run = subprocess.run([CCX, "film"], cwd=folder, capture_output=True, text=True, check=False)
        printed = Path(folder, "film.dat").read_text()
    if run.returncode or "*ERROR" in run.stdout:
        raise RuntimeError(run.stdout[-2000:])
    totals = re.findall(r"total force.*time\s+(\S+)\s+\S+\s+\S+\s+(\S+)", printed)
    time, force = map(float, totals[-1])
    if abs(time - 3) > 1e-6:
        raise RuntimeError(f"CalculiX stopped at time {time} of 3")
    return Solution(3 * (len(film.points) - len(film.plate) - len(film.frame)), force)


def version() -> str:
    """Version that ccx prints."""
    printed = subprocess.run([CCX, "-v"], capture_output=True, text=True, check=False).stdout
    return printed.split()[-1]


if __name__ == "__main__":
    notes = (f"K/mu = {BULK_RATIO:.0f}; SPOOLES; with the files; "
             "incompatible modes not in the unknowns")
    main(Peer("CalculiX", version(), "solid C3D8I, one layer", notes), prepare, solve)
