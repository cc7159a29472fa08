"""Every kind of folder with figures is drawn again from what it holds, byte for byte."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest

from tests.support.costs import dear
from tests.support.datasets import write_dataset
from tests.support.specimens import ROUND, SOFT, specimen_toml
from tympan.cli import main
from tympan.geometry.outlines import examples
from tympan.paper import page as paper_page
from tympan.paper.loads import MAP
from tympan.reports import look
from tympan.reports.diagnosis.self_check import build_self_check_page
from tympan.reports.figures.alpha import draw_map
from tympan.reports.rebuild import KINDS, rebuild
from tympan.studies.alpha import LoadGrid, table
from tympan.studies.alpha.map import AlphaMap, alpha_map
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.self_check import SyntheticSet, summary_of
from tympan.studies.shipped import actuators

SPECIMEN = specimen_toml(frame='shape = "ellipse"\nsemi_axes = ["6 cm", "4 cm"]', film=SOFT)
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


CREEPING = specimen_toml("thirds", ROUND, 'material = "vhb-4910-viscous"', 3.0)


def of_specimen(command: str, *options: str) -> Callable[[Path], None]:
    """What runs a command on the specimen, coarsely."""
    def run(folder: Path) -> None:
        specimen = folder.parent / "oval.toml"
        specimen.write_text(SPECIMEN, encoding="utf-8")
        assert main([*command.split(), str(specimen), "-o", str(folder), *options]) == 0

    return run


def steer(folder: Path) -> None:
    specimen = folder.parent / "halves.toml"
    halves = "".join(f'[[electrode.segment]]\nname = "{name}"\nsector = ["{start} deg", '
                     f'"{start + 180} deg"]\n' for name, start in (("A", -90), ("B", 90)))
    specimen.write_text(SPECIMEN + halves, encoding="utf-8")
    assert main(["steer", str(specimen), "-o", str(folder), "--voltage",
                 "A = 0 kV..2 kV in 3, B = 0 kV, 1 kV", *LOADED]) == 0


def lumped_steer(folder: Path) -> None:
    specimen = folder.parent / "thirds.toml"
    specimen.write_text(CREEPING + "".join(
        f'[[electrode.segment]]\nname = "{name}"\nsector = ["{start} deg", "{start + 120} deg"]\n'
        for name, start in zip("ABC", (0, 120, 240), strict=True)), encoding="utf-8")
    assert main(["lumped", "steer", str(specimen), "-o", str(folder), "--mass", "15 g", "--tilt",
                 "1 mrad", "--frequency", "4 Hz", "--turns", "1", "--refine", "0.5"]) == 0


def study(folder: Path) -> None:
    (folder.parent / "oval.toml").write_text(SPECIMEN, encoding="utf-8")
    (folder.parent / "study.toml").write_text(STUDY, encoding="utf-8")
    assert main(["study", str(folder.parent / "study.toml"), "-o", str(folder)]) == 0


def paper(folder: Path) -> None:
    options = ["--levels", "2", "--seed", "3", "--period", "20 s", "--reading", "rest"]
    assert main(["lumped", "paper", *options, "-o", str(folder)]) == 0


def outlines(folder: Path) -> None:
    assert main(["outlines", "-o", str(folder), "--refine", "0.5"]) == 0


def alpha_map_of_few(folder: Path) -> None:
    few = replace(MAP, loads=LoadGrid((17.9e-3,), (0.0, 3e3)), aspects=(1.1, 1.6, 2.5),
                  ratios=(0.1, 0.3, 0.6), inside=1, outside=1)
    alpha_map(actuators()[0].membrane, few).save(folder)
    draw_map(AlphaMap.load(folder), folder)


def design(folder: Path) -> None:
    (folder.parent / "oval.toml").write_text(SPECIMEN, encoding="utf-8")
    (folder.parent / "wanted.toml").write_text(
        'specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "2 kV"\ntolerances = "none"\n'
        '[want]\nstroke = "largest"\n[vary]\n"plate.radius" = ["9 mm", "11 mm"]',
        encoding="utf-8")
    wanted = str(folder.parent / "wanted.toml")
    assert main(["design", wanted, "-o", str(folder), "--refine", "0.5"]) == 0


def sweep(folder: Path) -> None:
    (folder.parent / "oval.toml").write_text(SPECIMEN, encoding="utf-8")
    (folder.parent / "SWEEP.toml").write_text(
        'specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\nfigures = true\n'
        '[grid]\n"plate.radius" = ["9 mm", "1 cm"]', encoding="utf-8")
    file = str(folder.parent / "SWEEP.toml")
    assert main(["sweep", file, "-o", str(folder), "--refine", "0.5", "--workers", "1"]) == 0


def identify(folder: Path) -> None:
    rows = "".join(f"{name},{mass},{kilovolts},{0.12 * mass + 0.02 * kilovolts**2}\n"
                   for name in "AB" for mass in (15, 20) for kilovolts in (0, 1, 2, 3, 4))
    dataset = write_dataset(folder.parent / "dataset", 'name = "test"\nnoise = "10 um"\n',
                            static=f"specimen,mass_g,voltage_kV,displacement_mm\n{rows}")
    assert main(["lumped", "identify", str(dataset), "--paper", "-o", str(folder)]) == 0


def diagnose(folder: Path) -> None:
    table_2 = resources.files("tympan.paper") / "table-2"
    assert main(["diagnose", str(table_2), "-o", str(folder), "--workers", "1"]) == 0


def self_check(folder: Path) -> None:
    sets = [SyntheticSet(cause, 2.0, "named", (Cause("drift"),))
            for cause in (None, Cause("drift"), Cause("sensor_zero"))]
    check = summary_of(sets)
    check.save(folder)
    build_self_check_page(check, folder)


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
    "solve": of_specimen("solve", "--voltage", "3 kV", *LOADED),
    "curve": of_specimen("curve", "--voltage", "1 kV", *LOADED),
    "tolerance": of_specimen("tolerance", "--mass", "17.9 g", "--voltage", "2 kV", "--films",
                              "100", "--refine", "0.5"),
    "steer": steer,
    "lumped steer": lumped_steer,
    "sense": of_specimen("sense", "--to", "4 mm", "--points", "5", "--refine", "0.5"),
    "force": of_specimen("force", "--to", "4 mm", "--mass", "20 g", "--refine", "0.5"),
    "outlines": outlines,
    "map": alpha_map_of_few,
    "design": design,
    "sweep": sweep,
    "material fit": material_fit,
    "diagnose": diagnose,
    "diagnose --self-check": self_check,
    "lumped identify": identify,
    "lumped paper": paper,
    "lumped simulate": of_specimen("lumped simulate", "--signal", "sine", "--duration", "2 s",
                                   "--interval", "20 ms"),
    "lumped control": of_specimen("lumped control", "--high", "2 kV", "--supply", "3 kV",
                                  "--duration", "1 s"),
    "transient": of_specimen("transient", "--signal", "sine", "--duration", "2 s", "--interval",
                             "20 ms", "--refine", "0.5"),
    "response": of_specimen("response", "--voltage", "3 kV", *LOADED),
    "lumped build": of_specimen("lumped build", "--mass", "17.9 g", "--count", "3",
                                "--voltage", "0 kV..3 kV", "--refine", "0.5"),
}


def test_every_kind_has_a_run() -> None:
    assert set(RUNS) == set(KINDS)


#: Outlines of which a table is made, and figures of the paper that are drawn, where few will do: a
#: round frame, and one whose circles are two; curves, loops and a map.
FEW_OUTLINES = ("circle", "stadium")
FEW_FIGURES = ("fig7", "fig13", "misfit")


@pytest.fixture
def whole(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether all outlines and all figures of the paper are drawn, else few."""
    if not request.param:
        few = {name: examples()[name] for name in FEW_OUTLINES}
        monkeypatch.setattr(table, "examples", lambda: few)
        figures = {name: compose if name in FEW_FIGURES else lambda *_: look.new_figure(20.0)
                   for name, compose in paper_page.FIGURES.items()}
        monkeypatch.setattr(paper_page, "FIGURES", figures)
    return bool(request.param)


@pytest.mark.parametrize(("command", "whole"), [
    *((command, False) for command in KINDS
      if command not in ("diagnose", "lumped paper", "lumped steer")),
    dear("lumped paper", False, seconds=17), dear("lumped steer", False, seconds=30),
    pytest.param("diagnose", True, marks=pytest.mark.study), dear("outlines", True, seconds=24),
    dear("lumped paper", True, seconds=23)], indirect=["whole"])
def test_figures_are_drawn_again_byte_for_byte(
        command: str, whole: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are also what a command names last of all that it prints."""
    folder = tmp_path / "folder"
    RUNS[command](folder)
    printed = capsys.readouterr().out.splitlines()
    vectors = {file: file.read_bytes() for file in folder.glob("*.svg")}
    drawn = [*vectors, *folder.glob("*.png"), *folder.glob("*.html")]
    assert drawn
    for file in drawn:
        file.unlink()
    shown = rebuild(folder)
    assert shown
    if printed and command != "sweep":  # which names its page above its numbers
        assert printed[-len(shown):] == [str(file) for file in shown]
    assert all(file.exists() for file in (*shown, *drawn))
    assert {file: file.read_bytes() for file in vectors} == vectors
