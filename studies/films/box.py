"""The parameters in which films of a family differ, and between which values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.base.fields import field_at
from tympan.base.fields import numbers as quantities
from tympan.base.paths import at, numbers, with_arrays
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen

#: The factor on all stresses of the film's law, a parameter beside the numbers of the specimen.
STIFFNESS = "stiffness"
#: The spring between plate and ground [N/m], beside those of the rig: another such parameter.
SPRING = "rig.spring"
#: The pressure of the gas below film and plate [Pa], in place of the rig's: another.
PRESSURE = "rig.gas_pressure"
#: Parameters that are no numbers of the specimen, and their dimensions.
_BESIDE = {STIFFNESS: "", SPRING: "stiffness per length", PRESSURE: "stress"}

#: The law's part of a specimen.
_LAW = "membrane.material"

#: Parts of a specimen that have numbers a family's films may differ in.
_PARTS = ("frame", "plate", "membrane", "electrode")
#: Numbers of the plate's outline, on which its area depends.
_PLATE = "plate.outline"
#: Lengths, which move the mesh, are in these.
_OUTLINED = ("frame.", "plate.", "electrode.margin", "electrode.outline")
#: What must be the same for all films, as formulas for many films at once do not have it.
_SAME = ("membrane.thickness_gradient", "membrane.law_range", "electrode.stiffness",
         "electrode.patches")

#: What limits are.
_BETWEEN = "must be two values, the smaller first"

#: How far outside the box a parameter may be, in widths of the box: rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Box:
    """A specimen and the ``names`` of its numbers that vary, from lowest to highest value [SI].

    A name is the path of a number in the specimen, such as "frame.semi_axes.0",
    "plate.outline.radius" or "membrane.thickness". "stiffness" is a factor on all stresses of the
    law, "rig.spring" a spring on the plate [N/m], "rig.gas_pressure" that of the gas. Of values
    ``low`` and ``high`` the shape is (names,); rows of parameters have it last.
    """

    specimen: Specimen
    names: tuple[str, ...]
    low: Array
    high: Array

    @classmethod
    def around(cls, specimen: Specimen, limits: Mapping[str, Sequence[float | str]]) -> Box:
        """Limits of numbers of a specimen by name; its own values need not be among them.

        Raises
        ------
        InputError
            When a number is not there or cannot vary, or limits are none.
        """
        known, edges = (*varying(specimen), *_BESIDE), []
        for name, given in limits.items():
            if name not in known:
                raise InputError("is no number of the specimen that films of a family may differ "
                                 f"in; these are {', '.join(known)}", key=name)
            field = None if name in _BESIDE else field_at(specimen, tuple(name.split(".")))
            dimension = field.says.dimension if field else _BESIDE.get(name, "")
            edges.append(between(given, dimension, name))
            if edges[-1][0] == edges[-1][1]:
                raise InputError(_BETWEEN, key=name, given=given)
        if STIFFNESS in limits and any(name.startswith(_LAW) for name in limits):
            raise InputError("varies the law's constants, too: only one of both", key=STIFFNESS)
        low, high = np.array(edges, dtype=float).reshape(-1, 2).T
        return cls(specimen, tuple(limits), low, high)

    @classmethod
    def of(cls, specimens: Sequence[Specimen]) -> Box:
        """The smallest box with some specimens of one :func:`kind_of`; about the middle one."""
        names = varying(specimens[0])
        rows = np.array([[at(specimen, name.split(".")) for name in names]
                         for specimen in specimens], dtype=float)
        low, high = rows.min(0), rows.max(0)
        differs = low < high
        names = tuple(name for name, wide in zip(names, differs, strict=True) if wide)
        low, high = low[differs], high[differs]
        away = np.abs((rows[:, differs] - (low + high) / 2) / (high - low)).max(1, initial=0.0)
        return cls(specimens[int(away.argmin())], names, low, high)

    def row(self, specimen: Specimen, spring: float = 0.0, pressure: float = 0.0) -> Array:
        """The parameters of a specimen of the family, whose law has factor 1, shape (names,).

        And those of a ``spring`` on its plate [N/m] and a gas ``pressure`` [Pa].
        """
        beside = {STIFFNESS: 1.0, SPRING: spring, PRESSURE: pressure}
        return np.array([beside[name] if name in beside else at(specimen, name.split("."))
                         for name in self.names], dtype=float)

    def member(self, row: Array) -> Specimen:
        """The specimen with these parameters; an :class:`InputError` if it cannot be built."""
        numbers = {path: column.item() for path, column in self.columns(row[None]).items()}
        # Checked once, as a whole.
        made: Specimen = replace(with_arrays(self.specimen, numbers))
        return made

    def columns(self, rows: Array) -> dict[str, Array]:
        """The numbers of the specimen, by path, in which films differ, (films,) each."""
        columns = {name: rows[:, number] for number, name in enumerate(self.names)
                   if name not in (SPRING, PRESSURE)}
        factor = columns.pop(STIFFNESS, None)
        if factor is not None:
            columns |= {path: factor * at(self.specimen, path.split("."))
                        for path in self._stresses}
        return columns

    def springs(self, rows: Array) -> Array:
        """Stiffness of the springs in which films differ [N/m], (films,)."""
        return self._beside(rows, SPRING, 0.0)

    def pressures(self, rows: Array, usual: float) -> Array:
        """Pressures of the gas below the films [Pa], (films,): ``usual`` where they do not vary."""
        return self._beside(rows, PRESSURE, usual)

    def plate_areas(self, rows: Array) -> Array:
        """Areas of the plates [m²], (films,), 0 without plates."""
        return plate_areas(self.specimen, self.columns(rows), len(rows))

    def forces(self, rig: Rig, masses: tuple[float, float]) -> tuple[float, float]:
        """Lowest and highest force [N] on plates of its films under masses of a range [kg]."""
        areas = self.plate_areas(np.array([self.low, self.high]))
        forces = [float(rig.force(mass, area)) for mass in masses for area in areas.tolist()]
        return min(forces), max(forces)

    def _beside(self, rows: Array, name: str, usual: float) -> Array:
        if name not in self.names:
            return np.full(len(rows), usual)
        return np.asarray(rows[:, self.names.index(name)])

    @cached_property
    def _stresses(self) -> tuple[str, ...]:
        """Paths of the law's constants that are stresses."""
        paths = numbers(self.specimen.membrane.material, _LAW)
        fields = {path: field_at(self.specimen, tuple(path.split("."))) for path in paths}
        return tuple(path for path, field in fields.items()
                     if field is not None and field.says.dimension == "stress")

    @property
    def lengths(self) -> tuple[str, ...]:
        """Names of those that move the mesh."""
        return tuple(name for name in self.names if name.startswith(_OUTLINED))

    def holds(self, rows: Array) -> Mask:
        """Mask of the films that are within it, (films,)."""
        off = _ROUNDING * (self.high - self.low)
        return np.asarray(((rows >= self.low - off) & (rows <= self.high + off)).all(-1))

    def scaled(self, rows: Array) -> Array:
        """Parameters from -1 to 1 within the box."""
        return np.asarray(2 * (rows - self.low) / (self.high - self.low) - 1)


