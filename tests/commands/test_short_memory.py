"""Memory that is short: one line and status 1, whichever library says so."""

from __future__ import annotations

import doctest
import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support.costs import dear
from tests.support.specimens import specimen_toml
from tympan import cli
from tympan.base import system
from tympan.base.errors import InputError
from tympan.base.system import out_of_memory, silent

ADVICE = "use a smaller --refine, or fewer --workers\n"


@pytest.mark.parametrize("refine", [dear("1", seconds=4), "20"])
def test_a_solve_without_memory_is_one_line(tmp_path: Path, refine: str) -> None:
    """With refine 20 SuperLU gets none, and prints besides; with refine 1 NumPy or SuperLU."""
    file = tmp_path / "oval.toml"
    file.write_text(specimen_toml())
    most = 700 << 20
    done = subprocess.run(
        [sys.executable, "-m", "tympan", "solve", str(file), "--mass", "1 g", "--json",
         "--refine", refine], capture_output=True, text=True, check=False, timeout=120,
        env=os.environ | {"TYMPAN_CACHE": "", "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (most, most)))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("tympan: memory is short")
    assert done.stderr.endswith(ADVICE)
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("error", [
    MemoryError(), np._core._exceptions._ArrayMemoryError((10**6,), np.dtype(float)),
    RuntimeError("std::bad_alloc"), Exception("Standard_OutOfMemory: bad alloc"),
    RuntimeError("can't start new thread"), OSError(errno.ENOMEM, "Cannot allocate memory"),
    ImportError("libgmsh.so: failed to map segment: Cannot allocate memory"),
], ids=lambda error: type(error).__name__)
def test_every_library_says_so_in_its_own_way(error: Exception, capsys: pytest.CaptureFixture[str],
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(cli, "build_parser", fail)
    assert cli.main([]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("tympan: memory is short")
    assert err.endswith(ADVICE)
    assert err.count("\n") == 1


@pytest.mark.parametrize("error", [RuntimeError("no"), OSError(errno.ENOENT, "no"), KeyError("a")])
def test_other_errors_stay_what_they_are(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise error

    assert out_of_memory(error) is None
    assert out_of_memory(InputError("must be a number")) is None
    monkeypatch.setattr(cli, "build_parser", fail)
    with pytest.raises(type(error)):
        cli.main([])


def test_what_libraries_print_is_dropped_meanwhile(capfd: pytest.CaptureFixture[str]) -> None:
    os.write(1, b"before ")
    with silent():
        os.write(1, b"one")
        with silent():
            os.write(2, b"two")
        os.write(2, b"three")
    os.write(2, b"after")
    assert capfd.readouterr() == ("before ", "after")


def test_examples() -> None:
    assert doctest.testmod(system).failed == 0
