"""What all peer scripts share: the reference problem, the timing and the line they print."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import NoReturn, TypeVar

MISSING = 3  # exit status of a script whose package is not installed
QUICK_S = 0.5  # quick solves are repeated for so long: the pace of a machine changes
PATIENCE_S = 60.0  # no further repeats of one mesh once they have used up this time


@dataclass(frozen=True)
class Problem:
    """Rigid disc pushed out of a prestretched neo-Hookean film; lengths in mm, stresses in MPa."""

    inner: float = 10.0
    outer: float = 45.0
    film_thickness: float = 1.0
    prestretch: float = 5.0**0.5
    mu: float = 0.025
    travel: float = 5.0
    force: float = 0.518268589

    @property
    def mounted_thickness(self) -> float:
        """T / J_p, the film thickness (mm) after the equibiaxial prestretch."""
        return self.film_thickness / self.prestretch**2


PROBLEM = Problem()


@dataclass(frozen=True)
class Limit:
    """Voltage at which the film of :data:`PROBLEM` first loses its tension under a weight.

    ``permittivity`` [N/V²], ``weight`` [N], ``voltage`` by the axisymmetric equations [V]. A ramp
    has increments of ``increment`` [V] and finds the limit to the relative ``accuracy``.
    """

    permittivity: float = 4.7 * 8.8541878128e-12
    weight: float = 17.9e-3 * 9.80665
    voltage: float = 9095.627
    increment: float = 500.0
    accuracy: float = 1e-4


LIMIT = Limit()


@dataclass(frozen=True)
class Row:
    """One measurement; the field names are those of the printed JSON object."""

    peer: str
    version: str
    method: str
    unknowns: int
    force_N: float
    relative_error: float
    seconds: float
    notes: str
    peak_MB: float = 0.0


@dataclass(frozen=True)
class Peer:
    """What a row says of the package, whatever the mesh."""

    name: str
    version: str
    method: str
    notes: str


@dataclass(frozen=True)
class Solution:
    """Free degrees of freedom and plate force (N) of one run."""

    unknowns: int
    force: float


Mesh = TypeVar("Mesh")


def give_up(package: str, install: str) -> NoReturn:
    """Leave with the status for a missing package, saying what to install."""
    print(f"{package} is not installed: {install}", file=sys.stderr)
    sys.exit(MISSING)


def measure(
    peer: Peer, levels: int, repeat: int,
    prepare: Callable[[int], Mesh], solve: Callable[[Mesh], Solution],
    first: int = 0,
) -> Iterator[Row]:
    """Rows for the meshes `prepare(first) ... prepare(first + levels - 1)`.

    Only `solve` is timed, of at least `repeat` runs the fastest.

    Every run gets a mesh of its own, so nothing computed in one run is reused in the next. One run
    on the coarsest mesh goes before and is not counted: lazy imports and compile caches are not the
    subject.
    """
    solve(prepare(0))
    for level in range(first, first + levels):
        times: list[float] = []
        while sum(times) < (PATIENCE_S if len(times) < repeat else QUICK_S):
            mesh = prepare(level)
            start = time.perf_counter()
            solution = solve(mesh)
            times.append(time.perf_counter() - start)
        yield Row(
            peer=peer.name,
            version=peer.version,
            method=peer.method,
            unknowns=solution.unknowns,
            force_N=solution.force,
            relative_error=abs(solution.force / PROBLEM.force - 1),
            seconds=min(times),
            notes=peer.notes,
            peak_MB=max(resource.getrusage(who).ru_maxrss
                        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024,
        )


def main(peer: Peer, prepare: Callable[[int], Mesh], solve: Callable[[Mesh], Solution]) -> None:
    """Command line of a peer script: one JSON object per mesh on stdout."""
    parser = argparse.ArgumentParser(description=f"{peer.name}: {peer.method}")
    parser.add_argument("--levels", type=int, default=3,
                        help="number of meshes, each twice as fine")
    parser.add_argument("--repeat", type=int, default=3, help="runs per mesh; the fastest counts")
    parser.add_argument("--first", type=int, default=0, help="coarsest mesh")
    options = parser.parse_args()
    for row in measure(peer, options.levels, options.repeat, prepare, solve, options.first):
        print(json.dumps(asdict(row)), flush=True)
