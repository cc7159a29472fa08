"""The explorer without a browser: views, what is solved of them, and what is written of them."""

from __future__ import annotations

import asyncio
import json
import os
import re
import resource
import signal
import subprocess
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import aclosing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.costs import dear
from tests.support.datasets import write_dataset
from tests.support.moves import random_views
from tests.support.specimens import circular, elliptical, skewed, specimen_toml
from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.explore import latest
from tympan.explore.copied import command_of, python_of
from tympan.explore.curve import drawn_curve
from tympan.explore.latest import Latest, Pause, Trouble
from tympan.explore.numbers import blocked_rows, curve_rows, limit_rows, result_rows
from tympan.explore.page import Asked, Page, Picture, scene_answers
from tympan.explore.session import (
    Question,
    Scene,
    Session,
    Views,
    followed,
)
from tympan.explore.subject import Subject, read_subject
from tympan.explore.view import (
    FilmView,
    changed,
    control_value,
    controls,
)
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.biases import Constant
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.outlines import Circle, Polygon, Rotated, Stadium, examples, reshaped
from tympan.geometry.specimen import Electrode, Plate, Specimen
from tympan.reports.colouring import COLOURINGS, MOST_MARGIN
from tympan.studies.case import Settings, solve

SETTINGS = Settings()


def vhb_oval() -> Specimen:
    """An oval of the library's film, which has a strength."""
    return load_specimen(Table("oval.toml", tomllib.loads(specimen_toml())))


START = FilmView(skewed(), mass=0.02, voltage=2000.0)
OVAL = FilmView(elliptical(60e-3), mass=0.0179, voltage=2000.0)


def same_as_solved(scene: Scene) -> None:
    """A scene's numbers are those of ``tympan solve``; where that finds none, neither has it."""
    expected = solve(scene.view.case, SETTINGS)
    assert (scene.result.status == "equilibrium") == (expected.status == "equilibrium"), expected
    for name in ("deflection_m", "capacitance_F", "max_true_stress_Pa", "breakdown_margin"):
        if getattr(expected, name) is not None:
            assert getattr(scene.result, name) == pytest.approx(getattr(expected, name), rel=1e-6)


@pytest.mark.parametrize(("key", "value"), [
    ("voltage", 3500.0), dear("mass", 0.03, seconds=1), ("stiffness", 1.3),
    ("membrane.prestretch.0", 2.1), dear("membrane.relative_permittivity", 5.5, seconds=1),
    dear("membrane.thickness", 0.8e-3, seconds=1), dear("frame.semi_axes.1", 50e-3, seconds=1),
    dear("plate.outline.radius", 8e-3, seconds=1), ("plate.offset.0", -4e-3)])
def test_a_moved_control_gives_what_solve_gives(key: str, value: float) -> None:
    session = Session()
    session.scene(START)
    view = changed(START, key, value)
    assert control_value(view, key) == value
    scene = session.scene(view)
    assert scene.result.deflection_m != session.scene(START).result.deflection_m
    same_as_solved(scene)


@pytest.mark.parametrize(("key", "value"), [
    ("voltage", 3500.0), ("mass", 0.03), ("stiffness", 1.25), ("membrane.prestretch.0", 2.1),
    ("frame.semi_axes.0", 66e-3), ("plate.outline.radius", 9e-3)])
def test_a_control_that_slides_is_near_what_solve_gives_and_there_when_it_rests(
        key: str, value: float) -> None:
    session = Session()
    session.scene(OVAL)
    view = changed(OVAL, key, value)
    scene, expected = session.scene(view, sliding=True), solve(view.case, SETTINGS)
    assert scene.guessed == (key not in ("voltage", "mass"))
    for name, rel in (("deflection_m", 1e-6), ("capacitance_F", 1e-6),
                      ("max_true_stress_Pa", 5e-4)):
        assert getattr(scene.result, name) == pytest.approx(getattr(expected, name), rel=rel)
    blocked = session.blocked(view, sliding=True).force
    scene = session.scene(view)
    assert not scene.guessed
    same_as_solved(scene)
    assert session.blocked(view).force == pytest.approx(blocked, rel=1e-5)


