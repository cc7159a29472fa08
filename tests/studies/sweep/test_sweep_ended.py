"""``tympan sweep`` ended from outside: killed, interrupted, without space, without permission."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Never

import meshio
import numpy as np
import pytest
import xarray as xr

from tests.support.costs import dear
from tests.support.sweeps import Command, finished, read, table, written
from tympan.base.process.workers import signals_blocked
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings
from tympan.studies.parallel import serial
from tympan.studies.sweep.plan import Sweep
from tympan.studies.sweep.run import run_sweep

#: What ``--refine 0.5`` says.
COARSE = Settings(MeshSettings().refined(0.5))

MANY = """
specimen = "oval.toml"
mass = "17.9 g"
voltage = ["0 kV", "3 kV"]
[sample]
method = "sobol"
count = 32
seed = 5
[sample.ranges]
"frame.semi_axes.0" = ["4.6 cm", "7.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"""

SPACE = "No space left on device"


@pytest.fixture(scope="module")
def right(tmp_path_factory) -> tuple[Sweep, xr.Dataset]:
    """The sweep, and its table from a run without interruption in this process."""
    folder = tmp_path_factory.mktemp("right")
    sweep = read(folder, MANY, COARSE)
    run_sweep(sweep, folder / "out", serial)
    return sweep, table(folder / "out")


def goes_on(right: tuple[Sweep, xr.Dataset], folder: Path) -> None:
    """What is finished there stays, and the same sweep comes to the right table."""
    sweep, whole = right
    before = finished(sweep, folder)
    run_sweep(sweep, folder, serial)
    after = finished(sweep, folder)
    assert before.items() <= after.items()  # nothing is lost, nothing written again
    assert len(after) == 32
    xr.testing.assert_identical(table(folder), whole)


@pytest.mark.study(seconds=11)
@pytest.mark.parametrize("times", [2, dear(10, seconds=45)])
def test_killed_many_times_the_table_is_complete_and_nothing_is_solved_twice(
        right, tmp_path, times: int) -> None:
    random = np.random.default_rng(7)
    stood = [finished(right[0], tmp_path / "out")]
    kills = 0
    for _ in range(times):
        command = Command(written(tmp_path, MANY), tmp_path / "out")
        tasks = int(random.choice([0, 0, 1, 3]))  # none: while it starts
        kills += command.signalled(signal.SIGKILL, tasks,
                                   random.uniform(0.0, 0.05 if tasks else 1.0))
        command.ended()
        stood.append(finished(right[0], tmp_path / "out"))
        assert stood[-2].items() <= stood[-1].items()
    assert kills == times
    assert len({len(done) for done in stood}) > 0.4 * times
    goes_on(right, tmp_path / "out")


def test_what_a_signal_does_waits_for_a_process_that_is_being_started() -> None:
    """Also where another thread takes the signal, whom nothing blocks it."""
    came: list[str] = []
    before = signal.signal(signal.SIGTERM, lambda *_: came.append("signal"))
    over = threading.Event()
    threading.Thread(target=over.wait, daemon=True).start()
    try:
        with signals_blocked():
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.05)
            came.append("started")
    finally:
        over.set()
        signal.signal(signal.SIGTERM, before)
    assert came == ["started", "signal"]


@pytest.mark.study(seconds=5, only=("15-3",))
@pytest.mark.parametrize(("number", "tasks"),
                         [(signal.SIGINT, 0), (signal.SIGINT, 3), (signal.SIGTERM, 3)])
def test_interrupted_it_says_so_once_and_goes_on(right, tmp_path, number, tasks: int) -> None:
    """As by Ctrl-C, which all processes of a terminal get, or by a supervisor, also those that have
    only just been started."""
    command = Command(written(tmp_path, MANY), tmp_path / "out")
    while not (tmp_path / "out" / ".tympan").exists():
        time.sleep(0.01)
    assert command.signalled(number, tasks, 0.0 if tasks else 0.3)
    status, said = command.ended()
    kept = len(finished(right[0], tmp_path / "out"))
    words = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}[number]
    *progress, last = said.splitlines()
    assert all(line.endswith(" left") for line in progress)  # every half minute
    note = f"; {2 * kept} of 64 cases are kept, the same command goes on from there"
    # Before the plan is read there are no cases yet.
    assert last in (f"tympan: {words}{note}", f"tympan: {words}" if tasks == 0 else "")
    assert status == 128 + number
    if tasks:
        assert kept >= 3
        goes_on(right, tmp_path / "out")


