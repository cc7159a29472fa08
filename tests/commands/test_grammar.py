"""Commands, functions and files have one name for one thing, as the page of grammar says."""

from __future__ import annotations

import argparse
import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import tympan
from tests.support import grammar, python_doors
from tests.support.specimens import circular, specimen_toml
from tympan.base.errors import InputError
from tympan.base.units import DIMENSIONS, any_quantity
from tympan.cli import main
from tympan.commands import COMMANDS
from tympan.geometry.mesher import MeshSettings
from tympan.grammar import BY_QUESTION, LOADS, SUBJECTS, WORDS
from tympan.studies.case import Settings
from tympan.studies.sweep.plan import read_sweep

#: Names of arguments that hand others on.
HANDED_ON = ("loads", "wave", "sizes", "table")
#: Longest signature: three lines of a notebook.
LONGEST = 200
COARSE = Settings(MeshSettings().refined(0.5))


def arguments(function: Any) -> dict[str, inspect.Parameter]:
    """Arguments as a notebook shows them, and those that are handed on but not shown."""
    shown = dict(inspect.signature(function).parameters)
    return {name: item for name, item in shown.items() if name not in HANDED_ON}


def plain(default: object) -> object:
    """A default without its form."""
    try:
        found = any_quantity(default)
    except InputError:
        found = None
    return default if found is None else found[0]


def test_every_option_and_argument_is_a_word_and_every_word_is_used() -> None:
    spoken = {*grammar.spoken()}
    written = {name.rstrip("_") for function in grammar.functions().values()
               for name in arguments(function)}
    handed = {name for command in COMMANDS if command.name not in python_doors.WITHOUT
              for name in python_doors.arguments(command.name)} - {*HANDED_ON, "from_"}
    assert spoken | written | handed | {*grammar.keys()} == {*WORDS}


def test_a_key_of_a_file_has_unit_and_default_of_its_word() -> None:
    """Keys of the files that ask; tables of parts have keys of their own in the reference."""
    for name, places in grammar.keys().items():
        word = WORDS[name]
        for file, field in places:
            if field.says.dimension and word.unit:
                assert DIMENSIONS[field.says.dimension].si == word.unit, f"{file}: {name}"
            if word.default is not BY_QUESTION and not field.required:
                assert field.default in (None, (), "", plain(word.default)), f"{file}: {name}"


def test_a_default_is_the_same_wherever_its_word_stands() -> None:
    places = [(name, where, default) for name, found in grammar.spoken().items()
              for where, default in found]
    places += [(name.rstrip("_"), where, item.default)
               for where, function in grammar.functions().items()
               for name, item in arguments(function).items()
               if item.default is not inspect.Parameter.empty]
    for name, where, default in places:
        if WORDS[name].default is not BY_QUESTION:
            assert default in (None, (), []) or plain(default) == plain(WORDS[name].default), (
                f"{where}: {name}")


@pytest.mark.parametrize("name", [*grammar.functions()])
def test_arguments_stand_in_order_and_are_few_lines(name: str) -> None:
    function = grammar.functions()[name]
    assert len(str(inspect.signature(function))) < LONGEST
    listed = arguments(function)
    first = [item.name for item in listed.values()
             if item.kind in (item.POSITIONAL_OR_KEYWORD, item.VAR_POSITIONAL)]
    assert {*first} <= {*SUBJECTS}
    named = [item for item in listed if item not in first]
    loads = [item for item in named if item in LOADS]
    assert named[:len(loads)] == [load for load in LOADS if load in loads]
    assert "settings" not in named or named[-1] == "settings"
    if "settings" in named:
        assert listed["settings"].default is None
    # Every argument is explained, by its name or as one of a few.
    words = inspect.getdoc(function) or ""
    assert words.split("\n")[0].endswith(".")


#: Functions of one state, and those that take several loads.
ONE = ("solve", "limits", "tolerance", "path", "modes", "response", "sensitivity", "transient",
       "lumped.simulate", "lumped.linearise", "lumped.control", "lumped.steer",
       "steer")
SEVERAL = ("curve", "force", "sense", "export", "films_within", "lumped.build")


def test_each_question_takes_one_load_or_several() -> None:
    with_mass = {name for name, function in grammar.functions().items()
                 if "mass" in inspect.signature(inspect.unwrap(function)).parameters
                 or "loads" in inspect.signature(inspect.unwrap(function)).parameters}
    assert with_mass - {"lumped.export"} == {*ONE, *SEVERAL}


@pytest.mark.parametrize("name", ONE)
@pytest.mark.parametrize("given", ["10 g, 20 g", "10 g..20 g", ["10 g", "20 g"],
                                   {"from": "1 g", "to": "2 g"}])
def test_a_question_of_one_state_says_so_when_it_gets_several(name: str, given: object) -> None:
    with pytest.raises(InputError, match=r"mass: given .*must be one: .*about one state"):
        grammar.functions()[name](circular(), mass=given)


