"""FElupe: Q2 membrane, a hand-written material on a 3 x 2 deformation gradient."""

from __future__ import annotations

import numpy as np
from annulus import Annulus, quads
from harness import PROBLEM, Peer, Solution, give_up, main
from numpy.typing import NDArray

try:
    import felupe as fem
except ImportError:
    give_up("FElupe", "pip install felupe")
import symmetric_lu

Array = NDArray[np.float64]


class PrestretchedMembrane:
    """Neo-Hooke in plane stress per mounted area: h mu/2 (tr C + 1/det C - 3).

    C = s^2 F^T F, F is 3 x 2.
    """

    def __init__(self, mu: float, thickness: float, prestretch: float) -> None:
        self.linear = thickness * mu * prestretch**2
        self.squeeze = thickness * mu / prestretch**4
        self.x = [np.zeros((3, 2)), np.zeros(0)]

    @staticmethod
    def _metric(f: Array) -> tuple[Array, Array]:
        """Inverse of F^T F and its determinant, (2, 2, q, c) and (q, c)."""
        c11, c22, c12 = (f[:, 0] ** 2).sum(0), (f[:, 1] ** 2).sum(0), (f[:, 0] * f[:, 1]).sum(0)
        det = c11 * c22 - c12**2
        return np.array([[c22, -c12], [-c12, c11]]) / det, det

    def gradient(self, x: list[Array]) -> list[Array]:
        """First Piola-Kirchhoff stress, h mu (s^2 F - s^-4 F C^-1 / det C)."""
        f, statevars = x
        inverse, det = self._metric(f)
        dual = np.einsum("iJ...,JK...->iK...", f, inverse)
        return [self.linear * f - self.squeeze / det * dual, statevars]

    def hessian(self, x: list[Array]) -> list[Array]:
        """Derivative of the stress by F; G = F C^-1, projector on the normal I - G F^T."""
        f = x[0]
        inverse, det = self._metric(f)
        dual = np.einsum("iJ...,JK...->iK...", f, inverse)
        normal = np.eye(3)[:, :, None, None] - np.einsum("iJ...,kJ...->ik...", dual, f)
        moduli = 2 * np.einsum("iJ...,kL...->iJkL...", dual, dual)
        moduli += np.einsum("iL...,kJ...->iJkL...", dual, dual)
        moduli -= np.einsum("ik...,JL...->iJkL...", normal, inverse)
        moduli *= self.squeeze / det
        for i in range(3):
            for j in range(2):
                moduli[i, j, i, j] += self.linear
        return [moduli]


def prepare(level: int) -> Annulus:
    """9-node quadrilaterals with 4, 8, 16, ... cells across the film."""
    n_r = 4 * 2**level
    return quads(PROBLEM.inner, PROBLEM.outer, n_r, 4 * n_r, order=2)


def solve(annulus: Annulus) -> Solution:
    """Newton from the flat membrane straight to the full travel.

    The force is the reaction of the rim.
    """
    mesh = fem.Mesh(annulus.points, annulus.cells, "quad9")
    region = fem.RegionBiQuadraticQuad(mesh)
    field = fem.FieldContainer([fem.Field(region, dim=3)])
    film = PrestretchedMembrane(PROBLEM.mu, PROBLEM.mounted_thickness, PROBLEM.prestretch)
    membrane = fem.SolidBody(film, field)
    values = np.zeros((mesh.npoints, 3))
    values[annulus.inner, 2] = PROBLEM.travel
    fixed = np.zeros((mesh.npoints, 3), dtype=bool)
    fixed[np.concatenate([annulus.inner, annulus.outer])] = True
    dof0, dof1 = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    result = fem.newtonraphson(
        items=[membrane],
        x0=field,
        dof0=dof0,
        dof1=dof1,
        ext0=values.ravel()[dof0],
        solver=symmetric_lu.spsolve,
        verbose=0,
    )
    return Solution(len(dof1), float(result.fun.reshape(-1, 3)[annulus.inner, 2].sum()))


if __name__ == "__main__":
    main(Peer("FElupe", fem.__version__, "membrane Q2 quads", symmetric_lu.NAME), prepare, solve)
