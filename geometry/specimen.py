"""One actuator: frame, plate, film, electrode; as dataclasses and as TOML."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, Registry, takes_units
from tympan.base.paths import any_complex
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule
from tympan.base.units import place_text, quantities_text
from tympan.geometry.electrode import OFF
from tympan.geometry.electrode import Electrode as Electrode
from tympan.geometry.electrode import Patch as Patch
from tympan.geometry.electrode import Region as Region
from tympan.geometry.electrode import Segment as Segment
from tympan.geometry.outlines import OUTLINES, Circle, Ellipse, Outline, area, check_outline
from tympan.geometry.outlines.outline import SMALLEST
from tympan.geometry.rays import exits

Stretch = Array | NDArray[np.complex128]
Pair = tuple[float, float]

_NAME: Rule = (lambda text: re.fullmatch(r"\w[\w .+-]{0,99}", text) is not None,
               "must serve as a file name: at most 100 letters, digits, blanks and _ . + -, a "
               "letter or digit first")
_STRETCH: Rule = (lambda x: 0.2 <= x <= 10,
                  "must be a stretch between 0.2 and 10 (1 is unstretched)")
_EXPONENT: Rule = (lambda x: -10 <= x <= 10, "must be from -10 to 10")
_POWER: Rule = (lambda x: -50 <= x <= 50, "must be from -50 to 50")
_DENSITY: Rule = (lambda x: x == 0 or 1 <= x <= 30e3,
                  "must be 0 (weightless) or from 1 to 30000 kg/m^3")
_UNEVEN: Rule = (lambda x: -0.9 <= x <= 0.9, "must be from -0.9 to 0.9")
_THICKNESS: Rule = (lambda x: 1e-7 <= x <= 0.1, "must be positive, from 0.1 um to 10 cm")
_LAYERS: Rule = (lambda x: 1 <= x <= 1000, "must be a whole number from 1 to 1000")
_PERMITTIVITY: Rule = (lambda x: 1 <= x <= 1000, "must be at least 1 (vacuum) and at most 1000")


#: Largest stretch that a range may name; no law is meant for more.
_LARGEST_STRETCH = 20.0

#: Largest share of the stated thickness that a gradient may take away somewhere.
_UNEVENNESS = 0.9

#: Places across the frame, and around it, at which overlaps of segments are looked for: a hundredth
#: of the frame apart.
_ACROSS = 100
_AROUND = 360

#: Words on segments of a drawing that overlap.
_OF_DRAWING = ("; segments keep their places in a drawing if the frame is read from it too, else "
               "give their offsets")

#: Electrode of a specimen that states none.
_IN_ONE_PIECE = Electrode()

#: Least width of an uncovered band along an edge, as a share of the gap between plate and frame.
NARROWEST = 0.01


class Unbuildable(InputError):
    """A specimen whose values are each allowed but do not go together."""


class Material(Protocol):
    """A material of a film; ``law`` is its name in specimen files.

    A strain energy W(λ₁, λ₂) per virgin volume, incompressible, λ₃ = 1/(λ₁λ₂).
    """

    law: ClassVar[str]

    def derivatives(self, l1: Stretch, l2: Stretch) -> tuple[Stretch, ...]:
        """W [J/m³] and W₁, W₂, W₁₁, W₁₂, W₂₂ at the principal stretches, each of their shape.

        Where the law cannot be stretched so far, W is +∞ and its derivatives are nan.
        """


class LibraryEntry(Protocol):
    """A material with what is known of its films, ``of_film``, by the names of their fields."""

    @property
    def material(self) -> Material:
        """The law with its constants."""

    @property
    def of_film(self) -> dict[str, Any]:
        """Properties of a film of this material, unless the film's file states them."""


class Strength(Protocol):
    """Largest field that a film withstands; ``law`` is its name in specimen files."""

    law: ClassVar[str]

    def field(self, l1: Stretch, l2: Stretch, thickness: Stretch) -> Stretch:
        """Compute the breakdown field [V/m] from the stretches and the stretched thickness [m]."""


