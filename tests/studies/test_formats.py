"""Tables as laboratories write them: semicolons and decimal commas, workbooks, wide tables, and a
format of a user's own package."""

from __future__ import annotations

import io
import json
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.datasets import write_dataset
from tests.support.packages import installed, run
from tympan.base.errors import InputError
from tympan.studies.columns import Sheet
from tympan.studies.data.coupon import read_coupons
from tympan.studies.data.dataset import read_dataset
from tympan.studies.formats import FORMATS, Format, text_rows
from tympan.studies.signals import read_signal

openpyxl = pytest.importorskip("openpyxl")

SHEET = "xl/worksheets/sheet1.xml"
LONG = """specimen,mass_g,voltage_kV,displacement_mm,direction,repeat,capacitance_pF
A,17.9,0,2.25,up,1,810.5
B,17.9,0,2.5,up,1,
A,17.9,3.5,2.75,up,1,
A,17.9,3.5,2.875,up,2,
A,17.9,0,2.375,down,1,
B,22.45,3.5,3.125,up,1,
"""
WIDE = """\
voltage_kV;A 17,9 g displacement_mm up;A 17,9 g capacitance_pF up;A 17.9 g displacement_mm up;\
A 17.9 g displacement_mm down;B 17.9 g displacement_mm up;B 22,45 g displacement_mm up
0;2,25;810,5;;;2,5;
3,5;2,75;;2,875;;;3,125

0;;;;2,375;;
"""


def workbook(text: str, name: str = "Tabelle1", first: str = "") -> bytes:
    """A table as Excel keeps it: numbers as numbers, on a sheet behind another one if that is."""
    book, content = openpyxl.Workbook(), io.BytesIO()
    sheet = book.active
    if first:
        sheet.title = first
        sheet.append(["notes"])
        sheet = book.create_sheet()
    sheet.title = name
    for line in text.splitlines():
        sheet.append([number(cell) for cell in line.split(",")])
    book.save(content)
    return content.getvalue()


def packed(part: str, before: str, more: str) -> bytes:
    """A workbook of which one part has more text."""
    out = io.BytesIO()
    with (zipfile.ZipFile(io.BytesIO(workbook(LONG, "static"))) as old,
          zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new):
        for name in old.namelist():
            text = old.read(name).decode()
            assert name != part or before in text
            new.writestr(name, text.replace(before, more + before, 1) if name == part else text)
    return out.getvalue()


def number(cell: str) -> float | str | None:
    try:
        return float(cell)
    except ValueError:
        return cell or None


def read(folder: Path, content: str | bytes, suffix: str = ".csv") -> Sheet:
    write_dataset(folder)
    (folder / f"static{suffix}").write_bytes(
        content.encode() if isinstance(content, str) else content)
    static = read_dataset(folder).static
    assert static is not None
    return static


def rows(sheet: Sheet) -> list[tuple[object, ...]]:
    names = ("specimen", "mass", "voltage", "displacement", "direction", "repeat", "capacitance")
    return sorted(zip(*(map(str, sheet[name]) for name in names), strict=True))


@pytest.mark.parametrize(("content", "suffix"), [
    (LONG.replace(",", ";").replace(".", ","), ".csv"),
    (LONG.replace(",", ";"), ".csv"),
    (LONG.replace(",", "\t").replace("\n", "\r\n"), ".csv"),
    (workbook(LONG), ".xlsx"),
    (workbook(LONG, "Static", first="Notizen"), ".xlsx"),
    (WIDE, ".csv"),
    (workbook(WIDE.replace(",", ".").replace(";", ",")), ".xlsx"),
], ids=["decimal commas", "semicolons", "tabs", "workbook", "sheet", "wide", "wide workbook"])
def test_one_table_in_every_writing_is_the_same(tmp_path: Path, content: str | bytes,
                                                suffix: str) -> None:
    assert rows(read(tmp_path / "other", content, suffix)) == rows(read(tmp_path / "long", LONG))


def test_a_reading_of_a_wide_table_has_the_line_it_stood_in(tmp_path: Path) -> None:
    sheet = read(tmp_path / "d", WIDE)
    assert sheet.line.tolist() == [2, 2, 3, 3, 3, 5]


