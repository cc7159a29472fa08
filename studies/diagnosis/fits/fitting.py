"""Fitting of hypotheses to a table of readings: the nominal one first, others from it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import Predicts, ReadingModel
from tympan.studies.diagnosis.fits.evidence import evidence
from tympan.studies.diagnosis.fits.fit import NUISANCE, Fit, best_of
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    SIZES,
    Hypothesis,
    parameters_of,
    sizes_of,
    unknown_count,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.effects.prior import as_residuals
from tympan.studies.estimation.least_squares import (
    Evaluation,
    LeastSquares,
    Minimum,
    minimise,
)
from tympan.studies.estimation.noise import Noise

#: Most steps of a fit. It limits the cost.
_ITERATIONS = 40
#: Decrease of the cost by a step at which a fit ends: the log odds change by as much.
_SMALL = 1e-4

#: Largest decrease of the cost that derivatives may still promise at a fit. With more, the search
#: ended on a kink, where a plate begins to rub or a film to wrinkle, and the fit is not used: odds
#: would be wrong by a factor of 1.6 or more.
_UNFINISHED = 0.5

#: Shares of the readings that the nominal model is fitted to in turn, lowest voltages first.
_SHARES = (0.25, 0.5, 0.75, 1.0)


def fit(simulation: Predicts, hypothesis: Hypothesis, table: ReadingTable,
        start: Array | None = None, widen: float = 1.0, beside: Noise | None = None) -> Fit:
    """Fit a hypothesis to readings, with prior scales multiplied by ``widen``.

    The search begins at ``start``; for it the unknowns of the nominal hypothesis are enough.
    Without ``start`` it begins without effects or, where the sign of a size changes nothing, at
    some of the prior scale. Small errors ``beside`` the hypothesis count as noise.
    """
    return best_of([_fit_from(simulation, hypothesis, table, first, widen, beside)
                    for first in _starts(hypothesis, start)])


def _fit_from(simulation: Predicts, hypothesis: Hypothesis, table: ReadingTable, start: Array,
              widen: float, beside: Noise | None) -> Fit:
    bounds, limits = simulation.bounds(hypothesis), simulation.limits(hypothesis)
    scales = np.array([np.inf if parameter.switch else parameter.prior.widened(widen).scale
                       for parameter in parameters_of(hypothesis)])

    def prior(unknowns: Array) -> tuple[Array, Array]:
        rows, slopes = as_residuals(unknowns[SIZES], scales)
        return (np.concatenate([unknowns[FACTORS] / NUISANCE, rows]),
                np.concatenate([1 / NUISANCE, slopes]))

    def white(values: Array) -> Array:
        return values if beside is None else beside.whitened(values)

    def evaluate(unknowns: Array, near: Evaluation | None) -> Evaluation:
        prediction = simulation.prediction(hypothesis, unknowns, table)
        residual = table.noise.whitened(table.value - prediction.extended)
        if near is not None and prediction.beyond(near.state):
            residual = np.full(len(table), np.nan)
        return Evaluation(white(residual),
                          lambda: -white(table.noise.whitened(prediction.jacobian)), prediction)

    problem = LeastSquares(evaluate, bounds[0], bounds[1], prior=prior)
    start = np.clip(start, *bounds)
    minimum = minimise(problem, start, quick=_SMALL, iterations=_ITERATIONS)
    finished = _promised(problem, minimum) <= _UNFINISHED
    if not finished:
        minimum = minimise(problem, minimum.unknowns, iterations=_ITERATIONS)
        finished = _promised(problem, minimum) <= _UNFINISHED
    point, unknowns, prediction = minimum.point, minimum.unknowns, minimum.point.state
    residual, jacobian = point.residual, -point.jacobian
    if beside is not None:
        residual = table.noise.whitened(table.value - prediction.extended)
        jacobian = table.noise.whitened(prediction.jacobian)
    reached = Fit(hypothesis, unknowns, bounds, limits, residual, jacobian,
                  problem.slope(unknowns, point), problem.curvature(unknowns, point), minimum.cost,
                  0.0, prediction.deflection, widen=widen, beside=beside)
    if prediction.complete:
        # Derivatives off a minimum would count as evidence that the readings do not give.
        known = finished or not hypothesis
        return replace(reached, evidence=evidence(reached, widen) if known else -np.inf)
    further = np.all(prediction.possible | prediction.short)
    return replace(reached, cost=np.inf, evidence=-np.inf,
                   short=minimum.cost if further else np.inf)


def _promised(problem: LeastSquares, minimum: Minimum) -> float:
    """Compute the decrease of the cost that derivatives promise nearby, within the bounds."""
    slope = problem.slope(minimum.unknowns, minimum.point)
    free = ~(((minimum.unknowns <= problem.low) & (slope > 0))
             | ((minimum.unknowns >= problem.high) & (slope < 0)))
    if not free.any() or not np.isfinite(minimum.cost):
        return 0.0
    curvature = problem.curvature(minimum.unknowns, minimum.point)[np.ix_(free, free)]
    width = np.maximum(np.diag(curvature), 1e-300) ** -0.5
    step, scaled = width * slope[free], curvature * width * width[:, None]
    return 0.5 * float(step @ np.linalg.lstsq(scaled, step, rcond=None)[0])


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


def nominal_fit(simulation: ReadingModel, table: ReadingTable) -> Fit:
    """Fit the nominal model: first to readings of low voltages, then to more of them.

    So the stiffness is found before the films' limits matter.
    """
    return list(nominal_fits(simulation, table))[-1]


def nominal_fits(simulation: ReadingModel, table: ReadingTable) -> Iterator[Fit]:
    """Fit the nominal model to more and more readings, in the end to all."""
    order, unknowns = np.argsort(table.voltage, kind="stable"), np.zeros(FACTORS.stop)
    for share in _SHARES:
        count = max(int(share * len(order)), FACTORS.stop)
        lowest = table[np.sort(order[:count])].compact() if count < len(order) else table
        nominal = fit(simulation, (), lowest, unknowns)
        if not (simulation.loaded or nominal.possible):
            # Factors that suit other readings may leave a charged strip without equilibrium width.
            nominal = best_of([nominal, fit(simulation, (), lowest)])
        unknowns = nominal.unknowns
        yield nominal


def with_sizes(hypothesis: Hypothesis, *fits: Fit) -> Array:
    """Combine the factors of the last fit and the sizes of all fits; other sizes are 0."""
    unknowns = np.zeros(unknown_count(hypothesis))
    for member in fits:
        unknowns[FACTORS] = member.unknowns[FACTORS]
        for cause in member.hypothesis:
            sizes = member.unknowns[sizes_of(member.hypothesis, cause)]
            unknowns[sizes_of(hypothesis, cause)] = sizes
    return unknowns
