"""Tilts of plates of many sizes by shapes that belong to one plate.

The shapes of a family are motions of nodes, the same for all films. They turn the plate of one film
rigidly to first order. Another film's plate, which is larger or turned, tilts by another angle when
its nodes move as far, and its edge contracts by another amount, in proportion to the angle's
square.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.fem.derivatives.shape import with_plate
from tympan.fem.membrane.model import Model

#: Plate freedoms that are tilts.
TURNS = slice(3, 5)

#: Height of an arm (x, y) by tilts about x and y: y times the first less x times the second.
_ROUND = np.array([[0.0, -1.0], [1.0, 0.0]])
#: Matrix that moves an arm in the plane by the squares of tilts about x and y: its second
#: derivatives by them, (2, 2, 2, 2). It is half of ω × (ω × r).
_SQUARES = np.array([[[[0.0, 0.0], [0.0, -1.0]], [[0.0, 0.5], [0.5, 0.0]]],
                     [[[0.0, 0.5], [0.5, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]]])


@dataclass(frozen=True, eq=False)
class Tilting:
    """How the plates of films tilt by the tilts p of the plate that their shapes belong to.

    ``slants``: tilts by p, (films, 2, 2). ``bends``: second derivatives by p of the amplitudes of
    :func:`motions_by_tilt`, (films, bends, 2, 2). Arrays have one film where all plates are alike.
    """

    slants: AnyArray
    bends: AnyArray

    @classmethod
    def of(cls, arms: AnyArray, others: AnyArray) -> Self:
        """Make it from the arms of nodes on the plate's edge [m], (nodes, 2), and of other plates.

        The others' have the shape (films, nodes, 2). A plate of another size, or a turned one, has
        the arms of the first one times a matrix.
        """
        if not len(arms):
            return cls(np.eye(2)[None], np.zeros((1, 4, 2, 2)))
        matrices = np.swapaxes(others, 1, 2) @ arms @ np.linalg.inv(arms.T @ arms)
        own = others @ _ROUND
        slants = np.linalg.solve(np.swapaxes(own, 1, 2) @ own,
                                 np.swapaxes(own, 1, 2) @ (arms @ _ROUND))
        bends = np.einsum("ikab,nac,nbd,nkj->nijcd", _SQUARES, slants, slants, matrices)
        return cls(slants, bends.reshape(len(others), 4, 2, 2))

    def amplitudes(self, films: AnyArray, turns: AnyArray) -> AnyArray:
        """Compute the amplitudes of the bends, (states, bends), by p, (states, 2)."""
        return np.asarray(np.einsum("smi,si->sm", self.slopes(films, turns), turns) / 2)

    def slopes(self, films: AnyArray, turns: AnyArray) -> AnyArray:
        """Compute derivatives of these amplitudes by p, (states, bends, 2)."""
        return np.asarray((each_of(self.bends, films) @ turns[:, None, :, None])[..., 0])


def each_of(values: AnyArray, films: AnyArray) -> AnyArray:
    """Select values of some films, (states, …); values of one film are those of all."""
    return values if len(values) == 1 else values[films]


def motions_by_tilt(model: Model) -> Array:
    """Compute motions of the nodes by the squares of the plate's tilts, (4, nodes, 3) [m].

    Each moves the plate's edge in x or y in proportion to an arm's x or y, and decreases smoothly
    to zero at the other edges. Without tilts the shape is (0, nodes, 3).
    """
    mesh, arms = model.discretisation, model.arms[:, :2]
    if not set(range(6)[TURNS]) & set(model.plate_freedoms):
        return np.zeros((0, *mesh.reference.shape))
    bends = np.zeros((4, *mesh.reference.shape))
    for number, bend in enumerate(bends):
        way = np.zeros((2, 2))
        way.flat[number] = 1.0
        bend[:, :2] = with_plate(mesh, arms @ way.T)
    return bends
