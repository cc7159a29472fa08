"""Invariants of an incompressible solid by the in-plane stretches; energies of the first one.

A function of the stretches is the tuple of its value and its derivatives by 1, 2, 11, 12, 22.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import inf, nan
from typing import Any, ClassVar

import numpy as np


def first_invariant(l1: Any, l2: Any) -> tuple[Any, ...]:
    """I₁ − 3 = λ₁² + λ₂² + λ₃² − 3."""
    l3 = 1 / (l1 * l2)
    s3 = l3 * l3
    by1, by2 = s3 / l1, s3 / l2
    return (l1 * l1 + l2 * l2 + s3 - 3, 2 * (l1 - by1), 2 * (l2 - by2),
            2 + 6 * (by1 / l1), 4 * (s3 * l3), 2 + 6 * (by2 / l2))


def second_invariant(l1: Any, l2: Any) -> tuple[Any, ...]:
    """I₂ − 3 = λ₁⁻² + λ₂⁻² + λ₃⁻² − 3."""
    s1, s2 = l1 * l1, l2 * l2
    return (1 / s1 + 1 / s2 + s1 * s2 - 3, 2 * (l1 * s2 - 1 / (s1 * l1)),
            2 * (l2 * s1 - 1 / (s2 * l2)),
            2 * s2 + 6 / s1**2, 4 * l1 * l2, 2 * s1 + 6 / s2**2)


def of_first_invariant(energy: Callable[[Any], tuple[Any, Any, Any]], l1: Any, l2: Any
                       ) -> tuple[Any, ...]:
    """An energy f of I₁ − 3, given with f′ and f″, as a function of the stretches."""
    excess, i1, i2, i11, i12, i22 = first_invariant(l1, l2)
    f, slope, bend = energy(excess)
    bend1, bend2 = bend * i1, bend * i2
    return (f, slope * i1, slope * i2,
            slope * i11 + bend1 * i1, slope * i12 + bend1 * i2, slope * i22 + bend2 * i2)


class FirstInvariantLaw(ABC):
    """A law whose energy is a function f of I₁ − 3 alone."""

    stress_free_when_virgin: ClassVar[bool] = True

    @property
    def locking(self) -> float:
        """The I₁ − 3 from which on W is +∞ and its derivatives are nan."""
        return inf

    @abstractmethod
    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """f, f′ and f″ at I₁ − 3 below :attr:`locking`."""

    @property
    def shear_modulus(self) -> float:
        """Small-strain shear modulus 2 f′(0) [Pa]."""
        modulus: float = 2 * self.energy(0.0)[1]
        return modulus

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        """W and W₁, W₂, W₁₁, W₁₂, W₂₂ at the stretches (arrays of one shape, real or complex)."""
        return of_first_invariant(self._energy_or_infinity, l1, l2)

    def _energy_or_infinity(self, excess: Any) -> tuple[Any, Any, Any]:
        defined = np.real(excess) < np.real(self.locking)
        if np.all(defined):
            return self.energy(excess)
        f, slope, bend = self.energy(np.where(defined, excess, 0.0))
        slope, bend = (np.where(defined, value, nan) for value in (slope, bend))
        return np.where(defined, f, inf), slope, bend
