"""Grips of strips in tests of the rubber: how far they hold or free the strip's width."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.base.fields import Key, takes_units
from tympan.base.toml_reader import Rule

_SHARE: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")


@takes_units
@dataclass(frozen=True, kw_only=True)
class Grips:
    """Grips of strips; the default strips deform as their tests are said to."""

    width_held: Annotated[float, Key("of strips in tests said to be uniaxial, how far the grips "
                                     "hold their width: 0 not at all, 1 as in pure shear",
                                     rule=_SHARE)] = 0.0
    width_let: Annotated[float, Key("of strips in tests said to be in pure shear, how far the "
                                    "grips let them narrow: 0 not at all, 1 as in a uniaxial test",
                                    rule=_SHARE)] = 0.0

    def width_shift(self, mode: AnyArray) -> Array:
        """Look up how far tests of these modes are shifted to the other width, (tests,).

        0 is as said; 1 is pure shear for "uniaxial", uniaxial for "pure_shear".
        """
        return np.select([mode == "uniaxial", mode == "pure_shear"],
                         [self.width_held, self.width_let], 0.0)

    def stretch_across(self, mode: AnyArray, along: Array, free: Array) -> Any:
        """Compute the stretch across strips, (tests,); ``free`` is that of uniaxial free strips.

        A strip in neither mode stretches across as it does ``along``.
        """
        return np.select([mode == "uniaxial", mode == "pure_shear"],
                         [free ** (1 - self.width_held), along ** (-0.5 * self.width_let)], along)
