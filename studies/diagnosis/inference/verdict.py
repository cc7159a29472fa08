"""Verdict on readings: whether something is wrong, the possible causes, and what they explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from tympan.base.arrays import Mask
from tympan.studies.diagnosis.evidence.kind import ReadingModel, rows_of_kinds
from tympan.studies.diagnosis.fits.evidence import evidence
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause, hypotheses_of
from tympan.studies.diagnosis.inference.exploration import Exploration
from tympan.studies.diagnosis.inference.families import has_size
from tympan.studies.diagnosis.inference.identifiability import shows_when_large
from tympan.studies.diagnosis.inference.noise_terms import remembers, same_terms
from tympan.studies.diagnosis.inference.nominal import TOO_FEW, NominalMisfit, one_sided
from tympan.studies.diagnosis.inference.posterior import DISCREPANCY as DISCREPANCY_PRIOR
from tympan.studies.diagnosis.inference.posterior import (
    PAIR,
    SINGLE,
    Posterior,
    log_odds_to_smooth,
    odds_of_more,
)
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests, TestResult
from tympan.studies.diagnosis.inference.rough_bench import SMALL, RoughBench, near_rivals
from tympan.studies.diagnosis.inference.weighing import EXCLUDED, MORE
from tympan.studies.diagnosis.patterns.reading_patterns import over
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.result import Verdict
from tympan.studies.estimation.noise import UNSTATED, Noise, NoiseTerm

#: Probability by noise alone below which something is wrong, or a cause leaves something
#: unexplained. Noise of real test benches has heavy tails, outliers and correlation: it goes below
#: this twice as often as the normal noise that the tests assume.
ALARM = 0.02
#: Probability by noise alone below which a cause is excluded if another one leaves only noise.
HARDLY = 1e-3
#: Share of the probability of all effects in the library, alone and in pairs, from which a cause is
#: named.
SURE = 0.9
#: Probability of something outside the library, given that something is wrong, from which nothing
#: is named.
DOUBTED = 1 / 3
#: Probability of something outside the library from which the verdict is unexplained: it is then
#: the more probable case.
DISCREPANCY = 0.5

#: Prior probability of factors on stiffness and permittivity below which the film cannot be the
#: stated one, however well they fit.
UNUSUAL = 1e-3

#: Factors on the prior scales; a cause must stand out with each of them to be named.
SCALES = (1 / 3, 1.0, 3.0, 10.0)

#: Log odds of two causes over a smooth misfit of no cause from which the two are named.
PAIRED = 3.0

#: Size over the prior scale from which it is called surprising.
SURPRISING = 3.0

#: Fewest specimens besides an odd one that must agree with their description.
_OTHERS = 2

#: Times that readings are judged again with the noise that the fits show. It limits the cost.
_AGAIN = 2

#: Number of hypotheses tested for leaving only noise: the most probable, and those of least χ².
_ASKED = (8, 6)


@dataclass(frozen=True)
class Wandering:
    """A sensor that drifts, where its noise is not stated.

    ``size``: errors of the readings that also explain the misfit [the readings' unit], 0 where none
    do; ``excluded``: whether a cause is much more probable.
    """

    size: float = 0.0
    excluded: bool = False

    @property
    def possible(self) -> bool:
        """Whether the sensor may be all that is wrong."""
        return self.size > 0 and not self.excluded


@dataclass(frozen=True, eq=False)
class Weighed:
    """Causes weighed by what they leave of a misfit.

    ``simulation``: extended as far as needed; ``posterior``, and ``after``, the test of the
    residuals of the best hypothesis: None where nothing is wrong. ``alone``: every effect
    fitted alone with hardly any prior; ``suspects``: causes that may be present. ``named``: causes
    that stand out; ``robust``: those that do with prior scales multiplied by each of some factors;
    ``unknown``: the probability of something outside the library with each of these factors;
    ``rivals``: fits of ``alone`` that only their size makes improbable. ``small_errors``: the share
    of their prior scales at which all other causes are present, where that explains the rest.
    ``odd_specimen``: the specimen without which the nominal model fits, where no single cause
    explains the misfit; where two causes that are not both surprisingly large do, they are listed
    with it.
    """

    verdict: Verdict
    simulation: ReadingModel
    posterior: Posterior | None = None
    after: TestResult | None = None
    alone: tuple[Fit, ...] = ()
    suspects: tuple[Cause, ...] = ()
    named: tuple[Cause, ...] = ()
    robust: dict[float, tuple[Cause, ...]] = field(default_factory=dict)
    unknown: dict[float, float] = field(default_factory=dict)
    rivals: tuple[Fit, ...] = ()
    small_errors: float | None = None
    odd_specimen: str = ""

    @property
    def without_a_name(self) -> Weighed:
        """These weights where the sensor may be all that is wrong: no cause is named."""
        if self.verdict != "named":
            return self
        return replace(self, verdict="ambiguous", named=())


@dataclass(frozen=True, eq=False)
class Judgement:
    """Judgement of readings on the nominal model.

    ``misfit``: misfit of the nominal model, with the noise found; ``test``: whether that is noise;
    ``sensor``: whether a drifting sensor explains it; ``weighed``: other explanations;
    ``test_of_all``: the test with the noise as stated, where the readings show another.
    """

    misfit: NominalMisfit
    test: TestResult
    weighed: Weighed
    sensor: Wandering = Wandering()
    test_of_all: TestResult | None = None

    @property
    def verdict(self) -> Verdict:
        """Conclusion in one word."""
        return self.weighed.verdict

    @property
    def simulation(self) -> ReadingModel:
        """The simulation, extended as far as needed."""
        return self.weighed.simulation

    @property
    def table(self) -> ReadingTable:
        """The readings with the noise found."""
        return self.misfit.table

    @property
    def nominal(self) -> Fit:
        """The fit of the nominal model."""
        return self.misfit.fit

    @property
    def posterior(self) -> Posterior | None:
        """Hypotheses by their probability; None where nothing is wrong."""
        return self.weighed.posterior

    @property
    def named(self) -> tuple[Cause, ...]:
        """Causes that are named."""
        return self.weighed.named

    @property
    def unusual(self) -> bool:
        """Whether the fit needs factors on stiffness and permittivity that hardly any film has."""
        return (self.chosen or self.nominal).usual < UNUSUAL

    @property
    def chosen(self) -> Fit | None:
        """Extension of the model: the named causes, or the most probable hypothesis.

        None when nothing is wrong.
        """
        if self.posterior is None or not self.posterior.fits:
            return None
        return self.posterior.fit_of(self.named) or self.posterior.fits[0]

    @property
    def fits(self) -> tuple[Fit, ...]:
        """All fits to these readings; the last one of a hypothesis has the usual prior scales."""
        return (*self.weighed.alone, *(self.posterior.fits if self.posterior else ()))

    def explained(self, fit: Fit) -> float:
        """Compute the share of the nominal model's χ² beyond noise that a fit explains."""
        excess = max(self.nominal.chi_squared - len(self.table), 1e-9)
        share = (self.nominal.chi_squared - fit.chi_squared) / excess
        return min(max(share, 0.0), 1.0)

    def noise_over(self, stated: ReadingTable) -> float:
        """Compute the scatter of deflections, else of all readings, over the noise of their table.

        Readings weighed with coupons had their noise found before.
        """
        films, lengths = self.of_first().table, stated.lengths
        if not lengths.any():
            return self.test.noise
        return float(np.median(films.sigma[lengths] / stated.sigma[lengths]))

    def of_first(self) -> Judgement:
        """Restrict the judgement to the first kind of evidence, if others were weighed with it."""
        first = self.simulation.of_first()
        if first.evidence == self.simulation.evidence:
            return self
        films = rows_of_kinds(first.evidence, self.table)
        posterior = self.posterior and replace(
            self.posterior, fits=tuple(fit.part(films) for fit in self.posterior.fits))
        weighed = replace(self.weighed, simulation=first, posterior=posterior,
                          alone=tuple(fit.part(films) for fit in self.weighed.alone))
        return replace(self, misfit=self.misfit.part(films, first), weighed=weighed)


def probability_with_noise(judged: Judgement, factor: float, seed: int = 0) -> float | None:
    """Compute the probability of the named causes if the noise were larger by a ``factor``.

    It is 0 where the misfit would then be noise. None where no cause is named, or small errors have
    been added to the noise already. Fits keep their unknowns; their residuals are tested, and their
    evidence is computed anew.
    """
    posterior = judged.posterior
    if posterior is None or not judged.named or judged.weighed.small_errors:
        return None
    nominal, *fits = (fit.louder(factor) for fit in (judged.nominal, *posterior.fits))
    columns = over(judged.misfit.patterns, judged.table)
    tests = ResidualTests.of(nominal.free_jacobian, judged.misfit.shown, 0.0,
                             one_sided(judged.misfit.causes))
    noise = judged.table.noise.known(judged.test.freedom)
    if tests(nominal.residual, np.random.default_rng(seed), noise).p_value >= ALARM:
        return 0.0
    evidences = np.array([evidence(fit, fit.widen) for fit in (nominal, *fits)])
    with np.errstate(divide="ignore"):
        shares = np.log(np.array([posterior.nothing, *posterior.probabilities]))
    # A probability that underflows is replaced by the difference of evidence.
    before = np.array([judged.nominal.evidence, *(fit.evidence for fit in posterior.fits)])
    shares = np.where(np.isfinite(shares), shares, before - before[1] + shares[1])
    logs = shares + evidences - before
    columns = {name: values / factor for name, values in columns.items()}
    more = logs[1] + odds_of_more(fits[0], columns) + np.log(DISCREPANCY_PRIOR / (SINGLE + PAIR))
    weight = np.exp(np.array([*logs, more]) - max(*logs, more))
    named = [set(judged.named) <= set(fit.hypothesis) for fit in fits]
    return float(weight[1:-1][named].sum() / weight.sum())


def judge(simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause],
          widen: float = 1.0, seed: int = 0, workers: int = 1) -> Judgement:
    """Judge a table's readings, with prior scales multiplied by ``widen``.

    ``workers``: processes for the films of effects larger than those simulated so far.
    """
    judged = _judged(simulation, table, causes, widen, seed, workers)
    for _ in range(_AGAIN):
        terms = _noise_terms(judged)
        if same_terms(terms, judged.misfit.terms):
            break
        judged = _judged(judged.simulation, table, causes, widen, seed, workers, terms,
                         judged.sensor)
    if not judged.misfit.terms:
        return judged
    every = NominalMisfit.of(judged.simulation, table, causes, workers, ())
    found = table.noise if table.noise.found else None
    test = every.tests(every.fit.residual, np.random.default_rng(seed), found)
    return replace(judged, test_of_all=test)


