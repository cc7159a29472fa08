"""Films that may be built: a family of reduced films over all that varies and all that scatters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.paths import with_numbers
from tympan.base.points import drawn_points
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings
from tympan.studies.design.exact import ExactFilm
from tympan.studies.design.ranges import Ranges, Vary
from tympan.studies.design.requirements import Requirements
from tympan.studies.films.box import SPRING, Box
from tympan.studies.films.family import FamilySettings, FilmFamily
from tympan.studies.films.population import LoadedFilms, Population
from tympan.studies.tolerance.drawn import Scattered
from tympan.studies.tolerance.given import ScatterCause

#: Random films among which searches begin, a power of two.
_RANDOM = 512
#: Position of a length of the plate in its range, for the film whose mesh moves to all others; a
#: length of the frame has the same distance from its other end. The mesh of the middle film cannot
#: move to 2 % of random films about the smallest gaps of an ellipse; from here it moves to all.
_NARROW = 0.75
#: Settings of the family: finite elements correct the errors that remain at the end.
_FAMILY = FamilySettings(error=1e-3, rounds=2, candidates=128, checks=8)


def _meshed(middle: Specimen, box: Mapping[str, tuple[float, float]]) -> Specimen:
    """Choose the film whose mesh moves to all others: it has a narrow gap, which can be stretched.

    A mesh of the middle film would invert elements where it moves to a small frame with a large
    plate.
    """
    places = {name: (1 - _NARROW if name.startswith("frame.") else _NARROW)
              for name in box if name.startswith(("frame.", "plate.outline."))}
    try:
        narrow: Specimen = with_numbers(middle, {
            name: box[name][0] + share * (box[name][1] - box[name][0])
            for name, share in places.items()})
    except InputError:
        return middle
    return narrow


@dataclass(frozen=True, eq=False)
class DesignSpace(Ranges):
    """Films of one specimen whose numbers vary as requirements allow, and scatter."""

    requirements: Requirements
    family: FilmFamily
    scatter: tuple[ScatterCause, ...] = field(default=())

    @classmethod
    def of(cls, requirements: Requirements, specimen: Specimen, settings: Settings,
           variables: tuple[Vary, ...] = ()) -> DesignSpace:
        """Make the family of a specimen over all that varies, and over its scatter.

        ``variables``: variables with narrower ranges than the requirements', where these are too
        wide for one family.
        """
        variables = variables or requirements.variables[specimen.name]
        try:
            middle = Ranges(specimen, variables).built([(each.low + each.high) / 2
                                                       for each in variables])
        except InputError as error:
            raise InputError("has a film in the middle of its ranges that cannot be built: "
                             f"{error}", key="vary", given=specimen.name) from None
        box = {name: (each.low, each.high) for each in variables
               for name in (each.names or ((SPRING,) if each.key == SPRING else ()))}
        scattered = Scattered.of(middle, requirements.tolerances)
        box = scattered.widened(box)
        family = scattered.family(
            Box.around(_meshed(middle, box), box), _range(variables, "mass", requirements.mass),
            requirements.voltage * requirements.margin, requirements.rig, settings, _FAMILY)
        return cls(middle, variables, requirements, family, scattered.causes)

    @property
    def asked(self) -> tuple[Vary, ...]:
        """The variables with the ranges of the requirements."""
        return self.requirements.variables[self.specimen.name]

    @cached_property
    def random(self) -> tuple[Array, LoadedFilms]:
        """Shares of random films, (films, variables), and these films without scatter."""
        x = drawn_points(len(self.variables), _RANDOM, 1)
        return x, self.films(self.values(x))

    def load(self, values: Array) -> float:
        """Find the nominal mass on the plate [kg]."""
        return self._load(values, "mass", self.requirements.mass)

    def voltage(self, values: Array) -> float:
        """Find the nominal voltage [V]."""
        return self._load(values, "voltage", self.requirements.voltage)

    def rig(self, values: Array) -> Rig:
        """Make the rig of the film, with the spring of these values."""
        spring = self._load(values, SPRING, self.requirements.rig.spring)
        return replace(self.requirements.rig, spring=spring)

    def _row(self, specimen: Specimen, values: Array) -> Array:
        """Compute the family's parameters of a specimen with the spring of some values."""
        return self.family.box.row(specimen, self._load(values, SPRING, 0.0))

    def _load(self, values: Array, key: str, given: float) -> float:
        return next((float(value) for each, value in zip(self.variables, values, strict=True)
                     if each.key == key), given)

    def films(self, values: Array) -> LoadedFilms:
        """Make films without scatter from values (films, variables).

        The specimen of a film that cannot be built is None, and its numbers are nan.
        """
        specimens = [self._specimen(each) for each in values]
        known = np.array([specimen is not None for specimen in specimens])
        rows = np.array([self._row(self.specimen if specimen is None else specimen, each)
                         for specimen, each in zip(specimens, values, strict=True)])
        masses, voltage = (np.array([read(each) for each in values])
                           for read in (self.load, self.voltage))
        films = Population.alike(self.family, self.requirements.rig, rows, specimens)
        return self._loaded(films, masses, np.where(known, voltage, np.nan))

    def scattered(self, designs: Array, points: Array) -> LoadedFilms:
        """Draw films about designs, at points (films, inputs) from 0 to 1.

        ``designs``: values of one design, (variables,), or of several, (designs, variables), whose
        films follow one another.
        """
        designs, count = np.atleast_2d(designs), len(points)
        copies = [self._copies(values, points) for values in designs]
        masses, voltages = (np.repeat([read(values) for values in designs], count)
                            for read in (self.load, self.voltage))
        return self._loaded(Population.joined(copies), masses, voltages)

    def _copies(self, values: Array, points: Array) -> Population:
        """Draw films at points about one design."""
        specimen = self.built(values)
        films = Scattered(specimen, self.scatter).films(
            self.family, self._row(specimen, values), points, self.requirements.rig)
        return replace(films, specimens=[specimen] * len(points))

    def _loaded(self, films: Population, masses: Array, voltage: Array) -> LoadedFilms:
        wanted = self.requirements
        return films.under(masses, voltage, wanted.margin, swings=wanted.swings)

    def exact(self, values: Array, settings: Settings) -> ExactFilm:
        """Make the film without scatter by finite elements."""
        return ExactFilm(self.built(values), self.load(values), self.voltage(values),
                         self.rig(values), settings, self.requirements.margin)

    @property
    def inputs(self) -> int:
        """Number of inputs that scatter."""
        return sum(len(cause.targets) for cause in self.scatter)

    def _specimen(self, values: Array) -> Specimen | None:
        try:
            return self.built(values)
        except InputError:
            return None


def _range(variables: tuple[Vary, ...], key: str, given: float) -> tuple[float, float]:
    return next(((each.low, each.high) for each in variables if each.key == key), (given, given))