@pytest.mark.study(seconds=5)
def test_a_full_disk_is_one_message_and_what_was_finished_stays(right, tmp_path) -> None:
    """On a file system of 12 pages, mounted for the command alone."""
    (tmp_path / "small").mkdir()
    inside = (f"mount -t tmpfs -o size=48k,mode=777 tmpfs {tmp_path}/small || exit 77; "
              f'"$@"; status=$?; cp -a {tmp_path}/small/out {tmp_path}/out; exit $status')
    mounted = ["unshare", "--map-root-user", "--mount", "sh", "-c", inside, "sh"]
    if shutil.which("unshare") is None or subprocess.run([*mounted, "true"],
                                                         check=False).returncode == 77:
        pytest.skip("no file system can be mounted here")
    status, said = Command(written(tmp_path, MANY), tmp_path / "small" / "out",
                           before=mounted).ended()
    assert status == 2, said
    assert said.startswith("tympan: ")
    assert said.count("\n") == 1
    assert f"cannot be written: {SPACE}" in said
    assert 2 <= len(finished(right[0], tmp_path / "out")) < 32
    goes_on(right, tmp_path / "out")


@pytest.mark.study(seconds=6)
def test_no_room_for_the_table_is_one_message_and_what_was_finished_stays(right, tmp_path) -> None:
    """Files of some size are refused, as by a quota."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (45_000, before[1]))
    try:
        command = Command(written(tmp_path, MANY), tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    words = f"tympan: {tmp_path}/out/sweep.nc: cannot be written: File too large\n"
    assert command.ended() == (2, words)
    assert len(finished(right[0], tmp_path / "out")) == 32
    assert not (tmp_path / "out" / "sweep.nc").exists()
    goes_on(right, tmp_path / "out")


def test_a_folder_that_cannot_be_written_is_one_message(right, tmp_path) -> None:
    """A read-only one: root needs to be deprived of the right to write anywhere."""
    bound = ["setpriv",
             "--bounding-set=-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
    if bound and shutil.which("setpriv") is None:
        pytest.skip("root may write anywhere")
    file = written(tmp_path, MANY)
    (tmp_path / "kept").mkdir()
    run_sweep(read(tmp_path, MANY.replace("count = 32", "count = 2"), COARSE),
              tmp_path / "kept" / "out", serial)
    written(tmp_path, MANY)
    for folder in (tmp_path / "kept" / "out", tmp_path / "kept"):
        folder.chmod(0o500)
    for folder in (tmp_path / "kept" / "out", tmp_path / "kept" / "other"):
        status, said = Command(file, folder, before=bound).ended()
        assert (status, said) == (2, f"tympan: {folder}: cannot be written: Permission denied\n")
    assert len(finished(right[0], tmp_path / "kept" / "out")) == 2
    (tmp_path / "kept").chmod(0o700)
    (tmp_path / "kept" / "out").chmod(0o700)


def test_a_folder_that_is_a_file_is_one_message(tmp_path) -> None:
    (tmp_path / "out").write_text("")
    assert Command(written(tmp_path, MANY), tmp_path / "out").ended() == (
        2, f"tympan: {tmp_path}/out: cannot be written: Not a directory\n")


def test_fields_are_kept_whole_and_a_lost_one_is_solved_again(tmp_path) -> None:
    text = MANY.replace("count = 32", "count = 3").replace("specimen =",
                                                           "fields = true\nspecimen =")
    sweep, folder = read(tmp_path, text, COARSE), tmp_path / "out"
    assert run_sweep(sweep, folder, serial).solved == 6
    cases = table(folder)
    files = sorted((folder / "fields").iterdir())
    assert [file.name for file in files] == sorted(f"{number}.vtu"
                                                   for number in cases["id"].values.ravel())
    for number, deflection in zip(cases["id"].values.ravel(), cases["deflection_m"].values.ravel(),
                                  strict=True):
        film = meshio.read(folder / "fields" / f"{number}.vtu")
        assert film.point_data["deflection"].max() == pytest.approx(deflection, rel=1e-12)
        assert (film.points[:, :2].min(axis=0) <
                -0.03).all()  # the whole film, not the part that was meshed
    files[0].unlink()
    (folder / "fields" / ".tympan-half.vtu").write_text("")  # as a kill leaves it
    asked: list[str] = []

    def noted(function, tasks):
        asked.extend(tasks)
        return serial(function, tasks)

    run_sweep(sweep, folder, noted)
    assert len(asked) == 1
    assert sorted((folder / "fields").iterdir()) == files
    xr.testing.assert_identical(table(folder), cases)
    assert run_sweep(sweep, folder, partial(_never)).kept == 6


def _never(function: object, tasks: object) -> Iterator[Never]:
    assert not tasks
    yield from ()
