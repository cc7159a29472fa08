"""Memory of a film with viscous branches, and its energy in a step of time.

Beside its law a film has branches of a modulus μ and a time τ. Each stores μ/2 (C : C_v⁻¹ − 3) per
virgin volume, det C_v = 1, C₃₃ = 1/(C₁₁C₂₂ − C₁₂²), and flows: Ċ_v = (C − ⅓ (C : C_v⁻¹) C_v)/τ
(Kumar and Lopez-Pamies, C. R. Mecanique 344, 2016, with a neo-Hookean branch), τ = η/μ. The
viscosity η may depend on C_v and the stress (:mod:`tympan.fem.film.flows`).

So C_v = M/det(M)^⅓ of an M that grows along C, Ṁ = det(M)^⅓ C/τ. A step from C₀ to C ends at M = H
+ w C, where H is known before the step and w follows from its duration. The branch's stress at the
end derives from the potential (3μ/2w) det(H + w C)^⅓. No equations are solved at a point, C_v stays
positive with determinant 1, and the tangent is symmetric. (For Euler's step: Shutov, Landgraf and
Ihlemann, Comput. Methods Appl. Mech. Eng. 265, 2013; this one is of second order.)

Symmetric tensors are arrays of the components 11, 22, 12, 33 along the virgin film's axes, as their
first axis; the second axis is that of the branches, where values differ between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.geometry.specimen import ConstantFlow, Film, FlowLaw, ViscousBranch

#: Rate below which the weights of a step are computed by their series, and its terms.
_SLOW = 0.5
_SERIES = [(-1) ** n / factorial(n + 2) for n in range(12)]

#: Number of its times after which a branch is relaxed to the last digit.
_LONG = 80.0

#: C of an unstrained film.
_UNIT = np.array([1.0, 1.0, 0.0, 1.0])

#: Coefficients of det A in twice A dC A by dC, symmetric in both pairs, which is 2 A ⊗ A plus this
#: times det A, in the plane by the components 11, 22, 12 (A_ik A_lj − A_ij A_lk = det A ε_il ε_kj).
ACROSS = ((0.0, -2.0, 0.0), (-2.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Memory:
    """The branches' C_v at points, shape (4, branches, *points), moduli [Pa] and times [s].

    ``flows`` are those of the branches if any viscosity is not constant, else empty.
    """

    moduli: AnyArray
    times: AnyArray
    viscous: AnyArray
    flows: tuple[FlowLaw, ...] = ()

    @classmethod
    def relaxed(cls, film: Film, c: Any) -> Memory:
        """Make a memory that is fully relaxed at C of the virgin film, (C₁₁, C₂₂, C₁₂)."""
        full = incompressible(c)[:, None]
        moduli, times, flows = _constants(film)
        return cls(moduli, times, np.repeat(full, len(times), 1), flows)

    @classmethod
    def mounted(cls, film: Film, points: tuple[int, ...]) -> Memory:
        """Make the memory of a flat film, stretched at once at its age, at points of a shape."""
        first, second = film.prestretch
        flat = incompressible((first**2, second**2, 0.0))
        moduli, times, flows = _constants(film)
        viscous = np.repeat(flat[:, None], len(times), axis=1)
        if film.mounted is not None:
            shares = [_grown(flat, film.mounted, branch) for branch in film.branches]
            viscous = np.stack([_UNIT + share * flat for share in shares], axis=1)
            viscous = viscous / np.cbrt(determinant(viscous))
        spread = viscous.reshape(4, len(times), *np.ones(len(points), dtype=int))
        return cls(moduli, times, np.broadcast_to(spread, (4, len(times), *points)), flows)

    def step(self, c: Any, duration: float, ahead: Any = None) -> Flow:
        """Prepare a step of a duration [s] from C.

        In the step det(M)^⅓ grows exponentially, by its rate at the start. Where a viscosity is not
        constant, its inverse is the mean of that at the start and of that at a C ``ahead``, where
        the step is expected to end.
        """
        fluidity = self.fluidity(c)
        if self.flows and np.any(duration) and ahead is not None:
            foreseen = self._step(c, duration, fluidity).after(ahead)
            fluidity = (fluidity + foreseen.fluidity(ahead)) / 2
        return self._step(c, duration, fluidity)

    def _step(self, c: Any, duration: float, fluidity: Any) -> Flow:
        if not np.any(duration):
            return Flow(self, self.viscous, np.zeros(self.viscous.shape[1:]))
        before = incompressible(c)[:, None]
        share = duration / self.each(self.times) * fluidity
        rate = share * inner(inverse(self.viscous), before) / 3
        first, last = _weights(rate)
        kept = np.exp(-rate) * self.viscous + share * first * before
        return Flow(self, kept, share * last)

    def energy(self, c: Any) -> AnyArray:
        """Compute the energy that the branches store at C [J/m³], shape (*points)."""
        stretch = inner(inverse(self.viscous), incompressible(c)[:, None]) - 3
        return np.asarray((self.each(self.moduli) / 2 * stretch).sum(0))

    def dissipation(self, c: Any) -> AnyArray:
        """Compute the power that the branches turn into heat at C [W/m³], shape (*points).

        It is (μ/2τ) (tr X² − (tr X)²/3) with X = C C_v⁻¹.
        """
        rate = self.each(self.moduli / self.times) * self.fluidity(c)
        return np.asarray((rate * self._driving(c)).sum(0))

    def fluidity(self, c: Any) -> Any:
        """Compute inverse viscosity at C, over that of the branches' times, (branches, *points)."""
        if not self.flows:
            return 1.0
        stretch = self.viscous[0] + self.viscous[1] + self.viscous[3]
        stress_squared = self.each(self.moduli) ** 2 * self._driving(c)
        pairs = zip(self.flows, stretch, stress_squared, strict=True)
        return np.stack([1 / (flow.relative_viscosity(*invariants) + np.zeros_like(stretch[0]))
                         for flow, *invariants in pairs])

    def _driving(self, c: Any) -> AnyArray:
        """Compute (tr X² − (tr X)²/3)/2, X = C C_v⁻¹, shape (branches, *points)."""
        full, back = incompressible(c)[:, None], inverse(self.viscous)
        c11, c22, c12, c33 = full
        v11, v22, v12, v33 = back
        trace = inner(back, full)
        # tr X² = C C_v⁻¹ : (C C_v⁻¹)ᵀ, by components in the plane.
        x11 = c11 * v11 + c12 * v12
        x22 = c22 * v22 + c12 * v12
        x12 = c11 * v12 + c12 * v22
        x21 = c12 * v11 + c22 * v12
        square = x11**2 + x22**2 + 2 * x12 * x21 + (c33 * v33) ** 2
        driving = (square - trace**2 / 3) / 2
        # Rounding may leave a negative value where the branch is relaxed.
        return np.where(np.real(driving) > 0, driving, 0.0)

    def each(self, values: AnyArray) -> AnyArray:
        """Broadcast values of the branches over all of their points."""
        return values.reshape(-1, *(1,) * (self.viscous.ndim - 2))


