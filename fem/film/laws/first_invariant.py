"""Laws in the first invariant alone: neo-Hooke, Yeoh, Gent, Arruda and Boyce."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.fem.film.laws.invariants import FirstInvariantLaw
from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, require
from tympan.geometry.specimen import LAWS
from tympan.geometry.toml_reader import POSITIVE, Rule

_ABOVE_ONE: Rule = (lambda x: 1 < x < float("inf"),
                    "must be above 1 (at 1 the chains would be taut at rest)")


@LAWS.register
@dataclass(frozen=True)
class NeoHooke(FirstInvariantLaw):
    """The neo-Hookean law (Rivlin, Phil. Trans. R. Soc. A 240, 459, 1948.

    Treloar's Gaussian network).

    W = μ/2 (I₁ − 3), μ in Pa. It follows unfilled rubber up to stretches of about 1.5 to 2, and
    does not stiffen beyond as rubber does.

    Examples
    --------
    Equibiaxial true stress at λ₁ = λ₂ = 2 is μ (λ² − λ⁻⁴):

    >>> 2 * NeoHooke(mu=16e3).derivatives(2.0, 2.0)[1]
    63000.0
    """

    law: ClassVar[str] = "neo_hooke"
    mu: Annotated[float, Key("shear modulus", "stress", POSITIVE)]

    def __post_init__(self) -> None:
        require(self)

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """μ/2 (I₁ − 3) and its derivatives."""
        return self.mu / 2 * excess, self.mu / 2, 0.0


@LAWS.register
@dataclass(frozen=True)
class Yeoh(FirstInvariantLaw):
    """Yeoh's law (Rubber Chem. Technol. 66, 754, 1993) with any number of terms; he used three.

    W = Σ c_k0 (I₁ − 3)ᵏ, k = 1, 2, …, c = (c₁₀, c₂₀, …) in Pa. It follows filled rubber with c₂₀ <
    0 < c₃₀; being a polynomial, it is worth nothing beyond the stretches it was fitted to. It does
    not lock.

    Examples
    --------
    >>> Yeoh((9e3, -20.0, 1.0)).shear_modulus
    18000.0
    """

    law: ClassVar[str] = "yeoh"
    c: Annotated[tuple[float, ...], Key("c₁₀, c₂₀, …", "stress")]

    def __post_init__(self) -> None:
        if not self.c:
            raise InputError("must be a list of at least one stress", key="c", given=self.c)

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """Σ c_k0 (I₁ − 3)ᵏ and its derivatives."""
        return _polynomial(self.c, excess)


@LAWS.register
@dataclass(frozen=True)
class Gent(FirstInvariantLaw):
    """Gent's law (Rubber Chem. Technol. 69, 59, 1996), unbounded at a finite stretch.

    W = −μ J/2 ln(1 − (I₁ − 3)/J), μ in Pa, J = ``j_lim`` without unit. It follows rubber up to I₁ −
    3 = J, where its chains are taut; beyond, the film cannot be stretched, W = +∞.

    Examples
    --------
    >>> film = Gent(mu=18e3, j_lim=7.0)
    >>> film.shear_modulus
    18000.0
    >>> float(film.derivatives(3.0, 3.0)[0])
    inf
    """

    law: ClassVar[str] = "gent"
    mu: Annotated[float, Key("shear modulus", "stress", POSITIVE)]
    j_lim: Annotated[float, Key("the I₁ − 3 at which it locks", rule=POSITIVE)]

    def __post_init__(self) -> None:
        require(self)

    @property
    def locking(self) -> float:
        """J."""
        return self.j_lim

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """−μ J/2 ln(1 − (I₁ − 3)/J) and its derivatives."""
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
    42039/(67375λ⁸), λ = λ_lock: see :attr:`shear_modulus`.

    λ_lock = √N is the stretch of a chain of N links when taut; a chain's stretch is √(I₁/3). The
    series stands for the inverse Langevin function: its stress is 0.5 % too small where chains are
    at 0.6 λ_lock and 10 % at 0.8 λ_lock. From λ_lock on, W = +∞; the series itself is finite there
    but means nothing.

    Examples
    --------
    >>> film = ArrudaBoyce(mu=16e3, lambda_lock=3.0)
    >>> round(film.shear_modulus / film.mu, 6)
    1.07455
    """

    law: ClassVar[str] = "arruda_boyce"
    mu: Annotated[float, Key("rubbery modulus of the chains", "stress", POSITIVE)]
    lambda_lock: Annotated[float, Key("stretch of a taut chain", rule=_ABOVE_ONE)]

    def __post_init__(self) -> None:
        require(self)

    @property
    def locking(self) -> float:
        """3 (λ_lock² − 1)."""
        return 3 * (self.lambda_lock**2 - 1)

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """The series and its derivatives."""
        c = tuple(self.mu * number / self.lambda_lock ** (2 * power)
                  for power, number in enumerate(_LANGEVIN))
        f, slope, bend = _polynomial(c, excess + 3)
        return f - _polynomial(c, 3.0)[0], slope, bend


_LANGEVIN = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


def _polynomial(c: tuple[float, ...], x: Any) -> tuple[Any, Any, Any]:
    """Σ c_k xᵏ, k = 1, 2, …, and its first two derivatives, by Horner's rule."""
    value = slope = half_bend = 0.0
    for number in (*reversed(c), 0.0):
        half_bend = half_bend * x + slope
        slope = slope * x + value
        value = value * x + number
    return value, slope, 2 * half_bend
