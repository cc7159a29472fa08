"""How far a film can go: the voltages of its limits, and the curve to them."""

from tympan.studies.case import Limit as Limit
from tympan.studies.case import Limits as Limits
from tympan.studies.limits.voltages import limits as limits
