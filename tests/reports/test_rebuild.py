"""Every kind of folder with figures is drawn again from what it holds, byte for byte."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tympan.cli import main
from tympan.reports.rebuild import KINDS, rebuild

SPECIMEN = """
name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "4 cm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
[membrane.material]
law = "ogden"
mu = ["15 kPa"]
alpha = [2]
"""
STUDY = """
specimens = ["oval.toml"]
[curves]
mass = ["17.9 g"]
voltage = ["0 kV", "3 kV"]
[alpha_fit]
mass = ["17.9 g"]
voltage = ["0 kV", "3 kV"]
[alpha_held_out]
mass = ["20 g"]
voltage = ["2.5 kV"]
"""


def of_specimen(command: str, *options: str) -> Callable[[Path], None]:
    """What runs a command on the specimen, coarsely."""
    def run(folder: Path) -> None:
        specimen = folder.parent / "oval.toml"
        specimen.write_text(SPECIMEN, encoding="utf-8")
        assert main([*command.split(), str(specimen), "-o", str(folder), *options]) == 0

    return run


def study(folder: Path) -> None:
    (folder.parent / "oval.toml").write_text(SPECIMEN, encoding="utf-8")
    (folder.parent / "study.toml").write_text(STUDY, encoding="utf-8")
    assert main(["study", str(folder.parent / "study.toml"), "-o", str(folder)]) == 0


def paper(folder: Path) -> None:
    options = ["--levels", "2", "--seed", "3", "--period", "20 s", "--reading", "rest"]
    assert main(["lumped", "paper", *options, "-o", str(folder)]) == 0


def material_fit(folder: Path) -> None:
    rows = "".join(f"uniaxial,{stretch},{20 * (stretch - stretch**-2) + 0.1 * number % 0.3}\n"
                   for number, stretch in enumerate((1.2, 1.4, 1.6, 1.9, 2.1, 2.5, 2.8)))
    file = folder.parent / "coupon.csv"
    file.write_text(f"mode,stretch,nominal_stress_kPa\n{rows}", encoding="utf-8")
    laws = ["--law", "neo_hooke", "--law", "gent"]
    assert main(["material", "fit", str(file), *laws, "-o", str(folder)]) == 0


LOADED = ("--mass", "17.9 g", "--refine", "0.5")
#: What makes a small folder, by the command of the kind.
RUNS: dict[str, Callable[[Path], None]] = {
    "study": study,
    "modes": of_specimen("modes", "--voltage", "3 kV", "--count", "3", *LOADED),
    "path": of_specimen("path", *LOADED),
    "material fit": material_fit,
    "lumped paper": paper,
    "lumped simulate": of_specimen("lumped simulate", "--signal", "sine", "--duration", "2 s",
                                   "--interval", "20 ms"),
    "lumped build": of_specimen("lumped build", "--mass", "17.9 g", "--count", "3",
                                "--voltages", "0 kV..3 kV", "--refine", "0.5"),
}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.command)
def test_figures_are_drawn_again_byte_for_byte(kind, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    RUNS[kind.command](folder)
    vectors = {file: file.read_bytes() for file in folder.glob("*.svg")}
    drawn = [*vectors, *folder.glob("*.png"), *folder.glob("*.html")]
    assert vectors
    for file in drawn:
        file.unlink()
    shown = rebuild(folder)
    assert shown
    assert all(file.exists() for file in (*shown, *drawn))
    assert {file: file.read_bytes() for file in vectors} == vectors
