"""The same sweep on a Dask cluster whose workers are killed at seeded moments."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
import xarray as xr

from tests.support.sweeps import read
from tympan.base.errors import Failure, InputError
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
    with (xr.open_dataset(tmp_path / "here" / "sweep.nc", engine="h5netcdf") as here,
          xr.open_dataset(tmp_path / "dask" / "sweep.nc", engine="h5netcdf") as there):
        xr.testing.assert_allclose(here, there, rtol=1e-12, atol=0)
        assert (here["status"] == there["status"]).all()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "tcp://127.0.0.1:{silent}",
                                     "tls://127.0.0.1:{silent}", "http://127.0.0.1:{silent}",
                                     "127.0.0.1", ""])
def test_a_scheduler_that_is_not_there_is_one_message(address: str, monkeypatch) -> None:
    """Also where a port accepts and says nothing."""
    monkeypatch.setattr("tympan.studies.sweep.cluster._PATIENCE", 0.3)
    with (socket.create_server(("127.0.0.1", 0)) as silent,
          pytest.raises(InputError, match=r"no Dask scheduler answers there within 0\.3 s")):
        dict(cluster(abs, {"a": -1}, address.format(silent=silent.getsockname()[1])))


@pytest.fixture
def machine() -> Iterator[Any]:
    """A scheduler and a worker in this process."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, host="127.0.0.1",
                      protocol="tcp", dashboard_address=None, silence_logs=50) as machine:
        yield machine


IGNORED = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning",
                                     "ignore::pytest.PytestUnraisableExceptionWarning")


@IGNORED
def test_a_worker_in_the_scheduler_s_place_is_one_message(machine) -> None:
    with pytest.raises(InputError, match="must be a scheduler: a Dask worker answers there"):
        dict(cluster(abs, {"a": -1}, machine.workers[0].address))


@IGNORED
@pytest.mark.parametrize(("there", "words"), [
    ("'tympan 0.0.1 revision 1'", "has another version: tympan 0.0.1 revision 1, here tympan "),
    ("__import__('nothing')", "cannot load tympan: ModuleNotFoundError: No module named ")])
def test_a_worker_that_cannot_do_the_work_is_named(machine, monkeypatch, there: str,
                                                   words: str) -> None:
    assert dict(cluster(abs, {"a": -1}, machine.scheduler_address)) == {"a": 1}
    monkeypatch.setattr("tympan.studies.sweep.cluster._SOLVER", there)
    with pytest.raises(Failure, match=f"the worker at {machine.workers[0].address} {words}"):
        dict(cluster(abs, {"a": -1}, machine.scheduler_address))


@IGNORED
def test_a_last_worker_that_ends_is_waited_for_and_said_once(machine, monkeypatch) -> None:
    monkeypatch.setattr("tympan.studies.sweep.cluster._GLANCE", 0.1)
    said: list[str] = []
    values = cluster(rested, {"a": 0.0, "b": 1.0, "c": 1.0}, machine.scheduler_address, 0.5,
                     said.append)
    assert next(values) == ("a", 0.0)
    machine.scale(0)
    with pytest.raises(Failure, match=f"no worker came to {machine.scheduler_address} within"):
        list(values)
    assert [f"waiting 0.5 s for one, `dask worker {machine.scheduler_address}`" in words
            for words in said] == [True]


def rested(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


HOARDING = """
import mmap
import resource
import numpy as np
from tympan.studies.sweep.cluster import _hoarded

def faults(_=None):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(100):
        np.ones(200_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
mmap.mmap(-1, 1 << 20)[:] = bytes(1 << 20)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
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
    fresh, before, inside, after = map(int, printed.split())
    if not fresh:
        pytest.skip("the kernel counted no fault of fresh pages")
    assert inside < 0.1 * min(before, after)
