"""Folders of results: whose files are in them, who works there, what a kill left."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.specimens import specimen_toml
from tympan.base.errors import InputError
from tympan.base.process.folder import (
    MANIFEST,
    _discard_folders,
    alone,
    discard_temporaries,
    temporary_beside,
    temporary_folder,
)
from tympan.cli import main
from tympan.studies.files import remove, replaced, write_atomically, write_text

#: A command that is killed while it draws: its picture is half there.
KILLED = """
import os, sys
from pathlib import Path
from tympan.studies.files import write_atomically

def half(path):
    path.write_text("half")
    os.kill(os.getpid(), 9)

write_atomically(Path(sys.argv[1]), half)
"""


def test_the_list_is_one_that_sha256sum_checks(tmp_path) -> None:
    for text in ("first", "second", "second"):
        write_text(tmp_path / "a.json", text)
    write_text(tmp_path / "b c.json", "other")
    assert (tmp_path / MANIFEST).read_text().splitlines() == [
        f"{hashlib.sha256(text.encode()).hexdigest()}  {name}"
        for text, name in (("first", "a.json"), ("second", "a.json"), ("other", "b c.json"))]
    write_text(tmp_path / "a.json", "first")
    assert (tmp_path / "a.json").read_text() == "first"


@pytest.mark.parametrize("replace", [lambda file: write_text(file, "ours"),
                                     lambda file: remove(file.parent, file.name)])
def test_a_user_s_own_file_of_a_result_s_name_stays(tmp_path, replace: Callable[[Path], None]
                                                    ) -> None:
    file = tmp_path / "a.json"
    write_text(file, "ours")
    file.unlink()
    file.write_text("mine")
    with pytest.raises(InputError, match=r"a\.json: was changed since tympan wrote it: move it"):
        replace(file)
    assert file.read_text() == "mine"
    (tmp_path / MANIFEST).write_text("a.json\n")  # as earlier versions wrote it
    with pytest.raises(InputError, match=r"a\.json: is from an earlier version"):
        replace(file)
    file.unlink()
    file.symlink_to(tmp_path / "elsewhere")
    (tmp_path / "elsewhere").write_text("mine")
    with pytest.raises(InputError, match=r"a\.json: is "):
        replace(file)
    assert (tmp_path / "elsewhere").read_text() == "mine"


def test_solve_spares_what_a_user_put_in_its_result_s_place(tmp_path, capsys) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml())
    command = ["curve", str(tmp_path / "oval.toml"), "--mass", "1 g", "--refine", "0.5", "-o",
               str(tmp_path / "m")]
    assert main(command) == 0
    assert main(command) == 0
    (tmp_path / "m" / "oval-curve.json").unlink()
    (tmp_path / "m" / "oval-curve.json").write_text("mine\n")
    before = {file.name: file.read_bytes() for file in (tmp_path / "m").iterdir()}
    assert main(command) == 2
    assert "oval-curve.json: was changed since" in capsys.readouterr().err
    assert {file.name: file.read_bytes() for file in (tmp_path / "m").iterdir()} == before


def as_pipe(file: Path) -> None:
    os.mkfifo(file)


def as_link(file: Path) -> None:
    (file.parent.parent / "target").write_text("mine\n")
    file.symlink_to(file.parent.parent / "target")


@pytest.mark.parametrize("make", [
    as_pipe, as_link, Path.mkdir, lambda file: file.write_bytes(bytes(range(256))),
    lambda file: file.symlink_to("/dev/zero"), lambda file: file.symlink_to("nowhere")])
def test_a_list_that_is_none_is_one_message(tmp_path, make: Callable[[Path], object]) -> None:
    folder = tmp_path / "m"
    folder.mkdir()
    (folder / "a.json").write_text("mine")
    make(folder / MANIFEST)
    words = r"m/\.tympan: is not the list that tympan keeps of its results: it must be a text file"
    for attempt in (lambda: write_text(folder / "a.json", "ours"),
                    lambda: write_text(folder / "b.json", "ours"),
                    lambda: alone(folder).__enter__()):
        with pytest.raises(InputError, match=words):
            attempt()
    assert (folder / "a.json").read_text() == "mine"
    assert {file.name for file in folder.iterdir()} == {"a.json", MANIFEST}
    if (tmp_path / "target").exists():
        assert (tmp_path / "target").read_text() == "mine\n"


def test_a_cut_line_of_the_list_takes_no_other_with_it(tmp_path) -> None:
    (tmp_path / MANIFEST).write_text("0123456789")
    write_text(tmp_path / "a.json", "ours")
    write_text(tmp_path / "a.json", "ours again")
    assert (tmp_path / "a.json").read_text() == "ours again"


def test_a_kill_leaves_the_earlier_picture_and_the_next_run_removes_the_half(tmp_path) -> None:
    write_text(tmp_path / "m" / "a.png", "earlier")
    for file in ("a.png", "fields/a.vtu"):
        done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "m" / file)],
                              check=False, env=os.environ | {
                                  "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
        assert done.returncode == -9
    assert (tmp_path / "m" / "a.png").read_text() == "earlier"
    assert len(list((tmp_path / "m").rglob(".tympan-*"))) == 2
    with temporary_beside(tmp_path / "m" / "b.png") as written:
        discard_temporaries(tmp_path / "m")
        assert list((tmp_path / "m").rglob(".tympan-*")) == [written]  # its process lives
    with alone(tmp_path / "m"):
        pass
    assert not list((tmp_path / "m").rglob(".tympan-*"))
    assert (tmp_path / "m" / "a.png").read_text() == "earlier"


def test_temporary_folders_of_killed_processes_go(tmp_path, monkeypatch) -> None:
    """None of processes that live, none that was made just now, and none of another name."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    code = ("import sys, tempfile, time; from pathlib import Path\n"
            "from tympan.base.process.folder import temporary_folder\n"
            "tempfile.tempdir = sys.argv[1]\n"
            "with temporary_folder() as folder:\n"
            "    (folder / 'film.brep').write_text('half')\n"
            "    print(folder, flush=True); time.sleep(60)")
    (tmp_path / "tympan-results").mkdir()
    os.utime(tmp_path / "tympan-results", (0, 0))

    def beside() -> set[Path]:
        """What stands beside a temporary folder of a new process."""
        _discard_folders.cache_clear()
        with temporary_folder() as made:
            assert made.stat().st_mode & 0o777 == 0o700
            return set(tmp_path.iterdir()) - {made, tmp_path / "tympan-results"}

    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], env=os.environ | {
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        left = Path(process.stdout.readline().strip())
        os.utime(left, (0, 0))
        assert beside() == {left}  # its process lives
        process.kill()
    os.utime(left)
    assert beside() == {left}  # it may be one that is not locked yet
    os.utime(left, (0, 0))
    assert beside() == set()
    assert list(tmp_path.iterdir()) == [tmp_path / "tympan-results"]


def test_pictures_stay_until_others_are_there_and_those_left_over_go(tmp_path) -> None:
    for name in ("a.png", "a.svg"):
        write_text(tmp_path / name, "earlier")

    def draw(path: Path) -> None:
        assert (tmp_path / "a.png").read_text() == (tmp_path / "a.svg").read_text() == "earlier"
        path.write_text("new")

    with replaced(tmp_path, ("a.png", "a.svg", "a.gif")):
        write_atomically(tmp_path / "a.png", draw)
    assert {file.name: file.read_text() for file in tmp_path.iterdir() if file.name != MANIFEST
            } == {"a.png": "new"}


def test_a_second_command_into_a_folder_is_refused(tmp_path, capsys) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml())
    command = ["limits", str(tmp_path / "oval.toml")], ["draw", str(tmp_path / "oval.toml"), "-o",
                                                        str(tmp_path / "m")]
    with alone(tmp_path / "m"):
        assert main(command[1]) == 2
        assert capsys.readouterr().err == (
            f"tympan: {tmp_path}/m: is in use by another command: wait for its end, or choose "
            "another folder\n")
    assert not (tmp_path / "m").exists()  # it was made for nothing
    assert main(command[1]) == 0


def test_who_waits_gets_the_folder(tmp_path) -> None:
    code = ("import sys, time; from pathlib import Path\n"
            "from tympan.base.process.folder import alone\n"
            "with alone(Path(sys.argv[1])):\n    print(flush=True); time.sleep(0.5)")
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "m")], env=os.environ | {
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        began = time.monotonic()
        with alone(tmp_path / "m", 20.0):
            assert time.monotonic() > began + 0.1
