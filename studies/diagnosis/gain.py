"""Gain of the extended model on held-out shapes, masses, specimens and voltages.

Readings of one ramp share mounting, creep and offset, so single readings are never held out. On
each split the cause is chosen and fitted on the training part only. Within a class of causes that
these readings cannot distinguish, a gain does not support one name: an alias gains as much as the
true cause.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.diagnosis.evidence.kind import Predicts, ReadingModel, Split
from tympan.studies.diagnosis.fits.first_order import FirstOrder
from tympan.studies.diagnosis.fits.fit import Fit, best_of
from tympan.studies.diagnosis.fits.fitting import fit, nominal_fit
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis, hypotheses_of
from tympan.studies.diagnosis.inference.exploration import pair_starts
from tympan.studies.diagnosis.inference.identifiability import SAME, signatures, visibility
from tympan.studies.diagnosis.inference.posterior import NOTHING, priors
from tympan.studies.diagnosis.inference.predictive import SHARE, Predictive
from tympan.studies.diagnosis.inference.smooth_misfit import Discrepancy, GaussianProcess
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import UNITS, ReadingTable, Unit
from tympan.studies.diagnosis.result import Coverage, Gain, GainOfKind, HeldOut

#: Kinds of splits whose levels are held out all at once.
_AT_ONCE = ("voltage", "stretch")

#: Fewest readings that must be left for training: stiffness, permittivity and an effect are fitted
#: to them.
_FEWEST_ROWS = 6
#: Fewest shapes, masses or ramps that must be left.
_FEWEST_LEFT = 2
#: Fewest held-out ramps for an interval: it is found by resampling ramps.
_FEWEST_RAMPS = 3
#: Number of the most probable effects that are fitted in pairs. It limits the cost.
_SHORTLIST = 5
#: Probability from which a hypothesis is fitted with the model, not only weighed to first order.
_MATTERS = 0.05
#: Draws for the interval: its limits then have an error of 1/50 of its width.
_DRAWS = 4000

#: Size over the prior scale from which the search for an effect starts at its full fit too.
_LARGE = 3.0


@dataclass(frozen=True, eq=False)
class SplitGain:
    """Errors on the held-out readings of a split.

    ``chosen``: the causes chosen on the training part; ``wrong``: the best ones there that share
    no cause with them nor with their class. ``models``: the refitted nominal model and the extended
    model. ``rows``: numbers of the held-out readings at which both have an equilibrium, (n,).
    ``errors`` [m], (n,) each: "noise" is the standard deviation of the readings; "before", "after",
    "process" and "rival" are readings minus predictions of the nominal model, of the extended
    model, of the nominal model plus a Gaussian process, and of the best wrong cause. ``others``:
    held-out readings of other kinds. ``note``: why the split says nothing about the gain, if so.
    ``below``: for every row the predictive probability of a reading below the measured one, by all
    hypotheses together; empty where the cause cannot be learned. Where the verdict is ambiguous,
    "none of them" is one more hypothesis. ``nominally``: the same probabilities by the nominal
    model with its misfit alone, where that model is possible.
    """

    kind: str
    held_out: str
    rows: Numbers
    chosen: Hypothesis
    wrong: Hypothesis
    models: tuple[Fit, ...]
    errors: dict[str, Array]
    note: str = ""
    others: ReadingTable | None = None
    below: Array = field(default_factory=lambda: np.empty(0))
    nominally: Array = field(default_factory=lambda: np.empty(0))

    @property
    def rmse(self) -> dict[str, float]:
        """Root mean squares [m] of the errors, nan where there are no errors."""
        finite = {name: values[np.isfinite(values)] for name, values in self.errors.items()}
        return {name: float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
                for name, values in finite.items()}

    def shown(self, unit: Unit) -> HeldOut:
        """Build the part of a result, with errors in a unit."""
        return HeldOut(held_out=self.held_out, chosen=tuple(map(str, self.chosen)),
                       wrong=tuple(map(str, self.wrong)), note=self.note,
                       rmse={name: unit.per_si * value if np.isfinite(value) else None
                             for name, value in self.rmse.items()})


@dataclass(frozen=True, eq=False)
class GainReport:
    """The gain ``overall``, of each split, and in words which splits were not made, and why.

    ``overall`` is None where nothing could be held out. ``extends``: whether the extended model is
    useful: where nothing explains the readings, whether its error on held-out readings is smaller.
    """

    overall: Gain | None
    splits: tuple[SplitGain, ...]
    impossible: tuple[str, ...]
    extends: bool = True

    @property
    def predictive(self) -> Coverage | None:
        """Prediction of held-out readings; None without any."""
        below = np.concatenate([np.empty(0), *(split.below if self.extends else split.nominally
                                               for split in self.splits)])
        below = below[np.isfinite(below)]
        if not len(below):
            return None
        inside = np.abs(below - 0.5) <= SHARE / 2
        return Coverage(coverage_95=float(np.mean(inside)), readings=len(below),
                        pit=tuple(np.histogram(below, 10, (0.0, 1.0))[0].tolist()))


def gain_of(simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause],
            judgement: Judgement, seed: int = 0) -> GainReport:
    """Compute the gain of extending the model by causes chosen anew on each training part.

    A split does not count, and says so, where its training part cannot show the cause that all
    readings support (one on a held-out specimen; a neglected mass, with one mass left), or shows
    nothing wrong. Outliers do not count either.
    """
    table = table.with_noise(judgement.table.noise)
    splits, impossible = splits_of(simulation, table)
    counts = table.judged & (judgement.table.noise.off == 0)
    splits = tuple(split for split in splits if np.any(split[2] & counts))
    unexplained = judgement.verdict == "unexplained"
    doubtful = unexplained or judgement.verdict == "ambiguous"
    beyond = _Beyond.of(judgement, table) if doubtful and splits else None
    sought = causes if judgement.chosen and splits else ()
    about = FirstOrder.of(simulation, sought, judgement.nominal, judgement.fits, judgement.table)
    tested = tuple(_tested(simulation, table, sought, split, counts, judgement, about, beyond)
                   for split in splits)
    overall = _overall(tested, table, seed)
    return GainReport(overall and replace(
        overall, splits=tuple(split.shown(table.unit) for split in tested), impossible=impossible,
        others=tuple(_of_other_kinds(simulation, tested))),
        tested, impossible, not unexplained or _better(overall))


def _of_other_kinds(simulation: ReadingModel, splits: Sequence[SplitGain]) -> Iterator[GainOfKind]:
    """Compute errors of both models on held-out readings that are not lengths, kind by kind."""
    missed: dict[str, list[Array]] = defaultdict(list)
    for split in splits:
        if split.note or split.others is None or not len(split.others):
            continue
        table = split.others
        both = [table.value - simulation.predict(model.hypothesis, model.unknowns, table)
                for model in split.models]
        for kind, rows in table.rows_of.items():
            missed[kind].append(np.stack([*both, table.sigma])[:, rows])
    for kind, parts in missed.items():
        errors = np.hstack(parts)
        errors = errors[:, np.isfinite(errors).all(axis=0)] * UNITS[kind].per_si
        if errors.shape[1]:
            before, after, noise = np.sqrt(np.mean(errors**2, axis=1)).tolist()
            yield GainOfKind(kind=kind, unit=UNITS[kind].name, readings=errors.shape[1],
                             noise=noise, rmse_before=before, rmse_after=after)


def _better(gain: Gain | None) -> bool:
    """Check whether the extended model has a smaller error on held-out readings."""
    return (gain is not None and gain.rmse_before is not None and gain.rmse_after is not None
            and gain.rmse_after < gain.rmse_before)


@dataclass(frozen=True, eq=False)
class _Beyond:
    """Misfit that a nominal and a chosen fit may leave unexplained, by all readings.

    All readings show that something is wrong, and how large it is; so parts of them count it too.
    ``noise``: a factor on the noise where there are no lengths, since a discrepancy is smooth in
    lengths. ``doubt``: probability that none of the hypotheses explains the readings.
    """

    nominal: Discrepancy | None
    chosen: Discrepancy | None
    noise: float
    doubt: float

    @classmethod
    def of(cls, judgement: Judgement, table: ReadingTable) -> _Beyond:
        nominal, chosen = judgement.nominal, judgement.chosen or judgement.nominal
        of_nominal, posterior = Discrepancy.of(nominal, table), judgement.posterior
        doubt = (1.0 if judgement.verdict == "unexplained" or posterior is None
                 else posterior.discrepancy / posterior.wrong)
        used = chosen if doubt == 1.0 else nominal
        return cls(of_nominal, of_nominal if used is nominal else Discrepancy.of(used, table),
                   1.0 if of_nominal else used.misfit, doubt)

    def below(self, simulation: Predicts, fits: Sequence[Fit], weights: Array, train: ReadingTable,
              test: ReadingTable) -> Array:
        """Compute :meth:`Predictive.below` at the readings, by fits to a part of readings."""
        whole = self.chosen if fits[0].hypothesis else self.nominal
        expected = Predictive.of(simulation, fits, weights, test,
                                 whole and replace(whole, table=train))
        return expected.below(test.value, self.noise * test.noise.total)


def splits_of(simulation: ReadingModel,
              table: ReadingTable) -> tuple[tuple[Split, ...], tuple[str, ...]]:
    """List the splits that leave enough to train on and to test; say in words which do not."""
    return _told_apart(table, *simulation.evidence[0].splits(simulation.setup, table))


def _told_apart(table: ReadingTable, splits: Sequence[Split], levels: dict[str, Array]
                ) -> tuple[tuple[Split, ...], tuple[str, ...]]:
    """Separate splits that can be made from those that cannot, the latter in words."""
    reasons = [_unfit(kind, test, table, levels[kind]) for kind, _, test in splits]
    return (tuple(split for split, reason in zip(splits, reasons, strict=True) if not reason),
            tuple(f"{name} cannot be held out: {reason}"
                  for (_, name, _), reason in zip(splits, reasons, strict=True) if reason))


def _unfit(kind: str, test: Mask, table: ReadingTable, levels: Array) -> str:
    """Say why a split cannot be made, "" where it can."""
    if not np.any(test & table.judged):
        return "no displacements would be held out"
    if np.sum(~test) < _FEWEST_ROWS:
        return f"fewer than {_FEWEST_ROWS} readings would be left"
    if len(np.unique(levels[~test])) < _FEWEST_LEFT:
        return f"fewer than {_FEWEST_LEFT} {'ramp' if kind == 'mass' else kind}s would be left"
    return ""


def _tested(simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause], split: Split,
            counts: Mask, judgement: Judgement, about: FirstOrder,
            beyond: _Beyond | None) -> SplitGain:
    kind, held_out, rows = split
    train = table[~rows].compact()
    counted = rows & counts
    test = table[counted].compact()
    others = table[rows & ~table.judged & (judgement.table.noise.off == 0)].compact()
    names = {simulation.setup.specimens[number].name for number in np.unique(train.specimen)}
    trained = [cause for cause in causes if cause.specimen in (None, *names)]
    nominal = nominal_fit(simulation, train)
    fits, logs, wrong, exact = _alternatives(simulation, train, trained, nominal, judgement,
                                             replace(about, rows=~rows))
    there = replace(about, rows=counted, exact=exact)
    chosen = (*fits, nominal)[0]
    # That something is wrong is known from all readings; what it is, from the training part.
    members = fits or [nominal], np.exp(np.array(logs or [0.0]) - max(logs, default=0.0))
    nominally = np.empty(0)
    if beyond is None or beyond.doubt < 1.0:
        below = Predictive.of(there, *members, test).below(test.value, test.noise.total)
    else:
        below = beyond.below(there, *members, train, test)
    if beyond is not None:
        nominally = beyond.below(there, [nominal], np.ones(1), train, test)
    if beyond is not None and beyond.doubt < 1.0:
        below = (1 - beyond.doubt) * below + beyond.doubt * nominally

    before, after, rival = (
        test.value - simulation.predict(model.hypothesis, model.unknowns, test) if model
        else np.full(len(test), np.nan) for model in (nominal, chosen, wrong))
    smooth = np.full(len(test), np.nan)
    if simulation.loaded:
        missed = train.value - nominal.predicted(train)
        process = GaussianProcess.trained(train, train.noise.apart(missed))
        smooth = before - process.predicted(test)
    errors = {"before": before, "after": after, "process": smooth,
              "rival": rival, "noise": test.noise.total}
    solved = np.isfinite(before + after)
    best = judgement.chosen.hypothesis if judgement.chosen else ()
    signs = signatures(judgement.simulation, train, nominal.unknowns, best)
    hidden = [cause for cause in signs if visibility(signs[cause]) < SAME]
    if not solved.any():
        note = "the models have no equilibrium where readings were held out"
    elif hidden:
        note = f"{hidden[0]} cannot be learned while {held_out} is held out"
    else:
        unseen = logsumexp([*logs, -np.inf]) < 0
        note = f"nothing is seen to be wrong while {held_out} is held out" if unseen else ""
    return SplitGain(kind, held_out, np.flatnonzero(counted)[solved], chosen.hypothesis,
                     wrong.hypothesis if wrong else (), (nominal, chosen),
                     {name: values[solved] for name, values in errors.items()}, note, others,
                     np.empty(0) if hidden else below, nominally)


class _Alternatives(NamedTuple):
    """Hypotheses with an effect, most probable first, and their log odds against nothing wrong.

    ``wrong``: the best hypothesis unlike the first, if there is one; ``exact``: hypotheses fitted
    with the model, the others to first order.
    """

    fits: list[Fit]
    logs: list[float]
    wrong: Fit | None
    exact: frozenset[Hypothesis]


def _alternatives(simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause],
                  nominal: Fit, judgement: Judgement, about: FirstOrder) -> _Alternatives:
    """Weigh hypotheses by a table of a part of the readings.

    These are each cause alone, the best of them with every other that may help, and pairs of the
    best few, to first order ``about`` the fits to all readings. Those that matter are then fitted
    with the model. Causes that are large by all readings are searched from there too.
    """
    large = {other.hypothesis: [other.unknowns] for other in judgement.weighed.alone
             if other.surprise(other.hypothesis[0]) > _LARGE}
    hypotheses = hypotheses_of(causes)
    prior = {hypothesis: np.log(share) for hypothesis, share in priors(hypotheses).items()}
    fits: dict[Hypothesis, Fit] = {}

    def fitted(model: Predicts, hypothesis: Hypothesis, starts: Sequence[Array]) -> None:
        fits[hypothesis] = best_of([fit(model, hypothesis, table, start) for start in starts])

    def log(other: Fit) -> float:
        return float(other.evidence + prior[other.hypothesis])

    def ranked() -> list[Fit]:
        return sorted((other for other in fits.values() if np.isfinite(other.evidence)),
                      key=lambda other: -log(other))

    for cause in causes:
        fitted(about, (cause,), [nominal.unknowns])
    order = [single.hypothesis[0] for single in ranked()]
    for pair in (pair for pair in prior if len(pair) == 2
                 and {cause.first for cause in pair} <= set(order)):
        if order[0] in pair or {cause.first for cause in pair} <= set(order[:_SHORTLIST]):
            least = min(other.cost for other in fits.values())
            if starts := pair_starts(pair, fits, least, simulation, table):
                fitted(about, pair, starts)
    while True:
        best = ranked()
        wrong = _unlike_the_best(best, judgement.misfit.indistinguishable)
        least_log = logsumexp([log(other) for other in best] or [0.0]) + np.log(_MATTERS)
        rough = next((other for other in best if about.approximates(other.hypothesis) and (
            other is best[0] or other is wrong or log(other) > least_log)), None)
        if rough is None:
            return _Alternatives(
                best, [log(other) - nominal.evidence - np.log(NOTHING) for other in best], wrong,
                about.exact)
        hypothesis = rough.hypothesis
        alone = [nominal.unknowns, *large.get(hypothesis, [])] if len(hypothesis) == 1 else []
        fitted(simulation, hypothesis, [rough.unknowns, *alone])
        about = replace(about, exact=about.exact | {hypothesis})


def _unlike_the_best(fits: Sequence[Fit], classes: Sequence[Sequence[Cause]]) -> Fit | None:
    """Find the best fit that shares no cause with the first one, nor with its class."""
    taken = set(fits[0].hypothesis) if fits else set()
    taken |= {cause for group in classes if taken & set(group) for cause in group}
    return next((other for other in fits if not taken & set(other.hypothesis)), None)


def excess_ratio(before: Array | float, after: Array | float, noise: Array | float,
                 count: Array | int) -> Array:
    """Compute √(excess after / excess before), where excess is squares minus expected noise.

    An excess smaller than the scatter of noise, √(2/count) of its sum for ``count`` readings,
    counts as this scatter before, and as zero after.
    """
    least = noise * np.sqrt(2 / np.maximum(count, 1))
    return np.asarray(np.sqrt(np.maximum(after - noise, 0.0) / np.maximum(before - noise, least)))


def _overall(splits: Sequence[SplitGain], table: ReadingTable, seed: int) -> Gain | None:
    """Combine all splits; the interval is found by resampling ramps and drawing noise anew."""
    splits = [split for split in splits if not split.note]
    if not splits:
        return None
    rows = np.concatenate([split.rows for split in splits])
    before, after, noise = (np.concatenate([split.errors[name] for split in splits])
                            for name in ("before", "after", "noise"))
    of_before, of_after, of_noise = (float(np.sum(values**2)) for values in (before, after, noise))
    low, high = None, None
    ramps, number = np.unique(table.ramp[rows], return_inverse=True)
    if (count := len(ramps)) >= _FEWEST_RAMPS:
        generator = np.random.default_rng(seed)
        # One ramp fewer than there are: means of few ramps scatter more than resampling shows.
        times = generator.multinomial(count - 1, np.full(count, 1 / count), _DRAWS).T[number]
        fresh = table.noise.coloured(generator.standard_normal((len(table), _DRAWS)))[rows]
        scatter = np.sum(times * fresh**2, axis=0)
        old, new = (np.sum(times * _as_likely(values, noise, fresh), axis=0)
                    for values in (before, after))
        low, high = (float(limit) for limit in np.quantile(
            excess_ratio(old, new, scatter, times.sum(0)), (0.025, 0.975)))
    names = {kind: ", ".join(split.held_out for split in splits if split.kind == kind)
             for kind in dict.fromkeys(split.kind for split in splits)}
    words = [f"all readings {name}" if kind in _AT_ONCE else f"each {kind} in turn ({name})"
             for kind, name in names.items() if name]
    rmse_before, rmse_after = (table.unit.per_si * (total / len(rows)) ** 0.5
                               for total in (of_before, of_after))
    return Gain(held_out="; ".join(words), rmse_before=rmse_before, rmse_after=rmse_after,
                ratio=float(excess_ratio(of_before, of_after, of_noise, len(rows))),
                low=low, high=high)


def _as_likely(errors: Array, noise: Array, fresh: Array) -> Array:
    """Compute squares of errors, (n, draws), that readings as likely as these would have had.

    Minus the squares of a draw they are those of a misfit that, with it, leaves these errors. The
    share of the errors that noise does not explain is taken as the misfit.
    """
    squares = float(np.sum(errors**2))
    share = max(squares - float(np.sum(noise**2)), 0.0) / max(squares, 1e-300)
    return np.asarray(errors[:, None]**2 - 2 * share**0.5 * errors[:, None] * fresh)
