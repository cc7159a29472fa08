"""Spread between films made to the same tolerances, by a family of reduced films."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Annotated, Self

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.progress import Progress
from tympan.base.toml_reader import Rule
from tympan.fem.rig import MASS_RULE, VOLTAGE_RULE, Loads, Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Limit, Settings, solve
from tympan.studies.films.family import FilmFamily
from tympan.studies.films.first_limits import kinds, label_of
from tympan.studies.films.population import LoadedFilms, Population
from tympan.studies.limits.loads import require_moved, usual_masses, usual_voltages
from tympan.studies.limits.voltages import first_limit
from tympan.studies.tolerance.drawn import Scattered
from tympan.studies.tolerance.given import ScatterCause, Tolerances, causes
from tympan.studies.tolerance.result import (
    TILTS,
    TOLD,
    Chance,
    FilmFailure,
    FilmLimits,
    GivenTolerance,
    Spread,
    ToleranceResult,
    VarianceShare,
    WantedBound,
)
from tympan.studies.tolerance.shares import SaltelliDesign
from tympan.studies.wanted import BREAKDOWN, LIMIT, QUANTITIES, TENSION, Bound, scattering

_FILMS: Rule = (lambda x: 100 <= x <= 1_000_000,
                "must be a whole number from 100 to 1000000")
_SEED: Rule = (lambda x: 0 <= x < 2**63, "must be a whole number, 0 or more")

#: Default number of films: quantiles of 5 % are then accurate to about 0.02 of the standard
#: deviation.
USUAL_FILMS = 10_000
#: Number of films whose error is estimated.
_CHECKED = 200
#: Quantiles of a spread.
_EDGES = (0.05, 0.5, 0.95)
#: Largest share of films that miss the voltage with which the variance is divided.
_MISSED = 0.05
#: Part of the films whose limits are sought: each needs about five states.
_LIMITED = 1 / 8
#: Highest voltage at which films' limits are sought, over the nominal film's first limit. With the
#: library's scatter of VHB, which is large, 1 film in 300 has a limit this high.
ABOVE = 1.4
#: Relative difference of the first limit of the film without scatter from that by finite elements,
#: above which there is a warning: films scatter by about 5 %.
_ASTRAY = 0.01
#: Share of films without a limit above which there is a warning.
_FEW = 0.005
#: Largest number of bins of a histogram.
_BINS = 40
#: Standard deviation over the value below which films are equal: rounding errors.
_ALIKE = 1e-9


@asks
@dataclass(frozen=True)
class ToleranceCase:
    """A specimen made to tolerances, under a nominal ``mass`` [kg] and ``voltage`` [V].

    By default mass and voltage suit the film. ``wanted``: bounds; the result states the share of
    films that keep them. About ``films`` films are drawn, with a ``seed``: their number is a power
    of two times three more than there are tolerances.
    """

    specimen: Specimen
    _: KW_ONLY
    mass: Annotated[float | None, Key("nominal load on the plate", "mass", MASS_RULE)] = None
    voltage: Annotated[float | None, Key("nominal voltage", "voltage", VOLTAGE_RULE)] = None
    tolerances: Tolerances = Tolerances()
    wanted: tuple[Bound, ...] = ()
    films: Annotated[int, Key("how many are drawn, about", rule=_FILMS)] = USUAL_FILMS
    seed: Annotated[int, Key("of the random numbers", rule=_SEED)] = 0
    rig: Rig = Rig()

    if TYPE_CHECKING:
        def __init__(self, specimen: Specimen, *, mass: float | str | None = ...,
                     voltage: float | str | None = ..., tolerances: Tolerances = ...,
                     wanted: tuple[Bound, ...] = ..., films: int = ..., seed: int = ...,
                     rig: Rig = ...) -> None: ...

    def __post_init__(self) -> None:
        causes(self.specimen, self.tolerances)
        for bound in self.wanted:
            if not bound.quantity.scatters:
                able = ", ".join(scattering())
                raise InputError(f"must be of what differs between films, one of {able}: "
                                 f"{bound.name} is judged by its nominal value, in tympan design",
                                 key="want", given=bound.text)
            if bound.quantity.of_plate:
                self.specimen.needed_plate()
            if bound.name == BREAKDOWN and self.specimen.membrane.strength is None:
                raise InputError("needs a film whose electric strength is known "
                                 "(membrane.breakdown)", key="want", given=bound.text)

    @property
    def margin(self) -> float:
        """Voltage that films must bear without loss of tension, over their own."""
        return max((bound.value for bound in self.wanted if bound.name == TENSION), default=1.0)

    def loaded(self, settings: Settings) -> tuple[float, float]:
        """Find mass and voltage, given or such that they suit the film."""
        mass = self.mass
        if mass is None and self.specimen.plate is None:
            mass = 0.0
        if mass is None:
            mass = usual_masses(self.specimen, settings, self.rig)[0]
        require_moved(self.specimen, self.rig, mass)
        if self.voltage is not None:
            return mass, self.voltage
        return mass, usual_voltages(self.specimen, mass, settings, self.rig)[-1]


def tolerance(case: ToleranceCase, settings: Settings,
              progress: Progress = lambda words: None) -> ToleranceResult:
    """Draw films, solve them without and under the voltage, and divide their variance."""
    began = time.perf_counter()
    found, words = causes(case.specimen, case.tolerances)
    mass, voltage = case.loaded(settings)
    if not voltage > 0:
        raise InputError("must be above 0: films are compared without and under it", key="voltage",
                         given=f"{voltage:g} V")
    drawn = DrawnFilms.of(case, found, mass, voltage, settings)
    made = time.perf_counter()
    progress(f"{drawn.count} films")
    solved = drawn.solved()
    reached = solved.reached[1:]
    wanted, kept = drawn.wanted(solved)
    limits = drawn.limits()
    warnings = [*Case(case.specimen, mass=mass, voltage=voltage, rig=case.rig).remarks, *words]
    return ToleranceResult(
        specimen=case.specimen.name, mass_kg=mass, voltage_V=voltage, films=drawn.count,
        seed=case.seed, tolerances=tuple(map(_stated, found)),
        reached=Chance.of(reached, drawn.design.independent),
        fails=drawn.fails(reached), wanted=wanted, kept=kept,
        quantities=drawn.spreads(solved) | limits.spread(), limits=limits.record(),
        error=drawn.error(),
        made_s=made - began, wall_s=time.perf_counter() - began,
        warnings=(*warnings, *_missed(reached), *drawn.excuse(solved, settings),
                  *limits.warnings, *_without_air(case.rig)))


@dataclass(frozen=True, eq=False)
class SolvedFilms:
    """Results of films, the nominal one first, (films,) each.

    ``values`` of the quantities by their keys, nan for films that do not reach the voltage;
    ``missed``: shares by which they miss the wanted bounds.
    """

    values: Mapping[str, AnyArray]
    reached: Mask
    missed: Sequence[AnyArray]

    @classmethod
    def of(cls, films: LoadedFilms, wanted: Sequence[Bound]) -> Self:
        """Solve films of one block."""
        reached = films.reached
        # Limits need several states of each film, and are sought of fewer films.
        names = (*TOLD, *(TILTS if films.tilts else ()),
                 *(bound.name for bound in wanted if bound.name not in (LIMIT, TENSION)))
        asked = [QUANTITIES[name] for name in names]
        values = {each.column: films.stroke if each.name == "stroke" else each.of(films)
                  for each in asked if films.swings or not each.of_plate}
        return cls({key: np.where(reached, value, np.nan) for key, value in values.items()},
                   reached, [bound.misses(films) for bound in wanted])

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Join the results of all films, block by block."""
        values = {key: np.concatenate([part.values[key] for part in parts])
                  for key in parts[0].values}
        missed = [np.concatenate(each) for each in zip(*(part.missed for part in parts),
                                                       strict=True)]
        return cls(values, np.concatenate([part.reached for part in parts]), missed)


