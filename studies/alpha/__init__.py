"""Weights α of the circular actuators that stand for a shape (Eqs. (5), (6))."""

from tympan.studies.alpha.weights import AlphaResult as AlphaResult
from tympan.studies.alpha.weights import AlphaSettings as AlphaSettings
from tympan.studies.alpha.weights import Weights as Weights
from tympan.studies.alpha.weights import alpha as alpha
from tympan.studies.alpha.weights import uncertainty as uncertainty
from tympan.studies.limits.loads import LoadGrid as LoadGrid
