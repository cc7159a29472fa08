"""Independent reference for discs and annuli under gas pressure, own weight and a force on the
plate.

Words, kinematics and energy are those of :mod:`axisymmetric`; nothing of the project is imported.
Besides the force ``F`` on the plate there are a gas pressure ``p`` on the film, normal to it
wherever it goes, and a weight ``g`` per virgin area along the load. With the virgin radius ``rho =
R / lp``, the stretches ``l1`` along and ``l2 = r / rho`` around, and the slope ``t`` against the
plane (``z' < 0 < t``), equilibrium along and across the meridian is ::

    (rho T Psi_1)'   =  T Psi_2 cos t + g rho sin t
    rho T Psi_1 t'   =  p r l1 + g rho cos t - T Psi_2 sin t

Two methods: shooting on these equations (:func:`shoot`), and a Ritz method (:func:`minimise`) on ::

    Pi = integral of T Psi dA - p V - F w - g integral of z dA,    V = integral of pi r^2 (-dz) - pi
    a^2 w

A pressure on the plate as well is a force ``p pi a^2`` on it. All quantities are in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar, root_scalar

from tests.oracles.axisymmetric import Film, energy_derivatives
from tympan.base.arrays import Array

_CENTRE = 1e-5  # where shooting starts in a disc, relative to its radius; the error is its square


@dataclass(frozen=True)
class Disc(Film):
    """A film without a plate: ``inner`` is 0."""

    def __post_init__(self) -> None:
        if self.inner != 0.0 or min(self.outer, self.thickness, self.prestretch) <= 0.0:
            raise ValueError("a disc has no inner radius; its other lengths are positive")


@dataclass(frozen=True)
class Loads:
    """Gas pressure on the film [Pa], force on the plate [N], voltage [V], weight per virgin area
    [Pa]."""

    pressure: float = 0.0
    force: float = 0.0
    voltage: float = 0.0
    weight: float = 0.0


@dataclass(frozen=True, eq=False)
class Bubble:
    """An equilibrium: ``apex`` is the height of the centre or the plate [m]; ``meridian`` maps R to
    (l1, l2, z)."""

    apex: float
    meridian: Callable[[Array], tuple[Array, Array, Array]]


def shoot(film: Film, loads: Loads, guess: float | None = None) -> Bubble:
    """By integration from the plate or the centre, with ``l1`` there such that ``r(b) = b``.

    ``guess`` of that ``l1``; it chooses between several equilibria.
    """
    lp, thickness, q = film.prestretch, film.thickness, loads.voltage**2
    start_radius = film.inner or _CENTRE * film.outer
    span = math.log(film.outer / start_radius)

    def rate(x: float, y: Array) -> list[float]:
        l1, l2, slope, _ = y
        rho = start_radius / lp * math.exp(x)
        psi = energy_derivatives(film, l1, l2, q)
        sine, cosine = math.sin(slope), math.cos(slope)
        l2_x = l1 * cosine - l2
        l1_x = (psi.d2 * cosine + loads.weight * rho * sine / thickness - psi.d1 - psi.d12
                * l2_x) / psi.d11
        push = rho * (loads.pressure * l2 * l1 + loads.weight * cosine) / (thickness * psi.d1)
        return [float(l1_x), l2_x, float(push - psi.d2 / psi.d1 * sine),
                -l1 * rho * sine / film.outer]

    def trajectory(first: float) -> Any:
        rho, around = start_radius / lp, lp if film.inner else first
        lifted = loads.force / (2 * math.pi)
        if not film.inner:
            lifted = 0.5 * (loads.pressure * around**2 + loads.weight) * rho**2
        psi = energy_derivatives(film, np.float64(first), np.float64(around), q)
        sine = lifted / (rho * thickness * float(psi.d1))
        result = solve_ivp(rate, (0.0, span), [first, around, math.asin(sine), 0.0],
                           method="DOP853", rtol=1e-12,
                           atol=1e-13, dense_output=True)
        if not result.success:
            raise ArithmeticError(f"shooting failed: {result.message}")
        return result

    first = guess or 1.02 * lp
    root = root_scalar(lambda l1: trajectory(l1).y[1, -1] / lp - 1.0, x0=first, x1=1.001 * first,
                       xtol=1e-13)
    if not root.converged:
        raise ArithmeticError("shooting did not converge")
    path = trajectory(root.root)
    apex = -film.outer * float(path.y[3, -1])

    def meridian(radius: Array) -> tuple[Array, Array, Array]:
        l1, l2, _, height = path.sol(np.log(radius / start_radius))
        return l1, l2, apex + film.outer * height

    return Bubble(apex, meridian)


def minimise(film: Film, loads: Loads, degree: int = 30) -> Bubble:
    """By Newton's method on a spectral Ritz expansion, the loads raised in ten steps."""
    ritz = _Expansion(film, degree)
    unknowns = ritz.start(loads)
    for share in np.linspace(0.1, 1.0, 10):
        part = Loads(share * loads.pressure, share * loads.force, loads.voltage,
                     share * loads.weight)
        unknowns = ritz.solve(unknowns, part)
    return Bubble(ritz.apex(unknowns), lambda radius: ritz.meridian(unknowns, radius))


