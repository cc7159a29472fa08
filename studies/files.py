"""Results on disk: files are written under a temporary name and renamed, so they are never partial.

Files are read strictly: a file that is missing, damaged or of another kind gives one message that
names it.
"""

from __future__ import annotations

import csv
import json
import tomllib
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from functools import cache
from math import isinf, nan
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Printed, fields_of
from tympan.base.process.folder import (
    is_own,
    put,
    take_away,
    temporary_beside,
    together,
)
from tympan.base.process.interruption import raise_again
from tympan.base.read_file import STORED, file_text

T = TypeVar("T")


def write_atomically(file: Path, write: Callable[[Path], object], hashed: bool = False) -> None:
    """Let ``write`` fill a temporary file in the folder of ``file``, and rename it.

    A failure or a signal leaves the old file, or none. A file that tympan did not write, or that
    was changed since, is never replaced. This is not checked where the name is ``hashed``, because
    nobody else gives such a name.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with temporary_beside(file) as temporary:
            if not hashed:
                is_own(file)
            write(temporary)
            raise_again()
            temporary.chmod(0o644)
            put(temporary, file, listed=not hashed)
    except OSError as error:  # libraries may raise it without a number
        raise InputError(f"cannot be written: {error.strerror or error}", file=file) from None


def remove(folder: Path, *names: str) -> None:
    """Remove files of an earlier run, so that none is mixed with results of another run."""
    raise_again()
    try:
        for file in [file for file in map(folder.joinpath, names) if is_own(file)]:
            take_away(file)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=folder) from None


@contextmanager
def replaced(folder: Path, names: Iterable[str]) -> Iterator[None]:
    """Replace a result with its pictures: all of it, or nothing where a step fails.

    Pictures of an earlier run stay until new ones replace them; the others are removed at the end.
    """
    before = {name: (folder / name).stat().st_ino for name in names if is_own(folder / name)}
    with together(folder):
        yield
        remove(folder, *(name for name, number in before.items()
                         if (folder / name).exists() and (folder / name).stat().st_ino == number))


def write_text(file: Path, text: str, hashed: bool = False) -> None:
    """Write a text file atomically."""
    write_atomically(file, lambda path: path.write_text(text, encoding="utf-8"), hashed)


def write_json(file: Path, value: Any) -> None:
    """Write a JSON file atomically."""
    write_text(file, json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_csv(file: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a CSV file atomically; floats have 12 significant digits."""
    def write(path: Path) -> None:
        with path.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(header)
            writer.writerows([f"{cell:.12g}" if isinstance(cell, float) else cell for cell in row]
                             for row in rows)

    write_atomically(file, write)


def write_arrays(file: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays by name atomically: MATLAB's NAME.mat or NumPy's NAME.npz."""
    def write(path: Path) -> None:
        with path.open("wb") as stream:
            if file.suffix == ".mat":
                savemat(stream, dict(arrays), long_field_names=True)
            else:
                np.savez(stream, **arrays)

    from scipy.io import savemat

    write_atomically(file, write)


def read_text(file: Path, most: int = STORED) -> str:
    """Read a result's text in UTF-8, of at most ``most`` bytes."""
    if not file.exists():
        raise InputError("is missing: run the command that wrote the folder again", file=file)
    return file_text(file, most)


def words_beside(module: str) -> dict[str, str]:
    """Read sentences by key, from the .toml file of a module, given by its ``__file__``."""
    return tomllib.loads(Path(module).with_suffix(".toml").read_text(encoding="utf-8"))


def read_json(file: Path) -> Any:
    """Read the value of a JSON file."""
    text = read_text(file)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"is not valid JSON: {error}", file=file) from None
    except (ValueError, RecursionError):
        raise InputError("is not valid JSON: a number has too many digits, or objects are nested "
                         "too deep", file=file) from None


def stored_file(folder: Path, pattern: str, name: str | None, writer: str) -> Path:
    """Find the file of one result in a folder; ``name`` replaces * in the pattern.

    Without a name there must be exactly one file. ``writer`` is the command that an error message
    suggests.
    """
    if name is not None:
        return folder / pattern.replace("*", name)
    files = sorted(folder.glob(pattern))
    if len(files) != 1:
        there = ", ".join(file.name for file in files) or "none"
        raise InputError(f"must hold one {pattern}, as {writer} writes it; there: {there}",
                         file=folder)
    return files[0]


#: Key of a mapping that is stored without a key of its own; no field has this key.
_INLINE = ""


@cache
def _stored(cls: Any, unit: str) -> tuple[tuple[str, str, Printed], ...]:
    """List the fields of a dataclass that are stored: name, key, and printed form.

    Fields that are not compared have files of their own and are left out.
    """
    declared = {field.name: field.printed for field in fields_of(cls)}
    stored = [(item.name, declared.get(item.name, Printed()))
              for item in fields(cls) if item.compare]
    return tuple((name, _INLINE if printed.inline else printed.spelled(name, unit), printed)
                 for name, printed in stored)


