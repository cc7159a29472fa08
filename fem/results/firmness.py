"""Least stiffness of a film in its plane at a given voltage: the film is unstable where it is 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.electrode_edge import CORNERS
from tympan.fem.discretisation.isoparametric import deformation
from tympan.fem.film.density import FilmDensity, principal_stretches
from tympan.fem.film.interface import Side, interface_margin
from tympan.fem.membrane.model import Model, cauchy_green
from tympan.fem.membrane.state import State

#: Share of the film's mean firmness below which an element's own nodal values are not accurate
#: enough: on a coarse mesh they are wrong by some 1 % of the mean.
_NEAR = 0.3

#: Strain of a film as the triple (C₁₁, C₂₂, C₁₂).
Strain = tuple[Any, Any, Any]


def firmness(model: Model, state: State) -> AnyArray:
    """Compute the least stiffness of the film in its plane at the elements' nodes [Pa], (n,).

    The order is element-major, as in :func:`~tympan.fem.results.fields.node_fields`. The value is
    :meth:`FilmDensity.firmness`; where the film wrinkles it is its margin to unlimited thinning,
    and on an electrode's edge that of the line between covered and bare film
    (:func:`~tympan.fem.film.interface.interface_margin`). It is not positive where the film is
    unstable. In elements near to that, strong ellipticity uses the strain recovered at their
    corners, and the nodes between have ∞: an element's own strain at the plate's edge oscillates
    about the true one. A film with memory has ∞: its branches hold for a while what is unstable at
    rest.
    """
    elliptic, thinning, _ = _margins(model, state)
    edge = edge_firmness(model, state)
    return np.minimum(np.minimum(elliptic, thinning), edge).ravel()


def least_firmness(model: Model, state: State) -> float:
    """Find the least firmness of a film [Pa]; infinite for a film without elements."""
    return float(firmness(model, state).min(initial=np.inf))


def rough_firmness(model: Model, state: State) -> AnyArray:
    """Compute the firmness by each element's own strain; jumps show the discretisation error."""
    least = np.minimum(*_by_element(model, state))
    return np.minimum(least, edge_firmness(model, state, rough=True)).ravel()


@dataclass(frozen=True)
class StrainSource:
    """Points whose strains, times weights, add up to one: ``elements``, (elements, points).

    ``gradients`` are ∂φ/∂X at the points, (elements, points, local, 2).
    """

    elements: AnyArray
    gradients: AnyArray
    weights: AnyArray

    @classmethod
    def recovered(cls, mesh: Discretisation, element: int, corner: int) -> StrainSource:
        """Use the strain recovered at a corner."""
        around, weights = mesh.recovery.at(element, corner)
        return cls(around, mesh.gradients[around], weights)

    @classmethod
    def averaged(cls, mesh: Discretisation, elements: AnyArray, locals_: AnyArray) -> StrainSource:
        """Use the mean of elements' own strains at nodes of theirs."""
        count = len(elements)
        return cls(elements, mesh.nodal_gradients[elements, locals_][:, None],
                   np.full((count, 1), 1 / count))


@dataclass(frozen=True)
class Spot:
    """A node of an element, where :func:`firmness` is a function of strains of the film.

    With ``thinning`` it is the margin to thinning there; with ``recovered`` it uses recovered
    strain.
    """

    element: int
    local: int
    thinning: bool
    recovered: bool

    def sources(self, mesh: Discretisation) -> list[StrainSource]:
        """Find the sources of the strains that determine the firmness here."""
        if self.recovered:
            return [StrainSource.recovered(mesh, self.element, self.local)]
        return [StrainSource.averaged(mesh, np.array([self.element]), np.array([self.local]))]

    def value(self, model: Model, voltage_squared: Any, strains: Sequence[Strain]) -> Any:
        """Compute the firmness where the strain is C, numbers or arrays of one, maybe complex."""
        places = np.array([[self.element, self.local]])
        there, seen = _density_at(model, voltage_squared, places), _arrays(strains[0])
        if not self.thinning:
            return there.firmness(seen)[0]
        stretches = principal_stretches(seen, model.specimen.membrane.prestretch)
        return there.material.thinning_margin(*stretches)[0]


@dataclass(frozen=True)
class EdgeSpot:
    """A node on an electrode's edge, by its number there; it depends on strains of both sides."""

    number: int

    def sources(self, mesh: Discretisation) -> list[StrainSource]:
        """Find the sources of the strains that determine the firmness here."""
        edge = mesh.electrode_edge
        return [StrainSource.averaged(mesh, *places[rows == self.number].T)
                for places, rows in zip(edge.places, edge.rows, strict=True)]

    def value(self, model: Model, voltage_squared: Any, strains: Sequence[Strain]) -> Any:
        """Compute the firmness where the strains are C on each side; they may be complex."""
        edge = model.discretisation.electrode_edge
        sides = [_side(_density_at(model, voltage_squared, places[[self.number]]), _arrays(strain))
                 for places, strain in zip(edge.firsts, strains, strict=True)]
        return interface_margin(sides, edge.along[[self.number]])[0]


