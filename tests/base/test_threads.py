"""Threads of the numerical libraries: one while tympan computes, else the caller's own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from tests.support.specimens import specimen_toml
from tests.support.threads import MAPS, counted
from tympan.base.process.threads import VARIABLES, _linked, blas_threads, one_thread
from tympan.studies.parallel import mapped

pytestmark = pytest.mark.skipif(not MAPS.exists(), reason="no /proc")

#: A script whose caller has several threads; the solver tells what it finds.
SCRIPT = """
import json, sys
import tympan
from tympan.studies import limits
from tests.support.threads import counted

real, within = limits.solve_within, []

def solve_within(*arguments, **more):
    import scipy.linalg
    result = real(*arguments, **more)
    within.append(counted())
    if len(within) == 2:
        raise RuntimeError
    return result

limits.solve_within = solve_within
oval = tympan.load(sys.argv[1])
coarse = tympan.Settings(tympan.MeshSettings(order=2).refined(0.5))
before = counted()
tympan.solve(oval, coarse, mass="1 g")
once = counted()
try:
    tympan.solve(oval, coarse, mass="1 g")
except RuntimeError:
    pass
print(json.dumps([before, within, once, counted()]))
"""


def test_a_door_s_call_has_one_thread_and_gives_the_callers_back(tmp_path) -> None:
    processors = len(os.sched_getaffinity(0))
    if processors == 1:
        pytest.skip("one processor: no library takes more threads")
    (tmp_path / "oval.toml").write_text(specimen_toml())
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    done = subprocess.run([sys.executable, "-c", SCRIPT, str(tmp_path / "oval.toml")], check=False,
                          capture_output=True, env=environment | {
                              "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    assert done.returncode == 0, done.stderr.decode()
    before, within, once, after = json.loads(done.stdout)
    assert set(before) == {processors}
    assert [set(counts) for counts in within] == [{1}, {1}]
    assert len(once) == len(within[0]) >= len(before)
    assert set(once) == set(after) == {processors}


LATER = """
import json
from tests.support.threads import counted
from tympan.base.process.threads import one_thread
with one_thread():
    import numpy, scipy.linalg
    within = counted()
print(json.dumps([within, counted()]))
"""


@pytest.mark.parametrize("number", ["1", "2", ""])
def test_libraries_that_are_loaded_later_are_limited_and_freed(number: str) -> None:
    done = subprocess.run([sys.executable, "-c", LATER], check=True, capture_output=True,
                          env=os.environ | {
                              "OPENBLAS_NUM_THREADS": number, "OMP_NUM_THREADS": "",
                              "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    within, after = json.loads(done.stdout)
    assert set(within) == {1}
    processors = len(os.sched_getaffinity(0))
    assert set(after) == {min(int(number or processors), processors)}


def of_worker(_: None) -> list[int]:
    """Threads in a process that has imported this module, and so both libraries."""
    return counted()


def test_workers_have_one_thread(monkeypatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    for counts in mapped(of_worker, [None, None], 2):
        assert set(counts) == {1}
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"


def test_calls_in_several_threads_end_in_any_order() -> None:
    """The last one that leaves gives the numbers back."""
    assert scipy.linalg.norm(np.eye(2)) > 1  # both are loaded
    first, second = threading.Event(), threading.Event()
    outer = dict(os.environ)
    before = blas_threads()

    def other() -> None:
        with one_thread():
            first.set()
            second.wait(10)

    thread = threading.Thread(target=other)
    with one_thread():
        thread.start()
        first.wait(10)
    assert set(counted()) == {1}
    second.set()
    thread.join()
    assert blas_threads() == before
    assert dict(os.environ) == outer


def test_a_package_whose_library_is_no_file_has_no_threads_to_set(tmp_path: Path) -> None:
    """An extension module may lie in an archive, or be a part of the interpreter."""
    assert _linked(str(tmp_path / "archive.zip" / "_umath.so")) is None
