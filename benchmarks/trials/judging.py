"""What the truth allows to be known of readings, and what a diagnosis makes of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.trials.record import Record
from benchmarks.trials.synthetic_trials import Design, Truth, readings
from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.studies.diagnosis.calibration import calibrated, with_effects
from tympan.studies.diagnosis.explanations.labels import other_labels
from tympan.studies.diagnosis.explanations.registry import explanation_of
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit, nominal_fit
from tympan.studies.diagnosis.gain import GainReport, SplitGain, gain_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.exploration import Exploration
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.patterns.reading_patterns import PATTERNS
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.self_check import grown_to
from tympan.studies.diagnosis.sentences import where

#: Widths of the priors for fits to readings without noise, where only the readings are to count.
_LOOSE = 5.0
#: Populations whose sizes are drawn from the priors, so that intervals must have them.
_AS_DRAWN = ("single", "strong", "pair", "duo", "form")


def stands_out(simulation: Simulation, truth: Truth, exact: ReadingTable,
               causes: Sequence[Cause], judgement: Judgement | None = None,
               pairs: bool = False) -> tuple[float, float]:
    """χ² by which the nominal model, and the best rival, miss readings without noise more than the
    truth does.

    Rivals are single effects, or ``pairs`` too, explored as in a diagnosis; single ones start where
    a judgement of the readings with noise had them. They are not asked for an effect that cannot be
    seen, nor further ones once the effect is not told from one.
    """
    simulation, unknowns = grown_to(simulation, truth.hypothesis, truth.unknowns)
    nominal = fit(simulation, (), exact)
    if not nominal.possible:
        return 0.0, 0.0
    of_truth = fit(simulation, truth.hypothesis, exact, unknowns, _LOOSE).chi_squared
    seen, apart = nominal.chi_squared - of_truth, np.inf
    if seen < SEEN:
        return seen, 0.0
    if pairs:
        fits = _explored(simulation, causes, exact, nominal, of_truth + TOLD)
        return seen, min(fit.chi_squared - of_truth for fit in fits
                         if set(fit.hypothesis) != set(truth.hypothesis))
    starts = {} if judgement is None else {
        single.hypothesis: single.unknowns for single in judgement.weighed.alone}
    for rival in ((cause,) for cause in causes if (cause,) != truth.hypothesis):
        first = fit(simulation, rival, exact, starts.get(rival, nominal.unknowns))
        best = fit(simulation, rival, exact, first.unknowns, _LOOSE)
        apart = min([apart, *(attempt.chi_squared - of_truth for attempt in (first, best)
                              if attempt.possible)])
        if apart < TOLD:
            break
    return seen, float(apart)


def best_of(simulation: Simulation, causes: Sequence[Cause], exact: ReadingTable) -> float:
    """χ² by which the best of the library, as far as it goes, misses readings without noise."""
    nominal = fit(simulation, (), exact)
    if not nominal.possible or nominal.chi_squared < SEEN:
        return nominal.chi_squared if nominal.possible else 0.0
    return min(fit.chi_squared for fit in _explored(simulation, causes, exact, nominal, SEEN))


def _explored(simulation: Simulation, causes: Sequence[Cause], exact: ReadingTable,
              nominal: Fit, enough: float) -> list[Fit]:
    """Every cause and two together, fitted where only the readings count.

    As far as they go while none has a χ² below ``enough``, from there on as in a diagnosis.
    """
    exploration = Exploration(simulation, exact, nominal, causes,
                              lambda fitted: fitted.chi_squared < enough, _LOOSE)
    exploration.run()
    return exploration.ranked()


def judged(record: Record, design: Design, simulation: Simulation, table: ReadingTable,
           truth: Truth, widen: float = 1.0) -> tuple[Record, Judgement | None]:
    """The record with what the diagnosis said of a table, and that; None where it refused."""
    return concluded(record, truth, lambda: judge(*fitted_to(simulation, table), design.causes,
                                                  widen=widen, seed=record.number))


def concluded(record: Record, truth: Truth, ask: Callable[[], Judgement]
              ) -> tuple[Record, Judgement | None]:
    """The record with what a diagnosis says when it is asked, and that; None where it refuses."""
    record = replace(record, widths=record.widths or truth.widths)
    try:
        judgement = ask()
    except (ArithmeticError, InputError) as error:
        return replace(record, words=str(error)), None
    p_values = judgement.test.p_values
    # The least probable pattern, one of few columns where there is a choice.
    strongest = min([name for name in p_values if name != "ramps"] or p_values, key=p_values.get)
    record = replace(record, verdict=judgement.verdict, named=tuple(map(str, judgement.named)),
                     listed=tuple(map(str, judgement.weighed.suspects)),
                     p_value=judgement.test.p_value, noise=judgement.test.noise, words=strongest)
    asked = truth.hypothesis and record.population in _AS_DRAWN
    if asked:
        record = replace(record, inside=_inside(judgement, truth))
    if judgement.posterior is None or judgement.weighed.after is None:
        return record, judgement
    posterior = judgement.posterior
    ranked = tuple((str(cause), float(share))
                   for cause, share in list(posterior.of_causes().items())[:5])
    seen = set(truth.hypothesis) - set(judgement.misfit.invisible)
    covered = any(set(candidate.hypothesis) - set(judgement.misfit.invisible) == seen
                  for candidate in posterior.credible()) if asked else None
    return replace(record, ranked=ranked, best=tuple(map(str, posterior.fits[0].hypothesis)),
                   wrong=posterior.wrong, unknown=posterior.discrepancy,
                   after=judgement.weighed.after.p_value, covered=covered), judgement


def gained(record: Record, design: Design, truth: Truth, judgement: Judgement | None) -> Record:
    """The record with what the extended model is said to gain on other readings, and gains.

    The latter at states like those held out under a mass between those that were read, where the
    films have equilibria there.
    """
    if judgement is None:
        return record
    simulation = judgement.simulation
    assert isinstance(simulation, Simulation)
    report = gain_of(simulation, judgement.table, design.causes, judgement, record.number)
    gain, within = report.overall, report.predictive
    record = replace(
        record, ratio=None if gain is None else gain.ratio,
        limits=() if gain is None or gain.low is None or gain.high is None
        else (gain.low, gain.high),
        predicted=() if within is None else (
            round(within.coverage_95 * within.readings), within.readings))
    # Labels that a stranger makes wrong are those of the rows that were read.
    between = design.between()
    exact = readings(between, truth) if record.limits and truth.hypothesis else None
    if exact is None:
        return record
    table = between.table.with_values(exact)
    return replace(record, held=ratio_of(
        simulation, report, lambda split: _like(split, judgement.table, table)))


def ratio_of(simulation: Simulation, report: GainReport,
             exact: Callable[[SplitGain], ReadingTable]) -> float | None:
    """What extended models miss of exact readings, over what nominal ones do, of those of a split.

    None where no split has any.
    """
    missed = [_missed(simulation, split, exact(split)) for split in report.splits if not split.note]
    before, after = np.hstack(missed) if missed else np.empty((2, 0))
    return float(np.linalg.norm(after) / np.linalg.norm(before)) if len(before) else None


def _like(split: SplitGain, read: ReadingTable, between: ReadingTable) -> ReadingTable:
    """States like those that a split holds out.

    A specimen held out is so under the other mass, and a voltage above all others; for a mass held
    out the mass between stands.
    """
    there = np.ones(len(between), bool)
    if split.kind in ("shape", "specimen"):
        there = np.isin(between.specimen, read.specimen[split.rows])
    elif split.kind == "voltage":
        there = np.abs(between.voltage) >= np.abs(read.voltage[split.rows]).min()
    return between[there].compact()


def _missed(simulation: Simulation, split: SplitGain, table: ReadingTable) -> Array:
    """What a split's nominal and extended models miss of exact readings, (2, n)."""
    errors = np.array([table.value - simulation.predict(model.hypothesis, model.unknowns, table)
                       for model in split.models])
    return errors[:, np.isfinite(errors).all(axis=0)]


