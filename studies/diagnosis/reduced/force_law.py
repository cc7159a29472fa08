"""A reduced model of one film: the force that holds its plate, smooth over deflection and U².

The force is a smooth function of deflection and U² through pull-in and beyond, where the deflection
is no function of the force. So equilibria, limit points included, are roots of a polynomial. All
forces scale with the film's stiffness once U² is divided by it, so that stiffness and permittivity
need no further solutions. Changes by effects are smoother still, and sampled at fewer deflections
and U². Along one effect's parameter they are interpolated rationally between the sizes sampled,
which may be as large as the film bears. Joint changes by several parameters are added (a truncated
ANOVA decomposition; Rabitz, Aliş, J. Math. Chem. 25, 1999).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.polynomial import chebyshev

from tympan.base.arrays import Array, Numbers
from tympan.studies.diagnosis.reduced.axes import Axis, HeldFilm, Sample
from tympan.studies.diagnosis.reduced.segment_voltages import segment_voltages

#: Indices of the nominal film's nodes by deflection that serve effects, whose changes are smooth.
_SOME_HEAVES = np.array([0, 2, 4])
#: Indices of its nodes by U² that serve effects.
_SOME_VOLTAGES = np.array([0, 2, 3, 5])

#: Largest degree of the polynomials that Floater's and Hormann's interpolant blends.
_DEGREE = 4

#: Ratio between successive largest deflections or U² to which grids are rounded.
_STEP = 1.15

#: Share beyond its largest deflection and U² up to which a force law is valid. Further out it is
#: continued by a line.
BEYOND = 0.15
#: Distance from that U² at which the slope of the line is taken, as a share.
_NEAR = 1e-4

#: Index of the force [N] among the values sampled at a node.
FORCE = 0
#: Index of the capacitance [F].
CAPACITANCE = 1
#: Index of the square of the plate's tilt [rad²].
TILT = 2

#: Indices of the plate's slopes along x and y.
SLOPES = (3, 4)
#: Index of the capacitance of the first of several segments [F]; the others follow. Where there is
#: one electrode, displacements of a film's lattice may begin here, component by component.
SEGMENTS = 5


@dataclass(frozen=True)
class Grid:
    """Chebyshev points up to a ``deflection`` [m] and a ``voltage_squared`` [V²].

    An ``odd`` force (without weight and gas) is sampled over the deflection, as a function of its
    square. With ``some`` not all of the points are nodes. Several ``segments`` have a U² each, up
    to ``voltage_squared``; U² then has the shape (n, segments) instead of (n,).
    """

    deflection: float
    voltage_squared: float
    odd: bool
    deflections: int = 5
    voltages: int = 6
    some: bool = False
    segments: int = 1

    @property
    def numbers(self) -> tuple[Numbers, Numbers]:
        """Indices of the points that are nodes, by deflection and by U²."""
        rows = _SOME_HEAVES if self.some else np.arange(self.deflections)
        if self.segments > 1:
            several = segment_voltages(self.segments)
            return rows, several.few if self.some else np.arange(len(several.nodes))
        return rows, _SOME_VOLTAGES if self.some else np.arange(self.voltages)

    @property
    def first_of_shape(self) -> int:
        """First index of displacements of a film's lattice, where they are sampled."""
        return SEGMENTS + (self.segments if self.segments > 1 else 0)

    @cached_property
    def nodes(self) -> tuple[Array, Array]:
        """Deflections [m] and U² [V²] of the nodes."""
        rows, columns = self.numbers
        shares = (1 + _points(self.deflections)[rows]) / 2
        squares = (segment_voltages(self.segments).nodes if self.segments > 1
                   else (1 + _points(self.voltages)) / 2)
        deflections = self.deflection * (np.sqrt(shares) if self.odd else shares)
        return deflections, self.voltage_squared * squares[columns]

    @property
    def degrees(self) -> Numbers:
        """Total degree of each of the polynomials of :meth:`of_voltage`."""
        if self.segments > 1:
            return np.asarray(segment_voltages(self.segments).powers.sum(1))
        return np.arange(self.voltages)

    @property
    def highest(self) -> Array:
        """Highest U² of each node [V²], of all segments, shape (voltages,)."""
        squares = self.nodes[1]
        return np.asarray(squares if squares.ndim == 1 else squares.max(1))

    @property
    def coarse(self) -> Grid:
        """The grid with only the nodes at which changes by effects are sampled."""
        return replace(self, some=True)

    @property
    def rounded(self) -> Grid:
        """A grid up to 15 % larger, the same for readings that are nearly the same."""
        return replace(self, deflection=_rounded(self.deflection),
                       voltage_squared=_rounded(self.voltage_squared))

    def coefficients(self, values: Array) -> Array:
        """Compute Chebyshev coefficients of nodal values, shape (..., deflections, voltages)."""
        numbers, squares = self.numbers[0], self.nodes[1]
        rows = np.linalg.inv(_polynomials(_points(self.deflections)[numbers], len(numbers)))
        columns = self.of_voltage(squares)
        full = np.zeros((*values.shape[:-2], self.deflections, columns.shape[1]))
        columns = np.asarray(np.linalg.inv(columns[:, : len(squares)]))
        full[..., : len(rows), : len(columns)] = rows @ values @ columns.T
        return full

    def of_deflection(self, deflection: Array) -> tuple[Array, Array]:
        """Evaluate Chebyshev polynomials of deflections [m] and derivatives, each (n, count)."""
        share = deflection / self.deflection
        x, rate = 2 * share - 1, np.full_like(share, 2 / self.deflection)
        if self.odd:
            x, rate = 2 * share**2 - 1, 4 * share / self.deflection
        values = _polynomials(x, self.deflections)
        return values, values @ _derivative(self.deflections) * rate[:, None]

    def values(self, coefficients: Array, other: Grid) -> Array:
        """Evaluate polynomials at the nodes of another grid."""
        deflections, voltages_squared = other.nodes
        in_deflection, _ = self.of_deflection(deflections)
        return in_deflection @ coefficients @ self.of_voltage(voltages_squared).T

    def of_voltage(self, voltage_squared: Array) -> Array:
        """Evaluate the polynomials of U² [V²], shape (n, count)."""
        if self.segments > 1:
            return segment_voltages(self.segments).terms(voltage_squared / self.voltage_squared)
        return _polynomials(2 * voltage_squared / self.voltage_squared - 1, self.voltages)


