"""The best films for requirements, with margins for what scatters, checked by finite elements."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.units import DIMENSIONS, quantity_text
from tympan.studies.case import Case, Settings
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
from tympan.studies.design.scatter import (
    KeptByMost,
    ScatteredFilms,
    drawn,
    kept_by_most,
    missed_exactly,
    of_share,
)
from tympan.studies.design.search import KEPT, Search, value_of
from tympan.studies.design.space import DesignSpace
from tympan.studies.design.sqp import Descent
from tympan.studies.parallel import mapped
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
#: Designs of which is looked at what a bound that cannot be kept may be instead.
_EASED = 3
#: Rounds without a film that keeps all bounds before most of the films shall, whichever they are.
_IN_VAIN = 2
#: Factors between which the share that may fail each bound changes at once.
_LEVEL_STEP = (0.7, 1.4)
#: Times that a search goes on about a film at the edge of what reduced films know.
_BEYOND = 4
#: Ranges about such a film, as a share of those asked for.
_ABOUT = 0.3
#: Distance of the neighbours by which that is seen, as a share of the ranges.
_NEIGHBOUR = 0.02
#: By what share of itself the aim must get better there.
_BETTER = 1e-3
#: Quantities that are told of every film.
_TOLD = ("stroke", "blocked_force", "work", "frequency", TENSION, "voltage", "max_field",
         "max_true_stress", "gap")


@dataclass(frozen=True, eq=False)
class Sought:
    """End of the search, the margins it had, and the film by finite elements.

    ``off``: by what share of each bound reduced films are better than finite elements; ``priced``:
    what a share of each bound costs of the aim, (bounds,), where the search's end does not say.
    """

    search: Search
    end: Descent
    possible: bool
    exact: ExactFilm | None = None
    off: Mapping[str, float] = field(default_factory=dict)
    films: ScatteredFilms | None = None
    priced: Array | None = None

    @property
    def prices(self) -> Array:
        """Cost of a share of each bound, in the aim, (bounds,)."""
        if self.priced is not None:
            return self.priced
        multipliers = self.end.multipliers
        return np.zeros(len(self.search.bounds)) if multipliers is None else multipliers.limits

    @property
    def values(self) -> Array:
        """Values of the variables."""
        space = self.search.space
        return space.values(self.end.x[: len(space.variables)])

    @property
    def inner_ends(self) -> list[int]:
        """Variables at an end of their range that is none of those asked for."""
        space, multipliers = self.search.space, self.end.multipliers
        if multipliers is None:
            return []
        return [number for number, (own, asked, price) in enumerate(zip(
            space.variables, space.asked, multipliers.bounds.tolist(), strict=False))
            if price and (own.high < asked.high if price > 0 else own.low > asked.low)]

    @property
    def at_edge(self) -> bool:
        """Whether the search ended where reduced films know nothing more, at no bound."""
        if not (self.possible and self.search.best):
            return False
        if self.inner_ends or self.end.status != "no_progress":
            return bool(self.inner_ends)
        space = self.search.space
        x = self.end.x[: len(space.variables)]
        around = np.clip(x + _NEIGHBOUR * np.concatenate([np.eye(len(x)), -np.eye(len(x))]), 0, 1)
        return not space.films(space.values(around)).sound.all()

    @property
    def aim(self) -> float:
        """Quantity that was to be largest."""
        assert self.end.here is not None
        return self.end.here.value


@dataclass(frozen=True, eq=False)
class _Kind:
    """The best film of one kind as it is stored, its files, and the search's end for others."""

    film: DesignedFilm
    specimen: Specimen
    rig: Rig
    warnings: list[str]
    sought: Sought | None


def design(requirements: Requirements, settings: Settings = Settings(),
           progress: Callable[[str], None] = lambda words: None, workers: int = 1) -> DesignResult:
    """The best film of each kind; that a requirement cannot be met is a result, too.

    So many ``workers`` search kinds side by side, a process each.

    Raises
    ------
    InputError
        When no kind has a reduced film, or none bears its loads.
    """
    began = time.perf_counter()
    found, failed = list[_Kind](), list[FailedKind]()
    with closing(mapped(partial(_kind, requirements, settings), requirements.specimens,
                        min(workers, len(requirements.specimens)))) as kinds:
        for specimen in requirements.specimens:
            progress(specimen.name)
            kind = next(kinds)
            if isinstance(kind, _Kind):
                found.append(kind)
            else:
                failed.append(kind)
    if not found:
        raise InputError("has no film that bears its loads; " + failed[0].reason,
                         key="requirements", given=requirements.name)
    found.sort(key=lambda kind: (kind.film.status != "met", -kind.film.aim))
    films, specimens, rigs, warnings = [], {}, {}, list[str]()
    for number, kind in enumerate(found, start=1):
        name = f"{requirements.name}-{number}"
        film = replace(kind.film, specimen_file=f"{name}.toml", rig_file=f"{name}-rig.toml")
        films.append(film)
        specimens[film.specimen_file] = replace(kind.specimen, name=name)
        rigs[film.rig_file] = kind.rig
        warnings += [f"{film.specimen_file}: {words}" for words in kind.warnings]
    chosen, between = found[0].sought, None
    if requirements.front is not None and chosen is not None and chosen.possible:
        progress("front")
        size = len(chosen.search.space.variables)
        between = front(chosen.search, chosen.end.x[:size], requirements.front)
    return DesignResult(
        name=requirements.name, status=films[0].status, best=requirements.best,
        share=requirements.share, films=tuple(films), failed=tuple(failed),
        front=between, wall_s=time.perf_counter() - began, warnings=tuple(warnings),
        specimens=specimens, rigs=rigs)


