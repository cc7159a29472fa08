"""Axes of a film's force law besides deflection and voltage: parameters of effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product

from tympan.base.errors import InputError
from tympan.fem.membrane.loading import Loading
from tympan.geometry.specimen import Specimen
from tympan.studies.effects import EFFECTS, Effect, EffectParameter, Setup
from tympan.studies.effects.effect import Observable

#: Where a film is solved: numbers of some axes and the sizes there, the others 0.
Sample = tuple[tuple[int, float], ...]

#: The largest size at which a film is sampled first, in standard deviations of the prior. Set by
#: trial.
FIRST_SPAN = 3.0

#: First sizes of a parameter with two signs, in standard deviations, on either side.
_FIRST_SIGNED = (1.3, FIRST_SPAN)
#: First sizes of a parameter with one sign, or whose sign changes nothing.
_FIRST = (1.4, FIRST_SPAN)

#: The largest size that is sought, in standard deviations: less than a thousandth of any prior is
#: beyond.
_FAR = 1e3
#: How closely that size is found, relative to it. A film is meshed a little before it in any case.
_CLOSE = 1e-3

#: How near to the largest size that can be built a film is still meshed, as a share.
_MESHED = 0.97

#: The least size a film must bear for its parameter to be an axis, in standard deviations.
_LEAST = 0.05


@dataclass(frozen=True)
class Axis:
    """One parameter of an effect that changes the film.

    ``places``: the sizes, ascending and without 0, at which the film is sampled; ``reachable``:
    the smallest and the largest size it could be sampled at, as far as known; ``ends``: why there
    are none beyond these, "" where the parameter's own limits say so. On a ``folded`` axis a sign
    changes nothing and the film depends on the square. A ``modulus`` is taken relative to the
    film's stiffness scale.
    """

    effect: str
    index: int
    places: tuple[float, ...]
    reachable: tuple[float, float]
    ends: tuple[str, str]
    folded: bool

    @property
    def parameter(self) -> EffectParameter:
        return EFFECTS[self.effect].parameters[self.index]

    @property
    def modulus(self) -> bool:
        return self.parameter.dimension == "stress"

    def nominal_size(self, size: float, stiffness: float = 1.0) -> float:
        """The size that does the same on the nominal film.

        As on a film ``stiffness`` times as stiff; without its sign where that changes nothing.
        """
        size = size / stiffness if self.modulus else size
        return abs(size) if self.folded else size

    def coordinate(self, size: float) -> float:
        """Interpolation coordinate: size over prior scale, squared if its sign changes nothing."""
        share = size / self.parameter.deviation
        return share**2 if self.folded else share

    def side(self, sense: int) -> tuple[float, ...]:
        """The places above 0, or below for ``sense`` -1, from 0 on."""
        return tuple(sorted((place for place in self.places if place * sense > 0), key=abs))

    def span(self, side: int) -> float:
        """The largest size sampled on side +1 or -1, without its sign."""
        places = self.side(1 if self.folded else side)
        return abs(places[-1]) if places else 0.0

    def reach(self, side: int) -> float:
        """The largest size that could be, without its sign."""
        return abs(self.reachable[side > 0 or self.folded])

    def with_place(self, size: float) -> Axis:
        """The axis with one place more."""
        return replace(self, places=tuple(sorted({*self.places, size})))

    def ended(self, side: int, reason: str) -> Axis:
        """The axis that reaches no further than where it is sampled."""
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
    """Specimen as finite elements see it: how its plate is held, and gas pressure [Pa].

    Without a plate its centre is held, by gas.
    """

    specimen: Specimen
    loading: Loading
    gas_pressure: float

    @classmethod
    def of(cls, setup: Setup, name: str) -> HeldFilm:
        """A specimen of a setup.

        Mechanisms between plate and ground act on the heave alone and are left out, and so is the
        electrodes' mass, which acts as one on the plate, and what no film at rest feels.
        """
        specimen, loading = setup.specimen(name), replace(setup.rig.loading, biases=())
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
        return cls(specimen, loading, setup.rig.gas_pressure if plate else 0.0)

    @property
    def odd(self) -> bool:
        """Whether its force is odd in the heave: no weight, no gas, no mass beside the centre."""
        return not self.loading.gravity and not self.gas_pressure and self.loading.arm == (0.0, 0.0)


def sampled_film(setup: Setup, name: str, axes: Sequence[Axis], sample: Sample) -> HeldFilm:
    """A specimen's film at a sample; parameters of the same effect are applied together.

    An :class:`InputError` where it cannot be built.
    """
    together: dict[str, list[float]] = {}
    for number, size in sample:
        axis = axes[number]
        sizes = together.setdefault(axis.effect, [0.0] * len(EFFECTS[axis.effect].parameters))
        sizes[axis.index] = size
    for effect in EFFECTS.values():
        if effect.name in together:
            setup = effect.at(setup, together[effect.name], name if effect.on_one else None)
    return HeldFilm.of(setup, name)


def film_axes(setup: Setup, name: str, shapes: bool = False) -> tuple[Axis, ...]:
    """The axes of a specimen's film, with their first places.

    With ``shapes`` those of effects, too, that only the film's shape shows; in it no sign changes
    nothing.
    """
    nominal = HeldFilm.of(setup, name)
    axes = [axis for effect in EFFECTS.values()
            if shapes or Observable.SHAPE not in effect.shows_in
            for index in range(len(effect.parameters))
            if (axis := _axis(setup, name, effect, index, shapes)).places]
    acting = {axis.effect for axis in axes
              if sampled_film(setup, name, (axis,), ((0, axis.places[-1]),)) != nominal}
    return tuple(axis for axis in axes if axis.effect in acting)


def acting_together(axes: Sequence[Axis]) -> list[tuple[Sample, ...]]:
    """Samples, by meshes, of effects one of whose axes only says how the others act.

    At the least places of these: each with the ends of that one, and every two together.
    """
    groups: list[tuple[Sample, ...]] = []
    for effect in dict.fromkeys(axis.effect for axis in axes if axis.parameter.spread):
        members = [number for number, axis in enumerate(axes) if axis.effect == effect]
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


def _axis(setup: Setup, name: str, effect: Effect, index: int, shapes: bool) -> Axis:
    """The axis of a parameter, as far as the specimen can be built."""
    parameter = effect.parameters[index]
    planes = frozenset() if shapes else setup.specimen(name).mirror_planes
    folded = parameter.sign == "even" and parameter.name[-1] in planes
    axis = Axis(effect.name, index, (), (0.0, 0.0), ("", ""), folded)

    def buildable(size: float, sign: int = 1) -> bool:
        try:
            sampled_film(setup, name, (axis,), ((0, sign * size),))
        except InputError:
            return False
        return True

    low, high = parameter.limits
    signs = (1,) if folded or low >= 0 else (-1, 1)
    first = _FIRST if len(signs) == 1 else _FIRST_SIGNED
    places, reachable, ends = [], [0.0, 0.0], ["", ""]
    for sign in signs:
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
    """The largest size up to a limit of which a film can be built; 0 if there is hardly any."""
    if buildable(limit):
        return limit
    low, high = 0.0, limit
    while high - low > _CLOSE * high and high > _LEAST * deviation:
        middle = (low + high) / 2
        low, high = (middle, high) if buildable(middle) else (low, middle)
    return low
