"""A film in motion as pictures, and its fields as a VTK series that other programs open."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from tests.support.specimens import circular
from tympan.cli import main
from tympan.commands import transient
from tympan.fem.toml_writer import specimen_to_toml


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
        heaves.append(points[:, 2].max())
    assert heaves[1] > heaves[0]


def test_an_animation_needs_a_folder(film: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["transient", str(film), "--animate"]) == 2
    assert "-o" in capsys.readouterr().err
