"""Independent axisymmetric reference for a prestretched hyperelastic annular membrane.

A virgin film of thickness ``T`` is stretched equibiaxially by ``lp``, clamped in a frame at the
mounted radius ``b`` and bonded to a rigid concentric plate of mounted radius ``a``.  The plate
carries an axial force ``F``; compliant electrodes cover the whole annulus and carry the voltage
``U``.  Nothing of the project is imported here: this module is the oracle that the project is
compared with.

Kinematics (``R`` in ``[a, b]`` is the mounted radius, a prime is ``d/dR``), membrane theory::

    l1 = lp sqrt(r'^2 + z'^2)        meridional stretch, from the virgin film
    l2 = lp r / R                    circumferential stretch, from the virgin film
    l3 = 1 / (l1 l2)                 thickness stretch, incompressibility

Energy per virgin volume, and potential (the mounted film is ``T / lp^2`` virgin volume per area)::

    Psi = W(l1, l2) - 1/2 eps0 epsr (l1 l2 / lp^2)^(-n) (U / T)^2 (l1 l2)^2
    Pi  = integral from a to b of  (T / lp^2) Psi 2 pi R dR

Its Euler-Lagrange equations, with ``s = sqrt(r'^2 + z'^2)`` and ``Psi_i = dPsi / dl_i``::

    (R Psi_1 r' / s)' = Psi_2                                          radial equilibrium
    2 pi R (T / lp^2) lp Psi_1 z' / s = -F = const                     axial equilibrium

Boundary conditions: ``r(a) = a, z(a) = w, r(b) = b, z(b) = 0``.

Two unrelated methods are provided, both with ``x = ln(R / a)`` as the independent variable:

* a spectral Ritz method, which minimises ``Pi`` over polynomials (:func:`solve_deflection` and all
that is
  built on it: :func:`solve_load`, :func:`pull_in`);
* shooting on the Euler-Lagrange equations (:func:`shoot_deflection`), which never uses ``Pi``.

A plain membrane is meant: a compressive hoop resultant stays.  With ``Film.relaxed`` it is relaxed
by tension-field theory (Pipkin 1986, IMA J. Appl. Math. 36, 85): the film may wrinkle, so that its
hoop stretch is any ``l2* >= l2`` and ``Psi(l1, l2)`` becomes its minimum over these, ``Psi(l1,
max(l2, n(l1)))`` with the natural width ``Psi_2(l1, n) = 0``.  The meridional stress must be
tensile, as it is wherever a force is carried. All quantities are in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import brentq

from tympan.base.arrays import Array

EnergyLaw = Callable[[Array, Array], Array]

_DEGREES = (24, 40, 64, 96)  # polynomial degrees tried in turn until the expansion is resolved
_RESOLVED = 1e-12  # size of the last coefficients, relative to the outer radius
_CONTINUATION_STEP = 0.04  # largest step of the plate deflection, relative to b - a


class NoEquilibrium(ArithmeticError):
    """There is no equilibrium on the primary branch, or none within the searched range.

    ``limit_force`` [N] is the largest force carried by the searched part of the primary branch and
    ``limit_deflection`` [m] the deflection at which that happens.  ``past_limit`` tells a genuine
    limit point (pull-in) from the mere end of the searched range.
    """

    def __init__(self, message: str, limit_force: float, limit_deflection: float,
                 past_limit: bool) -> None:
        super().__init__(message)
        self.limit_force = limit_force
        self.limit_deflection = limit_deflection
        self.past_limit = past_limit


class Material(Protocol):
    """Energy per virgin volume ``W(l1, l2)`` [J/m^3 = Pa] with ``l3 = 1 / (l1 l2)`` already
    eliminated.

    ``w1 = dW/dl1``, ``w12 = d2W/(dl1 dl2)`` and so on [Pa]; arguments and results are arrays of one
    shape.
    """

    def energy(self, l1: Array, l2: Array) -> Array: ...

    def w1(self, l1: Array, l2: Array) -> Array: ...

    def w2(self, l1: Array, l2: Array) -> Array: ...

    def w11(self, l1: Array, l2: Array) -> Array: ...

    def w12(self, l1: Array, l2: Array) -> Array: ...

    def w22(self, l1: Array, l2: Array) -> Array: ...


@dataclass(frozen=True)
class Ogden:
    """Incompressible Ogden law ``W = sum_p mu_p / alpha_p (l1^a + l2^a + l3^a - 3)``, ``a =
    alpha_p``.

    ``mu`` [Pa], ``alpha`` [-].  Convention ``mu_p / alpha_p``: the initial shear modulus is
    ``1/2 sum mu_p alpha_p``.  (Ogden 1972, Proc. R. Soc. A 326, 565.)  ``Ogden((mu,), (2.0,))`` is
    the neo-Hooke law ``W = mu / 2 (l1^2 + l2^2 + l3^2 - 3)``.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.mu or len(self.mu) != len(self.alpha):
            raise ValueError("mu and alpha must be non-empty and of equal length")
        if 0.0 in self.alpha:
            raise ValueError("alpha must not be zero")

    def energy(self, l1: Array, l2: Array) -> Array:
        """``W`` [Pa]."""
        total = 0.0 * l1
        for mu, a in zip(self.mu, self.alpha, strict=True):
            total = total + mu / a * (l1**a + l2**a + (l1 * l2) ** -a - 3.0)
        return total

    def w1(self, l1: Array, l2: Array) -> Array:
        """``dW/dl1 = sum mu (l1^a - l3^a) / l1`` [Pa]."""
        total = 0.0 * l1
        for mu, a in zip(self.mu, self.alpha, strict=True):
            total = total + mu * (l1**a - (l1 * l2) ** -a)
        return total / l1

    def w2(self, l1: Array, l2: Array) -> Array:
        """``dW/dl2`` [Pa]; the law is symmetric."""
        return self.w1(l2, l1)

    def w11(self, l1: Array, l2: Array) -> Array:
        """``d2W/dl1^2 = sum mu ((a - 1) l1^a + (a + 1) l3^a) / l1^2`` [Pa]."""
        total = 0.0 * l1
        for mu, a in zip(self.mu, self.alpha, strict=True):
            total = total + mu * ((a - 1.0) * l1**a + (a + 1.0) * (l1 * l2) ** -a)
        return total / l1**2

    def w12(self, l1: Array, l2: Array) -> Array:
        """``d2W/(dl1 dl2) = sum mu a l3^a / (l1 l2)`` [Pa]."""
        total = 0.0 * l1
        for mu, a in zip(self.mu, self.alpha, strict=True):
            total = total + mu * a * (l1 * l2) ** -a
        return total / (l1 * l2)

    def w22(self, l1: Array, l2: Array) -> Array:
        """``d2W/dl2^2`` [Pa]; the law is symmetric."""
        return self.w11(l2, l1)


