"""Units in the cells of a table, moved into the headings of their columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice, pairwise

from tympan.tables.column import NUMBER, Heading, quantity_of, usual_unit
from tympan.tables.formats import Row, decimal_point

#: Rows in which the headings are sought, and from which a column is judged.
_LOOKED_AT = 100
#: A number with its unit. A comma before three digits may separate thousands: it is left alone.
_WITH_UNIT = re.compile(r"([-+]?(?:\d+[.,]?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.,;].*)", re.ASCII)
_THOUSANDS = re.compile(r".*,\d{3}")


def with_units_above(rows: Iterable[Row]) -> Iterator[Row]:
    """Yield rows whose cells carry their unit as plain numbers below headings with that unit.

    A column is such if each of its cells in the first rows is a number with the same unit, and its
    heading has that unit or none. A later cell without the unit is left as it is.

    Examples
    --------
    >>> rows = [(1, ["mass", "s"]), (2, ["17.9 g", "2.10 mm"]), (3, ["20 g", "2.2 mm"])]
    >>> list(with_units_above(rows))[:2]
    [(1, ['mass (g)', 's (mm)']), (2, ['17.9', '2.10'])]
    """
    rest = iter(rows)
    first = list(islice(rest, _LOOKED_AT))
    at = _titles(first)
    units = {} if at is None else _units(first[at][1], [cells for _, cells in first[at + 1:]])
    for number, (line, cells) in enumerate(chain(first, rest)):
        if units and number == at:
            yield line, [f"{cell} ({units[place]})"
                         if place in units and not Heading.of(cell).unit else cell
                         for place, cell in enumerate(cells)]
        elif units and at is not None and number > at:
            yield line, [_number(cell, units.get(place)) for place, cell in enumerate(cells)]
        else:
            yield line, cells


def _titles(rows: Sequence[Row]) -> int | None:
    """Find the row of headings: names alone, above a row of the same width with numbers."""
    for at, ((_, cells), (_, below)) in enumerate(pairwise(rows)):
        if len(cells) == len(below) > 1 and not any(map(_split, cells)) and any(
                map(_split, below)) and not any(map(NUMBER.fullmatch, cells)):
            return at
    return None


def _units(titles: Sequence[str], below: Sequence[Sequence[str]]) -> dict[int, str]:
    """Find the unit of each column whose cells carry one, by the column's index."""
    found = {}
    for place, title in enumerate(titles):
        cells = [cells[place] for cells in below if place < len(cells) and cells[place]]
        units = {split[1] if (split := _split(cell)) else "" for cell in cells}
        unit = units.pop() if len(units) == 1 else ""
        own = Heading.of(title).unit
        if unit and (not own or usual_unit(own) == usual_unit(unit)):
            found[place] = unit
    return found


def _split(cell: str) -> tuple[str, str] | None:
    """Split a number and its unit; None of other cells."""
    match = _WITH_UNIT.fullmatch(cell)
    if match is None or not quantity_of(match[2]) or _THOUSANDS.fullmatch(match[1]):
        return None
    return decimal_point(match[1]), match[2]


def _number(cell: str, unit: str | None) -> str:
    """Write the number of a cell without its unit; leave a cell with another one."""
    found = _split(cell) if unit else None
    return found[0] if found and found[1] == unit else cell
