"""A first dataset.toml for a user's table: every line is a guess with its reason, to correct."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from tympan.base.command_line import command_line, file_word
from tympan.base.errors import InputError, did_you_mean
from tympan.base.read_file import beside, file_bytes
from tympan.base.units import quantity_text
from tympan.fem.film.library import load_specimen
from tympan.geometry.specimen import Specimen
from tympan.studies.data.coupon import MODES, named_mode
from tympan.studies.data.dataset import FILES, GUESS
from tympan.studies.data.guesses import EXAMPLES, SHOWN, ColumnChoice, Guesses
from tympan.studies.data.preamble import stated_specimen
from tympan.studies.files import write_text
from tympan.tables.cell_units import with_units_above
from tympan.tables.column import NUMBER, Column, Heading, quantity_of
from tympan.tables.formats import DECIMAL_COMMA, Row, TwoMarks, read_rows, unread
from tympan.tables.layouts import (
    ENOUGH,
    SEARCHED,
    Header,
    Layout,
    Reader,
    Source,
    in_blocks,
    titles_above_numbers,
)

#: Kinds of files that are guessed; of equally good ones the first is taken.
_KINDS = ("static", "transient", "force", "coupon", "frequency", "range")
#: Most rows by which the kind of a table is judged: more of them take seconds.
_JUDGED = 20_000
_CORRECT = f"{GUESS} "
#: Columns of settings, where a blank repeats the value above; in other columns a blank is missing.
_SET = ("specimen", "mass", "voltage", "run", "mode")
#: Marks of cells that repeat the value above.
_DITTO = frozenset(('"', "''", "″", "”", "〃", "dito", "ditto", "idem", "id.", "do."))
#: Blanks between columns, as in printed tables.
_BLANKS = re.compile(r"\S(?:\s{2,}|\t)\S")
#: Heading that is a load, as in wide tables.
_LOAD = re.compile(r"\d+(?:[.,]\d+)?\s*k?g")


class Decimal(NamedTuple):
    """A decimal mark that has to be stated, and the reason."""

    mark: str
    why: str


@dataclass(frozen=True)
class Draft:
    """Lines for a table: its :class:`Guesses`, and the decimal mark if stated.

    ``folder``: where its dataset.toml will be; ``stated``: whether the user states the kind;
    ``unread``: parts of the file that have no rows.
    """

    guesses: Guesses
    decimal: Decimal | None
    folder: Path
    stated: bool
    unread: str = ""

    @property
    def file(self) -> Path:
        """The table."""
        return self.guesses.file

    @property
    def header(self) -> Header:
        """The headings of the table."""
        return self.guesses.header

    @property
    def specimens(self) -> Mapping[Path, Specimen]:
        """Specimens whose files are near."""
        return self.guesses.specimens

    @property
    def name(self) -> str:
        """Name of the first specimen, "film" where none is known."""
        return next((film.name for film in self.specimens.values()), "film")

    @property
    def score(self) -> float:
        """Score of its kind."""
        return float("inf") if self.stated else self.guesses.score

    @property
    def likely(self) -> bool:
        """Whether a table without known headings may be of this kind."""
        known = any(choice.column.name in ("force", "frequency", "range")
                    for choice in self.guesses.choices.values() if choice.by != "numbers")
        return known or self.guesses.kind in (
            ("coupon",) if named_mode(self.file) else ("static", "transient"))

    @property
    def text(self) -> str:
        """The lines of a dataset.toml.

        Raises
        ------
        InputError
            Where a heading that is read occurs twice: no line could name one of them.
        """
        self._require_one_of_each()
        lines = ["# A draft: every line is a guess. Correct it, then run: tympan data .",
                 f"name = {_quoted(self.file.stem)}", "", *self._other(),
                 f"[columns.{self.guesses.kind}]", *self._about(), *self._columns(), "",
                 *self._specimens(), *self._gas()]
        return "\n".join(lines) + "\n"

    def _gas(self) -> Iterator[str]:
        """Write the gas under films without plate, for the user to correct."""
        if self.guesses.bare:
            yield ""
            yield "[rig]"
            yield (f'gas_pressure = "? Pa"  # {_CORRECT}of the gas below the film; from below it '
                   "lifts the film, and displacements are negative")

    def _require_one_of_each(self) -> None:
        titles = self.header.titles
        for choice in self.guesses.choices.values():
            places = [str(place + 1) for place, other in enumerate(titles)
                      if other == titles[choice.place]]
            if len(places) > 1:
                raise InputError(f"stands in the columns {' and '.join(places)}: give each a name "
                                 "of its own, or write their readings one below the other",
                                 file=self.file, key=f"line {self.header.line}",
                                 given=titles[choice.place])

    def _other(self) -> Iterator[str]:
        """Write other kinds that the table may be, where its headings do not decide."""
        if self.unread:
            yield f"# {_CORRECT}{self.unread}."
        for doubt, question, kind in () if self.stated else self.guesses.doubts_of_kind():
            again = command_line("data", "--draft", file_word(self.file.name), "--kind", kind)
            yield f"# {_CORRECT}{doubt}."
            yield f"# {question}: {again}"

    def _about(self) -> Iterator[str]:
        if self._named(self.file) != f"{self.guesses.kind}.csv":
            yield f"file = {_quoted(self._named(self.file))}"
        if self.guesses.untitled:
            yield ("titles_line = 0  # no line has headings: the columns are called "
                   f'"1" to "{len(self.header.titles)}"')
        else:
            yield f"titles_line = {self.header.line}  # " + (
                "the line above the numbers" if self.guesses.asked
                else "the first line with known headings")
        if self.decimal:
            yield f"decimal = {_quoted(self.decimal.mark)}  # {_CORRECT}{self.decimal.why}"
        yield from self._skipped()
        if words := self._words():
            yield f"missing = [{', '.join(map(_quoted, words))}]  # cells that are no numbers"
        if filled := [self.header.titles[place] for place in self.header.fill]:
            yield (f"fill = [{', '.join(map(_quoted, filled))}]  # stands only in the first row of "
                   "each block: blank cells have the value above")
        places = {*self.guesses.unknown, *self.guesses.others} - {
            self._naming, *self._labels, *self.guesses.possible, *self.guesses.unnamed,
            *(choice.place for choice in self.guesses.choices.values())}
        if left := [self.header.titles[place] for place in sorted(places, key=lambda one: one or 0)
                    if place is not None and self.header.titles[place] != self.guesses.numbering]:
            yield f"ignore = [{', '.join(map(_quoted, left))}]  # no column is known by these names"

    def _skipped(self) -> Iterator[str]:
        """Write the lines that are summaries, and those that another column excludes."""
        sums, uncounted = self.guesses.summaries, self.guesses.uncounted
        wordy = self.guesses.wordy
        said = list(dict.fromkeys(sums.values()))[:SHOWN]
        why = ["words below the headings"] * bool(wordy)
        why += [f"lines that sum others up: {', '.join(said)}"] * bool(said)
        doubts = list(dict.fromkeys(uncounted.values()))[:SHOWN]
        if sums or uncounted or wordy:
            lines = ", ".join(map(str, sorted({*sums, *uncounted, *wordy})))
            yield f"skip_lines = [{lines}]  # " + (
                f"{_CORRECT}look whether they are readings: " * bool(doubts)
                + "; ".join((*doubts, *why)))

    def _columns(self) -> Iterator[str]:
        sources, choices = self.guesses.sources, self.guesses.choices
        for size in dict.fromkeys(source.per for source in sources.values() if source.per):
            yield self._size(size)
        for column in self.guesses.columns:
            source = sources.get(column.name)
            if column.name in choices:
                yield self._chosen(choices[column.name], source)
            elif source is not None and source.place is not None:
                title = self.header.titles[source.place]
                yield f"{column.title} = {_quoted(title)}  # {title!r} is known as {column.name}"
            elif column.name == "specimen":
                yield self._of_all_rows(column)
            elif column.required and not (column.name == "mass" and self.guesses.bare):
                yield self._absent(column)

    def _chosen(self, choice: ColumnChoice, source: Source | None) -> str:
        """Write the line that reads a column from a heading, with a sign where it may have one."""
        column, title = choice.column, self.header.titles[choice.place]
        unit = self.guesses.unit_of(choice)
        why = (f"{title!r} is known as {column.name}" if choice.by == "words"
               else f"the only column in a unit of {column.dimension}")
        doubts = list(self.guesses.doubts(choice))
        said = f"{_CORRECT}{'; '.join(doubts)}" if doubts else why
        if source is not None and (not column.unit or source.per):
            return f"{column.title} = {_quoted(title)}  # {said}" + (
                "" if doubts else ", by its words and unit")
        key = f"{column.name}_{unit}" if unit.isalpha() else column.title
        if source is not None and (
                not column.claims(key) or abs(column.factor(key) / source.factor - 1) > 1e-9):
            return f"# {column.title}: {why}; its unit is read from the heading" + (
                f". {said}" if doubts else "")
        key = key if column.claims(key) else column.title
        sign = self.guesses.sign(choice)[0]
        if column.name == "voltage" and sign == "up":
            return (f'{key} = {{ from = {_quoted(title)}, sign = "up" }}  # {said}; the film\'s '
                    "pull has no sign, and all of these are negative")
        if column.name not in ("displacement", "force"):
            return f"{key} = {_quoted(title)}  # {said}"
        return f'{key} = {{ from = {_quoted(title)}, sign = "{sign}" }}  # {said}'

    @cached_property
    def _naming(self) -> int | None:
        """Index of the column of specimens: by its heading, else by cells that name films here."""
        by_heading = self.guesses.sources.get("specimen")
        chosen = {choice.place for choice in self.guesses.choices.values()}
        by_cells = [place for place in self.guesses.unknown if place not in chosen and any(
            self._file_of(name) for name in self.guesses.labels(place))]
        return by_heading.place if by_heading else next(iter(by_cells), None)

    def _of_all_rows(self, column: Column) -> str:
        """Write the line of the specimen without a known heading: a column of names, or one film.

        One film is a guess that a second film, a column of labels, or text above the headings may
        contradict; that text, or the file's name, may say which one.
        """
        if self._naming is not None:
            title = self.header.titles[self._naming]
            return f"{column.title} = {_quoted(title)}  # its cells name specimens that stand here"
        labels = self._labels
        if (film := self._film) is not None and not labels:
            where = next(where for where, label in self._told if self._file_of(label))
            return (f"{column.title} = {{ value = {_quoted(self.specimens[film].name)} }}  # "
                    f"{where} says it")
        line = self._absent(column).partition("  # ")[0]
        if numbering := self.guesses.numbering:
            return (f"{line}  # {_CORRECT}{numbering!r} is taken for the number of a reading; if "
                    f"it is that of a film: {column.title} = {_quoted(numbering)}")
        above = [f"{where} says {label!r}" for where, label in self._told[:-1] if column.required]
        if not labels and not above and len(self.specimens) < 2:
            return f"{line}  # no heading says it"
        line += f"  # {_CORRECT}no heading says it: one film in all rows"
        line += "".join(f"; {words}, and no file of such a specimen stands here" for words in above)
        for place, names in labels.items():
            title = self.header.titles[place]
            line += (f"; if the films are those of {title!r} ({', '.join(names[:SHOWN])}): "
                     f"{column.title} = {_quoted(title)}")
        return line

    @cached_property
    def _labels(self) -> dict[int, list[str]]:
        """Index and labels of the first unknown column that may name several films, if any."""
        if self._naming is not None:
            return {}
        found = ((place, self.guesses.labels(place)) for place in self.guesses.unknown)
        few = len(self.guesses.below) / 2
        return dict([(place, names) for place, names in found if 1 < len(names) <= few][:1])

    @cached_property
    def _film(self) -> Path | None:
        """The file of the specimen that is named above the table or in its file name."""
        files = (self._file_of(label) for _, label in self._told)
        return next((file for file in files if file is not None), None)

    @cached_property
    def _told(self) -> list[tuple[str, str]]:
        """Places outside the columns that may name the specimen, and the names; file name last."""
        above = stated_specimen(self.guesses.above)
        of_file = [("the file's name", self.file.stem)]
        return of_file if above is None else [(f"line {above[0]}", above[1]), *of_file]

    def _absent(self, column: Column) -> str:
        """Write the line of a column without a known heading: a value outside it, or a question."""
        if column.choices is not None:
            value = {"specimen": self.name, "run": "1"}.get(column.name, tuple(column.choices)[:1])
            value = named_mode(self.file).get(column.name, value)
            line = f"{column.title} = {{ value = {_quoted(''.join(value))} }}  # "
            if column.name == "mode" and len(column.choices) > 1 and not named_mode(self.file):
                return (f"{line}{_CORRECT}neither a heading nor the end of the file's name says "
                        f"it: {', '.join(MODES)}")
            if column.name == "run" and (back := self.guesses.run_back()) is not None:
                return (f"{line}{_CORRECT}the time runs back in line {back}: name the column of "
                        "the runs, or write one into the table")
            where = "the file's name" if column.name == "mode" else "no heading"
            return f"{line}{where} says it"
        stated = self.guesses.stated(column.dimension) if column.unit else []
        values = {float(f"{one.value / column.factor(column.title):.9g}") for one in stated}
        places = self.guesses.candidates(column)
        value = (f"{values.pop():.9g}" if len(values) == 1
                 else "0" if column.name == "voltage" and not values and not places else '"?"')
        said = ["no heading says it", *(one.text for one in stated[:SHOWN])]
        lines = self.guesses.lines_for(column)
        if places:
            said[0] = f"several columns have a {column.dimension}"
        if value == '"?"':
            ways = [*lines[:SHOWN]] or [f'{column.title} = "its heading"']
            if column.name in EXAMPLES:
                ways += [f"{column.title} = {{ value = {EXAMPLES[column.name]} }}, if it never "
                         "changes"]
            said += [f"write {' or '.join(ways)}"]
            said += [f"scale is what 1 in its column is in {column.unit}"] * (
                "scale = " in said[-1])
        else:
            heading = next((line for line in lines if "scale" not in line),
                           f'{column.title} = "its heading"')
            said += [f"if it is another value, write that one; if it changes, write {heading}"]
        return f"{column.title} = {{ value = {value} }}  # {_CORRECT}{'; '.join(said)}"

    def _size(self, size: str) -> str:
        sizes = self.guesses.sizes
        if size == "length" and "length" in sizes:
            return f"length = {_quoted(quantity_text(sizes['length'], 'length'))}  # the preamble's"
        if size == "area" and {"thickness", "width"} <= {*sizes}:
            area = 1e6 * sizes["thickness"] * sizes["width"]
            return f'area = "{area:g} mm^2"  # thickness times width, from the preamble'
        usual = {"area": "18 mm^2", "length": "30 mm"}[size]
        return f'{size} = "{usual}"  # {_CORRECT}of the test piece before it is stretched'

    def _words(self) -> list[str]:
        """List cells in columns of numbers that are no numbers, and marks of a value above."""
        choices = self.guesses.choices.values()
        needed = any(choice.column.required for choice in choices)
        words = {cell for choice in choices for cell in set(self.guesses.read(choice.place))
                 if not any(mark.isdigit() for mark in cell) and (cell or needed)}
        return sorted(words | self.header.missing)

    def _specimens(self) -> Iterator[str]:
        """Write a file for each name in the table's column of specimens, else the first near."""
        place = self._naming
        said = [self.specimens[self._film].name] if self._film is not None else []
        if place is not None:
            said = [name for name in dict.fromkeys(self.guesses.cells(place)) if name]
        found = {name: self._file_of(name) for name in said}
        if any(found.values()):
            for name, file in found.items():
                yield "[[specimen]]"
                yield self._entry(name, file)
            return
        yield "[[specimen]]"
        if not self.specimens:
            yield (f'file = "specimen.toml"  # {_CORRECT}no file of a specimen stands here; the '
                   "name of yours")
            return
        first, *others = map(self._named, self.specimens)
        yield f"file = {_quoted(first)}  # " + (
            f"{_CORRECT}there are also {', '.join(others)}" if others
            else "the only specimen in its folder")

    def _file_of(self, name: str) -> Path | None:
        """Find the file of the specimen of that name, else the file with that name.

        Else take the only file whose name, or whose specimen's, is a word of it: kreis.toml for
        "Kreis 1".
        """
        called = {file.stem.casefold(): file for file in self.specimens}
        exact = next((file for file, film in self.specimens.items() if film.name == name),
                     called.get(name.casefold()))
        words = re.split(r"[^\w]+|_", name.casefold())
        near = [file for file, film in self.specimens.items()
                if {film.name.casefold(), file.stem.casefold()} & set(words)]
        return exact or (near[0] if len(near) == 1 else None)

    def _entry(self, name: str, file: Path | None) -> str:
        """Write the line that names the file of a specimen in the table."""
        if file is None:
            return (f"file = {_quoted(f'{name}.toml')}  # {_CORRECT}no file of a specimen "
                    f"{name!r} stands here")
        own = self.specimens[file].name
        return f"file = {_quoted(self._named(file))}  # " + (
            ("its name stands in the table" if self._naming is not None
             else "the film in all rows") if own == name else
            f"{_CORRECT}its name is {own!r}, in the table it is {name!r}: write one in both")

    def _named(self, file: Path) -> str:
        """Write a file's name for dataset.toml: relative to its folder, if near enough."""
        name = Path(os.path.relpath(file, self.folder)).as_posix()
        try:
            beside(self.folder, name)
        except InputError as error:
            raise error.located(file=file) from None
        return name


