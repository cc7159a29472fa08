"""The geometry of curved triangles from their nodes, for nodes that may be complex."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import CurvedTriangles

Array = NDArray[Any]


def isoparametric(mesh: CurvedTriangles, points: Array, weights: Array, nodes: Array) -> tuple[Array, Array]:
    """Gradients of the shape functions and areas at quadrature points, of nodes that may be complex.

    Parameters
    ----------
    points, weights
        Quadrature on the reference triangle, shapes (2, points) and (points,).
    nodes
        Of the elements, shape (elements, local, 2) [m].

    Returns
    -------
    gradients
        Shape (elements, points, local, 2) [1/m].
    weights
        Shape (elements, points) [m²].
    """
    element = mesh.elem()
    slopes = np.stack([element.lbasis(points, number)[1] for number in range(nodes.shape[1])])
    jacobian = np.einsum("elc,lkp->epck", nodes, slopes)
    (a, b), (c, d) = np.moveaxis(jacobian, (2, 3), (0, 1))
    determinant = a * d - b * c
    inverse = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2) / determinant[..., None, None]
    gradients = np.matmul(slopes.transpose(2, 0, 1)[None], inverse)
    return gradients, determinant * np.sign(determinant.real) * weights
