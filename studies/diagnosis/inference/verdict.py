"""From readings to a verdict: is something wrong, what could it be, does that explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from tympan.studies.diagnosis.inference.identifiability import Signatures, classes_of, signatures
from tympan.studies.diagnosis.inference.posterior import (
    Fit,
    Posterior,
    discrepancy_evidence,
    fit,
    fit_all,
    nominal_fit,
    prior_widths,
)
from tympan.studies.diagnosis.inference.residual_tests import (
    STATED,
    ResidualTests,
    TestResult,
    over,
    patterns,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import SIZES, Cause, Simulation, hypotheses_of

Array = NDArray[np.float64]

#: Standard deviations within which a value lies on a bound.
_AT_BOUND = 1e-6

#: Factor on the widths of the priors of effects tried alone: what is left of them holds back only
#: what nothing asks for.
_WIDE = 10.0

Verdict = Literal["nothing", "named", "ambiguous", "unexplained"]

#: What it takes: the probability by noise alone below which something is wrong, and below which
#: what a cause leaves is not explained by it; the probability from which a cause is named, and that
#: of none of the library from which the verdict is unexplained.
ALARM, ADEQUATE, SURE, DISCREPANCY = 0.03, 0.01, 0.9, 0.5


@dataclass(frozen=True, eq=False)
class Judgement:
    """What readings say about the nominal model.

    ``table`` has the noise found; ``test`` is that of the nominal fit, ``after`` that of the best
    hypothesis, None when nothing is wrong; ``patterns`` are those tested. ``named`` are the causes
    that stand out; ``indistinguishable`` classes that these readings cannot tell apart,
    ``invisible`` causes they cannot see.
    """

    verdict: Verdict
    table: ReadingTable
    nominal: Fit
    test: TestResult
    patterns: dict[str, Array]
    signatures: Signatures
    posterior: Posterior | None = None
    after: TestResult | None = None
    named: tuple[Cause, ...] = ()
    indistinguishable: tuple[tuple[Cause, ...], ...] = ()
    invisible: tuple[Cause, ...] = ()
    suspects: tuple[Cause, ...] = ()

    @property
    def chosen(self) -> Fit | None:
        """What to extend the model with: the causes named, or the most probable hypothesis.

        None when nothing is wrong.
        """
        if self.posterior is None or not self.posterior.fits:
            return None
        return self.posterior.fit_of(self.named) or self.posterior.fits[0]


def judge(simulation: Simulation, table: ReadingTable, causes: Sequence[Cause],
          stated: float = STATED, widen: float = 1.0, seed: int = 0) -> Judgement:
    """Judge a table's readings by what may be wrong, the effects' priors ``widen`` times as wide.

    The noise is the table's as far as it is ``stated``: by so many degrees of freedom, 0 where it
    is made up.
    """
    generator = np.random.default_rng(seed)
    nominal = nominal_fit(simulation, table)
    if not nominal.possible:
        raise ArithmeticError("the nominal model has no equilibrium at the states that were read")
    names = [specimen.name for specimen in simulation.setup.specimens]
    columns = patterns(table, names, table.value - nominal.residual * table.sigma)
    signs = signatures(simulation, table, nominal.unknowns, causes)
    one_sided = frozenset(
        str(cause) for cause in causes
        if [parameter.sign for parameter in cause.effect.parameters] == ["positive"])
    tests = ResidualTests.of(nominal.jacobian, over(columns, table) | {
        str(cause): signature for cause, signature in signs.items()}, stated, one_sided)
    if not tests.able:
        raise ArithmeticError("there are too few readings to tell a misfit from noise")
    test = tests(nominal.residual, generator)
    table = table.with_sigma(table.sigma * test.noise)
    nominal = fit(simulation, (), table, nominal.unknowns)
    signs = signatures(simulation, table, nominal.unknowns, causes)
    invisible, classes = classes_of(signs)
    base = Judgement("nothing", table, nominal, test, columns, signs, indistinguishable=classes,
                     invisible=invisible)
    if test.p_value >= ALARM:
        return base
    hypotheses = hypotheses_of([cause for cause in causes if cause not in invisible])
    fits = [fit for fit in fit_all(simulation, hypotheses, table, nominal.unknowns, widen)
            if fit.possible]
    posterior = Posterior.of(nominal, fits, discrepancy_evidence(nominal, over(columns, table)))
    return _weighed(base, posterior, tests.freedom + stated, generator)


def _weighed(base: Judgement, posterior: Posterior, freedom: float,
             generator: np.random.Generator) -> Judgement:
    """The verdict when something is wrong."""
    after = _adequacy(base, posterior.fits[0], freedom, generator)
    suspects = tuple(dict.fromkeys(cause for fit in posterior.credible()
                                   for cause in fit.hypothesis))
    weighed = replace(base, posterior=posterior, after=after, suspects=suspects)
    unlike_any = posterior.discrepancy > DISCREPANCY * posterior.wrong
    if unlike_any or after.p_value < ADEQUATE:
        return replace(weighed, verdict="unexplained")
    sure = tuple(cause for cause, share in posterior.of_causes().items() if share >= SURE)
    alone = posterior.fit_of(sure) if sure else None
    alike = any(cause in group for cause in sure for group in base.indistinguishable)
    if alone is None or alike or _adequacy(base, alone, freedom, generator).p_value < ADEQUATE:
        return replace(weighed, verdict="ambiguous")
    return replace(weighed, verdict="named", named=sure)


def _adequacy(base: Judgement, fit: Fit, freedom: float,
              generator: np.random.Generator) -> TestResult:
    """Whether what a hypothesis leaves is noise, known as well as before."""
    tests = ResidualTests.of(fit.jacobian, over(base.patterns, base.table), stated=0.0)
    return tests(fit.residual, generator, known=freedom)


def interval(fit: Fit, number: int) -> tuple[float, float, float]:
    """An unknown's most probable value and 95 % limits; a bound that the value lies on is one."""
    centre, width = float(fit.unknowns[number]), float(fit.deviations[number])
    low, high = ((bound - centre) / width for bound in fit.bounds[:, number])
    below, above = ndtr(low), ndtr(high)
    parts = ((0.0, 0.95) if low >= -_AT_BOUND else (0.05, 1.0) if high <= _AT_BOUND
             else (0.025, 0.975))
    limits = [float(centre + width * ndtri(below + part * (above - below))) for part in parts]
    return centre, min(limits[0], centre), max(limits[1], centre)


