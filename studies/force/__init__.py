"""Force on the plate against its displacement, as a tensile tester measures it, and its work.

``follow.py`` follows a film whose plate is displaced at one voltage. ``result.py`` defines what is
stored. ``cycle.py`` finds the equilibria and the work of loads on the curves. ``force.py`` combines
these modules.
"""

from tympan.studies.force.force import ForceCase as ForceCase
from tympan.studies.force.force import blocked_force as blocked_force
from tympan.studies.force.force import force as force
from tympan.studies.force.result import ForceResult as ForceResult
