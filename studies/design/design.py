"""The best films for requirements, with margins for what scatters, checked by finite elements."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.points import drawn_points
from tympan.base.progress import Progress
from tympan.base.units import DIMENSIONS, quantity_text
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings
from tympan.studies.design.exact import ExactFilm
from tympan.studies.design.front import front
from tympan.studies.design.relaxed import RELAXED, Relaxed, attained, ends_at, gain_of
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
    kept_by_most,
    missed_exactly,
    of_share,
)
from tympan.studies.design.search import KEPT, Search, common_share, value_of
from tympan.studies.design.space import DesignSpace
from tympan.studies.design.sqp import Descent
from tympan.studies.parallel import mapped
from tympan.studies.tolerance.result import Chance, FilmFailure
from tympan.studies.wanted import QUANTITIES, TENSION, Quantity

#: Films by which margins are set: 26 of them lie beyond the 5 % quantile.
_DRAWN = 512
#: Films by which they are judged at the end, within some 0.5 % of all films.
_JUDGED = 2048
#: Times that margins are set at most; usually four do.
_ROUNDS = 12
#: Change of a margin that counts as none, as a share of its bound.
_SETTLED = 1e-3
#: Change from which on it is looked at how many films fail: margins still move by less.
_NEAR = 2e-2
#: Share of the allowed failing films that is aimed at, so that those drawn last do not exceed them.
_AIMED = 0.9
#: Shares of the allowed failing films between which the margins stay as they are.
_NEARLY = (0.75, 0.96)
#: Rounds after which margins go half the way: two films may call each for the margins of the other.
_DAMPED = 3
#: Rounds without a film that keeps all bounds before most of the films shall, whichever they are.
_IN_VAIN = 2
#: Factors between which the share that may fail each bound changes at once.
_LEVEL_STEP = (0.7, 1.4)
#: Times that a search goes on about a film at the edge of what reduced films know.
_BEYOND = 4
#: Ranges about such a film, as a share of those asked for.
_ABOUT = 0.3
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
    ``relaxed``: weaker bounds, each of which alone would do, by the keys of those they replace.
    """

    search: Search
    end: Descent
    possible: bool
    exact: ExactFilm | None = None
    off: Mapping[str, float] = field(default_factory=dict)
    films: ScatteredFilms | None = None
    priced: Array | None = None
    relaxed: Mapping[str, Relaxed] = field(default_factory=dict)

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
        return not ends_at(self.search.space, self.end.x).known

    @property
    def aim(self) -> float:
        """Quantity that was to be largest."""
        assert self.end.here is not None
        return self.end.here.value if self.search.best else common_share(self.end)


@dataclass(frozen=True, eq=False)
class _Kind:
    """The best film of one kind as it is stored, its files, and the search's end for others."""

    film: DesignedFilm
    specimen: Specimen
    rig: Rig
    warnings: list[str]
    sought: Sought | None


def design(requirements: Requirements, settings: Settings = Settings(),
           progress: Progress = lambda words: None, workers: int = 1) -> DesignResult:
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
        sought = sought_in(DesignSpace.of(requirements, specimen, settings), settings)
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
    return _Kind(designed_film(sought, specimen), space.built(values), space.rig(values),
                 [*_edge(sought), *exact.warnings], None if requirements.front is None else sought)


def _edge(found: Sought) -> list[str]:
    """A warning where the search ended at the edge of what reduced films know."""
    if not found.at_edge:
        return []
    film = ", ".join(f"{each.key} = {quantity_text(value, each.dimension)}" for each, value in zip(
        found.search.space.asked, found.values.tolist(), strict=True))
    return [f"the search ended at the edge of what reduced films know, at {film}: beyond it a "
            "better film is possible. Search again with narrower ranges about this film"]


def sought_in(space: DesignSpace, settings: Settings) -> Sought:
    """The best film of a space; where none keeps all bounds, the nearest and what could be kept."""
    requirements = space.requirements
    search = Search(space, requirements.kept(space.specimen), requirements.best)
    found = _beyond(_settled(search, search.starts()), settings)
    found = _with_margins(_checked(found, settings), settings)
    return found if found.possible else _relaxed(found, settings)


