"""``tympan sweep``: many specimens under many loads, on this machine or a Dask cluster."""

from __future__ import annotations

import argparse
import os
from functools import partial
from pathlib import Path

from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    argument,
    command,
    either,
    output,
    print_record,
    read_settings,
)


@command("sweep",
         argument("file", type=Path, metavar="SWEEP.toml",
                  help="which specimens, masses and voltages"),
         output("tables as netCDF, Parquet and CSV; finished cases, which are not solved again",
                required=True),
         either(argument("--workers", type=int, metavar="N",
                         help="processes on this machine (default: its processors)"),
                argument("--scheduler", metavar="ADDRESS",
                         help='of a Dask cluster, such as "tcp://10.0.0.5:8786"')), JSON, MESH)
def sweep(options: argparse.Namespace) -> None:
    """Solve grids, lists or samples of specimens; goes on where it was ended."""
    from tympan.progress import cases
    from tympan.studies.parallel import processes
    from tympan.studies.sweep.cluster import cluster
    from tympan.studies.sweep.plan import read_sweep
    from tympan.studies.sweep.run import run_sweep

    workers = len(os.sched_getaffinity(0)) if options.workers is None else options.workers
    if not 1 <= workers <= 1024:
        raise InputError("must be from 1 to 1024", key="--workers", given=options.workers)
    planned = read_sweep(options.file, read_settings(options))
    pool = (partial(cluster, address=options.scheduler) if options.scheduler
            else partial(processes, workers=workers))
    done = 0
    try:
        with cases(planned.cases) as progress:
            def seen(ready: int, kept: int) -> None:
                nonlocal done
                done = ready
                progress(ready, kept)

            result = run_sweep(planned, options.output, pool, seen)
    except KeyboardInterrupt:
        kept = f"{done} of {planned.cases} cases are kept, the same command goes on from there"
        raise KeyboardInterrupt(kept) from None
    print_record(options, {"table": str(options.output / "sweep.nc"), **result.json()})