def draft(file: Path | str, kind: str | None = None, folder: Path | None = None) -> Draft:
    """Guess the meaning of a table; ``kind`` is the file of a dataset it is, such as "force".

    ``folder``: where dataset.toml will be, if not next to the table.

    Raises
    ------
    InputError
        Where no line has known headings, or the file is no table.
    """
    file = Path(file)
    if kind is not None and f"{kind}.csv" not in FILES:
        hint = did_you_mean(kind, {name: name for name in _KINDS})
        raise InputError(f"unknown kind: {hint}known are {', '.join(_KINDS)}", key="kind",
                         given=kind)
    rows, decimal = _rows(file)
    folder = file.parent if folder is None else folder
    specimens = _specimens_in(file.parent) or _specimens_in(folder)
    left = unread(file, file_bytes(file))

    def guessed(kinds: Sequence[str], some: Sequence[Row], titles: int | None = None
                ) -> list[Draft]:
        """List drafts of the kinds that rows of the table may be."""
        return [Draft(Guesses(file, name, header, tuple(some), specimens, titles is not None),
                      decimal, folder, name in (kind, file.stem.lower()), left)
                for name in kinds if (header := _header(file, name, some, titles)) is not None]

    kinds, titles = _KINDS if kind is None else (kind,), None
    taken = guessed(kinds, rows[:_JUDGED])
    if not taken:
        titles, hint = titles_above_numbers(rows[:SEARCHED]), _hint(rows)
        if hint or titles is None:
            raise InputError("has no line with two known headings, such as Weg (mm) or Voltage "
                             f"(kV): give the columns such names{hint}", file=file)
        taken = guessed(kinds, rows[:_JUDGED], titles)
        taken = [one for one in taken if one.stated or one.likely] or taken
    best = max(taken, key=lambda one: one.score)
    return best if len(rows) <= _JUDGED else guessed((best.guesses.kind,), rows, titles)[0]