@pytest.mark.parametrize(("key", "value"), [
    ("voltage", 3500.0), ("membrane.thickness", 1.1e-3), ("membrane.prestretch.0", 3.0),
    ("plate.offset.0", 5e-3), ("frame.semi_axes.0", 80e-3)])
def test_sliding_numbers_are_within_their_digits_and_those_of_solve_at_rest(
        key: str, value: float) -> None:
    views = Views()
    assert not views.scene(OVAL).guessed
    view = changed(OVAL, key, value)
    scene, expected = views.scene(view, sliding=True), solve(view.case, SETTINGS)
    assert scene.guessed == (key != "voltage")
    for name, rel in (("deflection_m", 5e-4), ("capacitance_F", 5e-4), ("max_stretch", 5e-3),
                      ("max_true_stress_Pa", 5e-3), ("max_field_V_per_m", 2e-2)):
        assert getattr(scene.result, name) == pytest.approx(getattr(expected, name), rel=rel)
    assert views.blocked(view, sliding=True).force == pytest.approx(
        Session().blocked(view).force, rel=1e-3)
    same_as_solved(views.scene(view))


def test_a_mesh_does_not_slide_far_nor_to_another_kind_of_film() -> None:
    session = Session()
    session.scene(OVAL)
    for view in (changed(OVAL, "frame.semi_axes.0", 95e-3), changed(OVAL, "plate.offset.0", 2e-3)):
        scene = session.scene(view, sliding=True)
        assert not scene.guessed
        same_as_solved(scene)


@pytest.mark.parametrize("count", [10, dear(30, seconds=5)])
def test_random_moves_give_what_solve_gives(count: int) -> None:
    session = Session()
    for view in random_views(OVAL, count, most_voltage=3e3):
        same_as_solved(session.scene(view))


def test_beyond_the_end_there_is_no_film_and_below_it_there_is_one_again() -> None:
    session = Session()
    scenes = [session.scene(replace(OVAL, voltage=voltage)) for voltage in (7e3, 12e3, 7e3)]
    for scene in scenes:
        same_as_solved(scene)
    assert [scene.film is None for scene in scenes] == [False, True, False]
    assert "thins without bound" in scenes[1].result.warnings[0]


@pytest.mark.study
def test_a_thousand_random_moves_leave_memory_as_it_was() -> None:
    session, resident = Session(), []
    for number, view in enumerate(random_views(OVAL, 1000, seed=1, most_voltage=5e3)):
        scene = session.scene(view)
        if number % 10 == 0:
            same_as_solved(scene)
        resident.append(resident_bytes())
    early, late = np.median(resident[100:300]), np.median(resident[800:])
    assert late < 1.1 * early, (early, late)  # narrow films on the way take more for a while


