"""The best films for requirements, with margins for scatter, checked by finite elements."""

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
from tympan.studies.design.relaxed import RELAXED, Relaxed, attained, ends_at, gain_by_relaxing
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

#: Digits of the values that are chosen: more are rounding of the search, and read badly in files.
_DIGITS = 12
#: Random films for setting the margins: 26 of them lie beyond the 5 % quantile.
_DRAWN = 512
#: Random films for the final check: its error is about 0.5 % of all films.
_JUDGED = 2048
#: Most rounds of setting the margins; usually four suffice.
_ROUNDS = 12
#: Change of a margin, over its bound, below which it has settled.
_SETTLED = 1e-3
#: Change below which failing films are counted: margins still move by less.
_NEAR = 2e-2
#: Targeted share of the allowed failures, so that other random films do not exceed them.
_AIMED = 0.9
#: Shares of the allowed failures between which the margins stay as they are.
_NEARLY = (0.75, 0.96)
#: Rounds after which margins change by half: two films may each require the margins of the other.
_DAMPED = 3
#: Rounds without a film that keeps all bounds, after which most films must keep them instead.
_IN_VAIN = 2
#: Limits of the factor by which the share that may fail each bound changes in one round.
_LEVEL_STEP = (0.7, 1.4)
#: Times that a search continues about a film at the edge of the known reduced films.
_BEYOND = 4
#: Ranges about a film at the edge, over the ranges given.
_ABOUT = 0.3
#: Smallest relative gain of the aim for which the search continues about a film at the edge.
_BETTER = 1e-3
#: Quantities that are reported for every film.
_TOLD = ("stroke", "blocked_force", "work", "frequency", TENSION, "voltage", "max_field",
         "max_true_stress", "gap")


@dataclass(frozen=True, eq=False)
class Sought:
    """End of the search, the margins it had, and the film by finite elements.

    ``off``: the share of each bound by which reduced films are better than finite elements.
    ``priced``: the cost of a share of each bound in the aim, (bounds,), where the search's end does
    not give it. ``relaxed``: weaker bounds by the keys of those they replace; each of them alone
    would suffice.
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
        """Cost of a share of each bound in the aim, (bounds,)."""
        if self.priced is not None:
            return self.priced
        multipliers = self.end.multipliers
        return np.zeros(len(self.search.bounds)) if multipliers is None else multipliers.limits

    @property
    def values(self) -> Array:
        """Values of the variables, with the digits that files show."""
        space = self.search.space
        exact = space.values(self.end.x[: len(space.variables)])
        shown = [float(f"{value:.{_DIGITS}g}") for value in exact.tolist()]
        return np.clip(shown, [each.low for each in space.variables],
                       [each.high for each in space.variables])

    @property
    def inner_ends(self) -> list[int]:
        """Variables at an end of their range that is not an end of the range given."""
        space, multipliers = self.search.space, self.end.multipliers
        if multipliers is None:
            return []
        return [number for number, (own, asked, price) in enumerate(zip(
            space.variables, space.asked, multipliers.bounds.tolist(), strict=False))
            if price and (own.high < asked.high if price > 0 else own.low > asked.low)]

    @property
    def at_edge(self) -> bool:
        """Whether the search ended at the edge of the known reduced films, and not at a bound."""
        if not (self.possible and self.search.best):
            return False
        if self.inner_ends or self.end.status != "no_progress":
            return bool(self.inner_ends)
        return not ends_at(self.search.space, self.end.x).known

    @property
    def aim(self) -> float:
        """Value of the quantity that is maximised."""
        assert self.end.here is not None
        return self.end.here.value if self.search.best else common_share(self.end)


@dataclass(frozen=True, eq=False)
class _Kind:
    """The best film of one kind as it is stored, its files, and the search's end for a front."""

    film: DesignedFilm
    specimen: Specimen
    rig: Rig
    warnings: list[str]
    sought: Sought | None


def design(requirements: Requirements, settings: Settings = Settings(),
           progress: Progress = lambda words: None, workers: int = 1) -> DesignResult:
    """Find the best film of each kind; an unmet requirement is a result, too.

    ``workers`` is the number of processes that search kinds in parallel.

    Raises
    ------
    InputError
        When no kind has a reduced film, or no film bears its loads.
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
    """Find the best film of one kind; if the only kind has no film, raise the reason."""
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
    # A process sends a family's films only where the front needs them.
    space, values, exact = sought.search.space, sought.values, sought.exact
    assert exact is not None
    return _Kind(designed_film(sought, specimen), space.built(values), space.rig(values),
                 [*_edge(sought), *exact.warnings], None if requirements.front is None else sought)


def _edge(found: Sought) -> list[str]:
    """Warn where the search ended at the edge of the known reduced films."""
    if not found.at_edge:
        return []
    film = ", ".join(f"{each.key} = {quantity_text(value, each.dimension)}" for each, value in zip(
        found.search.space.asked, found.values.tolist(), strict=True))
    return [f"the search ended at the edge of what reduced films know, at {film}: beyond it a "
            "better film is possible. Search again with narrower ranges about this film"]


def sought_in(space: DesignSpace, settings: Settings) -> Sought:
    """Find the best film of a space; without one, find the nearest and bounds that it can keep."""
    requirements = space.requirements
    search = Search(space, requirements.kept(space.specimen), requirements.best,
                    least=requirements.least)
    found = _beyond(_settled(search, search.starts()), settings)
    found = _with_margins(_checked(found, settings), settings)
    return found if found.possible else _relaxed(found, settings)


def _relaxed(found: Sought, settings: Settings) -> Sought:
    """Find for each binding bound of the nearest film the value that it can have instead.

    All other bounds are kept. Where the value found is no weaker than the bound, a film keeps all
    bounds after all. Then the search continues from it, and the value is dropped where the result
    does not keep them.
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
    """Find the best film from one at shares x of the ranges that seems to keep all bounds."""
    if found.films is not None:
        return _kept_by_most(replace(found, end=replace(found.end, x=x)), settings)
    best = found.search.space.requirements.best
    again = _settled(replace(found.search, best=best), x[None])
    return _with_margins(_checked(again, settings), settings)


