"""Where the entries of the element tangents go in the sparse one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class SparsityPattern:
    """The tangent's sparsity, and the sum of element tangents as a sparse matrix.

    A tangent is symmetric, so three neighbours in a row of an element's tangent, the components of
    one node, are three neighbours in a column of the sparse one. ``gather`` adds up such triples:
    its index is a ninth of what single entries would need, and it writes the sparse tangent once,
    from its beginning to its end. ``kept`` marks the entries that remain where only some components
    of a node are free; None if all do.
    """

    gather: csr_matrix
    kept: NDArray[np.bool_] | None
    indices: Array
    indptr: Array

    @classmethod
    def of(cls, connectivity: Array, free: NDArray[np.bool_]) -> SparsityPattern:
        """Pattern of the free components.

        Parameters
        ----------
        connectivity
            Nodes of the elements, shape (elements, local).
        free
            Which nodal components are unknowns, shape (nodes, 3).
        """
        row, first, places = _node_pairs(connectivity, free)
        count = np.diff(first, append=len(places))
        column = connectivity.ravel()[places[first] // connectivity.shape[1]]
        start = np.searchsorted(column, np.arange(len(free) + 1))
        node, axis = np.nonzero(free)
        degree = np.diff(start)[node]
        # One triple per free component and node it meets: which pair, and which row of the pair's
        # block.
        triple = _runs(start[node], degree)
        entry = _runs(first[triple], count[triple])
        rows = np.repeat(np.repeat(axis, degree), count[triple])
        local = connectivity.shape[1]
        pair = places[entry]
        source = (pair // local * 3 + rows) * local + pair % local
        ends = np.concatenate([[0], np.cumsum(count[triple])])
        shape = len(triple), 3 * local * connectivity.size
        gather = csr_matrix((np.ones(len(source)), source.astype(np.int32), ends.astype(np.int32)),
                            shape=shape)
        kept = np.asarray(free[row[triple]])
        number = (np.cumsum(free.ravel(), dtype=np.int32) - 1).reshape(free.shape)
        lengths = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
        indptr = lengths[np.concatenate([[0], np.cumsum(degree)])]
        indices = number[row[triple]][kept]
        return cls(gather, None if kept.all() else kept.ravel(), indices, indptr.astype(np.int32))

    def assemble(self, elements: Array) -> csc_matrix:
        """The sparse tangent of free components, from symmetric (elements, 3 local, 3 local)."""
        data = (self.gather @ elements.reshape(-1, 3)).ravel()
        size = len(self.indptr) - 1
        return csc_matrix((data if self.kept is None else data[self.kept], self.indices,
                           self.indptr), (size, size))


def _node_pairs(connectivity: Array, free: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Pairs of nodes with unknowns that share an element, ordered by column, then row.

    Returns the row of each pair, and the start of each pair's run in the list of the places
    (element, column, row) where it occurs.
    """
    nodes, any_free = len(free), np.any(free, axis=1)[connectivity]
    both = np.flatnonzero(any_free[:, :, None] & any_free[:, None, :])
    key = (connectivity.astype(np.int64)[:, :, None] * nodes + connectivity[:, None,
                                                                            :]).ravel()[both]
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    return key[first] % nodes, first, both[order]


def _runs(start: Array, length: Array) -> Array:
    """The integers start[k], …, start[k] + length[k] − 1 for each k in turn."""
    before = np.cumsum(length) - length
    return np.asarray(np.arange(length.sum()) + np.repeat(start - before, length))
