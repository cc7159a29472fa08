"""The law of Mooney and Rivlin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from tympan.fem.film.laws.invariants import first_invariant, second_invariant
from tympan.geometry.fields import Key
from tympan.geometry.specimen import LAWS


@LAWS.register
@dataclass(frozen=True)
class MooneyRivlin:
    """The law of Mooney (J. Appl. Phys. 11, 582, 1940) and Rivlin.

    W = c₁₀ (I₁ − 3) + c₀₁ (I₂ − 3), c₁₀ and c₀₁ in Pa (Rivlin, Phil. Trans. R. Soc. A 241, 379,
    1948). It follows unfilled rubber in tension up to
    stretches of about 2 to 3; in equibiaxial tension its second term is apt to be far too stiff
    (Treloar, *The Physics of Rubber Elasticity*, 3rd ed. 1975), so constants fitted to uniaxial
    tests alone are not for films. It does not lock.

    Examples
    --------
    >>> film = MooneyRivlin(c10=8e3, c01=2e3)
    >>> film.shear_modulus
    20000.0
    """

    law: ClassVar[str] = "mooney_rivlin"
    stress_free_when_virgin: ClassVar[bool] = True
    c10: Annotated[float, Key("c₁₀", "stress")]
    c01: Annotated[float, Key("c₀₁", "stress")]

    @property
    def shear_modulus(self) -> float:
        """Small-strain shear modulus 2 (c₁₀ + c₀₁) [Pa]."""
        return 2 * (self.c10 + self.c01)

    def derivatives(self, l1: Any, l2: Any) -> tuple[Any, ...]:
        pairs = zip(first_invariant(l1, l2), second_invariant(l1, l2), strict=True)
        return tuple(self.c10 * first + self.c01 * second for first, second in pairs)
