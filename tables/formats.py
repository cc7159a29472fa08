"""Formats of tables of readings: conversion of a file's bytes to rows of cells.

Every table is counted before it is read: one with too many columns or cells is refused at once. A
new format is a value of :data:`FORMATS`, recognised by the end of the files' names and, if needed,
by their content. Those of users' own packages are loaded by entry points of the group
``tympan.formats`` (:mod:`tympan.base.plugins`).
"""

from __future__ import annotations

import codecs
import csv
import io
import re
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import unescape
from itertools import chain, islice
from pathlib import Path
from typing import Any

from tympan.base.errors import InputError
from tympan.base.extras import needs
from tympan.base.fields import Registry
from tympan.base.plugins import load_later
from tympan.base.read_file import STORED
from tympan.base.units import quantity

#: A row: its line, 1 for the first of a file, and its cells without blanks around them.
Row = tuple[int, list[str]]

#: Marks that may separate cells; of equally frequent ones the first counts.
_SEPARATORS = (",", ";", "\t")
#: A cell that is a number, possibly with its unit.
_NUMBER_CELL = re.compile(r" *[-+]?\d[\d.,]*+(?:[eE][-+]?\d+)?[^\d,;\t]*", re.ASCII)

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?", re.ASCII)
_DECIMAL_POINT = re.compile(r"[-+]?\d+\.\d+(?:[eE][-+]?\d+)?", re.ASCII)

#: A number that may have a thousands separator: "1.000" is 1000 or 1.
THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
#: A number with a separator that ends with 0: programs that omit zero decimals do not write it.
_ROUND = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d\d0(?![\d.eE])", re.ASCII)
_HUNDREDS = re.compile(r"[-+]?[1-9]\d{2,}", re.ASCII)

#: A number with any marks in it, and marks that may separate thousands.
_WITH_MARKS = re.compile(r"[-+]?\d[\d.,' \u2019\u00a0\u202f]*(?:[eE][-+]?\d+)?", re.ASCII)
_BETWEEN_THOUSANDS = re.compile("[.,' \u2019\u00a0\u202f]")

#: A first line that tells Excel the separator of cells.
_SEP_LINE = re.compile(r'\ufeff?"?sep=([^\w\s"\'.+-]|\t)"?[ \t;,]*\n', re.IGNORECASE)

#: Tabs that stand together: between two cells, or a blank cell.
_DOUBLE_TABS = re.compile(r"\t[\t ]*\t")

#: A cell between blanks: a number, a date or a clock, or a mark of nothing that was read.
_BLANK_CELL = (r"(?:[-+]?(?:0|[1-9]\d*)?(?:[.,]\d*)?(?:[eE][-+]?\d+)?(?<=[\d.,])|\d[\d:./T-]*\d|"
               r"[nN]a[nN]|-+)")
#: A line of such cells.
_BLANKS = re.compile(rf" *{_BLANK_CELL}(?: +{_BLANK_CELL})+ *", re.ASCII)
#: Marks that begin a comment in files of programs.
COMMENT = re.compile(r"\s*(?:#+|%+|//+|;+|\*+|!+)\s*")
#: What may stand between headings whose numbers have blanks between them, the surest first.
_BETWEEN_HEADINGS = (re.compile(r"\s{2,}|\t"), re.compile(r"\s+"), re.compile(r"\s+(?![\[(/])"))

#: First line that is not blank.
_FIRST = re.compile(r"^(?=[ \t;,]*[^ \t;,\n]).*", re.MULTILINE)

#: Number of lines from which the separator of cells is found.
_LOOKED_AT = 200
#: Number of characters of a line in which the separator is sought: 1000 columns of numbers.
_LOOKED_INTO = 20_000

#: Characters that no text contains.
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")

