"""Which experiment would tell the rivals apart: the expected Δχ² of each on a menu.

If one rival is true, new readings will be about what its fit predicts, and another rival, refitted
to old and new ones together, will fit them worse. How much worse is what an experiment is worth for
this pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from tympan.studies.diagnosis.inference.fit import Fit, prior_widths
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD
from tympan.studies.diagnosis.inference.posterior import Posterior
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.next_experiment.experiments import MENU, WORDS, Experiment, Readout
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.reduced.simulation import Simulation

Array = NDArray[np.float64]

#: How far below the voltage at which any rival pulls in new readings stay, as a share.
_MARGIN = 0.05

_MOST_RIVALS = 5


@dataclass(frozen=True)
class Proposal:
    """An experiment, best first.

    Parameters
    ----------
    what
        What to do, in words.
    separates
        The most probable pair of rivals that it tells apart, else the pair it comes nearest to
        telling apart; each without the causes they share.
    expected
        Expected Δχ² between these two, whichever of them is true.
    value, mean
        Mean Δχ² over which rival is true and which one is told from it, by their probabilities;
        each pair counted up to where it is told beyond doubt, and in full.
    """

    what: str
    separates: tuple[Hypothesis, Hypothesis]
    expected: float
    value: float
    mean: float

    @property
    def enough(self) -> bool:
        """Whether the pair is told apart at odds of a hundred to one."""
        return self.expected >= TOLD

    @property
    def effects(self) -> tuple[str, str]:
        """The two in words."""
        first, second = (" with ".join(map(str, hypothesis)) for hypothesis in self.separates)
        return first, second


def propose(simulation: Simulation, judgement: Judgement, causes: Sequence[Cause],
            menu: Sequence[Experiment] = MENU) -> tuple[tuple[Proposal, ...], str]:
    """All that is possible of a menu, by what it would tell, and what to do in one sentence.

    Parameters
    ----------
    causes
        What may be wrong: rivals that hold another cause are left out.
    """
    if judgement.posterior is None:
        return (), WORDS["nothing_wrong"]
    fits, weights = rivals(judgement.posterior, causes)
    if len(fits) < 2:
        return (), WORDS["one_explanation"]
    readout = Readout(simulation, judgement.table, judgement.nominal)
    worths = [_proposal(experiment, readout, fits, weights) for experiment in menu]
    ranked = tuple(sorted((proposal for proposal in worths if proposal), reverse=True,
                          key=lambda proposal: (round(proposal.value, 3), proposal.mean)))
    return ranked, _sentence(ranked, _apart(fits[0].hypothesis, fits[1].hypothesis))


def rivals(posterior: Posterior, causes: Sequence[Cause]) -> tuple[tuple[Fit, ...], Array]:
    """The most probable explanations, none of which holds another, and their shares.

    What holds another, or is held by it, counts for the more probable of the two.
    """
    order = sorted(zip(posterior.fits, posterior.probabilities.tolist(), strict=True),
                   key=lambda item: -item[1])
    credible = {fit.hypothesis for fit in posterior.credible()}
    chosen: list[Fit] = []
    shares: list[float] = []
    for fit, share in order:
        members = set(fit.hypothesis)
        if not members <= set(causes):
            continue
        home = next((number for number, other in enumerate(chosen)
                     if members <= set(other.hypothesis) or members > set(other.hypothesis)), None)
        if home is not None:
            shares[home] += share
        elif len(chosen) < 2 or (len(chosen) < _MOST_RIVALS and fit.hypothesis in credible):
            chosen.append(fit)
            shares.append(share)
    total = np.array(shares)
    return tuple(chosen), total / max(total.sum(), 1e-300)


def _proposal(experiment: Experiment, readout: Readout, fits: Sequence[Fit],
              weights: Array) -> Proposal | None:
    """An experiment's worth; None where it is not possible."""
    table = possible(experiment, readout, fits)
    if table is None:
        return None
    distances = expected(readout.simulation, fits, table)
    worst = np.minimum(distances, distances.T)
    # The probability that one rival is true (rows) and another is to be told from it.
    others = np.tile(weights + 1e-9, (len(weights), 1))
    np.fill_diagonal(others, 0.0)
    chance = (weights + 1e-9)[:, None] * others / others.sum(1, keepdims=True)
    value = float(np.sum(chance * np.minimum(distances, SEEN)) / chance.sum())
    able, both = worst >= TOLD, chance + chance.T
    merit = np.where(able, both, 0.0) if able.any() else both * (worst + 1e-9)
    pair = np.unravel_index(np.argmax(merit), worst.shape)
    first, second = sorted(int(number) for number in pair)
    return Proposal(experiment.words(table),
                    _apart(fits[first].hypothesis, fits[second].hypothesis),
                    float(worst[first, second]), value,
                    float(np.sum(chance * distances) / chance.sum()))