def _judged(simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause], widen: float,
            seed: int, workers: int, terms: Sequence[NoiseTerm] | None = None,
            sensor: Wandering = Wandering()) -> Judgement:
    """Judge as :func:`judge` does, with known ``terms`` of the noise and a known ``sensor``.

    By default they are those that the nominal model's misfit shows.
    """
    generator = np.random.default_rng(seed)
    misfit = NominalMisfit.of(simulation, table, causes, workers, terms)
    if not misfit.tests.able:
        raise ArithmeticError(TOO_FEW)
    found = table.noise if table.noise.found else None
    test = misfit.tests(misfit.fit.residual, generator, found)
    if terms is None and test.p_value < ALARM and misfit.simulation.loaded:
        remembering = misfit.with_terms(misfit.shown_terms(remembers=True))
        if remembering is not misfit:
            misfit = remembering
            test = misfit.tests(misfit.fit.residual, generator, found)
        if test.p_value < ALARM and misfit.stated.source in UNSTATED:
            sensor = _wandering(misfit, generator)
    misfit = misfit.louder(test.noise)
    simulation, nominal = misfit.simulation, misfit.fit
    if test.p_value >= ALARM:
        verdict: Verdict = "nothing" if nominal.usual >= UNUSUAL else "unexplained"
        return Judgement(misfit, test, Weighed(verdict, simulation))
    adequacy = _Adequacy(misfit, found or misfit.table.noise.known(test.freedom), generator)
    possible = tuple(cause for cause in causes if cause not in misfit.invisible
                     or shows_when_large(simulation, cause, nominal, misfit.table))
    exploration = Exploration(simulation, misfit.table, nominal, possible, adequacy.enough, widen,
                              workers)
    exploration.run()
    weighed = _weighed(misfit, exploration, adequacy)
    return Judgement(misfit, test, weighed.without_a_name if sensor.possible else weighed, sensor)


