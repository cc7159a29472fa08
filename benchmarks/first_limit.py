"""Time the first limit of a weighted film: tympan, and a continuation in FElupe beside it.

    python -m benchmarks.first_limit [--peer-python PYTHON] [--levels 2] [--refine 0.5 1 2]

The question: at which voltage does the film of ``benchmarks.reference_problem``, under a weight of
17.9 g, first lose its tension? The axisymmetric equations answer it to all digits
(``tests/oracles/unstable.py``). tympan's times are those of ``limits`` from a specimen on, meshing
included, in a process that has solved another film. The peer's are those of a script as its users
write it (``benchmarks/peers/felupe_limit.py``), from its mesh on.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from benchmarks.peers.harness import LIMIT
from benchmarks.tympan_rows import specimen
from tympan.base.constants import STANDARD_GRAVITY
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, build_model
from tympan.studies.limits import limits

SCRIPT = Path(__file__).parent / "peers" / "felupe_limit.py"


@dataclass(frozen=True)
class Row:
    """Voltage [V] of the first loss of tension by a package on a mesh, and the time it took [s]."""

    package: str
    version: str
    unknowns: int
    voltage_V: float
    seconds: float

    @property
    def error(self) -> float:
        """Relative error of the voltage."""
        return abs(self.voltage_V / LIMIT.voltage - 1)


def own_rows(refine: list[float]) -> Iterator[Row]:
    """Find the limit with tympan on meshes of several finenesses; the faster of two runs counts."""
    film, mass = specimen(), LIMIT.weight / STANDARD_GRAVITY
    limits(Case(specimen(outer=40.0), mass=mass), Settings(MeshSettings().refined(0.5)))
    for factor in refine:
        settings, seconds = Settings(MeshSettings().refined(factor)), []
        for _ in range(2):
            began = time.perf_counter()
            found = limits(Case(film, mass=mass), settings).tension
            seconds.append(time.perf_counter() - began)
        assert found is not None
        yield Row("tympan", version("tympan"), build_model(film, settings).unknowns,
                  found.voltage_V, min(seconds))


def peer_rows(python: str, levels: int) -> Iterator[Row]:
    """Run the peer's script with a Python that has it."""
    done = subprocess.run([python, SCRIPT.name, "--levels", str(levels)], cwd=SCRIPT.parent,
                          capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stderr.strip().splitlines()[-1], file=sys.stderr)
    for line in done.stdout.splitlines():
        yield Row(**json.loads(line))


def table(rows: list[Row]) -> list[str]:
    """Write the rows as a table."""
    return ["| package | unknowns | first loss of tension | error | time |",
            "|---|---|---|---|---|",
            *(f"| {row.package} {row.version} | {row.unknowns:,} | {row.voltage_V:.1f} V | "
              f"{row.error:.1e} | {row.seconds:.2f} s |" for row in rows)]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.first_limit",
                                     description="Time the first limit of a weighted film.")
    parser.add_argument("--peer-python", help="Python that has the pip-installed FElupe")
    parser.add_argument("--levels", type=int, default=2, help="meshes of the peer")
    parser.add_argument("--refine", type=float, nargs="+", default=[0.5, 1.0, 2.0])
    options = parser.parse_args()
    rows = list(own_rows(options.refine))
    if options.peer_python and shutil.which(options.peer_python):
        rows += peer_rows(options.peer_python, options.levels)
    print(*table(rows), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
