"""Laws of a film already stretched: Eq. (8) of the source paper as a membrane material."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, require
from tympan.geometry.specimen import LAWS
from tympan.geometry.toml_reader import Rule

_POWER: Rule = (lambda x: 0 < x <= 50, "must be above 0, at most 50")
_REFERENCE: Rule = (lambda x: 0.2 <= x <= 10,
                    "must be a stretch between 0.2 and 10 (from the virgin film)")


@dataclass(frozen=True)
class Prestretched(ABC):
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

    stress_free_when_virgin: ClassVar[bool] = False
    beta: Annotated[tuple[float, ...], Key("β_p", "stress")]
    gamma: Annotated[tuple[float, ...], Key("γ_p", "stress")]
    alpha: Annotated[tuple[float, ...], Key("α_p", rule=_POWER, default="2, 4, 6, …")]
    reference: Annotated[float, Key("λ_r, from the virgin film", rule=_REFERENCE)]

    def __post_init__(self) -> None:
        if not len(self.beta) == len(self.gamma) == len(self.alpha) > 0:
            raise InputError("beta, gamma and alpha must be lists of the same length, at least one",
                             key="beta",
                             given=f"{len(self.beta)}, {len(self.gamma)} and {len(self.alpha)} "
                                   "values")
        require(self)

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """With the paper's powers where a file leaves them out."""
        powers = tuple(2.0 * (number + 1) for number in range(len(values["beta"])))
        return {"alpha": powers} | values

    @property
    @abstractmethod
    def shear_modulus(self) -> float:
        """Incremental shear modulus ½ ∂(σ₁ − σ₂)/∂ln λ₁ at the reference [Pa]."""

    @abstractmethod
    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        """W and W₁, W₂, W₁₁, W₁₂, W₂₂ at stretches from the virgin film (arrays of one shape)."""

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

    Examples
    --------
    The stress at the reference is Σ (β − γ):

    >>> film = Separable((20e3,), (4e3,), (2.0,), reference=2.0)
    >>> 2.0 * film.derivatives(2.0, 2.0)[1]
    16000.0
    """

    law: ClassVar[str] = "separable"

    @property
    def shear_modulus(self) -> float:
        """½ Σ α (β + γ) [Pa]."""
        modulus: float = sum(a * (b + g) for b, g, a in self._terms()) / 2
        return modulus

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        (w, w1, w11), (v, w2, w22) = self._axis(l1), self._axis(l2)
        return w + v, w1, w2, w11, 0 * (l1 * l2), w22

    def _axis(self, stretch: Any) -> tuple[Any, Any, Any]:
        """w and its derivatives by the stretch."""
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

    Examples
    --------
    >>> PrestretchedOgden((20e3,), (20e3,), (2.0,), reference=1.0).derivatives(2.0, 1.0)[1]
    37500.0
    """

    law: ClassVar[str] = "prestretched_ogden"

    @property
    def shear_modulus(self) -> float:
        """½ Σ α β [Pa]."""
        modulus: float = sum(a * b for b, _, a in self._terms()) / 2
        return modulus

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

