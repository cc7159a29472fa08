"""A reduced model of one film: the force that holds its plate at a heave, as a polynomial.

Force over heave is a smooth function of the heave and of U², through pull-in and beyond, where the
heave is not one of the force. So equilibria, limit points included, are roots of the polynomial.
All forces scale with the film's stiffness once U² is divided by it, so that stiffness and
permittivity need no further solutions. The parameters of effects enter as polynomials of their own,
and in pairs (a truncated ANOVA decomposition; Rabitz, Aliş, J. Math. Chem. 25, 1999).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from tympan.studies.diagnosis.reduced.axes import Axis, Sample

Array = NDArray[np.float64]

#: Coordinates at which pairs of axes are sampled.
_CORNERS = (-0.6, 0.6)


@dataclass(frozen=True)
class Grid:
    """Chebyshev points up to a ``heave`` [m] and a ``voltage_squared`` [V²].

    An ``odd`` force (no weight, no gas) is sampled over the heave, as a function of its square.
    """

    heave: float
    voltage_squared: float
    odd: bool
    heaves: int = 5
    voltages: int = 6

    @cached_property
    def nodes(self) -> tuple[Array, Array]:
        """Heaves [m] and U² [V²]."""
        x, q = _points(self.heaves), _points(self.voltages)
        shares = (1 + x) / 2
        heaves = self.heave * (np.sqrt(shares) if self.odd else shares)
        return heaves, self.voltage_squared * (1 + q) / 2

    @property
    def coarse(self) -> Grid:
        """The grid for pairs of effects."""
        return replace(self, heaves=3, voltages=3)

    def at(self, sample: Sample) -> Grid:
        """The grid on which a sample is solved."""
        return self if len(sample) < 2 else self.coarse

    def of_heave(self, heave: Array) -> tuple[Array, Array]:
        """Chebyshev polynomials of heaves [m] and their derivatives by it, each (n, count)."""
        share = heave / self.heave
        x, rate = 2 * share - 1, np.full_like(share, 2 / self.heave)
        if self.odd:
            x, rate = 2 * share**2 - 1, 4 * share / self.heave
        values = _polynomials(x, self.heaves)
        return values, values @ _derivative(self.heaves) * rate[:, None]

    def of_voltage(self, voltage_squared: Array) -> Array:
        """Chebyshev polynomials of U² [V²], shape (n, count)."""
        return _polynomials(2 * voltage_squared / self.voltage_squared - 1, self.voltages)


def _polynomials(x: Array, count: int) -> Array:
    # NumPy's own function is five times slower on short arrays.
    values = np.ones((len(x), count))
    values[:, 1] = x
    for degree in range(2, count):
        values[:, degree] = 2 * x * values[:, degree - 1] - values[:, degree - 2]
    return values


def _points(count: int) -> Array:
    """Chebyshev points of the first kind, ascending."""
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


@lru_cache
def _derivative(count: int) -> Array:
    """D with T'(x) = T(x) D for the first Chebyshev polynomials."""
    matrix = np.zeros((count, count))
    matrix[: count - 1] = chebyshev.chebder(np.eye(count))
    return matrix


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """Polynomials in heave, U² and the coordinates of the axes.

    ``powers``: of the axes, shape (terms, axes); ``force``: coefficients of the force over the
    heave [N/m], or of the force [N], shape (terms, heaves, voltages); ``capacitance``: of the
    capacitance [F], the same.
    """

    grid: Grid
    axes: tuple[Axis, ...]
    powers: NDArray[np.int64]
    force: Array
    capacitance: Array

    def at(self, coordinates: Array) -> ForceSurface:
        """The law with the effects' coordinates given, shape (axes,)."""
        return _force_surface(self, tuple(coordinates.tolist()))


@dataclass(frozen=True, eq=False)
class ForceSurface:
    """A force law with everything but heave and U² given."""

    grid: Grid
    force_coefficients: Array
    capacitance_coefficients: Array

    def by_heave(self, voltage_squared: Array) -> Array:
        """Coefficients of the force by the heave's polynomials at U² [V²], shape (n, heaves)."""
        return np.asarray(self.grid.of_voltage(voltage_squared) @ self.force_coefficients.T)

    def force(self, heave: Array, by_heave: Array) -> tuple[Array, Array]:
        """Force [N] and stiffness [N/m] at heaves [m], shape (n,), from :meth:`by_heave`."""
        v, slope = self.grid.of_heave(heave)
        value, rate = (v * by_heave).sum(1), (slope * by_heave).sum(1)
        return (heave * value, value + heave * rate) if self.grid.odd else (value, rate)

    def capacitance(self, heave: Array, voltage_squared: Array) -> Array:
        """Capacitance [F] at heaves [m] and U² [V²]."""
        v, _ = self.grid.of_heave(heave)
        return np.asarray((v * (self.grid.of_voltage(voltage_squared)
                                @ self.capacitance_coefficients.T)).sum(1))


@lru_cache(maxsize=64)
def _force_surface(law: ForceLaw, coordinates: tuple[float, ...]) -> ForceSurface:
    """The law at some coordinates; kept, since most of what a fit varies is no axis."""
    at = np.array(coordinates)
    used = at != 0
    terms = np.flatnonzero(~law.powers[:, ~used].any(axis=1))
    weights = np.prod(at[used] ** law.powers[np.ix_(terms, used)], axis=1)
    force, capacitance = (
        (weights @ values.reshape(len(values), -1)[terms]).reshape(values.shape[1:])
        for values in (law.force, law.capacitance))
    return ForceSurface(law.grid, force, capacitance)


