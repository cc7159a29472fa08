"""Where a film gives way in itself: its least stiffness within its plane, at a given voltage."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import deformation
from tympan.fem.film.density import principal_stretches
from tympan.fem.membrane.model import Model, cauchy_green
from tympan.fem.membrane.state import State

Array = NDArray[Any]

#: Share of the film's mean firmness below which an element's own values at its nodes are not good
#: enough, since they are off by some 1 % of the mean on a coarse mesh.
_NEAR = 0.3

#: Corners of a triangle: the first of its nodes.
_CORNERS = 3


def firmness(model: Model, state: State) -> Array:
    """Least stiffness of the film within its plane at the nodes of every element [Pa], (n,).

    Element-major, as of :func:`~tympan.fem.results.fields.node_fields`; that is
    :meth:`FilmDensity.firmness` and, where the film wrinkles, its margin to thinning without bound.
    Not positive where the film gives way in itself. In elements near to that, strong ellipticity is
    that of the strain recovered at their corners, and the nodes between have none (∞): an element's
    own strain at the plate's edge waves about the true one. ∞ of a film with memory, whose branches
    hold for a while what gives way at rest.
    """
    elliptic, thinning, _ = _margins(model, state)
    return np.asarray(np.minimum(elliptic, thinning).ravel())


def rough_firmness(model: Model, state: State) -> Array:
    """The same by each element's own strain; its jumps show the discretisation error."""
    return np.asarray(np.minimum(*_by_element(model, state)).ravel())


@dataclass(frozen=True)
class Spot:
    """A node of an element, where :func:`firmness` is a function of strains of the film.

    ``thinning``: there it is the margin to that; ``recovered``: of the strain recovered.
    """

    element: int
    local: int
    thinning: bool
    recovered: bool

    def sources(self, mesh: Discretisation) -> tuple[Array, Array, Array]:
        """Elements, ∂φ/∂X at their points (elements, points, local, 2), weights of the strains.

        Those of shape (elements, points) add up to the strain here.
        """
        if self.recovered:
            around, weights = _corner(mesh, self.element, self.local)
            return around, mesh.gradients[around], weights
        alone = np.array([self.element])
        return alone, mesh.nodal_gradients[alone, self.local : self.local + 1], np.ones((1, 1))

    def value(self, model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
        """The firmness where the strain is C, a number or an array of one; it may be complex."""
        shape = model.discretisation.connectivity.shape
        density = model.density(voltage_squared, nodal=True)
        covered, thickness = (np.broadcast_to(values, shape)[self.element, self.local]
                              for values in (density.covered, density.thickness))
        there = replace(density, covered=covered, thickness=thickness)
        seen = (np.atleast_1d(c[0]), np.atleast_1d(c[1]), np.atleast_1d(c[2]))
        if not self.thinning:
            return there.firmness(seen)[0]
        stretches = principal_stretches(seen, model.specimen.membrane.prestretch)
        return there.material.thinning_margin(*stretches)[0]


def spots_at(model: Model, state: State, places: Iterable[int]) -> list[Spot]:
    """Where :func:`firmness` has its values at places, element-major."""
    elliptic, thinning, near = _margins(model, state)
    spots = []
    for place in places:
        element, local = divmod(place, elliptic.shape[1])
        thins = bool(thinning[element, local] <= elliptic[element, local])
        spots.append(Spot(element, local, thins, not thins and bool(near[element])))
    return spots


def _margins(model: Model, state: State) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Margins to the loss of strong ellipticity and to thinning, (elements, local).

    And in which elements the first is that of recovered strains.
    """
    elliptic, thinning = _by_element(model, state)
    near, finite = np.zeros(len(elliptic), dtype=bool), np.isfinite(elliptic)
    if finite.any():
        near = (elliptic < _NEAR * np.abs(elliptic[finite]).mean()).any(axis=1)
        if near.any():
            _recover(model, state, elliptic, np.flatnonzero(near))
    return elliptic, thinning, near


def _by_element(model: Model, state: State) -> tuple[Array, Array]:
    """Margins to the loss of strong ellipticity and to thinning, shape (elements, local)."""
    mesh = model.discretisation
    none = np.full(mesh.connectivity.shape, np.inf)
    if model.flow is not None:
        return none, none
    density = model.density(state.voltage_squared, nodal=True)
    c = cauchy_green(deformation(mesh.nodal_gradients, state.positions[mesh.connectivity]))
    elliptic = np.array(np.broadcast_to(density.firmness(c), none.shape))
    if not model.wrinkles:
        return elliptic, none
    stretches = principal_stretches(c, model.specimen.membrane.prestretch)
    return elliptic, density.material.thinning_margin(*stretches)


def _recover(model: Model, state: State, elliptic: Array, elements: Array) -> None:
    """Put margins by recovered strains at the corners of some elements, ∞ at their other nodes."""
    mesh = model.discretisation
    density = model.density(state.voltage_squared, nodal=True)
    covered, thickness = (np.broadcast_to(values, elliptic.shape)[elements, :_CORNERS]
                          for values in (density.covered, density.thickness))
    there = replace(density, covered=covered, thickness=thickness)
    strains = recovered(mesh, np.stack(model.cauchy_green(state.positions)), elements)
    elliptic[elements] = np.inf
    elliptic[elements, :_CORNERS] = there.firmness((strains[0], strains[1], strains[2]))


def recovered(mesh: Discretisation, values: Array, elements: Array) -> Array:
    """Values at the corners of some elements from those at the quadrature points around.

    ``values`` (k, elements, points), the result (k, elements, 3). By the polynomial, a degree below
    the elements' own, that is nearest to the values in all elements that meet in the corner on the
    same side of an electrode's edge (Zienkiewicz and Zhu, Int. J. Numer. Methods Eng. 33, 1331,
    1992).
    """
    sides = _sides(mesh)
    result = np.empty((len(values), len(elements), _CORNERS))
    done: dict[int, Array] = {}
    for row, element in enumerate(elements.tolist()):
        for corner in range(_CORNERS):
            side = int(sides[element, corner])
            if side not in done:
                around, weights = _corner(mesh, element, corner)
                done[side] = np.tensordot(values[:, around], weights, axes=2)
            result[:, row, corner] = done[side]
    return result


def _sides(mesh: Discretisation) -> Array:
    """A number for each corner of each element, the same on one side of an electrode's edge."""
    return np.asarray(2 * mesh.connectivity[:, :_CORNERS] + (mesh.covered[:, :1] > 0))


