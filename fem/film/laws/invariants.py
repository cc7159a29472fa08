"""Laws of the invariants I₁ and I₂: neo-Hooke, Yeoh, Gent, Arruda and Boyce, Mooney and Rivlin.

A function of the stretches is the tuple of its value and its derivatives by 1, 2, 11, 12, 22.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.geometry.specimen import LAWS

_ABOVE_ONE: Rule = (lambda x: 1 < x < float("inf"),
                    "must be above 1 (at 1 the chains would be taut at rest)")
_LANGEVIN = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


def first_invariant(l1: Any, l2: Any) -> tuple[Any, ...]:
    """Compute I₁ − 3 = λ₁² + λ₂² + λ₃² − 3."""
    l3 = 1 / (l1 * l2)
    s3 = l3 * l3
    by1, by2 = s3 / l1, s3 / l2
    value = l1 * l1 + l2 * l2 + s3 - 3
    slopes = 2 * (l1 - by1), 2 * (l2 - by2)
    curvatures = 2 + 6 * (by1 / l1), 4 * (s3 * l3), 2 + 6 * (by2 / l2)
    return value, *slopes, *curvatures


def _second_invariant(l1: Any, l2: Any) -> tuple[Any, ...]:
    """Compute I₂ − 3 = λ₁⁻² + λ₂⁻² + λ₃⁻² − 3."""
    s1, s2 = l1 * l1, l2 * l2
    value = 1 / s1 + 1 / s2 + s1 * s2 - 3
    slopes = 2 * (l1 * s2 - 1 / (s1 * l1)), 2 * (l2 * s1 - 1 / (s2 * l2))
    curvatures = 2 * s2 + 6 / s1**2, 4 * l1 * l2, 2 * s1 + 6 / s2**2
    return value, *slopes, *curvatures


def of_first_invariant(energy: Callable[[Any], tuple[Any, Any, Any]], l1: Any, l2: Any
                       ) -> tuple[Any, ...]:
    """Convert an energy f of I₁ − 3, given with f′ and f″, to a function of the stretches."""
    excess, i1, i2, i11, i12, i22 = first_invariant(l1, l2)
    f, slope, bend = energy(excess)
    bend1, bend2 = bend * i1, bend * i2
    return (f, slope * i1, slope * i2,
            slope * i11 + bend1 * i1, slope * i12 + bend1 * i2, slope * i22 + bend2 * i2)


class FirstInvariantLaw(ABC):
    """A law whose energy is a function f of I₁ − 3 alone."""

    @property
    def locking(self) -> float:
        """I₁ − 3 above which W is +∞ and its derivatives are nan."""
        return inf

    @abstractmethod
    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """Compute f, f′ and f″ at I₁ − 3 below :attr:`locking`."""

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        return of_first_invariant(self._energy_or_infinity, l1, l2)

    def _energy_or_infinity(self, excess: Any) -> tuple[Any, Any, Any]:
        defined = np.real(excess) < np.real(self.locking)
        if np.all(defined):
            return self.energy(excess)
        f, slope, bend = self.energy(np.where(defined, excess, 0.0))
        slope, bend = (np.where(defined, value, nan) for value in (slope, bend))
        return np.where(defined, f, inf), slope, bend


@LAWS.register
@dataclass(frozen=True)
class NeoHooke(FirstInvariantLaw):
    """The neo-Hookean law (Rivlin, Phil. Trans. R. Soc. A 240, 459, 1948.

    Treloar's Gaussian network).

    W = μ/2 (I₁ − 3), μ in Pa. It follows unfilled rubber up to stretches of about 1.5 to 2, and
    does not stiffen beyond as rubber does.
    """

    law: ClassVar[str] = "neo_hooke"
    mu: Annotated[float, Key("shear modulus", "stress", POSITIVE)]

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        return self.mu / 2 * excess, self.mu / 2, 0.0


@LAWS.register
@dataclass(frozen=True)
class Yeoh(FirstInvariantLaw):
    """Yeoh's law (Rubber Chem. Technol. 66, 754, 1993) with any number of terms; he used three.

    W = Σ c_k0 (I₁ − 3)ᵏ, k = 1, 2, …, c = (c₁₀, c₂₀, …) in Pa. It follows filled rubber with c₂₀ <
    0 < c₃₀; being a polynomial, it is worth nothing beyond the stretches it was fitted to. It does
    not lock.
    """

    law: ClassVar[str] = "yeoh"
    c: Annotated[tuple[float, ...], Key("c₁₀, c₂₀, …", "stress")]

    def __post_init__(self) -> None:
        if not self.c:
            raise InputError("must be a list of at least one stress", key="c", given=self.c)

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        return _polynomial(self.c, excess)


@LAWS.register
@dataclass(frozen=True)
class Gent(FirstInvariantLaw):
    """Gent's law (Rubber Chem. Technol. 69, 59, 1996), unbounded at a finite stretch.

    W = −μ J/2 ln(1 − (I₁ − 3)/J), μ in Pa, J = ``j_lim`` without unit. It follows rubber up to I₁ −
    3 = J, where its chains are taut; beyond, the film cannot be stretched, W = +∞.

    Examples
    --------
    >>> float(Gent(mu=18e3, j_lim=7.0).derivatives(3.0, 3.0)[0])
    inf
    """

    law: ClassVar[str] = "gent"
    mu: Annotated[float, Key("shear modulus", "stress", POSITIVE)]
    j_lim: Annotated[float, Key("the I₁ − 3 at which it locks", rule=POSITIVE)]

    @property
    def locking(self) -> float:
        return self.j_lim

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        slope = self.mu / (2 * (1 - excess / self.j_lim))
        energy = -self.mu * self.j_lim / 2 * np.log1p(-excess / self.j_lim)
        return energy, slope, slope / (self.j_lim - excess)


@LAWS.register
@dataclass(frozen=True)
class ArrudaBoyce(FirstInvariantLaw):
    """The eight-chain law of Arruda and Boyce (J. Mech. Phys. Solids 41, 389, 1993), five terms.

    W = μ Σ C_i/λ_lock^(2i−2) (I₁ⁱ − 3ⁱ), C = 1/2, 1/20, 11/1050, 19/7000, 519/673750. μ = n k T
    [Pa] is the rubbery modulus of the chains (C_R of the paper, ``MU`` of Abaqus) and not the
    initial shear modulus, which is larger by 1 + 3/(5λ²) + 99/(175λ⁴) + 513/(875λ⁶) +
    42039/(67375λ⁸), λ = λ_lock.

    λ_lock = √N is the stretch of a chain of N links when taut; a chain's stretch is √(I₁/3). The
    series stands for the inverse Langevin function: its stress is 0.5 % too small where chains are
    at 0.6 λ_lock and 10 % at 0.8 λ_lock. From λ_lock on, W = +∞; the series itself is finite there
    but means nothing.
    """

    law: ClassVar[str] = "arruda_boyce"
    mu: Annotated[float, Key("rubbery modulus of the chains", "stress", POSITIVE)]
    lambda_lock: Annotated[float, Key("stretch of a taut chain", rule=_ABOVE_ONE,
                                       made=_ABOVE_ONE)]

    @property
    def locking(self) -> float:
        return 3 * (self.lambda_lock**2 - 1)

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        c = tuple(self.mu * number / self.lambda_lock ** (2 * power)
                  for power, number in enumerate(_LANGEVIN))
        f, slope, bend = _polynomial(c, excess + 3)
        return f - _polynomial(c, 3.0)[0], slope, bend


@LAWS.register
@dataclass(frozen=True)
class MooneyRivlin:
    """The law of Mooney (J. Appl. Phys. 11, 582, 1940) and Rivlin.

    W = c₁₀ (I₁ − 3) + c₀₁ (I₂ − 3), c₁₀ and c₀₁ in Pa (Rivlin, Phil. Trans. R. Soc. A 241, 379,
    1948). It follows unfilled rubber in tension up to
    stretches of about 2 to 3; in equibiaxial tension its second term is apt to be far too stiff
    (Treloar, *The Physics of Rubber Elasticity*, 3rd ed. 1975), so constants fitted to uniaxial
    tests alone are not for films. It does not lock.
    """

    law: ClassVar[str] = "mooney_rivlin"
    c10: Annotated[float, Key("c₁₀", "stress")]
    c01: Annotated[float, Key("c₀₁", "stress")]

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        pairs = zip(first_invariant(l1, l2), _second_invariant(l1, l2), strict=True)
        return tuple(self.c10 * first + self.c01 * second for first, second in pairs)


def _polynomial(c: tuple[float, ...], x: Any) -> tuple[Any, Any, Any]:
    """Evaluate Σ c_k xᵏ, k = 1, 2, …, and its first two derivatives, by Horner's rule."""
    value = slope = half_bend = 0.0
    for number in (*reversed(c), 0.0):
        half_bend = half_bend * x + slope
        slope = slope * x + value
        value = value * x + number
    return value, slope, 2 * half_bend
