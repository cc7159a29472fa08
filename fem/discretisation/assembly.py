"""Element forces and tangents by batched contractions, and their sum as a sparse matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from tympan.base.arrays import AnyArray, Mask

#: Bytes of the largest temporary of one chunk, about what a core's second-level cache holds.
_CHUNK = 2**20

#: Pairs of components i ≤ j of the symmetric 3×3 blocks.
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def element_forces(gradients: AnyArray, f: AnyArray, stress: AnyArray) -> AnyArray:
    """Compute forces on the elements' nodes, shape (elements, local, 3).

    The arguments are ∂φ/∂X (elements, points, local, 2), F (elements, points, 3, 2) and the second
    Piola–Kirchhoff stress (S₁₁, S₂₂, S₁₂) times the point's volume, (elements, points, 3).
    """
    return gathered(gradients, first_piola(f, stress))


def first_piola(f: AnyArray, stress: AnyArray) -> AnyArray:
    """Multiply F S, by its two columns, shape (2, elements, points, 3)."""
    a, b = f[..., 0], f[..., 1]
    s11, s22, s12 = np.moveaxis(stress, -1, 0)[..., None]
    return np.stack([a * s11 + b * s12, a * s12 + b * s22])


def gathered(gradients: AnyArray, piola: AnyArray) -> AnyArray:
    """Gather stresses at the points into nodal forces, shape (elements, local, 3)."""
    first: AnyArray = np.matmul(gradients[..., 0].transpose(0, 2, 1), piola[0])
    second: AnyArray = np.matmul(gradients[..., 1].transpose(0, 2, 1), piola[1])
    return first + second


def element_tangents(gradients: AnyArray, f: AnyArray, stress: AnyArray, tangent: AnyArray,
                     volumes: AnyArray) -> AnyArray:
    """Compute the elements' tangents, shape (elements, 3 local, 3 local), node-major.

    Temporaries do not grow with the mesh. With A = ∂²ψ/∂F∂F an element's block for components i, j
    is Gᵀ A_ij G over its gradients G, and block ji is the transpose of block ij. Unlike for
    :func:`element_forces`, ``stress`` and its derivative by the strain, (elements, points, 3, 3),
    are to be multiplied by ``volumes``.
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


def _moduli(f: AnyArray, stress: AnyArray, tangent: AnyArray, volumes: AnyArray) -> AnyArray:
    """Compute ∂²ψ/∂F_iα∂F_jβ times volume, (elements, points, 12, 2): rows (α, ij), columns β."""
    a, b = np.ascontiguousarray(f.transpose(3, 2, 0, 1))
    d = tangent.transpose(2, 3, 0, 1) * volumes
    s = stress.transpose(2, 0, 1) * volumes
    # ∂S/∂F_jβ for both β: rows S₁₁, S₂₂, S₁₂, columns j.
    slopes = (d[:, 0, None] * a + d[:, 2, None] * b,
              d[:, 1, None] * b + d[:, 2, None] * a)
    result = np.empty((2, len(_PAIRS), 2, *volumes.shape))
    for pair, (i, j) in enumerate(_PAIRS):
        for beta, slope in enumerate(slopes):
            s11, s22, s12 = slope[:, j]
            result[0, pair, beta] = a[i] * s11 + b[i] * s12
            result[1, pair, beta] = b[i] * s22 + a[i] * s12
        if i == j:
            result[:, pair] += s[[0, 2, 2, 1]].reshape(2, 2, *volumes.shape)
    return result.transpose(3, 4, 0, 1, 2).reshape(*volumes.shape, 12, 2)


def _place(blocks: AnyArray, result: AnyArray) -> None:
    for pair, (i, j) in enumerate(_PAIRS):
        result[:, :, i, :, j] = blocks[:, :, pair]
        if i != j:
            result[:, :, j, :, i] = blocks[:, :, pair].transpose(0, 2, 1)


@dataclass(frozen=True, eq=False)
class SparsityPattern:
    """The tangent's sparsity, and the sum of element tangents as a sparse matrix.

    A tangent is symmetric. So three neighbours in a row of an element's tangent, the components of
    one node, are three neighbours in a column of the sparse one. ``gather`` adds up such triples:
    its index is a ninth of that of single entries, and it writes the sparse tangent once, from its
    beginning to its end. ``kept`` marks the entries that remain where only some components of a
    node are free; None if all are free.
    """

    gather: csr_matrix
    kept: Mask | None
    indices: AnyArray
    indptr: AnyArray

    @classmethod
    def of(cls, connectivity: AnyArray, free: Mask) -> SparsityPattern:
        """Build from nodes of the elements (elements, local) and the free components (nodes, 3)."""
        row, first, places = _node_pairs(connectivity, free)
        local = connectivity.shape[1]
        corner, across = np.divmod(places, local)
        column, source = connectivity.ravel()[corner], 3 * local * corner + across
        node, axis = np.nonzero(free)
        # One triple per free component and node it shares an element with, summed over its places.
        entry, lengths = _of_columns(column, node)
        source = source[entry] + local * np.repeat(axis, lengths)
        triple, degree = _of_columns(column[first], node)
        ends = _ends(np.diff(first, append=len(places))[triple])
        gather = csr_matrix((np.ones(len(source)), source.astype(np.int32), ends),
                            shape=(len(triple), 3 * local * connectivity.size))
        number = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1).astype(np.int32)
        indices = number[row].take(triple, axis=0).ravel()
        kept = indices >= 0
        return cls(gather, None if kept.all() else kept, indices[kept],
                   _ends(kept)[3 * _ends(degree)])

    def assemble(self, elements: AnyArray) -> csc_matrix:
        """Sum symmetric element tangents (elements, 3 local, 3 local) over free components."""
        data = (self.gather @ elements.reshape(-1, 3)).ravel()
        size = len(self.indptr) - 1
        return csc_matrix((data if self.kept is None else data[self.kept], self.indices,
                           self.indptr), (size, size))


def _node_pairs(connectivity: AnyArray, free: Mask) -> tuple[AnyArray, AnyArray, AnyArray]:
    """List pairs of nodes with unknowns that share an element, ordered by column, then row.

    The result is the row of each pair, and the start of each pair's run in the list of the places
    (element, column, row) where it occurs.
    column, row) where it occurs.
    """
    nodes, any_free = len(free), np.any(free, axis=1)[connectivity]
    both = np.flatnonzero(any_free[:, :, None] & any_free[:, None, :])
    column, row = connectivity.astype(np.int64)[:, :, None], connectivity[:, None, :]
    key = (column * nodes + row).ravel()[both]
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    return key[first] % nodes, first, both[order]


def _of_columns(column: AnyArray, chosen: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Find places of chosen columns in an ascending list, one after another, and their counts."""
    start = np.searchsorted(column, np.arange(int(chosen.max(initial=-1)) + 2))
    length = np.diff(start)[chosen]
    before = np.cumsum(length) - length
    return np.arange(length.sum()) + np.repeat(start[chosen] - before, length), length


def _ends(lengths: AnyArray) -> AnyArray:
    """Compute first and last indices of runs of given lengths."""
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
