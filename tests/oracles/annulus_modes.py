"""Independent closed forms for vibrations of a flat annular film under an equal tension, with or
without a rigid disc.

Nothing of the project is imported here. A film of tension ``N`` [N/m] and mass ``s`` per area
[kg/m²] between the radii ``a`` and ``b`` obeys ``N lap(w) = -s w^2 w``, so ``w(r, t) = f(r) cos(m
t)`` with ``f = A J_m(k r) + B Y_m(k r)``, ``omega = k c``, ``c^2 = N / s``, and ``f(b) = 0``. At
the inner edge:

* plate held: ``f(a) = 0``;
* rigid disc of mass ``M`` that heaves (m = 0): ``-M omega^2 f(a) = 2 pi a N f'(a)``;
* rigid disc of inertia ``I`` about a diameter that tilts (m = 1, tilt ``f(a)/a``):
  ``I omega^2 f(a)/a = pi a^2 N (f(a)/a - f'(a))``. The first term on the right is the tension's: it
  pulls horizontally on an edge that stands ``f(a) cos t`` above the frame;
* rigid disc pushed off by a spring ``-K`` stiffer than the film: it leaves as ``exp(g t)``, and
with ``kappa = g / c``
  the modified Bessel functions take over: ``M g^2 f(a) = K f(a) + 2 pi a N f'(a)``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.integrate import simpson
from scipy.optimize import brentq
from scipy.special import iv, ivp, j0, jv, jvp, kv, kvp, yv, yvp

#: Wave numbers of a transform, times the outer radius: beyond there are 1e-10 of its square.
_WAVES = 400.0


def held(order: int, count: int, inner: float, outer: float) -> np.ndarray:
    """The first ``count`` wave numbers k [1/m] of angular order m with the inner edge held."""
    return _roots(lambda k: _cross(order, k, inner, outer)[0], count, inner, outer)


def heaving(count: int, inner: float, outer: float, mass_ratio: float) -> np.ndarray:
    """Wave numbers [1/m], m = 0, with a rigid disc of ``mass_ratio = M / s`` [m²]."""
    def equation(k: float) -> float:
        value, slope = _cross(0, k, inner, outer)
        return mass_ratio * k**2 * value + 2 * np.pi * inner * slope

    return _roots(equation, count, inner, outer)


def tilting(count: int, inner: float, outer: float, inertia_ratio: float) -> np.ndarray:
    """Wave numbers [1/m], m = 1, with a rigid disc of ``inertia_ratio = I / s`` [m⁴]."""
    def equation(k: float) -> float:
        value, slope = _cross(1, k, inner, outer)
        return inertia_ratio * k**2 * value / inner - np.pi * inner**2 * (value / inner - slope)

    return _roots(equation, count, inner, outer)


def growing(inner: float, outer: float, mass_ratio: float, push_ratio: float) -> float:
    """kappa = g / c [1/m] of the disc that leaves, with ``mass_ratio = M / s`` [m²] and
    ``push_ratio = K / N``."""
    def equation(kappa: float) -> float:
        i, k = iv(0, kappa * outer), kv(0, kappa * outer)
        value = iv(0, kappa * inner) * k - kv(0, kappa * inner) * i
        slope = kappa * (ivp(0, kappa * inner) * k - kvp(0, kappa * inner) * i)
        return (mass_ratio * kappa**2 - push_ratio) * value - 2 * np.pi * inner * slope

    return float(brentq(equation, 1e-6 / outer, np.sqrt(push_ratio / mass_ratio), rtol=1e-14))


def swinging_mass(inner: float, outer: float, plate: float, coat: float) -> float:
    """Mass [kg] on a weightless film with the lowest frequency of a plate [kg] on one of a mass per
    area [kg/m²]."""
    if not coat:
        return plate
    k = float(heaving(1, inner, outer, plate / coat)[0])
    # ω² = k² N/s and the stiffness 2πN/ln(b/a): the tension N does not matter.
    return float(2 * np.pi * coat / np.log(outer / inner) / k**2)


def lifted_area(inner: float, outer: float) -> float:
    """Of the flat film's weight per area the share the plate carries [m²]: ∫ ln(b/R)/ln(b/a) dA."""
    ratio = np.log(outer / inner)
    return float(np.pi * ((outer**2 - inner**2) / 2 - inner**2 * ratio) / ratio)


def sag(inner: float, outer: float, radius: np.ndarray) -> np.ndarray:
    """What a flat film held at both edges gives way at radii under a pressure, over that and times
    its tension [m²]: of N lap(w) = -p."""
    ratio = np.log(outer / radius) / np.log(outer / inner)
    return np.asarray((outer**2 - radius**2 - (outer**2 - inner**2) * ratio) / 4)


@cache
def air_volume(inner: float, outer: float) -> float:
    """Added mass of still air on both sides in a baffle, over its density [m³].

    Of the profile 1 on the plate and ln(b/R)/ln(b/a) beyond, ∬ v v'/(2π |x - x'|) dA dA' a side,
    by Hankel's transform V = (J₀(ka) − J₀(kb))/(k² ln(b/a)): 2π ∫ V(k)² dk.
    """
    k, ratio = np.linspace(0.0, _WAVES / outer, 400_001), np.log(outer / inner)
    transform = np.full(len(k), (outer**2 - inner**2) / (4 * ratio))  # the limit at k = 0
    transform[1:] = (j0(k[1:] * inner) - j0(k[1:] * outer)) / (k[1:]**2 * ratio)
    return float(4 * np.pi * simpson(transform**2, x=k))


@cache
def air_inertia(inner: float, outer: float) -> float:
    """Added moment of inertia about a diameter of the same, over the air's density [m⁵].

    Of the profile R cos t on the plate and, beyond, the harmonic one that is 0 at the frame,
    a (b²/R − R)/(b²/a − a) cos t: π ∫ V(k)² dk a side with Hankel's transform of order 1.
    """
    k = np.linspace(0.0, 60.0 * np.pi / outer, 1501)[1:]
    nodes, weights = np.polynomial.legendre.leggauss(120)
    transform = np.zeros(len(k))
    for low, high in ((0.0, inner), (inner, outer)):
        radius = low + (high - low) * (1 + nodes) / 2
        beyond = inner * (outer**2 / radius - radius) / (outer**2 / inner - inner)
        profile = radius if low == 0 else beyond
        transform += (jv(1, np.outer(k, radius)) * (profile * radius)) @ weights * (high - low) / 2
    return float(2 * np.pi * simpson(transform**2, x=k))


def _cross(order: int, k: float, inner: float, outer: float) -> tuple[float, float]:
    """f(a) and f'(a) of the solution that vanishes at b."""
    j, y = jv(order, k * outer), yv(order, k * outer)
    value = jv(order, k * inner) * y - yv(order, k * inner) * j
    return value, k * (jvp(order, k * inner) * y - yvp(order, k * inner) * j)


def _roots(equation: Callable[[float], float], count: int, inner: float,
           outer: float) -> np.ndarray:
    """Lowest positive roots; neighbours are about pi/(b - a) apart, so this net is fine enough for
    all of them."""
    step = np.pi / (outer - inner) / 200
    k = step * np.arange(1, 200 * (count + 2) + 1)
    values = np.array([equation(item) for item in k])
    change = np.flatnonzero(values[:-1] * values[1:] < 0)[:count]
    if len(change) < count:
        raise ArithmeticError(f"only {len(change)} of {count} roots found")
    return np.array([brentq(equation, k[i], k[i + 1], xtol=1e-14 * k[i], rtol=1e-15)
                     for i in change])
