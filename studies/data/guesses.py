"""Guesses of the meaning of each column of a user's table, and doubts about them."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.geometry.specimen import Specimen
from tympan.studies.data import doubts
from tympan.studies.data.by_numbers import counts_rows, guessed_by_numbers, likely_unit
from tympan.studies.data.coupon import named_mode
from tympan.studies.data.dataset import FILES
from tympan.studies.data.preamble import (
    Statement,
    explained_columns,
    named_quantities,
    stated_quantities,
    stated_sizes,
)
from tympan.tables.column import NUMBER, Column, Heading, Meaning, quantity_of, usual_unit
from tympan.tables.formats import Row
from tympan.tables.layouts import Header, Source
from tympan.tables.meanings import (
    HEIGHTS,
    NO_READINGS,
    OTHER_READINGS,
    RANGES,
    SENSORS,
    SET_VOLTAGES,
    SPECIMENS,
    STRETCHES,
    TIMES,
    TOTALS,
    VALIDITIES,
    sums_up,
)

#: Fewest readings of a run in time; a shorter table with times is a list of states.
_RUN = 30
#: Different voltages from which a table is a list of states rather than steps of a run in time.
_STEPS = 3
#: Penalty of a missing column of numbers, relative to the score of a column that was found.
_MISSED = 1.0
#: Score of a column by what it is recognised by; a column that the reader finds counts 1.
_HALF = {"words": 0.0, "no unit": 0.6, "other unit": 0.6, "unit": 0.5, "above": 0.4,
         "numbers": 0.0}
#: Penalty of a table of an unlikely kind: more than that of a missing column.
_UNLIKELY = 1.5
#: Most headings and lines that a doubt lists.
SHOWN = 3
#: Words that decide even where other columns have the same unit.
_SURE = TOTALS.words | SET_VOLTAGES.words
#: Words for specimens.
_SPECIMENS = Meaning.of(SPECIMENS)
#: A factor in a heading: "x100", "1/100 mm", "10^3".
_FACTOR = re.compile(r"[x×*]\s*10|10\s*\^|(?<!\d)1/10|(?<!\d)\s*/\s*10|\b1?[eE][+-]?\d\b")
#: Words in headings of a range, also after a unit: "kVpp".
_PEAKS = re.compile(r"(?:\b|V)pp\b|\bp-p\b|pk-pk|peak.to.peak|spitze.spitze|crête.à.crête",
                    re.IGNORECASE)
#: Strains above which per cent may be meant: double length is 1 or 100.
_STRAINED = 2.0
#: Factor beyond which a deflection is not that of this film and mass. Laws, creep and shapes other
#: than circles change it by less.
_UNUSUAL = 3.0
#: Fewest readings in which a number for each row is taken as the row's number.
_NUMBERED = 20
#: Stretch below which strains may be meant.
_SHORT = 0.95
#: Values that lines of a draft have as examples, in the unit of the column's title.
EXAMPLES = {"mass": 17.9, "voltage": 3}
#: Units that a question about a guessed column names.
OTHER_UNITS = {"mass": ("g", "kg"), "voltage": ("kV", "V"), "displacement": ("mm", "um"),
               "force": ("mN", "N"), "t": ("s", "ms")}
#: Columns of numbers that define a state.
_STATE = ("mass", "voltage", "voltage_min", "voltage_max", "t")
#: Least largest voltage of a film's column [V]: less moves no film, and may be a sensor's.
_HIGH = 50.0
#: Columns along which the numbers of another one rise, by kind of table, the surest first.
_RISES = {("static", "displacement"): ("voltage", "mass"),
          ("transient", "displacement"): ("voltage",),
          ("force", "force"): ("displacement",)}
#: Kinds of tables whose displacements are counted from the flat film.
_FROM_FLAT = ("static", "transient")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


@dataclass(frozen=True)
class ColumnChoice:
    """A column of numbers that is taken for one of ours: its index, and by what.

    "words": words and unit of its heading, "no unit": its words alone, "unit": its unit alone,
    "other unit": its words, although its unit does not fit, "above": what a line above the headings
    says, "numbers": its numbers alone.
    """

    column: Column
    place: int
    by: Literal["words", "no unit", "unit", "other unit", "above", "numbers"]


@dataclass(frozen=True)
class Guesses:
    """Guesses of a table of a ``kind``, from its header and rows.

    ``specimens`` are those whose files are near; ``asked``: whether its headings are not known.
    """

    file: Path
    kind: str
    header: Header
    rows: tuple[Row, ...]
    specimens: Mapping[Path, Specimen]
    asked: bool = False

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Columns that a table of this kind may have."""
        return FILES[f"{self.kind}.csv"]

    @cached_property
    def _every(self) -> list[Row]:
        """The rows below the headings, including those that lack a reading."""
        return list(self.header.below(lambda: self.rows))

    @cached_property
    def below(self) -> list[Row]:
        """The rows below the headings, without summaries."""
        return [row for row in self._every if row[0] not in self.summaries]

    @cached_property
    def summaries(self) -> dict[int, str]:
        """Lines that are summaries, such as means, and the cells that say so."""
        found: dict[int, str] = {}
        for place in range(len(self.header.titles)):
            cells = {cell for _, cells in self._every for cell in (cells[place],)
                     if cell and not cell[0].isdigit()}
            sums = {cell for cell in cells if sums_up(cell)}
            lines = {line: cells[place] for line, cells in self._every if cells[place] in sums}
            if 2 * len(lines) <= len(self._every):  # else the mark is on most readings
                found |= lines
        return dict(sorted(found.items()))

    def cells(self, place: int) -> list[str]:
        """List the cells of a column."""
        return [cells[place] for _, cells in self.below]

    def read(self, place: int) -> list[str]:
        """List the cells of a column that are read, below lines of words."""
        return [cells[place] for line, cells in self.below if line not in self.wordy]

    def numbers(self, place: int) -> Array:
        """Read the numbers of a column, nan where there is none."""
        if place not in self._numbers:
            self._numbers[place] = np.array([float(cell) if NUMBER.fullmatch(cell) else np.nan
                                             for cell in self.cells(place)])
        return self._numbers[place]

    @cached_property
    def _numbers(self) -> dict[int, Array]:
        """The numbers of columns that were read before."""
        return {}

    def labels(self, place: int) -> list[str]:
        """List the cells of a column, each once, if they are words."""
        return [cell for cell in dict.fromkeys(self.cells(place))
                if cell and not NUMBER.fullmatch(cell)]

    @cached_property
    def sources(self) -> dict[str, Source]:
        """Columns that the reader finds by itself, by name, if their cells fit."""
        return {source.column.name: source for source in self.header.sources
                if source.place not in self.others}

    @cached_property
    def wordy(self) -> list[int]:
        """Lines directly below the headings that have words alone, such as makes of sensors."""
        first = next((number for number, (_, cells) in enumerate(self._every)
                      if any(map(NUMBER.fullmatch, cells))), 0)
        return [line for line, _ in self._every[:first]]

    @cached_property
    def others(self) -> frozenset[int]:
        """Indices of known headings whose cells do not fit: numbers of rows, clocks."""
        numeric = [source.place for source in self.header.sources
                   if source.place is not None and source.column.name in _STATE]
        return frozenset(
            source.place for source in self.header.sources if source.place is not None
            and (self._numbers_rows(source.place, numeric) if source.column.choices == ()
                 else source.column.choices is None and not source.column.required
                 and self._is_no_number(source.place)))

    def _numbers_rows(self, place: int, numeric: Sequence[int]) -> bool:
        states = [tuple(cells[other] for other in numeric) for _, cells in self.below]
        return doubts.numbers_rows(self.cells(place), states)

    @cached_property
    def uncounted(self) -> dict[int, str]:
        """Lines that another column marks as no readings, with the reason."""
        found: dict[int, str] = {}
        for place in self.unknown:
            cells, title = self.cells(place), self.header.titles[place]
            counts = Counter(cells)
            if self._headings[place].words in VALIDITIES and len(counts) == 2:
                (_, many), (rare, few) = counts.most_common()
                found |= {line: f"{title!r} is {rare!r} there" for line, row in self.below
                          if row[place] == rare and few < many}
            if doubts.numbered(cells):
                found |= {line: f"{title!r} is blank there" for line, row in self.below
                          if not row[place] and self._is_reading(row)}
        return dict(sorted(found.items()))

    def _is_reading(self, row: Sequence[str]) -> bool:
        """Check whether a row has a number in each needed column."""
        return all(NUMBER.fullmatch(row[choice.place]) for choice in self.choices.values()
                   if choice.column.required)

    @property
    def numbering(self) -> str:
        """The heading of a column of specimens that seems to number a few readings, "" if none."""
        places = [source.place for source in self.header.sources
                  if source.column.name == "specimen" and source.place in self.others]
        few = len(self.below) < _NUMBERED
        return self.header.titles[places[0] or 0] if places and few else ""

    @property
    def unnamed(self) -> list[int]:
        """Indices of unknown columns of numbers that may be the needed one that is missing."""
        absent = any(column.name not in self.choices for column in self._missing)
        return [place for place in self.unknown if absent and not self._is_no_number(place)
                and np.isfinite(self.numbers(place)).any()]

    def _is_no_number(self, place: int) -> bool:
        said = [cell for cell in self.cells(place) if any(mark.isdigit() for mark in cell)]
        return 2 * sum(NUMBER.fullmatch(cell) is None for cell in said) > len(said)

    @property
    def numeric(self) -> list[int]:
        """Indices of unknown columns of numbers that are not chosen."""
        taken = {choice.place for choice in self.choices.values()}
        return [place for place in self.unknown if place not in taken and not
                self._is_no_number(place) and np.isfinite(self.numbers(place)).any()]

    def lines_for(self, column: Column) -> list[str]:
        """List lines that may read a missing column: from its unit, or from a scale of it."""
        others = [place for place in self.numeric
                  if self._reads(place) and not counts_rows(self.numbers(place))]
        return [self.line(column, place) for place in self.candidates(column) or others]

    def line(self, column: Column, place: int, more: str = "") -> str:
        """Write the line that reads a column from a heading, with a scale if its unit differs."""
        title, unit = self.header.titles[place], usual_unit(self._headings[place].unit) or ""
        key = f"{column.name}_{unit}"
        if not (unit.isalpha() and column.claims(key)
                and self._dimensions[place] == column.dimension):
            key = column.title
            more = more or ", scale = 1" * bool(self._dimensions[place])
        return (f"{key} = {{ from = {_quoted(title)}{more} }}" if more
                else f"{key} = {_quoted(title)}")

    @cached_property
    def unknown(self) -> list[int]:
        """Indices of the columns whose headings are not known."""
        known = {source.place for source in self.header.sources}
        return [place for place, title in enumerate(self.header.titles)
                if title and place not in known]

    @cached_property
    def _headings(self) -> list[Heading]:
        return [Heading.of(title) for title in self.header.titles]

    @cached_property
    def _dimensions(self) -> list[str]:
        """Dimension of the unit in each heading, "" without one."""
        return [quantity_of(heading.unit) for heading in self._headings]

    @cached_property
    def _missing(self) -> list[Column]:
        """Needed columns of numbers that the reader does not find by itself."""
        return [column for column in self.columns if column.required
                and column.choices is None and column.name not in self.sources]

    @cached_property
    def possible(self) -> list[int]:
        """Indices of unknown columns in a unit of a needed one, but for sizes and scatters."""
        wanted = {column.dimension for column in self.columns
                  if column.required and column.dimension}
        return [place for place in self.unknown
                if self._dimensions[place] in wanted and self._reads(place)]

    @cached_property
    def choices(self) -> dict[str, ColumnChoice]:
        """Columns of numbers that are taken for ours, by name."""
        found = {name: ColumnChoice(source.column, source.place, "words")
                 for name, source in self.sources.items()
                 if source.place is not None and source.column.choices is None}
        for column in self._missing:
            free = [place for place in self.unknown
                    if place not in {choice.place for choice in found.values()}]
            named = self._named(column, free)
            without = next((place for place in named if not self._headings[place].unit), None)
            by_unit = self._by_unit(column, free)
            if without is not None:
                found[column.name] = ColumnChoice(column, without, "no unit")
            elif by_unit is not None:
                found[column.name] = ColumnChoice(column, by_unit, "unit")
            elif named:
                found[column.name] = ColumnChoice(column, named[0], "other unit")
            elif (above := self._by_line_above(column, free)) is not None:
                found[column.name] = ColumnChoice(column, above, "above")
        return found | self._by_numbers(found) if self.asked else found

    def _by_line_above(self, column: Column, free: Sequence[int]) -> int | None:
        """Find the column that a line above the headings explains as this one."""
        said = {place: Heading.of(self.explained[place][1]) for place in free
                if place in self.explained}
        fits = [place for place, heading in said.items()
                if quantity_of(heading.unit) == column.dimension and column.dimension]
        fits = [place for place in fits if column.alludes(said[place].words)] or fits
        return fits[0] if len(fits) == 1 else None

    @cached_property
    def explained(self) -> dict[int, tuple[int, str]]:
        """Lines above the headings that say what unknown columns are, and their words."""
        return explained_columns(self.above, self.header.titles, self.untitled)

    @property
    def untitled(self) -> bool:
        """Whether no line has headings: the columns are called by their numbers."""
        return self.header.titles == tuple(str(place + 1)
                                           for place in range(len(self.header.titles)))

    def _by_numbers(self, found: Mapping[str, ColumnChoice]) -> dict[str, ColumnChoice]:
        """Choose columns by their numbers for those that are missing yet."""
        taken = {choice.place for choice in found.values()}
        missing = {column.name: column for column in self._missing if column.name not in found}
        free = {place: self.numbers(place) for place in self.unknown
                if place not in taken and not self._is_no_number(place)
                and not self._dimensions[place] and self._headings[place].words not in TIMES.words}
        if [*stated_quantities(self.above, "mass"), *named_quantities(self.file, "mass")]:
            missing.pop("mass", None)
        return {name: ColumnChoice(missing[name], place, "numbers")
                for name, place in guessed_by_numbers(missing, free).items()}

    def _named(self, column: Column, free: Sequence[int]) -> list[int]:
        """List columns that are recognised by words and not by a unit, exact words first."""
        exact = [place for place in free if column.knows(self._headings[place].words)]
        like = [place for place in free if column.alludes(self._headings[place].words)
                and not self._dimensions[place] and self._reads(place)]
        return [*exact, *like] if column.unit else []

    def _reads(self, place: int) -> bool:
        """Check whether a heading may be that of readings: not of sizes, nor of their scatter."""
        return not NO_READINGS.alluded(self._headings[place].words)

    def _by_unit(self, column: Column, free: Sequence[int]) -> int | None:
        """Find the only unknown column in a unit of its kind, or with words like it."""
        places = self.candidates(column, free)
        same = [other.name for other in self._missing if other.dimension == column.dimension]
        if len(same) > 1:  # two voltages: the one that changes is meant
            return places[0] if len(places) == 1 and column.name == "voltage_max" else None
        likely = [place for place in places if column.alludes(self._headings[place].words)
                  and not self._of_something_else(place)]
        return (places[0] if len(places) == 1 else likely[0] if len(likely) == 1 else None)

    def candidates(self, column: Column, free: Sequence[int] | None = None) -> list[int]:
        """List unknown columns in a unit of the column's kind."""
        return [place for place in self.possible if self._dimensions[place] == column.dimension
                and (free is None or place in free)]

    def _of_something_else(self, place: int) -> str:
        """Find words in a heading that mark another quantity than the column's, "" if none."""
        title = self.header.titles[place]
        if _FACTOR.search(title):
            return "the heading has a factor, which is not read"
        if (self._dimensions[place] == "mass"
                and SENSORS["force"].alluded(self._headings[place].words)):
            return ("a force sensor in units of a mass: if a tester moved the plate, draft the "
                    "table again with --kind force")
        if OTHER_READINGS.alluded(self._headings[place].words):
            return "by its words it may be another quantity"
        return ""

    @cached_property
    def score(self) -> float:
        """Score of the kind: how well it explains the headings."""
        needed = [column.name for column in self.columns
                  if column.required and column.choices is None]
        found = sum(name in self.sources for name in needed)
        half = sum(_HALF[choice.by] * (not self._of_something_else(choice.place))
                   for name, choice in self.choices.items() if name in needed)
        missed = sum(name not in self.choices for name in needed)
        unlikely = (self.kind == "transient" and len(self.below) < _RUN
                    and not (doubts.quick(self._times) and doubts.even(self._times)),
                    self.kind == "coupon" and self.of_a_plate,
                    self.kind == "force" and self.of_a_strip)
        return (found + half - _MISSED * missed * (not self.asked)
                - _UNLIKELY * sum(unlikely) + 0.1 * len(self.sources))

    @cached_property
    def _times(self) -> Array:
        """Times [s], or in an unknown unit, of the column that is recognised by its words."""
        place = next((place for place, heading in enumerate(self._headings)
                      if heading.words in TIMES.words and not self._is_no_number(place)), None)
        if place is None:
            return np.zeros(0)
        return self.numbers(place) * (TIMES.factor(self._headings[place].unit) or 1.0)

    @property
    def of_a_tester(self) -> bool:
        """Whether it has forces and displacements, as tests of strips and of plates have."""
        return ({"displacement", "force"} <= {*self.choices} if self.kind == "force"
                else any(source.per == "area" for source in self.sources.values()))

    @property
    def of_a_strip(self) -> bool:
        """Whether sizes are above the headings, or a mode is in the file's name."""
        return bool(self.sizes or named_mode(self.file))

    @cached_property
    def of_a_plate(self) -> bool:
        """Whether forces may be those on the specimen's plate, and nothing indicates a strip.

        A strip may be pulled further than the distance from plate to frame.
        """
        if not self.of_a_tester or len(self.specimens) != 1 or self.of_a_strip:
            return False
        film, = self.specimens.values()
        moved = [source.factor * np.nan_to_num(np.abs(self.numbers(source.place))).max(initial=0.0)
                 for source in self.sources.values()
                 if source.per == "length" and source.place is not None]
        return film.plate is not None and max(moved, default=0.0) < film.gap

    @cached_property
    def above(self) -> tuple[Row, ...]:
        """The rows above the headings."""
        return self.rows[:self.header.above + self.untitled]

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Sizes of the test piece [m] that are above the headings."""
        return stated_sizes(self.above)

    def stated(self, dimension: str) -> list[Statement]:
        """List quantities outside the columns: in the name, above, and between blocks."""
        between = [row for row in self.below if not self._is_reading(row[1])]
        titles = [(self.header.line, [self.header.titles[choice.place]])
                  for choice in self.choices.values()]
        return [*stated_quantities((*self.above, *titles, *between), dimension),
                *named_quantities(self.file, dimension)]

    def unit_beside(self, choice: ColumnChoice) -> tuple[str, str]:
        """Find the unit in the cells of a column without one in its heading, and where it is."""
        rows = [*self.above[-1:], *(row for row in self.below
                                    if row[1][choice.place] in self.labels(choice.place))]
        for line, cells in rows:
            cell = cells[choice.place] if choice.place < len(cells) else ""
            unit = usual_unit(cell.strip("[]() "))
            if unit and unit.isalpha() and quantity_of(unit) == choice.column.dimension:
                return unit, f"line {line} has {cell!r}"
        return "", ""

    def unit_of(self, choice: ColumnChoice) -> str:
        """Find the unit of a column's numbers, "" where only the key gives it."""
        if choice.by == "above":
            return usual_unit(Heading.of(self.explained[choice.place][1]).unit) or ""
        if choice.by == "numbers":
            return likely_unit(choice.column.name, self.numbers(choice.place))
        return (usual_unit(self._headings[choice.place].unit) or ""
                if choice.by in ("words", "unit") else self.unit_beside(choice)[0])

    def doubts(self, choice: ColumnChoice) -> Iterator[str]:
        """Yield reasons against a choice, or for another one."""
        column, place = choice.column, choice.place
        title, words = self.header.titles[place], self._headings[place].words
        if choice.by == "numbers":
            yield self._asks_by_numbers(choice)
            return
        if choice.by == "above":
            line, said = self.explained[place]
            yield f"line {line} says {said!r}"
        if choice.by in ("no unit", "other unit"):
            unit, where = self.unit_beside(choice)
            yield ("the heading has no unit that fits; " + (f"taken is {unit!r}, as {where}" if unit
                   else f"the unit is that of the key{self._other_unit(choice)}"))
        elif choice.by == "unit":
            other = self._of_something_else(place)
            if other or column.name == "voltage_max":
                scaled = f": write it as {self.line(column, place, ', scale = 100')}"
                yield (f"the only column in a unit of {column.dimension}"
                       + f"; {other}" * bool(other) + scaled * bool(_FACTOR.search(title)))
            elif not self._is_certain(choice):
                yield (f"the only column in a unit of {column.dimension}, but its words are not "
                       f"known: look whether {title!r} is the {column.name}; if not, write "
                       "another heading")
        if column.name in ("voltage", "voltage_max") and choice.by in ("words", "unit"):
            most = float(np.nan_to_num(np.abs(self._si(choice))).max(initial=0.0))
            if 0.0 < most < _HIGH:
                scaled = f"{column.title} = {{ from = {_quoted(title)}, scale = 1 }}"
                yield (f"at most {most:.3g} V move no film; if a monitor shows 1 V for 1 kV, write "
                       f"{scaled}")
        if words not in _SURE and not column.claims(title):
            rivals = [*self._rivals(choice)][:SHOWN]
            if rivals:
                near = " or ".join(repr(self.header.titles[other]) for other in rivals)
                lines = " or ".join(self.line(column, other) for other in rivals)
                yield f"it may also be {near}: then write {lines}"
            if column.name == "mass":
                yield from self._doubts_of_mass(choice)
            if column.name == "mass" and _SPECIMENS.alluded(words):
                yield ("it may be the film's own mass, which is none of what hangs on it: then "
                       f"write {column.title} = {{ value = {EXAMPLES['mass']} }}")
        if column.name == "stretch":
            yield from self._doubts_of_strain(choice)
        if column.name == "frequency" and doubts.swept(self.numbers(place), self._states("")):
            yield ("one state has many frequencies: those of a drive are none, only natural "
                   "frequencies")
        if column.name in ("displacement", "force"):
            yield from filter(None, [self.sign(choice)[1]])
        if column.name == "displacement" and self.kind in _FROM_FLAT:
            yield from self._doubts_of_zero(choice)

    def _is_certain(self, choice: ColumnChoice) -> bool:
        """Check whether a column is known by its words, or by its numbers as well as by its unit.

        They count if masses, voltages and deflections are those of a film that stands here.
        """
        dimension, words = choice.column.dimension, self._headings[choice.place].words
        if choice.column.alludes(words):
            return True
        if choice.column.name == "voltage" and not (self._si(choice) >= _HIGH).any():
            return False
        sensors = SENSORS.get(dimension)
        return (sensors is not None and sensors.alluded(words)) or self._is_of_a_film

    @cached_property
    def _is_of_a_film(self) -> bool:
        """Whether deflections are those of masses and voltages on a film that stands here."""
        moved = self.choices.get("displacement")
        if self.kind not in _FROM_FLAT or moved is None or not {"mass", "voltage"} <= {
                *self.choices} or self.bare or not self.specimens:
            return False
        voltage, mass = self._of("voltage"), self._of("mass")
        return (voltage is not None and mass is not None and self._rising(moved) is not None
                and bool(np.nan_to_num(np.abs(voltage)).max() > 0 and (mass > 0).any())
                and not any(self._doubts_of_zero(moved)))

    def _other_unit(self, choice: ColumnChoice) -> str:
        """Say what to write where the numbers of a column have another unit than its key."""
        column, title = choice.column, self.header.titles[choice.place]
        if choice.by == "no unit":
            keys = (f"{column.name}_{unit}" for unit in OTHER_UNITS.get(column.name, ()))
            key = next((key for key in keys if key != column.title), "")
            return f"; if it is another, write {key} = {_quoted(title)}" if key else ""
        if not column.unit:
            return ""
        return (f"; if 1 in the table is 25 {column.unit}, write "
                + self.line(column, choice.place, ", scale = 25"))

    def _asks_by_numbers(self, choice: ColumnChoice) -> str:
        """Ask about a column that is chosen by its numbers, with what else to write."""
        name, values = choice.column.name, self.numbers(choice.place)
        key = f"{name}_{self.unit_of(choice)}" if self.unit_of(choice) else choice.column.title
        other = next((self.header.titles[place] for place in self.unknown
                      if place != choice.place and not self._is_no_number(place)), "")
        units = (f"{name}_{unit}" for unit in OTHER_UNITS.get(name, ()))
        unit = next((other for other in units if other != key), "")
        ways = [f"{key} = {_quoted(other)} (another heading)"] * bool(other)
        ways += [f"{unit} = {_quoted(self.header.titles[choice.place])} (another unit)"
                 ] * bool(unit)
        if name in EXAMPLES:
            ways.append(f"{choice.column.title} = {{ value = {EXAMPLES[name]} }} (one value for "
                        "all rows)")
        return (f"guessed by its numbers, {np.nanmin(values):g} to {np.nanmax(values):g}; if it is "
                f"not the {name} in {key.removeprefix(f'{name}_')}, write " + ", or ".join(ways))

    def _rivals(self, choice: ColumnChoice) -> Iterator[int]:
        """Yield other columns in a unit of the same kind that may be meant."""
        dimension = self._dimensions[choice.place]
        taken = {other.place for other in self.choices.values()}
        for place in self.unknown if dimension else ():
            words = self._headings[place].words
            if (place not in taken and self._dimensions[place] == dimension and self._reads(place)
                    and (choice.column.knows(words) or (choice.column.required and (
                        choice.column.name == "mass" or choice.column.alludes(words)
                        or OTHER_READINGS.alluded(words))))):
                yield place

    def _doubts_of_mass(self, choice: ColumnChoice) -> Iterator[str]:
        """Yield doubts about a mass outside the column that does not occur in it."""
        factor = choice.column.also[0].factor(self._headings[choice.place].unit) or 1.0
        values = factor * self.numbers(choice.place)
        for one in self.stated("mass"):
            if not np.isclose(values, one.value, rtol=1e-6).any():
                yield f"{one.text}: look whether it is in the masses of this column"
                return

    def _doubts_of_strain(self, choice: ColumnChoice) -> Iterator[str]:
        heading, values = self._headings[choice.place], self.numbers(choice.place)
        if heading.words in STRETCHES[0].words and np.nanmin(
                np.append(values * (STRETCHES[0].factor(heading.unit) or 1.0), 1.0)) < _SHORT:
            yield "below 1 a strip would be pressed: strains have other headings, such as Strain"
        if (heading.words in STRETCHES[1].words and not heading.unit
                and np.nan_to_num(np.abs(values)).max(initial=0.0) > _STRAINED):
            yield ("the strain has no unit: taken as a number, 0.5 for 50 %; if it is in per cent, "
                   "write (%) into its heading")

    def _doubts_of_zero(self, choice: ColumnChoice) -> Iterator[str]:
        """Yield doubts whether deflections are counted from the flat film."""
        values, mass = self.numbers(choice.place), self._of("mass")
        loaded = values if mass is None else np.where(mass == 0, np.nan, values)
        voltage = self._of("voltage")
        if voltage is not None and doubts.from_rest(loaded, voltage, self._states("voltage")):
            yield ("it is 0 at the lowest voltage, but deflections count from the flat film, "
                   "before anything hangs on it; differences between voltages belong into "
                   "range.csv")
        elif (self.kind == "static" and mass is not None
              and doubts.hardly_grow(values, mass, self._states("mass"))):
            yield ("it hardly grows with the mass, but deflections count from the flat film, "
                   f"before anything hangs on it; {self._with_zero(choice)}")
        elif mass is not None and self.kind in _FROM_FLAT:
            yield from self._doubts_of_size(choice)

    def _doubts_of_size(self, choice: ColumnChoice) -> Iterator[str]:
        """Yield doubts about deflections that the masses cannot cause in any of the films."""
        heavy = self.choices["mass"]
        voltage = self._of("voltage")
        still = np.zeros(len(self.below)) if voltage is None else np.abs(np.nan_to_num(voltage))
        rows = np.flatnonzero(still == still.min(initial=np.inf))
        deflections = np.abs(self._si(choice))[rows]
        films = [film for film in self.specimens.values() if film.plate is not None]
        if not (len(rows) and films and np.isfinite(deflections).all()):
            return
        usual = np.array([doubts.usual_deflections(film, self._si(heavy)[rows]) for film in films])
        loaded = (usual > 0).all(axis=0) & np.isfinite(usual).all(axis=0)
        if not loaded.any():
            return
        ratios = np.median(deflections[loaded] / usual[:, loaded], axis=1)
        if ratios.min() > _UNUSUAL or ratios.max() < 1 / _UNUSUAL:
            first = int(np.flatnonzero(loaded)[0])
            yield (f"line {self.below[int(rows[first])][0]} has {1e3 * deflections[first]:.3g} mm, "
                   f"where this mass pulls {films[0].name} down by some "
                   f"{1e3 * usual[0][first]:.2g} mm: look at unit and mass; "
                   + self._with_zero(choice))

    def _with_zero(self, choice: ColumnChoice) -> str:
        """Advise to write the number of the flat film."""
        more = f', sign = "{self.sign(choice)[0]}", zero = 50'
        return ("if the flat film has not 0 but 50 there, write "
                + self.line(choice.column, choice.place, more))

    def _si(self, choice: ColumnChoice) -> Array:
        """Convert numbers of a choice to SI."""
        unit = self.unit_of(choice)
        title = f"{choice.column.name}_{unit}" if unit.isalpha() else choice.column.title
        return self.numbers(choice.place) * choice.column.factor(title)

    def _of(self, name: str) -> Array | None:
        """Read the numbers of a chosen column."""
        choice = self.choices.get(name)
        return None if choice is None else self.numbers(choice.place)

    def _states(self, along: str) -> Numbers:
        """Assign numbers to groups of rows that differ in only one column of settings."""
        places = [source.place for name, source in self.sources.items()
                  if name in ("specimen", "run") and source.place is not None]
        places += [choice.place for name, choice in self.choices.items()
                   if name in ("mass", "voltage") and name != along]
        return doubts.groups_of([self.cells(place) for place in places], len(self.below))

    @cached_property
    def bare(self) -> bool:
        """Whether no film near has a plate: gas loads them, and no mass hangs on one."""
        return bool(self.specimens) and all(film.plate is None for film in self.specimens.values())

    def sign(self, choice: ColumnChoice) -> tuple[str, str]:
        """Find the sign of a column's numbers, and a doubt about it.

        Deflections rise with the voltage and with the mass, forces with the deflection.
        """
        name, values = choice.column.name, self.numbers(choice.place)
        negative = doubts.all_negative(values)
        if name == "voltage":
            return ("up" if negative else "down"), ""
        if self.bare and name == "displacement":
            return "down", ("gas from below lifts a film without plate, and its displacements are "
                            "negative: look which way they count")
        rising = self._rising(choice)
        if rising is False:
            return "up", (f"the numbers fall where {name}s rise: taken as counted the other way; "
                          'if they are not, write sign = "down"')
        if negative and rising is None:
            return "up", ("all numbers are negative: taken as counted the other way; if they are "
                          'not, write sign = "down"')
        if negative:
            return "down", ("all numbers are negative: look which way they count; if the other "
                            'way, write sign = "up"')
        if name == "displacement" and HEIGHTS.alluded(self._headings[choice.place].words):
            return ("down" if rising else "up"), "a height: look from where and which way it counts"
        return "down", ""

    def _rising(self, choice: ColumnChoice) -> bool | None:
        """Check if the numbers rise along their independent column; None where this is unclear."""
        values = self.numbers(choice.place)
        for along in _RISES.get((self.kind, choice.column.name), ()):
            other = self._of(along)
            if other is None:
                continue
            if along == "displacement":
                other = -other if self._up(along) else other
                groups = np.zeros(len(other), np.int64)
            else:
                other, groups = np.abs(other), self._states(along)
            rising = doubts.rises(values, other, groups)
            if rising is not None:
                return rising
        return None

    def _up(self, name: str) -> bool:
        """Check whether a chosen column has the opposite sign."""
        choice = self.choices.get(name)
        return choice is not None and self.sign(choice)[0] == "up"

    def doubts_of_kind(self) -> Iterator[tuple[str, str, str]]:
        """Yield doubts about the kind: its reading, a question, the kind if the answer is yes."""
        if self.asked:
            known = {"static": "states of a plate at rest", "transient": "a run in time"}
            yield (f"no heading of the table is known: taken as {known.get(self.kind, self.kind)}",
                   "If not, draft it again (force, coupon, frequency and range are kinds, too)",
                   "static" if self.kind == "transient" else "transient")
        if self.of_a_tester and "voltage" not in self.choices and not self.of_a_strip:
            what, kind, of = (("the plate of an actuator", "coupon", "a strip of film")
                              if self.kind == "force"
                              else ("a strip of film", "force", "the plate of an actuator"))
            yield (f"force and displacement without voltage: taken as those of {what}",
                   f"If {of} was pulled", kind)
        places = [self.choices[name].place for name in ("force", "voltage") if name in self.choices]
        if self.kind == "force" and len(places) > 1 and doubts.forces_are_weights(
                *map(self.cells, places)):
            yield ("each force stands at several voltages: taken as a tester's", "If weights hung "
                   "on the plate, write their masses [kg], which are N / 9.81, into the table",
                   "static")
        moved = self.choices.get("displacement")
        if self.kind == "static" and moved and any(
                self._headings[moved.place].words in meaning.words for meaning in RANGES):
            yield (f"{self.header.titles[moved.place]!r} is taken as the distance from the flat "
                   "film", "If it is that between two voltages", "range")
        peaks = [title for title in self.header.titles if _PEAKS.search(title)]
        if self.kind == "static" and peaks:
            yield (f"{peaks[0]!r} is taken as a column of states at rest",
                   "If it is from peak to peak", "range")
        voltages = self.cells(self.choices["voltage"].place) if "voltage" in self.choices else []
        if self.kind == "static" and doubts.even(self._times):
            yield ("the times are evenly spaced: taken as a list of states at rest",
                   "If it is a run in time", "transient")
        if (self.kind == "transient" and len(set(voltages)) >= _STEPS
                and not doubts.quick(self._times)):
            yield ("the voltage changes slowly: taken as a run in time",
                   "If each line is a state at rest", "static")

    def run_back(self) -> int | None:
        """Find the line where time runs back, although no new run is marked there."""
        if self.kind != "transient" or "t" not in self.choices or "run" in self.sources:
            return None
        row = doubts.run_back(self.numbers(self.choices["t"].place), self._states(""))
        return None if row is None else self.below[row][0]

