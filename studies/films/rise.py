"""A film of a family while its voltage rises, up to its first limits, in some milliseconds.

For a first film the states come from the search of
:func:`tympan.studies.films.first_limits.first_limits`. For a similar film they are found from the
first film's states, all at once. Each state has its rate, so U² is known between them as a function
of the plate's deflection.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from tympan.base.arrays import AnyArray
from tympan.studies.films.family import FilmFamily, RaisedFilms
from tympan.studies.films.first_limits import ENDS, WITHIN, FilmMargins, first_limits
from tympan.studies.films.many_films import Charged, Films, FilmsAt, LocalState

#: Number of points of a curve. They are closer at both ends, where the deflection has most
#: curvature against the voltage.
_POINTS = 25
#: States in addition to those of the search. U² is then accurate to 3e-4 of its value at the end,
#: in eight random films; a family's own error is as large.
_MORE = 8
#: Exponent of the spacing of additional states' deflections: the plate moves ever more per volt.
_MORE_AND_MORE = 1.5
#: Largest correction of a state's U², over the largest U²: its square remains as error.
_FAR = 0.03
#: Distance of the last of these states beyond the end, over the deflection by the voltage.
_BEYOND = 0.05
#: Number of states after the first, of a film that is found from another one.
_ALONG = 10
#: Additional range of this film beyond the other one's, over the deflection by the voltage.
_AHEAD = 0.25
#: Number of corrections of these states with their first tangents.
_CHORDS = 1
#: Largest correction of a state's U² after these corrections, over the largest U²; the remaining
#: error is about its square.
_MISSED = 3e-3
#: Least number of states before the end.
_ENOUGH = 6

#: Distance from a limit of the second evaluation of its margin, over the deflection by the voltage.
_ASIDE = 0.02
#: Largest number of corrections of a limit by its margin.
_CLOSING = 3
#: Correction, over the deflection by the voltage, below which the corrections end; its square
#: remains as error.
_CLOSE = 3e-3
#: Error of local numbers of the reduced film: of stresses over the largest one, and of the share of
#: the strength. Set by trial: limits of nine films had half of the error that this gives.
_LOCAL = 2e-3
#: Least plate stiffness, over that without voltage, of the state that gives the error. Towards the
#: pull-in the deflection's error grows without bound and is no measure any more.
_STIFF = 0.2


@dataclass(frozen=True)
class FamilyLimit:
    """U² [V²] at a limit, its error ``off``, and its place in the mounted film."""

    squared: float
    off: float
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class FamilyRise:
    """A film from rest to its end, as far as the family is valid; arrays have the shape (points,).

    ``deflection`` [m], ``squared``: U² across the film [V²], ``stiffness`` of the plate [N/m].
    ``limits``: limits by kind. ``rest``: amplitudes q without voltage. ``whole``: the film pulls in
    at the last point, taut and firm all the way. Otherwise it loses tension there, or the family is
    not valid beyond. ``off``: error of the force on the plate [N]. ``path``: U² and q as a function
    of the deflection.
    """

    deflection: AnyArray
    squared: AnyArray
    stiffness: AnyArray
    limits: dict[str, FamilyLimit]
    whole: bool
    off: float
    rest: AnyArray
    path: CubicHermiteSpline

    def error(self, deflection: float) -> float:
        """Compute the error of a deflection at a given voltage [m]."""
        return self.off / float(np.interp(deflection, self.deflection, np.abs(self.stiffness)))


def rise(family: FilmFamily, row: AnyArray, force: float, last: FamilyRise | None = None
         ) -> FamilyRise | None:
    """Raise the voltage of a film with parameters (names,) under a force on its plate [N].

    None if the family is not valid without voltage, or if a voltage does not move the plate.
    ``last``: rise of a similar film; with its states the computation takes half the time.
    """
    film = _Film(family, row, force)
    ended = (None if last is None else _followed(film, last)) or _searched(film)
    return None if ended is None else _to_end(film, *ended)


def _searched(film: _Film) -> tuple[_Way, str | None, float] | None:
    """Search for a film's limits; return its path, the limit that ends it, and its deflection."""
    family, seen = film.family, list[tuple[AnyArray, FilmMargins]]()
    # The search for breakdown is later: films continue beyond it.
    raised = RaisedFilms(film.films, film.places, np.array([film.force]), np.ones(1),
                         (*ENDS, *WITHIN))

    def found(some: AnyArray, squared: AnyArray, near: AnyArray | None) -> FilmMargins:
        margins = family.margins(raised, some, squared, near)
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
    kind = end.kind[0] if np.isfinite(end.voltage[0]) else None
    highest = float(min(end.voltage[0] ** 2, family.squared[1]))
    last = way.place(kind, highest)
    near = way.path(_spaced(q[0, 0], (1 + _BEYOND) * (last - q[0, 0]), _MORE))
    with np.errstate(all="ignore"):
        more = film.charged(near[:, 0], near[:, 1:])
    # A state whose guess was far off is dropped, not corrected again.
    sure = np.abs(more.squared - near[:, 0]) < _FAR * near[:, 0].max()
    way = _Way.of(way.states.joined(more.some(sure)))
    return way, kind, way.place(kind, highest)


