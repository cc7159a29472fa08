"""Every kind of mechanism between plate and ground once; a new one must be added here."""

from __future__ import annotations

from tympan.fem.membrane.biases import (
    Bistable,
    BuckledBeam,
    Constant,
    ForceTable,
    Magnet,
    Spring,
)

#: By law, near a deflection of 4 mm, and all there from -3 to 9 mm.
SAMPLES = {
    "spring": Spring(7.0, 1e-3),
    "constant": Constant(-0.05),
    "magnet": Magnet(0.5, 12e-3, 6e-3, 3.3),
    "bistable": Bistable(0.08, 6e-3, 0.05, 1e-3),
    "buckled_beam": BuckledBeam(30e-3, 4e-3, 0.1e-3, 1.5e9, 0.4e-3, 2, 3e-3),
    "table": ForceTable((-5e-3, 0.0, 3e-3, 5e-3, 12e-3), (-0.1, 0.01, 0.02, 0.02, 0.09)),
}
