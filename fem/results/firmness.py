"""Where a film gives way in itself: its least stiffness within its plane, at a given voltage."""

from __future__ import annotations

from dataclasses import replace
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
    elliptic, thinning = _by_element(model, state)
    finite = np.isfinite(elliptic)
    if finite.any():
        near = (elliptic < _NEAR * np.abs(elliptic[finite]).mean()).any(axis=1)
        if near.any():
            _recover(model, state, elliptic, np.flatnonzero(near))
    return np.asarray(np.minimum(elliptic, thinning).ravel())


def rough_firmness(model: Model, state: State) -> Array:
    """The same by each element's own strain; its jumps show the discretisation error."""
    return np.asarray(np.minimum(*_by_element(model, state)).ravel())


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
    places = np.matmul(mesh.shapes, mesh.reference[mesh.connectivity])[..., :2]
    corners = mesh.connectivity[:, :_CORNERS]
    sides = 2 * corners + (mesh.covered[:, :1] > 0)
    order = np.argsort(sides.ravel(), kind="stable")
    ranked = sides.ravel()[order]
    result = np.empty((len(values), len(elements), _CORNERS))
    done: dict[int, Array] = {}
    for row, element in enumerate(elements.tolist()):
        for corner in range(_CORNERS):
            side = int(sides[element, corner])
            if side not in done:
                low, high = np.searchsorted(ranked, (side, side + 1))
                around = order[low:high] // _CORNERS
                centre = mesh.reference[corners[element, corner], :2]
                away = places[around].reshape(-1, 2) - centre
                powers = _powers(away / np.abs(away).max(), mesh.mesh.order - 1)
                given = values[:, around].reshape(len(values), -1).T
                done[side] = np.linalg.lstsq(powers, given, rcond=None)[0][0]
            result[:, row, corner] = done[side]
    return result


def _powers(places: Array, degree: int) -> Array:
    """All products of powers of x and y up to a degree, (n, products); the first is 1."""
    x, y = places.T
    return np.column_stack([x**a * y**(total - a) for total in range(degree + 1)
                            for a in range(total + 1)])
