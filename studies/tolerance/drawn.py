"""Random films whose parameters vary within the given tolerances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings
from tympan.studies.films.box import STIFFNESS, Box
from tympan.studies.films.family import FamilySettings, FilmFamily
from tympan.studies.films.population import Population
from tympan.studies.tolerance.given import (
    AMPLIFIER,
    FACTORS,
    LOAD,
    STRENGTH,
    ScatterCause,
    Tolerances,
    causes,
)
from tympan.studies.tolerance.shares import SaltelliDesign

#: Relative error of a family against finite elements: a quantile of 10,000 films that scatter by
#: about 5 % is accurate to 1e-3. With 1e-4 the films take a third more time.
_ERROR = 5e-4
#: Settings of a family that is made only for the spread between films.
BY_SPREAD = FamilySettings(error=_ERROR, checks=24)


@dataclass(frozen=True, eq=False)
class Scattered:
    """A specimen and the causes by which its numbers scatter; without causes nothing scatters."""

    specimen: Specimen
    causes: tuple[ScatterCause, ...] = ()

    @classmethod
    def of(cls, specimen: Specimen, tolerances: Tolerances | None) -> Self:
        """Find the causes of a specimen's tolerances; without tolerances nothing scatters."""
        if tolerances is None:
            return cls(specimen)
        found, _ = causes(specimen, tolerances)
        return cls(specimen, found)

    @property
    def _inputs(self) -> list[tuple[ScatterCause, str]]:
        """Independent random numbers: the cause, and the number that it changes."""
        return [(cause, target) for cause in self.causes for target in cause.targets]

    @property
    def inputs(self) -> int:
        """Number of random numbers of a film."""
        return len(self._inputs)

    def design(self, count: int, seed: int) -> SaltelliDesign:
        """Draw about ``count`` films; groups: the causes, and all that differs within a batch."""
        inputs = self._inputs
        groups = [[cause is own for own, _ in inputs] for cause in self.causes]
        apart = [own.scope == "film" for own, _ in inputs]
        return SaltelliDesign.drawn([*groups, apart], count, seed)

    def values(self, points: Array) -> dict[str, Array]:
        """Compute numbers at points (films, inputs) from 0 to 1, by name, (films,) each."""
        values: dict[str, Array] = {}
        for (cause, target), shares in zip(self._inputs, points.T, strict=True):
            values[target] = cause.moved(values.get(target, self._own(target)), shares)
        return values

    def _own(self, target: str) -> float:
        """Find a number of the film without scatter."""
        if target in FACTORS:
            return 1.0
        return float(Box.around(self.specimen, {target: (0.0, 1.0)}).row(self.specimen)[0])

    def _around(self) -> dict[str, tuple[float, float]]:
        """Find lowest and highest value of every number that scatters, without the strength."""
        bounded = tuple(cause for cause in self.causes if cause.weibull is None)
        ends = Scattered(self.specimen, bounded)
        found = ends.values(np.outer([0.0, 1.0], np.ones(ends.inputs)))
        return {name: (float(low), float(high)) for name, (low, high) in found.items()}

    def widened(self, limits: Mapping[str, tuple[float, float]], *, generous: bool = False
                ) -> dict[str, tuple[float, float]]:
        """Widen limits of numbers by the scatter about any film within these limits.

        A number that scatters and has no limits has the specimen's value. Lengths scatter by the
        same amount at any value, other numbers in proportion. With ``generous`` they scatter by the
        larger of both.
        """
        wide = dict(limits)
        relative = {target for cause, target in self._inputs if cause.relative}
        for name, (low, high) in self._around().items():
            if name in FACTORS:
                continue
            own = self._own(name)
            first, last = limits.get(name, (own, own))
            moved = first + low - own, last + high - own
            scaled = (first * low / own, last * high / own) if own else moved
            wide[name] = scaled if name in relative else moved
            if generous:
                wide[name] = min(moved[0], scaled[0]), max(moved[1], scaled[1])
        return wide

    def box(self, limits: Mapping[str, tuple[float, float]] | None = None, *,
            generous: bool = False) -> Box:
        """Make the box of all films that scatter about films within limits: :meth:`widened`."""
        return Box.around(self.specimen, self.widened(limits or {}, generous=generous))

    def scaled(self, factor: str, low: float, high: float) -> tuple[float, float]:
        """Find lowest and highest value of a load or a voltage, with the factor's own scatter."""
        ends = self._around().get(factor, (1.0, 1.0))
        return min(low * end for end in ends), max(high * end for end in ends)

    def family(self, box: Box, masses: tuple[float, float], voltage: float, rig: Rig,
               settings: Settings, family: FamilySettings = BY_SPREAD) -> FilmFamily:
        """Make the family of all films of a box under their scattering loads.

        ``masses``: lowest and highest nominal mass [kg]. ``voltage``: highest nominal voltage [V].
        """
        forces = box.forces(rig, self.scaled(LOAD, *masses))
        across = self.scaled(AMPLIFIER, 0.0, float(rig.film_voltage(voltage)))
        return FilmFamily.over(box, forces, across, rig, settings, family)

    def films(self, family: FilmFamily, row: Array, points: Array, rig: Rig) -> Population:
        """Make films of a family at points (films, inputs) about one with parameters ``row``."""
        values, count = self.values(points), len(points)
        rows = np.tile(row, (count, 1))
        for number, name in enumerate(family.box.names):
            if name in values:
                own = row[number] if name == STIFFNESS else 1.0
                rows[:, number] = own * values[name]
        one = np.ones(count)
        load, amplifier, strength = (values.get(name, one)
                                     for name in (LOAD, AMPLIFIER, STRENGTH))
        median = median_strength(family, row, self.causes)
        return Population(family, rig, rows, load, amplifier, median * strength)

    def population(self, masses: tuple[float, float], voltage: float, points: Array, rig: Rig,
                   settings: Settings) -> Population:
        """Make films about the specimen at points (films, inputs), with their family.

        ``masses``: lowest and highest nominal mass [kg]. ``voltage``: highest nominal voltage [V].
        """
        box = self.box()
        family = self.family(box, masses, voltage, rig, settings)
        return self.films(family, box.row(self.specimen), points, rig)

    def with_nominal(self, points: Array) -> Array:
        """Put the point of the film without scatter in front of points."""
        return np.concatenate([np.full((1, self.inputs), 0.5), points])


def median_strength(family: FilmFamily, row: Array, found: tuple[ScatterCause, ...]) -> float:
    """Compute the factor on the electric strength by the area of a film's electrode."""
    weibull = next((cause.weibull for cause in found if cause.weibull is not None), None)
    if weibull is None:
        return 1.0
    films = family.films(row[None])
    mounted = films.at(films.whole).volumes[0] @ films.whole.sites.covered
    # Each film of a stack may break down, so their areas add up.
    return weibull.median(float(mounted / family.box.specimen.membrane.thickness
                                * family.box.specimen.membrane.area_prestretch))
