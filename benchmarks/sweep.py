"""How long a sweep takes: specimens under two masses and fifteen voltages, CAD and meshing too.

    python -m benchmarks.sweep [--specimens 1000] [--workers 2] [--every 8] [--rounds 3]
    python -m benchmarks.sweep --parts
    python -m benchmarks.sweep --asked [--specimens 500]

All of them once with several processes, by reduced films; then every eighth by finite elements
(``--exact``) with several, with one, and on a Dask cluster of as many worker processes on loopback,
in turn, three times. Deflections of the reduced films are compared with these. Of their ratios in
each round, from the first result on, the median counts, since starting processes takes as long for
few specimens as for many; the time from the start stands beside it. With ``--parts`` instead: what
the processor time of a specimen is spent on, the least of four repeats, mean of eight specimens of
each shape. With ``--asked``: 500 specimens under one mass and eight voltages with α, limits and
modes, by the command, which is killed without warning when a third is done, and run again.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tympan.base.fields import write
from tympan.base.toml_reader import Table
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.model import Model
from tympan.geometry.mesh import from_flat
from tympan.geometry.mesher import mesh_film
from tympan.geometry.outlines import OUTLINES
from tympan.studies.case import summaries, voltage_ramp
from tympan.studies.parallel import processes
from tympan.studies.sweep.cluster import cluster
from tympan.studies.sweep.plan import Sweep, read_sweep
from tympan.studies.sweep.run import Pool, run_sweep
from tympan.studies.sweep.task import SweepTask

if TYPE_CHECKING:
    import xarray as xr

AIM = 10.0  # seconds for 1000 specimens on two processors
REDUCED = 1e-4  # largest difference of a reduced film's deflection, relative
ASKED_AIM = 600.0  # for 500 that are asked for more
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

LOADS = """
mass = ["17.9 g", "22.45 g"]
voltage = { from = "0 kV", to = "7 kV", count = 15 }
"""
ASKED = """
mass = "17.9 g"
voltage = { from = "0 kV", to = "3.5 kV", count = 8 }
ask = ["alpha", "limits", "modes"]
"""

SWEEP = """
specimen = [{files}]
{loads}
[sample]
method = "sobol"
count = {count}
[sample.ranges]
"frame.semi_axes.0" = ["4.5 cm", "7.5 cm"]
"frame.semi_axes.1" = ["4 cm", "4.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"""


def planned(folder: Path, specimens: int, loads: str = LOADS, exact: bool = False) -> Sweep:
    """Half of the specimens of each shape that is there."""
    shapes = [shape for shape in FRAMES if shape in OUTLINES]
    for shape in shapes:
        folder.joinpath(f"{shape}.toml").write_text(
            f'name = "{shape}"\n[frame]\nshape = "{shape}"\n'
            f'semi_axes = ["6 cm", "4.5 cm"]\n{FRAMES[shape]}{FILM}')
    files = ", ".join(f'"{shape}.toml"' for shape in shapes)
    folder.joinpath("SWEEP.toml").write_text(SWEEP.format(
        files=files, loads=loads, count=specimens // len(shapes)))
    return read_sweep(folder / "SWEEP.toml", exact=exact)


@dataclass(frozen=True)
class Timing:
    """Of a run: seconds from its start, from its first result to its last table, and the table."""

    whole: float
    running: float
    table: xr.Dataset


def timed(words: str, sweep: Sweep, folder: Path, solve: Pool) -> Timing:
    """Run a sweep and say how long it took."""
    began = first = time.perf_counter()
    spent = _processor()

    def seen(done: int, kept: int) -> None:
        nonlocal first
        if done and first == began:
            first = time.perf_counter()

    summary = run_sweep(sweep, folder, solve, seen)
    ended = time.perf_counter()
    cpu = (_processor() - spent) / len(sweep.entries)
    print(f"{words:<24}{ended - began:>8.1f} s, {ended - first:.1f} s from the first result, "
          f"{summary.solved / (ended - began):.0f} cases/s"
          + f", CPU {cpu:.3f} s a specimen   {summary.statuses}", flush=True)
    import xarray as xr  # not above: the processes that solve import this file, too

    with xr.open_dataset(folder / "sweep.nc", engine="h5netcdf") as table:
        return Timing(ended - began, ended - first, table.load())


def _processor() -> float:
    """Processor time of this process and of those it started, which have ended [s]."""
    return sum(used.ru_utime + used.ru_stime for used in map(
        resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


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
    parser.add_argument("--specimens", type=int, help="1000, or 500 that are asked")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--every", type=int, default=8,
                        help="which share of them to compare on; 0: none")
    parser.add_argument("--rounds", type=int, default=3, help="how often they are compared")
    parser.add_argument("--parts", action="store_true")
    parser.add_argument("--asked", action="store_true")
    options = parser.parse_args()
    os.environ["TYMPAN_CACHE"] = ""  # every round meshes its films anew
    several = partial(processes, workers=options.workers)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.parts:
            print_parts(planned(folder, 20, exact=True))
            return
        if options.asked:
            resumed(folder, options.specimens or 500)
            return
        began, spent = time.perf_counter(), _processor()
        sweep = planned(folder, options.specimens or 1000)
        reading = time.perf_counter() - began
        print(f"{len(sweep.entries)} specimens, {sweep.cases} cases; "
              f"read and checked in {reading:.1f} s, load {os.getloadavg()[0]:.1f}", flush=True)
        all_of_them = timed(f"{options.workers} processes", sweep, folder / "all", several)
        aim = AIM * len(sweep.entries) / 1000
        whole, used = reading + all_of_them.whole, (_processor() - spent) / options.workers
        _verdict(f"in all {whole:.1f} s, aim {aim:.1f} s; {used:.1f} s of each of "
                 f"{options.workers} processors, load {os.getloadavg()[0]:.1f}", whole < aim)
        if not options.every:
            return
        part = planned(folder, options.specimens or 1000, exact=True)
        part = replace(part, entries=part.entries[:: options.every])
        print(f"every {options.every}th: {len(part.entries)} specimens, {part.cases} cases",
              flush=True)
        exact = compare(part, folder, options.workers, options.rounds)
        near = all_of_them.table.isel(specimen=slice(None, None, options.every))
        off = abs(near["deflection_m"] / exact["deflection_m"] - 1).max().item()
        share = (near["by"] == "reduced").mean().item()
        _verdict(f"{share:.1%} of the rows are by a reduced film; deflections differ by at most "
                 f"{off:.1e} from finite elements, aim {REDUCED:.0e}", off <= REDUCED)


def print_parts(sweep: Sweep, count: int = 8, repeats: int = 4) -> None:
    """Processor time of the parts of a task [ms], for each shape."""
    tasks = [entry.task for entry in sweep.entries if entry.task is not None]
    for shape in FRAMES:
        alike = [task for task in tasks if task.specimen.frame.shape == shape][: count + 1]
        _least(alike[0], 1)  # what is loaded once
        rows = [_least(task, repeats) for task in alike[1:]]
        for part in rows[0]:
            spent = 1e3 * sum(row[part] for row in rows) / len(rows)
            print(f"{shape:<14}{part:<42}{spent:>8.1f} ms")


def _least(task: SweepTask, repeats: int) -> dict[str, float]:
    runs = [dict(_timed_parts(task, 1 + 1e-9 * number)) for number in range(1, repeats + 1)]
    return {part: min(run[part] for run in runs) for part in runs[0]}


def _timed_parts(task: SweepTask, factor: float) -> Iterator[tuple[str, float]]:
    """Of a frame of ``factor`` times the width, since outlines met before are not checked again."""
    rig, path, (along, across) = task.rig, task.settings.path, task.specimen.frame.semi_axes
    content = write(task.specimen)
    content["frame"]["semi_axes"] = [f"{along * factor!r} m", f"{across!r} m"]
    last = time.process_time()

    def lap() -> float:
        nonlocal last
        before, last = last, time.process_time()
        return last - before

    specimen = load_specimen(Table("specimen.toml", content))
    planes = specimen.mirror_planes
    yield "reading and checking", lap()
    mesh = from_flat(mesh_film(specimen, task.settings.mesh, planes))
    yield "CAD and gmsh", lap()
    model = Model(Discretisation.of(mesh, planes), specimen)
    model.linearised(model.mounted())
    yield "discretisation, order, pattern", lap()
    cases = [pair for mass in task.masses
             for pair in voltage_ramp(model, mass, task.voltages, rig, path)]
    yield "30 equilibria, each mass by itself", lap()
    list(summaries(model, cases))
    yield "their fields, totals and warnings", lap()


def resumed(folder: Path, specimens: int) -> None:
    """What is asked beside, by the command: killed when a third is done, and run again."""
    count = len(planned(folder, specimens, ASKED).entries)
    command = [sys.executable, "-m", "tympan", "sweep", str(folder / "SWEEP.toml"), "-o",
               str(folder / "out")]
    began = time.perf_counter()
    run = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)
    while run.poll() is None and _finished(folder) < count / 3:
        time.sleep(0.2)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    killed, kept = time.perf_counter() - began, _finished(folder)
    subprocess.run(command, check=True)
    whole = time.perf_counter() - began
    print(f"{count} specimens with alpha, limits and modes; killed after {killed:.0f} s with "
          f"{kept} of them")
    _verdict(f"in all {whole:.0f} s, aim {ASKED_AIM:.0f} s", whole <= ASKED_AIM)


def _finished(folder: Path) -> int:
    return sum(file.is_file() for file in (folder / "out" / "tasks").rglob("*"))


def compare(sweep: Sweep, folder: Path, workers: int, rounds: int) -> xr.Dataset:
    """Several processes, one, and a Dask cluster in turn; the table of the first.

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
    return runs["several"][0].table


def _same(words: str, table: xr.Dataset, other: xr.Dataset) -> None:
    worst = difference(table, other)
    _verdict(f"the table of {words} differs by at most {worst:.1e}, aim {AGREEMENT:.0e}",
             worst <= AGREEMENT)


def _verdict(words: str, met: bool) -> None:
    print(f"{words}   {'met' if met else 'not met'}", flush=True)


if __name__ == "__main__":
    main()
