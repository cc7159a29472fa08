"""Things that go wrong in a laboratory and are no effect of the library, for a diagnosis to call
unexplained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from benchmarks.trials.synthetic_trials import Array, Design, Stranger
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, State
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Patch, Plate, Specimen
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import EffectFamily
from tympan.studies.effects.library.families import BARE_FILM, LESS_MOVED

#: Over what angle the edge of a missing sector fades [rad]: 2 mm at 20 mm from the middle.
_FADES = 0.1


@dataclass(frozen=True)
class OfOne(Stranger):
    """What is wrong with one specimen, or with each of them where none is said."""

    which: str | None
    #: The family of one film's effects that names it as well.
    alias: ClassVar[EffectFamily | None] = None

    @property
    def at_fault(self) -> str:
        return self.which or ""

    @property
    def family(self) -> EffectFamily | None:
        return self.alias


@dataclass(frozen=True)
class Thickness(OfOne):
    """The virgin film of one specimen is thicker by a share: tape is sold to within 10 %."""

    share: float

    def setup(self, setup: Setup) -> Setup:
        return setup.with_films(lambda film: replace(film, thickness=film.thickness
                                                     * (1 + self.share)), self.which)


@dataclass(frozen=True)
class Patchy(OfOne):
    """The electrode of one specimen has holes: a share of its permittivity is missing."""

    share: float
    alias: ClassVar[EffectFamily | None] = LESS_MOVED

    def setup(self, setup: Setup) -> Setup:
        return setup.with_films(lambda film: replace(
            film, relative_permittivity=film.relative_permittivity * (1 - self.share)), self.which)


@dataclass(frozen=True)
class Frame(OfOne):
    """The frame of one specimen was cut too large or too small by a length [m]."""

    excess: float

    def setup(self, setup: Setup) -> Setup:
        def change(specimen: Specimen) -> Specimen:
            x, y = (axis + self.excess for axis in specimen.frame.semi_axes)
            return replace(specimen, frame=Circle(x) if isinstance(specimen.frame, Circle)
                           else Ellipse((x, y)))

        return setup.with_specimens(change, self.which)


@dataclass(frozen=True)
class Offset(Stranger):
    """The supply gives some volts too many or too few whenever it is on."""

    volts: float

    @property
    def at_fault(self) -> str:
        return "voltage"

    def voltage(self, nominal: float) -> float:
        return max(nominal + self.volts, 0.0) if nominal else 0.0


@dataclass(frozen=True)
class Label(Stranger):
    """One of the two weights is not what its label says."""

    error: float

    @property
    def at_fault(self) -> str:
        return "mass"

    def mass(self, nominal: float) -> float:
        return nominal + (self.error if nominal > 20e-3 else 0.0)


@dataclass(frozen=True)
class Warming(Stranger):
    """The film's stiffness changes from ramp to ramp with the temperature of the room."""

    shares: tuple[float, ...]

    def stiffness(self, ramp: int) -> float:
        return 1 + self.shares[ramp % len(self.shares)]


@dataclass(frozen=True)
class Bend(Stranger):
    """The sensor's scale is curved: a share of the square of the reading over 5 mm is added."""

    share: float

    @property
    def at_fault(self) -> str:
        return "displacement"

    def shown(self, reading: Array, states: States) -> Array:
        return reading + self.share * reading**2 / 5e-3


@dataclass(frozen=True)
class Jump(Stranger):
    """The sensor is knocked once, from one reading on."""

    length: float
    reading: int

    def shown(self, reading: Array, states: States) -> Array:
        return reading + self.length * (np.arange(len(reading)) >= self.reading)


@dataclass(frozen=True)
class Stick(Stranger):
    """The plate rubs at a guide: it moves only once it has to by more than a threshold [m], then
    all the way."""

    threshold: float

    def shown(self, reading: Array, states: States) -> Array:
        shown = reading.copy()
        for row in range(1, len(shown)):
            if (states.voltage[row] > states.voltage[row - 1]
                    and abs(reading[row] - shown[row - 1]) < self.threshold):
                shown[row] = shown[row - 1]
        return shown


@dataclass(frozen=True)
class Sector(Patch):
    """What an electrode misses of the film about the frame's centre, ``width`` [rad] wide."""

    start: float = 0.0
    width: float = 0.0

    def bare(self, x: Any, y: Any) -> Any:
        middle = self.start + self.width / 2
        away = np.abs(np.angle(np.exp(1j * (np.arctan2(y, x) - middle))))
        return 0.5 * (1 + np.tanh((self.width / 2 - away) / _FADES))


