"""SfePy: its total-Lagrangian Mooney-Rivlin membrane term on the face of a layer of hexahedra."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout

import numpy as np
from annulus import Floats, Ints, quads
from harness import PROBLEM, Peer, Solution, give_up, main

try:
    with redirect_stdout(sys.stderr):  # it reports missing optional packages on stdout
        import sfepy
        import sfepy.terms
except ImportError:
    give_up("SfePy", "pip install sfepy")
import symmetric_lu
from scipy.sparse import csr_matrix
from sfepy.base.base import output
from sfepy.discrete import (
    Equation,
    Equations,
    FieldVariable,
    Integral,
    Material,
    PolySpace,
    Problem,
)
from sfepy.discrete.conditions import Conditions, EssentialBC
from sfepy.discrete.fem import FEDomain, Field, Mesh
from sfepy.discrete.fem.mappings import FEMapping
from sfepy.discrete.functions import Function
from sfepy.solvers.ls import LinearSolver
from sfepy.solvers.nls import Newton
from sfepy.terms import Term, register_term
from sfepy.terms.terms_membrane import TLMembraneTerm

output.set_output(quiet=True)
NEWTON = {"i_max": 20, "eps_r": 1e-8, "eps_a": 1e-9, "eps_mode": "or",
          "lin_red": None, "ls_on": 1e9}


class SymmetricLU(LinearSolver):
    """SuperLU in symmetric mode for the nodes that carry the membrane.

    SfePy has no quadratic field on a surface alone: the nodes off the film belong to the field,
    with empty rows.
    """

    name = "ls.symmetric_lu"

    def __call__(self, rhs: Floats, mtx: csr_matrix, status: dict[str, float],
                 **_ignored: object) -> Floats:
        """Solve mtx x = rhs where the rows are not empty; zero elsewhere."""
        status["n_iter"] = 1
        used = np.flatnonzero(np.diff(mtx.indptr))
        x = np.zeros(len(rhs))
        x[used] = symmetric_lu.spsolve(mtx[used][:, used], rhs[used])
        return x


class CurvedMembrane(TLMembraneTerm):
    """SfePy's membrane term on quadratic elements whose edge nodes lie on circles.

    The term's own geometry is for linear elements with straight edges; only that part is replaced.
    """

    name = "dw_tl_curved_membrane"

    def get_fargs(self, *args, **kwargs):
        """Set the element frames (the global one), the quadratic mapping, then do as SfePy does."""
        if self.mtx_t is None:
            field = args[4].field
            conn = field.extra_data[f"sd_{self.region.name}"].econn
            space = PolySpace.any_from_args(None, field.gel.surface_facet, field.approx_order)
            points, weights = self.integral.get_qp(field.gel.surface_facet.name)
            mapping = FEMapping(field.get_coor()[:, :2].copy(), conn, poly_space=space, order=2)
            values = space.eval_basis(points)
            self.membrane_geo = mapping.get_mapping(points, weights, values, poly_space=space)
            self.bfg = self.membrane_geo.bfg
            self.mtx_t = np.tile(np.eye(3), (len(conn), 1, 1))
        return super().get_fargs(*args, **kwargs)


register_term(CurvedMembrane)


def on_circles(points: Floats, conn: Ints) -> Floats:
    """Points (n, 2) with the edge and centre nodes of the 9-node cells moved to the mean radius."""
    radius = np.hypot(*points.T)
    moved = radius.copy()
    corners = radius[conn[:, :4]]
    moved[conn[:, 4:8]] = (corners + np.roll(corners, -1, axis=1)) / 2
    moved[conn[:, 8]] = corners.mean(axis=1)
    return points * (moved / radius)[:, None]


def prepare(level: int) -> Mesh:
    """Virgin film as one layer of 8-node hexahedra.

    Only the nodes of its upper face carry unknowns.
    """
    n_r = 4 * 2**level
    flat = quads(PROBLEM.inner / PROBLEM.prestretch, PROBLEM.outer / PROBLEM.prestretch,
                 n_r, 4 * n_r, order=1)
    n = len(flat.points)
    points = np.vstack([np.c_[flat.points, np.full(n, z)] for z in (1.0, 0.0)])
    cells = np.hstack([flat.cells + n, flat.cells]).astype(np.int32)
    groups = np.zeros(2 * n, dtype=np.int32)
    groups[:n] = 3
    groups[flat.inner] = 1
    groups[flat.outer] = 2
    return Mesh.from_data("film", points, groups, [cells],
                          [np.zeros(len(cells), np.int32)], ["3_8"])


def mounted(points: Floats) -> Floats:
    """Displacement (n, 3) that stretches the film in its plane and lifts it to a cone.

    The cone is flat at the frame.

    SfePy puts the boundary values into the start: without the cone the plate's travel would be
    taken up by the first ring of cells and Newton's method would need more steps.
    """
    radius = PROBLEM.prestretch * np.hypot(points[:, 0], points[:, 1])
    lift = PROBLEM.travel * (PROBLEM.outer - radius) / (PROBLEM.outer - PROBLEM.inner)
    return np.c_[(PROBLEM.prestretch - 1) * points[:, :2], lift]


def _at_rim(_ts: object, points: Floats, **_ignored: object) -> Floats:
    """Boundary values as SfePy asks for them."""
    return mounted(points)


def solve(mesh: Mesh) -> Solution:
    """Newton from a cone to the full travel; the force is the reaction of the rim."""
    domain = FEDomain("domain", mesh)
    omega = domain.create_region("Omega", "all")
    film = domain.create_region("Film", "vertices in (z > 0.5)", "facet")
    inner = domain.create_region("Inner", "vertices of group 1", "edge")
    outer = domain.create_region("Outer", "vertices of group 2", "edge")
    field = Field.from_args("displacement", np.float64, 3, omega, approx_order=2)
    domain.create_surface_group(film)
    field.setup_surface_data(film)
    field.coors[:, :2] = on_circles(field.coors[:, :2], field.extra_data["sd_Film"].econn)
    u = FieldVariable("u", "unknown", field)
    v = FieldVariable("v", "test", field, primary_var_name="u")
    rubber = Material("m", a1=PROBLEM.mu / 2, a2=0.0, h0=PROBLEM.film_thickness)
    integral = Integral("i", order=4)
    term = Term.new("dw_tl_curved_membrane(m.a1, m.a2, m.h0, v, u)", integral, film,
                    m=rubber, v=v, u=u)
    problem = Problem("film", equations=Equations([Equation("balance", term)]), active_only=True)
    at_rim = Function("rim", _at_rim)
    fixed = [EssentialBC(rim.name, rim, {"u.all": at_rim}) for rim in (inner, outer)]
    problem.set_bcs(ebcs=Conditions(fixed))
    problem.set_solver(Newton(NEWTON, lin_solver=SymmetricLU({})))
    state = problem.solve(state0=mounted(field.get_coor()).ravel(), save_results=False)
    problem.remove_bcs()
    residual = problem.equations.eval_residuals(state()).reshape(-1, 3)
    plate = field.get_dofs_in_region(inner)
    free = len(field.get_dofs_in_region(film)) - len(plate) - len(field.get_dofs_in_region(outer))
    return Solution(3 * free, float(residual[plate, 2].sum()))


if __name__ == "__main__":
    main(Peer("SfePy", sfepy.__version__, "membrane Q2 quads", symmetric_lu.NAME), prepare, solve)
