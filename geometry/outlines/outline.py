"""What an outline is, what all of them share, and the registry."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, cast

from tympan.geometry.fields import Content, Key, Registry, takes_units, write
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.pieces import Array, Piece
from tympan.geometry.toml_reader import Rule, Table

SIZE: Rule = (lambda x: 1e-5 <= x <= 10, "must be positive, from 10 um to 10 m")


class Outline(ABC):
    """A closed curve whose bounding box is centred on the origin, counterclockwise.

    ``shape`` is its name in specimen files, ``semi_axes`` are its half extents along x and y [m]. A
    shape adds its numbers, which may be complex, and :meth:`pieces`.
    """

    if TYPE_CHECKING:  # fields of some shapes, computed by others
        @property
        def shape(self) -> str: ...

        @property
        def semi_axes(self) -> tuple[float, float]: ...

    def __getstate__(self) -> dict[str, Any]:
        """Its numbers alone: what follows from them can be sixty times as long."""
        numbers = {item.name for item in fields(cast(Any, self))}
        return {name: value for name, value in vars(self).items() if name in numbers}

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """The curve counterclockwise, wherever it lies [m], in pieces that CAD draws exactly."""

    @property
    def simple(self) -> bool:
        """Whether it cannot cross itself, whatever its numbers."""
        return True

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes (``"x"``, ``"y"``) whose coordinate may change sign without changing the curve."""
        return self.curve.mirror_planes

    @cached_property
    def curve(self) -> Curve:
        """The pieces, centred on their bounding box."""
        return Curve(self.pieces()).centred()

    def level(self, x: Array, y: Array) -> Array:
        """Negative inside, positive outside; near the curve, about the distance [m]."""
        return self.curve.level(x, y)

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m], evenly along each piece."""
        return self.curve.points(count)


class Symmetric(Outline):
    """Shapes that both axes mirror; they give their half extents themselves."""

    @property
    def mirror_planes(self) -> frozenset[str]:
        return frozenset("xy")


class Boxed(Outline):
    """Shapes that are not given by the half extents of their box."""

    @property
    def semi_axes(self) -> tuple[float, float]:
        (west, east), (south, north) = self.curve.box
        return (east - west) / 2, (north - south) / 2


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

    def pieces(self) -> tuple[Piece, ...]:
        return self.outline.curve.placed(self.rotation).pieces


class OutlineRegistry(Registry[Any]):
    """Shapes; beside their own keys, tables of all of them may say ``rotation``."""

    def read(self, table: Table) -> Any:
        rotation = table.number("rotation", "angle", 0.0 if table.plain else "0 rad")
        outline = super().read(table)
        return outline if rotation == 0 or outline.shape == "circle" else Rotated(outline, rotation)

    def write(self, value: Any, plain: bool = False) -> Content:
        if isinstance(value, Rotated):
            return self.write(value.outline, plain) | write(value, plain)
        return super().write(value, plain)


#: Shapes that files may name.
OUTLINES = OutlineRegistry("shape")
