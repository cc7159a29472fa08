"""A finished study read back from disk, checked, in the units of the pictures: mm, kPa, kV."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.alpha import AlphaResult
from tympan.studies.case import CaseResult
from tympan.studies.study import SpecimenResult, StudyResult

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Line:
    """Values along one line of the film: ``distance`` and ``deflection`` [mm], largest true stress [kPa]."""

    distance: Array
    deflection: Array
    stress: Array

    def side(self, sign: int) -> Line:
        """The half at positive or negative distance, as distance from the plate's edge outwards."""
        outward = self.distance * sign
        order = np.flatnonzero(outward > 0)[np.argsort(outward[outward > 0], kind="stable")]
        return Line(outward[order] - outward[order].min(initial=np.inf), self.deflection[order],
                    self.stress[order])

    @property
    def sides(self) -> tuple[Line, ...]:
        """Both halves, or one if the other repeats it."""
        right, left = self.side(1), self.side(-1)
        same = len(right.stress) == len(left.stress) and np.allclose(right.distance, left.distance,
                                                                     atol=1e-6)
        # A hundredth of the curve's own height is less than the width of the line that draws it.
        if same and np.allclose(right.stress, left.stress, rtol=0, atol=0.01 * np.ptp(self.stress)):
            return (right,)
        return right, left

    @property
    def jump(self) -> float:
        """Largest jump of the stress where two elements meet [kPa]: what the discretisation leaves open."""
        meets = np.diff(self.distance) == 0
        return float(np.abs(np.diff(self.stress))[meets].max(initial=0.0))

    @property
    def at_plate(self) -> float:
        """The larger of the stresses at the two points of the plate's edge [kPa]."""
        return max(float(side.stress[0]) for side in self.sides)


@dataclass(frozen=True, eq=False)
class Curve:
    """Deflection [mm] against voltage [kV] under one mass [g]; the deflection is NaN where ``status`` has none.

    ``slack`` is the share of the film that has lost tension, ``margin`` the smallest strength over
    field, NaN where there is none.
    """

    mass: float
    voltage: Array
    status: tuple[str, ...]
    deflection: Array
    slack: Array
    margin: Array

    @property
    def found(self) -> NDArray[np.bool_]:
        """Where there is an equilibrium."""
        return np.array([status == "equilibrium" for status in self.status])

    @property
    def loose(self) -> NDArray[np.bool_]:
        """Where part of the film has lost tension."""
        return self.slack > 0

    @property
    def pull_in(self) -> tuple[float, float] | None:
        """Last voltage with an equilibrium (NaN if none) and the first without [kV]; None where all have one."""
        lost = [index for index, status in enumerate(self.status) if status == "no_equilibrium"]
        if not lost:
            return None
        before = np.flatnonzero(self.found[:lost[0]])
        return (float(self.voltage[before[-1]]) if len(before)
                else np.nan), float(self.voltage[lost[0]])


@dataclass(frozen=True, eq=False)
class Film:
    """The deformed film: ``points`` [mm], shape (n, 3), z along the load; triangles; largest true stress [kPa].

    ``mounted`` is where the points lay in the flat film [mm], ``least`` the smaller principal true
    stress [kPa], ``tension`` 0 where the film is taut, 1 wrinkled, 2 slack.
    """

    points: Array
    mounted: Array
    triangles: NDArray[np.int64]
    stress: Array
    least: Array
    tension: Array


@dataclass(frozen=True, eq=False)
class Stored:
    """One specimen of the study: ``semi_axes`` along x and y [mm], its results, lines and curves."""

    name: str
    semi_axes: tuple[float, float]
    material: str
    source: str
    result: CaseResult
    deflection: float  #: [mm]
    film: Film
    along_x: Line
    along_y: Line
    around_plate: Line
    curves: tuple[Curve, ...]

    @property
    def loose(self) -> bool:
        """Whether the film has lost tension anywhere."""
        return bool(self.film.tension.any())

    @property
    def round(self) -> bool:
        """Whether neither axis is the longer one."""
        a, b = self.semi_axes
        return abs(a - b) <= 1e-9 * max(a, b)

    @property
    def axes(self) -> tuple[str, str]:
        """What the short and the long axis are called."""
        return ("y", "x") if self.round else ("short", "long")

    @property
    def alike(self) -> bool:
        """Whether the stresses at the plate on the two axes differ by no more than the discretisation makes them."""
        noise = max(self.along_x.jump, self.along_y.jump, 1e-6 * abs(self.long.at_plate))
        return abs(self.short.at_plate - self.long.at_plate) <= noise

    @property
    def short(self) -> Line:
        """Along the short axis; along y where neither is shorter."""
        return self.along_x if self.semi_axes[0] < self.semi_axes[1] and not self.round else self.along_y

    @property
    def long(self) -> Line:
        """Along the long axis; along x where neither is longer."""
        return self.along_y if self.short is self.along_x else self.along_x