def _wandering(misfit: NominalMisfit, generator: np.random.Generator) -> Wandering:
    """Find correlated errors, however large, that explain the misfit."""
    unknown = misfit.of_unknown_noise
    free = unknown.as_a_sensor_that_wanders()
    if not (remembers(free.terms) and free.fit.possible):
        return Wandering()
    test = free.tests(free.fit.residual, generator, None)
    lengths = free.table.lengths
    size = test.noise * float(np.median(free.table.sigma[lengths])) if lengths.any() else 0.0
    if test.p_value < ALARM:
        return Wandering()
    beside = unknown.shown_terms(remembers=True, most=np.inf)
    return Wandering(size, excluded=not remembers(beside))


def _noise_terms(judged: Judgement) -> tuple[NoiseTerm, ...]:
    """Find the noise terms from all fits together."""
    misfit = judged.misfit
    if judged.posterior is None:
        return misfit.terms
    fits = [misfit.fit, *judged.posterior.fits[: _ASKED[0]], *judged.weighed.alone[: _ASKED[1]]]
    return misfit.terms_by([misfit.missed_by(fit) for fit in fits], judged.simulation.loaded)


@dataclass
class _Adequacy:
    """Tests whether residuals of a hypothesis are noise of the size known before."""

    misfit: NominalMisfit
    noise: Noise
    generator: np.random.Generator
    results: dict[Fit, TestResult] = field(default_factory=dict)

    def of(self, fit: Fit) -> TestResult:
        """Test a fit; each fit is tested once."""
        if fit not in self.results:
            self.results[fit] = self._test(fit, np.full(len(self.misfit.table), True))
        return self.results[fit]

    def _test(self, fit: Fit, rows: Mask) -> TestResult:
        """Test a fit to some of the readings."""
        patterns = over(self.misfit.patterns, self.misfit.table)
        columns = {name: fit.whitened(values[rows]) for name, values in patterns.items()
                   if values[rows].any()}
        tests = ResidualTests.of(fit.whitened(fit.free_jacobian), columns, stated=0.0)
        return tests(fit.whitened(fit.residual), self.generator, self.noise[rows])

    def odd_specimen(self) -> str:
        """Find the specimen of three or more without which the nominal model fits; "" if none."""
        table, simulation = self.misfit.table, self.misfit.simulation
        numbers = np.unique(table.specimen)
        if not simulation.loaded or len(numbers) < _OTHERS + 1:
            return ""
        odd = [number for number in numbers.tolist() if self._noise_alone(table.specimen != number)]
        return simulation.setup.specimens[odd[0]].name if len(odd) == 1 else ""

    def _noise_alone(self, rows: Mask) -> bool:
        """Check whether the nominal model fits some of the readings within noise."""
        misfit = self.misfit
        others = fit(misfit.simulation, (), misfit.table[rows].compact(), misfit.fit.unknowns)
        return others.possible and self._test(others, rows).p_value >= ALARM

    def enough(self, fit: Fit) -> bool:
        """Check whether a fit's residuals may be noise."""
        return self.of(fit).p_value >= ALARM


