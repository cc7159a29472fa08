"""Small vibrations about an equilibrium: frequencies, growth rates, shapes and names.

With x = (free node components, plate freedoms) the kinetic energy is ½ ẋᵀMẋ and the energy's second
variation ½ xᵀKx, so K φ = ω² M φ. The voltage is held constant: charge flows as the film moves. At
constant charge the same state would be stiffer, since the voltage then decreases where the
capacitance increases.

Mirror symmetry of the state divides the modes into classes, even or odd about each plane. All
classes are solved on the meshed part, with different conditions on the planes. No mode is therefore
lost, and the two modes of a double frequency are in different classes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import Any

import numpy as np
import scipy.linalg
from numpy.polynomial import chebyshev
from scipy.sparse import bmat, coo_matrix, csc_matrix, csr_matrix, identity, kron
from scipy.sparse.linalg import LinearOperator, eigsh

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.linear_solver.direct import factorise
from tympan.fem.membrane.model import Linearised, Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS, State
from tympan.geometry.mesh import unfold

#: Number of unknowns below which a dense solver takes no longer. The same holds for fewer than four
#: unknowns per mode.
_DENSE = 200
#: Inertia, relative to the largest, below which a motion of the plate counts as massless.
_MASSLESS = 1e-13

#: Plate freedoms that may mix, as numbers in FREEDOMS, and two names: for a mix and for one
#: freedom.
_MOTIONS = (((0, 1), "slide", "slide along {}"), ((2,), "heave", "heave"),
            ((3, 4), "tilt", "tilt about {}"), ((5,), "twist", "twist"))
_MAINLY = 0.9  #: least share of one motion for which a mode gets its name
_ORDERS = 12  #: highest angular order that is searched
_DEGREE = 11  #: degree of the radial polynomial: resolves at least five nodal circles
_LEAST = 0.02  #: amplitude, relative to the largest, below which a sign is not counted


def symmetry_classes(model: Model) -> Iterator[Model]:
    """Yield the model with motions even or odd about each plane: 1, 2 or 4 classes.

    The even class is the first.
    """
    mesh = model.discretisation
    for odd in chain.from_iterable(combinations(sorted(mesh.planes), count)
                                   for count in range(len(mesh.planes) + 1)):
        yield replace(model, discretisation=Discretisation.of(mesh.mesh, mesh.planes,
                                                              frozenset(odd))) if odd else model


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes about a state: unstable ones first, then vibrations by rising frequency.

    The first axis of all arrays is the mode. Shapes are those of the whole film and
    mass-normalised: φᵀMφ = 1, in m/√(kg m²). ``shares`` is the part of a mode's kinetic energy that
    each plate freedom carries; the rest of 1 belongs to the film.
    """

    frequencies_Hz: Array  #: 0 for an unstable mode, shape (modes,)
    growth: Array  #: e-folding rate of an unstable mode [1/s], 0 for a vibration
    shapes: Array  #: displacements of the nodes of the whole film, shape (modes, nodes, 3)
    plate: Array  #: the plate's motion, translations and rotations, shape (modes, 6)
    shares: Array  #: shares of the plate's freedoms in the kinetic energy, shape (modes, 6)
    unstable: int  #: number of directions of negative stiffness, with massless or omitted ones


def vibrations(model: Model, state: State, plate: RigidPlate, count: int = 6) -> Modes:
    """Compute modes of film and plate about an equilibrium, at constant voltage and pressure.

    ``plate`` is the whole plate with its mass. A loading with the guide "fixed" gives modes of the
    film alone. ``count``: number of lowest frequencies, and largest number of unstable modes, those
    of slowest growth. After a loss of tension the fast unstable modes are as fine as the mesh and
    mean only that the film wrinkles. A massless film (density 0) follows the plate at once. It is
    condensed out, and at most six modes are left. InputError if nothing that can move has mass.
    """
    if count < 1:
        raise InputError("must be at least 1", key="count", given=count)
    classes = [System.of(part, state, plate) for part in symmetry_classes(model)]
    spectra = [system.solve(count) for system in classes]
    values = np.concatenate([squares for squares, _, _ in spectra])
    order = np.argsort(values, kind="stable")
    chosen = order[_nearest_zero(int(np.count_nonzero(values < 0)), count)]
    if not len(chosen):
        raise InputError("nothing that can move has mass: neither the film nor the plate",
                         key="membrane.density", given=model.specimen.membrane.density)
    _, origin, signs = unfold(model.discretisation.mesh, model.discretisation.planes)
    pairs = [(system, vector) for system, (_, vectors, _) in zip(classes, spectra, strict=True)
             for vector in vectors.T]
    shapes, motions, shares = (np.array(part) for part in zip(
        *(pairs[index][0].unfolded(pairs[index][1], origin, signs) for index in chosen),
        strict=True))
    values = values[chosen]
    return Modes(np.sqrt(np.maximum(values, 0)) / (2 * np.pi), np.sqrt(np.maximum(-values, 0)),
                 shapes, motions, shares, sum(unstable for _, _, unstable in spectra))


