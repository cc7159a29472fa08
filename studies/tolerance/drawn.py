"""Random films whose parameters vary within the given tolerances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings
from tympan.studies.films.box import STIFFNESS, Box
from tympan.studies.films.family import BLOCK, FamilySettings, FilmFamily
from tympan.studies.films.loaded import FamilyFilms
from tympan.studies.films.many_films import Films
from tympan.studies.tolerance.given import AMPLIFIER, FACTORS, LOAD, Cause
from tympan.studies.tolerance.shares import Design

#: How near a family is to finite elements, relative: a quantile of 10,000 films that scatter by
#: some 5 % is known to 1e-3. With 1e-4 films take a third more time.
_ERROR = 5e-4


@dataclass(frozen=True, eq=False)
class Scattered:
    """Numbers of a specimen with what makes each of them scatter."""

    specimen: Specimen
    causes: tuple[Cause, ...]

    @property
    def _inputs(self) -> list[tuple[Cause, str]]:
        """Independent random numbers: cause and number that it moves."""
        return [(cause, target) for cause in self.causes for target in cause.targets]

    @property
    def inputs(self) -> int:
        """Number of random numbers of a film."""
        return len(self._inputs)

    def design(self, count: int, seed: int) -> Design:
        """Design of about ``count`` films; groups: causes, and all that a batch does not share."""
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

    def forces(self, forces: tuple[float, float]) -> tuple[float, float]:
        """Lowest and highest force of films under nominal forces of a range [N]."""
        loads, (low, high) = self.around().get(LOAD, (1.0, 1.0)), forces
        return min(low * share for share in loads), max(high * share for share in loads)

    def highest(self, voltage: float) -> float:
        """Highest voltage of films under a nominal one [V]."""
        return voltage * self.around().get(AMPLIFIER, (1.0, 1.0))[1]

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

    def part(self, some: Any) -> Self:
        """Some of the films."""
        return replace(self, **{name: getattr(self, name)[some]
                                for name in ("rows", "load", "amplifier", "strength")})

    @classmethod
    def of(cls, values: Mapping[str, Array]) -> Self:
        """Those of numbers by name."""
        names = [name for name in values if name not in FACTORS]
        count = len(next(iter(values.values())))
        rows = np.array([values[name] for name in names]).reshape(len(names), count).T
        return cls(names, rows, *(values.get(name, np.ones(count)) for name in FACTORS))


@dataclass(frozen=True, eq=False)
class Copies:
    """Films drawn from a specimen, the first without scatter, and the family that solves them."""

    rig: Rig
    family: FilmFamily
    drawn: Rows

    @classmethod
    def of(cls, scattered: Scattered, points: Array, forces: tuple[float, float], voltage: float,
           rig: Rig, settings: Settings) -> Self:
        """Films at points, (films, inputs), under forces of a range [N] up to a film voltage [V].

        Both are those of the film without scatter.
        """
        around = scattered.around()
        family = FilmFamily.around(
            scattered.specimen, {name: limits for name, limits in around.items()
                                 if name not in FACTORS},
            scattered.forces(forces), (0.0, scattered.highest(voltage)), rig, settings,
            FamilySettings(error=_ERROR))
        return cls.within(family, scattered, points, rig)

    @classmethod
    def within(cls, family: FilmFamily, scattered: Scattered, points: Array, rig: Rig,
               stiffness: float = 1.0) -> Self:
        """Films at points, (films, inputs), that a family holds.

        Numbers that do not scatter are those of the specimen, whose law has a factor ``stiffness``.
        """
        middle = np.full((1, points.shape[1]), 0.5)
        values = scattered.values(np.concatenate([middle, points]))
        row = dict(zip(family.box.names, family.box.row(scattered.specimen), strict=True))
        count = 1 + len(points)
        every = {name: values.get(name, np.full(count, value)) for name, value in row.items()}
        if STIFFNESS in every:
            every[STIFFNESS] = stiffness * every[STIFFNESS]
        drawn = Rows.of(every | {name: values[name] for name in FACTORS if name in values})
        strength = drawn.strength * median_strength(family, drawn.rows[0], scattered.causes)
        return cls(rig, family, replace(drawn, strength=strength))

    def parts(self) -> Iterator[Self]:
        """All of them in parts, as they are computed together."""
        for start in range(0, len(self.drawn.rows), BLOCK):
            yield replace(self, drawn=self.drawn.part(slice(start, start + BLOCK)))

    @cached_property
    def _films(self) -> Films:
        return self.family.films(self.drawn.rows)

    def forces(self, mass: float) -> Array:
        """Forces on the plates [N] of a nominal mass [kg], (films,)."""
        size = self.family.box.specimen.plate_area
        return np.asarray(self.rig.force(mass * self.drawn.load, size))

    def across(self, voltages: Any) -> Array:
        """Voltages across the films [V] at nominal ones, (films, voltages)."""
        nominal = self.rig.film_voltage(np.atleast_1d(voltages))
        return np.asarray(self.drawn.amplifier[:, None] * nominal)

    def solved(self, mass: float, voltages: Any, rest: Array | None = None, *,
               swings: bool = True) -> dict[str, Array]:
        """Numbers of the films at nominal voltages [V], (films, voltages), by key; nan where none.

        Such a film has no stable equilibrium, or is not firm, in tension and below its strength.
        ``rest``: what :meth:`rests` answers, where it is known; without ``swings`` frequencies are
        left out.
        """
        forces = self.forces(mass)
        states = self.family.states(self._films, forces[:, None], self.across(voltages), False,
                                    self.swinging(mass)[:, None] if swings else None)
        rest = self.rests(forces) if rest is None else rest
        holds = states.holds & states.sound & np.isfinite(rest[:, :1])
        holds &= states.breakdown < self.drawn.strength[:, None]
        # Without a load the film is flat; what its equations leave of a deflection is rounding.
        loaded = (forces[:, None] != 0) | self._films.gas
        values = {"deflection_m": loaded * states.deflection,
                  "stroke_m": loaded * (states.deflection - rest[:, :1]),
                  "capacitance_F": states.capacitance, "frequency_Hz": states.frequency}
        return {key: np.where(holds, value, np.nan) for key, value in values.items()}

    def loaded(self, mass: float, voltage: float, margin: float = 1.0) -> FamilyFilms:
        """The films under a nominal mass [kg] and voltage [V], and that times a margin."""
        plated = self.family.box.specimen.plate is not None
        swinging = self.swinging(mass) if plated else None
        return FamilyFilms(self.family, self.drawn.rows, self.forces(mass), swinging,
                           np.full(len(self.drawn.rows), voltage), self.rig, margin,
                           self.drawn.amplifier, self.drawn.strength)

    def swinging(self, mass: float) -> Array:
        """Masses that swing with the plates under a nominal mass [kg], (films,)."""
        return np.asarray(mass * self.drawn.load + self.rig.unaccounted_mass + self.rig.added_mass)

    def rests(self, forces: Array) -> Array:
        """States q of the films without voltage, (films, shapes)."""
        return self.family.rests(self._films, forces, np.zeros(len(forces)))

    def frequencies(self, q: Array, mass: float) -> Array:
        """Lowest frequencies [Hz] in states q without voltage, (films,)."""
        return self.family.frequencies(self._films, q, np.zeros(len(q)), self.swinging(mass))

    def held(self, q: Array, voltages: Array) -> Array:
        """Forces [N] that hold plates where states q have them, at voltages across, (films,)."""
        return self.family.held_forces(self._films, q, voltages)


def median_strength(family: FilmFamily, row: Array, found: tuple[Cause, ...]) -> float:
    """Factor on the electric strength that the area of a film's electrode makes."""
    weibull = next((cause.weibull for cause in found if cause.weibull is not None), None)
    if weibull is None:
        return 1.0
    films = family.films(row[None])
    mounted = films.at(films.whole).volumes[0] @ films.whole.sites.covered
    # A stack is so many films, each of which may break down.
    return weibull.median(float(mounted / family.box.specimen.membrane.thickness
                                * family.box.specimen.membrane.area_prestretch))