def plate_areas(specimen: Specimen, columns: Mapping[str, Array], count: int) -> Array:
    """Areas [m²] of the plates of so many films, a specimen with columns of numbers, (films,)."""
    varied = {path: column for path, column in columns.items() if path.startswith(_PLATE)}
    if not varied:
        return np.full(count, float(specimen.plate_area))
    made = [with_arrays(specimen, {path: column[film].item() for path, column in varied.items()})
            for film in range(count)]
    return np.array([float(film.plate_area) for film in made])


def between(values: Sequence[float | str], dimension: str, key: str) -> tuple[float, float]:
    """Lowest and highest of a number [SI], given as they are or as texts with their unit."""
    low, *high = quantities(values, dimension, key)
    if len(high) != 1 or not low <= high[0]:
        raise InputError(_BETWEEN, key=key, given=values)
    return low, high[0]


def varying(specimen: Specimen) -> tuple[str, ...]:
    """Paths of all numbers of a specimen in which films of a family may differ."""
    return tuple(path for part in _PARTS if getattr(specimen, part) is not None
                 for path in numbers(getattr(specimen, part), part) if not path.startswith(_SAME))


def kind_of(specimen: Specimen) -> object:
    """All of a specimen but its name and the numbers of :func:`varying`, to be compared.

    Bands that are there or not are no numbers: the mesh has an edge more with each.
    """
    arrays = dict.fromkeys(varying(specimen), 0.0) | {"name": ""}
    electrode = specimen.electrode
    bands = electrode.margin_frame > 0, electrode.margin_plate > 0
    return with_arrays(specimen, arrays), bands
