"""Test rig around the specimen: loads, voltage supply, displacement sensor, tester, grips.

Each of these is a record in a module of its own, with its settings and with what they do;
:class:`Rig` is their sum, :class:`Actuator` a specimen on it. A setting is declared in its record,
and in no other place. A function that needs one record alone takes this record: a rig is one of
each.
"""

from tympan.fem.rig.actuator import OWN as OWN
from tympan.fem.rig.actuator import Actuator as Actuator
from tympan.fem.rig.actuator import load_actuator as load_actuator
from tympan.fem.rig.actuator import mounted as mounted
from tympan.fem.rig.actuator import mounted_together as mounted_together
from tympan.fem.rig.actuator import rig_under as rig_under
from tympan.fem.rig.direction import DIRECTIONS as DIRECTIONS
from tympan.fem.rig.direction import HYSTERESIS as HYSTERESIS
from tympan.fem.rig.grips import Grips as Grips
from tympan.fem.rig.loads import GAS_SIGN as GAS_SIGN
from tympan.fem.rig.loads import MASS_RULE as MASS_RULE
from tympan.fem.rig.loads import MOST_MASS as MOST_MASS
from tympan.fem.rig.loads import PRESSURES as PRESSURES
from tympan.fem.rig.loads import Ambient as Ambient
from tympan.fem.rig.loads import Loads as Loads
from tympan.fem.rig.loads import PlateLoads as PlateLoads
from tympan.fem.rig.rig import Rig as Rig
from tympan.fem.rig.rig import checked_load as checked_load
from tympan.fem.rig.sensor import Sensor as Sensor
from tympan.fem.rig.supply import MOST_VOLTAGE as MOST_VOLTAGE
from tympan.fem.rig.supply import VOLTAGE_RULE as VOLTAGE_RULE
from tympan.fem.rig.supply import Supply as Supply
from tympan.fem.rig.tester import Tester as Tester
