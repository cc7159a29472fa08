"""One size of the scaling benchmark, in a process of its own; see `scaling.py`.

python -m benchmarks.scaling_case ORDER UNKNOWNS SOLVER MEMORY_GB
"""

from __future__ import annotations

import json
import math
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TypeVar

import numpy as np

from benchmarks.tympan_rows import specimen
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import Ogden
from tympan.fem.linear_solver import direct
from tympan.fem.linear_solver.direct import factorise
from tympan.fem.membrane.model import Model
from tympan.geometry.mesh import from_flat
from tympan.geometry.mesher import MeshSettings, mesh_film

FORCE, VOLTAGE = 0.0179 * 9.81, 5e3

T = TypeVar("T")


@dataclass(frozen=True)
class Stage:
    """Seconds and the process's peak memory by the end of it, in MB above what the imports took."""

    seconds: float
    peak_MB: float


@dataclass(frozen=True)
class Case:
    """One size.

    ``ratio`` is assembly's time over that of moving its bytes at a copy's ``bandwidth`` [GB/s].
    """

    order: int
    solver: str
    unknowns: int
    entries: int
    meshing: Stage
    setup: Stage
    assembly: Stage
    analysis: Stage
    factorisation: Stage
    path: Stage
    bandwidth: float
    ratio: float
    error: float


def exact_deflection() -> float:
    """Deflection [m] of the axisymmetric neo-Hooke membrane, 20 kPa, under them, by the oracle."""
    from tests.oracles.axisymmetric import Film, neo_hooke, solve_load

    return float(solve_load(Film(0.01, 0.045, 1e-3, math.sqrt(5), neo_hooke(20e3), 4.7), FORCE,
                            VOLTAGE).deflection)


def peak_mb() -> float:
    """Peak resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def timed(work: Callable[[], T], base: float) -> tuple[T, Stage]:
    """What the work returns, and its stage."""
    began = time.perf_counter()
    result = work()
    return result, Stage(time.perf_counter() - began, peak_mb() - base)


def film_model(order: int, unknowns: int) -> Model:
    """The full annulus, neo-Hooke 20 kPa, meshed by gmsh to about so many unknowns."""
    plain = specimen()
    case = replace(plain, membrane=replace(plain.membrane, material=Ogden((20e3,), (2.0,))))
    # Fine meshes of order 4 have 1800 unknowns times the square of their refinement.
    factor = math.sqrt(unknowns / 1800) * 4 / order
    mesh = from_flat(mesh_film(case, MeshSettings(order).refined(factor), frozenset()))
    return Model(Discretisation.of(mesh), case)


def copy_bandwidth() -> float:
    """Bytes read and written per second by a large copy."""
    source, target = np.ones(2**24), np.zeros(2**24)
    seconds = []
    for _ in range(5):
        began = time.perf_counter()
        np.copyto(target, source)
        seconds.append(time.perf_counter() - began)
    return 2 * source.nbytes / min(seconds)


def least_bytes(model: Model, entries: int) -> int:
    """Bytes assembly cannot avoid: gradients, element tangents twice, the sparse tangent."""
    mesh = model.discretisation
    elements, local = mesh.connectivity.shape
    return 8 * (mesh.gradients.size + 2 * elements * (3 * local) ** 2 + entries)


def prepare(model: Model, solver: str) -> None:
    """Choose the solver of this name for the model."""
    direct.PARDISO_PAYS = 0 if solver == "Pardiso" else 2**62
    assert type(model.discretisation.unknowns.analysis).__name__ == solver


def assembled(model: Model, base: float) -> Stage:
    """Forces and tangent of a state, the faster of two."""
    rest = model.mounted(1e6)
    stages = [timed(lambda: bool(model.linearised(rest)), base)[1] for _ in range(2)]
    return min(stages, key=lambda stage: stage.seconds)


def factorised(model: Model, solver: str, base: float) -> tuple[Stage, Stage, int]:
    """The analysis with what it adds to the first factorisation; a second one.

    And the tangent's entries.
    """
    inner = model.linearised(model.mounted(1e6)).inner
    _, order = timed(lambda: prepare(model, solver), base)
    _, first = timed(lambda: bool(factorise(inner, model.discretisation.unknowns.analysis)), base)
    _, again = timed(lambda: bool(factorise(inner, model.discretisation.unknowns.analysis)), base)
    return Stage(order.seconds + max(0.0, first.seconds - again.seconds),
                 first.peak_MB), again, int(inner.nnz)


def measure(order: int, unknowns: int, solver: str) -> Case:
    """All stages of one size."""
    equilibrium(film_model(order, 500), FORCE, VOLTAGE)  # lazy imports are not the subject
    base = peak_mb()
    model, meshing = timed(lambda: film_model(order, unknowns), base)
    _, setup = timed(lambda: (model.volumes, model.discretisation.unknowns.pattern), base)
    assembly = assembled(model, base)
    analysis, factorisation, entries = factorised(model, solver, base)
    outcome, path = timed(lambda: equilibrium(model, FORCE, VOLTAGE), base)
    bandwidth = copy_bandwidth()
    error = abs(outcome.state.plate.deflection / exact_deflection() - 1)
    ratio = assembly.seconds * bandwidth / least_bytes(model, entries)
    return Case(order, solver, model.unknowns, entries, meshing, setup, assembly, analysis,
                factorisation, path,
                bandwidth / 1e9, ratio, error)


def main() -> None:
    """Command line."""
    order, unknowns, solver, memory = sys.argv[1:]
    limit = int(float(memory) * 2**30)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    print(json.dumps(asdict(measure(int(order), int(float(unknowns)), solver))))


if __name__ == "__main__":
    main()