def neo_hooke(mu: float) -> Ogden:
    """Neo-Hooke law ``W = mu / 2 (l1^2 + l2^2 + l3^2 - 3)``; ``mu`` is the shear modulus [Pa]."""
    return Ogden((mu,), (2.0,))


@dataclass(frozen=True)
class EnergyFunction:
    """Any energy ``W(l1, l2)`` [Pa] given with its first derivatives ``first = dW/dl1``, ``second =
    dW/dl2``.

    The second derivatives are five-point central differences (step 1e-3, error about 1e-12
    relative).  The Ritz method needs them only to converge and to judge stability, its force does
    not depend on them.
    """

    function: EnergyLaw
    first: EnergyLaw
    second: EnergyLaw

    def energy(self, l1: Array, l2: Array) -> Array:
        """``W`` [Pa]."""
        return self.function(l1, l2)

    def w1(self, l1: Array, l2: Array) -> Array:
        """``dW/dl1`` [Pa]."""
        return self.first(l1, l2)

    def w2(self, l1: Array, l2: Array) -> Array:
        """``dW/dl2`` [Pa]."""
        return self.second(l1, l2)

    def w11(self, l1: Array, l2: Array) -> Array:
        """``d2W/dl1^2`` [Pa]."""
        return _difference(lambda h: self.first(l1 + h, l2))

    def w12(self, l1: Array, l2: Array) -> Array:
        """``d2W/(dl1 dl2)`` [Pa]."""
        return _difference(lambda h: self.first(l1, l2 + h))

    def w22(self, l1: Array, l2: Array) -> Array:
        """``d2W/dl2^2`` [Pa]."""
        return _difference(lambda h: self.second(l1, l2 + h))


def _difference(function: Callable[[float], Array], step: float = 1e-3) -> Array:
    """Five-point central difference of ``function`` at 0."""
    inner = function(step) - function(-step)
    outer = function(2.0 * step) - function(-2.0 * step)
    return (8.0 * inner - outer) / (12.0 * step)


@dataclass(frozen=True)
class Film:
    """The mounted film.

    ``inner`` (plate edge) and ``outer`` (frame) are mounted radii [m], ``thickness`` is that of the
    virgin film [m], ``prestretch`` the equibiaxial stretch per axis [-].  The permittivity is
    ``relative_permittivity (l1 l2 / prestretch^2)^(-permittivity_exponent)`` times ``eps0`` [F/m].
    ``relaxed`` says whether a compressive hoop stress is relaxed by wrinkling.  ``coverage`` is the
    share of the film under the electrode by mounted radius [m], 1 without; by the Ritz method only.
    """

    inner: float
    outer: float
    thickness: float
    prestretch: float
    material: Material
    relative_permittivity: float = 0.0
    permittivity_exponent: float = 0.0
    eps0: float = 8.8541878128e-12
    relaxed: bool = False
    coverage: Callable[[Array], Array] | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.inner < self.outer:
            raise ValueError("0 < inner < outer is required")
        if not (self.thickness > 0.0 and self.prestretch > 0.0):
            raise ValueError("thickness and prestretch must be positive")

    @property
    def log_ratio(self) -> float:
        """``ln(outer / inner)`` [-]."""
        return math.log(self.outer / self.inner)

    def resultant(self, voltage: float = 0.0) -> float:
        """Total (mechanical + Maxwell) resultant of the flat film [N/m].

        ``N0 = (T / lp^2) lp Psi_1(lp, lp)``: true stress times mounted thickness.
        """
        lp = np.array([self.prestretch])
        psi = energy_derivatives(self, lp, lp, voltage**2)
        return float(self.thickness / self.prestretch * psi.d1[0])

    def small_deflection_force(self, deflection: float, voltage: float = 0.0) -> float:
        """Force for a small deflection, ``F = 2 pi N0 w / ln(b / a)`` [N].

        From axial equilibrium linearised about the flat film, ``2 pi R N0 z' = -F``.
        """
        return 2.0 * math.pi * self.resultant(voltage) * deflection / self.log_ratio


