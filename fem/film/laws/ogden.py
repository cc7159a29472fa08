"""Laws of powers of the stretches: Ogden's, and Eq. (8) of the source paper as a membrane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.toml_reader import Rule
from tympan.geometry.specimen import LAWS

_POWER: Rule = (lambda x: 0 < abs(x) <= 50, "must not be zero, nor beyond 50")
_POSITIVE_POWER: Rule = (lambda x: 0 < x <= 50, "must be above 0, at most 50")
_REFERENCE: Rule = (lambda x: 0.2 <= x <= 10,
                    "must be a stretch between 0.2 and 10 (from the virgin film)")


@LAWS.register
@dataclass(frozen=True)
class Ogden:
    """Ogden's law with any number of terms, incompressible.

    W = Σ (μ_p/α_p) (λ₁^α_p + λ₂^α_p + λ₃^α_p − 3), λ₃ = 1/(λ₁λ₂), μ_p in Pa.

    This is Ogden's own convention (Proc. R. Soc. A 326, 1972); Abaqus, CalculiX and FElupe write
    Σ 2μ_p/α_p² (…), see :meth:`from_abaqus`.

    Examples
    --------
    Neo-Hooke is one term with α = 2; its true stress at λ₁ = λ₂ = 2 is μ (λ² − λ⁻⁴):

    >>> float(2 * Ogden((16e3,), (2.0,)).derivatives(2.0, 2.0)[1])
    63000.0
    """

    law: ClassVar[str] = "ogden"
    mu: Annotated[tuple[float, ...], Key("μ_p", "stress")]
    alpha: Annotated[tuple[float, ...], Key("α_p", rule=_POWER)]

    def __post_init__(self) -> None:
        if len(self.mu) != len(self.alpha) or not self.mu:
            raise InputError("mu and alpha must be lists of the same length, at least one",
                             key="mu", given=f"{len(self.mu)} and {len(self.alpha)} values")
        if 0 in self.alpha:
            raise InputError("must not be zero", key="alpha", given=self.alpha)

    @classmethod
    def from_abaqus(cls, mu: tuple[float, ...], alpha: tuple[float, ...]) -> Ogden:
        """Convert from the convention Σ 2μ_p/α_p² (…) of Abaqus, CalculiX and FElupe."""
        return cls(tuple(2 * m / a for m, a in zip(mu, alpha, strict=True)), alpha)

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        w = w1 = w2 = w11 = w12 = w22 = 0.0
        # Two logarithms and an exponential for each power take half of the time of the powers.
        log1, log2 = np.log(l1), np.log(l2)
        for mu, alpha in zip(self.mu, self.alpha, strict=True):
            p1, p2 = np.exp(alpha * log1), np.exp(alpha * log2)
            p3 = 1 / (p1 * p2)
            w = w + mu / alpha * (p1 + p2 + p3 - 3)
            w1 = w1 + mu * (p1 - p3)
            w2 = w2 + mu * (p2 - p3)
            both = mu * (alpha + 1) * p3
            w11 = w11 + (mu * (alpha - 1) * p1 + both)
            w22 = w22 + (mu * (alpha - 1) * p2 + both)
            w12 = w12 + mu * alpha * p3
        return w, w1 / l1, w2 / l2, w11 / (l1 * l1), w12 / (l1 * l2), w22 / (l2 * l2)


@dataclass(frozen=True)
class Prestretched:
    """Energies of relative stretches lᵢ = λᵢ/λ_r, built to give Eq. (8) of the source paper.

    Eq. (8) is σ(l) = Σ (β_p l^α_p − γ_p l^−α_p), α = 2, 4, 6: the true stress along a film that is
    stretched by l from the mounted state while its width is held. One stress in one such test does
    not make a law for two stretches: an assumption must be added on what carries γ, and each
    subclass is one.

    The reference is equibiaxial, because an isotropic W(λ₁, λ₂) must not change when its stretches
    are exchanged. Volume is preserved, so energy per mounted and per virgin volume are the same. W
    is 0 at the reference, where the stress is Σ (β − γ); the virgin film is in general not free of
    stress, and nothing says what it does there.
    """

    beta: Annotated[tuple[float, ...], Key("β_p", "stress")]
    gamma: Annotated[tuple[float, ...], Key("γ_p", "stress")]
    alpha: Annotated[tuple[float, ...], Key("α_p", rule=_POSITIVE_POWER, default="2, 4, 6, …")]
    reference: Annotated[float, Key("λ_r, from the virgin film", rule=_REFERENCE)]

    def __post_init__(self) -> None:
        if not len(self.beta) == len(self.gamma) == len(self.alpha) > 0:
            raise InputError("beta, gamma and alpha must be lists of the same length, at least one",
                             key="beta",
                             given=f"{len(self.beta)}, {len(self.gamma)} and {len(self.alpha)} "
                                   "values")

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Add the paper's powers where a file leaves them out."""
        powers = tuple(2.0 * (number + 1) for number in range(len(values["beta"])))
        return {"alpha": powers} | values

    def _terms(self) -> Any:
        return zip(self.beta, self.gamma, self.alpha, strict=True)


