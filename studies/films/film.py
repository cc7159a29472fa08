"""A film reduced to its plate's deflection, a few shapes, and a few representative points.

The film moves as x = X + Σ q_k φ_k(X). The first amplitudes are the plate's freedoms, q_1 the
deflection; the other shapes do not move the plate. C is therefore a quadratic function of q at
every point. The stored energy is Σ V_p ψ(C_p(q)) over a few points, whose virgin volumes V_p
represent all points (a reduced basis with empirical cubature: Hernández, Caicedo and Ferrer,
Comput. Methods Appl. Mech. Eng. 313, 2017). Law, voltage and viscous branches are the film's own at
these points (:mod:`tympan.fem.film`); nothing of them is fitted.

A plate that tilts also moves its edge in the plane, by the squares of the tilts, so that it stays
rigid. The film's tension works on this way, so it belongs to the resistance against tilts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg.lapack import dposv, dpotrf

from tympan.base.arrays import Array, Numbers
from tympan.fem.film.density import (
    FilmDensity,
    maxwell,
    plane_stress,
    principal_stretches,
)
from tympan.fem.film.energy_table import EnergyTable
from tympan.fem.film.memory import (
    Flow,
    Memory,
    incompressible,
    of_thickness,
    plane_determinant,
)
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.membrane.biases import Bias, acting
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS, HEAVE, PlateMotion
from tympan.geometry.specimen import Specimen

#: Largest number of corrections of a state. Newton's method needs a few from a good guess.
ITERATIONS = 12
#: Last correction over the gap. The error after it is its square, 1e-8.
_LAST = 1e-4

#: Largest deflection of the table of a film's law, over the gap between plate and frame. Beyond it
#: the law itself is evaluated.
_TABULATED = 0.25
#: Margin of the table beyond the strains at the tabulated deflections, relative to their range:
#: other shapes strain the film a little more.
_MARGIN = 0.2

#: Shortest part of a change of loads that is tried.
_PART = 1e-3


#: Quantities of a film that its shapes and points alone determine.
_OF_SHAPES = ("_slope", "_bend", "_pairs", "_works", "arms")


class NoBalance(ArithmeticError):
    """Error: no stable equilibrium of the film was found."""


@dataclass(frozen=True, eq=False)
class FilmLoads:
    """Force on the plate [N], U² across the film [V²], and mechanisms on the plate.

    Values are numbers, or arrays of several runs.
    """

    force: Any
    voltage_squared: Any
    biases: tuple[Bias, ...] = ()

    def differ(self, other: FilmLoads) -> bool:
        """Check whether a force or a voltage is different."""
        return bool(np.any(self.force != other.force)
                    or np.any(self.voltage_squared != other.voltage_squared))

    def towards(self, other: FilmLoads, share: float) -> FilmLoads:
        """Interpolate the loads to others by a share.

        The mechanisms are those of the others.
        """
        return FilmLoads(self.force + share * (other.force - self.force),
                     self.voltage_squared + share * (other.voltage_squared - self.voltage_squared),
                     other.biases)


@dataclass(frozen=True, eq=False)
class ReducedFilm:
    """A specimen's film at points; states q have the shape (..., shapes), also of several runs.

    ``volumes`` [m³], ``covered`` (1 under the electrode) and ``segments``, the numbers of its
    segments, have the shape (points,).
    ``gradients``: ∂φ/∂X of the deflection's shape and the others [1/m], shape (shapes, points, 3,
    2). ``errors``: largest error of the deflection over its range in the field model, by the names
    of test runs. ``table``: table of this specimen's law and charge, or None; outside it the law
    itself is evaluated. ``gas_area`` [m²]: area on which gas below film and plate lifts the plate,
    if known. ``freedoms``: numbers of the plate's freedoms that the first amplitudes are, the
    deflection first. A rotation's amplitude is its angle times the frame's half extent [m].
    ``bends``: second derivatives of the amplitudes of further shapes, at the end of ``gradients``,
    by those of the plate, (bends, led, led) [1/m].
    """

    specimen: Specimen
    volumes: Array
    covered: Array
    gradients: Array
    errors: Mapping[str, float] = field(default_factory=dict)
    table: EnergyTable | None = None
    gas_area: float | None = None
    segments: Any = 0
    freedoms: tuple[int, ...] = (HEAVE,)
    bends: Array = field(default_factory=lambda: np.zeros((0, 1, 1)))

    @property
    def led(self) -> int:
        """Number of amplitudes that move the plate."""
        return len(self.freedoms)

    @cached_property
    def arms(self) -> Array:
        """Amplitude of each of the plate's freedoms over the freedom: 1, or a length [m]."""
        return arms_of(self.specimen)[list(self.freedoms)]

    def plate(self, q: Array) -> Array:
        """Compute the plate's six freedoms [m, rad] from amplitudes; shape (..., 6)."""
        motion = np.zeros((*q.shape[:-1], len(FREEDOMS)))
        motion[..., self.freedoms] = q[..., :self.led] / self.arms
        return motion

    def inertia(self, plate: RigidPlate) -> Array:
        """Compute the mass matrix of the plate's amplitudes [kg], for small rotations."""
        some = np.ix_(self.freedoms, self.freedoms)
        matrix: Array = plate.matrix(PlateMotion.rest())[some] / np.outer(self.arms, self.arms)
        return matrix

    def driven(self, voltages: Mapping[str, float]) -> tuple[ReducedFilm, float]:
        """Set the voltages of segments [V] by their names, as :meth:`Electrode.driven` does.

        Returns the film with their shares, and the highest voltage.
        """
        electrode, top = self.specimen.electrode.driven(voltages)
        film = replace(self, specimen=replace(self.specimen, electrode=electrode))
        if self.table is not None:
            charged = self.covered * film._shares**2
            film = replace(film, table=replace(self.table, charged=charged))
        # The shapes are the same, and so is what is made of them.
        vars(film).update({name: getattr(self, name) for name in _OF_SHAPES})
        return film, top

    @property
    def _shares(self) -> Any:
        """Voltage of the electrode over the film's, 1 or of shape (points,)."""
        return self.specimen.electrode.share(self.segments)

    @property
    def count(self) -> int:
        """Number of amplitudes q, the deflection's included."""
        return len(self.gradients) - len(self.bends)

    @cached_property
    def flat(self) -> Array:
        """Amplitudes q of the mounted film."""
        return np.zeros(self.count)

    @cached_property
    def _slope(self) -> Array:
        """∂E/∂q of the flat film, shape (shapes, 3 × points).

        Strains and stresses are in Voigt form and refer to the virgin film, as everywhere in this
        class.
        """
        g = self.gradients
        parts = np.stack([g[:, :, 0, 0], g[:, :, 1, 1], g[:, :, 0, 1] + g[:, :, 1, 0]], -2)
        return (parts * self._scale[:, None]).reshape(len(g), -1)

    @cached_property
    def _bend(self) -> Array:
        """∂²E/∂q∂q, shape (shapes, shapes, 3 × points)."""
        first, second = self.gradients[..., 0], self.gradients[..., 1]
        parts = [np.einsum("kpi,lpi->klp", *pair)
                 for pair in ((first, first), (second, second), (first, second))]
        parts[2] = parts[2] + parts[2].swapaxes(0, 1)
        bend = np.stack(parts, -2) * self._scale[:, None]
        return bend.reshape(len(first), len(first), -1)

    @cached_property
    def _scale(self) -> Array:
        """Ratio of E of the virgin film to that of the mounted one, shape (3,)."""
        first, second = self.specimen.membrane.prestretch
        return np.array([first * first, second * second, first * second])

    @cached_property
    def _pairs(self) -> tuple[Numbers, Numbers, Array]:
        """Numbers of pairs of (1, q), each once, and their factors in C of the virgin film.

        Shapes (pairs,) twice and (3, pairs, points).
        """
        points, size = len(self.volumes), len(self.gradients) + 1
        by_shear = np.repeat([1.0, 1.0, 0.5], points)
        whole = np.zeros((size, size, 3 * points))
        whole[0, 0] = np.repeat(self._scale * [1.0, 1.0, 0.0], points)
        whole[0, 1:] = 2 * self._slope * by_shear
        whole[1:, 1:] = self._bend * by_shear
        whole += np.triu(np.ones((size, size)), 1)[..., None] * whole.swapaxes(0, 1)
        first, second = np.triu_indices(size)
        by_pair = whole[first, second].reshape(-1, 3, points).swapaxes(0, 1)
        return first, second, np.ascontiguousarray(by_pair)

    @cached_property
    def _works(self) -> Array:
        """V ∂E/∂q of the flat film and V ∂²E/∂q∂q, (3 × points, shapes and pairs of shapes)."""
        by_point = np.tile(self.volumes, 3)
        both = np.concatenate([self._slope, self._bend.reshape(-1, len(by_point))])
        return np.ascontiguousarray((by_point * both).T)

    def strain(self, q: Array) -> Array:
        """Compute C₁₁, C₂₂, C₁₂ of the virgin film at the points, shape (3, ..., points)."""
        first, second, by_pair = self._pairs
        every = self._every(q)
        along = np.ones((q.size // self.count, every.shape[-1] + 1))
        along[:, 1:] = every.reshape(-1, every.shape[-1])
        pairs = along.take(first, 1) * along.take(second, 1)
        return np.asarray((pairs @ by_pair).reshape(3, *q.shape[:-1], -1))

    def _every(self, q: Array) -> Array:
        """Add the amplitudes of the bends to q."""
        if not len(self.bends):
            return q
        return np.concatenate([q, (self._levers(q) @ q[..., :self.led, None])[..., 0] / 2], -1)

    def _levers(self, q: Array) -> Array:
        """Compute the derivatives of the bends' amplitudes by the plate's, (..., bends, led)."""
        return np.asarray(np.einsum("bkl,...l->...bk", self.bends, q[..., :self.led]))

    def _slopes(self, q: Array) -> Array:
        """Compute ∂E/∂q, shape (..., shapes, 3 × points)."""
        every, size = self._every(q), len(self.gradients)
        bent = every.reshape(-1, size) @ self._bend.reshape(size, -1)
        slopes = self._slope + bent.reshape(*every.shape, -1)
        if not len(self.bends):
            return slopes
        by_bends = np.swapaxes(self._levers(q), -1, -2) @ slopes[..., self.count:, :]
        slopes[..., :self.led, :] += by_bends
        return np.ascontiguousarray(slopes[..., :self.count, :])

    def pull(self, q: Array, voltage_squared: Any, flow: Flow | None = None
             ) -> tuple[Array, Array]:
        """Compute the film's generalised forces against q [N] and their derivatives [N/m].

        ``flow``: a step of its branches' memory; without it they are relaxed.
        """
        c, slope = self.strain(q), self._slopes(q)
        if flow is None or flow.at_once is None:
            stress, tangent = self._law(c, voltage_squared)
        else:
            plane, thick = flow.at_once
            stress, tangent = self._law(c, voltage_squared, thick)
            stress = stress + plane.reshape(3, *(1,) * (c.ndim - plane.ndim), *plane.shape[1:])
        if flow is not None and flow.at_once is None:
            viscous, bend = flow.stress(c)
            stress, tangent = stress + viscous, tangent + bend
        forces, geometric = self._forces(q, stress)
        return forces, self._bent(slope, tangent) @ np.swapaxes(slope, -1, -2) + geometric

    def staged_pull(self, q: Array, voltage_squared: Any, flow: StagedFlow
                    ) -> tuple[Array, Array, StagedFlow]:
        """Compute the pull of states (..., stages, shapes) in a collocated step.

        It is as :meth:`pull`. The derivatives of a stage's forces with respect to another stage's q
        use one C for both stages. Their shape is (..., stages, shapes, stages, shapes). The last
        result is the flow at this q.
        """
        c, slope = self.strain(q), self._slopes(q)
        plane, thick, slopes, flow = flow.stress(c)
        assert slopes is not None
        stress, tangent = self._law(c, voltage_squared, thick)
        forces, geometric = self._forces(q, stress + plane)
        back = np.swapaxes(slope, -1, -2)
        stiffness = np.zeros((*q.shape, *q.shape[-2:]))
        for branch, weights in enumerate(flow.weights):
            viscous = self._bent(slope, slopes[:, :, branch]) @ back
            stiffness += viscous[..., None, :] * weights[:, None, :, None]
        diagonal = np.einsum("...sksl->...skl", stiffness)
        diagonal += self._bent(slope, tangent) @ back
        diagonal += geometric
        return forces, stiffness, flow

    def staged_forces(self, q: Array, voltage_squared: Any, flow: StagedFlow
                      ) -> tuple[Array, StagedFlow]:
        """Compute forces and flow as :meth:`staged_pull` does, without derivatives."""
        c = self.strain(q)
        plane, thick, _, flow = flow.stress(c, slopes=False)
        stress, _ = self._law(c, voltage_squared, thick, tangent=False)
        return self._forces(q, stress + plane)[0], flow

    def _forces(self, q: Array, stress: Array) -> tuple[Array, Array]:
        """Compute generalised forces [N] from S, and the geometric part of their derivatives."""
        work = stress.transpose(*range(1, q.ndim), 0, -1).reshape(-1, 3 * len(self.volumes))
        both, every = work @ self._works, self._every(q)
        size = every.shape[-1]
        geometric = both[:, size:].reshape(*every.shape, size)
        flat = both[:, :size].reshape(every.shape)
        forces = flat + (geometric @ every[..., None])[..., 0]
        return (forces, geometric) if not len(self.bends) else self._led(q, forces, geometric)

    def _led(self, q: Array, forces: Array, geometric: Array) -> tuple[Array, Array]:
        """Take the bends' forces and their derivatives to the plate's amplitudes."""
        some, led, levers = self.count, self.led, self._levers(q)
        matrix = np.zeros((*geometric.shape[:-1], some))
        matrix[..., :some, :] = np.eye(some)
        matrix[..., some:, :led] = levers
        back = np.swapaxes(matrix, -1, -2)
        kept = back @ geometric @ matrix
        kept[..., :led, :led] += np.einsum("...b,bkl->...kl", forces[..., some:], self.bends)
        return (back @ forces[..., None])[..., 0], kept

    def _bent(self, slope: Array, tangent: Array) -> Array:
        """Compute the points' derivatives of forces for ∂S/∂E, (..., shapes, 3 × points)."""
        by_point = slope.reshape(*slope.shape[:-1], 3, -1)
        bent = np.einsum("ij...p,...njp->...nip", tangent * self.volumes, by_point)
        return np.asarray(bent.reshape(slope.shape))

    def _law(self, c: Array, voltage_squared: Any, thick: Any = None, *, tangent: bool = True
             ) -> tuple[Array, Any]:
        """Compute S [Pa], (3, ..., points), and ∂S/∂E, (3, 3, ..., points).

        They include law and voltage. With ``thick`` [Pa] the energy ½ ``thick`` / det C is added.
        """
        squared = _each(voltage_squared)
        if self.table is not None:
            quick = self.table.stress(c, squared, thick, tangent=tangent)
            if quick is not None:
                return quick
        density = FilmDensity(self.specimen, squared, self.covered, share=self._shares)
        stress: Any = 0.0
        bend: Any = 0.0
        if thick is not None:
            stress, bend = of_thickness(c, thick, tangent=tangent)
        first, second = self.specimen.membrane.prestretch
        for material, (along, across) in density.parts:
            part = plane_stress(material, (c[0], c[1], c[2]), (along / first, across / second),
                                tangent=tangent)
            stress = stress + part.stress.transpose(-1, *range(part.stress.ndim - 1))
            if tangent:
                axes = part.tangent.ndim
                bend = bend + part.tangent.transpose(-2, -1, *range(axes - 2))
        return stress, bend

    @cached_property
    def tabulated(self) -> ReducedFilm:
        """The film with its law in a table, if a table is accurate: faster for motions.

        The table covers a good part of the gap.
        """
        if self.table is not None:
            return self
        deflections = np.multiply.outer(np.linspace(0.0, _TABULATED * self.specimen.gap, 9),
                                   np.eye(self.count)[0])
        c = self.strain(deflections)
        invariants = np.stack([c[0] + c[1], plane_determinant(c)]).reshape(2, -1)
        low, high = invariants.min(1), invariants.max(1)
        margin = _MARGIN * (high - low)
        charged = self.covered * self._shares**2
        table = EnergyTable.of(self.specimen, charged, low - margin, high + margin)
        return replace(self, table=table)

    def capacitance(self, q: Array, voltage_squared: Any = 0.0) -> Any:
        """Compute the capacitance of the film [F], wrinkles included."""
        density = FilmDensity(self.specimen, _each(voltage_squared), self.covered,
                              share=self._shares)
        seen = principal_stretches(tuple(self.strain(q)), (1.0, 1.0))
        charged = maxwell(self.specimen, 1.0, self.covered * self._shares**2)
        energy = charged.derivatives(*density.material.stretches(*seen)[:2])[0]
        return -2 * (energy * self.volumes).sum(-1)

    def relaxed(self, q: Array) -> Memory:
        """Create the memory of branches that are fully relaxed at q."""
        full = incompressible(self.strain(q))[:, None]
        memory = self._flat_memory
        return replace(memory, viscous=np.repeat(full, len(memory.times), 1))

    @cached_property
    def _flat_memory(self) -> Memory:
        return Memory.relaxed(self.specimen.membrane, self.strain(self.flat))

    def balanced(self, q: Array, loads: FilmLoads, flow: Flow | None = None, *,
                 clamped: int = 0, last: float = _LAST) -> Array:
        """Solve for q in equilibrium near a guess; the first ``clamped`` amplitudes are kept.

        ``last``: largest last correction, over the gap.

        Raises
        ------
        NoBalance
            If there is no stable equilibrium.
        """
        scale = self.specimen.gap
        for _ in range(ITERATIONS):
            pull, stiffness = self.pull(q, loads.voltage_squared, flow)
            if clamped:
                kept = np.arange(clamped)
                pull[..., kept], stiffness[..., kept, :], stiffness[..., :, kept] = 0.0, 0.0, 0.0
                stiffness[..., kept, kept] = 1.0
            else:
                _, push, bend = acting(loads.biases, q[..., 0])
                pull[..., 0] += push - loads.force
                stiffness[..., 0, 0] += bend
            step = _solved(stiffness, pull)
            size = float(np.abs(step).max()) / scale
            if not size < 1:
                break
            q = q - step
            if size < last:
                return q
        raise NoBalance

    def carried(self, q: Array, before: FilmLoads, after: FilmLoads, flow: Flow | None = None, *,
                clamped: int = 0, last: float = _LAST) -> Array:
        """Solve for q after a jump of the loads, in as many parts as needed."""
        share, step = 0.0, 1.0
        while share < 1:
            ahead = min(1.0, share + step)
            try:
                q = self.balanced(q, before.towards(after, ahead), flow, clamped=clamped,
                                  last=last)
                share, step = ahead, 2 * step
            except NoBalance:
                step /= 2
                if step < _PART:
                    raise
        return q

    def at_rest(self, loads: FilmLoads, last: float = _LAST) -> Array:
        """Solve for the relaxed q under loads: first the weight, then the voltage."""
        runs, nothing = np.shape(loads.force), FilmLoads(0.0, 0.0)
        weight = replace(loads, voltage_squared=0.0)
        flat = np.broadcast_to(self.flat, (*runs, self.count))
        q = self.carried(flat, nothing, weight, last=last)
        if not np.any(loads.voltage_squared):
            return q
        return self.carried(q, weight, loads, last=last)


def arms_of(specimen: Specimen) -> Array:
    """Amplitudes of the plate's six freedoms over the freedoms: 1, for rotations a length [m]."""
    return np.where([name.startswith("r") for name in FREEDOMS], max(specimen.frame.semi_axes), 1.0)


def _solved(stiffness: Array, pull: Array) -> Array:
    """Solve symmetric positive definite systems (..., n, n) for (..., n)."""
    if pull.ndim == 1:
        _, step, unstable = dposv(stiffness, pull)
        if unstable:
            raise NoBalance
        return np.asarray(step)
    require_stable(stiffness)
    return np.asarray(np.linalg.solve(stiffness, pull[..., None])[..., 0])


def require_stable(stiffness: Array) -> None:
    """Raise NoBalance unless symmetric matrices (..., n, n) are positive definite."""
    if stiffness.ndim == 2:
        if dpotrf(stiffness)[1]:
            raise NoBalance
        return
    try:
        np.linalg.cholesky(stiffness)
    except np.linalg.LinAlgError:
        raise NoBalance from None


def _each(values: Any) -> Any:
    """Broadcast values of every run over its points."""
    return values[..., None] if np.ndim(values) else values
