"""Hypotheses fitted and weighed: their most probable unknowns, evidence and probabilities."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr

from tympan.geometry.errors import InputError
from tympan.studies.diagnosis.inference.residual_tests import orthonormal
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import (
    FACTORS,
    SIZES,
    Cause,
    Hypothesis,
    Prediction,
    Simulation,
    bounds_of,
    parameters_of,
    sizes_of,
    unknown_count,
)
from tympan.studies.estimation.least_squares import Evaluation, LeastSquares, Minimum, minimise

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

#: What is thought before any data: that something is wrong at all is as probable as not; then that
#: it is one effect of the library, two, or none of them. Effects share theirs equally, an effect on
#: one specimen among these.
NOTHING, SINGLE, PAIR, DISCREPANCY = 0.5, 0.3, 0.1, 0.1

#: Sizes a discrepancy may have over the noise, each as probable as the other.
_SIZES = np.geomspace(0.3, 100.0, 12)


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis fitted to a table.

    ``residual``: readings minus predictions over their noise, shape (rows,); ``jacobian``:
    derivatives of the predictions over the noise by the unknowns; ``precision``: second derivatives
    of the cost; ``cost``: minus the logarithm of posterior density, and ``evidence``: logarithm of
    the readings' probability, up to what all hypotheses share; ``heave``: of the states [m].
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

    @property
    def possible(self) -> bool:
        """Whether any unknowns make a state of equilibrium of every state that was read."""
        return bool(np.isfinite(self.cost))

    @property
    def chi_squared(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns."""
        return np.sqrt(np.diag(np.linalg.inv(self.precision)))


def prior_widths(hypothesis: Hypothesis, widen: float = 1.0) -> Array:
    """Standard deviations of the unknowns beforehand, shape (p,)."""
    sizes = [widen * parameter.deviation for parameter in parameters_of(hypothesis)]
    return np.concatenate([NUISANCE, sizes])


def fit(simulation: Simulation, hypothesis: Hypothesis, table: ReadingTable,
        start: Array | None = None, widen: float = 1.0) -> Fit:
    """The best fit of a hypothesis to readings, the effects' priors ``widen`` times as wide.

    It begins at ``start``, of which the nominal hypothesis' unknowns are enough; without effects
    else, or, where a sign changes nothing, with some of the prior's width.
    """
    widths, bounds = prior_widths(hypothesis, widen), bounds_of(simulation, hypothesis)

    def evaluate(unknowns: Array, near: Evaluation | None) -> Evaluation:
        prediction = Prediction(simulation, hypothesis, unknowns, table,
                                None if near is None else near.state)
        return Evaluation((table.value - prediction.values) / table.sigma,
                          lambda: -prediction.jacobian / table.sigma[:, None], prediction.heave)

    problem = LeastSquares(evaluate, bounds[0], bounds[1], prior=widths**-2.0)
    fits = []
    for first in np.clip(_starts(hypothesis, widths, start), *bounds):
        try:
            minimum = minimise(problem, first, quick=_SMALL, iterations=_ITERATIONS)
        except InputError:  # it cannot be at the states that were read
            rows, count = len(table), len(first)
            fits.append(Fit(hypothesis, first, bounds, np.full(rows, np.inf),
                            np.zeros((rows, count)), np.eye(count), np.inf, -np.inf,
                            problem.at(first).state))
            continue
        point = minimum.point
        fits.append(Fit(hypothesis, minimum.unknowns, bounds, point.residual, -point.jacobian,
                        problem.curvature(point), minimum.cost,
                        _log_mass(problem, minimum, widths[SIZES]) - minimum.cost, point.state))
    return best_of(fits)


def _starts(hypothesis: Hypothesis, widths: Array, start: Array | None) -> list[Array]:
    first = np.zeros(len(widths))
    if start is not None:
        first[: len(start)] = start[: len(first)]
    even = np.array([parameter.sign == "even" for parameter in parameters_of(hypothesis)], bool)
    if not even.any() or (start is not None and len(start) >= len(first)):
        return [first]
    moved = np.zeros(len(first))
    moved[SIZES] = np.where(even, widths[SIZES], 0.0)
    return [first + share * moved for share in (0.5, 2.0)]


