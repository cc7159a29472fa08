"""Tension field: a film without bending stiffness wrinkles instead of carrying compression."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from operator import add
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray, Mask, Numbers

_HALVINGS = 60
#: Relative length of a step of Newton's after which the next one is negligible.
_SMALL = 1e-9
#: Least stiffness along the tension lines of a wrinkled film, in residual tensions. It is a little
#: below zero, so that the loads at which the stiffness vanishes are bracketed.
_SOFT = 100.0
#: Factors of the stretches of a film slack both ways at which tension is sought. Where none of them
#: gives tension the film has none.
_OUTWARDS = np.array([1.03, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0])


class Tension(IntEnum):
    """Number of directions in which the film carries no tension, as numbered in VTU files."""

    TAUT = 0  #: in both
    WRINKLED = 1  #: along the wrinkles only
    SLACK = 2  #: in none


def tension_state(stress_1: AnyArray, stress_2: AnyArray, tense: AnyArray) -> Numbers:
    """Classify points by :class:`Tension`, by principal true stresses [Pa], shape (n,).

    ``tense`` is the number of directions in which a wrinkling film carries tension by itself. The
    stress is positive in the other directions too, but no more than the residual tension of
    :class:`TensionField`.
    """
    pressed = (np.asarray(stress_1) <= 0).astype(np.int64) + (np.asarray(stress_2) <= 0)
    return np.asarray(np.maximum(pressed, 2 - np.asarray(tense)))


@dataclass(frozen=True)
class Coat:
    """A material on a share of every point: 1 where it is present, 0 where it is not.

    Its own virgin state is the film's at the stretch ``scale`` along both axes.
    """

    material: Any
    weight: Any = field(compare=False)
    scale: float = 1.0

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        s, share = self.scale, self.weight
        w, w1, w2, w11, w12, w22 = self.material.derivatives(l1 / s, l2 / s)
        return (share * w, share * (w1 / s), share * (w2 / s),
                share * (w11 / s**2), share * (w12 / s**2), share * (w22 / s**2))


@dataclass(frozen=True)
class TensionField:
    """The quasiconvex envelope of materials that act together, with a residual tension.

    A film cannot bear compression: where the stress along its smaller stretch λ₂ would fall below
    zero it wrinkles, takes its natural width λ₂*(λ₁), W₂(λ₁, λ₂*) = 0, and stores W(λ₁, λ₂*)
    (Pipkin, IMA J. Appl. Math. 36, 1986; Steigmann, Proc. R. Soc. A 429, 1990; with voltage W
    includes the electrostatic energy, at constant potential). That leaves no stiffness across the
    tension lines. So the film keeps a residual second Piola–Kirchhoff tension ``residual`` there
    [Pa]: the envelope is taken of W − ½κ(λ₁² + λ₂²) and ½κ(λ₁² + λ₂²) added again. A film with
    tensions above κ is not changed. Under voltage a wrinkled film may have no natural width: it
    would thin until it breaks down, and its values there are nan.

    The stretches must be ordered, λ₁ ≥ λ₂; otherwise the material is symmetric in them.
    """

    materials: tuple[Any, ...]
    residual: Any

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        plain = total(self.materials, l1, l2)
        loose = self._loose(plain, l2)
        if not loose.any():
            return plain
        kind = np.result_type(*plain, l1, l2, self.residual, float)
        values = [np.array(np.broadcast_to(value, loose.shape), dtype=kind) for value in plain]
        wrinkled = self._wrinkled(l1, l2, loose)
        loose[loose] = wrinkled.sound
        for value, relaxed in zip(values, wrinkled.relaxed(self.residual), strict=True):
            value[loose] = relaxed[wrinkled.sound]
        return tuple(value[()] for value in values)

    def stretches(self, l1: Any, l2: Any) -> tuple[Any, Any, Numbers]:
        """Compute the stretches of the material itself, wrinkles included, λ₁* ≥ λ₁ and λ₂* ≥ λ₂.

        The third result is the number of directions in which the film is tense by its own tension.
        The residual one does not count: across its wrinkles the film would be compressed without
        them.
        """
        plain = total(self.materials, l1, l2)
        loose = self._loose(plain, l2)
        tense = np.where(plain[2] > 0, 2, 1)
        if not loose.any():
            return l1, l2, tense
        first, second = (np.array(np.broadcast_to(value, loose.shape)) for value in (l1, l2))
        wrinkled = self._wrinkled(l1, l2, loose)
        loose[loose] = wrinkled.sound
        first[loose], second[loose] = (stretch[wrinkled.sound] for stretch in wrinkled.natural)
        slack = (first != l1) & (tense == 1)
        return first[()], second[()], np.where(slack, 0, tense)

    def thinning_margin(self, l1: Any, l2: Any) -> Any:
        """Compute the margin of a wrinkling film to unlimited thinning [Pa]; negative beyond.

        Where the film is wrinkled it is the stiffness W*″ along the tension lines; where a wrinkled
        film would have no stiffness, the tension; elsewhere ∞.
        """
        plain = total(self.materials, l1, l2)
        _, _, w2, w11, w12, w22 = plain
        with np.errstate(all="ignore"):
            across = w22 - self.residual
            soft = ~(w11 - w12 * w12 / across > 0) | ~(w22 > self.residual)
        margin = np.where(soft, w2 / l2, np.inf)
        loose = self._loose(plain, l2)
        if loose.any():
            wrinkled = self._wrinkled(l1, l2, loose)
            margin[loose] = np.where(wrinkled.sound, wrinkled.stiffness, (w2 / l2)[loose])
        # A law without a stress means that the film is strained too far, not that it is thin.
        return np.where(np.isnan(margin), np.inf, margin)

    def _loose(self, plain: tuple[Any, ...], l2: Any) -> Mask:
        # A law may have no value at such a compression.
        least = np.real(self.residual) * np.real(l2)
        return np.asarray(~(np.real(plain[2]) >= least) & np.isfinite(least))

    def _at(self, l1: Any, l2: Any, points: Mask
            ) -> tuple[tuple[Any, ...], AnyArray, AnyArray]:
        """Select materials and stretches at points; a material's arrays are fields over all."""
        def chosen(value: Any) -> AnyArray:
            return np.broadcast_to(value, points.shape)[points]

        return _at_points(self.materials, points), chosen(l1), chosen(l2)

    def _taken(self, materials: tuple[Any, ...], a: AnyArray, b: AnyArray) -> tuple[AnyArray,
               AnyArray]:
        """Compute natural stretches of loose points, nan where the film has none."""
        k = self.residual

        def across(s: Any) -> tuple[Any, Any]:
            values = total(materials, a, s)
            return values[2] - k * s, values[5] - k

        slack = ~(np.real(across(a)[0]) > 0)
        width = _root(across, b, a, ~slack)
        if not slack.any():
            return a, width
        apart = self._apart(_at_points(materials, slack), a[slack])
        first, second = (np.array(value, np.result_type(value, apart)) for value in (a, width))
        first[slack] = second[slack] = apart
        return first, second

    def _apart(self, materials: tuple[Any, ...], a: AnyArray) -> AnyArray:
        """Find the natural stretch of points that are slack both ways, nan where there is none."""
        k = self.residual

        def both(s: Any) -> tuple[Any, Any]:
            values = total(materials, s, s)
            return values[1] - k * s, values[3] + values[4] - k

        # Under voltage the tension falls again at larger stretches.
        outer = _OUTWARDS[:, None] * a
        tense = np.real(both(outer)[0]) > 0
        nearest = np.argmax(tense, axis=0)
        return _root(both, a, outer[nearest, np.arange(len(a))], tense.any(axis=0))

    def _wrinkled(self, l1: Any, l2: Any, loose: Mask) -> _Wrinkled:
        materials, a, b = self._at(l1, l2, loose)
        natural = self._taken(materials, a, b)
        with np.errstate(all="ignore"):
            w, w1, _, w11, w12, w22 = total(materials, *natural)
            slack = np.real(natural[0]) > np.real(a)
            k = self.residual
            wrinkled = w11 - w12 * w12 / (w22 - k)
            along = np.where(slack, w11 - k - np.abs(w12), wrinkled)
            least = np.real(k)
            sound = (np.real(along) > -_SOFT * least) & (np.real(w22) > least)
        return _Wrinkled((a, b), natural, sound, slack, w, w1, along)