class Solver(Protocol):
    """Solver of films with their plates held.

    Results have the shape (5, deflections, voltages) of a grid's nodes: force [N], capacitance [F],
    squared tilt [rad²], slopes of the plate along x and y; nan where there is none. Capacitances of
    several segments [F] follow, then maybe displacements [m] of a
    :class:`~tympan.studies.diagnosis.reduced.film_shape.Lattice`.
    """

    def stored(self, film: HeldFilm, grid: Grid) -> Array | None:
        """Look up values that are known already."""

    def solved(self, film: HeldFilm, grid: Grid, near: Sequence[HeldFilm]) -> Array:
        """Solve at the nodes, from films ``near`` that have been solved, the nearest last.

        An ArithmeticError where too few nodes have a solution.
        """


def _polynomials(x: Array, count: int) -> Array:
    # NumPy's own function is five times slower on short arrays.
    values = np.ones((len(x), count))
    values[:, 1] = x
    for degree in range(2, count):
        values[:, degree] = 2 * x * values[:, degree - 1] - values[:, degree - 2]
    return values


def _points(count: int) -> Array:
    """Compute Chebyshev points of the first kind, ascending."""
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


@lru_cache
def _derivative(count: int) -> Array:
    """Compute D with T'(x) = T(x) D for the first Chebyshev polynomials."""
    matrix = np.zeros((count, count))
    matrix[: count - 1] = chebyshev.chebder(np.eye(count))
    return matrix


