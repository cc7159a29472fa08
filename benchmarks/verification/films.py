"""Specimens, structured meshes and solves the claims share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tests.oracles import axisymmetric
from tests.oracles.inflation import Disc
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import newton
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import edge_fields
from tympan.geometry.mesh import ELEMENTS, CurvedTriangles, curved_mesh
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Material, Plate, Specimen

A, B, T, ROOT5, PERMITTIVITY = 10e-3, 45e-3, 1e-3, math.sqrt(5), 4.7
G = 9.80665
#: Shear modulus [Pa] of the neo-Hooke film where a claim is not about materials.
MU = 20e3


def annulus(material: Material, **film: Any) -> Specimen:
    """The annulus of 10 mm to 45 mm, 1 mm thick before it is stretched by √5."""
    values = {"thickness": T, "prestretch": (ROOT5, ROOT5), "relative_permittivity": PERMITTIVITY}
    return Specimen("annulus", Circle(B), Plate(Circle(A)),
                    Film(material=material, **(values | film)))


def oracle(material: axisymmetric.Material) -> axisymmetric.Film:
    """The same for the axisymmetric equations."""
    return axisymmetric.Film(A, B, T, ROOT5, material, PERMITTIVITY)


def rim_peak(model: Model, state: State) -> float:
    """Largest elastic principal true stress around the plate [Pa]."""
    fields, _ = edge_fields(model, state, "plate")
    return float((fields.stress_1 + fields.maxwell_stress).max())


def quarter_annulus(order: int, count: int) -> Model:
    """A quarter cut evenly in log r and in angle, ``count`` by ``count``: meshes of one family."""
    s, t = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1), indexing="ij")
    number = np.arange(s.size).reshape(s.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.hstack([np.stack([a, b, c]).reshape(3, -1), np.stack([a, c, d]).reshape(3, -1)])

    def place(unit: np.ndarray) -> np.ndarray:
        radius, angle = A * (B / A) ** unit[0], np.pi / 2 * unit[1]
        return radius * np.stack([np.cos(angle), np.sin(angle)])

    mesh = _curved(order, np.stack([s.ravel(), t.ravel()]), triangles, place)
    tagged = _tagged(mesh, math.sqrt(A * B))
    return Model(Discretisation.of(tagged, frozenset("xy")), annulus(NeoHooke(MU)))


def quarter_disc(order: int, count: int, radius: float, film: Film) -> Model:
    """A quarter of a disc without a plate, ``count`` elements along the radius.

    Its edge is held as a plate's is.
    """
    corners = np.array([(i, j) for i in range(count + 1) for j in range(count + 1 - i)])
    number = {tuple(corner): k for k, corner in enumerate(corners)}
    cells = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in corners if i + j < count]
    cells += [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i, j in corners if i + j < count - 1]
    triangles = np.array([[number[corner] for corner in cell] for cell in cells]).T

    def place(unit: np.ndarray) -> np.ndarray:
        # Straight at the centre, round at the edge, and smooth between.
        s = unit.sum(axis=0)
        angle = np.pi / 2 * unit[1] / np.where(s == 0, 1, s)
        return radius * ((1 - s**2) * unit + s**3 * np.stack([np.cos(angle), np.sin(angle)]))

    mesh = _tagged(_curved(order, corners.T / count, triangles, place), 2 * radius)
    disc = Specimen("disc", Circle(radius), Plate(Circle(radius / 10)), film)
    return Model(Discretisation.of(mesh, frozenset("xy")), disc)


def bulge(model: Model, pressures: list[float], apex: float) -> list[float]:
    """Apex heights [m] above the frame at rising gas pressures [Pa], from a guess of the first."""
    x, y, _ = model.discretisation.reference.T
    positions = model.discretisation.reference.copy()
    positions[:, 2] = -apex * (1 - (x**2 + y**2) / model.size**2)
    state = State(positions, model.mounted().plate)
    heights = []
    for pressure in pressures:
        solution = newton(model, state.under(pressure=pressure), ("force",), (held_plate(0.0),))
        if not solution.converged:
            raise ArithmeticError(solution.advice)
        state = solution.state
        heights.append(float(-state.positions[:, 2].min()))
    return heights


def _curved(order: int, unit: np.ndarray, triangles: np.ndarray, place: Any) -> CurvedTriangles:
    triangles = np.sort(triangles, axis=0)
    xy = ELEMENTS[order].doflocs
    weights = np.column_stack([1 - xy.sum(1), xy])
    return curved_mesh(place(unit), triangles, order,
                       place(np.einsum("lv,kve->kle", weights, unit[:, triangles])))


def _tagged(mesh: CurvedTriangles, between: float) -> CurvedTriangles:
    """Names of the edges; the plate's arc lies within the radius ``between``."""
    facets = mesh.boundary_facets()
    x, y = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    tiny = 1e-9 * mesh.p.max()
    arc, near = (x > tiny) & (y > tiny), np.hypot(x, y) < between
    return mesh.with_boundaries({"axis_x": facets[y <= tiny], "axis_y": facets[x <= tiny],
                                 "plate": facets[arc & near],
                                 "frame": facets[arc & ~near]})


def disc(radius: float, thickness: float, material: axisymmetric.Material) -> Disc:
    """An unstretched disc for the axisymmetric equations."""
    return Disc(0.0, radius, thickness, 1.0, material)