def _relaxed(found: Sought, settings: Settings) -> Sought:
    """The nearest film with what each bound that binds may be instead, all others kept.

    Where that is no weaker than what was asked for, there is a film that keeps all bounds, after
    all: the search goes on from it, and nothing is said where it does not keep them at the end.
    """
    relaxed = dict[str, Relaxed]()
    for (key, bound), price in zip(found.search.bounds.items(), found.prices, strict=True):
        if not price > 0 or key == TENSION:
            continue
        best = attained(found.search, bound, found.end.x, found.off, found.films is not None)
        if best is None:
            continue
        weaker = bound.relaxed_to(best.value)
        if weaker is not None:
            relaxed[key] = Relaxed(weaker, ends_at(found.search.space, best.x))
        elif bound.kept_by(best.value):
            again = _from(found, best.x, settings)
            if again.possible:
                return again
    return replace(found, relaxed=relaxed)


def _from(found: Sought, x: Array, settings: Settings) -> Sought:
    """The best film from one at shares x of the ranges that seems to keep all bounds."""
    if found.films is not None:
        return _kept_by_most(replace(found, end=replace(found.end, x=x)), settings)
    best = found.search.space.requirements.best
    again = _settled(replace(found.search, best=best), x[None])
    return _with_margins(_checked(again, settings), settings)


@dataclass(frozen=True, eq=False)
class _Margins:
    """A film and the margins by which it was found, on the way to a film that suits its margins.

    ``level``: share of the films that may fail each bound; ``shifts``: the margins; ``points`` of
    the films about each design, None where nothing scatters. Of the rounds before: their count,
    those in ``vain``, the best film ``kept`` by enough of its copies, and the ``likely`` one, which
    the ``most`` of its copies keep.
    """

    found: Sought
    points: Array | None
    level: float
    likely: Sought
    shifts: Mapping[str, float] = field(default_factory=dict)
    count: int = 0
    vain: int = 0
    kept: Sought | None = None
    most: float = -1.0

    @classmethod
    def of(cls, found: Sought) -> Self:
        """The first round, from a film without margins."""
        space = found.search.space
        points = drawn_points(space.inputs, _DRAWN, 1) if space.scatter else None
        return cls(found, points, _AIMED * (1 - space.requirements.share), found)

    @property
    def failing(self) -> float:
        """Share of the films that may fail."""
        return 1 - self.found.search.space.requirements.share

    @cached_property
    def films(self) -> ScatteredFilms | None:
        """Films that scatter about this one."""
        if self.points is None:
            return None
        return ScatteredFilms.of(self.found.search, self.found.values, self.points)

    @cached_property
    def share(self) -> float:
        """Share of these films that keep all bounds."""
        return 1.0 if self.films is None else float(self.films.kept(self.found.off).mean())

    @property
    def failed(self) -> float:
        """Share that fails over the one that may; where nothing scatters that which is aimed at."""
        return _AIMED if self.films is None else (1 - self.share) / self.failing

    @cached_property
    def wanted(self) -> dict[str, float]:
        """Margins that suit this film."""
        shifts = {} if self.films is None else self.films.shifts(self.found.values, self.level)
        return {key: value + shifts.get(key, 0.0) for key, value in self.found.off.items()}

    @property
    def change(self) -> float:
        """Largest change of a margin from those by which the film was found."""
        return max(abs(value - self.shifts.get(key, np.inf)) for key, value in self.wanted.items())

    @property
    def many(self) -> bool:
        """Whether too many copies of a film that keeps all bounds fail."""
        return self.films is not None and self.found.possible and self.failed > _NEARLY[1]

    @property
    def in_vain(self) -> int:
        """Rounds without a film that keeps all bounds."""
        return self.vain + (not self.found.possible)

    @property
    def settled(self) -> bool:
        """Whether the margins suit the film, or no film is found with any."""
        few = _NEARLY[0] <= self.failed <= _NEARLY[1]
        return ((self.change < _SETTLED and not self.many) or (few and self.change < _NEAR)
                or self.in_vain > _IN_VAIN)

    @property
    def best(self) -> Sought | None:
        """The best film up to here that enough of its copies keep."""
        if self.films is None or not self.found.possible or self.many:
            return self.kept
        return max(filter(None, [self.kept, self.found]), key=lambda each: each.aim)

    @property
    def likeliest(self) -> Sought:
        """The film up to here that most of its copies keep."""
        return self.found if self.films is not None and self.share > self.most else self.likely

    def next(self, settings: Settings) -> Self | None:
        """Search on with margins that suit this film; None where they are too wide for any."""
        space, level, shifts = self.found.search.space, self.level, self.wanted
        if self.found.possible and self.change < _NEAR and self.films is not None:
            step = float(np.clip(_AIMED / self.failed, *_LEVEL_STEP))
            level = min(self.failing, level * step)
        if self.count >= _DAMPED:
            shifts = {key: (value + self.shifts[key]) / 2 for key, value in shifts.items()}
        search = replace(self.found.search, best=space.requirements.best, shifts=shifts)
        found = _settled(search, self.found.end.x[None, :len(space.variables)])
        wide = level < _AIMED * self.failing
        if wide and self.found.possible and not found.possible:
            return None
        most = self.most if self.films is None else max(self.share, self.most)
        return replace(self, found=_checked(found, settings), level=level, shifts=shifts,
                       count=self.count + 1, vain=self.in_vain, kept=self.best,
                       likely=self.likeliest, most=most)