#: Most columns of a table, enough for the specimens of a wide one.
_MOST_COLUMNS = 1000
#: Most cells of a table: 2 million samples in five columns. A table of specimens takes 1 GB of
#: memory, any other a tenth of that.
_MOST_CELLS = 10_000_000
#: Most rows of a workbook; an empty row costs nothing in its file.
_MOST_ROWS = 300_000
#: Most tags in the cells and texts of a workbook, four a cell: 100,000 take openpyxl 0.3 s.
_MOST_TAGS = 5_000_000
#: Most tags in the styles and other parts of a workbook: 100,000 take 1.4 s and 50 MB.
_MOST_OTHER_TAGS = 100_000
#: Parts of a workbook that hold cells or texts.
_CELLS = re.compile(r"worksheets/|sharedStrings", re.IGNORECASE)
#: Part of a workbook that lists its sheets.
_SHEETS = "xl/workbook.xml"
#: Part of a workbook with the places of its sheets.
_PLACES = "xl/_rels/workbook.xml.rels"
#: A sheet in the list of a workbook.
_SHEET = re.compile(r"<(?:\w+:)?sheet\s[^>]*>")
#: The place of a part of a workbook.
_PLACE = re.compile(r"<(?:\w+:)?Relationship\s[^>]*>")
#: A cell with something in it.
_CELL = re.compile(rb"<(?:\w+:)?(?:v|is)>")
#: An attribute of a tag, and its value.
_ATTRIBUTE = re.compile(r'([\w:]+)="([^"]*)"')
#: Bytes of a workbook that are counted at a time.
_CHUNK = 1 << 20
#: Longest tag of a cell that is found where two chunks meet [bytes].
_NAME = 20

#: Encodings by their byte-order mark at the beginning; that of UTF-32 begins with one of UTF-16.
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32",
          codecs.BOM_UTF32_BE: "utf-32", codecs.BOM_UTF16_LE: "utf-16",
          codecs.BOM_UTF16_BE: "utf-16"}

#: The name of a column of a wide table: "circle 17.9 g displacement_mm up".
_WIDE = re.compile(r"(?P<specimen>.+?)\s+(?P<mass>[\d.,]+\s*[a-z]+)\s+"
                   r"(?P<title>[a-z]+_\w+)(?:\s+(?P<direction>up|down))?")


class TwoMarks(InputError):
    """A number that can be read in two ways, since a file has two marks in its numbers."""


@dataclass(frozen=True)
class Format:
    """Files whose names end with ``suffix``, a dot and small letters.

    ``rows(file, content)`` converts the bytes of a file, which it names in errors, to rows; the
    first has the names of the columns. They may be made one by one. ``explanation`` is one sentence
    for someone in the laboratory. Formats that share a suffix have a ``name`` each, and all but one
    of them say which files are theirs: ``claims(file, content)``. ``table`` is the file of a
    dataset, such as coupon.csv, that these files replace, whatever their names. ``unread(file,
    content)`` says which part of a file has no rows here, "" if none.
    """

    suffix: str
    explanation: str
    rows: Callable[[Path, bytes], Iterable[Row]]
    name: str = ""
    claims: Callable[[Path, bytes], bool] | None = None
    table: str = ""
    unread: Callable[[Path, bytes], str] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.suffix)


#: All formats by name.
FORMATS: Registry[Format] = Registry("name")


def suffixes() -> tuple[str, ...]:
    """List the suffixes of all formats, each once."""
    return tuple(dict.fromkeys(kind.suffix for kind in FORMATS.whole().values()))


def format_of(file: Path, content: bytes) -> Format | None:
    """Find the format that claims a file, else that of its suffix, None if there is none."""
    able = [kind for kind in FORMATS.whole().values() if kind.suffix == file.suffix.lower()]
    claiming = [kind for kind in able if kind.claims is not None and kind.claims(file, content)]
    return next(iter([*claiming, *(kind for kind in able if kind.claims is None)]), None)


def read_rows(file: Path, content: bytes, decimal: str | None = None) -> Iterable[Row]:
    """Read the rows of a file by its format, or as text if it has none.

    ``decimal`` is the decimal mark of a text; by default it is found.
    """
    kind = format_of(file, content)
    if kind is None or kind.rows is text_rows:
        return text_rows(file, content, decimal)
    return kind.rows(file, content)


def unread(file: Path, content: bytes) -> str:
    """Say which part of a file is not read, "" if none."""
    kind = format_of(file, content)
    return kind.unread(file, content) if kind is not None and kind.unread is not None else ""