def _rounded(value: float) -> float:
    return float(_STEP ** np.ceil(np.log(value) / np.log(_STEP) - 1e-9))


@dataclass(frozen=True, eq=False)
class SampledForce:
    """Values of a film at the nodes of a grid, as a :class:`Solver` gives them."""

    grid: Grid
    values: Array

    def coefficients(self, grid: Grid, less: Array | None = None) -> Array:
        """Compute coefficients of polynomials on a grid, minus those of ``less``.

        Values that are odd in the deflection are divided by it first.
        """
        values = self.values.copy()
        if self.grid.odd:
            values[odd_values(self.grid, len(values))] /= self.grid.nodes[0][:, None]
        if less is not None:
            values -= grid.values(less, self.grid)
        full = replace(grid, some=False)
        return full.coefficients(self.grid.values(self.grid.coefficients(values), full))


def odd_values(grid: Grid, count: int) -> Numbers:
    """List the indices of the values, of ``count``, that change sign with the deflection."""
    first = grid.first_of_shape
    deflections = np.arange(first + 2 * (count - first) // 3, count)
    return np.asarray(np.r_[FORCE, SLOPES, deflections])


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """Force of a film at a deflection, a U² and sizes of the effects that change it.

    ``samples`` are films solved, the one without effects on the law's own grid. ``solver`` solved
    them and solves more.
    """

    solver: Solver
    grid: Grid
    axes: tuple[Axis, ...]
    samples: Mapping[Sample, SampledForce]

    def at(self, sizes: Array) -> ForceSurface:
        """Evaluate the law at sizes of the axes' parameters on the nominal film, shape (axes,)."""
        return _force_surface(self, tuple(sizes.tolist()))

    @cached_property
    def nominal(self) -> Array:
        """Coefficients of the film without effects, shape (values, deflections, voltages)."""
        return self.samples[()].coefficients(self.grid)

    @cached_property
    def terms(self) -> Mapping[tuple[int, ...], ForceTerm]:
        """Terms that are added to the nominal film, by the axes that they depend on."""
        groups: dict[tuple[int, ...], list[Sample]] = {}
        for sample in sorted(self.samples, key=len):
            if sample:
                groups.setdefault(tuple(number for number, _ in sample), []).append(sample)
        terms: dict[tuple[int, ...], ForceTerm] = {}
        for group, members in groups.items():
            terms[group] = self._term(group, members, terms)
        return terms

    def _term(self, group: tuple[int, ...], members: list[Sample],
              lower: Mapping[tuple[int, ...], ForceTerm]) -> ForceTerm:
        at = np.array([[self.axes[number].coordinate(size) for number, size in sample]
                       for sample in members])
        # What fewer effects add is subtracted at the nodes: what is left may have only few of them.
        known = [self.nominal + _sum_of(lower, dict(zip(group, coordinates, strict=True)))
                 for coordinates in at.tolist()]
        added = np.array([self.samples[sample].coefficients(self.grid, less)
                          for sample, less in zip(members, known, strict=True)])
        return ForceTerm(group, at, added)

    def with_samples(self, axes: tuple[Axis, ...], more: Mapping[Sample, SampledForce]) -> ForceLaw:
        """Add samples to the law; drop those no longer at places of the axes."""
        kept = {sample: values for sample, values in {**self.samples, **more}.items()
                if len(sample) != 1 or sample[0][1] in axes[sample[0][0]].places}
        return replace(self, axes=axes, samples=kept)


@dataclass(frozen=True, eq=False)
class ForceTerm:
    """Term that depends on all axes of a ``group`` together, through samples.

    ``at`` are their coordinates, shape (samples, axes); ``added`` are coefficients there, shape
    (samples, values, deflections, voltages).
    """

    group: tuple[int, ...]
    at: Array
    added: Array

    def value(self, coordinates: Sequence[float]) -> Array:
        """Interpolate the coefficients, shape (values, deflections, voltages)."""
        at = np.asarray(coordinates)
        weights = self._along(float(at[0])) if len(self.group) == 1 else self._among(at)
        return np.tensordot(weights, self.added, 1)

    @cached_property
    def _rule(self) -> tuple[Array, Array]:
        """Coordinates of the samples of one axis with 0, and their barycentric weights."""
        nodes = np.append(0.0, self.at[:, 0])
        weights = np.empty(len(nodes))
        order = np.argsort(nodes)
        weights[order] = _floater_hormann(nodes[order])
        return nodes, weights

    def _along(self, at: float) -> Array:
        """Compute weights of the samples of one axis; beyond the last ones along straight lines."""
        nodes, weights = self._rule
        end = float(np.clip(at, nodes.min(), nodes.max()))
        values = _cardinal(nodes, weights, end)
        if end != at:
            values = values + (at - end) * _slopes(nodes, weights, end)
        return values[1:]

    def _among(self, at: Array) -> Array:
        """Compute weights of the samples of several axes.

        The weight is the product of the coordinates over the sample's own; near samples count most
        (Shepard).
        """
        apart = ((np.arcsinh(self.at) - np.arcsinh(at)) ** 2).sum(1)
        apart = apart / apart.max(initial=1e-300)
        near = np.array([np.prod(np.delete(apart, k)) for k in range(len(apart))])
        return np.asarray(near / near.sum() * np.prod(at / self.at, axis=1))


def _floater_hormann(nodes: Array) -> Array:
    """Compute barycentric weights of Floater's and Hormann's interpolant, nodes ascending.

    It is rational without poles, through all nodes, and a polynomial if they are few (Numer. Math.
    107, 2007).
    """
    last, degree = len(nodes) - 1, min(len(nodes) - 1, _DEGREE)
    unit = (nodes[-1] - nodes[0]) / 4
    weights = np.zeros(len(nodes))
    for first in range(last - degree + 1):
        blended = range(first, first + degree + 1)
        for number in blended:
            others = np.array([nodes[other] for other in blended if other != number])
            weights[number] += (-1) ** first / np.prod((nodes[number] - others) / unit)
    return weights


def _cardinal(nodes: Array, weights: Array, at: float) -> Array:
    """Compute the weight of each node's value at a place."""
    apart = at - nodes
    # So close to a node its share would overflow.
    if (hit := np.abs(apart) <= np.finfo(float).eps * np.ptp(nodes)).any():
        return np.asarray(hit, float)
    shares = weights / apart
    return np.asarray(shares / shares.sum())


def _slopes(nodes: Array, weights: Array, at: float) -> Array:
    """Differentiate the cardinal functions at a node."""
    here = int(np.flatnonzero(nodes == at)[0])
    slopes = np.zeros(len(nodes))
    others = np.arange(len(nodes)) != here
    slopes[others] = weights[others] / weights[here] / (at - nodes[others])
    slopes[here] = -slopes.sum()
    return slopes


@dataclass(frozen=True, eq=False)
class ForceSurface:
    """A force law in which everything but deflection and U² is given."""

    grid: Grid
    coefficients: Array

    def by_deflection(self, voltage_squared: Array) -> Array:
        """Compute the force's coefficients by polynomials of deflection at U² [V²], (n, powers)."""
        return np.asarray(self.grid.of_voltage(voltage_squared) @ self.coefficients[FORCE].T)

    def force(self, deflection: Array, by_deflection: Array) -> tuple[Array, Array]:
        """Compute force [N] and stiffness [N/m] at deflections [m], (n,).

        ``by_deflection``: coefficients by :meth:`by_deflection`.
        """
        v, slope = self.grid.of_deflection(deflection)
        value, rate = (v * by_deflection).sum(1), (slope * by_deflection).sum(1)
        return (deflection * value, value + deflection * rate) if self.grid.odd else (value, rate)

    @property
    def uncharged(self) -> Array:
        """U² of one state without voltage [V²]."""
        return np.zeros((1, self.grid.segments) if self.grid.segments > 1 else 1)

    @property
    def flat_stiffness(self) -> float:
        """Stiffness of the flat film without voltage [N/m]."""
        return float(self.force(np.zeros(1), self.by_deflection(self.uncharged))[1][0])

    def capacitance(self, deflection: Array, voltage_squared: Array) -> Array:
        """Compute the capacitance of all electrodes [F] at deflections [m] and U² [V²]."""
        return self._value(CAPACITANCE, deflection, voltage_squared)

    def of_segment(self, number: int, deflection: Array, voltage_squared: Array) -> Array:
        """Compute the capacitance of one segment [F] at deflections [m] and U² [V²]."""
        several = self.grid.segments > 1
        return self._value(SEGMENTS + number if several else CAPACITANCE, deflection,
                           voltage_squared)

    def slope(self, axis: int, deflection: Array, voltage_squared: Array) -> Array:
        """Compute the plate's slope along x (0) or y (1) at deflections [m] and U² [V²]."""
        slope = self._value(SLOPES[axis], deflection, voltage_squared)
        return deflection * slope if self.grid.odd else slope

    def tilt_squared(self, deflection: Array, voltage_squared: Array) -> Array:
        """Compute the square of the angle between the plate's normal and the load [rad²].

        It depends on deflections [m] and U² [V²]; interpolation may make it slightly negative.
        """
        return self._value(TILT, deflection, voltage_squared)

    def shape(self, deflection: float, voltage_squared: float | tuple[float, ...]) -> Array:
        """Compute the lattice's displacements [m] at a deflection [m], a U² [V²], (3, points)."""
        v, _ = self.grid.of_deflection(np.array([deflection]))
        u = self.grid.of_voltage(np.array([voltage_squared]))
        shape = self.coefficients[self.grid.first_of_shape:]
        values = np.asarray(v[0] @ (shape @ u[0]).T).reshape(3, -1)
        if self.grid.odd:
            values[2] *= deflection
        return values

    def _value(self, which: int, deflection: Array, voltage_squared: Array) -> Array:
        v, _ = self.grid.of_deflection(deflection)
        return np.asarray((v * (self.grid.of_voltage(voltage_squared)
                                @ self.coefficients[which].T)).sum(1))


@lru_cache(maxsize=64)
def _force_surface(law: ForceLaw, sizes: tuple[float, ...]) -> ForceSurface:
    """Evaluate the law once for sizes, since most of the unknowns of a fit are no axes."""
    coordinates = {number: law.axes[number].coordinate(size)
                   for number, size in enumerate(sizes) if size != 0}
    return ForceSurface(law.grid, law.nominal + _sum_of(law.terms, coordinates))


def _sum_of(terms: Mapping[tuple[int, ...], ForceTerm], coordinates: Mapping[int, float]
            ) -> Array | float:
    """Sum all terms of some axes and their groups, coordinates by number ascending."""
    groups = (group for count in range(1, len(coordinates) + 1)
              for group in combinations(coordinates, count) if group in terms)
    return sum((terms[group].value([coordinates[number] for number in group])
                for group in groups), 0.0)


@lru_cache
def in_powers(count: int) -> Array:
    """Write Chebyshev polynomials by powers, shape (polynomials, powers)."""
    return np.stack([np.pad(chebyshev.cheb2poly(row), (0, count - 1 - degree))
                     for degree, row in enumerate(np.eye(count))])


def continued(surface: ForceSurface, voltage_squared: Array) -> Array:
    """Compute the force's coefficients by the deflection's polynomials, linear in high U²."""
    top = (1 + BEYOND) * surface.grid.voltage_squared
    highest = voltage_squared if voltage_squared.ndim == 1 else voltage_squared.max(1)
    share = np.maximum(highest / top, 1.0)
    within = voltage_squared / (share if voltage_squared.ndim == 1 else share[:, None])
    coefficients = surface.by_deflection(within)
    if np.all(share <= 1):
        return coefficients
    before = surface.by_deflection((1 - _NEAR) * within)
    return np.asarray(coefficients + ((share - 1) / _NEAR)[:, None] * (coefficients - before))