@pytest.mark.parametrize("given", ["10 g, 20 g", "10 g..20 g", "1 g..2 g in 3"])
@pytest.mark.parametrize("command", ["solve", "limits", "tolerance", "modes", "lumped linearise"])
def test_so_does_its_command(command: str, given: str, tmp_path: Any,
                             capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    assert main([*command.split(), str(tmp_path / "oval.toml"), "--mass", given]) == 2
    assert f"--mass: given '{given}': must be one: this question" in capsys.readouterr().err


@pytest.mark.parametrize("given", [
    "0 kV, 1 kV, 2 kV", "0 kV..2 kV in 3", [0, 1e3, "2 kV"],
    {"from": 0, "to": "2 kV", "count": 3}, ("0 V", 1000, 2000.0)])
def test_forms_of_several_loads_are_the_same(given: Any) -> None:
    found = tympan.force(circular(), voltage=given, mass="10 g", to="4 mm", points=3,
                         settings=COARSE)
    assert [curve.voltage_V for curve in found.curves] == [0.0, 1000.0, 2000.0]


def test_a_film_and_a_rig_are_named_made_or_written_out(tmp_path: Any) -> None:
    from tympan.fem.toml_writer import specimen_to_toml

    film = circular()
    file, rig = tmp_path / "circle.toml", tmp_path / "rig.toml"
    file.write_text(specimen_to_toml(film), encoding="utf-8")
    rig.write_text('spring = "12 N/m"\n', encoding="utf-8")
    loads: dict[str, Any] = {"mass": "17.9 g", "voltage": "2 kV", "settings": COARSE}
    found = [tympan.solve(subject, rig=holder, **loads).deflection_m for subject, holder in (
        (film, tympan.Rig(spring=12.0)), (str(file), str(rig)), (file, {"spring": "12 N/m"}))]
    assert found[0] == found[1] == found[2] != tympan.solve(film, **loads).deflection_m


def _formerly() -> Iterator[Any]:
    yield lambda film: tympan.curve(film, "10 g", settings=COARSE), "mass=.* has to be named now"
    yield (lambda film: tympan.curve(film, mass="10 g", voltages=["1 kV"], settings=COARSE),
           "voltages= is voltage= now")
    yield lambda film: tympan.solve(film, COARSE, mass="10 g"), "settings= has to be named now"


@pytest.mark.parametrize(("ask", "words"), [*_formerly()])
def test_a_former_way_still_works_with_one_line_of_advice(ask: Any, words: str) -> None:
    with pytest.warns(FutureWarning, match=words) as told:
        assert ask(circular()).specimen == circular().name
    assert len(told) == 1
    assert told[0].filename == __file__


def test_former_arguments_are_words_no_more() -> None:
    for where, then, now in grammar.former_arguments():
        listed = {*python_doors.inspect.signature(
            inspect.unwrap(grammar.functions()[where])).parameters}
        assert then.rstrip("=") not in listed
        assert now.partition("=")[0] in listed


@pytest.mark.parametrize(("command", "then", "now"), [*grammar.former_options()])
def test_a_former_option_sets_the_one_of_now(command: str, then: str, now: str,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    parser = argparse.ArgumentParser()
    for add in next(each for each in COMMANDS if each.name == command).arguments:
        add(parser)
    subject = [] if command.startswith("lumped") and command != "lumped build" else ["a.toml"]
    needed = ["-o", "out"] if command == "sweep" else []
    options = parser.parse_args([*subject, *needed, then, "1 kV"])
    assert vars(options)[now.lstrip("-")] == "1 kV"
    line, = capsys.readouterr().err.splitlines()
    assert f"{then} is {now} now" in line
    assert then not in parser.format_help()


def test_the_page_is_up_to_date() -> None:
    """If it fails: ``python -m tests.support.grammar``."""
    assert grammar.PAGE.read_text(encoding="utf-8") == grammar.page()


SHARED = 'specimen = "oval.toml"\nmass = "10 g, 20 g"\nvoltage = "0 kV..2 kV in 3"\n'


@pytest.mark.parametrize(("written", "same"), [
    ('[grid]\n"plate.radius" = "6 mm..1.4 cm in 5"',
     '[grid]\n"plate.radius" = ["6 mm", "8 mm", "10 mm", "12 mm", "14 mm"]'),
    ('[grid]\n"plate.radius" = { from = "6 mm", to = "14 mm", count = 2 }',
     '[grid]\n"plate.radius" = ["6 mm", "14 mm"]'),
    ('[list]\n"electrode.margin_plate" = "0 mm..2 mm in 2"',
     '[list]\n"electrode.margin_plate" = ["0 mm", "2 mm"]'),
    ('[sample]\nmethod = "sobol"\ncount = 4\n[sample.ranges]\n"plate.radius" = "6 mm..14 mm"',
     '[sample]\nmethod = "sobol"\ncount = 4\n[sample.ranges]\n"plate.radius" = ["6 mm", "14 mm"]')])
def test_a_range_of_a_sweep_is_its_values(written: str, same: str, tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    found = []
    for text in (written, same):
        (tmp_path / "sweep.toml").write_text(f"{SHARED}{text}\n", encoding="utf-8")
        planned = read_sweep(tmp_path / "sweep.toml")
        found.append([(entry.task.specimen, entry.masses, entry.voltages)
                      for entry in planned.entries if entry.task])
    assert found[0] == found[1] != []
    assert found[0][0][1:] == ((0.01, 0.02), (0.0, 1e3, 2e3))


def test_a_range_of_a_design_is_its_ends(tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    found = []
    for vary in ('"0.5 mm..1.5 mm"', '["0.5 mm", "1.5 mm"]'):
        (tmp_path / "wanted.toml").write_text(
            'specimen = "oval.toml"\nmass = "10 g"\nvoltage = "2 kV"\n[want]\nstroke = "largest"\n'
            f'[vary]\n"membrane.thickness" = {vary}\n', encoding="utf-8")
        found.append(tympan.Requirements.read(tmp_path / "wanted.toml"))
    assert found[0] == found[1]


@pytest.mark.parametrize("wrong", ['"6 mm..14 g in 3"', '"wide..14 mm"', '"6 mm..14 mm in 1"'])
def test_a_wrong_range_is_one_message(wrong: str, tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    (tmp_path / "sweep.toml").write_text(f'{SHARED}[grid]\n"plate.radius" = {wrong}\n',
                                         encoding="utf-8")
    with pytest.raises(InputError, match=r"sweep\.toml: grid\.plate\.radius: given .*must"):
        read_sweep(tmp_path / "sweep.toml")


def test_a_lumped_model_stands_where_a_specimen_does_and_keeps_its_rig(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film, rig = circular(), {"spring": "20 N/m"}
    built = tympan.lumped.build(film, rig=rig, voltage="0 kV..2 kV in 3", mass="10 g",
                                settings=COARSE)
    built.save(tmp_path)
    file = tmp_path / "circle.lumped.toml"
    loads: dict[str, Any] = {"mass": "10 g", "voltage": "1 kV"}
    sprung, = tympan.lumped.linearise(built, **loads).linear
    for given in (built.models[0], file, str(file)):
        same, = tympan.lumped.linearise(given, **loads).linear
        assert same.deflection == pytest.approx(sprung.deflection, rel=1e-12)
    free, = tympan.lumped.linearise(file, rig={}, **loads).linear
    assert free.deflection > 1.05 * sprung.deflection
    words = ["--mass", "10 g", "--voltage", "1 kV", "--json"]
    printed = []
    for place in ([str(file)], ["--model", str(file)]):
        assert main(["lumped", "linearise", *place, *words]) == 0
        printed.append(json.loads(capsys.readouterr().out))
    assert printed[0] == printed[1]
    assert [path.name for path in tympan.lumped.export(built, tmp_path / "c")] == [
        "circle.h", "circle.c"]


@pytest.mark.parametrize("name", ["solve", "path", "modes", "response", "sensitivity"])
def test_both_doors_ask_for_a_mass(name: str, tmp_path: Path,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match=r'^mass: must be given, such as "17\.9 g", or "0 g"'):
        grammar.functions()[name](circular(), voltage="1 kV")
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    assert main([name, str(tmp_path / "oval.toml"), "--voltage", "1 kV"]) == 2
    assert '--mass: must be given, such as "17.9 g", or "0 g"' in capsys.readouterr().err


def test_files_of_another_kind_say_where_they_belong(tmp_path: Path) -> None:
    (tmp_path / "frame.dxf").write_text("  0\nSECTION\n", encoding="utf-8")
    with pytest.raises(InputError, match=r'is a drawing: .*shape = "dxf", file = "frame\.dxf"'):
        tympan.draw(tmp_path / "frame.dxf")
    with pytest.raises(InputError, match=r"is a folder: tympan\.Result\.load reads"):
        tympan.load(tmp_path)
    with pytest.raises(InputError, match="name the others: mass, voltage"):
        tympan.solve(circular(), "17.9 g")


def test_the_files_of_the_page_are_read(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = re.findall(r"`(\w+\.toml)`, for(?:(?!```).)*```toml\n(.*?)```", grammar.BEGINNING,
                       re.DOTALL)
    assert [name for name, _ in found] == ["actuator.toml", "scatter.toml", "wanted.toml",
                                           "sweep.toml"]
    for name, text in found:
        assert len(text.splitlines()) <= 15
        Path(name).write_text(text, encoding="utf-8")
    actuator = tympan.load("actuator.toml")
    assert isinstance(actuator, tympan.Actuator)
    assert len(actuator.rig.biases) == 1
    wanted = tympan.Requirements.read("wanted.toml")
    assert wanted.tolerances == tympan.Tolerances.read("scatter.toml")
    assert len(read_sweep(Path("sweep.toml")).entries) == 3 * 2
