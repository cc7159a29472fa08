"""What a film's force law depends on besides heave and voltage: parameters of effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tympan.fem.membrane.loading import Loading
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.effects import EFFECTS, Effect, Setup

#: Where a film is solved: numbers of some axes and the coordinates there, the others 0.
Sample = tuple[tuple[int, float], ...]

#: How far from no effect a force law reaches, in standard deviations of the prior.
REACH = 3.0

_LEAST_SHARE = 0.02


@dataclass(frozen=True)
class Axis:
    """One parameter of an effect that changes the film.

    ``span`` is the size at which the coordinate u is 1. On a ``folded`` axis a sign changes nothing
    and u is a square. A ``modulus`` is taken relative to the film's stiffness scale. ``two_sided``:
    whether u may be negative.
    """

    effect: str
    index: int
    span: float
    two_sided: bool
    folded: bool
    modulus: bool

    @property
    def places(self) -> tuple[float, ...]:
        """Coordinates at which it is sampled besides 0."""
        return (-1.0, -0.5, -0.25, 0.25, 0.5, 1.0) if self.two_sided else (0.3, 0.65, 1.0)

    def coordinate(self, size: float, stiffness: float = 1.0) -> float:
        """u of a size, on a film of the nominal stiffness times ``stiffness``."""
        share = size / (self.span * stiffness if self.modulus else self.span)
        return share**2 if self.folded else share

    def size(self, coordinate: float) -> float:
        """The size at a coordinate, on a film of nominal stiffness."""
        return self.span * (coordinate**0.5 if self.folded else coordinate)


@dataclass(frozen=True)
class HeldFilm:
    """What the finite elements see of a specimen: how its plate is held, and gas pressure [Pa]."""

    specimen: Specimen
    loading: Loading
    gas_pressure: float

    @classmethod
    def of(cls, setup: Setup, name: str) -> HeldFilm:
        """A specimen of a setup.

        Mechanisms between plate and ground act on the heave alone and are left out.
        """
        specimen, loading = setup.specimen(name), replace(setup.rig.loading, biases=())
        if not specimen.membrane.density:
            loading = replace(loading, gravity=0.0)
        return cls(specimen, loading, setup.rig.gas_pressure)

    @property
    def odd(self) -> bool:
        """Whether its force is odd in the heave: no weight, no gas, no mass beside the centre."""
        return not self.loading.gravity and not self.gas_pressure and self.loading.arm == (0.0, 0.0)


def sampled_film(setup: Setup, name: str, axes: Sequence[Axis], sample: Sample) -> HeldFilm:
    """A specimen's film at a sample; parameters of the same effect are applied together."""
    together: dict[str, list[float]] = {}
    for index, at in sample:
        axis = axes[index]
        sizes = together.setdefault(axis.effect, [0.0] * len(EFFECTS[axis.effect].parameters))
        sizes[axis.index] = axis.size(at)
    for effect in EFFECTS.values():
        if effect.name in together:
            setup = effect.at(setup, together[effect.name], name if effect.on_one else None)
    return HeldFilm.of(setup, name)


def film_axes(setup: Setup, name: str) -> tuple[Axis, ...]:
    """The axes of a specimen's film."""
    nominal = HeldFilm.of(setup, name)
    axes = (_axis(setup, name, effect, index) for effect in EFFECTS.values()
            for index in range(len(effect.parameters)))
    return tuple(axis for axis in axes
                 if axis and sampled_film(setup, name, (axis,), ((0, 1.0),)) != nominal)


def _axis(setup: Setup, name: str, effect: Effect, index: int) -> Axis | None:
    """The axis of a parameter, as long as the specimen can be built; None where hardly any can."""
    parameter = effect.parameters[index]
    low, high = parameter.limits
    reach = min(REACH * parameter.deviation, max(high, -low))
    planes = setup.specimen(name).mirror_planes
    folded = parameter.sign == "even" and parameter.name[-1] in planes
    axis = Axis(effect.name, index, min(reach, high), low < 0 and not folded, folded,
                parameter.dimension == "stress")
    while axis.span > _LEAST_SHARE * reach:
        try:
            for at in (1.0, -1.0) if axis.two_sided else (1.0,):
                sampled_film(setup, name, (axis,), ((0, at),))
        except InputError:
            axis = replace(axis, span=0.7 * axis.span)
        else:
            return axis
    return None
