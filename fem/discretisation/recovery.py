"""Values at the corners of elements, recovered from those at the quadrature points around.

A polynomial, a degree below the elements' own, is fitted to the values in all elements that meet in
the corner on the same side of an electrode's edge (Zienkiewicz and Zhu, Int. J. Numer. Methods
Eng. 33, 1331, 1992).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.discretisation.electrode_edge import CORNERS


@dataclass(frozen=True, eq=False)
class Recovery:
    """Weights of the values around each corner, computed once for each corner when needed.

    ``connectivity`` (elements, local); ``parts``, a number for each part of the electrode and one
    for bare film, (elements,); ``nodes`` (nodes, 2) and ``places``
    (elements, points, 2) are the positions of nodes and quadrature points, complex where the mesh
    is; ``order`` is that of the elements.
    """

    connectivity: AnyArray
    parts: AnyArray
    nodes: AnyArray
    places: AnyArray
    order: int
    _known: dict[int, tuple[AnyArray, AnyArray]] = field(default_factory=dict, init=False,
    repr=False)

    def recovered(self, values: AnyArray, elements: AnyArray) -> AnyArray:
        """Recover values at the corners of some elements from the quadrature points around.

        ``values`` (k, elements, points), the result (k, elements, 3).
        """
        result = np.empty((len(values), len(elements), CORNERS))
        done: dict[int, AnyArray] = {}
        for row, element in enumerate(elements.tolist()):
            for corner in range(CORNERS):
                side = int(self._sides[element, corner])
                if side not in done:
                    around, weights = self.at(element, corner)
                    done[side] = np.tensordot(values[:, around], weights, axes=2)
                result[:, row, corner] = done[side]
        return result

    def at(self, element: int, corner: int) -> tuple[AnyArray, AnyArray]:
        """Find the elements around a corner, and the weights of their points, (elements, points).

        The recovered value is the sum of weights times values. It has derivatives by complex steps
        of the nodes' places.
        """
        side = int(self._sides[element, corner])
        if side not in self._known:
            self._known[side] = self._fitted(side, self.connectivity[element, corner])
        return self._known[side]

    @cached_property
    def _sides(self) -> AnyArray:
        """A number for each corner of each element, the same on one side of an electrode's edge."""
        count = 1 + self.parts.max(initial=0)
        sides: AnyArray = count * self.connectivity[:, :CORNERS] + self.parts[:, None]
        return sides

    def _fitted(self, side: int, node: int) -> tuple[AnyArray, AnyArray]:
        around = np.flatnonzero((self._sides == side).any(axis=1))
        places = self.places[around]
        away = places - self.nodes[node]
        powers = _powers(away.reshape(-1, 2) / np.abs(away).max(), self.order - 1)
        inverse = np.linalg.pinv(powers.real)
        weights = inverse[0]
        if np.iscomplexobj(powers):
            # d(A⁺) = −A⁺ dA A⁺ + (AᵀA)⁻¹ dAᵀ (1 − A A⁺), of which the first row is needed.
            change, residual = powers.imag, np.eye(len(powers)) - powers.real @ inverse
            slope = -inverse @ change @ inverse + inverse @ inverse.T @ change.T @ residual
            weights = weights + 1j * slope[0]
        return around, weights.reshape(places.shape[:2])


def _powers(places: AnyArray, degree: int) -> AnyArray:
    """Compute all products of powers of x and y up to a degree, (n, products); the first is 1."""
    x, y = places.T
    return np.column_stack([x**a * y**(total - a) for total in range(degree + 1)
                            for a in range(total + 1)])
