"""Spaces of allowed motions of the film: all motions, or smooth ones that cannot wrinkle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from numpy.polynomial import legendre
from skfem.models.poisson import laplace

from tympan.base.arrays import Array
from tympan.fem.membrane.model import Linearised, Model, Parts
from tympan.fem.membrane.state import PlateMotion

#: Eigenvalue of the columns' Gram matrix, relative to the largest, below which the mesh cannot
#: distinguish two motions.
_DEPENDENT = 1e-13

#: Number of smooth motions whose products with a tangent take as long as the tangent itself: 120 to
#: 240 on films of 6,000 to 90,000 unknowns.
_AS_LONG = 150


@dataclass(frozen=True, eq=False)
class Subspace:
    """Linear map from unknowns to free nodal components and plate freedoms, and its transpose.

    This class is the full space: every node moves independently.
    """

    def expand(self, motion: Parts) -> Parts:
        """Map the unknowns to free components and plate freedoms."""
        return motion

    def project(self, forces: Parts) -> Parts:
        """Map nodal forces and forces on the plate to forces on the unknowns."""
        return forces

    def reduced(self, part: Linearised) -> Linearised:
        """Reduce a tangent to the unknowns."""
        return part


    @property
    def work(self) -> float:
        """Work of a tangent for the unknowns, relative to that of the film's own tangent."""
        return 1.0


FULL = Subspace()


@dataclass(frozen=True, eq=False)
class SmoothSubspace(Subspace):
    """Polynomials from plate to frame times the first few waves around the plate.

    A film that has lost tension has no equilibrium independent of the mesh: ever shorter wrinkles
    lower its energy. A membrane theory without wrinkles, or the axisymmetric equations, describe a
    smooth equilibrium. It still exists, and it is a regular solution within motions too long to
    wrinkle. ``film`` (free components, unknowns) has orthonormal columns. ``follow`` (free
    components, plate freedoms) makes the film follow the plate.
    """

    film: Array
    follow: Array

    @classmethod
    def of(cls, model: Model, waves: int, degree: int = 14) -> SmoothSubspace:
        """Build polynomials in the potential between plate and frame, times waves around it.

        Without waves the motion is axisymmetric.
        """
        mesh, share = model.discretisation, _potential(model)
        arms = mesh.reference - model.centre
        rigid = PlateMotion.rest().gradient(arms)[:, :, model.plate_freedoms]
        follow = (1 - share)[:, None, None] * rigid
        angle = np.arctan2(arms[:, 1], arms[:, 0])
        radial = legendre.legvander(2 * share - 1, degree) * (share * (1 - share))[:, None]
        frame = np.zeros((len(angle), 3, 3))
        frame[:, 0, 0] = frame[:, 1, 1] = np.cos(angle)
        frame[:, 1, 0] = np.sin(angle)
        frame[:, 0, 1] = -frame[:, 1, 0]
        frame[:, 2, 2] = 1.0
        parts = [frame[:, :, axis, None] * (radial * wave[:, None])[:, None, :]
                 for axis in range(3) for wave in _waves(model, axis, waves, angle)]
        columns = np.concatenate([part[mesh.free] for part in parts], axis=1)
        return cls(_orthonormal(columns), follow[mesh.free])

    def expand(self, motion: Parts) -> Parts:
        return self.film @ motion[0] + self.follow @ motion[1], motion[1]

    def project(self, forces: Parts) -> Parts:
        return self.film.T @ forces[0], forces[1] + self.follow.T @ forces[0]

    def reduced(self, part: Linearised) -> Linearised:
        by_film, by_plate = part.inner @ self.film, part.inner @ self.follow
        border = self.film.T @ (part.border + by_plate)
        across = self.follow.T @ part.border
        corner = part.corner + across + across.T + self.follow.T @ by_plate
        inner: Any = self.film.T @ by_film
        return Linearised(part.forces, inner, border, corner)

    @property
    def work(self) -> float:
        return float(1 + self.film.shape[1] / _AS_LONG)


def _orthonormal(columns: Array) -> Array:
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > _DEPENDENT * values[-1]
    basis = columns @ (vectors[:, kept] / np.sqrt(values[kept]))
    return np.asarray(np.linalg.qr(basis)[0])


def _waves(model: Model, axis: int, highest: int, angle: Array) -> list[Array]:
    """List the waves of radial, circumferential or vertical motion that mirror planes allow."""
    mirrored, planes = -1 if axis == 1 else 1, model.discretisation.planes
    waves: list[Array] = []
    for number in range(highest + 1):
        turn = (-1) ** number  # sign of cos(number θ) as x changes sign; sin: opposite
        if all({"x": turn, "y": 1}[plane] == mirrored for plane in planes):
            waves.append(np.cos(number * angle))
        if number and all({"x": -turn, "y": -1}[plane] == mirrored for plane in planes):
            waves.append(np.sin(number * angle))
    # Without waves there is no rotation about the axis.
    return waves if highest or axis != 1 else []


def _potential(model: Model) -> Array:
    """Solve for the harmonic function that is 0 on the plate and 1 on the frame."""
    mesh = model.discretisation
    frame, plate = mesh.boundary_nodes("frame"), mesh.plate_nodes
    value = np.zeros(len(mesh.reference))
    value[frame] = 1.0
    rims = np.concatenate([frame, plate])
    return np.asarray(skfem.solve(*skfem.condense(laplace.assemble(mesh.basis), x=value, D=rims)))
