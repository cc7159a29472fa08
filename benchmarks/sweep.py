"""How long a sweep takes: specimens under two masses and fifteen voltages, CAD and meshing too.

    python -m benchmarks.sweep [--specimens 1000] [--workers 2] [--every 8] [--rounds 3]

All of them once with several processes; then every eighth with several, with one, and on a Dask
cluster of as many worker processes on loopback, in turn, three times. Of their ratios in each
round, from the first result on, the median counts, since starting processes takes as long for few
specimens as for many; the time from the start stands beside it.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from tympan.geometry.outlines import OUTLINES
from tympan.studies.parallel import processes
from tympan.studies.sweep.cluster import cluster
from tympan.studies.sweep.plan import Sweep, read_sweep
from tympan.studies.sweep.run import Pool, run_sweep

AIM = 100.0  # seconds for 1000 specimens on two processors
LEAST_GAIN, MOST_OVERHEAD, AGREEMENT = 1.8, 0.15, 1e-12

FILM = """
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.2360679775, 2.2360679775]
relative_permittivity = 4.7
material = "vhb-4910"
"""

FRAMES = {"ellipse": "", "superellipse": "exponent = 3\n"}

SWEEP = """
specimen = [{files}]
mass = ["17.9 g", "22.45 g"]
voltage = {{ from = "0 kV", to = "7 kV", count = 15 }}
[sample]
method = "sobol"
count = {count}
[sample.ranges]
"frame.semi_axes.0" = ["4.5 cm", "7.5 cm"]
"frame.semi_axes.1" = ["4 cm", "4.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"""


def planned(folder: Path, specimens: int) -> Sweep:
    """Half of the specimens of each shape that is there."""
    shapes = [shape for shape in FRAMES if shape in OUTLINES]
    for shape in shapes:
        folder.joinpath(f"{shape}.toml").write_text(
            f'name = "{shape}"\n[frame]\nshape = "{shape}"\n'
            f'semi_axes = ["6 cm", "4.5 cm"]\n{FRAMES[shape]}{FILM}')
    files = ", ".join(f'"{shape}.toml"' for shape in shapes)
    folder.joinpath("SWEEP.toml").write_text(SWEEP.format(files=files,
                                                          count=specimens // len(shapes)))
    return read_sweep(folder / "SWEEP.toml")


@dataclass(frozen=True)
class Timing:
    """Of a run: seconds from its start, from its first result to its last table, and the table."""

    whole: float
    running: float
    table: xr.Dataset


def timed(words: str, sweep: Sweep, folder: Path, solve: Pool) -> Timing:
    """Run a sweep and say how long it took."""
    began = first = time.perf_counter()
    spent = _children()

    def seen(done: int, kept: int) -> None:
        nonlocal first
        if done and first == began:
            first = time.perf_counter()

    summary = run_sweep(sweep, folder, solve, seen)
    ended = time.perf_counter()
    cpu = (_children() - spent) / len(sweep.entries)
    print(f"{words:<24}{ended - began:>8.1f} s, {ended - first:.1f} s from the first result, "
          f"{summary.solved / (ended - began):.0f} cases/s"
          + (f", CPU {cpu:.2f} s a specimen" if cpu else "")
          + f"   {summary.statuses}", flush=True)
    with xr.open_dataset(folder / "sweep.nc", engine="h5netcdf") as table:
        return Timing(ended - began, ended - first, table.load())


def _children() -> float:
    """Processor time of processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def loopback(workers: int) -> Iterator[str]:
    """Address of the scheduler of a cluster of processes on this machine."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1",
                      dashboard_address=None) as machine:
        yield machine.scheduler_address


def difference(table: xr.Dataset, other: xr.Dataset) -> float:
    """Largest relative difference of a number; infinite where texts differ."""
    worst = 0.0
    for name in table.data_vars:
        a, b = table[name].values, other[name].values
        if a.dtype.kind != "f":
            worst = worst if (a == b).all() else np.inf
        elif not np.array_equal(np.isnan(a), np.isnan(b)):
            worst = np.inf
        else:
            scale = np.nanmax(np.abs(a), initial=1e-300)
            worst = max(worst, float(np.nanmax(np.abs(a - b) / scale, initial=0.0)))
    return worst


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--specimens", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--every", type=int, default=8, help="which share of them to compare on")
    parser.add_argument("--rounds", type=int, default=3, help="how often they are compared")
    options = parser.parse_args()
    os.environ["TYMPAN_CACHE"] = ""  # every round meshes its films anew
    several = partial(processes, workers=options.workers)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        began = time.perf_counter()
        sweep = planned(folder, options.specimens)
        reading = time.perf_counter() - began
        print(f"{len(sweep.entries)} specimens, {sweep.cases} cases; "
              f"read and checked in {reading:.1f} s, load {os.getloadavg()[0]:.1f}", flush=True)
        all_of_them = timed(f"{options.workers} processes", sweep, folder / "all", several)
        aim = AIM * len(sweep.entries) / 1000
        whole = reading + all_of_them.whole
        _verdict(f"in all {whole:.1f} s, aim {aim:.1f} s", whole < aim)
        part = replace(sweep, entries=sweep.entries[:: options.every])
        print(f"every {options.every}th: {len(part.entries)} specimens, {part.cases} cases",
              flush=True)
        compare(part, folder, options.workers, options.rounds)


def compare(sweep: Sweep, folder: Path, workers: int, rounds: int) -> None:
    """Several processes, one, and a Dask cluster in turn.

    The median of the rounds' ratios counts.
    """
    runs: dict[str, list[Timing]] = {"several": [], "one": [], "dask": []}
    for number in range(rounds):
        for words, name, count in ((f"{workers} processes", "several", workers),
                                   ("1 process", "one", 1)):
            solve = partial(processes, workers=count)
            runs[name].append(timed(words, sweep, folder / f"{name}-{number}", solve))
        with loopback(workers) as address:
            solve = partial(cluster, address=address)
            runs["dask"].append(timed(f"Dask, {workers} workers", sweep, folder / f"dask-{number}",
                                      solve))
    gain, overhead = (float(np.median([slow.running / fast.running for slow, fast in
                                       zip(runs[name], runs["several"], strict=True)]))
                      for name in ("one", "dask"))
    _verdict(f"{workers} processes are {gain:.2f} times as fast as one, aim {LEAST_GAIN}",
             gain >= LEAST_GAIN)
    _same("one process", runs["several"][0].table, runs["one"][0].table)
    _verdict(f"Dask takes {overhead - 1:+.1%} time, aim below {MOST_OVERHEAD:.0%}",
             overhead - 1 < MOST_OVERHEAD)
    _same("Dask", runs["several"][0].table, runs["dask"][0].table)


def _same(words: str, table: xr.Dataset, other: xr.Dataset) -> None:
    worst = difference(table, other)
    _verdict(f"the table of {words} differs by at most {worst:.1e}, aim {AGREEMENT:.0e}",
             worst <= AGREEMENT)


def _verdict(words: str, met: bool) -> None:
    print(f"{words}   {'met' if met else 'not met'}", flush=True)


if __name__ == "__main__":
    main()
