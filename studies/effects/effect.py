"""An effect: a named change of specimens or rig that the nominal model leaves out."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from itertools import combinations
from math import exp, inf, isclose, log
from string import Formatter
from typing import Any, Literal, get_type_hints

from tympan.base.errors import InputError
from tympan.base.fields import Registry
from tympan.base.units import any_quantity
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.effects.prior import HeavyTail


class Place(Enum):
    """Part of a setup that an effect changes; the value says it in words."""

    EVERYTHING = "all specimens, or the rig"
    SPECIMEN = "one specimen"
    SEGMENT = "one segment of an electrode"
    PAIR = "two segments of an electrode"


#: Between a segment's name, which has no blanks, and that of its specimen.
_OF = " of "
#: Between the names of two segments.
_AND = " and "


def segments_in(which: str) -> tuple[str, tuple[str, ...]]:
    """Split the name of a place, "A of disc" or "A and B of disc": specimen and segments."""
    segments, _, specimen = which.partition(_OF)
    return specimen, tuple(segments.split(_AND))


class Observable(Enum):
    """Kind of readings without which some effects cannot be seen, by the column that holds it.

    ``TIME`` is the course of readings, by a transient's times or by the time states were held;
    ``SLOPE`` is that of the plate along x or y.
    """

    ELAPSED = "elapsed_s"
    DIRECTION = "direction"
    TIME = "t_s or dwell_s"
    FREQUENCY = "frequency_Hz"
    SHAPE = "x_mm"
    SLOPE = "tilt_x_mrad"
    FORCE = "force_mN"
    STRESS = "nominal_stress_kPa"
    TEMPERATURE = "temperature_C"


@dataclass(frozen=True)
class Setup:
    """Everything an effect may change: the specimens of a dataset, and their rig.

    ``formula``: film in closed form that computes them, as in
    :class:`~tympan.studies.case.Settings`.
    """

    specimens: tuple[Specimen, ...]
    rig: Rig
    formula: str | None = None

    def specimen(self, name: str) -> Specimen:
        """Find a specimen by its name; an :class:`InputError` if there is none."""
        for specimen in self.specimens:
            if specimen.name == name:
                return specimen
        names = ", ".join(specimen.name for specimen in self.specimens)
        raise InputError(f"must be one of {names}", key="specimen", given=name)

    def with_films(self, change: Callable[[Film], Film], which: str | None = None) -> Setup:
        return self.with_specimens(
            lambda specimen: replace(specimen, membrane=change(specimen.membrane)), which)

    def with_specimens(self, change: Callable[[Specimen], Specimen],
                       which: str | None = None) -> Setup:
        if which is not None:
            self.specimen(which)
        return replace(self, specimens=tuple(
            change(specimen) if which in (None, specimen.name) else specimen
            for specimen in self.specimens))

    def with_rig(self, **changes: Any) -> Setup:
        return replace(self, rig=replace(self.rig, **changes))


@dataclass(frozen=True)
class EffectParameter:
    """A number of an effect, in SI inside, with prior knowledge of it.

    ``power`` turns a value into its size, in which no effect is 0 and the readings are smooth.
    ``width``, ``low`` and ``high`` are values: ``width`` is typical, for a ``reason``; physics or
    geometry allow nothing beyond ``low`` and ``high``. The prior of the size has a heavy tail
    between them (:class:`~tympan.studies.effects.prior.HeavyTail`). ``unit`` is the one to show (""
    for plain numbers). Values other than 0 that are smaller than ``least`` cannot be built.
    ``even``: the sign changes no reading of a specimen that is its own mirror image. ``spread``
    belongs to a number that is no effect by itself but describes how another one acts, such as a
    time: its size is the logarithm of the value over ``width``, and this is its typical size.
    Sentences give ``tell(value)`` in ``told_in``, or the unit to show if that is left out, or "%"
    for plain numbers. ``name`` is that of the argument it annotates. A ``switch`` is 1 where the
    effect is present, and nothing between: no size is fitted.
    """

    meaning: str
    unit: str
    width: float
    low: float
    high: float
    reason: str
    power: Literal[1, -1, -2] = 1
    least: float = 0.0
    even: bool = False
    spread: float = 0.0
    told_in: str = ""
    tell: Callable[[float], float] = float
    name: str = ""
    switch: bool = False

    @cached_property
    def _unit(self) -> tuple[float, str]:
        return any_quantity(f"1 {self.unit}") or (1.0, "")

    @property
    def dimension(self) -> str:
        """Dimension, a key of :data:`tympan.base.units.DIMENSIONS`; "" for plain numbers."""
        return self._unit[1]

    def size(self, value: float) -> float:
        """Convert a value to a size: 0 where there is no effect."""
        if self.spread:
            return log(value / self.width) if value > 0 else -inf
        return float(value**self.power)

    def value(self, size: float) -> float:
        """Convert a size to a value."""
        if self.spread:
            value = self.width * exp(size)
            # Limits that come back from their logarithms must be exactly as they were.
            return next((end for end in (self.low, self.high) if isclose(value, end)), value)
        return inf if self.power < 0 and size == 0 else float(size ** (1 / self.power))

    def shown(self, value: float) -> float:
        return value / self._unit[0]

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest size."""
        low, high = sorted((self.size(self.low), self.size(self.high)))
        return low, high

    @property
    def deviation(self) -> float:
        """Typical size, that of ``width``."""
        return self.spread or self.size(self.width)

    @property
    def sign(self) -> Literal["signed", "positive", "even"]:
        """Signs that the size can have."""
        return "even" if self.even else "signed" if self.limits[0] < 0 else "positive"

    @property
    def prior(self) -> HeavyTail:
        """The distribution of the size."""
        return HeavyTail(self.deviation, *self.limits)