def decoded(content: bytes, file: Path | None = None) -> str:
    """Decode the text of a table, with its lines ended by line feeds.

    The encoding is the one that a byte-order mark names, else UTF-8, else Windows-1252, which
    includes Latin-1 without control characters. UTF-16 is also recognised by its zeros. With a
    ``file``, bytes that are no text are an :class:`InputError`.
    """
    encoding = _encoding(content)
    try:
        text = content.decode(encoding, "strict" if file else "replace")
    except UnicodeDecodeError as error:
        if encoding != "cp1252":
            name = encoding.removesuffix("-sig").upper()
            raise InputError(f"is not {name} text (byte {error.start}): save it as CSV in UTF-8",
                             file=file) from None
        text = content.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\x1a")  # ends a text in DOS
    if file and (control := _CONTROL.search(text)):
        raise InputError("is no text: save it as CSV in UTF-8, or as a workbook .xlsx", file=file,
                         given=control.group(),
                         key=f"line {text.count(chr(10), 0, control.start()) + 1}")
    return text


def _encoding(content: bytes) -> str:
    for mark, encoding in _MARKS.items():
        if content.startswith(mark):
            return encoding
    even, odd = (content[start:_CHUNK:2].count(0) for start in (0, 1))
    if max(even, odd) > len(content[:_CHUNK]) // 4:
        return "utf-16-le" if odd > even else "utf-16-be"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def first_line(content: bytes) -> str:
    """Read the first line of a text, without Excel's ``sep=``, cut after a few words."""
    text = decoded(content[:400])
    return _SEP_LINE.sub("", text, 1).partition("\n")[0]


def text_rows(file: Path, content: bytes, decimal: str | None = None) -> Iterator[Row]:
    """Read rows of text with commas, semicolons or tabs between cells, or the mark of ``sep=``.

    Blanks separate cells where no other mark stands between numbers. Commas may stand in numbers
    where they do not separate cells. Blank lines are skipped; encodings and line ends are those of
    :func:`decoded`. An :class:`InputError` where a number can be read in two ways, unless its
    ``decimal`` mark is given.
    """
    text = decoded(content, file)
    said = _SEP_LINE.match(text)
    if said:  # its line remains, so that the others keep their numbers
        text = "\n" + text[said.end():]
    if not said and (columns := _between_blanks(text)):
        text = _tabs_for_blanks(text, columns)
    mark = said[1] if said else _separator(text)
    if mark == "\t" and _DOUBLE_TABS.search(text):
        text = _single_tabs(text)
    if (columns := _unquoted(text).count(mark) + 1) > _MOST_COLUMNS:
        raise _too_many(file, columns, _MOST_COLUMNS, "columns")
    if (cells := text.count(mark) + text.count("\n")) > _MOST_CELLS:
        raise _too_many(file, cells, _MOST_CELLS, "cells")
    if decimal is not None:
        for line, row in _split(file, text, mark):
            yield line, [_plain_number(cell, decimal) for cell in row]
        return
    if mark == "," and not _ROUND.search(text):
        yield from _split(file, text, mark)
        return
    rows = list(_split(file, text, mark))
    if mark != ",":
        _check_marks(file, rows)
    if _ROUND.search(text):
        _check_rounds(file, rows)
    for line, row in rows:
        yield line, row if mark == "," else [decimal_point(cell) for cell in row]


def _between_blanks(text: str) -> int:
    """Count the columns of a table with blanks alone between its numbers; 0 of any other text."""
    lines = [line.rstrip("\n") for line in islice(_lines(text), _LOOKED_AT) if line.strip()]
    widths = Counter(len(line.split()) for line in lines if _BLANKS.fullmatch(line))
    width, count = widths.most_common(1)[0] if len(widths) == 1 else (0, 0)
    return width if count > 1 and 2 * count >= len(lines) else 0


def _tabs_for_blanks(text: str, columns: int) -> str:
    """Write tabs between the cells of lines that have as many as there are columns."""
    lines = []
    for line in map(str.strip, text.split("\n")):
        plain = COMMENT.sub("", line, 1) if COMMENT.match(line) else line
        splits = (between.split(words) for words in (line, plain) for between in _BETWEEN_HEADINGS)
        lines.append(next(("\t".join(cells) for cells in splits if len(cells) == columns), line))
    return "\n".join(lines)


def _single_tabs(text: str) -> str:
    """Make one tab of several between cells, if no line then has another number of cells."""
    single = _DOUBLE_TABS.sub("\t", text)
    lines = [line.strip("\t ") for line in islice(_lines(single), _LOOKED_AT)]
    widths = {line.count("\t") for line in lines if line.count("\t")}
    return single if len(widths) == 1 else text