def _log_mass(problem: LeastSquares, minimum: Minimum, widths: Array) -> float:
    """Logarithm of the integral of prior times likelihood, relative to its largest value.

    Laplace's approximation: the cost is taken as a parabola. It is integrated exactly over
    stiffness and permittivity and by Gauss–Legendre quadrature over the sizes within their limits,
    where the largest value may lie on a limit.
    """
    precision = problem.curvature(minimum.point)
    slope = problem.slope(minimum.unknowns, minimum.point)
    inner = precision[FACTORS, FACTORS]
    mass = -0.5 * np.linalg.slogdet(inner)[1] - np.log(NUISANCE).sum()
    if not len(widths):
        return float(mass)
    # The sizes' own parabola, stiffness and permittivity at their best for each.
    gain = np.linalg.solve(inner, precision[FACTORS, SIZES])
    curvature = precision[SIZES, SIZES] - precision[SIZES, FACTORS] @ gain
    pull = slope[SIZES] - gain.T @ slope[FACTORS]
    low, high = problem.low[SIZES], problem.high[SIZES]
    share = ndtr(high / widths) - ndtr(low / widths)
    mass += -np.sum(np.log(widths * share)) - 0.5 * len(widths) * np.log(2 * np.pi)
    sizes = minimum.unknowns[SIZES]
    return float(mass + _log_quadrature(curvature, pull, low - sizes, high - sizes))


def best_of(fits: Sequence[Fit]) -> Fit:
    """The most probable, possible ones first."""
    return max(fits, key=lambda fit: (fit.possible, fit.evidence))


def nominal_fit(simulation: Simulation, table: ReadingTable) -> Fit:
    """The nominal model fitted, from the first start that has equilibria everywhere."""
    for start in _STARTS:
        nominal = fit(simulation, (), table, np.array(start))
        if nominal.possible:
            break
    return nominal


def _log_quadrature(precision: Array, slope: Array, low: Array, high: Array) -> float:
    """Logarithm of the integral of exp(-slope·x - x·precision·x/2) over a box that holds 0."""
    reach = 7 / np.sqrt(1 / np.diag(np.linalg.inv(precision)))
    centre = -np.linalg.solve(precision, slope)
    lower = np.clip(np.minimum(centre - reach, 0.0), low, high)
    upper = np.clip(np.maximum(centre + reach, 0.0), low, high)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES if len(slope) < 4 else 10)
    half = ((upper - lower) / 2)[:, None]
    at = ((lower + upper) / 2)[:, None] + half * nodes
    grid = np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, len(slope))
    weight = np.prod(np.meshgrid(*(half * weights), indexing="ij"), axis=0).ravel()
    exponent = -grid @ slope - 0.5 * np.einsum("ni,ij,nj->n", grid, precision, grid)
    top = exponent.max()
    return float(top + np.log(max(float(weight @ np.exp(exponent - top)), 1e-300)))


