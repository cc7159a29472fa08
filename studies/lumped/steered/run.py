"""A plate's normal that draws a circle: with feedback and without, on the film in time."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.progress import ShareDone
from tympan.base.toml_reader import POSITIVE
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.films.film import ReducedFilm
from tympan.studies.films.segmented import error_in_time, levels, segmented_film
from tympan.studies.lumped.plants import FilmPlant
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.law import SteeredDesign, SteeredLaw, design_law
from tympan.studies.lumped.steered.model import NAMES, STEERED, SteeredModel

#: Directions of a circle at which the inverse of the static map is checked.
_AROUND = 60
#: Directions about which the controller is made robust, beside the centre.
_QUARTERS = 4


@asks
@dataclass(frozen=True)
class SteerSettings:
    """A circle that the plate's normal draws, and the supply, sampling and load."""

    _: KW_ONLY
    mass: Annotated[float, Key("on the plate", "mass", POSITIVE)] = 15e-3
    tilt: Annotated[float, Key("radius of the circle", "angle", POSITIVE)] = 3e-3
    frequency: Annotated[float, Key("turns a second", "frequency", POSITIVE)] = 1.0
    turns: Annotated[float, Key("whole turns, after one in which the circle grows",
                                rule=POSITIVE)] = 2.0
    supply: Annotated[float, Key("highest voltage of a segment; the lowest is 0", "voltage",
                                 POSITIVE)] = 2.8e3
    interval: Annotated[float, Key("sampling interval", "time", POSITIVE)] = 10e-3


@dataclass(frozen=True, eq=False)
class Steered:
    """An actuator that can be steered: film in time, lumped model, static inverse, controller.

    ``errors``: errors of the reduced film in time against finite elements, over the ranges.
    """

    film: ReducedFilm
    model: SteeredModel
    inverse: SteeredInverse
    design: SteeredDesign
    rig: Rig
    settings: SteerSettings

    @property
    def law(self) -> SteeredLaw:
        """The controller."""
        return self.design.law


@dataclass(frozen=True)
class Circle:
    """How a circle was drawn, after the turn in which it grew.

    ``smallest`` and ``largest`` radius over the wanted one; ``drift``: distance of the mean of the
    last turn from the wanted centre, over the radius; ``deflection``: range of the deflection [m].
    """

    smallest: float
    largest: float
    drift: float
    deflection: float

    @property
    def error(self) -> float:
        """Largest error of the radius, over the wanted one."""
        return max(self.largest - 1, 1 - self.smallest)


@dataclass(frozen=True, eq=False)
class SteerRun:
    """Samples of a run at times [s]: wanted and reached places, voltages of the segments [V].

    Places are deflection [m], tilt_x and tilt_y [rad], (times, 3).
    """

    names: tuple[str, ...]
    time: Array
    wanted: Array
    reached: Array
    voltages: Array
    frequency: float

    @property
    def circle(self) -> Circle:
        """Compare the circle with the wanted one."""
        late = self.time * self.frequency >= 1 - 1e-9
        wanted = np.hypot(*self.wanted[late, 1:].T)
        radius = np.hypot(*self.reached[late, 1:].T) / wanted
        last = self.time * self.frequency >= self.time[-1] * self.frequency - 1 + 1e-9
        missed = (self.reached - self.wanted)[last, 1:].mean(0)
        return Circle(float(radius.min()), float(radius.max()),
                      float(np.hypot(*missed) / wanted.max()),
                      float(np.ptp(self.reached[late, 0])))

    @property
    def samples(self) -> pd.DataFrame:
        """A row for each sample, in SI units."""
        columns = {"t": self.time}
        for number, name in enumerate(STEERED):
            columns |= {f"wanted_{name}": self.wanted[:, number], name: self.reached[:, number]}
        return pd.DataFrame(columns | {f"voltage_{name}": self.voltages[:, number]
                                       for number, name in enumerate(self.names)})


def steerable(specimen: Specimen, settings: SteerSettings, rig: Rig = Rig(),
              mesh: Settings = Settings()) -> tuple[Steered, dict[str, float]]:
    """Make film, model and controller of a specimen; also the film's errors in time.

    The errors are those of deflection and tilt in a run against finite elements, over their ranges.

    Raises
    ------
    InputError
        Where the film cannot tilt the plate, or does not creep.
    """
    _require(specimen, rig)
    model = full_model(specimen, mesh, rig)
    force = float(rig.force(settings.mass))
    film = segmented_film(model, force, settings.supply, mesh.path)
    errors = error_in_time(film, model, force, levels(specimen, settings.supply))
    return steered(film, settings, rig), errors


def full_model(specimen: Specimen, mesh: Settings = Settings(), rig: Rig = Rig()) -> Any:
    """Make the whole film's model: voltages of its segments need not be mirrored."""
    names = specimen.electrode.names
    uneven = {name: 1 - number / (2 * len(names)) for number, name in enumerate(names)}
    electrode, _ = specimen.electrode.driven(uneven)
    model = build_model(replace(specimen, electrode=electrode), mesh, rig.loading)
    return replace(model, specimen=specimen)


