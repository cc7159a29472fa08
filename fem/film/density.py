"""Energy density of the film as a function of its in-plane deformation, with two derivatives.

All values are per virgin volume, for arrays of quadrature points, as functions of the Voigt triple
c = (C₁₁, C₂₂, C₁₂) of C = FᵀF: the second Piola–Kirchhoff stress S = 2∂ψ/∂C as (S₁₁, S₂₂, S₁₂) and
its tangent D = ∂S/∂E in Voigt form with engineering shear, E = (C − I)/2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from tympan.base.constants import EPSILON_0
from tympan.fem.film.admissibility import acoustic_margin, strong_ellipticity
from tympan.fem.film.laws import Ogden
from tympan.fem.film.memory import Flow
from tympan.fem.film.tension_field import Coat, TensionField, total
from tympan.geometry.specimen import Film, Specimen

#: Relative distance of the squared stretches below which the divided difference of the stress is
#: replaced by its limit. Both are then wrong by less than 1e-10, and only in the tangent: the
#: stress multiplies it by that distance.
_EQUAL = 1e-5

#: Second Piola–Kirchhoff tension that a film keeps across its wrinkles, over the material's
#: stiffness, that of the virgin or of the mounted film. The rest of the film is not affected.
_RESIDUAL = 1e-3


@dataclass(frozen=True)
class Maxwell:
    """Electrostatic energy −½ c (λ₁λ₂)^p of the share ``covered``, used like a material.

    With c = ε₀ ε_r J_pⁿ (U/T)² and p = 2 − n this is the ideal dielectric (n = 0) or one with a
    permittivity that falls as (J/J_p)^(−n).
    """

    coefficient: Any
    power: float
    covered: Any = field(default=1.0, compare=False)

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        p = self.power
        w = -0.5 * (self.coefficient * self.covered) * (l1 * l2) ** p
        first, bend = p * w, p * (p - 1) * w
        return w, first / l1, first / l2, bend / l1**2, p * first / (l1 * l2), bend / l2**2


@dataclass(frozen=True)
class Density:
    """Energy density of a material at a deformation; the tangent is None if not requested."""

    energy: Any
    stress: Any
    tangent: Any


#: A material and its stretches from the virgin state to the mounted film.
EnergyPart = tuple[Any, tuple[Any, Any]]


@dataclass(frozen=True)
class FilmDensity:
    """The film's energy at a voltage: elastic, and electrostatic and electrode where covered.

    ``covered`` is the share of the film under the electrode, broadcastable against the quadrature
    points. So are ``thickness``, the virgin film's over the stated one, and ``share``, the voltage
    of the electrode there over the film's. With ``wrinkles`` the film wrinkles rather than carry
    compression (:class:`~tympan.fem.film.tension_field.TensionField`); without them it carries any
    compression.
    """

    specimen: Specimen
    voltage_squared: Any
    covered: Any
    wrinkles: bool = True
    flow: Flow | None = None
    thickness: Any = 1.0
    share: Any = 1.0

    @property
    def maxwell(self) -> Maxwell:
        """The electrostatic part."""
        charged = self.covered * (self.share * self.share)
        return maxwell(self.specimen, self.voltage_squared, charged / self.thickness**2)

    @property
    def parts(self) -> list[EnergyPart]:
        """Parts that add up to the film; those that share principal axes wrinkle together.

        Parts that contribute the same are equal, wherever they are.
        """
        joined, apart = self._joined_and_apart
        materials = (self.material,) if self.wrinkles else joined
        return [*((material, self.specimen.membrane.prestretch) for material in materials), *apart]

    @cached_property
    def material(self) -> TensionField:
        """All parts that share the film's principal axes, as one material."""
        film, (joined, _) = self.specimen.membrane, self._joined_and_apart
        if not self.wrinkles:
            return TensionField(joined, -np.inf)
        return TensionField(joined, _RESIDUAL * _stiffness(film))

    @cached_property
    def _joined_and_apart(self) -> tuple[tuple[Any, ...], list[EnergyPart]]:
        film, grease = self.specimen.membrane, self.specimen.electrode.stiffness
        joined = film.material, self.maxwell
        if not grease:
            return joined, []
        law, (first, second) = Ogden((grease,), (2.0,)), film.prestretch
        if np.all(first == second):
            return (*joined, Coat(law, self.covered, first)), []
        # A coat that is stress-free at an unequally stretched state has axes of its own.
        return joined, [(Coat(law, self.covered), (1.0, 1.0))]

    def __call__(self, c: tuple[Any, Any, Any], *, tangent: bool = True) -> Density:
        """Compute density, stress and tangent at C of the mounted film."""
        _, apart = self._joined_and_apart
        result = plane_stress(self.material, c, self.specimen.membrane.prestretch, tangent=tangent)
        for material, prestretch in apart:
            part = plane_stress(material, c, prestretch, tangent=tangent)
            result = Density(result.energy + part.energy, result.stress + part.stress,
                             result.tangent + part.tangent if tangent else None)
        return result if self.flow is None else self._flowing(result, self.flow, c, tangent)

    @property
    def coaxial(self) -> bool:
        """Whether all parts of the film share its principal axes."""
        return not self._joined_and_apart[1]

    def of_virgin(self, c: tuple[Any, Any, Any], *, tangent: bool = True) -> Density:
        """Compute density, stress and tangent, all of the virgin film, at its C."""
        if self.coaxial:
            return plane_stress(self.material, c, (1.0, 1.0), tangent=tangent)
        first, second = self.specimen.membrane.prestretch
        scale = first * first, second * second, first * second
        found = self(tuple(part / by for part, by in zip(c, scale, strict=True)), tangent=tangent)
        over = np.stack(np.broadcast_arrays(*scale), -1)
        bend = found.tangent / (over[..., :, None] * over[..., None, :]) if tangent else None
        return Density(found.energy, found.stress / over, bend)

    def _flowing(self, rest: Density, flow: Flow, c: tuple[Any, Any, Any], tangent: bool
                 ) -> Density:
        """Add the branches to a density; the energy includes the potential of the step."""
        first, second = self.specimen.membrane.prestretch
        scale = np.array([first * first, second * second, first * second])
        energy, stress, bend = flow.density(from_virgin(c, (first, second)), tangent=tangent)
        stress = rest.stress + np.moveaxis(stress, 0, -1) * scale
        if bend is None:
            return Density(rest.energy + energy, stress, None)
        return Density(rest.energy + energy, stress, rest.tangent
                       + np.moveaxis(bend, (0, 1), (-2, -1)) * np.outer(scale, scale))

    def stretches(self, c: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        """Compute principal stretches, wrinkles included, and the number of tense directions."""
        seen = principal_stretches(c, self.specimen.membrane.prestretch)
        if not self.wrinkles:
            return *seen, np.array(2)
        return self.material.stretches(*seen)

    def firmness(self, c: tuple[Any, Any, Any]) -> Any:
        """Compute the least stiffness of the taut film within its plane, at a given voltage [Pa].

        It is the margin to the loss of strong ellipticity of the energy with the voltage's part. A
        uniform film whose edge a frame holds is stable while the margin is positive (van Hove,
        Proc. Kon. Ned. Akad. Wet. 50, 18, 1947), and no film is stable where it is negative (the
        condition of Legendre and Hadamard). The loss of convexity alone, the criterion under dead
        loads (Zhao and Suo, Appl. Phys. Lett. 91, 061921, 2007), needs an edge that is free to
        move. The margin is ∞ where the film is compressed, since wrinkles by themselves are no
        instability, or where its law has no stress.
        """
        joined, apart = self._joined_and_apart
        with np.errstate(all="ignore"):
            seen = principal_stretches(c, self.specimen.membrane.prestretch)
            plain = total(joined, *seen)
            if apart:
                whole = replace(self, wrinkles=False, flow=None)(c)
                margin = acoustic_margin(c, whole.stress, whole.tangent)
            else:
                margin = strong_ellipticity(*seen, plain)
        return np.where((plain[2] > 0) & ~np.isnan(margin), margin, np.inf)


@lru_cache(maxsize=64)
def _stiffness(film: Film) -> Any:
    """Find the least stiffness of the virgin film and of the mounted one along its axes [Pa].

    A law that refers to the mounted film may have no meaning for the virgin one.
    """
    virgin = small_strain_modulus(film.material)
    *_, along, _, across = film.material.derivatives(*map(np.asarray, film.prestretch))
    return min((value for value in (virgin, along, across) if value.real > 0),
               key=lambda value: value.real, default=virgin)


def small_strain_modulus(material: Any) -> Any:
    """Compute the shear modulus of a law at small strains [Pa]."""
    return material.derivatives(np.ones(()), np.ones(()))[3] / 4


def from_virgin(c: tuple[Any, Any, Any], prestretch: tuple[float, float]) -> tuple[Any, Any, Any]:
    """Convert C of the mounted film to C of the virgin one."""
    first, second = prestretch
    return c[0] * first**2, c[1] * second**2, c[2] * (first * second)


def maxwell(specimen: Specimen, voltage_squared: Any, covered: Any = 1.0) -> Maxwell:
    """Make the electrostatic energy of the film at U² (scalar or per point) [V²]."""
    film = specimen.membrane
    n = film.permittivity_exponent
    unit = EPSILON_0 * film.relative_permittivity * film.area_prestretch**n / film.thickness**2
    return Maxwell(unit * voltage_squared, 2 - n, covered)


def principal_stretches(c: tuple[Any, Any, Any], prestretch: tuple[float, float]
                        ) -> tuple[Any, Any]:
    """Compute the total principal stretches λ₁ ≥ λ₂ from C of the mounted film."""
    mean, _, _, radius = _circle(from_virgin(c, prestretch))
    return np.sqrt(mean + radius), np.sqrt(mean - radius)


def plane_stress(material: Any, c: tuple[Any, Any, Any], prestretch: tuple[float, float], *,
                 tangent: bool = True) -> Density:
    """Compute an isotropic energy W(λ₁, λ₂) and its derivatives by C of the mounted film.

    The principal stretches belong to Λ C Λ, Λ = diag(prestretch). In terms of the Mohr circle of
    ΛCΛ, with mean m, half difference d, shear s and radius b = √(d² + s²), W depends on (m, b) and
    is even in b; so W_b/b stays finite at equal stretches and no eigenvectors are needed.
    """
    first, second = prestretch
    virgin = bool(np.all(np.equal(first, 1.0)) and np.all(np.equal(second, 1.0)))
    mean, half, shear, radius = _circle(c if virgin else from_virgin(c, prestretch))
    l1, l2 = np.sqrt(mean + radius), np.sqrt(mean - radius)
    w, w1, w2, w11, w12, w22 = material.derivatives(l1, l2)
    # Derivatives by the squares of the stretches: dx = 2 l dl.
    by1, by2 = 0.5 / l1, 0.5 / l2
    g1, g2 = w1 * by1, w2 * by2
    equal = np.abs(radius) < _EQUAL * np.abs(mean)
    alike = equal.any()
    if tangent or alike:
        g11 = by1 * by1 * (w11 - 2 * g1)
        g22 = by2 * by2 * (w22 - 2 * g2)
        both = 2 * (by1 * by2 * w12)
        sum_ = g11 + both + g22
        bend = g11 - both + g22
    total = g1 + g2
    over = (g1 - g2) / (np.where(equal, 1.0, radius) if alike else radius)
    if alike:
        over = np.where(equal, bend, over)
    split = over * half
    stress = np.empty((3, *np.shape(w)), dtype=np.result_type(w, 0.0))
    stress[0] = total + split
    stress[1] = total - split
    stress[2] = over * shear
    if not virgin:  # stretches may be numbers, or arrays that differ between films
        scale = np.array(np.broadcast_arrays(first * first, second * second, first * second))
        stress = stress * _outermost(scale, stress)
    if not tangent:
        return Density(w, _components_last(stress, 1), None)
    safe = np.where(radius == 0, 1.0, radius) if alike else radius
    n1, n2 = half / safe, shear / safe
    mb, bb = g11 - g22, bend - over
    md, ms = 2 * mb * n1, mb * n2
    b1 = bb * n1
    dd, ds = over + b1 * n1, b1 * n2
    together = sum_ + dd
    d = np.empty((3, 3, *np.shape(w)), dtype=stress.dtype)
    d[0, 0] = together + md
    d[1, 1] = together - md
    d[2, 2] = over + bb * n2 * n2
    d[0, 1] = d[1, 0] = sum_ - dd
    d[0, 2] = d[2, 0] = ms + ds
    d[1, 2] = d[2, 1] = ms - ds
    if not virgin:
        d = d * _outermost(scale[:, None] * scale[None], d)
    return Density(w, _components_last(stress, 1), _components_last(d, 2))


def _outermost(values: Any, others: Any) -> Any:
    """Extend values along the first axes of others, so that they broadcast."""
    return values.reshape(*values.shape, *(1,) * (others.ndim - values.ndim))


def _components_last(values: Any, axes: int) -> Any:
    """View an array with its first axes moved to the end."""
    return values.transpose(*range(axes, values.ndim), *range(axes))


def virtual_work(c: tuple[Any, Any, Any], changes: tuple[Any, Any, Any],
                 prestretch: tuple[Any, Any], weights: Any) -> Callable[[Any], Any]:
    """Make a function of a material: weighted sums of W₁δλ₁ + W₂δλ₂ over the points, (k,).

    C of the mounted film and ``weights`` have shape s, the changes (k, *s). Where the stretches are
    equal, their difference has no derivative; it is not needed if the stresses are equal too.
    """
    centre, half, shear, radius = _circle(from_virgin(c, prestretch))
    mean, by_half, by_shear, _ = _circle(from_virgin(changes, prestretch))
    l1, l2 = np.sqrt(centre + radius), np.sqrt(centre - radius)
    by_radius = (half * by_half + shear * by_shear) / np.where(radius == 0, 1.0, radius)
    first = (weights * (mean + by_radius) / (2 * l1)).reshape(len(mean), -1)
    second = (weights * (mean - by_radius) / (2 * l2)).reshape(len(mean), -1)

    def of_material(material: Any) -> Any:
        _, w1, w2, *_ = material.derivatives(l1, l2)
        return first @ np.ravel(w1) + second @ np.ravel(w2)

    return of_material


def _circle(c: tuple[Any, Any, Any]) -> tuple[Any, Any, Any, Any]:
    """Compute mean, half difference, shear and radius of the Mohr circle of C."""
    c11, c22, shear = c
    mean, half = (c11 + c22) / 2, (c11 - c22) / 2
    return mean, half, shear, np.sqrt(half * half + shear * shear)