@LAWS.register
@dataclass(frozen=True)
class Separable(Prestretched):
    """Eq. (8) of the source paper with every in-plane stretch on its own.

    W = w(λ₁/λ_r) + w(λ₂/λ_r).

    w(l) = Σ (β_p l^α_p + γ_p l^−α_p − β_p − γ_p)/α_p, so that the true stress σᵢ = Σ (β_p lᵢ^α_p −
    γ_p lᵢ^−α_p) is Eq. (8) whatever the other stretch: a film without coupling between its axes.
    Incompressibility gives the thickness but λ₃ does not enter the energy. With all β, γ > 0 it is
    admissible everywhere; with the paper's Table 1 (γ < 0) stress falls with stretch at the mounted
    state. It does not lock.
    """

    law: ClassVar[str] = "separable"

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        (w, w1, w11), (v, w2, w22) = self._axis(l1), self._axis(l2)
        return w + v, w1, w2, w11, 0 * (l1 * l2), w22

    def _axis(self, stretch: Any) -> tuple[Any, Any, Any]:
        w = slope = bend = 0.0
        relative = stretch / self.reference
        for beta, gamma, alpha in self._terms():
            up, down = beta * relative**alpha, gamma * relative**-alpha
            w = w + (up + down - beta - gamma) / alpha
            slope = slope + (up - down) / stretch
            bend = bend + ((alpha - 1) * up + (alpha + 1) * down) / stretch**2
        return w, slope, bend


@LAWS.register
@dataclass(frozen=True)
class PrestretchedOgden(Prestretched):
    """Eq. (8) of the source paper with γ carried by the thickness.

    An Ogden law written for the mounted film.

    W = Σ (β_p (l₁^α_p + l₂^α_p − 2) + γ_p (l₃^α_p − 1))/α_p, l₃ = 1/(l₁ l₂), so σᵢ = Σ (β_p lᵢ^α_p
    − γ_p l₃^α_p): Eq. (8) where l₂ = 1, its l^−α being the paper's λ_z^α by its Eqs. (2) and (3).
    Ogden's law of a virgin film stretched by λ_r has this form with β = μ λ_r^α and γ = μ λ_r^−2α,
    so both of one sign and β/γ = λ_r^3α; β = γ is an Ogden film mounted without prestretch. The
    paper's Table 1 (γ < 0 < β) is neither.
    """

    law: ClassVar[str] = "prestretched_ogden"

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        w = w1 = w2 = w11 = w12 = w22 = 0.0
        x1, x2 = l1 / self.reference, l2 / self.reference
        for beta, gamma, alpha in self._terms():
            p1, p2, p3 = beta * x1**alpha, beta * x2**alpha, gamma * (x1 * x2) ** -alpha
            w = w + (p1 + p2 + p3 - 2 * beta - gamma) / alpha
            w1 = w1 + (p1 - p3) / l1
            w2 = w2 + (p2 - p3) / l2
            w11 = w11 + ((alpha - 1) * p1 + (alpha + 1) * p3) / l1**2
            w22 = w22 + ((alpha - 1) * p2 + (alpha + 1) * p3) / l2**2
            w12 = w12 + alpha * p3 / (l1 * l2)
        return w, w1, w2, w11, w12, w22