def _require(specimen: Specimen, rig: Rig) -> None:
    if len(specimen.electrode.names) < len(STEERED):
        raise InputError("must have three segments at least: fewer voltages cannot set a "
                         "deflection and two tilts", key="electrode.segment",
                         given=len(specimen.electrode.names))
    if not specimen.membrane.branches:
        raise InputError("must have viscous branches: a film without them follows its voltages at "
                         "once, and a plate on it swings without end", key="membrane.branch",
                         given="none")
    if rig.series_resistance:
        raise InputError("must be 0: each segment would charge through it at a rate of its own, "
                         "and the segments' charges are not read", key="rig.series_resistance",
                         given=f"{rig.series_resistance:g} ohm")


def steered(film: ReducedFilm, settings: SteerSettings, rig: Rig = Rig()) -> Steered:
    """Design a controller on the lumped model of a film."""
    moved = rig.moving_mass(settings.mass)
    plate = RigidPlate.uniform(film.specimen.needed_plate().outline, moved)
    model = SteeredModel.of(film, plate, float(rig.force(settings.mass)), settings.supply,
                            rig.plate_damping)
    missing = [name for name in STEERED if name not in model.freedoms]
    if missing:
        raise InputError("must let the plate tilt two ways", key="rig.guide",
                         given=f"{rig.guide}: no {', '.join(missing)}")
    middle = model.rest(np.full(len(model.segments), settings.supply**2 / 2))[model.steered]
    middle[1:] = 0.0
    places = circle(middle, settings.tilt, np.arange(_AROUND, dtype=float) / _AROUND)
    inverse = SteeredInverse.of(model, places, settings.supply)
    rests = [inverse.squared(place) for place in (inverse.centre,
                                                  *places[::_AROUND // _QUARTERS])]
    design = design_law(model, inverse, rests, settings.interval, settings.frequency)
    return Steered(film.tabulated, model, inverse, design, rig, settings)


def circle(centre: Array, radius: Any, turns: Array) -> Array:
    """Make the places of a circle about a centre, (turns, 3); it begins along x."""
    along = 2 * np.pi * np.asarray(turns)
    return np.stack([centre[0] + 0 * along, centre[1] + radius * np.cos(along),
                     centre[2] + radius * np.sin(along)], axis=-1)


#: How the segments' voltages are found: by the static inverse of the wanted place alone, by the
#: feed-forward of the wanted motion alone, or with feedback about it.
Drive = Literal["static", "motion", "feedback"]


def run(actuator: Steered, film: ReducedFilm | None = None, drive: Drive = "feedback",
        progress: ShareDone = lambda share: None) -> SteerRun:
    """Draw the circle on a film in time, by default on the actuator's own.

    Another film may differ from that of the design in its material, not in its shape.
    """
    settings, inverse = actuator.settings, actuator.inverse
    law = actuator.law if drive == "feedback" else replace(actuator.law, feedback=None)
    count = round((1 + settings.turns) / settings.frequency / settings.interval)
    time = settings.interval * np.arange(count + 1, dtype=float)
    wanted = wanted_circle(inverse.centre, settings, time)
    plant = _resting(actuator, actuator.film if film is None else film.tabulated)
    memory = law.resting(inverse.centre, place_of(plant))
    reached, voltages = [], []
    for number in range(count):
        reading = place_of(plant)
        if drive == "static":
            given = np.sqrt(np.clip(inverse.squared(wanted[number]), 0.0, inverse.supply**2))
        else:
            given, memory = law.voltages(memory, wanted[number + 1], reading)
        reached.append(reading)
        voltages.append(given)
        plant = plant.after(given, settings.interval)
        progress((number + 1) / count)
    return SteerRun(actuator.model.segments, time[:-1], wanted[:-1], np.array(reached),
                    np.array(voltages), settings.frequency)


def wanted_circle(centre: Array, settings: SteerSettings, time: Array) -> Array:
    """Compute the wanted places at times [s]: a circle that grows in its first turn."""
    grown = np.clip(time * settings.frequency, 0.0, 1.0)
    return circle(centre, settings.tilt * grown**2 * (3 - 2 * grown), time * settings.frequency)


def place_of(plant: FilmPlant) -> Array:
    """Read deflection [m] and tilts [rad] of a plant."""
    motion = plant.plate
    return np.array([sign * motion[FREEDOMS.index(of)]
                     for sign, of in (NAMES[name] for name in STEERED)])


def _resting(actuator: Steered, film: ReducedFilm) -> FilmPlant:
    """Bring a film to rest at the voltages that hold the centre of the circle."""
    voltages = np.sqrt(actuator.inverse.squared(actuator.inverse.centre)).tolist()
    wired, top = film.driven(dict(zip(actuator.model.segments, voltages, strict=True)))
    begin = FilmPlant.resting(wired, actuator.settings.mass, actuator.rig, top)
    return replace(begin, film=film)


