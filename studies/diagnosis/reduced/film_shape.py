"""The shape of a film as a reduced model: displacements on a lattice between plate and frame.

Rays from the plate's centre meet plate and frame; the lattice has Chebyshev points along each ray
and cubic splines around. It moves with a plate that is off centre, so that displacements of its
points are a smooth function of all parameters that change the film, and no point crosses the
plate's edge. A sensor that looks down on a place of the table sees a point of the film that was
elsewhere in the flat film: it is found on the deformed lattice.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.errors import InputError
from tympan.geometry.outlines import Outline
from tympan.geometry.rays import exits, outside
from tympan.geometry.specimen import Plate

#: Number of points along each ray from plate to frame, with both ends. Set by trial.
ALONG = 12
#: Number of rays around the plate. Set by trial.
AROUND = 48

#: Number of values of a lattice: three components at each point.
COUNT = 3 * ALONG * AROUND

#: Most steps of Newton's method on the lattice.
_STEPS = 12
#: Length of the last step, in the lattice's coordinates over the number of rays: the next one is
#: its square.
_SMALL = 1e-9
#: Distance beyond plate and frame to which the lattice is continued, as a share of a ray: places
#: are not read more exactly.
_BEYOND = 0.02


@dataclass(frozen=True, eq=False)
class Lattice:
    """Points of a flat film on rays from its plate's ``centre`` [m].

    ``points`` have the shape (2, ALONG, AROUND) [m], from plate to frame; ``plate`` is within them.
    """

    plate: Plate
    points: Array

    @property
    def centre(self) -> Array:
        return np.array(self.plate.offset)

    @property
    def flat(self) -> Array:
        """The points, shape (ALONG · AROUND, 2)."""
        return np.ascontiguousarray(self.points.reshape(2, -1).T)


@lru_cache(maxsize=256)
def lattice_of(frame: Outline, plate: Plate) -> Lattice:
    """Make the lattice of a film between two outlines.

    An :class:`InputError` where part of the film is not visible from the plate's centre.
    """
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    way = np.stack([np.cos(angle), np.sin(angle)])
    centre = np.array(plate.offset)[:, None]
    inner = _crossing(plate, centre, way, 2.5 * max(plate.outline.semi_axes))
    away = float(np.abs(centre).max())
    outer = _crossing(frame, centre, way, 2.5 * max(frame.semi_axes) + away)
    angles = np.pi * np.arange(ALONG) / (ALONG - 1)
    share = (1 - np.cos(angles)) / 2
    radius = inner + share[:, None] * (outer - inner)
    return Lattice(plate, centre[:, None] + way[:, None] * radius)


def _crossing(outline: Outline | Plate, centre: Array, way: Array, far: float) -> Array:
    """Find the distances at which rays leave an outline [m], shape (AROUND,)."""
    beyond = outside(outline, centre, way, far)
    if np.any(np.diff(beyond.astype(int), axis=0) < 0) or not beyond[-1].all():
        raise InputError("must be one whose whole edge is seen from the plate's centre, for "
                         "field.csv to be judged", key="frame, plate", given=str(outline))
    return exits(outline, centre, way, far)


@lru_cache
def _rules() -> tuple[Array, Array]:
    """Make matrices from values to coefficients: Chebyshev polynomials, periodic cubic splines."""
    nodes = -np.cos(np.pi * np.arange(ALONG) / (ALONG - 1))
    rays = np.eye(AROUND)
    beside = np.roll(rays, 1, axis=0) + np.roll(rays, -1, axis=0)
    around = 4 / 6 * rays + beside / 6
    along = np.asarray(np.linalg.inv(chebyshev.chebvander(nodes, ALONG - 1)), float)
    return along, np.asarray(np.linalg.inv(around), float)


def coefficients(values: Array) -> Array:
    """Compute coefficients of lattice values, shape (..., ALONG, AROUND)."""
    along, around = _rules()
    return along @ values @ around.T


#: Chebyshev polynomials by powers of their variable, a column each.
_CHEBYSHEV = np.stack([np.r_[row, np.zeros(ALONG - len(row))]
                       for row in map(chebyshev.cheb2poly, np.eye(ALONG))], axis=1)
#: The four cubic splines by powers of a place between the second and the third, a column each.
_SPLINES = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
_NEIGHBOURS = np.arange(-1, 3)


def _along(share: Array) -> tuple[Array, Array]:
    """Evaluate Chebyshev polynomials on rays, 0 at the plate, 1 at the frame, and derivatives."""
    return _with_slope(2 * share - 1, _CHEBYSHEV, 2.0)


def _around(turn: Array) -> tuple[Numbers, Array, Array]:
    """Evaluate the four splines at places around, in rays: numbers, values and derivatives."""
    first = np.floor(turn).astype(np.int64)
    return (first[:, None] + _NEIGHBOURS) % AROUND, *_with_slope(turn - first, _SPLINES)


def _with_slope(x: Array, polynomials: Array, rate: float = 1.0) -> tuple[Array, Array]:
    """Evaluate polynomials, a column each by powers of x, and ``rate`` times their derivatives."""
    powers = np.ones((len(polynomials), len(x)))
    np.multiply.accumulate(np.broadcast_to(x, (len(powers) - 1, len(x))), out=powers[1:])
    slopes = rate * np.arange(1, len(powers))[:, None] * polynomials[1:]
    return powers.T @ polynomials, powers[:-1].T @ slopes


@dataclass(frozen=True, eq=False)
class FilmShape:
    """A deformed film: coefficients of the flat lattice (2) and its displacements (3).

    ``coefficients`` have the shape (5, ALONG, AROUND) [m]; ``rim`` is the displacement of the
    plate's edge at the rays, (3, AROUND) [m].
    """

    lattice: Lattice
    coefficients: Array
    rim: Array

    @classmethod
    def of(cls, lattice: Lattice, displacement: Array) -> FilmShape:
        """Fit the shape to displacements [m] at the lattice's points, shape (3, ALONG, AROUND)."""
        values = np.concatenate([lattice.points, displacement])
        return cls(lattice, coefficients(values), displacement[:, 0])

    @cached_property
    def plane(self) -> Array:
        """Plane of the plate: its coefficients times 1, x, y are the heights of the edge."""
        x, y = self.lattice.points[:, 0] + self.rim[:2]
        design = np.stack([np.ones(AROUND), x, y], axis=1)
        return np.asarray(np.linalg.lstsq(design, self.rim[2], rcond=None)[0])

    @cached_property
    def _by_ray(self) -> Array:
        """The coefficients, shape (AROUND, ALONG · 5)."""
        return np.ascontiguousarray(self.coefficients.transpose(2, 1, 0)).reshape(AROUND, -1)

    def heights(self, places: Array) -> Array:
        """Compute heights that a sensor above places of the table reads [m]; places (n, 2) [m]."""
        share, turn = self._sought(places, moved=True)
        film = self._at(share, turn)[0][4]
        plate = self.plane[0] + places @ self.plane[1:]
        return np.where(share < 0, plate, np.where(share > 1, 0.0, film))

    def origins(self, places: Array) -> tuple[Array, Mask]:
        """Find the flat places of the points that are now at places (n, 2) [m]; which are film."""
        share, turn = self._sought(places, moved=True)
        return self._at(share, turn)[0][:2].T, (share > 0) & (share < 1)

    def displacements(self, places: Array) -> Array:
        """Compute displacements of the points that were at places of the flat film [m], (3, n)."""
        share, turn = self._sought(places, moved=False)
        film = self._at(share, turn)[0][2:]
        moved = self.rim[:2].mean(axis=1)
        on_plate = np.concatenate([np.tile(moved[:, None], len(places)),
                                   [self.plane[0] + (places + moved) @ self.plane[1:]]])
        return np.where(share < 0, on_plate, np.where(share > 1, 0.0, film))

    def _at(self, share: Array, turn: Array) -> tuple[Array, Array, Array]:
        """Evaluate flat place and displacement, (5, n), and derivatives by share and turn."""
        along, slope = _along(share)
        number, around, rate = _around(turn)
        local = self._by_ray[number]
        in_turn, by_turn = (np.einsum("nr,nrk->nk", part, local).reshape(len(turn), ALONG, -1)
                            for part in (around, rate))
        return (np.einsum("na,naf->fn", along, in_turn), np.einsum("na,naf->fn", slope, in_turn),
                np.einsum("na,naf->fn", along, by_turn))

    def _edges(self, turn: Array) -> Array:
        """Evaluate flat places at the plate and at the frame, shape (2, n, 2)."""
        number, around, _ = _around(turn)
        ends = _along(np.array([0.0, 1.0]))[0] @ self.coefficients[:2].transpose(2, 1, 0)
        return np.asarray(np.einsum("nr,nrek->enk", around, ends[number]))

    def _sought(self, places: Array, moved: bool) -> tuple[Array, Array]:
        """Find lattice coordinates of places, on the deformed (``moved``) or the flat film.

        They are below 0 on the plate, above 1 beyond the frame.
        """
        away = places - self.lattice.centre
        turn = np.arctan2(away[:, 1], away[:, 0]) * AROUND / (2 * np.pi) % AROUND
        rim, edge = (np.hypot(*(ends - self.lattice.centre).T) for ends in self._edges(turn))
        share = (np.hypot(*away.T) - rim) / (edge - rim)
        # A plate that was displaced sideways uncovers film where it was.
        slid = moved * np.hypot(*self.rim[:2]).max() / (edge - rim)
        near = (share > -_BEYOND - slid) & (share < 1 + _BEYOND)
        if not near.any():
            return share, turn
        start = share[near].clip(0, 1)
        share[near], turn[near] = self._newton(start, turn[near], places[near], moved)
        return share, turn

    def _newton(self, share: Array, turn: Array, places: Array, moved: bool
                ) -> tuple[Array, Array]:
        for _ in range(_STEPS):
            value, by_share, by_turn = (part[:2] + moved * part[2:4]
                                        for part in self._at(share, turn))
            missing = places.T - value
            determinant = by_share[0] * by_turn[1] - by_share[1] * by_turn[0]
            step = np.stack([by_turn[1] * missing[0] - by_turn[0] * missing[1],
                             by_share[0] * missing[1] - by_share[1] * missing[0]])
            step /= determinant
            before, share = share, np.clip(share + step[0], -2 * _BEYOND, 1 + 2 * _BEYOND)
            turn = (turn + step[1]) % AROUND
            # A place on the plate or beyond the frame stays at the bound, without further search.
            if np.abs(np.where(share == before, 0.0, step)).max(initial=0.0) < _SMALL * AROUND:
                break
        return share, turn