@dataclass(frozen=True, eq=False)
class Run:
    """A finished study: ``mass`` [g] and ``voltage`` [kV] of the picture, and ``record`` as stored."""

    name: str
    version: str
    finished: str
    mass: float
    voltage: float
    specimens: tuple[Stored, ...]
    alphas: tuple[AlphaResult, ...]
    record: Mapping[str, Any]

    @cached_property
    def stress_range(self) -> tuple[float, float]:
        """Smallest and largest of the largest true stresses of all films [kPa]."""
        low = min(float(item.film.stress.min()) for item in self.specimens)
        return low, max(float(item.film.stress.max()) for item in self.specimens)


def read_run(folder: Path) -> Run:
    """A stored study in the units of the pictures.

    Raises
    ------
    InputError
        When a file is missing or is not what the study writes, naming the file and what is wrong.
    """
    stored = StudyResult.load(folder)
    return Run(stored.name, stored.version, stored.finished, stored.mass_kg * 1e3,
               stored.voltage_V / 1e3,
               tuple(_specimen(specimen, folder) for specimen in stored.specimens),
               stored.alphas, stored.json())


def _specimen(stored: SpecimenResult, folder: Path) -> Stored:
    result = stored.result
    if len(stored.semi_axes_m) != 2 or min(stored.semi_axes_m) <= 0 or result.deflection_m is None:
        raise InputError("must have two semi-axes and a deflection", file=folder / "study.json",
                         key="specimens", given=stored.name)
    a, b = stored.semi_axes_m
    return Stored(stored.name, (a * 1e3, b * 1e3), stored.material, stored.source, result,
                  result.deflection_m * 1e3, _film(result, folder), _line(stored, folder, "x"),
                  _line(stored, folder, "y"), _line(stored, folder, "plate"), _curves(stored))


def _film(result: CaseResult, folder: Path) -> Film:
    film = result.film
    assert film is not None
    missing = [name for name in ("stress_1", "stress_2", "tension") if name not in film.values]
    if missing:
        raise InputError(f"has no {missing[0]}: run the study again",
                         file=folder / "fields" / f"{result.specimen}.vtu")
    return Film(film.points * 1e3, film.mounted * 1e3, film.triangles,
                film.values["stress_1"] / 1e3, film.values["stress_2"] / 1e3,
                film.values["tension"])


def _line(stored: SpecimenResult, folder: Path, name: str) -> Line:
    chosen = stored.lines["line"] == name
    distance, deflection, stress = (stored.lines[key][chosen]
                                    for key in ("distance", "deflection", "stress_1"))
    if not chosen.any() or (name != "plate" and not distance.min() < 0 < distance.max()):
        raise InputError(f"must have rows of the line {name!r} on both sides of the plate",
                         file=folder / "lines" / f"{stored.name}.csv", key="line")
    return Line(distance * 1e3, deflection * 1e3, stress / 1e3)


def _curves(stored: SpecimenResult) -> tuple[Curve, ...]:
    table = stored.curves
    curves = []
    for mass in dict.fromkeys(table["mass"].tolist()):
        chosen = table["mass"] == mass
        curves.append(Curve(
            mass * 1e3, table["voltage"][chosen] / 1e3, tuple(table["status"][chosen].tolist()),
            table["deflection"][chosen] * 1e3, table["slack_share"][chosen],
            table["breakdown_margin"][chosen]))
    return tuple(curves)
