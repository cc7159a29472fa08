"""A reduced model of one film: the force that holds its plate at a heave, as a polynomial.

Force over heave is a smooth function of the heave and of U², through pull-in and beyond, where the
heave is not one of the force. So equilibria, limit points included, are roots of the polynomial.
All forces scale with the film's stiffness once U² is divided by it, so that stiffness and
permittivity need no further solutions. The parameters of effects enter as polynomials of their own,
and in pairs (a truncated ANOVA decomposition; Rabitz, Aliş, J. Math. Chem. 25, 1999).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from tympan.studies.diagnosis.reduced.axes import Axis

Array = NDArray[np.float64]

#: Coordinates at which an axis is sampled besides 0.
TWO_SIDED, ONE_SIDED = (-1.0, -0.5, -0.25, 0.25, 0.5, 1.0), (0.3, 0.65, 1.0)
#: The same for pairs of axes.
CORNERS = (-0.6, 0.6)


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
        return self.heave * (np.sqrt(shares) if self.odd
                             else shares), self.voltage_squared * (1 + q) / 2

    def coarse(self) -> Grid:
        """The grid for pairs of effects."""
        return Grid(self.heave, self.voltage_squared, self.odd, 3, 3)

    def coefficients(self, values: Array) -> Array:
        """Chebyshev coefficients of what has these values at the nodes, (heaves, voltages)."""
        v, q = (np.linalg.inv(chebyshev.chebvander(_points(n), n - 1)) for n in values.shape)
        return np.asarray(v @ values @ q.T)

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
    """The first Chebyshev polynomials, shape (n, count).

    NumPy's own function is five times slower on short arrays.
    """
    values = np.empty((len(x), count))
    values[:, 0] = 1.0
    for degree in range(1, count):
        values[:, degree] = x if degree == 1 else 2 * x * values[:, degree - 1] - values[:,
                                                                                         degree - 2]
    return values


def _points(count: int) -> Array:
    """Chebyshev points of the first kind, ascending."""
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


@lru_cache
def _derivative(count: int) -> Array:
    """Matrix D with T'(x) = T(x) D for the first Chebyshev polynomials."""
    matrix = np.zeros((count, count))
    for column in range(1, count):
        slope = chebyshev.chebder(np.eye(count)[column])
        matrix[: len(slope), column] = slope
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
    force, capacitance = ((weights @ values.reshape(len(values),
                                                    -1)[terms]).reshape(values.shape[1:])
                          for values in (law.force, law.capacitance))
    return ForceSurface(law.grid, force, capacitance)


@dataclass(frozen=True)
class Sample:
    """Where on the axes a film is solved: coordinates of some axes, the others 0."""

    axes: tuple[int, ...]
    at: tuple[float, ...]

    def coordinates(self, count: int) -> Array:
        """Of all axes."""
        full = np.zeros(count)
        full[list(self.axes)] = self.at
        return full


def samples(axes: tuple[Axis, ...]) -> list[Sample]:
    """Where to solve: the nominal film, each axis alone, each pair of axes."""
    found = [Sample((), ())]
    for index, axis in enumerate(axes):
        found += [Sample((index,), (at,)) for at in (TWO_SIDED if axis.two_sided else ONE_SIDED)]
    for one, two in combinations(range(len(axes)), 2):
        high = CORNERS[1]
        found.append(Sample((one, two), (high, high)))
        if axes[one].two_sided:
            found.append(Sample((one, two), (-high, high)))
        elif axes[two].two_sided:
            found.append(Sample((one, two), (high, -high)))
    return found


