"""Closed curves among the pieces of a drawing: joined, gaps closed, and the wanted one chosen."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import SMALLEST
from tympan.geometry.outlines.pieces import MOST_PIECES, Line, Piece

#: Most curves that a drawing may have. The library takes 0.1 to 0.3 ms to read each of them.
MOST_CURVES = 100_000
#: Largest distance between ends of pieces that count as one point, over the size of the drawing.
JOINT = 1e-6
#: Widest gap that is closed unless the file states a tolerance, over the size of the drawing. CAD
#: programs leave gaps of 1e-8 to 1e-5 of it.
_GAP = 1e-4
#: Widest gap that is closed in any drawing [m]: less than a laser cutter's error.
_WIDEST = 0.05e-3
#: Widest gap that counts as a mistake in the drawing, over its size. An open curve that only such
#: gaps keep from being closed is refused, and not left out as a stray curve.
_MISTAKE = 1e-2

#: Number of places above which a k-d tree saves more time than it takes to load.
_MANY = 1000

#: Most lines that take the place of one arc or spline.
_MOST_CHORDS = 2**14

#: Two ends that meet in a gap, and how far they are apart [m].
Gaps = list[tuple[int, int, float]]


@dataclass(frozen=True)
class DrawingSheet:
    """Curves as they were read [m], remarks on the reading, and advice on units for messages."""

    pieces: list[Piece]
    remarks: tuple[str, ...] = ()
    units: str = ""


@dataclass(frozen=True)
class Contours:
    """Closed curves of a drawing, in ascending order of area, and remarks on what was done."""

    closed: tuple[Curve, ...]
    remarks: tuple[str, ...] = ()

    def chosen(self, which: str = "only", inside: tuple[float, float] | None = None) -> Contours:
        """Choose one curve, with remarks on those that are left out.

        It is the ``only`` one, the largest (``outer``) or the largest within that (``inner``); with
        ``inside``, a point [m], it is the smallest curve around the point.

        Raises
        ------
        InputError
            When there is no such curve, or the ``only`` one of several is asked for.
        """
        *others, outer = self.closed
        fitting = [outer]
        if inside is not None:
            fitting = [curve for curve in self.closed if _around(curve, inside)]
            if not fitting:
                raise InputError(f"has no closed curve around {_place(inside)} of the drawing, "
                                 f"which inside names: it has {_listed(self.closed)}")
        elif which == "inner":
            fitting = [curve for curve in reversed(others) if _around(outer, curve.starts[0])]
            if not fitting:
                raise InputError(f"has no closed curve within the largest one: it has "
                                 f"{_listed(self.closed)}")
        elif which == "only" and others:
            raise InputError(
                f"has {len(self.closed)} closed curves: {_listed(self.closed)}. Choose one with "
                'curve = "outer", curve = "inner" (the largest within the outer one), '
                'inside = ["x mm", "y mm"] (the smallest around that point) or a layer of its own')
        left = [curve for curve in self.closed if curve is not fitting[0]]
        remarks = (f"left out {_counted(len(left), 'other closed curve')}: {_listed(left)}",)
        return Contours((fitting[0],), self.remarks + remarks * bool(left))


def closed_curves(pieces: Sequence[Piece], tolerance: float | None = None) -> Contours:
    """Join pieces in any order to closed curves; ends within ``tolerance`` [m] are moved together.

    Lines drawn twice count once. Open curves beside the closed ones are left out with a remark.
    ezdxf's ``edgeminer`` joins edges too, but takes 4.5 s in place of 0.2 for 10,000 lines.

    Raises
    ------
    InputError
        When no curve is closed, one is nearly closed, or curves branch.
    """
    ends = piece_ends(pieces)
    size = float(np.ptp(ends, axis=(0, 1)).max() or np.abs(ends).max())
    joint = JOINT * size + 1e-12
    tolerance = min(_GAP * size, _WIDEST) if tolerance is None else tolerance
    middles = ends.mean(axis=0)
    reach = np.linalg.norm(ends[1] - ends[0], axis=1)
    for k, piece in enumerate(pieces):
        if not isinstance(piece, Line):
            within = piece.at(np.array([0.3, 0.5]))[0]
            middles[k] = within[1]
            reach[k] = max(reach[k], np.linalg.norm(within - ends[0, k], axis=1).max())
    long = np.flatnonzero(reach > joint)
    if not len(long):
        raise InputError("must be one closed curve: all its lines are points")
    nodes = _clustered(ends, joint)
    kept = _once(long, nodes, middles, joint)
    nodes, gaps = _bridged(kept, nodes, ends, reach, tolerance)
    closed, stray = _pruned(kept, nodes)
    if stray:
        _refuse_mistakes(stray, nodes, ends, reach, max(_MISTAKE * size, 2 * tolerance))
    loops = [_trace(loop, nodes, pieces) for loop in _connected(closed, nodes, ends)]
    if not loops:
        first, last = _longest_open(stray, nodes, ends, reach)
        raise _open(ends, first, last, allowed=False)
    remarks = [] if not gaps else [_on_gaps(gaps, ends)]
    if stray:
        count = len(_connected(stray, nodes, ends, check=False))
        first, last = _longest_open(stray, nodes, ends, reach)
        remarks.append(f"left out {_counted(count, 'open curve')}, {'the longest ' * (count > 1)}"
                       f"from {_place(_point(ends, first))} to {_place(_point(ends, last))}")
    curves = []
    for loop in loops:
        thin, words = _thinned(_closed_up(loop, joint), tolerance)
        remarks += words
        curve = Curve(tuple(thin))
        curves.append(curve if curve.area > 0 else curve.backwards())
    return Contours(tuple(sorted(curves, key=lambda curve: float(curve.area))), tuple(remarks))


def piece_ends(pieces: Sequence[Piece]) -> AnyArray:
    """First and last points of pieces, shape (2, pieces, 2) [m]."""
    ends = [(piece.start, piece.end) if isinstance(piece, Line)
            else piece.at(np.array([0.0, 1.0]))[0] for piece in pieces]
    return np.array(ends, dtype=float).swapaxes(0, 1)


def _near(places: AnyArray, distance: float) -> AnyArray:
    """Find pairs of places at most a distance apart; their numbers, shape (pairs, 2)."""
    if len(places) <= _MANY:
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        return np.argwhere(np.triu(apart <= distance, 1))
    from scipy.spatial import cKDTree  # heavy, and few drawings have so many curves

    return np.asarray(cKDTree(places).query_pairs(distance, output_type="ndarray"))


def _clustered(ends: AnyArray, joint: float) -> AnyArray:
    """Assign numbers to the points where ends meet, shape (2, pieces)."""
    places = ends.reshape(-1, 2)
    pairs = _near(places, joint)
    label, before = np.arange(len(places)), np.zeros(0, int)
    while not np.array_equal(label, before):
        before = label.copy()
        least = np.minimum(label[pairs[:, 0]], label[pairs[:, 1]])
        np.minimum.at(label, pairs[:, 0], least)
        np.minimum.at(label, pairs[:, 1], least)
    return label.reshape(2, -1)


def _once(kept: AnyArray, nodes: AnyArray, middles: AnyArray, joint: float) -> list[int]:
    """Leave out pieces that repeat others."""
    seen, once = defaultdict[tuple[int, int], list[AnyArray]](list), []
    for k in kept.tolist():
        low, high = sorted(nodes[:, k].tolist())
        alike = seen[low, high]
        if not any(np.linalg.norm(middles[k] - other) <= 2 * joint for other in alike):
            once.append(k)
        alike.append(middles[k])
    return once


def _dangling(kept: Sequence[int], nodes: AnyArray) -> list[int]:
    """Find the ends at points where only one piece ends: places in ``nodes`` laid out flat."""
    flat = np.concatenate([np.array(kept), np.array(kept) + nodes.shape[1]]).astype(int)
    _, first, counts = np.unique(nodes.ravel()[flat], return_index=True, return_counts=True)
    ends: list[int] = flat[first[counts == 1]].tolist()
    return ends


def _bridged(kept: Sequence[int], nodes: AnyArray, ends: AnyArray, reach: AnyArray,
             widest: float) -> tuple[AnyArray, Gaps]:
    """Close gaps between loose ends, the narrowest first; new numbers of points, and the gaps."""
    dangling = _dangling(kept, nodes)
    if not dangling:
        return nodes, []
    count = nodes.shape[1]
    places = ends.reshape(-1, 2)[dangling]
    near = _near(places, widest)
    away = np.linalg.norm(places[near[:, 0]] - places[near[:, 1]], axis=1)
    moved, gaps, used = nodes.ravel().copy(), Gaps(), set[int]()
    for number in np.argsort(away, kind="stable"):
        first, last = (dangling[k] for k in near[number])
        itself = first % count == last % count and reach[first % count] <= 2 * widest
        if itself or used & {first, last}:
            continue
        used |= {first, last}
        moved[last] = moved[first]
        gaps.append((first, last, float(away[number])))
    return moved.reshape(2, -1), gaps


def _pruned(kept: Sequence[int], nodes: AnyArray) -> tuple[list[int], list[int]]:
    """Divide pieces into those of closed curves and those of open ones."""
    at = defaultdict[int, set[int]](set)
    for k in kept:
        for node in nodes[:, k].tolist():
            at[node].add(k)
    single = {k for k in kept if nodes[0, k] == nodes[1, k]}
    loose = [node for node, here in at.items() if len(here) == 1 and not here & single]
    stray = set[int]()
    while loose:
        here = at[loose.pop()]
        if len(here) == 1:
            k, = here
            stray.add(k)
            for node in nodes[:, k].tolist():
                at[node].discard(k)
                if len(at[node]) == 1 and not at[node] & single:
                    loose.append(node)
    return [k for k in kept if k not in stray], [k for k in kept if k in stray]


def _refuse_mistakes(stray: Sequence[int], nodes: AnyArray, ends: AnyArray, reach: AnyArray,
                     widest: float) -> None:
    """Refuse open curves that only small gaps keep from being closed."""
    bridged, gaps = _bridged(stray, nodes, ends, reach, widest)
    closed, _ = _pruned(stray, bridged)
    part = set(closed)
    gaps = [gap for gap in gaps if {end % nodes.shape[1] for end in gap[:2]} <= part]
    if gaps:
        first, last, _ = max(gaps, key=lambda item: item[2])
        raise _open(ends, first, last)


def _connected(kept: Sequence[int], nodes: AnyArray, ends: AnyArray, check: bool = True
               ) -> list[list[int]]:
    """Sort pieces into curves, in order along each; a branch is an :class:`InputError`."""
    at = defaultdict[int, list[int]](list)
    for k in kept:
        for node in nodes[:, k].tolist():
            at[node].append(k)
    if check and (bad := [here for here in at.values() if len(here) > 2]):
        k = bad[0][0]
        node = next(node for node in nodes[:, k].tolist() if len(at[node]) > 2)
        side = int(nodes[1, k] == node)
        raise InputError(f"must be one closed curve: it branches at {_place(ends[side, k])} of the "
                         "drawing, where more than two lines end: delete what is not part of the "
                         "outline, or name the layer of the outline with layer")
    left, curves = dict.fromkeys(kept), list[list[int]]()
    while left:
        k = next(iter(left))
        chain, ahead = list[int](), [k]
        while ahead:
            k = ahead.pop()
            if k in left:
                del left[k]
                chain.append(k)
                ahead += [other for node in nodes[:, k].tolist() for other in at[node]
                          if other in left]
        curves.append(chain)
    return curves


def _longest_open(stray: Sequence[int], nodes: AnyArray, ends: AnyArray, reach: AnyArray
                  ) -> tuple[int, int]:
    """Find two loose ends of the longest open curve."""
    chains = _connected(stray, nodes, ends, check=False)
    longest = max(chains, key=lambda chain: float(reach[chain].sum()))
    first, last, *_ = _dangling(longest, nodes)
    return first, last


def _trace(chain: list[int], nodes: AnyArray, pieces: Sequence[Piece]) -> list[Piece]:
    """Turn the pieces of a closed curve so that each runs on from the one before."""
    loop, node = [pieces[chain[0]]], nodes[1, chain[0]]
    if len(chain) > 1 and node not in nodes[:, chain[1]]:
        loop, node = [pieces[chain[0]].backwards()], nodes[0, chain[0]]
    for k in chain[1:]:
        ahead = nodes[0, k] == node
        loop.append(pieces[k] if ahead else pieces[k].backwards())
        node = nodes[int(ahead), k]
    return loop


def _closed_up(loop: list[Piece], joint: float) -> list[Piece]:
    """Move the ends of pieces together where there is a gap."""
    starts, stops = piece_ends(loop)
    miss = np.linalg.norm(np.roll(stops, 1, axis=0) - starts, axis=1)
    if miss.max() <= joint:
        return loop
    meet = np.where(miss[:, None] > joint, (np.roll(stops, 1, axis=0) + starts) / 2, starts)
    ahead = np.where(np.roll(miss, -1)[:, None] > joint, np.roll(meet, -1, axis=0), stops)
    return [piece.between(meet[k], ahead[k])
            if max(miss[k], miss[(k + 1) % len(loop)]) > joint else piece
            for k, piece in enumerate(loop)]


def _thinned(loop: list[Piece], tolerance: float) -> tuple[list[Piece], list[str]]:
    """Replace lines by fewer within the tolerance, if they are too many or too short.

    If there are too many arcs and splines, all pieces become lines.
    """
    starts, stops = piece_ends(loop)
    lines = np.array([isinstance(piece, Line) for piece in loop])
    short = np.linalg.norm(stops - starts, axis=1) < SMALLEST * np.ptp(starts, axis=0).max() / 2
    if len(loop) <= MOST_PIECES and not (short & lines).any():
        return loop, []
    turn = 0 if lines.all() else int(np.flatnonzero(~lines)[0])
    loop = loop[turn:] + loop[:turn]
    thin = list[Piece]()
    for straight, run in groupby(loop, lambda piece: isinstance(piece, Line)):
        parts = list(run)
        if not straight:
            thin += parts
            continue
        points, last = piece_ends(parts)
        points = np.vstack([points, last[-1:]])
        keep = _few(points, tolerance)
        thin += [Line((a[0], a[1]), (b[0], b[1])) for a, b in pairwise(points[keep].tolist())]
    if len(thin) > MOST_PIECES and not lines.all() and tolerance > 0:
        return _straightened(loop, tolerance)
    if len(thin) == len(loop):
        return loop, []
    return thin, [f"thinned {len(loop)} lines to {len(thin)}, within {1e3 * tolerance:.3g} mm"]


def _straightened(loop: list[Piece], tolerance: float) -> tuple[list[Piece], list[str]]:
    """Replace all pieces by lines within the tolerance; half of it is for chords, half to thin.

    Pieces that would take too many lines stay as they are.
    """
    chords = [_chords(piece, tolerance / 2) for piece in loop]
    if not all(map(len, chords)):
        return loop, []
    points = np.vstack([*chords, piece_ends(loop)[1][-1:]])
    keep = _few(points, tolerance / 2)
    lines: list[Piece] = [Line((a[0], a[1]), (b[0], b[1]))
                          for a, b in pairwise(points[keep].tolist())]
    return lines, [f"replaced {len(loop)} arcs, splines and lines by {len(lines)} straight lines, "
                   f"within {1e3 * tolerance:.3g} mm"]


def _chords(piece: Piece, within: float) -> AnyArray:
    """Points along a piece, without its end, whose chords keep within a distance of it.

    There are none if that takes more than :data:`_MOST_CHORDS`.
    """
    starts: AnyArray = piece_ends([piece])[0]
    if isinstance(piece, Line):
        return starts
    count = 2
    while count <= _MOST_CHORDS:
        points = piece.at(np.linspace(0, 1, 2 * count + 1))[0]
        middles = (points[:-2:2] + points[2::2]) / 2
        if np.linalg.norm(points[1::2] - middles, axis=1).max() <= within:
            return points[:-1:2]
        count *= 2
    return starts[:0]


def _few(points: AnyArray, tolerance: float) -> AnyArray:
    """Select the points that a polyline needs (Douglas and Peucker's method); their numbers."""
    keep = np.zeros(len(points), bool)
    keep[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    while spans:
        low, high = spans.pop()
        if high - low < 2:
            continue
        chord, away = points[high] - points[low], points[low + 1 : high] - points[low]
        length = float(np.hypot(*chord))
        along = np.clip(away @ chord / (length**2 or 1.0), 0, 1)
        distance = np.linalg.norm(away - along[:, None] * chord, axis=1)
        worst = int(distance.argmax())
        if distance[worst] > tolerance:
            keep[low + 1 + worst] = True
            spans += [(low, low + 1 + worst), (low + 1 + worst, high)]
    return np.flatnonzero(keep)


def _around(curve: Curve, point: Sequence[float]) -> bool:
    """Whether a curve runs around a point."""
    (west, east), (south, north) = curve.box
    within = west < point[0] < east and south < point[1] < north
    return bool(within and curve.level(np.array(point[0]), np.array(point[1])) < 0)


def _point(ends: AnyArray, end: int) -> AnyArray:
    return np.asarray(ends.reshape(-1, 2)[end])


def _place(point: Sequence[float] | AnyArray) -> str:
    x, y = (round(1e3 * float(value), 9) + 0.0 for value in point)
    return f"{x:.6g}, {y:.6g} mm"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count > 1)}"


