"""Polygons with corners rounded by circular arcs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.pieces import Arc, Line, Piece, Point, direction


def filleted(vertices: Sequence[Point], radius: float) -> tuple[Piece, ...]:
    """Lines between the vertices [m], arcs of a radius [m] at them; no arcs if it is 0.

    Raises
    ------
    InputError
        Where sides are too short for the arcs at their ends.
    """
    count = len(vertices)
    arcs = [_arc(vertices[k - 1], vertices[k], vertices[(k + 1) % count], radius)
            for k in range(count)]
    size = max(abs(np.real(number)) for vertex in vertices for number in vertex)
    result: list[Piece] = []
    for k, (arc, _, leave, reach) in enumerate(arcs):
        after = (k + 1) % count
        side = _distance(vertices[k], vertices[after])
        rest = np.real(side - reach - arcs[after][3])
        if rest < -1e-12 * size:
            x, y = (1e3 * float(np.real(number)) for number in vertices[k])
            raise InputError(f"must leave room on every side: the side from {x:.4g}, {y:.4g} mm is "
                             f"{np.real(side) * 1e3:.4g} mm long, the arcs at its ends need "
                             f"{np.real(reach + arcs[after][3]) * 1e3:.4g} mm",
                             given=f"{np.real(radius) * 1e3:.4g} mm")
        if arc is not None:
            result.append(arc)
        if rest > 1e-12 * size:
            result.append(Line(leave, arcs[after][1]))
    return tuple(result)


def _arc(before: Point, corner: Point, after: Point, radius: float) -> tuple[Arc | None, Point,
                                                                             Point, float]:
    """The arc at a corner, its ends, and how much of both sides it takes."""
    if np.real(radius) == 0:
        return None, corner, corner, 0.0
    (u, v), (w, z) = _unit(before, corner), _unit(corner, after)
    turn = direction(u * w + v * z, u * z - v * w)
    if abs(np.real(turn)) < 1e-9:
        return None, corner, corner, 0.0
    side = np.sign(np.real(turn))
    reach = radius * side * np.tan(turn / 2)
    start, end = (corner[0] - reach * u, corner[1] - reach * v), (corner[0] + reach * w,
                                                                  corner[1] + reach * z)
    centre = start[0] - side * radius * v, start[1] + side * radius * u
    return Arc(centre, (radius, radius), direction(u, v) - side * np.pi / 2,
               turn), start, end, reach


def _unit(start: Point, end: Point) -> Point:
    length = _distance(start, end)
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length


def _distance(start: Point, end: Point) -> float:
    squared: float = (end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2
    distance: float = squared**0.5
    return distance