class FlowLaw(Protocol):
    """Flow of a viscous branch; ``flow`` is its name in specimen files."""

    flow: ClassVar[str]

    def relative_viscosity(self, stretch: Any, stress_squared: Any) -> Any:
        """Viscosity over that of the branch's time, at tr C_v and (tr X² − (tr X)²/3) μ²/2 [Pa²].

        X = C C_v⁻¹. Positive, and 1 of a dashpot that is not stretched under no stress.
        """


#: Laws and strengths that files may name; :mod:`tympan.fem.film` fills both.
LAWS: Registry[Any] = Registry("law")
STRENGTHS: Registry[Any] = Registry("law")


#: Flows that files may name; :mod:`tympan.fem.film` adds to them. A branch without ``flow`` has a
#: constant viscosity.
FLOWS: Registry[Any] = Registry("flow", usual="constant")


@FLOWS.register
@dataclass(frozen=True)
class ConstantFlow:
    """Constant viscosity."""

    flow: ClassVar[str] = "constant"

    def relative_viscosity(self, stretch: Any, stress_squared: Any) -> Any:
        return 1.0


@takes_units
@dataclass(frozen=True)
class Plate(Region):
    """The rigid plate; its edge clamps the film."""


@takes_units
@dataclass(frozen=True)
class ViscousBranch:
    """A neo-Hookean spring and a dashpot in series, beside the law of a film (a Maxwell element).

    As in :mod:`tympan.fem.film.memory`; a film at rest for long does not feel it.
    """

    modulus: Annotated[float, Key("shear modulus per virgin volume", "stress", POSITIVE,
                                  made=NON_NEGATIVE)]
    time: Annotated[float, Key("in which it relaxes, by a factor e", "time", POSITIVE)]
    flow: Annotated[FlowLaw, Key("how its viscosity depends on stretch and stress", kinds=FLOWS,
                                 inline=True)] = ConstantFlow()