def _listed(curves: Sequence[Curve]) -> str:
    """Describe the three largest curves, and count the others."""
    words = []
    for curve in sorted(curves, key=lambda curve: -float(curve.area))[:3]:
        (west, east), (south, north) = curve.box
        words.append(f"{1e3 * (east - west):.4g} x {1e3 * (north - south):.4g} mm about "
                     f"{_place(((west + east) / 2, (south + north) / 2))}")
    more = len(curves) - len(words)
    return "; ".join(words) + f"; and {more} more" * (more > 0)


def _open(ends: AnyArray, first: int, last: int, allowed: bool = True) -> InputError:
    """Make the message on an open curve; the tolerance that it advises closes the gap."""
    start, end = _point(ends, first), _point(ends, last)
    gap = 1e3 * float(np.linalg.norm(start - end))
    digits = 1 - int(np.floor(np.log10(gap)))
    enough = np.ceil(1.02 * gap * 10.0**digits) / 10.0**digits
    advice = f', or allow it with tolerance = "{enough:g} mm"' if allowed else ""
    return InputError(f"must be one closed curve: it is open at {_place(start)} and {_place(end)} "
                      f"of the drawing, {gap:.3g} mm apart: close the gap in the drawing{advice}")


def _on_gaps(gaps: Gaps, ends: AnyArray) -> str:
    first, _, gap = max(gaps, key=lambda item: item[2])
    return (f"closed {_counted(len(gaps), 'gap')}, the widest {1e3 * gap:.3g} mm at "
            f"{_place(_point(ends, first))} of the drawing")
