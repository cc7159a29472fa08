"""Layouts of tables by other writers: headings, and their meanings.

A :class:`Layout` is ``[columns.static]`` of a dataset.toml. Everything it does not state is found:
the line of the headings, and the columns by the words of :attr:`Column.also`. A heading with
several meanings is refused, with the line to write.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Annotated, Literal

from tympan.base.errors import InputError, did_you_mean
from tympan.base.fields import Key, asks, fields_of, read
from tympan.base.toml_reader import POSITIVE, Rule, Table
from tympan.base.units import any_quantity
from tympan.tables.column import (
    NUMBER,
    Column,
    Heading,
    Meaning,
    quantity_of,
    usual_unit,
)
from tympan.tables.formats import COMMENT, Row

#: Lines in which headings are searched: preambles of testers have some 60.
SEARCHED = 200
#: Least number of known headings in a line of headings: a preamble may have one by chance.
ENOUGH = 2
#: The end of a quantity, such as "mass 20 g", which is no heading.
_QUANTITY = re.compile(r"\d\s*[^\W\d]+$")
#: Most characters of a line that are shown.
_SHOWN = 80
#: Most ranges of lines that are listed.
_RANGES = 4
#: Sizes of a test piece as examples in messages.
_SIZES = {"area": "18 mm^2", "length": "30 mm"}
_SCALE: Rule = (lambda x: x > 0, "must be positive: sign says which way the numbers count")
_LINE: Rule = (lambda x: x >= 1, "must be the number of a line, from 1 on")
_TITLES: Rule = (lambda x: x >= 0, "must be the number of a line, from 1 on, or 0: no line has "
                                   "headings, and the columns are called \"1\", \"2\", …")


@asks
@dataclass(frozen=True)
class Stated:
    """Place of the values of one column, as the user states it.

    ``title`` is tympan's name with the unit of the numbers, such as ``displacement_mm``.
    """

    title: str
    heading: Annotated[str, Key("the heading in the file", name="from")] = ""
    sign: Annotated[Literal["down", "up"], Key(
        "up: the file's numbers count the other way, such as heights where deflections are wanted"
        )] = "down"
    value: Annotated[str, Key("one value for the whole file, in place of a heading")] = ""
    zero: Annotated[float, Key(
        "the file's number where the column is 0, such as a sensor's reading of the flat film"
        )] = 0.0
    scale: Annotated[float | None, Key(
        "what 1 in the file is in the unit of the name, such as 0.5 for a sensor of 0.5 mm/V; the "
        "unit in the heading then does not count", rule=_SCALE, default="by the units")] = None


@asks
@dataclass(frozen=True)
class Layout:
    """Layout of a file of readings with headings other than tympan's.

    ``columns`` are stated; others are found by their headings.
    """

    file: Annotated[str, Key("the file's name, where it is another one")] = ""
    titles_line: Annotated[int | None, Key(
        "line of the headings; 0: there is none, and the columns are called 1, 2, …",
        rule=_TITLES, default="the first with known ones")] = None
    skip_lines: Annotated[tuple[int, ...], Key(
        "further lines to leave out, by their numbers", rule=_LINE)] = ()
    decimal: Annotated[Literal[",", "."] | None, Key(
        "the decimal mark; the other one then separates thousands", default="found")] = None
    area: Annotated[float | None, Key(
        "cross-section of the test piece before it is stretched: makes stresses of forces", "area",
        POSITIVE)] = None
    length: Annotated[float | None, Key(
        "length of the test piece before it is stretched: makes stretches of displacements",
        "length", POSITIVE)] = None
    unit: Annotated[str, Key(
        "unit of the columns that it fits and whose heading has none")] = ""
    missing: Annotated[tuple[str, ...], Key(
        "cells that count as blank; a line without a needed reading is left out")] = ()
    fill: Annotated[tuple[str, ...], Key(
        "headings of columns in which a blank cell has the value above, as merged cells leave it"
        )] = ()
    ignore: Annotated[tuple[str, ...], Key("headings of columns to leave out")] = ()
    columns: tuple[Stated, ...] = ()

    @classmethod
    def from_table(cls, table: Table) -> Layout:
        """Read the layout that a table of a dataset.toml states."""
        own = {field.key for field in fields_of(cls)}
        titles = [key for key in table.data if key not in own]
        columns = tuple(_stated(table, title) for title in titles)
        table.asked.update(titles)
        return replace(read(cls, table), columns=columns)


def _stated(table: Table, title: str) -> Stated:
    """Read a column stated by its heading alone, or by a table."""
    if not isinstance(table.data[title], Mapping):
        return Stated(title, table.text(title))
    part = table.table(title)
    if isinstance(part.data.get("value"), int | float):  # TOML allows a number here
        part = replace(part, data=dict(part.data) | {"value": str(part.data["value"])})
    values = {key: part.text(key) for key in ("from", "value") if key in part}
    sign = part.choice("sign", {"down": "down", "up": "up"}, "down")
    zero = part.number("zero", default=0.0)
    scale = part.number("scale", rule=_SCALE) if "scale" in part else None
    part.done()
    if len(values) != 1:
        raise table.error(title, 'must say where its values are: { from = "a heading" }, or one '
                                 "value for all rows: { value = … }", table.data[title])
    return Stated(title, values.get("from", ""), sign,  # type: ignore[arg-type]
                  values.get("value", ""), zero, scale)


@dataclass(frozen=True)
class Source:
    """Source of a column: a ``place`` in each row, or a ``constant``.

    ``per`` names the size of the test piece by which its numbers were divided.
    """

    column: Column
    place: int | None
    factor: float = 1.0
    offset: float = 0.0
    constant: str = ""
    per: str = ""


@dataclass(frozen=True)
class Header:
    """The headings of a table: their line and words, the sources of the columns, and remarks.

    ``above`` is the number of rows before it; ``without`` are other lines without readings; in the
    columns at ``fill`` a blank cell has the value above; ``foreign``: no heading is tympan's.
    """

    line: int
    titles: tuple[str, ...]
    sources: tuple[Source, ...]
    above: int = 0
    without: frozenset[int] = frozenset()
    missing: frozenset[str] = frozenset()
    fill: tuple[int, ...] = ()
    foreign: bool = False
    remarks: tuple[str, ...] = ()

    def rows(self, rows: Callable[[], Iterable[Row]]) -> Iterator[Row]:
        """Yield the titles and the rows below, of equal width, except rows that lack a reading."""
        yield self.line, list(self.titles)
        for line, cells in self.below(rows):
            if not self.lacking(cells):
                yield line, cells

    def below(self, rows: Callable[[], Iterable[Row]]) -> Iterator[Row]:
        """Yield the rows below the titles, also those that lack a reading."""
        above = dict.fromkeys(self.fill, "")
        for line, cells in islice(rows(), self.above + 1, None):
            if self.foreign:
                cells = _as_wide(cells, len(self.titles))
            if self.missing:
                cells = ["" if cell in self.missing else cell for cell in cells]
            if above:  # lines to leave out count too: the first cell of a block holds for all of it
                cells = list(cells)
                for place in (place for place in above if place < len(cells)):
                    cells[place] = above[place] = cells[place] or above[place]
            if line not in self.without:
                yield line, cells

    def lacking(self, cells: Sequence[str]) -> list[int]:
        """Find places of required cells that are blank, where such a row is left out."""
        return [source.place for source in self.sources if self.missing
                and source.column.required and source.place is not None
                and source.place < len(cells) and not cells[source.place]]


def first_numbers(rows: Sequence[Row]) -> int | None:
    """Find the index of the first row with several numbers; None if there is none."""
    return next((at for at, (_, cells) in enumerate(rows)
                 if sum(NUMBER.fullmatch(cell) is not None for cell in cells) >= ENOUGH), None)


def titles_above_numbers(rows: Sequence[Row]) -> int | None:
    """Find the line of unknown headings: the first of the lines as wide directly above numbers.

    Of lines behind a comment mark it is the last one. It is 0 where there is none, and None where
    no line has numbers.
    """
    at = first_numbers(rows)
    if at is None:
        return None
    width, lines = len(rows[at][1]), list[Row]()
    for row in reversed(rows[:at]):
        if len(row[1]) != width or not all(row[1]) or any(map(NUMBER.fullmatch, row[1])):
            break
        lines.append(row)
    plain = [line for line, cells in lines if not COMMENT.match(cells[0])]
    return plain[-1] if plain else lines[0][0] if lines else 0


def in_blocks(cells: Sequence[str]) -> bool:
    """Check whether cells stand only in the first row of each block, as merged ones do."""
    return bool(cells and cells[0]) and 2 * sum(not cell for cell in cells) >= len(cells)


def _si_unit(cell: str) -> tuple[float, str] | None:
    """Find SI value and dimension of a heading's unit, or of a unit alone; None without one."""
    unit = next((unit for unit in (Heading.of(cell).unit, cell.strip("[]() "))
                 if quantity_of(unit)), "")
    return any_quantity(f"1 {usual_unit(unit)}") if unit else None


