"""Tilts of plates of many sizes by shapes that belong to one plate.

The shapes of a family are motions of nodes, the same for all films. They turn the plate of one film
rigidly to first order. Another film's plate, which is larger or turned, tilts by another angle when
its nodes move as far, and its edge contracts by another amount, in proportion to the angle's
square. Where edges of the electrode's segments meet the plate, nodes slide along it from film to
film: they then also move along the load, in proportion to the angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.fem.derivatives.shape import with_plate
from tympan.fem.membrane.model import Model

#: Plate freedoms that are tilts.
TURNS = slice(3, 5)

#: Number of the motions by squares of tilts.
_BENDS = 4
#: Least slide of nodes along the plate's edge over its extent that counts.
_SLID = 1e-5

#: Height of an arm (x, y) by tilts about x and y: y times the first less x times the second.
_ROUND = np.array([[0.0, -1.0], [1.0, 0.0]])
#: Matrix that moves an arm in the plane by the squares of tilts about x and y: its second
#: derivatives by them, (2, 2, 2, 2). It is half of ω × (ω × r).
_SQUARES = np.array([[[[0.0, 0.0], [0.0, -1.0]], [[0.0, 0.5], [0.5, 0.0]]],
                     [[[0.0, 0.5], [0.5, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]]])


@dataclass(frozen=True, eq=False)
class Tilting:
    """How the plates of films tilt by the tilts p of the plate that their shapes belong to.

    ``slants``: tilts by p, (films, 2, 2). ``leans`` and ``bends``: first and second derivatives at
    p = 0 of the amplitudes of :func:`motions_by_tilt`, (films, bends, 2) and (films, bends, 2, 2).
    Arrays have one film where all plates are alike.
    """

    slants: AnyArray
    leans: AnyArray
    bends: AnyArray

    @classmethod
    def of(cls, arms: AnyArray, others: AnyArray, slides: AnyArray, mirrored: bool) -> Self:
        """Make it from the arms of nodes on the plate's edge [m], (nodes, 2), and of other plates.

        The others' have the shape (films, nodes, 2). A plate of another size, or a turned one, has
        the arms of the first one times a matrix, apart from what nodes slide along its edge:
        ``slides`` of :func:`slides_of`, (slides, nodes). ``mirrored``: the nodes are those of a
        half or a quarter of the plate.
        """
        count = _BENDS + len(slides)
        if not len(arms):
            return cls(np.eye(2)[None], np.zeros((1, count, 2)), np.zeros((1, count, 2, 2)))
        matrices = (_products(others, arms, mirrored)
                    @ np.linalg.inv(_products(arms, arms, mirrored)))
        own = others @ _ROUND
        slants = np.linalg.solve(_products(own, own, mirrored),
                                 _products(own, arms @ _ROUND, mirrored))
        leans, bends = np.zeros((len(others), count, 2)), np.zeros((len(others), count, 2, 2))
        leans[:, _BENDS:] = slides @ (own @ slants - arms @ _ROUND)
        bends[:, :_BENDS] = np.einsum("ikab,nac,nbd,nkj->nijcd", _SQUARES, slants, slants, matrices
                                      ).reshape(len(others), _BENDS, 2, 2)
        return cls(slants, leans, bends)

    def amplitudes(self, films: AnyArray, turns: AnyArray) -> AnyArray:
        """Compute the amplitudes of the bends, (states, bends), by p, (states, 2)."""
        mean = (each_of(self.leans, films) + self.slopes(films, turns)) / 2
        return np.asarray(np.einsum("smi,si->sm", mean, turns))

    def slopes(self, films: AnyArray, turns: AnyArray) -> AnyArray:
        """Compute derivatives of these amplitudes by p, (states, bends, 2)."""
        bent = (each_of(self.bends, films) @ turns[:, None, :, None])[..., 0]
        return np.asarray(each_of(self.leans, films) + bent)


def each_of(values: AnyArray, films: AnyArray) -> AnyArray:
    """Select values of some films, (states, …); values of one film are those of all."""
    return values if len(values) == 1 else values[films]


def _products(left: AnyArray, right: AnyArray, mirrored: bool) -> AnyArray:
    """Multiply components of arms, summed over all nodes, (…, 2, 2).

    Those of x with y cancel between a part of a plate and its mirror image, on which no nodes are.
    """
    products = np.swapaxes(left, -1, -2) @ right
    return products * np.eye(2) if mirrored else products


def slides_of(arms: AnyArray, others: Sequence[AnyArray], mirrored: bool) -> Array:
    """Find how heights of nodes on the plate's edge change by slides, (slides, nodes), orthonormal.

    ``arms`` of the nodes of the first plate [m], (nodes, 2), and of other plates, (nodes, 2) each;
    ``mirrored`` as in :meth:`Tilting.of`.
    """
    if not len(arms):
        return np.zeros((0, len(arms)))
    apart = []
    for other in others:
        matrix = np.linalg.solve(_products(other, other, mirrored),
                                 _products(other, arms, mirrored))
        apart.append((other @ matrix - arms).T)
    _, sizes, ways = np.linalg.svd(np.concatenate(apart), full_matrices=False)
    return np.asarray(ways[sizes > _SLID * np.abs(arms).max()])


def motions_by_tilt(model: Model, slides: Array) -> Array:
    """Compute motions of the nodes that keep tilted plates rigid, (4 + slides, nodes, 3) [m].

    The first four, by the squares of tilts, move the plate's edge in x or y in proportion to an
    arm's x or y. The others move it along the load by ``slides``. They decrease smoothly to zero at
    the other edges. Without tilts the shape is (0, nodes, 3).
    """
    mesh, arms = model.discretisation, model.arms[:, :2]
    if not set(range(6)[TURNS]) & set(model.plate_freedoms):
        return np.zeros((0, *mesh.reference.shape))
    bends = np.zeros((_BENDS + len(slides), *mesh.reference.shape))
    for number, bend in enumerate(bends[:_BENDS]):
        way = np.zeros((2, 2))
        way.flat[number] = 1.0
        bend[:, :2] = with_plate(mesh, arms @ way.T)
    for bend, slide in zip(bends[_BENDS:], slides, strict=True):
        bend[:, 2] = with_plate(mesh, np.column_stack([slide, slide]))[:, 0]
    return bends
