"""Films in the format of a page's viewer: whole numbers in base64, with their scales."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from tympan.base.arrays import AnyArray, Mask
from tympan.reports import look
from tympan.reports.colouring import (
    COLOURINGS,
    DEPTHS,
    Colouring,
    colour_table,
    css_gradient,
    tick_places,
    usual_depth,
)
from tympan.reports.scales import bar_length
from tympan.studies.film_surface import FilmSurface, lattice

#: Most points of all films of a page; beyond, elements are cut into fewer triangles.
_MOST_POINTS = 40_000

#: Largest signed whole number of 16 bits.
_SIGNED = 2**15 - 1
#: Largest unsigned whole number of 16 bits.
_UNSIGNED = 2**16 - 1

#: Distance over the film's extent below which points are one. No multiple of a round length.
_SAME = 0.9137e-6


def payload(films: Mapping[str, FilmSurface],
            colourings: Mapping[str, Colouring] = COLOURINGS) -> str:
    """Write the record of films as JSON for a script element."""
    # A "<" could end the element.
    return json.dumps(record_of(films, colourings), allow_nan=False).replace("<", r"\u003c")


def record_of(films: Mapping[str, FilmSurface], colourings: Mapping[str, Colouring] = COLOURINGS,
              even: bool = False) -> dict[str, Any]:
    """Build the record of films by their names, all on one scale of each quantity.

    Quantities that are the same everywhere are left out, unless ``even`` those are to be shown.
    """
    thin = coarsened(list(films.values()), _MOST_POINTS)
    values = {key: [quantity.of(film) for film in thin] for key, quantity in colourings.items()}
    shown = {key: of_films for key, of_films in values.items()
             if even or min(map(np.min, of_films)) < max(map(np.max, of_films))}
    extent = 1e3 * max(float(np.abs(film.mounted[:, :2]).max()) for film in thin)
    sag = 1e3 * max(float(np.abs(film.values["displacement"][:, 2]).max()) for film in thin)
    return {
        "net": bar_length(2 * extent) / 2, "depths": (0, *DEPTHS),
        "depth": usual_depth(sag, extent), "lines": (look.SHORT, look.LONG),
        "quantities": {key: _quantity(colourings[key], of_films)
                       for key, of_films in shown.items()},
        "films": [{"name": name, **_film(film), "values": {
            key: _scaled(of_films[number], "uint16", colourings[key])
            for key, of_films in shown.items()}}
            for number, (name, film) in enumerate(zip(films, thin, strict=True))]}


def coarsened(films: Sequence[FilmSurface], most: int) -> list[FilmSurface]:
    """Coarsen films to at most ``most`` points together, or to as few as their elements allow."""
    for divisor in (1, 2, 3, 6):
        thin = [_coarser(film, divisor) for film in films]
        if sum(len(film.points) for film in thin) <= most:
            break
    return thin


def _coarser(film: FilmSurface, divisor: int) -> FilmSurface:
    """Divide the edges of a film's elements into ``divisor`` times fewer parts, where possible.

    The points of an element are consecutive, in the order of :func:`lattice`.
    """
    parts = next((parts for parts in range(1, 25) if len(film.triangles) * (parts + 1) * (parts + 2)
                  == 2 * len(film.points) * parts**2), 1)
    if divisor == 1 or parts % divisor:
        return film
    fine, (coarse, triangles) = lattice(parts)[0], lattice(parts // divisor)
    keep = np.array([np.abs(fine.T - place).sum(axis=1).argmin() for place in coarse.T])
    elements = len(film.points) // len(fine.T)
    rows = (len(fine.T) * np.arange(elements)[:, None] + keep).ravel()
    corners = len(keep) * np.arange(elements)[:, None, None] + triangles
    return FilmSurface(film.points[rows], corners.reshape(-1, 3),
                       {name: value[rows] for name, value in film.values.items()})


def _quantity(quantity: Colouring, of_films: Sequence[AnyArray]) -> dict[str, Any]:
    scale = quantity.scale(min(float(values.min()) for values in of_films),
                           max(float(values.max()) for values in of_films))
    return {"label": quantity.label, "words": quantity.title, "unit": quantity.unit,
            "low": scale.low, "high": scale.high, "ticks": tick_places(scale),
            "gradient": css_gradient(quantity.colours),
            "colours": _encoded(colour_table(quantity.colours))}


def _film(film: FilmSurface) -> dict[str, Any]:
    mounted, rims = 1e3 * film.mounted[:, :2], rim_edges(film)
    plate = [plate_triangles(mounted, edges) for edges in rims[1:]]
    half = np.abs(mounted).max(axis=0)
    centre = mounted[rims[-1]].mean(axis=(0, 1))
    index = np.uint16 if len(mounted) <= _UNSIGNED else np.uint32
    return {"turned": bool(half[1] > half[0] * (1 + 1e-6)), "centre": centre.tolist(),
            "mounted": _steps(mounted), "displaced": _steps(1e3 * film.values["displacement"]),
            "tension": _encoded(film.values["tension"].astype(np.uint8)),
            "triangles": _encoded(film.triangles.astype(index)),
            "plate": _encoded(np.vstack([np.empty((0, 3)), *plate]).astype(index)),
            "edges": _encoded(np.vstack(rims).astype(index)),
            "segments": [{"colour": colour, **_encoded(
                film.segment_sides(number)[:, :2].astype(index))}
                for number, colour in enumerate(look.segment_colours(film.segments))]}


def _steps(values: AnyArray) -> dict[str, Any]:
    """Convert numbers [mm] to multiples of a step."""
    step = max(float(np.abs(values).max()), 1e-9) / _SIGNED
    return {"step": step, **_encoded(np.round(values / step).astype(np.int16))}


def _scaled(values: AnyArray, dtype: str, quantity: Colouring) -> dict[str, Any]:
    """Scale values to the range from their smallest to their largest."""
    low, high = float(values.min()), float(values.max())
    parts = (values - low) / (high - low) if high > low else np.zeros(len(values))
    scale = quantity.scale(low, high)
    return {"low": low, "high": high, "from": scale.text(low, 1), "to": scale.text(high, 1),
            **_encoded(np.round(_UNSIGNED * parts).astype(dtype))}


def _encoded(values: AnyArray) -> dict[str, str]:
    """Encode an array's numbers, little-endian, row by row."""
    little = values.astype(values.dtype.newbyteorder("<"))
    return {"type": values.dtype.name, "data": b64encode(little.tobytes()).decode()}


