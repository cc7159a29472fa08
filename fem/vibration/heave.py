"""What moves with a plate that heaves: film, electrodes and air, as a mass on the plate.

Of a film that follows the plate as at rest, x = v h with the heave h, the kinetic energy is ½ m ḣ²
with m = ∫ ρ |v|² dA (Rayleigh). Its own inertia makes it follow a little more: condensed on the
heave its dynamic stiffness is k - ω² m - ω⁴ g/k - …, where g = k pᵀ K⁻¹ p with p = M v and the
stiffness K of the film with its plate held (Leung, Int. J. Num. Meth. Eng. 12, 1978, 1705).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import identity, kron

from tympan.fem.linear_solver.direct import factorise
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import HEAVE, State
from tympan.fem.vibration.modes import System, mass_matrix
from tympan.geometry.errors import InputError

#: Added mass of a piston in a baffle, over ρ r³ and one side, far below the frequency at which
#: sound is as long as it: Rayleigh, The Theory of Sound II (1896), § 302.
_PISTON = 8 / 3


@dataclass(frozen=True)
class FollowingFilm:
    """How a film follows its plate; two-fold numbers are of film and electrodes.

    ``swinging``: ∫ |v|² dA over the mounted film, and over what is covered of it [m²]; ``lag``: the
    g above for masses per area of 1 kg/m² [m⁴], shape (2, 2); ``lifted``: ∫ v_z dA over the covered
    film, which its weight acts on; ``swept``: that of the whole film and the ``plate``, whose area
    that is.
    """

    swinging: tuple[float, float]
    lag: tuple[tuple[float, float], tuple[float, float]]
    lifted: float
    swept: float
    plate: float

    def mass(self, plate: Any, film: float, electrode: float, air: float = 0.0) -> Any:
        """Mass [kg] that on a weightless film has the frequency of the whole.

        Of a mass on the plate [kg], film and electrodes by theirs per mounted area [kg/m²], and
        :meth:`air_mass`.

        Examples
        --------
        >>> none = (0.0, 0.0), ((0.0, 0.0), (0.0, 0.0))
        >>> FollowingFilm(*none, 0.0, 0.0, 0.0).mass(0.02, 0.2, 0.05).item()
        0.02
        """
        coats = np.array([film, electrode])
        whole = plate + coats @ self.swinging + self.air_mass(air)
        share = coats @ self.lag @ coats / whole**2
        # With ω² = x k/m, 1 - x - x² g/m² = 0.
        return whole * (1 + np.sqrt(1 + 4 * share)) / 2

    def air_mass(self, density: float) -> float:
        """Mass of the air on both sides [kg], frame and stand a baffle, by its density [kg/m³].

        That of the piston that sweeps as much and has the same ∫ |v|² dA; of a film ln(b/R)/ln(b/a)
        about a plate of a = 0.22 b it is 5 % low. Without a baffle there is less: of a free disc
        half.

        Examples
        --------
        >>> area, none = 3.141592653589793 * 0.03**2, ((0.0, 0.0), ((0.0, 0.0), (0.0, 0.0)))
        >>> round(FollowingFilm(*none, 0.0, area, area).air_mass(1.2), 7)  # 16/3 ρ (3 cm)³
        0.0001728
        """
        whole = self.swinging[0] + self.plate
        return float(2 * _PISTON * density * self.swept * np.sqrt(whole) / np.pi**1.5)


def following(model: Model, state: State) -> FollowingFilm:
    """How the film follows the plate about a state, at constant voltage.

    The plate's other freedoms follow too. InputError where the plate is held.
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
    return FollowingFilm((film, electrode), ((first, mixed), (mixed, second)),
                         float((model.covered * lift).sum()), float(lift.sum()) + plate, plate)
