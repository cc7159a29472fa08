"""Weights α of the circular actuators that stand for a shape (Eqs. (5), (6)).

``circles.py`` has their radii and forces, ``simplex.py`` the fit, which knows no film,
``weights.py`` α of one specimen, ``table.py`` of all outlines, ``map.py`` over aspect and plate.
"""

from tympan.studies.alpha.weights import AlphaResult as AlphaResult
from tympan.studies.alpha.weights import AlphaSettings as AlphaSettings
from tympan.studies.alpha.weights import Weights as Weights
from tympan.studies.alpha.weights import alpha as alpha
from tympan.studies.alpha.weights import uncertainty as uncertainty
from tympan.studies.limits.loads import LoadGrid as LoadGrid
