"""A finished study in the units of its pictures: mm, kPa, kV, g."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.reports.figures.curve import VoltageCurve, voltage_curves
from tympan.studies.case import CaseResult
from tympan.studies.film_surface import FilmSurface
from tympan.studies.study import SpecimenResult, StudyResult


@dataclass(frozen=True, eq=False)
class AxisLine:
    """Stress along one line of the film: ``distance`` [mm], largest true ``stress`` [kPa]."""

    distance: Array
    stress: Array

    def side(self, sign: int) -> AxisLine:
        """Take the half at positive or negative distance, measured from the plate outwards."""
        outward = self.distance * sign
        order = np.flatnonzero(outward > 0)[np.argsort(outward[outward > 0], kind="stable")]
        return AxisLine(outward[order] - outward[order].min(initial=np.inf), self.stress[order])

    @property
    def sides(self) -> tuple[AxisLine, ...]:
        """Both halves, or one if the other repeats it."""
        right, other = self.side(1), self.side(-1)
        same = (len(right.stress) == len(other.stress)
                and np.allclose(right.distance, other.distance, atol=1e-6))
        # A hundredth of the curve's own height is less than the width of its line.
        least = 0.01 * np.ptp(self.stress)
        if same and np.allclose(right.stress, other.stress, rtol=0, atol=least):
            return (right,)
        return right, other

    @property
    def jump(self) -> float:
        """Largest jump of the stress where two elements meet [kPa]: the discretisation error."""
        meets = np.diff(self.distance) == 0
        return float(np.abs(np.diff(self.stress))[meets].max(initial=0.0))

    @property
    def at_plate(self) -> float:
        """Larger stress of the two points at the plate's edge [kPa]."""
        return max(float(side.stress[0]) for side in self.sides)


@dataclass(frozen=True, eq=False)
class SpecimenView:
    """One specimen of the study: ``semi_axes`` along x and y [mm], results, lines and curves."""

    name: str
    semi_axes: tuple[float, float]
    material: str
    source: str
    result: CaseResult
    deflection: float  #: [mm]
    film: FilmSurface
    along_x: AxisLine
    along_y: AxisLine
    curves: tuple[VoltageCurve, ...]

    @property
    def stress(self) -> Array:
        """The largest true stress [kPa] at the film's points."""
        return self.film.values["stress_1"] / 1e3

    @property
    def loose(self) -> bool:
        """Whether the film has lost tension anywhere."""
        return bool(self.film.values["tension"].any())

    @property
    def round(self) -> bool:
        """Whether neither axis is the longer one."""
        a, b = self.semi_axes
        return abs(a - b) <= 1e-9 * max(a, b)

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the short and the long axis."""
        return ("y", "x") if self.round else ("short", "long")

    @property
    def alike(self) -> bool:
        """Whether the stresses at the plate on the two axes differ only by discretisation."""
        noise = max(self.along_x.jump, self.along_y.jump, 1e-6 * abs(self.long.at_plate))
        return abs(self.short.at_plate - self.long.at_plate) <= noise

    @property
    def short(self) -> AxisLine:
        """Line along the short axis; along y where neither is shorter."""
        x_is_short = self.semi_axes[0] < self.semi_axes[1] and not self.round
        return self.along_x if x_is_short else self.along_y

    @property
    def long(self) -> AxisLine:
        """Line along the long axis; along x where neither is longer."""
        return self.along_y if self.short is self.along_x else self.along_x


@dataclass(frozen=True, eq=False)
class StudyView:
    """A finished study as stored; ``mass`` [g] and ``voltage`` [kV] of the picture."""

    stored: StudyResult
    mass: float
    voltage: float
    specimens: tuple[SpecimenView, ...]

    @cached_property
    def stress_range(self) -> tuple[float, float]:
        """Smallest and largest of the largest true stresses of all films [kPa]."""
        low = min(float(item.stress.min()) for item in self.specimens)
        return low, max(float(item.stress.max()) for item in self.specimens)


def view_study(stored: StudyResult, folder: Path) -> StudyView:
    """Convert a stored study to the units of the pictures; messages name ``folder``."""
    return StudyView(stored, stored.mass_kg * 1e3, stored.voltage_V / 1e3,
                     tuple(_specimen(specimen, folder) for specimen in stored.specimens))


def _specimen(stored: SpecimenResult, folder: Path) -> SpecimenView:
    result, film = stored.result, stored.result.film
    if len(stored.semi_axes_m) != 2 or min(stored.semi_axes_m) <= 0 or result.deflection_m is None:
        raise InputError("must have two semi-axes and a deflection", file=folder / "study.json",
                         key="specimens", given=stored.name)
    assert film is not None
    missing = [name for name in ("stress_1", "stress_2", "tension") if name not in film.values]
    if missing:
        raise InputError(f"has no {missing[0]}: run the study again",
                         file=folder / "fields" / f"{stored.name}.vtu")
    a, b = stored.semi_axes_m
    return SpecimenView(stored.name, (a * 1e3, b * 1e3), stored.material, stored.source, result,
                        result.deflection_m * 1e3, film, _line(stored, folder, "x"),
                        _line(stored, folder, "y"), tuple(voltage_curves(stored.curves)))


def _line(stored: SpecimenResult, folder: Path, name: str) -> AxisLine:
    rows = stored.lines["line"] == name
    distance, stress = stored.lines["distance"][rows], stored.lines["stress_1"][rows]
    if not rows.any() or not distance.min() < 0 < distance.max():
        raise InputError(f"must have rows of the line {name!r} on both sides of the plate",
                         file=folder / "lines" / f"{stored.name}.csv", key="line")
    return AxisLine(distance * 1e3, stress / 1e3)