@dataclass(frozen=True, eq=False)
class Flow:
    """A step in progress: H, shape (4, branches, *points), and w of every branch."""

    memory: Memory
    kept: AnyArray
    weight: AnyArray

    def after(self, c: Any) -> Memory:
        """Compute the memory at the step's end, at C."""
        grown = self.kept + self.weight * incompressible(c)[:, None]
        return replace(self.memory, viscous=grown / cube_root(determinant(grown)))

    def at(self, interpolate: Callable[[AnyArray], AnyArray], shear: Any = 1.0) -> Flow:
        """Move the step to other points, to which values are interpolated, shape (..., *points).

        ``shear`` multiplies the component 12 there: -1 in a mirror image.
        """
        viscous, kept = interpolate(self.memory.viscous).copy(), interpolate(self.kept).copy()
        viscous[2] *= shear
        kept[2] *= shear
        return Flow(replace(self.memory, viscous=viscous), kept, interpolate(self.weight))

    def density(self, c: Any, *, tangent: bool = True) -> tuple[AnyArray, AnyArray,
                AnyArray | None]:
        """Compute the step's potential at C [J/m³], S = 2∂/∂C and ∂S/∂E in Voigt form [Pa].

        Shapes are (*points), (3, *points), (3, 3, *points), with those of several films first. The
        potential is 0 where nothing is strained; without flow it is the energy that the branches
        store.
        """
        full, weight, grown, growth = self._grown(c)
        moduli, kept = self._moduli(full.ndim), _aligned(self._unit[0], 2, full.ndim)
        excess = _excess(kept, weight, full) / (1 + growth + growth**2) - 1
        return ((1.5 * moduli * excess).sum(0),
                *self._stress(full, weight, grown, growth, tangent))

    def stress(self, c: Any) -> tuple[AnyArray, AnyArray | None]:
        """Compute S and ∂S/∂E of :meth:`density` alone."""
        if self.at_once is None:
            return self._stress(*self._grown(c), tangent=True)
        plane, thick = self.at_once
        stress, bend = of_thickness(np.asarray(c), thick)
        return _aligned(plane, 1, stress.ndim) + stress, bend

    @cached_property
    def at_once(self) -> tuple[AnyArray, AnyArray] | None:
        """Σ μ C_v⁻¹ in the plane, (3, *points), and Σ μ/C_v,33 [Pa]; None if a branch flows.

        Without flow the branches store ½ (the first : C + the second/det C).
        """
        if np.any(self.weight):
            return None
        moduli, back = self._moduli(self.kept.ndim), inverse(self.kept)
        return (moduli * back[:3]).sum(1), (moduli * back[3]).sum(0)

    def _grown(self, c: Any) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray]:
        """Compute C, w, H + w C and det(H + w C)^⅓, scaled to det H = 1."""
        full = incompressible(c)[:, None]
        kept, weight = self._unit
        weight = _aligned(weight, 1, full.ndim - 1)
        grown = _aligned(kept, 2, full.ndim) + weight * full
        return full, weight, grown, cube_root(determinant(grown))

    def _stress(self, full: AnyArray, weight: AnyArray, grown: AnyArray, growth: AnyArray,
                tangent: bool
                ) -> tuple[AnyArray, AnyArray | None]:
        by_grown, by_full = inverse(grown), inverse(full)
        ratio = full[3] / grown[3]
        pull = (by_grown - ratio * by_full)[:3]
        strength = self._moduli(full.ndim) * growth
        stress = (strength * pull).sum(1)
        if not tangent:
            return stress, None
        softer, stiffer = strength * weight, strength * ratio
        along = 2 / 3 * softer * pull
        by_stretch = 2 * stiffer * (2 - weight * ratio) * by_full
        by_growth = 2 * softer * by_grown
        area = stiffer * plane_determinant(by_full) - softer * plane_determinant(by_grown)
        bend = np.empty((3, 3, *stress.shape[1:]), dtype=stress.dtype)
        for i in range(3):
            for j in range(i, 3):
                part = (along[i] * pull[j] + by_stretch[i] * by_full[j]
                        - by_growth[i] * by_grown[j])
                if ACROSS[i][j]:
                    part += ACROSS[i][j] * area
                bend[i, j] = bend[j, i] = part.sum(0)
        return stress, bend

    def _moduli(self, axes: int) -> AnyArray:
        """Reshape the moduli of the branches for tensors of this number of axes."""
        return self.memory.moduli.reshape(-1, *(1,) * (axes - 2))

    @cached_property
    def _unit(self) -> tuple[AnyArray, AnyArray]:
        # The potential is the same for any multiple of H and w; with det H = 1 it has a limit.
        unit = cube_root(determinant(self.kept))
        return self.kept / unit, self.weight / unit


