"""A film of a family as its voltage rises, to its first limits, in some milliseconds.

The plate's deflection is given and the voltage sought, at a dozen deflections at once. So the way
passes the pull-in, where the voltage is largest, and finds it like any other place.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from tympan.studies.case import LimitKind
from tympan.studies.films.family import FilmFamily
from tympan.studies.films.many_films import Films, Local

Array = NDArray[Any]

#: Deflections from the film at rest to the end of the family's voltages. Limits between them are
#: then interpolated to 1e-4, and found to more.
_POINTS = 16
#: How many are computed at a time, until the film has ended: most of them are not needed then.
_AT_ONCE = 8
#: Points about a limit through which numbers are interpolated.
_ABOUT = 3
#: How often states are sought from those before, where a guess has led to none.
_CLOSER = 6
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


@dataclass(frozen=True, eq=False)
class _Way:
    """States on the way, and what they are at the family's places."""

    q: Array
    squared: Array
    stiffness: Array
    sound: NDArray[np.bool_]
    here: Local

    @property
    def there(self) -> NDArray[np.bool_]:
        """Mask of equilibria that are firm everywhere and within the law's range."""
        return np.asarray(self.sound & self.here.sound.all(1))

    @property
    def tension(self) -> Array:
        """Least tension of each [Pa]."""
        return np.asarray(self.here.stress_2.min(1))

    @property
    def unbroken(self) -> Array:
        """1 less the largest share of the strength, of each."""
        return np.asarray(1 - self.here.share.max(1))


def rise(family: FilmFamily, row: Array, force: float) -> FamilyRise | None:
    """A film with these parameters, (names,), under a force on its plate [N].

    None where the family does not hold it at rest, or a voltage does not move its plate.
    """
    rows = row[None]
    films, scaled = family.films(rows), family.box.scaled(rows)
    low, high = family.force
    if not (family.box.holds(rows)[0] and low <= force <= high):
        return None
    one = np.zeros(1, dtype=np.int64)
    rest = family.guess.balanced(films, scaled, one, np.array([force]), np.zeros(1))
    if not rest.sound[0]:
        return None
    share = np.linspace(0.0, 1.0, _POINTS + 1)
    squared = family.voltage[1] ** 2 * share
    guess = family.guess.at(scaled[0], force, squared)
    first, last = rest.q[0, 0], guess[:, 0].max()
    if not last > first:
        return None
    # Voltages move the plate by more and more.
    y = first + (last - first) * share * (1 + share) / 2
    squared = np.interp(y, np.maximum.accumulate(guess[:, 0]), squared)
    guess = family.guess.at(scaled[0], force, squared)
    guess += (1 - share)[:, None] * (rest.q[0] - guess[0])
    parts: list[_Way] = []
    while not parts or (_goes_on(parts[-1]) and len(parts) * _AT_ONCE < len(y)):
        part = slice(len(parts) * _AT_ONCE, (len(parts) + 1) * _AT_ONCE)
        parts.append(_way(family, films, force, y[part], squared[part], guess[part]))
    way, lost = _sure(_joined(*parts))
    if len(way.q) < _ABOUT:
        return None
    if lost:  # by a bad guess: on from the states before
        step = way.q[-1, 0] - way.q[-2, 0]
        for _ in range(_CLOSER):
            if _ended(way) or way.squared[-1] > family.voltage[1] ** 2:
                break
            ahead = way.q[-1, 0] + step * np.array([1.0, 2.0])
            near = _followed(way)(ahead)
            way, lost = _sure(_joined(way, _way(family, films, force, ahead, near[:, 0],
                                                near[:, 1:])))
            step = step / 2 if lost else step
    return _to_end(family, films, force, way)


def _goes_on(way: _Way) -> bool:
    """Whether a film is there all the way, and has no end yet."""
    return bool(way.there.all() and not _ended(way))


def _ended(way: _Way) -> bool:
    """Whether it loses tension on the way, or its voltage falls."""
    return bool((way.tension <= 0).any() or (np.diff(way.squared) < 0).any())


def _sure(way: _Way) -> tuple[_Way, bool]:
    """The way up to the first state that is not there, and whether there is such a one."""
    if way.there.all():
        return way, False
    return _some(way, slice(0, int(np.argmin(way.there)))), True


def _followed(way: _Way) -> CubicSpline:
    """U² and states by deflection, (1 + shapes)."""
    return CubicSpline(way.q[:, 0], np.column_stack([way.squared, way.q]))


def _way(family: FilmFamily, films: Films, force: float, deflections: Array, squared: Array,
         guess: Array) -> _Way:
    """States at deflections from guesses of U² and of states."""
    number = np.zeros(len(guess), dtype=np.int64)
    balance, squared = films.charged(number, np.full(len(guess), force), deflections, squared,
                                     guess)
    with np.errstate(all="ignore"):
        here = films.local(films.at(family.looked_at), number, balance.q, squared)
    return _Way(balance.q, squared, balance.stiffness, balance.sound, here)


