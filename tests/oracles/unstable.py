"""Independent references around pull-in: the unstable branch beyond it, and before it the loss of
hoop tension and that of strong ellipticity.

The latter is the condition of Legendre and Hadamard, tried on directions of a jump and of its line;
no formula for ellipticity is used.

Built on the Ritz expansion of :mod:`axisymmetric`; the project is not imported.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from tests.oracles.axisymmetric import (
    Film,
    NoEquilibrium,
    RitzExpansion,
    Solution,
    energy_derivatives,
    fold_point,
    pull_in_voltage,
    solve_load,
)
from tympan.base.arrays import Array

#: Directions of a line and of the jump across it, in half a turn.
_DIRECTIONS = 90



def branch_voltage(film: Film, force: float, heave: float, degree: int = 40) -> float:
    """Voltage [V] beyond the fold at which the plate at ``heave`` [m] carries ``force`` [N].

    Followed from the fold in the heave, with shape and ``U^2`` unknown, so it may be unstable, held
    or not.
    """
    ritz = RitzExpansion(film, degree)
    fold = fold_point(ritz, force)
    if heave < fold.deflection:
        raise ValueError(f"the fold is at {fold.deflection:.6g} m")
    past, now = None, (fold.deflection, fold.c, fold.q)
    steps = max(2, math.ceil((heave - fold.deflection) / 4e-5))
    for target in np.linspace(fold.deflection, heave, steps + 1)[1:]:
        share = 0.0 if past is None else (target - now[0]) / (now[0] - past[0])
        guess = now if past is None else tuple(b + share * (b - a)
                                               for a, b in zip(past, now, strict=True))
        past, now = now, (target, *shape_at(ritz, guess[1], float(target), guess[2], force))
    return math.sqrt(now[2])


def shape_at(ritz: RitzExpansion, c: Array, heave: float, q: float,
             force: float) -> tuple[Array, float]:
    """Shape and ``q = U^2`` at a heave and a force, by Newton's method."""
    unit = ritz.q_unit / ritz.film.outer
    for _ in range(25):
        parts = ritz.derivatives(c, heave, q)
        if parts is None:
            break
        _, gradient, hessian, mixed = parts
        matrix = np.column_stack([hessian[:, :-1], mixed * unit])
        residual = gradient - force * np.eye(len(gradient))[-1]
        step = np.linalg.solve(matrix, residual)
        c, q = c - step[:-1], q - float(step[-1]) * unit
        if np.max(np.abs(step)) < 1e-9 * ritz.film.outer:
            return c, q
    raise NoEquilibrium("the branch ends", force, heave, past_limit=False)


def slack_voltage(film: Film, force: float, highest: float) -> float:
    """Voltage [V] at which the hoop stress at the plate falls to zero, Maxwell stress included.

    Beyond it a film that may wrinkle (``Film.relaxed``) has no stable equilibrium: at the natural
    width its energy is not convex in the meridional stretch. ``highest``: a voltage below pull-in
    at which the stress is compressive.
    """
    def hoop(voltage: float) -> float:
        return float(solve_load(film, force, voltage).total2(film.inner))

    return float(brentq(hoop, 0.9 * highest, highest, xtol=1e-3))


def end_voltage(film: Film, force: float, highest: float) -> float:
    """Voltage [V] up to ``highest`` at which a film that may wrinkle ends under a force; else inf.

    Its pull-in, or before that the loss of its hoop tension, anywhere, where at the natural width
    the energy is not convex in the meridional stretch; nan where it is convex there, so that the
    film goes on wrinkled.
    """
    try:
        limit = pull_in_voltage(film, force)
    except (ArithmeticError, ValueError):
        limit = math.inf
    highest = min(highest, 0.999999 * limit)
    radii = np.geomspace(film.inner, film.outer, 60)

    def hoop(voltage: float) -> float:
        return float(solve_load(film, force, voltage).total2(radii).min())

    try:
        if hoop(highest) >= 0:
            return limit
        loss_voltage = float(brentq(hoop, 0.0, highest, rtol=1e-6))
    except ArithmeticError:
        return math.nan
    state = solve_load(film, force, loss_voltage)
    at = radii[[int(np.argmin(state.total2(radii)))]]
    psi = energy_derivatives(film, state.lambda1(at), state.lambda2(at), loss_voltage**2)
    return loss_voltage if psi.d11[0] < psi.d12[0] ** 2 / psi.d22[0] else math.nan


def least_stiffness(film: Film, solution: Solution, radius: float) -> float:
    """Smallest second derivative of the energy [Pa] along any jump a⊗n of the plane at a radius."""
    l1, l2 = (float(stretch([radius])[0]) for stretch in (solution.lambda1, solution.lambda2))
    at = energy_derivatives(film, np.array([l1]), np.array([l2]), solution.voltage**2)
    d1, d2, d11, d12, d22 = (float(getattr(at, name)[0])
                             for name in ("d1", "d2", "d11", "d12", "d22"))
    angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    a, n = np.meshgrid(angles, angles)
    shear = (l1 * d1 - l2 * d2) / (l1**2 - l2**2)  # of a jump along the line
    turn = (l2 * d1 - l1 * d2) / (l1**2 - l2**2)
    g11, g22, g12, g21 = (np.cos(a) * np.cos(n), np.sin(a) * np.sin(n), np.cos(a) * np.sin(n),
                          np.sin(a) * np.cos(n))
    form = (d11 * g11**2 + d22 * g22**2 + 2 * d12 * g11 * g22 + shear * (g12**2 + g21**2)
            + 2 * turn * g12 * g21)
    return float(form.min())


def instability_voltage(film: Film, force: float, low: float, high: float) -> float:
    """Voltage [V] between two at which the film gives way at the plate's edge."""
    def stiffness(voltage: float) -> float:
        return least_stiffness(film, solve_load(film, force, voltage), film.inner)

    return float(brentq(stiffness, low, high, xtol=1e-3))
