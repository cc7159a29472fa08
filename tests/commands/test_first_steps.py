"""What a person meets first: help, examples, completion, the drawing, the doctor, quick starts."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import matplotlib.image
import numpy as np
import pytest

from tests.support.costs import dear
from tests.support.specimens import PATCH_TOML, circular, specimen_toml
from tympan import cli
from tympan.base.fields import fields_of, numbers
from tympan.cli import main
from tympan.commands import COMMANDS, ELSEWHERE, FIRST, HEADINGS, doctor
from tympan.commands.loads import takes_rig
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode
from tympan.grammar import LOADS
from tympan.options import Command
from tympan.studies import alpha as weights
from tympan.studies.case import Case, Settings, meshed, solve
from tympan.studies.kept import meshes

MASS = ("--mass", "17.9 g")


@pytest.fixture
def oval(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("oval.toml").write_text(specimen_toml())
    return "oval.toml"


@pytest.mark.parametrize(("asked", "headings"), [
    (["--help"], FIRST), (["help"], FIRST), (["help", "all"], HEADINGS),
    (["--help-all"], HEADINGS)])
def test_help_lists_commands_once_under_their_heading(asked: list[str], headings: Any,
                                                      capsys) -> None:
    with pytest.raises(SystemExit):
        main(asked)
    text = capsys.readouterr().out
    sections = [text.partition(f"\n{heading}:\n")[2].partition("\n\n")[0] for heading in headings]
    listed = [line[2:].split("  ")[0] for section in sections for line in section.splitlines()
              if line[:3].strip()]
    assert listed == [command.name for commands in headings.values() for command in commands]
    assert text.index("options:") > text.index(listed[-1])


def test_the_first_help_is_ten_commands_in_three_groups_of_all() -> None:
    first = [command for commands in FIRST.values() for command in commands]
    assert (len(FIRST), len(first)) == (3, 10)
    assert {*first} <= {*COMMANDS}


def test_one_page_explains_loads_and_rig(capsys: pytest.CaptureFixture[str]) -> None:
    for asked in (["help", "loads"], ["--help-loads"]):
        with pytest.raises(SystemExit):
            main(asked)
        page = capsys.readouterr().out
    assert max(map(len, page.splitlines())) < 80
    text = " ".join(page.split())
    named = text.partition("same in ")[2].partition(". ")[0].replace(" and ", ", ").split(", ")
    assert named == [command.name for command in COMMANDS if takes_rig(command)]
    for field in fields_of(Rig):
        assert f" {field.key} {field.says.meaning}" in text
    for load in LOADS:
        assert f" --{load} " in text
    for form, dimension, count in (
            ("17.9 g", "mass", 1), ("10 g, 20 g", "mass", 2), ("0 kV..5 kV", "voltage", 11),
            ("0 kV..5 kV in 6", "voltage", 6)):
        assert len(numbers(form, dimension, "load")) == count
        assert f'"{form}"' in text
        assert count < 3 or f"a range of {count} values" in text


@pytest.mark.parametrize(("slip", "meant"), [
    ("simulate", "'solve'"), ("fit", "'material fit'"), ("optimize", "'design'"),
    ("hysteresis", "'path'"), ("blocked-force", "'force'"), ("fatigue", "no lifetime is"),
    ("bode", "'response'"), ("monte-carlo", "'tolerance'"), ("identify", "'lumped identify'")])
def test_words_of_the_trade_lead_to_a_command(slip: str, meant: str, capsys) -> None:
    assert main([slip, "oval.toml"]) == 2
    line, = capsys.readouterr().err.splitlines()
    assert meant in line


def test_no_word_leads_to_two_commands() -> None:
    words = [word for command in COMMANDS for word in (
        command.name, *command.also, *command.formerly)] + [*ELSEWHERE]
    assert len(words) == len({*words})


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_every_help_has_an_example_that_the_parser_takes(command: Command, capsys) -> None:
    with pytest.raises(SystemExit):
        main([*command.name.split(), "--help"])
    words = " ".join(capsys.readouterr().out.split())
    line = f"tympan {command.name} {command.example}".rstrip()
    assert words.endswith(f"Example: {line}")
    assert ("tympan help loads" in words) == ("--rig" in words)
    options = cli.build_parser().parse_args(shlex.split(line)[1:])
    assert options.command == command.name


def test_bash_completes_commands_options_and_files(oval: str) -> None:
    pytest.importorskip("shtab")  # of the environment that make test makes
    if shutil.which("bash") is None:
        pytest.skip("there is no bash")
    parser = cli.build_parser()
    cli._complete_files(parser, {"bash": "_shtab_compgen_files"})
    script = __import__("shtab").complete(parser, shell="bash")

    def completed(*words: str) -> set[str]:
        ask = (f"COMP_WORDS=({shlex.join(words)}); COMP_CWORD={len(words) - 1}; "
               "_shtab_tympan; printf '%s\n' \"${COMPREPLY[@]}\"")
        done = subprocess.run(["bash", "-c", f"{script}\n{ask}"], capture_output=True, text=True,
                              check=True)
        return set(done.stdout.split())

    assert completed("tympan", "sol") == {"solve"}
    assert {"build", "simulate"} <= completed("tympan", "lumped", "")
    assert "--voltage" in completed("tympan", "solve", "--vol")
    assert "oval.toml" in completed("tympan", "solve", "ova")


def test_a_drawing_has_the_specimen_s_sizes(oval: str, capsys) -> None:
    assert main(["draw", oval, "-o", "drawing"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "oval: frame ellipse 120 × 90 mm, plate circle 20 mm, film 200 µm mounted "
        "(1000 µm × stretch 2.236, 2.236)",
        "drawing/oval-specimen.png", "drawing/oval-specimen.svg"]
    text = Path("drawing/oval-specimen.svg").read_text(encoding="utf-8")
    for words in ("frame 120 mm", ">90 mm", "plate 20 mm", "200 µm mounted", "gap 35 mm"):
        assert words in text


def test_a_drawing_warns_of_a_film_that_is_mounted_slack(oval: str, capsys) -> None:
    """Compressed along one axis it may still be tense, pulled by the other."""
    text = Path(oval).read_text(encoding="utf-8")
    for prestretch, slack in (("0.8", True), ("[1.5, 0.9]", False), ("[1.1, 0.9]", True)):
        Path(oval).write_text(re.sub("prestretch = .*", f"prestretch = {prestretch}", text))
        assert main(["draw", oval, "-o", "drawing"]) == 0
        assert ("slack before it is loaded" in capsys.readouterr().out) == slack


def test_a_drawing_shades_what_the_electrode_covers(oval: str) -> None:
    """Within an ellipse of 30 and 20 mm, from 1 mm off the plate of 10 mm on."""
    Path("patch.toml").write_text(PATCH_TOML)
    assert main(["draw", "patch.toml", "-o", "drawing"]) == 0
    pixels = 255 * matplotlib.image.imread("drawing/patch-specimen.png")[:, :, :3]
    covered, plate = (np.count_nonzero(np.abs(pixels - np.array(colour)).max(axis=2) < 2)
                      for colour in ((0x9a, 0xa5, 0xb1), (0x4d, 0x57, 0x63)))
    assert covered / plate == pytest.approx((30 * 20 - 11**2) / 10**2, rel=0.05)


def test_solve_says_what_it_read_and_found_in_units_of_the_bench(oval: str, capsys) -> None:
    arguments = ["solve", oval, *MASS, "--voltage", "3.5 kV", "--refine", "0.5"]
    assert main([*arguments, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert main(arguments) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.startswith("oval: frame ellipse 120 × 90 mm, plate circle 20 mm, film 200 µm")
    rows = dict(line.split("  ", 1) for line in lines if "  " in line)
    assert rows["deflection"].split() == [f"{1e3 * record['deflection_m']:.5g}", "mm"]
    assert rows["capacitance"].split() == [f"{1e9 * record['capacitance_F']:.5g}", "nF"]
    assert main(["solve", oval, *MASS, "--voltage", "20 kV", "--refine", "0.5"]) == 0
    assert "None" not in capsys.readouterr().out


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that answers what it did at first."""
    answers: list[Any] = []

    def kept(*arguments: Any) -> Any:
        answers[:] = answers or [function(*arguments)]
        return answers[0]

    return kept


