"""Corrections of a collocated step: its systems of equations, and Broyden's updates of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from tympan.studies.films.film import NoBalance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Corrections:
    """Corrections by a tangent that is not formed again but learns from those that were made.

    Broyden's good method by its first tangent's ``solve`` and its steps (Kelley, *Iterative Methods
    for Linear and Nonlinear Equations*, §7.3); arrays are (..., stages, shapes), of several runs.
    """

    solve: Callable[[Array], Array]
    steps: list[tuple[Array, Any]] = field(default_factory=list)

    def correction(self, pull: Array) -> Array:
        """Of a state that is out of balance by a pull."""
        change = self.solve(pull)
        for (step, square), (following, _) in pairwise(self.steps):
            change = change + following * (_product(step, change) / square)
        if self.steps:
            step, square = self.steps[-1]
            change = change / (1 - _product(step, change) / square)
        self.steps.append((change, _product(change, change)))
        return change


def _product(a: Array, b: Array) -> Any:
    """Of two changes, by runs."""
    if a.ndim == 2:
        return np.vdot(a, b)
    return (a * b).sum((-1, -2), keepdims=True)


def factorised(stiffness: Array) -> Callable[[Array], Array]:
    """What solves for right sides, (..., stages, shapes), by a matrix over stages and shapes.

    Raises
    ------
    NoBalance
        Where it is singular.
    """
    *runs, stages, count = stiffness.shape[:-2]
    size = stages * count
    matrix = stiffness.reshape(*runs, size, size)
    # By LAPACK itself: NumPy has no factors to solve by again, and costs a small system more.
    factors = [dgetrf(each.T) for each in matrix.reshape(-1, size, size)]
    if any(singular for *_, singular in factors):
        raise NoBalance

    def solve(pull: Array) -> Array:
        rights = zip(factors, pull.reshape(-1, size), strict=True)
        changes = [dgetrs(both, pivots, right, trans=1)[0] for (both, pivots, _), right in rights]
        return np.array(changes).reshape(pull.shape)

    return solve
