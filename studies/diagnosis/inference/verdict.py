"""Verdict by readings: is something wrong, what could it be, does that explain it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.evidence.kind import Model, rows_of
from tympan.studies.diagnosis.fits.evidence import evidence
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause, hypotheses_of
from tympan.studies.diagnosis.inference.exploration import Exploration
from tympan.studies.diagnosis.inference.families import has_size
from tympan.studies.diagnosis.inference.identifiability import (
    Signatures,
    classes_of,
    shows_when_large,
)
from tympan.studies.diagnosis.inference.noise_told import Told
from tympan.studies.diagnosis.inference.nominal import TOO_FEW, UNLIKE, NominalMisfit, one_sided
from tympan.studies.diagnosis.inference.posterior import DISCREPANCY as DISCREPANCY_PRIOR
from tympan.studies.diagnosis.inference.posterior import (
    PAIR,
    SINGLE,
    Posterior,
    log_odds_to_smooth,
    odds_of_more,
)
from tympan.studies.diagnosis.inference.relabelled import Relabelling, relabelling_of
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests, TestResult
from tympan.studies.diagnosis.inference.rough_bench import SMALL, RoughBench, near_rivals
from tympan.studies.diagnosis.patterns.reading_patterns import over
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.result import Verdict
from tympan.studies.estimation.noise import UNSTATED, Noise

#: Probability by noise alone below which something is wrong, or is left by a cause unexplained:
#: noise as benches have it, of heavy tails or with slips and memory, goes below it twice as often
#: as the normal one that tests assume.
ALARM = 0.02
#: Probability by noise alone below which a cause is out of the question where another one leaves
#: noise.
HARDLY = 1e-3
#: Share of the probability of all effects in the library, alone and in pairs, from which a cause is
#: named.
SURE = 0.9
#: Probability of something beside the library, among all that is wrong, from which nothing is
#: named.
DOUBTED = 1 / 3
#: Probability of something beside the library from which the verdict is unexplained: it is more
#: probable than not.
DISCREPANCY = 0.5

#: Probability beforehand below which factors on stiffness and permittivity are none of a film as it
#: is stated, however well they fit.
UNUSUAL = 1e-3

#: Factors on the usual sizes for each of which a cause must stand out to be named.
SCALES = (1 / 3, 1.0, 3.0, 10.0)

#: χ² by which a rival must miss the readings more than what is named, whatever its size may be: a
#: cause that is expected to be ahead by t is behind by this with z = (EXCLUDED + t) / (2 √t) or
#: more, 3 at least. So must a film of its own for one specimen, for other labels to be told.
EXCLUDED = 9.0

#: χ² by which two causes of one class must explain more than one alone, to be weighed as two, and
#: effects more than other labels, for these not to be told.
MORE = 4.0

#: How many effects are asked whether they explain the readings with other labels: a real one may
#: be there besides.
_BESIDE = 2

#: How much more two causes must explain than a smooth misfit of no cause, to be named: logarithm of
#: the odds.
PAIRED = 3.0

#: Sizes over the usual ones from which they are called a surprise.
SURPRISING = 3.0

#: Specimens beside an odd one that must be as they are written, at least.
_OTHERS = 2

#: How often readings are judged again by a noise that the fits tell. A bound of the cost.
_AGAIN = 2

#: How many hypotheses are asked whether they leave noise, by probability and by χ².
_ASKED = (8, 6)


@dataclass(frozen=True)
class Confusion:
    """A quantity that was written as if it were another, in words.

    ``of``: the column and file, or the key of the specimens; ``taken``: how it reads; ``check``:
    the sentence on what to do about it.
    """

    of: str
    taken: str
    check: str = "do_quantity"


@dataclass(frozen=True, eq=False)
class Judgement:
    """Judgement of readings on the nominal model.

    ``simulation``: as far as it was grown; ``table`` has the noise found; ``test`` is that of the
    nominal fit, ``after`` that of the best hypothesis, None when nothing is wrong; ``patterns`` are
    those tested; ``told``: what readings tell of their noise, ``test_of_all``: the test as if they
    did not, where they do. ``named`` are the causes that stand out, ``robust`` those that do with
    usual sizes times each of some factors, ``unknown`` how probable something beside the library is
    with these; ``indistinguishable`` classes that these readings cannot
    tell apart, ``invisible`` causes they cannot see; ``alone`` every effect fitted by itself with
    hardly any prior, ``rivals`` those of them that only their size speaks against.
    ``small_errors``: the share of their usual sizes at which all other causes are there, where that
    is what explains the rest. ``relabelling``: labels that, put right, let the nominal model or one
    effect explain the readings as well as any effects do with those stated; ``confusions``:
    quantities that, read as others they are often taken for, make unusual factors usual;
    ``wandering``: how large errors of a sensor that wanders would be that explain the misfit, too
    [the readings' unit], where no noise is stated that excludes them, else 0; ``no_sensor``:
    whether a cause is much more probable than these, without which nothing is named; ``scatter``:
    that of channels about smooth curves over their stated noise, by kind, where both are known.
    ``odd_specimen``: that without which the nominal model misses nothing, where no one cause
    explains it; where two do that are not both surprisingly large, they stand beside it.
    """

    verdict: Verdict
    simulation: Model
    table: ReadingTable
    nominal: Fit
    test: TestResult
    patterns: dict[str, Array]
    signatures: Signatures
    told: Told
    test_of_all: TestResult | None = None
    posterior: Posterior | None = None
    after: TestResult | None = None
    named: tuple[Cause, ...] = ()
    robust: dict[float, tuple[Cause, ...]] = field(default_factory=dict)
    unknown: dict[float, float] = field(default_factory=dict)
    rivals: tuple[Fit, ...] = ()
    indistinguishable: tuple[tuple[Cause, ...], ...] = ()
    invisible: tuple[Cause, ...] = ()
    suspects: tuple[Cause, ...] = ()
    alone: tuple[Fit, ...] = ()
    small_errors: float | None = None
    relabelling: Relabelling | None = None
    confusions: tuple[Confusion, ...] = ()
    odd_specimen: str = ""
    wandering: float = 0.0
    no_sensor: bool = False
    scatter: Mapping[str, float] = field(default_factory=dict)

    @property
    def of_sensor(self) -> bool:
        """Whether it may be nothing but a sensor that wanders, as nobody states its noise."""
        return self.wandering > 0 and not self.no_sensor

    @property
    def unusual(self) -> bool:
        """Whether it takes factors on stiffness and permittivity that hardly any film has."""
        return (self.chosen or self.nominal).usual < UNUSUAL

    @property
    def chosen(self) -> Fit | None:
        """Extension of the model: the causes named, or the most probable hypothesis.

        None when nothing is wrong.
        """
        if self.posterior is None or not self.posterior.fits:
            return None
        return self.posterior.fit_of(self.named) or self.posterior.fits[0]

    @property
    def fits(self) -> tuple[Fit, ...]:
        """All fits to these readings; of one hypothesis the last has sizes as they are usual."""
        return (*self.alone, *(self.posterior.fits if self.posterior else ()))

    def explained(self, fit: Fit) -> float:
        """Share of the nominal model's χ² beyond noise that a fit takes away."""
        excess = max(self.nominal.chi_squared - len(self.table), 1e-9)
        share = (self.nominal.chi_squared - fit.chi_squared) / excess
        return min(max(share, 0.0), 1.0)

    @property
    def rough(self) -> dict[str, float]:
        """Scatter of the channels whose stated noise is too small to be theirs."""
        return {kind: scatter for kind, scatter in self.scatter.items() if scatter > UNLIKE}

    @property
    def quiet(self) -> dict[str, float]:
        """Scatter of the channels whose stated noise is too large to be theirs."""
        return {kind: scatter for kind, scatter in self.scatter.items() if scatter < 1 / UNLIKE}

    def noise_over(self, stated: ReadingTable) -> float:
        """Scatter of deflections over the noise of the table they came in; else of all readings.

        Weighed with coupons they have had their noise found before.
        """
        films, lengths = self.of_first().table, stated.lengths
        if not lengths.any():
            return self.test.noise
        return float(np.median(films.sigma[lengths] / stated.sigma[lengths]))

    def of_first(self) -> Judgement:
        """Judgement on the first kind of evidence, where others were weighed with it."""
        first = self.simulation.of_first()
        if first.evidence == self.simulation.evidence:
            return self
        films = rows_of(first.evidence, self.table)

        def part(fit: Fit) -> Fit:
            return replace(fit, residual=fit.residual[films], jacobian=fit.jacobian[films],
                           beside=fit.beside and fit.beside[films])

        posterior = self.posterior and replace(
            self.posterior, fits=tuple(map(part, self.posterior.fits)))
        return replace(
            self, simulation=first, table=self.table[films
            ].compact(), nominal=part(self.nominal), posterior=posterior,
            patterns={name: values[films] for name, values in self.patterns.items()
                      if values[films].any()},
            signatures={cause: values[films] for cause, values in self.signatures.items()},
            told=self.told[films],
            alone=tuple(map(part, self.alone)))


def probability_with_noise(judged: Judgement, factor: float, seed: int = 0) -> float | None:
    """Probability of what is named, were the noise larger by a ``factor``; None without a name.

    0 where nothing would be seen to be wrong. None, too, where small errors have been added to the
    noise already. Fits stay where they are; what they leave is tested, and evidence is computed
    anew.
    """
    posterior = judged.posterior
    if posterior is None or not judged.named or judged.small_errors:
        return None
    nominal, *fits = (fit.louder(factor) for fit in (judged.nominal, *posterior.fits))
    columns = over(judged.patterns, judged.table)
    causes = {str(cause): signature for cause, signature in judged.signatures.items()}
    tests = ResidualTests.of(nominal.free_jacobian, columns | causes, 0.0,
                             one_sided(judged.signatures))
    noise = judged.table.noise.known(judged.test.freedom)
    if tests(nominal.residual, np.random.default_rng(seed), noise).p_value >= ALARM:
        return 0.0
    evidences = np.array([evidence(fit, fit.widen) for fit in (nominal, *fits)])
    with np.errstate(divide="ignore"):
        shares = np.log(np.array([posterior.nothing, *posterior.probabilities]))
    # A share too small for a number is as far behind as its evidence is.
    before = np.array([judged.nominal.evidence, *(fit.evidence for fit in posterior.fits)])
    shares = np.where(np.isfinite(shares), shares, before - before[1] + shares[1])
    logs = shares + evidences - before
    columns = {name: values / factor for name, values in columns.items()}
    more = logs[1] + odds_of_more(fits[0], columns) + np.log(DISCREPANCY_PRIOR / (SINGLE + PAIR))
    weight = np.exp(np.array([*logs, more]) - max(*logs, more))
    named = [set(judged.named) <= set(fit.hypothesis) for fit in fits]
    return float(weight[1:-1][named].sum() / weight.sum())


def judge(simulation: Model, table: ReadingTable, causes: Sequence[Cause],
          widen: float = 1.0, seed: int = 0, workers: int = 1) -> Judgement:
    """Judge a table's readings by what may be wrong, usual sizes taken ``widen`` times as large.

    ``workers``: processes for the films of effects larger than those simulated so far.
    """
    misfit, judged = _judged(simulation, table, causes, widen, seed, workers)
    wandering, no_sensor = judged.wandering, judged.no_sensor
    for _ in range(_AGAIN):
        told = _told_by(misfit, judged)
        if told.alike(misfit.told):
            break
        misfit, judged = _judged(judged.simulation, table, causes, widen, seed, workers, told)
    if judged.test.p_value < ALARM:
        judged = _with_labels(judged, misfit)
        if wandering:
            judged = replace(judged, wandering=wandering, no_sensor=no_sensor)
            if judged.verdict == "named" and judged.of_sensor:
                judged = replace(judged, verdict="ambiguous", named=())
    if not misfit.told.anything:
        return judged
    every, tests = NominalMisfit.of(judged.simulation, table, causes, workers,
                                    Told.nothing(len(table)))
    found = table.noise if table.noise.found else None
    test = tests(every.fit.residual, np.random.default_rng(seed), found)
    return replace(judged, test_of_all=test)


def _judged(simulation: Model, table: ReadingTable, causes: Sequence[Cause], widen: float,
            seed: int, workers: int, told: Told | None = None) -> tuple[NominalMisfit, Judgement]:
    """Judged as :func:`judge` does, with what is ``told`` of the noise.

    By default what the nominal model's misfit tells.
    """
    generator, wandering, no_sensor = np.random.default_rng(seed), 0.0, False
    misfit, tests = NominalMisfit.of(simulation, table, causes, workers, told)
    if not tests.able:
        raise ArithmeticError(TOO_FEW)
    found = table.noise if table.noise.found else None
    test = tests(misfit.fit.residual, generator, found)
    if told is None and test.p_value < ALARM and misfit.simulation.loaded:
        remembering = misfit.with_noise_told(causes, remembers=True)
        if remembering is not misfit:
            misfit = remembering
            test = misfit.tests(causes)(misfit.fit.residual, generator, found)
        if test.p_value < ALARM and misfit.stated.source in UNSTATED:
            wandering, no_sensor = _wandering(misfit, causes, generator)
    misfit = misfit.louder(test.noise)
    simulation, table, nominal = misfit.simulation, misfit.table, misfit.fit
    signs = misfit.signatures(causes)
    invisible, classes = classes_of(signs)
    base = Judgement("nothing", simulation, table, nominal, test, misfit.patterns, signs,
                     misfit.told, indistinguishable=classes, invisible=invisible,
                     wandering=wandering, no_sensor=no_sensor, scatter=misfit.scatter)
    if test.p_value >= ALARM:
        return misfit, (base if nominal.usual >= UNUSUAL
                        else replace(base, verdict="unexplained"))
    adequacy = _Adequacy(base, found or table.noise.known(test.freedom), generator)
    possible = tuple(cause for cause in causes if cause not in invisible
                     or shows_when_large(simulation, cause, nominal, table))
    exploration = Exploration(simulation, table, nominal, possible, adequacy.enough, widen, workers)
    exploration.run()
    return misfit, _weighed(replace(base, simulation=exploration.simulation), exploration,
                            adequacy)


def _wandering(misfit: NominalMisfit, causes: Sequence[Cause], generator: np.random.Generator
               ) -> tuple[float, bool]:
    """Size of errors that remember, however large, if they explain the misfit, else 0.

    And whether a cause is much more probable.
    """
    unknown = misfit.of_unknown_noise
    free = unknown.as_a_sensor_that_wanders()
    if not (free.told.correlation and free.fit.possible):
        return 0.0, False
    test = free.tests(causes)(free.fit.residual, generator, None)
    lengths = free.table.lengths
    size = test.noise * float(np.median(free.table.sigma[lengths])) if lengths.any() else 0.0
    if test.p_value < ALARM:
        return 0.0, False
    beside = unknown.with_noise_told(causes, remembers=True, most=np.inf)
    return size, not beside.told.correlation


def _told_by(misfit: NominalMisfit, judged: Judgement) -> Told:
    """Noise by which all fits together were judged, as they show it."""
    if judged.posterior is None:
        return misfit.told
    fits = [misfit.fit, *judged.posterior.fits[: _ASKED[0]], *judged.alone[: _ASKED[1]]]
    return misfit.noise_told([misfit.missed_by(fit) for fit in fits], judged.simulation.loaded)


def _with_labels(base: Judgement, misfit: NominalMisfit) -> Judgement:
    """Judgement with other labels that explain as much as any effects do, if there are such."""
    if not misfit.simulation.loaded:
        return base
    every = base.fits
    table = misfit.table
    if misfit.told.anything:
        # Other labels may explain what was taken for readings that are off by themselves.
        loudness = float(np.median(table.sigma / misfit.told.of(misfit.stated).sigma))
        table = table.with_noise(misfit.stated.with_sigma(loudness * misfit.stated.sigma))

    def missed(one: Fit) -> float:
        return float(np.sum(table.noise.whitened(misfit.missed_by(one).residual) ** 2))

    most = min(min(map(missed, every), default=np.inf) + MORE, _own_film(base, table) - EXCLUDED)
    singles = sorted((fit for fit in base.alone if fit.possible), key=lambda fit: fit.chi_squared)
    found = list[Relabelling]()
    for fitted in (misfit.fit, *singles[:_BESIDE]):
        if misfit.told.anything:
            fitted = fit(base.simulation, fitted.hypothesis, table, fitted.unknowns)
        relabelling = relabelling_of(base.simulation, table, fitted)
        if relabelling and relabelling.after < most:
            found.append(relabelling)
            if relabelling.plain:
                break
    best = min(found, key=lambda one: one.after + EXCLUDED * len(one.hypothesis), default=None)
    return replace(base, relabelling=best)


def _own_film(base: Judgement, table: ReadingTable) -> float:
    """χ² with factors of its own for the film of the odd specimen; infinite where there is none."""
    odd = [base.simulation.setup.specimens[number].name == base.odd_specimen
           for number in table.specimen.tolist()]
    if not any(odd):
        return np.inf
    fits = [fit(base.simulation, (), table[rows].compact(), base.nominal.unknowns)
            for rows in (np.array(odd), ~np.array(odd))]
    return sum(one.chi_squared for one in fits) if all(one.possible for one in fits) else np.inf


@dataclass
class _Adequacy:
    """Tests whether what a hypothesis leaves is noise, known as well as before."""

    base: Judgement
    noise: Noise
    generator: np.random.Generator
    results: dict[Fit, TestResult] = field(default_factory=dict)

    def of(self, fit: Fit) -> TestResult:
        """The test of a fit, done once."""
        if fit not in self.results:
            self.results[fit] = self._test(fit, np.full(len(self.base.table), True))
        return self.results[fit]

    def _test(self, fit: Fit, rows: Mask) -> TestResult:
        """The test of a fit to some of the readings."""
        columns = {name: fit.whitened(values[rows]) for name, values in over(
            self.base.patterns, self.base.table).items() if values[rows].any()}
        tests = ResidualTests.of(fit.whitened(fit.free_jacobian), columns, stated=0.0)
        return tests(fit.whitened(fit.residual), self.generator, self.noise[rows])

    def odd_specimen(self) -> str:
        """Specimen, of three or more, without which the nominal model leaves noise; "" if none."""
        table, simulation = self.base.table, self.base.simulation
        numbers = np.unique(table.specimen)
        if not simulation.loaded or len(numbers) < _OTHERS + 1:
            return ""
        odd = [number for number in numbers.tolist() if self._noise_alone(table.specimen != number)]
        return simulation.setup.specimens[odd[0]].name if len(odd) == 1 else ""

    def _noise_alone(self, rows: Mask) -> bool:
        """Whether the nominal model may leave noise of some of the readings."""
        others = fit(self.base.simulation, (), self.base.table[rows].compact(),
                     self.base.nominal.unknowns)
        return others.possible and self._test(others, rows).p_value >= ALARM

    def enough(self, fit: Fit) -> bool:
        """Whether it may be noise."""
        return self.of(fit).p_value >= ALARM


def _weighed(base: Judgement, exploration: Exploration, adequacy: _Adequacy) -> Judgement:
    """The verdict when something is wrong."""
    columns = over(base.patterns, base.table)
    singles = tuple(exploration.alone(SCALES[-1]))
    ranked = exploration.ranked()
    best_fitting = sorted(ranked, key=lambda fit: fit.chi_squared)
    asked = dict.fromkeys([*ranked[: _ASKED[0]], *best_fitting[: _ASKED[1]]])
    enough = {fit.hypothesis for fit in asked if adequacy.enough(fit)}
    # What leaves more than noise is no explanation while something else leaves noise alone.
    out = {fit.hypothesis for fit in asked if enough and adequacy.of(fit).p_value < HARDLY}

    among = hypotheses_of(exploration.causes)
    kept = [fit for fit in ranked
            if fit.hypothesis not in out and not _twice_told(fit, exploration, base)]
    odds = {fit.hypothesis: odds_of_more(fit, columns) for fit in asked if fit in kept}
    if not kept:
        odds = {(): odds_of_more(base.nominal, columns)}
    posterior = Posterior.of(base.nominal, kept, odds, among)
    best = next(iter(posterior.fits), base.nominal)
    weighed = replace(base, posterior=posterior, after=adequacy.of(best), alone=singles,
                      suspects=_causes(posterior.credible()))
    explaining = [fit for fit in asked if fit.hypothesis in enough]
    if all(len(fit.hypothesis) > 1 for fit in explaining):
        weighed = replace(weighed, odd_specimen=adequacy.odd_specimen())
    if weighed.odd_specimen and not any(map(_usual, explaining)):
        return replace(weighed, verdict="unexplained")
    if not enough or posterior.discrepancy > DISCREPANCY:
        return _on_a_rough_bench(replace(weighed, verdict="unexplained"), exploration, adequacy)
    scaled = {scale: Posterior.of(base.nominal, [
        replace(fit, evidence=evidence(fit, scale * exploration.widen)) for fit in kept], odds,
        among) for scale in SCALES}
    robust = {scale: _sure(posterior) for scale, posterior in scaled.items()}
    sure = robust[1.0]
    alone = posterior.fit_of(sure) if sure else None
    rivals = () if alone is None else _rivals(alone, singles, adequacy)
    unknown = {scale: posterior.discrepancy for scale, posterior in scaled.items()}
    # One that may be of no size is a doubt, but no alternative.
    seen = tuple(fit for fit in rivals if has_size(fit, fit.hypothesis[0]))
    suspects = tuple(dict.fromkeys([*weighed.suspects, *_causes(seen)]))
    weighed = replace(weighed, robust=robust, unknown=unknown, rivals=seen, suspects=suspects)
    firm = len({frozenset(names) for names in robust.values()}) == 1
    doubted = posterior.discrepancy > DOUBTED * posterior.wrong or (
        alone is not None and len(sure) > 1
        and log_odds_to_smooth(alone, base.nominal, columns, among) < PAIRED)
    # Two causes that one specimen alone shows may be anything that is wrong with this one.
    of_one = len(sure) > 1 and weighed.odd_specimen
    if alone is None or rivals or doubted or of_one or not firm or not adequacy.enough(alone):
        return replace(weighed, verdict="ambiguous")
    return replace(weighed, verdict="named", named=sure, odd_specimen="")


def _on_a_rough_bench(base: Judgement, exploration: Exploration, adequacy: _Adequacy) -> Judgement:
    """An unexplained misfit, where causes and small errors of every kind beside them explain it.

    A cause that stands out from these is named.
    """
    posterior, among = base.posterior, hypotheses_of(exploration.causes)
    assert posterior is not None
    bench = RoughBench.of((base.nominal, *posterior.fits), base.signatures, among,
                          exploration.widen)
    if bench.small < SURE:
        return base
    again, best = bench.again(base.simulation, base.table, exploration.widen)
    if not adequacy.enough(best):
        return base
    robust = {scale: bench.widened(scale * exploration.widen).sure(SURE) for scale in SCALES}
    sure = tuple(cause for cause in robust[1.0]
                 if all(cause in others for others in robust.values()))
    # The fewest causes that explain it: where they alone do, what else is likely is not told.
    alone = again.fit_of(sure)
    chosen = alone if alone is not None and adequacy.enough(alone) else best
    share = bench.share(chosen.hypothesis)
    rough = replace(base, small_errors=share if share <= SMALL else None)
    if not sure or share > SMALL or not set(sure) <= set(chosen.hypothesis) or near_rivals(
            chosen, base.alone, base.signatures, share, EXCLUDED):
        return rough
    return replace(rough, verdict="named", named=sure, posterior=again, robust=robust,
                   after=adequacy.of(chosen), suspects=_causes(again.credible()), odd_specimen="")


def _usual(fit: Fit) -> bool:
    """Whether it is of one cause, or of two that are not both far from their usual sizes."""
    return len(fit.hypothesis) < 2 or min(map(fit.surprise, fit.hypothesis)) < SURPRISING


def _twice_told(fit: Fit, exploration: Exploration, base: Judgement) -> bool:
    """Whether it is of two causes that cannot be told apart and say no more than one of them."""
    causes = set(fit.hypothesis)
    if len(causes) < 2 or not any(causes <= set(group) for group in base.indistinguishable):
        return False
    singles = [exploration.fits[cause,].chi_squared for cause in fit.hypothesis]
    return fit.chi_squared > min(singles) - MORE


def _sure(posterior: Posterior) -> tuple[Cause, ...]:
    """Causes of which the library is sure, if it is one of its effects at all."""
    return tuple(cause for cause, share in posterior.in_library().items() if share >= SURE)


def _rivals(fit: Fit, singles: Sequence[Fit], adequacy: _Adequacy) -> tuple[Fit, ...]:
    """Effects that explain the readings as well alone, if they may have the size for it."""
    return tuple(other for other in singles if other.hypothesis[0] not in fit.hypothesis
                 and other.chi_squared < fit.chi_squared + EXCLUDED and adequacy.enough(other))


def _causes(fits: Sequence[Fit]) -> tuple[Cause, ...]:
    return tuple(dict.fromkeys(cause for fit in fits for cause in fit.hypothesis))
