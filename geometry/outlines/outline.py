"""What an outline is, what all of them share, and the registry."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Any, Protocol, cast

from tympan.geometry.fields import Content, Key, Registry, takes_units, write
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.pieces import Array, Piece
from tympan.geometry.toml_reader import Rule, Table


class Outline(Protocol):
    """A closed curve whose bounding box is centred on the origin, counterclockwise."""

    @property
    def shape(self) -> str:
        """Its name in specimen files."""

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Half extent along x and along y [m]."""

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes (``"x"``, ``"y"``) whose coordinate may change sign without changing the curve."""

    @property
    def curve(self) -> Curve:
        """The curve as pieces."""

    @property
    def simple(self) -> bool:
        """Whether it cannot cross itself, whatever its numbers."""

    def level(self, x: Array, y: Array) -> Array:
        """Negative inside, positive outside; near the curve, about the distance [m]."""

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m]."""

    def primitives(self) -> tuple[Piece, ...]:
        """The curve as pieces that CAD can draw exactly, in order around it."""


SIZE: Rule = (lambda x: 1e-5 <= x <= 10, "must be positive, from 10 um to 10 m")
ROUNDING: Rule = (lambda x: x == 0 or 1e-6 <= x <= 10,
                  "must be 0 (sharp corners) or from 1 um to 10 m")

class Pieced(ABC):
    """What follows from the pieces alone; a shape adds its numbers and :meth:`pieces`."""

    def __getstate__(self) -> dict[str, Any]:
        """Its numbers alone: what follows from them can be sixty times as long."""
        numbers = {item.name for item in fields(cast(Any, self))}
        return {name: value for name, value in vars(self).items() if name in numbers}

    @property
    def simple(self) -> bool:
        """Whether it cannot cross itself, whatever its numbers."""
        return True

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """The curve counterclockwise, wherever it lies [m]; its numbers may be complex."""

    @cached_property
    def curve(self) -> Curve:
        """The pieces, centred on their bounding box."""
        return Curve(self.pieces()).centred()

    def level(self, x: Array, y: Array) -> Array:
        """Signed distance to the curve [m], negative inside."""
        return self.curve.level(x, y)

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m], evenly along each piece."""
        return self.curve.points(count)

    def primitives(self) -> tuple[Piece, ...]:
        """The curve as pieces that CAD can draw exactly, in order around it."""
        return self.curve.pieces


class Symmetric(Pieced):
    """Shapes that both axes mirror; they give their half extents themselves."""

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Both axes."""
        return frozenset("xy")


class Boxed(Pieced):
    """Shapes that are not given by the half extents of their box."""

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Half extent along x and along y [m]."""
        (west, east), (south, north) = self.curve.box
        return (east - west) / 2, (north - south) / 2

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes whose coordinate may change sign without changing the curve."""
        return self.curve.mirror_planes


@takes_units
@dataclass(frozen=True)
class Rotated(Boxed):
    """Another outline turned counterclockwise about the centre of its bounding box."""

    outline: Outline
    rotation: Annotated[float, Key("of any shape, counterclockwise about the centre of its box",
                                   "angle", default="0 deg")]

    @property
    def shape(self) -> str:
        return self.outline.shape

    @property
    def simple(self) -> bool:
        return self.outline.simple

    @cached_property
    def curve(self) -> Curve:
        """The outline's, turned and centred anew."""
        return self.outline.curve.placed(self.rotation).centred()

    def pieces(self) -> tuple[Piece, ...]:
        return self.curve.pieces


class OutlineRegistry(Registry[Any]):
    """Shapes; beside their own keys, tables of all of them may say ``rotation``."""

    def read(self, table: Table) -> Any:
        key = table.spelled("rotation", "angle")
        table.asked.add(key)
        rotation = table.quantity("rotation", "angle") if key in table else 0.0
        outline = super().read(table)
        return outline if rotation == 0 or outline.shape == "circle" else Rotated(outline, rotation)

    def write(self, value: Any, plain: bool = False) -> Content:
        if isinstance(value, Rotated):
            return self.write(value.outline, plain) | write(value, plain)
        return super().write(value, plain)


#: Shapes that files may name.
OUTLINES = OutlineRegistry("shape")
