"""The air that swings with a film without plate: an added mass for each pair of its modes.

Frame and stand are a baffle and the air is still, far below the frequency at which sound is as long
as the film. On each side its kinetic energy is ½ ρ/(2π) ∬ v(x) v(x') / |x − x'| dA dA' with the
velocity v along the load (Lamb, Proc. R. Soc. A 98, 1920, 205). Modes in vacuo are the basis in
which film and air swing together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import isoparametric, middles, tabulated
from tympan.fem.vibration.modes import Modes

Array = NDArray[np.float64]

#: Triangles into which elements are cut, along an edge; the finer cut has twice as many.
_PARTS = 3

#: Rows of the kernel at once.
_ROWS = 512


def with_air(mesh: Discretisation, modes: Modes, density: float, count: int) -> Modes:
    """The lowest modes of film and air [kg/m³] among combinations of the film's own.

    ``mesh`` is that of the whole film. Shapes are normalised to film and air together.
    """
    stiffness = (2 * np.pi * modes.frequencies_Hz) ** 2 - modes.growth**2
    inertia = np.eye(len(stiffness)) + air_masses(mesh, modes.shapes[..., 2], density)
    values, mixes = scipy.linalg.eigh(np.diag(stiffness), inertia)
    chosen = slice(0, count)
    mixed = mixes[:, chosen].T
    return replace(modes, frequencies_Hz=np.sqrt(np.maximum(values[chosen], 0)) / (2 * np.pi),
                   growth=np.sqrt(np.maximum(-values[chosen], 0)),
                   shapes=np.tensordot(mixed, modes.shapes, axes=1),
                   plate=mixed @ modes.plate, shares=modes.shares[chosen])


def air_masses(mesh: Discretisation, heights: Array, density: float) -> Array:
    """Of the air on both sides, for motions along the load of the nodes (motions, nodes).

    Shape (motions, motions), kg where the motions have no unit. The midpoint rule's error halves
    with the triangles, so that two of them leave little of it.
    """
    coarse, fine = (_midpoint_rule(mesh, heights, parts) for parts in (_PARTS, 2 * _PARTS))
    return np.asarray(density / np.pi * (2 * fine - coarse))


def _midpoint_rule(mesh: Discretisation, heights: Array, parts: int) -> Array:
    """∬ v v' / |x − x'| dA dA'; of a triangle with itself that of the disc of its area."""
    order, points = mesh.mesh.order, middles(parts)
    corners = mesh.reference[mesh.connectivity, :2]
    areas = isoparametric(order, points, corners)[1]
    areas = (areas * (mesh.weights.sum(axis=1) / areas.sum(axis=1))[:, None]).ravel()
    shapes = tabulated(order, points)[0]
    places = np.einsum("lp,elx->epx", shapes, corners).reshape(-1, 2)
    flow = (heights[:, mesh.connectivity] @ shapes).reshape(len(heights), -1) * areas
    result = flow / areas * (2 * np.sqrt(np.pi * areas)) @ flow.T
    for start in range(0, len(places), _ROWS):
        rows = slice(start, start + _ROWS)
        distance = np.linalg.norm(places[rows, None] - places, axis=2)
        inverse = np.divide(1.0, distance, out=np.zeros_like(distance), where=distance > 0)
        result += flow[:, rows] @ inverse @ flow.T
    return np.asarray(result)
