"""Hypotheses fitted and weighed: their most probable unknowns, evidence and probabilities."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    SIZES,
    Cause,
    Hypothesis,
    parameters_of,
    sizes_of,
    unknown_count,
)
from tympan.studies.diagnosis.inference.residual_tests import JUMPS, orthonormal, taken_by, without
from tympan.studies.diagnosis.inference.small_errors import SmallErrors
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.reduced_films import bounds_of, limits_of
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects.prior import as_residuals
from tympan.studies.estimation.least_squares import Evaluation, LeastSquares, minimise

Array = NDArray[np.float64]

#: What is known beforehand of the logarithms of the factors on stiffness and permittivity, as
#: standard deviations: sources on one tape differ by a factor of 1.7 in stiffness, and from 2.6 to
#: 4.7 in permittivity.
NUISANCE = np.array([0.5, 0.4])

_ITERATIONS, _SMALL = 40, 1e-4
#: Points of quadrature in each of one, two, three or more sizes, and in one of which limits are
#: asked; how far it reaches, in standard deviations.
_NODES, _FINE, _REACH = (32, 20, 12, 6, 4, 3), 128, 6.0

#: Shares of the readings, those of the lowest voltages first, that the nominal model is fitted to.
_SHARES = (0.25, 0.5, 0.75, 1.0)

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
    derivatives of the predictions over the noise by the unknowns; ``bounds`` and ``limits``: what
    films are sampled for and could be, shape (2, unknowns); ``slope`` and ``precision``:
    first and second derivatives of the cost; ``cost``: minus the logarithm of posterior density,
    and ``evidence``: logarithm of the readings' probability, up to what all hypotheses share;
    ``heave``: of the states [m]. Where not all states are possible, cost and evidence are infinite,
    and ``short`` is the cost that laws of further reach might have, or inf. Usual sizes were taken
    ``widen`` times as large, and there may be small errors ``beside`` the hypothesis.
    """

    hypothesis: Hypothesis
    unknowns: Array
    bounds: Array
    limits: Array
    residual: Array
    jacobian: Array
    slope: Array
    precision: Array
    cost: float
    evidence: float
    heave: Array
    short: float = np.inf
    widen: float = 1.0
    beside: SmallErrors | None = None

    @property
    def possible(self) -> bool:
        """Whether any unknowns make a state of equilibrium of every state that was read."""
        return bool(np.isfinite(self.cost))

    @property
    def chi_squared(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def covariance(self) -> Array:
        """Of the unknowns, shape (p, p)."""
        # Over their own widths, since unknowns in different units are of different magnitude.
        width = np.maximum(np.abs(np.diag(self.precision)), 1e-300) ** -0.5
        scaled = self.precision * width * width[:, None]
        return np.asarray(np.linalg.pinv(scaled, hermitian=True) * width * width[:, None], float)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def stopped(self) -> NDArray[np.bool_]:
        """Which unknowns would go on, were they not at a bound."""
        low, high = self.bounds
        return np.asarray(((self.unknowns <= low) & (self.slope > 0))
                          | ((self.unknowns >= high) & (self.slope < 0)))

    @property
    def free_jacobian(self) -> Array:
        """That by the unknowns that are not stopped, which alone take up what is missed."""
        return np.asarray(self.jacobian[:, ~self.stopped])

    def whitened(self, values: Array) -> Array:
        """Values of readings over their noise as if that were all, not small errors besides."""
        return values if self.beside is None else self.beside.whitened(values)

    def surprise(self, cause: Cause) -> float:
        """The largest size of a cause's parameters over its usual one."""
        sizes = np.abs(self.unknowns[sizes_of(self.hypothesis, cause)])
        usual = [parameter.deviation for parameter in cause.effect.parameters]
        return float((sizes / usual).max())


def fit(simulation: Simulation, hypothesis: Hypothesis, table: ReadingTable,
        start: Array | None = None, widen: float = 1.0, beside: SmallErrors | None = None) -> Fit:
    """The best fit of a hypothesis to readings, usual sizes taken ``widen`` times as large.

    It begins at ``start``, of which the nominal hypothesis' unknowns are enough; without effects
    else, or, where a sign changes nothing, with some of the usual size. Small errors ``beside`` it
    count as noise.
    """
    return best_of([_fit_from(simulation, hypothesis, table, first, widen, beside)
                    for first in _starts(hypothesis, start)])


def _fit_from(simulation: Simulation, hypothesis: Hypothesis, table: ReadingTable, start: Array,
              widen: float, beside: SmallErrors | None) -> Fit:
    bounds, limits = bounds_of(simulation, hypothesis), limits_of(simulation, hypothesis)
    scales = np.array([parameter.prior.widened(widen).scale
                       for parameter in parameters_of(hypothesis)])

    def prior(unknowns: Array) -> tuple[Array, Array]:
        rows, slopes = as_residuals(unknowns[SIZES], scales)
        return (np.concatenate([unknowns[FACTORS] / NUISANCE, rows]),
                np.concatenate([1 / NUISANCE, slopes]))

    def white(values: Array) -> Array:
        return values if beside is None else beside.whitened(values)

    def evaluate(unknowns: Array, near: Evaluation | None) -> Evaluation:
        prediction = simulation.prediction(hypothesis, unknowns, table)
        residual = (table.value - prediction.extended) / table.sigma
        if near is not None and prediction.beyond(near.state):
            residual = np.full(len(table), np.nan)
        return Evaluation(white(residual),
                          lambda: -white(prediction.jacobian / table.sigma[:, None]), prediction)

    problem = LeastSquares(evaluate, bounds[0], bounds[1], prior=prior)
    start = np.clip(start, *bounds)
    minimum = minimise(problem, start, quick=_SMALL, iterations=_ITERATIONS)
    point, unknowns, prediction = minimum.point, minimum.unknowns, minimum.point.state
    residual, jacobian = point.residual, -point.jacobian
    if beside is not None:
        residual = (table.value - prediction.extended) / table.sigma
        jacobian = prediction.jacobian / table.sigma[:, None]
    reached = Fit(hypothesis, unknowns, bounds, limits, residual, jacobian,
                  problem.slope(unknowns, point), problem.curvature(unknowns, point), minimum.cost,
                  0.0, prediction.heave, widen=widen, beside=beside)
    if prediction.complete:
        return replace(reached, evidence=evidence(reached, widen))
    further = np.all(prediction.possible | prediction.short)
    return replace(reached, cost=np.inf, evidence=-np.inf,
                   short=minimum.cost if further else np.inf)


def _starts(hypothesis: Hypothesis, start: Array | None) -> list[Array]:
    usual = np.array([parameter.deviation for parameter in parameters_of(hypothesis)])
    first = np.zeros(FACTORS.stop + len(usual))
    if start is not None:
        first[: len(start)] = start[: len(first)]
    even = np.array([parameter.sign == "even" for parameter in parameters_of(hypothesis)], bool)
    if not even.any() or (start is not None and len(start) >= len(first)):
        return [first]
    moved = np.zeros(len(first))
    moved[SIZES] = np.where(even, usual, 0.0)
    return [first + share * moved for share in (0.5, 2.0)]


def evidence(fit: Fit, widen: float = 1.0) -> float:
    """Logarithm of the integral of prior times likelihood, usual sizes ``widen`` times as large.

    The logarithm of likelihood is taken as a parabola about the fit, Laplace's approximation. It is
    integrated exactly over stiffness and permittivity, and with the sizes' priors as they are by
    quadrature within their limits.
    """
    parabola = _Parabola.of(fit)
    if not fit.hypothesis:
        return parabola.top
    sizes = list(range(len(fit.unknowns) - SIZES.start))
    _, logs = parabola.quadrature(fit, fit.bounds, widen, sizes)
    return parabola.top + float(logsumexp(logs))


def quantiles(fit: Fit, number: int, shares: Sequence[float]) -> Array:
    """Sizes below which shares of an effect's posterior lie, the other unknowns whatever they are.

    ``number`` is the place of the size among the unknowns. By the same quadrature as the evidence,
    as far as sizes may go, so that one that readings hardly tell has the prior's limits.
    """
    sizes = list(range(len(fit.unknowns) - SIZES.start))
    first = number - SIZES.start
    places, logs = _Parabola.of(fit).quadrature(
        fit, fit.limits, fit.widen, [first, *(size for size in sizes if size != first)], _FINE)
    weight = np.exp(logs - logs.max()).reshape(_FINE, -1).sum(1)
    below = (np.cumsum(weight) - 0.5 * weight) / weight.sum()
    return np.interp(shares, below, places[:: len(places) // _FINE, 0])


@dataclass(frozen=True, eq=False)
class _Parabola:
    """The logarithm of likelihood about a fit, stiffness and permittivity at their best.

    ``top`` - ``slope``·x - x·``curvature``·x/2, x the sizes less those of the fit.
    """

    top: float
    slope: Array
    curvature: Array

    @classmethod
    def of(cls, fit: Fit) -> _Parabola:
        """Integrated over stiffness and permittivity and their prior."""
        weights = np.zeros(len(fit.unknowns))
        weights[FACTORS] = NUISANCE**-2.0
        # A factor at its bound stays there whatever the sizes are.
        moves = np.ones(len(fit.unknowns))
        moves[FACTORS] = ~fit.stopped[FACTORS]
        jacobian, residual = fit.whitened(fit.jacobian) * moves, fit.whitened(fit.residual)
        precision = jacobian.T @ jacobian + np.diag(weights)
        slope = moves * weights * fit.unknowns - jacobian.T @ residual
        inner = precision[FACTORS, FACTORS]
        top = -0.5 * float(residual @ residual + weights @ fit.unknowns**2)
        top -= fit.beside.log_volume if fit.beside is not None else 0.0
        top += 0.5 * float(slope[FACTORS] @ np.linalg.solve(inner, slope[FACTORS]))
        top -= 0.5 * np.linalg.slogdet(inner)[1] + np.log(NUISANCE).sum()
        gain = np.linalg.solve(inner, precision[FACTORS, SIZES])
        return cls(float(top), slope[SIZES] - gain.T @ slope[FACTORS],
                   precision[SIZES, SIZES] - precision[SIZES, FACTORS] @ gain)

    def quadrature(self, fit: Fit, bounds: Array, widen: float, order: Sequence[int],
                   first: int | None = None) -> tuple[Array, Array]:
        """Nodes, shape (n, sizes) in that ``order``, and the logarithms of their weights.

        Weights are of priors times exp(-slope·x - x·curvature·x/2) within ``bounds``. One size
        after the other, by Gauss–Legendre quadrature in the inverse hyperbolic sine of its size
        over its scale, about where those before it leave it. ``first``: nodes in the first size.
        """
        count = len(order)
        parameters = parameters_of(fit.hypothesis)
        priors = [parameters[k].prior.widened(widen) for k in order]
        scales = np.array([prior.scale for prior in priors])
        sizes = fit.unknowns[SIZES][order]
        low, high = bounds[:, SIZES][:, order]
        slope = self.slope[order]
        # A size that readings do not tell keeps a little curvature, of what priors allow.
        curvature = self.curvature[np.ix_(order, order)] + np.diag((1e-3 / scales) ** 2)
        places, logs = np.zeros((1, count)), np.zeros(1)
        for k in range(count):
            nodes, weights = _legendre(first if first and k == 0 else _NODES[count - 1])
            last = slice(k, count)
            inverse = np.linalg.inv(curvature[last, last])
            towards = slope[last] + places[:, :k] @ curvature[:k, last]
            centre, width = -(towards @ inverse)[:, 0], inverse[0, 0] ** 0.5
            # Where likelihood falls from a limit, as far as it falls.
            with np.errstate(over="ignore"):  # where it does not fall at all
                fall = np.minimum(_REACH * width,
                                  40 * width**2 / np.maximum(np.abs(centre), 1e-300))
            from_, to = low[k] - sizes[k], high[k] - sizes[k]
            near, far = np.clip(centre, from_, to) - fall, np.clip(centre, from_, to) + fall
            lower = np.clip(np.minimum(np.minimum(centre - _REACH * width, near), 0.0), from_, to)
            upper = np.clip(np.maximum(np.maximum(centre + _REACH * width, far), 0.0), from_, to)
            begin, end = (np.arcsinh((edge + sizes[k]) / scales[k]) for edge in (lower, upper))
            at = 0.5 * (begin + end)[:, None] + 0.5 * (end - begin)[:, None] * nodes
            inside = scales[k] * np.sinh(at)
            measure = 0.5 * (end - begin)[:, None] * weights * scales[k] * np.cosh(at)
            logs = (logs[:, None] + np.log(np.maximum(measure, 1e-300))
                    + priors[k].logpdf(inside)).ravel()
            places = np.repeat(places, len(nodes), axis=0)
            places[:, k] = (inside - sizes[k]).ravel()
        logs = logs - places @ slope - 0.5 * np.einsum("ni,ij,nj->n", places, curvature, places)
        return places + sizes, logs


@lru_cache
def _legendre(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss–Legendre quadrature."""
    return np.polynomial.legendre.leggauss(count)


def best_of(fits: Sequence[Fit]) -> Fit:
    """The most probable, possible ones first."""
    return min(fits, key=lambda fit: (fit.cost, fit.short))


def nominal_fit(simulation: Simulation, table: ReadingTable) -> Fit:
    """The nominal model fitted: to the readings of low voltages first, and from there to more.

    So films find their stiffness before their limits matter.
    """
    return list(nominal_fits(simulation, table))[-1]


def nominal_fits(simulation: Simulation, table: ReadingTable) -> Iterator[Fit]:
    """The nominal model fitted to more and more readings, in the end to all."""
    order, unknowns = np.argsort(table.voltage, kind="stable"), np.zeros(FACTORS.stop)
    for share in _SHARES:
        count = max(int(share * len(order)), FACTORS.stop)
        lowest = table[np.sort(order[:count])].compact() if count < len(order) else table
        nominal = fit(simulation, (), lowest, unknowns)
        if simulation.tests is not None and not nominal.possible:
            # Factors that others liked may leave a charged strip without width.
            nominal = best_of([nominal, fit(simulation, (), lowest)])
        unknowns = nominal.unknowns
        yield nominal


def fit_all(simulation: Simulation, hypotheses: Sequence[Hypothesis], table: ReadingTable,
            start: Array, widen: float = 1.0, fitted: Sequence[Fit] = ()) -> list[Fit]:
    """Every hypothesis fitted but those that are ``fitted``.

    They start from the nominal one's unknowns, pairs from each of their members' fits.
    """
    fits = {fit.hypothesis: fit for fit in fitted}
    for hypothesis in hypotheses:
        if hypothesis in fits:
            continue
        starts = [with_sizes(hypothesis, fits[cause,]) for cause in hypothesis
                  if len(hypothesis) > 1 and (cause,) in fits and fits[cause,].possible]
        fits[hypothesis] = best_of([fit(simulation, hypothesis, table, first, widen)
                                    for first in starts or [start[FACTORS]]])
    return [fits[hypothesis] for hypothesis in hypotheses]


def with_sizes(hypothesis: Hypothesis, *fits: Fit) -> Array:
    """Unknowns of a hypothesis with the factors of the last fit, and the sizes of all, else 0."""
    unknowns = np.zeros(unknown_count(hypothesis))
    for member in fits:
        unknowns[FACTORS] = member.unknowns[FACTORS]
        for cause in member.hypothesis:
            sizes = member.unknowns[sizes_of(member.hypothesis, cause)]
            unknowns[sizes_of(hypothesis, cause)] = sizes
    return unknowns


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities given the readings, which add up to 1.

    ``fits`` are the hypotheses with an effect, the most probable first, ``probabilities`` theirs;
    ``nothing`` that of the nominal model; ``discrepancy`` that of something else beside them.
    """

    fits: tuple[Fit, ...]
    probabilities: Array
    nothing: float
    discrepancy: float

    @classmethod
    def of(cls, nominal: Fit, fits: Sequence[Fit], log_odds: Mapping[Hypothesis, float],
           among: Sequence[Hypothesis]) -> Posterior:
        """By evidence and prior, that of all hypotheses ``among`` which they are.

        ``log_odds``: of some hypotheses, the logarithm of the odds that there is a discrepancy
        beside them, by what they leave (:func:`odds_of_more`); of others those are taken to be as
        before any data. Without any fits, of the nominal one.
        """
        logs = np.array([fit.evidence for fit in fits])
        shares = dict(zip(among, priors(among).tolist(), strict=True))
        logs = logs + np.log([shares[fit.hypothesis] for fit in fits])
        odds = np.array([log_odds.get(fit.hypothesis, 0.0) for fit in fits])
        more = float(logsumexp(logs + odds)) if fits else nominal.evidence + log_odds[()]
        both = np.array([nominal.evidence + np.log(NOTHING),
                         more + np.log(DISCREPANCY / (SINGLE + PAIR)), *logs])
        weight = np.exp(both - both.max())
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


def odds_of_more(fit: Fit, patterns: dict[str, Array]) -> float:
    """Logarithm by which readings raise the odds that some smooth pattern is beside a hypothesis.

    Only what its unknowns cannot take up counts, whatever their size: a large effect that leaves
    nothing is no reason to look for another. A pattern's columns have independent normal
    coefficients that make it a typical size, the same for one pattern of the table at a time or for
    all. Columns are over the noise of the readings.
    """
    taken = taken_by(fit.free_jacobian)
    residual = without(taken, fit.residual)
    gains = []
    for columns in (patterns[name] for name in patterns if name not in JUMPS):
        basis = orthonormal(columns)
        scale = (len(columns) / max(basis.shape[1], 1)) ** 0.5
        free = without(taken, basis)
        gains += [_log_gain(residual, size * scale * free) for size in _SIZES]
    return float(logsumexp(gains) - np.log(len(gains)))


def log_odds_to_smooth(fit: Fit, nominal: Fit, patterns: dict[str, Array],
                       among: Sequence[Hypothesis]) -> float:
    """Logarithm of a hypothesis' odds against something smooth that the nominal model lacks."""
    share = dict(zip(among, priors(among).tolist(), strict=True))[fit.hypothesis]
    smooth = nominal.evidence + odds_of_more(nominal, patterns) + np.log(DISCREPANCY)
    return float(fit.evidence + np.log(share) - smooth)


def _log_gain(residual: Array, spread: Array) -> float:
    """Logarithm of normal residuals' density with covariance 1 + spread · spreadᵀ, over with 1."""
    inner = np.eye(spread.shape[1]) + spread.T @ spread
    along = spread.T @ residual
    return float(0.5 * along @ np.linalg.solve(inner, along) - 0.5 * np.linalg.slogdet(inner)[1])