def _constants(film: Film) -> tuple[AnyArray, AnyArray, tuple[FlowLaw, ...]]:
    """Collect moduli [Pa] and times [s] of branches, and their flows if any is not constant."""
    flows = tuple(branch.flow for branch in film.branches)
    constant = all(flow == ConstantFlow() for flow in flows)
    return (np.array([branch.modulus for branch in film.branches]),
            np.array([branch.time for branch in film.branches]), () if constant else flows)


def _grown(flat: AnyArray, age: float, branch: ViscousBranch) -> float:
    """Compute s of M = 1 + s C after C was held for an age [s]; ds/dt = det(M)^⅓ φ/τ, φ = η₀/η."""
    from scipy.integrate import solve_ivp  # slow to load, and few films have an age

    constants = np.array([branch.modulus]), np.array([branch.time])
    flows = () if branch.flow == ConstantFlow() else (branch.flow,)

    def fluidity(viscous: AnyArray) -> Any:
        return Memory(*constants, viscous[:, None], flows).fluidity(flat[:3])

    # The unknown is the logarithm of 1 + s, since s grows exponentially.
    def rate(_: float, log: AnyArray) -> AnyArray:
        grown = _UNIT + np.expm1(log) * flat
        size = np.cbrt(determinant(grown))
        return np.asarray(size * np.exp(-log) * fluidity(grown / size))

    longest = _LONG / float(np.squeeze(fluidity(flat)))
    done = solve_ivp(rate, (0.0, min(age / branch.time, longest)), [0.0], "DOP853", rtol=1e-12,
                     atol=1e-12)
    return float(np.expm1(done.y[0, -1]))


