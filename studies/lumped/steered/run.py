"""A plate's normal that draws a circle, or follows a path, on the film in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, get_args

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.progress import ShareDone
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS
from tympan.fem.rig import OWN, Rig, mounted
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, build_model, solved_loading
from tympan.studies.films.film import ReducedFilm
from tympan.studies.films.segmented import error_at_once, error_in_time, levels, segmented_film
from tympan.studies.lumped.control.controller import Method
from tympan.studies.lumped.control.result import LoopMargins
from tympan.studies.lumped.export.fmu import require_compiler
from tympan.studies.lumped.plants import FieldPlant, FilmPlant
from tympan.studies.lumped.steered.export import Exported
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.law import SteeredDesign, SteeredLaw, design_law
from tympan.studies.lumped.steered.model import NAMES, STEERED, SteeredModel
from tympan.studies.lumped.steered.path import SteeredPath, circle_path, read_path
from tympan.studies.lumped.steered.result import (
    DRIVES,
    Drive,
    SteeredMatrices,
    SteeredResult,
    SteeredRun,
    SteeringLaw,
    columns,
    rows_of,
)
from tympan.studies.trace import sample_count

#: Most places of a path at which the inverse of the static map is checked.
_CHECKED = 60
#: Places of a path about which the controller is made robust, beside the centre.
_ALONG = 4
#: Distance of a voltage squared from an end of the supply that counts as being there, over the
#: supply's.
_AT_END = 1e-9
#: Error of a circle's radius from which on a run with feedback has a remark.
_ROUND = 0.05
#: A circle is judged over its last turn.
_TURNS: Rule = (lambda x: 1 <= x <= 1e4, "must be from 1 to 10000")


@asks
@dataclass(frozen=True)
class SteerSettings:
    """The path of the plate's normal, and the supply, sampling and load.

    Without a ``reference`` it is a circle.
    """

    _: KW_ONLY
    mass: Annotated[float, Key("on the plate", "mass", POSITIVE)] = 15e-3
    tilt: Annotated[float, Key("radius of the circle", "angle", POSITIVE)] = 3e-3
    frequency: Annotated[float, Key("turns a second, for which the controller is designed",
                                    "frequency", POSITIVE)] = 1.0
    turns: Annotated[float, Key("turns, after one in which the circle grows",
                                rule=_TURNS)] = 2.0
    supply: Annotated[float, Key("highest voltage of a segment; the lowest is 0", "voltage",
                                 POSITIVE)] = 2.8e3
    interval: Annotated[float, Key("sampling interval", "time", POSITIVE)] = 10e-3
    method: Annotated[Method, Key("how the feedback is designed")] = "lqg"
    reference: Annotated[Path | None, Key(
        "CSV file of another path: t_s with deflection_mm, tilt_x_mrad, tilt_y_mrad")] = None
    fmu: Annotated[bool, Key("whether model and controller are stored as FMUs, too")] = False

    if TYPE_CHECKING:
        def __init__(self, *, mass: float | str = 15e-3, tilt: float | str = 3e-3,
                     frequency: float | str = 1.0, turns: float = 2.0,
                     supply: float | str = 2.8e3, interval: float | str = 10e-3,
                     method: Method = "lqg", reference: Path | str | None = None,
                     fmu: bool = False) -> None: ...

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise InputError("must be one of " + ", ".join(get_args(Method)), key="method",
                             given=self.method)
        sample_count((1 + self.turns) / self.frequency, self.interval)

    def path(self, middle: Array) -> SteeredPath:
        """Make the path; ``middle``: deflection and tilts of equal voltages in mid-supply."""
        if self.reference is not None:
            return read_path(self.reference, middle, self.interval)
        return circle_path(middle, self.tilt, self.frequency, self.turns, self.interval)


@dataclass(frozen=True, eq=False)
class Steered:
    """An actuator that can be steered: film in time, lumped model, static inverse, controller."""

    film: ReducedFilm
    model: SteeredModel
    inverse: SteeredInverse
    design: SteeredDesign
    path: SteeredPath
    rig: Rig
    settings: SteerSettings

    @property
    def law(self) -> SteeredLaw:
        """The controller."""
        return self.design.law


@dataclass(frozen=True, eq=False)
class SteerRun:
    """Samples of a run: reached places and voltages of the segments [V], at the path's times.

    Places are deflection [m], tilt_x and tilt_y [rad], (times, 3).
    """

    drive: Drive
    path: SteeredPath
    reached: Array
    voltages: Array

    @property
    def summary(self) -> SteeredRun:
        """Compare the run with the wanted path."""
        path, late = self.path, self.path.late
        missed, wanted = (self.reached - path.now)[late], path.now[late, 1:]
        off = np.hypot(*missed[:, 1:].T)
        radius, drift = None, None
        if path.period is not None:
            relative = np.hypot(*self.reached[late, 1:].T) / np.hypot(*wanted.T)
            radius = float(relative.min()), float(relative.max())
            drift = float(np.hypot(*missed[-path.period:, 1:].mean(0)))
        reached = self.reached[late, 0]
        return SteeredRun(
            drive=self.drive, radius=radius, drift_rad=drift,
            radius_error=None if radius is None else max(radius[1] - 1, 1 - radius[0]),
            tilt_error_rad=float(off.max()), tilt_rms_rad=float(np.sqrt(np.mean(off**2))),
            deflection_error_m=float(np.abs(missed[:, 0]).max()),
            deflection_m=(float(reached.min()), float(reached.max())),
            highest_V=tuple(self.voltages.max(0).tolist()),
            lowest_V=tuple(self.voltages.min(0).tolist()))


def steer(specimen: Specimen, settings: SteerSettings = SteerSettings(), rig: Rig = OWN,
          mesh: Settings = Settings(),
          progress: Callable[..., None] = lambda *words, share=0.0: None) -> SteeredResult:
    """Design a controller that steers a specimen's plate, and run it on the film in time.

    ``progress`` is called with the words of a step, then with the ``share`` of it that is done.

    Raises
    ------
    InputError
        Where the film cannot tilt the plate, or does not creep.
    Failure
        Where the supply cannot hold the plate on its path, or no controller is robust.
    """
    begin = perf_counter()
    specimen, rig = mounted(specimen, rig)
    if settings.fmu:
        require_compiler()
    progress("film")
    actuator, errors = steerable(specimen, settings, rig, mesh)
    runs = []
    for drive in DRIVES:
        progress(drive)
        runs.append(run(actuator, drive=drive, progress=lambda share: progress(share=share)))
    names, model, path, law = specimen.electrode.names, actuator.model, actuator.path, actuator.law
    samples = {"t": path.time[:-1]}
    for prefix, places in (("wanted", path.now), *((each.drive, each.reached) for each in runs)):
        samples |= {f"{prefix}_{name}": places[:, number] for number, name in enumerate(STEERED)}
    for each in runs:
        samples |= {f"{each.drive}_voltage_{name}": each.voltages[:, number]
                    for number, name in enumerate(names)}
    linear = model.linearise(law.inverse.squared(law.inverse.centre))
    case = Case(specimen, mass=settings.mass, voltage=settings.supply, rig=rig)
    return SteeredResult(
        specimen=specimen.name, mass_kg=settings.mass, segments=names, freedoms=model.freedoms,
        supply_V=settings.supply, interval_s=settings.interval, sensor_lag_s=rig.sensor_lag,
        frequency_Hz=settings.frequency, method=settings.method,
        tilt_rad=None if path.period is None else settings.tilt,
        margins=LoopMargins.of(actuator.design.margins),
        inertia_off=actuator.design.inertia_off,
        runs=tuple(each.summary for each in runs),
        film_error={name: error for name, error in errors.items() if np.isfinite(error)},
        force_error=model.error, inverse_error=law.inverse.error,
        linear=SteeredMatrices(
            a=rows_of(linear.a), b=rows_of(linear.b), c=rows_of(linear.c), states=linear.states,
            inputs=linear.inputs, outputs=linear.outputs, rest=rows_of(linear.rest),
            squared_V2=rows_of(linear.squared)),
        law=SteeringLaw(
            **{name: rows_of(part) for name, part in zip(
                ("a", "b", "c", "d", "g", "rest"), law.parts, strict=True)},
            centre=rows_of(law.inverse.centre), scale=rows_of(law.inverse.scale),
            powers=rows_of(law.inverse.powers), coefficients_V2=rows_of(law.inverse.coefficients),
            slopes_per_V2=rows_of(law.slopes)),
        wall_s=perf_counter() - begin,
        warnings=(*_remarks(runs[-1], settings, errors), *rig.in_motion, *case.remarks),
        samples=pd.DataFrame({each.name: samples[each.name] for each in columns(names)}),
        exported=Exported(model, law), fmu=settings.fmu)


def _remarks(run: SteerRun, settings: SteerSettings, errors: dict[str, float]) -> list[str]:
    """List what limits a run with feedback."""
    squared, most = run.voltages**2, settings.supply**2
    remarks = []
    if (np.minimum(squared, most - squared) < _AT_END * most).any():
        remarks.append("with feedback a voltage reaches an end of the supply: choose a smaller "
                       "tilt or a higher supply")
    if (run.summary.radius_error or 0.0) > _ROUND:
        remarks.append(f"with feedback the radius is off by more than {100 * _ROUND:g} %: choose a "
                       "lower frequency, a shorter interval or the other method")
    if not np.isfinite(list(errors.values())).all():
        remarks.append("random voltages up to the supply's lead to a pull-in: the reduced film "
                       "was not compared with finite elements")
    return remarks


def steerable(specimen: Specimen, settings: SteerSettings, rig: Rig = Rig(),
              mesh: Settings = Settings()) -> tuple[Steered, dict[str, float]]:
    """Make film, model and controller of a specimen; also the film's errors in time.

    The errors are those of deflection and tilt in a run against finite elements, over their ranges,
    and those of tilts at once after the voltages of places of the path, over the largest.

    Raises
    ------
    InputError
        Where the film cannot tilt the plate, or does not creep.
    """
    _require(specimen, rig)
    model = full_model(specimen, mesh, rig)
    force = _force(specimen, settings, rig)
    film = segmented_film(model, force, settings.supply, mesh.path)
    errors = error_in_time(film, model, force, levels(specimen, settings.supply))
    made = steered(film, settings, rig)
    centre, *about = (
        dict(zip(specimen.electrode.names, np.sqrt(made.inverse.squared(place)).tolist(),
                 strict=True))
        for place in (made.inverse.centre, *made.path.spread(_ALONG)))
    return made, errors | {"tilt_at_once": error_at_once(film, model, force, centre, about)}


def _force(specimen: Specimen, settings: SteerSettings, rig: Rig) -> float:
    """Compute the force on the plate [N]."""
    area = float(specimen.plate_area) if rig.plate_pressure else 0.0
    return float(rig.force(settings.mass, area))


def full_model(specimen: Specimen, mesh: Settings = Settings(), rig: Rig = Rig()) -> Any:
    """Make the whole film's model: voltages of its segments need not be mirrored."""
    names = specimen.electrode.names
    uneven = {name: 1 - number / (2 * len(names)) for number, name in enumerate(names)}
    electrode, _ = specimen.electrode.driven(uneven)
    model = build_model(replace(specimen, electrode=electrode), mesh, rig.loading)
    return replace(model, specimen=specimen)