class EnergyDerivatives(NamedTuple):
    """``Psi`` and its derivatives by the stretches; ``q*`` are derivatives by ``q = U^2`` [Pa,
    Pa/V^2]."""

    value: Array
    d1: Array
    d2: Array
    d11: Array
    d12: Array
    d22: Array
    q1: Array
    q2: Array


def energy_derivatives(film: Film, l1: Array, l2: Array,
                       squared_voltage: float) -> EnergyDerivatives:
    """Energy per virgin volume, elastic plus electrical, relaxed if the film is, at ``U^2`` [V^2].
    """
    plain = _plain(film, l1, l2, squared_voltage)
    slack = plain.d2 < 0.0
    if not (film.relaxed and np.any(slack)):
        return plain
    width = natural_width(film, np.atleast_1d(l1)[np.atleast_1d(slack)],
                          np.atleast_1d(l2)[np.atleast_1d(slack)],
                          squared_voltage)
    wide = np.array(l2, dtype=np.float64, ndmin=1)
    wide[np.atleast_1d(slack)] = width
    at = _plain(film, l1, wide.reshape(np.shape(l2)), squared_voltage)
    ratio = at.d12 / at.d22  # minus the slope of the natural width
    zero = 0.0 * at.d2
    wrinkled = EnergyDerivatives(at.value, at.d1, zero, at.d11 - at.d12 * ratio, zero, zero,
                                 at.q1 - at.q2 * ratio, zero)
    return EnergyDerivatives(*(np.where(slack, there, here)
                               for there, here in zip(wrinkled, plain, strict=True)))


def natural_width(film: Film, l1: Array, l2: Array, squared_voltage: float) -> Array:
    """Smallest root ``n > l2`` of ``Psi_2(l1, n) = 0``, from ``Psi_2(l1, l2) < 0``; nan where there
    is none."""
    with np.errstate(all="ignore"):  # points without a root end in nan
        factor = 1.02
        low, high = l2, l2 * factor
        while np.any(below := _plain(film, l1, high, squared_voltage).d2
                     < 0.0) and np.all(high < 30.0 * l2):
            factor = min(factor**1.5, 1.2)
            low, high = np.where(below, high, low), np.where(below, factor * high, high)
        width = np.where(below, np.nan, high)
        for _ in range(20):  # Newton's method within the bracket
            at = _plain(film, l1, width, squared_voltage)
            before, width = width, np.clip(width - at.d2 / at.d22, low, high)
            if not np.any(np.abs(width - before) > 1e-15 * width):
                break
        residual = np.abs(_plain(film, l1, width, squared_voltage).d2)
        return np.where(residual < 1e-9 * np.abs(film.material.w1(l1, width)), width, np.nan)


def _plain(film: Film, l1: Array, l2: Array, squared_voltage: float) -> EnergyDerivatives:
    """Energy per virgin volume without relaxation."""
    m = 2.0 - film.permittivity_exponent
    factor = 0.5 * film.eps0 * film.relative_permittivity / film.thickness**2
    unit = factor * film.prestretch ** (2.0 * film.permittivity_exponent) * (l1 * l2) ** m
    q1, q2 = -m * unit / l1, -m * unit / l2
    law = film.material
    return EnergyDerivatives(
        value=law.energy(l1, l2) - squared_voltage * unit,
        d1=law.w1(l1, l2) + squared_voltage * q1,
        d2=law.w2(l1, l2) + squared_voltage * q2,
        d11=law.w11(l1, l2) - squared_voltage * m * (m - 1.0) * unit / l1**2,
        d12=law.w12(l1, l2) - squared_voltage * m**2 * unit / (l1 * l2),
        d22=law.w22(l1, l2) - squared_voltage * m * (m - 1.0) * unit / l2**2,
        q1=q1,
        q2=q2,
    )


class _Profile(NamedTuple):
    """Stretches and deformed shape at some radii."""

    lambda1: Array
    lambda2: Array
    radius: Array
    height: Array


