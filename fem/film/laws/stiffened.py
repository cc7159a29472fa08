"""Laws made from another law: hardened, with a second invariant, or scaled by a factor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.base.fields import Key, fields_of
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.fem.film.laws.invariants import MooneyRivlin, of_first_invariant
from tympan.geometry.specimen import LAWS, Material

_EXPONENT: Rule = (lambda x: -1 < x <= 10, "must be above -1 and at most 10")
_INVARIANT: Rule = (lambda x: 3 <= x <= 1000, "must be from 3 (the virgin film's) to 1000")
_SHARE: Rule = (lambda x: -1 <= x <= 1, "must be from -1 to 1")


@LAWS.register
@dataclass(frozen=True)
class Stiffened:
    """Another law, plus an energy φ of the first invariant that hardens it.

    Where the film is mounted, φ adds no stress.

    φ = S [I_m/(1+h) (I₁/I_m)^(1+h) − I₁], so that φ′ = S [(I₁/I_m)^h − 1]: nothing at I₁ = I_m. S
    is the slope of the neo-Hookean law with the modulus of the ``nominal`` one, ∂²W/∂λ₁²/8 of the
    virgin film; h = ``exponent``, without unit, I_m = ``invariant``, I₁ of the mounted film. A
    neo-Hookean film gets ∂W/∂I₁ = S (I₁/I_m)^h, as Gent's law has it about I_m with h = I_m/(J + 3
    − I_m). h > 0 hardens, h < 0 softens; h = 0 is the nominal law. The virgin film changes too: its
    modulus becomes that of the nominal law times about (3/I_m)^h. Where the nominal law is
    undefined, so is this.

    Examples
    --------
    >>> from tympan.fem.film.laws import NeoHooke
    >>> nominal = NeoHooke(20e3)
    >>> law = Stiffened(nominal, exponent=0.2, invariant=8.0625)
    >>> [round(float(kind.derivatives(2.0, 2.0)[1])) for kind in (nominal, law)]
    [39375, 39375]
    >>> [round(float(kind.derivatives(3.0, 3.0)[1])) for kind in (nominal, law)]
    [59918, 70368]
    """

    law: ClassVar[str] = "stiffened"
    nominal: Annotated[Material, Key("the law that is hardened", kinds=LAWS)]
    exponent: Annotated[float, Key("h: above 0 hardens, below softens", rule=_EXPONENT)]
    invariant: Annotated[float, Key("I_m, the first invariant of the mounted film",
                                    rule=_INVARIANT)]

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        return _sum(self.nominal.derivatives(l1, l2), of_first_invariant(self._energy, l1, l2))

    def _energy(self, excess: Any) -> tuple[Any, Any, Any]:
        """Compute φ counted from the virgin film, φ′ and φ″; ``scale`` is S."""
        h, mounted = self.exponent, self.invariant
        scale = _neo_hookean_slope(self.nominal)
        ratio = (excess + 3) / mounted
        power = ratio**h
        energy = mounted / (1 + h) * (power * ratio - (3 / mounted) ** (1 + h)) - excess
        bend = h * power / (ratio * mounted)
        return scale * energy, scale * (power - 1), scale * bend


@LAWS.register
@dataclass(frozen=True)
class MooneyShare:
    """Another law, of whose stress a share comes from Mooney's second invariant instead.

    Where the film is mounted, stretched equally along both axes, the stress stays.

    φ = s S [(I₂ − 3)/J − (I₁ − 3)] is added to the ``nominal`` energy; s = ``share``, without unit,
    J = ``area``, λ₁λ₂ of the mounted film, 1 for the virgin one. S is the slope of the neo-Hookean
    law with the modulus of the ``nominal`` one, ∂²W/∂λ₁²/8 of the virgin film. As ∂I₂/∂λ₁ = λ₂²
    ∂I₁/∂λ₁, nothing pulls more at λ₁ = λ₂ = √J. A neo-Hookean film becomes Mooney's and Rivlin's
    with c₁₀ = (1 − s) S and c₀₁ = s S/J: equally stretched beyond J it is stiffer with s > 0, in a
    narrow strip softer. With large stretches ∂W/∂I₂ of rubber falls (Rivlin, Saunders, Phil. Trans.
    R. Soc. A 243, 251, 1951), here it is constant, as Mooney's. Where the nominal law is undefined,
    so is this.

    Examples
    --------
    >>> from tympan.fem.film.laws import NeoHooke
    >>> nominal = NeoHooke(20e3)
    >>> law = MooneyShare(nominal, share=0.2, area=4.0)
    >>> [round(float(kind.derivatives(2.0, 2.0)[1])) for kind in (nominal, law)]
    [39375, 39375]
    >>> [round(float(kind.derivatives(3.0, 3.0)[1])) for kind in (nominal, law)]
    [59918, 74897]
    """

    law: ClassVar[str] = "mooney_share"
    nominal: Annotated[Material, Key("the law that gives up a share", kinds=LAWS)]
    share: Annotated[float, Key("s: of the stress, from the second invariant", rule=_SHARE)]
    area: Annotated[float, Key("J, the area stretch of the mounted film", rule=POSITIVE)]

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        slope = self.share * _neo_hookean_slope(self.nominal)
        added = MooneyRivlin(c10=-slope, c01=slope / self.area)
        return _sum(self.nominal.derivatives(l1, l2), added.derivatives(l1, l2))


def _neo_hookean_slope(law: Any) -> Any:
    """Compute ∂W/∂I₁ of the neo-Hookean law with the modulus of a virgin film's law [Pa]."""
    return law.derivatives(np.ones(()), np.ones(()))[3] / 8


def _sum(first: Iterable[Any], second: Iterable[Any]) -> tuple[Any, ...]:
    return tuple(value + more for value, more in zip(first, second, strict=True))


def scaled(material: Material, factor: float) -> Material:
    """Multiply every stress of a law, and so its energy, by a factor.

    Examples
    --------
    >>> from tympan.fem.film.laws import Ogden
    >>> scaled(Ogden((20e3, 100.0), (2.0, 4.0)), 1.5)
    Ogden(mu=(30000.0, 150.0), alpha=(2.0, 4.0))
    """
    law: Any = material
    changed: dict[str, Any] = {}
    for field in fields_of(type(law)):
        value = getattr(law, field.name)
        if field.says.kinds is not None:
            changed[field.name] = scaled(value, factor)
        elif field.says.dimension == "stress":
            changed[field.name] = (tuple(factor * stress for stress in value) if field.several
                                   else factor * value)
    stiffer: Material = replace(law, **changed)
    return stiffer
