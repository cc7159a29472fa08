"""Units in the cells of a table, moved into the headings of their columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice, pairwise

from tympan.base.units import unit_factor
from tympan.tables.column import NUMBER, Heading, quantity_of, usual_unit
from tympan.tables.formats import Row, decimal_point

#: Rows in which the headings are sought, and from which a column is judged.
_LOOKED_AT = 100
#: A number with its unit. A comma before three digits may separate thousands: it is left alone.
_WITH_UNIT = re.compile(r"([-+]?(?:\d+[.,]?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.,;].*)", re.ASCII)
_THOUSANDS = re.compile(r".*,\d{3}")
#: Zero without a unit, which it may lack: it is the same in all.
_ZERO = re.compile(r"[-+]?0+(?:[.,]0+)?")


def with_units_above(rows: Iterable[Row]) -> Iterator[Row]:
    """Yield rows whose cells carry their unit as plain numbers below headings with that unit.

    A column is such if each of its cells with digits in the first rows is a number with a unit of
    one kind, or zero, and its heading has one of these units or none. Units of one kind, as of a
    meter that changes its range, become the most frequent one. A later cell without a unit is left
    as it is.

    Examples
    --------
    >>> rows = [(1, ["mass", "s"]), (2, ["17.9 g", "2.10 mm"]), (3, ["20 g", "2.2 mm"])]
    >>> list(with_units_above(rows))[:2]
    [(1, ['mass (g)', 's (mm)']), (2, ['17.9', '2.10'])]
    >>> list(with_units_above([(1, ["s", "U"]), (2, ["1 mm", "950 V"]), (3, ["2 mm", "2 kV"])]))
    [(1, ['s (mm)', 'U (V)']), (2, ['1', '950']), (3, ['2', '2000'])]
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
        cells = [cells[place] for cells in below if place < len(cells)
                 and any(map(str.isdigit, cells[place]))]  # others were not read
        split = [_split(cell) for cell in cells if not _ZERO.fullmatch(cell)]
        units = [usual_unit(one[1]) for one in split if one is not None]
        own = usual_unit(Heading.of(title).unit) if Heading.of(title).unit else None
        if (units and len(units) == len(split) and (own is None or own in units)
                and len({quantity_of(str(unit)) for unit in units}) == 1):
            unit = own or max(dict.fromkeys(units), key=units.count)
            found[place] = next(one[1] for one in split if one and usual_unit(one[1]) == unit)
    return found


def _split(cell: str) -> tuple[str, str] | None:
    """Split a number and its unit; None of other cells."""
    match = _WITH_UNIT.fullmatch(cell)
    if match is None or not quantity_of(match[2]) or _THOUSANDS.fullmatch(match[1]):
        return None
    return decimal_point(match[1]), match[2]


def _number(cell: str, unit: str | None) -> str:
    """Write the number of a cell in a unit without it; leave a cell with a unit of another kind."""
    found = _split(cell) if unit else None
    if found is None or unit is None:
        return cell
    if found[1] == unit or usual_unit(found[1]) == usual_unit(unit):
        return found[0]
    if quantity_of(found[1]) != quantity_of(unit):
        return cell
    factor, wanted = (unit_factor(str(usual_unit(one)), quantity_of(unit))
                      for one in (found[1], unit))
    return f"{float(found[0]) * factor / wanted:.12g}"
