"""Films drawn at random as tolerances have it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import truncnorm

from tympan.geometry.specimen import Specimen
from tympan.studies.films.box import Box
from tympan.studies.tolerance.given import AMPLIFIER, LOAD, Cause
from tympan.studies.tolerance.shares import Design

Array = NDArray[Any]

#: Standard deviations beyond which there is no film: a workshop throws it away.
_FARTHEST = 3.0
#: The normal distribution within these, of standard deviation 1.
_WIDTH = float(truncnorm.std(-_FARTHEST, _FARTHEST))

#: Factors that are no numbers of the specimen.
_FACTORS = (LOAD, AMPLIFIER)


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
        edge = np.full(len(self._inputs), _FARTHEST / _WIDTH)
        low, high = self._moved(-edge[None]), self._moved(edge[None])
        return {name: (float(low[name][0]), float(high[name][0])) for name in low}

    def values(self, points: Array) -> dict[str, Array]:
        """The numbers at points (films, inputs) from 0 to 1, by name, (films,) each."""
        return self._moved(truncnorm.ppf(points, -_FARTHEST, _FARTHEST) / _WIDTH)

    def _moved(self, normal: Array) -> dict[str, Array]:
        values: dict[str, Array] = {}
        for (cause, target), deviation in zip(self._inputs, normal.T, strict=True):
            before = values.get(target, self._nominal(target))
            change = cause.deviation * deviation
            values[target] = before * np.exp(change) if cause.relative else before + change
        return values

    def _nominal(self, target: str) -> float:
        if target in _FACTORS:
            return 1.0
        return float(Box.around(self.specimen, {target: (0.0, 1.0)}).row(self.specimen)[0])


def split(values: dict[str, Array]) -> tuple[Sequence[str], Array, Array, Array]:
    """Names and rows of a family's parameters, and the factors of load and voltage."""
    names = [name for name in values if name not in _FACTORS]
    count = len(next(iter(values.values())))
    rows = np.array([values[name] for name in names]).reshape(len(names), count).T
    load, amplifier = (values.get(name, np.ones(count)) for name in _FACTORS)
    return names, rows, load, amplifier
