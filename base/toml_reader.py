"""Strict reading of TOML: keys are read by name; a key that nothing reads is an error."""

from __future__ import annotations

import re
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, replace
from functools import cache, cached_property
from math import inf
from pathlib import Path
from typing import Any, Self, TypeVar

from tympan.base.errors import WORKS_STILL, InputError, did_you_mean, nearest_word
from tympan.base.file_kinds import require_kind
from tympan.base.read_file import WRITTEN, beside, file_text
from tympan.base.units import DIMENSIONS, RANGE, bounded, evenly, quantities, quantity, range_ends

T = TypeVar("T")
Rule = tuple[Callable[[Any], bool], str]

POSITIVE: Rule = (lambda x: 0 < x < inf, "must be positive")
NON_NEGATIVE: Rule = (lambda x: 0 <= x < inf, "must not be negative")
FINITE: Rule = (lambda x: -inf < x < inf, "must be finite")
A_NUMBER: Rule = (lambda x: x == x, "must be a number")
WHOLE: Rule = (lambda x: x % 1 == 0, "must be a whole number")

#: Most tables and lists within each other, and dots of a key: files of tympan need only a few, and
#: the parser of the standard library takes very long on many.
_DEEPEST = 20
#: Shapes of drawings by the ends of their names.
_DRAWINGS = {"dxf": "dxf", "step": "step", "stp": "step"}
#: Most entries of a list. A longer one is data and belongs in a table of its own file.
_ENTRIES = 10_000

_LONGEST_KEY = 500
#: TOML's own limits of whole numbers.
_WHOLE_NUMBERS = range(-(2**63), 2**63)
#: Pattern of a key with too many parts, on which the standard parser takes very long.
_TOO_DOTTED = re.compile(rf"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){{{_DEEPEST}}}""")


