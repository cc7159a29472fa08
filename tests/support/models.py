"""Discretised films the tests share, and states they are brought into."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tests.support.specimens import circular
from tympan.fem.derivatives.quantities import FUNCTIONALS
from tympan.fem.derivatives.sensitivity import gradient
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.newton import Solution, moved
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import PlateMotion, State
from tympan.geometry.mesh import ELEMENTS, CurvedTriangles, curved_mesh
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model


def model(specimen: Specimen, *, symmetry: bool = True, refine: float = 1.0,
          order: int = 4) -> Model:
    """The model at the default mesh, refined."""
    return build_model(specimen,
                       Settings(MeshSettings(order=order).refined(refine), symmetry=symmetry))


def pressed_model(specimen: Specimen, *, refine: float = 1.0) -> Model:
    """The same of a film that bears compression instead of wrinkling."""
    return replace(model(specimen, refine=refine), wrinkles=False)


def structured_mesh(order: int, cells: tuple[int, int],
                    place: Callable[[np.ndarray], np.ndarray]) -> CurvedTriangles:
    """The unit square cut evenly into cells of two triangles, its points (2, ...) placed."""
    first, second = cells
    s, t = np.meshgrid(np.linspace(0, 1, first + 1), np.linspace(0, 1, second + 1), indexing="ij")
    number = np.arange(s.size).reshape(s.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.sort(np.hstack([np.stack([a, b, c]).reshape(3, -1),
                                   np.stack([a, c, d]).reshape(3, -1)]), axis=0)
    unit = np.stack([s.ravel(), t.ravel()])
    xy = ELEMENTS[order].doflocs
    weights = np.column_stack([1 - xy.sum(1), xy])
    nodes = place(np.einsum("lv,kve->kle", weights, unit[:, triangles]))
    return curved_mesh(place(unit), triangles, order, nodes)


def structured_quarter(order: int, radial: int, around: int) -> Model:
    """A quarter annulus cut evenly in log r and in angle: one family, for orders of convergence."""
    def place(points: np.ndarray) -> np.ndarray:
        r, angle = 10e-3 * 4.5 ** points[0], np.pi / 2 * points[1]
        return np.stack([r * np.cos(angle), r * np.sin(angle)])

    mesh = structured_mesh(order, (radial, around), place)
    facets = mesh.boundary_facets()
    x, y = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    # An arc's chord has its middle inside the quarter, off both axes.
    arc, near = (x > 1e-6) & (y > 1e-6), np.hypot(x, y) < 20e-3
    tags = {"axis_x": facets[y <= 1e-6], "axis_y": facets[x <= 1e-6],
            "plate": facets[arc & near], "frame": facets[arc & ~near]}
    return Model(Discretisation.of(mesh.with_boundaries(tags), frozenset("xy")), circular())


def deformed(film: Model, seed: int = 0) -> tuple[np.ndarray, PlateMotion]:
    """A smooth, large, asymmetric deformation with the plate moved in all six freedoms."""
    rng = np.random.default_rng(seed)
    motion = np.array([1e-3, -0.5e-3, 4e-3, 0.1, -0.15, 0.2])
    plate = PlateMotion.rest().moved(motion)
    x = film.discretisation.reference / film.size
    waves = sum(rng.normal(size=3) * np.sin(rng.normal(size=2) @ x[:, :2].T * 2)[:, None]
                for _ in range(4))
    mesh = film.discretisation
    positions = mesh.reference + 1.5e-3 * waves * mesh.unknowns.movable
    return film.place(positions, plate), plate


def loaded(film: Model, seed: int = 0) -> State:
    """A state far from equilibrium under all loads, moved only as the model allows."""
    rng = np.random.default_rng(seed)
    start = film.mounted().under(force=0.3, voltage=2500.0**2, pressure=60.0)
    size = np.array([1e-3, -0.5e-3, 4e-3, 0.1, -0.15, 0.2])[list(film.plate_freedoms)]
    x = film.discretisation.reference / film.size
    waves = sum(rng.normal(size=3) * np.cos(rng.normal(size=2) @ x[:, :2].T * 2)[:, None]
                for _ in range(4))
    return moved(film, start, (1.5e-3 * waves[film.discretisation.free], size))


def deflection_gradient(film: Model, at: Outcome | Solution | State,
                        names: Sequence[str]) -> dict[str, float]:
    """Derivatives of the deflection at constant loads by named parameters [m per SI unit]."""
    return gradient(film, at, FUNCTIONALS["heave"], names)