@dataclass(frozen=True, eq=False)
class _Wrinkled:
    """Loose points of a film: their stretches, natural stretches, and energy and tension at these.

    ``stiffness`` is that along the tension lines, for a slack film the smaller one; ``sound`` marks
    points where it is not much below zero, so that the film has a state.
    """

    seen: tuple[AnyArray, AnyArray]
    natural: tuple[AnyArray, AnyArray]
    sound: Mask
    slack: Mask
    energy: AnyArray
    tension: AnyArray
    stiffness: AnyArray

    def relaxed(self, k: Any) -> tuple[AnyArray, ...]:
        """Compute W and its derivatives with a residual tension k [Pa]."""
        (a, b), (first, second) = self.seen, self.natural
        squares = a * a + b * b - first * first - second * second
        energy = self.energy + k / 2 * squares
        w1 = np.where(self.slack, k * a, self.tension)
        w11 = np.where(self.slack, k, self.stiffness)
        return energy, w1, k * b, w11, 0 * a, k + 0 * a


def _at_points(materials: tuple[Any, ...], points: Mask) -> tuple[Any, ...]:
    """Select materials at some points; their arrays are fields over all."""
    fields = [{name: np.broadcast_to(value, points.shape)[points] for name, value
               in vars(material).items() if isinstance(value, np.ndarray)}
              for material in materials]
    return tuple(replace(material, **here) if here else material
                 for material, here in zip(materials, fields, strict=True))


def total(materials: tuple[Any, ...], l1: Any, l2: Any) -> tuple[Any, ...]:
    """Sum the materials' W and derivatives."""
    first, *others = (material.derivatives(l1, l2) for material in materials)
    for other in others:
        first = tuple(map(add, first, other))
    return tuple(first)


def _root(function: Any, low: AnyArray, high: AnyArray, exists: Mask) -> AnyArray:
    """Find the root of a function that is negative at ``low`` and positive at ``high``.

    Nan where no root ``exists``. The method is Newton's within bisection. The last step is taken in
    the arguments' own arithmetic, so that an imaginary step of any argument passes through.
    """
    if not exists.any():
        return np.full(len(low), np.nan)
    with np.errstate(all="ignore"):
        lower, upper = np.real(low).copy(), np.real(high).copy()
        point = lower
        for _ in range(_HALVINGS):
            value, slope = (np.real(part) for part in function(point))
            above = value >= 0  # False where there is no value
            lower, upper = np.where(above, lower, point), np.where(above, point, upper)
            step = -value / slope
            settled = np.abs(step) <= _SMALL * point
            inside = (point + step > lower) & (point + step < upper)
            point = np.where(inside | settled, point + step, (lower + upper) / 2)
            if (settled | ~exists).all():
                break
        value, slope = function(point)
        point = point - value / slope
    return np.where(exists, point, np.nan)