@dataclass
class Table:
    """One TOML table while it is read, its dotted path, and the keys read so far.

    ``known`` has the keys it may hold by all words that people write for them; a synonym comes
    with what its key holds. ``meanings`` says what each key holds.

    A quantity is a text with a unit; in a ``plain`` table an SI number under a key that ends with
    the unit, ``radius_m``. All are returned in SI. ``above`` is the table it stands in.
    """

    file: Path | str
    data: Mapping[str, Any]
    where: str = ""
    plain: bool = False
    asked: set[str] = field(default_factory=set)
    known: dict[str, tuple[str, str]] = field(default_factory=dict)
    meanings: dict[str, str] = field(default_factory=dict)
    above: Table | None = None

    @classmethod
    def read(cls, file: Path | str, kind: str = "") -> Self:
        """Parse a file; an :class:`InputError` gives the line and column of a fault.

        ``kind`` is one of :data:`tympan.base.file_kinds.KINDS`: a file of another kind is refused,
        with the commands that take it.
        """
        text = file_text(file, WRITTEN)
        too_deep = f"is not valid TOML: tables are nested more than {_DEEPEST} deep"
        if _TOO_DOTTED.search(text):
            raise InputError(too_deep, file=file)
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            drawn = Path(file).suffix.lower().lstrip(".")
            shape = _DRAWINGS.get(drawn)
            raise InputError(f"is not valid TOML: {error}" if shape is None else
                             f'is a drawing: name it in a specimen\'s file, frame = {{ shape = '
                             f'"{shape}", file = "{Path(file).name}" }}', file=file) from None
        except RecursionError:
            raise InputError(too_deep, file=file) from None
        except ValueError:  # more digits than Python reads
            raise InputError("is not valid TOML: a number has too many digits", file=file) from None
        _check_values(data, file, too_deep)
        require_kind(file, data, kind)
        return cls(file, data)

    def path(self, key: str) -> str:
        """Write the dotted path of a key."""
        return f"{self.where}.{key}" if self.where else key

    def error(self, key: str, allowed: str, given: object = None) -> InputError:
        """Make an error about one key."""
        return InputError(allowed, file=self.file, key=self.path(key), given=given)

    def renamed(self, former: str, now: str) -> Table:
        """Rename a key that files had formerly, and warn once of it; both at once are an error."""
        if former not in self.data:
            return self
        if now in self.data:
            raise self.error(former, f"is {now} now, which is there, too: write {now} alone")
        warnings.warn(f"{self.file}: {self.path(former)} is {self.path(now)} now; the former key "
                      f"{WORKS_STILL}", FutureWarning, stacklevel=3)
        return replace(self, data={now if key == former else key: value
                                   for key, value in self.data.items()})

    def knows(self, key: str, also: Sequence[str] = (), meaning: str = "") -> None:
        """Register a key, so that messages offer it for words near it, or near one of ``also``."""
        self.meanings[key] = meaning
        self.known = dict.fromkeys(also, (key, meaning)) | self.known | {key: (key, "")}

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def value(self, key: str, default: Any = MISSING) -> Any:
        """Read the raw value of a key, or its default."""
        self.asked.add(key)
        if key in self.data:
            return self.data[key]
        if default is MISSING:
            meaning = self.meanings.get(key)
            raise self.error(key, "is missing" + (
                self._instead(key) or f" ({meaning})" * bool(meaning)))
        return default

    def _instead(self, key: str) -> str:
        """Ask for keys of the file that may stand for a missing one."""
        words, instead, holds = {key: (key, "")} | self.known, [], ""
        for name in self.data:
            if name in self.asked or words.get(name) == (name, ""):
                continue
            near = nearest_word(name, words)
            if near is not None and words[near][0] == key:
                instead.append(repr(name))
                holds = holds or f" It holds {words[near][1]}" * bool(words[near][1])
        return f": did you mean it by {' and '.join(instead)}?{holds}" if instead else ""

    def table(self, key: str, default: Any = MISSING) -> Table:
        """Read a sub-table."""
        value = self.value(key, default)
        if not isinstance(value, Mapping):
            raise self.error(key, "must be a table", value)
        return self._within(value, key)

    def table_or_file(self, key: str) -> Table:
        """Read a sub-table, empty where it is left out, or the file of its keys that is named."""
        value = self.value(key, {})
        if isinstance(value, str):
            return Table.read(self.beside(key), key)
        if not isinstance(value, Mapping):
            raise self.error(key, "must be a table, or the name of a file with its keys", value)
        return self._within(value, key)

    def parts(self, key: str, what: str) -> tuple[str | Table, ...]:
        """Read one name or sub-table, or a list of them; ``what`` each stands for."""
        value = self.value(key)
        items = value if isinstance(value, list) else [value]
        if not items or not all(isinstance(item, str | Mapping) for item in items):
            raise self.error(key, f"must be {what}, or a list of them", value)
        return tuple(item if isinstance(item, str) else
                     self._within(item, f"{key}.{number}" if isinstance(value, list) else key)
                     for number, item in enumerate(items))

    def _within(self, data: Mapping[str, Any], key: str) -> Table:
        return Table(self.file, data, self.path(key), self.plain, above=self)

    def spelled(self, key: str, dimension: str) -> str:
        """Write a key as the file has it; ``dimension`` is "" for all but quantities."""
        return key + DIMENSIONS[dimension].suffix if self.plain and dimension else key

    def text(self, key: str, default: Any = MISSING, rule: Rule | None = None) -> str:
        """Read a non-empty string."""
        value = self.value(key, default)
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, "must be a non-empty string", value)
        if rule is not None and not rule[0](value):
            raise self.error(key, rule[1], value)
        return value

    def beside(self, key: str) -> Path:
        """Locate the file that a key names, relative to the table's own file."""
        return self.named_file(key, self.text(key))

    def named_file(self, key: str, name: str) -> Path:
        """Locate the file of a ``name`` under a key, relative to the table's own file."""
        if "\0" in name:
            raise self.error(key, "must name a file: no file has NUL in its name", name)
        try:
            return beside(Path(self.file).parent, name)
        except InputError as error:
            raise self.error(key, error.allowed, name) from None

    def truth(self, key: str, default: Any = MISSING) -> bool:
        """Read true or false."""
        value = self.value(key, default)
        if not isinstance(value, bool):
            raise self.error(key, "must be true or false", value)
        return value

    def number(self, key: str, dimension: str = "", default: Any = MISSING,
               rule: Rule = FINITE) -> float:
        """Read a quantity of a dimension, or a plain number."""
        key = self.spelled(key, dimension)
        return self._number(key, self.value(key, default), dimension, rule)

    def numbers(self, key: str, dimension: str = "", default: Any = MISSING, rule: Rule = FINITE,
                count: int | None = None) -> tuple[float, ...]:
        """Read a list of quantities, or of plain numbers.

        Any number of quantities may also be one text with commas or a range, as
        :func:`~tympan.base.units.quantities` reads it, a list of such texts, or a table of a range:
        ``from``, ``to`` and ``count``.
        """
        key, value = self.spelled(key, dimension), self.value(self.spelled(key, dimension), default)
        what = f"quantities ({dimension})" if dimension else "numbers"
        loose = dimension and not self.plain and count is None
        if loose and isinstance(value, Mapping):
            return self._span(key, value, dimension, rule)
        ends = range_ends(value) if count == 2 else None
        if ends is not None:
            value = ends if dimension else [float(end) for end in ends]
        items = self._list(key, [value] if loose and isinstance(value, str) else value, count, what)
        return tuple(number for item in items for number in (
            self._quantities(key, item, dimension, rule) if loose and isinstance(item, str)
            else (self._number(key, item, dimension, rule),)))

    def _quantities(self, key: str, text: str, dimension: str, rule: Rule) -> tuple[float, ...]:
        """Read one quantity or several, with commas or as a range."""
        try:
            found = quantities(text, dimension)
        except InputError as error:
            raise error.located(file=self.file, key=self.path(key)) from None
        return tuple(self._kept(key, number, rule, text) for number in found)

    def _span(self, key: str, value: Mapping[str, Any], dimension: str, rule: Rule
              ) -> tuple[float, ...]:
        """Read a range that is a table."""
        span = self._within(value, key)
        low, high = (span.number(end, dimension, rule=rule) for end in ("from", "to"))
        count = span.number("count", "", RANGE, WHOLE)
        span.done()
        try:
            return tuple(evenly(low, high, int(count)))
        except InputError as error:
            raise self.error(f"{key}.count", error.allowed, count) from None

    def texts(self, key: str) -> tuple[str, ...]:
        """Read a list of texts."""
        items = self._list(key, self.value(key), None, "texts")
        for item in items:
            if not isinstance(item, str):
                raise self.error(key, "must be a list of texts", item)
        return tuple(map(str, items))

    def places(self, key: str, least: int = 1, count: int | None = None,
               rule: Rule = FINITE) -> tuple[tuple[float, float], ...]:
        """Read a list of points, each a pair of lengths: ``count`` or at least ``least`` points."""
        key = self.spelled(key, "length")
        items = self._list(key, self.value(key), count, "points, each a pair of lengths")
        if len(items) < least:
            raise self.error(key, f"must be at least {least} points", items)
        points = []
        for number, item in enumerate(items):
            where = f"{key}.{number}"
            x, y = self._list(where, item, 2, "quantities (length)")
            points.append((self._number(where, x, "length", rule),
                           self._number(where, y, "length", rule)))
        return tuple(points)

    def tables(self, key: str) -> tuple[Table, ...]:
        """Read the sub-tables of a list, or a single one; none if the key is missing."""
        value = self.value(key, [])
        entries = [value] if isinstance(value, dict) else value
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise self.error(key, "must be a table, or a list of tables", value)
        return tuple(self._within(entry, f"{key}.{number}")
                     for number, entry in enumerate(entries))

    def choice(self, key: str, options: Mapping[str, T], default: Any = MISSING) -> T:
        """Choose one of several named values."""
        if key not in self.data and default is MISSING:
            raise self.error(key, f"is missing: {one_of(None, options)}{self._instead(key)}")
        name = self.value(key, default)
        if not isinstance(name, str) or name not in options:
            raise self.error(key, one_of(name, options), name)
        return options[name]

    def named(self, key: str, find: Callable[[str], T]) -> T:
        """Find the object that the name under a key stands for."""
        try:
            return find(self.text(key))
        except InputError as error:
            raise self.error(key, error.allowed, self.data[key]) from None

    def done(self) -> None:
        """Refuse keys that nothing has read, with the table they belong to or the nearest name."""
        for key in self.data:
            if key not in self.asked:
                spelled = {word: f"{name!r} ({holds})" if holds else repr(name)
                           for word, (name, holds) in self.known.items()}
                hint = self._belongs(key) or did_you_mean(
                    key, spelled | {name: repr(name) for name in self.asked})
                raise self.error(key,
                                 f"unknown key: {hint}known here: {', '.join(sorted(self.asked))}")

    def _belongs(self, key: str) -> str:
        """Hint at the nearest table above that has a key; empty if none has."""
        above = self.above
        while above is not None and above.known.get(key) != (key, ""):
            above = above.above
        return "" if above is None else (
            f"it belongs to {above.where or 'the top of the file'}, above the tables there; ")

    def _list(self, key: str, value: object, count: int | None, what: str) -> Sequence[object]:
        if not isinstance(value, (list, tuple)) or not value or (count is not None
                                                                 and len(value) != count):
            number = f"{count} " if count is not None else ""
            raise self.error(key, f"must be a list of {number}{what}", value)
        if len(value) > _ENTRIES:
            raise self.error(key, f"must be at most {_ENTRIES} {what}", f"{len(value)} of them")
        return value

    def _number(self, key: str, value: object, dimension: str, rule: Rule = FINITE) -> float:
        try:
            if dimension and not self.plain:
                number = quantity(value, dimension)
            elif isinstance(value, bool) or not isinstance(value, int | float):
                raise InputError("must be a number without a unit", given=value)
            else:
                number = bounded(float(value))
        except InputError as error:
            raise error.located(file=self.file, key=self.path(key)) from None
        return self._kept(key, number, rule, value)

    def _kept(self, key: str, number: float, rule: Rule, given: object) -> float:
        holds, words = rule
        if not holds(number):
            raise self.error(key, words, given)
        return number


