"""Drafts for tables as laboratories have them: what is wrong is marked, refused or warned about."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tympan
from benchmarks.trials.lab_drafts import MARKED, REFUSED, RIGHT, SILENT, Judged, judged, lab_tables
from tests.support.datasets import SPECIMEN
from tests.support.specimens import specimen_toml
from tympan.base.errors import InputError
from tympan.base.units import quantity
from tympan.studies.data import doubts
from tympan.studies.data.by_numbers import guessed_by_numbers, likely_unit
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.data.draft import write_draft
from tympan.tables.cell_units import with_units_above

TABLES = lab_tables()
#: Tables that no draft and no line of dataset.toml can make readable.
MOST_REFUSED = 10
#: Tables that are read right as their drafts are.
LEAST_RIGHT = 109
#: Tables of sixty.toml that are read right as their drafts are; the others are asked about.
LEAST_RIGHT_OF_SIXTY = 53
#: Marks, on average, on a draft that is right as it is.
MOST_MARKS = 1.0


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Judged]:
    folder = tmp_path_factory.mktemp("tables")
    return {table.file: judged(table, folder / str(number))
            for number, table in enumerate(TABLES)}


def film(folder: Path, name: str = "film") -> None:
    text = SPECIMEN.format(name=name).replace("[[specimen]]\n", "").replace("[specimen.", "[")
    (folder / f"{name}.toml").write_text(text, "utf-8")


def drafted(folder: Path, text: str, name: str = "m.csv") -> str:
    """The draft of a table beside the file of one film."""
    film(folder)
    (folder / name).write_text(text, "utf-8")
    (folder / "dataset.toml").unlink(missing_ok=True)
    return tympan.draft(folder / name).read_text("utf-8")


def test_no_table_is_silently_wrong(verdicts: dict[str, Judged]) -> None:
    assert len(verdicts) == len(TABLES) >= 40
    assert {file: one.line for file, one in verdicts.items() if one.verdict == SILENT} == {}


def test_few_tables_are_refused_and_each_message_says_what_to_do(
        verdicts: dict[str, Judged]) -> None:
    counts = Counter(one.verdict for one in verdicts.values())
    assert counts["refused without advice"] == 0
    assert counts[REFUSED] <= MOST_REFUSED
    assert counts[RIGHT] >= LEAST_RIGHT


def test_each_of_the_sixty_is_read_right_or_asked_about(verdicts: dict[str, Judged]) -> None:
    counts = Counter(verdicts[table.file].verdict for table in TABLES if table.group == "sixty")
    assert counts.total() == 60
    assert {*counts} == {RIGHT, MARKED}
    assert counts[RIGHT] >= LEAST_RIGHT_OF_SIXTY


def test_drafts_that_are_right_have_few_marks(verdicts: dict[str, Judged]) -> None:
    marks = [one.marks for one in verdicts.values() if one.verdict == RIGHT]
    assert sum(marks) / len(marks) <= MOST_MARKS


@pytest.mark.parametrize("column", ["mass", "voltage", "displacement"])
def test_a_table_that_is_read_otherwise_than_meant_is_found(tmp_path: Path, column: str) -> None:
    """The judge is judged: one number is changed in what the writer means."""
    table = next(table for table in TABLES if table.file == "prova 4.csv")
    assert judged(table, tmp_path / "as meant").verdict == RIGHT
    values = [*table.meant[column][:-1], 7e-3]
    other = replace(table, meant={**table.meant, column: values})
    verdict = judged(other, tmp_path / "otherwise")
    assert verdict.verdict == SILENT
    assert verdict.why == f"wrong: {column}"


def test_a_mark_excuses_its_own_column_alone(tmp_path: Path) -> None:
    table = next(table for table in TABLES if table.file == "stroke.csv")
    assert "displacement" in judged(table, tmp_path / "a").why
    masses = [0.03] * len(table.meant["mass"])
    assert judged(replace(table, meant={**table.meant, "mass": masses}),
                  tmp_path / "b").verdict == SILENT


ROWS = "20;0;2,40\n20;2;2,55\n20;4;3,02\n"


@pytest.mark.parametrize(("headings", "mark"), [
    ("Masse (g);Spannung (kV);Weg (mm)", None),
    ("Massa (g);Tensione (kV);Spostamento (mm)", None),
    ("质量（g）;电压（kV）;位移（mm）", None),
    ("Masse oben (g);Spannung (kV) Netzteil;Plattenweg (mm)", None),
    ("Masse (g);Spannung (kV);Lehajlás (mm)", None),       # unknown words, deflections of the film
    ("Zátěž (g);Sp. (kV);Laser (mm)", None),
    ("Masse (g);HV (kV);LVDT (mm)", None),
    ("Masse (g);Trek 10/10 (kV);Keyence LK-G (mm)", None),
    ("Load cell (g);Spannung (kV);Weg (mm)", "mass_g"),
    ("Masse (g);Vmon (V);Weg (mm)", "voltage_V"),
    ("Masse (g);Spannung (V);Weg (mm)", "voltage_V"),      # 4 V at most
    ("Masse (g);Spannung (kV);Spitzenauslenkung (mm)", "displacement_mm"),
    ("Masse (g);Spannung x10 (kV);Weg (mm)", "voltage_kV"),
    ("Masse (g);Spannung (%);Weg (mm)", "voltage_kV"),
    ("Folienmasse (g);Spannung (kV);Weg (mm)", "mass_g"),
    ("Masse (lb);Spannung (kV);Weg (mm)", "mass_g"),
])
def test_words_and_units_that_leave_a_doubt_are_marked(
        tmp_path: Path, headings: str, mark: str | None) -> None:
    text = drafted(tmp_path, f"{headings}\n{ROWS}")
    marked = [line.partition(" ")[0] for line in text.splitlines() if "CORRECT THIS" in line]
    assert marked == [mark] * (mark is not None)


@pytest.mark.parametrize(("column", "mark"), [
    ("Zusatzmasse (g)", "mass_g"), ("Tara (g)", "mass_g"), ("Weg korrigiert (mm)", "displacement"),
    ("Nullwert (mm)", "displacement"), ("Istspannung (kV)", "voltage"), ("Dicke (mm)", None),
    ("Fehler (mm)", None), ("Strom (uA)", None), ("Sensor (V)", None)])
def test_a_second_column_of_the_same_kind_is_asked_about(
        tmp_path: Path, column: str, mark: str | None) -> None:
    rows = "".join(f"{line};1,5\n" for line in ROWS.splitlines())
    text = drafted(tmp_path, f"Masse (g);Spannung (kV);Weg (mm);{column}\n{rows}")
    marked = [line for line in text.splitlines() if "CORRECT THIS" in line]
    assert len(marked) == (mark is not None)
    for line in marked:
        assert line.startswith(str(mark))
        assert f"it may also be {column!r}" in line


def test_totals_and_set_voltages_leave_no_doubt(tmp_path: Path) -> None:
    text = drafted(tmp_path, "Zusatzmasse (g);Gesamtmasse (g);Istspannung (kV);Sollspannung (kV);"
                             "Weg (mm)\n10;20;0,1;0;2,40\n10;20;1,9;2;2,55\n10;20;3,9;4;3,02\n")
    assert "CORRECT THIS" not in text
    static = read_dataset(tmp_path).static
    assert static is not None
    assert static.mass.tolist() == pytest.approx([0.02] * 3)
    assert static.voltage.tolist() == [0, 2000, 4000]


@pytest.mark.parametrize(("numbers", "doubt"), [
    ((2.40, 2.55, 3.02), ""),
    ((0.0, 0.15, 0.62), "it is 0 at the lowest voltage"),
    ((12.40, 12.55, 13.02), "line 2 has 12.4 mm, where this mass pulls film down by some 2.4 mm"),
    ((-2.40, -2.55, -3.02), "the numbers fall where displacements rise"),
])
def test_deflections_that_are_not_from_the_flat_film_are_asked_about(
        tmp_path: Path, numbers: tuple[float, ...], doubt: str) -> None:
    rows = "".join(f"20,{2 * i},{number}\n" for i, number in enumerate(numbers))
    text = drafted(tmp_path, f"Mass (g),Voltage (kV),Deflection (mm)\n{rows}")
    assert ("CORRECT THIS" in text) == bool(doubt)
    assert doubt in text


def test_the_mass_of_a_line_outside_the_table_is_proposed_or_asked_about(tmp_path: Path) -> None:
    text = drafted(tmp_path, "Platte; 17,9 g\nSpannung (kV);Weg (mm)\n0;2,2\n2;2,4\n")
    assert "mass_g = { value = 17.9 }  # CORRECT THIS: no heading says it; line 1 says" in text
    text = drafted(tmp_path, f"Platte; 10 g\nZusatzmasse (g);Spannung (kV);Weg (mm)\n{ROWS}")
    assert "line 1 says 'Platte 10 g': look whether it is in the masses of this column" in text
    text = drafted(tmp_path, f"Serie mit 20 g\nZusatzmasse (g);Spannung (kV);Weg (mm)\n{ROWS}")
    assert "CORRECT THIS" not in text


def test_lines_that_sum_up_are_skipped(tmp_path: Path) -> None:
    rows = "".join(f"{number};{line}\n" for number, line in enumerate(ROWS.splitlines(), 1))
    text = drafted(tmp_path, f"Nr;Masse (g);Spannung (kV);Weg (mm)\n{rows}Mittelwert;20;2;2,66\n")
    assert "skip_lines = [5]  # lines that sum others up: Mittelwert" in text
    static = read_dataset(tmp_path).static
    assert static is not None
    assert static.line.tolist() == [2, 3, 4]


def dataset(folder: Path, head: str, **files: str) -> Dataset:
    film(folder)
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text, "utf-8")
    (folder / "dataset.toml").write_text(f'name = "d"\n{head}[[specimen]]\nfile = "film.toml"\n',
                                         "utf-8")
    return read_dataset(folder)


@pytest.mark.parametrize(("again", "refused"), [("Weg (µm)", True), ("Weg (mm)", False)])
def test_headings_that_stand_again_in_another_unit_are_refused(
        tmp_path: Path, again: str, refused: bool) -> None:
    """Even where the writer leaves out the cells that are no numbers."""
    first = "Masse (g);Spannung (kV);Weg (mm)"
    text = f"{first}\n{ROWS}{first.replace('Weg (mm)', again)}\n30;0;3640\n"
    words = ", ".join(f'"{word}"' for word in ("Masse (g)", "Spannung (kV)", again))
    head = f"[columns.static]\nmissing = [{words}]\n"
    if refused:
        with pytest.raises(InputError, match=r"line 5: given 'Weg \(µm\)': is a heading in another "
                                             "unit .*: write the readings below it"):
            dataset(tmp_path, head, static=text)
    else:
        assert dataset(tmp_path, head, static=text).static is not None


def test_a_column_of_labels_has_no_unit(tmp_path: Path) -> None:
    """A probe of high voltage is no specimen, which German calls so."""
    text = "Masse (g);Spannung (kV);Weg (mm);Probe (kV)\n20;0;2,40;0\n20;2;2,55;1,9\n"
    static = dataset(tmp_path, "", static=text).static
    assert static is not None
    assert set(static.specimen) == {"film"}


def test_sheets_that_are_not_read_are_named(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for name, value in (("Tabelle1", 2.4), ("Oval & mehr", 2.5), ("leer", None)):
        sheet = book.create_sheet(name)
        for row in (["Masse (g)", "Spannung (kV)", "Weg (mm)"], [20, 0, value]) if value else ():
            sheet.append(row)
    del book["Sheet"]
    film(tmp_path)
    book.save(tmp_path / "Messung.xlsx")
    text = tympan.draft(tmp_path / "Messung.xlsx").read_text("utf-8")
    said = "only the sheet 'Tabelle1' is read; there are also 'Oval & mehr': if these have readings"
    assert f"# CORRECT THIS: {said}" in text
    assert any(said in words for words in tympan.data(tmp_path)["warnings"])
    (tmp_path / "Messung.xlsx").rename(tmp_path / "Tabelle1.xlsx")  # its own sheet is meant
    (tmp_path / "dataset.toml").unlink()
    assert "sheet" not in tympan.draft(tmp_path / "Tabelle1.xlsx").read_text("utf-8")


def test_grams_of_force() -> None:
    assert quantity("1 gf", "force") == pytest.approx(9.80665e-3, rel=1e-12)
    assert quantity("2 kgf", "force") == pytest.approx(19.6133, rel=1e-12)


def test_readings_rise_with_the_voltage_under_each_mass_though_not_over_all() -> None:
    """Heavier masses differ by more than the voltage makes."""
    voltage = np.array([0, 3, 5] * 2, float)
    read = -np.array([1.8, 2.1, 2.5, 3.6, 4.0, 5.0])
    masses = doubts.groups_of([["15"] * 3 + ["30"] * 3], 6)
    assert doubts.rises(read, voltage, masses) is False
    assert doubts.rises(-read, voltage, masses) is True
    assert doubts.rises(read, np.zeros(6), masses) is None
    assert doubts.rises(read, voltage, doubts.groups_of([], 6)) is None


def test_a_film_stiffens_up_to_the_cube_of_its_deflection() -> None:
    mass, one = np.array([0.01, 0.08]), np.zeros(2, np.int64)
    assert not doubts.hardly_grow(np.array([1.0, 2.01]), mass, one)
    assert doubts.hardly_grow(np.array([1.0, 1.99]), mass, one)
    assert not doubts.hardly_grow(np.array([1.0, 1.0]), np.array([0.01, 0.014]), one)


def test_numbers_of_rows_are_no_names_of_films() -> None:
    states = [("20", "0"), ("20", "2"), ("30", "0")]
    assert doubts.numbers_rows(["1", "2", "3"], states)
    assert not doubts.numbers_rows(["1", "1", "2"], states)
    assert not doubts.numbers_rows(["1", "2", "3"], states[:1] * 3)  # each film in one state
    assert not doubts.numbers_rows(["A", "B", "C"], states)


def test_the_usual_deflection_is_that_of_the_solved_film(tmp_path: Path) -> None:
    film(tmp_path)
    actuator = tympan.load(tmp_path / "film.toml")
    solved = tympan.solve(actuator, mass="20 g", voltage=0).deflection_m
    usual, = doubts.usual_deflections(actuator, np.array([0.02]))
    assert usual == pytest.approx(solved, rel=0.05)


#: Tables as other programs write them, each of the same five readings.
SHAPED = {
    "units in the cells": "mass,voltage,deflection\n17.9 g,0 kV,2.10 mm\n17.9 g,1 kV,2.13 mm\n"
                          "17.9 g,2 kV,2.21 mm\n17.9 g,3 kV,2.34 mm\n17.9 g,4 kV,2.56 mm\n",
    "units in the cells, commas": "mass;voltage;deflection\n17,9 g;0 kV;2,10 mm\n"
                                  "17,9 g;1 kV;2,13 mm\n17,9 g;2 kV;2,21 mm\n17,9 g;3 kV;2,34 mm\n"
                                  "17,9 g;4 kV;2,56 mm\n",
    "double tabs": "mass_g\tvoltage_kV\tdisplacement_mm\n17.9\t\t0\t\t2.10\n17.9\t\t1\t\t2.13\n"
                   "17.9\t\t2\t\t2.21\n17.9\t\t3\t\t2.34\n17.9\t\t4\t\t2.56\n",
    "names, units, objects": "TIME;MASS;U;S\ns;g;kV;mm\n;oval;oval;oval\n0;17,9;0;2,10\n"
                             "60;17,9;1;2,13\n120;17,9;2;2,21\n180;17,9;3;2,34\n240;17,9;4;2,56\n",
    "a comment mark in a cell of its own": "#\tmass (g)\tU (kV)\tz (mm)\n17.9\t0\t2.10\n"
                                           "17.9\t1\t2.13\n17.9\t2\t2.21\n17.9\t3\t2.34\n"
                                           "17.9\t4\t2.56\n",
    "blanks, comments": "; bench 3\n; m [g] U [kV] z [mm]\n 17.9 0 2.10\n 17.9 1 2.13\n"
                        " 17.9 2 2.21\n 17.9 3 2.34\n 17.9 4 2.56\n",
    "a meter that changes its range": "mass,voltage,laser\n17.9 g,0,2.10 mm\n17.9 g,1000 V,"
                                      "2.13 mm\n17.9 g,2 kV,2.21 mm\n17.9 g,3 kV,2.34 mm\n"
                                      "17.9 g,4 kV,2.56 mm\n",
    "no headings": "17.9,0,2.10\n17.9,1,2.13\n17.9,2,2.21\n17.9,3,2.34\n17.9,4,2.56\n",
    "unknown headings": "Kanal 1;Kanal 2;Kanal 3\n17,9;0;2,10\n17,9;1;2,13\n17,9;2;2,21\n"
                        "17,9;3;2,34\n17,9;4;2,56\n",
}


@pytest.mark.parametrize("shape", [*SHAPED])
def test_a_table_of_another_shape_is_read_as_it_is(shape: str, tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    (tmp_path / "table.csv").write_text(SHAPED[shape], encoding="utf-8")
    write_draft(tmp_path / "table.csv")
    static = read_dataset(tmp_path).static
    assert static is not None
    assert static.mass == pytest.approx([17.9e-3] * 5)
    assert static.voltage == pytest.approx([0, 1e3, 2e3, 3e3, 4e3])
    assert static.displacement == pytest.approx([2.1e-3, 2.13e-3, 2.21e-3, 2.34e-3, 2.56e-3])
    assert {*static.specimen} == {"oval"}


@pytest.mark.parametrize(("cells", "kept"), [
    (["17.9 g", "18 g"], ["17.9", "18"]), (["17.9 g", "18"], ["17.9 g", "18"]),
    (["17.9 g", "0.018 kg"], ["17.9", "18"]), (["1,000 g", "2,000 g"], None),
    (["17.9 g", "0"], ["17.9", "0"]), (["17.9 g", "n/a"], ["17.9", "n/a"]),
    (["17.9 g", "18 mm"], ["17.9 g", "18 mm"]),
    (["17.9 cows", "18 cows"], None), (["17,9 g", ""], ["17.9", ""])])
def test_only_a_unit_of_a_whole_column_moves_into_its_heading(cells: list[str],
                                                              kept: list[str] | None) -> None:
    rows = [(1, ["mass", "voltage"]), *((2 + number, [cell, "1 kV"])
                                        for number, cell in enumerate(cells))]
    (_, titles), *below = with_units_above(rows)
    assert [row[0] for _, row in below] == (kept or cells)
    moved = kept is not None and kept != cells
    assert titles == ["mass (g)" if moved else "mass", "voltage (kV)"]


def test_a_unit_that_contradicts_the_heading_is_left_and_refused() -> None:
    rows = [(1, ["mass (g)", "U"]), (2, ["1 kg", "1 kV"])]
    assert list(with_units_above(rows)) == [(1, ["mass (g)", "U (kV)"]), (2, ["1 kg", "1"])]


def test_a_table_without_known_headings_has_a_marked_line_for_each_column(tmp_path: Path) -> None:
    rows = "20;0;2,40\n20;2;2,55\n30;0;3,64\n"
    lines = drafted(tmp_path, f"Kanal 1;Kanal 2;Kanal 3\n{rows}").splitlines()
    marked = [line.partition("  # CORRECT THIS: ")[0] for line in lines if "CORRECT THIS" in line]
    assert marked[1:] == ['mass_g = "Kanal 1"', 'voltage_kV = "Kanal 2"',
                          'displacement_mm = { from = "Kanal 3", sign = "down" }']
    assert "no heading of the table is known: taken as states of a plate at rest" in marked[0]
    text = drafted(tmp_path, rows)
    assert 'titles_line = 0  # no line has headings: the columns are called "1" to "3"' in text
    assert 'displacement_mm = { from = "3", sign = "down" }  # CORRECT THIS' in text


@pytest.mark.parametrize("above", [
    "# U in kV, s in mm, m in g", "Spalten: U in kV; s in mm; m in g",
    "1: U (kV)\n2: s (mm)\n3: m (g)"])
def test_lines_above_say_what_columns_without_headings_are(tmp_path: Path, above: str) -> None:
    text = drafted(tmp_path, f"{above}\n0\t2,40\t20\n2\t2,55\t20\n0\t3,64\t30\n")
    for line in ('mass_g = "3"', 'voltage_kV = "1"', 'displacement_mm = { from = "2"'):
        assert line in text


def test_two_columns_of_one_dimension_are_asked_about_by_name(tmp_path: Path) -> None:
    text = drafted(tmp_path, "Masse (g);HV (kV);Links (mm);Rechts (µm)\n20;0;2,40;2410\n"
                             "20;2;2,55;2570\n")
    assert ('displacement_mm = { value = "?" }  # CORRECT THIS: several columns have a length; '
            'write displacement_mm = "Links (mm)" or displacement_um = "Rechts (µm)"\n') in text


@pytest.mark.parametrize(("line", "read"), [
    ('{ from = "LVDT (V)", scale = 0.5 }', 2.4),
    ('{ from = "LVDT (V)", scale = 0.5, zero = 5 }', -0.1),
    ('{ from = "Abstand (mm)", sign = "up", zero = 50 }', 2.4)])
def test_a_scale_and_a_zero_make_readings_of_sensors(tmp_path: Path, line: str, read: float
                                                     ) -> None:
    text = "Masse (g);HV (kV);LVDT (V);Abstand (mm)\n20;0;4,8;47,6\n"
    head = f"[columns.static]\ndisplacement_mm = {line}\n"
    static = dataset(tmp_path, head, static=text).static
    assert static is not None
    assert static.displacement.tolist() == pytest.approx([1e-3 * read])


@pytest.mark.parametrize(("line", "fault"), [
    ('displacement_mm = { from = "2", scale = -1 }', "must be positive"),
    ("titles_line = 0", "no line has two numbers"), ("titles_line = -1", "must be the number")])
def test_a_wrong_scale_or_line_of_headings_is_refused(tmp_path: Path, line: str, fault: str
                                                      ) -> None:
    text = "a;b\nc;d\n" if line.endswith(" 0") else ROWS
    with pytest.raises(InputError, match=fault):
        dataset(tmp_path, f"[columns.static]\n{line}\n", static=text)


def test_columns_are_guessed_by_their_numbers() -> None:
    states = ("mass", "voltage", "displacement")
    table = {0: np.array([1.0, 2, 3, 4]), 1: np.array([20.0, 20, 20, 30]),
             2: np.array([0.0, 2, 4, 0]), 3: np.array([2.40, 2.55, 3.02, 3.64])}
    assert guessed_by_numbers(states, table) == {"mass": 1, "voltage": 2, "displacement": 3}
    two = {0: table[2], 1: table[3]}
    assert guessed_by_numbers(states, two) == {"voltage": 0, "displacement": 1}
    assert [likely_unit("voltage", 1e3 * table[2]), likely_unit("displacement", table[3]),
            likely_unit("mass", 1e-3 * table[1]), likely_unit("t", table[0])] == [
                "V", "mm", "kg", ""]
