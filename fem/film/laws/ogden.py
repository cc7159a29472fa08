"""Ogden's law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key
from tympan.geometry.specimen import LAWS
from tympan.geometry.toml_reader import Rule

_POWER: Rule = (lambda x: 0 < abs(x) <= 50, "must not be zero, nor beyond 50")


@LAWS.register
@dataclass(frozen=True)
class Ogden:
    """Ogden's law with any number of terms, incompressible.

    W = Σ (μ_p/α_p) (λ₁^α_p + λ₂^α_p + λ₃^α_p − 3), λ₃ = 1/(λ₁λ₂), μ_p in Pa.

    This is Ogden's own convention (Proc. R. Soc. A 326, 1972); Abaqus, CalculiX and FElupe write
    Σ 2μ_p/α_p² (…), see :meth:`from_abaqus`.

    Examples
    --------
    Neo-Hooke is one term with α = 2, and its shear modulus is μ:

    >>> film = Ogden((20e3,), (2.0,))
    >>> float(film.shear_modulus)
    20000.0
    """

    law: ClassVar[str] = "ogden"
    stress_free_when_virgin: ClassVar[bool] = True
    mu: Annotated[tuple[float, ...], Key("μ_p", "stress")]
    alpha: Annotated[tuple[float, ...], Key("α_p", rule=_POWER)]

    def __post_init__(self) -> None:
        """Refuse lists that do not match and powers of zero."""
        if len(self.mu) != len(self.alpha) or not self.mu:
            raise InputError("mu and alpha must be lists of the same length, at least one",
                             key="mu", given=f"{len(self.mu)} and {len(self.alpha)} values")
        if 0 in self.alpha:
            raise InputError("must not be zero", key="alpha", given=self.alpha)

    @classmethod
    def from_abaqus(cls, mu: tuple[float, ...], alpha: tuple[float, ...]) -> Ogden:
        """From the convention Σ 2μ_p/α_p² (…) of Abaqus, CalculiX and FElupe.

        Examples
        --------
        >>> Ogden.from_abaqus((10.0,), (4.0,))
        Ogden(mu=(5.0,), alpha=(4.0,))
        """
        return cls(tuple(2 * m / a for m, a in zip(mu, alpha, strict=True)), alpha)

    @property
    def shear_modulus(self) -> float:
        """Small-strain shear modulus ½ Σ μ_p α_p [Pa]."""
        return sum(m * a for m, a in zip(self.mu, self.alpha, strict=True)) / 2

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        w = w1 = w2 = w11 = w12 = w22 = 0.0
        for mu, alpha in zip(self.mu, self.alpha, strict=True):
            p1, p2 = l1**alpha, l2**alpha
            p3 = 1 / (p1 * p2)
            w = w + mu / alpha * (p1 + p2 + p3 - 3)
            w1 = w1 + mu * (p1 - p3) / l1
            w2 = w2 + mu * (p2 - p3) / l2
            w11 = w11 + mu * ((alpha - 1) * p1 + (alpha + 1) * p3) / l1**2
            w22 = w22 + mu * ((alpha - 1) * p2 + (alpha + 1) * p3) / l2**2
            w12 = w12 + mu * alpha * p3 / (l1 * l2)
        return w, w1, w2, w11, w12, w22