def _kind(requirements: Requirements, settings: Settings, specimen: Specimen) -> _Kind | FailedKind:
    """The best film of one kind; if it is the only one and has none, the reason is raised."""
    try:
        sought = _sought(DesignSpace.of(requirements, specimen, settings), settings)
    except InputError as error:
        case = Case(specimen, mass=requirements.mass, voltage=requirements.voltage,
                    rig=requirements.rig)
        doubted = InputError(case.doubted(error.allowed), file=error.file, key=error.key,
                             given=error.given)
        if len(requirements.specimens) == 1:
            raise doubted from None
        return FailedKind(specimen=specimen.name, reason=str(doubted))
    # A process has a family's films to send where others are sought between them alone.
    space, values, exact = sought.search.space, sought.values, sought.exact
    assert exact is not None
    return _Kind(_film(sought, specimen), space.built(values), space.rig(values),
                 [*_edge(sought), *exact.warnings], None if requirements.front is None else sought)


def _edge(found: Sought) -> list[str]:
    """A warning where the search ended at the edge of what reduced films know."""
    if not found.at_edge:
        return []
    film = ", ".join(f"{each.key} = {quantity_text(value, each.dimension)}" for each, value in zip(
        found.search.space.asked, found.values.tolist(), strict=True))
    return [f"the search ended at the edge of what reduced films know, at {film}: beyond it a "
            "better film is possible. Search again with narrower ranges about this film"]


def _sought(space: DesignSpace, settings: Settings) -> Sought:
    """The best film of a space, with margins for what scatters and for what reduced films miss."""
    requirements = space.requirements
    search = Search(space, requirements.kept(space.specimen), requirements.best)
    found = _checked(_beyond(_settled(search, search.starts()), settings), settings)
    space = found.search.space
    failing, points = 1 - requirements.share, drawn(space, _DRAWN, 1) if space.scatter else None
    level, shifts, vain = _AIMED * failing, dict[str, float](), 0
    kept: Sought | None = None
    likely, most = found, -1.0
    for number in range(_ROUNDS):
        wanted, failed = dict(found.off), _AIMED
        if points is not None:
            films = ScatteredFilms.of(found.search, found.values, points)
            share = float(films.kept(wanted).mean())
            failed = (1 - share) / failing
            likely, most = (found, share) if share > most else (likely, most)
            shift = films.shifts(found.values, level)
            wanted = {key: value + shift.get(key, 0.0) for key, value in wanted.items()}
        change = max(abs(value - shifts.get(key, np.inf)) for key, value in wanted.items())
        few = _NEARLY[0] <= failed <= _NEARLY[1]
        many = points is not None and found.possible and failed > _NEARLY[1]
        if points is not None and found.possible and not many:
            kept = max(filter(None, [kept, found]), key=lambda each: each.aim)
        vain += not found.possible
        if (change < _SETTLED and not many) or (few and change < _NEAR) or vain > _IN_VAIN:
            break
        if found.possible and change < _NEAR and points is not None:
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
        found = _checked(found, settings)
    else:  # between films that call each for the margins of the other
        found = kept or found
    if points is None:
        return found
    if found.possible and (judged := _judged(found)).possible:
        return judged
    return _kept_by_most(likely, settings)


def _beyond(found: Sought, settings: Settings) -> Sought:
    """The best film, searched on where the search ended because no reduced film was known.

    Reduced films of narrower ranges about that film know more of its neighbours.
    """
    for _ in range(_BEYOND):
        if not found.at_edge:
            return found
        space, values = found.search.space, found.values
        about = tuple(replace(each, low=max(each.low, value - _ABOUT * (each.high - each.low)),
                              high=min(each.high, value + _ABOUT * (each.high - each.low)))
                      for each, value in zip(space.asked, values.tolist(), strict=True))
        try:
            closer = DesignSpace.of(space.requirements, space.specimen, settings, about)
            search = replace(found.search, space=closer)
            here = (values - closer.lows) / closer.widths
            again = _settled(search, np.concatenate([here[None], search.starts()]))
        except InputError:  # no family, or no film of it bears its loads
            return found
        if not again.possible or again.aim < found.aim + _BETTER * abs(found.aim):
            return found
        found = again
    return found