@dataclass(frozen=True, eq=False)
class Solution:
    """An equilibrium.

    ``force`` [N] on the plate and ``deflection`` [m] of the plate are positive in the same
    direction, ``voltage`` [V].  ``energy`` [J] is the potential ``Pi`` of the module docstring:
    elastic energy counted from the virgin film, minus ``1/2 C U^2``, without the potential ``-F w``
    of the load.  ``stiffness`` is ``dF/dw`` [N/m] at constant voltage.  ``stable`` is true where
    the equilibrium is a minimum under constant force and ``stable_held`` where it is one with the
    plate held, both among axisymmetric shapes only; for a shooting solution these three are not
    evaluated (NaN, False, False).

    The profiles take mounted radii ``R`` [m] in ``[inner, outer]`` and return arrays of the same
    shape.
    """

    film: Film
    force: float
    deflection: float
    voltage: float
    energy: float
    stiffness: float
    stable: bool
    stable_held: bool
    profile: Callable[[Array], _Profile] = field(repr=False)

    def _at(self, radius: ArrayLike) -> _Profile:
        mounted = np.asarray(radius, dtype=np.float64)
        slack = 1e-12 * self.film.outer
        if np.any(mounted < self.film.inner - slack) or np.any(mounted > self.film.outer + slack):
            raise ValueError("radius outside the mounted film")
        flat = np.clip(mounted.ravel(), self.film.inner, self.film.outer)
        return _Profile(*(value.reshape(mounted.shape) for value in self.profile(flat)))

    def lambda1(self, radius: ArrayLike) -> Array:
        """Meridional stretch ``l1 = lp sqrt(r'^2 + z'^2)`` [-]."""
        return self._at(radius).lambda1

    def lambda2(self, radius: ArrayLike) -> Array:
        """Circumferential stretch ``l2 = lp r / R`` [-]."""
        return self._at(radius).lambda2

    def r(self, radius: ArrayLike) -> Array:
        """Deformed radius [m]."""
        return self._at(radius).radius

    def z(self, radius: ArrayLike) -> Array:
        """Deformed height [m], positive along the load."""
        return self._at(radius).height

    def sigma1(self, radius: ArrayLike) -> Array:
        """Meridional true mechanical stress ``l1 dW/dl1`` [Pa], without the Maxwell part."""
        at = self._at(radius)
        return at.lambda1 * self.film.material.w1(at.lambda1, at.lambda2)

    def sigma2(self, radius: ArrayLike) -> Array:
        """Circumferential true mechanical stress ``l2 dW/dl2`` [Pa], without the Maxwell part."""
        at = self._at(radius)
        return at.lambda2 * self.film.material.w2(at.lambda1, at.lambda2)

    def total1(self, radius: ArrayLike) -> Array:
        """Meridional true stress with the Maxwell part, ``l1 dPsi/dl1`` [Pa]."""
        at = self._at(radius)
        psi = energy_derivatives(self.film, at.lambda1, at.lambda2, self.voltage**2)
        return at.lambda1 * psi.d1

    def total2(self, radius: ArrayLike) -> Array:
        """Circumferential true stress with the Maxwell part, ``l2 dPsi/dl2`` [Pa]."""
        at = self._at(radius)
        psi = energy_derivatives(self.film, at.lambda1, at.lambda2, self.voltage**2)
        return at.lambda2 * psi.d2


@dataclass(frozen=True, eq=False)
class _State:
    """Ritz equilibrium: coefficients ``c`` of r and z [m], deflection [m], ``q = U^2`` [V^2].

    ``energy`` [J], ``force`` [N]; ``stiffness = dF/dw`` [N/m] and ``sensitivity = dF/dq`` [N/V^2]
    follow the equilibrium; ``held`` is true if the Hessian is positive definite with the plate
    held.  ``tangent_w`` and ``tangent_q`` are ``dc/dw`` and ``dc/dq``.
    """

    c: Array
    deflection: float
    q: float
    energy: float
    force: float
    stiffness: float
    sensitivity: float
    held: bool
    tangent_w: Array
    tangent_q: Array

    @property
    def stable(self) -> bool:
        return self.held and self.stiffness > 0.0


