"""The branch of the soft reference film under 17.9 g through its pull-in, shared by tests."""

from __future__ import annotations

import numpy as np
from axisymmetric import Film as Reference
from axisymmetric import FloatArray, _Ritz

from fem.branch import ArcSettings, Branch, Point
from fem.laws import Ogden
from fem.model import Model
from fem.motions import Motions
from fem.paths import equilibrium

SOFT = Ogden((15e3,), (2.0,))
WEIGHT = 17.9e-3 * 9.80665


def branch_points(film: Model, motions: Motions, reach: float = 10.9e-3, longest: float = 0.05) -> list[Point]:
    """Points from a stable voltage on, through the largest, to a heave beyond it."""
    start = equilibrium(film, WEIGHT, 6000.0).state
    found = []
    for point in Branch(film, "voltage", motions=motions, arc=ArcSettings(longest=longest)).points(start):
        if point.state.plate.heave > reach:
            break
        found.append(point)
    return found


def voltage_at(reference: Reference, heave: float, force: float, near: tuple[FloatArray, float], degree: int
               ) -> tuple[FloatArray, float]:
    """Shape and U² of the Ritz method at a heave and a force, by Newton's method from a shape and a U² near."""
    ritz = _Ritz(reference, degree)
    c, q = near
    unit = ritz.q_unit / ritz.film.outer
    for _ in range(40):
        parts = ritz.derivatives(c, heave, q)
        assert parts is not None
        _, gradient, hessian, mixed = parts
        residual = gradient - force * np.eye(len(gradient))[-1]
        step = np.linalg.solve(np.column_stack([hessian[:, :-1], mixed * unit]), residual)
        c, q = c - step[:-1], q - float(step[-1]) * unit
        if np.max(np.abs(step)) < 1e-10 * ritz.film.outer:
            return c, q
    raise ArithmeticError("not converged")
