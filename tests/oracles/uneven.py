"""A round film that is a little thicker on one side, or loaded beside its centre: first order.

Base state: the axisymmetric membrane of :mod:`tests.oracles.axisymmetric`, with r(R), z(R) and
stretches l1, l2. The virgin thickness is T (1 + g (R/b) cos t), t the angle from x. A small
displacement is added to each point::

    g (u(R) cos t e_r + v(R) sin t e_t + w(R) cos t e_z)

The plate is rigid. Its rim, of radius a, may shift along x by g X and turn by a small angle, so
that its heights are g Y x: ``u(a) = X``, ``v(a) = -X``, ``w(a) = a Y``. At the frame all are 0.

The energy per mounted area is ``(T / lp^2) (h W - M (l1 l2)^2 / h)`` with h the relative thickness,
``M = eps0 epsr U^2 / (2 T^2)``. It is expanded to second order in the displacement, and the part
that is linear in both g and displacement is the load. With the derivatives of the displacement by
arc lengths of the mounted film, ``a`` along the meridian and ``b`` around, in the base's own axes
(1 along the meridian, 2 around, 3 normal), the second-order part of an isotropic energy is half
of::

    Psi_11 a1^2 + 2 Psi_12 a1 b2 + Psi_22 b2^2 + Psi_1/l1 a3^2 + Psi_2/l2 b3^2
    + (Psi_1 - Psi_2)/(l1 - l2) (a2 + b1)^2 / 2 + (Psi_1 + Psi_2)/(l1 + l2) (a2 - b1)^2 / 2

A rigid plate that turns by Y also draws its rim in, by Y^2 x/2: second order, against the film's
pull, so it counts. A plate whose rim only moves up and down is not rigid, and turns about twice as
far. The fields are integrated Legendre polynomials in ln R, as those of the base.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from tests.oracles.axisymmetric import (
    EnergyDerivatives,
    Film,
    Solution,
    energy_derivatives,
    solve_load,
)
from tympan.base.arrays import Array


class Moved(NamedTuple):
    """Displacements [m] along x, y and the load."""

    x: Array
    y: Array
    z: Array


@dataclass(frozen=True, eq=False)
class Uneven:
    """An equilibrium to first order.

    ``shift``: displacement of the plate's centre along x [m]; ``slope``: change of its height per x
    [rad], both in whole. ``fields``: u, v, w in whole [m] at mounted radii [m].
    """

    base: Solution
    shift: float
    slope: float
    fields: Callable[[Array], tuple[Array, Array, Array]]

    def added(self, x: Array, y: Array) -> Moved:
        """Displacements of points at x, y of the mounted film, less those of the base [m]."""
        radius = np.hypot(x, y)
        cos, sin = x / radius, y / radius
        u, v, w = self.fields(radius)
        return Moved(u * cos**2 - v * sin**2, (u + v) * sin * cos, w * cos)

    def moved(self, x: Array, y: Array) -> Moved:
        """Displacements of points at x, y of the mounted film [m]."""
        radius = np.hypot(x, y)
        added, outwards = self.added(x, y), self.base.r(radius) - radius
        return Moved(added.x + outwards * x / radius, added.y + outwards * y / radius,
                     added.z + self.base.z(radius))


def solve_uneven(film: Film, force: float, voltage: float, share: float = 0.0, arm: float = 0.0,
                 degree: int = 24) -> Uneven:
    """A film by a ``share`` thicker where x reaches the frame, a force [N] at an ``arm`` [m].

    The arm is along x from the plate's centre, on the plate.
    """
    base = solve_load(film, force, voltage)
    basis = _Basis(film, degree)
    points, weights = legendre.leggauss(2 * degree)
    radius = basis.radius(points)
    per_area = np.pi * film.thickness / film.prestretch**2
    area = per_area * radius**2 * basis.half * weights
    u, v, w = basis.fields(points)
    stretches = base.lambda1(radius), base.lambda2(radius)
    first, second = stretches
    psi = energy_derivatives(film, *stretches, voltage**2)
    down, level = _directions(film, radius, psi, force)
    along, around = _parts(film.prestretch, radius, (down, level), (u, v, w))
    stiffness = _stiffness(area, stretches, psi, along, around)
    rim = energy_derivatives(film, base.lambda1([film.inner]), base.lambda2([film.inner]),
                             voltage**2)
    _, level_at_rim = _directions(film, np.array([film.inner]), rim, force)
    pull = film.thickness / film.prestretch * float((rim.d1 * level_at_rim)[0])
    stiffness[-1, -1] += np.pi * film.inner**2 * pull
    # By thickness: the energy's mechanical part grows with it, its electrical one falls.
    grown = energy_derivatives(film, first, second, -(voltage**2))
    thicker = area * share * radius / film.outer
    load = -(along[0].T @ (thicker * grown.d1) + around[1].T @ (thicker * grown.d2))
    load[-1] += force * arm
    unknowns = np.linalg.solve(stiffness, load)

    def fields(places: Array) -> tuple[Array, Array, Array]:
        at_u, at_v, at_w = (values for values, _ in basis.fields(basis.point(places)))
        return at_u @ unknowns, at_v @ unknowns, at_w @ unknowns

    return Uneven(base, float(unknowns[-2]), float(unknowns[-1]), fields)


#: Values and derivatives by R of a field, by the unknowns, shape (points, unknowns) each.
_Field = tuple[Array, Array]


@dataclass(frozen=True)
class _Basis:
    """Fields u, v, w as polynomials in ln R; the last two unknowns are the plate's."""

    film: Film
    degree: int

    @property
    def half(self) -> float:
        return self.film.log_ratio / 2

    def radius(self, point: Array) -> Array:
        return self.film.inner * np.exp((1 + point) * self.half)

    def point(self, radius: Array) -> Array:
        return np.log(radius / self.film.inner) / self.half - 1

    def fields(self, point: Array) -> tuple[_Field, _Field, _Field]:
        polynomials = legendre.legvander(point, self.degree)
        order = np.arange(1, self.degree)
        values = (polynomials[:, 2:] - polynomials[:, :-2]) / (2 * order + 1)
        by_radius = 1 / (self.half * self.radius(point))
        slopes = polynomials[:, 1:-1] * by_radius[:, None]
        edge, edge_slope = (1 - point) / 2, -by_radius / 2
        count = len(order)

        def field(number: int, plate: tuple[float, float]) -> _Field:
            value, slope = np.zeros((2, len(point), 3 * count + 2))
            mine = slice(number * count, (number + 1) * count)
            value[:, mine], slope[:, mine] = values, slopes
            value[:, -2:], slope[:, -2:] = (np.outer(part, plate) for part in (edge, edge_slope))
            return value, slope

        return field(0, (1.0, 0.0)), field(1, (-1.0, 0.0)), field(2, (0.0, self.film.inner))


