"""Numbers of a specimen and its loads that may be chosen, each within a range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array
from tympan.base.paths import at, with_numbers
from tympan.geometry.specimen import Specimen


@dataclass(frozen=True)
class Vary:
    """A free number between two values [SI]: a number of the specimen, equal numbers, or a load.

    ``names``: its paths in a specimen; empty for a load.
    """

    key: str
    names: tuple[str, ...]
    low: float
    high: float
    dimension: str = ""


@dataclass(frozen=True, eq=False)
class Ranges:
    """A specimen, and the free numbers of it and of its loads."""

    specimen: Specimen
    variables: tuple[Vary, ...]

    @property
    def lows(self) -> Array:
        """Lowest values of the variables [SI], (variables,)."""
        return np.array([each.low for each in self.variables])

    @property
    def widths(self) -> Array:
        """Highest less lowest values [SI], (variables,)."""
        return np.array([each.high - each.low for each in self.variables])

    def values(self, x: Array) -> Array:
        """Compute values of the variables at shares x of their ranges."""
        return np.asarray(self.lows + self.widths * x)

    def hold(self, specimen: Specimen) -> bool:
        """Test whether the numbers of a specimen lie within the ranges."""
        return all(each.low <= float(at(specimen, name.split("."))) <= each.high
                   for each in self.variables for name in each.names)

    def built(self, values: Sequence[float] | Array) -> Specimen:
        """Build the specimen with these values.

        Raises
        ------
        InputError
            When it cannot be built.
        """
        made: Specimen = with_numbers(self.specimen, {
            name: float(value) for each, value in zip(self.variables, values, strict=True)
            for name in each.names})
        return made