@dataclass(frozen=True, eq=False)
class DrawnFilms:
    """Films of a design under the nominal mass [kg] and voltage [V] of a case.

    The first of the ``films`` is the nominal one, the others are the design's. ``first``: the
    nominal film's first limit by finite elements.
    """

    films: Population
    causes: tuple[ScatterCause, ...]
    design: SaltelliDesign
    mass: float
    voltage: float
    case: ToleranceCase
    first: Limit | None

    @classmethod
    def of(cls, case: ToleranceCase, found: tuple[ScatterCause, ...], mass: float, voltage: float,
           settings: Settings) -> DrawnFilms:
        """Draw the films of a case, and make their family."""
        scattered, rig = Scattered(case.specimen, found), case.rig
        design = scattered.design(case.films, case.seed)
        first = first_limit(Case(case.specimen, mass=mass, rig=rig), settings)
        asked = [bound.value for bound in case.wanted if bound.name == LIMIT]
        highest = max(case.margin * voltage, *asked,
                      0.0 if first is None else ABOVE * first.voltage_V)
        films = scattered.population((mass, mass), highest,
                                     scattered.with_nominal(design.points), rig, settings)
        return cls(films, found, design, mass, voltage, case, first)

    @property
    def family(self) -> FilmFamily:
        """The family that solves them."""
        return self.films.family

    @property
    def count(self) -> int:
        """Number of films besides the nominal one."""
        return len(self.films) - 1

    def loaded(self, margin: float = 1.0) -> LoadedFilms:
        """Load the films, at their voltage and at a margin times it."""
        plated = self.case.specimen.plate is not None
        return self.films.under(self.mass, self.voltage, margin, swings=plated)

    def solved(self) -> SolvedFilms:
        """Solve all films."""
        parts = self.loaded(self.case.margin).parts()
        return SolvedFilms.joined([SolvedFilms.of(part, self.case.wanted) for part in parts])

    def fails(self, reached: Mask) -> tuple[FilmFailure, ...]:
        """Find the first limits of the films that do not reach the voltage."""
        films = self.loaded().part(slice(1, None))
        return FilmFailure.of(films, ~reached, self.voltage, self.design.independent)

    def wanted(self, solved: SolvedFilms) -> tuple[tuple[WantedBound, ...], Chance | None]:
        """Count films that keep each wanted bound, and all bounds together, if there are any.

        The quantities are those of a design. All but the first limit are those at the voltage, so a
        film that does not reach it does not keep them.
        """
        if not self.case.wanted:
            return (), None
        reached = solved.reached[1:]
        kept = [(missed[1:] <= 0) & (reached | (bound.name == LIMIT))
                for bound, missed in zip(self.case.wanted, solved.missed, strict=True)]
        each = tuple(WantedBound.of(bound, some, reached, self.design.independent)
                     for bound, some in zip(self.case.wanted, kept, strict=True))
        return each, Chance.of(np.all([reached, *kept], axis=0), self.design.independent)

    def error(self) -> float | None:
        """Find the largest estimated relative error of the first films' deflection, if any."""
        films = self.films.part(slice(0, _CHECKED))
        states = self.family.states(films.films, films.forces(self.mass)[:, None],
                                    films.across(self.voltage))
        share = states.error / np.abs(states.deflection)
        return float(np.nanmax(share)) if np.isfinite(share).any() else None

    def excuse(self, solved: SolvedFilms, settings: Settings) -> list[str]:
        """Explain by finite elements why the film without scatter does not reach the voltage."""
        if solved.reached[0]:
            return []
        case = Case(self.case.specimen, mass=self.mass, voltage=self.voltage, rig=self.case.rig)
        found = solve(case, settings)
        return ["the film without scatter does not reach the voltage: "
                + "; ".join(found.warnings)]

    def spreads(self, solved: SolvedFilms) -> dict[str, Spread]:
        """Compute distributions by key; none where hardly any film reaches the voltage."""
        if solved.reached[1:].sum() < _BINS:
            return {}
        return {key: self.spread(value, self.design) for key, value in solved.values.items()
                if np.isfinite(value[1:]).sum() >= _BINS}

    def limits(self) -> Limited:
        """Find the first limits of some of the films."""
        design, numbers = self.design.part(_LIMITED)
        films = self.films.part(np.append(0, 1 + numbers))
        voltage, kind = films.first_limits(self.mass)
        return Limited(self, design, voltage, kind)

    def spread(self, values: AnyArray, design: SaltelliDesign) -> Spread:
        """Compute the spread of values of the nominal film and a design's; nan are left out."""
        nominal, films = float(values[0]), values[1:]
        there = films[np.isfinite(films)]
        low, median, high = np.quantile(there, _EDGES)
        deviation, alike = float(there.std()), _ALIKE * float(np.abs(there).max())
        told = len(there) >= (1 - _MISSED) * len(films)
        count = min(_BINS, round(len(there) ** 0.5 / 2))
        if deviation <= alike:
            deviation, told, count = 0.0, False, 1
        counts, bins = np.histogram(there, count, (there.min() - alike, there.max() + alike))
        shares, apart, rest = self._shares(films, design) if told else ((), None, None)
        return Spread(
            nominal=nominal if np.isfinite(nominal) else None, median=float(median),
            low=float(low), high=float(high), deviation=deviation,
            within_batch=None if apart is None else deviation * apart**0.5,
            shares=shares, interactions=rest, bins=tuple(bins.tolist()),
            counts=tuple(counts.tolist()))

    def _shares(self, films: AnyArray, design: SaltelliDesign
                ) -> tuple[tuple[VarianceShare, ...], float, float]:
        """Compute the shares of the causes, of all differences in a batch, and of the rest."""
        found = design.shares(films)
        each = zip(self.causes, found.alone, found.total, found.low, found.high, strict=False)
        shares = [VarianceShare(name=cause.name, scope=cause.scope, alone=float(alone),
                                total=float(total), low=float(low), high=float(high))
                  for cause, alone, total, low, high in each]
        rest = 1 - sum(share.alone for share in shares)
        return (tuple(sorted(shares, key=lambda share: -share.alone)), float(found.total[-1]),
                float(rest))