def resident_bytes() -> float:
    """Memory of this process [bytes]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return float(pages * resource.getpagesize())


def test_the_mesh_serves_while_the_film_needs_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    from tympan.explore import session as module

    made: list[str] = []
    build = module.build_model

    def counted(specimen: Any, *others: Any) -> Any:
        made.append(specimen.name)
        return build(specimen, *others)

    monkeypatch.setattr(module, "build_model", counted)
    session = Session()
    for key, value in (("voltage", 1e3), ("mass", 0.01), ("membrane.thickness", 0.9e-3)):
        session.scene(changed(START, key, value))
    assert len(made) == 1
    session.scene(changed(START, "plate.outline.radius", 9e-3))
    assert len(made) == 2
    unequal = changed(START, "membrane.prestretch.0", 5.0)  # is meshed more finely
    session.scene(unequal)
    assert len(made) == 3


def test_a_film_that_becomes_a_wedge_is_meshed_whole() -> None:
    session = Session()
    session.scene(OVAL)
    assert OVAL.specimen.mirror_planes == {"x", "y"}
    film = replace(OVAL.specimen.membrane, thickness_gradient=(0.1, 0.1))
    same_as_solved(session.scene(replace(OVAL, specimen=replace(OVAL.specimen, membrane=film))))


@pytest.mark.parametrize(("key", "text", "words"), [
    ("voltage", "-1", "must be from 0 to 1000 kV"),
    ("voltage", "3 g", "must be a voltage"),
    ("mass", "much", "must be a mass"),
    ("stiffness", "0", "must be from 0.01 to 100"),
    ("stiffness", "2 mm", "must be a number"),
    ("membrane.relative_permittivity", "0.2", "must be at least 1"),
    ("membrane.prestretch.1", "0", "must be"),
    ("plate.outline.radius", "50", "must lie inside the frame"),
    ("plate.offset.0", "5.5 cm", "must lie inside the frame"),
    ("frame.semi_axes.0", "1 um", "half extents must be")])
def test_bad_values_are_told_as_in_a_file(key: str, text: str, words: str) -> None:
    control = next(control for control in controls(START) if control.key == key)
    with pytest.raises(InputError, match=words):
        changed(START, key, control.parsed(text))


def test_numbers_are_of_the_field_s_unit_or_of_their_own() -> None:
    radius = next(control for control in controls(START) if control.key == "plate.outline.radius")
    assert radius.unit == "mm"
    assert radius.parsed("12.5") == radius.parsed("1.25 cm") == 12.5e-3
    assert radius.text(changed(START, radius.key, radius.parsed(" 9 "))) == "9"


def test_every_control_begins_within_its_slider_and_sliders_stand_on_steps() -> None:
    for specimen in (skewed(), circular(), elliptical(70e-3)):
        view = FilmView(specimen, mass=0.02)
        for control in controls(view):
            assert control.low <= control.value(view) * (1 + 1e-12) + 1e-12 <= control.high + 1e-9
            steps = (control.position(view) - control.low) / control.step
            assert steps == pytest.approx(round(steps), abs=1e-6)
            assert abs(control.position(view) - control.value(view)) <= control.step / 2 + 1e-9
            assert 100 <= (control.high - control.low) / control.step <= 2500


def test_an_outline_of_many_numbers_has_no_sliders() -> None:
    corners = tuple((40e-3 * np.cos(a), 40e-3 * np.sin(a)) for a in 2 * np.pi * np.arange(12) / 12)
    view = FilmView(replace(skewed(), frame=Polygon(corners), plate=Plate(Circle(5e-3)),
                        electrode=Electrode()))
    keys = [control.key for control in controls(view)]
    assert not [key for key in keys if key.startswith("frame")]
    assert "plate.outline.radius" in keys


def test_the_written_file_and_the_command_give_the_same_film(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
        ) -> None:
    import shlex

    from tympan.cli import main

    monkeypatch.chdir(tmp_path)
    view = changed(changed(OVAL, "stiffness", 1.2), "frame.semi_axes.0", 58.2e-3)
    expected = Session().scene(view).result.deflection_m
    Path("oval.toml").write_text(specimen_to_toml(view.actuator), encoding="utf-8")
    assert load_specimen(Path("oval.toml")) == view.actuator
    main([*shlex.split(command_of(view, "oval.toml"))[1:], "--json"])
    found = json.loads(capsys.readouterr().out)["deflection_m"]
    assert found == pytest.approx(expected, rel=1e-10)


def ran(script: str) -> dict[str, Any]:
    """The names of a script that has run."""
    names: dict[str, Any] = {}
    exec(script, names)
    return names


def test_copied_python_is_eight_lines_through_one_import_and_gives_the_page_s_numbers() -> None:
    view = changed(FilmView(vhb_oval(), mass=0.0179, voltage=2000.0), "frame.semi_axes.0", 58.2e-3)
    script = python_of(view)
    lines = [line for line in script.splitlines() if line]
    assert len(lines) == 8
    assert [line for line in lines if "import" in line] == ["import tympan"]
    assert 'material="vhb-4910"' in script
    names = ran(script)
    assert names["specimen"] == view.actuator
    expected = Session().scene(view).result.deflection_m
    assert names["result"].deflection_m == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("film", [
    vhb_oval(), skewed(), *(replace(skewed(), frame=outline, plate=Plate(Circle(5e-3)),
                                    electrode=Electrode(margin_frame=1e-3))
                            for outline in examples().values())],
    ids=["vhb", "skewed", *examples()])
def test_copied_python_makes_the_same_film(film: Specimen) -> None:
    rig = Rig(spring=2.0, sag_voltage=40e3, biases=(Constant(0.01),))
    for view in (FilmView(film, rig), FilmView(film, rig, stiffness=1.2)):
        names = ran(python_of(view).partition("result =")[0])
        assert names["specimen"] == view.actuator
        assert names["rig"] == rig


def test_a_stiffer_film_of_the_library_is_said_to_be_one() -> None:
    view = FilmView(vhb_oval(), mass=0.0179, stiffness=1.2)
    script = python_of(view)
    assert "# vhb-4910, its stresses times 1.2" in script
    assert "from" not in script


def test_a_film_that_is_in_a_file_is_loaded_from_it(tmp_path: Path) -> None:
    file = tmp_path / "oval.toml"
    file.write_text(specimen_toml(), encoding="utf-8")
    view = FilmView(load_specimen(file), mass=0.0179, voltage=1e3)
    script = python_of(view, str(file))
    assert len([line for line in script.splitlines() if line]) == 4
    assert ran(script)["specimen"] == view.specimen


@pytest.mark.parametrize("name", [
    "my film;touch PWNED;$(touch PWNED).toml", "a`touch PWNED`.toml", "it's \"one\".toml",
    "-o.toml", "a\ntouch PWNED\n.toml", "$HOME & touch PWNED.toml", "~.toml", "film 2.toml"])
def test_a_copied_command_runs_nothing_but_itself(name: str, tmp_path: Path) -> None:
    """A shell hands the file's name over as it is."""
    (tmp_path / name).write_text("mine", encoding="utf-8")
    command = command_of(OVAL, name, f"rig of {name}")
    shown = "tympan() { printf '%s\\0' \"$@\"; }\n" + command
    done = subprocess.run(["sh", "-c", shown], cwd=tmp_path, capture_output=True, check=True)
    words = done.stdout.decode().split("\0")[:-1]
    file = f"./{name}" if name.startswith("-") else name
    assert words == ["solve", file, "--mass", "17.9 g", "--voltage", "2 kV", "--rig",
                     f"rig of {name}"]
    assert (tmp_path / words[1]).read_text(encoding="utf-8") == "mine"
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_copied_python_holds_names_as_texts() -> None:
    """The script runs nothing of a name; one that might be run cannot be given."""
    with pytest.raises(InputError, match="must serve as a file name"):
        replace(OVAL.specimen, name="a'); import os; print('")
    odd = replace(OVAL, specimen=replace(OVAL.specimen, name="7 a+b.c-1"))
    names: dict[str, Any] = {}
    exec(python_of(odd).partition("result =")[0], names)
    assert names["specimen"] == odd.specimen


