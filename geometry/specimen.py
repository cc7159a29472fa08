"""One actuator: frame, plate, film, electrode; as dataclasses and as TOML."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle, Ellipse, Outline, check, read_outline
from tympan.geometry.toml_reader import FINITE, NON_NEGATIVE, Rule, Table

Stretch = NDArray[np.float64] | NDArray[np.complex128]


class Unbuildable(InputError):
    """A specimen whose values are each allowed but do not go together."""


class Material(Protocol):
    """What a film can be made of: a strain energy W(λ₁, λ₂) per virgin volume, incompressible, λ₃ = 1/(λ₁λ₂).

    ``law`` is the name in specimen files.
    """

    law: ClassVar[str]

    def derivatives(self, l1: Stretch, l2: Stretch) -> tuple[Stretch, ...]:
        """W [J/m³] and W₁, W₂, W₁₁, W₁₂, W₂₂ at the principal stretches, each of their shape.

        Where the law cannot be stretched so far, W is +∞ and its derivatives are nan.
        """


class Strength(Protocol):
    """How large a field a film withstands. ``law`` is the name in specimen files."""

    law: ClassVar[str]

    def field(self, l1: Stretch, l2: Stretch, thickness: Stretch) -> Stretch:
        """The true field at breakdown [V/m] at the principal stretches and the stretched thickness [m]."""


@dataclass(frozen=True)
class Plate:
    """The rigid plate; its edge clamps the film. ``offset`` of its centre from the frame's [m]."""

    outline: Outline
    offset: tuple[float, float] = (0.0, 0.0)

    def level(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative inside the plate, zero at its edge [m]."""
        return self.outline.level(x - self.offset[0], y - self.offset[1])


@dataclass(frozen=True)
class Film:
    """The elastomer film before it is mounted, and how it is mounted.

    ``thickness`` is that of the virgin film [m], ``prestretch`` the stretch along x and y from it
    to the flat mounted state; the permittivity is ε_r (J/J_p)^(-permittivity_exponent), J = λ₁λ₂,
    J_p its mounted value. ``density`` is the film's mass per volume [kg/m³]; 0 is design §3's
    weightless film. ``strength`` is what it withstands electrically; None where nobody says.
    """

    thickness: float
    prestretch: tuple[float, float]
    material: Material
    relative_permittivity: float
    permittivity_exponent: float = 0.0
    density: float = 0.0
    strength: Strength | None = None

    @property
    def area_prestretch(self) -> float:
        """J_p, mounted over virgin area."""
        return self.prestretch[0] * self.prestretch[1]


@dataclass(frozen=True)
class Region:
    """What lies within an outline; ``offset`` of its centre from the frame's [m]."""

    outline: Outline
    offset: tuple[float, float] = (0.0, 0.0)

    def __str__(self) -> str:
        (a, b), (x, y) = (tuple(1e3 * length for length in pair)
                          for pair in (self.outline.semi_axes, self.offset))
        return f"{self.outline.shape}, {2 * a:.4g} by {2 * b:.4g} mm, centred at {x:.4g}, {y:.4g} mm"

    def level(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative inside the outline, zero on it [m]."""
        return self.outline.level(x - self.offset[0], y - self.offset[1])

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes of the frame whose coordinate may change sign without changing the region."""
        return self.outline.mirror_planes & _centred(self.offset)


@dataclass(frozen=True)
class Electrode:
    """Uncovered bands along frame and plate [m] and a neo-Hookean stiffness per virgin volume [Pa].

    With an ``outline`` only the film within it is covered; it may cross frame and plate, or lie
    beside the plate.
    """

    margin_frame: float = 0.0
    margin_plate: float = 0.0
    stiffness: float = 0.0
    outline: Region | None = None

    @property
    def everywhere(self) -> bool:
        """Whether it covers the whole film between plate and frame."""
        return self.outline is None and self.margin_frame == self.margin_plate == 0


@dataclass(frozen=True)
class Specimen:
    """One actuator, all sizes in SI."""

    name: str
    frame: Outline
    plate: Plate
    membrane: Film
    electrode: Electrode = field(default_factory=Electrode)

    def __post_init__(self) -> None:
        """Refuse what cannot be built."""
        check(self.frame, "frame")
        check(self.plate.outline, "plate")
        if self.electrode.outline is not None:
            check(self.electrode.outline.outline, "electrode.outline")
        gap, (x, y) = self._narrowest
        if gap <= 0:
            raise InputError(
                f"the plate must lie inside the frame: it reaches {-gap * 1e3:.4g} mm beyond it at "
                f"{x * 1e3:.4g}, {y * 1e3:.4g} mm", key="plate",
                given=f"offset {self.plate.offset} m")
        if gap < 1e-3 * max(self.frame.semi_axes):
            raise InputError("the plate must leave a gap of at least a thousandth of the frame's half extent",
                             key="plate",
                             given=f"a gap of {gap * 1e3:.4g} mm at {x * 1e3:.4g}, {y * 1e3:.4g} mm")
        bands = self.electrode.margin_frame + self.electrode.margin_plate
        if bands > 0.98 * gap:
            raise InputError(f"the margins must leave an electrode: their sum must stay below 98 % of the gap of "
                             f"{gap * 1e3:.4g} mm between plate and frame",
                             key="electrode", given=f"{bands * 1e3:.4g} mm")
        for name in ("margin_frame", "margin_plate"):
            margin = getattr(self.electrode, name)
            if 0 < margin < 0.01 * gap:
                raise InputError("must be 0 or at least 1 % of the gap between plate and frame",
                                 key=f"electrode.{name}", given=f"{margin * 1e3:.4g} mm")
        if self.electrode.outline is not None and not self._meets(self.electrode.outline):
            raise InputError("must cover some of the film between plate and frame",
                             key="electrode.outline", given=str(self.electrode.outline))
        stretch = np.real(self.membrane.prestretch)
        with np.errstate(all="ignore"):
            energy = self.membrane.material.derivatives(*stretch)[0]
        if np.isposinf(np.real(energy)):
            raise InputError(f"must be a stretch the film can reach: {self.membrane.material} locks before it",
                             key="membrane.prestretch", given=self.membrane.prestretch)

    @property
    def gap(self) -> float:
        """Smallest distance between plate and frame [m], negative where the plate sticks out."""
        return self._narrowest[0]

    @property
    def _narrowest(self) -> tuple[float, tuple[float, float]]:
        """The gap and the point of plate or frame where it is [m]; each edge is seen from points of the other."""
        edges = self.plate.outline.points(720) + np.array(self.plate.offset)[:,
                                                                             None], self.frame.points(720)
        found = []
        for edge, away in zip(edges, (-self.frame.level(*edges[0]), self.plate.level(*edges[1])),
                              strict=True):
            least = int(np.argmin(away))
            found.append((float(away[least]), (float(edge[0, least]), float(edge[1, least]))))
        return min(found)

    @property
    def axisymmetric(self) -> bool:
        """Whether a rotation about the frame's centre changes nothing."""
        round_edges = all(outline.semi_axes[0] == outline.semi_axes[1]
                          and isinstance(outline, Circle | Ellipse)
                          for outline in (self.frame, self.plate.outline))
        film = self.membrane.prestretch
        return round_edges and self.plate.offset == (0.0, 0.0) and film[0] == film[1]

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes whose coordinate may change sign without changing the specimen."""
        planes = self.frame.mirror_planes & self.plate.outline.mirror_planes & _centred(self.plate.offset)
        return planes if self.electrode.outline is None else planes & self.electrode.outline.mirror_planes

    def _meets(self, region: Region) -> bool:
        """Whether any film lies within the region: its edge is on the film, or it holds the film whole."""
        edge = region.outline.points(720) + np.array(region.offset)[:, None]
        on_film = (self.frame.level(*edge) < 0) & (self.plate.level(*edge) > 0)
        return bool(on_film.any() or (region.level(*self.frame.points(8)) <= 0).all())


def _centred(offset: tuple[float, float]) -> frozenset[str]:
    """Axes along which the offset is zero."""
    return frozenset(axis for axis, distance in zip("xy", offset, strict=True) if distance == 0)


_NAME = re.compile(r"\w[\w .+-]{0,99}")
_STRETCH: Rule = (lambda x: 0.2 <= x <= 10,
                  "must be a stretch between 0.2 and 10 (1 is unstretched)")
_EXPONENT: Rule = (lambda x: -10 <= x <= 10, "must be from -10 to 10")
_DENSITY: Rule = (lambda x: x == 0 or 1 <= x <= 30e3,
                  "must be 0 (weightless) or from 1 to 30000 kg/m^3")
_THICKNESS: Rule = (lambda x: 1e-7 <= x <= 0.1, "must be positive, from 0.1 um to 10 cm")
_PERMITTIVITY: Rule = (lambda x: 1 <= x <= 1000, "must be at least 1 (vacuum) and at most 1000")


def specimen_from_table(table: Table, read_material: Callable[[Table, str], Material],
                        read_strength: Callable[[Table, str], Strength
                                                | None] = lambda table, key: None) -> Specimen:
    """A specimen from the keys of design §4.

    Parameters
    ----------
    read_material
        Turns the key ``material`` of the given table into a material; the caller knows the laws.
    read_strength
        The same for the key ``breakdown``.
    """
    name = table.text("name")
    if not _NAME.fullmatch(name):
        raise table.error("name",
                          "must serve as a file name: at most 100 letters, digits, blanks and _ . + -, "
                          "a letter or digit first", name)
    frame = _outline(table.table("frame"))
    plate_table = table.table("plate")
    offset = _offset(plate_table)
    plate = Plate(_outline(plate_table), offset)
    film = _film(table.table("membrane"), read_material, read_strength)
    electrode = _electrode(table.table("electrode", {}))
    table.done()
    try:
        return Specimen(name, frame, plate, film, electrode)
    except InputError as error:
        raise Unbuildable(error.allowed, file=error.file or table.file, key=error.key,
                          given=error.given) from None


def read_specimen(file: Path | str, read_material: Callable[[Table, str], Material],
                  read_strength: Callable[[Table, str],
                                          Strength | None] = lambda table, key: None) -> Specimen:
    """The specimen of a TOML file."""
    return specimen_from_table(Table.read(file), read_material, read_strength)


def _offset(table: Table) -> tuple[float, float]:
    x, y = table.quantities("offset", "length", ("0 mm", "0 mm"), FINITE, 2)
    return x, y


def _outline(table: Table) -> Outline:
    outline = read_outline(table)
    table.done()
    return outline


def _film(table: Table, read_material: Callable[[Table, str], Material],
          read_strength: Callable[[Table, str], Strength | None]) -> Film:
    stretch = table.numbers("prestretch", rule=_STRETCH, count=2)
    film = Film(
        thickness=table.quantity("thickness", "length", rule=_THICKNESS),
        prestretch=(stretch[0], stretch[1]),
        material=read_material(table, "material"),
        relative_permittivity=table.number("relative_permittivity", rule=_PERMITTIVITY),
        permittivity_exponent=table.number("permittivity_exponent", 0.0, _EXPONENT),
        density=table.quantity("density", "density", "0 kg/m^3", _DENSITY),
        strength=read_strength(table, "breakdown"),
    )
    table.done()
    return film


def _electrode(table: Table) -> Electrode:
    electrode = Electrode(
        margin_frame=table.quantity("margin_frame", "length", "0 mm", NON_NEGATIVE),
        margin_plate=table.quantity("margin_plate", "length", "0 mm", NON_NEGATIVE),
        stiffness=table.quantity("stiffness", "stress", "0 kPa", NON_NEGATIVE),
        outline=_region(table.table("outline")) if "outline" in table else None,
    )
    table.asked.add("outline")
    table.done()
    return electrode


def _region(table: Table) -> Region:
    offset = _offset(table)
    return Region(_outline(table), offset)
