"""Causes weighed together with small errors of every other kind.

Besides what is wrong, a test bench has small errors of every kind. Many readings detect them all,
and then no one or two causes leave noise alone. Here every cause outside a hypothesis is present at
some share of its prior scale, the same share for all, as noise that readings have in common; its
effect is proportional to its signature. The share is weighed with the hypotheses, as a model
discrepancy is (Kennedy, O'Hagan, J. R. Stat. Soc. B 63, 425, 2001), but this one is made of the
library's effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.evidence import evidence
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.inference.identifiability import TYPICAL, Signatures
from tympan.studies.diagnosis.inference.posterior import Posterior, priors
from tympan.studies.diagnosis.inference.projection import taken_by, without
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import Noise, Shared

#: Shares of the prior scales that small errors may have, all with the same prior probability.
SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.8)

#: Largest share that still counts as small.
SMALL = 0.5

#: Distance in log probability from the best one up to which hypotheses are refitted with small
#: errors.
_NEAR = 8.0
#: Most hypotheses that are refitted. It limits the cost.
_MOST = 8


@dataclass(frozen=True, eq=False)
class RoughBench:
    """Hypotheses with small errors of every kind in addition.

    ``fits``: those weighed, the nominal model first; ``logs``: logarithms of their probabilities
    with each of ``SHARES``, shape (fits, shares), which add up to 1; ``among``: all hypotheses
    there are.
    """

    fits: tuple[Fit, ...]
    logs: Array
    signatures: Signatures
    among: Sequence[Hypothesis]

    @classmethod
    def of(cls, fits: Sequence[Fit], signatures: Signatures, among: Sequence[Hypothesis],
           widen: float = 1.0) -> RoughBench:
        """Weigh fits to readings with noise alone, and with small errors to first order.

        The first is the nominal one. Prior scales are multiplied by ``widen``, but not those of
        small errors.
        """
        weights = priors(among)
        total = np.array(list(weights.values())).sum()
        chances = {hypothesis: np.log(weight / total) for hypothesis, weight in weights.items()}
        logs = np.array([[evidence(member, widen) for member in _beside_each(fitted, signatures)]
                         for fitted in fits])
        logs += np.array([chances.get(member.hypothesis, 0.0) for member in fits])[:, None]
        return cls(tuple(fits), logs - logsumexp(logs), signatures, among)

    def share(self, hypothesis: Hypothesis) -> float:
        """Find the most probable share of their prior scales that small errors have with it."""
        number = [member.hypothesis for member in self.fits].index(hypothesis)
        return SHARES[int(np.argmax(self.logs[number]))]

    @property
    def small(self) -> float:
        """Probability that the errors are small."""
        return float(np.exp(self.logs[:, np.array(SHARES) <= SMALL]).sum())

    def near(self) -> list[Fit]:
        """List the fits with causes that are probable enough for another fit, best first."""
        each = logsumexp(self.logs, axis=1)
        order = 1 + np.argsort(-each[1:], kind="stable")[:_MOST]
        return [self.fits[k] for k in order if each[k] > each.max() - _NEAR]

    def widened(self, widen: float) -> RoughBench:
        """Weigh the near fits with other prior scales."""
        return self.of((self.fits[0], *self.near()), self.signatures, self.among, widen)

    def sure(self, least: float) -> tuple[Cause, ...]:
        """List the causes of at least that probability; none standing out counts as a rival."""
        shares: dict[Cause, float] = {}
        for member, chance in zip(self.fits, np.exp(self.logs).sum(1).tolist(), strict=True):
            for cause in member.hypothesis:
                shares[cause] = shares.get(cause, 0.0) + chance
        return tuple(cause for cause, chance in shares.items() if chance >= least)

    def again(self, simulation: ReadingModel, table: ReadingTable, widen: float
              ) -> tuple[Posterior, Fit]:
        """Refit the near ones, each with its most probable small errors; return also the best.

        The case that no cause stands out from the small errors counts as a discrepancy.
        """
        nominal, *members = (
            fit(simulation, member.hypothesis, table, member.unknowns, widen,
                _beside(member, self.signatures, self.share(member.hypothesis)).beside)
            for member in (self.fits[0], *self.near()))
        members = [member for member in members if member.possible]
        chances = {member.hypothesis: chance for member, chance in zip(
            self.fits, np.exp(self.logs).sum(1).tolist(), strict=True)}
        nothing = float(np.exp(self.logs[0, 0]))
        weights = np.array([nothing, chances[()] - nothing,
                            *(chances[member.hypothesis] for member in members)])
        weights /= weights.sum()
        best = int(np.argmax(weights[1:]))
        return (Posterior(tuple(members), weights[2:], float(weights[0]), float(weights[1])),
                (nominal, *members)[best])


def least_chi_squared(fitted: Fit) -> float:
    """Compute the least χ² of a fit over its unknowns without priors, small errors as noise.

    It is extrapolated with the fit's derivatives.
    """
    taken = taken_by(fitted.whitened(fitted.free_jacobian))
    return float(np.sum(without(taken, fitted.whitened(fitted.residual)) ** 2))


def near_rivals(named: Fit, others: Sequence[Fit], signatures: Signatures, share: float,
                within: float) -> tuple[Fit, ...]:
    """Find other single causes with hardly more χ², whatever their size would be."""
    most = least_chi_squared(_beside(named, signatures, share)) + within
    return tuple(other for other in others if other.hypothesis[0] not in named.hypothesis
                 and least_chi_squared(_beside(other, signatures, share)) < most)


def _beside_each(member: Fit, signatures: Signatures) -> list[Fit]:
    """Build fits with small errors of each of the shares."""
    errors = _errors_beside(member, signatures)
    return [_with(member, errors, share) for share in SHARES]


def _beside(member: Fit, signatures: Signatures, share: float) -> Fit:
    """Build a fit with small errors of every kind but those of its hypothesis."""
    return _with(member, _errors_beside(member, signatures), share)


def _errors_beside(member: Fit, signatures: Signatures) -> Shared | None:
    """Build errors of prior scale of all kinds outside its hypothesis; None if there are none."""
    columns = [signature for cause, signature in signatures.items()
               if cause not in member.hypothesis]
    if not columns:
        return None
    return Shared.of(np.arange(len(member.residual)), np.concatenate(columns, axis=1) / TYPICAL)


def _with(member: Fit, errors: Shared | None, share: float) -> Fit:
    """Build a fit with these errors, scaled by a share."""
    if errors is None:
        return replace(member, beside=None)
    whole = Noise(np.ones(len(member.residual)))
    return replace(member, beside=whole.plus(errors.times(share)))
