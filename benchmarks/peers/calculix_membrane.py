"""CalculiX: one layer of 20-node hexahedra, the film stretched in a first step and lifted in a second."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from annulus import Floats, Ints, quads
from harness import PROBLEM, Peer, Solution, give_up, main

CCX = shutil.which("ccx") or give_up("CalculiX", "apt-get install calculix-ccx")
BULK_RATIO = 2000.0  # K / mu: J is off by less than 1e-3, the linear systems are still well conditioned
TIGHT = 1e-6  # of the mean force, where CalculiX would stop at 5e-3


@dataclass(frozen=True)
class Film:
    """Virgin film of 20-node hexahedra, points (n, 3) in mm; per rim position the nodes through the thickness."""

    points: Floats
    cells: Ints
    plate: list[list[int]]
    frame: list[list[int]]


def prepare(level: int) -> Film:
    """Hexahedra from 4, 8, 16, ... cells across the film; mid-thickness nodes at the corners only."""
    n_r = 4 * 2**level
    flat = quads(PROBLEM.inner / PROBLEM.prestretch, PROBLEM.outer / PROBLEM.prestretch, n_r, 4 * n_r, order=2)
    eight = flat.cells[:, :8]
    used, numbers = np.unique(eight, return_inverse=True)
    eight = numbers.reshape(eight.shape)
    n = len(used)
    corners, place = np.unique(eight[:, :4], return_inverse=True)
    between = 2 * n + place.reshape(-1, 4)
    points = flat.points[used]
    half = PROBLEM.film_thickness / 2
    film = np.vstack([
        np.c_[points, np.full(n, -half)], np.c_[points, np.full(n, half)], np.c_[points[corners], np.zeros(len(corners))]
    ])  # fmt: skip
    cells = np.hstack([eight[:, :4], eight[:, :4] + n, eight[:, 4:], eight[:, 4:] + n, between])
    middle = {int(corner): 2 * n + k for k, corner in enumerate(corners)}

    def rim(nodes: Ints) -> list[list[int]]:
        lower = np.searchsorted(used, nodes).tolist()
        return [[node, node + n] + ([middle[node]] if node in middle else []) for node in lower]

    return Film(film, cells, rim(flat.inner), rim(flat.outer))


def _lines(numbers: Ints, first: int = 1) -> Iterator[str]:
    """Rows of node numbers, counted from 1, labelled from `first`."""
    for label, row in enumerate(numbers + 1, start=first):
        yield f"{label}, " + ", ".join(map(str, row[:10])) + ",\n" + ", ".join(map(str, row[10:]))


def deck(film: Film) -> str:
    """Input file. The rims hold the mean of the lower and upper node: hinged, as a membrane is.

    The first step prescribes the homogeneous stretch at every node, the second lets all but the rims go.
    """
    points, n = film.points, len(film.points)
    scale = np.array([PROBLEM.prestretch, PROBLEM.prestretch, PROBLEM.prestretch**-2]) - 1
    stretch = points * scale
    hinges = [(nodes, travel) for rim, travel in ((film.plate, PROBLEM.travel), (film.frame, 0.0)) for nodes in rim]
    sides = [(nodes, travel) for nodes, travel in hinges if len(nodes) == 2]
    corners = [(nodes, travel) for nodes, travel in hinges if len(nodes) == 3]
    text = ["*NODE, NSET=ALL"]
    text += [f"{k}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(points.tolist(), start=1)]
    text += ["*NODE, NSET=GUIDES"]
    text += [
        f"{n + k}, {points[nodes[0], 0]:.12g}, {points[nodes[0], 1]:.12g}, 0." for k, (nodes, _) in enumerate(sides, 1)
    ]
    text += ["*ELEMENT, TYPE=C3D20R, ELSET=FILM", *_lines(film.cells)]
    text += ["*NSET, NSET=PLATE", *(f"{node + 1}," for nodes in film.plate for node in nodes)]
    text += ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE"]
    text += [f"{PROBLEM.mu / 2:.12g}, {2 / (BULK_RATIO * PROBLEM.mu):.12g}"]
    text += ["*SOLID SECTION, ELSET=FILM, MATERIAL=RUBBER"]
    return "\n".join(text) + "\n"
