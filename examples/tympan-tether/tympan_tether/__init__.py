"""A tether that tightens: an effect and the mechanism it puts between plate and ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from tympan.base.fields import Key
from tympan.base.toml_reader import NON_NEGATIVE
from tympan.fem.membrane.biases import BIASES
from tympan.studies.effects.effect import EffectParameter, Setup, effect

_REFERENCE = 1e-3  #: deflection at which the pull is stated [m]


@BIASES.register
@dataclass(frozen=True)
class Tether:
    """A slack lead or thread whose pull grows with the third power of the deflection."""

    law: ClassVar[str] = "tether"
    pull: Annotated[float, Key("its pull at 1 mm", "force", NON_NEGATIVE)]

    def derivatives(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Energy [J], force against the deflection [N] and stiffness [N/m] at a deflection [m]."""
        share = deflection / _REFERENCE
        return (self.pull * _REFERENCE * share**4 / 4, self.pull * share**3,
                3 * self.pull * share**2 / _REFERENCE)


@effect("A slack lead tightens as the plate goes down.",
        finding="A tether tightens: it pulls with {F_1} at 1 mm, and 27 times as much at 3 mm",
        check="take the leads off the plate, or make them longer, and read the lowest state again")
def tether(setup: Setup, F_1: Annotated[float, EffectParameter(
        "pull at 1 mm, growing with the third power", "mN", width=0.5e-3, low=0.0, high=1.0,
        reason="a lead of 30 mm with 1 mm of slack, by a ruler; no source")]) -> Setup:
    """The setup with a tether on every plate."""
    return setup.with_rig(biases=(*setup.rig.biases, Tether(F_1)))
