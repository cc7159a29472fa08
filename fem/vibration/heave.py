"""Effective mass of a plate that moves up and down, with film, electrodes and air.

A film that follows the plate as at rest has the motion x = v h with the deflection h. Its kinetic
energy is ½ m ḣ² with m = ∫ ρ |v|² dA (Rayleigh). Its own inertia makes it move a little more.
Condensed to the deflection, the dynamic stiffness is k - ω² m - ω⁴ g/k - …, where g = k pᵀ K⁻¹ p
with p = M v, and K is the stiffness of the film with its plate held (Leung, Int. J. Num. Meth. Eng.
12, 1978, 1705).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import identity, kron

from tympan.base.errors import InputError
from tympan.fem.linear_solver.direct import factorise
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS, HEAVE, State
from tympan.fem.vibration.air import MovedAir
from tympan.fem.vibration.modes import System, mass_matrix

#: Plate freedoms of tilt.
_TURNS = (FREEDOMS.index("rx"), FREEDOMS.index("ry"))


@dataclass(frozen=True, eq=False)
class FollowingFilm:
    """Motion of a film that follows its plate; pairs of numbers are for film and electrodes.

    ``swinging``: ∫ |v|² dA over the mounted film, and over its covered part [m²]. ``lag``: g of the
    module's text for masses per area of 1 kg/m² [m⁴], shape (2, 2). ``lifted``: ∫ v_z dA over the
    covered film, which the weight of the electrodes acts on. ``swept``: ∫ v_z dA over the whole
    film and the plate. ``plate``: area of the plate. ``moved``: the motion that still air follows
    on both sides, with frame and stand as a baffle.
    """

    swinging: tuple[float, float]
    lag: tuple[tuple[float, float], tuple[float, float]]
    lifted: float
    swept: float
    plate: float
    moved: MovedAir | None = None

    @cached_property
    def air(self) -> float:
        """Added mass of the air over its density [m³]; computed at first use."""
        return 0.0 if self.moved is None else self.moved.volumes.item()

    def mass(self, plate: Any, film: float, electrode: float, air: float = 0.0) -> Any:
        """Compute the mass [kg] on a weightless film that has the same frequency as the whole.

        ``plate``: mass on the plate [kg]. ``film`` and ``electrode``: masses per mounted area
        [kg/m²]. ``air``: density of the air [kg/m³].

        Examples
        --------
        >>> none = (0.0, 0.0), ((0.0, 0.0), (0.0, 0.0))
        >>> FollowingFilm(*none, 0.0, 0.0, 0.0).mass(0.02, 0.2, 0.05).item()
        0.02
        """
        coats = np.array([film, electrode])
        whole = plate + coats @ self.swinging + (self.air * air if air else 0.0)
        share = coats @ self.lag @ coats / whole**2
        # With ω² = x k/m, 1 - x - x² g/m² = 0.
        return whole * (1 + np.sqrt(1 + 4 * share)) / 2


def following(model: Model, state: State) -> FollowingFilm:
    """Compute the motion of the film with the plate about a state, at constant voltage.

    The plate's other freedoms follow, too. InputError if the plate is held.
    """
    mesh, freedoms = model.discretisation, model.plate_freedoms
    if HEAVE not in freedoms:
        raise InputError("must let the plate move up and down", key="guide",
                         given=model.loading.guide)
    system = System.of(model, state, RigidPlate(0.0))
    stiffness, coordinates = system.stiffness, system.coordinates
    heave = stiffness.shape[0] - len(freedoms) + freedoms.index(HEAVE)
    others = np.delete(np.arange(stiffness.shape[0]), heave)
    factors = factorise(stiffness[others][:, others].tocsc())
    motion = np.ones(stiffness.shape[0])
    motion[others] = factors.solve(-stiffness[:, heave].toarray().ravel()[others])
    masses = [coordinates.T @ kron(mass_matrix(model, part), identity(3)) @ coordinates
              for part in (np.ones_like(mesh.covered), model.covered)]
    inertia = np.stack([mass @ motion for mass in masses])
    lag = inertia[:, others] @ np.stack([factors.solve(row[others]) for row in inertia]).T
    lag = lag * (motion @ stiffness @ motion) * mesh.mirrored**2
    nodal = (coordinates @ motion).reshape(-1, 3)[mesh.connectivity]
    lift = mesh.mirrored * mesh.weights * (nodal[..., 2] @ mesh.shapes.T)
    film, electrode = (mesh.mirrored * inertia @ motion).tolist()
    (first, mixed), (_, second) = lag.tolist()
    plate = float(model.plate_area)
    heights = (coordinates @ motion).reshape(-1, 3)[None, :, 2]
    turns = [motion[stiffness.shape[0] - len(freedoms) + freedoms.index(turn)]
             if turn in freedoms else 0.0 for turn in _TURNS]
    moved = MovedAir.of(model.specimen, mesh, heights, np.array([[1.0, *turns]]))
    return FollowingFilm((film, electrode), ((first, mixed), (mixed, second)),
                         float((model.covered * lift).sum()), float(lift.sum()) + plate, plate,
                         moved)
