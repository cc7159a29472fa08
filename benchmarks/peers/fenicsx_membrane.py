"""FEniCSx: P2 membrane, residual and tangent derived by UFL from the energy (Debian's dolfinx)."""

from __future__ import annotations

import numpy as np
from annulus import Annulus, triangles
from harness import PROBLEM, Peer, Solution, give_up, main

try:
    import dolfinx
except ImportError:
    give_up("FEniCSx", "apt-get install python3-dolfinx, run with the system's python3")
import ufl
from dolfinx import fem
from dolfinx.cpp.mesh import exterior_facet_indices
from dolfinx.fem.petsc import (
    apply_lifting,
    assemble_matrix,
    assemble_vector,
    create_matrix,
    create_vector,
    set_bc,
)
from dolfinx.mesh import Mesh, create_mesh
from mpi4py import MPI
from petsc4py import PETSc

BASIX_ORDER = [0, 1, 2, 4, 5, 3]  # P2 triangle: the edges are numbered by the opposite corner
TOLERANCE = 1e-8  # of the first residual; the force then is exact to 1e-9


def prepare(level: int) -> Mesh:
    """Curved 6-node triangles, 4, 8, 16, ... cells across the film, as the package's mesh."""
    n_r = 4 * 2**level
    annulus: Annulus = triangles(PROBLEM.inner, PROBLEM.outer, n_r, 4 * n_r, order=2)
    shape = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.triangle, 2))
    return create_mesh(MPI.COMM_WORLD, annulus.cells[:, BASIX_ORDER], annulus.points, shape)


def _energy(mesh: Mesh, u: fem.Function) -> ufl.Form:
    """Mounted area integral [mJ] of (T / J_p) mu/2 (tr C + 1/det C - 3), C of the total stretch."""
    flat = ufl.as_matrix([[1, 0], [0, 1], [0, 0]])
    f = PROBLEM.prestretch * (flat + ufl.grad(u))
    c = f.T * f
    density = PROBLEM.mounted_thickness * PROBLEM.mu / 2 * (ufl.tr(c) + 1 / ufl.det(c) - 3)
    return density * ufl.dx(mesh, metadata={"quadrature_degree": 2})


def solve(mesh: Mesh) -> Solution:
    """Newton from the flat membrane straight to the full travel.

    The force is the reaction of the rim.
    """
    space = fem.VectorFunctionSpace(mesh, ("Lagrange", 2), dim=3)
    u, v, du = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    first = ufl.derivative(_energy(mesh, u), u, v)
    residual, tangent = fem.form(first), fem.form(ufl.derivative(first, u, du))

    mesh.topology.create_connectivity(1, 2)
    rims = fem.locate_dofs_topological(space, 1, exterior_facet_indices(mesh.topology))
    points = space.tabulate_dof_coordinates()[rims]
    lifted = fem.Function(space)
    inner = rims[np.hypot(points[:, 0], points[:, 1]) < (PROBLEM.inner + PROBLEM.outer) / 2]
    lifted.x.array.reshape(-1, 3)[inner, 2] = PROBLEM.travel
    fixed = [fem.dirichletbc(lifted, rims)]

    matrix, vector, step = create_matrix(tangent), create_vector(residual), create_vector(residual)
    solver = PETSc.KSP().create(mesh.comm)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("cholmod")
    scale = None
    while True:
        _assemble(vector, residual)
        reaction = vector.array.reshape(-1, 3)[inner, 2].sum()
        apply_lifting(vector, [tangent], [fixed], [u.vector], -1.0)
        set_bc(vector, fixed, u.vector, -1.0)
        norm = vector.norm()
        scale = scale or norm
        if norm <= TOLERANCE * scale:
            break
        matrix.zeroEntries()
        assemble_matrix(matrix, tangent, fixed)
        matrix.assemble()
        solver.solve(vector, step)
        u.vector.axpy(-1.0, step)
    return Solution(3 * (len(u.x.array) // 3 - len(rims)), float(reaction))


def _assemble(vector: PETSc.Vec, form: fem.FormMetaClass) -> None:
    """Overwrite the vector with the assembled form."""
    vector.set(0.0)
    assemble_vector(vector, form)


if __name__ == "__main__":
    main(Peer("FEniCSx", dolfinx.__version__, "membrane P2 triangles",
              "CHOLMOD; compiled forms cached"), prepare, solve)