def rim_edges(film: FilmSurface) -> list[AnyArray]:
    """Find edges that belong to one triangle only, (n, 2) each: the frame's, then the holes'."""
    mounted = film.mounted[:, :2]
    tolerance = _SAME * float(np.abs(mounted).max())
    places, size = np.round(mounted / tolerance), len(mounted)
    # A pair as one complex number: comparing rows is far slower.
    _, first, number = np.unique(places @ [1, 1j], return_index=True, return_inverse=True)
    edges = first[number][film.triangles][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, first_edge, count = np.unique(np.sort(edges, axis=1) @ [size, 1], return_index=True,
                                     return_counts=True)
    rim = edges[first_edge[count == 1]]
    links = coo_array((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(size, size))
    loop = connected_components(links, directed=False)[1][rim[:, 0]]
    loops = [rim[loop == label] for label in np.unique(loop)]
    return sorted(loops, key=lambda edges: -float(np.ptp(mounted[edges[:, 0]], axis=0).max()))


def plate_triangles(mounted: AnyArray, edges: AnyArray) -> AnyArray:
    """Triangulate the loop of some edges between points, (n, 3)."""
    corners = np.unique(edges)
    triangles = corners[Delaunay(mounted[corners]).simplices]
    return np.asarray(triangles[_inside(mounted[triangles].mean(axis=1), mounted[edges])])


def _inside(points: AnyArray, edges: AnyArray) -> Mask:
    """Check if points, (n, 2), are within closed edges, (m, 2, 2), by counting crossings."""
    (x, y), start, end = points.T[..., None], edges[:, 0], edges[:, 1]
    crossed = (start[:, 1] > y) != (end[:, 1] > y)
    rise = np.where(end[:, 1] == start[:, 1], np.inf, end[:, 1] - start[:, 1])
    at = start[:, 0] + (y - start[:, 1]) / rise * (end[:, 0] - start[:, 0])
    return np.asarray((crossed & (x < at)).sum(axis=1) % 2 == 1)
