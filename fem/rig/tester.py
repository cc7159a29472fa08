"""Tester that moves the plate: its gauge, its displacement and its compliance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from tympan.base.fields import Key, takes_units
from tympan.base.toml_reader import NON_NEGATIVE
from tympan.fem.rig.gain import GAIN

#: Number of corrections of the plate's deflection in a compliant tester. Few are enough, since a
#: film's force is nearly linear.
_CORRECTIONS = 5


@takes_units
@dataclass(frozen=True, kw_only=True)
class Tester:
    """Tester that holds the plate at displacements and reads forces; the defaults are ideal."""

    gauge_zero: Annotated[float, Key("what a tester's gauge shows at no force", "force")] = 0.0
    gauge_gain: Annotated[float, Key("k: a tester's gauge reads (1+k) F", rule=GAIN)] = 0.0
    displacement_zero: Annotated[float, Key("what a tester's displacement shows at the flat film",
                                            "length")] = 0.0
    tester_compliance: Annotated[float, Key(
        "by which a tester yields between its own displacement and the plate", "compliance",
        NON_NEGATIVE)] = 0.0

    def gauged(self, force: Callable[[Any], Any], stiffness: Callable[[Any], Any],
               displacement: Any) -> Any:
        """Compute the force [N] that a tester's gauge shows at a displacement [m] that it shows.

        ``force`` and ``stiffness`` give the film's force on the plate and its slope at deflections
        of the plate. The plate is where tester and film are in equilibrium.
        """
        at, yields = displacement - self.displacement_zero, self.tester_compliance
        plate = at
        for _ in range(_CORRECTIONS if yields else 0):
            off = plate + yields * force(plate) - at
            plate = plate - off / (1 + yields * stiffness(plate))
        return (1 + self.gauge_gain) * force(plate) + self.gauge_zero
