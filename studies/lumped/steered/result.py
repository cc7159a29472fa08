"""A steered plate as it is stored: controller, margins, runs on the film in time, small motions."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd

from tympan.base.fields import Key
from tympan.studies.case import SpecimenRecord, WallTime, Warnings
from tympan.studies.columns import as_written, read_own_sheet, write_sheet
from tympan.studies.files import remove
from tympan.studies.lumped.control.controller import Method, Rows
from tympan.studies.lumped.control.result import LoopMargins
from tympan.studies.lumped.steered.export import Exported
from tympan.studies.lumped.steered.model import STEERED
from tympan.tables.column import Column

#: How the segments' voltages are found: by the static inverse of the wanted place alone, by the
#: feed-forward of the wanted motion alone, or with feedback about it.
Drive = Literal["static", "motion", "feedback"]
DRIVES: tuple[Drive, ...] = ("static", "motion", "feedback")

#: Units in which the places of STEERED are stored.
UNITS = ("mm", "mrad", "mrad")


@dataclass(frozen=True, kw_only=True)
class SteeredRun:
    """How well a path was followed on the film in time."""

    drive: Annotated[Drive, Key(
        "what gave the voltages: the static inverse of the wanted place, the feed-forward of the "
        "wanted motion, or that with feedback")]
    radius: Annotated[tuple[float, float] | None, Key(
        "smallest and largest tilt of a circle over the wanted one, after the turn in which it "
        "grows; none for another path")]
    radius_error: Annotated[float | None, Key("largest error of the radius over it")]
    drift_rad: Annotated[float | None, Key(
        "distance of the mean tilt of the last turn from the wanted one")]
    tilt_error_rad: Annotated[float, Key("largest distance of the tilt from the wanted one, after "
                                         "the first turn of a circle")]
    tilt_rms_rad: Annotated[float, Key("root mean square of that distance")]
    deflection_error_m: Annotated[float, Key(
        "largest distance of the deflection from the wanted one in the same time")]
    deflection_m: Annotated[tuple[float, float], Key("range of the deflection in the same time")]
    highest_V: Annotated[tuple[float, ...], Key("highest voltage of each segment")]
    lowest_V: Annotated[tuple[float, ...], Key("lowest voltage of each segment")]


@dataclass(frozen=True, kw_only=True)
class SteeredMatrices:
    """Small motions about the centre of the path: x' = A x + B u, y = C x."""

    a: Annotated[Rows, Key("A, by rows")]
    b: Annotated[Rows, Key("B, by rows")]
    c: Annotated[Rows, Key("C, by rows")]
    states: Annotated[tuple[str, ...], Key("components of x: places, speeds, places of branches")]
    inputs: Annotated[tuple[str, ...], Key("components of u: the segments' U² [V²]")]
    outputs: Annotated[tuple[str, ...], Key("components of y [m, rad]")]
    rest: Annotated[tuple[float, ...], Key("places at rest, of the first states")]
    squared_V2: Annotated[tuple[float, ...], Key("U² of the segments there")]


@dataclass(frozen=True, kw_only=True)
class SteeringLaw:
    """v = C s + D (r, y) and s⁺ = A s + B (r, y) + G (v' − v), once an interval.

    s is the memory, r the places wanted a sample ahead, y the readings, v the requested places at
    rest, v' those that the supply can hold. All places are relative to ``centre``.
    """

    a: Annotated[Rows, Key("A, by rows")]
    b: Annotated[Rows, Key("B, by rows")]
    c: Annotated[Rows, Key("C, by rows")]
    d: Annotated[Rows, Key("D, by rows")]
    g: Annotated[Rows, Key("G, by rows")]
    rest: Annotated[Rows, Key("the memory after a long rest, per r and y, by rows")]
    centre: Annotated[tuple[float, ...], Key("deflection [m] and tilts [rad] about which it works")]
    scale: Annotated[tuple[float, ...], Key(
        "reach of the static inverse about the centre: requested places are limited to it")]
    powers: Annotated[tuple[tuple[int, ...], ...], Key(
        "powers of (v − centre)/scale in each term of the static inverse")]
    coefficients_V2: Annotated[Rows, Key("coefficients of its terms, U² by segments")]
    slopes_per_V2: Annotated[Rows, Key("places at rest by the segments' U², at the centre")]


