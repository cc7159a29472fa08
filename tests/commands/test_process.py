"""The command as a process: ended by signals, on terminals and disks that cannot take what it
says."""

from __future__ import annotations

import doctest
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import tympan.__main__
from benchmarks.trials.signals import tried
from tests.support.costs import dear
from tests.support.specimens import specimen_toml

TYMPAN = [sys.executable, "-m", "tympan"]
WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

#: A module in a library's place. A signal comes while it is imported, which takes time.
INTERRUPTED = """
import os, time
os.kill(os.getpid(), {number})
try:
    end = time.monotonic() + {seconds}
    while time.monotonic() < end:
        pass
except BaseException:
    raise ImportError("initialization failed")  # as compiled modules do
print("imported", flush=True)
"""


#: A command in the place of ours: a signal is swallowed, and results are written at once.
SWALLOWED = ("-c", """
import os, signal, sys, time
from pathlib import Path
from tympan import __main__, cli
from tympan.base.errors import InputError
from tympan.studies.files import write_text

def main():
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(10)  # on a busy machine a signal comes a little later
    except KeyboardInterrupt:
        pass
    try:
        write_text(Path(os.environ["TYMPAN_TEST_FOLDER"]) / "a.json", "wrong")
    except BaseException:
        pass
    return 0

cli.main = main
__main__.run_command()
""")


def run(*arguments: str, path: Path | None = None, stdout: int = subprocess.PIPE,
        **environment: str) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command."""
    paths = [str(path), *sys.path] if path is not None else sys.path
    command = [sys.executable] if arguments[0] == "-c" else TYMPAN
    done = subprocess.run([*command, *arguments], stdout=stdout, stderr=subprocess.PIPE,
                          check=False, stdin=subprocess.DEVNULL, timeout=60,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths)),
                                            **environment})
    return done.returncode, (done.stdout or b"").decode("latin-1"), done.stderr.decode("latin-1")


@pytest.mark.parametrize("number", WORDS)
@pytest.mark.parametrize("seconds", [0.1, 30.0])
def test_a_signal_during_an_import_is_one_line(tmp_path, number: int, seconds: float) -> None:
    """It waits for the import, but not for long."""
    (tmp_path / "jinja2.py").write_text(INTERRUPTED.format(number=int(number), seconds=seconds))
    printed = "imported\n" if seconds < 1 else ""
    assert run("materials", path=tmp_path) == (128 + number, printed,
                                               f"tympan: {WORDS[number]}\n")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc")
@pytest.mark.parametrize("moments", [1, dear(4, seconds=40)])
def test_signals_at_any_moment_are_one_line_and_nothing_is_lost(moments: int) -> None:
    """From when the process listens on, through imports, fit and drawing; then the next run.

    A moment takes two processes of seconds; `make signals` tries all commands at many.
    """
    # The first moment of this seed is half way: a run that is quicker than the one timed before
    # it, as on a busy machine, has not ended by then.
    statuses, faults = tried("material fit", moments, seed=11, kill=False)
    assert faults == []
    assert set(statuses) <= {0, 130, 143}
    assert max(statuses) > 0


def test_a_signal_that_is_swallowed_comes_again_and_nothing_is_written(tmp_path) -> None:
    """Within a callback that ends at once: what was raised is lost, and not what was asked."""
    assert run(*SWALLOWED, path=None, TYMPAN_TEST_FOLDER=str(tmp_path)) == (
        130, "", "tympan: interrupted\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("arguments", "words", "environment"), [
    (["help", "all"], "derive alpha", {"PYTHONIOENCODING": "ascii"}),
    (["materials"], "a Gent law with mu 18 kPa", {"PYTHONIOENCODING": "latin-1"}),
    (["help", "all"], "derive alpha",
     {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""})])
def test_terminals_without_greek_get_it_spelled(arguments: list[str], words: str,
                                                environment: dict[str, str]) -> None:
    status, said, error = run(*arguments, **environment)
    assert (status, error) == (0, "")
    assert words in said


def test_letters_are_spelled_or_stand_by_their_number() -> None:
    assert doctest.testmod(tympan.__main__) == (0, 2)


def test_json_is_the_same_on_any_terminal(capsys) -> None:
    from tympan.cli import main

    assert main(["effects", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert "µ" in json.dumps(record, ensure_ascii=False)
    assert json.loads(run("effects", "--json", PYTHONIOENCODING="ascii")[1]) == record


@pytest.mark.parametrize(("arguments", "unbuffered"), [(["--help"], "1"), (["materials"], "")])
def test_output_that_finds_no_room_or_no_reader(arguments: list[str], unbuffered: str) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    with open("/dev/full", "w") as full:
        said = "tympan: standard output cannot be written: No space left on device\n"
        assert run(*arguments, stdout=full.fileno(), PYTHONUNBUFFERED=unbuffered) == (1, "", said)
    reading, writing = os.pipe()
    os.close(reading)
    try:
        assert run(*arguments, stdout=writing, PYTHONUNBUFFERED=unbuffered) == (1, "", "")
    finally:
        os.close(writing)


def test_a_backend_that_does_not_exist_draws_nothing_on_no_screen(tmp_path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml())
    status, _, error = run("draw", str(tmp_path / "oval.toml"), "-o", str(tmp_path),
                           MPLBACKEND="nonsense")
    assert (status, error) == (0, "")
    assert list(tmp_path.glob("*.png"))