class _Expansion:
    """``r = R + sum c_k r_k(R)`` and ``z = sum d_k z_k(R)``; the plate's heave is the first ``d``,
    if there is one."""

    def __init__(self, film: Film, degree: int) -> None:
        self.film, self.degree = film, degree
        xi, weight = legendre.leggauss(2 * degree)
        if film.inner:
            self.radius = film.inner * np.exp(0.5 * (1 + xi) * film.log_ratio)
            self.step = 0.5 * film.log_ratio * self.radius * weight
        else:
            self.radius = 0.5 * film.outer * (1 + xi)
            self.step = 0.5 * film.outer * weight
        self.r, self.r_by, self.z, self.z_by = self.basis(self.radius)

    def basis(self, radius: Array) -> tuple[Array, Array, Array, Array]:
        """Values and slopes by R of the functions of r, and of z, in columns."""
        film, identity = self.film, np.eye(self.degree)
        if film.inner:
            s, s_by = 2 * np.log(radius / film.inner) / film.log_ratio - 1, 2 / (film.log_ratio
                                                                                 * radius)
            bubble, bubble_by = 1 - s * s, -2 * s
        else:
            s, s_by = 2 * (radius / film.outer) ** 2 - 1, 4 * radius / film.outer**2
            bubble, bubble_by = 0.5 * (1 - s), -0.5 + 0 * s
        values = legendre.legval(s, identity).T
        slopes = legendre.legval(s, legendre.legder(identity)).T
        z, z_by = bubble[:, None] * values, (bubble_by[:, None] * values + bubble[:, None]
                                             * slopes) * s_by[:, None]
        if not film.inner:  # r is odd in R
            return radius[:, None] * z, z + radius[:, None] * z_by, z, z_by
        r, r_by = film.outer * z, film.outer * z_by
        heave, heave_by = 0.5 * (1 - s)[:, None], -0.5 * s_by[:, None]
        return r, r_by, np.hstack([heave, z]), np.hstack([heave_by, z_by])

    def start(self, loads: Loads) -> Array:
        """The flat film, slightly domed: unstressed it has no stiffness across its plane."""
        stretch = np.array([self.film.prestretch])
        modulus = 0.75 * float(energy_derivatives(self.film, stretch, stretch, 0.0).d11[0])
        push = abs(0.1 * loads.pressure) + abs(0.1 * loads.weight)
        dome = 0.6 * self.film.outer * (push * self.film.outer
                                        / (modulus * self.film.thickness)) ** (1 / 3)
        unknowns = np.zeros(self.r.shape[1] + self.z.shape[1])
        unknowns[self.r.shape[1]] = dome
        return unknowns

    def apex(self, unknowns: Array) -> float:
        """Height of the plate or the centre."""
        if self.film.inner:
            return float(unknowns[self.r.shape[1]])
        return float(self.meridian(unknowns, np.array([0.0]) + 1e-12 * self.film.outer)[2][0])

    def meridian(self, unknowns: Array, radius: Array) -> tuple[Array, Array,
                                                                          Array]:
        """Stretches and height at mounted radii."""
        r, r_by, z, z_by = self.basis(radius)
        c, d = np.split(unknowns, [r.shape[1]])
        lp = self.film.prestretch
        return lp * np.hypot(1 + r_by @ c, z_by @ d), lp * (1 + r @ c / radius), z @ d

    def solve(self, unknowns: Array, loads: Loads) -> Array:
        """Newton's method, halving steps that do not reduce the gradient."""
        for _ in range(60):
            gradient, hessian = self.derivatives(unknowns, loads)
            step = np.linalg.solve(hessian, gradient)
            share = 1.0
            while share > 1e-3:
                trial = unknowns - share * step
                after = self.derivatives(trial, loads)[0]
                if np.linalg.norm(after) < (1 - 0.1 * share) * np.linalg.norm(gradient):
                    break
                share *= 0.5
            unknowns = unknowns - share * step
            if np.max(np.abs(step)) < 1e-11 * self.film.outer:
                return unknowns
        raise ArithmeticError("the Ritz iteration did not converge")

    def derivatives(self, unknowns: Array, loads: Loads) -> tuple[Array, Array]:
        """Gradient and Hessian of Pi."""
        film, radius, step = self.film, self.radius, self.step
        c, d = np.split(unknowns, [self.r.shape[1]])
        ratio = film.prestretch
        r, r_by, z_by = radius + self.r @ c, 1 + self.r_by @ c, self.z_by @ d
        length = np.hypot(r_by, z_by)
        psi = energy_derivatives(film, ratio * length, ratio * r / radius, loads.voltage**2)
        volume = 2 * math.pi * film.thickness / ratio**2 * radius * step
        along_r, along_z = r_by / length, z_by / length
        zero_r, zero_z = np.zeros_like(self.r), np.zeros_like(self.z)
        l1_slopes = ratio * np.hstack([along_r[:, None] * self.r_by, along_z[:, None] * self.z_by])
        l2_slopes = ratio * np.hstack([self.r / radius[:, None], zero_z])
        across = np.hstack([-along_z[:, None] * self.r_by, along_r[:, None] * self.z_by])
        gradient = l1_slopes.T @ (volume * psi.d1) + l2_slopes.T @ (volume * psi.d2)
        cross = l1_slopes.T @ ((volume * psi.d12)[:, None] * l2_slopes)
        hessian = (l1_slopes.T @ ((volume * psi.d11)[:, None] * l1_slopes) + l2_slopes.T
                   @ ((volume * psi.d22)[:, None] * l2_slopes)
                   + cross + cross.T + across.T
                   @ ((volume * psi.d1 * ratio / length)[:, None] * across))
        wide, fall = np.hstack([self.r, zero_z]), -np.hstack([zero_r, self.z_by])
        tall = np.hstack([zero_r, self.z])
        push = math.pi * loads.pressure * step
        gradient -= wide.T @ (2 * push * r * -z_by) + fall.T @ (push * r**2)
        mixed = wide.T @ ((2 * push * r)[:, None] * fall)
        hessian -= mixed + mixed.T + wide.T @ ((2 * push * -z_by)[:, None] * wide)
        gradient -= tall.T @ (2 * math.pi * loads.weight / ratio**2 * radius * step)
        if film.inner:
            gradient[self.r.shape[1]] += math.pi * film.inner**2 * loads.pressure - loads.force
        return gradient, hessian