def fit_all(simulation: Simulation, hypotheses: Sequence[Hypothesis], table: ReadingTable,
            start: Array, widen: float = 1.0, fitted: Sequence[Fit] = ()) -> list[Fit]:
    """Every hypothesis fitted but those that are ``fitted``.

    They start from the nominal one's unknowns, pairs from each of their members' fits.
    """
    fits = {fit.hypothesis: fit for fit in fitted}
    for hypothesis in hypotheses:
        if hypothesis in fits:
            continue
        starts = []
        for cause in hypothesis:
            member = fits.get((cause,))
            if member is not None and member.possible:
                unknowns = np.zeros(unknown_count(hypothesis))
                unknowns[FACTORS] = member.unknowns[FACTORS]
                unknowns[sizes_of(hypothesis, cause)] = member.unknowns[SIZES]
                starts.append(unknowns)
        fits[hypothesis] = best_of([fit(simulation, hypothesis, table, first, widen)
                                    for first in starts or [start[FACTORS]]])
    return [fits[hypothesis] for hypothesis in hypotheses]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities given the readings, which add up to 1.

    ``fits`` are the hypotheses with an effect, the most probable first, ``probabilities`` theirs;
    ``nothing`` that of the nominal model; ``discrepancy`` that of some discrepancy no effect makes.
    """

    fits: tuple[Fit, ...]
    probabilities: Array
    nothing: float
    discrepancy: float

    @classmethod
    def of(cls, nominal: Fit, fits: Sequence[Fit], discrepancy_evidence: float) -> Posterior:
        """By evidence and prior."""
        logs = np.array([nominal.evidence, discrepancy_evidence, *(fit.evidence for fit in fits)])
        logs = logs + np.log([NOTHING, DISCREPANCY, *priors([fit.hypothesis for fit in fits])])
        weight = np.exp(logs - logs.max())
        weight /= weight.sum()
        order = 2 + np.argsort(-weight[2:], kind="stable")
        return cls(tuple(fits[k - 2] for k in order), weight[order], float(weight[0]),
                   float(weight[1]))

    @property
    def wrong(self) -> float:
        """Probability that something is wrong."""
        return 1 - self.nothing

    def of_causes(self) -> dict[Cause, float]:
        """Probability of each cause given that something is wrong; most probable first."""
        shares: dict[Cause, float] = {}
        for fit, share in zip(self.fits, self.probabilities.tolist(), strict=True):
            for cause in fit.hypothesis:
                shares[cause] = shares.get(cause, 0.0) + share / max(self.wrong, 1e-300)
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def fit_of(self, causes: Sequence[Cause]) -> Fit | None:
        """The fit of these causes together."""
        return next((fit for fit in self.fits if set(fit.hypothesis) == set(causes)), None)

    def with_cause(self, cause: Cause) -> Fit:
        """The most probable hypothesis that has a cause."""
        return next(fit for fit in self.fits if cause in fit.hypothesis)

    def credible(self) -> tuple[Fit, ...]:
        """The fewest hypotheses that together have 95 % of all that have an effect."""
        total = np.cumsum(self.probabilities)
        return self.fits[: int(np.searchsorted(total, 0.95 * total[-1])) + 1] if len(total) else ()


def priors(hypotheses: Sequence[Hypothesis]) -> Array:
    """Prior probabilities of hypotheses with one or two causes."""
    # How many specimens an effect may happen to.
    variants = Counter(cause.name for cause in set(chain(*hypotheses)))
    weight = np.array([np.prod([1 / variants[cause.name] for cause in hypothesis])
                       for hypothesis in hypotheses])
    single = np.array([len(hypothesis) == 1 for hypothesis in hypotheses], bool)
    for rows, mass in ((single, SINGLE), (~single, PAIR)):
        if rows.any():
            weight[rows] *= mass / weight[rows].sum()
    return weight


def discrepancy_evidence(nominal: Fit, patterns: dict[str, Array]) -> float:
    """Logarithm of the readings' probability if the nominal model is off by some smooth pattern.

    A pattern's columns have independent normal coefficients that make it a typical size, the same
    for one pattern of the table at a time or for all; the nominal model is taken as linear about
    its fit. Columns are over the noise of the readings.
    """
    evidence = []
    for columns in patterns.values():
        basis = orthonormal(columns)
        scale = (len(columns) / max(basis.shape[1], 1)) ** 0.5
        evidence += [_evidence(nominal, size * scale * basis) for size in _SIZES]
    return float(logsumexp(evidence) - np.log(len(evidence)))


def _evidence(nominal: Fit, columns: Array) -> float:
    residual = nominal.residual + nominal.jacobian @ nominal.unknowns
    spread = np.concatenate([NUISANCE * nominal.jacobian, columns], axis=1)
    inner = np.eye(spread.shape[1]) + spread.T @ spread
    along = spread.T @ residual
    squares = residual @ residual - along @ np.linalg.solve(inner, along)
    return float(-0.5 * squares - 0.5 * np.linalg.slogdet(inner)[1])
