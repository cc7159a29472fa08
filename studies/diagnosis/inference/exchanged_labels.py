"""Whether readings that nothing explains have labels exchanged: of two specimens, or two masses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.evidence.kind import Model
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.reading_table import ReadingTable

#: The share of χ² that an exchange must leave at most: a third of what is missed.
_LEFT = 0.1


@dataclass(frozen=True)
class Exchange:
    """Two labels that stand for each other, in words; where ("" if everywhere); χ² that is left."""

    first: str
    second: str
    within: str
    chi_squared: float


def exchange_of(simulation: Model, table: ReadingTable, nominal: Fit) -> Exchange | None:
    """The exchange that leaves least of what the nominal model misses; None if none leaves little.

    ``nominal`` is that model's fit, to which each exchange adds one with the factors anew.
    """
    exchanges = [replace(exchange, chi_squared=fitted.chi_squared)
                 for exchange, other in _exchanges(simulation, table)
                 if (fitted := fit(simulation, (), other, nominal.unknowns)).possible]
    best = min(exchanges, key=lambda exchange: exchange.chi_squared, default=None)
    return best if best and best.chi_squared < _LEFT * nominal.chi_squared else None


def _exchanges(simulation: Model, table: ReadingTable
               ) -> Iterator[tuple[Exchange, ReadingTable]]:
    """Exchanges of two labels where both were read, everywhere and then in part."""
    states = table.states
    names = np.array([specimen.name for specimen in simulation.setup.specimens])[states.specimen]
    masses = np.array([f"{1e3 * mass:.4g} g" for mass in states.mass.tolist()])
    for column, labels, others in (("specimen", names, masses), ("mass", masses, names)):
        for first, second in combinations(np.unique(labels).tolist(), 2):
            shared = np.intersect1d(others[labels == first], others[labels == second]).tolist()
            parts = ["", *(shared if len(np.unique(others)) > 1 else [])]
            for within in parts if shared else ():
                rows = np.full(len(states), True) if not within else others == within
                place = _exchanged(labels, rows, (first, second))
                moved = (replace(states, specimen=states.specimen[place]) if column == "specimen"
                         else replace(states, mass=states.mass[place]))
                yield Exchange(first, second, within, np.inf), replace(table, states=moved)


def _exchanged(labels: NDArray[np.str_], rows: NDArray[np.bool_], pair: tuple[str, str]
               ) -> NDArray[np.int64]:
    """Places from which labels are taken to exchange a pair of them among some rows."""
    place = np.arange(len(labels))
    for label, other in (pair, pair[::-1]):
        place[rows & (labels == label)] = np.flatnonzero(labels == other)[0]
    return place