def to_json(value: Any, unit: str = "") -> Any:
    """Convert a value to JSON for :func:`from_json`: dataclasses to objects, arrays to lists.

    Keys of fields that are ``in_unit`` end with the ``unit``.

    Examples
    --------
    >>> to_json({"loads": (1.0, float("inf")), "size": np.zeros(2)})
    {'loads': [1.0, 'inf'], 'size': [0.0, 0.0]}
    """
    if isinstance(value, float):
        return str(value) if isinf(value) else float(value)
    if value is None or isinstance(value, str | int):
        return value
    if is_dataclass(value):
        kind: Any = type(value)
        record: dict[str, Any] = {}
        for name, key, printed in _stored(kind, unit):
            part = getattr(value, name)
            if part is None and printed.may_miss:
                continue
            entry: Any = None if printed.may_miss and part != part else to_json(part, unit)
            record |= entry if key == _INLINE else {key: entry}
        return record
    if isinstance(value, Mapping):
        return {str(name): to_json(entry, unit) for name, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return to_json(value.tolist())
    if isinstance(value, tuple | list):
        return [to_json(entry, unit) for entry in value]
    return value


def from_json(kind: type[T], value: Any, file: Path | str | None = None, key: str = "",
              unit: str = "") -> T:
    """Convert a JSON value to a dataclass, or to another annotated type.

    Keys of fields that are ``in_unit`` end in the ``unit``. Keys that the type does not have are
    ignored, since a record may hold more than its class. Fields with a default may be missing;
    those that are not compared always are. An :class:`InputError` names file and key of a value
    that is missing or of another type.

    Examples
    --------
    >>> from_json(tuple[float, ...], [1, 2.5])
    (1.0, 2.5)
    """
    return cast(T, _converted(kind, value, _Place(file, key, unit)))


@dataclass(frozen=True)
class _Place:
    """Place of a value in a JSON file: file and key; ``unit`` is that of the whole result."""

    file: Path | str | None
    key: str
    unit: str

    def error(self, allowed: str, given: Any = None) -> InputError:
        """Make the error about the value here."""
        return InputError(allowed, file=self.file, key=self.key or None, given=given)

    def at(self, name: str) -> _Place:
        """Find the place of an object's entry."""
        return replace(self, key=f"{self.key}.{name}".lstrip("."))

    def item(self, number: int) -> _Place:
        """Find the place of a list's item."""
        return replace(self, key=f"{self.key}[{number}]")


def _converted(kind: Any, value: Any, place: _Place) -> Any:
    """Convert a JSON value at a place to a type."""
    if kind is Any:
        return value
    if is_dataclass(kind):
        return _record(kind, value, place)
    if kind is float:
        return _number(value, place)
    return _READERS.get(get_origin(kind), _instance)(kind, value, place)


def _record(kind: Any, value: Any, place: _Place) -> Any:
    if not isinstance(value, dict):
        raise place.error("must be an object", value)
    hints, arguments = get_type_hints(kind), {}
    stored = {name: (own, printed) for name, own, printed in _stored(kind, place.unit)}
    for item in fields(kind):
        own, printed = stored.get(item.name, (None, Printed()))
        hint = hints[item.name]
        if own == _INLINE:
            choices = printed.choices or {}
            beside = {name: entry for name, entry in value.items() if name in choices}
            arguments[item.name] = _converted(hint, beside, place)
        elif printed.may_miss and value.get(own, 0) is None:
            arguments[item.name] = nan
        elif own in value:
            arguments[item.name] = _chosen(hint, value[own], printed, place.at(str(own)))
        elif item.default is MISSING and item.default_factory is MISSING:
            raise place.at(str(own)).error("is missing: run the command that wrote the file again")
    return kind(**arguments)


def _chosen(kind: Any, value: Any, printed: Printed, place: _Place) -> Any:
    """Convert a field's value, which must be one of its choices, if it has any."""
    part = _converted(kind, value, place)
    if printed.choices is not None and part not in (None, *printed.choices):
        raise place.error(f"must be one of {', '.join(printed.choices)}", part)
    return part


def _number(value: Any, place: _Place) -> float:
    if value in ("inf", "-inf"):
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise place.error("must be a number", value)
    return float(value)


def _literal(kind: Any, value: Any, place: _Place) -> Any:
    if value not in get_args(kind):
        raise place.error(f"must be one of {', '.join(map(str, get_args(kind)))}", value)
    return value


def _option(kind: Any, value: Any, place: _Place) -> Any:
    options = get_args(kind)
    if value is None and type(None) in options:
        return None
    first, *_ = (option for option in options if option is not type(None))
    return _converted(first, value, place)


def _tuple(kind: Any, value: Any, place: _Place) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise place.error("must be a list", value)
    items = get_args(kind)
    repeated = len(items) == 2 and items[1] is Ellipsis
    if not repeated and len(value) != len(items):
        raise place.error(f"must be a list of {len(items)}", value)
    kinds = [items[0]] * len(value) if repeated else items
    return tuple(_converted(item, entry, place.item(number))
                 for number, (item, entry) in enumerate(zip(kinds, value, strict=True)))


def _mapping(kind: Any, value: Any, place: _Place) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise place.error("must be an object", value)
    return {name: _converted(get_args(kind)[1], entry, place.at(name))
            for name, entry in value.items()}


def _array(kind: Any, value: Any, place: _Place) -> Any:
    try:
        return np.array(value, float)
    except (TypeError, ValueError):
        raise place.error("must be a list of numbers", value) from None


def _instance(kind: Any, value: Any, place: _Place) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        words = {str: "a text", int: "a whole number", bool: "true or false"}
        raise place.error(f"must be {words.get(kind, kind.__name__)}", value)
    return value


#: Readers of annotated types by their origin; all others are read as instances of a class.
_READERS: dict[Any, Callable[[Any, Any, _Place], Any]] = {
    Literal: _literal, Union: _option, types.UnionType: _option, tuple: _tuple, dict: _mapping,
    Mapping: _mapping, np.ndarray: _array}
