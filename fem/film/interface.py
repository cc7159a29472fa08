"""Stability of the line between two parts of a film: waves along the line that grow.

Where two different materials meet along a line, short waves of that line may lower the energy while
each material by itself is still stable. An example is an electrode's edge, where the voltage
presses on one side alone. Such waves have no length scale and die out within a wavelength on both
sides, so that only the strains beside the line matter. Each side resists a wave by its surface
impedance, a Hermitian matrix Z; the line is stable while Z₁ + Z̄₂ is positive definite (Agmon's
condition at an interface: Mielke and Sprenger, J. Elasticity 51, 23, 1998). The impedance is here
the integral of Barnett and Lothe over the directions of the plane (Ting, *Anisotropic Elasticity*,
1996, ch. 7), which does not depend on the line's direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tympan.base.arrays import AnyArray

#: Directions over half a turn at which the integrand is evaluated. The error falls exponentially
#: with their number: with 32 it is 1e-12 for an isotropic film, and 1e-6 for one that is 20 times
#: as stiff in one direction as across.
_DIRECTIONS = 48

#: Place of the components (J, L) of a symmetric tensor in its Voigt triple.
_VOIGT = np.array([[0, 2], [2, 1]])


class Side(NamedTuple):
    """A film beside a line: C and S as triples (n,) and (n, 3), D (n, 3, 3).

    They are those of :mod:`tympan.fem.film.density`; each may be complex.
    """

    c: tuple[Any, Any, Any]
    stress: AnyArray
    tangent: AnyArray


def interface_margin(sides: Sequence[Side], along: AnyArray) -> AnyArray:
    """Compute the least stiffness of the line between two films against short waves, (n,) [Pa].

    It is the smaller eigenvalue of the sum of both impedances, positive where the line is stable;
    NaN where a side is not strongly elliptic. ``along`` is the line's unit direction in the mounted
    film (n, 2). The result has derivatives by complex steps.
    """
    (first, turn), (other, back) = (impedance(moduli(side, along)) for side in sides)
    real, imaginary = first + other, turn - back
    r11, r22, r12 = real[..., 0, 0], real[..., 1, 1], real[..., 0, 1]
    mean, half = (r11 + r22) / 2, (r11 - r22) / 2
    least: AnyArray = mean - np.sqrt(half**2 + r12**2 + imaginary**2)
    return least


def impedance(stiffness: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Compute the surface impedance of a half plane: its real part, and the imaginary one's entry.

    The real part has shape (n, 2, 2). The imaginary part is antisymmetric; its entry (1, 2) has
    shape (n,). ``stiffness`` is ∂²ψ/∂F∂F (n, 2, 2, 2, 2) [Pa], its first and third index those of
    places.
    """
    angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    m = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    n = np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    across = _inverse(_along(stiffness, n, n))
    # The mixed moduli are transposed, since the moduli are symmetric in their pairs.
    mixed = _along(stiffness, n, m)
    real = _inverse(across.mean(axis=-1))
    turned = np.einsum("...ija,...jka->...ik", across, mixed) / _DIRECTIONS
    product = np.einsum("...j,...j->...", real[..., 0, :], turned[..., :, 1])
    return real, -product


def _along(stiffness: AnyArray, first: AnyArray, second: AnyArray) -> AnyArray:
    """Contract moduli with pairs of directions (directions, 2), shape (n, 2, 2, directions)."""
    pairs = np.einsum("aJ,aL->JLa", first, second)
    return np.tensordot(np.swapaxes(stiffness, -3, -2), pairs, axes=2)


def _inverse(matrices: AnyArray) -> AnyArray:
    """Invert matrices (n, 2, 2, …)."""
    a, b = matrices[:, 0, 0], matrices[:, 0, 1]
    c, d = matrices[:, 1, 0], matrices[:, 1, 1]
    determinant = a * d - b * c
    adjugate = np.stack([np.stack([d, -b], axis=1), np.stack([-c, a], axis=1)], axis=1)
    inverse: AnyArray = adjugate / determinant[:, None, None]
    return inverse


def moduli(side: Side, along: AnyArray) -> AnyArray:
    """Compute ∂²ψ/∂F∂F (n, 2, 2, 2, 2) of a film, turned so that a line keeps one direction.

    Both sides of the line then have this direction in common.
    """
    c11, c22, c12 = side.c
    a, b = along[..., 0], along[..., 1]
    # F maps the line's direction to a multiple of the first axis: it is the Cholesky factor of C.
    stretch = np.sqrt(a * a * c11 + b * b * c22 + 2 * a * b * c12)
    slide = (a * b * (c22 - c11) + (a * a - b * b) * c12) / stretch
    rise = np.sqrt(c11 * c22 - c12 * c12) / stretch
    first = np.stack([stretch * a - slide * b, stretch * b + slide * a], axis=-1)
    second = np.stack([-rise * b, rise * a], axis=-1)
    f = np.stack([first, second], axis=-2)
    bend = side.tangent[..., _VOIGT[:, :, None, None], _VOIGT]
    stress = side.stress[..., _VOIGT]
    elastic = np.einsum("...iM,...kN,...MJNL->...iJkL", f, f, bend)
    result: AnyArray = elastic + np.einsum("ik,...JL->...iJkL", np.eye(2), stress)
    return result
