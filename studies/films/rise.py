"""A film of a family as its voltage rises, to its first limits, in some milliseconds.

The states are those by which :func:`tympan.studies.films.first_limits.first_limits` finds the
limits. Each has its rate, so U² as a function of the plate's deflection is known between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from tympan.studies.case import LimitKind
from tympan.studies.films.family import FilmFamily
from tympan.studies.films.first_limits import KINDS, Margins, first_limits
from tympan.studies.films.many_films import Charged, Films, FilmsAt, Local

Array = NDArray[Any]

#: Points of a curve, closer at both ends: there the deflection bends most against the voltage.
_POINTS = 25
#: States between those of the search: U² between all of them is then known to 3e-4 of that at the
#: end, in eight random films; a family's own error is as large.
_MORE = 8
#: Exponent of their deflections over that at the end: a voltage moves the plate more and more.
_MORE_AND_MORE = 1.5
#: By how much U² of a state may be corrected, over the largest: of that the square is left.
_FAR = 0.03
#: How far beyond the end the last of these is, over the deflection by the voltage.
_BEYOND = 0.05
#: How far from a limit its margin is looked at again, over the deflection by the voltage.
_ASIDE = 0.02
#: What local numbers of the reduced film may be off: stresses over the largest one, and the share
#: of the strength. Set by trial: limits of nine films were wrong by half of what follows.
_LOCAL = 2e-3
#: The plate's stiffness where the error is estimated, over that at rest: beyond, the deflection is
#: no measure of it any more, since it grows without bound towards the pull-in.
_STIFF = 0.2


@dataclass(frozen=True)
class FamilyLimit:
    """U² [V²] at a limit, by how much it may be wrong, and where it begins in the mounted film."""

    squared: float
    off: float
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class FamilyRise:
    """A film from rest to its end, as far as the family holds it; arrays have the shape (points,).

    ``deflection`` [m], ``squared``: U² across the film [V²], the plate's ``stiffness`` [N/m];
    ``limits`` that are met, by kind; ``rest``: amplitudes q of the film without voltage.
    ``whole``: it pulls in at the last point, taut and firm all the way. Otherwise it loses tension
    there, or the family holds it no further. ``off``: by how much the force on the plate may be
    wrong [N].
    """

    deflection: Array
    squared: Array
    stiffness: Array
    limits: dict[LimitKind, FamilyLimit]
    whole: bool
    off: float
    rest: Array

    def error(self, deflection: float) -> float:
        """Error of a deflection at a given voltage [m]."""
        return self.off / float(np.interp(deflection, self.deflection, np.abs(self.stiffness)))


def rise(family: FilmFamily, row: Array, force: float) -> FamilyRise | None:
    """A film with these parameters, (names,), under a force on its plate [N].

    None where the family does not hold it at rest, or a voltage does not move its plate.
    """
    film = _Film(family, row, force)
    seen: list[tuple[Array, Margins]] = []

    def found(some: Array, squared: Array, near: Array | None) -> Margins:
        # Breakdown is looked for later: films go on beyond it.
        margins = family.margins(film.films, film.places, np.array([force]), np.array([np.inf]),
                                 True, some, squared, near)
        seen.append((squared, margins))
        return margins

    end = first_limits(found, 1, *family.squared)
    squared, values, q = (np.concatenate(parts) for parts in zip(*(
        (squared, margins.values, margins.q) for squared, margins in seen), strict=True))
    there = np.flatnonzero(np.isfinite(values).all(1))
    squared, first = np.unique(squared[there], return_index=True)
    q = q[there[first]]
    if len(q) < 2 or not (np.diff(q[:, 0]) > 0).all():
        return None
    way = _Way.of(film.charged(squared, q))
    kind = KINDS[end.kind[0]] if np.isfinite(end.voltage[0]) else None
    highest = float(min(end.voltage[0] ** 2, family.squared[1]))
    last = way.place(kind, highest)
    share = np.linspace(0.0, 1.0, _MORE + 1)[1:]
    near = way.path(q[0, 0] + (1 + _BEYOND) * (last - q[0, 0]) * share**_MORE_AND_MORE)
    with np.errstate(all="ignore"):
        more = film.charged(near[:, 0], near[:, 1:])
    # A state whose guess was far off is corrected again nowhere.
    sure = np.abs(more.squared - near[:, 0]) < _FAR * near[:, 0].max()
    return _to_end(film, _Way.of(way.states.joined(more.some(sure))), kind, highest)


@dataclass(frozen=True, eq=False)
class _Film:
    """One film of a family, under a force on its plate [N]."""

    family: FilmFamily
    row: Array
    force: float

    @cached_property
    def films(self) -> Films:
        """The film alone."""
        return self.family.films(self.row[None])

    @cached_property
    def places(self) -> FilmsAt:
        """The film at the family's places."""
        return self.films.at(self.family.looked_at)

    def charged(self, squared: Array, q: Array) -> Charged:
        """States near equilibria, as :meth:`Films.charged` corrects them."""
        return self.films.charged(np.zeros(len(q), dtype=np.int64), np.full(len(q), self.force), q,
                                  squared)

    def local(self, states: Array) -> Local:
        """Stretches, stresses and fields of states, (states, 1 + shapes): U² and q."""
        return self.films.local(self.places, np.zeros(len(states), dtype=np.int64), states[:, 1:],
                                states[:, 0])