@dataclass(frozen=True)
class MissingSector(OfOne):
    """The electrode was brushed but for a sector [rad]."""

    start: float
    width: float

    @property
    def family(self) -> EffectFamily | None:
        return LESS_MOVED if self.which else BARE_FILM

    def setup(self, setup: Setup) -> Setup:
        def change(specimen: Specimen) -> Specimen:
            middle, size = self.start + self.width / 2, 0.5 * min(specimen.frame.semi_axes)
            sector = Sector((size * float(np.cos(middle)), size * float(np.sin(middle))), size,
                            self.start, self.width)
            return replace(specimen, electrode=replace(specimen.electrode, patches=(sector,)))

        return setup.with_specimens(change, self.which)


@dataclass(frozen=True)
class Hardening(Stranger):
    """A lead or a guide holds the plate like a spring [N/m] that is twice as stiff a length [m] out
    and five times two of them out."""

    spring: float
    length: float
    law: ClassVar[str] = "hardening"
    softening: ClassVar[tuple[tuple[float, float], ...]] = ()

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        """Energy, its derivative, its second derivative, as of any bias."""
        share, k = (deflection / self.length) ** 2, self.spring
        return (k * deflection**2 * (1 / 2 + share / 12), k * deflection * (1 + share / 3),
                k * (1 + share))

    def setup(self, setup: Setup) -> Setup:
        return setup.with_rig(biases=(*setup.rig.biases, self))


@dataclass(frozen=True)
class Oval(OfOne):
    """The frame of one specimen was bent in its plane: longer one way, shorter the other."""

    share: float

    def setup(self, setup: Setup) -> Setup:
        def change(specimen: Specimen) -> Specimen:
            x, y = specimen.frame.semi_axes
            return replace(specimen, frame=Ellipse((x * (1 + self.share), y * (1 - self.share))))

        return setup.with_specimens(change, self.which)


@dataclass(frozen=True, eq=False)
class WarpedFilm(Model):
    """A film in a frame that is a saddle: ``warp`` [m] up at the ends of x, as much down at those
    of y; the plate is at 0 while nothing acts on it."""

    warp: float = 0.0
    down: float = 0.0

    def mounted(self, voltage_squared: float = 0.0) -> State:
        state, frame = super().mounted(voltage_squared), self.specimen.frame.semi_axes
        plate = self.specimen.needed_plate().outline.semi_axes[0] / min(frame)
        x, y = (state.positions[:, :2] / frame).T
        far = np.hypot(x, y)
        share = np.clip((far - plate) / (1 - plate), 0.0, 1.0)
        state.positions[:, HEAVE] = share * (self.warp * (x**2 - y**2) - self.down)
        return state


@dataclass(frozen=True)
class Warp(OfOne):
    """The frame of one specimen is warped out of its plane, by a length [m] at its ends."""

    length: float

    def film(self, model: Model) -> Model:
        if model.specimen.name != self.which:
            return model
        parts = {item.name: getattr(model, item.name) for item in fields(Model)}
        warped = WarpedFilm(**parts, warp=self.length)
        alone = equilibrium(warped, 0.0, 0.0).state
        return replace(warped, down=alone.plate.deflection)


@dataclass(frozen=True)
class OtherPlate(OfOne):
    """The plate of one specimen has another size, by a share of it."""

    share: float

    def setup(self, setup: Setup) -> Setup:
        def change(specimen: Specimen) -> Specimen:
            plate = specimen.needed_plate()
            radius = plate.outline.semi_axes[0] * (1 + self.share)
            return replace(specimen, plate=Plate(Circle(radius), plate.offset))

        return setup.with_specimens(change, self.which)


@dataclass(frozen=True)
class Rimmed(Specimen):
    """A specimen whose film is thicker by a ``share`` at the frame, and half of that a ``reach``
    [m] from there."""

    share: float = 0.0
    reach: float = 1.0

    def relative_thickness(self, x: Any, y: Any) -> Any:
        a, b = self.frame.semi_axes
        depth = (1 - np.hypot(x / a, y / b)) * np.sqrt(a * b)
        return super().relative_thickness(x, y) + self.share * 0.5 ** (depth / self.reach) ** 2


@dataclass(frozen=True)
class Rim(OfOne):
    """Glue has crept over the film from the frame, and stiffens its rim as more film would."""

    share: float
    reach: float

    def setup(self, setup: Setup) -> Setup:
        def change(specimen: Specimen) -> Specimen:
            parts = {item.name: getattr(specimen, item.name) for item in fields(Specimen)}
            return Rimmed(**parts, share=self.share, reach=self.reach)

        return setup.with_specimens(change, self.which)