def hencky(poisson: float, tension: float = 0.0, terms: int = 400) -> tuple[float, float]:
    """Hencky's series for a clamped linear membrane under uniform pressure: ``b0`` and the apex
    coefficient.

    ``n(s) = sum b_k s^2k`` solves ``n'' + 3 n'/s + 8 / n^2 = 0`` for the radial resultant
    ``N = (E h p^2 a^2 / 64)^(1/3) n(r/a)``; the edge does not move. The apex is at ``w0 = a (p a /
    (E h))^(1/3)`` times the second number returned. ``tension``: resultant before the pressure, in
    the unit of ``n``. (Hencky, Z. Math. Phys. 63, 311, 1915, as corrected by Fichter, NASA TP-3658,
    1997.)
    """
    numbers = np.arange(terms)

    def series(first: float) -> Array:
        b, inverse = np.zeros(terms), np.zeros(terms)  # of n and of 1 / n
        square = np.zeros(terms)  # of 1 / n^2
        b[0], inverse[0] = first, 1 / first
        for k in range(terms):
            if k:
                inverse[k] = -(b[1 : k + 1] @ inverse[k - 1 :: -1][:k]) / first
            square[k] = inverse[: k + 1] @ inverse[k::-1][: k + 1]
            if k + 1 < terms:
                b[k + 1] = -8 * square[k] / (4 * (k + 1) * (k + 2))
        return b

    def edge(first: float) -> float:
        return float((2 * numbers + 1 - poisson) @ series(first)) - (1 - poisson) * tension

    low, high = max(1.5, tension), max(3.0, tension + 3.0)
    first = float(root_scalar(edge, bracket=(low, high), xtol=1e-14).root)
    s, weight = legendre.leggauss(60)
    s, weight = 0.5 * (1 + s), 0.5 * weight
    n = (series(first)[None, :] * s[:, None] ** (2 * numbers)).sum(axis=1)
    return first, 2 * float(weight @ (s / n))


