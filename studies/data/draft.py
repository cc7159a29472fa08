"""A first dataset.toml for somebody's table: every line a guess with its reason, to correct."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from tympan.fem.film.library import load_specimen
from tympan.geometry.column import NUMBER, Column, Heading
from tympan.geometry.command_line import command_line, file_word
from tympan.geometry.errors import InputError, did_you_mean
from tympan.geometry.formats import Row, TwoMarks, read_rows
from tympan.geometry.layouts import Header, Layout, Reader, Source, in_blocks
from tympan.geometry.read_file import beside, file_bytes
from tympan.geometry.specimen import Specimen
from tympan.geometry.units import any_quantity, quantity_text
from tympan.studies.data.coupon import named_mode
from tympan.studies.data.dataset import FILES, GUESS
from tympan.studies.files import write_text

#: Kinds of files that are guessed, of those that explain as much the first.
_KINDS = ("static", "transient", "force", "coupon", "frequency", "range")
#: Readings below which a table with times is a list of states and no run in time.
_RUN = 30
#: What one missing column of numbers counts against one that was found.
_MISSED = 1.0
#: What an unlikely reading of a table counts against it: more than a missing column.
_UNLIKELY = 1.5
#: Correlation below which numbers fall where deflections and forces rise.
_FALLING = -0.5
#: Words of preambles for the sizes of a test piece.
_SIZES = {"thickness": ("thickness", "specimen thickness", "dicke", "probendicke", "epaisseur"),
          "width": ("width", "specimen width", "breite", "probenbreite", "largeur"),
          "length": ("gauge length", "length", "specimen length", "messlange", "einspannlange",
                     "longueur", "longueur initiale", "anfangsmesslange")}
_CORRECT = f"{GUESS} "
#: Labels that a line shows of a column.
_NAMED = 3
#: Columns of what is set, which holds on until it is changed; what is read is not there if blank.
_SET = ("specimen", "mass", "voltage", "run", "mode")


@dataclass(frozen=True)
class Draft:
    """Guess of a table: its ``kind``, header and rows, and the decimal mark if stated.

    ``specimens`` are those whose files stand near; ``folder`` is where its dataset.toml will
    stand, ``stated`` whether the kind is no guess.
    """

    file: Path
    kind: str
    header: Header
    rows: tuple[Row, ...]
    decimal: str | None
    specimens: Mapping[Path, Specimen]
    folder: Path
    stated: bool

    @property
    def name(self) -> str:
        """Name of the first specimen, "film" where none is known."""
        return next((film.name for film in self.specimens.values()), "film")

    @property
    def score(self) -> float:
        """Score of its kind by how well it explains the headings."""
        if self.stated:
            return float("inf")
        have = {source.column.name for source in self.header.sources}
        needed = [column.name for column in FILES[f"{self.kind}.csv"]
                  if column.required and column.choices is None]
        missed = sum(name not in have for name in needed)
        unlikely = (self.kind == "transient" and len(self.rows) < _RUN,
                    self.kind == "coupon" and self._of_a_plate)
        return (sum(name in have for name in needed) - _MISSED * missed
                - _UNLIKELY * sum(unlikely) + 0.1 * len(have))

    @property
    def _of_a_tester(self) -> bool:
        """Whether it has forces and displacements, which strips and plates have."""
        have = {source.column.name: source for source in self.header.sources}
        return ({"displacement", "force"} <= {*have} if self.kind == "force"
                else any(source.per == "area" for source in have.values()))

    @property
    def _of_a_strip(self) -> bool:
        """Whether its sizes stand above the headings, or its mode in the file's name."""
        return bool(self._preamble() or named_mode(self.file))

    @cached_property
    def _of_a_plate(self) -> bool:
        """Whether forces may be those on the specimen's plate, and nothing speaks of a strip.

        A strip may be pulled further than the plate is from the frame.
        """
        if not self._of_a_tester or len(self.specimens) != 1 or self._of_a_strip:
            return False
        film, = self.specimens.values()
        lengths = [source for source in self.header.sources if source.per == "length"]
        moved = [abs(float(cells[source.place])) * source.factor for source in lengths
                 for _, cells in self._below
                 if source.place is not None and NUMBER.fullmatch(cells[source.place])]
        return film.plate is not None and max(moved, default=0.0) < film.gap

    @property
    def text(self) -> str:
        """The lines of a dataset.toml."""
        lines = ["# A draft: every line is a guess. Correct it, then run: tympan data .",
                 f"name = {_quoted(self.file.stem)}", "", *self._other(),
                 f"[columns.{self.kind}]", *self._about(), *self._columns(), "",
                 *self._specimens()]
        return "\n".join(lines) + "\n"

    def _other(self) -> Iterator[str]:
        """Other files the table may be, where its headings do not decide."""
        names = {source.column.name for source in self.header.sources}
        if (self._of_a_tester and "voltage" not in names
                and not (self.stated or self._of_a_strip)):
            what, kind, of = (("the plate of an actuator", "coupon", "a strip of film")
                              if self.kind == "force"
                              else ("a strip of film", "force", "the plate of an actuator"))
            yield f"# {_CORRECT}force and displacement without voltage: taken as those of {what}."
            again = command_line("data", "--draft", file_word(self.file.name), "--kind", kind)
            yield f"# If {of} was pulled: {again}"

    def _about(self) -> Iterator[str]:
        if self._named(self.file) != f"{self.kind}.csv":
            yield f"file = {_quoted(self._named(self.file))}"
        yield f"titles_line = {self.header.line}  # the first line with known headings"
        if self.decimal:
            yield (f"decimal = {_quoted(self.decimal)}  # {_CORRECT}numbers have both marks; the "
                   "other one is taken to separate thousands")
        if words := self._words():
            yield f"missing = [{', '.join(map(_quoted, words))}]  # cells that are no numbers"
        if filled := [self.header.titles[place] for place in self.header.fill]:
            yield (f"fill = [{', '.join(map(_quoted, filled))}]  # stands only in the first row of "
                   "each block: blank cells have the value above")
        taken = {self._naming, *self._by_unit.values()}
        left = [self.header.titles[place] for place in self._unknown if place not in taken]
        if left:
            yield f"ignore = [{', '.join(map(_quoted, left))}]  # no column is known by these names"

    def _columns(self) -> Iterator[str]:
        columns = FILES[f"{self.kind}.csv"]
        found = {source.column.name: source for source in self.header.sources}
        for size in dict.fromkeys(source.per for source in found.values() if source.per):
            yield self._size(size)
        for column in columns:
            if column.name in found:
                yield self._found(found[column.name])
            elif column.name == "specimen":
                yield self._of_all_rows(column)
            elif column.name in self._by_unit:
                yield self._mapped(column, self._by_unit[column.name])
            elif column.required:
                yield self._absent(column)

    def _found(self, source: Source) -> str:
        place = source.place
        if place is None:
            return ""
        title, column = self.header.titles[place], source.column
        unit = Heading.of(title).unit
        why = f"{title!r} is known as {column.name}"
        if not column.unit or source.per:
            return f"{column.title} = {_quoted(title)}  # {why}, by its words and unit"
        key = f"{column.name}_{unit}" if unit.isalpha() else column.title
        if not column.claims(key) or abs(column.factor(key) / source.factor - 1) > 1e-9:
            return f"# {column.title}: {why}; its unit is read from the heading"
        return self._line(key, column, place, why)

    def _line(self, key: str, column: Column, place: int, why: str) -> str:
        """The line that reads a column from a heading, with its sign where it may have one."""
        title = _quoted(self.header.titles[place])
        if column.name not in ("displacement", "force"):
            return f"{key} = {title}  # {why}"
        if self._falls(place, column.name):
            return (f'{key} = {{ from = {title}, sign = "up" }}  # {_CORRECT}the numbers fall '
                    f"where {column.name}s rise: taken as counted the other way")
        return f'{key} = {{ from = {title}, sign = "down" }}  # {why}'

    @property
    def _unknown(self) -> list[int]:
        """Places of the columns whose headings are not known."""
        known = {source.place for source in self.header.sources}
        return [place for place, title in enumerate(self.header.titles)
                if title and place not in known]

    @cached_property
    def _naming(self) -> int | None:
        """Place of the column of specimens: by its heading, else by cells that name films here."""
        by_heading = [source.place for source in self.header.sources
                      if source.column.name == "specimen"]
        by_cells = [place for place in self._unknown if any(
            self._file_of(name) for name in self._labels(place))]
        return next(iter([*by_heading, *by_cells]), None)

    @cached_property
    def _by_unit(self) -> dict[str, int]:
        """Places of needed columns that no heading names: the only ones in a unit of that kind."""
        found = {source.column.name for source in self.header.sources}
        headings = {place: Heading.of(self.header.titles[place]) for place in self._unknown}
        sizes = {word for words in _SIZES.values() for word in words}
        dimensions = {place: _dimension(heading.unit) for place, heading in headings.items()
                      if heading.words not in sizes}
        wanted = {column.name: _dimension(column.unit) for column in FILES[f"{self.kind}.csv"]
                  if column.required and column.choices is None and column.name not in found}
        only = {}
        for name, dimension in wanted.items():
            places = [place for place, other in dimensions.items() if other == dimension]
            if dimension and len(places) == list(wanted.values()).count(dimension) == 1:
                only[name] = places[0]
        return only

    def _mapped(self, column: Column, place: int) -> str:
        """The line of a column whose heading is not known, but its unit is."""
        unit = Heading.of(self.header.titles[place]).unit
        key = f"{column.name}_{unit}" if unit.isalpha() else column.title
        return self._line(key if column.claims(key) else column.title, column, place,
                          f"the only column in a unit of {_dimension(unit)}")

    def _labels(self, place: int) -> list[str]:
        """The cells of a column, each once, if they are words."""
        cells = dict.fromkeys(cells[place] for _, cells in self._below)
        return [cell for cell in cells if cell and not NUMBER.fullmatch(cell)]

    def _of_all_rows(self, column: Column) -> str:
        """The line of the specimen where no heading says it: a column whose cells do, or one film.

        One film is a guess that a second film or a column of labels may contradict.
        """
        if self._naming is not None:
            title = self.header.titles[self._naming]
            return f"{column.title} = {_quoted(title)}  # its cells name specimens that stand here"
        labels = {self.header.titles[place]: labels for place in self._unknown
                  if 1 < len(labels := self._labels(place)) <= len(self._below) / 2}
        line = self._absent(column)
        if not labels and len(self.specimens) < 2:
            return line
        line = line.partition("  # ")[0] + f"  # {_CORRECT}no heading says it: one film in all rows"
        for title, names in list(labels.items())[:1]:
            line += (f"; if the films are those of {title!r} ({', '.join(names[:_NAMED])}): "
                     f"{column.title} = {_quoted(title)}")
        return line

    def _absent(self, column: Column) -> str:
        nearest = next((title for title in self.header.titles
                        if any(Heading.of(title).words in meaning.words
                               for meaning in column.also)), None)
        if nearest is not None:
            return (f"{column.title} = {_quoted(nearest)}  # {_CORRECT}the heading has no unit "
                    "that fits; the unit is that of the key")
        if column.choices is not None:
            value = {"specimen": self.name, "run": "1", "mode": "uniaxial"}.get(column.name, "1")
            value = named_mode(self.file).get(column.name, value)
            value = column.choices[0] if column.choices and value not in column.choices else value
            return f"{column.title} = {{ value = {_quoted(value)} }}  # no heading says it"
        value = "0" if column.name == "voltage" else '"?"'
        return (f"{column.title} = {{ value = {value} }}  # {_CORRECT}no heading says it; "
                "the value of the whole file, or the heading")

    def _size(self, size: str) -> str:
        sizes = self._preamble()
        if size == "length" and "length" in sizes:
            return f"length = {_quoted(quantity_text(sizes['length'], 'length'))}  # the preamble's"
        if size == "area" and {"thickness", "width"} <= {*sizes}:
            area = 1e6 * sizes["thickness"] * sizes["width"]
            return f'area = "{area:g} mm^2"  # thickness times width, from the preamble'
        usual = {"area": "18 mm^2", "length": "30 mm"}[size]
        return f'{size} = "{usual}"  # {_CORRECT}of the test piece before it is stretched'

    def _preamble(self) -> dict[str, float]:
        """Sizes of the test piece [m] in the lines above the headings."""
        sizes: dict[str, float] = {}
        for _, cells in self.rows[:self.header.above]:
            heading = Heading.of(cells[0].rstrip(":"))
            name = next((key for key, words in _SIZES.items() if heading.words in words), None)
            value = next((cell for cell in cells[1:] if NUMBER.fullmatch(cell)), None)
            unit = heading.unit or next((cell for cell in cells[2:] if cell), "mm")
            known = any_quantity(f"{value} {unit}") if name and value else None
            if name and known and known[1] == "length":
                sizes[name] = known[0]
        return sizes

    def _words(self) -> list[str]:
        """Cells of columns of numbers that are none."""
        places = [source.place for source in self.header.sources
                  if source.place is not None and source.column.choices is None]
        cells = {cells[place] for _, cells in self._below for place in places}
        return sorted(cell for cell in cells if not any(mark.isdigit() for mark in cell)
                      and (cell or any(source.column.required for source in self.header.sources)))

    @cached_property
    def _below(self) -> list[Row]:
        return list(self.header.rows(lambda: self.rows))[1:]

    def _falls(self, place: int, name: str) -> bool:
        """Whether a column falls as the voltage rises, or the force as the displacement does."""
        along = {"displacement": "voltage", "force": "displacement"}[name]
        other = next((source.place for source in self.header.sources
                      if source.column.name == along), None)
        pairs = [(float(cells[place]), float(cells[other])) for _, cells in self._below
                 if other is not None and NUMBER.fullmatch(cells[place])
                 and NUMBER.fullmatch(cells[other])]
        if len(pairs) < 2 or not np.ptp(pairs, axis=0).all():
            return False
        return bool(np.corrcoef(np.transpose(pairs))[0, 1] < _FALLING)

    def _specimens(self) -> Iterator[str]:
        """A file for each name in the table's column of specimens, else the first that is near."""
        place = self._naming
        said = [] if place is None else [
            name for name in dict.fromkeys(cells[place] for _, cells in self._below) if name]
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
        """The file of the specimen of that name, else the file that is called so.

        Else the only one whose name, or its file's, is a word of it: kreis.toml of "Kreis 1".
        """
        called = {file.stem.casefold(): file for file in self.specimens}
        exact = next((file for file, film in self.specimens.items() if film.name == name),
                     called.get(name.casefold()))
        words = re.split(r"[^\w]+|_", name.casefold())
        near = [file for file, film in self.specimens.items()
                if {film.name.casefold(), file.stem.casefold()} & set(words)]
        return exact or (near[0] if len(near) == 1 else None)

    def _entry(self, name: str, file: Path | None) -> str:
        """The line that names the file of a specimen that the table names."""
        if file is None:
            return (f"file = {_quoted(f'{name}.toml')}  # {_CORRECT}no file of a specimen "
                    f"{name!r} stands here")
        own = self.specimens[file].name
        return f"file = {_quoted(self._named(file))}  # " + (
            "its name stands in the table" if own == name else
            f"{_CORRECT}its name is {own!r}, in the table it is {name!r}: write one in both")

    def _named(self, file: Path) -> str:
        """A file's name as dataset.toml has to write it: from its own folder, near enough."""
        name = Path(os.path.relpath(file, self.folder)).as_posix()
        try:
            beside(self.folder, name)
        except InputError as error:
            raise error.located(file=file) from None
        return name


