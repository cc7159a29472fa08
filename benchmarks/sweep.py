"""How long a sweep takes: specimens, each under two masses and fifteen voltages, CAD and meshing included.

    python -m benchmarks.sweep [--specimens 1000] [--workers 2] [--skip-dask]

Once with one process, once with several, once on a Dask cluster of as many worker processes on loopback.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from geometry.outlines import REGISTRY
from studies.sweep.cluster import cluster
from studies.sweep.plan import Sweep, read_sweep
from studies.sweep.pool import processes
from studies.sweep.run import Solve, run

AIM = 360.0  # seconds for 1000 specimens on two processors
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
    shapes = [shape for shape in FRAMES if shape in REGISTRY]
    for shape in shapes:
        folder.joinpath(f"{shape}.toml").write_text(
            f'name = "{shape}"\n[frame]\nshape = "{shape}"\nsemi_axes = ["6 cm", "4.5 cm"]\n{FRAMES[shape]}{FILM}')
    files = ", ".join(f'"{shape}.toml"' for shape in shapes)
    folder.joinpath("SWEEP.toml").write_text(SWEEP.format(files=files, count=specimens // len(shapes)))
    return read_sweep(folder / "SWEEP.toml")


def timed(words: str, sweep: Sweep, folder: Path, solve: Solve) -> tuple[float, xr.Dataset]:
    """Seconds, and the table."""
    began = time.perf_counter()
    summary = run(sweep, folder, solve)
    wall = time.perf_counter() - began
    print(f"{words:<28}{wall:>8.1f} s {summary.solved / wall:>8.0f} cases/s   {summary.statuses}", flush=True)
    with xr.open_dataset(folder / "sweep.nc", engine="h5netcdf") as table:
        return wall, table.load()


@contextmanager
def loopback(workers: int) -> Iterator[str]:
    """Address of the scheduler of a cluster of processes on this machine."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1",
                      dashboard_address=None) as found:
        yield found.scheduler_address


def difference(one: xr.Dataset, other: xr.Dataset) -> float:
    """Largest relative difference of a number; infinite where texts differ."""
    worst = 0.0
    for name in one.data_vars:
        a, b = one[name].values, other[name].values
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--specimens", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--skip-dask", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        began = time.perf_counter()
        sweep = planned(folder, options.specimens)
        reading = time.perf_counter() - began
        print(f"{len(sweep.entries)} specimens, {sweep.cases} cases; read and checked in {reading:.1f} s, "
              f"load {os.getloadavg()[0]:.1f}", flush=True)
        several, table = timed(f"{options.workers} processes", sweep, folder / "several",
                               partial(processes, workers=options.workers))
        one, same = timed("1 process", sweep, folder / "one", partial(processes, workers=1))
        aim = AIM * len(sweep.entries) / 1000
        _verdict(f"in all {reading + several:.1f} s, aim {aim:.1f} s", reading + several < aim)
        _verdict(f"{one / several:.2f} times one process, aim {LEAST_GAIN}", one / several >= LEAST_GAIN)
        _verdict(f"tables differ by {difference(table, same):.1e}", difference(table, same) <= AGREEMENT)
        if not options.skip_dask:
            with loopback(options.workers) as address:
                dask, third = timed(f"Dask, {options.workers} workers", sweep, folder / "dask",
                                    partial(cluster, address=address))
            overhead = dask / several - 1
            _verdict(f"Dask {overhead:+.1%} (its workers' start not counted), aim below {MOST_OVERHEAD:.0%}",
                     overhead < MOST_OVERHEAD)
            _verdict(f"tables differ by {difference(table, third):.1e}", difference(table, third) <= AGREEMENT)


def _verdict(words: str, met: bool) -> None:
    print(f"{words}   {'met' if met else 'not met'}", flush=True)


if __name__ == "__main__":
    main()
