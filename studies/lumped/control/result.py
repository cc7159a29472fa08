"""A closed loop as it is stored: the controller, its margins, each step, and the run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd

from tympan.base.fields import Key
from tympan.studies.case import Warnings
from tympan.studies.columns import as_written, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, remove, to_json, write_json, write_text
from tympan.studies.lumped.control.controller import Controller
from tympan.studies.lumped.control.fmu import write_controller_fmu
from tympan.studies.lumped.control.loop import RunMargins
from tympan.studies.rows import named_apart
from tympan.studies.sense.inverse import Inverse
from tympan.tables.column import Column

#: Columns of control.csv: the run with feedback, and the run without feedback.
COLUMNS: tuple[Column, ...] = (
    Column.labels("specimen"),
    Column("t", "s"),
    Column("wanted", "mm"),
    Column("displacement", "mm"),
    Column("voltage", "kV"),
    Column("open_displacement", "mm"),
    Column("open_voltage", "kV"),
)

#: Limit of a step's speed.
ControlLimit = Literal["supply", "swing", "creep", "sampling"]


@dataclass(frozen=True, kw_only=True)
class ControlStep:
    """A step of the wanted deflection."""

    start_s: Annotated[float, Key("when it is wanted")]
    from_m: Annotated[float, Key("deflection wanted before")]
    to_m: Annotated[float, Key("deflection wanted from then on")]
    settled_s: Annotated[float | None, Key(
        "time after which the deflection stays within 2 % of the step; none where the next step "
        "comes first")]
    open_settled_s: Annotated[float | None, Key(
        "the same without feedback, with the voltage that holds the deflection at rest")]
    soonest_s: Annotated[float | None, Key(
        "time before which no controller can, unless it swings the plate by millimetres: until "
        "then the supply at its end does not hold the deflection within 2 %; none where that is "
        "longer than the step lasts")]
    times_as_soon: Annotated[float | None, Key(
        "settled_s without feedback over that with it, at least: where the film without feedback "
        "does not settle, the time to the next step stands for it")]
    overshoot: Annotated[float, Key("how far beyond the wanted deflection it goes, over the step")]
    limited_by: Annotated[ControlLimit, Key(
        "what keeps it from being quicker: the supply, which needs half of the time at least; the "
        "plate swings; the film creeps, which feedback must outrun; a settling of few samples")]


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """A mass that is put on the plate and stays there, at a constant wanted deflection."""

    mass_kg: Annotated[float, Key("mass that is put on")]
    open_m: Annotated[float, Key("deflection by it at rest without feedback")]
    largest_m: Annotated[float, Key("largest deflection from the wanted one with feedback")]
    settled_s: Annotated[float | None, Key(
        "time after which it stays within 2 % of that without feedback; none where it does not "
        "within the run")]


@dataclass(frozen=True, kw_only=True)
class LoopMargins:
    """Margins of the sampled loop, the worst over the range of deflections."""

    gain: Annotated[float | None, Key("factor by which the loop's gain may grow; none: any")]
    phase_deg: Annotated[float | None, Key("phase margin [°]; none where there is none to lose")]
    delay_s: Annotated[float | None, Key("delay that may be added")]
    sensitivity: Annotated[float, Key("largest sensitivity |1/(1 + L)|")]

    @classmethod
    def of(cls, found: RunMargins) -> LoopMargins:
        """Store margins; a margin without a limit is none."""
        def limit(value: float) -> float | None:
            return value if np.isfinite(value) else None

        return cls(gain=limit(found.gain), phase_deg=limit(found.phase),
                   delay_s=limit(found.delay), sensitivity=found.sensitivity)


@dataclass(frozen=True, kw_only=True)
class ControlledFilms:
    """Films that differ from the film of the design, under its controller.

    Standard deviations: 10 % of stiffness and of permittivity, 5 % of the mass, 20 % of each
    viscous constant.
    """

    films: Annotated[int, Key("how many")]
    stable: Annotated[int, Key("how many of them are stable at all voltages of the design at which "
                               "they have a rest")]


@dataclass(frozen=True, kw_only=True)
class ControlledFilm:
    """One actuator with its controller, and the limits of its speed.

    Pairs hold the value without voltage and the value at the supply's voltage.
    """

    specimen: Annotated[str, Key("name of the specimen")]
    mass_kg: Annotated[float, Key("nominal load on the plate")]
    controller: Annotated[Controller, Key("the controller")]
    margins: Annotated[LoopMargins, Key("margins on the linearised model")]
    travel_m: Annotated[tuple[float, float], Key("deflections at rest between which it works")]
    swing_Hz: Annotated[tuple[float, float], Key("frequency of the plate's swing; 0: overdamped")]
    damping_ratio: Annotated[tuple[float, float], Key("damping ratio of the swing")]
    creep_share: Annotated[tuple[float, float], Key(
        "share of the deflection by voltage that comes by creep")]
    creep_s: Annotated[tuple[float | None, float | None], Key(
        "time of the slowest creep; none without any")]
    lowest_V: Annotated[float, Key("lowest voltage of the run")]
    highest_V: Annotated[float, Key("highest voltage of the run")]
    error_rms_m: Annotated[float, Key("root mean square of wanted less reached deflection")]
    open_error_rms_m: Annotated[float, Key("the same without feedback")]
    steps: Annotated[tuple[ControlStep, ...], Key("steps of the wanted deflection")]
    scattered: Annotated[ControlledFilms, Key("films that differ from this one")]
    sensed: Annotated[Inverse | None, Key("deflection by capacitance, where that is read")]
    disturbance: Annotated[Disturbance, Key("a mass put on the plate in the middle of its travel")]
    warnings: Warnings
    samples: pd.DataFrame = field(default_factory=pd.DataFrame, repr=False, compare=False)

    @property
    def at_once(self) -> float:
        """Share of a small voltage's deflection that comes at once, and therefore swings."""
        return 1 - self.creep_share[0]

    @property
    def swing_allows(self) -> float:
        """2 ζ ω over the share at once, without voltage [1/s]: the integral gain grows with it.

        At the swing's frequency the loop is K_i/ω times the height of the resonance,
        share/(2 ζ), which must stay away from −1. The swing is damped least without voltage.
        """
        return 4 * np.pi * self.swing_Hz[0] * self.damping_ratio[0] / self.at_once

    @property
    def supply_limited(self) -> int:
        """Number of steps that the supply limits."""
        return sum(step.limited_by == "supply" for step in self.steps)