def _joined(*ways: _Way) -> _Way:
    """States of several, one after the other."""
    def join(parts: list[Any]) -> Any:
        if isinstance(parts[0], Local):
            return Local(*(np.concatenate([getattr(part, item.name) for part in parts])
                           for item in fields(Local)))
        return np.concatenate(parts)

    return _Way(*(join([getattr(way, item.name) for way in ways]) for item in fields(_Way)))


def _some(way: _Way, chosen: Any) -> _Way:
    """Some of the states, in this order."""
    here = Local(*(getattr(way.here, item.name)[chosen] for item in fields(Local)))
    return _Way(way.q[chosen], way.squared[chosen], way.stiffness[chosen], way.sound[chosen], here)


def _to_end(family: FilmFamily, films: Films, force: float, way: _Way) -> FamilyRise | None:
    """The way to the first of tension lost and pull-in, or as far as states are there."""
    y, path = way.q[:, 0], _followed(way)
    slope = CubicSpline(y, path(y, 1)[:, 0])
    signs: dict[LimitKind, CubicSpline] = {
        "tension": _near(y, way.tension), "breakdown": _near(y, way.unbroken), "pull_in": slope}
    crossed = {kind: place for kind, sign in signs.items()
               if (place := _crossing(y, sign)) is not None}
    end = min((place for kind, place in crossed.items() if kind != "breakdown"),
              default=float(y[-1]))
    crossed = {kind: place for kind, place in crossed.items() if place <= end}
    before = _some(way, (y < end) | (y == y[0])) if crossed else way
    off = _force_error(family, films, force, before)
    limits = dict[LimitKind, FamilyLimit]()
    along = before
    if crossed:
        places = np.array([*crossed.values()])
        near = path(places)
        met = _way(family, films, force, places, near[:, 0], near[:, 1:])
        if not met.sound.all():
            return None
        along = _joined(before, met)
        # The force of a held plate falls with U² as it rises with the deflection along the way.
        wide = abs((before.squared[-1] - before.squared[0])
                   / np.trapezoid(before.stiffness, before.q[:, 0]))
        for number, (kind, place) in enumerate(crossed.items()):
            scale = {"tension": met.here.stress_1[number].max(), "breakdown": 1.0}.get(kind, 0.0)
            local = _LOCAL * scale / abs(float(signs[kind](place, 1))) if scale else 0.0
            limits[kind] = FamilyLimit(
                float(met.squared[number]), off * wide + local * abs(float(slope(place))),
                *_place(family, films, kind, met, number))
    along = _some(along, np.argsort(along.q[:, 0]))
    along.squared[0] = 0.0  # by what rounding leaves
    return FamilyRise(along.q[:, 0], along.squared, along.stiffness, limits, "pull_in" in crossed,
                      off, along.q[0])


def _near(y: Array, values: Array) -> CubicSpline:
    """Values about where they become negative: they have a kink where another place is least."""
    after = int(np.argmax(values <= 0)) if (values <= 0).any() else len(y) - 1
    near = slice(max(0, after - _ABOUT), after + _ABOUT)
    return CubicSpline(y[near], values[near])


def _crossing(y: Array, sign: CubicSpline) -> float | None:
    """Deflection at which a number first becomes negative; None where it does not."""
    inside = y[(y >= sign.x[0]) & (y <= sign.x[-1])]
    below = sign(inside) <= 0
    if below[0] or not below.any():
        return None
    after = int(np.argmax(below))
    return float(brentq(sign, inside[after - 1], inside[after]))


def _place(family: FilmFamily, films: Films, kind: str, met: _Way, number: int
           ) -> tuple[float, float]:
    """Place at which a limit begins: of a pull-in, where the film is thinnest."""
    here = met.here
    worst = {"tension": -here.stress_2, "breakdown": here.share,
             "pull_in": here.stretch_1 * here.stretch_2}[kind][number]
    x, y = family.places.at(films.nodes)[0, int(np.argmax(worst))]
    return float(x), float(y)


def _force_error(family: FilmFamily, films: Films, force: float, way: _Way) -> float:
    """Error of forces on the plate [N]."""
    stiff = np.flatnonzero(way.stiffness >= _STIFF * way.stiffness[0])
    at = stiff[-1:] if len(stiff) else np.zeros(1, dtype=np.int64)
    off = family.error(films, np.zeros(1, dtype=np.int64), way.q[at], np.array([force]),
                       way.squared[at], way.stiffness[at])
    return float(off[0] * way.stiffness[at][0])
