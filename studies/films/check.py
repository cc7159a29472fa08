"""Error of a reduced film's state compared with finite elements, from its residual.

The residual of the whole mesh at a reduced state has two parts. The part that acts on the shapes is
the error of the few points that represent all points. The shapes' own tangent gives the plate's
motion due to it. The other part acts on motions that the shapes do not contain. To first order
these do not move the plate, as far as the shapes include its response to a force. To second order
they move it by twice their energy over the plate's force (as the error of a compliance: Machiels,
Maday, Patera, Comput. Methods Appl. Mech. Eng. 190, 2001). Their energy is computed with the
tangent of one solved film, scaled by the plate's stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.fields import FieldsAlone
from tympan.fem.equilibrium.newton import tangent_at
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import FREEDOMS, HEAVE, PlateMotion, State
from tympan.studies.films.many_films import Films, FilmsAt
from tympan.studies.films.reduction import Reduction, Snapshot, plate_freedoms
from tympan.studies.films.tilting import TURNS, each_of

#: Force [N] that replaces zero, to avoid a division by 0.
_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class ResidualCheck(FieldsAlone):
    """A finite-element film in equilibrium, and the projection of its tangent to the shapes."""

    model: Model
    state: State
    motions: AnyArray
    stiffness: AnyArray

    @classmethod
    def of(cls, shot: Snapshot, reduction: Reduction) -> ResidualCheck:
        """Create the check from the tangent of a solved film."""
        model = shot.model
        allowed = list(model.plate_freedoms)
        motions = np.array([np.concatenate([
            shape[model.discretisation.free], plate_freedoms(model, shape)[allowed]])
            for shape in reduction.shapes])
        free = model.discretisation.free_count
        part = model.linearised(shot.state)
        inner, plate = motions[:, :free], motions[:, free:]
        coupled = inner @ part.border @ plate.T
        stiffness = (inner @ (part.inner @ inner.T) + coupled + coupled.T
                     + plate @ part.corner @ plate.T) * model.discretisation.mirrored
        return cls(model, shot.state, motions, stiffness)

    @cached_property
    def tangent(self) -> Tangent:
        """Tangent of the film."""
        tangent, _ = tangent_at(self.model, self.state)
        assert tangent is not None
        return tangent

    @cached_property
    def plate_stiffness(self) -> float:
        """Stiffness of the solved film against the plate's deflection [N/m]."""
        return float(1 / np.linalg.inv(self.stiffness)[0, 0])

    @cached_property
    def _rigid(self) -> AnyArray:
        """Motion of the plate's nodes by its freedoms, (plate nodes, 3, freedoms)."""
        return PlateMotion.rest().gradient(self.model.arms)[:, :, self.model.plate_freedoms]

    def estimate(self, films: Films, number: AnyArray, q: AnyArray, force: AnyArray,
                 squared: AnyArray,
                 stiffness: AnyArray) -> AnyArray:
        """Estimate the errors of deflections [m], (states,); nan without a state."""
        result = np.full(len(q), np.nan)
        sound = np.flatnonzero(np.isfinite(q).all(1))
        at = films.at(films.whole)
        for part in films.parts(sound, len(films.whole.sites.cells)):
            some = sound[part]
            result[some] = self._estimate(films, at, number[some], q[some], force[some],
                                          squared[some], stiffness[some])
        return result

    def _estimate(self, films: Films, at: FilmsAt, number: AnyArray, q: AnyArray, force: AnyArray,
                  squared: AnyArray, stiffness: AnyArray) -> AnyArray:
        strained = films.strain(at, number, q)
        stress = films.density(at, number, squared).of_virgin(strained.c, tangent=False).stress
        forces = strained.forces(stress.transpose(2, 0, 1) * at.volumes[number])
        nodal = self._nodal(films, forces) - films.nodal_weight[number]
        freedoms = self.model.plate_freedoms
        on_plate = np.zeros((len(q), len(FREEDOMS)))
        on_plate[:, HEAVE] += films.acting(number, q[:, 0])[0]
        on_plate -= np.outer(force, films.loading.lift(PlateMotion.rest()))
        if films.gas:
            pressure = films.pressure[number]
            nodal -= pressure[:, None, None] * self._swept(films, number, q)
            by_deflection, by_turns = films.volume.of_plates(number, q[:, 0],
                                                             films.tilts(number, q))
            by_turns = (by_turns[:, None] @ each_of(films.tilting.slants, number))[:, 0]
            on_plate[:, HEAVE] -= pressure * by_deflection
            on_plate[:, TURNS] -= pressure[:, None] * by_turns
        mesh = self.model.discretisation
        inner = nodal[(slice(None), *mesh.free)]
        edge = np.einsum("snc,ncf->sf", nodal[:, mesh.plate_nodes], self._rigid)
        edge += on_plate[:, freedoms]
        on_bends = np.zeros((len(q), 0))
        if films.bends:
            bends = films.whole.shapes[films.count:]
            nodes = mesh.plate_nodes
            on_edge = np.einsum("snc,mnc->sm", nodal[:, nodes], bends[:, nodes])
            slopes = films.tilting.slopes(number, q @ films.turns.T)
            for turn, pushed in enumerate(np.einsum("sm,smi->is", on_edge, slopes)):
                if (freedom := TURNS.start + turn) in freedoms:
                    edge[:, freedoms.index(freedom)] += pushed
            on_bends = inner @ np.array([bend[mesh.free] for bend in bends]).T
        whole = np.concatenate([inner, edge], 1)
        on_shapes = whole @ self.motions.T + films.by_bends(number, q, on_bends)
        _, tangent = films.pull(number, q, squared)
        first = np.linalg.solve(tangent, on_shapes[..., None])[:, 0, 0]
        film, plate = self.tangent.respond((inner.T / mesh.mirrored, edge.T / mesh.mirrored))
        energy = (film.T * inner).sum(1) + (plate.T * edge).sum(1)
        known = (on_shapes * np.linalg.solve(self.stiffness, on_shapes.T).T).sum(1)
        rest = np.maximum(energy - known, 0.0) * self.plate_stiffness / stiffness
        return np.asarray(np.abs(first) + rest / np.maximum(stiffness * np.abs(q[:, 0]), _NOTHING))

    @staticmethod
    def _swept(films: Films, number: AnyArray, q: AnyArray) -> AnyArray:
        """Compute derivatives of the gas volume below films by nodal positions.

        Their shape is (states, nodes, 3).
        """
        sites, shapes = films.whole.sites, films.whole.shapes
        x = films.nodes[number].copy()
        moved = np.tensordot(films.along(number, q), shapes, 1)
        x += moved[..., :2]
        a, b, c, d = sites.tangents(x).transpose(1, 0, 2)
        weights = sites.weights * sites.turns
        heights = weights * sites.at(moved[..., 2:])[..., 0]
        along, across = sites.gather
        by_x = along @ (heights * d).T - across @ (heights * c).T
        by_y = across @ (heights * a).T - along @ (heights * b).T
        by_z = sites.spread @ (weights * (a * d - b * c)).T
        return -np.stack([by_x, by_y, by_z], -1).swapaxes(0, 1)

    def _nodal(self, films: Films, forces: AnyArray) -> AnyArray:
        """Sum forces against ∂x/∂ξ, (6, states, points), to forces on the nodes.

        Their shape is (states, nodes, 3).
        """
        sites = films.whole.sites
        by = forces.reshape(3, 2, *forces.shape[1:])
        summed = [sites.gather[a] @ by[i, a].T for i in range(3) for a in range(2)]
        nodal = [summed[2 * i] + summed[2 * i + 1] for i in range(3)]
        return np.asarray(np.stack(nodal, -1).swapaxes(0, 1))
