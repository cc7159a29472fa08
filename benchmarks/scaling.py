"""How time and memory grow with the number of unknowns, and where the peers are at the same sizes.

    python -m benchmarks.scaling [--sizes 1e3 1e4 1e5 1e6] [--limit S] [--memory GB] [--peers]
    [--peer-python PYTHON]

Each size runs in a process of its own: the full annulus meshed by gmsh, neo-Hooke 20 kPa, loaded
with 17.9 g and charged to 5 kV. Memory is the process's peak by the end of a stage, above what its
imports took.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.reference_problem import SCRIPTS, interpreter

STAGES = ("meshing", "setup", "assembly", "analysis", "factorisation", "path")
PEERS = ("felupe_membrane", "sfepy_membrane", "getfem_membrane", "calculix_membrane")
#: Peers' meshes double each way from level to level: about 700, 12,000 and 190,000 unknowns.
LEVELS = (0, 2, 4)


def child(command: Sequence[str], limit: float) -> dict[str, Any] | str:
    """The last JSON object the command prints, or in words why there is none."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=limit)
    except subprocess.TimeoutExpired:
        return f"over the limit of {limit:.0f} s"
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode == 0 and lines:
        return dict(json.loads(lines[-1]))
    return (done.stderr.strip().splitlines() or [f"ended with status {done.returncode}"])[-1]


def table(rows: Sequence[Sequence[str]]) -> str:
    """Columns aligned to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
                     for row in rows)


def line(case: dict[str, Any]) -> list[str]:
    """One size as cells: seconds / MB of each stage."""
    stages = [f"{case[stage]['seconds']:.3g} / {case[stage]['peak_MB']:,.0f}" for stage in STAGES]
    return [f"{case['unknowns']:,}", *stages, f"{case['ratio']:.1f}", f"{case['error']:.0e}"]


def exponents(cases: Sequence[dict[str, Any]]) -> list[str]:
    """Fitted powers of the unknowns, time / memory.

    Memory only where it has risen above that of the imports.
    """
    unknowns = np.array([case["unknowns"] for case in cases])

    def power(stage: str, quantity: str) -> str:
        values = np.array([case[stage][quantity] for case in cases])
        seen = values > (30 if quantity == "peak_MB" else 0)
        if seen.sum() < 2:
            return "-"
        return f"{np.polyfit(np.log(unknowns[seen]), np.log(values[seen]), 1)[0]:.2f}"

    return ["exponent",
            *(f"{power(stage, 'seconds')} / {power(stage, 'peak_MB')}" for stage in STAGES), "", ""]


def own(sizes: Sequence[float], limit: float, memory: float) -> Iterator[str]:
    """Tables of tympan for each order and solver."""
    solvers = ("SuperLU", *(["Pardiso"] if find_spec("pypardiso") else []))
    for order in (4, 2):
        for solver in solvers:
            cases, failures = [], []
            for size in sizes:
                print(f"P{order} {solver} {size:.0e} ...", file=sys.stderr, flush=True)
                module = [sys.executable, "-m", "benchmarks.scaling_case"]
                result = child([*module, str(order), str(size), solver, str(memory)], limit)
                if isinstance(result, dict):
                    cases.append(result)
                else:
                    failures.append(f"{size:.0e} unknowns: {result}")
            heads = ["unknowns", *STAGES, "x copy", "rel. error"]
            rows = [heads, *map(line, cases), *([exponents(cases)] if len(cases) > 1 else [])]
            title = f"P{order}, {solver}: seconds / MB (peak by the end of the stage)"
            yield "\n".join([title, table(rows), *failures])


def peers(limit: float, python: str) -> str:
    """The reference problem at equal numbers of unknowns, tympan on the peers' own kind of mesh."""
    rows = [["package", "unknowns", "rel. error", "seconds", "peak MB"]]
    failures = []
    for name in ("tympan_membrane", *PEERS):
        for level in LEVELS:
            print(f"{name} {level} ...", file=sys.stderr, flush=True)
            if name == "tympan_membrane":
                command = [sys.executable, "-m", "benchmarks.scaling_reference"]
            else:
                script = next(s for s in SCRIPTS if s.name == name)
                command = [interpreter(script, python) or "python3", str(script.path)]
            result = child([*command, "--first", str(level), "--levels", "1", "--repeat", "1"],
                           limit)
            if isinstance(result, str):
                failures.append(f"{name}, level {level}: {result}")
                continue
            rows.append([result["peer"], f"{result['unknowns']:,}",
                         f"{result['relative_error']:.1e}",
                         f"{result['seconds']:.3g}", f"{result['peak_MB']:,.0f}"])
    return "\n".join([table(rows), *failures])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", type=float, default=[1e3, 1e4, 1e5, 1e6],
                        help="unknowns")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for one size")
    parser.add_argument("--memory", type=float, default=16.0, help="GB one size may use")
    parser.add_argument("--peers", action="store_true",
                        help="also the other packages, 120 s for each mesh")
    parser.add_argument("--peer-python", default=sys.executable,
                        help="Python that has the pip-installed peers")
    options = parser.parse_args()
    for part in own(options.sizes, options.limit, options.memory):
        print(part + "\n", flush=True)
    if options.peers:
        print(peers(120.0, options.peer_python))


if __name__ == "__main__":
    main()
