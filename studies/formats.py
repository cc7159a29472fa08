"""What tables of readings are written in: how the bytes of a file become rows of cells.

A new format is a value of :data:`FORMATS`, known by the end of the files' names, and where that is
not enough by what is in them; those of users' own packages are loaded by entry points of the group
``tympan.formats`` (:mod:`tympan.geometry.plugins`).
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Registry
from tympan.geometry.plugins import load_plugins
from tympan.geometry.system import MissingLibrary
from tympan.geometry.units import quantity

#: A row: its line, the first of a file is 1, and its cells without blanks around them.
Row = tuple[int, list[str]]

#: What may stand between cells; of those that are there as often, the first.
_SEPARATORS = (",", ";", "\t")

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?", re.ASCII)

#: Most rows and columns of a workbook.
_MOST_ROWS, _MOST_COLUMNS = 300_000, 100

#: The name of a column of a wide table: "circle 17.9 g displacement_mm up".
_WIDE = re.compile(r"(?P<specimen>.+?)\s+(?P<mass>[\d.,]+\s*[a-z]+)\s+"
                   r"(?P<title>[a-z]+_\w+)(?:\s+(?P<direction>up|down))?")


@dataclass(frozen=True)
class Format:
    """Files whose names end with ``suffix``, a dot and small letters.

    ``rows(file, content)`` are those of the bytes of a file, which it names in errors; the first
    has the names of the columns. ``explanation`` is one sentence for someone in the laboratory.
    Formats that share a suffix have a ``name`` each, and all but one of them say which files are
    theirs: ``claims(file, content)``. ``table``: the file of a dataset, such as coupon.csv, for
    which those stand whatever their names.
    """

    suffix: str
    explanation: str
    rows: Callable[[Path, bytes], list[Row]]
    name: str = ""
    claims: Callable[[Path, bytes], bool] | None = None
    table: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.suffix)


#: All formats by name.
FORMATS: Registry[Format] = Registry("name")


def suffixes() -> tuple[str, ...]:
    """Those of all formats, each once."""
    return tuple(dict.fromkeys(kind.suffix for kind in FORMATS.values()))


def format_of(file: Path, content: bytes) -> Format | None:
    """The format that claims a file, else that of its suffix, None where there is none."""
    able = [kind for kind in FORMATS.values() if kind.suffix == file.suffix.lower()]
    claiming = [kind for kind in able if kind.claims is not None and kind.claims(file, content)]
    return next(iter([*claiming, *(kind for kind in able if kind.claims is None)]), None)


def read_rows(file: Path, content: bytes) -> list[Row]:
    """The rows of a file by its format, or as text where it has none."""
    kind = format_of(file, content)
    return (text_rows if kind is None else kind.rows)(file, content)


def readers() -> str:
    """What is read, in words for a message on a file that is not."""
    return "; ".join(f"{kind.suffix}: {kind.explanation}" for kind in FORMATS.values())


def text_rows(file: Path, content: bytes) -> list[Row]:
    """Rows of text with commas, semicolons or tabs between cells, in UTF-8.

    Where no comma stands between them, it may stand in numbers. Blank lines are skipped; a
    byte-order mark and any line ends are taken.
    """
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start}): save it as CSV in UTF-8; or it "
                         f"is written as one of {readers()}", file=file) from None
    mark = _separator(text)
    reader = csv.reader(io.StringIO(text), delimiter=mark, skipinitialspace=True, strict=True)
    rows, begin = [], 1
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells):
                points = cells if mark == "," else [decimal_point(cell) for cell in cells]
                rows.append((begin, points))
            begin = reader.line_num + 1
    except csv.Error as error:
        raise InputError(f"is not comma-separated text: {error}; is a quotation mark left open?",
                         file=file, key=f"line {begin}") from None
    return rows


def _separator(text: str) -> str:
    """What stands most often in the first line that is not blank, quotations left out."""
    first = next((line for line in text.split("\n") if line.strip(" \t;,")), "")
    unquoted = re.sub(r'"[^"]*"', "", first)
    return max(_SEPARATORS, key=unquoted.count)


def decimal_point(cell: str) -> str:
    """A number with a decimal comma as one with a point; any other cell as it is."""
    return cell.replace(",", ".") if DECIMAL_COMMA.fullmatch(cell) else cell


def workbook_rows(file: Path, content: bytes) -> list[Row]:
    """Rows of a workbook's sheet that is called as the file is, else of its first one.

    Formulas count as what they made when the workbook was saved.
    """
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise MissingLibrary("workbooks need openpyxl: pip install 'tympan[excel]'") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and links it does not keep
            book = load_workbook(io.BytesIO(content), read_only=True, data_only=True)
            names = {sheet.title.lower(): sheet for sheet in book.worksheets}
            sheet = names.get(file.stem.lower()) or book.worksheets[0]
            cells = list(islice(sheet.iter_rows(values_only=True, max_col=_MOST_COLUMNS + 1),
                                _MOST_ROWS + 1))
    except Exception as error:  # whatever a broken archive or its XML raises
        raise InputError(f"is no workbook that can be read: {error}", file=file) from None
    if len(cells) > _MOST_ROWS:
        raise InputError(f"must have at most {_MOST_ROWS} rows", file=file)
    rows = [(line, [_text(cell) for cell in row]) for line, row in enumerate(cells, start=1)]
    rows = [(line, row) for line, row in rows if any(row)]
    width = max((place for _, row in rows for place, cell in enumerate(row, 1) if cell), default=0)
    if width > _MOST_COLUMNS:
        raise InputError(f"must have at most {_MOST_COLUMNS} columns", file=file)
    return [(line, (row + [""] * width)[:width]) for line, row in rows]


def _text(cell: Any) -> str:
    return "" if cell is None else str(cell).strip()


FORMATS.register(Format(
    ".csv", "text with commas, semicolons or tabs between cells, and decimal commas where no comma "
    "stands between them", text_rows))
FORMATS.register(Format(
    ".xlsx", "a workbook: its sheet that is called as the file is, else its first one",
    workbook_rows))
load_plugins("tympan.formats", FORMATS)


def unfolded(file: Path, rows: Sequence[Row]) -> list[Row] | None:
    """The rows of a wide table as one row for each reading; None of a table that is not wide.

    Columns of a wide table are called "SPECIMEN MASS NAME_UNIT", with "up" or "down" behind for the
    way the voltage came, as in "circle 17.9 g displacement_mm"; others hold for all of a row's
    readings. Blank cells are no readings; a column that is there again is a repeat.

    Examples
    --------
    >>> rows = [(1, ["voltage_kV", "A 20 g displacement_mm", "B 20 g displacement_mm"]),
    ...         (2, ["0", "1.5", ""]), (3, ["2", "1.6", "1.9"])]
    >>> for line, cells in unfolded(Path("static.csv"), rows):
    ...     print(line, cells)
    1 ['voltage_kV', 'specimen', 'mass_kg', 'displacement_mm']
    2 ['0', 'A', '0.02', '1.5']
    3 ['2', 'A', '0.02', '1.6']
    3 ['2', 'B', '0.02', '1.9']
    """
    if not rows:
        return None
    (top, titles), *below = rows
    matches = [_WIDE.fullmatch(title) for title in titles]
    if "specimen" in titles or not any(matches):
        return None
    common = [place for place, match in enumerate(matches) if match is None]
    groups = list(_groups(file, top, titles, matches))
    values = list(dict.fromkeys(title for _, places in groups for title in places))
    marks = ["specimen", "mass_kg", *(name for name in ("direction", "repeat")
                                      if any(name in head for head, _ in groups))]
    long: list[Row] = [(top, [*(titles[place] for place in common), *marks, *values])]
    for line, cells in below:
        if len(cells) != len(titles):
            raise InputError(f"must have {len(titles)} cells, as the first line has", file=file,
                             key=f"line {line}", given=f"{len(cells)} cells")
        for head, places in groups:
            read = [cells[places[title]] if title in places else "" for title in values]
            if any(read):
                long.append((line, [*(cells[place] for place in common),
                                    *(head.get(mark, "") for mark in marks), *read]))
    return long


def _groups(file: Path, top: int, titles: Sequence[str], matches: Sequence[re.Match[str] | None]
            ) -> Iterator[tuple[dict[str, str], dict[str, int]]]:
    """What marks readings of one row each, and where their values stand by title."""
    seen = Counter[tuple[str, ...]]()
    groups: dict[tuple[str, ...], tuple[dict[str, str], dict[str, int]]] = {}
    for place, match in enumerate(matches):
        if match is None:
            continue
        specimen, mass, title, direction = match.groups()
        try:
            mass = repr(quantity(mass.replace(",", "."), "mass"))
        except InputError as error:
            raise InputError(error.allowed, file=file, key=f"line {top}, column {place + 1}",
                             given=titles[place]) from None
        seen[specimen, mass, direction or "", title] += 1
        repeat = seen[specimen, mass, direction or "", title]
        head = {"specimen": specimen, "mass_kg": mass}
        head |= {"direction": direction} if direction else {}
        groups.setdefault((specimen, mass, direction or "", str(repeat)),
                          (head | {"repeat": str(repeat)}, {}))[1][title] = place
    repeated = any(head["repeat"] != "1" for head, _ in groups.values())
    for head, places in groups.values():
        if not repeated:
            del head["repeat"]
        yield head, places