def _weighed(misfit: NominalMisfit, exploration: Exploration, adequacy: _Adequacy) -> Weighed:
    """Weigh the causes when something is wrong."""
    nominal = misfit.fit
    columns = over(misfit.patterns, misfit.table)
    singles = tuple(exploration.alone(SCALES[-1]))
    ranked = exploration.ranked()
    best_fitting = sorted(ranked, key=lambda fit: fit.chi_squared)
    asked = dict.fromkeys([*ranked[: _ASKED[0]], *best_fitting[: _ASKED[1]]])
    enough = {fit.hypothesis for fit in asked if adequacy.enough(fit)}
    # A hypothesis that leaves more than noise is excluded if another one leaves only noise.
    out = {fit.hypothesis for fit in asked if enough and adequacy.of(fit).p_value < HARDLY}

    among = hypotheses_of(exploration.causes)
    kept = [fit for fit in ranked if fit.hypothesis not in out
            and not _redundant(fit, exploration, misfit.indistinguishable)]
    odds = {fit.hypothesis: odds_of_more(fit, columns) for fit in asked if fit in kept}
    if not kept:
        odds = {(): odds_of_more(nominal, columns)}
    posterior = Posterior.of(nominal, kept, odds, among)
    best = next(iter(posterior.fits), nominal)
    after, suspects = adequacy.of(best), _causes(posterior.credible())
    explaining = [fit for fit in asked if fit.hypothesis in enough]
    of_two = all(len(fit.hypothesis) > 1 for fit in explaining)
    odd = adequacy.odd_specimen() if of_two else ""
    weighed = partial(Weighed, simulation=exploration.simulation, posterior=posterior,
                      after=after, alone=singles)
    unexplained = weighed("unexplained", suspects=suspects, odd_specimen=odd)
    if odd and not any(map(_usual, explaining)):
        return unexplained
    if not enough or posterior.discrepancy > DISCREPANCY:
        return _on_a_rough_bench(unexplained, misfit, exploration, adequacy)
    scaled = {scale: Posterior.of(nominal, [
        replace(fit, evidence=evidence(fit, scale * exploration.widen)) for fit in kept], odds,
        among) for scale in SCALES}
    robust = {scale: _sure(posterior) for scale, posterior in scaled.items()}
    sure = robust[1.0]
    alone = posterior.fit_of(sure) if sure else None
    rivals = () if alone is None else _rivals(alone, singles, adequacy)
    # A rival whose size may be zero raises a doubt, but is no alternative.
    seen = tuple(fit for fit in rivals if has_size(fit, fit.hypothesis[0]))
    firm = len({frozenset(names) for names in robust.values()}) == 1
    doubted = posterior.discrepancy > DOUBTED * posterior.wrong or (
        alone is not None and len(sure) > 1
        and log_odds_to_smooth(alone, nominal, columns, among) < PAIRED)
    # Two causes that only one specimen shows may stand for anything wrong with this one.
    of_one = len(sure) > 1 and odd
    open_ = (alone is None or rivals or doubted or of_one or not firm
             or not adequacy.enough(alone))
    return weighed("ambiguous" if open_ else "named", named=() if open_ else sure, robust=robust,
                   unknown={scale: posterior.discrepancy for scale, posterior in scaled.items()},
                   rivals=seen, suspects=tuple(dict.fromkeys([*suspects, *_causes(seen)])),
                   odd_specimen=odd if open_ else "")


