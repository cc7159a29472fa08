"""Collocation rules: time steps that satisfy their equations at several stages at once.

y_i = y_0 + h Σ_j A_ij ẏ_j at times c_i h. Radau's rule ends at its last stage and has order 2 s − 1
with s stages. It damps components that decay much faster than a step (Radau IIA: Hairer and Wanner,
*Solving Ordinary Differential Equations II*, §IV.5). Gauss's rule has order 2 s and does not damp
oscillations without loss; it ends beyond its last stage. Within a step the solution is the
polynomial through its start and its stages.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import legendre

from tympan.base.arrays import Array


@dataclass(frozen=True, eq=False)
class CollocationRule:
    """Collocation rule with ``nodes`` c (stages,), matrix A and its inverse (stages, stages).

    ``end``: weight of each stage's change from the start in the step's end, shape (stages,).
    ``powers``: coefficients of the polynomial through the values at start and stages, shape (stages
    + 1, stages + 1). ``tail``: its two highest coefficients in Legendre's polynomials.
    """

    nodes: Array
    matrix: Array
    inverse: Array
    end: Array
    powers: Array
    tail: Array

    @cached_property
    def from_start(self) -> Array:
        """Matrix A with the start as the first stage, shape (stages + 1, stages + 1)."""
        return np.pad(self.matrix, ((1, 0), (1, 0)))

    def beyond(self, share: float) -> Array:
        """Extrapolate to the nodes of the next step from the values of this one.

        ``share``: length of the next step, relative to this one.
        """
        times = 1 + share * self.nodes
        return np.asarray(times[:, None] ** np.arange(len(self.powers)) @ self.powers)


@lru_cache
def radau(stages: int) -> CollocationRule:
    """Create Radau's rule; its last stage is the step's end.

    Examples
    --------
    >>> rule = radau(2)
    >>> rule.nodes.round(6).tolist(), rule.matrix.round(6).tolist()
    ([0.333333, 1.0], [[0.416667, -0.083333], [0.75, 0.25]])
    """
    last = np.eye(stages + 1)[stages] - np.eye(stages + 1)[stages - 1]
    roots = np.sort(np.real(legendre.legroots(last)))
    return _collocated(np.append((roots[:-1] + 1) / 2, 1.0))


@lru_cache
def gauss(stages: int) -> CollocationRule:
    """Create Gauss's rule; its stages are inside the step.

    Examples
    --------
    >>> rule = gauss(2)
    >>> rule.nodes.round(6).tolist(), rule.end.round(6).tolist()
    ([0.211325, 0.788675], [-1.732051, 1.732051])
    """
    roots = np.sort(np.real(legendre.legroots(np.eye(stages + 1)[stages])))
    return _collocated((roots + 1) / 2)


def _collocated(nodes: Array) -> CollocationRule:
    """Create the rule with nodes in (0, 1]."""
    stages = len(nodes)
    values = _values(nodes, stages - 1)

    def integrals(ends: Array | float) -> Array:
        """Integrate Legendre's polynomials from 0, shape (stages, *ends)."""
        antiderivatives = [legendre.legint(unit) for unit in np.eye(stages)]
        return np.array([(legendre.legval(2 * ends - 1, each) - legendre.legval(-1.0, each)) / 2
                         for each in antiderivatives])

    matrix = np.linalg.solve(values.T, integrals(nodes)).T
    weights = np.linalg.solve(values.T, integrals(1.0))
    at = np.append(0.0, nodes)
    tail = np.linalg.inv(_values(at, stages))[:-3:-1]
    powers = np.linalg.inv(at[:, None] ** np.arange(stages + 1))
    inverse = np.linalg.inv(matrix)
    parts = matrix, inverse, weights @ inverse, powers, tail
    return CollocationRule(nodes, *(np.asarray(part, np.float64) for part in parts))


def newton_matrix(weights: Array, slopes: Array) -> Array:
    """Compute I − W ∂ẏ/∂y of all stages at once, shape (..., stages × size, stages × size).

    ``weights``: the rule's matrix times the step's duration, (..., stages, stages). ``slopes``:
    ∂ẏ/∂y at the stages, (..., stages, size, size).
    """
    *_, stages, size = slopes.shape[:-1]
    blocks = weights[..., :, None, :, None] * np.moveaxis(slopes, -3, -2)[..., None, :, :, :]
    return np.eye(stages * size) - blocks.reshape(*blocks.shape[:-4], stages * size, stages * size)


def _values(nodes: Array, degree: int) -> Array:
    """Evaluate Legendre's polynomials on (0, 1), shape (nodes, degree + 1)."""
    return np.asarray(legendre.legvander(2 * nodes - 1, degree), float)