def _require(specimen: Specimen, rig: Rig) -> None:
    specimen.needed_plate()
    segments = specimen.electrode.names
    if len(segments) < len(STEERED):
        raise InputError("must have three segments at least: fewer voltages cannot set a "
                         "deflection and two tilts", key="electrode.segment",
                         given=len(segments))
    if not specimen.membrane.branches:
        raise InputError("must have viscous branches: a film without them follows its voltages at "
                         "once, and a plate on it swings without end", key="membrane.branch",
                         given="none")
    if rig.series_resistance:
        raise InputError("must be 0: each segment would charge through it at a rate of its own, "
                         "and the segments' charges are not read", key="rig.series_resistance",
                         given=f"{rig.series_resistance:g} ohm")
    if rig.gas_pressure:
        raise InputError("must be 0: gas below the film bulges it between plate and frame, and so "
                         "changes how stiff it is against tilts, which the model leaves out",
                         key="rig.gas_pressure", given=f"{rig.gas_pressure:g} Pa")
    if any(rig.weight_offset):
        raise InputError("must be 0: a mass beside the centre is a moment on the plate, which the "
                         "model has not; feedback takes it off as an error of the film",
                         key="rig.weight_offset",
                         given=", ".join(f"{1e3 * each:g} mm" for each in rig.weight_offset))


