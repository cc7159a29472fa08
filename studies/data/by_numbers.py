"""Guesses of what columns without known headings are, by their numbers alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.data import doubts

#: Columns that are set, of which a table has few values, the fewest first.
_SET = ("mass", "voltage", "voltage_min", "voltage_max")
#: Units by the size of the numbers, from which each is likelier than the ones before it: a film
#: takes 0.1 to 10 kV, deflects by 0.1 to 50 mm and carries 0.5 to 500 g.
_UNITS: dict[str, tuple[tuple[float, str], ...]] = {
    "mass": ((0.0, "kg"), (0.5, "g")),
    "voltage": ((0.0, "kV"), (50.0, "V")),
    "displacement": ((0.0, "m"), (0.05, "mm"), (50.0, "um")),
    "force": ((0.0, "N"), (5.0, "mN"))}


def guessed_by_numbers(wanted: Iterable[str], columns: Mapping[int, Array]) -> dict[str, int]:
    """Choose the index of a column for each wanted name, as far as there are columns.

    What is read has the most different numbers; a time is evenly spaced; voltages have a zero, and
    masses have the fewest different numbers.

    Examples
    --------
    >>> table = {0: np.array([20.0, 20, 30]), 1: np.array([0.0, 2, 0]), 2: np.array([2.4, 2.5, 3])}
    >>> guessed_by_numbers(("mass", "voltage", "displacement"), table)
    {'displacement': 2, 'mass': 0, 'voltage': 1}
    """
    names, found = list(wanted), dict[str, int]()
    free = {place: values for place, values in columns.items() if np.isfinite(values).any()}
    numbering = [place for place, values in free.items() if counts_rows(values)]
    for place in numbering[:max(0, len(free) - len(names))]:
        del free[place]
    if "t" in names:
        names.remove("t")
        if even := [place for place, values in free.items() if doubts.even(values)]:
            found["t"] = even[0]
            del free[even[0]]
    settings = [name for name in _SET if name in names]
    for name in (name for name in reversed(names) if name not in settings):
        if free:
            found[name] = max(reversed(free), key=lambda place: _different(free[place]))
            del free[found[name]]
    order = sorted(free, key=lambda place: (bool((free[place] == 0).any()),
                                            _different(free[place])))
    if order and len(order) < len(settings) and "voltage" in settings:  # the mass is elsewhere
        settings = ["voltage"]
    return found | dict(zip(settings, order, strict=False))


def likely_unit(name: str, values: Array) -> str:
    """Find the likely unit of a column's numbers by their size, "" where its key has it."""
    size = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    return next((unit for least, unit in reversed(_UNITS.get(name, ())) if size >= least), "")


def _different(values: Array) -> int:
    return len(np.unique(values[np.isfinite(values)]))


def counts_rows(values: Array) -> bool:
    """Check whether numbers count the rows."""
    return len(values) > 2 and bool((np.diff(values) == 1).all()) and values[0] in (0, 1)
