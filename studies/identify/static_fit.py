"""Eq. (11): static constants from readings at rest of all shapes, masses and voltages at once."""

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
from tympan.studies.lumped.equilibria import settle
from tympan.studies.paper.table1 import known

Array = NDArray[np.float64]
Law = Literal["eq8", "film"]
Sharing = Literal["each", "shared"]
Objective = Literal["deflection", "force", "printed"]

_HIGHEST_STRESS = 1e7
_POWERS = (2.0, 4.0, 6.0)  # of Eq. (8)


@dataclass(frozen=True, eq=False)
class StaticReadings:
    """Displacements read [m] of specimens (by number) under loads; ``noise`` is that of one."""

    specimens: tuple[Specimen, ...]
    rig: Rig
    which: NDArray[np.int64]
    mass: Array
    voltage: Array
    displacement: Array
    noise: float | None = None


@dataclass(frozen=True)
class Constant:
    """A number to find: name, unit, where the search begins, the size it is judged by, bounds."""

    name: str
    unit: str
    start: float
    scale: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class StaticProblem:
    """StaticReadings, and what is to be found: a law's constants, ε_r and α.

    The law is Eq. (8) with β and γ (``eq8``), or one factor on the films (``film``). ``alpha`` says
    whether each shape with two semi-axes has its own α of the circle with the short one (``each``),
    or one serves all as in Eq. (11) (``shared``). Each is what a user expects, because α belongs to
    the shape: for the paper's ellipses the membrane's is 0.562 and 0.608 (`tympan alpha`), and one
    for both leaves that difference to the other constants. Shapes alike in their semi-axes share.
    Without such a shape α is left out.
    """

    readings: StaticReadings
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
    def _units(self) -> tuple[tuple[ConeCircle, Any, Any], ...]:
        """Each specimen's circles, and what acts on them at unit constants: material and voltage.

        The material has its constants on a first axis, before points and circles.
        """
        units: Any = np.eye(6)[:, :, None, None]
        films = []
        for specimen in self.readings.specimens:
            film = specimen.membrane
            material = film.material if self.law == "film" else Separable(
                tuple(units[:3]), tuple(units[3:]), _POWERS, film.area_prestretch**0.5)
            unit = replace(specimen, membrane=replace(film, relative_permittivity=1.0))
            circles = ConeCircle(specimen, np.array(radii_of(specimen.frame)))
            films.append((circles, material, maxwell(unit, 1.0)))
        return tuple(films)

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
        """The film's force [N] at deflections of all readings [m], its derivatives by y, constants.

        Shapes (readings,), (readings,) and (readings, constants).
        """
        r = self.readings
        force, stiffness = np.zeros(len(y)), np.zeros(len(y))
        slopes = np.zeros((len(y), len(self.constants)))
        for number in range(len(r.specimens)):
            rows = r.which == number
            force[rows], stiffness[rows], slopes[rows] = self.force_of(number, values, y[rows],
                                                                       r.voltage[rows])
        return force, stiffness, slopes

    def force_of(self, number: int, values: Array, y: Array,
                 voltage: Array) -> tuple[Array, Array, Array]:
        """The same of one specimen (by number), at deflections [m] and voltages [V], (points,)."""
        rig, (circles, *parts) = self.readings.rig, self._units[number]
        squared = np.asarray(rig.film_voltage(voltage))[:, None] ** 2
        elastic, electric = (circles.pull(part, y[:, None])[1:] for part in parts)
        # Both linear in the constants: shape (constants, points, circles).
        pulls, stiffs = (np.concatenate([held.reshape(-1, *drawn.shape), squared * drawn[None]])
                         for held, drawn in zip(elastic, electric, strict=True))
        weights, linear = np.array(self.weights(number, values)), values[:len(pulls)]
        slopes = np.zeros((len(y), len(self.constants)))
        slopes[:, :len(linear)] = (pulls @ weights).T
        if len(weights) > 1:
            slopes[:, self._place(number)] = linear @ (pulls[..., 0] - pulls[..., 1])
        force = slopes[:, :len(linear)] @ linear
        return force + rig.spring * y, linear @ (stiffs @ weights) + rig.spring, slopes

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
        """Deflections at rest [m] and their derivatives by the constants (implicit functions).

        Newton from what was read, at most a quarter of it a step.
        """
        def balance(y: Array) -> tuple[Array, Array]:
            force, stiffness, _ = self.force(values, y)
            return force - self.load, stiffness

        y = settle(balance, self.read, 0.25 * np.abs(self.read) + 1e-5)
        _, stiffness, slopes = self.force(values, y)
        return y, -slopes / stiffness[:, None]

    def residual(self, values: Array, objective: Objective) -> tuple[Array, Array]:
        """What a search makes small, and its derivative: deflections [m] or Eq. (11)'s forces [N].

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


def static_readings(dataset: Any) -> StaticReadings:
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
    return StaticReadings(dataset.specimens, dataset.rig, which, static.mass, static.voltage,
                    static.displacement,
                    dataset.noise)