def _hint(rows: Sequence[Row]) -> str:
    """Advise on a table whose headings are not known; "" without any advice."""
    first = [cells for _, cells in rows[:SEARCHED]]
    lying = [cells for cells in first if len(cells) > ENOUGH and quantity_of(
        Heading.of(cells[0]).unit) and all(map(NUMBER.fullmatch, cells[1:]))]
    if len(lying) >= ENOUGH:
        return ("; its quantities stand in lines: turn it, so that each stands in a column (in a "
                "spreadsheet: copy, paste special, transpose)")
    if sum(len(cells) == 1 and bool(_BLANKS.search(cells[0])) for cells in first) > len(first) / 2:
        return ("; blanks stand between them: save the table with commas, semicolons or tabs "
                "between the columns")
    if any(sum(bool(_LOAD.fullmatch(cell)) for cell in cells) >= ENOUGH for cells in first):
        return ("; a column for each load is called such as \"kreis 20 g displacement_mm\", with "
                "the specimen, its load and what was read")
    return ""


def write_draft(file: Path | str, target: Path | str | None = None, kind: str | None = None
                ) -> Path:
    """Write the draft of a table next to it, or to a ``target``; nothing is overwritten."""
    file = Path(file)
    target = file.parent / "dataset.toml" if target is None else Path(target)
    text = draft(file, kind, target.parent).text
    if target.exists():
        raise InputError("is there already: name another file with -o", file=target)
    write_text(target, text)
    return target