def _split(file: Path, text: str, mark: str) -> Iterator[Row]:
    """Split text into rows at a mark, without blank rows.

    A title above all numbers is one cell if it quotes only its first words. A comment mark in a
    cell of its own is left out where the numbers have a cell less.
    """
    rows = _split_all(file, text, mark)
    first = list(islice(rows, _LOOKED_AT))
    below = next((len(cells) for _, cells in first if any(map(_NUMBER_CELL.fullmatch, cells))
                  and not COMMENT.fullmatch(cells[0])), 0)
    for line, cells in chain(first, rows):
        apart = len(cells) == below + 1 > 1 and COMMENT.fullmatch(cells[0])
        yield line, cells[1:] if apart else cells


def _split_all(file: Path, text: str, mark: str) -> Iterator[Row]:
    """Split text into rows, also with a comment mark in a cell of its own."""
    reader = csv.reader(_lines(text), delimiter=mark, skipinitialspace=True, strict=True)
    begin, numbers = 1, False
    while True:
        try:
            cells = [cell.strip() for cell in next(reader)]
        except StopIteration:
            return
        except csv.Error as error:
            if (numbers or reader.line_num > _LOOKED_AT
                    or "expected after" not in str(error)):
                raise InputError(f"is not comma-separated text: {error}; is a quotation mark left"
                                 " open?", file=file, key=f"line {begin}") from None
            cells = [next(islice(_lines(text), reader.line_num - 1, None)).strip()]
        numbers = numbers or any(map(_NUMBER_CELL.fullmatch, cells))
        if any(cells):
            yield begin, cells
        begin = reader.line_num + 1


def _lines(text: str) -> Iterator[str]:
    """Yield lines with their ends; all at once, or a stream, would take four times the memory."""
    begin = 0
    while begin < len(text):
        end = text.find("\n", begin) + 1 or len(text)
        yield text[begin:end]
        begin = end


def _too_many(file: Path, count: int, most: int, things: str) -> InputError:
    return InputError(f"must have at most {most} {things}", file=file, given=count)


def _unquoted(text: str) -> str:
    """Find the first line that is not blank, without quotations."""
    first = _FIRST.search(text)
    return re.sub(r'"[^"]*"', "", first.group()) if first else ""


def _separator(text: str) -> str:
    """Find the separator: the mark between most numbers of lines of one width, without quotations.

    A comma comes last, as it may be a decimal mark. Without numbers, it is the most frequent mark
    in the first line that is not blank.
    """
    lines = [re.sub(r'"[^"]*"', "", line[:_LOOKED_INTO].rstrip("\n"))
             for line in islice(_lines(text), _LOOKED_AT) if line.strip(" \t;,\n")]

    numbers = Counter[tuple[str, int]]()
    for mark in (";", "\t", ","):
        for cells in (line.split(mark) for line in lines if mark in line):
            numbers[mark, len(cells)] += sum(map(bool, map(_NUMBER_CELL.fullmatch, cells)))
    (best, _), most = max(numbers.items(), key=lambda item: item[1], default=((",", 1), 0))
    return best if most else max(_SEPARATORS, key=_unquoted(text).count)


def decimal_point(cell: str) -> str:
    """Write a number with a decimal comma with a point; leave any other cell as it is."""
    return cell.replace(",", ".") if DECIMAL_COMMA.fullmatch(cell) else cell


def _plain_number(cell: str, decimal: str) -> str:
    """Write a number without thousands separators and with a decimal point; else leave it."""
    if not _WITH_MARKS.fullmatch(cell):
        return cell
    whole, _, rest = cell.partition(decimal)
    groups = re.split(_BETWEEN_THOUSANDS, whole)
    if decimal in rest or any(len(group) != 3 for group in groups[1:]):
        return cell
    return "".join(groups) + (f".{rest}" if rest else "")


def _below_titles(rows: Sequence[Row]) -> tuple[list[str], Sequence[Row]]:
    """Find the titles, the first of the fullest lines below a preamble, and the rows below."""
    full = [sum(map(bool, cells)) for _, cells in rows[:_LOOKED_AT]]
    at = full.index(max(full)) if full else 0
    return (rows[at][1] if rows else []), rows[at + 1:]


