"""What the extended model gains on shapes, masses, specimens, voltages it has not seen.

Readings of one ramp share mounting, creep and offset, so single readings are never held out. On
each split the cause is chosen and fitted on the training part only. A gain is no evidence for a
name within a class of causes that these readings cannot tell apart: an alias gains as much as the
truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tympan.studies.diagnosis.inference.fit import Fit, fit_all, nominal_fit
from tympan.studies.diagnosis.inference.identifiability import SAME, signatures
from tympan.studies.diagnosis.inference.posterior import NOTHING, priors
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.hypothesis import Cause, Hypothesis, hypotheses_of
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.validation.gaussian_process import GaussianProcess

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

#: Kinds of rows that are lengths, on which errors are counted.
LENGTHS = ("displacement", "range")

#: Share of the largest voltage up to which the extended model is fitted when it is tested above.
LOW_VOLTAGES = 0.7

_FEWEST_ROWS, _FEWEST_LEFT, _FEWEST_RAMPS, _SHORTLIST, _DRAWS = 6, 2, 3, 5, 4000


@dataclass(frozen=True, eq=False)
class Split:
    """Readings held out: ``kind`` is "shape", "specimen", "mass" or "voltage".

    ``test`` are the rows, shape (rows,).
    """

    kind: str
    held_out: str
    test: Rows


@dataclass(frozen=True, eq=False)
class SplitGain:
    """Errors on the readings of a split that were held out.

    Parameters
    ----------
    chosen, wrong
        The causes chosen on the training part, and the best ones there that share none with them
        nor with their class; empty where there are none.
    noise
        Standard deviation of the readings, shape (rows,) [m], as have all that follow.
    before, after, process, rival
        Readings minus predictions of the nominal model refitted, of the extended model, of the
        nominal model plus a Gaussian process, and of the best wrong cause.
    ramp
        Specimen and mass of the rows, numbered.
    lost
        Test readings left out because the nominal or the extended model has no equilibrium there.
    note
        Why the split says nothing of the gain; empty where it does.
    """

    split: Split
    chosen: Hypothesis
    wrong: Hypothesis
    noise: Array
    before: Array
    after: Array
    process: Array
    rival: Array
    ramp: NDArray[np.int64]
    lost: int
    note: str = ""

    @property
    def rmse(self) -> dict[str, float]:
        """Root mean squares [m] of "before", "after", "process", "rival" and "noise".

        Nan where there is none.
        """
        return {name: _rms(getattr(self, name)) for name in ("before", "after", "process", "rival",
                                                             "noise")}

    @property
    def ratio(self) -> float:
        """Error beyond noise after over before."""
        before, after, noise = (float(np.sum(values**2))
                                for values in (self.before, self.after, self.noise))
        return float(excess_ratio(before, after, noise, len(self.noise)))


@dataclass(frozen=True)
class Gain:
    """The gain over all splits.

    ``low`` and ``high`` are 95 % limits of the ratio, None where ramps are too few.
    """

    held_out: str
    rmse_before_um: float
    rmse_after_um: float
    ratio: float
    low: float | None
    high: float | None


@dataclass(frozen=True, eq=False)
class GainReport:
    """The gain, None where nothing could be held out; each split.

    And in words which splits there are not, and why.
    """

    overall: Gain | None
    splits: tuple[SplitGain, ...]
    impossible: tuple[str, ...]


def gain_of(simulation: Simulation, table: ReadingTable, causes: Sequence[Cause],
            judgement: Judgement,
            seed: int = 0
            ) -> GainReport:
    """The gain of extending the model by causes chosen anew on each training part.

    The noise is the one the judgement found. Where the training part cannot show a cause that all
    readings speak for (one on a specimen that is held out; a mass left out of account, with one
    mass left), or shows nothing wrong at all, the split says so and does not count.
    """
    if judgement.posterior is None or not judgement.posterior.fits:
        return GainReport(None, (),
                          ("nothing was found to be wrong, so there is no extended model to test",))
    table = table.with_sigma(judgement.table.sigma)
    splits, impossible = splits_of(simulation, table)
    classes = judgement.indistinguishable
    best = (judgement.posterior.fit_of(judgement.named) or judgement.posterior.best).hypothesis
    tested = tuple(_tested(simulation, table, causes, split, classes, best) for split in splits)
    return GainReport(_overall(tested, seed), tested, impossible)


def splits_of(simulation: Simulation, table: ReadingTable) -> tuple[tuple[Split, ...], tuple[str,
                                                                                             ...]]:
    """The splits that leave enough to train on and to test, and in words those that do not."""
    specimens = simulation.setup.specimens
    frames = [(one.frame, one.plate) for one in specimens]
    shape = np.array([frames.index(frame) for frame in frames])[table.specimen]
    masses, mass = np.unique(table.mass, return_inverse=True)
    found: list[Split] = []
    for number in np.unique(shape):
        named = [one.name for one, frame in zip(specimens, frames, strict=True)
                 if frame == frames[number]]
        found.append(Split("shape", " and ".join(named), shape == number))
    if len(np.unique(shape)) < len(np.unique(table.specimen)):
        found += [Split("specimen", specimens[k].name, table.specimen == k)
                  for k in np.unique(table.specimen)]
    found += [Split("mass", f"{1e3 * one:.5g} g", mass.ravel() == k)
              for k, one in enumerate(masses)]
    edge = LOW_VOLTAGES * float(np.abs(table.voltage).max(initial=0.0))
    found.append(Split("voltage", f"above {edge / 1e3:.3g} kV", np.abs(table.voltage) > edge))
    reasons = [_unfit(split, table, shape) for split in found]
    impossible = [f"{split.held_out} cannot be held out: {reason}"
                  for split, reason in zip(found, reasons, strict=True) if reason]
    return tuple(split for split, reason in zip(found, reasons, strict=True)
                 if not reason), tuple(impossible)


def _unfit(split: Split, table: ReadingTable, shape: NDArray[np.int64]) -> str:
    """Why a split cannot be made; empty where it can."""
    train = ~split.test
    if not np.any(split.test & np.isin(table.kind, LENGTHS)):
        return "no displacements would be held out"
    if train.sum() < _FEWEST_ROWS:
        return f"fewer than {_FEWEST_ROWS} readings would be left"
    left = {"shape": shape, "specimen": table.specimen, "mass": _ramps(table),
            "voltage": np.abs(table.voltage)}
    if len(np.unique(left[split.kind][train])) < _FEWEST_LEFT:
        name = {"mass": "ramp", "voltage": "voltage"}.get(split.kind, split.kind)
        return f"fewer than {_FEWEST_LEFT} {name}s would be left"
    return ""


def _ramps(table: ReadingTable) -> NDArray[np.int64]:
    """Number of the specimen and mass of each row."""
    _, numbers = np.unique(np.stack([table.specimen.astype(float), table.mass], 1), axis=0,
                           return_inverse=True)
    return np.asarray(numbers.ravel(), dtype=np.int64)


def _tested(simulation: Simulation, table: ReadingTable, causes: Sequence[Cause], split: Split,
            classes: tuple[tuple[Cause, ...], ...], best: Hypothesis) -> SplitGain:
    """The models trained on one part and tested on the other."""
    train = compact(table[~split.test])
    counted = split.test & np.isin(table.kind, LENGTHS)
    test = compact(table[counted])
    known = {simulation.setup.specimens[k].name for k in np.unique(train.specimen)}
    nominal = nominal_fit(simulation, train)
    choice = choose(simulation, train, [cause for cause in causes if cause.which in (None, *known)],
                    nominal, classes)
    chosen, wrong = choice.best or nominal, choice.wrong
    error = {name: _errors(simulation, one, test)
             for name, one in (("before", nominal), ("after", chosen))}
    error["rival"] = _errors(simulation, wrong, test) if wrong else np.full(len(test), np.nan)
    process = GaussianProcess.trained(train, nominal.residual * train.sigma)
    error["process"] = error["before"] - process.predicted(test)
    kept = np.isfinite(error["before"] + error["after"])
    note = _unlearnable(simulation, train, nominal, best, split.held_out)
    if not note and choice.odds < 1:
        note = f"nothing is seen to be wrong while {split.held_out} is held out"
    if not kept.any():
        note = "the models have no equilibrium where readings were held out"
    return SplitGain(split, chosen.hypothesis, wrong.hypothesis if wrong else (), test.sigma[kept],
                     error["before"][kept], error["after"][kept], error["process"][kept],
                     error["rival"][kept],
                     _ramps(table)[counted][kept], int((~kept).sum()), note)


def _unlearnable(simulation: Simulation, train: ReadingTable, nominal: Fit, best: Hypothesis,
                 held_out: str) -> str:
    """Why the training part cannot show a cause that all readings speak for; empty if it can."""
    blind = [one.cause for one in signatures(simulation, train, nominal.unknowns, best)
             if one.strength < SAME]
    return f"{blind[0]} cannot be learned while {held_out} is held out" if blind else ""


def _errors(simulation: Simulation, one: Fit, table: ReadingTable) -> Array:
    """Readings minus predictions [m]; nan where there is no equilibrium."""
    return table.value - simulation.predict(one.hypothesis, one.unknowns, table)


@dataclass(frozen=True, eq=False)
class Choice:
    """The best fit and the best one that is wrong, None where there is none.

    Odds that there is a cause at all.
    """

    best: Fit | None
    wrong: Fit | None
    odds: float


def choose(simulation: Simulation, table: ReadingTable, causes: Sequence[Cause], nominal: Fit,
           classes: Sequence[Sequence[Cause]] = ()) -> Choice:
    """The most probable causes for a table, and the best that share none with them nor their class.

    Each cause alone, the best of them with every other, and pairs of the best few are weighed.
    """
    prior = dict(zip(hypotheses_of(causes), np.log(priors(hypotheses_of(causes))).tolist(),
                     strict=True))
    singles = _ranked(fit_all(simulation, [(cause,) for cause in causes], table, nominal.unknowns),
                      prior)
    if not singles:
        return Choice(None, None, 0.0)
    order = [one.hypothesis[0] for one in singles]
    pairs = [pair for pair in prior if len(pair) == 2 and set(pair) <= set(order)
             and (order[0] in pair or set(pair) <= set(order[:_SHORTLIST]))]
    ranked = _ranked([*singles,
                      *fit_all(simulation, pairs, table, nominal.unknowns, fitted=singles)], prior)
    taken = set(ranked[0].hypothesis)
    taken |= {cause for group in classes if taken & set(group) for cause in group}
    weights = [one.evidence + prior[one.hypothesis] - nominal.evidence - np.log(NOTHING)
               for one in ranked]
    return Choice(ranked[0], next((one for one in ranked if not taken & set(one.hypothesis)), None),
                  float(np.exp(min(logsumexp(weights), 700.0))))


def _ranked(fits: Sequence[Fit], prior: dict[Hypothesis, float]) -> list[Fit]:
    """Fits by probability, the most probable first; without those that have no equilibria."""
    return sorted((one for one in fits if one.possible),
                  key=lambda one: -(one.evidence + prior[one.hypothesis]))


def compact(table: ReadingTable) -> ReadingTable:
    """The same rows with only the states they are of."""
    used, numbers = np.unique(np.r_[table.state, table.since[table.since >= 0]],
                              return_inverse=True)
    since = table.since.copy()
    since[since >= 0] = numbers[len(table) :]
    return replace(table, states=table.states[used], state=numbers[: len(table)], since=since)


def excess_ratio(before: Array | float, after: Array | float, noise: Array | float,
                 count: Array | int) -> Array:
    """√(excess after / excess before) of sums of squares over their expectation by noise.

    An excess below what noise scatters by itself, √(2/count) of its sum for ``count`` readings,
    counts as that before and as none after.
    """
    least = noise * np.sqrt(2 / np.maximum(count, 1))
    return np.asarray(np.sqrt(np.maximum(after - noise, 0.0) / np.maximum(before - noise, least)))


def _overall(splits: Sequence[SplitGain], seed: int) -> Gain | None:
    """All splits together; the interval by drawing ramps with replacement."""
    told = [one for one in splits if not one.note]
    if not told:
        return None
    ramps, number = np.unique(np.concatenate([one.ramp for one in told]), return_inverse=True)
    columns = [np.concatenate([getattr(one, name) for one in told]) ** 2
               for name in ("before", "after", "noise")]
    sums = np.stack([np.bincount(number, values) for values in (*columns, np.ones(len(number)))])
    before, after, _, count = sums.sum(1)
    low, high = None, None
    if len(ramps) >= _FEWEST_RAMPS:
        generator = np.random.default_rng(seed)
        drawn = generator.multinomial(len(ramps), np.full(len(ramps), 1 / len(ramps)),
                                      _DRAWS) @ sums.T
        low, high = (float(limit) for limit in np.quantile(excess_ratio(*drawn.T), (0.025, 0.975)))
    return Gain(_words(told), 1e6 * float(np.sqrt(before / count)),
                1e6 * float(np.sqrt(after / count)),
                float(excess_ratio(*sums.sum(1))), low, high)


def _words(splits: Sequence[SplitGain]) -> str:
    """What was held out."""
    kinds = {kind: [one.split.held_out for one in splits if one.split.kind == kind]
             for kind in ("shape", "specimen", "mass", "voltage")}
    parts = [f"each {kind} in turn ({', '.join(names)})" if kind != "voltage"
             else f"all readings {names[0]}"
             for kind, names in kinds.items() if names]
    return "; ".join(parts)


def _rms(values: Array) -> float:
    """Root mean square of what is finite."""
    kept = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(kept**2))) if len(kept) else float("nan")
