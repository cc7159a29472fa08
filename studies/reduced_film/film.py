"""A film reduced to its plate's heave, a few shapes, and a few points that stand for the rest.

The film moves as x = X + Σ q_k φ_k(X): q_1 is the heave, the other shapes leave the plate where it
is. So C is a quadratic function of q at every point, and what the film stores is Σ V_p ψ(C_p(q)),
over a few points of virgin volumes V_p that stand for all (a reduced basis with empirical cubature:
Hernández, Caicedo and Ferrer, Comput. Methods Appl. Mech. Eng. 313, 2017). Law, voltage and viscous
branches are the film's own at these points (:mod:`tympan.fem.film`): nothing of them is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from tympan.fem.film.density import (
    FilmDensity,
    maxwell,
    plane_stress,
    principal_stretches,
)
from tympan.fem.film.memory import Flow, Memory
from tympan.fem.film.staged_memory import StagedFlow
from tympan.geometry.specimen import Specimen

Array = NDArray[np.float64]

#: The most corrections of a state; and the last one over the gap: of the next its square is left.
ITERATIONS, _LAST = 12, 1e-4

#: Shortest part of a change of loads that is tried.
_PART = 1e-3


class NoBalance(ArithmeticError):
    """The film has no stable equilibrium where it was looked for."""


@dataclass(frozen=True, eq=False)
class FilmLoads:
    """The force on the plate [N], U² across the film [V²], a spring on the plate [N/m].

    Numbers, or arrays of several runs.
    """

    force: Any
    voltage_squared: Any
    spring: float = 0.0

    def differ(self, other: FilmLoads) -> bool:
        """Whether a force or a voltage is another one."""
        return bool(np.any(self.force != other.force)
                    or np.any(self.voltage_squared != other.voltage_squared))

    def towards(self, other: FilmLoads, share: float) -> FilmLoads:
        """Between these and others, whose spring it has."""
        return FilmLoads(self.force + share * (other.force - self.force),
                     self.voltage_squared + share * (other.voltage_squared - self.voltage_squared),
                     other.spring)


@dataclass(frozen=True, eq=False)
class ReducedFilm:
    """A specimen's film at points; states q have the shape (..., shapes), of several runs at once.

    ``volumes`` [m³] and ``covered``, 1 under the electrode, shape (points,); ``gradients``: ∂φ/∂X
    of the heave's shape and the others [1/m], shape (shapes, points, 3, 2). ``errors``: the largest
    of its deflection over the range of the field model's, by runs it was not made from.
    """

    specimen: Specimen
    volumes: Array
    covered: Array
    gradients: Array
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Of shapes, the heave's included."""
        return len(self.gradients)

    @cached_property
    def flat(self) -> Array:
        """q of the mounted film."""
        return np.zeros(self.count)

    @cached_property
    def _slope(self) -> Array:
        """∂E/∂q of the flat film, shape (shapes, 3 × points).

        In Voigt form and of the virgin film, as all strains and stresses here.
        """
        g = self.gradients
        parts = np.stack([g[:, :, 0, 0], g[:, :, 1, 1], g[:, :, 0, 1] + g[:, :, 1, 0]], -2)
        return (parts * self._scale[:, None]).reshape(self.count, -1)

    @cached_property
    def _bend(self) -> Array:
        """∂²E/∂q∂q, shape (shapes, shapes, 3 × points)."""
        first, second = self.gradients[..., 0], self.gradients[..., 1]
        parts = [np.einsum("kpi,lpi->klp", *pair)
                 for pair in ((first, first), (second, second), (first, second))]
        parts[2] = parts[2] + parts[2].swapaxes(0, 1)
        bend = np.stack(parts, -2) * self._scale[:, None]
        return bend.reshape(self.count, self.count, -1)

    @cached_property
    def _scale(self) -> Array:
        """Of E of the virgin film over that of the mounted one, shape (3,)."""
        first, second = self.specimen.membrane.prestretch
        return np.array([first * first, second * second, first * second])

    @cached_property
    def _forms(self) -> tuple[Array, Array, Array, Array]:
        """For :meth:`_strained` and :meth:`pull`, flat.

        ∂²E/∂q∂q by one shape, by pairs; C of the flat film, and over ½ q · (its slopes, before and
        after).
        """
        count, points = self.count, len(self.volumes)
        return (self._bend.reshape(count, -1), self._bend.reshape(count * count, -1).T.copy(),
                np.repeat(self._scale * [1.0, 1.0, 0.0], points),
                np.repeat([1.0, 1.0, 0.5], points))

    def strain(self, q: Array) -> Array:
        """C₁₁, C₂₂, C₁₂ of the virgin film at the points, shape (3, ..., points)."""
        return self._strained(q)[1]

    def _strained(self, q: Array) -> tuple[Array, Array]:
        """∂E/∂q, shape (..., shapes, 3 × points), and C, (3, ..., points)."""
        by_shape, _, flat, by_shear = self._forms
        slope = self._slope + (q @ by_shape).reshape(*q.shape, -1)
        change = (q[..., None, :] @ (self._slope + slope))[..., 0, :]
        c = (flat + change * by_shear).reshape(*q.shape[:-1], 3, -1)
        return slope, np.moveaxis(c, -2, 0)

    def pull(self, q: Array, voltage_squared: Any, flow: Flow | None = None
             ) -> tuple[Array, Array]:
        """The film's generalised forces against q [N] and their derivatives [N/m].

        ``flow``: a step of its branches' memory; without, they are relaxed.
        """
        slope, c = self._strained(q)
        stress, tangent = self._stressed(c, voltage_squared, flow)
        forces, geometric = self._forces(slope, stress)
        return forces, self._bent(slope, tangent) @ np.swapaxes(slope, -1, -2) + geometric

    def staged_pull(self, q: Array, voltage_squared: Any, flow: StagedFlow
                    ) -> tuple[Array, Array, StagedFlow]:
        """As :meth:`pull` of states (..., stages, shapes) in a step that is collocated.

        The derivatives at a stage by q at another, those as if C were the same at both, have the
        shape (..., stages, shapes, stages, shapes). Last comes the flow as it is at this q.
        """
        slope, c = self._strained(q)
        stress, tangent = self._stressed(c, voltage_squared)
        viscous, slopes, flow = flow.stress(c)
        slopes[:, :, 0] += _first(_first(tangent))
        forces, geometric = self._forces(slope, stress + _last(viscous, 1))
        bent = self._bent(slope, _last(slopes, 2))
        stiffness = self._across_stages(slope, bent[1:], flow.weights)
        diagonal = np.einsum("...sksl->...skl", stiffness)
        diagonal += bent[0] @ np.swapaxes(slope, -1, -2) + geometric
        return forces, stiffness, flow

    def _forces(self, slope: Array, stress: Array) -> tuple[Array, Array]:
        """Generalised forces [N] of S at the points; what S itself adds to their derivatives."""
        stress = (np.swapaxes(stress, -1, -2) * self.volumes).reshape(*slope.shape[:-2], -1)
        geometric = (stress @ self._forms[1]).reshape(*slope.shape[:-1], self.count)
        return (slope @ stress[..., None])[..., 0], geometric

    def _bent(self, slope: Array, tangent: Array) -> Array:
        """The points' forces [N m] by q for ∂S/∂E, shape (..., shapes, 3 × points)."""
        by_point = slope.reshape(*slope.shape[:-1], 3, -1)
        bent = np.einsum("...pij,...njp->...nip", tangent, by_point * self.volumes)
        return np.asarray(bent.reshape(*bent.shape[:-2], -1))

    def _across_stages(self, slope: Array, bent: Array, weights: Array) -> Array:
        """What the memory of one stage does to the forces at another; ``bent`` by branches."""
        *lead, stages, count, rows = slope.shape
        before = slope.reshape(*lead, stages * count, rows).swapaxes(-1, -2)
        work = bent.reshape(len(weights), *lead, stages * count, rows) @ before
        work = work.reshape(len(weights), *lead, stages, count, stages, count)
        each = weights.reshape(-1, *(1,) * len(lead), stages, 1, stages, 1)
        return np.asarray((work * each).sum(0))

    def _stressed(self, c: Array, voltage_squared: Any, flow: Flow | None = None
                  ) -> tuple[Array, Array]:
        """S [Pa], shape (..., points, 3), and ∂S/∂E, (..., points, 3, 3), of the virgin film."""
        first, second = self.specimen.membrane.prestretch
        film = FilmDensity(self.specimen, _each(voltage_squared), self.covered)
        stress: Any = 0.0
        tangent: Any = 0.0
        for material, (along, across) in film.parts:
            part = plane_stress(material, (c[0], c[1], c[2]), (along / first, across / second))
            stress, tangent = stress + part.stress, tangent + part.tangent
        if flow is not None:
            viscous, bend = flow.stress(c)
            assert bend is not None
            stress, tangent = stress + _last(viscous, 1), tangent + _last(bend, 2)
        return stress, tangent

    def capacitance(self, q: Array, voltage_squared: Any = 0.0) -> Any:
        """Of the film [F], wrinkles included."""
        density = FilmDensity(self.specimen, _each(voltage_squared), self.covered)
        seen = principal_stretches(tuple(self.strain(q)), (1.0, 1.0))
        charged = maxwell(self.specimen, 1.0, self.covered)
        energy = charged.derivatives(*density.material.natural(*seen))[0]
        return -2 * (energy * self.volumes).sum(-1)

    def relaxed(self, q: Array) -> Memory:
        """The memory of branches that have rested at q for ever."""
        return Memory.relaxed(self.specimen.membrane, self.strain(q))

    def balanced(self, q: Array, loads: FilmLoads, flow: Flow | None = None, *,
                 clamped: bool = False, last: float = _LAST) -> Array:
        """q in equilibrium near a guess, with a ``clamped`` plate at its heave.

        ``last``: the largest correction, over the gap, after which no other follows.

        Raises
        ------
        NoBalance
            Where there is none that is stable.
        """
        scale = self.specimen.gap
        for _ in range(ITERATIONS):
            pull, stiffness = self.pull(q, loads.voltage_squared, flow)
            if clamped:
                pull[..., 0], stiffness[..., 0, :], stiffness[..., :, 0] = 0.0, 0.0, 0.0
                stiffness[..., 0, 0] = 1.0
            else:
                pull[..., 0] += loads.spring * q[..., 0] - loads.force
                stiffness[..., 0, 0] += loads.spring
            step = _solved(stiffness, pull)
            size = float(np.abs(step).max()) / scale
            if not size < 1:
                break
            q = q - step
            if size < last:
                return q
        raise NoBalance

    def carried(self, q: Array, before: FilmLoads, after: FilmLoads, flow: Flow | None = None, *,
                clamped: bool = False, last: float = _LAST) -> Array:
        """q after the loads changed at once, in as many steps as it takes."""
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
        """q at rest for ever under loads."""
        weight = replace(loads, voltage_squared=0.0)
        weighed = self._weighed(weight, last)
        if not np.any(loads.voltage_squared):
            return weighed
        return self.carried(weighed, weight, loads, last=last)

    def _weighed(self, weight: FilmLoads, last: float) -> Array:
        """q at rest without voltage; near what the stiffness of the flat film says."""
        pull, stiffness = self._flat_pull
        spring = np.zeros_like(stiffness)
        spring[0, 0] = weight.spring
        push = np.multiply.outer(weight.force, np.eye(self.count)[0]) - pull
        with suppress(NoBalance, np.linalg.LinAlgError):
            near = push @ np.linalg.inv(stiffness + spring)
            return self.balanced(near, weight, last=last)
        runs = np.shape(weight.force)
        flat = np.broadcast_to(self.flat, (*runs, self.count))
        return self.carried(flat, FilmLoads(0.0, 0.0), weight, last=last)

    @cached_property
    def _flat_pull(self) -> tuple[Array, Array]:
        """:meth:`pull` of the flat film without voltage."""
        return self.pull(self.flat, 0.0)


def _solved(stiffness: Array, pull: Array) -> Array:
    """The solution, shape (..., n), of symmetric positive definite systems (..., n, n)."""
    if pull.ndim == 1:
        _, step, unstable = dposv(stiffness, pull)
        if unstable:
            raise NoBalance
        return np.asarray(step)
    require_stable(stiffness)
    return np.asarray(np.linalg.solve(stiffness, pull[..., None])[..., 0])


def require_stable(stiffness: Array) -> None:
    """That symmetric matrices (..., n, n) are positive definite, else NoBalance."""
    try:
        np.linalg.cholesky(stiffness)
    except np.linalg.LinAlgError:
        raise NoBalance from None


def _each(values: Any) -> Any:
    """Of every run, for all of its points."""
    return values[..., None] if np.ndim(values) else values


def _last(values: Array, axes: int) -> Array:
    """A view whose first axes are the last."""
    return values.transpose(*range(axes, values.ndim), *range(axes))


def _first(values: Array) -> Array:
    """A view whose last axis is the first."""
    return values.transpose(-1, *range(values.ndim - 1))