class RitzExpansion:
    """Spectral Ritz discretisation of ``Pi`` in ``xi in [-1, 1]``, ``R = a exp((1 + xi) ln(b / a) /
    2)``.

    ``r = R + sum c_k B_k`` and ``z = w (1 - xi) / 2 + sum d_k B_k`` with the integrated Legendre
    polynomials ``B_k' = P_k, k >= 1``, which vanish at both ends.  The boundary conditions hold
    exactly, and the force ``F = dPi/dw`` at fixed coefficients has twice the order of the shape
    (envelope theorem).
    """

    def __init__(self, film: Film, degree: int) -> None:
        self.film = film
        self.degree = degree
        self.half_log = 0.5 * film.log_ratio
        lp = np.array([film.prestretch])
        psi = energy_derivatives(film, lp, lp, 0.0)
        coupling = abs(float(psi.q1[0]))
        # q_unit [V^2]: the U^2 at which Maxwell stress and stiffness are comparable
        self.q_unit = film.prestretch * float(psi.d11[0]) / coupling if coupling > 0.0 else 1.0
        xi, weight = legendre.leggauss(2 * degree)
        self.bubble, self.slope = self._basis(xi)
        self.xi = xi
        self.radius = film.inner * np.exp((1.0 + xi) * self.half_log)
        # integral of 2 pi R (T / lp^2) dR, with dR = R dx and dx = half_log dxi
        scale = 2.0 * math.pi * film.thickness / film.prestretch**2
        self.weight = scale * self.radius**2 * self.half_log * weight

    def _basis(self, xi: Array) -> tuple[Array, Array]:
        """``B_k`` and ``dB_k/dx`` at the points ``xi`` (rows)."""
        p: Array = np.asarray(legendre.legvander(xi, self.degree), dtype=np.float64)
        k = np.arange(1, self.degree)
        bubble = (p[:, 2:] - p[:, :-2]) / (2.0 * k + 1.0)
        return bubble, p[:, 1:-1] / self.half_log

    def profile(self, c: Array, deflection: float, radius: Array) -> _Profile:
        """Stretches and shape at the mounted radii ``radius`` (1-d)."""
        xi = np.log(radius / self.film.inner) / self.half_log - 1.0
        bubble, slope = self._basis(np.clip(xi, -1.0, 1.0))
        return self._kinematics(c, deflection, xi, radius, bubble, slope)[0]

    def _kinematics(
        self,
        c: Array,
        deflection: float,
        xi: Array,
        radius: Array,
        bubble: Array,
        slope: Array,
    ) -> tuple[_Profile, Array, Array]:
        """Profile with the slopes ``dr/dx`` and ``dz/dx``."""
        count = self.degree - 1
        r = radius + bubble @ c[:count]
        z = 0.5 * deflection * (1.0 - xi) + bubble @ c[count:]
        r_x = radius + slope @ c[:count]
        z_x = -0.5 * deflection / self.half_log + slope @ c[count:]
        lp = self.film.prestretch
        return _Profile(lp * np.hypot(r_x, z_x) / radius, lp * r / radius, r, z), r_x, z_x

    def derivatives(
        self, c: Array, deflection: float, q: float
    ) -> tuple[float, Array, Array, Array] | None:
        """``Pi``, its gradient and Hessian by ``(c, w)``, and the derivative of the gradient by ``q
        = U^2``.

        None if the shape is not admissible (non-positive stretch or overflow).
        """
        profile, r_x, z_x = self._kinematics(c, deflection, self.xi, self.radius, self.bubble,
                                             self.slope)
        l1, l2 = profile.lambda1, profile.lambda2
        if not (np.all(np.isfinite(l1)) and np.all(np.isfinite(l2)) and l1.min() > 1e-3
                and l2.min() > 1e-3):
            return None
        if max(l1.max(), l2.max()) > 1e3:
            return None
        covered = 1.0 if self.film.coverage is None else self.film.coverage(self.radius)
        psi = energy_derivatives(self.film, l1, l2, q * covered)
        if not np.all(np.isfinite(psi.value)):
            return None
        ratio = self.film.prestretch / self.radius
        # derivatives of l1 by (dr/dx, dz/dx), of l2 by r
        n_r, n_z = ratio**2 * r_x / l1, ratio**2 * z_x / l1
        curve = ratio**2 / l1
        weight = self.weight
        count = self.degree - 1

        l1_c = np.hstack([n_r[:, None] * self.slope, n_z[:, None] * self.slope])
        l2_c = np.hstack([ratio[:, None] * self.bubble, np.zeros_like(self.bubble)])
        slope_w = -0.5 / self.half_log
        l1_all = np.hstack([l1_c, (n_z * slope_w)[:, None]])
        l2_all = np.hstack([l2_c, np.zeros((len(weight), 1))])

        value = float(weight @ psi.value)
        gradient = l1_all.T @ (weight * psi.d1) + l2_all.T @ (weight * psi.d2)
        mixed = l1_all.T @ (weight * psi.q1 * covered) + l2_all.T @ (weight * psi.q2 * covered)
        cross = l1_all.T @ ((weight * psi.d12)[:, None] * l2_all)
        hessian = (
            l1_all.T @ ((weight * (psi.d11 - psi.d1 / l1))[:, None] * l1_all)
            + l2_all.T @ ((weight * psi.d22)[:, None] * l2_all)
            + cross
            + cross.T
        )
        # d2 l1 = curve (d r_x^2 + d z_x^2) - (d l1)^2 / l1; the second part is in the line above
        geometric = weight * psi.d1 * curve
        block = self.slope.T @ (geometric[:, None] * self.slope)
        hessian[:count, :count] += block
        hessian[count:-1, count:-1] += block
        border = slope_w * (self.slope.T @ geometric)
        hessian[count:-1, -1] += border
        hessian[-1, count:-1] += border
        hessian[-1, -1] += slope_w**2 * geometric.sum()
        return value, gradient, hessian, mixed

    def equilibrium(self, c: Array, deflection: float, q: float) -> _State | None:
        """Newton iteration at given deflection and ``q = U^2`` from the guess ``c``; None if it
        fails."""
        for _ in range(12):
            now = self.derivatives(c, deflection, q)
            if now is None:
                return None
            try:
                step = np.linalg.solve(now[2][:-1, :-1], now[1][:-1])
            except np.linalg.LinAlgError:
                return None
            c = c - step
            # Quadratic: the error is now round-off.
            if np.max(np.abs(step)) < 1e-9 * self.film.outer:
                return self._state(c, deflection, q)
        return None

    def follow_force(self, base: _State, arc: float, force: float) -> _State | None:
        """Next equilibrium of constant ``force`` [N], ``arc`` ahead of the stable state ``base``,
        or None.

        Deflection and ``q = U^2`` are both unknown; the step is measured along the tangent of the
        branch in the plane of ``w / (b - a)`` and ``q / q_unit``, so that neither needs to be
        monotonic.
        """
        w_unit, q_unit = self.film.outer - self.film.inner, self.q_unit
        along_w, along_q = -base.sensitivity * q_unit, base.stiffness * w_unit  # dF = 0, U growing
        length = math.hypot(along_w, along_q)
        along_w, along_q = along_w / length, along_q / length
        w, q = base.deflection + arc * along_w * w_unit, base.q + arc * along_q * q_unit
        c = base.c + base.tangent_w * (w - base.deflection) + base.tangent_q * (q - base.q)
        for _ in range(12):
            now = self.derivatives(c, w, q)
            if now is None:
                return None
            _, gradient, hessian, mixed = now
            size = len(gradient)
            matrix = np.zeros((size + 1, size + 1))
            matrix[:-1, :-1] = hessian
            matrix[:-1, -1] = mixed * q_unit / w_unit
            matrix[-1, -2:] = hessian[-1, -1] * along_w, hessian[-1, -1] * along_q
            residual = np.append(gradient, 0.0)  # the prediction meets the linear arc condition
            residual[-2] -= force
            try:
                step = np.linalg.solve(matrix, residual)
            except np.linalg.LinAlgError:
                return None
            c, w, q = c - step[:-2], w - float(step[-2]), q - float(step[-1]) * q_unit / w_unit
            if np.max(np.abs(step)) < 1e-9 * self.film.outer:
                return self._state(c, w, q)
        return None

    def _state(self, c: Array, deflection: float, q: float) -> _State | None:
        now = self.derivatives(c, deflection, q)
        if now is None:
            return None
        value, gradient, hessian, mixed = now
        inner, border = hessian[:-1, :-1], hessian[:-1, -1]
        right = np.column_stack([border, mixed[:-1]])
        try:
            tangents = -cho_solve(cho_factor(inner), right)
            definite = True
        except LinAlgError:
            tangents = -np.linalg.lstsq(inner, right)[0]
            definite = False
        return _State(
            c=c,
            deflection=deflection,
            q=q,
            energy=value,
            force=float(gradient[-1]),
            stiffness=float(hessian[-1, -1] + border @ tangents[:, 0]),
            sensitivity=float(mixed[-1] + border @ tangents[:, 1]),
            held=definite,
            tangent_w=tangents[:, 0],
            tangent_q=tangents[:, 1],
        )

    def flat(self, q: float) -> _State:
        """The flat state, ``r = R`` and ``z = 0``: always an equilibrium, by uniformity."""
        state = self._state(np.zeros(2 * self.degree - 2), 0.0, q)
        if state is None:
            raise ArithmeticError("the flat film has no finite energy")
        return state

    def flat_is_stable(self, q: float) -> bool:
        """Whether the flat film is (at least neutrally) stable, the plate being free in z."""
        now = self.derivatives(np.zeros(2 * self.degree - 2), 0.0, q)
        if now is None:
            return False
        eigenvalues = np.linalg.eigvalsh(now[2])
        return bool(eigenvalues[0] >= -1e-10 * abs(eigenvalues[-1]))

    def advance(self, state: _State, deflection: float) -> _State | None:
        """Equilibrium at ``deflection`` and unchanged voltage, predicted along the tangent."""
        guess = state.c
        if state.held:
            guess = guess + state.tangent_w * (deflection - state.deflection)
        return self.equilibrium(guess, deflection, state.q)

    def resolved(self, state: _State) -> bool:
        """Whether the last four coefficients of both fields are negligible."""
        parts = state.c.reshape(2, -1)[:, -4:]
        return bool(np.max(np.abs(parts)) < _RESOLVED * self.film.outer)

    def solution(self, state: _State, sign: float) -> Solution:
        """The public face of a state; ``sign = -1`` mirrors it (z to -z, w to -w, F to -F)."""

        def profile(radius: Array) -> _Profile:
            at = self.profile(state.c, state.deflection, radius)
            return at._replace(height=sign * at.height)

        return Solution(
            film=self.film,
            force=sign * state.force,
            deflection=sign * state.deflection,
            voltage=math.sqrt(max(state.q, 0.0)),
            energy=state.energy,
            stiffness=state.stiffness,
            stable=state.stable,
            stable_held=state.held,
            profile=profile,
        )


