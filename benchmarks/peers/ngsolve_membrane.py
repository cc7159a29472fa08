"""NGSolve: P4 membrane on Netgen's curved triangles, residual and tangent from the energy."""

from __future__ import annotations

from harness import PROBLEM, Peer, Solution, give_up, main

try:
    import ngsolve as ngs
except ImportError:
    give_up("NGSolve", "pip install ngsolve")
from netgen.geom2d import SplineGeometry

ORDER = 4
TOLERANCE = 1e-10  # of the squared energy norm of a step; the step after it would be of that square


def prepare(level: int) -> ngs.Mesh:
    """Netgen's mesh, curved, the cell size growing with the radius and halving with the level."""
    geometry = SplineGeometry()
    coarsest = 0.55 / 2**level  # cell size over radius
    for radius, rim, left_domain, right_domain in ((PROBLEM.inner, "plate", 0, 1),
                                                   (PROBLEM.outer, "frame", 1, 0)):
        geometry.AddCircle((0, 0), radius, bc=rim, leftdomain=left_domain, rightdomain=right_domain,
                           maxh=coarsest * radius)
    mesh = ngs.Mesh(geometry.GenerateMesh(maxh=coarsest * PROBLEM.outer, grading=0.3))
    mesh.Curve(ORDER)
    return mesh


def _energy(space: ngs.FESpace) -> ngs.BilinearForm:
    """Mounted area integral [mJ] of (T / J_p) mu/2 (tr C + 1/det C - 3), C of the total stretch."""
    flat = ngs.CoefficientFunction((1, 0, 0, 1, 0, 0), dims=(3, 2))
    f = PROBLEM.prestretch * (flat + ngs.Grad(space.TrialFunction()))
    c = f.trans * f
    density = PROBLEM.mounted_thickness * PROBLEM.mu / 2 * (ngs.Trace(c) + 1 / ngs.Det(c) - 3)
    form = ngs.BilinearForm(space, symmetric=True)
    form += ngs.Variation(density.Compile() * ngs.dx)
    return form


def solve(mesh: ngs.Mesh) -> Solution:
    """Newton from the flat membrane straight to the full travel.

    The force is the work of a unit lift.
    """
    with ngs.TaskManager():
        space = ngs.H1(mesh, order=ORDER, dirichlet="plate|frame") ** 3
        form = _energy(space)
        u, lift = ngs.GridFunction(space), ngs.GridFunction(space)
        lift.components[2].Set(PROBLEM.travel, definedon=mesh.Boundaries("plate"))
        residual, step = u.vec.CreateVector(), u.vec.CreateVector()
        first = size = 0.0
        while size > TOLERANCE * first or not first:
            form.Apply(u.vec, residual)
            form.AssembleLinearization(u.vec)
            if not first:
                residual.data += form.mat * lift.vec
                u.vec.data += lift.vec
            step.data = form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky") * residual
            u.vec.data -= step
            size = abs(ngs.InnerProduct(step, residual))
            first = first or size
        form.Apply(u.vec, residual)
        force = ngs.InnerProduct(residual, lift.vec) / PROBLEM.travel
        return Solution(sum(space.FreeDofs()), force)


if __name__ == "__main__":
    notes = "sparse Cholesky, all cores"
    main(Peer("NGSolve", ngs.__version__, f"membrane P{ORDER} triangles", notes), prepare, solve)
