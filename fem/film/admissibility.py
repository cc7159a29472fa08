"""Range of laws: materials that a film can have, and points where a film is stretched too far."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.base.units import place_text
from tympan.geometry.specimen import Film, Material

LawMargin = Callable[[Material, Any, Any], Array]

#: Ranges are written with four digits, and tests reach their ends: stretches beyond an end by less
#: than this factor are within.
_ROUNDED = 1.01

#: Stretches over which a material must be admissible: a film tears before it exceeds them.
STRETCH_RANGE = (0.5, 6.0)

#: Number of directions of lines that :func:`acoustic_margin` checks: with as many the least
#: stiffness is missed by (π/120)²/2, some 3e-4 of its variation.
_LINES = 60


def reachable_stretches(material: Material, lowest: float = STRETCH_RANGE[0],
                        highest: float = STRETCH_RANGE[1],
                        include: float = 1.0) -> tuple[Array, Array]:
    """Make a grid of principal stretches λ₁ ≥ λ₂ where W is finite, with ``include``.

    No stretch is above ``highest``, and none in the plane is below ``lowest``.
    """
    grid = np.append(np.geomspace(lowest, highest, 61), np.unique([1.0, include]))
    l1, l2 = (axis.ravel() for axis in np.meshgrid(grid, grid))
    inside = (l1 >= l2) & (l1 * l2 >= 1 / highest)
    l1, l2 = l1[inside], l2[inside]
    with np.errstate(all="ignore"):
        reached = ~np.isposinf(np.real(material.derivatives(l1, l2)[0]))
    return l1[reached], l2[reached]


def hill_margin(material: Material, l1: Any, l2: Any) -> Array:
    """Compute the smallest stiffness of true stress against the logarithms of the stretches [Pa].

    Where it is positive, Hill's inequality for incompressible solids holds: W is convex in the
    logarithms of the stretches (Ogden, *Non-Linear Elastic Deformations*, §6.2.7), so that true
    stress grows with stretch in every direction.
    """
    return _hill(*_derivatives(material, l1, l2))


def _hill(l1: Array, l2: Array, derivatives: tuple[Array, ...]) -> Array:
    _, w1, w2, w11, w12, w22 = derivatives
    with np.errstate(all="ignore"):
        h11 = l1**2 * w11 + l1 * w1
        h22 = l2**2 * w22 + l2 * w2
        h12 = l1 * l2 * w12
        mean, radius = (h11 + h22) / 2, np.hypot((h11 - h22) / 2, h12)
        larger = mean + radius
        # The product over the larger eigenvalue keeps its digits where they are far apart.
        by_product = (h11 * h22 - h12**2) / larger
        return np.where(larger > 0, by_product, mean - radius)


def equibiaxial_stiffness(material: Material, l1: Any, l2: Any) -> Array:
    """Differentiate the mean true stress [Pa] by the logarithm of an equibiaxial stretch."""
    l1, l2, (_, w1, w2, w11, w12, w22) = _derivatives(material, l1, l2)
    own = l1**2 * w11 + l1 * w1 + l2**2 * w22 + l2 * w2
    return np.asarray(own / 2 + l1 * l2 * w12)


def ellipticity_margin(material: Material, l1: Any, l2: Any) -> Array:
    """Compute the smallest of five stiffnesses [Pa], positive where the film is strongly elliptic.

    The film is regarded in its plane. Where it is not strongly elliptic, deformations of the plane
    can jump across lines. The five conditions, necessary and sufficient for an isotropic energy of
    two stretches, are those of Knowles and Sternberg (J. Elasticity 8, 329, 1978); at equal
    stretches divided differences become derivatives. Out of its plane a film is elliptic where it
    is in tension, which :func:`tympan.studies.case.field_warnings` reports separately.
    """
    return strong_ellipticity(*_derivatives(material, l1, l2))


def strong_ellipticity(l1: Array, l2: Array, derivatives: tuple[Array, ...]) -> Array:
    """Compute the margin of :func:`ellipticity_margin` from W and its derivatives by the stretches.

    W may be any isotropic energy of two stretches, also with the voltage's part: at a given voltage
    that depends on λ₁λ₂ alone.
    """
    _, w1, w2, w11, w12, w22 = derivatives
    with np.errstate(all="ignore"):
        gap = l1 - l2
        near = np.abs(gap) < 1e-6 * (l1 + l2)
        safe = np.where(near, 1.0, gap)
        shear = np.where(near, w1 + l1 * (w11 - w12), (l1 * w1 - l2 * w2) / safe)
        slope = np.where(near, w11 - w12, (w1 - w2) / safe)
        root = np.sqrt(np.maximum(w11 * w22, 0))
        conditions = [w11, w22, shear, root + w12 + slope, root - w12 + (w1 + w2) / (l1 + l2)]
        return np.asarray(np.min(conditions, axis=0))


def acoustic_margin(c: tuple[Array, Array, Array], stress: Array, tangent: Array) -> Array:
    """Compute the smallest stiffness [Pa] against jumps across any line of the plane, shape (n,).

    It is the smallest eigenvalue of the acoustic tensor over all directions of the line. It serves
    energies without common axes, which two stretches cannot describe. C, S (n, 3) and D (n, 3, 3)
    are those of :mod:`tympan.fem.film.density`.
    """
    c11, c22, c12 = c
    s11, s22, s12 = stress[..., 0], stress[..., 1], stress[..., 2]
    det, zero = c11 * c22 - c12**2, np.zeros_like(c11)
    # A jump u of the material's own components strains it by the symmetric part of (C u) ⊗ N. That
    # is linear in the line's normal N = (a, b): a row for each of its components and each of u's.
    strain = np.array([[[c11, zero, c12], [c12, zero, c22]],
                       [[zero, c12, c11], [zero, c22, c12]]])
    stress_of = np.einsum("...ij,mvj...->mvi...", tangent, strain)
    of_a, of_b, of_both = (sum(np.einsum("uip,vip->uvp", strain[n].reshape(2, 3, -1),
                                         stress_of[m].reshape(2, 3, -1)) for n, m in pairs)
                           for pairs in (((0, 0),), ((1, 1),), ((0, 1), (1, 0))))
    result = np.full(np.shape(c11), np.inf)
    for angle in np.pi * np.arange(_LINES) / _LINES:
        a, b = np.cos(angle), np.sin(angle)
        q = (a * a * of_a + a * b * of_both + b * b * of_b).reshape(2, 2, *det.shape)
        mean = (q[0, 0] * c22 + q[1, 1] * c11 - 2 * q[0, 1] * c12) / (2 * det)
        product = (q[0, 0] * q[1, 1] - q[0, 1] ** 2) / det
        least = mean - np.sqrt(np.maximum(mean**2 - product, 0.0))
        result = np.minimum(result, least + s11 * a * a + s22 * b * b + 2 * s12 * a * b)
    return result


def inadmissible_stretch(material: Material, lowest: float = STRETCH_RANGE[0],
                         highest: float = STRETCH_RANGE[1], *,
                         margin: LawMargin = hill_margin, nearest: float = 1.0
                         ) -> tuple[float, float] | None:
    """Find the first stretches (λ₁, λ₂) in a range, within the law's reach, where it softens.

    First means nearest, in the logarithms, to the equibiaxial stretch ``nearest``. ``margin`` is
    :func:`hill_margin` or :func:`ellipticity_margin`.
    """
    l1, l2 = reachable_stretches(material, lowest, highest, nearest)
    bad = ~(margin(material, l1, l2) > 0)
    if not bad.any():
        return None
    distance = np.log(l1 / nearest) ** 2 + np.log(l2 / nearest) ** 2
    first = np.argmin(np.where(bad, distance, np.inf))
    return float(l1[first]), float(l2[first])


def checked(material: Material, lowest: float = STRETCH_RANGE[0],
            highest: float = STRETCH_RANGE[1]) -> Material:
    """Refuse a material whose true stress falls with stretch within a range; else return it."""
    stretch = inadmissible_stretch(material, lowest, highest)
    if stretch is not None:
        reach = reachable_stretches(material, lowest, highest)[0].max()
        limit = f" (of which it reaches {reach:.2g} at most)" if reach < highest else ""
        raise InputError(
            "is outside its admissible range: true stress must grow with stretch (Hill's "
            f"inequality) for stretches from {lowest} to {highest}{limit}, but it falls at "
            f"({stretch[0]:.3g}, {stretch[1]:.3g})", given=str(material))
    return material


#: Criteria in the words of a warning, each with its margin [Pa], positive where it holds.
CRITERIA = {
    "Hill's inequality (true stress must grow with stretch)": _hill,
    "strong ellipticity within the film": strong_ellipticity,
}


def failures(film: Film, position: Array, l1: Array, l2: Array) -> list[str]:
    """Describe where a film's law fails at the stretches of a state: where worst, and how widely.

    Stretches outside the range the law is meant for are described, too.

    ``position`` of the points in the mounted film [m], shape (n, 2 or 3); ``l1``, ``l2`` principal
    stretches from the virgin film there, shape (n,).
    """
    result, derivatives = [], _derivatives(film.material, l1, l2)
    for criterion, margin in CRITERIA.items():
        margins = margin(*derivatives)
        fails = ~(margins > 0)
        if fails.any():
            worst = np.argmin(np.where(fails, np.nan_to_num(margins, nan=-np.inf), np.inf))
            place = place_text(*position[worst, :2].tolist())
            result.append(
                f"the film's law fails {criterion} at {100 * fails.mean():.2g} % of the film's "
                f"points, worst at {place}, where the stretches are "
                f"{l1[worst]:.3f} and {l2[worst]:.3f}")
    return result + beyond_range(film, position, l1, l2)


def lawful(film: Film, l1: Any, l2: Any, derivatives: tuple[Any, ...]) -> Mask:
    """Mask the stretches at which a film's law fulfils all criteria and is within its range.

    ``film`` may have arrays in place of numbers; ``derivatives`` are those of its law there.
    """
    holds = np.all([margin(l1, l2, derivatives) > 0 for margin in CRITERIA.values()], axis=0)
    if film.law_range is not None:
        low, high = film.law_range
        visited = [l1, l2, *([1 / (l1 * l2)] if low <= _ROUNDED * high**-0.5 else [])]
        for stretch in visited:
            holds &= (stretch * _ROUNDED >= low) & (stretch <= high * _ROUNDED)
    return np.asarray(holds)


def beyond_range(film: Film, position: Array, l1: Array, l2: Array) -> list[str]:
    """Describe the stretches outside the range of the film's law, in a sentence.

    A law without a range has the in-plane stretches at which any film tears. Thickness counts as
    well as the plane, unless no test could cover such a range of all three: a strip stretched to
    the upper end is already thinner than the lower one.
    """
    if not np.size(l1):
        return []
    low, high = film.law_range or (0.0, STRETCH_RANGE[1])
    visited = {"a stretch in its plane": np.concatenate([l1, l2])}
    if film.law_range is not None and low <= _ROUNDED * high**-0.5:
        visited["a thickness stretch"] = 1 / (l1 * l2)
    parts = []
    for name, stretch in visited.items():
        for end, outside in ((int(np.argmin(stretch)), stretch.min() * _ROUNDED < low),
                             (int(np.argmax(stretch)), stretch.max() > high * _ROUNDED)):
            if outside:
                place = place_text(*position[end % len(l1), :2].tolist())
                parts.append(f"{name} of {stretch[end]:.3g} at {place}")
    if not parts:
        return []
    visits = f"the film visits {' and '.join(parts)}"
    if film.law_range is None:
        return [f"{visits}, beyond {high:.3g}, to which laws are tested: a real film tears before"]
    return [f"the film's law is used outside its range {low:.3g} to {high:.3g}: {visits}; what it "
            "says there was not tested"]


def _derivatives(material: Material, l1: Any, l2: Any) -> tuple[Array, Array, tuple[Array, ...]]:
    l1, l2 = np.broadcast_arrays(np.asarray(l1, float), np.asarray(l2, float))
    with np.errstate(all="ignore"):
        return l1, l2, tuple(np.broadcast_to(value, l1.shape)
                             for value in material.derivatives(l1, l2))
