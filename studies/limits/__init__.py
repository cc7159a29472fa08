"""Limits of a film: their voltages, and the curve up to them.

``voltages.py`` follows a film while its voltage rises and finds where it reaches each limit.
``loads.py`` chooses loads that suit a film. ``curve.py`` makes deflection-voltage curves, and is
imported only where they are needed. A new limit is not registered here but in
``fem/results/limit_states.py``.
"""

from tympan.studies.case import Limit as Limit
from tympan.studies.case import Limits as Limits
from tympan.studies.limits.loads import LoadGrid as LoadGrid
from tympan.studies.limits.loads import charged as charged
from tympan.studies.limits.voltages import LimitsResult as LimitsResult
from tympan.studies.limits.voltages import limits as limits
from tympan.studies.limits.voltages import rise as rise
from tympan.studies.limits.voltages import solve_within as solve_within