def _on_a_rough_bench(unexplained: Weighed, misfit: NominalMisfit, exploration: Exploration,
                      adequacy: _Adequacy) -> Weighed:
    """Weigh an unexplained misfit again, with small errors of every kind besides the causes.

    A cause that stands out from these is named.
    """
    posterior, among = unexplained.posterior, hypotheses_of(exploration.causes)
    assert posterior is not None
    bench = RoughBench.of((misfit.fit, *posterior.fits), misfit.signatures, among,
                          exploration.widen)
    if bench.small < SURE:
        return unexplained
    again, best = bench.again(exploration.simulation, misfit.table, exploration.widen)
    if not adequacy.enough(best):
        return unexplained
    robust = {scale: bench.widened(scale * exploration.widen).sure(SURE) for scale in SCALES}
    sure = tuple(cause for cause in robust[1.0]
                 if all(cause in others for others in robust.values()))
    # The fewest causes that explain the misfit: if they are enough, others are not reported.
    alone = again.fit_of(sure)
    chosen = alone if alone is not None and adequacy.enough(alone) else best
    share = bench.share(chosen.hypothesis)
    if not sure or share > SMALL or not set(sure) <= set(chosen.hypothesis) or near_rivals(
            chosen, unexplained.alone, misfit.signatures, share, EXCLUDED):
        return replace(unexplained, small_errors=share if share <= SMALL else None)
    return Weighed("named", exploration.simulation, again, adequacy.of(chosen), unexplained.alone,
                   _causes(again.credible()), sure, robust, small_errors=share)


def _usual(fit: Fit) -> bool:
    """Check that it has one cause, or two that are not both far from their prior scales."""
    return len(fit.hypothesis) < 2 or min(map(fit.surprise, fit.hypothesis)) < SURPRISING


def _redundant(fit: Fit, exploration: Exploration, alike: Sequence[Sequence[Cause]]) -> bool:
    """Check if a pair of indistinguishable causes explains no more than one of them."""
    causes = set(fit.hypothesis)
    if len(causes) < 2 or not any(causes <= set(group) for group in alike):
        return False
    singles = [exploration.fits[cause,].chi_squared for cause in fit.hypothesis]
    return fit.chi_squared > min(singles) - MORE


def _sure(posterior: Posterior) -> tuple[Cause, ...]:
    """List causes named given that the misfit is one of the library's effects."""
    return tuple(cause for cause, share in posterior.in_library().items() if share >= SURE)


def _rivals(fit: Fit, singles: Sequence[Fit], adequacy: _Adequacy) -> tuple[Fit, ...]:
    """List effects that alone explain the readings as well, if they may have the size for it."""
    return tuple(other for other in singles if other.hypothesis[0] not in fit.hypothesis
                 and other.chi_squared < fit.chi_squared + EXCLUDED and adequacy.enough(other))


def _causes(fits: Sequence[Fit]) -> tuple[Cause, ...]:
    return tuple(dict.fromkeys(cause for fit in fits for cause in fit.hypothesis))
