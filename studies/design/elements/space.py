"""Designs of one specimen, searched by finite elements from its own values on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tympan.fem.complex_step import complex_step
from tympan.geometry.paths import at, with_change, with_numbers
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case
from tympan.studies.design.ranges import Ranges
from tympan.studies.design.requirements import MEASURES, NOTHING, Requirements


@dataclass(frozen=True, eq=False)
class ElementSpace(Ranges):
    """Lengths of frame and plate that vary as requirements allow, under their loads."""

    requirements: Requirements

    @classmethod
    def of(cls, requirements: Requirements) -> Self:
        """Designs of requirements that are searched by finite elements."""
        specimen, = requirements.specimens
        return cls(specimen, requirements.variables[specimen.name], requirements)

    @property
    def reference(self) -> Specimen:
        """Specimen whose frame is held: the one that varies where no other is named."""
        return self.requirements.reference or self.specimen

    @property
    def starts(self) -> tuple[tuple[float, ...], ...]:
        """Values of the variables to start from: the specimen's own, then others."""
        own = tuple(float(at(self.specimen, name.split(".")))
                    for each in self.variables for name in each.names)
        return (own, *self.requirements.starts)

    @property
    def case(self) -> Case:
        """The specimen's own."""
        given = self.requirements
        return Case(self.specimen, mass=given.mass, voltage=given.voltage, rig=given.rig)

    def held_slopes(self, measure: str, values: np.ndarray) -> tuple[float, np.ndarray]:
        """A held measure of the frame over the reference's, minus one; its derivatives.

        Whether or not a plate fits in the frame. Of nothing, 0 and its derivatives.
        """
        if measure == NOTHING:
            return 0.0, np.zeros(len(self.variables))
        size, whole = MEASURES[measure], float(np.real(MEASURES[measure](self.reference.frame)))
        names = [each.names[0].partition("frame.")[2] for each in self.variables]
        frame = with_numbers(self.specimen.frame, {
            name: float(value) for name, value in zip(names, values, strict=True) if name})

        def slope(name: str) -> float:
            return float(complex_step(
                lambda change: size(with_change(frame, name.split("."), change)), 0.0))

        slopes = [slope(name) if name else 0.0 for name in names]
        return float(np.real(size(frame))) / whole - 1, np.array(slopes) / whole
