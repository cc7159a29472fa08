"""NGSolve: film in three dimensions with an electrode in sectors, on a rigid plate that tilts.

    python benchmarks/peers/ngsolve_quarter.py [--levels 3] [--order 4] [--only TEXT]

One JSON object for each film and mesh. Nothing of tympan is used. Lengths are in mm, stresses in
MPa and forces in N until they are printed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from driven_sectors import FILMS, Sector, SectorFilm, SectorRow
from harness import give_up

try:
    import ngsolve as ngs
    import numpy as np
    from scipy.spatial.transform import Rotation
except ImportError:
    give_up("NGSolve", "pip install ngsolve numpy scipy")
from netgen.geom2d import SplineGeometry
from ngsolve.comp import IntegrationRuleSpace

MM, MPA = 1e-3, 1e6

#: Cell size over radius on the coarsest mesh; each level halves it.
COARSEST = 0.6
#: Cell size over radius where an edge of the electrode meets plate or frame, on the coarsest mesh.
#: The stress is singular there, and each level divides this size by four.
AT_CORNERS = 0.04
#: How fast cells grow away from these corners, as Netgen counts it.
GRADING = 0.3
#: Longest arc that one rational spline draws [deg].
LONGEST_ARC = 100.0

#: Number of terms of the power series of :func:`_power_sum`, and the largest x that they are made
#: for: their error is below 1e-11 there.
TERMS, LARGEST_X = 20, 0.5

#: Largest energy of the last Newton step, relative to the largest of all steps.
TOLERANCE = 1e-20
#: Largest number of Newton steps.
ITERATIONS = 30

#: Matrices of the cross products eₖ × of the three axes, (3, 3, 3).
CROSS = -np.array([[[0, 0, 0], [0, 0, 1], [0, -1, 0]],
                   [[0, 0, -1], [0, 0, 0], [1, 0, 0]],
                   [[0, 1, 0], [-1, 0, 0], [0, 0, 0]]], dtype=float)


@dataclass(frozen=True)
class Pose:
    """The plate: shift of its centre [mm] and rotation matrix about it."""

    shift: np.ndarray
    rotation: np.ndarray

    def moved(self, step: np.ndarray) -> Pose:
        """Add a small shift, and put a small rotation after the present one."""
        turn = Rotation.from_rotvec(step[3:]).as_matrix()
        return Pose(self.shift + step[:3], turn @ self.rotation)


def _edges(film: SectorFilm) -> list[float]:
    """Angles of all straight edges of the electrode, within one turn, ascending [deg]."""
    return sorted({round(angle % 360, 9) for sector in film.sectors
                   for angle in (sector.start, sector.end)})


def _wedges(film: SectorFilm) -> list[tuple[float, float, float]]:
    """Start, end [deg] and voltage [V] of the parts between neighbouring edges; 0 V if bare."""
    edges = _edges(film)
    result = []
    for start, end in itertools.pairwise([*edges, edges[0] + 360]):
        middle = (start + end) / 2
        voltages = [sector.voltage for sector in film.sectors if _contains(sector, middle)]
        result.append((start, end, sum(voltages)))
    return result


def _contains(sector: Sector, angle: float) -> bool:
    """Whether an angle [deg], give or take whole turns, lies in a sector."""
    return (angle - sector.start) % 360 < sector.end - sector.start


def prepare(film: SectorFilm, level: int, order: int) -> ngs.Mesh:
    """Netgen's mesh, curved, with the electrode's straight edges, finer at their ends."""
    geometry = SplineGeometry()
    wedges, cell, corner = _wedges(film), COARSEST / 2**level, AT_CORNERS / 4**level

    def point(radius: float, angle: float, size: float = 1e99) -> int:
        turned = math.radians(angle)
        return int(geometry.AppendPoint(radius * math.cos(turned), radius * math.sin(turned),
                                        maxh=size))

    inner, outer = film.inner / MM, film.outer / MM
    corners = {radius: [point(radius, start, corner * radius) for start, _, _ in wedges]
               for radius in (inner, outer)}
    for number, (start, end, _) in enumerate(wedges):
        before, after = (number or len(wedges)), number + 1
        geometry.Append(["line", corners[inner][number], corners[outer][number]],
                        leftdomain=after, rightdomain=before, bc="edge")
        geometry.SetMaterial(after, f"wedge{number}")
        pieces = math.ceil((end - start) / LONGEST_ARC)
        half = (end - start) / pieces / 2
        for radius, rim, sides in ((inner, "plate", (0, after)), (outer, "frame", (after, 0))):
            between = [point(radius, start + 2 * half * k) for k in range(1, pieces)]
            ends = [corners[radius][number], *between,
                    corners[radius][(number + 1) % len(wedges)]]
            for k, (first, last) in enumerate(itertools.pairwise(ends)):
                peak = point(radius / math.cos(math.radians(half)), start + (2 * k + 1) * half)
                geometry.Append(["spline3", first, peak, last], bc=rim, leftdomain=sides[0],
                                rightdomain=sides[1], maxh=cell * radius)
    mesh = ngs.Mesh(geometry.GenerateMesh(maxh=cell * outer, grading=GRADING))
    mesh.Curve(order)
    return mesh


def _power_sum(half_trace: Any, det: Any, power: float) -> Any:
    """λ₁^(2p) + λ₂^(2p) from half the trace m and the determinant of C.

    2 m^p Σ (p over 2k) xᵏ with x = 1 − det/m² is smooth at equal stretches, where λ₁ and λ₂ are
    not.
    """
    x = 1 - det / half_trace**2
    binomials = [math.prod((power - j) / (j + 1) for j in range(2 * k)) for k in range(TERMS)]
    series: Any = binomials[-1]
    for binomial in reversed(binomials[:-1]):
        series = binomial if isinstance(series, float) and series == 0 else binomial + x * series
    return 2 * half_trace**power * series


class Film:
    """The film on one mesh, with the plate's edge as nine fields: three shifts, six slopes."""

    def __init__(self, film: SectorFilm, mesh: ngs.Mesh, order: int) -> None:
        self.film, self.mesh, self.order = film, mesh, order
        self.space = ngs.H1(mesh, order=order, dirichlet="plate|frame") ** 3
        self.u = ngs.GridFunction(self.space)
        self.pose = Pose(np.zeros(3), np.eye(3))
        self.volume = film.thickness / MM / film.prestretch**2  # virgin volume per mounted area
        self.voltages = [voltage for _, _, voltage in _wedges(film)]
        on_plate = mesh.Boundaries("plate")
        self.fields = []  # fields[3 * j + i]: component i moves by 1, by x or by y
        for function in (ngs.CoefficientFunction(1.0), ngs.x, ngs.y):
            for component in range(3):
                field = ngs.GridFunction(self.space)
                field.components[component].Set(function, definedon=on_plate)
                self.fields.append(field.vec)
        self.energy = ngs.BilinearForm(self.space, symmetric=True)
        trial = self.space.TrialFunction()
        self.energy += ngs.Variation(self._density(ngs.Grad(trial)).Compile() * ngs.dx)

    def _invariants(self, gradient: Any) -> tuple[Any, Any]:
        """Half the trace, and the determinant, of C from the virgin film."""
        flat = ngs.CoefficientFunction((1, 0, 0, 1, 0, 0), dims=(3, 2))
        f = self.film.prestretch * (flat + gradient)
        c = f.trans * f
        return ngs.Trace(c) / 2, ngs.Det(c)

    def _density(self, gradient: Any) -> Any:
        """Energy per mounted area [mJ/mm²]: W − ½ ε (U/T)² (λ₁ λ₂)², times T/J_p."""
        m, det = self._invariants(gradient)
        w = sum(mu / MPA / alpha * (_power_sum(m, det, alpha / 2) + det ** (-alpha / 2) - 3)
                for mu, alpha in self.film.terms)
        maxwell = self.mesh.MaterialCF({f"wedge{k}": self._maxwell(voltage)
                                        for k, voltage in enumerate(self.voltages)})
        return self.volume * (w - maxwell / 2 * det)

    def _maxwell(self, voltage: float) -> float:
        """ε (U/T)² [MPa]."""
        return self.film.permittivity * (voltage / self.film.thickness)**2 / MPA

    def place(self, pose: Pose) -> None:
        """Put the film's edge where the plate takes it."""
        change = [*(pose.shift - self.pose.shift),
                  *(pose.rotation - self.pose.rotation)[:, :2].T.ravel()]
        for field, size in zip(self.fields, change, strict=True):
            self.u.vec.data += float(size) * field
        self.pose = pose

    def lead(self, pose: Pose) -> None:
        """Move the plate, and the film with it as its tangent says: a start for Newton's method."""
        lift, pull = self.u.vec.CreateVector(), self.u.vec.CreateVector()
        before = self.u.vec.CreateVector()
        before.data = self.u.vec
        self.energy.AssembleLinearization(self.u.vec)
        inverse = self.energy.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")
        self.place(pose)
        lift.data = self.u.vec - before
        pull.data = self.energy.mat * lift
        self.u.vec.data -= inverse * pull

    def motions(self) -> np.ndarray:
        """Coefficients of the nine fields for each of the plate's six motions, (6, 9)."""
        motions = np.zeros((6, 9))
        motions[:3, :3] = np.eye(3)
        for k in range(3):
            motions[3 + k, 3:] = (CROSS[k] @ self.pose.rotation)[:, :2].T.ravel()
        return motions

    def curvature(self, slopes: np.ndarray) -> np.ndarray:
        """Stiffness of the six motions, as two small rotations do not just add up, (6, 6)."""
        result = np.zeros((6, 6))
        for k, m in itertools.product(range(3), repeat=2):
            both = (CROSS[k] @ CROSS[m] + CROSS[m] @ CROSS[k]) / 2 @ self.pose.rotation
            result[3 + k, 3 + m] = both[:, :2].T.ravel() @ slopes[3:]
        return result

    def balance(self, weight: float, free: bool) -> np.ndarray:
        """Newton's method for the film and, if it is ``free``, the plate.

        The answer is force and moments [N, N mm], (6,), that hold the plate beside the weight.
        """
        residual, answer = self.u.vec.CreateVector(), self.u.vec.CreateVector()
        sizes: list[float] = []
        while len(sizes) <= ITERATIONS:
            self.energy.Apply(self.u.vec, residual)
            slopes = np.array([ngs.InnerProduct(residual, field) for field in self.fields])
            motions = self.motions()
            forces = motions @ slopes - np.array([0, 0, weight, 0, 0, 0])
            if sizes and sizes[-1] <= TOLERANCE * max(sizes):
                return forces
            self.energy.AssembleLinearization(self.u.vec)
            inverse = self.energy.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")
            answer.data = inverse * residual
            sizes.append(abs(ngs.InnerProduct(answer, residual)))
            if free:
                move, answers = self._plate_step(inverse, residual, motions, slopes, forces)
                for size, each in zip(move, answers, strict=True):
                    answer.data += float(size) * each
                sizes[-1] += abs(move @ forces)
            self.u.vec.data -= answer
            if free:
                self.place(self.pose.moved(move))
        raise RuntimeError(f"{self.film.name}: no convergence, energies of the steps {sizes}")

    def _plate_step(self, inverse: Any, residual: Any, motions: np.ndarray, slopes: np.ndarray,
                    forces: np.ndarray) -> tuple[np.ndarray, list[Any]]:
        """Step of the plate, and the film's answer to each of its motions.

        The film's free unknowns are eliminated.
        """
        answers, pulls, moved = [], [], []
        for motion in motions:
            field, pull, answer = (self.u.vec.CreateVector() for _ in range(3))
            field[:] = 0.0
            for size, part in zip(motion, self.fields, strict=True):
                field.data += float(size) * part
            pull.data = self.energy.mat * field
            answer.data = inverse * pull
            moved.append(field)
            pulls.append(pull)
            answers.append(answer)
        stiffness = self.curvature(slopes)
        unbalanced = forces.copy()
        for k in range(6):
            unbalanced[k] -= ngs.InnerProduct(answers[k], residual)
            for m in range(6):
                stiffness[k, m] += ngs.InnerProduct(moved[k], pulls[m])
                stiffness[k, m] -= ngs.InnerProduct(answers[k], pulls[m])
        return -np.linalg.solve(stiffness, unbalanced), answers

    def capacitances(self) -> tuple[float, ...]:
        """Capacitance of each sector [F]: ε/T² times the integral of (λ₁ λ₂)² over its volume."""
        _, det = self._invariants(ngs.Grad(self.u))
        scale = self.film.permittivity / self.film.thickness**2 * self.volume * MM**3
        wedges = [((start + end) / 2,
                   scale * ngs.Integrate(det, self.mesh, order=4 * self.order,
                                         definedon=self.mesh.Materials(f"wedge{k}")))
                  for k, (start, end, _) in enumerate(_wedges(self.film))]
        return tuple(sum(part for middle, part in wedges if _contains(sector, middle))
                     for sector in self.film.sectors)

    def least_tension(self) -> float:
        """Smallest principal true stress at the integration points [Pa], the field's included."""
        points = IntegrationRuleSpace(self.mesh, order=2 * self.order)
        m, det = self._invariants(ngs.Grad(self.u))
        maxwell = self.mesh.MaterialCF({f"wedge{k}": self._maxwell(voltage)
                                        for k, voltage in enumerate(self.voltages)})
        values = []
        for function in (m, det, maxwell):
            field = ngs.GridFunction(points)
            field.Interpolate(function)
            values.append(field.vec.FV().NumPy().copy())
        half, area, field_stress = values
        x = 1 - area / half**2
        if x.max() > LARGEST_X and any(alpha != 2 for _, alpha in self.film.terms):
            raise RuntimeError(f"the series needs more terms: x is up to {x.max():.3g}")
        smaller = np.sqrt(half * (1 - np.sqrt(np.maximum(x, 0))))
        stress = sum(mu * (smaller**alpha - area**(-alpha / 2)) for mu, alpha in self.film.terms)
        return float((stress - MPA * field_stress * area).min())


