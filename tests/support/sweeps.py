"""Small sweeps for the tests, in this process and as a command of their own."""

from __future__ import annotations

import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import xarray as xr

from tests.support.specimens import specimen_toml
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings
from tympan.studies.sweep.plan import Sweep, read_sweep
from tympan.studies.sweep.run import Checkpoint
from tympan.studies.sweep.task import SweepTask

CHEAP = Settings(MeshSettings(order=2).refined(0.6))

SWEEP = """
specimen = "oval.toml"
mass = ["17.9 g", "22.45 g"]
voltage = { from = "0 kV", to = "4 kV", count = 3 }
[sample]
method = "sobol"
count = 8
seed = 3
[sample.ranges]
"frame.semi_axes.0" = ["4.6 cm", "7.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"""


def written(folder: Path, text: str = SWEEP, **files: str) -> Path:
    """A sweep file, its specimen, and further files beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in {"oval": specimen_toml(), "SWEEP": text, **files}.items():
        folder.joinpath(f"{name}.toml").write_text(content)
    return folder / "SWEEP.toml"


def read(folder: Path, text: str = SWEEP, settings: Settings = CHEAP, **files: str) -> Sweep:
    """The sweep of a text, cheap to solve."""
    return read_sweep(written(folder, text, **files), settings)


def finished(sweep: Sweep, folder: Path) -> dict[str, tuple[int, int]]:
    """Finished tasks, each with what changes when its file is written again."""
    shelf, stamps = Checkpoint(folder), {}
    for entry in sweep.entries:
        if entry.task is not None and shelf.get(entry.task) is not None:
            seen = next(folder.glob(f"tasks/*/{entry.task.id}.json")).stat()
            stamps[entry.task.id] = seen.st_ino, seen.st_mtime_ns
    return stamps


def table(folder: Path) -> xr.Dataset:
    """The table of a sweep's folder."""
    with xr.open_dataset(folder / "sweep.nc", engine="h5netcdf") as stored:
        return stored.load()


class Lethal(SweepTask):
    """Kills the process that solves it."""

    def run(self) -> NoReturn:
        """Instead of a result."""
        assert multiprocessing.parent_process() is not None
        os.kill(os.getpid(), 9)
        raise AssertionError


class Command:
    """``tympan sweep`` on two processors of this machine, all its processes in a group of their
    own."""

    def __init__(self, file: Path, folder: Path, *options: str, before: Sequence[str] = ()) -> None:
        """Start it; ``before``: a command that starts commands."""
        # Where nothing is compiled for later, it would be compiled again for every process.
        kept = {"PYTHONDONTWRITEBYTECODE": "",
                "PYTHONPYCACHEPREFIX": str(Path(tempfile.gettempdir()) / "tympan-tests")}
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        environment |= kept if os.environ.get("PYTHONDONTWRITEBYTECODE") else {}
        if resource.getrlimit(resource.RLIMIT_FSIZE)[0] != resource.RLIM_INFINITY:
            environment["PYTHONDONTWRITEBYTECODE"] = "1"  # it would be cut off, and stay so
        arguments = ["-m", "tympan", "sweep", str(file), "-o", str(folder), "--refine", "0.5",
                     "--workers", "2"]
        self.folder = folder
        self.process = subprocess.Popen([*before, sys.executable, *arguments, *options],
                                        stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, env=environment,
                                        start_new_session=True)

    def ended(self) -> tuple[int, str]:
        """Wait: exit status and what it said on standard error."""
        _, said = self.process.communicate(timeout=300)
        return self.process.returncode, said

    def signalled(self, number: int, tasks: int, seconds: float) -> bool:
        """A signal to the group, so long after so many more tasks are finished; False if it had
        ended by then."""
        wanted = tasks + self._finished
        while self._finished < wanted and self.process.poll() is None:
            time.sleep(0.005)
        time.sleep(seconds)
        alive = self.process.poll() is None
        if alive:
            os.killpg(self.process.pid, number)
        return alive

    @property
    def _finished(self) -> int:
        # What is being written has a name that begins with a dot.
        return len(list(self.folder.glob("tasks/*/[!.]*.json")))