@dataclass(frozen=True, eq=False)
class SingleEffect:
    """One effect fitted with hardly any prior.

    ``share``: of the nominal model's χ² beyond noise that it takes away; ``widths``: its largest
    parameter in standard deviations of its prior; ``bounded``: whether it stopped at a limit.
    """

    cause: Cause
    fit: Fit
    share: float
    widths: float
    bounded: bool

    @property
    def plausible(self) -> bool:
        """Whether the size is one such actuators have: within two standard deviations."""
        return self.widths <= 2.0


def single_effects(simulation: Simulation, judged: Judgement,
                   causes: Sequence[Cause]) -> tuple[SingleEffect, ...]:
    """Every effect fitted alone, the one that explains most first; none when nothing is wrong.

    Those too that are not visible at a usual size: at an unusual one they may be.
    """
    if judged.posterior is None:
        return ()
    excess = max(judged.nominal.chi_squared - len(judged.table), 1e-9)
    effects = []
    for cause in causes:
        wide = fit(simulation, (cause,), judged.table, judged.nominal.unknowns, widen=_WIDE)
        if wide.possible:
            share = (judged.nominal.chi_squared - wide.chi_squared) / excess
            sizes, (low, high) = wide.unknowns[SIZES], wide.bounds[:, SIZES]
            widths = float((np.abs(sizes) / prior_widths((cause,))[SIZES]).max())
            bounded = bool(np.any((sizes != 0) & ((sizes <= low) | (sizes >= high))))
            effects.append(SingleEffect(cause, wide, min(max(share, 0.0), 1.0), widths, bounded))
    return tuple(sorted(effects, key=lambda effect: -effect.share))
