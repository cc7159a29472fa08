"""Files of measured mechanisms: forces by displacement, as tables of testers have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.units import LEAST_STEP, unit_factor
from tympan.tables.columns import Column, Sheet, read_sheet

#: Most rows of a table of forces: the most entries of a list in a file.
_MOST_ROWS = 10_000
#: Most extrema of a measured force: a snapping mechanism has two, two of them side by side four;
#: noise has one in every second row.
_MOST_TURNS = 8

def measured(file: Path, titles: tuple[str, ...] | None
              ) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Read displacements [m], ascending, and forces [N] of a file in either order."""
    columns = [Column("displacement", "mm"), Column("force", "N")]
    for place, title in enumerate(titles or ()):
        columns[place] = _column(title, columns[place])
    sheet = read_sheet(file, columns, some=bool(titles))
    where, force = (sheet[column.name] for column in columns)
    if not 2 <= len(sheet) <= _MOST_ROWS:
        raise InputError(f"must have from 2 to {_MOST_ROWS} rows: one force at each displacement",
                         file=file, given=f"{len(sheet)} rows")
    steps = np.diff(where)
    turns = np.flatnonzero(steps * np.sign(steps[0] or 1.0) < LEAST_STEP)
    if len(turns):
        raise sheet.error(int(turns[0]) + 1, columns[0].name,
                          "must be one run that goes one way, by 1 nm a line at least: a table has "
                          "one force at each displacement; keep the way out or the way back, or "
                          "their mean")
    order = slice(None, None, int(np.sign(steps[0])))
    where, force = where[order], force[order]
    _check_sign(sheet, where, force)
    often = int(np.sum(np.diff(np.sign(np.diff(force))) != 0))
    if often > _MOST_TURNS:
        raise InputError("must be smoothed: its force turns so often that noise would make the "
                         "plate snap; keep fewer rows, each the mean of several", file=file,
                         key="force", given=f"{often} turns, more than {_MOST_TURNS}")
    return tuple(where.tolist()), tuple(force.tolist())


def _column(title: str, usual: Column) -> Column:
    """Make the column of a title that ends in a unit of the usual column's dimension."""
    name, _, unit = title.rpartition("_")
    if not name:
        raise InputError(f"has no unit: write it into the name, such as {title}_{usual.unit}",
                         key="columns", given=title)
    try:
        unit_factor(unit, usual.dimension)
    except InputError as error:
        raise InputError(f"{error.allowed}, at the end of the name", key="columns",
                         given=title) from None
    return Column(name, unit)


def _check_sign(sheet: Sheet, where: AnyArray, force: AnyArray) -> None:
    """Refuse a force that drives the plate away to both ends, and most strongly there.

    A spring of the wrong sign does that; a snapping mechanism measured beyond its peaks does not. A
    force that only pulls or only pushes may have either sign.
    """
    if force[0] == force.max() > 0 > force.min() == force[-1]:
        past = int(np.argmax(force < 0))
        gap, rise = where[past] - where[past - 1], force[past] - force[past - 1]
        turn = where[past] - force[past] * gap / rise
        raise InputError(
            "must be positive where the mechanism pushes the plate back towards smaller "
            f"displacements: this one drives it off from {1e3 * turn:.4g} mm to both sides, to "
            "no place of rest. Change the sign of a spring; measure a mechanism that "
            "snaps beyond its peaks; what is meant so has its numbers in the lists "
            "`displacement` and `force`", file=sheet.file, key="force",
            given=f"{force[0]:.4g} N at {1e3 * where[0]:.4g} mm, {force[-1]:.4g} N at "
                  f"{1e3 * where[-1]:.4g} mm")
