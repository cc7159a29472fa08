"""The film cut along the axes through its centre, as pieces of closed curves."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.pieces import Line, Piece, subdivided
from tympan.geometry.specimen import Pair, Specimen

#: Pieces in order around a part of the film.
Loop = tuple[Piece, ...]

#: Distance to an axis below which a point lies on it, relative to the frame: above rounding errors.
_MEET = 1e-12
#: Shortest piece, relative to the frame. A shorter one ends very near an axis; such a film is cut
#: by the CAD kernel instead. Set by trial.
_SHORT = 1e-6

#: Intervals from one break of a piece to the next. In each of them it crosses an axis once at most.
_EACH = 8

#: Places along each axis where outlines and patches are sampled: the covered share is then right to
#: a few thousandths.
_PLACES = 150

#: Signs of x and y in each quadrant, counterclockwise.
_QUADRANTS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def rings(specimen: Specimen) -> dict[str, list[tuple[Curve, Curve | None]]]:
    """Divide the film into rings, each an outer and an inner curve.

    ``covered`` is the ring under an electrode without outline; ``bare`` are the rings that its
    margins leave uncovered. The innermost ring of a film without plate has no inner curve (None).
    """
    electrode, plate = specimen.electrode, specimen.plate
    curves: list[Curve | None] = [specimen.frame.curve]
    if electrode.margin_frame > 0:
        curves.append(_edge_of_band(specimen.frame.curve, -electrode.margin_frame))
    if plate is None:
        curves.append(None)
    else:
        if electrode.margin_plate > 0:
            edge = _edge_of_band(plate.outline.curve, electrode.margin_plate)
            curves.append(edge.placed(shift=plate.offset))
        curves.append(plate.outline.curve.placed(shift=plate.offset))
    bare = [(outer, inner) for outer, inner in pairwise(curves) if outer is not None]
    covered = bare.pop(1 if electrode.margin_frame > 0 else 0)
    return {"covered": [covered], "bare": bare}


def covered_share(specimen: Specimen) -> float:
    """Share of the film between plate and frame that the electrode covers, by area."""
    areas = {kind: sum(_ring_area(*ring) for ring in parts)
             for kind, parts in rings(specimen).items()}
    electrode, plate = specimen.electrode, specimen.plate
    share = areas["covered"] / (areas["covered"] + areas["bare"])
    if electrode.outline is None and not electrode.patches and not electrode.segments:
        return share
    middles = (np.arange(_PLACES) + 0.5) / _PLACES * 2 - 1
    x, y = (axis.ravel() for axis in np.meshgrid(
        *(half * middles for half in specimen.frame.semi_axes)))
    within = specimen.frame.level(x, y) < -electrode.margin_frame
    if plate is not None:
        within &= plate.level(x, y) > electrode.margin_plate
    x, y = x[within], y[within]
    covered = np.broadcast_to(electrode.coverage(x, y), x.shape)
    if electrode.outline is not None:
        covered = covered * (electrode.outline.level(x, y) < 0)
    covered = covered * (electrode.segment_at(x, y, specimen.frame) >= 0)
    return share * float(covered.mean())


def _ring_area(outer: Curve, inner: Curve | None) -> float:
    hole = 0.0 if inner is None else inner.area
    return float(outer.area - hole)


def _edge_of_band(curve: Curve, width: float) -> Curve:
    """Edge of an uncovered band along a curve; outside the curve if the width is positive."""
    try:
        return curve.beside(width)
    except InputError as error:
        raise InputError(f"an electrode margin {error.allowed}", key="electrode",
                         given=error.given) from None


def sectors(specimen: Specimen, planes: frozenset[str]) -> dict[str, list[Loop]] | None:
    """Cut the rings along the axes through the film's centre; loops around the parts [m].

    ``planes`` names the coordinates in which the film is mirrored: only parts where they are
    positive are returned. The answer is None where an electrode's outline cuts the film, where a
    curve crosses one half of an axis more than once, and where a piece ends very near an axis.
    """
    if specimen.electrode.outline is not None:
        return None
    size = max(specimen.frame.semi_axes)
    wanted = [number for number, signs in enumerate(_QUADRANTS)
              if all(sign > 0 for axis, sign in zip("xy", signs, strict=True) if axis in planes)]
    loops: dict[str, list[Loop]] = {}
    for name, pairs in rings(specimen).items():
        loops[name] = []
        for outer, inner in pairs:
            outside = _quadrants(outer, specimen.centre, size)
            inside = 4 * [()] if inner is None else _quadrants(inner, specimen.centre, size)
            if outside is None or inside is None:
                return None
            loops[name] += [_loop(outside[number], inside[number], specimen.centre)
                            for number in wanted]
    return loops


def _loop(outer: Sequence[Piece], inner: Sequence[Piece], centre: Pair) -> Loop:
    """Loop along the outer pieces, an axis inwards, the inner pieces back, an axis outwards."""
    back = [piece.backwards() for piece in reversed(inner)]
    first, last = (back[0], back[-1]) if back else (None, None)
    inwards = _on_axis(outer[-1], 1.0, centre), _on_axis(first, 0.0, centre)
    outwards = _on_axis(last, 1.0, centre), _on_axis(outer[0], 0.0, centre)
    return (*outer, Line(*inwards), *back, Line(*outwards))


def _on_axis(piece: Piece | None, t: float, centre: Pair) -> Pair:
    """End of a piece that lies on an axis, exactly on it; the centre if there is no piece."""
    if piece is None:
        return centre
    place = piece.at(np.array([t]))[0][0]
    axis = int(np.argmin(np.abs(place - centre)))
    place[axis] = centre[axis]
    x, y = place.tolist()
    return x, y


def _quadrants(curve: Curve, centre: Pair, size: float) -> list[list[Piece]] | None:
    """Sort the pieces of a curve by quadrant about a centre; None if it enters one twice."""
    parts = [part for piece in curve.pieces for part in _split(piece, centre, _MEET * size)]
    places = np.array([part.at(np.array([0.0, 0.5, 1.0]))[0] for part in parts])
    middles = places[:, 1] - centre
    lengths = np.linalg.norm(np.diff(places, axis=1), axis=2).sum(axis=1)
    if np.abs(middles).min() < _MEET * size or lengths.min() < _SHORT * size:
        return None
    numbers = [_QUADRANTS.index((x, y)) for x, y in np.sign(middles).astype(int).tolist()]
    enters = [place for place, number in enumerate(numbers) if number != numbers[place - 1]]
    if [(numbers[place] - numbers[place - 1]) % 4 for place in enters] != [1, 1, 1, 1]:
        return None
    first = enters[0]
    ordered = list(zip(parts[first:] + parts[:first], numbers[first:] + numbers[:first],
                       strict=True))
    return [[part for part, number in ordered if number == quadrant] for quadrant in range(4)]


def _split(piece: Piece, centre: Pair, close: float) -> list[Piece]:
    """Cut a piece where it crosses the axes through a centre."""
    t = subdivided(piece.breaks, _EACH)
    places = piece.at(t)[0] - centre
    places[np.abs(places) < close] = 0.0
    cuts = [t[(places == 0).any(axis=1)]]
    for axis in range(2):
        crossed = np.flatnonzero(places[:-1, axis] * places[1:, axis] < 0)
        cuts.append(_crossings(piece, axis, centre[axis], t[crossed], t[crossed + 1]))
    ends = np.unique(np.concatenate([*cuts, [0.0, 1.0]]))
    if len(ends) == 2:
        return [piece]
    return [piece.part(low, high) for low, high in pairwise(ends.tolist())]


def _crossings(piece: Piece, axis: int, level: float, low: AnyArray, high: AnyArray) -> AnyArray:
    """Find where a coordinate has a level, once between each ``low`` and ``high``, by Newton."""
    t = (low + high) / 2
    for _ in range(30):
        value, slope, _ = piece.at(t)
        before, t = t, np.clip(t - (value[:, axis] - level) / slope[:, axis], low, high)
        if np.abs(t - before).max(initial=0.0) < 1e-16:
            break
    return t