@dataclass(frozen=True, eq=False)
class Limited:
    """First limits of films of a design, nominal voltages and kinds, (films,)."""

    drawn: DrawnFilms
    design: SaltelliDesign
    voltage: AnyArray
    kind: AnyArray

    @property
    def _met(self) -> Mask:
        return np.asarray(np.isfinite(self.voltage[1:]))

    def record(self) -> FilmLimits:
        """Make the record that is stored."""
        shares = {kind: float((self._met & (self.kind[1:] == kind)).mean()) for kind in kinds()}
        return FilmLimits(
            films=len(self._met),
            highest_V=self.drawn.films.rig.nominal_voltage(self.drawn.family.voltage[1]),
            kinds={kind: share for kind, share in sorted(shares.items(), key=lambda item: -item[1])
                   if share})

    def spread(self) -> dict[str, Spread]:
        """Compute its distribution by key; none where more than a few films have no limit."""
        if self._met.mean() < 1 - _MISSED:
            return {}
        values = np.where(np.isfinite(self.voltage), self.voltage, np.nan)
        return {"limit_V": self.drawn.spread(values, self.design)}

    @property
    def warnings(self) -> list[str]:
        """Warnings for the reader of the result."""
        highest, missing = self.record().highest_V / 1e3, 1 - self._met.mean()
        if missing <= _FEW:
            return self._astray
        left = ("there is no distribution of the first limit" if missing > _MISSED
                else "the distribution of the first limit is without them")
        return [*self._astray, f"{100 * missing:.3g} % of the films have no limit up to "
                f"{highest:.3g} kV: {left}"]

    @property
    def _astray(self) -> list[str]:
        """Warning that the nominal film's limit differs from that of finite elements."""
        known, found = self.drawn.first, float(self.voltage[0])
        # By the electrode's area, the median strength may differ from the stated one.
        if known is None or not np.isclose(self.drawn.films.strength[0], 1.0):
            return []
        kind = self.kind[0]
        if kind == known.kind and abs(found - known.voltage_V) <= _ASTRAY * known.voltage_V:
            return []
        said = (f"{label_of(kind)} at {found / 1e3:.3g} kV" if np.isfinite(found)
                else f"none up to {self.record().highest_V / 1e3:.3g} kV")
        return [f"the first limit of the film without scatter is {label_of(known.kind)} "
                f"at {known.voltage_V / 1e3:.3g} kV by finite elements, but {said} by reduced "
                "films: first limits are no surer than that"]


def _stated(cause: ScatterCause) -> GivenTolerance:
    return GivenTolerance(name=cause.name, scope=cause.scope, source=cause.source,
                          reason=cause.reason,
                          relative=None if cause.dimension else cause.deviation,
                          deviation_m=cause.deviation if cause.dimension else None)


def _without_air(loads: Loads) -> list[str]:
    return (["frequencies are those without air: the rig's air makes them lower"] if loads.air
            else [])


def _missed(reached: Mask) -> list[str]:
    if reached.mean() >= 1 - _MISSED:
        return []
    if reached.sum() < _BINS:
        return ["hardly any film reaches the voltage: there are no distributions under it"]
    return ["more than 5 % of the films do not reach the voltage: the distributions are of those "
            "that do, and no shares of variance are told"]