def possible(experiment: Experiment, readout: Readout, fits: Sequence[Fit]) -> ReadingTable | None:
    """The new rows where the laws reach and every rival has an equilibrium, None without any."""
    table = experiment.rows(readout)
    if table is None:
        return None
    usable = readout.within_reach(table) & np.isfinite(table.sigma)
    voltage = (1 + _MARGIN) * table.states.voltage
    beyond = replace(table, states=replace(table.states, voltage=voltage))
    for fit in fits:
        usable &= np.isfinite(readout.simulation.predict(fit.hypothesis, fit.unknowns, beyond))
    return table[usable] if usable.any() else None


def expected(simulation: Simulation, fits: Sequence[Fit], table: ReadingTable) -> Array:
    """Expected Δχ² of new rows, shape (true rival, other rival).

    What the other one loses, refitted to all rows.
    """
    values, jacobians = [], []
    for fit in fits:
        heave = simulation.heaves(fit.hypothesis, fit.unknowns, table.states)
        values.append(simulation.values(fit.hypothesis, fit.unknowns, table, heave))
        jacobians.append(simulation.jacobian(fit.hypothesis, fit.unknowns, table, heave,
                                             fit.bounds))
    losses = np.zeros((len(fits), len(fits)))
    for true, other in permutations(range(len(fits)), 2):
        losses[true, other] = _loss(fits[other], (values[true] - values[other]) / table.sigma,
                                    jacobians[other] / table.sigma[:, None])
    return losses


def _loss(fit: Fit, difference: Array, jacobian: Array) -> float:
    """By how much twice the cost grows when a fit moves to meet rows off its predictions.

    Predictions are taken as linear and the cost of the old rows as a parabola; unknowns stay within
    their bounds.
    """
    weight = prior_widths(fit.hypothesis) ** -2.0
    slope = -fit.jacobian.T @ fit.residual + weight * fit.unknowns
    scale = fit.deviations
    root = np.linalg.cholesky(fit.precision)
    matrix = np.concatenate([root.T, jacobian]) * scale
    target = np.concatenate([-np.linalg.solve(root, slope), difference])
    low, high = (fit.bounds - fit.unknowns) / scale
    step = np.linalg.lstsq(matrix, target, rcond=None)[0]
    if np.any((step < low) | (step > high)):
        step = lsq_linear(matrix, target, (np.minimum(low, -1e-9), np.maximum(high, 1e-9)),
                          method="bvls").x
    loss = float(np.sum((matrix @ step - target) ** 2) - np.sum(target[: len(step)] ** 2))
    return max(loss, 0.0)


def _apart(first: Hypothesis, second: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
    """Two hypotheses without what they share."""
    return (tuple(cause for cause in first if cause not in second),
            tuple(cause for cause in second if cause not in first))


def _sentence(ranked: Sequence[Proposal], pair: tuple[Hypothesis, Hypothesis]) -> str:
    """What to do; and whether the two most probable rivals stay together whatever is done."""
    first, second = (" with ".join(map(str, hypothesis)) for hypothesis in pair)
    none = WORDS["none"].format(first=first, second=second)
    best = next((proposal for proposal in ranked if proposal.enough), None)
    if best is None:
        return none
    words = WORDS["best"].format(what=best.what, first=best.effects[0], second=best.effects[1])
    apart = any(proposal.enough and proposal.separates == pair for proposal in ranked)
    return words if apart else f"{words}; {none}"