def _rows(file: Path) -> tuple[tuple[Row, ...], Decimal | None]:
    """Read the rows of a table, with a decimal mark where the reader does not recognise it."""
    content = file_bytes(file)
    try:
        rows = tuple(with_units_above(read_rows(file, content)))
    except TwoMarks as error:
        decimal = Decimal("." if "," in str(error.given) else ",", "numbers have both marks; the "
                          "other one is taken to separate thousands; if it is not, write that one")
    else:
        marked = [cell for _, cells in rows for cell in cells if "," in cell or "." in cell]
        if not (any(map(DECIMAL_COMMA.fullmatch, marked)) and not any(
                NUMBER.fullmatch(cell) for cell in marked)):
            return rows, None
        decimal = Decimal(",", "numbers have decimal commas, though commas stand between columns")
    return tuple(with_units_above(read_rows(file, content, decimal.mark))), decimal


def _header(file: Path, kind: str, rows: Sequence[Row], titles: int | None = None
            ) -> Header | None:
    """Find the header of a table if it is of that kind, even if columns are missing.

    ``titles``: the line of headings that are not known, 0 if there is none.
    """
    columns = [replace(column, required=False) for column in FILES[f"{kind}.csv"]]
    whole = Layout(area=1.0, length=1.0, titles_line=titles)
    reader = Reader(file, columns, whole, lenient=True)
    try:
        header = reader.header(rows)
    except InputError:
        return None
    if titles is None and len(reader.known(header.titles)) < ENOUGH:
        return None
    wanted = {column.name: column for column in FILES[f"{kind}.csv"]}
    sources = tuple(replace(source, column=wanted[source.column.name])
                    for source in header.sources)
    header = replace(header, sources=sources, foreign=True)
    below = [cells for _, cells in header.below(lambda: rows)]
    places = [source.place for source in sources if source.place is not None
              and source.column.name in _SET and source.column.required]
    columns_of_cells = {place: [cells[place] for cells in below] for place in places}
    blank = {place: ["" if cell in _DITTO else cell for cell in cells]
             for place, cells in columns_of_cells.items()}
    fill = tuple(place for place in places if in_blocks(blank[place]))
    dittos = {cell for place in fill for cell in columns_of_cells[place] if cell in _DITTO}
    return replace(header, fill=fill, missing=frozenset(dittos))


def _specimens_in(folder: Path) -> dict[Path, Specimen]:
    """Read the specimens in a folder by their files."""
    found = {}
    for file in sorted(folder.glob("*.toml")):
        with suppress(InputError):
            found[file] = load_specimen(file)
    return found


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