def test_a_wrinkled_film_is_hatched_where_solve_says_so() -> None:
    view = FilmView(elliptical(75e-3), mass=17.9e-3, voltage=7e3)
    scene = Session().scene(view)
    assert scene.film is not None
    assert scene.result.slack_area_m2 is not None
    assert (scene.result.slack_area_m2 > 0) == bool(scene.film.values["tension"].any())


def test_colours_are_those_numbers() -> None:
    scene = Session().scene(FilmView(vhb_oval(), mass=0.02, voltage=3000.0))
    assert scene.film is not None
    colours = {key: quantity.of(scene.film) for key, quantity in COLOURINGS.items()}
    assert colours["stress"].max() == pytest.approx(1e-3 * (scene.result.max_true_stress_Pa or 0),
                                                    rel=1e-2)
    assert colours["field"].max() == pytest.approx(1e-6 * (scene.result.max_field_V_per_m or 0),
                                                   rel=1e-2)
    assert colours["margin"].min() == pytest.approx(scene.result.breakdown_margin, rel=1e-2)
    film = scene.view.specimen.membrane
    flat = 1e6 * film.thickness / film.area_prestretch
    assert 0.8 * flat < colours["thickness"].min() <= colours["thickness"].max() < 1.01 * flat
    none = Session().scene(replace(scene.view, voltage=0.0))
    assert none.film is not None
    assert (COLOURINGS["margin"].of(none.film) == MOST_MARGIN).all()