def _directions(film: Film, radius: Array, psi: EnergyDerivatives, force: float
                ) -> tuple[Array, Array]:
    """Sine and cosine of the meridian's angle, by the balance of forces along the load."""
    sine = -force / (2 * np.pi * radius * film.thickness / film.prestretch * psi.d1)
    return sine, np.sqrt(1 - sine**2)


def _parts(prestretch: float, radius: Array, directions: tuple[Array, Array],
           fields: tuple[_Field, _Field, _Field]
           ) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Derivatives of the displacement along the meridian and around it, in the base's axes."""
    (u, u_slope), (v, v_slope), (w, w_slope) = fields
    sine, cosine, at = (values[:, None] for values in (*directions, radius))
    along = (u_slope * cosine + w_slope * sine, v_slope, w_slope * cosine - u_slope * sine)
    around = (-((u + v) * cosine + w * sine) / at, (u + v) / at, ((u + v) * sine - w * cosine) / at)
    return (tuple(prestretch * part for part in along), tuple(prestretch * part for part in around))


def _stiffness(area: Array, stretches: tuple[Array, Array], psi: EnergyDerivatives,
               along: tuple[Array, ...], around: tuple[Array, ...]) -> Array:
    (first, second), (a1, a2, a3), (b1, b2, b3) = stretches, along, around

    def product(by: Array, one: Array, other: Array) -> Array:
        return np.asarray(one.T @ ((area * by)[:, None] * other))

    apart = first - second
    equal = np.abs(apart) < 1e-7
    shear = np.where(equal, psi.d11 - psi.d12, (psi.d1 - psi.d2) / np.where(equal, 1.0, apart))
    turn = (psi.d1 + psi.d2) / (first + second)
    mixed = product(psi.d12, a1, b2)
    return np.asarray(
        product(psi.d11, a1, a1) + product(psi.d22, b2, b2) + mixed + mixed.T
        + product(psi.d1 / first, a3, a3) + product(psi.d2 / second, b3, b3)
        + product(shear / 2, a2 + b1, a2 + b1) + product(turn / 2, a2 - b1, a2 - b1))
