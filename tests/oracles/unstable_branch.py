"""The branch of the soft reference film under 17.9 g through its pull-in, shared by tests."""

from __future__ import annotations

from tests.oracles.axisymmetric import Film as Reference
from tests.oracles.axisymmetric import RitzExpansion
from tests.oracles.unstable import shape_at
from tympan.base.arrays import Array
from tympan.fem.equilibrium.arc_length import ArcSettings, Branch
from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.subspace import Subspace
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.model import Model

SOFT = Ogden((15e3,), (2.0,))
WEIGHT = 17.9e-3 * 9.80665


def branch_points(film: Model, subspace: Subspace, reach: float = 10.9e-3,
                  longest: float = 0.05) -> list[PathPoint]:
    """Points from a stable voltage on, through the largest, to a heave beyond it."""
    start = equilibrium(film, WEIGHT, 6000.0).state
    points = []
    for point in Branch(film, "voltage", subspace=subspace,
                        arc=ArcSettings(longest=longest)).points(start):
        if point.state.plate.deflection > reach:
            break
        points.append(point)
    return points


def voltage_at(reference: Reference, heave: float, force: float, near: tuple[Array, float],
               degree: int
               ) -> tuple[Array, float]:
    """Shape and U² of the Ritz method at a heave and a force, by Newton's method from a shape and a
    U² near."""
    return shape_at(RitzExpansion(reference, degree), near[0], heave, near[1], force)
