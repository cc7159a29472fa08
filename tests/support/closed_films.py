"""Films in closed form in place of a family's, to try a search for designs in moments.

A flat round film carries its plate by its tension along the film N = N₀ − c U², so that a plate
under a force F is at F ln(R/r) / (2π N). What makes designs differ is as in real films: stroke
against frequency, room, tension and strength. Nothing of it is meant to be exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from tympan.base.arrays import AnyArray
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings
from tympan.studies.design.ranges import Ranges
from tympan.studies.design.requirements import Requirements
from tympan.studies.variables import Variable

#: Tension of the film without voltage [N/m], and what a voltage takes from it [N/m/V²].
TAUT, SOFTER = 20.0, 4e-7
#: Thickness [m], strength [V/m] and density by area [kg/m²] of the film.
THIN, STRENGTH, HEAVY = 1e-4, 1e8, 0.1
#: Relative standard deviations of the tension and of the voltage.
SCATTER = np.array([0.08, 0.02])


@dataclass(frozen=True, eq=False)
class ClosedFilms:
    """Films of designs under a load [N] and voltages [V], (films,), as ``Loaded`` has them."""

    specimens: Sequence[Specimen]
    radii: tuple[AnyArray, AnyArray]
    load: float
    voltage: AnyArray
    margin: float
    taut: AnyArray
    amplifier: AnyArray

    @property
    def across(self) -> AnyArray:
        """Voltages of the states, (films, states)."""
        levels = [0.0, 1.0, self.margin] if self.margin > 1 else [0.0, 1.0]
        return np.outer(self.voltage * self.amplifier, levels)

    @property
    def tension(self) -> AnyArray:
        return (self.taut[:, None] - SOFTER * self.across**2) / THIN

    @property
    def _compliance(self) -> AnyArray:
        """Deflection over force [m/N]."""
        outer, inner = self.radii
        least = 0.1 * TAUT / THIN  # what is left of it where tension is lost
        carried = (self.tension + np.sqrt(self.tension**2 + 4 * least**2)) / 2
        carried = np.where(self.tension > -5 * least, carried, np.nan)
        return np.log(outer / inner)[:, None] / (2 * np.pi * THIN * carried)

    @property
    def deflection(self) -> AnyArray:
        return self.load * self._compliance

    @property
    def stroke(self) -> AnyArray:
        return self.deflection[:, 1] - self.deflection[:, 0]

    @property
    def slope(self) -> AnyArray:
        return np.zeros((*self.deflection.shape, 2))

    @property
    def shift(self) -> AnyArray:
        return np.zeros((*self.deflection.shape, 2))

    def shown(self, variable: Variable) -> AnyArray:
        """A variable of the states, of those that these films have."""
        states: Any = self
        assert variable.of is not None
        return variable.of(states)

    @property
    def capacitance(self) -> AnyArray:
        outer, inner = self.radii
        flat = 8.854e-12 * 4.7 * np.pi * (outer**2 - inner**2) / THIN
        return flat[:, None] * (1 + self.deflection**2 / outer[:, None]**2)

    @property
    def force(self) -> AnyArray:
        return np.full_like(self.across, self.load)

    @property
    def stress(self) -> AnyArray:
        return self.tension + self.load / (2 * np.pi * self.radii[1][:, None] * THIN)

    @property
    def electric(self) -> AnyArray:
        return self.across / THIN

    @property
    def breakdown(self) -> AnyArray:
        return self.electric / STRENGTH

    @property
    def blocked_force(self) -> AnyArray:
        return self.load * (1 - self.tension[:, 1] / self.tension[:, 0])

    @property
    def frequency(self) -> AnyArray:
        return np.asarray(1 / (2 * np.pi * np.sqrt(self._compliance[:, 1] * self.load / 9.80665)))

    @property
    def first_limit(self) -> AnyArray:
        return np.minimum(np.sqrt(self.taut / SOFTER), STRENGTH * THIN) / self.amplifier

    @property
    def limit(self) -> AnyArray:
        return np.sqrt(self.taut / SOFTER) / self.across[:, 1]

    @property
    def sound(self) -> AnyArray:
        return np.isfinite(self.deflection[:, :2]).all(1)

    def failures(self, some: AnyArray) -> AnyArray:
        """All of them lose tension."""
        return np.full(int(some.sum()), "tension", dtype=object)


@dataclass(frozen=True, eq=False)
class ClosedSpace(Ranges):
    """Round films, as :class:`~tympan.studies.design.space.DesignSpace`."""

    requirements: Requirements
    scatter: tuple[Any, ...] = field(default=())

    @property
    def asked(self) -> Any:
        return self.variables

    @cached_property
    def random(self) -> tuple[AnyArray, ClosedFilms]:
        """Shares of random films, and these."""
        x = qmc.Sobol(len(self.variables), seed=np.random.default_rng(1)).random_base2(6)
        return x, self.films(self.values(x))

    @property
    def inputs(self) -> int:
        return len(SCATTER)

    def load(self, values: AnyArray) -> float:
        return self.requirements.mass

    def voltage(self, values: AnyArray) -> float:
        return next((float(value) for each, value in zip(self.variables, values, strict=True)
                     if each.key == "voltage"), self.requirements.voltage)

    def rig(self, values: AnyArray) -> Rig:
        return self.requirements.rig

    def hold(self, specimen: Specimen) -> bool:
        return False

    def films(self, values: AnyArray) -> ClosedFilms:
        """Films without scatter."""
        return self._films(np.asarray(values), np.full((1, len(SCATTER)), 0.5))

    def scattered(self, designs: AnyArray, points: AnyArray) -> ClosedFilms:
        """Films about designs, whose copies follow one another."""
        return self._films(np.atleast_2d(designs), points)

    def exact(self, values: AnyArray, settings: Settings) -> ClosedFilms:
        """The film without scatter."""
        return self.films(values[None])

    def _films(self, designs: AnyArray, points: AnyArray) -> ClosedFilms:
        factors = np.exp(SCATTER * norm.ppf(np.clip(points, 1e-6, 1 - 1e-6)))
        taut, amplifier = np.tile(factors, (len(designs), 1)).T
        built, count = [self.built(each) for each in designs], len(points)
        outer, inner = (np.repeat([read(each) for each in built], count) for read in (
            lambda film: film.frame.semi_axes[0],
            lambda film: film.needed_plate().outline.semi_axes[0]))
        voltage = np.repeat([self.voltage(each) for each in designs], count)
        return ClosedFilms([film for film in built for _ in range(count)], (outer, inner),
                           9.80665 * self.requirements.mass, voltage, self.requirements.margin,
                           TAUT * taut, amplifier)

    def with_bounds(self, bounds: Any, best: str = "") -> ClosedSpace:
        """The same with other requirements."""
        return replace(self, requirements=replace(self.requirements, bounds=bounds, best=best))
