"""Force on the plate against its displacement, as a tensile tester measures it, and what it moves.

``follow.py`` follows a film whose plate is displaced at one voltage, ``result.py`` is what is
stored of it, ``cycle.py`` what loads do on the curves, and ``force.py`` puts these together.
"""

from tympan.studies.force.force import ForceCase as ForceCase
from tympan.studies.force.force import blocked_force as blocked_force
from tympan.studies.force.force import force as force
from tympan.studies.force.result import ForceResult as ForceResult
