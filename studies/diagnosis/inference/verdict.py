"""From readings to a verdict: is something wrong, what could it be, does that explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from tympan.studies.diagnosis.inference.discrepancy import discrepancy_evidence
from tympan.studies.diagnosis.inference.fit import Fit, fit, fit_all, nominal_fit
from tympan.studies.diagnosis.inference.identifiability import classes_of, signatures
from tympan.studies.diagnosis.inference.posterior import Posterior
from tympan.studies.diagnosis.inference.residual_tests import (
    STATED,
    ResidualPattern,
    ResidualTests,
    TestResult,
    patterns,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.hypothesis import Cause, hypotheses_of
from tympan.studies.diagnosis.reduced.simulation import Simulation

Array = NDArray[np.float64]

#: Standard deviations within which a value lies on a bound.
_AT_BOUND = 1e-6

Verdict = Literal["nothing", "named", "ambiguous", "unexplained"]


@dataclass(frozen=True)
class Levels:
    """What it takes.

    ``alarm``: probability by noise alone below which something is wrong; ``adequate``: the same for
    what a cause leaves, below which it does not explain the misfit; ``sure``: probability from
    which a cause is named; ``discrepancy``: probability of none of the library from which
    the verdict is unexplained.
    """

    alarm: float = 0.03
    adequate: float = 0.01
    sure: float = 0.9
    discrepancy: float = 0.5


@dataclass(frozen=True, eq=False)
class Judgement:
    """What readings say about the nominal model.

    ``table`` has the noise found; ``test`` is that of the nominal fit, ``after`` that of the best
    hypothesis, None when nothing is wrong. ``named`` are the causes that stand out;
    ``indistinguishable`` classes that these readings cannot tell apart, ``invisible`` causes they
    cannot see.
    """

    verdict: Verdict
    table: ReadingTable
    nominal: Fit
    test: TestResult
    patterns: tuple[ResidualPattern, ...]
    posterior: Posterior | None = None
    after: TestResult | None = None
    named: tuple[Cause, ...] = ()
    indistinguishable: tuple[tuple[Cause, ...], ...] = ()
    invisible: tuple[Cause, ...] = ()
    suspects: tuple[Cause, ...] = ()


def judge(simulation: Simulation, table: ReadingTable, causes: Sequence[Cause],
          stated: float = STATED,
          levels: Levels = Levels(), widen: float = 1.0, seed: int = 0) -> Judgement:
    """Judge readings.

    Parameters
    ----------
    table
        Readings with their noise as far as it is stated.
    causes
        What may be wrong.
    stated
        Degrees of freedom the stated noise counts as; 0 where it is made up.
    widen
        Factor on the widths of the effects' priors.
    """
    generator = np.random.default_rng(seed)
    names = [specimen.name for specimen in simulation.setup.specimens]
    nominal = nominal_fit(simulation, table)
    if not nominal.possible:
        raise ArithmeticError("the nominal model has no equilibrium at the states that were read")
    groups = patterns(table, names, table.value - nominal.residual * table.sigma)
    signs = signatures(simulation, table, nominal.unknowns, causes)
    tests = ResidualTests.of(table, nominal.jacobian, groups,
                     {str(one.cause): one.columns for one in signs},
                     frozenset(str(cause) for cause in causes if _one_sided(cause)), stated)
    if not tests.able:
        raise ArithmeticError("there are too few readings to tell a misfit from noise")
    found = tests(nominal.residual, generator)
    table = table.with_sigma(table.sigma * found.noise)
    nominal = fit(simulation, (), table, nominal.unknowns)
    invisible, classes = classes_of(signatures(simulation, table, nominal.unknowns, causes))
    base = Judgement("nothing", table, nominal, found, groups, indistinguishable=classes,
                     invisible=invisible)
    if found.p_value >= levels.alarm:
        return base
    seen = [cause for cause in causes if cause not in invisible]
    fits = [one for one in fit_all(simulation, hypotheses_of(seen), table, nominal.unknowns, widen)
            if one.possible]
    posterior = Posterior.of(nominal, fits, discrepancy_evidence(nominal, groups, table.sigma))
    return _weighed(base, posterior, tests.freedom + stated, levels, generator)


def _one_sided(cause: Cause) -> bool:
    parameters = cause.effect.parameters
    return len(parameters) == 1 and parameters[0].sign == "positive"


def _weighed(base: Judgement, posterior: Posterior, freedom: float, levels: Levels,
             generator: np.random.Generator
             ) -> Judgement:
    """The verdict when something is wrong."""
    probability = posterior.of_causes()
    after = adequacy(base, posterior.best, freedom, generator)
    suspects = tuple(dict.fromkeys(cause for one in posterior.credible()
                                   for cause in one.hypothesis))
    known = replace(base, posterior=posterior, after=after, suspects=suspects)
    unlike_any = posterior.discrepancy > levels.discrepancy * posterior.wrong
    if unlike_any or after.p_value < levels.adequate:
        return replace(known, verdict="unexplained")
    sure = tuple(cause for cause, share in probability.items() if share >= levels.sure)
    alone = posterior.fit_of(sure) if sure else None
    alike = any(cause in group for cause in sure for group in base.indistinguishable)
    if alone is None or alike or adequacy(base, alone, freedom,
                                          generator).p_value < levels.adequate:
        return replace(known, verdict="ambiguous")
    return replace(known, verdict="named", named=sure)


def adequacy(base: Judgement, one: Fit, freedom: float,
             generator: np.random.Generator) -> TestResult:
    """Whether what a hypothesis leaves is noise, known as well as before."""
    tests = ResidualTests.of(base.table, one.jacobian, base.patterns, stated=0.0)
    return tests.against(one.residual, freedom, generator)


def interval(one: Fit, number: int, share: float = 0.95) -> tuple[float, float, float]:
    """An unknown's most probable value and its limits; a bound that the value lies on is one."""
    centre, width = float(one.unknowns[number]), float(one.deviations[number])
    low, high = ((bound - centre) / width for bound in one.bounds[:, number])
    below, above = ndtr(low), ndtr(high)
    tail = (1 - share) / 2
    parts = (tail, 1 - tail)
    if low >= -_AT_BOUND or high <= _AT_BOUND:
        parts = (0.0, share) if low >= -_AT_BOUND else (1 - share, 1.0)
    limits = [float(centre + width * ndtri(below + part * (above - below))) for part in parts]
    return centre, min(limits[0], centre), max(limits[1], centre)