def _check_marks(file: Path, rows: Sequence[Row]) -> None:
    """Refuse decimal commas and decimal points in one file.

    In columns whose title has no unit, which may be labels, a point counts only if it may separate
    thousands.
    """
    first: dict[tuple[str, bool], tuple[int, int, str]] = {}
    titles, below = _below_titles(rows)
    units = ["_" in title for title in titles]
    for line, cells in below:
        for place, cell in enumerate(cells[:len(titles)]):
            twofold = THOUSANDS.fullmatch(cell) is not None
            if "," in cell and DECIMAL_COMMA.fullmatch(cell):
                first.setdefault((",", twofold), (line, place, cell))
            elif "." in cell and (twofold or units[place]) and _DECIMAL_POINT.fullmatch(cell):
                first.setdefault((".", twofold), (line, place, cell))
    for suspect, other in ((".", ","), (",", ".")):
        for twofold, plain in ((True, False), (True, True), (False, False)):
            if (suspect, twofold) in first and (other, plain) in first:
                line, place, cell = first[suspect, twofold]
                beside = first[other, plain]
                allowed = (f"{_readings(cell)}, since line {beside[0]} has {beside[2]!r}" if twofold
                           else f"must have the decimal mark of {beside[2]!r} in line {beside[0]}")
                raise TwoMarks(f"{allowed}: write all numbers without thousands separators and "
                                 "with one decimal mark", file=file, given=cell,
                                 key=_place(line, place, titles))


def _check_rounds(file: Path, rows: Sequence[Row]) -> None:
    """Refuse a column with "1.000" and "500": decimals are omitted only where there are none."""
    titles, below = _below_titles(rows)
    for place in range(len(titles)):
        column = [(line, cells[place]) for line, cells in below if place < len(cells)]
        shown = next(((line, cell) for line, cell in column if _ROUND.fullmatch(cell)), None)
        whole = shown and next((item for item in column if _HUNDREDS.fullmatch(item[1])), None)
        if shown and whole:
            raise TwoMarks(f"{_readings(shown[1])}, since line {whole[0]} has {whole[1]!r}: write"
                             " all numbers without thousands separators and with one decimal mark",
                             file=file, given=shown[1], key=_place(shown[0], place, titles))


def _readings(cell: str) -> str:
    return (f"can be read as {re.sub('[.,]', '', cell)} (with a thousands separator) or as "
            f"{float(cell.replace(',', '.')):g} (with a decimal mark)")


def _place(line: int, place: int, titles: Sequence[str]) -> str:
    return f"line {line}, column {place + 1} ({titles[place]})"


def workbook_rows(file: Path, content: bytes) -> list[Row]:
    """Read the rows of a workbook's sheet with the file's name, else of its first one.

    Formulas count with their values when the workbook was saved. Its unpacked size is counted
    before a library reads it.
    """
    needs("openpyxl", "reading a workbook")
    from openpyxl import load_workbook

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl warns of styles and links it drops
            _count_workbook(file, content)
            book = load_workbook(io.BytesIO(content), read_only=True, data_only=True)
            names = {sheet.title.lower(): sheet for sheet in book.worksheets}
            sheet = names.get(file.stem.lower()) or book.worksheets[0]
            sheet.reset_dimensions()  # the declared ones may be wrong
            rows = _filled(file, sheet.iter_rows(values_only=True))
            others = [other.title for other in book.worksheets if other is not sheet]
    except (InputError, MemoryError):
        raise
    except Exception:  # a broken archive or its XML may raise anything
        raise InputError("is no workbook that can be read: it is damaged, or of another kind; save "
                         "it again as .xlsx, or as CSV in UTF-8", file=file) from None
    if others and not rows:
        raise InputError("is empty; there are also the sheets " + ", ".join(map(repr, others))
                         + f": call the one to be read {file.stem!r}, or put it first", file=file,
                         key=f"sheet {sheet.title!r}")
    width = max((len(row) for _, row in rows), default=0)
    if width * len(rows) > _MOST_CELLS:
        raise _too_many(file, width * len(rows), _MOST_CELLS, "cells")
    return [(line, row + [""] * (width - len(row))) for line, row in rows]


