"""Many films in closed form: their formula on arrays, exact for all films at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.paths import with_arrays
from tympan.fem.film.admissibility import lawful
from tympan.fem.film.density import FilmDensity
from tympan.fem.membrane.formula import Derived, Formula, step_of
from tympan.fem.membrane.loading import Loading
from tympan.geometry.outlines import area
from tympan.studies.films.box import Box, plate_areas
from tympan.studies.films.many_films import (
    Extremes,
    Films,
    FilmsAt,
    LocalState,
    ShapesAt,
)
from tympan.studies.films.sites import Sites
from tympan.studies.films.tilting import Tilting

#: Paths of the frame's numbers.
_FRAME = "frame."


@dataclass(frozen=True, eq=False)
class FormulaFilms(Films):
    """Many films of one ``formula``: one shape, the deflection, and one point, the plate's centre.

    The point stands for the most strained place. Stretches, stresses and fields there are those of
    the formula's stretches; without them they are nan.
    """

    formula: Formula = field(kw_only=True)
    step: float = field(kw_only=True)  #: of differences between deflections [m]

    @classmethod
    def of(cls, formula: Formula, box: Box, rows: AnyArray, loading: Loading, pressure: float
           ) -> FormulaFilms:
        """Make the films of a box with given parameters, rows of (films, names)."""
        point = ShapesAt(_point(), np.array([[[0.0, 0.0, 1.0]]]))
        centre, none = np.array([box.specimen.centre]), np.zeros((0, 2))
        return cls(box.specimen, rows, box.columns(rows),
                   np.broadcast_to(centre, (len(rows), *centre.shape)), point, point, loading,
                   box.springs(rows), box.pressures(rows, pressure),
                   np.array([box.specimen.gap]), np.zeros((2, 1)),
                   Tilting.of(none, none[None], none.T[:0], mirrored=False),
                   np.zeros((2, 1)),
                   formula=formula, step=step_of(box.specimen))

    def some(self, films: Any) -> Any:
        return self._with(films)

    def _derived(self, films: AnyArray) -> Derived:
        """Derive the formula for states of films, one after another."""
        arrays = {path: column[films] for path, column in self.columns.items()}
        return Derived(self.formula, with_arrays(self.specimen, arrays), self.step)

    def at(self, shapes: ShapesAt) -> FilmsAt:
        flat = _frame_areas(self) - plate_areas(self.specimen, self.columns, len(self))
        film = self.some(slice(None)).membrane
        none = np.zeros((len(self), 4, 1))
        return FilmsAt(shapes, none, none, flat[:, None] * film.volume_per_area, np.ones(1),
                       np.ones(()))

    @property
    def weight(self) -> AnyArray:
        """Weight of the films on their shape: a formula has none."""
        return np.zeros((len(self), 1))

    @property
    def inertia(self) -> AnyArray:
        """Mass of the films' shape: a formula has none."""
        return np.zeros((len(self), 1, 1))

    @property
    def volume(self) -> Any:
        """Volume of the gas below films and plates."""
        return _Volume(self)

    def pull(self, films: AnyArray, q: AnyArray, squared: AnyArray, share: float = 1.0
             ) -> tuple[AnyArray, AnyArray]:
        derived, place = self._derived(films), q[:, 0]
        stiffness = derived.stiffness(place, squared) + self.acting(films, place)[1]
        if self.gas:
            stiffness = stiffness + share * self.pressure[films] * derived.widening(place)
        return self.forces(films, q, squared, share), stiffness[:, None, None]

    def forces(self, films: AnyArray, q: AnyArray, squared: AnyArray, share: float = 1.0
               ) -> AnyArray:
        derived, place = self._derived(films), q[:, 0]
        forces = derived.force(place, squared) + self.acting(films, place)[0]
        if self.gas:
            forces = forces + share * self.pressure[films] * derived.swept(place)
        return np.asarray(forces)[:, None]

    def stored(self, films: AnyArray, q: AnyArray, squared: AnyArray) -> tuple[AnyArray, AnyArray]:
        derived, place = self._derived(films), q[:, 0]
        return (np.asarray(derived.capacitance(place, squared)),
                np.asarray(derived.energy(place, squared)))

    def extremes(self, at: FilmsAt, films: AnyArray, q: AnyArray, squared: AnyArray) -> Extremes:
        found = super().extremes(at, films, q, squared)
        if self.formula.stretches is None:
            found.electric[:] = found.weakest_field[:] = np.nan
        return found

    def least(self, field: Callable[[Any], AnyArray], at: FilmsAt, films: AnyArray, q: AnyArray,
              squared: AnyArray) -> AnyArray:
        if self.formula.stretches is None:
            return np.full(len(q), np.inf)
        return super().least(field, at, films, q, squared)

    def local(self, at: FilmsAt, films: AnyArray, q: AnyArray, squared: AnyArray) -> LocalState:
        shape = len(q), 1
        if self.formula.stretches is None:
            unknown, endless = np.full(shape, np.nan), np.full(shape, np.inf)
            sure = np.ones(shape, dtype=bool)
            return LocalState(
                stretch_1=unknown, stretch_2=unknown, thickness=unknown, stress_1=unknown,
                stress_2=endless, electric_field=np.zeros(shape), breakdown_strength=endless,
                sound=sure, lawful=sure)
        specimen = self.some(films)
        both = [np.broadcast_to(stretch, shape)
                for stretch in self.formula.stretches(specimen, q[:, :1])]
        first, second = np.maximum(*both), np.minimum(*both)
        film, density = specimen.membrane, FilmDensity(specimen, squared[:, None], 1.0,
                                                       wrinkles=False)
        _, w1, w2, *_ = density.material.derivatives(first, second)
        thickness = film.thickness / (first * second)
        strength = np.full(shape, np.inf)
        if film.strength is not None:
            strength[:] = film.strength.field(first, second, thickness)
        within = lawful(film, first, second, film.material.derivatives(first, second))
        return LocalState(
            stretch_1=first, stretch_2=second, thickness=thickness, stress_1=first * w1,
            stress_2=second * w2, electric_field=np.sqrt(squared)[:, None] / thickness,
            breakdown_strength=strength, sound=within, lawful=within)