@dataclass(frozen=True, eq=False)
class _Margins:
    """A film and the margins it was found with, in the iteration for a film with its own margins.

    ``level``: share of the films that may fail each bound. ``shifts``: the margins. ``points``: the
    random films about each design, None where nothing scatters. The other fields are of the rounds
    before. ``count`` is their number, and ``vain`` counts those in vain. ``kept`` is the best film
    whose bounds enough of its copies keep. ``likely`` is the film whose bounds the largest share
    ``most`` of its copies keeps.
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
        """Make the first round, from a film without margins."""
        space = found.search.space
        points = drawn_points(space.inputs, _DRAWN, 1) if space.scatter else None
        return cls(found, points, _AIMED * (1 - space.requirements.share), found)

    @property
    def failing(self) -> float:
        """Share of the films that may fail."""
        return 1 - self.found.search.space.requirements.share

    @cached_property
    def films(self) -> ScatteredFilms | None:
        """Random films about this one."""
        if self.points is None:
            return None
        return ScatteredFilms.of(self.found.search, self.found.values, self.points)

    @cached_property
    def share(self) -> float:
        """Share of these films that keep all bounds."""
        return 1.0 if self.films is None else float(self.films.kept(self.found.off).mean())

    @property
    def failed(self) -> float:
        """Share of failures over the allowed share; the target where nothing scatters."""
        return _AIMED if self.films is None else (1 - self.share) / self.failing

    @cached_property
    def wanted(self) -> dict[str, float]:
        """Margins that suit this film."""
        shifts = {} if self.films is None else self.films.shifts(self.found.values, self.level)
        return {key: value + shifts.get(key, 0.0) for key, value in self.found.off.items()}

    @property
    def change(self) -> float:
        """Largest difference of a margin from the one that the film was found with."""
        return max(abs(value - self.shifts.get(key, np.inf)) for key, value in self.wanted.items())

    @property
    def many(self) -> bool:
        """Whether too many copies of a film that keeps all bounds fail."""
        return self.films is not None and self.found.possible and self.failed > _NEARLY[1]

    @property
    def in_vain(self) -> int:
        """Number of rounds without a film that keeps all bounds."""
        return self.vain + (not self.found.possible)

    @property
    def settled(self) -> bool:
        """Whether the margins suit the film, or no film is found with any margins."""
        few = _NEARLY[0] <= self.failed <= _NEARLY[1]
        return ((self.change < _SETTLED and not self.many) or (few and self.change < _NEAR)
                or self.in_vain > _IN_VAIN)

    @property
    def best(self) -> Sought | None:
        """Best film so far of which enough copies keep all bounds."""
        if self.films is None or not self.found.possible or self.many:
            return self.kept
        return max(filter(None, [self.kept, self.found]), key=lambda each: each.aim)

    @property
    def likeliest(self) -> Sought:
        """Film so far of which the most copies keep all bounds."""
        return self.found if self.films is not None and self.share > self.most else self.likely

    def next(self, settings: Settings) -> Self | None:
        """Search again with margins that suit this film; None where no film can have them."""
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
    """Find a film with margins for scatter and for the errors of reduced films."""
    here = _Margins.of(found)
    while here.count < _ROUNDS and not here.settled:
        after = here.next(settings)
        if after is None:
            break
        here = after
    film, likely = here.found, here.likely
    if here.count == _ROUNDS:  # two films each require the margins of the other
        film = here.kept or film
    else:
        likely = here.likeliest
    if here.points is None:
        return film
    if film.possible and (judged := _judged(film)).possible:
        return judged
    return _kept_by_most(likely, settings)


def _beyond(found: Sought, settings: Settings) -> Sought:
    """Continue a search that ended at the edge of the known reduced films.

    A family of narrower ranges about that film has more of its neighbours.
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
    """Solve the film by finite elements, and find the errors of the reduced film against them."""
    space, values, search = found.search.space, found.values, found.search
    exact = space.exact(values, settings)
    reduced = replace(search, shifts={}).missed(space.films(values[None]))[0]
    by_elements = missed_exactly(search, exact)
    off = by_elements - reduced if np.isfinite(by_elements).all() else np.zeros(len(reduced))
    return replace(found, exact=exact, off=dict(zip(search.bounds, off.tolist(), strict=True)))


