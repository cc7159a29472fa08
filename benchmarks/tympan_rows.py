"""tympan's rows of the reference problem: cold solves, a warm step, ten annuli from CAD on."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from unittest.mock import patch

import numpy as np

from benchmarks.peers.harness import PROBLEM, Peer, Row, Solution, measure
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.model import Model
from tympan.geometry.mesh import ELEMENTS, CurvedTriangles, curved_mesh, from_flat
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Settings, build_model, meshed

HEAVE = PROBLEM.travel * 1e-3


def specimen(inner: float = PROBLEM.inner, outer: float = PROBLEM.outer) -> Specimen:
    """The reference annulus, radii in mm."""
    film = Film(PROBLEM.film_thickness * 1e-3, (PROBLEM.prestretch, PROBLEM.prestretch),
                Ogden((PROBLEM.mu * 1e6,), (2.0,)), 4.7)
    return Specimen(f"annulus {inner} {outer}", Circle(outer * 1e-3), Plate(Circle(inner * 1e-3)),
                    film)


def annulus(order: int, radial: int, around: int) -> CurvedTriangles:
    """The full annulus cut evenly in log r and angle into curved triangles, as the peers do."""
    i, j = np.meshgrid(np.arange(radial + 1), np.arange(around), indexing="ij")
    vertices = np.stack([i.ravel() / radial, j.ravel() / around])
    number = (np.arange(vertices.shape[1])).reshape(i.shape)
    a, b = number[:-1], number[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.sort(np.hstack([np.stack([a, b, c]).reshape(3, -1),
                                   np.stack([a, c, d]).reshape(3, -1)]), axis=0)
    local = vertices[:, triangles]
    # A triangle across the seam: its angles are taken from the same side.
    local[1] = np.where(local[1].max(axis=0) - local[1] > 0.5, local[1] + 1, local[1])
    xy = ELEMENTS[order].doflocs
    weights = np.column_stack([1 - xy.sum(axis=1), xy])
    mesh = curved_mesh(_place(vertices), triangles, order,
                       _place(np.einsum("lv,kve->kle", weights, local)))
    facets = mesh.boundary_facets()
    near = np.hypot(*mesh.p[:, mesh.facets[0, facets]]) < PROBLEM.inner * 1.5e-3
    return mesh.with_boundaries({"plate": facets[near], "frame": facets[~near]})


def _place(points: np.ndarray) -> np.ndarray:
    radius = PROBLEM.inner * 1e-3 * (PROBLEM.outer / PROBLEM.inner) ** points[0]
    return radius * np.stack([np.cos(2 * np.pi * points[1]), np.sin(2 * np.pi * points[1])])


def cold(mesh: CurvedTriangles, planes: frozenset[str] = frozenset()) -> Solution:
    """From a mesh in memory to the force on the plate."""
    model = Model(Discretisation.of(mesh, planes), specimen())
    outcome = held(model, HEAVE)
    assert outcome.status == "equilibrium", outcome.advice
    return Solution(model.discretisation.free_count, outcome.state.force)


def rows(repeat: int) -> list[Row]:
    """Cold solves of the full annulus, comparable with the peers' rows."""
    return [*_structured(repeat), *_gmsh(repeat, frozenset(), "full")]


def extras(repeat: int) -> list[Row]:
    """What no peer's row compares with: a quarter by symmetry, and a warm step."""
    return [*_gmsh(repeat, frozenset("xy"), "quarter by symmetry"), _warm(repeat)]


def _structured(repeat: int) -> Iterator[Row]:
    sizes = {2: ((4, 14), (6, 20), (16, 48)), 3: ((3, 12), (4, 16), (6, 24)),
             4: ((1, 4), (2, 5), (2, 6), (2, 8), (2, 12), (3, 16))}
    for order, meshes in sizes.items():
        peer = _peer(f"P{order} curved triangles, log-polar")
        yield from measure(peer, len(meshes), repeat,
                           lambda level, o=order, m=meshes: annulus(o, *m[level]), cold)


def _gmsh(repeat: int, planes: frozenset[str], words: str) -> Iterator[Row]:
    """The mesh a user gets, and one of elements half as large again."""

    def prepare(level: int) -> CurvedTriangles:
        return from_flat(mesh_film(specimen(), MeshSettings().refined((2 / 3, 1.0)[level]),
                                     planes))

    peer = _peer(f"P4, gmsh default mesh, {words}")
    yield from measure(peer, 2, repeat, prepare, lambda mesh: cold(mesh, planes))


def _warm(repeat: int) -> Row:
    """One more step of a path, 5 to 5.25 mm, on a mesh good to 1e-6: a sweep's price a state."""
    model = Model(Discretisation.of(annulus(4, 2, 6)), specimen())
    start = held(model, HEAVE).solution
    seconds = []
    for _ in range(max(50, repeat)):
        began = time.perf_counter()
        outcome = held(model, 1.05 * HEAVE, start=start)
        seconds.append(time.perf_counter() - began)
    force = outcome.state.force
    fine = held(Model(Discretisation.of(annulus(4, 4, 24)), specimen()), 1.05 * HEAVE).state.force
    peer = _peer("one warm step of a path")
    return Row(peer.name, peer.version, peer.method, model.discretisation.free_count, force,
               abs(force / fine - 1), min(seconds),
               "the warm step's error is against a finer mesh")


@dataclass(frozen=True)
class Aim:
    """A time the project means to keep below ``limit``, and what it took, both in seconds."""

    words: str
    limit: float
    seconds: float


def aims(measured: list[Row], others: list[Row]) -> list[Aim]:
    """The project's aims for the full annulus, one warm step and ten annuli with meshing."""

    def fastest(error: float) -> float:
        return min((row.seconds for row in measured if row.relative_error <= error),
                   default=float("inf"))

    seconds, worst = ten_annuli()
    return [
        Aim("full annulus to 2e-4, cold, without meshing", 0.009, fastest(2e-4)),
        Aim("full annulus to 1e-6, cold, without meshing", 0.008, fastest(1e-6)),
        Aim("warm step of a path", 0.0025,
            next(row.seconds for row in others if "warm" in row.method)),
        Aim(f"ten annuli, CAD, mesh and solve (errors <= {worst:.0e})", 0.35, seconds),
    ]


def ten_annuli() -> tuple[float, float]:
    """Seconds for ten different annuli in one process, CAD, meshing and solve to 5 mm.

    And the worst relative error. The fastest of three rounds counts, of which none has a mesh of an
    earlier one. The error is against a finer mesh of the same annulus, not timed.
    """
    cases = [specimen(8.0 + index, 40.0 + 2 * index) for index in range(10)]
    settings, times = Settings(), []
    for _ in range(3):
        meshed.cache_clear()
        with patch.dict(os.environ, {"TYMPAN_CACHE": ""}):
            build_model(specimen(7.0, 30.0), settings)
            began = time.perf_counter()
            forces = [held(build_model(case, settings), HEAVE).state.force for case in cases]
            times.append(time.perf_counter() - began)
    fine = Settings(MeshSettings().refined(2))
    errors = [abs(force / held(build_model(replace(case, name="fine"), fine), HEAVE).state.force
                  - 1)
              for case, force in zip(cases, forces, strict=True)]
    return min(times), max(errors)


def _peer(method: str) -> Peer:
    return Peer("tympan", version("tympan"), method, "")
