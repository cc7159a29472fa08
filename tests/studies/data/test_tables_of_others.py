"""Tables as testers and laboratories write them: other headings, preambles, units, marks."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

import tympan
from benchmarks.trials.tables import followed, made, wrong
from tests.support.datasets import SPECIMEN, write_dataset
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.studies.columns import Sheet
from tympan.studies.data.coupon import Coupons, coupon_layout, read_coupons
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.data.draft import write_draft
from tympan.studies.signals import read_signal
from tympan.tables.layouts import Layout

STRETCH_STRESS = "Stretch,Stress\n1.1,0.030\n1.5,0.110\n2.0,0.180\n2.5,0.240\n3.0,0.310\n"
INSTRON = """Specimen Thickness (mm);3;;
Specimen Width (mm);6;;
Speed (mm/min);450;;
;;;
Time (s);Engineering Strain;Engineering Stress (MPa);
0,5;0,10;0,030;
2,5;0,50;0,110;
5,0;1,00;0,180;
7,5;1,50;0,240;
10,0;2,00;0,310;
"""
MACHINE = "Time (s),Displacement (mm),Force (N)\n0.5,4,0.3\n1.0,8,0.5\n"
ZWICK = """Prüfprotokoll Nr. 12, Labor 3
Prüfer;Müller
Vorkraft;0,1;N

Prüfzeit;Standardweg;Standardkraft
s;mm;N
0,5;4;0,3
1,0;8;0,5
"""
THOUSANDS = """specimen;mass_g;voltage_V;displacement_mm
circle;17,9;0;2,1000
circle;17,9;500;2,1100
circle;17,9;750;2,1225
circle;17,9;1.000;2,1400
circle;17,9;2.000;2,2600
"""
SEP = """sep=;
specimen;mass_g;voltage_kV;displacement_mm
circle;17,9;0;2,1000
circle;17,9;1;2,1400
circle;17,9;2;2,2600
"""
GERMAN = """Membranversuch vom 3.4.2024, Raum 12
Bediener;Jäger

