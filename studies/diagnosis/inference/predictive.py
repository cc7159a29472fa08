"""Predictive distribution of readings: a mixture of hypotheses with their uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import Predicts
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.smooth_misfit import Discrepancy
from tympan.studies.diagnosis.reading_table import ReadingTable

#: Share of the readings that a band must contain.
SHARE = 0.95

#: Hypotheses less probable than this are left out of the mixture.
_LEAST = 1e-3

#: Halvings of the interval in which a limit of a band is searched.
_HALVINGS = 50


@dataclass(frozen=True, eq=False)
class Predictive:
    """Normal distributions of noise-free predictions of rows, shape (members, rows) each.

    Their ``weight`` adds up to 1 over the members. It is 0 in rows where a member has no
    equilibrium; rows where no member has one are nan. ``mean`` and ``deviation`` are in the rows'
    units.
    """

    weight: Array
    mean: Array
    deviation: Array

    @classmethod
    def of(cls, simulation: Predicts, fits: Sequence[Fit], weights: Array, table: ReadingTable,
           discrepancy: Discrepancy | None = None) -> Predictive:
        """Mix fits by their weights, shape (fits,), each linear in its unknowns about its best.

        The least probable fits are left out. ``discrepancy``: may be present besides all of them.
        """
        used = np.flatnonzero(weights >= _LEAST * weights.max())
        fits, weights = [fits[k] for k in used.tolist()], weights[used]
        mean, deviation = np.empty((2, len(fits), len(table)))
        for k, fit in enumerate(fits):
            prediction = simulation.prediction(fit.hypothesis, fit.unknowns, table)
            mean[k] = prediction.values
            spread = np.linalg.solve(np.linalg.cholesky(fit.precision), prediction.jacobian.T)
            deviation[k] = np.sqrt((spread**2).sum(0))
            if discrepancy is not None:
                more = discrepancy.variance(fit, prediction.jacobian, table)
                deviation[k] = np.sqrt(deviation[k] ** 2 + more)
        there = np.isfinite(mean + deviation)
        weight = np.where(there, weights[:, None], 0.0)
        with np.errstate(invalid="ignore"):
            weight = weight / weight.sum(0)
        return cls(weight, np.where(there, mean, 0.0), np.where(there, deviation, 0.0))

    def below(self, values: Array, noise: Array | float) -> Array:
        """Compute the probabilities that rows with that noise read less than values, (rows,)."""
        spread = np.sqrt(self.deviation**2 + np.square(noise))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray((self.weight * ndtr((values - self.mean) / spread)).sum(0))

    def band(self, noise: Array | float, share: float = SHARE) -> tuple[Array, Array]:
        """Find the limits that contain a ``share`` of readings with that noise, (rows,) each."""
        spread = np.sqrt(self.deviation**2 + np.square(noise))
        used = self.weight > 0
        there = used.any(0)
        reach = 10 * spread.max(0, where=used, initial=0.0)
        least = np.where(there, self.mean.min(0, where=used, initial=np.inf), 0.0) - reach
        most = np.where(there, self.mean.max(0, where=used, initial=-np.inf), 0.0) + reach
        limits = []
        for part in ((1 - share) / 2, (1 + share) / 2):
            low, high = least, most
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                under = self.below(middle, noise) < part
                low, high = np.where(under, middle, low), np.where(under, high, middle)
            limits.append(np.where(there, high, np.nan))
        return limits[0], limits[1]