def _refine(film: Film, solve: Callable[[RitzExpansion], _State], sign: float) -> Solution:
    """Raise the polynomial degree until the expansion of the solution is resolved.

    That there is no equilibrium is believed only of the second degree tried.
    """
    for degree in _DEGREES:
        ritz = RitzExpansion(film, degree)
        try:
            state = solve(ritz)
        except NoEquilibrium:
            if degree == _DEGREES[0]:
                continue
            raise
        if ritz.resolved(state):
            return ritz.solution(state, sign)
    raise ArithmeticError(f"the solution is not resolved by polynomials of degree {_DEGREES[-1]}")


def _march(ritz: RitzExpansion, state: _State, target: float) -> _State:
    """Continue in the deflection from ``state`` up to ``target`` [m] at constant voltage."""
    smallest = 1e-5 * (ritz.film.outer - ritz.film.inner)
    step = 5.0 * _CONTINUATION_STEP * (ritz.film.outer - ritz.film.inner)
    while state.deflection < target:
        step = min(step, target - state.deflection)
        last = step >= target - state.deflection
        following = ritz.advance(state, target if last else state.deflection + step)
        if following is not None:
            state = following
            continue
        step *= 0.5
        if step < smallest:
            raise NoEquilibrium(
                f"the branch ends near the deflection {state.deflection:.6g} m",
                state.force,
                state.deflection,
                past_limit=False,
            )
    return state