def _judged(found: Sought) -> Sought:
    """Draw others about the film; it is possible if enough of them keep all bounds."""
    space = found.search.space
    films = ScatteredFilms.of(found.search, found.values, drawn_points(space.inputs, _JUDGED, 2))
    enough = Chance.of(films.kept(found.off)).high >= space.requirements.share
    return replace(found, films=films, possible=found.possible and enough)


def _kept_by_most(found: Sought, settings: Settings) -> Sought:
    """Find the film that most of its copies keep, from one on; the best if enough keep it."""
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
        if judged.possible and judged.films is not None:  # the films of a front have margins, too
            shifts = judged.films.shifts(judged.values, 1 - share)
            return replace(judged, search=replace(judged.search, shifts=shifts))
    return judged


def _settled(search: Search, starts: Array) -> Sought:
    """Find the best film from some starts; without one, that which misses the bounds least."""
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
    """Make the film's stored form, with the given specimen for comparison."""
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
        # A range that ends at 0 cannot be widened by a share of its end.
        share = RELAXED * abs(bound) / (each.high - each.low)
        kind = ends.numbers.get(each.key)
        numbers[each.key] = DesignedNumber(
            value=float(value), low=each.low, high=each.high,
            unit=DIMENSIONS[each.dimension].si if each.dimension else "1",
            end="range" if price else kind,
            relaxing=abs(price) * share / _scale(found) if price and share else None)
    return numbers


def _scale(found: Sought) -> float:
    """Find the scale for the aim's relative gain: the best quantity, or 1."""
    return abs(found.aim) if found.search.best else 1.0


def _quantities(found: Sought, given: Specimen) -> list[DesignedQuantity]:
    """List a film's quantities: those of all bounds, and those without a bound."""
    search, exact = found.search, found.exact
    assert exact is not None
    now = replace(exact, specimen=given) if search.space.hold(given) else None
    films = search.space.films(found.values[None]), exact, now
    bounded = {bound.name for bound in search.bounds.values()}
    others = {*_TOLD, *filter(None, [search.space.requirements.best]),
              *(search.space.requirements.front or ())} - bounded
    prices = dict(zip(search.bounds, found.prices.tolist(), strict=True))
    told = []
    for name, quantity in QUANTITIES.known.items():
        if quantity.of_plate and given.plate is None:
            continue
        if name in others:
            reduced, value, before = (_one(quantity, each) for each in films)
            more = search.space.requirements.seeks_more(quantity)
            told.append(DesignedQuantity(
                name=name, unit=quantity.unit, bound=None, value=value,
                sense="at least" if more else "at most",
                reduced=reduced, given=before, reached=_reached(found, name, more)))
        for key, bound in search.bounds.items():
            if bound.name == name:
                told.append(_bounded(found, key, prices[key], films))
    return told


def _bounded(found: Sought, key: str, price: float, films: tuple[Any, ...]) -> DesignedQuantity:
    """Describe a bound: the film's value, the copies that keep it, and what the bound costs."""
    bound, space = found.search.bounds[key], found.search.space
    reduced, value, before = (_one(bound.quantity, each) for each in films)
    kept = None if found.films is None else found.films.kept_each(found.off).get(key)
    share = None if kept is None else Chance.of(kept)
    missed = value is not None and not bound.kept_by(value)
    if share is not None:
        missed = share.high < space.requirements.share
    weaker = found.relaxed.get(key)
    gain = gain_by_relaxing(found.search, bound, found.values, price) if price > 0 else None
    return DesignedQuantity(
        name=bound.name, unit=bound.quantity.unit, sense=bound.sense, bound=bound.value,
        value=value, reduced=reduced, given=before,
        reached=_reached(found, bound.name, bound.least), kept=share, missed=missed,
        binding=price > 0, relaxing=None if gain is None else gain / _scale(found),
        attainable=None if weaker is None else weaker.bound.value,
        attainable_ends={} if weaker is None else weaker.ends.numbers)


def _one(quantity: Quantity, films: Any) -> float | None:
    """Compute a quantity of one film; None if the film does not have it."""
    if films is None:
        return None
    value = float(quantity.of(films)[0])
    return value if np.isfinite(value) else None


def _reached(found: Sought, name: str, least: bool) -> float | None:
    """Find the value that the required share of films reach; None where fewer films have it."""
    quantity, share = QUANTITIES[name], found.search.space.requirements.share
    if found.films is None or not quantity.scatters or name == TENSION:
        return None
    values = quantity.of(found.films.films)
    values = np.where(np.isfinite(values) & ~found.films.lost, values, -np.inf if least else np.inf)
    value = of_share(values, share, gain=least)
    return value if np.isfinite(value) else None
