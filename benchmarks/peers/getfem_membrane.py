"""GetFEM: P2 membrane, energy in the generic weak-form language (Debian's python3-getfem)."""

from __future__ import annotations

import subprocess

import numpy as np
from annulus import triangles
from harness import PROBLEM, Peer, Solution, give_up, main

try:
    import getfem
except ImportError:
    give_up("GetFEM", "apt-get install python3-getfem, run with the system's python3")

LATTICE_ORDER = [0, 3, 1, 5, 4, 2]  # nodes of GT_PK(2,2): row by row of the lattice
RIMS = 1
STRETCH = "(s*([1,0; 0,1; 0,0] + Grad_u))"
ENERGY = f"half*(Norm_sqr({STRETCH}) + 1/Det({STRETCH}'*{STRETCH}) - 3)"

getfem.util_trace_level(0)


def version() -> str:
    """Version of the Debian package; the module itself does not know it."""
    query = ["dpkg-query", "--show", "--showformat=${Version}", "python3-getfem"]
    return subprocess.run(query, capture_output=True, text=True, check=False).stdout.split("+")[0]


def prepare(level: int) -> getfem.Mesh:
    """Curved 6-node triangles, 4, 8, 16, ... cells across the film, as the package's mesh."""
    n_r = 4 * 2**level
    annulus = triangles(PROBLEM.inner, PROBLEM.outer, n_r, 4 * n_r, order=2)
    nodes = annulus.points[annulus.cells[:, LATTICE_ORDER]]
    mesh = getfem.Mesh("empty", 2)
    mesh.add_convex(getfem.GeoTrans("GT_PK(2,2)"), np.ascontiguousarray(nodes.transpose(2, 1, 0)))
    return mesh


def solve(mesh: getfem.Mesh) -> Solution:
    """Newton from a cone to the full travel.

    The force is the reaction of the rim.

    GetFEM puts the boundary values into the start: without the cone the plate's travel would be
    taken up by the first ring of cells and Newton's method would need more steps.
    """
    mesh.set_region(RIMS, mesh.outer_faces())
    field = getfem.MeshFem(mesh, 3)
    field.set_fem(getfem.Fem("FEM_PK(2,2)"))
    quadrature = getfem.MeshIm(mesh, getfem.Integ("IM_TRIANGLE(2)"))
    fixed = field.basic_dof_on_region(RIMS)
    radius = np.hypot(*field.basic_dof_nodes()[:, ::3])
    cone = np.zeros((len(radius), 3))
    cone[:, 2] = PROBLEM.travel * (PROBLEM.outer - radius) / (PROBLEM.outer - PROBLEM.inner)

    model = getfem.Model("real")
    model.add_fem_variable("u", field)
    model.add_initialized_data("s", [PROBLEM.prestretch])
    model.add_initialized_data("half", [PROBLEM.mounted_thickness * PROBLEM.mu / 2])
    model.add_nonlinear_term(quadrature, ENERGY, -1, 1, 1)  # everywhere; symmetric, coercive
    model.add_initialized_fem_data("rims", field, cone.ravel())
    model.add_Dirichlet_condition_with_simplification("u", RIMS, "rims")
    model.set_variable("u", cone.ravel())
    model.solve("lsolver", "mumps", "max_res", 1e-9)

    forces = getfem.asm("generic", quadrature, 1, ENERGY, -1, model)[: cone.size]
    vertical = fixed[2::3]
    plate = vertical[radius[vertical // 3] < (PROBLEM.inner + PROBLEM.outer) / 2]
    return Solution(cone.size - len(fixed), float(forces[plate].sum()))


if __name__ == "__main__":
    main(Peer("GetFEM", version(), "membrane P2 triangles", "MUMPS, symmetric"), prepare, solve)
