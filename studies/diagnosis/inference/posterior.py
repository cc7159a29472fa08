"""Probabilities of hypotheses given the readings, by evidence and prior."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.special import logsumexp

from tympan.base.arrays import Array
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.inference.projection import orthonormal, taken_by, without
from tympan.studies.diagnosis.patterns.reading_patterns import JUMPS

#: Prior probability that nothing is wrong: equal to that of something being wrong.
NOTHING = 0.5
#: Prior probability of one effect of the library. Effects share it equally; an effect on each
#: specimen shares that of its effect.
SINGLE = 0.3
#: Prior probability of two effects of the library, shared equally by pairs.
PAIR = 0.1
#: Prior probability of a cause that is not in the library.
DISCREPANCY = 0.1

#: Sizes of a discrepancy over the noise, all with the same prior probability.
_SIZES = np.geomspace(0.3, 100.0, 12)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities given the readings, which add up to 1.

    ``fits``: the hypotheses with an effect, most probable first; ``probabilities``: theirs;
    ``nothing``: that of the nominal model; ``discrepancy``: that of something else besides.
    """

    fits: tuple[Fit, ...]
    probabilities: Array
    nothing: float
    discrepancy: float

    @classmethod
    def of(cls, nominal: Fit, fits: Sequence[Fit], log_odds: Mapping[Hypothesis, float],
           among: Sequence[Hypothesis]) -> Posterior:
        """Weigh fits by their evidence, and by their prior ``among`` all hypotheses.

        ``log_odds``: for some hypotheses the logarithm of the odds that there is also a
        discrepancy, from their residuals (:func:`odds_of_more`); for others these odds keep their
        prior value. Without any fits they are those of the nominal model.
        """
        logs = np.array([fit.evidence for fit in fits])
        shares = priors(among)
        logs = logs + np.log([shares[fit.hypothesis] for fit in fits])
        odds = np.array([log_odds.get(fit.hypothesis, 0.0) for fit in fits])
        more = float(logsumexp(logs + odds)) if fits else nominal.evidence + log_odds[()]
        both = np.array([nominal.evidence + np.log(NOTHING),
                         more + np.log(DISCREPANCY / (SINGLE + PAIR)), *logs])
        weight = np.exp(both - both.max())
        weight /= weight.sum()
        order = 2 + np.argsort(-weight[2:], kind="stable")
        return cls(tuple(fits[k - 2] for k in order), weight[order], float(weight[0]),
                   float(weight[1]))

    @property
    def wrong(self) -> float:
        """Probability that something is wrong."""
        return 1 - self.nothing

    def of_causes(self) -> dict[Cause, float]:
        """Compute each cause's probability given that something is wrong; most probable first."""
        return self._shares(self.wrong)

    def in_library(self) -> dict[Cause, float]:
        """Compute each cause's share in the probability of the library's effects and pairs.

        The most probable is first. This share decides whether a cause is named, however probable
        something outside the library is, up to a limit. So a cause may be named at a lower
        probability than its share.
        """
        return self._shares(float(self.probabilities.sum()))

    def _shares(self, whole: float) -> dict[Cause, float]:
        """Divide probabilities of causes by that of a whole."""
        shares: dict[Cause, float] = {}
        for fit, share in zip(self.fits, self.probabilities.tolist(), strict=True):
            for cause in fit.hypothesis:
                shares[cause] = shares.get(cause, 0.0) + share / max(whole, 1e-300)
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def fit_of(self, causes: Sequence[Cause]) -> Fit | None:
        """Find the fit of these causes together."""
        return next((fit for fit in self.fits if set(fit.hypothesis) == set(causes)), None)

    def credible(self) -> tuple[Fit, ...]:
        """Select the fewest hypotheses that hold 95 % of the probability of all with an effect."""
        total = np.cumsum(self.probabilities)
        return self.fits[: int(np.searchsorted(total, 0.95 * total[-1])) + 1] if len(total) else ()


def priors(hypotheses: Sequence[Hypothesis]) -> dict[Hypothesis, float]:
    """Compute the prior probabilities of hypotheses with one or two causes."""
    # Number of specimens that an effect may act on.
    variants = Counter(cause.name for cause in {cause.first for cause in chain(*hypotheses)})
    weight = np.array([np.prod([1 / variants[cause.name] for cause in hypothesis])
                       for hypothesis in hypotheses])
    single = np.array([len(hypothesis) == 1 for hypothesis in hypotheses], bool)
    for rows, mass in ((single, SINGLE), (~single, PAIR)):
        if rows.any():
            weight[rows] *= mass / weight[rows].sum()
    return dict(zip(hypotheses, weight.tolist(), strict=True))


def odds_of_more(fit: Fit, patterns: dict[str, Array]) -> float:
    """Compute the log Bayes factor for a smooth pattern in addition to a hypothesis.

    Only what its unknowns cannot absorb counts, whatever their size: a large effect that leaves
    nothing is no reason to look for another. The columns of a pattern have independent normal
    coefficients of a typical size, the same for one pattern of the table at a time or for all.
    Columns are over the noise of the readings.
    """
    taken = taken_by(fit.free_jacobian)
    residual = without(taken, fit.residual)
    gains = []
    for columns in (patterns[name] for name in patterns if name not in JUMPS):
        basis = orthonormal(columns)
        scale = (len(columns) / max(basis.shape[1], 1)) ** 0.5
        free = without(taken, basis)
        gains += [_log_gain(residual, size * scale * free) for size in _SIZES]
    return float(logsumexp(gains) - np.log(len(gains)))


def log_odds_to_smooth(fit: Fit, nominal: Fit, patterns: dict[str, Array],
                       among: Sequence[Hypothesis]) -> float:
    """Compute a hypothesis' log odds against a smooth misfit of the nominal model."""
    smooth = nominal.evidence + odds_of_more(nominal, patterns) + np.log(DISCREPANCY)
    return float(fit.evidence + np.log(priors(among)[fit.hypothesis]) - smooth)


def _log_gain(residual: Array, spread: Array) -> float:
    """Compute the log ratio of normal densities with covariance 1 + spread · spreadᵀ and with 1."""
    inner = np.eye(spread.shape[1]) + spread.T @ spread
    along = spread.T @ residual
    return float(0.5 * along @ np.linalg.solve(inner, along) - 0.5 * np.linalg.slogdet(inner)[1])
