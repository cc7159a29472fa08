"""Axes of a film's force law besides deflection and voltage: parameters of effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product

import numpy as np

from tympan.base.errors import InputError
from tympan.fem.membrane.loading import Loading
from tympan.geometry.specimen import Specimen
from tympan.studies.effects import EFFECTS, Effect, EffectParameter, Setup
from tympan.studies.effects.effect import Observable

#: A point at which a film is solved: numbers of some axes with their sizes, the others 0.
Sample = tuple[tuple[int, float], ...]

#: Largest size at which a film is sampled first, in standard deviations of the prior. Set by trial.
FIRST_SPAN = 3.0

#: First sizes of a parameter with two signs, in standard deviations, on either side.
_FIRST_SIGNED = (1.3, FIRST_SPAN)
#: First sizes of a parameter with one sign, or with a sign that changes nothing.
_FIRST = (1.4, FIRST_SPAN)

#: Largest size searched, in standard deviations: less than a thousandth of any prior is beyond.
_FAR = 1e3
#: Relative accuracy of that size. A film is meshed a little before it in any case.
_CLOSE = 1e-3

#: Share of the largest size that can be built at which a film is still meshed.
_MESHED = 0.97

#: Least size that a film must bear for its parameter to be an axis, in standard deviations.
_LEAST = 0.05


@dataclass(frozen=True)
class Axis:
    """One parameter of an effect that changes the film.

    ``places`` are the sizes, ascending and without 0, at which the film is sampled. ``reachable``
    are the smallest and the largest size at which it could be sampled, as far as known; ``ends``
    say why not beyond, "" where the parameter's own limits do. On a ``folded`` axis a sign changes
    nothing and the film depends on the square. A ``modulus`` is relative to the film's stiffness
    scale. ``which``: the specimen or segment that the effect acts on, if it acts on one.
    """

    effect: str
    index: int
    places: tuple[float, ...]
    reachable: tuple[float, float]
    ends: tuple[str, str]
    folded: bool
    which: str | None = None

    @property
    def parameter(self) -> EffectParameter:
        return EFFECTS[self.effect].parameters[self.index]

    @property
    def modulus(self) -> bool:
        return self.parameter.dimension == "stress"

    def nominal_size(self, size: float, stiffness: float = 1.0) -> float:
        """Convert a size on a film ``stiffness`` times as stiff to that on the nominal film.

        The result has no sign where that changes nothing.
        """
        size = size / stiffness if self.modulus else size
        return abs(size) if self.folded else size

    def coordinate(self, size: float) -> float:
        """Compute the interpolation coordinate: size over prior scale, squared if folded."""
        share = size / self.parameter.deviation
        return share**2 if self.folded else share

    def side(self, sense: int) -> tuple[float, ...]:
        """List the places above 0, or below for ``sense`` -1, from 0 on."""
        return tuple(sorted((place for place in self.places if place * sense > 0), key=abs))

    def span(self, side: int) -> float:
        """Find the largest size sampled on side +1 or -1, without its sign."""
        places = self.side(1 if self.folded else side)
        return abs(places[-1]) if places else 0.0

    def reach(self, side: int) -> float:
        """Find the largest size that could be sampled, without its sign."""
        return abs(self.reachable[side > 0 or self.folded])

    def with_place(self, size: float) -> Axis:
        """Add a place to the axis."""
        return replace(self, places=tuple(sorted({*self.places, size})))

    def ended(self, side: int, reason: str) -> Axis:
        """End the axis at its last sample on a side, with a reason."""
        last = side * self.span(side)
        why = f"cannot be solved beyond {_shown(self.parameter, last)}: {reason}"
        (low, high), (below, above) = self.reachable, self.ends
        if side > 0:
            ends = (why if self.folded else below, why)
            return replace(self, reachable=(low, last), ends=ends)
        return replace(self, reachable=(last, high), ends=(why, above))


def _shown(parameter: EffectParameter, size: float) -> str:
    return f"{parameter.shown(parameter.value(size)):.3g} {parameter.unit}".strip()


@dataclass(frozen=True)
class HeldFilm:
    """Specimen as it is solved: how its plate is held, and gas pressure [Pa].

    Without a plate its centre is held, by gas. ``formula``: film in closed form that computes it.
    """

    specimen: Specimen
    loading: Loading
    gas_pressure: float
    formula: str | None = None

    @classmethod
    def of(cls, setup: Setup, name: str) -> HeldFilm:
        """Take a specimen of a setup.

        Mechanisms between plate and ground depend on the deflection alone and are left out. So is
        the electrodes' mass, which acts like one on the plate, and all that does not affect a film
        at rest.
        """
        specimen, loading = setup.specimen(name), replace(setup.rig.loading, biases=())
        specimen = with_shares(specimen)
        if specimen.electrode.mass:
            specimen = replace(specimen, electrode=replace(specimen.electrode, mass=0.0))
        specimen = replace(specimen, membrane=replace(specimen.membrane, branches=(),
                                                      mounted=None, temperature_power=0.0))
        # A film without plate is held by gas, and its weight counts as a part of that.
        plate = specimen.plate is not None
        if not plate:
            loading = Loading(gravity=0.0)
        elif not specimen.membrane.density:
            loading = replace(loading, gravity=0.0)
        return cls(specimen, loading, setup.rig.gas_pressure if plate else 0.0, setup.formula)

    @property
    def segments(self) -> int:
        """Number of U² that it depends on."""
        return max(1, len(self.specimen.electrode.segments))

    @property
    def odd(self) -> bool:
        """Whether its force is odd in the deflection: no weight, no gas, no mass off the centre."""
        return not self.loading.gravity and not self.gas_pressure and self.loading.arm == (0.0, 0.0)


def sampled_film(setup: Setup, name: str, axes: Sequence[Axis], sample: Sample) -> HeldFilm:
    """Make a specimen's film at a sample; parameters of the same effect are applied together.

    An :class:`InputError` where it cannot be built.
    """
    together: dict[tuple[str, str | None], list[float]] = {}
    for number, size in sample:
        axis = axes[number]
        sizes = together.setdefault((axis.effect, axis.which),
                                    [0.0] * len(EFFECTS[axis.effect].parameters))
        sizes[axis.index] = size
    order = list(EFFECTS)
    for effect, which in sorted(together, key=lambda use: order.index(use[0])):
        setup = EFFECTS[effect].at(setup, together[effect, which], which)
    return HeldFilm.of(setup, name)


def with_shares(specimen: Specimen, shares: Iterable[float] | None = None) -> Specimen:
    """Set what voltages reach the segments of an electrode, over the film's, by these numbers.

    By default all differ, so that no film is its own mirror image where its voltages need not be.
    """
    segments = specimen.electrode.segments
    if not segments:
        return specimen
    every = 1 - np.arange(len(segments)) / (2 * len(segments)) if shares is None else shares
    return replace(specimen, electrode=replace(specimen.electrode, segments=tuple(
        replace(segment, share=float(share), lead=None)
        for segment, share in zip(segments, every, strict=True))))


def film_axes(setup: Setup, name: str, shapes: bool = False, slopes: bool = False
              ) -> tuple[Axis, ...]:
    """Find the axes of a specimen's film, with their first places.

    With ``shapes`` effects that only the film's shape shows are included, with ``slopes`` those
    that the plate's slopes show; then no axis is folded, since every sign changes these.
    """
    nominal = HeldFilm.of(setup, name)
    shown = {Observable.SHAPE} if shapes else set()
    shown |= {Observable.SLOPE} if slopes else set()
    unread = {Observable.SHAPE, Observable.SLOPE} - shown
    axes = [axis for effect in EFFECTS.values()
            if not effect.shows_in or not unread.issuperset(effect.shows_in)
            for which in effect.choices(setup)
            if effect.specimen_of(which) in (None, name)
            for index in range(len(effect.parameters))
            if (axis := _axis(setup, name, effect, index, which, bool(shown))).places]
    acting = {(axis.effect, axis.which) for axis in axes
              if sampled_film(setup, name, (axis,), ((0, axis.places[-1]),)) != nominal}
    return tuple(axis for axis in axes if (axis.effect, axis.which) in acting)


def acting_together(axes: Sequence[Axis]) -> list[tuple[Sample, ...]]:
    """Choose samples, by meshes, of effects with an axis that only modifies the other axes.

    They are at the least places of these axes: each with the ends of the modifying axis, and every
    two together.
    """
    groups: list[tuple[Sample, ...]] = []
    for effect in dict.fromkeys(
            (axis.effect, axis.which) for axis in axes if axis.parameter.spread):
        members = [number for number, axis in enumerate(axes)
                   if (axis.effect, axis.which) == effect]
        how = [number for number in members if axes[number].parameter.spread]
        acting = {number: [place for sense in (1, -1) for place in axes[number].side(sense)[:1]]
                  for number in members if number not in how}
        groups += [tuple(_ascending((number, place), (other, end)) for other in how
                         for end in (axes[other].places[0], axes[other].places[-1]))
                   for number, places in acting.items() for place in places]
        groups += [tuple(_ascending((first, size), (second, other))
                         for size, other in product(acting[first], acting[second]))
                   for first, second in combinations(acting, 2)]
    return groups


def _ascending(*places: tuple[int, float]) -> Sample:
    return tuple(sorted(places))


def _axis(setup: Setup, name: str, effect: Effect, index: int, which: str | None, signs: bool
          ) -> Axis:
    """Make the axis of a parameter, as far as the specimen can be built.

    ``signs``: no sign is without consequence.
    """
    parameter = effect.parameters[index]
    planes = frozenset() if signs else HeldFilm.of(setup, name).specimen.mirror_planes
    folded = parameter.sign == "even" and parameter.name[-1] in planes
    axis = Axis(effect.name, index, (), (0.0, 0.0), ("", ""), folded, which)

    def buildable(size: float, sign: int = 1) -> bool:
        try:
            sampled_film(setup, name, (axis,), ((0, sign * size),))
        except InputError:
            return False
        return True

    low, high = parameter.limits
    senses = (1,) if folded or low >= 0 else (-1, 1)
    first = _FIRST if len(senses) == 1 else _FIRST_SIGNED
    places, reachable, ends = [], [0.0, 0.0], ["", ""]
    for sign in senses:
        limit = max(high, -low) if folded else high if sign > 0 else -low
        limit = min(limit, _FAR * parameter.deviation)
        largest = _largest(partial(buildable, sign=sign), limit, parameter.deviation)
        if largest < limit:
            ends[sign > 0] = f"cannot be built beyond {_shown(parameter, sign * largest)}"
            largest *= _MESHED
        reachable[sign > 0] = sign * largest
        shrunk = min(1.0, largest / (first[-1] * parameter.deviation))
        if largest >= _LEAST * parameter.deviation:
            places += [sign * shrunk * share * parameter.deviation for share in first]
    places = [place for place in places if buildable(place)]
    below = ends[1] if folded else ends[0]
    return replace(axis, places=tuple(sorted(places)), reachable=(reachable[0], reachable[1]),
                   ends=(below, ends[1]))


def _largest(buildable: Callable[[float], bool], limit: float, deviation: float) -> float:
    """Find the largest size up to a limit of which a film can be built; 0 if hardly any can."""
    if buildable(limit):
        return limit
    low, high = 0.0, limit
    while high - low > _CLOSE * high and high > _LEAST * deviation:
        middle = (low + high) / 2
        low, high = (middle, high) if buildable(middle) else (low, middle)
    return low