def _other_sheets(file: Path, content: bytes) -> str:
    """Name the sheets of a workbook that are not read and have cells.

    Loading them takes as long as reading them all; finding their names and cells does not.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        listed = [dict(_ATTRIBUTE.findall(tag))
                  for tag in _SHEET.findall(archive.read(_SHEETS).decode("utf-8", "replace"))]
        tags = _PLACE.findall(archive.read(_PLACES).decode("utf-8", "replace"))
        places = {place.get("Id", ""): place.get("Target", "")
                  for place in (dict(_ATTRIBUTE.findall(tag)) for tag in tags)}
        names = [unescape(sheet.get("name", "")) for sheet in listed]
        if file.stem.lower() in map(str.lower, names):
            return ""  # a sheet with the file's name is meant
        parts = (next((places.get(value, "") for key, value in sheet.items()
                       if key.endswith(":id")), "") for sheet in listed)
        others = [name for name, part in list(zip(names, parts, strict=True))[1:]
                  if _has_cells(archive, part)]
    if not others:
        return ""
    return (f"only the sheet {names[0]!r} is read; there are also "
            f"{', '.join(map(repr, others))}: if these have readings, copy their lines below those "
            "of the first, with the specimen in a column")


def _has_cells(archive: zipfile.ZipFile, place: str) -> bool:
    """Check whether a sheet of a workbook has a cell that is not blank."""
    part = place.lstrip("/") if place.startswith("/") else f"xl/{place}"
    if "worksheets/" not in part or part not in archive.namelist():
        return False  # a sheet with only a diagram
    with archive.open(part) as stream:
        before = b""
        while chunk := stream.read(_CHUNK):
            if _CELL.search(before + chunk):
                return True
            before = chunk[-_NAME:]
    return False


def _count_workbook(file: Path, content: bytes) -> None:
    """Refuse a workbook that unpacks to too much, by declared sizes, then by tags."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = [part for part in archive.infolist() if not part.filename.startswith("xl/media/")]
        if (size := sum(part.file_size for part in parts)) > STORED:
            raise InputError(f"must unpack to at most {STORED / 1e6:g} MB", file=file,
                             given=f"{size / 1e6:.0f} MB")
        tags = {_MOST_TAGS: 0, _MOST_OTHER_TAGS: 0}
        for part in parts:
            most = _MOST_TAGS if _CELLS.search(part.filename) else _MOST_OTHER_TAGS
            with archive.open(part) as stream:
                while chunk := stream.read(_CHUNK):
                    tags[most] += chunk.count(b"<")
                    if tags[most] > most:
                        raise InputError(f"must have at most {most} tags in {part.filename}",
                                         file=file)
                    if b"<!" in chunk and (b"<!DOCTYPE" in chunk or b"<!ENTITY" in chunk):
                        raise InputError("is no workbook: its XML defines words of its own",
                                         file=file)


def _filled(file: Path, cells: Iterator[Sequence[Any]]) -> list[Row]:
    """List the rows that are not blank, without the blank cells after their last one."""
    rows = []
    for line, values in enumerate(cells, start=1):
        if line > _MOST_ROWS:
            raise InputError(f"must have at most {_MOST_ROWS} rows", file=file)
        row = [_text(value) for value in values]
        while row and not row[-1]:
            row.pop()
        if len(row) > _MOST_COLUMNS:
            raise _too_many(file, len(row), _MOST_COLUMNS, "columns")
        if row:
            rows.append((line, row))
    return rows


def _text(cell: Any) -> str:
    return "" if cell is None else str(cell).strip()


FORMATS.register(Format(
    ".csv", "text with commas, semicolons, tabs or blanks between cells, and decimal commas where "
    "no comma stands between them; in UTF-8, UTF-16 or Windows-1252", text_rows))
FORMATS.register(Format(
    ".xlsx", "a workbook: its sheet that is called as the file is, else its first one",
    workbook_rows, unread=_other_sheets))


def unfolded(file: Path, rows: Sequence[Row]) -> list[Row] | None:
    """Unfold a wide table to one row for each reading; None if the table is not wide.

    Columns of a wide table are called "SPECIMEN MASS NAME_UNIT", with "up" or "down" appended for
    the direction of the voltage, as in "circle 17.9 g displacement_mm"; other columns hold for all
    of a row's readings. Blank cells are no readings; a column that occurs again is a repeat.

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
    width = len(common) + len(marks) + len(values)
    if (count := len(below) * len(groups) * width) > _MOST_CELLS:
        raise _too_many(file, count, _MOST_CELLS, "cells when it is unfolded")
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
    """Group the marks of readings that share a row, with the places of their values by title."""
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


load_later("tympan.formats", FORMATS)