@takes_units
@dataclass(frozen=True)
class Film:
    """The elastomer film before it is mounted, and how it is mounted."""

    thickness: Annotated[float, Key("of the virgin film", "length", _THICKNESS,
                                    made=POSITIVE, also=("height",))]
    prestretch: Annotated[Pair, Key(
        "stretches along x and y from the virgin film to the flat mounted one; one number is both",
        rule=_STRETCH, made=POSITIVE, also=("stretch", "pre_stretch"), repeats=True)]
    material: Annotated[Material, Key(
        "a law with its constants, a name of the library, or a file that `material fit` writes, or "
        "of another specimen; true stress must grow over the "
        "stretches of `range`, 0.5 to 6 unless the law's table says others; beyond a `range` that "
        "is given, thickness included, results warn", kinds=LAWS)]
    relative_permittivity: Annotated[float, Key(
        "ε_r of the mounted film", rule=_PERMITTIVITY, made=NON_NEGATIVE,
        default="that of the library's material", also=("permittivity", "epsilon_r", "eps_r"))]
    permittivity_exponent: Annotated[float, Key(
        "n of the permittivity ε_r (J/J_p)^(-n), J = λ₁λ₂, J_p its mounted value",
        rule=_EXPONENT)] = 0.0
    density: Annotated[float, Key(
        "mass per volume; left out, the film is weightless, also one of the library",
        "density", _DENSITY)] = 0.0
    strength: Annotated[Strength | None, Key(
        "what the film withstands electrically: a law with its constants, or a name of the "
        "library; left out, that of the library's material", name="breakdown",
        kinds=STRENGTHS, also=("strength", "breakdown_strength"))] = None
    branches: Annotated[tuple[ViscousBranch, ...], Key(
        "viscous branches beside the material's law, which nothing at rest feels; left out, those "
        "of the library's material",
        name="branch")] = ()
    thickness_gradient: Annotated[Pair, Key(
        "by which shares the virgin film is thicker than in the middle where the mounted one "
        "reaches the frame's half extents along x and y", rule=_UNEVEN)] = (0.0, 0.0)
    mounted: Annotated[float | None, Key(
        "time since the film was stretched; left out, so long ago that its branches are relaxed",
        "time", NON_NEGATIVE)] = None
    temperature_power: Annotated[float, Key(
        "p: in coupon tests at an absolute temperature T law and branches are (T/293.15 K)^p times "
        "as stiff; films are solved at 20 degrees Celsius", rule=_POWER,
        discrete=True)] = 0.0
    layers: Annotated[int, Key(
        "equal films in a stack, each with its electrodes: force, capacitance and mass are those "
        "of all, stress and field those of each; loads, gas and plate are there once",
        rule=_LAYERS)] = 1
    #: Principal stretches that the law is meant for, the thickness included; in files `range` of
    #: the material's table. None: nothing is said.
    law_range: Pair | None = None

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Add what the library knows of the film's material, which itself becomes the law."""
        entry: Any = values.get("material")
        # Only a LibraryEntry has ``of_film``. An isinstance check would take longer than making the
        # film.
        if hasattr(entry, "of_film"):
            values = entry.of_film | values | {"material": entry.material}
        if "relative_permittivity" not in values:
            raise InputError("is missing: the library lists none for this material",
                             key="relative_permittivity")
        return values

    @property
    def area_prestretch(self) -> float:
        """Mounted over virgin area, J_p."""
        return self.prestretch[0] * self.prestretch[1]

    @property
    def slack(self) -> bool:
        """Whether the prestretch compresses the film, so that it is slack without any load."""
        first, second = map(np.atleast_1d, sorted(self.prestretch, reverse=True))
        pulls = np.array(self.material.derivatives(first, second)[1:3])
        return min(self.prestretch) < 1 and bool((pulls < 0).any())

    @property
    def volume_per_area(self) -> float:
        """Virgin volume of all layers per mounted area [m]; a stack counts as n films by it."""
        return self.layers * (self.thickness / self.area_prestretch)


