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
from tympan.studies.diagnosis.next_experiment.experiments import MENU, Experiment, Readout
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
        one, other = self.separates
        return named(one), named(other)


@dataclass(frozen=True)
class Proposals:
    """All that is possible of a menu, best first, and what to do in one sentence."""

    ranked: tuple[Proposal, ...]
    sentence: str


@dataclass(frozen=True, eq=False)
class Foreseen:
    """What a rival expects of an experiment.

    The new rows' values and their derivatives by its unknowns.
    """

    values: Array
    jacobian: Array


def propose(simulation: Simulation, judgement: Judgement, causes: Sequence[Cause],
            menu: Sequence[Experiment] = MENU) -> Proposals:
    """The experiments of a menu by what they would tell.

    Parameters
    ----------
    causes
        What may be wrong: rivals that hold another cause are left out.
    """
    if judgement.posterior is None:
        return Proposals((), "nothing was found to be wrong, so there is nothing to tell apart")
    fits, weights = rivals(judgement.posterior, causes)
    if len(fits) < 2:
        return Proposals((), "there is only one explanation, so there is nothing to tell apart")
    readout = Readout(simulation, judgement.table, judgement.nominal)
    found = [_proposal(experiment, readout, fits, weights) for experiment in menu]
    ranked = tuple(sorted((one for one in found if one),
                          key=lambda one: (round(one.value, 3), one.mean), reverse=True))
    return Proposals(ranked, _sentence(ranked, _apart(fits[0].hypothesis, fits[1].hypothesis)))


def rivals(posterior: Posterior, causes: Sequence[Cause]) -> tuple[tuple[Fit, ...], Array]:
    """The most probable explanations, none of which holds another, and their shares.

    What holds another, or is held by it, counts for the more probable of the two.
    """
    order = sorted(zip(posterior.fits, posterior.probabilities.tolist(), strict=True),
                   key=lambda item: -item[1])
    credible = {one.hypothesis for one in posterior.credible()}
    found: list[Fit] = []
    shares: list[float] = []
    for one, share in order:
        own = set(one.hypothesis)
        if not own <= set(causes):
            continue
        home = next((k for k, other in enumerate(found) if own <= set(other.hypothesis)
                     or own > set(other.hypothesis)),
                    None)
        if home is not None:
            shares[home] += share
        elif len(found) < 2 or (len(found) < _MOST_RIVALS and one.hypothesis in credible):
            found.append(one)
            shares.append(share)
    total = np.array(shares)
    return tuple(found), total / max(total.sum(), 1e-300)


def _proposal(experiment: Experiment, readout: Readout, fits: Sequence[Fit],
              weights: Array) -> Proposal | None:
    """An experiment's worth; None where it is not possible."""
    table = possible(experiment, readout, fits)
    if table is None:
        return None
    distances = expected(readout.simulation, fits, table)
    told = np.minimum(distances, distances.T)
    chance = _chances(weights)
    value = float(np.sum(chance * np.minimum(distances, SEEN)) / chance.sum())
    able = told >= TOLD
    both = chance + chance.T
    pair = np.unravel_index(np.argmax(np.where(able, both, 0.0) if able.any()
                                      else both * (told + 1e-9)), told.shape)
    one, other = sorted(int(number) for number in pair)
    return Proposal(experiment.words(table), _apart(fits[one].hypothesis, fits[other].hypothesis),
                    float(told[one, other]), value,
                    float(np.sum(chance * distances) / chance.sum()))


def _chances(weights: Array) -> Array:
    """Probability that one rival is true (rows) and another is to be told from it."""
    chance = np.tile(weights + 1e-9, (len(weights), 1))
    np.fill_diagonal(chance, 0.0)
    return np.asarray((weights + 1e-9)[:, None] * chance / chance.sum(1, keepdims=True))


def possible(experiment: Experiment, readout: Readout, fits: Sequence[Fit]) -> ReadingTable | None:
    """The new rows where the laws reach and every rival has an equilibrium.

    None if there are none.
    """
    table = experiment.rows(readout)
    if table is None:
        return None
    kept = readout.within_reach(table) & np.isfinite(table.sigma)
    beyond = replace(table,
                     states=replace(table.states, voltage=(1 + _MARGIN) * table.states.voltage))
    for one in fits:
        kept &= np.isfinite(readout.simulation.predict(one.hypothesis, one.unknowns, beyond))
    return table[kept] if kept.any() else None


def expected(simulation: Simulation, fits: Sequence[Fit], table: ReadingTable) -> Array:
    """Expected Δχ² of new rows, shape (true rival, other rival).

    What the other one loses, refitted to all rows.
    """
    views = [_foreseen(simulation, one, table) for one in fits]
    found = np.zeros((len(fits), len(fits)))
    for true, other in permutations(range(len(fits)), 2):
        difference = (views[true].values - views[other].values) / table.sigma
        found[true, other] = _loss(fits[other], difference,
                                   views[other].jacobian / table.sigma[:, None])
    return found


def _foreseen(simulation: Simulation, one: Fit, table: ReadingTable) -> Foreseen:
    heave = simulation.heaves(one.hypothesis, one.unknowns, table.states)
    return Foreseen(simulation.values(one.hypothesis, one.unknowns, table, heave),
                    simulation.jacobian(one.hypothesis, one.unknowns, table, heave, one.bounds))


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


def _apart(one: Hypothesis, other: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
    """Two hypotheses without what they share."""
    shared = set(one) & set(other)
    return tuple(cause for cause in one if cause not in shared), tuple(cause for cause in other
                                                                       if cause not in shared)


def named(hypothesis: Hypothesis) -> str:
    """A hypothesis in words."""
    return " with ".join(map(str, hypothesis))


def _sentence(ranked: Sequence[Proposal], first: tuple[Hypothesis, Hypothesis]) -> str:
    """What to do; and whether the two most probable rivals stay together whatever is done."""
    none = f"no experiment on this menu separates {named(first[0])} and {named(first[1])}"
    best = next((one for one in ranked if one.enough), None)
    if best is None:
        return none
    told = any(one.enough and one.separates == first for one in ranked)
    words = f"{best.what}: this would tell {best.effects[0]} from {best.effects[1]}"
    return words if told else f"{words}; {none}"
