"""Tables as laboratories write them: semicolons and decimal commas, workbooks, wide tables, and a
format of a user's own package."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest

from tests.support.datasets import write_dataset
from tests.support.packages import installed, run
from tympan.geometry.errors import InputError
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import read_dataset
from tympan.studies.formats import FORMATS, Format

openpyxl = pytest.importorskip("openpyxl")

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


BAD = [
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
    (workbook(",".join(["x"] * 101)), ".xlsx", "static.xlsx: must have at most 100 columns"),
]


@pytest.mark.parametrize(("content", "suffix", "message"), BAD)
def test_what_cannot_be_read_is_named(tmp_path: Path, content: str | bytes, suffix: str,
                                      message: str) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path / "d", content, suffix)
    assert message in str(error.value)


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