#: The large ones are made when they are asked for.
BAD: list[tuple[str | bytes | Callable[[], str | bytes], str, str]] = [
    (WIDE.replace("2,875", "2.8.7"), ".csv",
     "static.csv: line 3, A 17.9 g displacement_mm: given '2.8.7': must be a number"),
    (WIDE.replace("22,45 g", "22,45 mm"), ".csv",
     "static.csv: line 1, column 7: given 'B 22,45 mm displacement_mm up': wrong dimension"),
    (WIDE.replace("3,5;2,75;;", "3,5;2,75;"), ".csv",
     "static.csv: line 3: given '6 cells': must have 7 cells"),
    (WIDE.replace("B 22,45", "C 22,45"), ".csv",
     "line 3, C 22.45 g specimen: given 'C': unknown specimen"),
    (b"PK\x03\x04 no archive", ".xlsx", "static.xlsx: is no workbook that can be read"),
    (workbook(LONG.replace("2.875", "low")), ".xlsx",
     "static.xlsx: line 5, column 4 (displacement_mm): given 'low': must be a number"),
    (workbook(""), ".xlsx", "static.xlsx: is empty"),
    (workbook(",".join(["x"] * 1001)), ".xlsx",
     "static.xlsx: given 1001: must have at most 1000 columns"),
    (",".join(["x"] * 60_000), ".csv", "static.csv: given 60000: must have at most 1000 columns"),
    (lambda: "x;x\n" + 5_000_001 * ";\n", ".csv",
     "static.csv: given 10000004: must have at most 1000"),
    (lambda: packed(SHEET, "<sheetData>", 30_000_000 * "<a/>"), ".xlsx",
     "static.xlsx: given '120 MB': must unpack to at most 100 MB"),
    (lambda: packed(SHEET, "<sheetData>", 5_000_000 * "<a/>"), ".xlsx",
     "static.xlsx: must have at most 5000000 tags in xl/worksheets/sheet1.xml"),
    (lambda: packed("xl/styles.xml", "<fonts", 100_001 * "<a/>"), ".xlsx",
     "static.xlsx: must have at most 100000 tags in xl/styles.xml"),
    (lambda: packed(SHEET, "<worksheet", "<!DOCTYPE a [<!ENTITY b 'c'>]>"), ".xlsx",
     "static.xlsx: is no workbook: its XML defines words of its own"),
    (lambda: packed(SHEET, "<row ", '<row r="1048576"><c r="A1048576"/></row>'), ".xlsx",
     "static.xlsx: must have at most 300000 rows"),
]


@pytest.mark.parametrize(("content", "suffix", "message"), BAD)
def test_what_cannot_be_read_is_named(
        tmp_path: Path, content: str | bytes | Callable[[], str | bytes], suffix: str,
        message: str) -> None:
    content = content if isinstance(content, str | bytes) else content()
    began = time.process_time()
    with pytest.raises(InputError) as error:
        read(tmp_path / "d", content, suffix)
    assert message in str(error.value)
    assert time.process_time() - began < 2


@pytest.mark.parametrize("cell", ["1" + "." * 9000 + "a1", "1" * 9000 + "a1", "1e" * 4500],
                         ids=["points", "digits", "exponents"])
def test_cells_that_are_nearly_numbers_are_quick(cell: str) -> None:
    """What stands between cells is found by whether they are numbers: each is looked at once."""
    began = time.process_time()
    assert len(list(text_rows(Path("a.csv"), f"{cell};{cell}\n".encode() * 200))) == 200
    assert time.process_time() - began < 4


@pytest.mark.parametrize("declared", ["A1:XFD1048576", "A1"])
def test_the_size_that_a_sheet_declares_is_not_asked(tmp_path: Path, declared: str) -> None:
    content = packed(SHEET, "<sheetData>", f'<dimension ref="{declared}"/>')
    assert rows(read(tmp_path / "other", content, ".xlsx")) == rows(read(tmp_path / "long", LONG))


@pytest.mark.parametrize(("old", "new", "message"), [
    ("3,5;2,75;", "3.500;2,75;",
     "line 3, column 1 (voltage_kV): given '3.500': can be read as 3500 (with a thousands "
     "separator) or as 3.5 (with a decimal mark), since line 2 has '2,25'"),
    ("3,5;2,75;", "3.5;2,75;", "line 3, column 1 (voltage_kV): given '3.5': must have the decimal "
     "mark of '2,25' in line 2"),
    ("2,25;810,5;;;2,5;", "2.25;810.5;;;2.5;",
     "given '2.25': must have the decimal mark of '3,5' in line 3"),
])
def test_numbers_with_both_decimal_marks_are_refused(tmp_path: Path, old: str, new: str,
                                                     message: str) -> None:
    assert old in WIDE
    with pytest.raises(InputError) as error:
        read(tmp_path / "d", WIDE.replace(old, new))
    assert message in str(error.value)