def _with_margins(found: Sought, settings: Settings) -> Sought:
    """A film with margins for what scatters and for what reduced films miss."""
    here = _Margins.of(found)
    while here.count < _ROUNDS and not here.settled:
        after = here.next(settings)
        if after is None:
            break
        here = after
    film, likely = here.found, here.likely
    if here.count == _ROUNDS:  # between films that call each for the margins of the other
        film = here.kept or film
    else:
        likely = here.likeliest
    if here.points is None:
        return film
    if film.possible and (judged := _judged(film)).possible:
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
    exact = space.exact(values, settings)
    reduced = replace(search, shifts={}).missed(space.films(values[None]))[0]
    by_elements = missed_exactly(search, exact)
    off = by_elements - reduced if np.isfinite(by_elements).all() else np.zeros(len(reduced))
    return replace(found, exact=exact, off=dict(zip(search.bounds, off.tolist(), strict=True)))


def _judged(found: Sought) -> Sought:
    """The film with others about it, by which it is possible or not."""
    space = found.search.space
    films = ScatteredFilms.of(found.search, found.values, drawn_points(space.inputs, _JUDGED, 2))
    enough = Chance.of(films.kept(found.off)).high >= space.requirements.share
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
    possible = common_share(end) >= -KEPT
    if not (possible and search.best):
        return Sought(common, end, possible)
    best = search.from_start(end.x[:-1])
    return Sought(search, best, possible=best.here is not None and best.status != "infeasible")


def designed_film(found: Sought, given: Specimen) -> DesignedFilm:
    """The film as it is stored, beside the given one."""
    space, values = found.search.space, found.values
    status: DesignStatus = "met" if found.possible else "impossible"
    reached, fails = None, tuple[FilmFailure, ...]()
    if found.films is not None:
        reached = Chance.of(found.films.kept(found.off))
        fails = FilmFailure.of(found.films.films, found.films.lost, space.voltage(values))
    return DesignedFilm(
        specimen=space.specimen.name, status=status, specimen_file="", rig_file="",
        mass_kg=space.load(values), voltage_V=space.voltage(values), aim=found.aim,
        numbers=_numbers(found), quantities=tuple(_quantities(found, given)), reached=reached,
        fails=fails)


