"""What a film with viscous branches remembers, and its energy in a step of time.

Beside its law a film has branches of a modulus μ and a time τ. Each stores μ/2 (C : C_v⁻¹ − 3) per
virgin volume, det C_v = 1, C₃₃ = 1/(C₁₁C₂₂ − C₁₂²), and flows: Ċ_v = (C − ⅓ (C : C_v⁻¹) C_v)/τ
(Kumar and Lopez-Pamies, C. R. Mecanique 344, 2016, with a neo-Hookean branch).

So C_v = M/det(M)^⅓ of an M that grows along C, Ṁ = det(M)^⅓ C/τ. A step from C₀ to C leaves M = H +
w C, where H is known before and w follows from the step's length, and what the branch then pulls
with derives from the potential (3μ/2w) det(H + w C)^⅓. No equations are solved at a point, C_v
stays positive with determinant 1, and the tangent is symmetric. (For Euler's step: Shutov, Landgraf
and Ihlemann, Comput. Methods Appl. Mech. Eng. 265, 2013; this one is of second order.)

Symmetric tensors are arrays of the components 11, 22, 12, 33 on the virgin film's axes, which are
their first axis; the branches' own are the second one of what belongs to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

#: Rates below which the weights of a step are their series, and its terms.
_SLOW, _TERMS = 0.5, 12

#: Places of the Voigt components 11, 22, 12 among themselves.
_PLACES = ((0, 0), (1, 1), (0, 1))
_COMPONENT = ((0, 2), (2, 1))


@dataclass(frozen=True, eq=False)
class Memory:
    """The branches' C_v at points, shape (4, branches, *points), moduli [Pa] and times [s]."""

    moduli: Array
    times: Array
    viscous: Array

    @classmethod
    def relaxed(cls, moduli: Sequence[float], times: Sequence[float], c: Any) -> Memory:
        """At rest for ever at C of the virgin film, (C₁₁, C₂₂, C₁₂)."""
        full = incompressible(c)[:, None]
        shape = (4, len(moduli), *full.shape[2:])
        return cls(np.asarray(moduli, float), np.asarray(times, float),
                   np.broadcast_to(full, shape))

    def step(self, c: Any, duration: float) -> Flow:
        """What a step of a duration [s] from C keeps of what was before.

        In the step det(M)^⅓ grows exponentially, by its rate at the start.
        """
        before = incompressible(c)[:, None]
        share = duration / self._each(self.times)
        rate = share * inner(inverse(self.viscous), before) / 3
        first, last = _weights(rate)
        kept = np.exp(-rate) * self.viscous + share * first * before
        return Flow(self, kept, share * last)

    def energy(self, c: Any) -> Array:
        """What the branches store at C [J/m³], shape (*points)."""
        stretch = inner(inverse(self.viscous), incompressible(c)[:, None]) - 3
        return np.asarray((self._each(self.moduli) / 2 * stretch).sum(0))

    def _each(self, values: Array) -> Array:
        return values.reshape(-1, *np.ones(self.viscous.ndim - 2, dtype=int))


@dataclass(frozen=True, eq=False)
class Flow:
    """A step under way: H and w of every branch, shapes (4, branches, *points), (branches, *points).
    """

    memory: Memory
    kept: Array
    weight: Array

    def after(self, c: Any) -> Memory:
        """The memory at the step's end, at C."""
        grown = self.kept + self.weight * incompressible(c)[:, None]
        return replace(self.memory, viscous=grown / _cube_root(determinant(grown)))

    def density(self, c: Any, *, tangent: bool = True) -> tuple[Array, Array, Array | None]:
        """The step's potential at C [J/m³], S = 2∂/∂C and ∂S/∂E in Voigt form [Pa].

        Shapes (*points), (3, *points), (3, 3, *points). The potential is 0 where nothing is
        strained; without flow it is what the branches store.
        """
        moduli, full = self.memory._each(self.memory.moduli), incompressible(c)[:, None]
        # The potential is the same for any multiple of H and w: of det H = 1 it has a limit.
        unit = _cube_root(determinant(self.kept))
        kept, weight = self.kept / unit, self.weight / unit
        grown = kept + weight * full
        growth = _cube_root(determinant(grown))
        energy = 1.5 * moduli * (_excess(kept, weight, full) / (1 + growth + growth**2) - 1)
        by_grown, by_full, ratio = inverse(grown), inverse(full), full[3] / grown[3]
        pull, strength = (by_grown - ratio * by_full)[:3], moduli * growth
        stress = (strength * pull).sum(1)
        if not tangent:
            return energy.sum(0), stress, None
        bend = np.empty((3, 3, *stress.shape[1:]), dtype=stress.dtype)
        stiffening = ratio * (1 - weight * ratio)
        for i in range(3):
            for j in range(i, 3):
                part = (weight / 3 * pull[i] * pull[j] - weight * _between(by_grown, i, j)
                        + stiffening * by_full[i] * by_full[j] + ratio * _between(by_full, i, j))
                bend[i, j] = bend[j, i] = 2 * (strength * part).sum(0)
        return energy.sum(0), stress, bend


def incompressible(c: Any) -> Array:
    """C of (C₁₁, C₂₂, C₁₂) with the C₃₃ that keeps the volume, shape (4, *points)."""
    c11, c22, c12 = c
    return np.stack(np.broadcast_arrays(c11, c22, c12, 1 / (c11 * c22 - c12 * c12)))


def determinant(a: Array) -> Array:
    """Of symmetric tensors, shape (...)."""
    return np.asarray((a[0] * a[1] - a[2] * a[2]) * a[3])


def inverse(a: Array) -> Array:
    """Of symmetric tensors, in their shape."""
    plane = a[0] * a[1] - a[2] * a[2]
    return np.stack([a[1] / plane, a[0] / plane, -a[2] / plane, 1 / a[3]])


def inner(a: Array, b: Array) -> Array:
    """a : b of symmetric tensors, shape (...)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + 2 * a[2] * b[2] + a[3] * b[3])


def _weights(rate: Array) -> tuple[Array, Array]:
    """Integrals over s in (0, 1) of e^(κ(s−1)) times 1 − s and s."""
    slow = rate < _SLOW
    k = np.where(slow, 1.0, rate)
    first, last = (1 - np.exp(-k) * (1 + k)) / k**2, (k - 1 + np.exp(-k)) / k**2
    if slow.any():
        powers = [(-np.minimum(rate, _SLOW)) ** n / factorial(n + 2) for n in range(_TERMS)]
        first = np.where(slow, sum((n + 1) * power for n, power in enumerate(powers)), first)
        last = np.where(slow, sum(powers), last)
    return first, last


def _excess(kept: Array, weight: Array, full: Array) -> Array:
    """(det(H + w C) − 1)/w of det H = det C = 1."""
    return inner(inverse(kept), full) + weight * (inner(inverse(full), kept) + weight)


def _between(a: Array, i: int, j: int) -> Array:
    """Of A dC A by dC, symmetric in both pairs, the Voigt components i and j."""
    (p, q), (r, s) = _PLACES[i], _PLACES[j]
    return np.asarray(a[_COMPONENT[p][r]] * a[_COMPONENT[q][s]]
                      + a[_COMPONENT[p][s]] * a[_COMPONENT[q][r]]) / 2


def _cube_root(value: Array) -> Array:
    return np.asarray(value ** (1 / 3) if np.iscomplexobj(value) else np.cbrt(value))
