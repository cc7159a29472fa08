"""Trials with more kinds of evidence: an effect of any size hidden in files as a laboratory writes
them, each judged by its readings at rest alone and by all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.trials.judging import concluded, stands_out
from benchmarks.trials.record import Record
from benchmarks.trials.strata import steps, strips
from benchmarks.trials.strata.evidence import (
    Columns,
    Evidence,
    ReadingPlan,
    evidence,
    sheets,
    write_dataset,
)
from benchmarks.trials.strata.steps import StepPlan, step_evidence, step_sheets
from benchmarks.trials.strata.strips import StripPlan, strip_evidence, strip_sheet
from benchmarks.trials.synthetic_trials import (
    ALIASES,
    FINEST,
    NOISE,
    ROUND,
    Array,
    Means,
    Truth,
    circles,
    design,
    draw,
    draw_rough,
    drawn_until,
    paper,
    readings,
)
from tympan.fem.film.laws import Ogden
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.diagnosis.diagnose import judge_dataset
from tympan.studies.diagnosis.evidence.coupons import CouponTests
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.effects import EFFECTS
from tympan.studies.effects.effect import Observable

#: A part of a dataset that is judged.
View = Callable[[Dataset], Dataset]
Plan = ReadingPlan | StepPlan | StripPlan

#: Sizes over the usual ones.
SIZES = (0.3, 20.0)
#: Every so many trials nothing is hidden, and on a rough bench nothing large.
_NOTHING, _NOTHING_LARGE = 11, 4
_NOISES = (NOISE, NOISE / 2, 2 * NOISE)
_VOLTAGES = np.linspace(0.0, 5500.0, 8)

#: Effects of circular films by the equations, at rest and as they swing; and those that films by
#: elements do not have: what is one with another, what needs ramps both ways or moves in time, what
#: coupons or a tester alone show, and air, which they have by the diagnosis' own formula.
_ROUND = tuple(name for name in ROUND if name not in ALIASES)
_SWINGING = ("added_mass", "air_mass")
_NOT_BY_ELEMENTS = {*ALIASES, "friction", "hysteresis", "creep", "mounting_age",
                    "plate_damping", "series_resistance", "sensor_lag", "air_mass", "temperature",
                    "width_not_free", "width_not_held", "gauge_zero", "gauge_gain",
                    "displacement_zero", "tester_compliance"}


@dataclass(frozen=True)
class Question:
    """What a trial reads, by which means that is made, and of which effects one is hidden."""

    plan: Plan
    means: Means
    effects: tuple[str, ...]


@dataclass(frozen=True)
class Stratum:
    """Evidence beside readings at rest: what is asked in a trial of a number, and the ``views`` of
    its dataset that are judged, in words, "" for all there is.

    ``rough``: beside what is hidden, which is large, all else that is asked for is a little there.
    """

    ask: Callable[[int], Question]
    views: Mapping[str, View]
    rough: bool = False


def at_rest(dataset: Dataset) -> Dataset:
    """Its readings at rest alone."""
    return replace(dataset, frequencies=None, fields=None, transients=None, coupons=None,
                   forces=None)


def coupons_alone(dataset: Dataset) -> Dataset:
    """What was read of its film in no actuator."""
    return replace(at_rest(dataset), coupons=dataset.coupons, static=None)


def with_dwell(dataset: Dataset) -> Dataset:
    """The same, with how long each state was held."""
    return at_rest(dataset)


def without_dwell(dataset: Dataset) -> Dataset:
    """The same, as if each state had been held for ever."""
    alone = with_dwell(dataset)
    assert alone.static is not None
    values = {**alone.static.values, "dwell": np.full(len(alone.static), np.nan)}
    return replace(alone, static=replace(alone.static, values=values))


def uniaxial(dataset: Dataset) -> Dataset:
    """Strips that are pulled one way, alone."""
    assert dataset.coupons is not None
    return replace(dataset, coupons=dataset.coupons[dataset.coupons.mode == "uniaxial"])


def whole(dataset: Dataset) -> Dataset:
    """All of it."""
    return dataset


@cache
def _three(kind: str) -> ReadingPlan:
    """Three specimens, each tapped at the lowest voltage and in the middle."""
    named = circles() if kind == "circles" else paper()
    some = design(kind, named.setup.specimens, voltages=_VOLTAGES)
    tapped = np.isin(some.table.states.voltage, _VOLTAGES[[0, len(_VOLTAGES) // 2]])
    return ReadingPlan(some, tapped=np.flatnonzero(tapped))


@cache
def two(kind: str, tapped: bool = False) -> ReadingPlan:
    """Two specimens, lines over them under the heavier mass at the lowest and highest voltage."""
    film = Film(1e-3, (5**0.5, 5**0.5), Ogden((20e3,), (2.0,)), 4.7)
    other = Circle(60e-3) if kind == "circles" else Ellipse((60e-3, 45e-3))
    specimens = [Specimen(name, frame, Plate(Circle(10e-3)), film)
                 for name, frame in (("round", Circle(45e-3)), ("other", other))]
    some = design(kind, specimens, voltages=_VOLTAGES)
    states = some.table.states
    ends = np.isin(states.voltage, _VOLTAGES[[0, -1]])
    return ReadingPlan(some, scanned=np.flatnonzero(ends & (states.mass == states.mass.max())),
                       tapped=np.flatnonzero(ends if tapped else ends & False))


@cache
def _pulled() -> ReadingPlan:
    """Three circular films at rest, and at each end of their voltages in a tester."""
    some = design("circles", circles().setup.specimens, voltages=_VOLTAGES)
    return ReadingPlan(some, voltages=(0.0, 4000.0))


def _force(number: int) -> Question:
    """Effects of the actuators and of the tester by turns, so that each comes as often."""
    tester = ("gauge_zero", "displacement_zero", "tester_compliance")
    others = tuple(name for name in _ROUND if name != "electrode_mass")
    return Question(_pulled(), "equations", (others, tester)[number % 2])


def _by_turns(circular: Callable[[], ReadingPlan], others: Callable[[], ReadingPlan], number: int
              ) -> Question:
    """Circular films by the equations and others by elements, half of these of another law."""
    if number % 2 == 0:
        plan = circular()
        return Question(plan, "equations", _ROUND + _SWINGING * bool(len(plan.tapped)))
    plan = others()
    effects = tuple(name for name in EFFECTS if name not in _NOT_BY_ELEMENTS
                    and (len(plan.tapped) or name != "added_mass")
                    and (len(plan.scanned) or Observable.SHAPE not in EFFECTS[name].shows_in))
    # Of each effect now one law, now the other.
    return Question(plan, ("elements", "another law")[(number // 2 + number // 32) % 2], effects)


def _step(number: int) -> Question:
    """Slow steps of films with and without a stated branch, and fast ones, by turns."""
    means: Means = ("equations", "another law")[number // 3 % 2]
    if number % 3 == 2:
        return Question(steps.fast(), "equations", (*steps.FAST, *steps.AT_REST))
    if number % 3 == 1:
        return Question(steps.slow(steps.SLOW_BRANCH), means, ("mounting_age", *steps.AT_REST))
    return Question(steps.slow(), means, ("creep", *steps.AT_REST))


#: Noise of coupons as a share of the stress; None: of a laboratory that does not state it.
_SHARES = (0.01, 0.02, 0.04, None)


def _strips(number: int) -> Question:
    """Coupons at rest and in time by turns, of each effect by both means and with every noise."""
    runs, effects = ((strips.AT_REST, tuple(strips.EFFECTS_OF)),
                     (strips.IN_TIME, strips.SEEN_IN_TIME))[number % 2]
    turn = number // 2
    noise = _SHARES[turn // 2 % len(_SHARES)]
    means: tuple[Means, ...] = ("equations", "another law")
    plan = (strips.laboratory(_film_alone(), runs) if noise is None
            else StripPlan(_film_alone(), runs, (12, 24)[number % 2], noise))
    return Question(plan, means[(turn + turn // len(effects)) % 2], effects)


def _film(number: int) -> Question:
    """Coupons at rest of the film of two round actuators, whose own factors are others."""
    noise, batch = _SHARES[number // 2 % 3], np.random.default_rng(number).normal(1.0, 0.05, 2)
    plan = StripPlan(two("circles").design, strips.AT_REST, 12, noise, (batch[0], batch[1]))
    return Question(plan, "equations", (*_OF_FILM, "temperature", "width_not_free", *_OF_ACTUATORS))


#: Effects that actuators and coupons show, and those of actuators alone.
_OF_FILM = ("strain_stiffening", "second_invariant", "permittivity_stretch")
_OF_ACTUATORS = ("parallel_spring", "unaccounted_mass", "sensor_zero")
_film_alone = cache(strips.film_alone)
_TWICE = {"at rest": at_rest, "": whole}
STRATA: dict[str, Stratum] = {
    "frequencies": Stratum(partial(_by_turns, partial(_three, "circles"),
                                   partial(_three, "paper")), _TWICE),
    "lines": Stratum(partial(_by_turns, partial(two, "circles"), partial(two, "others")), _TWICE),
    "transients": Stratum(_step, {"at rest": without_dwell, "at rest, with dwell": with_dwell,
                                  "": whole}),
    "mixture": Stratum(partial(_by_turns, partial(two, "circles", True),
                               partial(two, "others", True)), _TWICE),
    "coupons": Stratum(_strips, {"uniaxial alone": uniaxial, "": whole}),
    "film": Stratum(_film, {"actuators alone": at_rest, "coupons alone": coupons_alone,
                            "": whole}),
    "rough transients": Stratum(_step, {"": whole}, rough=True),
    "force": Stratum(_force, _TWICE)}
#: Those whose rates are on a page of their own.
SMOOTH = tuple(name for name, stratum in STRATA.items() if not stratum.rough)


def population_of(stratum: str, view: str) -> str:
    """What records of a stratum are called that were judged by a view."""
    return f"{stratum}, {view}" if view else stratum


def stratum_trial(name: str, generator: np.random.Generator, number: int) -> list[Record]:
    """The records of a trial, one of each view."""
    stratum = STRATA[name]
    question = stratum.ask(number)
    hypothesis = _hidden(question, number, generator, stratum.rough)
    truth, read, again = drawn_until(partial(evidence_of, question.plan), lambda: _on_its_mesh(
        question, _drawn(generator, question, hypothesis, stratum.rough)))
    by_itself = truth.of(hypothesis)
    alone = evidence_of(question.plan, by_itself) if stratum.rough else read
    noise = _NOISES[number // 3 % len(_NOISES)]
    blank = Record(name, number, question.means, tuple(map(str, hypothesis)), again, 0.0, 0.0,
                   words=f"{by_itself.sizes}", widths=by_itself.widths)
    seed = int(generator.integers(2**32))
    with TemporaryDirectory() as place:
        noisy, exact = (
            None if values is None else
            dataset_of(Path(place) / words, question.plan, values, noise, seed, words == "exact")
            for words, values in (("noisy", read), ("exact", alone)))
        assert noisy is not None
        return [_judged(replace(blank, population=population_of(name, words)), by_itself,
                        view(noisy), exact and view(exact))
                for words, view in stratum.views.items()
                if view is not with_dwell or getattr(question.plan, "dwell", None)]


def _drawn(generator: np.random.Generator, question: Question, hypothesis: Hypothesis, rough: bool
           ) -> Truth:
    """What is hidden, and, on a rough bench, a little of all else that is asked for."""
    if not rough:
        return draw(generator, hypothesis, question.means, widths=SIZES)
    setup = question.plan.design.setup
    causes = [Cause(name, choice) for name in question.effects
              for choice in EFFECTS[name].choices(setup)]
    return draw_rough(generator, causes, hypothesis, question.means)


def _hidden(question: Question, number: int, generator: np.random.Generator, rough: bool
            ) -> Hypothesis:
    """Each effect in turn, in an order of no meaning, or nothing."""
    every = _NOTHING_LARGE if rough else _NOTHING
    if number % every == every - 1:
        return ()
    turns = 3 if isinstance(question.plan, StepPlan) else 2
    order = np.random.default_rng(len(question.plan.design.table)).permutation(question.effects)
    effect = EFFECTS[str(order[number // turns % len(order)])]
    choices = effect.choices(question.plan.design.setup)
    return (Cause(effect.name, choices[int(generator.integers(len(choices)))]),)


def _on_its_mesh(question: Question, truth: Truth) -> Truth:
    """Films' shapes are read of the finest mesh."""
    lines = isinstance(question.plan, ReadingPlan) and len(question.plan.scanned)
    return replace(truth, mesh=FINEST) if lines else truth