def film_mass(model: Model) -> csr_matrix:
    """Compute the meshed film's consistent mass matrix for one component, (nodes, nodes).

    The unit is kg. The electrodes move with the film.
    """
    return mass_matrix(model, model.mass_per_area)


def mass_matrix(model: Model, per_area: Any) -> csr_matrix:
    """Compute the consistent mass matrix for any mass per mounted area [kg/m²].

    ``per_area`` is broadcastable to (elements, points). The result has the shape (nodes, nodes).
    """
    mesh = model.discretisation
    weights, shapes = mesh.weights * per_area, mesh.shapes
    elements = np.einsum("pa,pb,ep->eab", shapes, shapes, weights, optimize=True)
    return mesh.nodal_matrix(elements)


#: Lowest eigenvalues ω², their vectors as columns with vᵀMv = 1, and the number of all negative
#: eigenvalues.
_Spectrum = tuple[Array, Array, int]


@dataclass(frozen=True, eq=False)
class System:
    """Stiffness and mass of one symmetry class, for the meshed part.

    The unknowns are the free components, then the plate's freedoms, whose mass matrix is ``plate``.
    ``coordinates`` maps them to all node components.
    """

    model: Model
    tangent: Linearised
    plate: Array
    coordinates: csr_matrix

    @classmethod
    def of(cls, model: Model, state: State, plate: RigidPlate) -> System:
        weight = plate.matrix(state.plate) / model.discretisation.mirrored
        freedoms = model.plate_freedoms
        gradient = state.plate.gradient(model.arms)[:, :, freedoms]
        return cls(model, model.linearised(state), weight[np.ix_(freedoms, freedoms)],
                   _coordinates(model, gradient))

    def solve(self, count: int) -> _Spectrum:
        if not film_mass(self.model).data.any():
            return self._massless_film()
        if not self.coordinates.shape[1]:
            return np.zeros(0), np.zeros((0, 0)), 0
        return _lowest(self.stiffness, self.mass, count)

    @property
    def stiffness(self) -> csc_matrix:
        """Stiffness matrix of film and plate [N/m, N, N m].

        Free components come first, then the plate's freedoms.
        """
        part = self.tangent
        return part.inner if not len(self.plate) else bmat(
            [[part.inner, part.border], [part.border.T, part.corner]], format="csc")

    @property
    def mass(self) -> csc_matrix:
        """Mass matrix of film and plate for the same unknowns [kg, kg m, kg m²]."""
        size = self.coordinates.shape[1]
        film = kron(film_mass(self.model), identity(3))
        rows, columns = np.indices(self.plate.shape).reshape(2, -1) + size - len(self.plate)
        weight = coo_matrix((self.plate.ravel(), (rows, columns)), (size, size))
        return (self.coordinates.T @ film @ self.coordinates + weight).tocsc()

    def unfolded(self, vector: Array, origin: Numbers,
                 signs: Array) -> tuple[Array, Array, Array]:
        """Unfold a vector to motions of the whole film and plate, and the plate's energy shares.

        The motions are normalised to the mass of the whole.
        """
        mesh, freedoms = self.model.discretisation, list(self.model.plate_freedoms)
        nodal = (self.coordinates @ vector).reshape(-1, 3)[origin]
        factors = np.column_stack([*signs, np.ones(signs.shape[1])])
        for plane in mesh.odd:
            factors *= signs["xy".index(plane)][:, None]
        motion, share = np.zeros(6), np.zeros(6)
        motion[freedoms] = vector[len(vector) - len(freedoms):]
        share[freedoms] = motion[freedoms] * (self.plate @ motion[freedoms])
        whole = np.sqrt(mesh.mirrored)
        return nodal / whole * factors, motion / whole, share

    def _massless_film(self) -> _Spectrum:
        """Solve for the modes of a massless film, which follows the plate.

        Plate freedoms without inertia follow, too.
        """
        part, film = self.tangent, factorise(self.tangent.inner)
        influence = np.asarray(film.solve(part.border)) if len(self.plate) else part.border
        schur = part.corner - part.border.T @ influence
        schur = (schur + schur.T) / 2
        unstable = film.negative + int(np.count_nonzero(np.linalg.eigvalsh(schur) < 0))
        # Rotations are scaled by the frame's half extent to compare them with translations.
        turns = np.array(self.model.plate_freedoms, dtype=int) >= 3
        scale = np.where(turns, 1 / self.model.size, 1.0)
        weight, axes = np.linalg.eigh(scale[:, None] * self.plate * scale)
        heavy = weight > _MASSLESS * weight.max(initial=0)
        heavy, light = scale[:, None] * axes[:, heavy], scale[:, None] * axes[:, ~heavy]
        if not heavy.size:
            return np.zeros(0), np.zeros((self.coordinates.shape[1], 0)), unstable
        follow = heavy - light @ np.linalg.solve(light.T @ schur @ light, light.T @ schur @ heavy)
        values, plate = scipy.linalg.eigh(follow.T @ schur @ follow, heavy.T @ self.plate @ heavy)
        motion = follow @ plate
        return values, np.vstack([-influence @ motion, motion]), unstable