def one_of(name: object, options: Mapping[str, Any]) -> str:
    """Say which names are allowed, and the nearest one; options may have ``synonyms``."""
    spelled = getattr(options, "synonyms", {}) | {option: repr(option) for option in options}
    hint = did_you_mean(name, spelled).strip() if isinstance(name, str) else ""
    return f"must be one of {', '.join(sorted(options))}{f'; {hint}' if hint else ''}"


def _check_values(data: Mapping[str, Any], file: Path | str, too_deep: str) -> None:
    """Refuse whole numbers and nesting beyond the limits."""
    waiting: list[tuple[str, Any, int]] = [("", data, 0)]
    while waiting:
        key, value, depth = waiting.pop()
        if depth > _DEEPEST:
            raise InputError(too_deep, file=file, key=key[1:])
        if len(key) > _LONGEST_KEY:
            raise InputError(f"must be a key of at most {_LONGEST_KEY} characters", file=file,
                             key=f"{key[1:40]}…")
        if isinstance(value, int) and value not in _WHOLE_NUMBERS:
            raise InputError("must be a whole number of at most 64 bits", file=file, key=key[1:])
        parts = value.items() if isinstance(value, Mapping) else enumerate(
            value if isinstance(value, list) else ())
        waiting += [(f"{key}.{name}", part, depth + 1) for name, part in parts]


class Library(Mapping[str, T]):
    """Objects of a file of tympan's own by name; each is made when it is first asked for.

    ``tables`` finds the table of each object in the content of the file, ``make`` makes the object
    of one.
    """

    def __init__(self, file: Path, tables: Callable[[dict[str, Any]], dict[str, Any]],
                 make: Callable[[Table], T]) -> None:
        self._file, self._find, self._make = file, tables, make
        self._made: dict[str, T] = {}

    @cached_property
    def _tables(self) -> dict[str, Any]:
        return self._find(_content(self._file))

    def __getitem__(self, name: str) -> T:
        if name not in self._made:
            self._made[name] = self._make(Table(self._file, self._tables[name], plain=True))
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables)

    def __len__(self) -> int:
        return len(self._tables)


@cache
def _content(file: Path) -> dict[str, Any]:
    """Parse a file of tympan's own, once for all libraries in it."""
    return tomllib.loads(file.read_text(encoding="utf-8"))