def steered(film: ReducedFilm, settings: SteerSettings, rig: Rig = Rig()) -> Steered:
    """Design a controller on the lumped model of a film."""
    plate = RigidPlate.uniform(film.specimen.needed_plate().outline,
                               rig.moving_mass(settings.mass))
    model = SteeredModel.of(film, plate, _force(film.specimen, settings, rig), settings.supply,
                            rig.plate_damping, solved_loading(rig.loading, Settings()).biases)
    missing = [name for name in STEERED if name not in model.freedoms]
    if missing:
        raise InputError("must let the plate tilt two ways", key="rig.guide",
                         given=f"{rig.guide}: no {', '.join(missing)}")
    middle = model.rest(np.full(len(model.segments), settings.supply**2 / 2))[model.steered]
    middle[1:] = 0.0
    path = settings.path(middle)
    places = path.spread(_CHECKED)
    inverse = SteeredInverse.of(model, places, settings.supply)
    rests = [inverse.squared(place) for place in (inverse.centre, *path.spread(_ALONG))]
    design = design_law(model, inverse, rests, settings.interval, settings.frequency,
                        settings.method, rig.sensor_lag)
    return Steered(film.tabulated, model, inverse, design, path, rig, settings)


def run(actuator: Steered, film: ReducedFilm | Model | None = None, drive: Drive = "feedback",
        progress: ShareDone = lambda share: None) -> SteerRun:
    """Follow the path on a film in time, by default on the actuator's own.

    Another film may differ from that of the design in its material, not in its shape; it is
    reduced, or the model of :func:`full_model` in finite elements. The film
    begins at rest at the voltages that hold the first place of the path on the film of the design.
    """
    interval, inverse, path = actuator.settings.interval, actuator.inverse, actuator.path
    law = actuator.law if drive == "feedback" else replace(actuator.law, feedback=None)
    plant = _resting(actuator, actuator.film if film is None else film)
    place = shown = place_of(plant)
    memory = law.resting(path.wanted[0], shown)
    reached, voltages = [], []
    for number, (now, ahead) in enumerate(zip(path.wanted, path.wanted[1:], strict=False), 1):
        if drive == "static":
            given = np.sqrt(np.clip(inverse.squared(now), 0.0, inverse.supply**2))
        else:
            given, memory = law.voltages(memory, ahead, shown)
        reached.append(place)
        voltages.append(given)
        plant, before = plant.after(given, interval), place
        place = place_of(plant)
        shown = actuator.rig.lagged(shown, before, place, interval)
        progress(number / len(path.now))
    return SteerRun(drive, path, np.array(reached), np.array(voltages))


def place_of(plant: FilmPlant | FieldPlant) -> Array:
    """Read deflection [m] and tilts [rad] of a plant."""
    motion = plant.plate
    return np.array([sign * motion[FREEDOMS.index(of)]
                     for sign, of in (NAMES[name] for name in STEERED)])


def _resting(actuator: Steered, film: ReducedFilm | Model) -> FilmPlant | FieldPlant:
    """Bring a film to rest at the voltages that hold the first place of the path."""
    squared = actuator.inverse.squared(actuator.path.wanted[0])
    voltages = np.sqrt(np.maximum(squared, 0.0)).tolist()
    named, mass = dict(zip(actuator.model.segments, voltages, strict=True)), actuator.settings.mass
    if isinstance(film, Model):
        return FieldPlant.resting(film, mass, actuator.rig, named)
    wired, top = film.driven(named)
    return replace(FilmPlant.resting(wired, mass, actuator.rig, top), film=film.tabulated)