def samples(axes: tuple[Axis, ...]) -> list[Sample]:
    """Where to solve: the nominal film, each axis alone, each pair of axes."""
    places: list[Sample] = [()]
    for index, axis in enumerate(axes):
        places += [((index, at),) for at in axis.places]
    low, high = _CORNERS
    for first, second in combinations(range(len(axes)), 2):
        places.append(((first, high), (second, high)))
        if axes[first].two_sided:
            places.append(((first, low), (second, high)))
        elif axes[second].two_sided:
            places.append(((first, high), (second, low)))
    return places


def law_through(grid: Grid, axes: tuple[Axis, ...],
                solved: dict[Sample, tuple[Array, Array]]) -> ForceLaw:
    """The law through force and capacitance at samples, of pairs at the coarse grid's nodes.

    Values are nan where a film could not be solved. The nominal film's are continued along the
    voltage there, those of one axis along it, so that they bend nothing where there are some;
    of pairs, what they add is continued.
    """
    powers = _powers(axes)
    coordinates = np.zeros((len(solved), len(axes)))
    for row, sample in enumerate(solved):
        for index, at in sample:
            coordinates[row, index] = at
    design = np.prod(coordinates[:, None, :] ** powers, axis=2)
    single = np.array([len(sample) < 2 for sample in solved])
    alone = (powers > 0).sum(1) < 2
    over = {sample: force / grid.at(sample).nodes[0][:, None] if grid.odd else force
            for sample, (force, _) in solved.items()}
    coefficients = []
    for values in (over, {sample: capacitance for sample, (_, capacitance) in solved.items()}):
        completed = _along_axes(grid, {sample: item for sample, item in values.items()
                                       if len(sample) < 2})
        full = np.zeros((len(powers), grid.heaves * grid.voltages))
        full[alone] = np.linalg.lstsq(design[np.ix_(single, alone)], _flat(grid, completed),
                                      rcond=None)[0]
        if not single.all():
            expected = _on_coarse(grid, design[np.ix_(~single, alone)] @ full[alone])
            pairs = [item for sample, item in values.items() if len(sample) == 2]
            added = [_along_voltage(grid.coarse, item - sums)
                     for item, sums in zip(pairs, expected, strict=True)]
            full[~alone] = np.linalg.lstsq(design[np.ix_(~single, ~alone)], _flat(grid, added),
                                           rcond=None)[0]
        coefficients.append(full.reshape(len(powers), grid.heaves, grid.voltages))
    return ForceLaw(grid, axes, powers, *coefficients)


def _along_axes(grid: Grid, values: dict[Sample, Array]) -> list[Array]:
    """Values of the nominal film and single axes, completed by polynomials along the axes."""
    nominal = _along_voltage(grid, values[()])
    completed = []
    for sample, item in values.items():
        item = item.copy() if sample else nominal.copy()
        for node in map(tuple, np.argwhere(np.isnan(item))):
            (axis, at), = sample
            solved = {0.0: nominal[node]} | {
                other[0][1]: value[node] for other, value in values.items()
                if other and other[0][0] == axis and np.isfinite(value[node])}
            line = np.polyfit(list(solved), list(solved.values()), len(solved) - 1)
            item[node] = np.polyval(line, at)
        completed.append(item)
    return completed


def _along_voltage(grid: Grid, values: Array) -> Array:
    """Values continued beyond the last voltage that has one.

    A parabola through the last three, a line through two.
    """
    voltages_squared, values = grid.nodes[1], values.copy()
    for row in values:
        have = int(np.isfinite(row).sum())
        if have < len(row):
            degree = min(2, have - 1)
            last = slice(have - 1 - degree, have)
            unit = voltages_squared[have - 1]
            row[have:] = np.polyval(np.polyfit(voltages_squared[last] / unit, row[last], degree),
                                    voltages_squared[have:] / unit)
    return values


def _powers(axes: tuple[Axis, ...]) -> NDArray[np.int64]:
    """Powers of the axes in each term: each alone, and products of two."""
    unit = np.eye(len(axes), dtype=np.int64)
    rows = [np.zeros(len(axes), dtype=np.int64)]
    for index, axis in enumerate(axes):
        rows += [unit[index] * power for power in range(1, 1 + len(axis.places))]
    rows += [unit[first] + unit[second] for first, second in combinations(range(len(axes)), 2)]
    return np.array(rows).reshape(len(rows), len(axes))


def _flat(grid: Grid, values: list[Array]) -> Array:
    """Chebyshev coefficients of values at either grid's nodes, shape (count, heaves · voltages)."""
    full = np.zeros((len(values), grid.heaves, grid.voltages))
    for row, item in zip(full, values, strict=True):
        v, q = (np.linalg.inv(chebyshev.chebvander(_points(n), n - 1)) for n in item.shape)
        row[: item.shape[0], : item.shape[1]] = v @ item @ q.T
    return full.reshape(len(values), -1)


def _on_coarse(grid: Grid, flat: Array) -> Array:
    """Values of the fine polynomials at the coarse nodes, shape (count, heaves, voltages)."""
    coarse = grid.coarse
    v, q = (chebyshev.chebvander(_points(few), many - 1)
            for few, many in ((coarse.heaves, grid.heaves), (coarse.voltages, grid.voltages)))
    return np.asarray(np.einsum("ai,bj,tij->tab", v, q,
                                flat.reshape(len(flat), grid.heaves, grid.voltages)))