def _coordinates(model: Model, gradient: Array) -> csr_matrix:
    """Map free components and plate freedoms to node components, (3 nodes, n + p)."""
    mesh = model.discretisation
    node, component = mesh.free
    free, count, freedoms = 3 * node + component, mesh.free_count, gradient.shape[2]
    edge = (3 * mesh.plate_nodes[:, None] + np.arange(3)).ravel()
    rows = np.concatenate([free, np.repeat(edge, freedoms)])
    columns = np.concatenate([np.arange(count), np.tile(count + np.arange(freedoms), len(edge))])
    data = np.concatenate([np.ones(count), gradient.ravel()])
    return csr_matrix((data, (rows, columns)), shape=(mesh.reference.size, count + freedoms))


def _nearest_zero(negative: int, count: int) -> slice:
    """Select ``count`` of ascending values on either side of zero, the nearest to it."""
    return slice(max(0, negative - count), negative + count)


def _lowest(stiffness: csc_matrix, mass: csc_matrix, count: int) -> _Spectrum:
    """Compute up to ``count`` eigenvalues on either side of zero, by Lanczos on K⁻¹M."""
    size = mass.shape[0]
    if size < max(_DENSE, 4 * count):
        values, vectors = scipy.linalg.eigh(stiffness.toarray(), mass.toarray())
        negative = int(np.count_nonzero(values < 0))
        chosen = _nearest_zero(negative, count)
        return values[chosen], vectors[:, chosen], negative
    factors = factorise(stiffness)
    negative = factors.negative
    inverse = LinearOperator((size, size), matvec=factors.solve, dtype=float)
    # The start is the same in every run, and not orthogonal to any mode.
    start = np.random.default_rng(0).standard_normal(size)
    parts = [eigsh(stiffness, wanted, mass, sigma=0.0, OPinv=inverse, which=end, v0=start)
             for end, wanted in (("SA", min(negative, count)), ("LA", min(size - negative, count)))
             if wanted]
    values, vectors = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    order = np.argsort(values)
    return values[order], vectors[:, order], negative


def mode_names(model: Model, modes: Modes) -> tuple[str, ...]:
    """Name each mode; the model is that of the whole film.

    A mode is ``heave``, ``tilt about x``, ``slide along y`` or ``twist`` if the plate carries more
    than half of the kinetic energy, most of it in that freedom. Otherwise it is ``film``. It is
    ``film (m, n)`` with m nodal diameters and n nodal circles between the edges if frame, plate and
    prestretch are round and nine tenths of the displacement along the load follow such a pattern.
    It is ``film, in plane`` if the film moves normal to the load.
    """
    return tuple(plate_motion(share) or _film_name(model, shape)
                 for share, shape in zip(modes.shares, modes.shapes, strict=True))


def plate_motion(share: Array) -> str:
    """Name a mode by the plate's motion from its freedoms' shares; "" if the film dominates."""
    if share.sum() <= 0.5:
        return ""
    totals = [share[list(numbers)].sum() for numbers, _, _ in _MOTIONS]
    numbers, together, alone = _MOTIONS[int(np.argmax(totals))]
    if max(totals) <= 0.5 * share.sum():
        return "plate"
    main = max(numbers, key=lambda number: float(share[number]))
    return alone.format(FREEDOMS[main][-1]) if share[main] > _MAINLY * max(totals) else together


def _film_name(model: Model, shape: Array) -> str:
    across, along = (shape[:, :2] ** 2).sum(), (shape[:, 2] ** 2).sum()
    if along < (1 - _MAINLY) * (across + along):
        return "film, in plane"
    if along > _MAINLY * (across + along) and model.specimen.axisymmetric:
        pattern = _pattern(model.discretisation.reference[:, :2], shape[:, 2])
        if pattern is not None:
            return "film ({}, {})".format(*pattern)
    return "film"


def _pattern(points: Array, height: Array) -> tuple[int, int] | None:
    """Count nodal diameters and circles of w = P(r) cos mθ + Q(r) sin mθ; None for a bad fit."""
    radius, angle = np.hypot(*points.T), np.arctan2(*points.T[::-1])
    s = 2 * (radius - radius.min()) / np.ptp(radius) - 1
    radial = chebyshev.chebvander(s, _DEGREE)
    for order in range(_ORDERS + 1):
        parts = [radial * np.cos(order * angle)[:, None], radial * np.sin(order * angle)[:, None]]
        design = np.hstack(parts[: 2 if order else 1])
        coefficients = np.linalg.lstsq(design, height, rcond=None)[0]
        if np.sum((height - design @ coefficients) ** 2) < (1 - _MAINLY) * np.sum(height**2):
            profiles = coefficients.reshape(-1, _DEGREE + 1)
            leading = profiles.T @ np.linalg.svd(profiles)[0][:, 0]
            profile = chebyshev.chebval(np.linspace(-1, 1, 400), leading)
            clear = profile[np.abs(profile) > _LEAST * np.abs(profile).max()]
            return order, int(np.count_nonzero(np.diff(np.sign(clear))))
    return None