@dataclass(frozen=True, eq=False)
class ControlResult:
    """Closed loops of several actuators.

    ``fmu``: the controllers are also stored as FMUs.
    """

    films: tuple[ControlledFilm, ...]
    fmu: bool = False

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each step of each actuator."""
        return [{"specimen": film.specimen, **asdict(step)}
                for film in self.films for step in film.steps]

    @property
    def key_numbers(self) -> dict[str, Any]:
        """Margins, voltages and error of each film."""
        return named_apart({film.specimen: {
            "gain_margin": film.margins.gain, "phase_margin_deg": film.margins.phase_deg,
            "delay_margin_s": film.margins.delay_s, "sensitivity": film.margins.sensitivity,
            "highest_V": film.highest_V, "error_rms_m": film.error_rms_m}
            for film in self.films})

    def json(self) -> dict[str, Any]:
        """Convert the closed loops to a JSON object, without samples."""
        return {"films": to_json(self.films)}

    def save(self, folder: Path) -> None:
        """Write control.csv, each ``NAME-control.c``, and the numbers last, control.json.

        Where capacitance is read, ``NAME-sensed.c`` computes the deflection from it. With ``fmu``
        ``NAME-control.fmu`` is written as well.
        """
        remove(folder, "control.json",
               *(f"{film.specimen}-control.fmu" for film in self.films))
        for film in self.films:
            write_text(folder / f"{film.specimen}-control.c",
                       film.controller.c_source(film.specimen))
            if film.sensed is not None:
                write_text(folder / f"{film.specimen}-sensed.c",
                           film.sensed.c_source(film.specimen))
            if self.fmu:
                write_controller_fmu(folder, film.specimen, film.controller, film.sensed)
        write_sheet(folder / "control.csv", COLUMNS, pd.concat([film.samples
                                                                for film in self.films]))
        write_json(folder / "control.json", self.json())

    def as_stored(self) -> ControlResult:
        """Round the result to the digits of its file."""
        return replace(self, films=tuple(
            replace(film, samples=pd.DataFrame(as_written(COLUMNS, film.samples)))
            for film in self.films))

    @classmethod
    def load(cls, folder: Path) -> ControlResult:
        """Load a saved result; a missing or damaged file is an InputError."""
        file = folder / "control.json"
        films = from_json(tuple[ControlledFilm, ...], dict(read_json(file)).get("films"), file,
                          "films")
        samples = pd.DataFrame(read_own_sheet(folder / "control.csv", COLUMNS))
        return cls(tuple(replace(film, samples=samples[samples["specimen"] == film.specimen])
                         for film in films))
