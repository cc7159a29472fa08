"""The parts as type checkers see them: quantities are SI numbers or texts with their unit."""

from collections.abc import Sequence
from typing import Literal, overload

from tympan.fem.film.breakdown import ConstantStrength as AnyConstantStrength
from tympan.fem.film.breakdown import PowerStrength as AnyPowerStrength
from tympan.fem.film.flows import ShearThinning as AnyShearThinning
from tympan.fem.film.laws import ArrudaBoyce as AnyArrudaBoyce
from tympan.fem.film.laws import Gent as AnyGent
from tympan.fem.film.laws import MooneyRivlin as AnyMooneyRivlin
from tympan.fem.film.laws import NeoHooke as AnyNeoHooke
from tympan.fem.film.laws import Ogden as AnyOgden
from tympan.fem.film.laws import Yeoh as AnyYeoh
from tympan.fem.film.library import LibraryMaterial, StatedMaterial
from tympan.fem.membrane.biases import Bias
from tympan.fem.membrane.biases import Bistable as AnyBistable
from tympan.fem.membrane.biases import BuckledBeam as AnyBuckledBeam
from tympan.fem.membrane.biases import Constant as AnyConstant
from tympan.fem.membrane.biases import ForceTable as AnyForceTable
from tympan.fem.membrane.biases import JoinedFilm as AnyJoinedFilm
from tympan.fem.membrane.biases import Magnet as AnyMagnet
from tympan.fem.membrane.biases import Spring as AnySpring
from tympan.fem.rig import Actuator as Actuator
from tympan.fem.rig import Rig as AnyRig
from tympan.geometry.outlines import Circle as AnyCircle
from tympan.geometry.outlines import ClosedSpline as AnyClosedSpline
from tympan.geometry.outlines import Ellipse as AnyEllipse
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines import Polygon as AnyPolygon
from tympan.geometry.outlines import RegularPolygon as AnyRegularPolygon
from tympan.geometry.outlines import Rotated as AnyRotated
from tympan.geometry.outlines import RoundedRectangle as AnyRoundedRectangle
from tympan.geometry.outlines import Stadium as AnyStadium
from tympan.geometry.outlines import Superellipse as AnySuperellipse
from tympan.geometry.specimen import Electrode as AnyElectrode
from tympan.geometry.specimen import Film as AnyFilm
from tympan.geometry.specimen import FlowLaw, Material, Strength
from tympan.geometry.specimen import Patch as AnyPatch
from tympan.geometry.specimen import Plate as AnyPlate
from tympan.geometry.specimen import Region as AnyRegion
from tympan.geometry.specimen import Segment as AnySegment
from tympan.geometry.specimen import Specimen as Specimen
from tympan.geometry.specimen import ViscousBranch as AnyViscousBranch
from tympan.studies.design.requirements import Requirements as Requirements
from tympan.studies.tolerance.given import LengthScatter as AnyLengthScatter
from tympan.studies.tolerance.given import Scatter as Scatter
from tympan.studies.tolerance.given import StrengthScatter as AnyStrengthScatter
from tympan.studies.tolerance.given import Tolerances as Tolerances

Quantity = float | str
Pair = tuple[Quantity, Quantity]

class ConstantStrength(AnyConstantStrength):
    def __init__(self, strength: Quantity) -> None: ...

class PowerStrength(AnyPowerStrength):
    def __init__(self, strength: Quantity, exponent: float, thickness_exponent: float = ...,
                 thickness: Quantity = ...) -> None: ...

class ShearThinning(AnyShearThinning):
    def __init__(self, thinning_stress: Quantity, thinning_exponent: float, least_viscosity:
                 float = ..., stretch_gain: float = ..., stretch_exponent: float
                 = ...) -> None: ...

class ArrudaBoyce(AnyArrudaBoyce):
    def __init__(self, mu: Quantity, lambda_lock: float) -> None: ...

class Gent(AnyGent):
    def __init__(self, mu: Quantity, j_lim: float) -> None: ...

class MooneyRivlin(AnyMooneyRivlin):
    def __init__(self, c10: Quantity, c01: Quantity) -> None: ...

class NeoHooke(AnyNeoHooke):
    def __init__(self, mu: Quantity) -> None: ...

class Ogden(AnyOgden):
    def __init__(self, mu: Sequence[Quantity], alpha: Sequence[float]) -> None: ...

class Yeoh(AnyYeoh):
    def __init__(self, c: Sequence[Quantity]) -> None: ...

class Bistable(AnyBistable):
    def __init__(self, force: Quantity, travel: Quantity, back: Quantity = ..., rest: Quantity =
                 ...) -> None: ...

class BuckledBeam(AnyBuckledBeam):
    def __init__(self, length: Quantity, width: Quantity, thickness: Quantity, modulus: Quantity,
                 compression: Quantity, number: int = ..., middle: Quantity =
                 ...) -> None: ...

class Constant(AnyConstant):
    def __init__(self, force: Quantity) -> None: ...