def spot_at(model: Model, state: State, place: int) -> Spot | EdgeSpot:
    """Find the spot at which :func:`firmness` has the value of a place, element-major."""
    (elliptic, thinning, near), edge = _margins(model, state), edge_firmness(model, state)
    mesh = model.discretisation
    element, local = divmod(place, elliptic.shape[1])
    thins = bool(thinning[element, local] <= elliptic[element, local])
    if edge[element, local] < min(elliptic[element, local], thinning[element, local]):
        node = mesh.connectivity[element, local]
        return EdgeSpot(int(np.searchsorted(mesh.electrode_edge.nodes, node)))
    return Spot(element, local, thins, not thins and bool(near[element]))


def _margins(model: Model, state: State) -> tuple[AnyArray, AnyArray, Mask]:
    """Compute margins to the loss of strong ellipticity and to thinning, (elements, local).

    The third result marks elements where the first margin is that of recovered strains.
    """
    elliptic, thinning = _by_element(model, state)
    near, finite = np.zeros(len(elliptic), dtype=bool), np.isfinite(elliptic)
    if finite.any():
        near = (elliptic < _NEAR * np.abs(elliptic[finite]).mean()).any(axis=1)
        if near.any():
            _recover(model, state, elliptic, np.flatnonzero(near))
    return elliptic, thinning, near


def _by_element(model: Model, state: State) -> tuple[AnyArray, AnyArray]:
    """Compute margins to the loss of strong ellipticity and to thinning, (elements, local)."""
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


def _recover(model: Model, state: State, elliptic: AnyArray, elements: AnyArray) -> None:
    """Replace margins by those of recovered strains at the corners, and by ∞ at other nodes."""
    places = np.stack(np.broadcast_arrays(elements[:, None], np.arange(CORNERS)), axis=-1)
    own = np.stack(model.cauchy_green(state.positions))
    strains = model.discretisation.recovery.recovered(own, elements)
    elliptic[elements] = np.inf
    there = _density_at(model, state.voltage_squared, places)
    elliptic[elements, :CORNERS] = there.firmness((strains[0], strains[1], strains[2]))


def edge_firmness(model: Model, state: State, rough: bool = False) -> AnyArray:
    """Compute the firmness of electrodes' edges at the elements' corners, (elements, local).

    In Pa. It uses the mean strains of the elements on both sides, which beside a narrow band are
    more accurate than recovered ones; or, if ``rough``, an element's own strain and the mean on the
    other side. It is ∞ elsewhere, where either side is unstable by itself or has no tension, and
    for a film with memory.
    """
    mesh = model.discretisation
    edge, margins = mesh.electrode_edge, np.full(mesh.connectivity.shape, np.inf)
    if not len(edge.nodes) or model.flow is not None:
        return margins
    own = np.stack(cauchy_green(deformation(mesh.nodal_gradients,
                                            state.positions[mesh.connectivity])))
    means, square = edge.averaged(own), state.voltage_squared
    if not rough:
        held = _held(model, square, edge.along, *zip(edge.firsts, means, strict=True))
        for places, rows in zip(edge.places, edge.rows, strict=True):
            margins[places[:, 0], places[:, 1]] = held[rows]
        return margins
    for side, other in ((0, 1), (1, 0)):
        places, rows = edge.places[side], edge.rows[side]
        at = places[:, 0], places[:, 1]
        margins[at] = _held(model, square, edge.along[rows], (places, own[:, *at]),
                            (edge.firsts[other][rows], means[other][:, rows]))
    return margins


def _held(model: Model, voltage_squared: Any, along: AnyArray, *sides: tuple[AnyArray, AnyArray]
          ) -> AnyArray:
    """Compute margins of lines between films with strains (3, n); ∞ if one is unstable."""
    firm = np.ones(len(along), dtype=bool)
    films = []
    for places, (c11, c22, c12) in sides:
        density = _density_at(model, voltage_squared, places)
        margin = density.firmness((c11, c22, c12))
        firm &= (margin > 0) & np.isfinite(margin)
        films.append(_side(density, (c11, c22, c12)))
    with np.errstate(all="ignore"):
        margins = interface_margin(films, along)
    return np.where(firm & ~np.isnan(margins), margins, np.inf)


def _density_at(model: Model, voltage_squared: Any, places: AnyArray) -> FilmDensity:
    """Make the film's density at nodes of elements, (…, 2)."""
    shape = model.discretisation.connectivity.shape
    density = model.density(voltage_squared, nodal=True)
    covered, thickness, share = (
        np.broadcast_to(values, shape)[places[..., 0], places[..., 1]]
        for values in (density.covered, density.thickness, density.share))
    return replace(density, covered=covered, thickness=thickness, share=share)


def _side(density: FilmDensity, c: Strain) -> Side:
    """Make one side of a line, with the film taut."""
    taut = replace(density, wrinkles=False, flow=None)(c)
    return Side(c, taut.stress, taut.tangent)


def _arrays(c: Strain) -> Strain:
    return np.atleast_1d(c[0]), np.atleast_1d(c[1]), np.atleast_1d(c[2])