def draft(file: Path | str, kind: str | None = None, folder: Path | None = None) -> Draft:
    """Guess of a table; ``kind`` is the file of a dataset it stands for, such as "force".

    ``folder``: where dataset.toml will stand, if not beside the table.

    Raises
    ------
    InputError
        Where no line has headings that are known, or the file is no table.
    """
    file = Path(file)
    if kind is not None and f"{kind}.csv" not in FILES:
        hint = did_you_mean(kind, {name: name for name in _KINDS})
        raise InputError(f"unknown kind: {hint}known are {', '.join(_KINDS)}", key="kind",
                         given=kind)
    rows, decimal = _rows(file)
    folder = file.parent if folder is None else folder
    specimens = _specimens_in(file.parent) or _specimens_in(folder)
    taken = [Draft(file, name, header, rows, decimal, specimens, folder,
                   name in (kind, file.stem.lower()))
             for name in (_KINDS if kind is None else (kind,))
             if (header := _header(file, name, rows)) is not None and header.sources]
    if not taken:
        raise InputError("has no line with two known headings, such as Weg (mm) or Voltage (kV): "
                         "give the columns such names", file=file)
    return max(taken, key=lambda one: one.score)


def write_draft(file: Path | str, target: Path | str | None = None, kind: str | None = None
                ) -> Path:
    """Write the draft of a table beside it, or to a ``target``; nothing is overwritten."""
    file = Path(file)
    target = file.parent / "dataset.toml" if target is None else Path(target)
    text = draft(file, kind, target.parent).text
    if target.exists():
        raise InputError("is there already: name another file with -o", file=target)
    write_text(target, text)
    return target