def solve_deflection(film: Film, deflection: float, voltage: float = 0.0) -> Solution:
    """Equilibrium with the plate held at ``deflection`` [m] under ``voltage`` [V].

    The branch is followed from the flat film at that voltage, also past a maximum of the force; see
    ``Solution.stable`` and ``Solution.stable_held``.  Raises :class:`NoEquilibrium` beyond the
    deflection at which the branch turns back (a limit point even with the plate held).
    """
    sign = -1.0 if deflection < 0.0 else 1.0

    def solve(ritz: RitzExpansion) -> _State:
        return _march(ritz, ritz.flat(voltage**2), abs(deflection))

    return _refine(film, solve, sign)


def solve_load(
    film: Film, force: float, voltage: float = 0.0, max_deflection: float | None = None
) -> Solution:
    """Stable equilibrium on the primary branch under the dead load ``force`` [N] and ``voltage``
    [V].

    At constant voltage ``F(w)`` is followed from the flat film; the primary branch ends at the
    first limit point, where ``dF/dw = 0`` (pull-in under a dead load).  Raises
    :class:`NoEquilibrium` if ``force`` is above the limit force, if the flat film is unstable
    already, or if the force is not reached up to ``max_deflection`` [m] (default: ``3 (outer -
    inner)``; ``past_limit`` is False then).  An equilibrium beyond the limit point (snap-through of
    a stiffening film) is not sought.
    """
    sign = -1.0 if force < 0.0 else 1.0
    load = abs(force)
    reach = 3.0 * (film.outer - film.inner) if max_deflection is None else max_deflection

    def solve(ritz: RitzExpansion) -> _State:
        return _primary(ritz, load, voltage**2, reach)

    return _refine(film, solve, sign)


def _primary(ritz: RitzExpansion, load: float, q: float, reach: float) -> _State:
    """State under ``load`` [N] on the primary branch at ``q = U^2``."""
    state = ritz.flat(q)
    if not ritz.flat_is_stable(q):
        raise NoEquilibrium("the flat film is unstable at this voltage", 0.0, 0.0, past_limit=True)
    if load == 0.0:
        return state
    whole = ritz.film.outer - ritz.film.inner
    step = _CONTINUATION_STEP * whole
    while True:
        following = ritz.advance(state, min(state.deflection + step, reach))
        if following is None:
            step *= 0.5
            if step < 1e-7 * whole:
                raise NoEquilibrium(
                    f"the branch ends near the deflection {state.deflection:.6g} m",
                    state.force,
                    state.deflection,
                    past_limit=False,
                )
            continue
        if not following.stable:
            following = _limit_point(ritz, state, following.deflection)
            if following.force < load:
                raise NoEquilibrium(
                    f"the force exceeds the limit force {following.force:.9g} N, "
                    f"reached at the deflection {following.deflection:.6g} m",
                    following.force,
                    following.deflection,
                    past_limit=True,
                )
        if following.force >= load:
            return _at_load(ritz, state, following, load)
        if following.deflection >= reach:
            raise NoEquilibrium(
                f"the force is not reached up to the deflection {reach:.6g} m",
                following.force,
                following.deflection,
                past_limit=False,
            )
        state = following


def _limit_point(ritz: RitzExpansion, start: _State, end: float) -> _State:
    """Bisect the loss of stability under load between ``start`` (stable) and the deflection ``end``
    [m]."""
    low, high = start, end
    while high - low.deflection > 1e-9 * ritz.film.outer:
        middle = ritz.advance(low, 0.5 * (low.deflection + high))
        if middle is not None and middle.stable:
            low = middle
        else:
            high = 0.5 * (low.deflection + high)
    return low


def _at_load(ritz: RitzExpansion, low: _State, high: _State, load: float) -> _State:
    """State with ``force = load`` between two states of the branch that bracket it."""

    def excess(deflection: float) -> float:
        state = ritz.advance(low, deflection)
        if state is None:
            raise ArithmeticError("Newton iteration failed between two equilibria")
        return state.force - load

    if high.force == load:
        return high
    root = brentq(excess, low.deflection, high.deflection, xtol=1e-15 * ritz.film.outer, rtol=1e-14)
    state = ritz.advance(low, float(root))
    if state is None:
        raise ArithmeticError("Newton iteration failed between two equilibria")
    return state


def pull_in(film: Film, force: float) -> Solution:
    """The fold of the load-controlled branch: ``force`` [N] is kept while the voltage rises from
    zero.

    The equilibria of constant force are followed by arc length in the plane of deflection and
    ``U^2``.  The voltage is largest where ``dF/dw`` at constant voltage vanishes, since on the
    branch ``d(U^2)/dw = -(dF/dw) / (dF/dU^2)``; the first such point is returned.  Raises
    :class:`NoEquilibrium` if the branch shows no fold as far as it can be followed (a film that
    stiffens enough has none).
    """
    if force == 0.0 or film.relative_permittivity == 0.0 or film.permittivity_exponent >= 2.0:
        raise ValueError("pull-in needs a force, a permittivity "
                         "and a permittivity exponent below 2")
    sign = -1.0 if force < 0.0 else 1.0
    before = math.nan
    for degree in _DEGREES:
        ritz = RitzExpansion(film, degree)
        state = fold_point(ritz, abs(force))
        if ritz.resolved(state) or abs(state.q - before) < 1e-8 * state.q:
            return ritz.solution(state, sign)
        before = state.q
    raise ArithmeticError(f"the fold is not resolved by polynomials of degree {_DEGREES[-1]}")


