"""Time tympan and the other packages on the same membrane, each in a process of its own.

    python -m benchmarks.reference_problem [--levels 3] [--repeat 3] [--only NAME ...] [-o FILE]

A rigid disc is pushed out of a prestretched neo-Hookean film between two circles; see
`peers/harness.py` for the numbers. Timed is the way from a mesh in memory to the force, without
meshing, imports or compilation.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from benchmarks.peers.harness import MISSING, Row

PEERS = Path(__file__).parent / "peers"


@dataclass(frozen=True)
class Script:
    """A peer script and whose Python it needs.

    That of the operating system's packages, of the pip-installed peers, or tympan's own.
    """

    name: str
    python: Literal["system", "peers", "tympan"] = "peers"

    @property
    def path(self) -> Path:
        """The file to run."""
        return PEERS / f"{self.name}.py"


#: Seconds of peers' rows, by package and unknowns, on the machine that the aims were set on.
WHERE_AIMS_WERE_SET = {("FEniCSx", 672): 0.009, ("FEniCSx", 11_904): 0.106,
                       ("FElupe", 672): 0.011, ("NGSolve", 2_184): 0.034}


@dataclass(frozen=True)
class Outcome:
    """Rows of one peer script, and what went wrong or has to be installed, if anything."""

    script: Script
    rows: tuple[Row, ...]
    problem: str = ""


SCRIPTS = (
    Script("ngsolve_membrane"),
    Script("fenicsx_membrane", "system"),
    Script("felupe_membrane"),
    Script("felupe_axisymmetric"),
    Script("sfepy_membrane"),
    Script("getfem_membrane", "system"),
    Script("calculix_membrane", "tympan"),
)


def interpreter(script: Script, peer_python: str) -> str | None:
    """Python to run the script with; None if the operating system has none."""
    return {"system": shutil.which("python3", path="/usr/bin"), "peers": peer_python,
            "tympan": sys.executable}[script.python]


def run(script: Script, peer_python: str, levels: int, repeat: int) -> Outcome:
    """Run one peer script to its end; rows printed before a failure are kept."""
    python = interpreter(script, peer_python)
    if python is None or shutil.which(python) is None:
        return Outcome(script, (), f"no such Python: {python or '/usr/bin/python3'}")
    command = [python, str(script.path), "--levels", str(levels), "--repeat", str(repeat)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    rows = tuple(Row(**json.loads(line)) for line in done.stdout.splitlines()
                 if line.startswith("{"))
    if done.returncode == 0:
        return Outcome(script, rows)
    last = (done.stderr.strip().splitlines() or [""])[-1]
    return Outcome(script, rows, last if done.returncode == MISSING else f"failed: {last}")


def fastest_at_least_as_accurate(row: Row, ours: list[Row]) -> Row | None:
    """The quickest of tympan's rows whose error is no larger; None if there is none."""
    return min(
        (candidate for candidate in ours if candidate.relative_error <= row.relative_error),
        key=lambda candidate: candidate.seconds, default=None
    )


def _aligned(cells: tuple[str, ...], widths: list[int]) -> Iterator[str]:
    """Names to the left, numbers to the right of their columns."""
    for k, (cell, width) in enumerate(zip(cells, widths, strict=True)):
        yield cell.ljust(width) if k < 3 else cell.rjust(width)


def table(rows: list[Row], ours: list[Row]) -> str:
    """Text table.

    The last column is the time over that of tympan at the same or a better accuracy.
    """
    heads = ("package", "version", "method", "unknowns", "rel. error", "seconds", "x tympan")
    cells = [heads]
    for row in rows:
        match = fastest_at_least_as_accurate(row, ours)
        ratio = f"{row.seconds / match.seconds:.1f}" if match else "-"
        error, seconds = f"{row.relative_error:.1e}", f"{row.seconds:.3f}"
        cells.append((row.peer, row.version, row.method, f"{row.unknowns:,}", error, seconds,
                      ratio))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join("  ".join(_aligned(line, widths)) for line in cells)


def own_rows(repeat: int) -> list[Row]:
    """Rows of tympan; imported here because its absence must not keep the peers from running."""
    from benchmarks.tympan_rows import rows

    return rows(repeat)


def own_aims(ours: list[Row], repeat: int) -> str:
    """What tympan does besides, and its aims against what was measured in this run."""
    from benchmarks.tympan_rows import aims, extras

    others = extras(repeat)
    lines = (f"{aim.words:<52} aim {aim.limit * 1e3:5.0f} ms   "
             f"measured {aim.seconds * 1e3:6.1f} ms   "
             + ("met" if aim.seconds <= aim.limit
                else f"missed by {aim.seconds / aim.limit - 1:.0%}")
             for aim in aims(ours, others))
    return table(others, []) + "\n\n" + "\n".join(lines)


def pace(peers: list[Row]) -> str:
    """How much longer peers take than on the machine that the aims were set on."""
    ratios = [f"{row.peer} {row.unknowns:,} unknowns "
              f"{row.seconds / WHERE_AIMS_WERE_SET[row.peer, row.unknowns]:.2f}"
              for row in peers if (row.peer, row.unknowns) in WHERE_AIMS_WERE_SET]
    return ("times over those of the machine the aims were set on: "
            + (", ".join(ratios) or "no peer tells"))


def report(ours: list[Row], outcomes: list[Outcome]) -> str:
    """The table, the notes of each package and the packages that did not run."""
    rows = [*ours, *(row for outcome in outcomes for row in outcome.rows)]
    notes = dict.fromkeys(f"{row.peer}, {row.method}: {row.notes}" for row in rows if row.notes)
    absent = [f"{outcome.script.name}: {outcome.problem}" for outcome in outcomes
              if outcome.problem]
    parts = [table(rows, ours), "\n".join(notes)]
    if absent:
        parts.append("did not run to the end:\n" + "\n".join(absent))
    return "\n\n".join(parts)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--levels", type=int, default=3, help="meshes per peer, each twice as fine")
    parser.add_argument("--repeat", type=int, default=3,
                        help="runs per mesh, more of quick ones; the fastest counts")
    parser.add_argument("--only", nargs="+", metavar="NAME",
                        help="run the peers whose script name contains NAME")
    parser.add_argument("--peer-python", default=sys.executable,
                        help="Python that has the pip-installed peers")
    parser.add_argument("--peers-only", action="store_true", help="leave tympan out")
    parser.add_argument("-o", "--output", type=Path, help="also write the rows as JSON")
    options = parser.parse_args()
    scripts = [s for s in SCRIPTS if not options.only
               or any(name in s.name for name in options.only)]
    ours = [] if options.peers_only else own_rows(options.repeat)
    outcomes = []
    for script in scripts:
        print(f"{script.name} ...", file=sys.stderr, flush=True)
        outcomes.append(run(script, options.peer_python, options.levels, options.repeat))
    print(report(ours, outcomes))
    if ours:
        print("\n" + own_aims(ours, options.repeat))
        print(pace([row for outcome in outcomes for row in outcome.rows]))
    if options.output:
        rows = [*ours, *(row for outcome in outcomes for row in outcome.rows)]
        missing = {outcome.script.name: outcome.problem for outcome in outcomes if outcome.problem}
        options.output.write_text(json.dumps({"rows": [asdict(row) for row in rows],
                                              "missing": missing}, indent=1))


if __name__ == "__main__":
    main()