@dataclass(frozen=True, eq=False)
class _Volume:
    """Volume of the gas below films in closed form, and their plates, as :class:`Volume`."""

    films: FormulaFilms

    def value(self, films: AnyArray, a: AnyArray) -> AnyArray:
        """Compute volumes [m³], (states,)."""
        return np.asarray(-self.films._derived(films).volume(a[:, 0]))

    def of_plates(self, films: AnyArray, heave: AnyArray, turns: AnyArray
                  ) -> tuple[AnyArray, AnyArray]:
        """Compute derivatives of the volume below plates by deflection and tilts."""
        plates = plate_areas(self.films.specimen, self.films.columns, len(self.films))[films]
        return -plates, np.zeros((len(heave), 2))


def _frame_areas(films: FormulaFilms) -> AnyArray:
    """Compute the areas of the frames [m²], (films,)."""
    varied = {path: column for path, column in films.columns.items() if path.startswith(_FRAME)}
    if not varied:
        return np.full(len(films), float(area(films.specimen.frame)))
    made = [with_arrays(films.specimen, {path: column[number].item()
                                         for path, column in varied.items()})
            for number in range(len(films))]
    return np.array([float(area(film.frame)) for film in made])


def _point() -> Sites:
    """Make the one point of films in closed form, at the plate's centre."""
    none = np.zeros(1, dtype=np.int64)
    return Sites(none, none[:, None], np.ones((1, 1)), np.zeros((1, 1, 2)), np.ones(1), np.ones(1),
                 none, np.ones(1))
