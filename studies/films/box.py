"""Parameters in which films of a family differ, and their ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.base.fields import field_at
from tympan.base.fields import numbers as quantities
from tympan.base.paths import at, numbered, numbers, with_arrays
from tympan.fem.rig import Loads
from tympan.geometry.specimen import Specimen

#: Parameter: factor on all stresses of the film's law. It is no number of the specimen.
STIFFNESS = "stiffness"
#: Parameter: stiffness of a spring between plate and ground [N/m], in addition to the rig's.
SPRING = "rig.spring"
#: Parameter: pressure of the gas below film and plate [Pa]; it replaces the rig's.
PRESSURE = "rig.gas_pressure"
#: Parameters that are no numbers of the specimen, and their dimensions.
_BESIDE = {STIFFNESS: "", SPRING: "stiffness per length", PRESSURE: "stress"}

#: Path of the law in a specimen.
_LAW = "membrane.material"

#: Parts of a specimen whose numbers may vary in a family.
_PARTS = ("frame", "plate", "membrane", "electrode")
#: Path of the plate's outline, which determines its area.
_PLATE = "plate.outline"
#: Paths of lengths that move the mesh.
_OUTLINED = ("frame.", "plate.", "electrode.margin", "electrode.outline", "electrode.gap")
#: Numbers that must be equal in all films: the formulas for many films do not support their
#: variation.
_SAME = ("membrane.law_range", "electrode.stiffness", "electrode.patches")

#: Paths of the shares of an electrode's segments in the film's voltage. Films depend on the squares
#: of these voltages, as they do on that of the film's.
_SEGMENTS = "electrode.segments."
_SHARE = ".share"

#: Shares of the box's ranges at which a film is taken that has no symmetry of its own: the middle,
#: and by this much beside it, in steps of the golden section.
_OFF = 0.01
_GOLDEN = 0.6180339887498949

#: Message about wrong limits.
_BETWEEN = "must be two values, the smaller first"

#: Largest distance of a parameter from the box, relative to its width, that counts as rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Box:
    """A specimen and the ``names`` of its varying numbers, with their ranges [SI].

    A name is the path of a number in the specimen, such as "frame.semi_axes.0",
    "plate.outline.radius" or "membrane.thickness". Three more names exist: "stiffness" is a factor
    on all stresses of the law, "rig.spring" a spring on the plate [N/m], "rig.gas_pressure" the gas
    pressure [Pa]. ``low`` and ``high`` are the lowest and highest values, shape (names,). Rows of
    parameters have this as their last axis.
    """

    specimen: Specimen
    names: tuple[str, ...]
    low: Array
    high: Array

    @classmethod
    def around(cls, specimen: Specimen, limits: Mapping[str, Sequence[float | str]]) -> Box:
        """Create a box from limits of a specimen's numbers by name.

        The specimen's own values may be outside the limits.

        Raises
        ------
        InputError
            If a number does not exist or cannot vary, or if limits are invalid.
        """
        known, edges = (*varying(specimen), *_BESIDE), []
        limits = {numbered(specimen, name): given for name, given in limits.items()}
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
        """Find the smallest box that contains some specimens of one :func:`kind_of`.

        Its specimen is the one closest to the middle.
        """
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
        """Collect the parameters of a specimen of the family, shape (names,).

        The factor on its law is 1. ``spring``: stiffness of a spring on its plate [N/m].
        ``pressure``: gas pressure [Pa].
        """
        beside = {STIFFNESS: 1.0, SPRING: spring, PRESSURE: pressure}
        return np.array([beside[name] if name in beside else at(specimen, name.split("."))
                         for name in self.names], dtype=float)

    def member(self, row: Array) -> Specimen:
        """Build the specimen with given parameters; InputError if it cannot be built."""
        numbers = {path: column.item() for path, column in self.columns(row[None]).items()}
        # The specimen is checked once, as a whole.
        made: Specimen = replace(with_arrays(self.specimen, numbers))
        return made

    def columns(self, rows: Array) -> dict[str, Array]:
        """Compute the varying numbers of the specimen by their path, (films,) each."""
        columns = {name: rows[:, number] for number, name in enumerate(self.names)
                   if name not in (SPRING, PRESSURE)}
        factor = columns.pop(STIFFNESS, None)
        if factor is not None:
            columns |= {path: factor * at(self.specimen, path.split("."))
                        for path in self._stresses}
        return columns

    def springs(self, rows: Array) -> Array:
        """Select the stiffness of the films' springs [N/m], (films,)."""
        return self._beside(rows, SPRING, 0.0)

    def pressures(self, rows: Array, usual: float) -> Array:
        """Select the gas pressures below the films [Pa], (films,).

        They are ``usual`` if the pressure does not vary.
        """
        return self._beside(rows, PRESSURE, usual)

    def plate_areas(self, rows: Array) -> Array:
        """Compute the areas of the plates [m²], (films,); 0 without plates."""
        return plate_areas(self.specimen, self.columns(rows), len(rows))

    def forces(self, loads: Loads, masses: tuple[float, float]) -> tuple[float, float]:
        """Find lowest and highest force [N] on its films' plates for a range of masses [kg]."""
        areas = self.plate_areas(np.array([self.low, self.high]))
        forces = [float(loads.force(mass, area)) for mass in masses for area in areas.tolist()]
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
        """Names of the parameters that move the mesh."""
        return tuple(name for name in self.names if name.startswith(_OUTLINED)
                     or (name.startswith(_SEGMENTS) and not name.endswith(_SHARE)))

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of the parameters that are voltages of segments over the film's."""
        return tuple(filter(is_share, self.names))

    @cached_property
    def _powers(self) -> Array:
        """Powers of the parameters in which films are smooth, (names,): of voltages the square."""
        return np.array([2.0 if name in self.segments else 1.0 for name in self.names])

    def between(self, shares: Array) -> Array:
        """Compute parameters at shares of the box's ranges, 0 to 1, (films, names)."""
        low, high = self.low**self._powers, self.high**self._powers
        return np.asarray((low + shares * (high - low)) ** (1 / self._powers))

    def shares(self, rows: Array) -> Array:
        """Compute the shares of the box's ranges at which parameters are, (films, names)."""
        low, high = self.low**self._powers, self.high**self._powers
        return np.asarray((rows**self._powers - low) / (high - low))

    @property
    def general(self) -> Specimen:
        """The specimen near the middle of the box: only what all films share is symmetric in it."""
        beside = np.modf(_GOLDEN * np.arange(1, len(self.names) + 1))[0] - 0.5
        return self.member(self.between((0.5 + _OFF * beside)[None])[0])

    def holds(self, rows: Array) -> Mask:
        """Compute the mask of films inside the box, (films,)."""
        off = _ROUNDING * (self.high - self.low)
        return np.asarray(((rows >= self.low - off) & (rows <= self.high + off)).all(-1))

    def scaled(self, rows: Array) -> Array:
        """Scale parameters to -1 to 1 within the box."""
        return np.asarray(2 * self.shares(rows) - 1)