def solve(film: SectorFilm, level: int, order: int) -> SectorRow:
    """The film under the weight, and with its plate held drawn out."""
    began = time.perf_counter()
    mesh = prepare(film, level, order)
    loaded = Film(film, mesh, order)
    loaded.balance(film.weight, free=True)
    rx, ry, rz = Rotation.from_matrix(loaded.pose.rotation).as_rotvec().tolist()
    x, y, z = (MM * loaded.pose.shift).tolist()
    drawn = Film(film, mesh, order)
    drawn.lead(Pose(np.array([0, 0, film.drawn / MM]), np.eye(3)))
    holding = drawn.balance(0.0, free=False)
    return SectorRow(
        package=f"NGSolve {ngs.__version__}", film=film.name,
        mesh=f"P{order}, {mesh.ne} triangles", unknowns=sum(loaded.space.FreeDofs()),
        deflection_m=z, rx=rx, ry=ry, rz=rz, x_m=x, y_m=y, capacitances_F=loaded.capacitances(),
        tension_Pa=loaded.least_tension(), forces_N=tuple(holding[:3].tolist()),
        moments_Nm=tuple((MM * holding[3:5]).tolist()),
        seconds=time.perf_counter() - began)


def rows(films: list[SectorFilm], levels: list[int], order: int) -> Iterator[SectorRow]:
    """All films on all meshes."""
    for film in films:
        for level in levels:
            yield solve(film, level, order)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", type=int, nargs="+", default=[1],
                        help="meshes, each with cells half as long")
    parser.add_argument("--order", type=int, default=4, help="order of the curved triangles")
    parser.add_argument("--only", default="", metavar="TEXT",
                        help="films whose name contains TEXT")
    options = parser.parse_args()
    films = [film for film in FILMS if options.only in film.name]
    for row in rows(films, options.levels, options.order):
        print(json.dumps(asdict(row)), flush=True)


if __name__ == "__main__":
    main()
