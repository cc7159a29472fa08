"""What readings show under hypotheses: of films by their force laws, or of coupons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.laws.stiffened import scaled
from tympan.geometry.specimen import Film
from tympan.studies.diagnosis.hypothesis import FACTORS, Hypothesis, parameters_of, uses_of
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms, bounds_of
from tympan.studies.diagnosis.reduced.strips import StripPrediction, StripTests, strip_setup
from tympan.studies.effects import Setup, extended

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Simulation(ReducedFilms):
    """The films of a setup, and what is read of them.

    Of ``strips`` instead of actuators there are no force laws.
    """

    strips: StripTests | None = None

    def predict(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Array:
        """What each row of a table shows."""
        return self.prediction(hypothesis, unknowns, table).values

    def prediction(self, hypothesis: Hypothesis, unknowns: Array,
                   table: ReadingTable) -> Prediction | StripPrediction:
        """What a table's readings show, with derivatives."""
        if self.strips is None:
            return Prediction(self, hypothesis, unknowns, table)
        sizes = [1.0, 1.0, *(item.deviation for item in parameters_of(hypothesis))]
        return StripPrediction(self.strips, lambda moved: self.extended(hypothesis, moved),
                               unknowns, table.point, bounds_of(self, hypothesis), np.array(sizes))

    def as_read(self, table: ReadingTable, part: ReadingTable) -> tuple[Simulation, ReadingTable]:
        """A part of a table's rows with values as they were read, and what predicts those."""
        strips = self.strips
        if strips is None or strips.whitening is None:
            return self, part
        read, spread = strips.as_read(table.value), strips.spread(table.sigma)
        return (replace(self, strips=replace(strips, whitening=None)),
                part.with_values(read[part.point]).with_sigma(spread[part.point]))

    def with_noise(self, table: ReadingTable, factor: float) -> tuple[Simulation, ReadingTable]:
        """The table with that factor on its noise, and what predicts it.

        What lasts along strips is no part of the noise and stays as large as it is.
        """
        louder = table.with_sigma(factor * table.sigma)
        if self.strips is None or self.strips.lasting is None:
            return self, louder
        strips = self.strips.with_noise(louder.sigma)
        return (replace(self, strips=strips),
                louder.with_values(strips.whitened(self.strips.as_read(table.value))))

    def extended(self, hypothesis: Hypothesis, unknowns: Array) -> Setup:
        """The setup with stiffness, permittivity and effects."""
        stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()
        uses = uses_of(hypothesis, unknowns)
        if self.strips is not None:
            return strip_setup(self.setup, stiffness, permittivity, uses)

        def change(film: Film) -> Film:
            return replace(film, material=scaled(film.material, stiffness),
                           relative_permittivity=film.relative_permittivity * permittivity)

        return extended(self.setup.with_films(change), uses)
