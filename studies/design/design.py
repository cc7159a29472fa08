"""The best films for requirements, with margins for what scatters, checked by finite elements."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.units import DIMENSIONS
from tympan.studies.case import Settings
from tympan.studies.design.exact import ExactFilm
from tympan.studies.design.front import front
from tympan.studies.design.quantities import QUANTITIES, TENSION
from tympan.studies.design.requirements import Requirements
from tympan.studies.design.result import (
    DesignedFilm,
    DesignedNumber,
    DesignedQuantity,
    DesignResult,
    DesignStatus,
    FailedKind,
)
from tympan.studies.design.scatter import ScatteredFilms, missed_exactly
from tympan.studies.design.search import KEPT, Search
from tympan.studies.design.space import DesignSpace
from tympan.studies.design.sqp import Descent
from tympan.studies.tolerance.tolerance import chance

Array = NDArray[Any]

#: Films by which margins are set: 26 of them lie beyond the 5 % quantile.
_DRAWN = 512
#: Films by which they are judged at the end, within some 0.5 % of all films.
_JUDGED = 2048
#: Times that margins are set at most; usually four do.
_ROUNDS = 12
#: Change of a margin that is none any more, as a share of its bound.
_SETTLED = 1e-3
#: Change from which on it is looked at how many films fail: margins still move by less.
_NEAR = 2e-2
#: Share of the allowed failing films that is aimed at, so that those drawn last do not exceed them.
_AIMED = 0.9
#: Shares of the allowed failing films between which the margins stay as they are.
_NEARLY = (0.75, 0.96)
#: Change of a bound for which it is told what it costs.
_RELAXED = 0.01
#: Rounds after which margins go half the way: two films may call each for the margins of the other.
_DAMPED = 3
#: Factors between which the share that may fail each bound changes at once.
_LEVEL_STEP = (0.7, 1.4)
#: Quantities that are told of every film.
_TOLD = ("stroke", "blocked_force", "work", "frequency", TENSION, "voltage", "max_field",
         "max_true_stress", "gap")


@dataclass(frozen=True, eq=False)
class Sought:
    """End of the search, the margins it had, and the film by finite elements.

    ``off``: by what share of each bound reduced films are better than finite elements.
    """

    search: Search
    end: Descent
    possible: bool
    exact: ExactFilm | None = None
    off: Mapping[str, float] | None = None
    films: ScatteredFilms | None = None

    @property
    def values(self) -> Array:
        """Values of the variables."""
        space = self.search.space
        return space.values(self.end.x[: len(space.variables)])

    @property
    def aim(self) -> float:
        """Quantity that was to be largest."""
        assert self.end.here is not None
        return self.end.here.value


def design(requirements: Requirements, settings: Settings = Settings(),
           progress: Callable[[str], None] = lambda words: None) -> DesignResult:
    """The best film of each kind; that a requirement cannot be met is a result, too.

    Raises
    ------
    InputError
        When no kind has a reduced film, or none bears its loads.
    """
    began = time.perf_counter()
    found: list[tuple[Sought, DesignedFilm]] = []
    failed: list[FailedKind] = []
    for specimen in requirements.specimens:
        progress(specimen.name)
        try:
            space = DesignSpace.of(requirements, specimen, settings)
            sought = _sought(space, settings)
        except InputError as error:
            if len(requirements.specimens) == 1:
                raise
            failed.append(FailedKind(specimen=specimen.name, reason=str(error)))
            continue
        found.append((sought, _film(sought)))
    if not found:
        raise InputError("has no film that bears its loads; " + failed[0].reason,
                         key="requirements", given=requirements.name)
    found.sort(key=lambda pair: (not pair[0].possible, -pair[0].aim))
    films, specimens, rigs = [], {}, {}
    for number, (sought, film) in enumerate(found, start=1):
        name = f"{requirements.name}-{number}"
        film = replace(film, specimen_file=f"{name}.toml", rig_file=f"{name}-rig.toml")
        films.append(film)
        made = sought.search.space.built(sought.values)
        specimens[film.specimen_file] = replace(made, name=name)
        rigs[film.rig_file] = requirements.rig
    chosen, between = found[0][0], None
    if requirements.front is not None and chosen.possible:
        progress("front")
        size = len(chosen.search.space.variables)
        between = front(chosen.search, chosen.end.x[:size], requirements.front)
    return DesignResult(
        name=requirements.name, status=films[0].status, best=requirements.best,
        share=requirements.share, films=tuple(films), failed=tuple(failed),
        front=between, wall_s=time.perf_counter() - began, specimens=specimens, rigs=rigs)


def _sought(space: DesignSpace, settings: Settings) -> Sought:
    """The best film of a space, with margins for what scatters and for what reduced films miss."""
    requirements = space.requirements
    search = Search(space, requirements.kept(space.specimen), requirements.best)
    found = _settled(search, search.starts())
    failing = 1 - requirements.share
    level, shifts = _AIMED * failing, dict[str, float]()
    films: ScatteredFilms | None = None
    exact = _exact(found, settings)
    kept: tuple[Sought, ExactFilm] | None = None
    for number in range(_ROUNDS):
        wanted, failed = _off(found, exact), _AIMED
        if space.scatter:
            films = ScatteredFilms.of(found.search, found.values, _DRAWN, 1)
            failed = (1 - films.kept(wanted).mean()) / failing
            wanted = {key: value + wanted[key] for key, value in films.shifts(level).items()}
        change = max(abs(value - shifts.get(key, np.inf)) for key, value in wanted.items())
        few = _NEARLY[0] <= failed <= _NEARLY[1]
        many = films is not None and found.possible and failed > _NEARLY[1]
        if films is not None and found.possible and not many:
            kept = max(filter(None, [kept, (found, exact)]), key=lambda pair: pair[0].aim)
        if (change < _SETTLED and not many) or (few and change < _NEAR):
            break
        if found.possible and change < _NEAR and films is not None:
            level = min(failing, level * float(np.clip(_AIMED / failed, *_LEVEL_STEP)))
        if number >= _DAMPED:
            wanted = {key: (value + shifts[key]) / 2 for key, value in wanted.items()}
        shifts, before = wanted, found
        size = len(space.variables)
        found = _settled(replace(found.search, best=requirements.best, shifts=shifts),
                         found.end.x[None, :size])
        if level < _AIMED * failing and before.possible and not found.possible:
            found = before
            break
        exact = _exact(found, settings)
    else:  # between films that call each for the margins of the other
        found, exact = kept or (found, exact)
    off = _off(found, exact)
    if space.scatter:
        films = ScatteredFilms.of(found.search, found.values, _JUDGED, 2)
        found = replace(found, possible=found.possible
                        and chance(films.kept(off)).high >= requirements.share)
    return replace(found, exact=exact, off=off, films=films)


def _settled(search: Search, starts: Array) -> Sought:
    """The best film from some starts; where none keeps all bounds, that which nearly does."""
    if search.best:
        end = search.found(starts)
        if end is not None and end.status != "infeasible":
            return Sought(search, end, possible=True)
    common = replace(search, best="")
    end = common.found(common.starts() if search.best else starts)
    if end is None or end.here is None:
        raise InputError("has no film in the ranges of [vary] that bears its load and voltage",
                         key="vary", given=search.space.specimen.name)
    possible = end.here.value >= -KEPT
    if not (possible and search.best):
        return Sought(common, end, possible)
    best = search.from_start(end.x[:-1])
    return Sought(search, best, possible=best.here is not None and best.status != "infeasible")


def _exact(found: Sought, settings: Settings) -> ExactFilm:
    """The film without scatter, by finite elements."""
    space, values = found.search.space, found.values
    requirements = space.requirements
    return ExactFilm(space.built(values), space.load(values), space.voltage(values),
                     requirements.rig, settings, requirements.margin)


def _off(found: Sought, exact: ExactFilm) -> dict[str, float]:
    """Share of each bound by which reduced films are better than finite elements."""
    search = found.search
    bare = replace(search, shifts={})
    reduced = bare.missed(search.space.films(found.values[None]))[0]
    by_elements = missed_exactly(search, exact)
    if not np.isfinite(by_elements).all():
        return dict.fromkeys(search.bounds, 0.0)
    return dict(zip(search.bounds, (by_elements - reduced).tolist(), strict=True))


def _film(found: Sought) -> DesignedFilm:
    """The film as it is stored."""
    space, values, exact = found.search.space, found.values, found.exact
    assert exact is not None
    status: DesignStatus = "met" if found.possible else "impossible"
    reached = None
    if found.films is not None:
        reached = chance(found.films.kept(found.off or {}))
    return DesignedFilm(
        specimen=space.specimen.name, status=status, specimen_file="", rig_file="",
        mass_kg=space.load(values), voltage_V=space.voltage(values), aim=found.aim,
        numbers=_numbers(found), quantities=tuple(_quantities(found)), reached=reached)


def _numbers(found: Sought) -> dict[str, DesignedNumber]:
    space, end = found.search.space, found.end
    numbers = {}
    for number, (each, value) in enumerate(zip(space.variables, found.values, strict=True)):
        low_side = end.x[number] < 0.5
        price = 0.0 if end.multipliers is None else float(end.multipliers.bounds[number])
        bound = each.low if low_side else each.high
        share = _RELAXED * abs(bound) / (each.high - each.low)
        at_bound = bool(price)
        numbers[each.key] = DesignedNumber(
            value=float(value), low=each.low, high=each.high,
            unit=DIMENSIONS[each.dimension].si if each.dimension else "1", at_bound=at_bound,
            relaxing=abs(price) * share / _scale(found) if at_bound else None)
    return numbers


def _scale(found: Sought) -> float:
    """Scale of which a gain of the aim is a share: the best quantity, or one."""
    return abs(found.aim) if found.search.best else 1.0


def _quantities(found: Sought) -> list[DesignedQuantity]:
    search, exact = found.search, found.exact
    assert exact is not None
    prices = np.zeros(len(search.bounds))
    if found.end.multipliers is not None:
        prices = found.end.multipliers.limits
    keys = dict.fromkeys((*search.bounds, *_TOLD, *filter(None, [search.space.requirements.best]),
                          *(search.space.requirements.front or ())))
    reduced = search.space.films(found.values[None])
    told = []
    for key in QUANTITIES:
        if key not in keys:
            continue
        quantity = QUANTITIES[key]
        price = 0.0
        if key in search.bounds:
            price = float(prices[list(search.bounds).index(key)])
        told.append(DesignedQuantity(
            name=key, unit=quantity.unit, sense="at least" if quantity.gain else "at most",
            bound=search.bounds.get(key), value=_one(quantity.of(exact)),
            reduced=_one(quantity.of(reduced)), reached=_reached(found, key), binding=price > 0,
            relaxing=price * _eased(found, key) / _scale(found) if price > 0 else None,
            attainable=_attainable(found, key) if price > 0 and not found.possible else None))
    return told


def _one(values: Array) -> float | None:
    value = float(values[0])
    return value if np.isfinite(value) else None


def _reached(found: Sought, key: str) -> float | None:
    """Value of a quantity that the share of the films reach."""
    quantity, share = QUANTITIES[key], found.search.space.requirements.share
    if found.films is None or not quantity.scatters or key == TENSION:
        return None
    values = quantity.of(found.films.films)
    if not np.isfinite(values).any():
        return None
    values = np.where(np.isfinite(values), values, 0.0 if quantity.gain else np.inf)
    value = float(np.quantile(values, 1 - share if quantity.gain else share))
    return value if np.isfinite(value) else None


def _eased(found: Sought, key: str) -> float:
    """Fall of c where a bound is relaxed by 1 %."""
    if key != TENSION:
        return _RELAXED
    space = found.search.space
    eased_margin = (1 - _RELAXED) * space.requirements.margin
    bounds = {**space.requirements.bounds, TENSION: eased_margin}
    eased = replace(space, requirements=replace(space.requirements, bounds=bounds))
    c = [float(Search(each, {TENSION: 1.0}, "").missed(each.films(found.values[None]))[0, 0])
         for each in (space, eased)]
    return c[0] - c[1]


def _attainable(found: Sought, key: str) -> float | None:
    """The best bound that could be kept with all others, with the same margins."""
    search = found.search
    if key == TENSION:
        return None
    others = {other: bound for other, bound in search.bounds.items() if other != key}
    alone = replace(search, bounds=others, best=key)
    ended = _settled_best(alone, found.end.x[: len(search.space.variables)])
    if ended is None:
        return None
    values = search.space.values(ended.x)
    value = float(QUANTITIES[key].of(search.space.films(values[None]))[0])
    shift = search.shifts.get(key, 0.0) * search.bounds[key]
    return value - shift if QUANTITIES[key].gain else value + shift


def _settled_best(search: Search, x: Array) -> Descent | None:
    """End of a search from a place and random ones; None where no film keeps its bounds."""
    end = search.found(np.concatenate([x[None], search.starts()]))
    return None if end is None or end.status == "infeasible" else end
