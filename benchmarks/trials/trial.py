"""One trial: something hidden in readings, what the truth allows to be known, and what the
diagnosis made of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.trials.judging import best_of, blamed, gained, judged, stands_out
from benchmarks.trials.mess import MESSES, Mess
from benchmarks.trials.random_designs import random_design, written
from benchmarks.trials.record import Record
from benchmarks.trials.strata.trials import STRATA, stratum_trial
from benchmarks.trials.synthetic_trials import (
    ALIASES,
    LOOP,
    NOISE,
    Array,
    Design,
    Means,
    Stranger,
    Truth,
    circles,
    draw,
    draw_rough,
    drawn_until,
    hidden,
    paper,
    readings,
)
from benchmarks.trials.unmodelled_faults import FURTHER, STRANGERS, Draw, Label
from tympan.base.errors import InputError
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import conclude
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis, hypotheses_of
from tympan.studies.diagnosis.inference.families import one_load_instead
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.self_check import grown_to
from tympan.studies.estimation.noise import Noise, Shared, root_of

_NOISES = (NOISE, NOISE, NOISE, NOISE / 2, 2 * NOISE)
_MISJUDGED = 1.5
#: Numbers of random designs that stand in for those without equilibria begin here.
_OTHERS = 100_000

#: Sizes over the usual ones of single effects of any size, and of two.
SIZES_DRAWN, PAIRS_DRAWN = (0.3, 20.0), (1.0, 10.0)
#: What is judged also by priors of another scale, and by how much it is wrong.
WRONG_SCALES = {"large, priors a fifth as wide": 0.2, "large, priors five times as wide": 5.0}

#: Effects that look alike, of which both are hidden in a map, and their sizes over the usual ones.
ALIAS_PAIRS = (("parallel_spring", "prestretch_anisotropy"),
               ("electrode_stiffness", "strain_stiffening"),
               ("plate_eccentricity", "prestretch_anisotropy"))
MAP_WIDTHS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)


@dataclass(frozen=True, eq=False)
class Lab:
    """The designs with their fitted models, made when they are first asked for by so many workers,
    and the study's seed; ``loops`` are the paper's up and down."""

    seed: int
    workers: int = 1

    @cached_property
    def paper(self) -> tuple[Design, Simulation]:
        design = paper()
        return design, design.simulation(self.workers)

    @cached_property
    def loops(self) -> tuple[Design, Simulation]:
        return paper(LOOP), self.paper[1]

    @cached_property
    def circles(self) -> tuple[Design, Simulation]:
        design = circles()
        return design, design.simulation(self.workers)

    def run(self, population: str, number: int) -> list[Record]:
        """The trial of that number."""
        generator = np.random.default_rng([self.seed, list(POPULATIONS).index(population), number])
        return POPULATIONS[population](self, generator, number)

    def by(self, number: int) -> tuple[Design, Simulation, Means]:
        """Elements in half of the trials, half of these up and down, the equations and another law
        in a quarter."""
        means: Means = ("elements", "equations", "elements", "another law")[number % 4]
        return (*(self.paper, self.circles, self.loops, self.paper)[number % 4], means)


def measured(design: Design, values: Array, generator: np.random.Generator | None,
             number: int) -> ReadingTable:
    """Readings with the noise of that trial, and its standard deviation; without a generator only
    the latter."""
    sigma = _NOISES[number // 4 % len(_NOISES)]
    noise = 0.0 if generator is None else generator.normal(0, sigma, len(values))
    return design.table.with_sigma(np.full(len(values), sigma)).with_values(values + noise)


def _null(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    design, simulation, means = lab.by(number)
    truth, values, again = hidden(design, generator, (), means)
    record = Record("null", number, means, (), again, 0.0, 0.0)
    table = measured(design, values, generator, number)
    return [judged(record, design, simulation, table, truth)[0]]


def _single(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    design, simulation, means = lab.by(number)
    causes = _visible(design)
    hypothesis = (causes[int(generator.integers(len(causes)))],)
    truth, values, again = hidden(design, generator, hypothesis, means)
    return [_of_some("single", number, design, simulation, truth,
                    measured(design, values, generator, number), values,
                    again)]


def _strong(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """An effect drawn until the fitted model foretells that it stands out."""
    design, simulation, means = lab.by(number)
    truth, values, again = _foretold(design, simulation, [(cause,) for cause in _visible(design)],
                                     means, generator,
                                     number)
    table = measured(design, values, generator, number)
    record = _of_some("strong", number, design, simulation, truth, table, values, again)
    return [record, *(_deleted(record, design, simulation, table, truth) if number % 2 else ())]


def _gain(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """An effect that stands out, and what the model extended by causes chosen without them gains on
    other readings."""
    design, simulation, means = lab.by(number)
    truth, values, again = _foretold(design, simulation, [(cause,) for cause in _visible(design)],
                                     means, generator,
                                     number)
    table = measured(design, values, generator, number)
    record = Record("gain", number, means, tuple(map(str, truth.hypothesis)), again, 0.0, 0.0)
    finished, verdict = judged(record, design, simulation, table, truth)
    further = simulation if verdict is None else verdict.simulation
    seen, apart = stands_out(further, truth, table.with_values(values), _visible(design), verdict)
    return [gained(replace(finished, seen=seen, told=apart), design, truth, verdict)]


def _foretold(design: Design, simulation: Simulation, choice: Sequence[Hypothesis], means: Means,
              generator: np.random.Generator, number: int) -> tuple[Truth, Array, int]:
    """A truth that the fitted model foretells to stand out among single effects, its readings, and
    draws without."""
    again = 0
    while True:
        truth = draw(generator, choice[int(generator.integers(len(choice)))], means)
        further, unknowns = grown_to(simulation, truth.hypothesis, truth.unknowns)
        exact = measured(design, further.predict(truth.hypothesis, unknowns, design.table),
                         None, number)
        if not np.isfinite(exact.value).all():
            again += 1
            continue
        seen, apart = stands_out(further, truth, exact, _visible(design))
        if seen >= SEEN and apart >= TOLD:
            values = readings(design, truth)
            if values is not None:
                return truth, values, again
            again += 1


def _visible(design: Design) -> list[Cause]:
    return [cause for cause in design.causes if cause.name not in ALIASES]


def _of_some(population: str, number: int, design: Design, simulation: Simulation, truth: Truth,
             table: ReadingTable, values: Array, again: int) -> Record:
    """A trial with effects, and whether they stand out among the others."""
    record = Record(population, number, truth.means, tuple(map(str, truth.hypothesis)), again, 0.0,
                    0.0)
    finished, judgement = judged(record, design, simulation, table, truth)
    further = simulation if judgement is None else judgement.simulation
    seen, apart = stands_out(further, truth, table.with_values(values), _visible(design), judgement,
                             pairs=len(truth.hypothesis) > 1)
    return replace(finished, seen=seen, told=apart)


def _deleted(record: Record, design: Design, simulation: Simulation, table: ReadingTable,
             truth: Truth) -> list[Record]:
    """The same readings with the true effect not in the library, if it is identifiable."""
    if not record.identifiable:
        return []
    kept = tuple(cause for cause in design.causes if cause.name != truth.hypothesis[0].name)
    blank = Record("deleted", record.number, record.means, record.truth, record.again, record.seen,
                   record.told)
    return [judged(blank, replace(design, causes=kept), simulation, table, truth)[0]]


def _large(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """An effect of any size, judged also by priors whose scale is wrong."""
    design, simulation, means = lab.by(number)
    causes = _visible(design)
    hypothesis = (causes[int(generator.integers(len(causes)))],)
    truth, values, again = hidden(design, generator, hypothesis, means, widths=SIZES_DRAWN)
    table = measured(design, values, generator, number)
    records = [_of_some("large", number, design, simulation, truth, table, values, again)]
    for name, widen in WRONG_SCALES.items() if number % 2 == 0 else ():
        record = replace(_blank(records[0]), population=name)
        records.append(judged(record, design, simulation, table, truth, widen)[0])
    return records


def _large_pair(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """Two effects of the usual size or more."""
    design, simulation = lab.loops if number % 3 == 1 else lab.paper
    pairs = _pairs(design)
    truth, values, again = hidden(design, generator, pairs[int(generator.integers(len(pairs)))],
                                  "another law" if number % 3 == 2 else "elements",
                                  widths=PAIRS_DRAWN)
    return [_of_some("large pair", number, design, simulation, truth,
                    measured(design, values, generator, number), values, again)]


def _map(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """A cell of the map of two effects that look alike: readings by elements of both their sizes.
    """
    design, simulation = lab.paper
    pair, (first, second) = alias_cell(number)
    sizes = [(Cause(name), width) for name, width in zip(pair, (first, second), strict=True)
             if width]
    truth = Truth(1.0, 1.0, tuple(cause for cause, _ in sizes),
                  tuple(size for cause, width in sizes for size in _along(cause, width)))
    values = readings(design, truth)
    record = Record("map", number, "elements", tuple(map(str, truth.hypothesis)), 0, 0.0, 0.0,
                    widths=(first, second))
    if values is None:
        return [replace(record, verdict="no equilibrium")]
    return [judged(record, design, simulation, measured(design, values, generator, 0), truth)[0]]


def _random(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """A random design with readings of films that are not as stated, from files to the page."""
    again, folder = 0, None
    with TemporaryDirectory() as place:
        while folder is None:
            drawn = random_design(number + again * _OTHERS, lab.seed)
            folder = written(drawn, Path(place) / str(again))
            again += 1
        record = Record("random", number, "elements", (), again - 1, 0.0, 0.0, words=str(drawn))
        try:
            conclusions = conclude(read_dataset(folder), seed=number)
            conclusions.diagnosis().save(folder)
        except InputError as error:
            return [replace(record, words=f"{drawn}: {error}")]
        except Exception as error:  # that none raises is what is asked
            return [replace(record, verdict="raised",
                            words=f"{drawn}: {type(error).__name__}: {error}")]
    return [replace(record, verdict=conclusions.verdict, p_value=conclusions.judgement.test.p_value,
                    named=tuple(map(str, conclusions.judgement.named)))]


def _along(cause: Cause, width: float) -> tuple[float, ...]:
    """So many usual sizes, all in the first parameter."""
    parameters = cause.effect.parameters
    return (width * parameters[0].deviation, *(0.0 for _ in parameters[1:]))


def alias_cell(number: int) -> tuple[tuple[str, str], tuple[float, float]]:
    """The pair of effects and their sizes over the usual ones in a cell of the maps."""
    pair, cell = divmod(number, len(MAP_WIDTHS) ** 2)
    row, column = divmod(cell, len(MAP_WIDTHS))
    return ALIAS_PAIRS[pair], (MAP_WIDTHS[column], MAP_WIDTHS[row])


def _blank(record: Record) -> Record:
    """The same trial, not judged yet."""
    return Record(record.population, record.number, record.means, record.truth, record.again,
                  record.seen, record.told, widths=record.widths)


def _pair(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    design, simulation = lab.loops if number % 3 == 1 else lab.paper
    pairs = _pairs(design)
    means: Means = "another law" if number % 3 == 2 else "elements"
    truth, values, again = hidden(design, generator, pairs[int(generator.integers(len(pairs)))],
                                  means)
    return [_of_some("pair", number, design, simulation, truth,
                    measured(design, values, generator, number), values,
                    again)]


def _duo(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """Two effects drawn until the fitted model foretells that no single one will do."""
    design, simulation = lab.loops if number % 3 == 1 else lab.paper
    means: Means = "another law" if number % 3 == 2 else "elements"
    truth, values, again = _foretold(design, simulation, _pairs(design), means, generator, number)
    return [_of_some("duo", number, design, simulation, truth,
                    measured(design, values, generator, number), values,
                    again)]


def _pairs(design: Design) -> list[Hypothesis]:
    return [hypothesis for hypothesis in hypotheses_of(_visible(design)) if len(hypothesis) == 2]


def _outside(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """What the library lacks, of the first kinds, in readings of the paper's actuators."""
    return [_lacking("outside", STRANGERS, number, (*lab.paper, "elements"), generator)[0]]


