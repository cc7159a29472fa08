"""Which values a sweep gives to which keys: grids, lists and samples of ranges in SWEEP.toml."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.toml_reader import Rule, Table
from tympan.geometry.units import DIMENSIONS, any_quantity

#: Raw TOML values by dotted key: what one specimen of a sweep differs in.
Choice = dict[str, Any]

Array = NDArray[np.float64]

#: Ways to sample ranges.
METHODS = ("random", "latin_hypercube", "sobol")

#: More specimens than this are a slip of the pen.
MOST = 1_000_000

_COUNT: Rule = (lambda x: 1 <= x <= MOST and x == int(x),
                f"must be a whole number from 1 to {MOST}")
_SEED: Rule = (lambda x: 0 <= x < 2**32 and x == int(x), "must be a whole number, not negative")


def choices(table: Table) -> list[Choice]:
    """Every combination of the grid, with every row of the list and every point of the sample."""
    grid = table.table("grid", {})
    columns = _columns(grid)
    parts = [[dict(zip(columns, row, strict=True)) for row in product(*columns.values())],
             _list(table.table("list", {})), _sample(table.table("sample", {}))]
    keys = [key for part in parts if part for key in part[0]]
    for key in keys:
        if keys.count(key) > 1:
            raise table.error(key, "must stand in one of [grid], [list] and [sample] only")
        if any(other != key and other.startswith(f"{key}.") for other in keys):
            raise table.error(key, "is varied as a whole and by its parts: only one of both")
    if np.prod([float(len(part)) for part in parts]) > MOST:
        raise table.error("grid", f"there must be at most {MOST} specimens",
                          [len(part) for part in parts])
    return [{**first, **second, **third} for first, second, third in product(*parts)]


def with_choice(content: Mapping[str, Any], choice: Choice, table: Table) -> dict[str, Any]:
    """A copy of nested tables with a choice's values; list elements are named by their number."""
    changed = copy.deepcopy(dict(content))
    for key, value in choice.items():
        *path, last = key.split(".")
        inner: Any = changed
        for number, name in enumerate(path):
            inner = (inner[_index(inner, name, key, table)] if isinstance(inner, list)
                     else inner.setdefault(name, {}))
            if not isinstance(inner, dict | list):
                raise table.error(key, f"unknown key: {'.'.join(path[:number + 1])} is no table",
                                  inner)
        place = _index(inner, last, key, table) if isinstance(inner, list) else last
        inner[place] = copy.deepcopy(value)
    return changed


def read_quantity(value: Any) -> tuple[float, str] | None:
    """SI value and SI unit ("" of a plain number), None of what is neither.

    Examples
    --------
    >>> read_quantity("8 mm"), read_quantity(2), read_quantity("ellipse")
    ((0.008, 'm'), (2.0, ''), None)
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value), ""
    read = any_quantity(value)
    return None if read is None else (read[0], DIMENSIONS[read[1]].si)


def _index(items: list[Any], name: str, key: str, table: Table) -> int:
    if not name.isdecimal() or int(name) >= len(items):
        raise table.error(key, f"unknown key: a list has the elements 0 to {len(items) - 1}", name)
    return int(name)


def _values(table: Table, key: str) -> list[Any]:
    values = table.value(key)
    if not isinstance(values, list) or not values:
        raise table.error(key, "must be a list of values, at least one", values)
    return values


def _columns(table: Table) -> dict[str, list[Any]]:
    """The lists of a table by key; keys must be dotted names in quotation marks."""
    for key, value in table.data.items():
        if isinstance(value, Mapping):
            raise table.error(key, "must be a list; write a dotted key in quotation marks, such as "
                                   f'"{key}.…" = […]')
    return {key: _values(table, key) for key in table.data}


def _list(table: Table) -> list[Choice]:
    columns = _columns(table)
    if not columns:
        return [{}]
    length = len(next(iter(columns.values())))
    for key, values in columns.items():
        if len(values) != length:
            raise table.error(key, f"must be as long as the first list of [list], {length}",
                              len(values))
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _sample(table: Table) -> list[Choice]:
    if not table.data:
        return [{}]
    method = table.choice("method", {name: name for name in METHODS})
    count = int(table.number("count", rule=_COUNT))
    seed = int(table.number("seed", default=0, rule=_SEED))
    ranges = table.table("ranges")
    limits = {key: _range(ranges, key, values) for key, values in _columns(ranges).items()}
    if not limits:
        raise table.error("ranges", "must name at least one key", {})
    table.done()
    points = sample_points(method, len(limits), count, seed)
    choices: list[Choice] = [{} for _ in points]
    for (key, (low, high, unit)), shares in zip(limits.items(), points.T.tolist(), strict=True):
        for choice, share in zip(choices, shares, strict=True):
            value = low + share * (high - low)
            choice[key] = f"{value!r} {unit}" if unit else value
    return choices


def _range(table: Table, key: str, values: list[Any]) -> tuple[float, float, str]:
    """Low, high and SI unit."""
    read = [read_quantity(value) for value in values]
    first, *others = read
    if len(read) != 2 or first is None or others[0] is None or first[1] != others[0][1]:
        raise table.error(key, "must be two values of one kind, the smaller first, such as "
                               '["8 mm", "15 mm"]; one element of a list has its number in the key',
                          values)
    (low, unit), (high, _) = first, others[0]
    if not -np.inf < low < high < np.inf:
        raise table.error(key, "must be two finite values, the smaller first", values)
    return low, high, unit


def sample_points(method: str, dimensions: int, count: int, seed: int) -> Array:
    """Points in the unit cube, shape (count, dimensions)."""
    from scipy.stats import qmc

    rng = np.random.default_rng(seed)
    if method == "random":
        return rng.random((count, dimensions))
    if method == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(dimensions, seed=rng).random(count))
    # The first points of the scrambled sequence; a power of two of them is balanced.
    sequence = qmc.Sobol(dimensions, seed=rng)
    return np.asarray(sequence.random_base2(max(count - 1, 0).bit_length())[:count])


def flattened(choice: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Keys and single values: a list becomes its elements.

    Examples
    --------
    >>> list(flattened({"frame.semi_axes": ["6 cm", "4 cm"], "frame.shape": "ellipse"}))
    [('frame.semi_axes.0', '6 cm'), ('frame.semi_axes.1', '4 cm'), ('frame.shape', 'ellipse')]
    """
    for key, value in choice.items():
        if isinstance(value, Sequence) and not isinstance(value, str):
            yield from flattened({f"{key}.{number}": item for number, item in enumerate(value)})
        elif isinstance(value, Mapping):
            yield from flattened({f"{key}.{name}": item for name, item in value.items()})
        else:
            yield key, value
