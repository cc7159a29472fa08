"""Hypotheses weighed: probabilities of causes, of none, and of something else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tympan.studies.diagnosis.inference.fit import NUISANCE, Fit
from tympan.studies.diagnosis.inference.residual_tests import orthonormal
from tympan.studies.diagnosis.reduced.hypothesis import Cause, Hypothesis

Array = NDArray[np.float64]

#: What is thought of them before any data: that something is wrong at all is as probable as not;
#: then that it is one effect of the library, two, or none of them. Effects share theirs equally, an
#: effect on one specimen among these.
NOTHING, SINGLE, PAIR, DISCREPANCY = 0.5, 0.3, 0.1, 0.1

#: Sizes a discrepancy may have over the noise, each as probable as the other.
_SIZES = np.geomspace(0.3, 100.0, 12)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities given the readings, which add up to 1.

    ``fits`` are the hypotheses with an effect, ``probabilities`` theirs; ``nothing`` that of the
    nominal model; ``discrepancy`` that of some discrepancy no effect makes.
    """

    fits: tuple[Fit, ...]
    probabilities: Array
    nothing: float
    discrepancy: float

    @classmethod
    def of(cls, nominal: Fit, fits: Sequence[Fit], discrepancy_evidence: float) -> Posterior:
        """By evidence and prior."""
        logs = np.array([nominal.evidence, discrepancy_evidence, *(fit.evidence for fit in fits)])
        logs = logs + np.log([NOTHING, DISCREPANCY, *priors([fit.hypothesis for fit in fits])])
        weight = np.exp(logs - logs.max())
        weight /= weight.sum()
        return cls(tuple(fits), weight[2:], float(weight[0]), float(weight[1]))

    @property
    def wrong(self) -> float:
        """Probability that something is wrong."""
        return 1 - self.nothing

    def of_causes(self) -> dict[Cause, float]:
        """Probability of each cause given that something is wrong; most probable first."""
        shares: dict[Cause, float] = {}
        for fit, share in zip(self.fits, self.probabilities.tolist(), strict=True):
            for cause in fit.hypothesis:
                shares[cause] = shares.get(cause, 0.0) + share / max(self.wrong, 1e-300)
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    @property
    def best(self) -> Fit:
        """The most probable hypothesis with an effect."""
        return self.fits[int(np.argmax(self.probabilities))]

    def fit_of(self, causes: Sequence[Cause]) -> Fit | None:
        """The fit of these causes together."""
        return next((fit for fit in self.fits if set(fit.hypothesis) == set(causes)), None)

    def with_cause(self, cause: Cause) -> Fit:
        """The most probable hypothesis that has a cause."""
        return max(zip(self.probabilities.tolist(), self.fits, strict=True),
                   key=lambda item: (cause in item[1].hypothesis, item[0]))[1]

    def credible(self, share: float = 0.95) -> tuple[Fit, ...]:
        """The fewest hypotheses that together have this share of all that have an effect."""
        order = np.argsort(-self.probabilities, kind="stable")
        total = np.cumsum(self.probabilities[order])
        count = int(np.searchsorted(total, share * total[-1])) + 1 if len(total) else 0
        return tuple(self.fits[k] for k in order[:count])


def priors(hypotheses: Sequence[Hypothesis]) -> Array:
    """Prior probabilities of hypotheses with one or two causes."""
    # How many specimens an effect may happen to.
    variants = Counter(cause.name for cause in set(chain(*hypotheses)))
    weight = np.array([np.prod([1 / variants[cause.name] for cause in hypothesis])
                       for hypothesis in hypotheses])
    single = np.array([len(hypothesis) == 1 for hypothesis in hypotheses], bool)
    for rows, mass in ((single, SINGLE), (~single, PAIR)):
        if rows.any():
            weight[rows] *= mass / weight[rows].sum()
    return weight


def discrepancy_evidence(nominal: Fit, patterns: dict[str, Array], sigma: Array) -> float:
    """Logarithm of the readings' probability if the nominal model is off by some smooth pattern.

    A pattern's columns have independent normal coefficients that make it a typical size, the same
    for one pattern of the table at a time or for all; the nominal model is taken as linear about
    its fit. ``sigma`` is the readings' noise, shape (rows,).
    """
    evidence = []
    for columns in patterns.values():
        basis = orthonormal(columns / sigma[:, None])
        scale = (len(sigma) / max(basis.shape[1], 1)) ** 0.5
        evidence += [_evidence(nominal, size * scale * basis) for size in _SIZES]
    return float(logsumexp(evidence) - np.log(len(evidence)))


def _evidence(nominal: Fit, columns: Array) -> float:
    residual = nominal.residual + nominal.jacobian @ nominal.unknowns
    spread = np.concatenate([NUISANCE * nominal.jacobian, columns], axis=1)
    inner = np.eye(spread.shape[1]) + spread.T @ spread
    along = spread.T @ residual
    squares = residual @ residual - along @ np.linalg.solve(inner, along)
    return float(-0.5 * squares - 0.5 * np.linalg.slogdet(inner)[1])