@pytest.mark.parametrize("mark", [",", ";"])
def test_thousands_beside_whole_hundreds_are_refused(tmp_path: Path, mark: str) -> None:
    """1.000 V after 500 V, though nothing else in the file has a decimal mark."""
    text = "specimen,mass_g,voltage_V,displacement_um\nA,20,500,2100\nA,20,1.000,2140\n"
    with pytest.raises(InputError) as error:
        read(tmp_path / "d", text.replace(",", mark))
    assert ("line 3, column 3 (voltage_V): given '1.000': can be read as 1000 (with a thousands "
            "separator) or as 1 (with a decimal mark), since line 2 has '500'") in str(error.value)
    sheet = read(tmp_path / "e", text.replace("500", "0.500").replace(",", mark))
    assert sheet.voltage.tolist() == [0.5, 1.0]


def test_points_in_labels_are_no_decimal_marks(tmp_path: Path) -> None:
    text = LONG.replace(",", ";").replace(".", ",").replace(";repeat", ";order")
    text = text.replace("A;", "1.1;").replace("B;", "1.2;")
    names = list(text_rows(Path("static.csv"), text.encode()))
    assert names[1][1][:2] == ["1.1", "17.9"]


@pytest.mark.parametrize("text", [
    LONG.replace("specimen", "sep=,\r\nspecimen", 1), "sep=;\n" + LONG.replace(",", ";"),
    'sep=|\n' + LONG.replace(",", "|").replace(".", ","), '"sep=;"\n' + LONG.replace(",", ";"),
    "sep=\t\n" + LONG.replace(",", "\t"), "SEP=,\n" + LONG,
], ids=["comma", "semicolon", "bar", "quoted", "tab", "capitals"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_excels_first_line_names_the_separator(tmp_path: Path, mark: str, text: str) -> None:
    sheet = read(tmp_path / "sep", mark + text)
    assert rows(sheet) == rows(read(tmp_path / "long", LONG))
    assert sheet.line.tolist() == [3, 4, 5, 6, 7, 8]


ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1",
             "cp1252"]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("mark", [",", "\t"])
def test_every_usual_encoding_is_read(tmp_path: Path, encoding: str, mark: str) -> None:
    """Among them Excel's Unicode text: tabs in UTF-16 with a byte-order mark."""
    text = LONG.replace("A,", "Größe µ,").replace(",", mark)
    read_as = list(text_rows(Path("static.csv"), text.encode(encoding)))
    assert read_as == list(text_rows(Path("static.csv"), text.encode()))
    assert read_as[1][1][0] == "Größe µ"


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252"])
def test_signals_and_coupons_are_read_by_the_same_reader(tmp_path: Path, encoding: str) -> None:
    signal, coupons = tmp_path / "signal.csv", tmp_path / "coupon.csv"
    signal.write_bytes("sep=;\nt_s;voltage_kV\n0;0\n0,5;1,5\n".encode(encoding))
    assert read_signal(signal).voltage.tolist() == [0, 1500]
    coupons.write_bytes("specimen;mode;stretch;nominal_stress_kPa\nÄ;uniaxial;1,5;20\n".encode(
        encoding))
    sheet = read_coupons(coupons)
    assert (sheet.specimen[0], sheet.stretch[0], sheet.stress[0]) == ("Ä", 1.5, 20e3)


def test_one_table_stands_in_one_format(tmp_path: Path) -> None:
    read(tmp_path / "d", LONG)
    with pytest.raises(InputError, match=r"there are static.csv and static.xlsx"):
        read(tmp_path / "d", workbook(LONG), ".xlsx")


@pytest.mark.parametrize("kind", FORMATS.values(), ids=FORMATS)
def test_every_format_says_what_it_is(kind: Format) -> None:
    assert kind.suffix.startswith(".")
    assert kind.suffix == kind.suffix.lower()
    assert kind.explanation[0].islower()
    assert kind.claims is not None or kind.name == kind.suffix


def test_a_format_of_a_users_own_package_is_read(tmp_path: Path) -> None:
    (tmp_path / "our_rig.py").write_text(
        "from tympan.studies.formats import FORMATS, Format\n"
        "def rows(file, content):\n"
        "    lines = content.decode('latin-1').splitlines()\n"
        "    names = 'specimen mass_g voltage_kV displacement_um'.split()\n"
        "    return [(1, names), *((number, line.split()) for number, line in\n"
        "                          enumerate(lines, 1) if not line.startswith('#'))]\n"
        "FORMATS.register(Format('.rig', 'what our rig writes', rows))\n")
    installed(tmp_path, "our-rig", {"tympan.formats": {"rig": "our_rig"}})
    folder = write_dataset(tmp_path / "d")
    (folder / "static.rig").write_text("# 25 \xb0C\nA 17.9 0 1640\nA 17.9 3.5 1900\n", "latin-1")
    done = run("data", str(folder), "--json", path=(tmp_path,), cache="")
    assert done.returncode == 0, done.stderr
    assert [(file["name"], file["readings"]) for file in json.loads(done.stdout)["files"]] == [
        ("dataset.toml", None), ("static.rig", 2)]