def incompressible(c: Any) -> AnyArray:
    """Complete (C₁₁, C₂₂, C₁₂) with the C₃₃ that keeps the volume, shape (4, *points)."""
    c11, c22, c12 = c
    across = np.asarray(1 / (c11 * c22 - c12 * c12))
    full = np.empty((4, *across.shape), across.dtype)
    full[0], full[1], full[2], full[3] = c11, c22, c12, across
    return full


def determinant(a: AnyArray) -> AnyArray:
    """Compute determinants of symmetric tensors, shape (...)."""
    return np.asarray((a[0] * a[1] - a[2] * a[2]) * a[3])


def inverse(a: AnyArray) -> AnyArray:
    """Invert symmetric tensors, in their shape."""
    first, last, shear, thick = a
    plane = first * last - shear * shear
    result = np.empty_like(a)
    result[0] = last / plane
    result[1] = first / plane
    result[2] = -shear / plane
    result[3] = 1 / thick
    return result


def inner(a: AnyArray, b: AnyArray) -> AnyArray:
    """Compute a : b of symmetric tensors, shape (...)."""
    sums = a * b
    sums[2] *= 2
    return np.asarray(np.add.reduce(sums, 0))


def _weights(rate: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Integrate e^(κ(s−1)) times 1 − s, and times s, over s in (0, 1)."""
    slow = rate < _SLOW
    if slow.all():
        return _slow_weights(rate)
    k = np.where(slow, 1.0, rate)
    fading = np.exp(-k)
    first = (1 - fading * (1 + k)) / k**2
    last = (k - 1 + fading) / k**2
    if slow.any():
        near = _slow_weights(np.minimum(rate, _SLOW))
        first, last = np.where(slow, near[0], first), np.where(slow, near[1], last)
    return first, last


def _slow_weights(rate: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Compute both weights at small rates: of s by its series Σ (−κ)ⁿ/(n + 2)!, then of 1 − s."""
    last = np.full_like(rate, _SERIES[-1])
    for term in _SERIES[-2::-1]:
        last = last * rate + term
    return 1 - last * (1 + rate), last


def _excess(kept: AnyArray, weight: AnyArray, full: AnyArray) -> AnyArray:
    """Compute (det(H + w C) − 1)/w for det H = det C = 1."""
    return np.asarray(inner(inverse(kept), full)
                      + weight * (inner(inverse(full), kept) + weight))


def plane_determinant(a: AnyArray) -> AnyArray:
    """Compute determinants in the plane of symmetric tensors, shape (...)."""
    first, last, shear = a[:3]
    return np.asarray(first * last - shear * shear)


def of_thickness(c: AnyArray, thick: Any, *, tangent: bool = True) -> tuple[AnyArray,
                 AnyArray | None]:
    """Compute S = 2∂/∂C and ∂S/∂E (Voigt form) of ½ thick/det C, C in the plane, shape (3, ...)."""
    across, thin = cofactor(c), 1 / plane_determinant(c)
    push = thick * thin**2
    if not tangent:
        return -push * across, None
    bend = (4 * push * thin * across)[:, None] * across
    add_across(bend, push)
    return -push * across, bend


def cofactor(a: AnyArray) -> AnyArray:
    """Compute cofactors in the plane of symmetric tensors, shape (3, ...)."""
    result = np.empty((3, *a.shape[1:]), a.dtype)
    result[0], result[1] = a[1], a[0]
    np.negative(a[2], out=result[2])
    return result


def add_across(slopes: AnyArray, value: AnyArray) -> None:
    """Add :data:`ACROSS` times a value to slopes, shape (3, 3, ...)."""
    double = 2 * value
    slopes[0, 1] -= double
    slopes[1, 0] -= double
    slopes[2, 2] += value


def _aligned(values: AnyArray, first: int, axes: int) -> AnyArray:
    """Insert axes after the first ones, up to this number of axes in all."""
    new = (1,) * (axes - values.ndim)
    return values.reshape(*values.shape[:first], *new, *values.shape[first:])


def cube_root(value: AnyArray) -> AnyArray:
    """Compute the cube root of any numbers, complex ones too."""
    return value ** (1 / 3) if np.iscomplexobj(value) else np.cbrt(value)
