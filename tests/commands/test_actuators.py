"""An actuator is one file: every question reads its rig there, and another one replaces it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tympan
from benchmarks.compose.answering import OUTPUT
from benchmarks.compose.ask import ask
from benchmarks.compose.concepts import Asked, Combination, concepts
from benchmarks.compose.questions import Question, questions
from tests.support.costs import dear
from tests.support.specimens import specimen_toml
from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.cli import main
from tympan.explore.subject import read_subject
from tympan.fem.rig import Actuator, Rig, load_actuator, mounted, mounted_together
from tympan.fem.toml_writer import specimen_to_toml, toml
from tympan.reports.comparison import OF_THE_RUN
from tympan.studies.data.dataset import read_dataset
from tympan.studies.study import read_study
from tympan.studies.tolerance.given import Tolerances, asked_bounds

RIG = '[rig]\ngravity = "1.62 m/s^2"\nspring = "8 N/m"\n'
STATED = Rig(gravity=1.62, spring=8.0)
#: Seconds of questions that cost a few.
DEAR = {"design": 13, "lumped build": 5, "lumped control": 11, "lumped linearise": 4,
        "lumped simulate": 4, "path in time": 10, "sense": 5, "sweep": 14, "swing": 8,
        "tolerance": 9}


def written(folder: Path, rig: str = RIG, name: str = "oval") -> Path:
    file = folder / f"{name}.toml"
    file.write_text(specimen_toml(name) + rig, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Asked, Asked]:
    """The same actuator as two files and as one."""
    folder = tmp_path_factory.mktemp("actuators")
    spring = next(each for each in concepts() if each.name == "bias spring")
    two = Combination((spring,)).write(folder)
    one = folder / "one" / two.film.name
    one.parent.mkdir()
    one.write_text(toml({**two.combination.content("film"),
                         "rig": two.combination.content("rig")}), encoding="utf-8")
    return two, replace(two, film=one, rig=None)


def answered(question: Question, asked: Asked, folder: Path) -> Any:
    row = ask(question, asked, folder)
    assert row is not None
    assert row.status == 0, row.said
    text = (folder / OUTPUT).read_text("utf-8")
    try:
        return _lasting(json.loads(text))
    except json.JSONDecodeError:
        return text


def _lasting(record: Any) -> Any:
    if isinstance(record, dict):
        return {key: _lasting(value) for key, value in record.items() if key not in OF_THE_RUN}
    return [_lasting(item) for item in record] if isinstance(record, list) else record


@pytest.mark.parametrize("question", [
    dear(each, seconds=DEAR[each.name], name=each.name) if each.name in DEAR
    else pytest.param(each, id=each.name)
    for each in questions() if not each.name.startswith("best ")])
def test_one_file_is_answered_as_two(question: Question, pair: tuple[Asked, Asked],
                                     tmp_path: Path) -> None:
    two, one = (answered(question, asked, tmp_path / name)
                for asked, name in zip(pair, ("two", "one"), strict=True))
    assert one == two


def test_a_rig_that_is_given_replaces_that_of_the_file(tmp_path: Path,
                                                       capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path)
    other = tmp_path / "rig.toml"
    other.write_text('spring = "30 N/m"\n', encoding="utf-8")

    def deflection(*words: str) -> float:
        main(["solve", str(file), "--mass", "17.9 g", "--json", *words])
        return float(json.loads(capsys.readouterr().out)["deflection_m"])

    bare = load_actuator(file).bare  # type: ignore[attr-defined]
    assert deflection() == tympan.solve(bare, mass="17.9 g", rig=STATED).deflection_m
    assert deflection("--rig", str(other)) == tympan.solve(
        bare, mass="17.9 g", rig={"spring": "30 N/m"}).deflection_m
    assert tympan.solve(file, mass="17.9 g", rig={}).deflection_m == tympan.solve(
        bare, mass="17.9 g").deflection_m != deflection()


def test_python_loads_makes_and_writes_actuators(tmp_path: Path) -> None:
    film = tympan.load(written(tmp_path))
    assert isinstance(film, tympan.Actuator)
    assert film.rig == STATED
    again = tmp_path / "again.toml"
    again.write_text(specimen_to_toml(film), encoding="utf-8")
    assert tympan.load(again) == film
    assert tympan.load(written(tmp_path, "", "bare")) == replace(film.bare, name="bare")
    made = tympan.Actuator(film.name, film.frame, film.plate, film.membrane, rig=STATED)
    assert made == film
    assert tympan.Case(film, mass="10 g") == tympan.Case(film.bare, mass="10 g", rig=STATED)
    assert tympan.Case(film, rig=Rig()).rig == Rig()
    assert replace(tympan.Case(film), mass=0.01).rig == STATED
    disc = {"shape": "circle", "radius": "1 cm"}
    tables = {"name": "oval", "rig": {"spring": "8 N/m"}, "plate": disc,
              "frame": disc | {"radius": "45 mm"},
              "membrane": {"thickness": "1 mm", "prestretch": 2.2, "material": "vhb-4910"}}
    assert tympan.solve(tables, mass="10 g").deflection_m == tympan.solve(
        {key: part for key, part in tables.items() if key != "rig"}, mass="10 g",
        rig=Rig(spring=8.0)).deflection_m


def test_specimens_together_have_one_rig(tmp_path: Path) -> None:
    films = [tympan.load(written(tmp_path, RIG, name)) for name in ("a", "b")]
    odd = tympan.load(written(tmp_path, '[rig]\nspring = "9 N/m"\n', "odd"))
    bare, rig = mounted_together(films)
    assert rig == STATED
    assert not any(isinstance(film, Actuator) for film in bare)
    assert mounted_together([*films, odd], Rig())[1] == Rig()
    with pytest.raises(InputError, match="those of a and odd"):
        mounted_together([*films, odd])
    assert mounted(odd) == (odd.bare, Rig(spring=9.0))  # type: ignore[attr-defined]


@pytest.mark.parametrize(("read", "plan"), [
    (read_study, 'specimens = ["a.toml", "b.toml"]\nmass = "10 g"\n'),
    (lambda file: tympan.Requirements.read(file),
     'specimen = ["a.toml", "b.toml"]\nmass = "10 g"\nvoltage = "2 kV"\n[want]\n'
     'stroke = "largest"\n[vary]\n"membrane.thickness" = ["0.8 mm", "1.2 mm"]\n'),
    (lambda file: read_dataset(file.parent),
     'name = "bench"\nsource = "made up"\n[[specimen]]\nfile = "a.toml"\n[[specimen]]\n'
     'file = "b.toml"\n'),
], ids=["study", "design", "dataset"])
def test_plans_take_the_rig_of_their_specimens(read: Callable[[Path], Any], plan: str,
                                               tmp_path: Path) -> None:
    for name in ("a", "b"):
        written(tmp_path, RIG, name)
    (tmp_path / "static.csv").write_text(
        "specimen,mass_g,voltage_kV,displacement_mm\na,10,0,1.0\n", encoding="utf-8")
    file = tmp_path / "dataset.toml"
    file.write_text(plan, encoding="utf-8")
    found = read(file)
    assert found.rig == STATED
    assert not any(isinstance(film, Actuator) for film in found.specimens)
    file.write_text(f'rig = "rig.toml"\n{plan}', encoding="utf-8")
    (tmp_path / "rig.toml").write_text('spring = "3 N/m"\n', encoding="utf-8")
    assert read(file).rig == Rig(spring=3.0)
    written(tmp_path, '[rig]\nspring = "9 N/m"\n', "b")
    file.write_text(plan, encoding="utf-8")
    with pytest.raises(InputError, match="must be one for all these specimens") as raised:
        read(file)
    assert raised.value.file == file


def test_each_actuator_of_a_sweep_has_its_own_rig(tmp_path: Path) -> None:
    soft, stiff = '[rig]\nspring = "2 N/m"\n', '[rig]\nspring = "40 N/m"\n'
    for name, rig in (("soft", soft), ("stiff", stiff)):
        written(tmp_path, rig, name)
    plan = tmp_path / "SWEEP.toml"
    text = 'specimen = ["soft.toml", "stiff.toml"]\nmass = "10 g"\nvoltage = ["0 kV", "1 kV"]\n'
    plan.write_text(text, encoding="utf-8")
    table = tympan.sweep(plan).to_pandas()
    for name in ("soft", "stiff"):
        alone = tympan.solve(tmp_path / f"{name}.toml", mass="10 g").deflection_m
        rows = table[(table["specimen"] == name) & (table["voltage_V"] == 0)]
        assert rows["deflection_m"].item() == pytest.approx(alone, rel=1e-6)
    plan.write_text(f'{text}[grid]\n"rig.spring" = ["5 N/m"]\n', encoding="utf-8")
    table = tympan.sweep(plan).to_pandas()
    assert np.ptp(table[table["voltage_V"] == 0]["deflection_m"]) < 1e-9


def test_a_specimen_stands_in_a_plan_as_file_name_or_tables(tmp_path: Path) -> None:
    film = written(tmp_path)
    shared = 'mass = "10 g"\nvoltage = ["0 kV"]\n'
    inner = film.read_text("utf-8").replace("[rig]", "[specimen.rig]").replace(
        "[frame]", "[specimen.frame]").replace("[plate]", "[specimen.plate]").replace(
        "[membrane]", "[specimen.membrane]")
    named, within, paper = (tmp_path / f"{name}.toml" for name in ("named", "within", "paper"))
    named.write_text(f'specimen = "oval.toml"\n{shared}', encoding="utf-8")
    within.write_text(f"{shared}[specimen]\n{inner}", encoding="utf-8")
    paper.write_text(f'specimen = "circular"\n{shared}', encoding="utf-8")
    one, same, circle = (tympan.sweep(file).to_pandas() for file in (named, within, paper))
    assert one["deflection_m"].tolist() == same["deflection_m"].tolist()
    assert same["specimen"].tolist() == ["oval"]
    assert circle["specimen"].tolist() == ["circular"]


def test_the_explorer_reads_the_rig_of_its_file(tmp_path: Path) -> None:
    file = written(tmp_path)
    assert read_subject(file).rig == STATED
    assert read_subject(tmp_path).rig == STATED
    (tmp_path / "rig.toml").write_text("", encoding="utf-8")
    assert read_subject(tmp_path).rig == Rig()
    assert read_subject(file, tmp_path / "rig.toml").rig == Rig()


def test_a_joined_film_has_no_rig_of_its_own(tmp_path: Path) -> None:
    written(tmp_path, RIG, "upper")
    film = written(tmp_path, '[[rig.bias]]\nlaw = "film"\nspecimen = "upper.toml"\n'
                             'rod = "30 mm"\ndistance = "25 mm"\n')
    with pytest.raises(InputError, match="what acts on a joined film is the rig that joins it"
                       ) as raised:
        tympan.load(film)
    assert Path(str(raised.value.file)).name == "upper.toml"


def test_a_wrong_key_of_the_rig_names_its_place(tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, '[rig]\nsprings = "8 N/m"\n')
    assert main(["solve", str(file), "--mass", "1 g"]) == 2
    said = capsys.readouterr().err
    assert "oval.toml: rig.springs" in said
    assert "spring" in said


def test_a_material_is_a_name_a_table_or_a_file(tmp_path: Path) -> None:
    fitted = tmp_path / "fit" / "material.toml"
    fitted.parent.mkdir()
    law = '[membrane.material]\nlaw = "ogden"\nmu = ["15 kPa"]\nalpha = [2]\nrange = [0.5, 3.0]\n'
    branch = '[[membrane.branch]]\nmodulus = "30 kPa"\ntime = "10 s"\n'
    fitted.write_text(law + branch, encoding="utf-8")
    of_table = tmp_path / "table.toml"
    of_table.write_text(specimen_toml("film", film=law + branch), encoding="utf-8")
    of_file = tmp_path / "film.toml"
    of_file.write_text(specimen_toml("film", film='material = "fit/material.toml"'),
                       encoding="utf-8")
    assert tympan.load(of_file) == tympan.load(of_table)
    other = tmp_path / "other.toml"
    other.write_text(specimen_toml("film", film='material = "film.toml"'), encoding="utf-8")
    assert tympan.load(other) == tympan.load(of_table)
    made = tympan.Film("1 mm", 2.236, tympan.material(str(fitted)), relative_permittivity=4.7)
    assert made == tympan.load(of_table).membrane
    fitted.write_text(law + "thicknes = 1\n", encoding="utf-8")
    with pytest.raises(InputError, match="thicknes") as raised:
        tympan.load(of_file)
    assert raised.value.file == fitted


def test_tolerances_are_a_file_or_tables(tmp_path: Path) -> None:
    film, file = written(tmp_path), tmp_path / "TOLERANCES.toml"
    file.write_text('[want]\nstroke = "1 um"\n[thickness]\nfilm = 0.03\n', encoding="utf-8")
    given = {"want": {"stroke": "1 um"}, "thickness": {"film": 0.03}}
    assert Tolerances.read(file) == Tolerances.from_table(Table("given", given))
    assert asked_bounds(file) == asked_bounds(given) != ()
    assert tympan.solve(film, mass="10 g", tolerances=given).bands["deflection_m"]
    plan = tmp_path / "SWEEP.toml"
    plan.write_text('specimen = "oval.toml"\nmass = "10 g"\nvoltage = ["0 kV"]\n'
                    'tolerances = "TOLERANCES.toml"\n', encoding="utf-8")
    assert "deflection_low_m" in tympan.sweep(plan).to_pandas()