def evidence_of(plan: Plan, truth: Truth) -> Any | None:
    """What a plan reads without noise if that is the truth, None where something cannot be."""
    if isinstance(plan, StripPlan):
        heaves = readings(plan.design, truth) if len(plan.design.table) else np.zeros(0)
        stresses = strip_evidence(plan, truth)
        return None if heaves is None or stresses is None else (heaves, stresses)
    return step_evidence(plan, truth) if isinstance(plan, StepPlan) else evidence(plan, truth)


def dataset_of(folder: Path, plan: Plan, read: Any, noise: float, seed: int, exact: bool
               ) -> Dataset:
    """Written and read as any other; ``exact``: without the noise that is stated, but for that of
    samples in time, which is told by themselves."""
    random = np.random.default_rng(seed)
    files: dict[str, Columns]
    if isinstance(plan, StripPlan):
        heaves, stresses = read
        files = {"coupon.csv": strip_sheet(plan, stresses, random, exact)}
        if len(heaves):
            files |= sheets(ReadingPlan(plan.design), Evidence(heaves, {}, {}), noise,
                            None if exact else random)
    elif isinstance(plan, StepPlan):
        files = step_sheets(plan, read, noise, random, exact)
    else:
        files = sheets(plan, read, noise, None if exact else random)
    damping = plan.design.setup.rig.plate_damping
    head: dict[str, Any] = {"rig": {"plate_damping": f"{damping} N s/m"}} if damping else {}
    if isinstance(plan, StripPlan) and plan.differ:
        head["strip_scatter"] = plan.differ
    return read_dataset(write_dataset(folder, plan.design, files, noise, **head))