class ForceTable(AnyForceTable):
    def __init__(self, displacement: Sequence[Quantity] = ..., force: Sequence[Quantity] = ...,
                 file: str | None = ..., columns: Sequence[str] = ...) -> None: ...

class JoinedFilm(AnyJoinedFilm):
    def __init__(self, specimen: Specimen, distance: Quantity, rod: Quantity, voltage: Quantity =
                 ..., side: Literal["below", "above"] = ...) -> None: ...

class Magnet(AnyMagnet):
    def __init__(self, force: Quantity, gap: Quantity, decay: Quantity, power: float = ...) -> None: ...

class Spring(AnySpring):
    def __init__(self, stiffness: Quantity, rest: Quantity = ..., preload: Quantity = ...) -> None: ...

class Rig(AnyRig):
    def __init__(self, *, gravity: Quantity = ..., gas_pressure: Quantity = ..., air: Quantity =
                 ..., unaccounted_mass: Quantity = ..., spring: Quantity = ...,
                 guide: Literal["free", "level", "vertical", "fixed"] = ...,
                 weight_offset: Pair = ..., plate_pressure: Quantity = ...,
                 biases: Sequence[Bias] = ..., friction: Quantity = ...,
                 plate_damping: Quantity = ..., added_mass: Quantity = ...,
                 amplifier_gain: float = ..., sag_voltage: Quantity = ...,
                 lag_voltage: Quantity = ..., series_resistance: Quantity = ...,
                 leakage_resistance: Quantity = ..., sensor_gain: float = ...,
                 sensor_zero: Quantity = ..., drift: Quantity = ..., sensor_lag:
                 Quantity = ..., gauge_zero: Quantity = ..., gauge_gain: float =
                 ..., displacement_zero: Quantity = ..., tester_compliance:
                 Quantity = ..., width_held: float = ..., width_let: float = ...) -> None: ...

class Circle(AnyCircle):
    def __init__(self, radius: Quantity) -> None: ...

class ClosedSpline(AnyClosedSpline):
    def __init__(self, through: Sequence[Pair]) -> None: ...

class Ellipse(AnyEllipse):
    def __init__(self, semi_axes: Pair) -> None: ...

class Polygon(AnyPolygon):
    def __init__(self, vertices: Sequence[Pair], fillet: Quantity = ...) -> None: ...

class RegularPolygon(AnyRegularPolygon):
    def __init__(self, sides: int, radius: Quantity, fillet: Quantity = ...) -> None: ...

class Rotated(AnyRotated):
    def __init__(self, outline: Outline, rotation: Quantity = ...) -> None: ...

class RoundedRectangle(AnyRoundedRectangle):
    @overload
    def __init__(self, semi_axes: Pair, corner_radius: Quantity) -> None: ...
    @overload
    def __init__(self, *, width: Quantity, height: Quantity, corner_radius: Quantity) -> None: ...

class Stadium(AnyStadium):
    def __init__(self, semi_axes: Pair) -> None: ...

class Superellipse(AnySuperellipse):
    def __init__(self, semi_axes: Pair, exponent: float) -> None: ...

class Electrode(AnyElectrode):
    def __init__(self, margin_frame: Quantity = ..., margin_plate: Quantity = ..., stiffness:
                 Quantity = ..., outline: AnyRegion | None = ..., mass: Quantity
                 = ..., patches: Sequence[AnyPatch] = ..., segments:
                 Sequence[AnySegment] = ..., gap: Quantity = ...) -> None: ...

class Film(AnyFilm):
    def __init__(self, thickness: Quantity, prestretch: float | tuple[float, float], material:
                 Material | LibraryMaterial | StatedMaterial | str,
                 relative_permittivity: float = ..., permittivity_exponent:
                 float = ..., density: Quantity = ..., strength: Strength | str
                 | None = ..., branches: Sequence[AnyViscousBranch] = ...,
                 thickness_gradient: tuple[float, float] = ..., mounted:
                 Quantity | None = ..., temperature_power: float = ..., layers:
                 int = ..., law_range: Pair | None = ...) -> None: ...

class Patch(AnyPatch):
    def __init__(self, centre: Pair, diameter: Quantity) -> None: ...

class Plate(AnyPlate):
    def __init__(self, outline: Outline, offset: Pair = ...) -> None: ...

class Region(AnyRegion):
    def __init__(self, outline: Outline, offset: Pair = ...) -> None: ...

class Segment(AnySegment):
    def __init__(self, *, name: str, sector: Pair = ..., band: Pair = ..., outline: AnyRegion |
                 None = ..., share: float = ..., lead: str | None = ...) -> None: ...

class ViscousBranch(AnyViscousBranch):
    def __init__(self, modulus: Quantity, time: Quantity, flow: FlowLaw = ...) -> None: ...

class LengthScatter(AnyLengthScatter):
    def __init__(self, film: Quantity = ..., batch: Quantity = ...) -> None: ...

class StrengthScatter(AnyStrengthScatter):
    def __init__(self, shape: float, area: Quantity | None = ...) -> None: ...