@pytest.mark.parametrize("voltage", [0.0, 2000.0])
def test_what_is_drawn_lies_where_the_film_does(voltage: float) -> None:
    scene = Session().scene(replace(START, voltage=voltage))
    told, drawn, _ = scene_answers()(Asked(scene.view))
    assert told.result == drawn.scene.result
    assert scene.film is not None
    assert drawn.film is not None
    assert drawn.scene.result == scene.result
    assert json.dumps(drawn.film, allow_nan=False)
    item, = drawn.film["films"]
    deflection = scene.result.deflection_m or 0.0
    assert f"sunk by {1e3 * deflection:.3f} mm" in item["name"]
    displaced = item["displaced"]["step"] * decoded(item["displaced"]).reshape(-1, 3)
    assert displaced == pytest.approx(1e3 * scene.film.values["displacement"], abs=1e-4)
    plate = np.unique(decoded(item["plate"]))
    assert displaced[plate, 2].mean() == pytest.approx(1e3 * deflection, rel=1e-3)  # downwards
    assert (decoded(item["triangles"]).reshape(-1, 3) == scene.film.triangles).all()
    # Every quantity is offered of every film, so that a choice lasts.
    assert list(drawn.film["quantities"]) == list(COLOURINGS)
    for quantity in drawn.film["quantities"].values():
        assert quantity["low"] < quantity["high"]


def decoded(array: dict[str, Any]) -> Any:
    from base64 import b64decode

    return np.frombuffer(b64decode(array["data"]), array["type"])


def test_the_curve_ends_where_limits_says_and_meets_the_readings(tmp_path: Path) -> None:
    from tympan.studies.case import Case
    from tympan.studies.limits import limits

    masses, voltages = (0.0179, 0.0179, 0.0179, 0.02), (0.0, 3000.0, 50e3, 0.0)
    rows = "".join(f"A,{1e3 * mass},{voltage / 1e3},2.5\n"
                   for mass, voltage in zip(masses, voltages, strict=True))
    folder = write_dataset(tmp_path / "data", static="specimen,mass_g,voltage_kV,displacement_mm\n"
                                                     + rows)
    subject = read_subject(folder)
    assert subject.masses(0) == [0.0179, 0.02]
    assert subject.masses(1) == []
    view = subject.view(0)
    assert (view.mass, view.specimen.name) == (0.0179, "A")
    first, curve = followed(Question(view, subject.static))
    assert first.circles is None
    assert first.curve is curve.curve
    reached = limits(Case(view.specimen, mass=view.mass), SETTINGS)
    drawn = curve.curve.curves[0].limits
    assert [limit.kind for limit in drawn.reached] == [limit.kind for limit in reached.reached]
    assert [limit.voltage_V for limit in drawn.reached] == pytest.approx(
        [limit.voltage_V for limit in reached.reached], rel=1e-5)
    readings = curve.readings
    assert readings is not None
    expected = [solve(replace(view, voltage=voltage).case, SETTINGS).deflection_m or np.nan
                for voltage in (0.0, 3000.0)]
    assert readings.simulated[:2] == pytest.approx(expected, rel=1e-9)
    assert np.isnan(readings.simulated[2])  # beyond the film's end
    assert readings.residual[:2] == pytest.approx(2.5e-3 - np.array(expected), rel=1e-9)
    assert readings.rms == pytest.approx(np.sqrt((readings.residual[:2] ** 2).mean()))
    drawn = drawn_curve(curve, (3.0, 1e3 * expected[1]))
    assert drawn.count('class="reading"') == 3 + 2  # and what is left of two
    assert 'class="here"' in drawn
    # Each voltage of the axis has a line of its own.
    upright = re.findall(r'class="grid" x1="([0-9.]+)" x2="\1"', drawn)
    assert len(set(upright)) > 2
    rows_shown = {row["key"]: str(row["text"])
                  for row in (*limit_rows(curve), *curve_rows(curve, expected[1]))}
    stroke, unit = rows_shown["stroke"].split()
    assert (float(stroke), unit) == (pytest.approx(1e3 * (expected[1] - expected[0]), rel=1e-3),
                                     "mm")
    assert reached.limit is not None
    assert rows_shown["first"] == reached.limit.words
    assert rows_shown[reached.limit.kind].endswith("(the limit)")
    of_another = {row["key"]: row for row in curve_rows(curve, expected[1], stale=True)}
    assert all(row["stale"] for row in of_another.values())
    assert of_another["stroke"]["text"] == "…"
    assert rows_shown["rms"].endswith("µm")
    assert float(rows_shown["alpha-1"]) == pytest.approx(1.0, abs=1e-3)  # a circle is itself


