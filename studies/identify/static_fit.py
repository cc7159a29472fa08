"""Eq. (11): the lumped model's static constants from readings at rest of all shapes, masses and voltages at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.density import maxwell
from tympan.fem.film.laws import Separable
from tympan.fem.film.laws.scaled import scaled
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles.cone import ConeCircle, radii_of
from tympan.studies.paper.table1 import known

Array = NDArray[np.float64]
Law = Literal["eq8", "film"]
Sharing = Literal["each", "shared"]
Objective = Literal["deflection", "force", "printed"]

_HIGHEST_STRESS = 1e7
_POWERS = (2.0, 4.0, 6.0)  # of Eq. (8)


@dataclass(frozen=True, eq=False)
class Readings:
    """Displacements read [m] of specimens (by number) under masses [kg] and voltages [V]; ``noise`` of one, or None."""

    specimens: tuple[Specimen, ...]
    rig: Rig
    which: NDArray[np.int64]
    mass: Array
    voltage: Array
    displacement: Array
    noise: float | None = None


@dataclass(frozen=True)
class Constant:
    """One number to find: a name, a unit, where the search begins, the size it is judged by, and its bounds."""

    name: str
    unit: str
    start: float
    scale: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class _Film:
    """One specimen's circles, the material at unit constants, one row for each, and the voltage at ε_r = 1."""

    circles: tuple[ConeCircle, ...]
    material: Any
    electric: Any

    def columns(self, y: Array, squared: Array) -> tuple[list[Array], list[Array]]:
        """Force and stiffness of every circle by each linear constant, shape (points, constants), at film U² [V²]."""
        pulls, stiffs = [], []
        for circle in self.circles:
            held, drawn = circle.pull(self.material, y)[1:], circle.pull(self.electric, y)[1:]
            pulls.append(np.vstack([held[0], squared * drawn[0]]).T)
            stiffs.append(np.vstack([held[1], squared * drawn[1]]).T)
        return pulls, stiffs


