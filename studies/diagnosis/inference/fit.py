"""The most probable unknowns of a hypothesis, and its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tympan.studies.diagnosis.reading_table import Table
from tympan.studies.diagnosis.reduced.simulation import Hypothesis, Simulation, bounds_of, sizes_of
from tympan.studies.estimation.least_squares import LeastSquares, Point, Unreachable, minimise

Array = NDArray[np.float64]

#: What is known beforehand of the logarithms of the factors on stiffness and permittivity, as
#: standard deviations: sources on one tape differ by a factor of 1.7 in stiffness, and from 2.6 to
#: 4.7 in permittivity.
NUISANCE = np.array([0.5, 0.4])

_ITERATIONS, _SMALL = 40, 1e-4
_NODES = 24

#: Starts for the logarithms of stiffness and permittivity when the nominal model has no equilibria.
_STARTS = ((0.0, 0.0), (0.4, 0.0), (0.8, 0.0), (1.5, 0.0), (0.0, -0.5), (0.0, -1.5), (-0.7, -0.7),
           (2.5, 0.0))


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis fitted to a table.

    ``residual``: readings minus predictions over their noise, shape (rows,); ``jacobian``:
    derivatives of the predictions over the noise by the unknowns; ``precision``: second derivatives
    of the cost with the priors, by which the unknowns are about normal; ``cost``: minus the
    logarithm of posterior density, up to what all hypotheses share; ``evidence``: logarithm of the
    probability of the readings, up to the same. ``found`` is False where no unknowns make a state
    of equilibrium of every state that was read.
    """

    hypothesis: Hypothesis
    unknowns: Array
    bounds: Array
    residual: Array
    jacobian: Array
    precision: Array
    cost: float
    evidence: float
    heave: Array
    found: bool = True

    @property
    def chi_squared(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns."""
        return np.sqrt(np.diag(np.linalg.inv(self.precision)))


def prior_widths(hypothesis: Hypothesis, widen: float = 1.0) -> Array:
    """Standard deviations of the unknowns beforehand."""
    own = [widen * item.deviation for cause in hypothesis for item in cause.of_registry.parameters]
    return np.concatenate([NUISANCE, own])


def fit(simulation: Simulation, hypothesis: Hypothesis, table: Table, start: Array | None = None,
        widen: float = 1.0
        ) -> Fit:
    """Fit a hypothesis to readings, from sizes at none and, where a sign changes nothing, from the prior's width.

    Parameters
    ----------
    start
        Unknowns to start from; those of the nominal hypothesis serve all others.
    widen
        Factor on the widths of the effects' priors.
    """
    count = 2 + sizes_of(hypothesis)
    first = np.zeros(count)
    if start is not None:
        first[: min(len(start), count)] = start[:count]
    bounds = bounds_of(simulation, hypothesis)
    starts = [np.clip(first, *bounds)]
    even = np.array([item.sign == "even" for cause in hypothesis
                     for item in cause.of_registry.parameters], bool)
    if even.any() and (start is None or len(start) < count):
        width = prior_widths(hypothesis, widen)[2:]
        starts = [np.clip(first + np.r_[0.0, 0.0, np.where(even, size * width, 0.0)], *bounds)
                  for size in (0.5, 2.0)]
    fits = [_descend(simulation, hypothesis, table, one, bounds, widen) for one in starts]
    return max(fits, key=lambda one: (one.found, one.evidence))


def nominal_fit(simulation: Simulation, table: Table) -> Fit:
    """The nominal model fitted, from the first start that has equilibria everywhere."""
    found = fit(simulation, (), table)
    for start in _STARTS[1:]:
        if found.found:
            break
        found = fit(simulation, (), table, np.array(start))
    return found


def _descend(simulation: Simulation, hypothesis: Hypothesis, table: Table, start: Array,
             bounds: Array, widen: float
             ) -> Fit:
    """The minimum from a start, and the evidence by the curvature there."""

    def evaluate(unknowns: Array, near: Point | None) -> Point:
        heave = simulation.heaves(hypothesis, unknowns, table.states,
                                  None if near is None else near.state)
        values = simulation.values(hypothesis, unknowns, table, heave)
        return Point((table.value - values) / table.sigma,
                     lambda: -simulation.jacobian(hypothesis, unknowns, table, heave,
                                                  bounds) / table.sigma[:, None], heave)

    problem = LeastSquares(evaluate, bounds[0], bounds[1],
                           prior=prior_widths(hypothesis, widen) ** -2.0)
    try:
        minimum = minimise(problem, start, quick=_SMALL, iterations=_ITERATIONS)
    except Unreachable:
        return _lost(hypothesis, start, bounds, table,
                     simulation.heaves(hypothesis, start, table.states))
    unknowns, point = minimum.unknowns, minimum.point
    precision, slope = problem.curvature(point), problem.slope(unknowns, point)
    evidence = -minimum.cost + _log_mass(hypothesis, unknowns, precision, slope, bounds, widen)
    return Fit(hypothesis, unknowns, bounds, point.residual, -point.jacobian, precision,
               minimum.cost, evidence, point.state)


def _lost(hypothesis: Hypothesis, unknowns: Array, bounds: Array, table: Table,
          heave: Array) -> Fit:
    """A hypothesis that cannot be at the states that were read."""
    count = len(unknowns)
    return Fit(hypothesis, unknowns, bounds, np.full(len(table), np.inf),
               np.zeros((len(table), count)), np.eye(count),
               np.inf, -np.inf, heave, found=False)


def _log_mass(hypothesis: Hypothesis, unknowns: Array, precision: Array, slope: Array,
              bounds: Array, widen: float
              ) -> float:
    """Logarithm of the integral of prior times likelihood over the unknowns, relative to its largest value.

    Laplace's approximation: the cost is taken as a parabola. It is integrated exactly over
    stiffness and permittivity and by Gauss–Legendre quadrature over the sizes within their limits,
    where the largest value may lie on a limit.
    """
    nuisance, own = slice(0, 2), slice(2, None)
    inner = precision[nuisance, nuisance]
    mass = np.log(2
                  * np.pi) - 0.5 * np.linalg.slogdet(inner)[1] - np.log(NUISANCE).sum() - np.log(2
                                                                                                 * np.pi)
    if len(unknowns) == 2:
        return float(mass)
    # The sizes' own parabola, stiffness and permittivity at their best for each.
    gain = np.linalg.solve(inner, precision[nuisance, own])
    left = precision[own, own] - precision[own, nuisance] @ gain
    pull = slope[own] - gain.T @ slope[nuisance]
    widths = prior_widths(hypothesis, widen)[own]
    share = ndtr(bounds[1, own] / widths) - ndtr(bounds[0, own] / widths)
    mass += -np.sum(np.log(widths * share)) - 0.5 * len(widths) * np.log(2 * np.pi)
    return float(mass + _log_quadrature(left, pull, bounds[0, own] - unknowns[own],
                                        bounds[1, own] - unknowns[own]))


def _log_quadrature(precision: Array, slope: Array, low: Array, high: Array) -> float:
    """Logarithm of the integral of exp(-slope·x - x·precision·x/2) over a box that holds 0."""
    reach = 7 / np.sqrt(1 / np.diag(np.linalg.inv(precision)))
    centre = -np.linalg.solve(precision, slope)
    lower = np.clip(np.minimum(centre - reach, 0.0), low, high)
    upper = np.clip(np.maximum(centre + reach, 0.0), low, high)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES if len(slope) < 4 else 10)
    at = [(one + other) / 2 + (other - one) / 2 * nodes
          for one, other in zip(lower, upper, strict=True)]
    grid = np.stack([axis.ravel() for axis in np.meshgrid(*at, indexing="ij")], axis=1)
    weight = np.ones(1)
    for one, other in zip(lower, upper, strict=True):
        weight = np.multiply.outer(weight, (other - one) / 2 * weights).ravel()
    exponent = -grid @ slope - 0.5 * np.einsum("ni,ij,nj->n", grid, precision, grid)
    top = exponent.max()
    return float(top + np.log(max(float(weight @ np.exp(exponent - top)), 1e-300)))


def fit_all(simulation: Simulation, hypotheses: Sequence[Hypothesis], table: Table, start: Array,
            widen: float = 1.0,
            known: Sequence[Fit] = ()) -> list[Fit]:
    """Every hypothesis fitted but the ``known``, from the nominal one's unknowns; pairs from their members' fits."""
    found = {one.hypothesis: one for one in known}
    for hypothesis in hypotheses:
        if hypothesis not in found:
            members = [found[cause,] for cause in hypothesis if len(hypothesis) > 1
                       and (cause,) in found]
            starts = [_beside(one, hypothesis) for one in members if one.found] or [start[:2]]
            fits = [fit(simulation, hypothesis, table, first, widen) for first in starts]
            found[hypothesis] = max(fits, key=lambda one: (one.found, one.evidence))
    return [found[hypothesis] for hypothesis in hypotheses]


def _beside(member: Fit, hypothesis: Hypothesis) -> Array:
    """Unknowns of a pair to start from: those of one member, the other not there."""
    sizes = [member.unknowns[2:] if (cause,) == member.hypothesis else np.zeros(sizes_of((cause,)))
             for cause in hypothesis]
    return np.concatenate([member.unknowns[:2], *sizes])
