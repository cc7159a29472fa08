"""FElupe: a viscous membrane of Q2 quads in time, at rest under a weight, then under a voltage.

Law, branch and step in time are those of tympan, the steps of equal length: so what is compared is
what a step costs, and what the choice of steps and elements is worth.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from annulus import Floats, Ints
from harness import give_up
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

try:
    import felupe as fem
except ImportError:
    give_up("FElupe", "pip install felupe")
import symmetric_lu
from viscous_film import PROBLEM, TransientProblem, TransientRow

Array = NDArray[np.float64]

EPSILON_0 = 8.8541878128e-12
#: The voltage comes in so many parts.
PARTS = 3


def inner(a: Array, b: Array) -> Array:
    """a : b, of symmetric (2, 2, ...)."""
    return np.einsum("ij...,ij...->...", a, b)


def determinant(a: Array) -> Array:
    """Of (2, 2, ...)."""
    return a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]


def inverse(a: Array) -> Array:
    """Of symmetric (2, 2, ...)."""
    return np.array([[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]) / determinant(a)


def between(a: Array) -> Array:
    """Of A dC A by dC, (2, 2, 2, 2, ...)."""
    part = np.einsum("ik...,jl...->ijkl...", a, a)
    return (part + part.swapaxes(2, 3)) / 2


def outer(a: Array, b: Array) -> Array:
    """A ⊗ B, (2, 2, 2, 2, ...)."""
    return np.einsum("ij...,kl...->ijkl...", a, b)


@dataclass
class ViscousMembrane:
    """Neo-Hooke, a branch and the Maxwell stress in plane stress, per mounted area.

    The branch's C_v, components 11, 22, 12 and 33, are the state variables; ``duration`` of the
    step from where the strain was ``before``. Without one the branch is relaxed, and does not pull.
    """

    problem: TransientProblem
    voltage: float = 0.0
    duration: float | None = None
    before: Array | None = None
    x: list[Array] = field(default_factory=lambda: [np.zeros((3, 2)), np.zeros(4)])

    def strain(self, f: Array) -> Array:
        """C of the virgin film."""
        return self.problem.prestretch**2 * np.einsum("iJ...,iK...->JK...", f, f)

    def _neo_hooke(self, c: Array, kept: Array, kept33: Any, weight: Any, mu: float, bend: bool
                   ) -> tuple[Array, Array | None]:
        """S of (3μ/2w) det(H + w C)^⅓ and ∂S/∂C; with H = 1 and w = 0 of a neo-Hookean law."""
        c33, by_c, by_m = 1 / determinant(c), inverse(c), inverse(kept + weight * c)
        m33 = kept33 + weight * c33
        strength = mu * np.cbrt(determinant(kept + weight * c) * m33)
        ratio = c33 / m33
        pull = by_m - ratio * by_c
        if not bend:
            return strength * pull, None
        tangent = (weight / 3 * outer(pull, pull) - weight * between(by_m)
                   + ratio * (1 - weight * ratio) * outer(by_c, by_c) + ratio * between(by_c))
        return strength * pull, strength * tangent

    def _step(self, c: Array, states: Array) -> tuple[Array, Array, Array]:
        """H, its component 33, and w: det(M)^⅓ grows exponentially, by its rate at the start."""
        old = np.array([[states[0], states[2]], [states[2], states[1]]])
        start = c if self.before is None else self.before
        share = self.duration / self.problem.time
        rate = share * (inner(inverse(old), start) + 1 / determinant(start) / states[3]) / 3
        k = np.maximum(rate, 1e-6)
        first, last = (1 - np.exp(-k) * (1 + k)) / k**2, (k - 1 + np.exp(-k)) / k**2
        return (np.exp(-rate) * old + share * first * start,
                np.exp(-rate) * states[3] + share * first / determinant(start), share * last)

    def _law(self, f: Array, states: Array, bend: bool) -> tuple[Array, Array | None]:
        """S and ∂S/∂C of the virgin film."""
        p, c = self.problem, self.strain(f)
        identity = np.eye(2)[:, :, None, None] * np.ones(c.shape[2:])
        stress, tangent = self._neo_hooke(c, identity, 1.0, 0.0, p.mu, bend)
        by_c = inverse(c)
        field_squared = EPSILON_0 * p.permittivity * (self.voltage / p.thickness) ** 2
        pressure = field_squared * determinant(c)
        stress = stress - pressure * by_c
        if bend:
            tangent = tangent - pressure * (outer(by_c, by_c) - between(by_c))
        if self.duration is not None:
            part, further = self._neo_hooke(c, *self._step(c, states), p.branch, bend)
            stress = stress + part
            tangent = tangent + further if bend else None
        return stress, tangent

    def after(self, f: Array, states: Array) -> Array:
        """C_v at the step's end; relaxed where there was none."""
        c = self.strain(f)
        if self.duration is None:
            return np.array([c[0, 0], c[1, 1], c[0, 1], 1 / determinant(c)])
        kept, kept33, weight = self._step(c, states)
        m, m33 = kept + weight * c, kept33 + weight / determinant(c)
        return np.array([m[0, 0], m[1, 1], m[0, 1], m33]) / np.cbrt(determinant(m) * m33)

    def gradient(self, x: list[Array]) -> list[Array]:
        """First Piola-Kirchhoff stress; the state variables as they were."""
        f, states = x
        stress, _ = self._law(f, states, False)
        return [self.problem.thickness * np.einsum("iK...,KJ...->iJ...", f, stress), states]

    def hessian(self, x: list[Array]) -> list[Array]:
        """Derivative of the stress by F."""
        f, states = x
        stress, tangent = self._law(f, states, True)
        p = self.problem
        moduli = 2 * p.prestretch**2 * np.einsum("iM...,MJNL...,kN...->iJkL...", f, tangent, f)
        for i in range(3):
            moduli[i, :, i] += stress
        return [p.thickness * moduli]


