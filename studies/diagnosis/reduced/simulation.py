"""Readings under hypotheses: each kind of evidence predicts by the films, or by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.evidence.kind import (
    Evidence,
    ReadingModel,
    Shown,
    StripEvidence,
    rows_of_kinds,
)
from tympan.studies.diagnosis.evidence.registry import PLATES
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.growth import coupled, grown, refined, regridded
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms, bounds_of, limits_of

#: Factor by which deflections and U² reach further in one step.
_FURTHER = 1.4


class JointPrediction:
    """Readings of rows of several kinds, with the states of the first kind."""

    def __init__(self, parts: list[Shown], rows: list[Mask]) -> None:
        self.parts, self.rows = parts, rows
        self.possible, self.short = parts[0].possible, parts[0].short
        self.deflection = parts[0].deflection

    @property
    def complete(self) -> bool:
        """Whether everything that was read is possible."""
        return all(part.complete for part in self.parts)

    def beyond(self, before: JointPrediction) -> bool:
        """Check whether a search must not go here."""
        return any(part.beyond(other) for part, other in zip(self.parts, before.parts, strict=True))

    @cached_property
    def extended(self) -> Array:
        """Reading of each row, continued where there is no equilibrium."""
        return self._joined([part.extended for part in self.parts])

    @cached_property
    def values(self) -> Array:
        """Reading of each row, nan where it has no equilibrium."""
        return self._joined([part.values for part in self.parts])

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the extended rows by the unknowns, shape (rows, unknowns)."""
        return self._joined([part.jacobian for part in self.parts])

    def _joined(self, parts: list[Array]) -> Array:
        values = np.empty((len(self.rows[0]), *parts[0].shape[1:]))
        for rows, part in zip(self.rows, parts, strict=True):
            values[rows] = part
        return values


@dataclass(frozen=True, eq=False)
class Simulation(ReducedFilms, ReadingModel):
    """The films of a setup by their force laws, as the model for inference.

    Without plates under loads there are no force laws. A result is of the first kind of evidence,
    and of the kinds that agree with it in having loads.
    """

    evidence: tuple[Evidence, ...] = field(default_factory=lambda: tuple(PLATES))

    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        # The films are evaluated once for all readings of plates under loads.
        kinds = [[kind for kind in self.evidence if kind.loaded],
                 *([kind] for kind in self.evidence if not kind.loaded)]
        parts = [(some[0], rows) for some in kinds if (rows := rows_of_kinds(some, table)).any()]
        if len(parts) < 2:
            kind = parts[0][0] if parts else self.evidence[0]
            return self._shown(kind, hypothesis, unknowns, table)
        return JointPrediction([self._shown(kind, hypothesis, unknowns, table[rows])
                         for kind, rows in parts], [rows for _, rows in parts])

    def _shown(self, kind: Evidence, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable
               ) -> Shown:
        if kind.loaded:
            return Prediction(self, hypothesis, unknowns, table)
        assert isinstance(kind, StripEvidence)
        return kind.predict(self, hypothesis, unknowns, table)

    def bounds(self, hypothesis: Hypothesis) -> Array:
        return bounds_of(self, hypothesis)

    def limits(self, hypothesis: Hypothesis) -> Array:
        return limits_of(self, hypothesis)

    def of_first(self) -> Simulation:
        return replace(self, evidence=tuple(kind for kind in self.evidence
                                            if kind.loaded == self.evidence[0].loaded))

    def grown(self, cause: Cause, index: int, side: int, workers: int = 1) -> Simulation:
        return grown(self, cause, index, side, workers)

    def refined(self, hypothesis: Hypothesis, unknowns: Array, workers: int = 1) -> Simulation:
        return refined(self, hypothesis, unknowns, workers)

    def coupled(self, hypotheses: Sequence[Hypothesis], unknowns: Sequence[Array],
                workers: int = 1) -> Simulation:
        return coupled(self, hypotheses, unknowns, workers)

    def further(self, workers: int = 1) -> Simulation:
        grids = [replace(law.grid, deflection=_FURTHER * law.grid.deflection,
                         voltage_squared=_FURTHER * law.grid.voltage_squared)
                 for law in self.laws]
        try:
            return regridded(self, grids, workers)
        except ArithmeticError:  # the films cannot be solved further
            return self
