"""Numbers within dataclasses by their path of attributes and element numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cache, lru_cache
from typing import Any

from tympan.base.fields import fields_of


def numbers(value: Any, path: str) -> tuple[str, ...]:
    """List the paths of all continuous numbers within a dataclass or tuple.

    Examples
    --------
    >>> from tympan.geometry.outlines import Ellipse
    >>> numbers(Ellipse((0.06, 0.045)), "frame")
    ('frame.semi_axes.0', 'frame.semi_axes.1')
    """
    if isinstance(value, float | int | complex):
        return (path,)
    if isinstance(value, tuple):
        return tuple(name for index, item in enumerate(value)
                     for name in numbers(item, f"{path}.{index}"))
    if not is_dataclass(value):
        return ()
    return tuple(found for name in _continuous(value.__class__)
                 for found in numbers(getattr(value, name), f"{path}.{name}"))


def at(value: Any, path: Sequence[str]) -> Any:
    """Look up the value at a path within dataclasses and tuples."""
    for key in path:
        value = value[element(value, key)] if isinstance(value, tuple) else getattr(value, key)
    return value


def element(items: Sequence[Any], key: str) -> int:
    """Find the number of an element: its key is the number, or the name of an element with names.

    Elements are dataclasses or tables. LookupError where there is none.

    Examples
    --------
    >>> element([{"name": "A"}, {"name": "B"}], "B"), element([{"name": "A"}], "0")
    (1, 0)
    """
    if key.isdecimal() and int(key) < len(items):
        return int(key)
    names = [item.get("name") if isinstance(item, Mapping) else getattr(item, "name", None)
             for item in items]
    if key not in names:
        raise LookupError(key)
    return names.index(key)


def numbered(value: Any, path: str) -> str:
    """Write a path with the numbers of elements in place of their names.

    What follows a key that does not exist is left as it is.
    """
    keys = path.split(".")
    for place, key in enumerate(keys):
        try:
            if isinstance(value, tuple):
                keys[place] = str(element(value, key))
            value = at(value, (keys[place],))
        except (LookupError, AttributeError):
            break
    return ".".join(keys)


def with_change(value: Any, path: Sequence[str], change: Any) -> Any:
    """Copy a value with something added to the number at a path."""
    return with_number(value, path, at(value, path) + change)


def with_number(value: Any, path: Sequence[str], number: Any) -> Any:
    """Copy a value with another number at a path."""
    return with_numbers(value, {".".join(path): number})


def with_numbers(value: Any, numbers: Mapping[str, Any]) -> Any:
    """Copy a value with other numbers, by their path with dots; checked with all in place.

    Raises
    ------
    InputError
        When the result is not valid.
    """
    return _placed(value, _tree(tuple(numbers)), numbers, lambda old, new: replace(old, **new))


def with_arrays(value: Any, arrays: Mapping[str, Any]) -> Any:
    """Copy a value with arrays in place of numbers, by path with dots, for many values at once.

    Nothing is checked: the copy serves formulas alone.

    Examples
    --------
    >>> import numpy as np
    >>> from tympan.geometry.outlines import Ellipse
    >>> with_arrays(Ellipse((0.06, 0.045)), {"semi_axes.0": np.array([0.06, 0.07])}).semi_axes
    (array([0.06, 0.07]), 0.045)
    """
    return _placed(value, _tree(tuple(arrays)), arrays, _unchecked)


def _unchecked(value: Any, new: Mapping[str, Any]) -> Any:
    copied = object.__new__(type(value))
    vars(copied).update({name: new[name] if name in new else getattr(value, name)
                         for name in _names(value.__class__)})
    return copied


@cache
def _names(kind: type) -> tuple[str, ...]:
    """List the names of a dataclass's fields."""
    return tuple(item.name for item in fields(kind))


@cache
def _continuous(kind: type) -> tuple[str, ...]:
    """List the fields of a dataclass whose numbers are continuous."""
    discrete = {field.name for field in fields_of(kind) if field.discrete}
    return tuple(name for name in _names(kind) if name not in discrete)


#: Paths by their first key, each with what follows; a whole path at its end.
_Tree = dict[str, Any]


@lru_cache(maxsize=256)
def _tree(paths: tuple[str, ...]) -> _Tree | str:
    """Arrange paths with dots as a tree; the empty path stands for the whole value."""
    if "" in paths:
        return ""
    tree: _Tree = {}
    for path in paths:
        *way, last = path.split(".")
        inner = tree
        for name in way:
            inner = inner.setdefault(name, {})
        inner[last] = path
    return tree


def _placed(value: Any, tree: _Tree | str, news: Mapping[str, Any],
            copy: Callable[[Any, Mapping[str, Any]], Any]) -> Any:
    """Copy a value with others at these paths; ``copy`` copies a dataclass with new fields."""
    if isinstance(tree, str):
        return news[tree]
    if isinstance(value, tuple):
        items = list(value)
        for index, part in tree.items():
            items[int(index)] = _placed(items[int(index)], part, news, copy)
        return tuple(items)
    return copy(value, {name: _placed(getattr(value, name), part, news, copy)
                        for name, part in tree.items()})


def any_complex(value: Any) -> bool:
    """Look for a complex number within a dataclass or tuple."""
    if type(value) is float:
        return False
    if isinstance(value, tuple):
        return any(map(any_complex, value))
    if is_dataclass(value):
        return any(any_complex(getattr(value, name)) for name in _names(value.__class__))
    return isinstance(value, complex)