@dataclass(frozen=True)
class EffectFamily:
    """Effects that readings often cannot distinguish.

    ``measure`` is what they have in common, ``of(specimen, rig)`` its value. ``alike``: other
    effects with the same readings have at least and at most these multiples of its measure, by
    trial; some are no effects of the library. ``told_by`` are readings that distinguish them; if
    empty, each design decides whether its readings do. ``never_told``: no readings do, since causes
    outside the library have the same readings. ``finding`` is the sentence on all of them, with the
    measure as ``{share}`` or ``{size}``, and ``check`` is what to do; both have the specimen of an
    effect on one as ``{which}``.
    """

    name: str
    finding: str
    check: str
    measure: EffectParameter
    of: Callable[[Specimen, Rig], float]
    alike: tuple[float, float]
    told_by: tuple[Observable, ...] = ()
    never_told: bool = False

    @property
    def members(self) -> tuple[Effect, ...]:
        """Effects of the family, in the order of the registry."""
        return tuple(effect for effect in EFFECTS.values() if effect.family is self)


@dataclass(frozen=True)
class Effect:
    """A pure change of a :class:`Setup` by some parameters.

    ``edit(setup, *values)`` returns a new setup; values of size 0 must change no number of the
    solution. ``place``: whether it affects one specimen, one segment or two, which must be named,
    ``edit(setup, *values, which=name)``, rather than all or the rig. ``explanation`` is one
    sentence for someone in the laboratory. ``finding`` is the sentence where the effect is found,
    as :func:`tympan.studies.effects.findings.finding` fills it in, and ``check`` is what to do to
    see it directly; both have the place as ``{which}``. The effect shows in the observables
    ``shows_in`` alone, each of which is enough, or, if there are none, wherever it changes
    something. ``family`` is that of effects with the same readings, if any. ``twice``: it may be
    present twice, with different sizes.
    """

    name: str
    explanation: str
    finding: str
    check: str
    parameters: tuple[EffectParameter, ...]
    edit: Callable[..., Setup]
    place: Place = Place.EVERYTHING
    shows_in: tuple[Observable, ...] = ()
    family: EffectFamily | None = None
    twice: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of files, without all of which it cannot be seen."""
        return tuple(quantity.value for quantity in self.shows_in)

    def shown_by(self, read: Collection[Observable]) -> bool:
        """Check whether readings of some observables may show it."""
        return not self.shows_in or any(quantity in read for quantity in self.shows_in)

    @property
    def on_one(self) -> bool:
        """Whether it affects a place that must be named."""
        return self.place is not Place.EVERYTHING

    def choices(self, setup: Setup) -> tuple[str | None, ...]:
        """List the choices of ``which``."""
        if self.place is Place.EVERYTHING:
            return (None,)
        if self.place is Place.SPECIMEN:
            return tuple(specimen.name for specimen in setup.specimens)
        count = 1 if self.place is Place.SEGMENT else 2
        return tuple(_OF.join([_AND.join(names), specimen.name]) for specimen in setup.specimens
                     for names in combinations(specimen.electrode.names, count))

    def specimen_of(self, which: str | None) -> str | None:
        """Find the specimen of a choice of ``which``; None if it affects all of them."""
        if which is None or self.place is Place.SPECIMEN:
            return which
        return segments_in(which)[0]

    def apply(self, setup: Setup, values: Sequence[float], which: str | None = None) -> Setup:
        """Apply the effect to a setup: ``values`` in SI, ``which`` for an effect on one specimen.

        An :class:`InputError` for values beyond their limits or with which no specimen can be
        built, and where ``which`` is missing.
        """
        for parameter, value in zip(self.parameters, values, strict=True):
            if not parameter.low <= value <= parameter.high:
                raise InputError(f"must be from {parameter.low:g} to {parameter.high:g} (SI)",
                                 key=f"{self.name}.{parameter.name}", given=value)
        if (which is not None) != self.on_one:
            raise InputError(f"needs the place it happens to, {self.place.value}" if self.on_one
                             else "happens to no single specimen", key=self.name, given=which)
        return self.edit(setup, *values, **{"which": which} if self.on_one else {})

    def at(self, setup: Setup, sizes: Sequence[float], which: str | None = None) -> Setup:
        """Apply the effect to a setup at given sizes of its parameters."""
        values = [item.value(size) for item, size in zip(self.parameters, sizes, strict=True)]
        return self.apply(setup, values, which)


#: An effect by name, its values in SI, and the specimen it affects, if it is on one.
Use = tuple[str, tuple[float, ...], str | None]

#: All effects by name, in the order in which several are applied.
EFFECTS: Registry[Effect] = Registry("name")


def effect(explanation: str, *, finding: str, check: str, shows_in: tuple[Observable, ...] = (),
           family: EffectFamily | None = None, twice: bool = False
           ) -> Callable[[Callable[..., Setup]], Effect]:
    """Register an edit as the effect of its name: its annotated arguments are the parameters.

    An edit with an argument ``which`` is on one specimen, or on a :class:`Place` that annotates
    the argument.
    """
    def registered(edit: Callable[..., Setup]) -> Effect:
        hints = get_type_hints(edit, include_extras=True)
        parameters = tuple(replace(note, name=name) for name in inspect.signature(edit).parameters
                           for note in getattr(hints.get(name), "__metadata__", ())
                           if isinstance(note, EffectParameter))
        if not parameters:
            raise TypeError(f"the effect {edit.__name__} needs an argument annotated with an "
                            "EffectParameter")
        names = {item.name for item in parameters} | {"which"}
        unknown = {name for _, name, *_ in Formatter().parse(finding) if name} - names
        if unknown:
            raise TypeError(f"the finding of {edit.__name__} speaks of {', '.join(unknown)}, which "
                            "is no argument of it")
        made = Effect(edit.__name__, explanation, finding, check, parameters, edit,
                      _place(hints.get("which")), shows_in, family, twice)
        EFFECTS.register(made)
        edit.__doc__ = edit.__doc__ or explanation  # for help() of the edit
        return made

    return registered


def _place(hint: Any) -> Place:
    """Find the place of an effect by the annotation of its argument ``which``."""
    if hint is None:
        return Place.EVERYTHING
    notes = [note for note in getattr(hint, "__metadata__", ()) if isinstance(note, Place)]
    return notes[0] if notes else Place.SPECIMEN


def extended(setup: Setup, uses: Iterable[Use]) -> Setup:
    """Apply several effects to a setup, in the order of the registry."""
    order = list(EFFECTS)
    for name, values, which in sorted(uses, key=lambda use: order.index(use[0])):
        setup = EFFECTS[name].apply(setup, values, which)
    return setup