def _corner(mesh: Discretisation, element: int, corner: int) -> tuple[Array, Array]:
    """Elements around a corner of one, and the weights of their points, (elements, points).

    The value recovered there is the sum of weights times values. It has derivatives by complex
    steps of the nodes' places.
    """
    sides = _sides(mesh)
    around = np.flatnonzero((sides == sides[element, corner]).any(axis=1))
    places = np.matmul(mesh.shapes, mesh.reference[mesh.connectivity[around]])[..., :2]
    away = places - mesh.reference[mesh.connectivity[element, corner], :2]
    powers = _powers(away.reshape(-1, 2) / np.abs(away).max(), mesh.mesh.order - 1)
    inverse = np.linalg.pinv(powers.real)
    weights = inverse[0]
    if np.iscomplexobj(powers):
        # d(A⁺) = −A⁺ dA A⁺ + (AᵀA)⁻¹ dAᵀ (1 − A A⁺), the first row of it.
        change, residual = powers.imag, np.eye(len(powers)) - powers.real @ inverse
        slope = -inverse @ change @ inverse + inverse @ inverse.T @ change.T @ residual
        weights = weights + 1j * slope[0]
    return around, weights.reshape(places.shape[:2])


def _powers(places: Array, degree: int) -> Array:
    """All products of powers of x and y up to a degree, (n, products); the first is 1."""
    x, y = places.T
    return np.column_stack([x**a * y**(total - a) for total in range(degree + 1)
                            for a in range(total + 1)])