def _numbers(found: Sought) -> dict[str, DesignedNumber]:
    space, end = found.search.space, found.end
    ends = ends_at(space, end.x)
    numbers = {}
    for number, (each, value) in enumerate(zip(space.asked, found.values, strict=True)):
        price = 0.0
        if end.multipliers is not None and number not in found.inner_ends:
            price = float(end.multipliers.bounds[number])
        bound = each.low if end.x[number] < 0.5 else each.high
        # A range whose end is 0 is no wider by a share of that.
        share = RELAXED * abs(bound) / (each.high - each.low)
        kind = ends.numbers.get(each.key)
        numbers[each.key] = DesignedNumber(
            value=float(value), low=each.low, high=each.high,
            unit=DIMENSIONS[each.dimension].si if each.dimension else "1",
            end="range" if price else kind,
            relaxing=abs(price) * share / _scale(found) if price and share else None)
    return numbers


def _scale(found: Sought) -> float:
    """Scale of which a gain of the aim is a share: the best quantity, or one."""
    return abs(found.aim) if found.search.best else 1.0


def _quantities(found: Sought, given: Specimen) -> list[DesignedQuantity]:
    """Numbers of a film: of all bounds, and of quantities without one."""
    search, exact = found.search, found.exact
    assert exact is not None
    now = replace(exact, specimen=given) if search.space.hold(given) else None
    films = search.space.films(found.values[None]), exact, now
    bounded = {bound.name for bound in search.bounds.values()}
    others = {*_TOLD, *filter(None, [search.space.requirements.best]),
              *(search.space.requirements.front or ())} - bounded
    prices = dict(zip(search.bounds, found.prices.tolist(), strict=True))
    told = []
    for name, quantity in QUANTITIES.items():
        if quantity.of_plate and given.plate is None:
            continue
        if name in others:
            reduced, value, before = (_one(quantity, each) for each in films)
            told.append(DesignedQuantity(
                name=name, unit=quantity.unit, bound=None, value=value,
                sense="at least" if quantity.gain else "at most",
                reduced=reduced, given=before,
                reached=_reached(found, name, bool(quantity.gain))))
        for key, bound in search.bounds.items():
            if bound.name == name:
                told.append(_bounded(found, key, prices[key], films))
    return told


def _bounded(found: Sought, key: str, price: float, films: tuple[Any, ...]) -> DesignedQuantity:
    """A bound, with what the film has, what its copies keep, and what the bound costs."""
    bound, space = found.search.bounds[key], found.search.space
    reduced, value, before = (_one(bound.quantity, each) for each in films)
    kept = None if found.films is None else found.films.kept_each(found.off).get(key)
    share = None if kept is None else Chance.of(kept)
    missed = value is not None and not bound.kept_by(value)
    if share is not None:
        missed = share.high < space.requirements.share
    weaker = found.relaxed.get(key)
    gain = gain_of(found.search, bound, found.values, price) if price > 0 else None
    return DesignedQuantity(
        name=bound.name, unit=bound.quantity.unit, sense=bound.sense, bound=bound.value,
        value=value, reduced=reduced, given=before,
        reached=_reached(found, bound.name, bound.least), kept=share, missed=missed,
        binding=price > 0, relaxing=None if gain is None else gain / _scale(found),
        attainable=None if weaker is None else weaker.bound.value,
        attainable_ends={} if weaker is None else weaker.ends.numbers)


def _one(quantity: Quantity, films: Any) -> float | None:
    """A quantity of one film, if it has it."""
    if films is None:
        return None
    value = float(quantity.of(films)[0])
    return value if np.isfinite(value) else None


def _reached(found: Sought, name: str, least: bool) -> float | None:
    """Value of a quantity that the share of the films reach; None where fewer have it at all."""
    quantity, share = QUANTITIES[name], found.search.space.requirements.share
    if found.films is None or not quantity.scatters or name == TENSION:
        return None
    values = quantity.of(found.films.films)
    values = np.where(np.isfinite(values) & ~found.films.lost, values, -np.inf if least else np.inf)
    value = of_share(values, share, gain=least)
    return value if np.isfinite(value) else None
