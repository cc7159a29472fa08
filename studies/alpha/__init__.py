"""Weights α of the circular actuators that stand for a shape in the lumped model (Eqs. (5), (6))."""

from studies.alpha.circles import RADII as RADII
from studies.alpha.samples import LoadGrid as LoadGrid
from studies.alpha.samples import part_shares as part_shares
from studies.alpha.simplex import simplex_fit as simplex_fit
from studies.alpha.simplex import weight_ranges as weight_ranges
from studies.alpha.uncertainty import Uncertainty as Uncertainty
from studies.alpha.uncertainty import uncertainty as uncertainty
from studies.alpha.weights import AlphaResult as AlphaResult
from studies.alpha.weights import AlphaSettings as AlphaSettings
from studies.alpha.weights import Basis as Basis
from studies.alpha.weights import Weights as Weights
from studies.alpha.weights import alpha as alpha
