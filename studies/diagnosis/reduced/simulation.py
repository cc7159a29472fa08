"""What readings show under hypotheses: of films by their force laws, or of coupons."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.hypothesis import FACTORS, Hypothesis, uses_of, with_factors
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.coupon_tests import (
    CouponPrediction,
    CouponTests,
    coupon_setup,
)
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms, bounds_of
from tympan.studies.effects import Setup, extended

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class WithCoupons:
    """Rows of films and, where ``of_coupons``, of coupons; named as in a film's prediction."""

    def __init__(self, films: Prediction, coupons: CouponPrediction, of_coupons: Mask) -> None:
        self.films, self.coupons, self.of_coupons = films, coupons, of_coupons
        self.possible, self.short, self.heave = films.possible, films.short, films.heave

    @property
    def complete(self) -> bool:
        """Whether all that was read is possible."""
        return self.films.complete and self.coupons.complete

    def beyond(self, before: WithCoupons) -> bool:
        """Whether a search must not go here: where a strip has no equilibrium."""
        return self.coupons.beyond(before.coupons)

    @cached_property
    def extended(self) -> Array:
        """What each row shows, films at the extended heaves."""
        return self._joined(self.films.extended, self.coupons.extended)

    @cached_property
    def values(self) -> Array:
        """What each row shows, nan where it has no equilibrium."""
        return self._joined(self.films.values, self.coupons.values)

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the extended rows by the unknowns, shape (rows, unknowns)."""
        return self._joined(self.films.jacobian, self.coupons.jacobian)

    def _joined(self, films: Array, coupons: Array) -> Array:
        values = np.empty((len(self.of_coupons), *films.shape[1:]))
        values[~self.of_coupons], values[self.of_coupons] = films, coupons
        return values


@dataclass(frozen=True, eq=False)
class Simulation(ReducedFilms):
    """The films of a setup, and what is read of them.

    ``coupons`` are read beside actuators, or alone: then there are no force laws.
    """

    coupons: CouponTests | None = None

    @property
    def coupons_alone(self) -> CouponTests | None:
        """Coupons, where no actuators are read."""
        return None if self.laws else self.coupons

    def predict(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Array:
        """What each row of a table shows."""
        return self.prediction(hypothesis, unknowns, table).values

    def prediction(self, hypothesis: Hypothesis, unknowns: Array,
                   table: ReadingTable) -> Prediction | CouponPrediction | WithCoupons:
        """What a table's readings show, with derivatives."""
        if self.coupons_alone is not None:
            return self._of_coupons(self.coupons_alone, hypothesis, unknowns, table)
        stress = table.kind == "stress"
        if self.coupons is None or not stress.any():
            return Prediction(self, hypothesis, unknowns, table)
        return WithCoupons(Prediction(self, hypothesis, unknowns, table[~stress]), self._of_coupons(
            self.coupons, hypothesis, unknowns, table[stress]), stress)

    def _of_coupons(self, tests: CouponTests, hypothesis: Hypothesis, unknowns: Array,
                    table: ReadingTable) -> CouponPrediction:
        return CouponPrediction(tests, hypothesis, unknowns, table.coupon,
                               bounds_of(self, hypothesis))

    def extended(self, hypothesis: Hypothesis, unknowns: Array) -> Setup:
        """The setup with stiffness, permittivity and effects."""
        uses = uses_of(hypothesis, unknowns)
        if self.coupons_alone is not None:
            return coupon_setup(self.setup, unknowns, uses)
        stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()
        films = self.setup.with_films(lambda film: with_factors(film, stiffness, permittivity))
        return extended(films, uses)