def share_path(number: int) -> str:
    """Write the path of a segment's share in the film's voltage."""
    return f"{_SEGMENTS}{number}{_SHARE}"


def is_share(path: str) -> bool:
    """Check whether a path is that of a segment's share in the film's voltage."""
    return path.startswith(_SEGMENTS) and path.endswith(_SHARE)


def plate_areas(specimen: Specimen, columns: Mapping[str, Array], count: int) -> Array:
    """Compute the plates' areas [m²] of ``count`` films with columns of numbers, (films,)."""
    varied = {path: column for path, column in columns.items() if path.startswith(_PLATE)}
    if not varied:
        return np.full(count, float(specimen.plate_area))
    made = [with_arrays(specimen, {path: column[film].item() for path, column in varied.items()})
            for film in range(count)]
    return np.array([float(film.plate_area) for film in made])


def between(values: Sequence[float | str], dimension: str, key: str) -> tuple[float, float]:
    """Convert the limits of a number to SI: lowest and highest.

    They may be texts with a unit.
    """
    low, *high = quantities(values, dimension, key)
    if len(high) != 1 or not low <= high[0]:
        raise InputError(_BETWEEN, key=key, given=values)
    return low, high[0]


def varying(specimen: Specimen) -> tuple[str, ...]:
    """List the paths of all numbers of a specimen that may vary in a family.

    Edges that segments share, such as those without a gap, cannot move alone.
    """
    edges = {f"electrode.{path}" for path in specimen.electrode.edge_names}
    gap = specimen.electrode.gap
    return tuple(path for part in _PARTS if getattr(specimen, part) is not None
                 for path in numbers(getattr(specimen, part), part)
                 if not path.startswith(_SAME) and (path != "electrode.gap" or gap > 0)
                 and (not path.startswith(_SEGMENTS) or path.endswith(_SHARE) or path in edges))


def kind_of(specimen: Specimen) -> object:
    """Build a key that is equal for specimens of one family.

    It contains all of the specimen except its name and the numbers of :func:`varying`. It also
    contains which bands without electrode exist: the mesh has one more edge for each.
    """
    arrays = dict.fromkeys(varying(specimen), 0.0) | {"name": ""}
    electrode = specimen.electrode
    bands = electrode.margin_frame > 0, electrode.margin_plate > 0
    return with_arrays(specimen, arrays), bands
