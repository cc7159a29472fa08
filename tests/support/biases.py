"""Every kind of mechanism between plate and ground once; a new one must be added here."""

from __future__ import annotations

from tests.support.specimens import circular
from tympan.fem.membrane.biases import (
    Bistable,
    BuckledBeam,
    Constant,
    ForceTable,
    JoinedFilm,
    Magnet,
    Spring,
)
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings, build_model
from tympan.studies.joined_film import SolvedFilm

#: A film that is pushed out by 2 mm where the plate is at 0, at 2 kV.
JOINED = JoinedFilm(circular(), 20e-3, 22e-3, 2e3)
#: Meshed as few tests need it.
COARSE = Settings(MeshSettings(order=2).refined(0.5))

#: By law. All are there from -3 to 9 mm, and act on a film at 4 mm, and by 1 % of its force on one
#: at 1.7 mm.
SAMPLES = {
    "spring": Spring(7.0, 1e-3),
    "constant": Constant(-0.05),
    "magnet": Magnet(0.5, 12e-3, 6e-3, 3.3),
    "bistable": Bistable(0.08, 6e-3, 0.05, 1e-3),
    "buckled_beam": BuckledBeam(30e-3, 4e-3, 0.1e-3, 1.5e9, 0.4e-3, 2, 3e-3),
    "table": ForceTable((-5e-3, 0.0, 3e-3, 5e-3, 12e-3), (-0.1, 0.01, 0.02, 0.02, 0.09)),
    "film": SolvedFilm.of(JOINED, build_model(circular(), COARSE)),
}

#: As rigs have them.
DECLARED = {**SAMPLES, "film": JOINED}