Spannung [kV];Höhe / µm;Masse (g);Bemerkung
0,0;-2250;17,9;neu
1,0;-2300;17,9;
3,5;-2750;17,9;knistert
4,0;---;17,9;ausgefallen
"""
OF_GERMAN = '''[columns.static]
missing = ["---"]
displacement_um = { from = "Höhe / µm", sign = "up" }
'''
FRENCH = "Tension (V);Déplacement (mm);Masse (g)\n0;2,25;17,9\n3500;2,75;17,9\n"


def dataset(folder: Path, head: str = "", **files: str | bytes) -> Dataset:
    return read_dataset(write_dataset(folder, 'name = "d"\n' + head, ("circle",), **files))


def static(*given: object, **files: str | bytes) -> Sheet:
    sheet = dataset(*given, **files).static  # type: ignore[arg-type]
    assert sheet is not None
    return sheet


def coupons(folder: Path, text: str | bytes, layout: Layout = Layout(), name: str = "a.csv"
            ) -> Coupons:
    (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
    return read_coupons(folder / name, layout=layout)


def test_headings_of_a_plain_table_with_the_unit_beside(tmp_path: Path) -> None:
    read = coupons(tmp_path, STRETCH_STRESS, coupon_layout(unit="MPa"), "a_uniaxial.csv")
    assert read.stretch.tolist() == [1.1, 1.5, 2.0, 2.5, 3.0]
    assert read.stress.tolist() == pytest.approx([30e3, 110e3, 180e3, 240e3, 310e3])
    assert set(read.mode) == {"uniaxial"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_a_tester_with_a_preamble_strains_and_megapascals(tmp_path: Path, encoding: str) -> None:
    text = INSTRON.replace("Engineering Strain", "Dehnung, technische")
    for words in (INSTRON, text.replace("Engineering Stress", "Zugspannung")):
        read = coupons(tmp_path, words.encode(encoding), coupon_layout("pure_shear"))
        assert read.stretch.tolist() == [1.1, 1.5, 2.0, 2.5, 3.0]
        assert read.stress.tolist() == pytest.approx([30e3, 110e3, 180e3, 240e3, 310e3])
        assert read.time.tolist() == [0.5, 2.5, 5, 7.5, 10]
        assert set(read.mode) == {"pure_shear"}
        assert "headings in line 5" in read.remarks[0]


@pytest.mark.parametrize("text", [MACHINE, ZWICK], ids=["English", "German with a line of units"])
def test_forces_and_displacements_need_the_size_of_the_strip(tmp_path: Path, text: str) -> None:
    read = coupons(tmp_path, text, coupon_layout("uniaxial", area="18 mm^2", length="30 mm"))
    assert read.stretch.tolist() == pytest.approx([1 + 4 / 30, 1 + 8 / 30])
    assert read.stress.tolist() == pytest.approx([0.3 / 18e-6, 0.5 / 18e-6])


def test_the_advice_of_each_message_leads_to_the_end(tmp_path: Path,
                                                     capsys: pytest.CaptureFixture[str]) -> None:
    """Whoever writes what each message asks for gets there."""
    file = tmp_path / "c.csv"
    file.write_text(MACHINE + "1.5,11,0.6\n2.0,14,0.7\n", "utf-8")
    command = ["material", "fit", str(file), "--law", "neo_hooke", "--json"]
    for option, value in (("--length", "30 mm"), ("--area", "18 mm^2"), ("--mode", "uniaxial")):
        assert main(command) == 2
        advice = capsys.readouterr().err.rpartition("give ")[2].strip()
        assert advice == (f'{option} "{value}"' if " " in value else f"{option} {value}")
        command += [option, value]
    assert main(command) == 0
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert any("stretch is 'Displacement (mm)'" in words for words in warnings)
    fitted = tympan.fit_material(file, law="neo_hooke", mode="uniaxial", area="18 mm^2",
                                 length="30 mm")
    assert fitted.coupons.stress[0] == pytest.approx(0.3 / 18e-6)


def test_true_stresses_are_no_nominal_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nominal_stress_kPa is missing"):
        coupons(tmp_path, STRETCH_STRESS.replace("Stress", "True Stress (MPa)"),
                coupon_layout("uniaxial"))


def test_two_decimal_marks_are_refused_until_the_mark_is_stated(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        static(tmp_path / "a", static=THOUSANDS)
    assert ("static.csv: line 5, column 3 (voltage_V): given '1.000': can be read as 1000 (with a "
            "thousands separator) or as 1") in str(error.value)
    advice = 'below a line [columns.static]: decimal = ","'
    assert str(error.value).endswith(advice)
    sheet = static(tmp_path / "b", '[columns.static]\ndecimal = ","\n', static=THOUSANDS)
    assert sheet.voltage.tolist() == [0, 500, 750, 1000, 2000]
    assert sheet.displacement[0] == pytest.approx(2.1e-3)


def test_excels_first_line(tmp_path: Path) -> None:
    sheet = static(tmp_path / "a", static=SEP)
    assert sheet.voltage.tolist() == [0, 1000, 2000]
    assert sheet.line.tolist() == [3, 4, 5]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1", "cp1252"])
def test_a_german_table_with_two_lines_written(tmp_path: Path, encoding: str) -> None:
    sheet = static(tmp_path / "a", OF_GERMAN, static=GERMAN.encode(encoding))
    assert sheet.displacement.tolist() == pytest.approx([2.25e-3, 2.3e-3, 2.75e-3])
    assert sheet.voltage.tolist() == [0, 1000, 3500]
    assert sheet.mass.tolist() == pytest.approx([17.9e-3] * 3)
    assert set(sheet.specimen) == {"circle"}
    assert sheet.line.tolist() == [5, 6, 7]
    assert "not read: 'Bemerkung'" in sheet.remarks[0]


def test_a_french_table_as_it_is(tmp_path: Path) -> None:
    sheet = static(tmp_path / "a", static=FRENCH)
    assert sheet.voltage.tolist() == [0, 3500]
    assert sheet.displacement.tolist() == pytest.approx([2.25e-3, 2.75e-3])


def test_a_signal_of_a_recorder(tmp_path: Path) -> None:
    file = tmp_path / "signal.csv"
    file.write_bytes("Kanal 1\nZeit (ms);Spannung (V)\n0;0\n500;1500,5\n".encode("utf-16"))
    signal = read_signal(file)
    assert (signal.end, signal.voltage.tolist()) == (0.5, [0, 1500.5])


def test_forces_and_runs_in_time_of_testers(tmp_path: Path) -> None:
    forces = "Zeit [s]\tWeg [mm]\tKraft [N]\n0\t0,5\t0,1\n1\t1,0\t0,2\n"
    runs = "Temps (s);Tension (kV);Flèche (mm)\n0;0;2,25\n1;3;2,5\n"
    both = dataset(tmp_path / "a", "[columns.force]\nvoltage_kV = { value = 3 }\n"
                   "[columns.transient]\nmass_g = { value = 17.9 }\n", force=forces, transient=runs)
    assert both.forces is not None
    assert both.forces.force.tolist() == [0.1, 0.2]
    assert both.forces.voltage.tolist() == [3000, 3000]
    assert both.transients is not None
    assert both.transients.mass.tolist() == pytest.approx([17.9e-3] * 2)
    assert both.transients.t.tolist() == [0, 1]
    assert set(both.transients.run) == {"1"}


def test_a_file_of_any_name_with_lines_left_out(tmp_path: Path) -> None:
    text = GERMAN.replace("---", "2800") + "Mittelwert;2500;;\n"
    folder = write_dataset(tmp_path / "a", 'name = "d"\n[columns.static]\nfile = "Messung 3.txt"\n'
                           'titles_line = 4\nskip_lines = [9]\nignore = ["Bemerkung"]\n'
                           'displacement_um = "Höhe / µm"\n', ("circle",))
    (folder / "Messung 3.txt").write_text(text, "cp1252")
    sheet = read_dataset(folder).static
    assert sheet is not None
    assert len(sheet) == 4


@pytest.mark.parametrize(("head", "text", "message"), [
    ("", GERMAN, "static.csv: line 4: given 'Spannung [kV], Höhe / µm, Masse (g), Bemerkung': the "
                 "column displacement_mm is missing: write into dataset.toml, below a line "
                 "[columns.static]: displacement_mm = \"Höhe / µm\" or"),
    (OF_GERMAN.replace('missing = ["---"]\n', ""), GERMAN,
     "static.csv: line 8, column 2 (Höhe / µm): given '---': must be a number; write into "
     "dataset.toml, below a line [columns.static]: missing = [\"---\"] or "
     "skip_lines = [8]"),
    (OF_GERMAN.replace("Höhe /", "Hohe /"), GERMAN,
     "line 4: given 'Hohe / µm': has no line with this heading: did you mean 'Höhe / µm'?"),
    (OF_GERMAN.replace("_um", "_mm"), GERMAN,
     "columns.static: given 'Höhe / µm': has the unit um, which is not that of displacement_mm"),
    (OF_GERMAN.replace("displacement", "deflexion"), GERMAN, "unknown column: known are specimen"),
    ('[columns.static]\ndisplacement_mm = { sign = "up" }\n', GERMAN,
     "dataset.toml: columns.static.displacement_mm: given {'sign': 'up'}: must say where"),
    ("[columns.static]\nmass_g = { value = -3 }\n", FRENCH.replace("Masse (g)", "x"),
     "columns.static.mass_g: given '-3': must be from 0 to 100 kg"),
    ('[columns.statics]\nfile = "a"\n', FRENCH, "columns.statics: unknown key: did you mean"),
    ('[columns.force]\nfile = "a.csv"\n', FRENCH, "a.csv: cannot be read"),
    ("[columns.force]\nunit = \"N\"\n", FRENCH, "columns.force: there is no force.csv"),
    ("[columns.static]\ntitles_line = 40\n", FRENCH, "must be a line of the file"),
    ("", FRENCH.replace("Masse (g)", "Weg (mm)"),
     "given 'displacement_mm': can be 'Déplacement (mm)' or 'Weg (mm)': write into dataset.toml"),
    ("", FRENCH.replace("Tension (V)", "Tension"), "'Tension' has no unit; write into dataset.toml"
     ", below a line [columns.static]: voltage_kV = \"Tension\""),
])
def test_messages_have_the_line_what_was_expected_and_what_to_write(
        tmp_path: Path, head: str, text: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        static(tmp_path / "a", head, static=text)
    assert message in str(error.value)
    assert len(str(error.value)) < 600


def test_made_tables_are_read_right_after_what_their_messages_ask_for(tmp_path: Path) -> None:
    """Every maker's features by seed; each table needs at most five lines."""
    for seed in range(1, 31):
        table = made(seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        read, written = followed(folder, table)
        assert list(wrong(read, table)) == [], (seed, table.features, written)
        assert len(written) <= 5


ZUG = """Kraftmessung Aktor 7
Bediener;Jäger

Spannung [kV];Weg [mm];Bemerkung
{rows}7,0;---;ausgefallen
"""


@pytest.mark.study(seconds=12)
def test_a_german_table_of_ones_own_becomes_a_verdict_by_one_edit(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Heights fall as the voltage rises, and the mass stands nowhere: the draft asks for that."""
    film = SPECIMEN.format(name="oval").replace("[[specimen]]\n", "").replace("[specimen.", "[")
    (tmp_path / "oval.toml").write_text(film, "utf-8")
    oval = tympan.load(tmp_path / "oval.toml")
    rows = ""
    for number, voltage in enumerate((0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 1.0, 2.0, 3.0, 4.0)):
        deflection = tympan.solve(oval, mass="17.9 g", voltage=f"{voltage} kV").deflection_m
        height = -1e3 * deflection + (-1) ** number * 0.002 * (1 + number % 3)
        rows += f"{voltage:.1f};{height:.4f};\n".replace(".", ",")
    (tmp_path / "Messung 7.csv").write_bytes(ZUG.format(rows=rows).encode("cp1252"))
    assert main(["data", "--draft", str(tmp_path / "Messung 7.csv")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "dataset.toml")
    text = (tmp_path / "dataset.toml").read_text("utf-8")
    assert [line.partition(" ")[0] for line in text.splitlines() if "CORRECT THIS" in line] == [
        "mass_g", "displacement_mm"]
    assert 'sign = "up"' in text
    assert 'file = "oval.toml"' in text
    assert main(["data", str(tmp_path)]) == 2  # until it is corrected
    assert "columns.static.mass_g: given '?': must be a number" in capsys.readouterr().err
    (tmp_path / "dataset.toml").write_text(text.replace('"?"', "17.9"), "utf-8")
    verdict = tympan.diagnose(tmp_path)
    assert verdict.verdict == "nothing"


MERGED = """Probe;Masse (g);Spannung (kV);Weg (mm);Bemerkung
rund;20,0;0,0;2,14;
;;1,0;2,18;
;;2,0;;verloren
;30,0;0,0;3,14;
;;1,0;3,18;
;;2,0;3,24;
oval;20,0;0,0;1,14;
;;1,0;1,18;
;;2,0;1,24;
"""


def merged(folder: Path) -> str:
    """The draft of a table with merged cells beside the files of two specimens."""
    for name in ("oval", "rund"):
        film = SPECIMEN.format(name=name).replace("[[specimen]]\n", "").replace("[specimen.", "[")
        (folder / f"film {name}.toml").write_text(film, "utf-8")
    (folder / "Messung 8.csv").write_text(MERGED, "utf-8")
    return tympan.draft(folder / "Messung 8.csv").read_text("utf-8")


def test_a_draft_fills_merged_cells_and_names_the_specimens_of_the_table(tmp_path: Path) -> None:
    text = merged(tmp_path)
    assert 'fill = ["Probe", "Masse (g)"]' in text
    assert "CORRECT THIS" not in text
    assert text.index("film rund.toml") < text.index("film oval.toml")  # as in the table
    sheet = read_dataset(tmp_path).static
    assert sheet is not None
    assert sheet.specimen.tolist() == ["rund"] * 5 + ["oval"] * 3
    assert (1e3 * sheet.mass).tolist() == pytest.approx([20] * 2 + [30] * 3 + [20] * 3)
    assert sheet.line.tolist() == [2, 3, 5, 6, 7, 8, 9, 10]
    assert sheet.displacement.tolist() == pytest.approx(
        [2.14e-3, 2.18e-3, 3.14e-3, 3.18e-3, 3.24e-3, 1.14e-3, 1.18e-3, 1.24e-3])


def test_a_line_to_skip_still_begins_its_block(tmp_path: Path) -> None:
    text = merged(tmp_path).replace("fill =", "skip_lines = [8]\nfill =")
    (tmp_path / "dataset.toml").write_text(text, "utf-8")
    sheet = read_dataset(tmp_path).static
    assert sheet is not None
    assert sheet.specimen.tolist() == ["rund"] * 5 + ["oval"] * 2


def test_rows_that_blank_cells_leave_out_are_told_with_what_to_write(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "".join(line for line in merged(tmp_path).splitlines(True)
                   if not line.startswith("fill"))
    (tmp_path / "dataset.toml").write_text(text, "utf-8")
    assert main(["data", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "Messung 8.csv  2 readings, SHA-256" in told
    assert ("7 of 9 lines are left out because needed cells are blank: 'Probe' in lines 3 to 7, 9 "
            "to 10; 'Masse (g)' in lines 3 to 4, 6 to 7, 9 to 10; 'Weg (mm)' in line 4; if the "
            "value above holds there, write into dataset.toml, below a line [columns.static]: fill "
            '= ["Probe", "Masse (g)"]') in told
    (tmp_path / "dataset.toml").write_text(text.replace('missing = [""]', ""), "utf-8")
    with pytest.raises(InputError, match=r"holds, fill = ..Probe"):
        read_dataset(tmp_path)
    (tmp_path / "dataset.toml").write_text(
        text.replace("missing", 'fill = ["Prove"]\nmissing'), "utf-8")
    with pytest.raises(InputError, match="'Prove': has no line with this heading: did you mean"):
        read_dataset(tmp_path)


@pytest.mark.parametrize(("names", "entries"), [
    (("oval", "rund"), ['"a.toml"  # its name stands in the table',
                        '"b.toml"  # its name stands in the table']),
    (("oval",), ['"a.toml"  # its name stands in the table',
                 '"rund.toml"  # CORRECT THIS: no file of a specimen \'rund\' stands here']),
    (("x",), ['"a.toml"  # the only specimen in its folder']),
    (("x", "y"), ['"a.toml"  # CORRECT THIS: there are also b.toml']),
    ((), ['"specimen.toml"  # CORRECT THIS: no file of a specimen stands here; the name of yours']),
])
def test_a_draft_says_which_specimens_stand_where(tmp_path: Path, names: tuple[str, ...],
                                                  entries: list[str]) -> None:
    for file, name in zip("ab", names, strict=False):
        film = SPECIMEN.format(name=name).replace("[[specimen]]\n", "").replace("[specimen.", "[")
        (tmp_path / f"{file}.toml").write_text(film, "utf-8")
    (tmp_path / "all.csv").write_text("specimen,mass_g,voltage_kV,displacement_mm\noval,20,0,1\n"
                                      "oval,20,1,2\nrund,20,0,1\n", "utf-8")
    text = tympan.draft(tmp_path / "all.csv").read_text("utf-8")
    assert text.partition("[[specimen]]\nfile = ")[2].strip().split("\n[[specimen]]\nfile = "
                                                                   ) == entries


@pytest.mark.parametrize(("names", "line"), [
    # Cells that are names, or contain the name of a file: the column of specimens.
    (("Kreis 1", "Ellipse 1"), "specimen = \"Stück\"  # its cells name specimens"),
    (("kreis", "ellipse"), "specimen = \"Stück\"  # its cells name specimens"),
    # Films whose names do not occur: one film in all rows is a guess, and so is one of two files.
    (("A", "B"), "specimen = { value = \"A\" }  # CORRECT THIS: no heading says it: one film in "
                 "all rows; if the films are those of 'Stück' (Kreis 1, Ellipse 1): "),
    (("A",), "specimen = { value = \"A\" }  # CORRECT THIS: "),
])
def test_an_unknown_column_of_films_is_found_or_asked_about(
        tmp_path: Path, names: tuple[str, ...], line: str,
        capsys: pytest.CaptureFixture[str]) -> None:
    for name in names:
        film = SPECIMEN.format(name=name).replace("[[specimen]]\n", "").replace("[specimen.", "[")
        (tmp_path / f"{name}.toml").write_text(film, "utf-8")
    rows = [f"{film};{mass};{kv};{0.1 * kv + mass / 10:.2f};0,5"
            for film in ("Kreis 1", "Ellipse 1") for mass in (15, 30) for kv in (0, 2, 4)]
    (tmp_path / "messung.csv").write_text("\n".join([
        "Stück;Masse oben [g];Spannung [kV];Absenkung Mitte [mm];Dicke [mm]", *rows]), "utf-8")
    text = tympan.draft(tmp_path / "messung.csv").read_text("utf-8")
    assert line in text
    # The only columns in a unit of mass and of length; a size of the film is none of them.
    assert 'mass_g = "Masse oben [g]"  # the only column in a unit of mass' in text
    assert 'displacement_mm = { from = "Absenkung Mitte [mm]", sign = "down" }  # the only' in text
    if names[0] == "kreis":  # its name is to be made the same in both files
        return
    assert main(["data", str(tmp_path)]) == 0
    told = [said for said in capsys.readouterr().out.splitlines() if said.startswith("warning")]
    count = text.count("CORRECT THIS")
    assert all("is a guess of the draft" in said for said in told[:count])
    assert not any("is a guess of the draft" in said for said in told[count:])


def test_a_file_called_as_the_table_names_its_specimen_is_asked_about(tmp_path: Path) -> None:
    merged(tmp_path)
    (tmp_path / "dataset.toml").unlink()
    for name in ("oval", "rund"):
        old = tmp_path / f"film {name}.toml"
        (tmp_path / f"{name.title()}.toml").write_text(
            old.read_text("utf-8").replace(f'"{name}"', f'"{name} 1"'), "utf-8")
        old.unlink()
    text = tympan.draft(tmp_path / "Messung 8.csv").read_text("utf-8")
    assert ('file = "Rund.toml"  # CORRECT THIS: its name is \'rund 1\', in the table it is '
            "'rund': write one in both") in text


def test_a_draft_of_a_tester_has_the_size_of_its_strip(tmp_path: Path) -> None:
    text = INSTRON.replace("Engineering Strain", "Extension (mm)").replace(
        "Engineering Stress (MPa)", "Load (N)")
    file = tmp_path / "strip_uniaxial.csv"
    file.write_text(text, "utf-8")
    (tmp_path / "film.toml").write_text(
        SPECIMEN.format(name="film").replace("[[specimen]]\n", "").replace("[specimen.", "["),
        "utf-8")
    target = tympan.draft(file)
    words = target.read_text("utf-8")
    assert 'area = "18 mm^2"' in words
    assert words.count("CORRECT THIS") == 1
    tests = read_dataset(tmp_path).coupons
    assert tests is not None
    assert tests.stress[0] == pytest.approx(0.03 / 18e-6)
    with pytest.raises(InputError, match="is there already"):
        tympan.draft(file)
    assert tympan.data(tmp_path)["specimens"] == ["film"]


def pulled(folder: Path, most: float, head: str = "") -> Path:
    """A tester's table of force and displacement, to ``most`` [mm], beside a film with a plate."""
    film = SPECIMEN.format(name="film").replace("[[specimen]]\n", "").replace("[specimen.", "[")
    (folder / "film.toml").write_text(film, "utf-8")
    rows = "".join(f"{most * i / 20:.3f},{0.02 * i:.3f}\n" for i in range(21))
    file = folder / "test 3.csv"
    file.write_text(f"{head}Extension (mm),Load (N)\n{rows}", "utf-8")
    return file


@pytest.mark.parametrize(("most", "head", "kind"), [
    (4.0, "", "force"),                              # what a plate can do
    (90.0, "", "coupon"),                            # further than the plate is from the frame
    (4.0, "Thickness,1,mm\nWidth,10,mm\n\n", "coupon"),  # a strip's sizes
])
def test_force_of_a_plate_is_told_from_that_of_a_strip(tmp_path: Path, most: float, head: str,
                                                       kind: str) -> None:
    file = pulled(tmp_path, most, head)
    words = tympan.draft(file).read_text("utf-8")
    assert f"[columns.{kind}]" in words
    other = {"force": "coupon", "coupon": "force"}[kind]
    assert (f"--draft 'test 3.csv' --kind {other}" in words) == (not head)
    told = tympan.draft(file, target=tmp_path / "other.toml", kind=other).read_text("utf-8")
    assert f"[columns.{other}]" in told
    assert "--kind" not in told


def test_a_drafted_pull_of_a_plate_is_read(tmp_path: Path) -> None:
    film = pulled(tmp_path, 4.0).parent / "film.toml"
    exact = tympan.force(tympan.load(film), to="4 mm", points=9).curves[0]
    rows = "".join(f"{1e3 * w:.5f},{force:.6f}\n"
                   for w, force in zip(exact.displacement_m, exact.force_N, strict=True))
    (tmp_path / "test 3.csv").write_text(f"Extension (mm),Load (N)\n{rows}", "utf-8")
    tympan.draft(tmp_path / "test 3.csv")
    forces = read_dataset(tmp_path).forces
    assert forces is not None
    assert forces.force == pytest.approx(exact.force_N, abs=1e-6)
    assert set(forces.voltage) == {0.0}


def test_a_draft_in_another_folder_finds_table_and_specimen(tmp_path: Path) -> None:
    raw, mine = tmp_path / "raw data", tmp_path / "work" / "mine"
    raw.mkdir()
    target = tympan.draft(pulled(raw, 4.0), target=mine / "dataset.toml")
    words = target.read_text("utf-8")
    assert 'file = "../../raw data/test 3.csv"' in words
    assert 'file = "../../raw data/film.toml"' in words
    dataset = read_dataset(mine)
    assert dataset.forces is not None
    assert len(dataset.forces.force) == 21


def test_a_draft_keeps_both_marks_apart(tmp_path: Path) -> None:
    file = tmp_path / "zahlen.csv"
    file.write_text(THOUSANDS, "utf-8")
    assert 'decimal = ","' in tympan.draft(file, target=tmp_path / "a.toml").read_text("utf-8")
    file.write_text("a;b\nc;d\n", "utf-8")
    with pytest.raises(InputError, match="no line with two known headings"):
        tympan.draft(file, target=tmp_path / "b.toml")


def test_two_decimal_marks_below_a_preamble_are_refused_too(tmp_path: Path) -> None:
    preamble = "Protokoll 12\nDicke;1.000\n"
    with pytest.raises(InputError, match=r"line 7, column 3 .*can be read as 1000 .*decimal = "):
        static(tmp_path / "a", static=preamble + THOUSANDS)
    sheet = static(tmp_path / "b", '[columns.static]\ndecimal = ","\n',
                   static=preamble + THOUSANDS)
    assert sheet.voltage.tolist() == [0.0, 500.0, 750.0, 1000.0, 2000.0]
    rounded = "Weg (mm)\tVoltage (V)\n0.1\t500\n0.2\t1.000\n"
    with pytest.raises(InputError, match=r"can be read as 1000 .*decimal = "):
        static(tmp_path / "c", "[columns.static]\nmass_g = { value = 17.9 }\n",
               static=f"Protokoll 12\n{rounded}")


def test_a_line_of_headings_without_a_stated_one(tmp_path: Path) -> None:
    lines = '[columns.static]\ntitles_line = 1\ndisplacement_um = "Höhe / µm"\n'
    with pytest.raises(InputError, match="line 1: given 'Höhe / µm': has no line with this"):
        static(tmp_path, lines, static=GERMAN)


def test_a_draft_goes_into_the_file_that_is_named(tmp_path: Path) -> None:
    file, target = tmp_path / "zahlen.csv", tmp_path / "mine.toml"
    file.write_text(THOUSANDS, "utf-8")
    assert main(["data", "--draft", str(file), "-o", str(target)]) == 0
    assert target.read_text("utf-8") == write_draft(file, tmp_path / "b.toml").read_text("utf-8")


def test_a_draft_leaves_out_columns_beside_ours(tmp_path: Path) -> None:
    file = tmp_path / "own.csv"
    file.write_text("voltage_kV,displacement_mm,mass_g,comment\n0,1,10,a\n1,1.1,10,b\n", "utf-8")
    words = tympan.draft(file).read_text("utf-8")
    assert "[columns.static]" in words
    assert 'ignore = ["comment"]' in words
    assert 'mass_g = "mass_g"' in words


#: Lines that people write above a table: with any separator, names of columns, numbers, quotes.
TITLES = ("Versuch 3, Aktor 7, Mai 2024", "Film, plate, load, voltage", "Weg, Kraft, Spannung",
          "Test of 3 May 2024; room 12", "Aktor 7\tRaum 12", "a, b", 'Film "A", first',
          "Load, displacement", "Messung 1,5 kV, 17,9 g", "Deflection (mm), 3 kV",
          "# voltage, mass, deflection", "Kraft-Weg-Messung; 17,9 g", "Datum 3,4; 12,5; 9,1")
#: A title that quotes its first word alone.
QUOTED = '"A" film, second'
#: What loads on the plate are called, and how their units are written.
LOADS = ("Load", "Weight", "Last", "Gewicht", "Charge", "Masse", "Poids", "Applied load",
         "Dead weight", "Zusatzgewicht", "Masse ajoutée", "Weight on plate")
OF_LOADS = ("{} (g)", "{} [g]", "{} / g", "{} in g", "{} (kg)", "{} [kg]", "{}, g", "{} (gram)")


@pytest.mark.parametrize("seed", range(60))
def test_a_draft_reads_a_table_below_any_title_with_its_loads(tmp_path: Path, seed: int) -> None:
    draw = random.Random(seed)
    titles = draw.sample(TITLES, draw.choice((1, 1, 2)))
    titles = [QUOTED] * (draw.random() < 0.2) + titles
    mark = draw.choice(";\t,")
    decimal = "." if mark == "," else draw.choice(",.")
    load = draw.choice(OF_LOADS).format(draw.choice(LOADS))
    grams = 1000.0 if "kg" in load else 1.0
    rows = [(0.5 * i, 2.25 + 0.125 * i, (17.9, 22.45)[i % 2] / grams)
            for i in range(draw.choice((3, 5, 20)))]
    headings = mark.join(f'"{title}"' if mark in title else title
                         for title in ("Voltage (kV)", "Weg (mm)", load))
    lines = [mark.join(f"{value:.6g}".replace(".", decimal) for value in row) for row in rows]
    text = "\n".join([*titles, *[""] * draw.randrange(2), headings, *lines]) + "\n"
    film = SPECIMEN.format(name="circle").replace("[[specimen]]\n", "").replace("[specimen.", "[")
    (tmp_path / "circle.toml").write_text(film, "utf-8")
    (tmp_path / "m.csv").write_text(text, "utf-8")
    assert "CORRECT THIS" not in tympan.draft(tmp_path / "m.csv").read_text("utf-8"), text
    sheet = read_dataset(tmp_path).static
    assert sheet is not None
    for values, place, factor in ((sheet.voltage, 0, 1e3), (sheet.displacement, 1, 1e-3),
                                  (sheet.mass, 2, 1e-3 * grams)):
        assert values.tolist() == pytest.approx([factor * row[place] for row in rows]), text


def test_a_load_in_newtons_is_a_force(tmp_path: Path) -> None:
    words = tympan.draft(pulled(tmp_path, 4.0)).read_text("utf-8")
    assert "[columns.force]" in words  # 'Load (N)'
    (tmp_path / "b.csv").write_text("Voltage (kV),Weg (mm),Weight (N)\n0,1,0.2\n1,2,0.2\n", "utf-8")
    words = tympan.draft(tmp_path / "b.csv", target=tmp_path / "b.toml").read_text("utf-8")
    assert 'mass_g = "Weight (N)"  # CORRECT THIS: the heading has no unit that fits' in words


def test_a_mass_is_preferred_to_a_load(tmp_path: Path) -> None:
    sheet = static(tmp_path / "a", static="Voltage (kV),Weg (mm),Load (g),Mass (g)\n0,1,5,20\n")
    assert sheet.mass.tolist() == pytest.approx([20e-3])


def test_the_first_of_two_tables_in_a_file_keeps_its_headings(tmp_path: Path) -> None:
    """The second has more headings that are known; it is refused, not read in place of the first.
    """
    text = ("Voltage,Weg (mm),Mass (g)\n0,1,20\n1,2,20\n"
            "Voltage (kV),Weg (mm),Mass (g)\n0,1,20\n")
    with pytest.raises(InputError, match=r"line 1: .*'Voltage' has no unit"):
        static(tmp_path / "a", static=text)
