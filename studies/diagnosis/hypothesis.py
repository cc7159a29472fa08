"""Hypotheses: which effects are assumed together, and the places of their sizes among unknowns.

Unknowns of a hypothesis are the logarithms of a factor on all films' stiffness and of one on their
permittivity, then the sizes of its effects' parameters in its order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tympan.base.arrays import Array
from tympan.fem.film.laws.stiffened import scaled
from tympan.geometry.specimen import Film
from tympan.studies.effects import EFFECTS, Effect, EffectParameter, Use

#: Place of the stiffness factor's logarithm among the unknowns of every hypothesis.
STIFFNESS = 0
#: Place of the permittivity factor's logarithm.
PERMITTIVITY = 1

#: Places of the factors on stiffness and permittivity.
FACTORS = slice(0, 2)
#: Places of the sizes of a hypothesis' effects.
SIZES = slice(2, None)


@dataclass(frozen=True)
class Cause:
    """An effect by name, and the specimen or segment that it acts on, if it is on one.

    ``again``: it is a second instance of the same effect, with other sizes.
    """

    name: str
    which: str | None = None
    again: bool = False

    @property
    def first(self) -> Cause:
        """The cause that this one repeats; else itself."""
        return replace(self, again=False)

    @property
    def effect(self) -> Effect:
        """The effect of the registry."""
        return EFFECTS[self.name]

    @property
    def specimen(self) -> str | None:
        """Name of the specimen that it acts on, if it is on one."""
        return self.effect.specimen_of(self.which)

    def __str__(self) -> str:
        name = f"second_{self.name}" if self.again else self.name
        return name if self.which is None else f"{name} of {self.which}"


#: Effects that are assumed together; none for the nominal model.
Hypothesis = tuple[Cause, ...]


def with_factors(film: Film, stiffness: float, permittivity: float) -> Film:
    """Apply factors on stiffness and permittivity to a film."""
    return replace(film, material=scaled(film.material, stiffness),
                   relative_permittivity=film.relative_permittivity * permittivity)


def parameters_of(hypothesis: Hypothesis) -> list[EffectParameter]:
    """List the parameters of its effects in the order of their sizes."""
    return [parameter for cause in hypothesis for parameter in cause.effect.parameters]


def unknown_count(hypothesis: Hypothesis) -> int:
    """Count its unknowns."""
    return FACTORS.stop + len(parameters_of(hypothesis))


def sizes_of(hypothesis: Hypothesis, cause: Cause) -> slice:
    """Find the places of the sizes of one of its causes among the unknowns."""
    first = unknown_count(hypothesis[: hypothesis.index(cause)])
    return slice(first, first + len(cause.effect.parameters))


def parameter_at(hypothesis: Hypothesis, number: int) -> tuple[Cause, int]:
    """Find the cause whose size an unknown is, and the index among the cause's parameters."""
    cause = next(cause for cause in hypothesis
                 if number < sizes_of(hypothesis, cause).stop)
    return cause, number - sizes_of(hypothesis, cause).start


def uses_of(hypothesis: Hypothesis, unknowns: Array) -> tuple[Use, ...]:
    """List the effects with the values of their parameters at unknowns, shape (p,)."""
    return tuple(
        (cause.name, tuple(parameter.value(size) for parameter, size in zip(
            cause.effect.parameters, unknowns[sizes_of(hypothesis, cause)].tolist(),
            strict=True)), cause.which)
        for cause in hypothesis)


def hypotheses_of(causes: Sequence[Cause]) -> tuple[Hypothesis, ...]:
    """List each cause alone, then all pairs but those of one effect on two specimens.

    Effects that may occur twice are also paired with themselves.
    """
    singles: list[Hypothesis] = [(cause,) for cause in causes]
    pairs: list[Hypothesis] = [(first, second) for k, first in enumerate(causes)
                               for second in causes[k + 1 :] if first.name != second.name]
    twice: list[Hypothesis] = [(cause, replace(cause, again=True)) for cause in causes
                               if cause.effect.twice]
    return (*singles, *pairs, *twice)