def _as_wide(cells: list[str], width: int) -> list[str]:
    """Remove blank cells beyond the last heading, and add those that a line omits."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells + [""] * (width - len(cells))


@dataclass(frozen=True)
class Reader:
    """Finder of the header of a file that may have some ``columns``.

    ``table`` is its name in a dataset.toml, "" for a file read alone; ``usual`` has values that
    hold where no heading gives them, by the names of columns. If ``lenient``, unknown headings
    beside tympan's are ignored, the first of equally good ones is taken, and a line of headings may
    be recognised by units alone.
    """

    file: Path
    columns: Sequence[Column]
    layout: Layout = Layout()
    table: str = ""
    usual: Mapping[str, str] = ()  # type: ignore[assignment]
    lenient: bool = False

    def header(self, rows: Iterable[Row]) -> Header:
        """Find the header of a table with these rows.

        Raises
        ------
        InputError
            Where no line has known headings, a column is missing, or one has two meanings.
        """
        first = list(islice(rows, SEARCHED))
        if not first:
            raise InputError("is empty: a first line with the names of the columns is needed",
                             file=self.file)
        at = self._titles_at(first)
        line, titles = self._untitled(first[at + 1]) if self.layout.titles_line == 0 else first[at]
        self._require_headings_read(line)
        titles, units = self._with_units(titles, first[at + 1:at + 2])
        without = frozenset(self.layout.skip_lines) | units
        stated = self._stated_sources(line, titles)
        taken = {source.place for source in stated}
        used = [place for place, title in enumerate(titles)
                if place not in taken and title not in self.layout.ignore]
        own = [place for place in used
               if any(column.claims(titles[place]) for column in self.columns)]
        foreign = not own
        found = [*stated]
        for place in own:
            found.append(self._own(line, titles, place, found))
        free = [place for place in used if place not in own]
        guessed, lacks = self._guessed(line, titles, free, [source.column for source in found])
        found += guessed
        left = [place for place in free if place not in {source.place for source in guessed}]
        strict = own and not (self.lenient
                              or any(stated.heading for stated in self.layout.columns))
        for place in left if strict else ():
            self._refuse(line, titles, place)
        have = {source.column.name for source in found}
        found += [Source(column, None, constant=self.usual[column.name]) for column in self.columns
                  if column.name in self.usual and column.name not in have
                  and (foreign or column.required)]
        self._require(line, titles, found, lacks, left)
        fill = tuple(self._place(heading, line, titles) for heading in self.layout.fill)
        remarks: tuple[str, ...] = ()
        if guessed or at or foreign:
            remarks = (self._remark(line, titles, found, left),)
        return Header(line, tuple(titles), tuple(found), at, without,
                      frozenset(self.layout.missing), fill,
                      foreign or bool(self.layout.columns), remarks)

    def _require_headings_read(self, line: int) -> None:
        """Refuse a layout that leaves out what it needs: the line of the headings, or a column."""
        layout, key = self.layout, f"columns.{self.table}"
        if line in layout.skip_lines and layout.titles_line != 0:
            raise InputError("has the headings, which are read: leave it out of skip_lines, or say "
                             "with titles_line where the headings are", file=self.file,
                             key=f"{key}.skip_lines", given=line)
        for use, headings in (("read", [stated.heading for stated in layout.columns]),
                              ("filled", layout.fill)):
            for heading in {*headings} & {*layout.ignore}:
                raise InputError(f"is ignored and {use}: leave it out of `ignore`, or write no "
                                 "line that names it", file=self.file, key=f"{key}.ignore",
                                 given=heading)

    def chosen(self, rows: Iterable[Row]) -> Header:
        """Find the header of a table of which only columns with tympan's own titles are read."""
        line, titles = next(iter(rows), (0, []))
        if not titles:
            raise InputError("is empty: a first line with the names of the columns is needed",
                             file=self.file)
        named = {column.title for column in self.columns}
        found: list[Source] = []
        for place in (place for place, title in enumerate(titles) if title in named):
            found.append(self._own(line, titles, place, found))
        self._require(line, titles, found, {}, [])
        return Header(line, tuple(titles), tuple(found))

    def left_out(self, header: Header, rows: Callable[[], Iterable[Row]]) -> tuple[str, ...]:
        """Remark on rows that are left out for blank cells, if there are any, and on what to do."""
        if not header.missing:
            return ()
        below = list(header.below(rows))
        lacking = [(line, header.lacking(cells)) for line, cells in below]
        lines: dict[int, list[int]] = {}
        for line, places in lacking:
            for place in places:
                lines.setdefault(place, []).append(line)
        if not lines:
            return ()
        self._require_one_unit(header, rows, {line for line, places in lacking if places})
        where = "; ".join(f"{header.titles[place]!r} in {_ranges(found)}"
                          for place, found in sorted(lines.items()))
        blocks = [header.titles[place] for place in sorted(lines)
                  if in_blocks([cells[place] for _, cells in below if place < len(cells)])]
        advice = "if there are values, write them into the cells"
        if blocks:
            fill = ", ".join(f'"{title}"' for title in blocks)
            written = self._write(None, f"fill = [{fill}]", "write it into the cells")
            advice = f"if the value above holds there, {written}"
        count = sum(bool(places) for _, places in lacking)
        return (f"{self.file.name}: {count} of {len(below)} lines are left out because needed "
                f"cells are blank: {where}; {advice}",)

    def _require_one_unit(self, header: Header, rows: Callable[[], Iterable[Row]],
                          left_out: Container[int]) -> None:
        """Refuse headings that occur again among the readings, with another unit."""
        factors = {source.place: _si_unit(header.titles[source.place])
                   for source in header.sources if source.place is not None}
        for line, cells in islice(rows(), header.above + 1, None):
            for place, unit in factors.items() if line in left_out else ():
                again = _si_unit(cells[place]) if place < len(cells) else None
                if unit and again and unit != again and unit[1] == again[1]:
                    raise InputError(
                        f"is a heading in another unit than {header.titles[place]!r} in line "
                        f"{header.line}: write the readings below it in the unit of that, or into "
                        "a file of their own", file=self.file, key=f"line {line}",
                        given=cells[place])

    def advice_on(self, cell: str, line: int, title: str) -> str:
        """Advise to leave out a cell that is no number, or its line, or to fill it."""
        if not self.table:
            return ""
        if any(mark.isdigit() for mark in cell):
            return "; correct it, or " + self._write(None, f"skip_lines = [{line}]", "")
        filled = "" if cell else f' or, if the value above holds, fill = ["{title}"]'
        return "; " + self._write(
            None, f'missing = ["{cell}"] or skip_lines = [{line}]{filled}', "")

    def advice_on_marks(self, cell: str) -> str:
        """Advise to state a file's decimal mark in dataset.toml."""
        if not self.table:
            return ""
        mark = "." if "," in cell else ","
        return "; or " + self._write(None, f'decimal = "{mark}"', "")

    def _titles_at(self, first: Sequence[Row]) -> int:
        """Find the index of the row with the headings, among the first ones."""
        layout = self.layout
        wanted = layout.titles_line
        if wanted == 0:
            if (at := first_numbers(first)) is not None:
                return at - 1
            raise InputError("is 0, but no line has two numbers: write the line of the headings",
                             file=self.file, key="titles_line", given=wanted)
        if wanted is not None:
            for at, (line, _) in enumerate(first):
                if line == wanted:
                    return at
            raise InputError("must be a line of the file that is not blank, among its first "
                             f"{SEARCHED}", file=self.file, key="titles_line", given=wanted)
        headings = {column.heading for column in layout.columns if column.heading}
        if headings:
            for at, (_, titles) in enumerate(first):
                following = first[at + 1:at + 2]
                if headings <= {*titles, *self._with_units(titles, following)[0]}:
                    return at
            raise self._no_heading(first, headings)
        best, most = 0, (0, 0)
        for at, (_, titles) in enumerate(first):
            if at == 0 and any(column.claims(title) for title in titles for column in self.columns):
                return at
            if most[1] and sum(bool(NUMBER.fullmatch(cell)) for cell in titles) >= ENOUGH:
                break
            known = self.known(self._with_units(titles, first[at + 1:at + 2])[0])
            units = sum(bool(Heading.of(title).unit) for title in known)
            if len(known) >= ENOUGH and (units, len(known)) > most:  # a title may mention columns
                best, most = at, (units, len(known))
        return best

    @staticmethod
    def _untitled(row: Row) -> Row:
        """Call the columns of a row of readings by their numbers, from 1 on."""
        return row[0], [str(place + 1) for place in range(len(row[1]))]

    def _no_heading(self, first: Sequence[Row], headings: set[str]) -> InputError:
        best = max(first, key=lambda row: len(headings & {*row[1]}) + sum(map(self._known, row[1])))
        heading = next(iter(sorted(headings - {*best[1]})), "")
        near = did_you_mean(heading, {title: repr(title) for _, row in first for title in row})
        listed = _listed(best[1]) if len(best[1]) >= ENOUGH else "no line has several cells"
        return InputError(f"has no line with this heading: {near}{listed}",
                          file=self.file, key=f"line {best[0]}", given=heading)

    def known(self, titles: Sequence[str]) -> list[str]:
        """List the headings that are recognised by their words.

        A lenient reader also recognises them by their units, if no number stands in their line.
        """
        by_unit = self.lenient and not any(map(NUMBER.fullmatch, titles))
        return [title for title in titles
                if self._known(title) or (by_unit and self._of_a_unit(title))]

    def _known(self, title: str) -> bool:
        words = Heading.of(title).words
        return any(column.claims(title) or column.knows(words) for column in self.columns)

    def _of_a_unit(self, title: str) -> bool:
        """Check whether a heading with any words has a unit of one of the columns."""
        heading = Heading.of(title)
        dimension = quantity_of(heading.unit)
        return (bool(heading.words and dimension) and not _QUANTITY.search(title)
                and any(column.dimension == dimension for column in self.columns))

    @staticmethod
    def _with_units(titles: Sequence[str], below: Sequence[Row]
                    ) -> tuple[list[str], frozenset[int]]:
        """Add the units of the line below to the headings, if it has only units; number it."""
        for line, cells in below:
            units = [cell.strip("[]() ") for cell in cells]
            said = [unit for unit in units if unit]
            if (said and len(cells) <= len(titles)
                    and all(usual_unit(unit) and not NUMBER.fullmatch(unit) for unit in said)):
                merged = [f"{title} ({unit})" if unit and not Heading.of(title).unit else title
                          for title, unit in zip(titles, units, strict=False)]
                return [*merged, *titles[len(merged):]], frozenset({line})
        return list(titles), frozenset()

    def _stated_sources(self, line: int, titles: Sequence[str]) -> list[Source]:
        sources: list[Source] = []
        for stated in self.layout.columns:
            column = next((item for item in self.columns if item.claims(stated.title)), None)
            if column is None:
                names = {item.title: repr(item.title) for item in self.columns}
                raise InputError(f"unknown column: {did_you_mean(stated.title, names)}known are "
                                 f"{', '.join(names)}", file=self.file,
                                 key=f"columns.{self.table}", given=stated.title)
            if any(column is source.column for source in sources):
                raise InputError(f"one column of {column.name} only, whatever its unit",
                                 file=self.file, key=f"columns.{self.table}", given=stated.title)
            sign = -1.0 if stated.sign == "up" else 1.0
            factor = sign * column.factor(stated.title)
            if not stated.heading:
                sources.append(Source(column, None, factor, constant=stated.value))
                continue
            place = self._place(stated.heading, line, titles)
            source = (self._converted(column, place, factor, stated, titles[place])
                      if stated.scale is None else Source(column, place, factor * stated.scale))
            sources.append(replace(source, offset=source.offset - stated.zero * source.factor))
        return sources

    def _place(self, heading: str, line: int, titles: Sequence[str]) -> int:
        """Find the place of a stated heading in the line of the headings."""
        place = next((place for place, title in enumerate(titles)
                      if title == heading or title.startswith(f"{heading} (")), None)
        if place is None:
            raise self._no_heading([(line, [*titles])], {heading})
        return place

    def _converted(self, column: Column, place: int, factor: float, stated: Stated, title: str
                   ) -> Source:
        """Convert a stated column by the unit in its heading, else by that in its key."""
        meaning = None if column.unit else self._meaning(column, title)
        if isinstance(meaning, Source):
            return replace(meaning, place=place, factor=meaning.factor * factor)
        unit = usual_unit(Heading.of(title).unit)
        for item in column.also if unit else ():
            own = item.factor(unit or "")
            if own is None or (own != abs(factor) and not item.per and column.unit):
                continue
            return Source(column, place, math.copysign(own, factor) / self._size(item, stated),
                          item.offset)
        if unit and column.also:
            raise InputError(f"has the unit {unit}, which is not that of {stated.title}: convert "
                             "the numbers in the table and write their unit into the heading",
                             file=self.file, key=f"columns.{self.table}", given=stated.heading)
        return Source(column, place, factor)

    def _size(self, meaning: Meaning, stated: Stated) -> float:
        """Find the number by which numbers of a meaning are divided."""
        size: float | None = getattr(self.layout, meaning.per) if meaning.per else 1.0
        if size is None:
            raise InputError(f"needs the {meaning.per} of the test piece, such as "
                             f'{meaning.per} = "{_SIZES[meaning.per]}"', file=self.file,
                             key=f"columns.{self.table}", given=stated.heading)
        return size

    def _meaning(self, column: Column, title: str) -> Source | str | None:
        """Find the meaning of a heading in a column, or the missing key; None if it has none."""
        heading, lacking = Heading.of(title), None
        for meaning in column.also:
            if heading.words not in meaning.words:
                continue
            if column.choices is not None:
                return None if quantity_of(heading.unit) else Source(column, 0)
            factor = meaning.factor(heading.unit)
            if factor is None and not heading.unit and self.layout.unit:
                factor = meaning.factor(self.layout.unit)
            if factor is None:
                lacking = lacking or ("unit" if not heading.unit else None)
                continue
            if meaning.per:
                size: float | None = getattr(self.layout, meaning.per)
                if size is None:
                    lacking = meaning.per
                    continue
                factor /= size
            return Source(column, 0, factor, meaning.offset, per=meaning.per)
        return lacking

    def _rank(self, column: Column, title: str) -> int:
        heading = Heading.of(title)
        return next(rank for rank, meaning in enumerate(column.also)
                    if heading.words in meaning.words)

    def _own(self, line: int, titles: Sequence[str], place: int, before: Sequence[Source]
             ) -> Source:
        """Read a column under one of tympan's titles."""
        title = titles[place]
        try:
            column = next(item for item in self.columns if item.claims(title))
            if title in titles[:place]:
                raise InputError("is there twice")
            if any(column is source.column for source in before):
                raise InputError(f"one column of {column.name} only, whatever its unit")
            return Source(column, place, column.factor(title))
        except InputError as error:
            raise error_at(self.file, line, titles, place, error.allowed) from None

    def _guessed(self, line: int, titles: Sequence[str], free: Sequence[int],
                 have: Sequence[Column]) -> tuple[list[Source], dict[str, tuple[str, int]]]:
        """Find columns by the words of their headings; and the missing keys of others."""
        sources: list[Source] = []
        lacks: dict[str, tuple[str, int]] = {}
        for column in self.columns:
            if any(column is other for other in have):
                continue
            fitting: dict[int, list[Source]] = {}
            for place in free:
                meaning = self._meaning(column, titles[place])
                if isinstance(meaning, str):
                    lacks.setdefault(column.name, (meaning, place))
                elif meaning is not None:
                    fitting.setdefault(self._rank(column, titles[place]), []).append(
                        replace(meaning, place=place))
            if fitting:
                best = fitting[min(fitting)]
                if self.lenient:
                    best = best[:1]
                if len(best) > 1 and column.required:
                    names = " or ".join(repr(titles[source.place or 0]) for source in best)
                    raise InputError(
                        f"can be {names}: " + self._write(
                            column, f'{column.title} = "{titles[best[0].place or 0]}"',
                            f"call one of them {column.title}"),
                        file=self.file, key=f"line {line}", given=column.title)
                if len(best) == 1:
                    sources += best
        return sources, lacks

    def _refuse(self, line: int, titles: Sequence[str], place: int) -> None:
        """Refuse an unknown heading in a table with tympan's headings."""
        title = titles[place]
        known = [column.title for column in self.columns]
        named = next((column for column in self.columns if column.name == title), None)
        if named is not None:
            allowed = f"has no unit: write it into the name, such as {named.title}"
        elif not title:
            allowed = "must have a name: every column needs one"
        else:
            hint = did_you_mean(title.lower(), {name.lower(): repr(name) for name in known})
            allowed = f"unknown column: {hint}known are {', '.join(known)}"
            if self.table:
                allowed += "; " + self._write(None, f'ignore = ["{title}"]', "")
        raise error_at(self.file, line, titles, place, allowed)

    def _require(self, line: int, titles: Sequence[str], found: Sequence[Source],
                 lacks: Mapping[str, tuple[str, int]], left: Sequence[int]) -> None:
        """Refuse a table without a required column."""
        have = {source.column.name for source in found}
        absent = [column for column in self.columns
                  if column.required and column.name not in have]
        if not absent:
            return
        places = [source for source in found if source.place is not None]
        if not places and not lacks:
            raise InputError("has no heading that is known: expected is a line with "
                             f"{', '.join(column.title for column in absent)}; "
                             + self._write(absent[-1], f'{absent[-1].title} = "its heading"',
                                           "call the columns so, in a line of headings with "
                                           "commas, semicolons or tabs between them"),
                             file=self.file, key=f"line {line}",
                             # A file that is no table is not quoted: it may contain anything.
                             given=(", ".join(titles)[:_SHOWN] if len(titles) >= ENOUGH else None))
        column = next((item for item in absent if item.name in lacks), absent[0])
        words = (f"the column {column.title} is" if len(absent) == 1 else
                 f"the columns {', '.join(item.title for item in absent)} are")
        raise InputError(f"{words} missing{self._advice(column, titles, lacks, left)}",
                         file=self.file, key=f"line {line}", given=", ".join(titles))

    def _advice(self, column: Column, titles: Sequence[str],
                lacks: Mapping[str, tuple[str, int]], left: Sequence[int]) -> str:
        """Advise what to write for a missing column."""
        lack, place = lacks.get(column.name, ("", 0))
        title = titles[place]
        if lack == "unit":
            return (f": {title!r} has no unit; "
                    + self._write(column, f'{column.title} = "{title}"',
                                  "give its unit, such as --unit MPa"
                                  if column.dimension == "stress" else f"call it {column.title}"))
        if lack:
            size = _SIZES[lack]
            return (f": {title!r} needs the {lack} of the test piece; "
                    + self._write(column, f'{lack} = "{size}"', f'give --{lack} "{size}"'))
        if column.choices:
            first, *_ = column.choices
            line = f'{column.title} = {{ value = "{first}" }}'
            return ": " + self._write(column, line, f"give --{column.name} {first}")
        if column.choices is not None:
            return ": " + self._write(column, f'{column.title} = {{ value = "{column.example}" }}',
                                      f"call a column {column.title}")
        rest = next((titles[item] for item in left if titles[item]), "its heading")
        return ": " + self._write(
            column, f'{column.title} = "{rest}" or, if it never changes, '
                    f"{column.title} = {{ value = 0 }}", f"call a column {column.title}")

    def _write(self, column: Column | None, line: str, alone: str) -> str:
        """Say what to write into dataset.toml, or what to do with a file read alone."""
        return (f"write into dataset.toml, below a line [columns.{self.table}]: {line}"
                if self.table else alone)

    def _remark(self, line: int, titles: Sequence[str], found: Sequence[Source],
                left: Sequence[int]) -> str:
        """Remark how the headings were read."""
        named = [f"{source.column.title} is {titles[source.place]!r}" if source.place is not None
                 else f"{source.column.name} is {source.constant}" for source in found]
        rest = ", ".join(repr(titles[place]) for place in left if titles[place])
        others = f"; not read: {rest}" if rest else ""
        return f"{self.file.name}: headings in line {line}: {', '.join(named)}{others}"


def error_at(file: Path, line: int, titles: Sequence[str], place: int, allowed: str) -> InputError:
    """Make an error about one heading."""
    return InputError(allowed, file=file, key=f"line {line}, column {place + 1}",
                      given=titles[place])


def _listed(titles: Sequence[str]) -> str:
    return "headings are " + ", ".join(repr(title) for title in titles if title)[:4 * _SHOWN]


def _ranges(lines: Sequence[int]) -> str:
    """Write lines in words, the first ranges if many: "line 5", "lines 5, 7 to 19 and more"."""
    ranges: list[list[int]] = []
    for line in lines:
        if ranges and line == ranges[-1][-1] + 1:
            ranges[-1][1:] = [line]
        else:
            ranges.append([line])
    shown = ", ".join(" to ".join(map(str, ends)) for ends in ranges[:_RANGES])
    more = " and more" if len(ranges) > _RANGES else ""
    return f"line{'s' if len(lines) > 1 else ''} {shown}{more}"
