"""Elimination order of a mesh's nodes by nested dissection."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import AnyArray

#: Directions tried for each cut; four leave 5 % more fill-in than eight, and more than eight gain
#: nothing.
_DIRECTIONS = 8


def elimination_order(connectivity: AnyArray, points: AnyArray) -> AnyArray:
    """Order nodes so that elimination fills in O(n log n) entries, n nodes in a plane.

    The elements, shape (elements, local) with the three corners first, are halved again and again;
    nodes that two halves share are eliminated after both of them (A. George, "Nested dissection of
    a regular finite element mesh", SIAM J. Numer. Anal. 10 (1973) 345–363). ``points`` are the
    nodes' plane positions, shape (nodes, 2).

    Examples
    --------
    The nodes of one of two triangles alone come first, then those of the other, then their common
    edge:

    >>> import numpy as np
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    >>> elimination_order(np.array([[0, 1, 2], [0, 2, 3]]), square).tolist()
    [3, 1, 0, 2]
    """
    if not len(connectivity):
        return np.arange(len(points))
    codes = _bisected(connectivity, points)
    low, high = _Sharing.of(connectivity).ends(codes)
    # Elements 1011 and 1001 differ from their third-last digit on: their common nodes belong to
    # part 10xx, whose end is 1011.
    levels = np.frexp((low ^ high).astype(float))[1].astype(np.int64)
    ends = high | ((np.int64(1) << levels) - 1)
    return np.unique(connectivity)[np.lexsort((levels, ends))]


def _bisected(connectivity: AnyArray, points: AnyArray) -> AnyArray:
    """Compute the code of each element: the sides it fell on, cut after cut, as binary digits."""
    angles = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    along = directions @ points[connectivity].mean(axis=1).T
    ranks = np.argsort(np.argsort(along, kind="stable"), kind="stable")
    codes = np.zeros(len(connectivity), dtype=np.int64)
    corners = _Sharing.of(connectivity[:, :3])
    for level in range(int(np.ceil(np.log2(len(codes))))):
        trials = _halved(codes, ranks)
        cuts = _cuts(*corners.ends(trials), 1 << level)
        codes = np.take_along_axis(trials, cuts.argmin(axis=0)[codes][None], axis=0)[0]
    return codes


def _halved(codes: AnyArray, ranks: AnyArray) -> AnyArray:
    """Append a digit to the codes: 1 in the half of each part that ranks higher.

    The ranks are those along each direction, shape (directions, elements).
    """
    order = np.argsort(codes * len(codes) + ranks)
    parts = codes[order[0]]  # in ascending order, the same in all directions
    size = np.bincount(parts)
    within = np.arange(len(parts)) - (np.cumsum(size) - size)[parts]
    result = np.empty_like(ranks)
    np.put_along_axis(result, order, (2 * parts + (2 * within >= size[parts]))[None], axis=1)
    return result


def _cuts(low: AnyArray, high: AnyArray, parts: int) -> AnyArray:
    """Count the nodes within each part that the last digit divides, (directions, parts).

    The arguments are the ends of the nodes in each direction, (directions, nodes).
    """
    direction, node = np.nonzero((low ^ high) == 1)
    part = direction * parts + (low[direction, node] >> 1)
    return np.bincount(part, minlength=len(low) * parts).reshape(len(low), parts)


@dataclass(frozen=True, eq=False)
class _Sharing:
    """The elements of each node that has any, one node after another."""

    elements: AnyArray
    starts: AnyArray

    @classmethod
    def of(cls, connectivity: AnyArray) -> _Sharing:
        order = np.argsort(connectivity, axis=None, kind="stable")
        nodes = connectivity.ravel()[order]
        return cls(order // connectivity.shape[1], np.flatnonzero(np.diff(nodes, prepend=-1)))

    def ends(self, codes: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Find the smallest and largest code of the elements of each node, along the last axis."""
        spread = codes[..., self.elements]
        return (np.minimum.reduceat(spread, self.starts, axis=-1),
                np.maximum.reduceat(spread, self.starts, axis=-1))
