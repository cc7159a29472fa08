"""Things that go wrong in a laboratory and are no effect of the library, for a diagnosis to call
unexplained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.trials.synthetic_trials import Array, Design, Stranger
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Specimen
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.effects import Setup


@dataclass(frozen=True)
class Thickness(Stranger):
    """The virgin film of one specimen is thicker by a share: tape is sold to within 10 %."""

    share: float
    which: str

    def setup(self, setup: Setup) -> Setup:
        return setup.with_films(lambda film: replace(film, thickness=film.thickness
                                                     * (1 + self.share)), self.which)


@dataclass(frozen=True)
class Patchy(Stranger):
    """The electrode of one specimen has holes: a share of its permittivity is missing."""

    share: float
    which: str

    def setup(self, setup: Setup) -> Setup:
        return setup.with_films(lambda film: replace(
            film, relative_permittivity=film.relative_permittivity * (1 - self.share)), self.which)


@dataclass(frozen=True)
class Frame(Stranger):
    """The frame of one specimen was cut too large or too small by a length [m]."""

    excess: float
    which: str

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

    def voltage(self, nominal: float) -> float:
        return max(nominal + self.volts, 0.0) if nominal else 0.0


@dataclass(frozen=True)
class Label(Stranger):
    """One of the two weights is not what its label says."""

    error: float

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


Draw = Callable[[np.random.Generator, Design], Stranger]


def _which(generator: np.random.Generator, design: Design) -> str:
    return str(generator.choice([specimen.name for specimen in design.setup.specimens]))


#: Each with sizes thought plausible before any of them was tried.
STRANGERS: dict[str, Draw] = {
    "one film thicker": lambda g, design: Thickness(g.normal(0, 0.03), _which(g, design)),
    "one electrode patchy": lambda g, design: Patchy(abs(g.normal(0, 0.05)), _which(g, design)),
    "one frame cut wrong": lambda g, design: Frame(g.normal(0, 1e-3), _which(g, design)),
    "supply's zero": lambda g, design: Offset(g.normal(0, 150.0)),
    "one weight mislabelled": lambda g, design: Label(g.normal(0, 0.5e-3)),
    "room warming and cooling": lambda g, design: Warming(tuple(g.normal(0, 0.02, 6).tolist())),
    "sensor's scale curved": lambda g, design: Bend(g.normal(0, 0.02)),
    "sensor knocked": lambda g, design: Jump(g.normal(0, 100e-6), int(g.integers(5, 86))),
    "plate rubs": lambda g, design: Stick(abs(g.normal(0, 150e-6))),
}