def _checked(found: Sought, settings: Settings) -> Sought:
    """The film with its finite elements, and what reduced films are off by these."""
    space, values, search = found.search.space, found.values, found.search
    requirements = space.requirements
    exact = ExactFilm(space.built(values), space.load(values), space.voltage(values),
                      space.rig(values), settings, requirements.margin)
    reduced = replace(search, shifts={}).missed(space.films(values[None]))[0]
    by_elements = missed_exactly(search, exact)
    off = by_elements - reduced if np.isfinite(by_elements).all() else np.zeros(len(reduced))
    return replace(found, exact=exact, off=dict(zip(search.bounds, off.tolist(), strict=True)))


def _judged(found: Sought) -> Sought:
    """The film with others about it, by which it is possible or not."""
    space = found.search.space
    films = ScatteredFilms.of(found.search, found.values, drawn(space, _JUDGED, 2))
    enough = chance(films.kept(found.off)).high >= space.requirements.share
    return replace(found, films=films, possible=found.possible and enough)


def _kept_by_most(found: Sought, settings: Settings) -> Sought:
    """The film most of whose copies keep all bounds, from one on; the best where enough do."""
    search, requirements = found.search, found.search.space.requirements
    share, off = requirements.share, found.off
    search = replace(search, best="", shifts={})
    x = found.end.x[: len(search.space.variables)]
    nearest = kept_by_most(search, off, share, KeptByMost(search, off, share, x).likeliest())
    if nearest is None:
        return _judged(found)
    tried = [nearest]
    _, end = nearest
    if requirements.best and end.status == "optimum" and value_of(end) >= 0:
        best = kept_by_most(replace(search, best=requirements.best), off,
                            1 - _AIMED * (1 - share), end.x)
        tried += [] if best is None else [best]
    for most, end in reversed(tried):
        film = Sought(most.search, end, end.status == "optimum", priced=most.prices(end))
        judged = _judged(_checked(film, settings))
        if judged.possible and judged.films is not None:  # others between it and more have margins
            shifts = judged.films.shifts(judged.values, 1 - share)
            return replace(judged, search=replace(judged.search, shifts=shifts))
    return judged


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


def _film(found: Sought, given: Specimen) -> DesignedFilm:
    """The film as it is stored, beside the given one."""
    space, values = found.search.space, found.values
    status: DesignStatus = "met" if found.possible else "impossible"
    reached = None
    if found.films is not None:
        reached = chance(found.films.kept(found.off))
    return DesignedFilm(
        specimen=space.specimen.name, status=status, specimen_file="", rig_file="",
        mass_kg=space.load(values), voltage_V=space.voltage(values), aim=found.aim,
        numbers=_numbers(found), quantities=tuple(_quantities(found, given)), reached=reached)


def _numbers(found: Sought) -> dict[str, DesignedNumber]:
    space, end = found.search.space, found.end
    numbers = {}
    for number, (each, value) in enumerate(zip(space.asked, found.values, strict=True)):
        low_side = end.x[number] < 0.5
        price = 0.0
        if end.multipliers is not None and number not in found.inner_ends:
            price = float(end.multipliers.bounds[number])
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


def _quantities(found: Sought, given: Specimen) -> list[DesignedQuantity]:
    search, exact = found.search, found.exact
    assert exact is not None
    now = replace(exact, specimen=given) if search.space.hold(given) else None
    prices = found.prices
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
            reduced=_one(quantity.of(reduced)), reached=_reached(found, key),
            given=None if now is None else _one(quantity.of(now)), binding=price > 0,
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
    value = of_share(values, share, gain=quantity.gain)
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
    """The best bound that could be kept with all others."""
    search, quantity = found.search, QUANTITIES[key]
    if key == TENSION:
        return None
    space, size = search.space, len(search.space.variables)
    sign, missed = 1 if quantity.gain else -1, found.off[key] * search.bounds[key]
    others = {other: bound for other, bound in search.bounds.items() if other != key}
    alone = replace(search, bounds=others, best=key)
    starts = np.concatenate([found.end.x[None, :size], alone.starts()])
    if found.films is None or not quantity.scatters:
        ended = alone.found(starts)
        if ended is None or ended.status == "infeasible":
            return None
        value = float(quantity.of(space.films(space.values(ended.x)[None]))[0])
        return value - sign * missed
    share, points, values = space.requirements.share, drawn(space, _DRAWN, 1), found.values
    reached = list[float]()
    for _ in range(_EASED):
        films = ScatteredFilms.of(search, values, points)
        attained = films.attained(key, found.off, share)
        reached += [] if attained is None else [attained - sign * missed]
        # Half of the films that may fail do so by each of the other bounds.
        shifts = films.shifts(values, (1 - share) / 2)
        ended = replace(alone, shifts={other: shifts.get(other, 0.0) + found.off[other]
                                       for other in others}).found(starts)
        if ended is None or ended.status == "infeasible":
            break
        starts, values = ended.x[None], space.values(ended.x)
    return max(reached, key=lambda value: sign * value, default=None)
