"""Electric strength of films: laws, and cited constants by name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.base.fields import Key, read
from tympan.base.toml_reader import Library, Rule
from tympan.geometry.specimen import STRENGTHS, Strength

_FIELD: Rule = (lambda x: 1e4 <= x <= 1e10, "must be from 0.01 to 10000 MV/m")
_EXPONENT: Rule = (lambda x: -10 <= x <= 10, "must be from -10 to 10")
_THICKNESS: Rule = (lambda x: 1e-7 <= x <= 0.1, "must be from 0.1 um to 10 cm")


@STRENGTHS.register
@dataclass(frozen=True)
class ConstantStrength:
    """The same ``strength`` [V/m] at any stretch of the film."""

    law: ClassVar[str] = "constant"
    strength: Annotated[float, Key("field at breakdown", "field", _FIELD)]

    def field(self, l1: Any, l2: Any, thickness: Any) -> Any:
        return self.strength + 0 * (l1 + l2 + thickness)


@STRENGTHS.register
@dataclass(frozen=True)
class PowerStrength:
    """E_b = strength · λ^exponent · (h/thickness)^(−thickness_exponent), λ = √(λ₁λ₂).

    h is the stretched thickness. The strengths of films were measured in equibiaxial stretch; at
    other stretches λ stands for the square root of the area stretch.
    """

    law: ClassVar[str] = "power"
    strength: Annotated[float, Key("of the unstretched film of that thickness", "field", _FIELD)]
    exponent: Annotated[float, Key("power of the stretch √(λ₁λ₂)", rule=_EXPONENT)]
    thickness_exponent: Annotated[float, Key(
        "power of the inverse stretched thickness", rule=_EXPONENT)] = 0.0
    thickness: Annotated[float, Key("stretched thickness that the strength is of", "length",
                                    _THICKNESS, needs="thickness_exponent")] = 1e-3

    def field(self, l1: Any, l2: Any, thickness: Any) -> Any:
        return (self.strength * np.sqrt(l1 * l2) ** self.exponent
                * (thickness / self.thickness) ** -self.thickness_exponent)


@dataclass(frozen=True)
class LibraryStrength:
    """A strength of the library."""

    strength: Annotated[Strength, Key("the law with its constants", kinds=STRENGTHS)]
    source: Annotated[str, Key("where the constants come from")]
    caveat: Annotated[str, Key("what to beware of")]


STRENGTH_LIBRARY = Library(Path(__file__).with_name("strengths.toml"), dict,
                           partial(read, LibraryStrength))
