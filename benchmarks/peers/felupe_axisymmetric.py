"""FElupe: an axisymmetric, nearly incompressible solid of Q2 quads, one through the thickness."""

from __future__ import annotations

import numpy as np
from annulus import Floats, Ints, graded_radii
from harness import PROBLEM, Peer, Solution, give_up, main

try:
    import felupe as fem
except ImportError:
    give_up("FElupe", "pip install felupe")

BULK_RATIO = 50000.0  # K / mu: compressibility then costs 4e-5 of the force
# Shares of the travel; from the flat film straight to the end diverges.
LIFTS = (0.0, 0.2, 0.6, 1.0)
# Lattice steps (axial, radial) of the nodes of a 9-node cell.
STEPS = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1))


def prepare(level: int) -> tuple[Floats, Ints]:
    """Meridian of the virgin film, points (axial, radial) in mm: 8, 16, 32, ... cells along it."""
    n_r = 8 * 2**level
    radii = graded_radii(PROBLEM.inner, PROBLEM.outer, n_r, order=2) / PROBLEM.prestretch
    heights = PROBLEM.film_thickness * np.array([-0.5, 0.0, 0.5])
    points = np.array([[z, r] for r in radii for z in heights])
    first = 6 * np.arange(n_r)[:, None]
    return points, first + np.array([3 * radial + axial for axial, radial in STEPS])


def solve(meridian: tuple[Floats, Ints]) -> Solution:
    """Newton from the homogeneously stretched film, lifted in steps.

    Both rims are clamped.

    A film of finite thickness resists bending: with the mesh and K it goes to a force 2.3e-4 above
    the membrane's. Rims that may rotate have been tried; Newton's method then fails.
    """
    points, cells = meridian
    mesh = fem.Mesh(points, cells, "quad9")
    displacement = fem.FieldAxisymmetric(fem.RegionBiQuadraticQuad(mesh), dim=2)
    mounted = points * [PROBLEM.prestretch**-2 - 1, PROBLEM.prestretch - 1]
    displacement.values[:] = mounted
    field = fem.FieldContainer([displacement])
    film = fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=PROBLEM.mu), field,
                                             bulk=BULK_RATIO * PROBLEM.mu)
    plate, frame = slice(0, 3), slice(-3, None)
    fixed = np.zeros(points.shape, dtype=bool)
    fixed[plate] = fixed[frame] = True
    dof0, dof1 = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    for share in LIFTS:
        lifted = mounted.copy()
        lifted[plate, 0] += share * PROBLEM.travel
        result = fem.newtonraphson(items=[film], x0=field, dof0=dof0, dof1=dof1,
                                   ext0=lifted.ravel()[dof0], verbose=0)
    return Solution(len(dof1), float(result.fun.reshape(-1, 2)[plate, 0].sum()))


if __name__ == "__main__":
    notes = (f"circle only; K/mu = {BULK_RATIO:.0f}; SuperLU; "
             "clamped solid film, 2.3e-4 stiffer than a membrane")
    main(Peer("FElupe", fem.__version__, "axisymmetric solid Q2", notes), prepare, solve)
