"""What ranges are expected to be: by all of them, by the others, and by levels that are lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.diagnosis.conclusions import Conclusions
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import hypotheses_of
from tympan.studies.diagnosis.inference.posterior import NOTHING, priors
from tympan.studies.diagnosis.inference.predictive import Predictive
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.reading_table import ReadingTable

#: Hypotheses of which nobody need know are those less probable than this.
_LEAST = 1e-3


@dataclass(frozen=True)
class Ends:
    """The lowest and the highest level [kV], whose they are, and how long each is held [s]."""

    name: str
    low: float
    high: float
    dwell: float | None = None

    def moved(self, table: ReadingTable) -> ReadingTable:
        """Ranges between these ends instead of those that are stated."""
        voltage = table.states.voltage.copy()
        voltage[table.state], voltage[table.since] = 1e3 * self.high, 1e3 * self.low
        return replace(table, states=replace(table.states, voltage=voltage))


def judged_again(diagnosis: Conclusions, table: ReadingTable) -> Conclusions:
    """The diagnosis with the verdict on other states or another noise, and nothing else new."""
    readings = diagnosis.readings
    judgement = judge(diagnosis.simulation, table, readings.causes)
    return replace(diagnosis, judgement=judgement)


def expected(diagnosis: Conclusions) -> Predictive:
    """Of the ranges that were read, by the verdict on all of them."""
    fits, logs = _hypotheses(diagnosis.judgement)
    return _mixture(diagnosis, fits, logs, diagnosis.judgement.table)


def held_out(diagnosis: Conclusions) -> tuple[Array, Predictive]:
    """Of each range, by the others alone: the nominal model refitted to them [m], and all weighed.

    Hypotheses are those that all ranges leave credible.
    """
    judgement, members, nominal = diagnosis.judgement, [], []
    hypotheses, _ = _hypotheses(judgement)
    for row in range(len(judgement.table)):
        train = judgement.table[np.arange(len(judgement.table)) != row].compact()
        fits = [fit(diagnosis.simulation, fitted.hypothesis, train, fitted.unknowns)
                for fitted in hypotheses]
        logs = _prior(diagnosis, fits) + [fitted.evidence for fitted in fits]
        test = judgement.table[np.array([row])].compact()
        members.append(_mixture(diagnosis, fits, logs, test))
        bare = next(fitted for fitted in fits if not fitted.hypothesis)
        nominal.append(float(diagnosis.simulation.predict((), bare.unknowns, test)[0]))
    return np.array(nominal), _side_by_side(members)


def marginal(parts: Sequence[Predictive]) -> Predictive:
    """Several expectations of the same rows, each as probable as another."""
    return Predictive(np.concatenate([part.weight for part in parts]) / len(parts),
                      np.concatenate([part.mean for part in parts]),
                      np.concatenate([part.deviation for part in parts]))


def median(predictive: Predictive, noise: Array) -> Array:
    """Of every row as it is read with that noise."""
    return predictive.band(noise, 0.0)[0]


def _hypotheses(judgement: Judgement) -> tuple[list[Fit], Array]:
    """The nominal model's fit and those of credible hypotheses, with logarithms of their odds."""
    posterior = judgement.posterior
    if posterior is None:
        return [judgement.nominal], np.zeros(1)
    pairs = [(fitted, share) for fitted, share in zip(posterior.fits, posterior.probabilities,
                                                    strict=True) if share >= _LEAST]
    return ([judgement.nominal, *(fitted for fitted, _ in pairs)],
            np.log([max(posterior.nothing, 1e-300), *(share for _, share in pairs)]))


def _prior(diagnosis: Conclusions, fits: Sequence[Fit]) -> Array:
    """Logarithms of what is thought of hypotheses before any data."""
    among = hypotheses_of(diagnosis.readings.causes)
    shares = priors(among) | {(): NOTHING}
    return np.log([shares[fitted.hypothesis] for fitted in fits])


def _mixture(diagnosis: Conclusions, fits: Sequence[Fit], logs: Array, table: ReadingTable
             ) -> Predictive:
    return Predictive.of(diagnosis.simulation, fits, np.exp(logs - logs.max()), table)


def _side_by_side(parts: Sequence[Predictive]) -> Predictive:
    """Expectations of one row each as those of several rows."""
    most = max(len(part.weight) for part in parts)
    weight, mean, deviation = (
        np.concatenate([np.pad(values, ((0, most - len(values)), (0, 0))) for values in columns], 1)
        for columns in zip(*((part.weight, part.mean, part.deviation) for part in parts),
                           strict=True))
    return Predictive(weight, mean, deviation)
