"""A quarter of a film, which its mirror images make whole, as pieces of a closed curve."""

from __future__ import annotations

from dataclasses import replace
from itertools import takewhile

import numpy as np

from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.pieces import Line, Piece, Spline
from tympan.geometry.specimen import Electrode, Specimen

#: How near an axis a piece ends that ends on it, relative to the outline.
_MEET = 1e-12

_START, _MIDDLE, _END = np.array([0.0]), np.array([0.5]), np.array([1.0])


def quarter(specimen: Specimen) -> tuple[Piece, ...] | None:
    """Around the film where both coordinates are positive, all of it under the electrode [m].

    Counterclockwise from the frame's place on the x axis. None where the electrode leaves some
    bare, or an outline cannot be cut at the axes.
    """
    plate, outer = specimen.plate, _first_quadrant(specimen.frame)
    inner = _first_quadrant(plate.outline) if plate is not None else ()
    if outer is None or inner is None or specimen.electrode != Electrode():
        return None
    back = [piece.backwards() for piece in reversed(inner)]
    corner = (0.0, 0.0)
    low, high = (back[-1].at(_END)[0][0], back[0].at(_START)[0][0]) if back else (corner, corner)
    top, right = outer[-1].at(_END)[0][0], outer[0].at(_START)[0][0]
    return (*outer, Line((0.0, float(top[1])), (0.0, float(high[1]))),
            *back, Line((float(low[0]), 0.0), (float(right[0]), 0.0)))


def _first_quadrant(outline: Outline) -> list[Piece] | None:
    """The pieces from the x axis to the y axis; None where one crosses an axis within itself."""
    close = _MEET * max(outline.semi_axes)
    parts = [part for piece in outline.curve.pieces for part in _halved(piece, close)]
    first = next((number for number, part in enumerate(parts)
                  if _within(part) and not _within(parts[number - 1])), None)
    if first is None:
        return None
    pieces = list(takewhile(_within, (*parts[first:], *parts[:first])))
    ends = np.array([piece.at(np.array([0.0, 1.0]))[0] for piece in pieces])
    meets = max(abs(ends[0, 0, 1]), abs(ends[-1, 1, 0]), -ends.min()) < close
    return pieces if meets else None


def _within(piece: Piece) -> bool:
    """Whether its middle has positive coordinates."""
    return bool((piece.at(_MIDDLE)[0] > 0).all())


def _halved(piece: Piece, close: float) -> list[Piece]:
    """A line or an arc in parts that do not cross an axis in their middle."""
    middle = piece.at(_MIDDLE)[0][0]
    if isinstance(piece, Spline) or np.abs(middle).min() > close:
        return [piece]
    if isinstance(piece, Line):
        place = (float(middle[0]), float(middle[1]))
        halves: list[Piece] = [Line(piece.start, place), Line(place, piece.end)]
    else:
        half = piece.sweep / 2
        halves = [replace(piece, sweep=half),
                  replace(piece, start=piece.start + half, sweep=half)]
    return [part for each in halves for part in _halved(each, close)]
