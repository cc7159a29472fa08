"""Every kind of evidence of plates under loads: a new one is a file here and a line below."""

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

#: Kinds in the order of their rows in a table; the first one defines how rows are held out.
PLATES: list[PlateEvidence] = []

#: The evidence that predicts rows, by kind of row.
BY_ROWS: dict[str, PlateEvidence] = {}

Kind = TypeVar("Kind", bound=PlateEvidence)


def register(kind: Kind) -> Kind:
    """Add a kind of evidence, and the units and predictions of its rows.

    Raises
    ------
    ValueError
        When the columns of one of its files are not declared: datasets are read without kinds.
    """
    for name in kind.files:
        if name not in FILES:
            raise ValueError(f"declare the columns of {name} in FILES of studies/data/dataset.py")
    UNITS.update(kind.units)
    PLATES.append(kind)
    BY_ROWS.update(dict.fromkeys(kind.kinds, kind))
    return kind


#: Displacements; rows of other files are displacements, too.
REST = register(Rest())
#: Runs in time. No curves over the voltage are drawn for them.
TRANSIENTS = register(Transients())
register(Frequencies())
register(Held())
register(Scans())
