"""A film's stress by polynomials of trace and determinant of C: quick where points are few.

An isotropic energy W(λ₁, λ₂) is an analytic function of I = tr C and J = det C. That includes equal
stretches, and pairs (I, J) that no C has: their λ² are complex conjugates. So values at Chebyshev's
nodes of any box of I and J determine it, and S = 2 W_I 1 + 2 W_J cof C and ∂S/∂E need neither
stretches nor directions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.film.density import FilmDensity, maxwell
from tympan.fem.film.memory import add_across, cofactor
from tympan.geometry.specimen import Specimen

#: Largest error of an energy's slopes over the largest slope across the box, far below the error of
#: a reduced film.
PRECISION = 1e-5
#: Degrees tried in each variable, lowest first: a lower degree is quicker.
_DEGREES = (3, 4, 5, 6, 8, 10)

#: Number of fit nodes along an axis beyond the degree: a few more, for least squares.
_NODES = 2
#: Number of check nodes along an axis beyond the degree: at other places than those of the fit.
_CHECKS = 5


@dataclass(frozen=True, eq=False)
class EnergyTable:
    """A film's law and its energy by U² in a box of (I, J): ``middle`` ± ``reach``, both (2, 1).

    ``rows``, shape (2, 5, coefficients), give 2 W_I, 2 W_J, 4 W_II, 4 W_IJ, 4 W_JJ of the law and
    of the charge on a covered film at 1 V. ``charged`` is the share of that charge at each point.
    The film wrinkles where a principal S is below ``least`` [Pa].
    """

    middle: Array
    reach: Array
    rows: Array
    charged: Array
    least: float

    @classmethod
    def of(cls, specimen: Specimen, charged: Array, low: Array, high: Array
           ) -> EnergyTable | None:
        """Tabulate a specimen's film between two pairs (I, J) of its virgin C.

        None where no degree is precise enough, for example where an energy is infinite, or where
        electrodes are stiff.
        """
        if specimen.electrode.stiffness:
            return None
        energies = specimen.membrane.material, maxwell(specimen, 1.0)
        middle, reach = (low + high) / 2, (high - low) / 2
        units = np.array([reach[0], reach[1], reach[0]**2, reach[0] * reach[1], reach[1]**2])
        for degree in _DEGREES:
            fit = _fit(degree)
            places = (middle + reach * fit.nodes).T
            slopes = np.stack([_slopes(energy, *places) * reach[:, None] for energy in energies])
            fitted = slopes[..., :fit.count].reshape(2, -1)
            checked = slopes[..., fit.count:].reshape(2, -1)
            coefficients = fitted @ fit.inverse
            errors = np.abs(coefficients @ fit.checks - checked).max(1)
            precise = errors <= PRECISION * np.abs(slopes).max((1, 2))
            if not precise.all():
                continue
            rows = (coefficients @ fit.derivatives).swapaxes(0, 1) / units[:, None]
            rows[:, :2] *= 2
            rows[:, 2:] *= 4
            residual = FilmDensity(specimen, 0.0, charged).material.residual
            return cls(middle[:, None], reach[:, None], rows, charged, float(residual))
        return None

    def stress(self, c: Array, voltage_squared: Any, thick: Any = None, *, tangent: bool = True
               ) -> tuple[Array, Any] | None:
        """Compute S [Pa] at C, (3, ..., points), and if wanted ∂S/∂E, (3, 3, ..., points).

        ``thick`` adds an energy of half this value over det C [Pa], (..., points). None where any C
        is outside the box, or the film wrinkles.
        """
        first, last, shear = c
        trace, area = first + last, first * last - shear * shear
        values = self._derivatives(trace, area, voltage_squared * self.charged, 5 if tangent else 2)
        if values is None or not self._tense(trace, area, values):
            return None
        if thick is not None:
            push = thick / (area * area)
            values[1] -= push
        across = cofactor(c)
        stress = values[1] * across
        stress[:2] += values[0]
        if not tangent:
            return stress, None
        if thick is not None:
            values[4] += 4 * push / area
        bend = (values[4] * across)[:, None] * across
        mixed = values[3] * across
        bend[:2] += mixed
        bend[:, :2] += mixed[:, None]
        bend[:2, :2] += values[2]
        add_across(bend, -values[1])
        return stress, bend

    def _derivatives(self, trace: Array, area: Array, charge: Any, count: int) -> Array | None:
        """Sum ``count`` rows of law and charge, (count, ..., points); None outside the box."""
        powers = np.ones((self.degree + 1, 2, trace.size))
        place = powers[1]
        place[0], place[1] = trace.ravel(), area.ravel()
        place -= self.middle
        place /= self.reach
        if not np.maximum.reduce(np.abs(place), None) <= 1:
            return None
        for number in range(1, self.degree):
            np.multiply(powers[number], place, powers[number + 1])
        terms = (powers[:, None, 0] * powers[:, 1]).reshape(-1, place.shape[1])
        law, charged = (self.rows[:, :count] @ terms).reshape(2, count, *trace.shape)
        charged *= charge
        charged += law
        return np.asarray(charged)

    def _tense(self, trace: Array, area: Array, values: Array) -> bool:
        """Check that both principal S, 2 W_I + 2 W_J λ² of the other stretch, exceed ``least``."""
        flat, across = values[0] - self.least, values[1]
        other = flat + across * trace
        if np.minimum.reduce(np.minimum(flat, other), None) > 0:
            return True
        both = np.minimum(flat * other + across * across * area, flat + other)
        return bool(np.minimum.reduce(both, None) > 0)

    @cached_property
    def degree(self) -> int:
        """Degree of the polynomials, in each variable."""
        return math.isqrt(self.rows.shape[2]) - 1


@dataclass(frozen=True, eq=False)
class _Fit:
    """Fit of a polynomial's coefficients to its slopes at nodes in (−1, 1)², the first ``count``.

    ``inverse`` (2 × count, coefficients) fits; ``checks`` are slopes at the other nodes,
    (coefficients, 2 × others); ``derivatives`` turn the polynomial's coefficients into those of its
    derivatives x, y, xx, xy, yy, (5, coefficients, coefficients).
    """

    nodes: Array
    count: int
    inverse: Array
    checks: Array
    derivatives: Array


@lru_cache
def _fit(degree: int) -> _Fit:
    along = np.diag(np.arange(1.0, degree + 1), -1)
    unit = np.eye(degree + 1)
    first, second = np.kron(along, unit), np.kron(unit, along)
    derivatives = np.stack([first, second, first @ first, first @ second, second @ second])
    grids = [_grid(degree + more) for more in (_NODES, _CHECKS)]
    slopes = [np.concatenate([part @ _powers(grid, degree) for part in derivatives[:2]], 1)
              for grid in grids]
    return _Fit(np.concatenate(grids), len(grids[0]), np.linalg.pinv(slopes[0]), slopes[1],
                derivatives)


def _grid(count: int) -> Array:
    """Pair Chebyshev's nodes, shape (count², 2)."""
    nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return np.stack(np.meshgrid(nodes, nodes), -1).reshape(-1, 2)


def _powers(places: Array, degree: int) -> Array:
    """Compute xⁱ yʲ at places, shape (coefficients, places)."""
    x, y = places.T[:, None] ** np.arange(degree + 1)[:, None]
    return np.asarray((x[:, None] * y).reshape(-1, len(places)))


def _slopes(energy: Any, trace: Array, determinant: Array) -> Array:
    """Compute W_I and W_J of an energy by principal stretches, nan if undefined, shape (2, ...)."""
    half = trace / 2
    radius = np.sqrt(half * half - determinant + 0j)
    first, second = np.sqrt(half + radius), np.sqrt(half - radius)
    with np.errstate(all="ignore"):
        _, w1, w2, *_ = energy.derivatives(first, second)
        by_first, by_second = w1 / (2 * first), w2 / (2 * second)
        across = (by_second - by_first) / (2 * radius)
        return np.real(np.stack([by_first - across * second**2, across]))