def _judged(record: Record, truth: Truth, dataset: Dataset, exact: Dataset | None) -> Record:
    """The record of a part of a dataset, with what the part without noise allows to be known.

    ``exact``: that of what is hidden alone, None where it cannot be.
    """
    prepared: list[PreparedReadings] = []

    def ask() -> Judgement:
        made, judgement, _ = judge_dataset(dataset, seed=record.number)
        prepared.append(made)
        return judgement

    finished, judgement = concluded(record, truth, ask)
    if judgement is None or exact is None or not truth.hypothesis:
        return finished
    table, clean = judgement.table, _without_noise(judgement, exact)
    # Readings that were left out as impossible leave those with noise.
    if len(clean) == len(table):
        table = table.with_values(clean)
    causes = [cause for cause in prepared[0].causes if cause.name not in ALIASES]
    seen, apart = stands_out(judgement.simulation, truth, table, causes, judgement)
    return replace(finished, seen=seen, told=apart, words=f"{record.words} {finished.words}")


def _without_noise(judgement: Judgement, exact: Dataset) -> Array:
    """Values of a part without noise, as those that were judged are."""
    kinds = judgement.simulation.evidence
    values = [prepared_readings(exact).table.value] if kinds[0].loaded else []
    values += [exact.coupons.stress[kind.rows] for kind in kinds if isinstance(kind, CouponTests)]
    return np.concatenate(values)
