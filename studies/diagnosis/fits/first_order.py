"""Fits to a part of the readings, to first order about the fits to all of them.

A part of the readings moves most fits by little, so derivatives at the fits to all of them tell
which hypotheses it speaks for. The few that matter are then fitted by the model itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.evidence.kind import Predicts, Shown
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import with_sizes
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    SIZES,
    Cause,
    Hypothesis,
    sizes_of,
    unknown_count,
)
from tympan.studies.diagnosis.reading_table import ReadingTable


@dataclass(frozen=True, eq=False)
class FitTangent:
    """Predictions of rows to first order about some unknowns, at others.

    ``about`` and ``unknowns``: shape (p,); ``predicted``: at ``about``, (rows,); ``jacobian``:
    (rows, p); ``heave`` of states [m], not known; ``cost`` at ``about``. All states are taken as
    possible.
    """

    about: Array
    predicted: Array
    jacobian: Array
    unknowns: Array
    heave: Array
    cost: float
    complete: bool = True

    @classmethod
    def at(cls, fit: Fit, table: ReadingTable) -> FitTangent:
        """Tangent of a fit at its unknowns, in the rows of the table that it was fitted to."""
        return cls(fit.unknowns, fit.predicted(table), table.noise.coloured(fit.jacobian),
                   fit.unknowns, fit.heave, fit.cost)

    @classmethod
    def made(cls, shown: Shown, unknowns: Array, cost: float) -> FitTangent:
        """Tangent of what a model shows at some unknowns, at a cost."""
        return cls(unknowns, shown.extended, shown.jacobian, unknowns, shown.heave, cost)

    @property
    def extended(self) -> Array:
        """Reading of each row."""
        return np.asarray(self.predicted + self.jacobian @ (self.unknowns - self.about))

    @property
    def values(self) -> Array:
        """Reading of each row."""
        return self.extended

    @property
    def possible(self) -> Mask:
        """Mask of the states of equilibrium: all."""
        return np.ones(len(self.heave), bool)

    @property
    def short(self) -> Mask:
        """Mask of the states out of the model's reach: none."""
        return np.zeros(len(self.heave), bool)

    def beyond(self, before: Any) -> bool:
        """Whether a search must not go here: never."""
        return False


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """Model of some ``rows`` of a table by tangents at fits to all of them.

    ``tangents``: by hypothesis, of effects alone and of some pairs. Of other pairs both effects add
    up. ``whole`` is the model that has the bounds of all, and predicts the hypotheses that are
    ``exact`` and those without a tangent.
    """

    whole: Predicts
    tangents: Mapping[Hypothesis, FitTangent]
    rows: Mask
    exact: frozenset[Hypothesis] = frozenset()

    @classmethod
    def of(cls, whole: Predicts, causes: Iterable[Cause], nominal: Fit, fits: Iterable[Fit],
           table: ReadingTable) -> FirstOrder:
        """Model of all rows by all fits that are possible; of one hypothesis by its last fit.

        Of causes that were not fitted, since they are not seen, without size beside the nominal
        fit.
        """
        known = {fit.hypothesis: FitTangent.at(fit, table) for fit in fits if fit.possible}
        for cause in causes:
            if (cause,) not in known:
                unknowns = with_sizes((cause,), nominal)
                shown = whole.prediction((cause,), unknowns, table)
                known[cause,] = FitTangent.made(shown, unknowns, nominal.cost)
        return cls(whole, known, np.ones(len(table), bool))

    def approximates(self, hypothesis: Hypothesis) -> bool:
        """Whether a hypothesis is predicted to first order."""
        return hypothesis not in self.exact and bool(hypothesis) and (
            hypothesis in self.tangents or all((cause,) in self.tangents for cause in hypothesis))

    def bounds(self, hypothesis: Hypothesis) -> Array:
        """Smallest and largest unknowns, shape (2, unknowns), for which films are sampled."""
        return self.whole.bounds(hypothesis)

    def limits(self, hypothesis: Hypothesis) -> Array:
        """The same for which they could be, as far as known."""
        return self.whole.limits(hypothesis)

    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        """Predicted readings of the rows, with derivatives."""
        if not self.approximates(hypothesis):
            return self.whole.prediction(hypothesis, unknowns, table)
        tangent = self.tangents.get(hypothesis) or self._added(hypothesis)
        return replace(tangent, predicted=tangent.predicted[self.rows],
                       jacobian=tangent.jacobian[self.rows], unknowns=unknowns,
                       heave=np.full(len(table.states), np.nan))

    def _added(self, hypothesis: Hypothesis) -> FitTangent:
        """Tangent at the best of a hypothesis' effects alone, the others without size."""
        alone = [self.tangents[cause,] for cause in hypothesis]
        best = min(alone, key=lambda tangent: tangent.cost)
        about = np.zeros(unknown_count(hypothesis))
        jacobian = np.empty((len(best.predicted), len(about)))
        about[FACTORS], jacobian[:, FACTORS] = best.about[FACTORS], best.jacobian[:, FACTORS]
        for cause, tangent in zip(hypothesis, alone, strict=True):
            sizes = sizes_of(hypothesis, cause)
            jacobian[:, sizes] = tangent.jacobian[:, SIZES]
            about[sizes] = tangent.about[SIZES] if tangent is best else 0.0
        return replace(best, about=about, jacobian=jacobian)
