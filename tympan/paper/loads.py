"""The paper's loads for ``tympan map``: α and stroke of ellipses with the paper's film."""

from __future__ import annotations

from tympan.paper.published import MASSES, STEP
from tympan.studies.alpha import LoadGrid
from tympan.studies.alpha.map import MapSettings

#: A map under the paper's masses; its stroke is at the voltage to which figures 9 to 12 step.
MAP = MapSettings(LoadGrid(MASSES, (0.0, 2e3, 4e3)), mass=MASSES[0], voltage=STEP[1])