@takes_units
@dataclass(frozen=True)
class Specimen:
    """One actuator, all sizes in SI."""

    name: Annotated[str, Key("how results name it", rule=_NAME)]
    frame: Annotated[Outline, Key("inner edge of the frame, which clamps the film", kinds=OUTLINES,
                                  also=("outline", "ring"))]
    plate: Annotated[Plate | None, Key(
        "the rigid plate; left out, the film has none and its centre is what deflects",
        default="none", also=("disc", "disk", "piston"))]
    membrane: Annotated[Film, Key("the film", also=("film", "elastomer"))]
    electrode: Annotated[Electrode, Key(
        "the electrodes; left out, they cover the whole film",
        also=("electrodes",))] = _IN_ONE_PIECE

    def __post_init__(self) -> None:
        """Refuse what cannot be built; specimens with complex numbers are not checked."""
        if any_complex((self.frame, self.plate, self.electrode, self.membrane)):
            return
        object.__setattr__(self, "electrode", self._placed)
        try:
            self._check()
        except InputError as error:
            drawn = "".join(f" ({words})" for words in self.remarks)
            raise Unbuildable(error.allowed + drawn, key=error.key, given=error.given) from None

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Add "no plate" where a file has none."""
        return {"plate": None, **values}

    def _check(self) -> None:
        check_outline(self.frame, "frame")
        if self.plate is not None:
            check_outline(self.plate.outline, "plate")
            self._check_plate()
        elif not self.frame.level(np.zeros(1), np.zeros(1))[0] < 0:
            raise InputError("of a film without plate must contain its centre, where the film's "
                             "deflection is read", key="frame", given=self.frame.shape)
        elif self.electrode.margin_plate:
            raise InputError("must be 0: the film has no plate", key="electrode.margin_plate",
                             given=f"{self.electrode.margin_plate * 1e3:.4g} mm")
        self._check_electrode()
        self._check_prestretch()

    def _check_plate(self) -> None:
        gap, (x, y) = self._narrowest
        place = place_text(x, y)
        if gap <= 0:
            raise InputError(f"the plate must lie inside the frame: it reaches {-gap * 1e3:.4g} mm "
                             f"beyond it at {place}", key="plate", given=self._plate_words)
        if gap < 1e-3 * max(self.frame.semi_axes):
            raise InputError("the plate must leave a gap of at least a thousandth of the frame's "
                             "half extent", key="plate",
                             given=f"a gap of {gap * 1e3:.4g} mm at {place}")

    @property
    def _plate_words(self) -> str:
        """The plate's shape, size and offset."""
        plate = self.needed_plate()
        size = " × ".join(f"{2e3 * half:.4g}" for half in plate.outline.semi_axes)
        moved = f", offset {quantities_text(plate.offset, 'length')}" if any(plate.offset) else ""
        return f"{plate.outline.shape.replace('_', ' ')} of {size} mm{moved}"

    def _check_electrode(self) -> None:
        for key, part in self._inside:
            if key != "plate":
                check_outline(part.outline, key)
        gap, within = self.gap, self._gap_words
        bands = self.electrode.margin_frame + self.electrode.margin_plate
        if bands > 0.98 * gap:
            raise InputError("the margins must leave an electrode: their sum must stay below 98 % "
                             f"of the {gap * 1e3:.4g} mm {within}",
                             key="electrode", given=f"{bands * 1e3:.4g} mm")
        for name in ("margin_frame", "margin_plate"):
            margin = getattr(self.electrode, name)
            if 0 < margin < NARROWEST * gap:
                raise InputError(f"must be 0 or at least 1 % of the {gap * 1e3:.4g} mm {within}",
                                 key=f"electrode.{name}", given=f"{margin * 1e3:.4g} mm")
        if self.electrode.outline is not None and not self._meets(self.electrode.outline):
            raise InputError("must cover some of the film",
                             key="electrode.outline", given=str(self.electrode.outline))
        self._check_segments()
        for number, patch in enumerate(self.electrode.patches):
            if not self._holds(patch):
                raise InputError("must lie in the frame and be no wider than it",
                                 key=f"electrode.patch[{number}]", given=str(patch))
        if sum(map(abs, self.membrane.thickness_gradient)) > _UNEVENNESS:
            raise InputError("must leave some film everywhere: shares must add up to 0.9 at most",
                             key="membrane.thickness_gradient",
                             given=self.membrane.thickness_gradient)

    def _check_segments(self) -> None:
        electrode = self.electrode
        if electrode.gap and not electrode.segments:
            raise InputError("must be left out: the electrode has no segments",
                             key="electrode.gap", given=f"{electrode.gap * 1e3:.4g} mm")
        if len(set(electrode.names)) < len(electrode.segments):
            raise InputError("must have different names", key="electrode.segment",
                             given=", ".join(electrode.names))
        for number, lead in enumerate(electrode.leads):
            if lead not in (*electrode.names, OFF):
                raise InputError(f"must be the name of a segment, {', '.join(electrode.names)}, "
                                 f"or {OFF} if no voltage reaches this one",
                                 key=f"electrode.segment[{number}].lead", given=lead)
        _check_regions(self.frame, self.plate, electrode.even.segments, electrode.gap)

    def _check_prestretch(self) -> None:
        if self.membrane.law_range is not None:
            check_range(*self.membrane.law_range)
        stretch = np.real(self.membrane.prestretch)
        with np.errstate(all="ignore"):
            energy = self.membrane.material.derivatives(*stretch)[0]
        if np.isposinf(np.real(energy)):
            raise InputError(f"must be a stretch the film can reach: {self.membrane.material} "
                             "locks before it", key="membrane.prestretch",
                             given=self.membrane.prestretch)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on its drawings: gaps closed, curves left out, units, parts drawn elsewhere."""
        outlines = [("frame", self.frame), *((key, part.outline) for key, part in self._inside)]
        drawn = [f"{key}: {words}" for key, outline in outlines for words in outline.remarks]
        return (*drawn, *self.drawn_elsewhere)

    @property
    def _inside(self) -> list[tuple[str, Region]]:
        """Plate and outlines of the electrode, where there are any, with their keys."""
        inside = [("plate", self.plate), ("electrode.outline", self.electrode.outline)]
        inside += [(f"electrode.segment.{number}.outline", segment.outline)
                   for number, segment in enumerate(self.electrode.segments)]
        return [(key, part) for key, part in inside if part is not None]

    @property
    def _placed(self) -> Electrode:
        """The electrode with its segments where their corners, or the frame's drawing, are."""
        segments = list[Segment]()
        for segment in self.electrode.segments:
            place = None if segment.outline is None else self._drawn_place(segment.outline)
            segments.append(segment if segment.outline is None or place is None else replace(
                segment, outline=replace(segment.outline, offset=place)))
        if all(map(operator.is_, segments, self.electrode.segments)):
            return self.electrode
        return replace(self.electrode, segments=tuple(segments))

    def _drawn_place(self, part: Region) -> Pair | None:
        """Find where a part that no offset places was drawn, from the frame's centre [m].

        Corners in a file are from the same origin as those of the frame, or from the centre of a
        frame without any. None where the part is in the frame's centre, or has no place of its own:
        a shape without corners, a drawing that is not the frame's, a part beside the frame.
        """
        frame, files = self.frame, [getattr(outline, "file", "")
                                    for outline in (self.frame, part.outline)]
        if part.offset != (0, 0) or (files[1] and files[0] != files[1]):
            return None
        own = part.outline.drawn_at
        if own is None:
            return None
        origin = frame.drawn_at if files[0] == files[1] else None
        x, y = np.real(np.subtract(own, origin or (0.0, 0.0))).tolist()
        if max(abs(x), abs(y)) <= SMALLEST * max(frame.semi_axes):
            return None
        # A part drawn outside the frame was drawn beside it, not in its place.
        return None if files[1] and frame.level(*np.array([[x], [y]]))[0] >= 0 else (x, y)

    @property
    def drawn_elsewhere(self) -> tuple[str, ...]:
        """Remarks on parts that were drawn off the frame's centre, and are centred in it."""
        remarks = list[str]()
        for key, part in self._inside:
            # People give a plate's corners from anywhere: it is centred, as the frame is.
            drawn = key != "plate" or bool(getattr(part.outline, "file", ""))
            place = self._drawn_place(part) if drawn else None
            if place is not None:
                x, y = (f"{round(1e3 * length, 4) + 0.0:g}" for length in place)
                remarks.append(
                    f"{key}: is centred in the frame, but was drawn at {x}, {y} mm from its centre:"
                    f' if it belongs there, write offset = ["{x} mm", "{y} mm"] below [{key}]')
        return tuple(remarks)

    def segment_near(self, x: float, y: float) -> str | None:
        """Name the segment nearest to a place [m], or those at whose border it is: "A, B".

        None for an electrode in one piece.
        """
        return ", ".join(self.electrode.nearest(x, y, self.frame)) or None

    @property
    def centre(self) -> Pair:
        """The plate's centre, or the frame's where there is no plate [m]."""
        return (0.0, 0.0) if self.plate is None else self.plate.offset

    @property
    def plate_area(self) -> Any:
        """Area of the whole plate [m²], 0 without one."""
        return 0.0 if self.plate is None else area(self.plate.outline)

    def needed_plate(self) -> Plate:
        """Plate of a specimen that must have one; InputError where there is none."""
        if self.plate is None:
            raise InputError("is needed here: films without plate have solve, limits, curve, path, "
                             "modes, transient, response, sensitivity, sweep, tolerance, design, "
                             "diagnose, draw and export", key="plate", given=f"none in {self.name}")
        return self.plate

    @property
    def sharp_corners(self) -> Array:
        """Corners of plate and frame that point into the film, shape (n, 2) [m]."""
        corners = [self.frame.curve.sharp_corners(outwards=False)]
        if self.plate is not None:
            corners.append(self.plate.outline.curve.sharp_corners(outwards=True)
                           + np.real(self.plate.offset))
        return np.vstack(corners)

    @property
    def gap(self) -> float:
        """Smallest distance between plate and frame [m], negative where the plate sticks out.

        Without a plate it is the smallest distance between the frame and its centre.
        """
        return self._narrowest[0]

    @property
    def _gap_words(self) -> str:
        return "between plate and frame" if self.plate else "between the frame and its centre"

    @property
    def _narrowest(self) -> tuple[float, tuple[float, float]]:
        return _narrowest(self.frame, self.plate)

    @property
    def axisymmetric(self) -> bool:
        """Whether a rotation about the frame's centre changes nothing."""
        even = self.membrane.thickness_gradient == (0.0, 0.0)
        inside = [part for _, part in self._inside]
        edges = [self.frame, *(part.outline for part in inside)]
        round_edges = all(outline.semi_axes[0] == outline.semi_axes[1]
                          and isinstance(outline, Circle | Ellipse) for outline in edges)
        centred = all(part.offset == (0.0, 0.0) for part in inside)
        whole = all(patch.centre == (0.0, 0.0) for patch in self.electrode.patches)
        whole = whole and all(segment.sector is None for segment in self.electrode.segments)
        film = self.membrane.prestretch
        return even and round_edges and centred and whole and film[0] == film[1]

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes whose coordinate may change sign without changing the specimen."""
        fixed = [part for part in (self.plate, self.electrode.outline) if part is not None]
        planes = self.frame.mirror_planes.intersection(*(part.mirror_planes for part in fixed))
        planes = frozenset(plane for plane in planes if self.electrode.mirrored_in(plane))
        lopsided = (self.membrane.thickness_gradient,
                    *(patch.centre for patch in self.electrode.patches))
        uneven = {axis for pair in lopsided for axis, part in zip("xy", pair, strict=True) if part}
        return planes - uneven

    def relative_thickness(self, x: Any, y: Any) -> Any:
        """Virgin thickness over the stated one at places of the mounted film [m]; 1 if even."""
        along, across = self.membrane.thickness_gradient
        if not (np.any(along) or np.any(across)):
            return 1.0
        a, b = self.frame.semi_axes
        return 1 + along * x / a + across * y / b

    def place_between(self, way: Pair, share: float) -> Pair:
        """Place [m] on a ray from the centre, at a share of the way from plate to frame."""
        centre, direction = np.array(self.centre)[:, None], np.array(way)[:, None]
        far = 3 * max(self.frame.semi_axes)
        inner = 0.0 if self.plate is None else exits(self.plate, centre, direction, far)[0]
        outer = exits(self.frame, centre, direction, far)[0]
        x, y = (centre + direction * (inner + share * (outer - inner)))[:, 0].tolist()
        return x, y

    def _holds(self, patch: Patch) -> bool:
        """Whether a patch is centred within the frame or on it, and is no wider than the frame."""
        size = max(self.frame.semi_axes)
        depth = self.frame.level(*np.array(patch.centre)[:, None])[0]
        return bool(depth <= 1e-6 * size and patch.diameter <= 2 * size)

    def _meets(self, region: Region) -> bool:
        """Whether a region covers film: its edge lies on film, or it contains the whole film."""
        edge = region.points(720)
        on_film = self.frame.level(*edge) < 0
        if self.plate is not None:
            on_film &= self.plate.level(*edge) > 0
        around_frame = region.level(*self.frame.points(8)) <= 0
        return bool(on_film.any() or around_frame.all())


def check_range(low: float, high: float) -> None:
    """Refuse a range of stretches that no law can have."""
    if not 0 < low < high <= _LARGEST_STRETCH:
        raise InputError("must be two stretches, the smaller first, at most 20",
                         key="range", given=[low, high])


@lru_cache(maxsize=64)
def _check_regions(frame: Outline, plate: Plate | None, segments: tuple[Segment, ...], gap: float
                   ) -> None:
    """Refuse segments that overlap or cover no film."""
    x, y = np.column_stack([_sampled(frame, plate), frame.points(_AROUND) * (1 - SMALLEST)])
    # Edges have no width: a rounding error is no overlap.
    slack = SMALLEST * max(frame.semi_axes)
    within = list[Any]()
    for number, segment in enumerate(segments):
        key = f"electrode.segment.{number}"
        _check_band(segment, frame, gap, key)
        covers = segment.level(x, y, frame, gap) < -slack
        if not covers.any() and (segment.level(x, y, frame) < -slack).any():
            raise InputError(f"must leave some of segment {segment.name}: make the gap smaller, or "
                             "the segment larger", key="electrode.gap",
                             given=f"{gap * 1e3:.4g} mm")
        if not covers.any():
            raise InputError("must cover some of the film between frame and plate, wider than a "
                             "thousandth of the frame" if plate is not None else
                             "must cover some of the film, wider than a thousandth of the frame",
                             key=key, given=str(segment))
        for other, before in enumerate(within):
            both = covers & before
            if both.any():
                raise InputError(f"must not overlap {segments[other].name}: both cover "
                                 f"{place_text(x[both][0], y[both][0])}"
                                 + _OF_DRAWING * segment.from_drawing, key=key,
                                 given=str(segment))
        within.append(covers)


def _check_band(segment: Segment, frame: Outline, gap: float, key: str) -> None:
    """Refuse a band that cannot follow the frame's edge."""
    try:
        segment.edges(frame, gap)
    except InputError as error:
        raise InputError(f"a band along the frame {error.allowed}", key=f"{key}.band",
                         given=error.given) from None


