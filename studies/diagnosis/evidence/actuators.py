"""Readings of plates under loads: at rest, of ranges, in time, of frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.evidence.kind import Evidence, Split
from tympan.studies.diagnosis.patterns.reading_patterns import patterns
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Quantity

Array = NDArray[np.float64]

#: Share of the largest voltage up to which the extended model is fitted when it is tested above.
LOW_VOLTAGES = 0.7


class Actuators(Evidence):
    """Whatever is read of a plate."""

    kinds = ("displacement", "range", "capacitance", "film_voltage", "tilt", "frequency", "decay",
             "force")

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        return patterns(table, names, predicted)

    def splits(self, setup: Setup, table: ReadingTable
               ) -> tuple[list[Split], dict[str, NDArray[Any]]]:
        specimens = setup.specimens
        frames = [(specimen.frame, specimen.plate) for specimen in specimens]
        shape = np.array([frames.index(frame) for frame in frames])[table.specimen]
        masses, mass = np.unique(table.mass, return_inverse=True)
        edge = LOW_VOLTAGES * float(np.abs(table.voltage).max(initial=0.0))
        splits: list[Split] = []
        for number in np.unique(shape):
            names = [specimen.name for specimen, frame in zip(specimens, frames, strict=True)
                     if frame == frames[number]]
            splits.append(("shape", " and ".join(names), shape == number))
        if len(np.unique(shape)) < len(np.unique(table.specimen)):
            splits += [("specimen", specimens[number].name, table.specimen == number)
                       for number in np.unique(table.specimen)]
        splits += [("mass", f"{1e3 * value:.5g} g", mass.ravel() == number)
                   for number, value in enumerate(masses)]
        splits.append(("voltage", f"above {edge / 1e3:.3g} kV", np.abs(table.voltage) > edge))
        levels = {"shape": shape, "specimen": table.specimen, "mass": table.ramp,
                  "voltage": np.abs(table.voltage)}
        return splits, levels

    def tells(self, table: ReadingTable) -> set[Quantity]:
        states = table.states
        there = {Quantity.ELAPSED: np.ptp(states.elapsed) > 0,
                 Quantity.DIRECTION: np.any(states.direction != 0),
                 Quantity.FREQUENCY: "frequency" in table.kind,
                 Quantity.TIME: len(states.passages.rows)}
        return {quantity for quantity, told in there.items() if told}


#: They are told apart by their rows alone.
ACTUATORS = Actuators()