@pytest.mark.study(seconds=5, only=("more2",))
@pytest.mark.parametrize("more", [(), ("--basis", "cone"), ("--uncertainty",)])
def test_alpha_says_weights_and_radii_on_lines(more: tuple[str, ...], oval: str, capsys,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one result, which is computed once."""
    for name in ("alpha", "uncertainty"):
        monkeypatch.setattr(weights, name, once(getattr(weights, name)))
    arguments = ["alpha", oval, "--refine", "0.5", *more]
    assert main([*arguments, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert main(arguments) == 0
    text = capsys.readouterr().out
    for number, (weight, radius) in enumerate(zip(record["alpha"], record["circles"], strict=True)):
        assert f"α{number + 1} = {weight:.4f} of a circle of {1e3 * radius:.4g} mm" in text
    assert not set("[]{}") & set(text)
    assert ("with a finer mesh: " in text) == ("--uncertainty" in more)


def test_the_doctor_finds_this_machine_in_order(capsys) -> None:
    assert main(["doctor", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["wrong"] == record["missing_libraries"] == []
    assert [point["passed"] for point in record["self_check"]["points"]] == [True] * 3
    assert record["display"]["draws_with"].startswith("vtk")


@pytest.mark.parametrize(("name", "answer", "words"), [
    ("drawing_window", None, "drawing"),
    ("version_of", None, "packages"),
    ("self_check", {"points": [{"voltage_V": 0.0, "deflection_m": None, "reference_m": 2e-3,
                                "passed": False}], "passed": False, "wall_s": 0.1}, "self-check"),
])
def test_the_doctor_says_what_is_wrong(name: str, answer: object, words: str, monkeypatch,
                                       capsys) -> None:
    for probe, result in {"drawing_window": "vtkWindow", "version_of": "1.0", "self_check": {
            "points": [], "passed": True, "wall_s": 0.1}, name: answer}.items():
        monkeypatch.setattr(doctor, probe, Mock(return_value=result))
    assert main(["doctor"]) == 1
    printed = capsys.readouterr()
    assert printed.err == f"tympan: not in order: {words}\n"
    assert "<- not in order" in printed.out


@pytest.fixture
def meshing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mock:
    """Counts films that are meshed, with a cache of its own."""
    monkeypatch.setenv("TYMPAN_CACHE", str(tmp_path / "cache"))
    counted = Mock(side_effect=meshes.mesh_film)
    monkeypatch.setattr(meshes, "mesh_film", counted)
    return counted


def test_the_same_outlines_are_meshed_once(meshing: Mock) -> None:
    film, settings, whole = circular(), MeshSettings(order=2), frozenset[str]()
    first = meshes.film_part(film, settings, whole)
    renamed = replace(film, name="other", membrane=replace(film.membrane, thickness=2e-3))
    again = meshes.film_part(renamed, settings, whole)
    assert meshing.call_count == 1
    assert np.array_equal(first.doflocs, again.doflocs)
    others = [replace(film, frame=Circle(45.1e-3)), replace(film, frame=Ellipse((45e-3, 45e-3))),
              replace(film, electrode=Electrode(2e-3))]
    for count, other in enumerate(others, 2):
        meshes.film_part(other, settings, whole)
        assert meshing.call_count == count
    meshes.film_part(film, MeshSettings(order=3), whole)
    meshes.film_part(film, settings, frozenset("xy"))
    assert meshing.call_count == 6


def test_a_kept_mesh_changes_no_number(meshing: Mock) -> None:
    case, answers = Case(circular(), mass=17.9e-3, voltage=3e3), []
    for _ in range(2):
        meshed.cache_clear()
        answers.append(solve(case, Settings(MeshSettings(order=2))))
    assert meshing.call_count == 1
    assert replace(answers[0], wall_s=0.0) == replace(answers[1], wall_s=0.0)


@pytest.mark.parametrize("folder", ["", "/dev/null/nowhere"])
def test_without_a_cache_films_are_meshed_again(folder: str, meshing: Mock,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TYMPAN_CACHE", folder)
    for _ in range(2):
        meshes.film_part(circular(), MeshSettings(order=2), frozenset("xy"))
    assert meshing.call_count == 2


@pytest.mark.study(seconds=6, only=("solve-oval.png",))
@pytest.mark.parametrize(("words", "pictures"), [
    (("solve", *MASS), ["oval.png", "oval.svg"]),
    (("force", "--to", "4 mm"), ["oval-force.png", "oval-force.svg"]),
    dear(("curve", *MASS), ["oval-curve.png", "oval-curve.svg"], seconds=2),
    dear(("tolerance", "--mass", "17.9 g", "--voltage", "2 kV", "--films", "100"),
         ["oval-tolerance.png", "oval-tolerance.svg"], seconds=12),
    dear(("sense", "--to", "4 mm", "--points", "5"), ["oval-sense.png", "oval-sense.svg"],
         seconds=1),
    dear(("path", *MASS), ["oval-path.png", "oval-path.svg"], seconds=2),
    dear(("modes", *MASS, "--count", "1"), ["oval-modes.png", "oval-modes.svg"], seconds=2),
    (("transient", *MASS, "--signal", "ramp", "--duration", "1 s"),
     ["response.png", "response.svg"]),
], ids=lambda value: value[0])
def test_what_there_is_to_look_at_is_told_last(words: tuple[str, ...], pictures: list[str],
                                               oval: str, capsys) -> None:
    command, *options = words
    assert main([command, oval, *options, "--refine", "0.5", "-o", "out"]) == 0
    lines = capsys.readouterr().out.splitlines()
    files = [Path("out") / name for name in pictures]
    assert lines[-2:] == [str(file) for file in files]
    assert all(file.is_file() for file in files)
    assert main([command, oval, *options, "--refine", "0.5", "-o", "out", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)