def _strangers(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """The same of all kinds, on every bench; and what is told of where it is."""
    kinds = FURTHER | STRANGERS
    design, simulation, means = lab.by(number // len(kinds))
    bench = design, simulation, "elements" if means == "equations" else means
    record, truth, judgement = _lacking("strangers", kinds, number, bench, generator)
    stranger, told = truth.stranger, set() if judgement is None else blamed(judgement)
    if judgement is not None and len(judgement.named) == 1 and _said(stranger, judgement):
        record = replace(record, named=(), listed=record.named)
    if at_fault := stranger.at_fault:
        record = replace(record, rows=(int(at_fault in told), 1,
                                       len(told - {at_fault})))
    return [gained(record, design, truth, judgement)]


def _said(stranger: Stranger, judgement: Judgement) -> bool:
    """Whether what is named is said of the stranger, too, with its true size.

    Its family is told, and how much of what that measures; or the load that may weigh so much.
    """
    (cause,), fitted = judgement.named, judgement.chosen
    if isinstance(stranger, Label) and fitted is not None:
        loads = one_load_instead(fitted, cause, judgement.table, judgement.simulation.setup.rig)
        return any(low <= stranger.mass(label) <= high for label, (low, high) in loads.items()
                   if stranger.mass(label) != label)
    return (stranger.family is not None and cause.effect.family is stranger.family
            and (cause.which is None or cause.which == stranger.at_fault))


def _lacking(population: str, kinds: Mapping[str, Draw], number: int,
             bench: tuple[Design, Simulation, Means], generator: np.random.Generator
             ) -> tuple[Record, Truth, Judgement | None]:
    design, simulation, means = bench
    name = list(kinds)[number % len(kinds)]
    stranger = kinds[name](generator, design)
    truth, values, again = hidden(design, generator, (), means, stranger)
    table = measured(design, values, generator, number)
    record, judgement = judged(Record(population, number, means, (name,), again, 0.0, 0.0),
                                design, simulation, table, truth)
    further = simulation if judgement is None else judgement.simulation
    least = best_of(further, _visible(design), table.with_values(values))
    return replace(record, seen=least, told=least), truth, judgement


def _alias(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    design, simulation = lab.paper
    kind = number % 3
    effect = ("amplifier_gain", "unaccounted_mass", "drift" if number % 2 else "sensor_zero")[kind]
    if kind == 1:
        design = design.only(design.table.mass == design.table.mass[0])
    elif kind == 2:
        design = design.after(3 * 3600.0)
    truth, values, again = hidden(design, generator, (Cause(effect),), "elements")
    record = Record("alias", number, "elements", (effect,), again, 0.0, 0.0)
    finished, verdict = judged(record, design, simulation,
                                measured(design, values, generator, number), truth)
    if verdict is None:
        return [finished]
    group = {Cause("drift"), Cause("sensor_zero")}
    misfit = verdict.misfit
    reported = (any(group <= set(causes) for causes in misfit.indistinguishable) if kind == 2
                else Cause(effect) in misfit.invisible)
    return [replace(finished, reported=reported and not verdict.named)]


def _noise(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    design, simulation, means = lab.by(number)
    truth, values, again = hidden(design, generator, (), means)
    table = measured(design, values, generator, number)
    return [judged(Record(f"noise stated {words}", number, means, (), again, 0.0, 0.0), design,
                   simulation,
                   table.with_sigma(table.sigma * factor), truth)[0]
            for words, factor in (("too small", 1 / _MISJUDGED), ("too large", _MISJUDGED))]


def _form(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    design, simulation = lab.paper
    causes = _visible(design)
    hypothesis: Hypothesis = (causes[int(generator.integers(len(causes)))],) if number % 2 else ()
    truth, values, again = hidden(design, generator, hypothesis, "form error")
    table = measured(design, values, generator, number)
    if hypothesis:
        return [_of_some("form", number, design, simulation, truth, table, values, again)]
    record = Record("form", number, "form error", (), again, 0.0, 0.0)
    return [judged(record, design, simulation, table, truth)[0]]


def _rough(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """A bench where every effect is a little there, and in three of four trials one that is large.
    """
    design, simulation = lab.loops if number % 2 else lab.paper
    causes = tuple(_visible(design))
    large = (causes[int(generator.integers(len(causes)))],) if number % 4 else ()
    means: Means = "another law" if number % 4 == 2 else "elements"

    truth, values, again = drawn_until(
        partial(readings, design), lambda: draw_rough(generator, causes, large, means))
    record = Record("rough", number, means, tuple(map(str, large)), again, 0.0, 0.0)
    table = measured(design, values, generator, number)
    finished, verdict = judged(record, design, simulation, table, truth)
    by_itself = truth.of(large)
    finished = replace(finished, widths=by_itself.widths)
    if not large or (exact := readings(design, by_itself)) is None:
        return [finished]
    further = simulation if verdict is None else verdict.simulation
    seen, apart = stands_out(further, by_itself, table.with_values(exact), causes, verdict)
    return [replace(finished, seen=seen, told=apart)]


def _mess(lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    """Readings as benches make them, of each kind of mess in turn; in half of the trials with an
    effect that would stand out without, which is judged without, too."""
    kind = list(MESSES)[number % len(MESSES)]
    design, simulation, means = lab.by(number // len(MESSES))
    if number // len(MESSES) % 2:
        singles = [(cause,) for cause in _visible(design)]
        truth, values, again = _foretold(design, simulation, singles, means, generator, number)
    else:
        truth, values, again = hidden(design, generator, (), means)
    record = Record("mess", number, means, tuple(map(str, truth.hypothesis)), again, 0.0, 0.0)
    table = measured(design, values, None, number)
    errors, at_fault = MESSES[kind].draw(generator, len(values), float(table.sigma[0]))
    messy = table.with_values(values + errors)
    finished, verdict = judged(record, design, simulation, messy, truth)
    told = [] if verdict is None else np.flatnonzero(verdict.table.noise.off).tolist()
    hit = len({*told} & {*at_fault})
    finished = replace(finished, words=kind, rows=(hit, len(at_fault), len(told) - hit))
    if not truth.hypothesis:
        return [finished]
    finished = gained(finished, design, truth, verdict)
    clean = replace(_blank(record), population="mess, without")
    records = [finished, judged(clean, design, simulation,
                                measured(design, values, generator, number), truth)[0]]
    further = simulation if verdict is None else verdict.simulation
    # Each is identifiable or not by the errors that it has.
    exact = table.with_values(values)
    noises = exact.with_noise(_normal(exact.noise, MESSES[kind])), exact
    return [replace(one, seen=seen, told=apart) for one, (seen, apart) in zip(
        records, [stands_out(further, truth, known, _visible(design)) for known in noises],
        strict=True)]


def _normal(noise: Noise, mess: Mess) -> Noise:
    """Normal errors that tell as much as those of a kind of mess."""
    covariance = mess.covariance(len(noise))
    own = 0.5 * float(np.linalg.eigvalsh(covariance)[0])
    root = root_of(covariance - own * np.eye(len(noise)))
    return noise.times(own**0.5).plus(
        Shared.of(np.arange(len(noise)), noise.sigma[:, None] * root))


def _stratum(name: str, lab: Lab, generator: np.random.Generator, number: int) -> list[Record]:
    return stratum_trial(name, generator, number)


#: Strata that were added when others had been run: a population's place is part of its seeds.
_LATER = ("force",)

POPULATIONS: dict[str, Callable[[Lab, np.random.Generator, int], list[Record]]] = {
    "null": _null, "single": _single, "strong": _strong, "pair": _pair, "duo": _duo,
    "outside": _outside,
    "alias": _alias, "noise": _noise, "form": _form, "gain": _gain, "large": _large,
    "large pair": _large_pair, "map": _map, "random": _random,
    **{name: partial(_stratum, name) for name in STRATA if name not in _LATER}, "rough": _rough,
    "mess": _mess, "strangers": _strangers, **{name: partial(_stratum, name) for name in _LATER}}
