"""What a film's force law depends on besides heave and voltage: parameters of effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tympan.fem.membrane.loading import Loading
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.effects import EFFECTS, Effect, EffectParameter, Setup

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

    def coordinate(self, size: float, stiffness: float = 1.0) -> float:
        """u of a size, on a film of the nominal stiffness times ``stiffness``."""
        share = size / (self.span * stiffness if self.modulus else self.span)
        return share**2 if self.folded else share

    def size(self, coordinate: float) -> float:
        """The size at a coordinate, on a film of nominal stiffness."""
        return self.span * (coordinate**0.5 if self.folded else coordinate)


@dataclass(frozen=True)
class HeldFilm:
    """What the finite elements see of a specimen on a rig.

    Itself, how its plate is held, and gas pressure [Pa].
    """

    specimen: Specimen
    loading: Loading
    gas_pressure: float

    @classmethod
    def of(cls, setup: Setup, name: str) -> HeldFilm:
        """A specimen of a setup.

        Mechanisms between plate and ground act on the heave alone and are left out.
        """
        loading = replace(setup.rig.loading, biases=())
        specimen = setup.specimen(name)
        return cls(specimen,
                   loading if specimen.membrane.density else replace(loading, gravity=0.0),
                   setup.rig.gas_pressure)

    @property
    def heavy(self) -> bool:
        """Whether loads act on it that do not scale with its stiffness."""
        return bool(self.loading.gravity or self.gas_pressure)


def edited(setup: Setup, name: str, axes: Sequence[Axis], sizes: Sequence[float]) -> HeldFilm:
    """The film with some effects; sizes of parameters of the same effect are applied together."""
    together: dict[str, list[float]] = {}
    for axis, size in zip(axes, sizes, strict=True):
        values = together.setdefault(axis.effect, [0.0] * len(EFFECTS[axis.effect].parameters))
        values[axis.index] = size
    for effect in (effect for effect in EFFECTS.values() if effect.name in together):
        setup = effect.at(setup, together[effect.name], name if effect.on_one else None)
    return HeldFilm.of(setup, name)


def film_axes(setup: Setup, name: str) -> tuple[Axis, ...]:
    """The axes of a specimen's film."""
    nominal = HeldFilm.of(setup, name)
    axes = []
    for effect in EFFECTS.values():
        for index, parameter in enumerate(effect.parameters):
            axis = _axis(setup, name, effect, index, parameter)
            if axis is not None and edited(setup, name, (axis,), (axis.span,)) != nominal:
                axes.append(axis)
    return tuple(axes)


def changes_rig(setup: Setup, effect: Effect) -> bool:
    """Whether an effect edits the rig."""
    which = setup.specimens[0].name if effect.on_one else None
    sizes = [parameter.deviation for parameter in effect.parameters]
    try:
        return effect.at(setup, sizes, which).rig != setup.rig
    except InputError:  # the specimen cannot bear it, so it is the film that it changes
        return False


def _axis(setup: Setup, name: str, effect: Effect, index: int,
          parameter: EffectParameter) -> Axis | None:
    """The axis of a parameter, as long as the specimen can be built.

    None where hardly any of it can be.
    """
    low, high = parameter.limits
    reach = min(REACH * parameter.deviation, max(high, -low))
    two_sided = low < 0
    planes = setup.specimen(name).mirror_planes
    folded = parameter.sign == "even" and parameter.name[-1] in planes
    axis = Axis(effect.name, index, min(reach, high), two_sided and not folded, folded,
                parameter.dimension == "stress")
    while axis.span > _LEAST_SHARE * reach:
        try:
            for size in (axis.span, -axis.span) if axis.two_sided else (axis.span,):
                edited(setup, name, (axis,), (size,))
        except InputError:
            axis = replace(axis, span=0.7 * axis.span)
        else:
            return axis
    return None
