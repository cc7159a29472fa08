"""Every kind of evidence of plates under loads: a new one stands in a file of its own, and here."""

from __future__ import annotations

from typing import TypeVar

from tympan.studies.data.dataset import FILES
from tympan.studies.diagnosis.evidence.frequencies import Frequencies
from tympan.studies.diagnosis.evidence.held import Held
from tympan.studies.diagnosis.evidence.kind import PlateEvidence
from tympan.studies.diagnosis.evidence.rest import Rest
from tympan.studies.diagnosis.evidence.scans import Scans
from tympan.studies.diagnosis.evidence.transients import Transients
from tympan.studies.diagnosis.reading_table import UNITS

#: In the order in which their rows stand in a table; the first says how rows are held out.
PLATES: list[PlateEvidence] = []

#: That which says what rows of a kind show.
BY_ROWS: dict[str, PlateEvidence] = {}

Kind = TypeVar("Kind", bound=PlateEvidence)


def register(kind: Kind) -> Kind:
    """Add a kind of evidence: its files are read, and its rows have a unit and are predicted."""
    FILES.update(kind.columns)
    UNITS.update(kind.units)
    PLATES.append(kind)
    BY_ROWS.update(dict.fromkeys(kind.kinds, kind))
    return kind


#: Displacements, which rows of other files are, too.
REST = register(Rest())
#: Runs in time, of which no curve over the voltage is drawn.
TRANSIENTS = register(Transients())
register(Frequencies())
register(Held())
register(Scans())
