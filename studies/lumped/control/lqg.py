"""LQG for a lumped model: a Kalman filter and a linear quadratic regulator, with integral action.

The filter also estimates a deflection that is added to the requested one and walks at random. The
regulator subtracts this estimate, so that no error remains (Åström and Wittenmark,
*Computer-Controlled Systems*, 1997, §11.4 and §4.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.linalg import solve_discrete_are

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.studies.lumped.control.controller import Controller, LinearLaw, Made
from tympan.studies.lumped.control.loop import SampledLoop, closed_poles, frequencies

#: Weights of the requested deflection to try, over the weight of the deflection's error.
_WEIGHTS = np.geomspace(1e-2, 1e2, 7)
#: Variances to try of the disturbance that acts on the plate at each sample, over the reading's.
_SHAKEN = np.geomspace(1e-4, 1e2, 7)
#: Variances of the random walk's steps to try, over the reading's variance.
_WALKS = np.geomspace(1e-7, 1e0, 15)
#: Step through the frequencies in the search: it checks every fifth one.
_COARSE = 5


def best_lqg(plants: Sequence[SampledLoop], sensitivity: float) -> Made | None:
    """Find the LQG controller of the middle plant with most integral gain on all plants.

    All loops must be stable, and their sensitivity at most as given. None where no controller
    meets both.
    """
    model, interval = plants[len(plants) // 2], plants[0].interval
    omega = frequencies(interval)[::_COARSE]
    z = np.exp(1j * omega * interval)
    responses = np.array([plant.response(z) for plant in plants])
    best, gain = None, 0.0
    regulators = [_regulator(model, weight) for weight in _WEIGHTS]
    filters = [_filter(model, *noise) for noise in product(_SHAKEN, _WALKS)]
    for regulator, (moved, walked) in product(regulators, filters):
        law = _law(model, regulator, moved, walked)
        shape = -law.response(z)
        # The gain of a slow error is K_i T/(1 − 1/z).
        integral = float(np.abs(shape[0] * (1 - 1 / z[0])) / interval)
        if integral <= gain or np.abs(1 + shape * responses).min() < 1 / sensitivity:
            continue
        if max(closed_poles(plant, law).max() for plant in plants) < 1:
            best, gain = law, integral
    if best is None:
        return None
    return lambda inverse, supply: Controller(
        inverse=inverse, supply_V=supply, interval_s=interval, method="lqg", filter_s=None,
        proportional=None, integral_per_s=gain, law=best)


def _regulator(plant: SampledLoop, weight: float) -> Array:
    """Compute the gain K of v = −K x that minimises y² + weight v², shape (1, size)."""
    a, b = plant.a, plant.b
    left = solve_discrete_are(a, b, plant.c.T @ plant.c, np.array([[weight]]))
    return np.asarray(np.linalg.solve(weight + b.T @ left @ b, b.T @ left @ a))


def _filter(plant: SampledLoop, shaken: float, walk: float) -> tuple[Array, float]:
    """Compute a Kalman filter's gains: of the state, shape (size, 1), and of the random walk."""
    size = len(plant.a)
    a, noise, c = np.eye(size + 1), np.zeros((size + 1, size + 1)), np.zeros((1, size + 1))
    a[:-1, :-1], a[:-1, -1:], c[0, :-1] = plant.a, plant.b, plant.c[0]
    noise[:-1, :-1], noise[-1, -1] = shaken * plant.b @ plant.b.T, walk
    try:
        spread = solve_discrete_are(a.T, c.T, noise, np.eye(1))
    except np.linalg.LinAlgError:
        raise InputError("is too short for the creep of this film", key="interval") from None
    gain = spread @ c.T / (c @ spread @ c.T + 1)
    return gain[:-1], float(gain[-1, 0])


def _law(plant: SampledLoop, regulator: Array, moved: Array, walked: float) -> LinearLaw:
    """Join filter and regulator in one law; its memory is the predicted state and walk."""
    a, b, c, size = plant.a, plant.b, plant.c, len(plant.a)
    still = np.linalg.solve(np.eye(size) - a, b)  # the state at rest per deflection
    feed = float(1 + (regulator @ still)[0, 0])
    seen, slowed = np.eye(size) - moved @ c, a - b @ regulator
    law = np.block([[slowed @ seen, np.zeros((size, 1))], [-walked * c, np.ones((1, 1))]])
    inputs = np.block([[feed * b, slowed @ moved], [np.zeros((1, 1)), np.array([[walked]])]])
    asked = np.append((walked * c - regulator @ seen)[0], -1.0)
    through = np.array([feed, -walked - float((regulator @ moved)[0, 0])])
    rest = np.zeros((size + 1, 2))
    rest[:-1, 1:] = still
    return LinearLaw.of(law, inputs, asked, through, np.append(b[:, 0], 0.0), rest)