@dataclass(frozen=True, kw_only=True)
class SteeredResult(SpecimenRecord):
    """A controller that steers a plate along a path, and runs of it on the film in time, SI."""

    ending = "-steered"
    writer = "tympan lumped steer"
    kinds = ("csv", "json", "c", "fmu")
    drawn = ("png", "svg")

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    segments: Annotated[tuple[str, ...], Key("segments in the order of their voltages")]
    freedoms: Annotated[tuple[str, ...], Key("freedoms of the plate in the lumped model")]
    supply_V: Annotated[float, Key("highest voltage of a segment; the lowest is 0")]
    interval_s: Annotated[float, Key("sampling interval")]
    sensor_lag_s: Annotated[float, Key("time by which the sensor lags")]
    frequency_Hz: Annotated[float, Key("turns a second, for which the controller is designed")]
    tilt_rad: Annotated[float | None, Key("radius of the circle; none for another path")]
    method: Annotated[Method, Key("how the feedback is designed")]
    margins: Annotated[LoopMargins, Key(
        "margins on the linearised model, the worst at five places: of each channel with the "
        "others closed; the sensitivity is the largest singular value of that of all channels")]
    inertia_off: Annotated[float, Key(
        "relative error of the plate's inertia for which the loop is as robust at the centre; the "
        "frequency of a swing is then half as much off")]
    runs: Annotated[tuple[SteeredRun, ...], Key("runs on the film in time, by their drive")]
    film_error: Annotated[dict[str, float], Key(
        "errors of the reduced film against finite elements: of deflection and tilt in a run in "
        "time, over the range; of tilts at once after voltages of the path, over the largest")]
    force_error: Annotated[float, Key(
        "largest error of a generalised force of the lumped model, over its standard deviation")]
    inverse_error: Annotated[float, Key("largest error of U² of the static inverse, over the "
                                        "supply's")]
    linear: Annotated[SteeredMatrices, Key("small motions about the centre of the path")]
    law: Annotated[SteeringLaw, Key("the controller")]
    wall_s: WallTime
    warnings: Warnings = ()
    samples: pd.DataFrame = field(default_factory=pd.DataFrame, repr=False, compare=False)
    exported: Exported | None = field(default=None, repr=False, compare=False)
    fmu: bool = field(default=False, repr=False, compare=False)

    @property
    def rows(self) -> pd.DataFrame:
        """A row for each sample, in SI units."""
        return self.samples

    @property
    def key_numbers(self) -> dict[str, Any]:
        """Margins, and errors of the run with feedback."""
        best = self.run("feedback")
        return {"sensitivity": self.margins.sensitivity, "radius_error": best.radius_error,
                "tilt_error_rad": best.tilt_error_rad, "tilt_rms_rad": best.tilt_rms_rad}

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the controller's files, which do not have the record's ending."""
        return f"{self.specimen}-steering.c", f"{self.specimen}-steering.fmu"

    def run(self, drive: Drive) -> SteeredRun:
        """Find the run of a drive."""
        return next(each for each in self.runs if each.drive == drive)

    def save(self, folder: Path) -> None:
        """Write numbers, samples, model and controller as C99, and FMUs if they are wanted.

        Files are ``NAME-steered`` .csv, .c, .fmu and .json; the controller is ``NAME-steering``
        .c and .fmu.
        """
        name = f"{self.specimen}{self.ending}"
        remove(folder, *self.files)
        super().save(folder)
        write_sheet(folder / f"{name}.csv", columns(self.segments), self.samples)
        if self.exported is not None:
            self.exported.save(folder, self.fmu)

    def as_stored(self) -> SteeredResult:
        """Round the result to the digits of its file."""
        return replace(self, samples=pd.DataFrame(as_written(columns(self.segments),
                                                             self.samples)))

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> SteeredResult:
        """Load a saved result, by the specimen's ``name``, or the only one."""
        result = super().load(folder, name)
        file = folder / f"{result.specimen}{cls.ending}.csv"
        return replace(result, samples=pd.DataFrame(read_own_sheet(file,
                                                                   columns(result.segments))))


def columns(segments: tuple[str, ...]) -> tuple[Column, ...]:
    """List the columns of the samples: wanted and reached places, voltages, by drive."""
    places = list(zip(STEERED, UNITS, strict=True))
    return (Column("t", "s"), *(Column(f"wanted_{name}", unit) for name, unit in places),
            *(Column(f"{drive}_{name}", unit) for drive in DRIVES for name, unit in places),
            *(Column(f"{drive}_voltage_{name}", "kV") for drive in DRIVES for name in segments))


def rows_of(matrix: Any) -> Any:
    """Convert an array to nested tuples."""
    values = np.asarray(matrix).tolist()
    return _tuples(values)


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values
