"""The parts of an actuator; type checkers read parts.pyi, which also allows texts with units."""

from __future__ import annotations

from tympan.fem.film.breakdown import ConstantStrength as ConstantStrength
from tympan.fem.film.breakdown import PowerStrength as PowerStrength
from tympan.fem.film.flows import ShearThinning as ShearThinning
from tympan.fem.film.laws import ArrudaBoyce as ArrudaBoyce
from tympan.fem.film.laws import Gent as Gent
from tympan.fem.film.laws import MooneyRivlin as MooneyRivlin
from tympan.fem.film.laws import NeoHooke as NeoHooke
from tympan.fem.film.laws import Ogden as Ogden
from tympan.fem.film.laws import Yeoh as Yeoh
from tympan.fem.membrane.biases import Bistable as Bistable
from tympan.fem.membrane.biases import BuckledBeam as BuckledBeam
from tympan.fem.membrane.biases import Constant as Constant
from tympan.fem.membrane.biases import ForceTable as ForceTable
from tympan.fem.membrane.biases import JoinedFilm as JoinedFilm
from tympan.fem.membrane.biases import Magnet as Magnet
from tympan.fem.membrane.biases import Spring as Spring
from tympan.fem.rig import Rig as Rig
from tympan.geometry.outlines import Circle as Circle
from tympan.geometry.outlines import ClosedSpline as ClosedSpline
from tympan.geometry.outlines import Ellipse as Ellipse
from tympan.geometry.outlines import Polygon as Polygon
from tympan.geometry.outlines import RegularPolygon as RegularPolygon
from tympan.geometry.outlines import Rotated as Rotated
from tympan.geometry.outlines import RoundedRectangle as RoundedRectangle
from tympan.geometry.outlines import Stadium as Stadium
from tympan.geometry.outlines import Superellipse as Superellipse
from tympan.geometry.specimen import Electrode as Electrode
from tympan.geometry.specimen import Film as Film
from tympan.geometry.specimen import Patch as Patch
from tympan.geometry.specimen import Plate as Plate
from tympan.geometry.specimen import Region as Region
from tympan.geometry.specimen import Specimen as Specimen
from tympan.geometry.specimen import ViscousBranch as ViscousBranch
from tympan.studies.design.requirements import Requirements as Requirements
from tympan.studies.tolerance.given import LengthScatter as LengthScatter
from tympan.studies.tolerance.given import Scatter as Scatter
from tympan.studies.tolerance.given import StrengthScatter as StrengthScatter
from tympan.studies.tolerance.given import Tolerances as Tolerances