def _followed(film: _Film, last: FamilyRise) -> tuple[_Way, str | None, float] | None:
    """Find path, end and its deflection from a similar film's states.

    None if these are too few or too far away.
    """
    family = film.family
    number, force = np.zeros(1, dtype=np.int64), np.array([film.force])
    lowest = np.array([family.squared[0]])
    rest = film.films.balanced(number, force, lowest, last.rest[None])
    if not (rest.sound.all() and film.holds):
        return None
    start, reach = rest.q[0, 0], last.deflection[-1] - last.deflection[0]
    y = _spaced(start, (1 + _AHEAD) * reach, _ALONG)
    there = np.clip(y, last.deflection[0], last.path.x[-1])
    with np.errstate(all="ignore"):
        guess = last.path(there)[:, 1:] * (y / there)[:, None]
        near = film.charged(film.squared(guess), guess, _CHORDS)
        states = film.charged(np.concatenate([lowest, near.squared]),
                              np.concatenate([rest.q, near.q]))
        here = film.local(np.column_stack([states.squared, states.q]))
    missed = np.abs(states.squared[1:] - near.squared) / film.family.squared[1]
    good = np.isfinite(here.stress_2).all(1) & np.append(True, missed < _MISSED)
    count = len(good) if good.all() else int(good.argmin())
    if count < _ENOUGH:
        return None
    way = _Way.of(states.some(slice(0, count)))
    tension, sound = np.asarray(here.stress_2.min(1)), np.asarray(here.sound.all(1))
    kind, end = _end(film, way, tension[:count], sound[:count])
    before = way.states.q[:, 0] < end
    if before.all() or before.sum() < _ENOUGH or not way.states.firm[before].all():
        return None
    return way, kind, end


def _end(film: _Film, way: _Way, tension: AnyArray, sound: AnyArray) -> tuple[str | None, float]:
    """Find the first end of a film except breakdown, and its deflection; infinite without an end.

    ``tension``: least stress of the states [Pa]. ``sound``: whether the film is firm in its plane.
    """
    y = way.states.q[:, 0]
    slack = CubicSpline(y, tension).roots(extrapolate=False)
    found: list[tuple[float, str | None]] = [
        (float(min(slack, default=np.inf)), "tension"),
        (float(min(way.of_squared.derivative().roots(extrapolate=False), default=np.inf)),
         "pull_in"),
        (float(min(y[~sound], default=np.inf)), "instability"),
        (float(min(way.of_squared.solve(film.family.squared[1], extrapolate=False),
                   default=np.inf)), None)]
    place, kind = min(found, key=lambda each: each[0])
    return kind, place


def _spaced(start: float, reach: float, count: int) -> AnyArray:
    """Choose deflections beyond a first one, closer at the start."""
    share = np.linspace(0.0, 1.0, count + 1)[1:]
    return np.asarray(start + reach * share**_MORE_AND_MORE)


@dataclass(frozen=True, eq=False)
class _Film:
    """One film of a family, under a force on its plate [N]."""

    family: FilmFamily
    row: AnyArray
    force: float

    @cached_property
    def films(self) -> Films:
        """The film alone."""
        return self.family.films(self.row[None])

    @cached_property
    def places(self) -> FilmsAt:
        """The film at the family's places."""
        return self.films.at(self.family.looked_at)

    @property
    def holds(self) -> bool:
        """Whether parameters and force are in the family's ranges."""
        return bool(self.family.box.holds(self.row[None])[0]
                    and self.family.force[0] <= self.force <= self.family.force[1])

    def charged(self, squared: AnyArray, q: AnyArray, chords: int = 0) -> Charged:
        """Correct states near equilibria as :meth:`Films.charged` does."""
        return self.films.charged(np.zeros(len(q), dtype=np.int64), np.full(len(q), self.force), q,
                                  squared, chords)

    def squared(self, q: AnyArray) -> AnyArray:
        """Compute the U² [V²] for which states q are in equilibrium, (states,)."""
        number, scale = np.zeros(len(q), dtype=np.int64), self.family.squared[1]
        without, by = (self.films.forces(number, q, np.full(len(q), squared))[:, 0]
                       for squared in (0.0, scale))
        return np.asarray(scale * (self.force - without) / (by - without))

    def local(self, states: AnyArray) -> LocalState:
        """Compute stretches, stresses and fields of states, (states, 1 + shapes): U² and q."""
        return self.films.local(self.places, np.zeros(len(states), dtype=np.int64), states[:, 1:],
                                states[:, 0])