def _sampled(frame: Outline, plate: Plate | None) -> Array:
    """Sample places of the film, shape (2, n) [m]."""
    steps = (np.arange(_ACROSS) + 0.5) / _ACROSS * 2 - 1
    x, y = (axis.ravel() for axis in np.meshgrid(*(half * steps for half in frame.semi_axes)))
    within = frame.level(x, y) < 0
    if plate is not None:
        within &= plate.level(x, y) > 0
    return np.array([x[within], y[within]])


@lru_cache(maxsize=64)
def _narrowest(frame: Outline, plate: Plate | None) -> tuple[float, tuple[float, float]]:
    """Find the gap and its place [m]: distances from points of each edge to the other."""
    if plate is None:
        edge = frame.points(720)
        x, y = edge[:, np.argmin(np.hypot(*edge))].tolist()
        return float(np.hypot(x, y)), (x, y)
    inside, outside = plate.points(720), frame.points(720)
    for plane in frame.mirror_planes & plate.mirror_planes:
        inside, outside = (edge[:, edge["xy".index(plane)] > -1e-9] for edge in (inside, outside))
    narrowest = []
    for edge, away in ((inside, -frame.level(*inside)), (outside, plate.level(*outside))):
        least = int(np.argmin(away))
        x, y = edge[:, least].tolist()
        narrowest.append((float(away[least]), (x, y)))
    return min(narrowest)


def require_different_names(specimens: Iterable[Specimen]) -> None:
    """Refuse specimens of one name: their results would overwrite each other."""
    names = [specimen.name for specimen in specimens]
    if len(set(names)) < len(names):
        raise InputError("specimens must have different names", key="name", given=", ".join(names))