def voltage_at(film: Disc, electrode: float, stretch: float) -> float:
    """Voltage [V] at which a flat disc has a stretch, from the virgin film, under its electrode.

    The electrode lies within the mounted radius ``electrode`` [m]; under it the deformation is
    homogeneous. Outside ``r = l2 rho``, ``dr/drho = l1`` and ``d(rho W_1)/drho = W_2``, with one
    nominal stress on both sides of the electrode's edge. From the stretch, and so beyond a limit,
    the voltage is the result. Of a permittivity that does not depend on the stretch.
    """
    outside = pull_of(film, electrode, stretch)
    inside = float(_first(film, stretch, stretch))
    # W_1 - eps (U/T)^2 l^3 inside is what pulls from outside.
    permittivity = film.eps0 * film.relative_permittivity * stretch**3
    squared = (inside - outside) * film.thickness**2 / permittivity
    return math.sqrt(squared) if squared > 0 else -math.sqrt(-squared)


def pull_in(film: Disc, electrode: float, most: float) -> tuple[float, float]:
    """Largest voltage [V] that has an equilibrium, and its stretch, below a stretch ``most``."""
    peak = minimize_scalar(lambda stretch: -voltage_at(film, electrode, stretch), method="bounded",
                           bounds=(1.0001 * film.prestretch, most), options={"xatol": 1e-9})
    return -float(peak.fun), float(peak.x)


def _first(film: Film, l1: float, l2: float) -> float:
    return float(energy_derivatives(film, np.array([l1]), np.array([l2]), 0.0).d1[0])


def pull_of(film: Disc, electrode: float, stretch: float) -> float:
    """W_1 at the electrode's edge, just outside, such that the film meets the frame."""
    lp = film.prestretch
    span = (electrode / lp, film.outer / lp)

    def rate(rho: float, y: np.ndarray) -> list[float]:
        r, l1 = y
        l2 = r / rho
        psi = energy_derivatives(film, np.array([l1]), np.array([l2]), 0.0)
        l2_by = (l1 - l2) / rho
        return [l1, float(((psi.d2[0] - psi.d1[0]) / rho - psi.d12[0] * l2_by) / psi.d11[0])]

    def miss(first: float) -> float:
        path = solve_ivp(rate, span, [stretch * span[0], first], method="DOP853", rtol=1e-12,
                         atol=1e-14)
        return float(path.y[0, -1] / film.outer - 1)

    first = brentq(miss, 0.05 * lp, 1.5 * lp, xtol=1e-14)
    return _first(film, first, stretch)


def balloon(film: Disc, stretch: float) -> tuple[float, float]:
    """Gas pressure [Pa] and apex [m] of an inflated disc whose middle has a stretch.

    Lengths go with thickness over pressure: the meridian of one pressure is followed to where the
    frame would be, and scaled.
    """
    lp, rim = film.prestretch, energy_derivatives(film, np.array([stretch]), np.array([stretch]),
                                                  0.0)
    pressure = film.thickness * float(rim.d1[0]) / film.outer

    def rate(x: float, y: np.ndarray) -> list[float]:
        l1, l2, slope, _ = y
        rho = math.exp(x)
        psi = energy_derivatives(film, np.array([l1]), np.array([l2]), 0.0)
        d1, d2, d11, d12 = (float(part[0]) for part in (psi.d1, psi.d2, psi.d11, psi.d12))
        l2_by = l1 * math.cos(slope) - l2
        push = rho * pressure * l2 * l1 / (film.thickness * d1)
        return [(d2 * math.cos(slope) - d1 - d12 * l2_by) / d11, l2_by,
                push - d2 / d1 * math.sin(slope), -l1 * rho * math.sin(slope)]

    def at_frame(x: float, y: np.ndarray) -> float:
        return float(y[1] - lp)

    at_frame.terminal = True  # type: ignore[attr-defined]
    start = math.log(_CENTRE * film.outer)
    path = solve_ivp(rate, (start, start + 30), [stretch, stretch, 0.0, 0.0], method="DOP853",
                     rtol=1e-11, atol=1e-13, events=at_frame)
    (x,), (end,) = path.t_events[0], path.y_events[0]
    scale = film.outer / (lp * math.exp(x))
    return pressure / scale, -scale * float(end[3])


def highest_pressure(film: Disc, low: float, high: float) -> tuple[float, float]:
    """The largest pressure [Pa] between two stretches of the middle, and its apex [m]."""
    peak = minimize_scalar(lambda stretch: -balloon(film, stretch)[0], method="bounded",
                           bounds=(low, high), options={"xatol": 1e-7})
    return balloon(film, float(peak.x))