#: Columns that effects of the library are about, of all specimens.
_COLUMNS = {"voltage_sag": "voltage", "amplifier_gain": "voltage", "hysteresis": "voltage",
            "unaccounted_mass": "mass", "sensor_gain": "displacement",
            "sensor_zero": "displacement", "drift": "displacement"}
#: The same of patterns of a misfit.
_PATTERNS = {"voltage": "voltage", "mass": "mass", "fitted": "displacement",
             "level": "displacement", "order": "displacement", "time": "displacement"}


def blamed(judgement: Judgement) -> set[str]:
    """The specimens and columns that a page says something is wrong with, by what it says.

    Labels that look wrong are of a column; a misfit is where its sentence says; a cause that is
    named or listed is of a specimen, or of a column.
    """
    if judgement.verdict == "nothing":
        return set()
    explanation = explanation_of(judgement)
    fault = None if explanation is None else explanation.finding
    if fault is not None and fault.kind == "labels":
        labels = other_labels(judgement)
        assert labels is not None
        return {labels.column}
    sentence = "" if explanation is None else explanation.what
    if judgement.verdict == "unexplained":
        sentence = sentence or where(judgement)
        found = {column for pattern, column in _PATTERNS.items()
                 if PATTERNS[pattern].what in sentence}
    else:
        causes = judgement.named or judgement.weighed.suspects
        found = {name for cause in causes
                 if (name := cause.which or _COLUMNS.get(cause.name, ""))}
    names = [specimen.name for specimen in judgement.simulation.setup.specimens]
    return found | {name for name in names if re.search(rf"(?<![\w-]){name}(?![\w-])", sentence)}


def fitted_to(simulation: Simulation, table: ReadingTable) -> tuple[Simulation, ReadingTable]:
    """The simulation, or, where readings are beyond it, one made for them as a diagnosis does.

    And the readings that it can be at.
    """
    nominal = nominal_fit(simulation, table)
    if nominal.possible and table.value.max() < min(law.grid.deflection for law in simulation.laws):
        return simulation, table
    made = calibrated(simulation.setup, table)
    return with_effects(made.simulation, lambda done, count: None, 1), made.table


def _inside(judgement: Judgement, truth: Truth) -> tuple[bool, ...]:
    """Whether the true sizes are within their 95 % intervals if it is known what to look for."""
    further, unknowns = grown_to(judgement.simulation, truth.hypothesis, truth.unknowns)
    fitted = fit(further, truth.hypothesis, judgement.table, unknowns)
    if not fitted.possible:
        return tuple(False for _ in truth.sizes)
    limits = [interval(fitted, 2 + number)[1:] for number in range(len(truth.sizes))]
    sizes = [abs(size) if fitted.bounds[0, 2 + number] >= 0 else size
             for number, size in enumerate(truth.sizes)]
    return tuple(low <= size <= high for size, (low, high) in zip(sizes, limits, strict=True))