def pull_in_voltage(film: Film, force: float) -> float:
    """Voltage [V] of :func:`pull_in`, to 1e-8 relative or better (the fold is a maximum of the
    voltage)."""
    return pull_in(film, force).voltage


def fold_point(ritz: RitzExpansion, load: float) -> _State:
    """First maximum of ``q = U^2`` along the branch of constant ``load`` [N]."""
    state = _primary(ritz, load, 0.0, 10.0 * (ritz.film.outer - ritz.film.inner))
    arc = 0.5 * _CONTINUATION_STEP
    for _ in range(1000):
        following = ritz.follow_force(state, arc, load)
        if following is None:
            arc *= 0.5
            if arc < 1e-6:
                break
        elif following.stable:
            state = following
        else:
            while arc > 1e-6:  # bisect; the voltage varies as the square of the distance
                arc *= 0.5
                following = ritz.follow_force(state, arc, load)
                if following is not None and following.stable:
                    state = following
            return state
    raise NoEquilibrium(
        f"no fold up to the deflection {state.deflection:.6g} m "
        f"and {math.sqrt(max(state.q, 0.0)):.6g} V",
        load,
        state.deflection,
        past_limit=False,
    )


def shoot_deflection(film: Film, deflection: float, voltage: float = 0.0,
                     tolerance: float = 1e-12) -> Solution:
    """Same problem as :func:`solve_deflection`, by shooting on the Euler-Lagrange equations.

    With ``x = ln(R / a)``, ``z_R = -(l1 / lp) sin t`` and ``r_R = (l1 / lp) cos t`` the equations
    of the module docstring become, with the second derivatives of ``Psi``::

        dl2/dx = l1 cos t - l2
        dl1/dx = (Psi_2 cos t - Psi_1 - Psi_12 dl2/dx) / Psi_11
        dt/dx  = -(Psi_2 / Psi_1) sin t
        dz/dx  = -(R / lp) l1 sin t

    ``l1`` and ``t`` at the plate are found by Newton's method such that ``r(b) = b`` and ``z(a) -
    z(b) = w``; the force is ``F = 2 pi a (T / lp) Psi_1 sin t`` there.  The meridional tension must
    be positive. There is no continuation: the start is the small-deflection shape, and no limit
    point is noticed. ``tolerance`` of the integration: where a film begins to wrinkle, the
    equations have a kink that makes small ones slow.
    """
    lp, a, span = film.prestretch, film.inner, film.log_ratio
    q = voltage**2

    def rate(x: float, y: Array) -> list[Any]:
        l1, l2, angle = y[0], y[1], y[2]
        psi = energy_derivatives(film, l1, l2, q)
        sine, cosine = math.sin(angle), math.cos(angle)
        l2_x = l1 * cosine - l2
        l1_x = (psi.d2 * cosine - psi.d1 - psi.d12 * l2_x) / psi.d11
        return [l1_x, l2_x, -psi.d2 / psi.d1 * sine, -math.exp(x) * l1 * sine / lp]

    def trajectory(start: Array, dense: bool = False) -> Any:
        first = [start[0], lp, start[1], deflection / a]  # the height is scaled with a
        result = solve_ivp(
            rate, (0.0, span), first, method="DOP853", rtol=tolerance, atol=tolerance / 10,
            dense_output=dense
        )
        if not result.success:
            raise ArithmeticError(f"shooting failed: {result.message}")
        return result

    def miss(start: Array) -> Array:
        end = trajectory(start).y[:, -1]
        return np.array([end[1] / lp - 1.0, end[3]])

    tangent = deflection / (a * span)  # slope of the small-deflection shape z = w (1 - x / span)
    start = np.array([lp * math.hypot(1.0, tangent), math.atan(tangent)])
    for _ in range(20):
        error = miss(start)
        columns = [(miss(start + shift) - error) / 1e-6 for shift in 1e-6 * np.eye(2)]
        step = np.linalg.solve(np.column_stack(columns), error)
        start = start - step
        # The next step would be about 1e-6 of this one.
        if np.max(np.abs(step)) < max(1e-8, 10 * tolerance):
            break
    else:
        raise ArithmeticError("shooting did not converge")

    path = trajectory(start, dense=True).sol

    def profile(radius: Array) -> _Profile:
        l1, l2, _, height = path(np.log(radius / a))
        return _Profile(l1, l2, l2 * radius / lp, a * height)

    xi, weight = legendre.leggauss(80)
    radius = a * np.exp(0.5 * span * (1.0 + xi))
    at = profile(radius)
    density = energy_derivatives(film, at.lambda1, at.lambda2, q).value
    area = math.pi * span * radius**2 * weight  # 2 pi R dR
    rim = np.array([start[0]])
    psi = energy_derivatives(film, rim, np.array([lp]), q)
    force = 2.0 * math.pi * a * film.thickness / lp * psi.d1[0]
    return Solution(
        film=film,
        force=float(force) * math.sin(float(start[1])),
        deflection=deflection,
        voltage=voltage,
        energy=film.thickness / lp**2 * float(area @ density),
        stiffness=math.nan,
        stable=False,
        stable_held=False,
        profile=profile,
    )
