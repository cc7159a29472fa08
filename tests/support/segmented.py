"""Films whose electrode is in segments, by their voltages."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tests.support.specimens import quarters
from tympan.geometry.specimen import Specimen

#: Voltages that drive the four quarters: all alike, two and two, one alone, all different.
DRIVES = ({"A": 3e3, "B": 3e3, "C": 3e3, "D": 3e3}, {"A": 3e3, "B": 3e3, "C": 1e3, "D": 1e3},
          {"A": 3e3}, {"A": 3e3, "B": 2e3, "C": 1e3, "D": 2.5e3})


def driven_quarters(voltages: dict[str, float] | None = None, **electrode: Any) -> Specimen:
    """A round film with the segments A to D, counterclockwise from the x axis, with their shares.

    Without voltages all have the film's.
    """
    film = quarters()
    made = replace(film.electrode, **electrode)
    return replace(film, electrode=made if voltages is None else made.driven(voltages)[0])
