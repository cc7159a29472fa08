"""Films drawn at random as tolerances have it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.specimen import Specimen
from tympan.studies.films.box import Box
from tympan.studies.tolerance.given import FACTORS, Cause
from tympan.studies.tolerance.shares import Design

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Scattered:
    """Numbers of a specimen with what makes each of them scatter."""

    specimen: Specimen
    causes: tuple[Cause, ...]

    @property
    def _inputs(self) -> list[tuple[Cause, str]]:
        """Independent random numbers: cause and number that it moves."""
        return [(cause, target) for cause in self.causes for target in cause.targets]

    def design(self, count: int, seed: int) -> Design:
        """Design of about so many films; groups: causes, and all that a batch does not share."""
        inputs = self._inputs
        groups = [[cause is own for own, _ in inputs] for cause in self.causes]
        apart = [own.scope == "film" for own, _ in inputs]
        return Design.drawn([*groups, apart], count, seed)

    def around(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of all numbers, by name; of load and amplifier the factor."""
        bounded = [cause for cause in self.causes if cause.weibull is None]
        ends = Scattered(self.specimen, tuple(bounded))
        found = ends.values(np.outer([0.0, 1.0], np.ones(len(ends._inputs))))
        return {name: (float(low), float(high)) for name, (low, high) in found.items()}

    def values(self, points: Array) -> dict[str, Array]:
        """The numbers at points (films, inputs) from 0 to 1, by name, (films,) each."""
        values: dict[str, Array] = {}
        for (cause, target), shares in zip(self._inputs, points.T, strict=True):
            values[target] = cause.moved(values.get(target, self._nominal(target)), shares)
        return values

    def _nominal(self, target: str) -> float:
        if target in FACTORS:
            return 1.0
        return float(Box.around(self.specimen, {target: (0.0, 1.0)}).row(self.specimen)[0])


@dataclass(frozen=True, eq=False)
class Rows:
    """Films by a family's parameters ``names``: ``rows`` (films, names).

    And factors of load, voltage and electric strength, (films,) each.
    """

    names: Sequence[str]
    rows: Array
    load: Array
    amplifier: Array
    strength: Array

    @classmethod
    def of(cls, values: Mapping[str, Array]) -> Self:
        """Those of numbers by name."""
        names = [name for name in values if name not in FACTORS]
        count = len(next(iter(values.values())))
        rows = np.array([values[name] for name in names]).reshape(len(names), count).T
        return cls(names, rows, *(values.get(name, np.ones(count)) for name in FACTORS))