@pytest.mark.parametrize("rig", [Rig(), Rig(spring=3.0)])
def test_the_blocked_force_is_that_of_the_force_study_whatever_was_shown_before(rig: Rig) -> None:
    from tympan.studies.force import ForceCase, force

    session, view = Session(), replace(OVAL, rig=rig)
    rest = solve(replace(view, voltage=0.0).case, SETTINGS).deflection_m
    assert rest is not None
    case = ForceCase(view.specimen, voltages=(0.0, view.voltage), to=2 * rest,
                     masses=(view.mass,), rig=rig)
    expected = force(case, SETTINGS)
    assert expected.blocked_displacement_m == pytest.approx(rest, rel=1e-6)
    for before in (view, replace(view, mass=0.03), replace(view, voltage=4e3)):
        session.scene(before)
        session.blocked(before)
        session.scene(view)
        shown = session.blocked(view)
        assert shown.force == pytest.approx(expected.blocked_force_N, rel=1e-6)
    row, = blocked_rows(shown)
    assert float(str(row["text"]).split()[0]) == pytest.approx(1e3 * shown.force, rel=1e-4)
    assert session.blocked(replace(view, voltage=0.0)).force == pytest.approx(0.0, abs=1e-9)


def test_a_plate_that_cannot_move_has_no_blocked_force() -> None:
    view = replace(OVAL, rig=Rig(guide="fixed"))
    session = Session()
    session.scene(view)
    assert not blocked_rows(session.blocked(view))


def test_numbers_of_the_film_before_are_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latest, "_PRELOADED", [])
    session, other = Session(), replace(OVAL, mass=0.02)
    curve = next(iter(followed(Question(OVAL))))

    async def run() -> None:
        page = Page(Subject("oval", (OVAL.specimen,), Rig()), OVAL)

        def stale() -> dict[str, bool]:
            return {row["key"]: row["stale"] for row in page.state["numbers"]}

        def show(view: FilmView) -> None:
            page._solved(Picture(session.scene(view), {}), True)

        assert page.state["following"]
        show(OVAL)
        page._solved(session.blocked(OVAL), True)
        page._followed(curve, True)
        assert not page.state["following"]
        assert {"blocked", "stroke", "first"} <= set(stale())
        assert not any(stale().values())
        page.hear("typed", "mass", "20")
        assert page.state["following"]
        show(other)
        assert {key for key, is_old in stale().items() if is_old} == {"blocked", "stroke", "first"}
        page._solved(session.blocked(other), True)
        assert {key for key, is_old in stale().items() if is_old} == {"stroke", "first"}
        page._followed(Trouble("it is slack"), True)
        assert not any(stale().values())
        assert page.state["curve"] == ""
        page.close()

    asyncio.run(run())


def test_numbers_carry_their_units() -> None:
    scene = Session().scene(START)
    shown = {row["key"]: row["text"] for row in result_rows(scene)}
    value, unit = shown["deflection_m"].split()
    assert unit == "mm"
    assert float(value) == pytest.approx(1e3 * (scene.result.deflection_m or 0.0), rel=1e-4)


def test_a_folder_of_specimens_and_its_rig_are_explored_together(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(specimen_toml(name), encoding="utf-8")
    (tmp_path / "rig.toml").write_text('spring = "3 N/m"\n', encoding="utf-8")
    subject = read_subject(tmp_path)
    assert [specimen.name for specimen in subject.specimens] == ["a", "b"]
    assert subject.rig == Rig(spring=3.0)
    assert read_subject(tmp_path / "b.toml").rig == Rig()
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match=r"must hold dataset\.toml or specimens"):
        read_subject(tmp_path / "none")


def slow_square() -> Callable[[Any], Iterator[Any]]:
    """Answers the square of a number after that many tenths of a second; 13 ends the process.

    After 3 it pauses for a minute.
    """
    def answer(number: int) -> Iterator[int]:
        time.sleep(abs(number) / 10)
        if number == 13:
            os._exit(1)
        if number < 0:
            raise InputError("must not be negative", key="number", given=number)
        yield number * number
        if number == 3:
            yield Pause(60.0)
            yield -1

    return answer


