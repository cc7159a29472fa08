"""Self-sensing: capacitance against deflection at several voltages, and deflection from it.

``sense.py`` displaces the plate, ``inverse.py`` is deflection as a polynomial of capacitance and
voltage, also as C99, and ``result.py`` is what is stored.
"""

from tympan.studies.sense.result import SenseResult as SenseResult
from tympan.studies.sense.sense import SenseCase as SenseCase
from tympan.studies.sense.sense import sense as sense