@dataclass(frozen=True, eq=False)
class _Way:
    """States on the path; U² and amplitudes q through them as a function of the deflection."""

    states: Charged
    path: CubicHermiteSpline

    @classmethod
    def of(cls, states: Charged) -> Self:
        """Create the path through states in any order."""
        states = states.some(np.argsort(states.q[:, 0]))
        return cls(states, CubicHermiteSpline(
            states.q[:, 0], np.column_stack([states.squared, states.q]),
            np.column_stack([states.slope, states.rates])))

    @property
    def of_squared(self) -> CubicHermiteSpline:
        """U² as a function of the deflection."""
        return CubicHermiteSpline.construct_fast(self.path.c[..., 0], self.path.x)

    def place(self, kind: str | None, squared: float) -> float:
        """Find the deflection [m] where U² [V²] is first reached; for a pull-in, its maximum."""
        of_squared = self.of_squared
        if kind == "pull_in":
            roots = of_squared.derivative().roots(extrapolate=False)
            # Beyond the last state U² is extrapolated as a parabola.
            ahead = 2 * max(squared - self.states.squared[-1], 0.0) / self.states.slope[-1]
            return float(min(roots, default=self.path.x[-1] + ahead))
        roots = of_squared.solve(squared)
        return float(min(roots[roots >= self.path.x[0]], default=self.path.x[-1]))


def _to_end(film: _Film, way: _Way, kind: str | None, last: float) -> FamilyRise:
    """Build the rise up to loss of tension or pull-in, or as far as there are states."""
    states, first = way.states, float(way.path.x[0])
    off = _force_error(film, states.some(states.q[:, 0] < last))
    limits: dict[str, FamilyLimit] = {}
    if kind in ENDS:
        limits[kind], last = _limit(film, way, kind, last, off)
    places = [last]
    if film.family.box.specimen.membrane.strength is not None:
        share = film.local(np.column_stack([states.squared, states.q])).breakdown_share.max(1)
        broken = CubicSpline(states.q[:, 0], share - 1).roots(extrapolate=False)
        if (place := min(broken, default=last)) < last:
            limits["breakdown"], place = _limit(film, way, "breakdown", float(place), off)
            places.append(place)
    share = (1 - np.cos(np.pi * np.linspace(0.0, 1.0, _POINTS))) / 2
    y = np.unique([*first + (last - first) * share, *places])
    squared = way.path(y)[:, 0]
    squared[0] = film.family.squared[0]  # exact in spite of rounding
    return FamilyRise(y, squared, np.interp(y, states.q[:, 0], states.stiffness), limits,
                      kind == "pull_in", off, states.q[0], way.path)


def _limit(film: _Film, way: _Way, kind: str, place: float, off: float
           ) -> tuple[FamilyLimit, float]:
    """Correct a limit near a deflection; return it and its deflection; ``off`` is a force [N]."""
    error = off * abs(float(np.interp(place, way.states.q[:, 0], way.states.by_force)))
    for _ in range(_CLOSING):
        y = np.array([place, place - _ASIDE * (place - way.path.x[0])])
        here = film.local(way.path(y))
        worst, scale, end = {
            "tension": (-here.stress_2, float(here.stress_1[0].max()), 0.0),
            "breakdown": (here.breakdown_share, 1.0, 1.0),
            "pull_in": (here.stretch_1 * here.stretch_2, 0.0, np.nan)}[kind]
        if not scale:
            break
        margins = worst.max(1)
        rate = float((margins[0] - margins[1]) / (y[0] - y[1]))
        before, place = place, place + (end - float(margins[0])) / rate
        if abs(place - before) < _CLOSE * (place - way.path.x[0]):
            break
    if scale:
        error += _LOCAL * scale * abs(float(way.path(place, 1)[0]) / rate)
    at_x, at_y = film.family.places.at(film.films.nodes)[0, int(np.argmax(worst[0]))]
    return FamilyLimit(float(way.path(place)[0]), error, float(at_x), float(at_y)), place


def _force_error(film: _Film, states: Charged) -> float:
    """Estimate the error of forces on the plate [N]."""
    stiff = np.flatnonzero(states.stiffness >= _STIFF * states.stiffness[0])
    at = states.some(stiff[-1:] if len(stiff) else slice(0, 1))
    off = film.family.error(film.films, np.zeros(1, dtype=np.int64), at.q, np.array([film.force]),
                            at.squared, at.stiffness)
    return float(off[0] * at.stiffness[0])