def asked(questions: list[tuple[float | None, int]], patience: float, enough: int
          ) -> list[tuple[Any, bool]]:
    """What is delivered of questions asked so long [s] after another, None after its answer."""
    async def run() -> list[tuple[Any, bool]]:
        parts: list[tuple[Any, bool]] = []
        worker = Latest(slow_square, lambda part, newest: parts.append((part, newest)), patience)

        async def until(count: int) -> None:
            for _ in range(1200):
                if len(parts) >= count:
                    return
                await asyncio.sleep(0.05)

        try:
            for pause, question in questions:
                await (until(len(parts) + 1) if pause is None else asyncio.sleep(pause))
                worker.ask(question)
            await until(enough)
            return parts
        finally:
            worker.close()

    return asyncio.run(run())


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="the system cannot stop a process")
def test_a_process_that_waits_answers_when_it_may_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latest, "_PRELOADED", [])

    async def run() -> tuple[int, int]:
        parts: list[Any] = []
        worker = Latest(slow_square, lambda part, newest: parts.append(part), None)

        async def until(count: int, tries: int) -> int:
            for _ in range(tries):
                if len(parts) >= count:
                    break
                await asyncio.sleep(0.05)
            return len(parts)

        try:
            worker.ask(2)
            first = await until(1, 1200)
            while worker.busy:
                await asyncio.sleep(0.05)
            worker.wait(True)
            worker.ask(3)
            stopped = await until(first + 1, 40) - first
            worker.wait(False)
            return stopped, await until(first + 1, 1200) - first
        finally:
            worker.close()

    assert asyncio.run(run()) == (0, 1)


def test_the_newest_question_is_answered_and_those_between_are_dropped(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latest, "_PRELOADED", [])
    first, second = asked([(0, 3), (0, 1), (0, 2), (0, 4)], 60.0, 2)
    assert (first, second) == ((9, False), (16, True))


def test_an_answer_that_pauses_ends_where_another_question_is_asked() -> None:
    began = time.perf_counter()
    assert asked([(0, 3), (None, 1), (None, 2)], 60.0, 3) == [(9, True), (1, True), (4, True)]
    assert time.perf_counter() - began < 50


def test_what_nobody_waits_for_is_given_up_and_a_process_that_dies_is_replaced() -> None:
    parts = asked([(0, 300), (0.1, 2)], 0.2, 1)
    assert parts == [(4, True)]  # thirty seconds were not waited for
    dead, after = asked([(0, 13), (None, 1)], 60.0, 2)
    assert isinstance(dead[0], Trouble)
    assert after == (1, True)
    wrong, after = asked([(0, -1), (None, 1)], 60.0, 2)
    assert wrong == (Trouble("number: given -1: must not be negative"), True)
    assert after == (1, True)


def test_each_specimen_begins_as_it_was_read_and_its_sliders_stay_where_they_are_moved(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latest, "_PRELOADED", [])
    for name, radius in (("a", "4 cm"), ("b", "5 cm")):
        frame = f'shape = "circle"\nradius = "{radius}"'
        (tmp_path / f"{name}.toml").write_text(specimen_toml(name, frame), encoding="utf-8")
    subject = read_subject(tmp_path)

    async def run() -> None:
        start = changed(subject.view(0, 0.0179), "voltage", 1500.0)
        page = Page(subject, start)
        page.hear("typed", "stiffness", "1.5")
        for number, view in ((1, subject.view(1, 0.0179)), (0, start)):
            page.hear("choose", number)
            assert page.view == view
            assert page.state["texts"]["frame.radius"] == ("40", "50")[number]
            assert page.state["sliders"]["voltage"] == view.voltage / 1e3
        page.hear("typed", "frame.radius", "1 mm")
        assert page.view == start
        assert "must lie inside the frame" in page.state["errors"]["frame.radius"]
        page.hear("reset")
        assert page.state["errors"] == {}
        async with aclosing(page.news()) as news:
            whole = json.loads(await anext(news))
            assert whole == page.state
            page.hear("slid", "voltage", "2.5")
            page._reached()
            told = json.loads(await anext(news))
            assert "controls" in told
            assert told["texts"]["voltage"] == "2.5"
            assert "sliders" not in told  # a hand may be on one
            page.hear("typed", "voltage", "2")
            assert json.loads(await anext(news))["sliders"]["voltage"] == 2.0
        assert not page._browsers
        page.close()

    asyncio.run(run())