def quarter(problem: TransientProblem, across: int) -> tuple[Floats, Ints, dict[str, Ints]]:
    """Points [m] of a lattice between plate and frame, its 9-node cells, and its sides' nodes."""
    around = across
    steps = np.arange(2 * across + 1) / (2 * across)
    angles = np.pi / 2 * np.arange(2 * around + 1) / (2 * around)
    inside = problem.plate * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    outside = np.stack([problem.frame[0] * np.cos(angles), problem.frame[1] * np.sin(angles)],
                       axis=-1)
    shares = (np.exp(1.5 * steps) - 1) / (np.exp(1.5) - 1)  # smaller cells at the plate
    points = (inside + shares[:, None, None] * (outside - inside)).reshape(-1, 2)
    ring = 2 * around + 1
    row, column = (2 * grid.ravel()[:, None] for grid in np.mgrid[0:across, 0:around])
    places = np.array([(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)])
    cells = (row + places[:, 0]) * ring + column + places[:, 1]
    number = np.arange(len(points)).reshape(-1, ring)
    return points, cells, {"plate": number[0], "frame": number[-1], "x": number[:, 0],
                           "y": number[:, -1]}


class Film:
    """The assembled membrane; unknowns are the free components and the plate's heave, the last."""

    def __init__(self, problem: TransientProblem, across: int) -> None:
        points, cells, sides = quarter(problem, across)
        mesh = fem.Mesh(points, cells, "quad9")
        self.problem, self.law = problem, ViscousMembrane(problem)
        self.displacement = fem.Field(fem.RegionBiQuadraticQuad(mesh), dim=3)
        self.field = fem.FieldContainer([self.displacement])
        self.states = np.zeros((4, *self._gradient().shape[2:]))
        free = np.ones((len(points), 3), dtype=bool)
        free[sides["plate"]] = free[sides["frame"]] = False
        free[sides["x"], 1] = free[sides["y"], 0] = False
        rows = np.concatenate([np.flatnonzero(free), 3 * sides["plate"] + 2])
        count = int(free.sum())
        columns = np.concatenate([np.arange(count), np.full(len(sides["plate"]), count)])
        self.motions = csc_matrix((np.ones(len(rows)), (rows, columns)), (free.size, count + 1))
        self.heave = np.zeros(count + 1)

    def _gradient(self) -> Array:
        return self.field.extract(grad=True, sym=False, add_identity=False)[0] + np.eye(3, 2)[
            :, :, None, None]

    def solve(self) -> None:
        """Newton's method, from where the film is."""
        load = np.zeros(len(self.heave))
        load[-1] = self.problem.force / 4
        region = self.displacement.region
        while True:
            x = [self._gradient(), self.states]
            forces = fem.IntegralForm(self.law.gradient(x)[:1], self.field, region.dV)
            moduli = fem.IntegralForm(self.law.hessian(x), self.field, region.dV, self.field)
            residual = self.motions.T @ forces.assemble().toarray().ravel() - load
            matrix = self.motions.T @ moduli.assemble() @ self.motions
            step = -symmetric_lu.spsolve(matrix, residual)
            self.heave += step
            self.displacement.values[:] = (self.motions @ self.heave).reshape(-1, 3)
            if np.abs(step).max() < 1e-9 * max(self.problem.frame):
                return
            if not np.abs(step).max() < 1.0:
                raise ArithmeticError("Newton's method fails")

    def rest(self) -> None:
        """At rest under the weight."""
        self.solve()
        self.states = self.law.after(self._gradient(), self.states)

    def march(self, steps: int) -> None:
        """The voltage at once, in parts, then equal steps to the end."""
        self.law.duration = 0.0
        for part in range(1, PARTS + 1):
            self.law.voltage = self.problem.voltage * (part / PARTS) ** 0.5
            self.solve()
        self.law.duration = self.problem.end / steps
        for _ in range(steps):
            self.law.before = self.law.strain(self._gradient())
            self.solve()
            self.states = self.law.after(self._gradient(), self.states)


def main() -> None:
    """One JSON object for each mesh and number of steps on stdout."""
    parser = argparse.ArgumentParser(description="FElupe: a viscous membrane in time")
    parser.add_argument("--across", type=int, nargs="+", default=[4, 8, 16],
                        help="cells from plate to frame")
    parser.add_argument("--steps", type=int, nargs="+", default=[8, 32],
                        help="equal steps of 30 s")
    options = parser.parse_args()
    for across in options.across:
        for steps in options.steps:
            film = Film(PROBLEM, across)
            began = time.process_time()
            film.rest()
            before = film.heave[-1]
            film.march(steps)
            print(json.dumps(asdict(TransientRow(
                "FElupe", fem.__version__, "Q2 quads, equal steps", len(film.heave), steps,
                float(before), float(film.heave[-1]), time.process_time() - began))), flush=True)


if __name__ == "__main__":
    main()
