"""Experiments that would separate the rivals: expected Δχ² of each on a menu, per work.

If one rival is true, new readings will be near the predictions of its fit. Another rival, refitted
to old and new readings together, will fit them worse. The expected increase of its χ² is the value
of an experiment for this pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.data.effort import Effort
from tympan.studies.diagnosis.calibration import with_masses
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD
from tympan.studies.diagnosis.inference.posterior import Posterior
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.next_experiment.experiments import (
    MENU,
    WORDS,
    Experiment,
    Readout,
)
from tympan.studies.diagnosis.next_experiment.solved_experiments import SolvedExperiment
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.sentences import plain

AnyExperiment = Experiment | SolvedExperiment

_MINUTE = 60.0

_MOST_RIVALS = 5


@dataclass(frozen=True)
class Proposal:
    """An experiment, ``what`` to do, and what it would separate.

    ``separates``: the most probable pair of rivals that it separates, else the pair that it comes
    nearest to separating, in words, each without the causes they share; ``expected``: Δχ²
    between these two, whichever of them is true; ``value`` and ``mean``: mean Δχ² over the true
    rival and the one to be separated from it, weighted by their probabilities. ``value`` counts
    each pair only up to where it is separated beyond doubt, ``mean`` in full; ``work``: the work it
    takes [s].
    """

    what: str
    separates: tuple[str, str]
    expected: float
    value: float
    mean: float
    work: float

    @property
    def enough(self) -> bool:
        """Whether the pair is separated at odds of a hundred to one."""
        return self.expected >= TOLD

    @property
    def minutes(self) -> float:
        """Work in minutes."""
        return self.work / _MINUTE


def propose(simulation: Simulation, judgement: Judgement, causes: Sequence[Cause],
            menu: Sequence[AnyExperiment] = MENU, effort: Effort = Effort(),
            ) -> tuple[tuple[Proposal, ...], str]:
    """List all possible experiments of a menu, most Δχ² per minute first; and advice in words.

    ``causes``: those that may be wrong; rivals with any other cause are left out.
    """
    if judgement.posterior is None:
        return (), WORDS["nothing_wrong"]
    fits, weights = rivals(judgement.posterior, causes)
    if len(fits) < 2:
        return (), WORDS["one_explanation"]
    readout = Readout(with_masses(simulation), judgement.table, judgement.nominal)
    worths = [_proposal(experiment, readout, fits, weights, effort) for experiment in menu]
    ranked = tuple(sorted(
        (proposal for proposal in worths if proposal), reverse=True,
        key=lambda proposal: (round(proposal.value / proposal.minutes, 6), proposal.mean)))
    return ranked, _sentence(ranked, _apart(fits[0].hypothesis, fits[1].hypothesis))


def rivals(posterior: Posterior, causes: Sequence[Cause]) -> tuple[tuple[Fit, ...], Array]:
    """Find the most probable explanations, none of which contains another, and their shares.

    Of two explanations, one containing the other, the more probable counts for both.
    """
    credible = {fit.hypothesis for fit in posterior.credible()}
    chosen: list[Fit] = []
    shares: list[float] = []
    for fit, share in zip(posterior.fits, posterior.probabilities.tolist(), strict=True):
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


def _proposal(experiment: AnyExperiment, readout: Readout, fits: Sequence[Fit], weights: Array,
              effort: Effort) -> Proposal | None:
    outlook = experiment.outlook(readout, fits, effort)
    if outlook is None:
        return None
    distances = outlook.losses(fits)
    worst = np.minimum(distances, distances.T)
    # Probability that one rival is true (rows) and another is to be separated from it.
    others = np.tile(weights + 1e-9, (len(weights), 1))
    np.fill_diagonal(others, 0.0)
    chance = (weights + 1e-9)[:, None] * others / others.sum(1, keepdims=True)
    able, both = worst >= TOLD, chance + chance.T
    merit = np.where(able, both, 0.0) if able.any() else both * (worst + 1e-9)
    first, second = sorted(map(int, np.unravel_index(np.argmax(merit), worst.shape)))
    return Proposal(outlook.what,
                    _apart(fits[first].hypothesis, fits[second].hypothesis),
                    float(worst[first, second]),
                    float(np.sum(chance * np.minimum(distances, SEEN)) / chance.sum()),
                    float(np.sum(chance * distances) / chance.sum()),
                    outlook.work)


def _apart(first: Hypothesis, second: Hypothesis) -> tuple[str, str]:
    """Describe two hypotheses without what they share."""
    return (" with ".join(str(cause) for cause in first if cause not in second),
            " with ".join(str(cause) for cause in second if cause not in first))


def _sentence(ranked: Sequence[Proposal], pair: tuple[str, str]) -> str:
    """Write what to do, and whether any experiment separates the two likeliest rivals."""
    none = WORDS["none"].format(first=plain(pair[0]), second=plain(pair[1]))
    able = [proposal for proposal in ranked if proposal.enough]
    if not able:
        return none
    first, second = able[0].separates
    words = WORDS["best"].format(what=able[0].what, first=plain(first), second=plain(second),
                                 minutes=f"{able[0].minutes:.2g}")
    apart = any(proposal.separates == pair for proposal in able)
    return words if apart else f"{words}; {none}"