@dataclass(frozen=True, eq=False)
class _Way:
    """States on the way; U² and amplitudes q as a function of the deflection through them."""

    states: Charged
    path: CubicHermiteSpline

    @classmethod
    def of(cls, states: Charged) -> Self:
        """Path through states in any order."""
        states = states.some(np.argsort(states.q[:, 0]))
        return cls(states, CubicHermiteSpline(
            states.q[:, 0], np.column_stack([states.squared, states.q]),
            np.column_stack([states.slope, states.rates])))

    def place(self, kind: str | None, squared: float) -> float:
        """Deflection [m] at which U² [V²] is first met, or at its top for a pull-in."""
        of_squared = CubicHermiteSpline.construct_fast(self.path.c[..., 0], self.path.x)
        if kind == "pull_in":
            roots = of_squared.derivative().roots(extrapolate=False)
            # Beyond the last state U² is a parabola.
            ahead = 2 * max(squared - self.states.squared[-1], 0.0) / self.states.slope[-1]
            return float(min(roots, default=self.path.x[-1] + ahead))
        roots = of_squared.solve(squared)
        return float(min(roots[roots >= self.path.x[0]], default=self.path.x[-1]))


def _to_end(film: _Film, way: _Way, kind: LimitKind | None, highest: float) -> FamilyRise:
    """The way to the first of tension lost and pull-in, or as far as states are there."""
    states, first, last = way.states, float(way.path.x[0]), way.place(kind, highest)
    off = _force_error(film, states.some(states.q[:, 0] < last))
    limits: dict[LimitKind, FamilyLimit] = {}
    if kind is not None and kind != "instability":
        limits[kind], last = _limit(film, way, kind, last, off)
    places = [last]
    if film.family.box.specimen.membrane.strength is not None:
        share = film.local(np.column_stack([states.squared, states.q])).share.max(1)
        broken = CubicSpline(states.q[:, 0], share - 1).roots(extrapolate=False)
        if (place := min(broken, default=last)) < last:
            limits["breakdown"], place = _limit(film, way, "breakdown", float(place), off)
            places.append(place)
    share = (1 - np.cos(np.pi * np.linspace(0.0, 1.0, _POINTS))) / 2
    y = np.unique([*first + (last - first) * share, *places])
    squared = way.path(y)[:, 0]
    squared[0] = film.family.squared[0]  # but for what rounding leaves
    return FamilyRise(y, squared, np.interp(y, states.q[:, 0], states.stiffness), limits,
                      kind == "pull_in", off, states.q[0])


def _limit(film: _Film, way: _Way, kind: str, place: float, off: float
           ) -> tuple[FamilyLimit, float]:
    """A limit near a deflection, and where it is; forces may be wrong by ``off`` [N]."""
    y = np.array([place, place - _ASIDE * (place - way.path.x[0])])
    here = film.local(way.path(y))
    worst, scale, end = {
        "tension": (-here.stress_2, float(here.stress_1[0].max()), 0.0),
        "breakdown": (here.share, 1.0, 1.0),
        "pull_in": (here.stretch_1 * here.stretch_2, 0.0, np.nan)}[kind]
    error = off * abs(float(np.interp(place, way.states.q[:, 0], way.states.by_force)))
    if scale:
        margins = worst.max(1)
        rate = float((margins[0] - margins[1]) / (y[0] - y[1]))
        place += (end - float(margins[0])) / rate
        error += _LOCAL * scale * abs(float(way.path(place, 1)[0]) / rate)
    at_x, at_y = film.family.places.at(film.films.nodes)[0, int(np.argmax(worst[0]))]
    return FamilyLimit(float(way.path(place)[0]), error, float(at_x), float(at_y)), place


def _force_error(film: _Film, states: Charged) -> float:
    """Error of forces on the plate [N]."""
    stiff = np.flatnonzero(states.stiffness >= _STIFF * states.stiffness[0])
    at = states.some(stiff[-1:] if len(stiff) else slice(0, 1))
    off = film.family.error(film.films, np.zeros(1, dtype=np.int64), at.q, np.array([film.force]),
                            at.squared, at.stiffness)
    return float(off[0] * at.stiffness[0])