@dataclass(frozen=True)
class Late(Stranger):
    """From one reading of a ramp on, each is written a row late, and the first of them twice."""

    reading: int

    @property
    def at_fault(self) -> str:
        return "voltage"

    def shown(self, reading: Array, states: States) -> Array:
        shown = reading.copy()
        ramp = np.flatnonzero((states.specimen == states.specimen[self.reading])
                              & (states.mass == states.mass[self.reading]))
        late = ramp[ramp >= self.reading]
        shown[late[1:]] = reading[late[:-1]]
        return shown


@dataclass(frozen=True)
class Exchanged(Stranger):
    """Readings stand at each other's labels of a column, those of one specimen or of two."""

    column: str
    specimens: tuple[int, int]

    @property
    def at_fault(self) -> str:
        return self.column

    def shown(self, reading: Array, states: States) -> Array:
        shown = reading.copy()
        one, other = self.specimens
        heavy = states.mass > np.mean(states.mass)
        for first, last in ((~heavy, heavy), (heavy, ~heavy)) if one == other else (
                (heavy, heavy), (~heavy, ~heavy)):
            shown[(states.specimen == one) & first] = reading[(states.specimen == other) & last]
            shown[(states.specimen == other) & last] = reading[(states.specimen == one) & first]
        return shown


Draw = Callable[[np.random.Generator, Design], Stranger]


def _which(generator: np.random.Generator, design: Design) -> str:
    return str(generator.choice([specimen.name for specimen in design.setup.specimens]))


#: Each with sizes thought plausible before any of them was tried.
STRANGERS: dict[str, Draw] = {
    "one film thicker": lambda g, design: Thickness(share=g.normal(0, 0.03),
                                                       which=_which(g, design)),
    "one electrode patchy": lambda g, design: Patchy(share=abs(g.normal(0, 0.05)),
                                                        which=_which(g, design)),
    "one frame cut wrong": lambda g, design: Frame(excess=g.normal(0, 1e-3),
                                                    which=_which(g, design)),
    "supply's zero": lambda g, design: Offset(g.normal(0, 150.0)),
    "one weight mislabelled": lambda g, design: Label(g.normal(0, 0.5e-3)),
    "room warming and cooling": lambda g, design: Warming(tuple(g.normal(0, 0.02, 6).tolist())),
    "sensor's scale curved": lambda g, design: Bend(g.normal(0, 0.02)),
    "sensor knocked": lambda g, design: Jump(g.normal(0, 100e-6), int(g.integers(5, 86))),
    "plate rubs": lambda g, design: Stick(abs(g.normal(0, 150e-6))),
}


def _sector(generator: np.random.Generator, which: str | None) -> Stranger:
    return MissingSector(which, generator.uniform(0, 2 * np.pi),
                         generator.uniform(np.pi / 12, np.pi / 2))


def _rim(generator: np.random.Generator, which: str | None) -> Stranger:
    return Rim(which, float(np.exp(generator.uniform(*np.log([0.5, 5.0])))),
               abs(generator.normal(0, 2e-3)))


def _some(generator: np.random.Generator, design: Design, count: int) -> list[int]:
    """So many of the specimens."""
    every = len(design.setup.specimens)
    return [int(number) for number in generator.choice(every, count, replace=False)]


#: More of them: what is wrong with one specimen or with all, and labels that stand where they
#: should not. Their sizes, too, were thought plausible before any of them was tried.
FURTHER: dict[str, Draw] = {
    "one electrode without a sector": lambda g, design: _sector(g, _which(g, design)),
    "electrodes without a sector": lambda g, design: _sector(g, None),
    "lead that hardens": lambda g, design: Hardening(
        abs(g.normal(0, 5.0)), float(np.exp(g.uniform(*np.log([1.5e-3, 6e-3]))))),
    "one frame bent oval": lambda g, design: Oval(_which(g, design), g.normal(0, 0.03)),
    "one frame warped": lambda g, design: Warp(_which(g, design), g.normal(0, 3e-3)),
    "one plate of another size": lambda g, design: OtherPlate(_which(g, design),
                                                              g.normal(0, 0.05)),
    "one rim stiffened": lambda g, design: _rim(g, _which(g, design)),
    "rims stiffened": lambda g, design: _rim(g, None),
    "readings a row late": lambda g, design: Late(int(g.integers(len(design.table)))),
    "masses exchanged": lambda g, design: Exchanged("mass", (_some(g, design, 1)[0],) * 2),
    "specimens exchanged": lambda g, design: Exchanged(
        "specimen", (lambda both: (both[0], both[1]))(_some(g, design, 2))),
}
