"""Weights α of the circular actuators that stand for a shape (Eqs. (5), (6))."""

from tympan.studies.alpha.film_circles import RADII as RADII
from tympan.studies.alpha.samples import LoadGrid as LoadGrid
from tympan.studies.alpha.samples import part_shares as part_shares
from tympan.studies.alpha.simplex import simplex_fit as simplex_fit
from tympan.studies.alpha.simplex import weight_ranges as weight_ranges
from tympan.studies.alpha.uncertainty import uncertainty as uncertainty
from tympan.studies.alpha.weights import AlphaResult as AlphaResult
from tympan.studies.alpha.weights import AlphaSettings as AlphaSettings
from tympan.studies.alpha.weights import Basis as Basis
from tympan.studies.alpha.weights import Weights as Weights
from tympan.studies.alpha.weights import alpha as alpha
