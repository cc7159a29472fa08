"""Fits to a part of the readings, to first order about the fits to all of them.

Most fits move little if only a part of the readings is used. So derivatives at the fits to all
readings show which hypotheses that part supports. The few that matter are then fitted with the
model itself.
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
    """Predictions of rows at some unknowns, to first order about others.

    ``about``: where derivatives were taken, and ``unknowns``, shape (p,); ``predicted``: at
    ``about``, (rows,); ``jacobian``: (rows, p); ``deflection``: of states [m], not known;
    ``cost``: at ``about``. All states are taken as possible.
    """

    about: Array
    predicted: Array
    jacobian: Array
    unknowns: Array
    deflection: Array
    cost: float
    complete: bool = True

    @classmethod
    def at(cls, fit: Fit, table: ReadingTable) -> FitTangent:
        """Build the tangent of a fit at its unknowns, in the rows of the table it was fitted to."""
        return cls(fit.unknowns, fit.predicted(table), table.noise.coloured(fit.jacobian),
                   fit.unknowns, fit.deflection, fit.cost)

    @classmethod
    def made(cls, shown: Shown, unknowns: Array, cost: float) -> FitTangent:
        """Build the tangent of a model's prediction at some unknowns, with its cost."""
        return cls(unknowns, shown.extended, shown.jacobian, unknowns, shown.deflection, cost)

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
        """Mask of the states with an equilibrium: all."""
        return np.ones(len(self.deflection), bool)

    @property
    def short(self) -> Mask:
        """Mask of the states out of the model's reach: none."""
        return np.zeros(len(self.deflection), bool)

    def beyond(self, before: Any) -> bool:
        """Check whether a search must not go here: never."""
        return False


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """Model of some ``rows`` of a table by tangents at fits to all of them.

    ``tangents``: by hypothesis, for effects alone and some pairs. For other pairs, the changes by
    both effects are added. ``whole``: the model that has the bounds of all hypotheses and predicts
    those that are ``exact`` and those without a tangent.
    """

    whole: Predicts
    tangents: Mapping[Hypothesis, FitTangent]
    rows: Mask
    exact: frozenset[Hypothesis] = frozenset()

    @classmethod
    def of(cls, whole: Predicts, causes: Iterable[Cause], nominal: Fit, fits: Iterable[Fit],
           table: ReadingTable) -> FirstOrder:
        """Build the model of all rows from all possible fits; of several the last one counts.

        Causes that were not fitted, since they are not seen, get a tangent of size 0 at the nominal
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
        """Check whether a hypothesis is predicted to first order."""
        return hypothesis not in self.exact and bool(hypothesis) and (
            hypothesis in self.tangents or all((cause,) in self.tangents for cause in hypothesis))

    def bounds(self, hypothesis: Hypothesis) -> Array:
        """Give the smallest and largest unknowns, (2, unknowns), for which films are sampled."""
        return self.whole.bounds(hypothesis)

    def limits(self, hypothesis: Hypothesis) -> Array:
        """Give the limits of unknowns for which films could be sampled, as far as known."""
        return self.whole.limits(hypothesis)

    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        """Predict the readings of the rows, with derivatives."""
        if not self.approximates(hypothesis):
            return self.whole.prediction(hypothesis, unknowns, table)
        tangent = self.tangents.get(hypothesis) or self._added(hypothesis)
        return replace(tangent, predicted=tangent.predicted[self.rows],
                       jacobian=tangent.jacobian[self.rows], unknowns=unknowns,
                       deflection=np.full(len(table.states), np.nan))

    def _added(self, hypothesis: Hypothesis) -> FitTangent:
        """Add the tangents of a hypothesis' effects alone, about the best of these fits."""
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
