"""Long steps of time that are collocated at several stages: Radau's rule of any order.

y_i = y_0 + h Σ_j A_ij ẏ_j at times c_i h, of which the last is the end: of order 2 s − 1 with s
stages, and what decays much faster than a step is forgotten (Radau IIA: Hairer and Wanner, *Solving
Ordinary Differential Equations II*, §IV.5). Between, a step is the polynomial through its start and
its stages.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import legendre

from tympan.base.arrays import Array


@dataclass(frozen=True, eq=False)
class CollocationRule:
    """``nodes`` c, shape (stages,), of which the last is 1, matrix A and its inverse.

    Of what is through the start and the stages, by its values there: ``powers``, its coefficients,
    shape (stages + 1, stages + 1), and ``tail``, the two highest in Legendre's polynomials.
    """

    nodes: Array
    matrix: Array
    inverse: Array
    powers: Array
    tail: Array

    @cached_property
    def from_start(self) -> Array:
        """A where the start itself is the first stage, shape (stages + 1, stages + 1)."""
        return np.pad(self.matrix, ((1, 0), (1, 0)))

    def beyond(self, share: float) -> Array:
        """Values at the nodes of a next step, so many times as long, by values of this one."""
        times = 1 + share * self.nodes
        return np.asarray(times[:, None] ** np.arange(len(self.powers)) @ self.powers)


@lru_cache
def radau(stages: int) -> CollocationRule:
    """Radau's rule.

    Examples
    --------
    >>> rule = radau(2)
    >>> rule.nodes.round(6).tolist(), rule.matrix.round(6).tolist()
    ([0.333333, 1.0], [[0.416667, -0.083333], [0.75, 0.25]])
    """
    last = np.eye(stages + 1)[stages] - np.eye(stages + 1)[stages - 1]
    roots = np.sort(np.real(legendre.legroots(last)))
    nodes: Array = np.append((roots[:-1] + 1) / 2, 1.0)
    values = _values(nodes, stages - 1)
    sums = [(legendre.legval(2 * nodes - 1, legendre.legint(unit)) - legendre.legval(
        -1.0, legendre.legint(unit))) / 2 for unit in np.eye(stages)]
    matrix = np.linalg.solve(values.T, np.array(sums)).T
    tail = np.linalg.inv(_values(np.append(0.0, nodes), stages))[:-3:-1]
    powers = np.linalg.inv(np.append(0.0, nodes)[:, None] ** np.arange(stages + 1))
    return CollocationRule(nodes, *(np.asarray(part, np.float64) for part in (
        matrix, np.linalg.inv(matrix), powers, tail)))


def _values(nodes: Array, degree: int) -> Array:
    """Values of Legendre's polynomials on (0, 1), shape (nodes, degree + 1)."""
    return np.asarray(legendre.legvander(2 * nodes - 1, degree), float)