def _rows(file: Path) -> tuple[tuple[Row, ...], str | None]:
    content = file_bytes(file)
    try:
        return tuple(read_rows(file, content)), None
    except TwoMarks as error:
        decimal = "." if "," in str(error.given) else ","
        return tuple(read_rows(file, content, decimal)), decimal


def _header(file: Path, kind: str, rows: Sequence[Row]) -> Header | None:
    """The header of a table if it is of that kind, whatever is missing."""
    columns = [replace(column, required=False) for column in FILES[f"{kind}.csv"]]
    whole = Layout(area=1.0, length=1.0)
    with suppress(InputError):
        header = Reader(file, columns, whole, lenient=True).header(rows)
        wanted = {column.name: column for column in FILES[f"{kind}.csv"]}
        sources = tuple(replace(source, column=wanted[source.column.name])
                        for source in header.sources)
        header = replace(header, sources=sources, foreign=True)
        below = [cells for _, cells in header.below(lambda: rows)]
        return replace(header, fill=tuple(
            source.place for source in sources if source.place is not None
            and source.column.name in _SET and source.column.required
            and in_blocks([cells[source.place] for cells in below])))
    return None


def _specimens_in(folder: Path) -> dict[Path, Specimen]:
    """The specimens in a folder by their files."""
    found = {}
    for file in sorted(folder.glob("*.toml")):
        with suppress(InputError):
            found[file] = load_specimen(file)
    return found


def _dimension(unit: str) -> str:
    """Dimension of a unit, "" of one that is not known."""
    known = any_quantity(f"1 {unit}") if unit else None
    return known[1] if known else ""


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