def law_through(grid: Grid, axes: tuple[Axis, ...], where: list[Sample], force: list[Array],
           capacitance: list[Array]
           ) -> ForceLaw:
    """The law through samples at the nodes of the grid, of pairs at those of the coarse one.

    Values are nan where a film could not be solved. The nominal film's are continued along the
    voltage there, those of one axis along it, so that they bend nothing where there are some;
    of pairs, what they add is continued.
    """
    powers = _powers(axes)
    over = [values / grid_of(grid, sample).nodes[0][:, None] if grid.odd else values
            for sample, values in zip(where, force, strict=True)]
    design = np.stack([np.prod(sample.coordinates(len(axes))[None, :] ** powers, axis=1)
                       for sample in where])
    single = np.array([len(sample.axes) < 2 for sample in where])
    own = (powers > 0).sum(1) < 2
    coefficients = []
    for values in (over, capacitance):
        ones = [one for one, alone in zip(where, single, strict=True) if alone]
        known = _along_axes(grid, ones,
                            [item for item, alone in zip(values, single, strict=True) if alone])
        flat = np.stack([_padded(grid, item) for item in known]).reshape(len(known), -1)
        full = np.zeros((len(powers), flat.shape[1]))
        full[own] = np.linalg.lstsq(design[np.ix_(single, own)], flat, rcond=None)[0]
        if not single.all():
            expected = _on_coarse(grid, design[np.ix_(~single, own)] @ full[own])
            pairs = [item for item, alone in zip(values, single, strict=True) if not alone]
            added = [_along_voltage(grid.coarse(), item - sums)
                     for item, sums in zip(pairs, expected, strict=True)]
            rest = np.stack([_padded(grid, item) for item in added]).reshape(len(added), -1)
            full[~own] = np.linalg.lstsq(design[np.ix_(~single, ~own)], rest, rcond=None)[0]
        coefficients.append(full.reshape(len(powers), grid.heaves, grid.voltages))
    return ForceLaw(grid, axes, powers, coefficients[0], coefficients[1])


def _along_axes(grid: Grid, where: list[Sample], values: list[Array]) -> list[Array]:
    """Values of the nominal film and single axes, completed by polynomials along the axes."""
    nominal = next(_along_voltage(grid, item) for sample, item in zip(where, values, strict=True)
                   if not sample.axes)
    found = []
    for sample, item in zip(where, values, strict=True):
        item = nominal.copy() if not sample.axes else item.copy()
        for node in np.argwhere(np.isnan(item)):
            place = tuple(node)
            known = {0.0: nominal[place]} | {other.at[0]: values[number][place]
                                             for number, other in enumerate(where)
                                             if other.axes == sample.axes
                                             and np.isfinite(values[number][place])}
            item[place] = np.polyval(np.polyfit(list(known), list(known.values()), len(known) - 1),
                                     sample.at[0])
        found.append(item)
    return found


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


def grid_of(grid: Grid, sample: Sample) -> Grid:
    """The grid on which a sample is solved."""
    return grid if len(sample.axes) < 2 else grid.coarse()


def _powers(axes: tuple[Axis, ...]) -> NDArray[np.int64]:
    """Powers of the axes in each term: each alone, and products of two."""
    unit = np.eye(len(axes), dtype=np.int64)
    rows = [np.zeros(len(axes), dtype=np.int64)]
    for index, axis in enumerate(axes):
        rows += [unit[index] * power
                 for power in range(1, 1 + len(TWO_SIDED if axis.two_sided else ONE_SIDED))]
    rows += [unit[one] + unit[two] for one, two in combinations(range(len(axes)), 2)]
    return np.array(rows).reshape(len(rows), len(axes))


def _padded(grid: Grid, values: Array) -> Array:
    """Coefficients on the fine grid."""
    found = grid.coefficients(values)
    wanted = zip((grid.heaves, grid.voltages), found.shape, strict=True)
    return np.pad(found, [(0, full - have) for full, have in wanted])


def _on_coarse(grid: Grid, flat: Array) -> Array:
    """Values at the coarse nodes of the fine grid's polynomials, shape (count, heaves, voltages)."""
    coarse = grid.coarse()
    v, q = (chebyshev.chebvander(_points(few), many - 1)
            for few, many in ((coarse.heaves, grid.heaves), (coarse.voltages, grid.voltages)))
    return np.asarray(np.einsum("ai,bj,tij->tab", v, q,
                                flat.reshape(len(flat), grid.heaves, grid.voltages)))
