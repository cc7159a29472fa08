"""The same sweep on a Dask cluster whose workers are killed at seeded moments."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import xarray as xr

from tests.support.sweeps import read
from tympan.geometry.errors import InputError
from tympan.studies.parallel import serial
from tympan.studies.sweep.cluster import cluster
from tympan.studies.sweep.run import run_sweep


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning",
                            "ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_cluster_gives_the_same_table_also_when_both_workers_are_killed(tmp_path) -> None:
    from distributed import LocalCluster

    sweep = read(tmp_path)
    run_sweep(sweep, tmp_path / "here", serial)
    killed: list[int] = []
    moments = np.random.default_rng(11).choice(np.arange(1, 7), 2, replace=False)
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1",
                      dashboard_address=None,
                      silence_logs=50) as machine:

        def seen(done: int, kept: int) -> None:
            if done // 6 in moments:
                killed.append(list(machine.workers.values())[len(killed)].pid)
                os.kill(killed[-1], signal.SIGKILL)

        pool = partial(cluster, address=machine.scheduler_address)
        summary = run_sweep(sweep, tmp_path / "dask", pool, seen)
    assert len(set(killed)) == 2
    assert summary.solved == 48
    with (xr.open_dataset(tmp_path / "here" / "sweep.nc", engine="h5netcdf") as one,
          xr.open_dataset(tmp_path / "dask" / "sweep.nc", engine="h5netcdf") as other):
        xr.testing.assert_allclose(one, other, rtol=1e-12, atol=0)
        assert (one["status"] == other["status"]).all()


def test_a_scheduler_that_is_not_there_is_one_message(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tympan.studies.sweep.cluster._PATIENCE", "300ms")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        run_sweep(read(tmp_path), tmp_path / "out", partial(cluster, address="tcp://127.0.0.1:9"))


HOARDING = """
import resource
import numpy as np
from tympan.studies.sweep.cluster import _hoarded

def faults(_=None):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(100):
        np.ones(200_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
print(faults())
_hoarded(lambda _: (faults(), print(faults())), None)
faults()
print(faults())
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"),
                    reason="another allocator than glibc's")
def test_a_task_keeps_the_memory_it_frees_as_long_as_it_runs() -> None:
    """By page faults, with Dask's own setting.

    It gives back every array, which is taken again page by page.
    """
    environment = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}
    printed = subprocess.run([sys.executable, "-c", HOARDING], env=environment, capture_output=True,
                             text=True,
                             check=True).stdout
    before, inside, after = map(int, printed.split())
    assert inside < 0.1 * min(before, after)
