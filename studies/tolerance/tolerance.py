"""Spread between films made to the same tolerances, by a family of reduced films."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.toml_reader import Rule
from tympan.fem.rig import MASSES, VOLTAGES, Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Limit, Settings, solve
from tympan.studies.films.family import FilmFamily
from tympan.studies.films.first_limits import KINDS, label_of
from tympan.studies.limits.loads import require_moved, usual_masses, usual_voltages
from tympan.studies.limits.voltages import first_limit
from tympan.studies.tolerance.drawn import Copies, Scattered
from tympan.studies.tolerance.given import Cause, Tolerances, causes
from tympan.studies.tolerance.result import (
    SPREAD,
    Chance,
    FilmFailure,
    FilmLimits,
    GivenTolerance,
    Spread,
    ToleranceResult,
    VarianceShare,
    WantedBound,
)
from tympan.studies.tolerance.shares import Design
from tympan.studies.wanted import BREAKDOWN, LIMIT, TENSION, Bound, scattering

_FILMS: Rule = (lambda x: 100 <= x <= 1_000_000,
                "must be a whole number from 100 to 1000000")
_SEED: Rule = (lambda x: 0 <= x < 2**63, "must be a whole number, 0 or more")

#: Films where their number is not given: quantiles of 5 % are then known to some 0.02 of the
#: standard deviation.
USUAL_FILMS = 10_000
#: Films whose error is estimated.
_CHECKED = 200
#: Quantiles that are told.
_TOLD = (0.05, 0.5, 0.95)
#: Share of films that may miss a voltage where the shares of variance are still told.
_MISSED = 0.05
#: Part of the films whose limits are sought: each takes some five states.
_LIMITED = 1 / 8
#: How far above the nominal film's first limit films' limits are sought: with the library's scatter
#: of VHB, which is large, it is that of 1 film in 300.
_ABOVE = 1.4
#: By how much the first limit of the film without scatter may differ from that by finite elements,
#: relative, before it is worth a word: films scatter by some 5 %.
_ASTRAY = 0.01
#: Share of films without a limit from which on it is worth a word.
_FEW = 0.005
#: Bins of a histogram.
_BINS = 40
#: Standard deviation over the value below which films are alike: a computer's rounding.
_ALIKE = 1e-9


@asks
@dataclass(frozen=True)
class ToleranceCase:
    """A specimen made to tolerances, under a nominal ``mass`` [kg] and ``voltage`` [V].

    Mass and voltage suit the film where they are not given. ``wanted``: bounds of which is said how
    many films keep them. About so many ``films`` are drawn, by a ``seed``: their number is a power
    of two times three more than there are tolerances.
    """

    specimen: Specimen
    _: KW_ONLY
    mass: Annotated[float | None, Key("nominal load on the plate", "mass", MASSES)] = None
    voltage: Annotated[float | None, Key("nominal voltage", "voltage", VOLTAGES)] = None
    tolerances: Tolerances = Tolerances()
    wanted: tuple[Bound, ...] = ()
    films: Annotated[int, Key("how many are drawn, about", rule=_FILMS)] = USUAL_FILMS
    seed: Annotated[int, Key("of the random numbers", rule=_SEED)] = 1
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
        """Mass and voltage, given or such that they suit the film."""
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
              progress: Callable[[str], None] = lambda words: None) -> ToleranceResult:
    """Draw films, solve them without and under the voltage, and divide their variance."""
    began = time.perf_counter()
    found, words = causes(case.specimen, case.tolerances)
    mass, voltage = case.loaded(settings)
    if not voltage > 0:
        raise InputError("must be above 0: films are compared without and under it", key="voltage",
                         given=f"{voltage:g} V")
    drawn = Drawn.of(case, found, mass, voltage, settings)
    made = time.perf_counter()
    progress(f"{drawn.films} films")
    values = drawn.solved()
    reached = drawn.reached(values)
    wanted, kept = drawn.wanted(case, reached)
    limits = drawn.limits()
    warnings = [*Case(case.specimen, mass=mass, voltage=voltage, rig=case.rig).remarks, *words]
    return ToleranceResult(
        specimen=case.specimen.name, mass_kg=mass, voltage_V=voltage, films=drawn.films,
        seed=case.seed, tolerances=tuple(map(_stated, found)),
        reached=Chance.of(reached, drawn.design.independent),
        fails=drawn.fails(reached), wanted=wanted, kept=kept,
        quantities=drawn.spreads(values, reached) | limits.spread(), limits=limits.record(),
        error=drawn.error(),
        made_s=made - began, wall_s=time.perf_counter() - began,
        warnings=(*warnings, *_missed(reached), *drawn.excuse(values, case, settings),
                  *limits.warnings, *_without_air(case.rig)))


@dataclass(frozen=True, eq=False)
class Drawn:
    """Films of a design under a nominal mass [kg] and voltage [V].

    The first of the ``copies`` is the nominal one, the others are the design's. ``first``: the
    nominal film's first limit by finite elements.
    """

    copies: Copies
    causes: tuple[Cause, ...]
    design: Design
    mass: float
    voltage: float
    first: Limit | None

    @classmethod
    def of(cls, case: ToleranceCase, found: tuple[Cause, ...], mass: float, voltage: float,
           settings: Settings) -> Drawn:
        """The films of a case, and their family."""
        scattered, rig = Scattered(case.specimen, found), case.rig
        design = scattered.design(case.films, case.seed)
        nominal = Case(case.specimen, mass=mass, rig=rig)
        first = first_limit(nominal, settings)
        asked = [bound.value for bound in case.wanted if bound.name == LIMIT]
        highest = max(case.margin * voltage, *asked,
                      0.0 if first is None else _ABOVE * first.voltage_V)
        force = nominal.force(float(case.specimen.plate_area))
        copies = Copies.of(scattered, design.points, (force, force),
                           float(rig.film_voltage(highest)), rig, settings)
        return cls(copies, found, design, mass, voltage, first)

    @property
    def rows(self) -> AnyArray:
        """Parameters of the films, (films, names)."""
        return self.copies.drawn.rows

    @property
    def family(self) -> FilmFamily:
        """Solver of them."""
        return self.copies.family

    @property
    def forces(self) -> AnyArray:
        """Forces on their plates [N], (films,)."""
        return self.copies.forces(self.mass)

    @property
    def voltages(self) -> AnyArray:
        """Voltages across them [V], (films,)."""
        return self.copies.across(self.voltage)[:, 0]

    @property
    def films(self) -> int:
        """Number of films beside the nominal one."""
        return len(self.rows) - 1

    def solved(self) -> dict[str, AnyArray]:
        """Quantities of all films by key; nan of those that do not reach the voltage."""
        parts = list(map(self._solved, self.copies.parts()))
        return {key: np.concatenate([part[key] for part in parts])
                for key in SPREAD if key in parts[0]}

    def _solved(self, copies: Copies) -> dict[str, AnyArray]:
        forces = copies.forces(self.mass)
        rest = copies.rests(forces)
        plated = self.family.box.specimen.plate is not None
        values = {key: found[:, 0] for key, found in
                  copies.solved(self.mass, self.voltage, rest, swings=plated).items()}
        if not plated:  # nothing is blocked, and nothing swings
            del values["frequency_Hz"]
            return values
        blocked = forces - copies.held(rest, copies.across(self.voltage)[:, 0])
        values["blocked_force_N"] = np.where(np.isfinite(values["deflection_m"]), blocked, np.nan)
        values["frequency_Hz"] = np.minimum(values["frequency_Hz"],
                                            copies.frequencies(rest, self.mass))
        return values

    @staticmethod
    def reached(values: dict[str, AnyArray]) -> Mask:
        """Mask of the films that reach the voltage, the nominal one left out."""
        return np.isfinite(values["deflection_m"][1:])

    def fails(self, reached: Mask) -> tuple[FilmFailure, ...]:
        """First limits of the films that do not reach the voltage."""
        films = self.copies.loaded(self.mass, self.voltage).part(slice(1, None))
        return FilmFailure.of(films, ~reached, self.voltage, self.design.independent)

    def wanted(self, case: ToleranceCase, reached: Mask
               ) -> tuple[tuple[WantedBound, ...], Chance | None]:
        """Films that keep each of the bounds that are wanted, and all together, if there are any.

        By the same quantities as of films that are searched for; all but the first limit are those
        at the voltage, so that a film that does not reach it does not keep them.
        """
        if not case.wanted:
            return (), None
        films = self.copies.loaded(self.mass, self.voltage, case.margin).part(slice(1, None))
        kept = [(bound.misses(films) <= 0) & (reached | (bound.name == LIMIT))
                for bound in case.wanted]
        each = tuple(WantedBound.of(bound, some, reached, self.design.independent)
                     for bound, some in zip(case.wanted, kept, strict=True))
        return each, Chance.of(np.all([reached, *kept], axis=0), self.design.independent)

    def error(self) -> float | None:
        """Largest estimated error of the deflection of the first films, relative, if any."""
        some = slice(0, _CHECKED)
        states = self.family.states(self.rows[some], self.forces[some, None],
                                    self.voltages[some, None])
        share = states.error / np.abs(states.deflection)
        return float(np.nanmax(share)) if np.isfinite(share).any() else None

    def excuse(self, values: dict[str, AnyArray], case: ToleranceCase, settings: Settings
               ) -> list[str]:
        """Why the film without scatter does not reach the voltage, by finite elements."""
        if np.isfinite(values["deflection_m"][0]):
            return []
        found = solve(Case(case.specimen, mass=self.mass, voltage=self.voltage, rig=case.rig),
                      settings)
        return ["the film without scatter does not reach the voltage: "
                + "; ".join(found.warnings)]

    def spreads(self, values: dict[str, AnyArray], reached: Mask) -> dict[str, Spread]:
        """Distributions by key; none where hardly any film reaches the voltage."""
        if reached.sum() < _BINS:
            return {}
        return {key: self.spread(value, self.design) for key, value in values.items()}

    def limits(self) -> Limited:
        """The first limits of some of the films."""
        design, numbers = self.design.part(_LIMITED)
        some = np.array([0, *(1 + numbers)])
        drawn = self.copies.drawn
        found = self.family.first_limits(drawn.rows[some], self.forces[some], drawn.strength[some])
        across = found.voltage / drawn.amplifier[some]
        nominal = [self.copies.rig.nominal_voltage(voltage) if np.isfinite(voltage) else voltage
                   for voltage in across.tolist()]
        return Limited(self, design, np.array(nominal), found.kind)

    def spread(self, values: AnyArray, design: Design) -> Spread:
        """Scatter of values of the nominal film and those of a design, nan left out."""
        nominal, films = float(values[0]), values[1:]
        there = films[np.isfinite(films)]
        low, median, high = np.quantile(there, _TOLD)
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

    def _shares(self, films: AnyArray, design: Design
                ) -> tuple[tuple[VarianceShare, ...], float, float]:
        """Shares of the causes, that of all that films of a batch do not share, and the rest."""
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
    """First limits of films of a design, nominal voltages and numbers of their kinds, (films,)."""

    drawn: Drawn
    design: Design
    voltage: AnyArray
    kind: AnyArray

    @property
    def _met(self) -> Mask:
        return np.asarray(np.isfinite(self.voltage[1:]))

    def record(self) -> FilmLimits:
        """Record that is stored."""
        shares = {kind: float((self._met & (self.kind[1:] == number)).mean())
                  for number, kind in enumerate(KINDS)}
        return FilmLimits(
            films=len(self._met),
            highest_V=self.drawn.copies.rig.nominal_voltage(self.drawn.family.voltage[1]),
            kinds={kind: share for kind, share in sorted(shares.items(), key=lambda item: -item[1])
                   if share})

    def spread(self) -> dict[str, Spread]:
        """Distribution by its key; none where more than a few films have no limit."""
        if self._met.mean() < 1 - _MISSED:
            return {}
        values = np.where(np.isfinite(self.voltage), self.voltage, np.nan)
        return {"limit_V": self.drawn.spread(values, self.design)}

    @property
    def warnings(self) -> list[str]:
        """Warnings that its reader must know."""
        highest, missing = self.record().highest_V / 1e3, 1 - self._met.mean()
        if missing <= _FEW:
            return self._astray
        left = ("there is no distribution of the first limit" if missing > _MISSED
                else "the distribution of the first limit is without them")
        return [*self._astray, f"{100 * missing:.3g} % of the films have no limit up to "
                f"{highest:.3g} kV: {left}"]

    @property
    def _astray(self) -> list[str]:
        """Warning that the nominal film's limit is not that of finite elements."""
        known, found = self.drawn.first, float(self.voltage[0])
        # A median strength by the electrode's area is another than the stated one.
        if known is None or not np.isclose(self.drawn.copies.drawn.strength[0], 1.0):
            return []
        kind = KINDS[self.kind[0]]
        if kind == known.kind and abs(found - known.voltage_V) <= _ASTRAY * known.voltage_V:
            return []
        said = (f"{label_of(kind)} at {found / 1e3:.3g} kV" if np.isfinite(found)
                else f"none up to {self.record().highest_V / 1e3:.3g} kV")
        return [f"the first limit of the film without scatter is {label_of(known.kind)} "
                f"at {known.voltage_V / 1e3:.3g} kV by finite elements, but {said} by reduced "
                "films: first limits are no surer than that"]


def _stated(cause: Cause) -> GivenTolerance:
    return GivenTolerance(name=cause.name, scope=cause.scope, source=cause.source,
                          reason=cause.reason,
                          relative=cause.deviation if cause.relative else None,
                          deviation_m=None if cause.relative else cause.deviation)


def _without_air(rig: Rig) -> list[str]:
    return ["frequencies are those without air: the rig's air makes them lower"] if rig.air else []


def _missed(reached: Mask) -> list[str]:
    if reached.mean() >= 1 - _MISSED:
        return []
    if reached.sum() < _BINS:
        return ["hardly any film reaches the voltage: there are no distributions under it"]
    return ["more than 5 % of the films do not reach the voltage: the distributions are of those "
            "that do, and no shares of variance are told"]
