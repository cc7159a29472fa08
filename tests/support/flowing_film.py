"""A film with one branch of every registered flow, a path of its strain, Ċ_v by its equation."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.support.specimens import NEO_HOOKE
from tympan.fem.film.flows import ShearThinning
from tympan.fem.film.memory import incompressible, inner, inverse
from tympan.geometry.specimen import ConstantFlow, Film, FlowLaw, ViscousBranch

#: Stresses of the paths below are some 1e5 Pa.
SAMPLES: dict[str, FlowLaw] = {
    "constant": ConstantFlow(),
    "shear_thinning": ShearThinning(2e4, 0.8, 0.05, 0.3, 1.5)}
MODULUS, TIME = 5e4, 3.0


def film(flow: FlowLaw, **changes: Any) -> Film:
    return Film(1e-3, (2.0, 1.5), NEO_HOOKE, 4.7,
                branches=(ViscousBranch(MODULUS, TIME, flow),), **changes)


def path(time: float) -> np.ndarray:
    """A C that stretches, shears and comes back."""
    first, second = 2.0 + 0.8 * np.sin(time), 1.5 + 0.3 * np.cos(2 * time)
    return np.array([first**2, second**2, 0.3 * np.sin(1.7 * time) * first * second])


def rate(c: Any, viscous: Any, flow: FlowLaw) -> Any:
    """Ċ_v by its equation with whole matrices."""
    full = incompressible(c)
    matrix, memory = ([[a[0], a[2], 0], [a[2], a[1], 0], [0, 0, a[3]]] for a in (full, viscous))
    x = np.array(matrix) @ np.linalg.inv(np.array(memory))
    first, second = np.trace(x), (np.trace(x) ** 2 - np.trace(x @ x)) / 2
    squared = (first**2 / 3 - second) * MODULUS**2
    viscosity = flow.relative_viscosity(np.trace(memory), max(squared, 0.0))
    return (full - inner(full, inverse(viscous)) * viscous / 3) / (TIME * viscosity)