@dataclass(frozen=True, eq=False)
class StaticProblem:
    """Readings and the law: Eq. (8) with β, γ (``eq8``), or one factor on the films (``film``); and ε_r, α.

    ``alpha`` says whether each shape with two semi-axes has its own α of the circle with the short
    one (``each``), or one serves all as in Eq. (11) (``shared``). Each is what a user expects,
    because α belongs to the shape: for the paper's ellipses the membrane's is 0.562 and 0.608
    (`tympan alpha`), and one for both leaves that difference to the other constants. Shapes alike
    in their semi-axes share. Without such a shape α is left out.
    """

    readings: Readings
    law: Law = "eq8"
    alpha: Sharing = "each"

    @cached_property
    def constants(self) -> tuple[Constant, ...]:
        """What is to be found."""
        first = self.readings.specimens[0].membrane
        found: list[Constant] = []
        if self.law == "eq8":
            for name in ("beta", "gamma"):
                found += [Constant(f"{name}_{i}", "Pa", known(f"{name}_{i}"), 50e3,
                                   -_HIGHEST_STRESS, _HIGHEST_STRESS)
                          for i in (1, 2, 3)]
        else:
            found.append(Constant("stiffness", "1", 1.0, 1.0, 1e-3, 1e3))
        found.append(Constant("relative_permittivity", "1", first.relative_permittivity, 5.0, 0.0,
                              1e3))
        found += [Constant(name, "1", 0.5, 0.5, 0.0, 1.0) for name in dict.fromkeys(self._alphas)
                  if name]
        return tuple(found)

    def column(self, name: str) -> Array:
        """``start``, ``scale``, ``low`` or ``high`` of all constants."""
        return np.array([getattr(one, name) for one in self.constants])

    @cached_property
    def _alphas(self) -> tuple[str, ...]:
        """The name of every specimen's α; empty where it has one circle."""
        radii = [radii_of(specimen.frame) for specimen in self.readings.specimens]
        shapes: dict[tuple[float, ...], str] = {}
        for specimen, pair in zip(self.readings.specimens, radii, strict=True):
            if len(pair) > 1:
                shapes.setdefault(pair, f"alpha_1[{specimen.name}]")
        if self.alpha == "shared" or len(shapes) == 1:
            shapes = dict.fromkeys(shapes, "alpha_1")
        return tuple(shapes.get(pair, "") for pair in radii)

    @cached_property
    def _films(self) -> tuple[_Film, ...]:
        found = []
        for specimen in self.readings.specimens:
            unit = replace(specimen, membrane=replace(specimen.membrane, relative_permittivity=1.0))
            circles = tuple(ConeCircle(specimen, radius) for radius in radii_of(specimen.frame))
            found.append(_Film(circles, self._units(specimen), maxwell(unit, 1.0)))
        return tuple(found)

    def _units(self, specimen: Specimen) -> Any:
        film = specimen.membrane
        if self.law == "film":
            return film.material
        units: Any = np.eye(6)[:, :, None]
        return Separable(tuple(units[:3]), tuple(units[3:]), _POWERS, film.area_prestretch**0.5)

    def weights(self, number: int, values: Any) -> tuple[Any, ...]:
        """The weights α of a specimen's circles."""
        if not self._alphas[number]:
            return (1.0,)
        alpha = values[self._place(number)]
        return alpha, 1 - alpha

    def _place(self, number: int) -> int:
        return [one.name for one in self.constants].index(self._alphas[number])

    def specimen(self, number: int, values: Any) -> Specimen:
        """A specimen whose film follows the constants."""
        specimen = self.readings.specimens[number]
        film = specimen.membrane
        if self.law == "film":
            law, permittivity = scaled(film.material, values[0]), values[1]
        else:
            law = Separable(tuple(values[:3]), tuple(values[3:6]), _POWERS,
                            film.area_prestretch**0.5)
            permittivity = values[6]
        return replace(specimen,
                       membrane=replace(film, material=law, relative_permittivity=permittivity))

    def force(self, values: Array, y: Array) -> tuple[Array, Array, Array]:
        """The film's force [N] at deflections of all readings [m], its stiffness, its derivative by the constants."""
        r = self.readings
        force, stiffness, slopes = np.zeros(len(y)), np.zeros(len(y)), np.zeros((len(y),
                                                                                 len(self.constants)))
        for number in range(len(r.specimens)):
            own = r.which == number
            force[own], stiffness[own], slopes[own] = self.force_of(number, values, y[own],
                                                                    r.voltage[own])
        return force, stiffness, slopes

    def force_of(self, number: int, values: Array, y: Array, voltage: Array) -> tuple[Array, Array,
                                                                                      Array]:
        """The same of one specimen (by number), at deflections [m] and voltages [V] of one shape (points,)."""
        rig = self.readings.rig
        pulls, stiffs = self._films[number].columns(y, np.asarray(rig.film_voltage(voltage)) ** 2)
        weights, linear = self.weights(number, values), values[:pulls[0].shape[1]]
        mixed = sum(w * pull for w, pull in zip(weights, pulls, strict=True))
        stiffness = sum(w * stiff for w, stiff in zip(weights, stiffs, strict=True)) @ linear
        slopes = np.zeros((len(y), len(self.constants)))
        slopes[:, :len(linear)] = mixed
        if len(weights) > 1:
            slopes[:, self._place(number)] = (pulls[0] - pulls[1]) @ linear
        return mixed @ linear + rig.spring * y, stiffness + rig.spring, slopes

    @property
    def read(self) -> Array:
        """Deflections that the readings stand for [m]."""
        rig = self.readings.rig
        return np.asarray((self.readings.displacement - rig.sensor_zero) / (1 + rig.sensor_gain))

    @property
    def load(self) -> Array:
        """Weights [N]."""
        return np.asarray(self.readings.rig.force(self.readings.mass))

    def rest(self, values: Array) -> tuple[Array, Array]:
        """Deflections at rest [m] and their exact derivatives by the constants (implicit function theorem).

        Newton from what was read, at most a quarter of it a step.
        """
        y, load = self.read.copy(), self.load
        most = 0.25 * np.abs(self.read) + 1e-5
        for _ in range(40):
            force, stiffness, slopes = self.force(values, y)
            move = np.clip((load - force) / stiffness, -most, most)
            y = y + move
            if np.abs(move).max() < 1e-11:
                break
        return y, -slopes / stiffness[:, None]

    def residual(self, values: Array, objective: Objective) -> tuple[Array, Array]:
        """What the search makes small, and its derivative: metres of deflection, or newtons of Eq. (11).

        ``force`` is Eq. (11) with the signs of Eq. (5); ``printed`` is Eq. (11) as it stands, where
        what is within its brackets has the sign of Eq. (5) reversed, so that it asks the film to
        push down with the weight.
        """
        if objective == "deflection":
            y, slopes = self.rest(values)
            return y - self.read, slopes
        force, _, slopes = self.force(values, self.read)
        sign = 1.0 if objective == "force" else -1.0
        return self.load - sign * force, -sign * slopes


def readings_of(dataset: Any) -> Readings:
    """The readings at rest of a dataset.

    Raises
    ------
    InputError
        When it has no static.csv.
    """
    static = dataset.static
    if static is None:
        raise InputError("has no static.csv: the static constants need readings at rest",
                         key=dataset.name)
    names: Sequence[str] = [specimen.name for specimen in dataset.specimens]
    which = np.array([names.index(name) for name in static.specimen.tolist()])
    return Readings(dataset.specimens, dataset.rig, which, static.mass, static.voltage,
                    static.displacement,
                    dataset.noise)