@pytest.mark.parametrize("shape", examples())
def test_every_shape_is_as_large_as_the_one_before_and_the_way_back_is_exact(shape: str) -> None:
    template = examples()[shape]
    for outline in (Circle(30e-3), *examples().values()):
        made = reshaped(outline, template)
        assert made.shape == shape
        assert min(made.semi_axes) == pytest.approx(min(outline.semi_axes), rel=1e-9)
        again = reshaped(made, outline)
        assert min(again.semi_axes) == pytest.approx(min(outline.semi_axes), rel=1e-9)
    assert reshaped(template, template) == template
    turned = reshaped(Rotated(Polygon(((0.03, 0.0), (0.0, 0.04), (-0.03, 0.0), (0.0, -0.04))), 0.3),
                      template)
    assert turned.shape == shape
    assert isinstance(turned, Rotated) == (shape != "circle")


def test_a_shape_is_chosen_and_one_that_does_not_fit_is_refused(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latest, "_PRELOADED", [])

    async def run() -> None:
        start = FilmView(vhb_oval(), mass=0.0179)
        page = Page(Subject("oval", (start.specimen,), Rig()), start)
        semi_axes = start.specimen.frame.semi_axes
        page.hear("shape", "frame", "stadium")
        assert page.view.specimen.frame == Stadium(semi_axes)
        assert page.view.mass == start.mass
        page.hear("typed", "frame.semi_axes.0", "70")
        page.hear("shape", "frame", "rounded_rectangle")
        assert page.view.specimen.frame.semi_axes == (70e-3, semi_axes[1])
        assert "frame.corner_radius" in page.state["texts"]
        page.hear("shape", "frame", start.specimen.frame.shape)
        assert page.view.specimen.frame.semi_axes == (70e-3, semi_axes[1])
        page.hear("shape", "frame", "nonsense")
        page.hear("shape", "nonsense", "circle")
        page.hear("typed", "plate.offset.0", "40")
        before = page.view
        page.hear("shape", "frame", "circle")
        assert page.view == before
        assert "must lie inside" in page.state["errors"]["frame"]
        page.hear("reset")
        assert page.view == start
        assert page.state["errors"] == {}
        page.close()

    asyncio.run(run())


def test_a_film_is_saved_by_name_and_folder_and_never_over_another(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latest, "_PRELOADED", [])
    monkeypatch.chdir(tmp_path)
    Path("oval.toml").write_text(specimen_toml(), encoding="utf-8")
    before = Path("oval.toml").read_bytes()
    subject = replace(read_subject(Path("oval.toml")), rig=Rig(spring=2.0))

    async def run() -> None:
        page = Page(subject, subject.view(0, 0.0179))
        page.hear("typed", "stiffness", "1.2")
        for name, folder, words in (
                ("oval", ".", "is there already"), ("../up", ".", "must serve as a file name"),
                ("new", "none", "is no folder"),
                ("new", "~nobody/x", "is no folder"), ("new", "a\0b", "is no folder"),
                ("", ".", "name")):
            page.hear("save", name, folder)
            assert page.state["written"].startswith("Not saved: ")
            assert words in page.state["written"]
        assert [file.name for file in tmp_path.iterdir()] == ["oval.toml"]
        page.hear("save", "new", str(tmp_path))
        assert page.state["written"] == f"Saved in {tmp_path}: new.toml, rig-of-new.toml"
        saved = load_specimen(Path("new.toml"))
        assert saved == replace(page.view.actuator, name="new")
        assert Path("new.toml").read_text(encoding="utf-8").startswith("# vhb-4910, its stresses")
        assert Rig.read("rig-of-new.toml") == subject.rig
        assert "new.toml" in page.state["command"]
        assert page.state["unsaved"] == ""
        page.hear("reset")
        page.hear("save", "same", ".")
        assert 'material = "vhb-4910"' in Path("same.toml").read_text(encoding="utf-8")
        page.close()

    asyncio.run(run())
    assert Path("oval.toml").read_bytes() == before
