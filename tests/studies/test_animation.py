"""A film in motion as pictures, and its fields as a VTK series that other programs open."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import tympan
from tests.support.specimens import circular
from tympan.cli import main
from tympan.commands import transient
from tympan.fem.film.library import load_specimen
from tympan.fem.toml_writer import specimen_to_toml
from tympan.reports.figures import animation, modes


@pytest.fixture
def film(tmp_path: Path) -> Path:
    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(circular()), encoding="utf-8")
    return file


def test_pictures_and_fields_of_a_film_in_motion(film: Path, tmp_path: Path,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transient, "_FRAMES", 3)
    out = tmp_path / "out"
    assert main(["transient", str(film), "--signal", "ramp", "--high", "3 kV", "--duration", "2 s",
                 "--interval", "10 ms", "--at", "0.5 s, 1 s", "--animate", "-o", str(out)]) == 0
    with Image.open(out / "circle.gif") as gif:
        assert gif.n_frames == 3
        pictures = []
        for number in range(3):
            gif.seek(number)
            pictures.append(np.asarray(gif.convert("RGB"), float))
    upper = pictures[0].shape[0] // 3
    assert np.abs(pictures[1] - pictures[0])[:upper].max() > 50  # the film moved
    assert np.abs(pictures[2] - pictures[0])[:upper].mean() < np.abs(
        pictures[1] - pictures[0])[:upper].mean()  # and came back
    series = pv.PVDReader(out / "circle.pvd")
    assert series.time_values == pytest.approx([0.5, 1.0])
    heaves = []
    for number, time in enumerate(series.time_values):
        series.set_active_time_value(time)
        points = series.read()[0].points
        mesh = meshio.read(out / f"circle-{number:04d}.vtu")
        assert mesh.points == pytest.approx(points)
        heaves.append(-points[:, 2].min())
    assert heaves[1] > heaves[0]


def test_modes_swing_there_and_back(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                    ) -> None:
    monkeypatch.setattr(modes, "_FRAMES", 8)
    out = tmp_path / "out"
    assert main(["modes", str(film), "--mass", "17.9 g", "--count", "2", "--refine", "0.5",
                 "--animate", "-o", str(out)]) == 0
    pictures = []
    with Image.open(out / "circle-modes.gif") as gif:
        assert gif.n_frames == 8
        for number in range(8):
            gif.seek(number)
            pictures.append(np.asarray(gif.convert("RGB"), float))
    for number in (1, 2, 3):  # back as it came
        assert np.abs(pictures[number] - pictures[-number]).mean() < 1
    apart = [np.abs(picture - pictures[0]).mean() for picture in pictures[:5]]
    assert min(apart[1:]) > 1
    assert apart[4] > 5
    half = pictures[0].shape[1] // 2  # the modes stand side by side, and both move
    assert all(np.abs(pictures[4] - pictures[0])[:, part].mean() > 2
               for part in (slice(None, half), slice(half, None)))


@pytest.mark.study(seconds=4)
@pytest.mark.parametrize(("command", "name"), [
    (["modes", "--mass", "17.9 g", "--count", "1", "--refine", "0.5"], "circle-modes.gif"),
    (["transient", "--signal", "ramp", "--high", "3 kV", "--duration", "2 s", "--interval",
      "100 ms", "--refine", "0.5"], "circle.gif")], ids=["modes", "transient"])
def test_an_earlier_film_stays_until_another_is_whole(
        film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str], name: str
        ) -> None:
    monkeypatch.setattr(modes, "_FRAMES", 2)
    monkeypatch.setattr(transient, "_FRAMES", 2)
    out = tmp_path / "out"
    words = [command[0], str(film), *command[1:], "-o", str(out)]
    assert main([*words, "--animate"]) == 0
    earlier = (out / name).read_bytes()

    def disk_full(frames: object, file: Path) -> None:
        file.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(animation, "_save", disk_full)
        assert main([*words, "--animate"]) == 2
    assert (out / name).read_bytes() == earlier
    assert main([*words, "--animate"]) == 0
    assert (out / name).exists()
    assert main(words) == 0  # its film would be that of other results
    assert not (out / name).exists()


def test_a_mode_swings_by_its_cosine(film: Path) -> None:
    result = tympan.modes(load_specimen(film), count=1, mass="17.9 g").numbers
    there, rest, back = (modes.swung_films(result, share)[0] for share in (1.0, 0.0, -1.0))
    assert rest.points == pytest.approx(result.film.points)
    assert 0.5 * (there.points + back.points) == pytest.approx(rest.points, abs=1e-15)
    assert there.values["along"] == pytest.approx(-back.values["along"])
    assert not rest.values["along"].any()


def test_modes_are_animated_from_a_script_and_want_a_folder(
        film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(modes, "_FRAMES", 4)
    tympan.modes(load_specimen(film), count=1, mass="17.9 g").plot(tmp_path / "swing.gif")
    with Image.open(tmp_path / "swing.gif") as gif:
        assert gif.n_frames == 4
    assert main(["modes", str(film), "--mass", "17.9 g", "--animate"]) == 2
    assert "-o" in capsys.readouterr().err


def drawn(film: Path, out: Path, monkeypatch: pytest.MonkeyPatch, pictures: int) -> int:
    """The exit status of a film of so many pictures."""
    monkeypatch.setattr(transient, "_FRAMES", pictures)
    return main(["transient", str(film), "--signal", "ramp", "--high", "3 kV", "--duration", "2 s",
                 "--interval", "10 ms", "--animate", "-o", str(out)])


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="FFmpeg is not here")
def test_an_mp4_where_ffmpeg_is(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                ) -> None:
    """Its pictures, decoded again, are those of the GIF, but for what it compresses."""
    assert drawn(film, tmp_path / "out", monkeypatch, 8) == 0
    raw = subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-i", str(tmp_path / "out" / "circle.mp4"),
         "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True).stdout
    with Image.open(tmp_path / "out" / "circle.gif") as gif:
        width, height = (size // 2 * 2 for size in gif.size)
        decoded = np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3).astype(float)
        assert len(decoded) == gif.n_frames == 8
        for number, picture in enumerate(decoded):
            gif.seek(number)
            seen = np.asarray(gif.convert("RGB"), float)[:height, :width]
            assert np.abs(seen - picture).mean() < 4
    assert np.abs(decoded[4] - decoded[0]).mean() > 1


def test_an_ffmpeg_that_fails_says_why(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    program = tmp_path / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\ncat > /dev/null\necho 'no such codec' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    assert drawn(film, tmp_path / "out", monkeypatch, 2) == 2
    error = capsys.readouterr().err
    assert "no such codec" in error
    assert "without --animate" in error
    assert not [*(tmp_path / "out").glob("circle.*")]


def test_an_animation_needs_a_folder(film: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["transient", str(film), "--animate"]) == 2
    assert "-o" in capsys.readouterr().err
