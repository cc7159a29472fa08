"""Element forces and tangents by batched contractions, in chunks that stay in cache."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: Bytes of the largest temporary of one chunk, about what a core's second-level cache holds.
_CHUNK = 2**20

#: Pairs of components i ≤ j of the symmetric 3×3 blocks.
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def element_forces(gradients: Array, f: Array, stress: Array) -> Array:
    """Forces on the elements' nodes, shape (elements, local, 3).

    Parameters
    ----------
    gradients
        ∂φ/∂X, shape (elements, points, local, 2).
    f
        Deformation gradient, shape (elements, points, 3, 2).
    stress
        Second Piola–Kirchhoff (S₁₁, S₂₂, S₁₂) times the volume of the point, shape (elements,
        points, 3).
    """
    return gathered(gradients, first_piola(f, stress))


def first_piola(f: Array, stress: Array) -> Array:
    """F S by its two columns, shape (2, elements, points, 3)."""
    a, b, s = f[..., 0], f[..., 1], stress[..., None]
    return np.stack([a * s[..., 0, :] + b * s[..., 2, :], a * s[..., 2, :] + b * s[..., 1, :]])


def gathered(gradients: Array, piola: Array) -> Array:
    """What stresses at the points do to the elements' nodes, shape (elements, local, 3)."""
    return np.asarray(np.matmul(gradients[..., 0].transpose(0, 2, 1), piola[0])
                      + np.matmul(gradients[..., 1].transpose(0, 2, 1), piola[1]))


def element_tangents(gradients: Array, f: Array, stress: Array, tangent: Array,
                     volumes: Array) -> Array:
    """Tangents of the elements, shape (elements, 3 local, 3 local), node-major.

    Temporaries do not grow with the mesh. With A = ∂²ψ/∂F∂F an element's block for components i, j
    is Gᵀ A_ij G over its gradients G, and block ji is the transpose of block ij.

    Parameters
    ----------
    gradients, f
        As in :func:`element_forces`.
    stress, tangent
        Second Piola–Kirchhoff stress (elements, points, 3) and its derivative by the strain
        (elements, points, 3, 3).
    volumes
        Of the points, shape (elements, points).
    """
    elements, points, local, _ = gradients.shape
    result = np.empty((elements, 3 * local, 3 * local))
    step = max(1, _CHUNK // (8 * points * 2 * len(_PAIRS) * local))
    for start in range(0, elements, step):
        part = slice(start, start + step)
        g = np.ascontiguousarray(gradients[part].transpose(0, 1, 3, 2))
        moduli = _moduli(f[part], stress[part], tangent[part], volumes[part])
        right = np.matmul(moduli, g).reshape(len(g), points * 2, len(_PAIRS) * local)
        blocks = np.matmul(g.reshape(len(g), points * 2, local).transpose(0, 2, 1), right)
        _place(blocks.reshape(len(g), local, len(_PAIRS), local),
               result[part].reshape(len(g), local, 3, local, 3))
    return result


def _moduli(f: Array, stress: Array, tangent: Array, volumes: Array) -> Array:
    """∂²ψ/∂F_iα∂F_jβ times volume, (elements, points, 12, 2): rows (α, pair ij), columns β."""
    a, b = np.ascontiguousarray(np.moveaxis(f, (-1, -2), (0, 1)))
    d = np.ascontiguousarray(np.moveaxis(tangent, (-2, -1), (0, 1))) * volumes
    s = np.ascontiguousarray(np.moveaxis(stress, -1, 0)) * volumes
    # ∂S/∂F_jβ, rows S₁₁, S₂₂, S₁₂.
    by = d[:, 0, None] * a + d[:, 2, None] * b, d[:, 1, None] * b + d[:, 2, None] * a
    result = np.empty((2, len(_PAIRS), 2, *volumes.shape))
    for pair, (i, j) in enumerate(_PAIRS):
        for beta in range(2):
            result[0, pair, beta] = a[i] * by[beta][0, j] + b[i] * by[beta][2, j]
            result[1, pair, beta] = b[i] * by[beta][1, j] + a[i] * by[beta][2, j]
        if i == j:
            result[:, pair] += s[[0, 2, 2, 1]].reshape(2, 2, *volumes.shape)
    return np.ascontiguousarray(np.moveaxis(result, (0, 1, 2),
                                            (-3, -2, -1))).reshape(*volumes.shape, 12, 2)


def _place(blocks: Array, result: Array) -> None:
    """Put (elements, local, pair, local) into (elements, local, 3, local, 3)."""
    for pair, (i, j) in enumerate(_PAIRS):
        result[:, :, i, :, j] = blocks[:, :, pair]
        if i != j:
            result[:, :, j, :, i] = blocks[:, :, pair].transpose(0, 2, 1)
