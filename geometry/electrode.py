"""Electrode on a film: where it covers it, in one piece or in segments with their own voltages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, pi, prod
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, takes_units
from tympan.base.paths import at, numbers
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule
from tympan.base.units import quantities_text
from tympan.geometry.outlines import OUTLINES, Outline
from tympan.geometry.outlines.pieces import TURN, Line, Piece

Pair = tuple[float, float]

_ELECTRODE: Rule = (lambda x: 0 <= x <= 100, "must be from 0 (weightless) to 100 kg/m^2")
#: Name of a segment: no word that leads and ranges have.
_WORD = re.compile(r"(?!(?:none|from|to|count)$)[^\W\d]\w{0,29}")
_NAME: Rule = (lambda text: _WORD.fullmatch(text) is not None,
               "must be a word: at most 30 letters, digits and _, a letter first, and not `none`, "
               "`from`, `to` or `count`")
_DISTANCE: Rule = (lambda x: x >= 0, "must be 0 or positive; inf for the film's middle")
_SHARE: Rule = (lambda x: 0 <= x <= 1, "must be from 0 (grounded) to 1")

#: Lead of a segment that no voltage reaches.
OFF = "none"

#: Angle within which two directions are the same [rad]: rounding of degrees to radians is smaller.
_SAME_ANGLE = 1e-9
#: Distance from a border of segments, over the frame's half extent, below which a place is on it:
#: rounding of a mesh's nodes.
_ON_BORDER = 1e-6
#: Digits after the point to which the sines and cosines of equal directions agree.
_DIGITS = 9

#: Smallest and largest sector [rad]. A whole turn is a band or no segment at all.
_SECTORS = (np.radians(1.0), np.radians(359.0))


@takes_units
@dataclass(frozen=True)
class Region:
    """Region within an outline; ``offset`` of its centre from the frame's [m]."""

    outline: Annotated[Outline, Key("its shape", kinds=OUTLINES, inline=True)]
    offset: Annotated[Pair, Key("of its centre from the frame's", "length")] = (0.0, 0.0)

    def __str__(self) -> str:
        (a, b), (x, y) = (tuple(1e3 * length for length in pair)
                          for pair in (self.outline.semi_axes, self.offset))
        return (f"{self.outline.shape}, {2 * a:.4g} by {2 * b:.4g} mm, "
                f"centred at {x:.4g}, {y:.4g} mm")

    def level(self, x: AnyArray, y: AnyArray) -> AnyArray:
        """Signed distance to the outline [m], negative inside it."""
        return self.outline.level(x - self.offset[0], y - self.offset[1])

    def points(self, count: int) -> Array:
        """Points on the outline, shape (2, count) [m]."""
        return np.asarray(self.outline.points(count) + np.array(self.offset)[:, None])

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes of the frame whose coordinate may change sign without changing the region."""
        offset = zip("xy", self.offset, strict=True)
        return self.outline.mirror_planes & {axis for axis, distance in offset if distance == 0}


@takes_units
@dataclass(frozen=True)
class Patch:
    """A round spot that the electrode misses; its edge fades over about a third of its width."""

    centre: Annotated[Pair, Key("from the frame's centre", "length")]
    diameter: Annotated[float, Key("where half of the film is covered", "length", POSITIVE)]

    def bare(self, x: Any, y: Any) -> Any:
        """Share of the film left bare at places [m]: the smooth function 2^(-s⁴), s = 2 r/d."""
        away = (x - self.centre[0]) ** 2 + (y - self.centre[1]) ** 2
        return np.exp(-np.log(2) * (4 * away / self.diameter**2) ** 2)


@takes_units
@dataclass(frozen=True, kw_only=True)
class Segment:
    """Part of an electrode with a voltage of its own: a sector, a band, an outline.

    Of several of them it is the part that they share. ``share``: its voltage over the film's.
    """

    name: Annotated[str, Key("how voltages name it", rule=_NAME)]
    sector: Annotated[Pair | None, Key(
        "directions between which it lies, counterclockwise from the first to the second, seen "
        "from the frame's centre; 0 is the x axis", "angle", TURN)] = None
    band: Annotated[Pair | None, Key(
        "distances from the frame's edge between which it lies, the nearer one first", "length",
        _DISTANCE)] = None
    outline: Annotated[Region | None, Key("it lies within this outline")] = None
    share: Annotated[float, Key("its voltage over that of the film", rule=_SHARE)] = 1.0
    lead: Annotated[str | None, Key(
        "name of the segment whose voltage reaches this one, where leads were exchanged; `none` if "
        "no voltage reaches it", default="its own")] = None

    def __post_init__(self) -> None:
        """Refuse a segment without a region, and regions that are none."""
        if self.sector is None and self.band is None and self.outline is None:
            raise InputError(f"segment {self.name} needs a region: give a sector, a band or an "
                             "outline", key="sector", given="none of them")
        if self.sector is not None:
            low, high = _SECTORS
            if not low - _SAME_ANGLE <= np.real(self.width) <= high + _SAME_ANGLE:
                raise InputError("must be two directions, from 1 to 359 degrees apart",
                                 key="sector", given=self._sector_words)
        if self.band is not None and not np.real(self.band[0]) < np.real(self.band[1]):
            raise InputError("must be two distances from the frame's edge, the smaller first",
                             key="band", given=quantities_text(self.band, "length"))

    def __str__(self) -> str:
        words = []
        if self.sector is not None:
            words.append(f"sector {self._sector_words}")
        if self.band is not None:
            words.append("band {:.4g} to {:.4g} mm from the frame".format(
                *(1e3 * distance for distance in self.band)))
        if self.outline is not None:
            words.append(str(self.outline))
        return f"{self.name}, {' in '.join(words)}"

    @property
    def from_drawing(self) -> bool:
        """Whether its outline was read from a drawing."""
        return self.outline is not None and bool(getattr(self.outline.outline, "file", ""))

    @property
    def width(self) -> Any:
        """Angle of its sector [rad], a whole turn without one."""
        if self.sector is None:
            return 2 * pi
        angle = self.sector[1] - self.sector[0]
        # Complex numbers have no remainder.
        return angle - 2 * pi * (ceil(np.real(angle) / (2 * pi)) - 1)

    @property
    def _sector_words(self) -> str:
        return " to ".join(f"{angle:.6g} deg" for angle in np.degrees(np.real(self._sector)))

    def apex(self, gap: float) -> AnyArray:
        """Find where the straight edges of its sector meet, half a ``gap`` inside it [m]."""
        middle = self._sector[0] + self.width / 2
        along = np.array([np.cos(middle), np.sin(middle)])
        away: AnyArray = along * gap / 2 / np.sin(self.width / 2)
        return away

    @property
    def _sector(self) -> Pair:
        return (0.0, 0.0) if self.sector is None else self.sector

    def level(self, x: AnyArray, y: AnyArray, frame: Outline, gap: float = 0.0) -> AnyArray:
        """Compute a level at places of the film [m]: negative in the segment.

        Sector and band end half a ``gap`` before their edges.
        """
        levels = [np.full(np.shape(x), -inf)]
        if self.sector is not None:
            levels.append(self._beside_sector(x, y, gap))
        if self.band is not None:
            depth, (near, far) = -frame.level(x, y), self.within(gap)
            levels.append(np.maximum(near - depth, depth - far))
        if self.outline is not None:
            levels.append(self.outline.level(x, y))
        highest: AnyArray = np.max(levels, axis=0)
        return highest

    def within(self, gap: float) -> Pair:
        """Find the distances from the frame between which its band lies, less half gaps [m]."""
        near, far = (0.0, inf) if self.band is None else self.band
        return near + gap / 2 * (np.real(near) > 0), far - gap / 2

    def _beside_sector(self, x: AnyArray, y: AnyArray, gap: float) -> AnyArray:
        a, b = self.apex(gap)
        sides = []
        for angle, turn in zip(np.real(self._sector), (1, -1), strict=True):
            along = np.cos(angle), np.sin(angle)
            sides.append(-turn * (along[0] * (y - b) - along[1] * (x - a)))
        # Within half a turn a place is on both edges' inner sides, else on one of them.
        both = np.maximum if np.real(self.width) <= pi + _SAME_ANGLE else np.minimum
        beyond: AnyArray = both(*sides)
        return beyond

    def edges(self, frame: Outline, gap: float) -> tuple[Piece, ...]:
        """List the curves that bound it within the frame, as far as they are no edge of it [m]."""
        pieces: list[Piece] = []
        if self.sector is not None:
            far, (a, b) = 4 * max(frame.semi_axes), self.apex(gap)
            pieces += [Line((float(a), float(b)), (float(a + far * np.cos(angle)),
                                                   float(b + far * np.sin(angle))))
                       for angle in np.real(self._sector)]
        for distance in self.within(gap) if self.band is not None else ():
            if 0 < distance < inf:
                pieces += frame.curve.beside(-distance).pieces
        if self.outline is not None:
            pieces += self.outline.outline.curve.placed(shift=self.outline.offset).pieces
        return tuple(pieces)

    def reflected(self, plane: str, share: float) -> object:
        """Make a key of its region mirrored in a plane ("x", "y" or "" for none), and of a share.

        Equal regions have equal keys. An outline that the plane does not mirror has no equal.
        """
        angles: Any = None
        if self.sector is not None:
            start, end = np.real(self._sector)
            ends = {"": (start, end), "x": (pi - end, pi - start), "y": (-end, -start)}[plane]
            angles = tuple(round(part, _DIGITS) + 0.0 for angle in ends
                           for part in (np.cos(angle), np.sin(angle)))
        outline = self.outline
        if outline is not None and plane and plane not in outline.mirror_planes:
            return object()
        return angles, self.band, outline, share


@takes_units
@dataclass(frozen=True)
class Electrode:
    """Electrode on the film: between two uncovered bands, and within an outline if there is one.

    The outline may cross frame and plate, or lie beside the plate. Segments divide what these
    leave; each has the film's voltage times its share.
    """

    margin_frame: Annotated[float, Key(
        "width of the uncovered band along the frame", "length", NON_NEGATIVE)] = 0.0
    margin_plate: Annotated[float, Key(
        "width of the uncovered band along the plate", "length", NON_NEGATIVE)] = 0.0
    stiffness: Annotated[float, Key(
        "neo-Hookean modulus per virgin volume, without stress when mounted", "stress",
        NON_NEGATIVE)] = 0.0
    outline: Annotated[Region | None, Key("only the film within this outline is covered")] = None
    mass: Annotated[float, Key(
        "of the electrodes on both sides, per mounted area", "mass per area", _ELECTRODE)] = 0.0
    patches: Annotated[tuple[Patch, ...], Key(
        "spots that it misses, of a smooth edge that no mesh follows", name="patch")] = ()
    segments: Annotated[tuple[Segment, ...], Key(
        "parts with their own voltages; the film between them is bare; left out, the electrode is "
        "in one piece", name="segment")] = ()
    gap: Annotated[float, Key(
        "bare film between neighbouring sectors and bands: each ends half of it before its edge",
        "length", NON_NEGATIVE)] = 0.0

    @property
    def everywhere(self) -> bool:
        """Whether it covers the whole film between plate and frame, apart from patches."""
        return (self.outline is None and self.margin_frame == self.margin_plate == 0
                and not self.segments)

    def coverage(self, x: Any, y: Any) -> Any:
        """Share of the film covered at places within margins and outline [m]; 1 without patches."""
        return prod((1 - patch.bare(x, y) for patch in self.patches), start=1.0)

    def share(self, numbers: Any) -> Any:
        """Voltage over the film's at places in segments of these numbers; 1 without segments.

        Shares may be numbers, or arrays that broadcast against the places.
        """
        if not self.segments:
            return 1.0
        shares = self.arriving([segment.share for segment in self.segments])
        return sum(np.equal(numbers, number) * share for number, share in enumerate(shares))

    def arriving(self, shares: Sequence[Any]) -> list[Any]:
        """Find what reaches each segment through its lead of the voltages given by their names."""
        if self.wired_as_named:
            return list(shares)
        named = dict(zip(self.names, shares, strict=True))
        return [0.0 * shares[0] if lead == OFF else named[lead] for lead in self.leads]

    @property
    def leads(self) -> tuple[str, ...]:
        """Name of the segment whose voltage reaches each segment; OFF where none does."""
        return tuple(segment.name if segment.lead is None else segment.lead
                     for segment in self.segments)

    @property
    def wired_as_named(self) -> bool:
        """Whether each segment gets the voltage of its own name."""
        return self.leads == self.names

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the segments."""
        return tuple(segment.name for segment in self.segments)

    @property
    def edge_names(self) -> tuple[str, ...]:
        """Paths of the numbers of segments whose edges can move alone.

        The edge of a band that reaches frame or middle is none. Without a gap, neighbours share an
        edge.
        """
        def key(path: str) -> object:
            kind, number = path.split(".")[2], at(self, path.split("."))
            return kind, (round(np.cos(number), _DIGITS), round(np.sin(number), _DIGITS)
                          ) if kind == "sector" else number

        paths = [path for path in numbers(self.segments, "segments") if not path.endswith("share")]
        cuts = [path for path in paths if path.split(".")[2] != "outline"
                and (".band." not in path or 0 < at(self, path.split(".")) < inf)]
        keys = [key(path) for path in cuts]
        shared = {path for path, own in zip(cuts, keys, strict=True)
                  if self.gap == 0 and keys.count(own) > 1}
        return tuple(path for path in paths
                     if path not in shared and (".outline." in path or path in cuts))

    def segment_at(self, x: AnyArray, y: AnyArray, frame: Outline) -> AnyArray:
        """Find the number of the segment at places of the film [m]: -1 where there is none.

        Without segments all places have the number 0.
        """
        found = np.full(np.shape(x), -1 if self.segments else 0)
        for number, segment in enumerate(self.segments):
            found[segment.level(x, y, frame, self.gap) < 0] = number
        return found

    def edges(self, frame: Outline) -> list[Piece]:
        """List the curves that bound its segments within a frame [m], each once."""
        return list(dict.fromkeys(piece for segment in self.segments
                                  for piece in segment.edges(frame, self.gap)))

    @property
    def even(self) -> Electrode:
        """The electrode with the film's voltage on all segments."""
        if not self.segments:
            return self
        return self.with_shares([1.0] * len(self.segments))

    def with_shares(self, shares: Iterable[Any]) -> Electrode:
        """Set the shares of all segments, in their order."""
        return replace(self, segments=tuple(
            replace(segment, share=share)
            for segment, share in zip(self.segments, shares, strict=True)))

    def nearest(self, x: float, y: float, frame: Outline) -> tuple[str, ...]:
        """Name the segments nearest to a place of the film [m].

        Within a segment it is that one. On a border, and in bare film midway, there are several.
        """
        places = np.array([x]), np.array([y])
        away = [max(float(segment.level(*places, frame, self.gap)[0]), 0.0)
                for segment in self.segments]
        most = min(away, default=0.0) + _ON_BORDER * max(frame.semi_axes)
        return tuple(name for name, far in zip(self.names, away, strict=True) if far <= most)

    def driven(self, voltages: Mapping[str, float]) -> tuple[Electrode, float]:
        """Set the voltages of segments [V] by their names; others have none.

        Returns the electrode with their shares, and the highest voltage, that of the film.

        Raises
        ------
        InputError
            When a name is that of no segment; it lists the names.
        """
        unknown = [name for name in voltages if name not in self.names]
        if unknown:
            names = ", ".join(self.names)
            raise InputError(f"must be the name of a segment: {names}" if names else
                             "must be one number: the electrode has no segments",
                             key="voltage", given=unknown[0])
        given = [float(voltages.get(segment.name, 0.0)) for segment in self.segments]
        if min(given) < 0:
            raise InputError("must be 0 or positive: a film does not feel the sign of a voltage",
                             key="voltage", given=f"{min(given):g} V")
        top = max(given)
        if top == 0:
            return self, 0.0
        return self.with_shares(voltage / top for voltage in given), top

    def voltages(self, top: float) -> dict[str, float]:
        """Compute the voltages of the segments [V] by their names, from that of the film [V]."""
        return {segment.name: segment.share * top for segment in self.segments}

    def image(self, path: Sequence[str], plane: str) -> tuple[tuple[str, ...], int]:
        """Find the number of a segment that is another's in a mirror, and the sign of its change.

        ``path``: keys of a number from the electrode on; one that is no segment's is its own image.
        The electrode must be its own image.

        Examples
        --------
        >>> halves = Electrode(segments=(Segment(name="right", sector=(-1.5, 1.5)),
        ...                              Segment(name="left", sector=(pi - 1.5, pi + 1.5))))
        >>> halves.image(("segments", "0", "sector", "1"), "x")
        (('segments', '1', 'sector', '0'), -1)
        """
        kind, *rest = path
        if kind != "segments":
            return tuple(path), 1
        regions = [segment.reflected(plane, segment.share) for segment in self.segments]
        number, *keys = rest
        own = self.segments[int(number)]
        here = own.reflected("", own.share)
        there = next((str(other) for other, region in enumerate(regions) if region == here), number)
        if keys[0] == "sector":
            return (kind, there, keys[0], str(1 - int(keys[1]))), -1
        return (kind, there, *keys), 1

    def mirrored_in(self, plane: str) -> bool:
        """Check whether its segments and their shares are the same in a mirror."""
        shares = self.arriving([segment.share for segment in self.segments])
        before, after = ([segment.reflected(way, share)
                          for segment, share in zip(self.segments, shares, strict=True)]
                         for way in ("", plane))
        return all(key in before for key in after)
