"""Every kind of evidence of plates under loads: a new one stands in a file of its own, and here."""

from __future__ import annotations

from tympan.studies.diagnosis.evidence.frequencies import Frequencies
from tympan.studies.diagnosis.evidence.held import Held
from tympan.studies.diagnosis.evidence.kind import PlateEvidence
from tympan.studies.diagnosis.evidence.rest import Rest
from tympan.studies.diagnosis.evidence.scans import Scans
from tympan.studies.diagnosis.evidence.transients import Transients

#: Displacements, which rows of other files are, too.
REST = Rest()
#: Runs in time, of which no curve over the voltage is drawn.
TRANSIENTS = Transients()

#: In the order in which their rows stand in a table; the first says how rows are held out.
PLATES: tuple[PlateEvidence, ...] = (REST, TRANSIENTS, Frequencies(), Held(), Scans())

#: That which says what rows of a kind show.
BY_ROWS = {name: kind for kind in PLATES for name in kind.kinds}
