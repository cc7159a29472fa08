"""Trace of a film along time, by any model: moments and their numbers, saved and loaded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, write
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_content, toml
from tympan.fem.transient.ends import MotionStatus
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Warnings
from tympan.studies.columns import (
    Column,
    as_written,
    column_of,
    read_own_sheet,
    write_rows,
    write_sheet,
)
from tympan.studies.files import from_json, read_json, remove, to_json, write_json, write_text
from tympan.studies.film_surface import FilmSurface, save_series
from tympan.studies.rows import named_apart
from tympan.studies.signals import Signal
from tympan.studies.variables import VARIABLES

#: Largest drift of a closed loop, over its range: less cannot be seen in a figure.
_CLOSED = 0.01
#: Share of its largest swing below which an oscillation has settled.
_SETTLED = 0.05
#: Most samples of one file: with its nine columns it stays within the limits of a table.
_MOST = 1_000_000
#: Time of the sample at rest before a jump at time 0, over the interval of samples.
_EARLY = 1e-3

_COLUMNS = (Column.labels("specimen"), Column("mass", "g"), Column.labels("run"),
            Column("t", "s"), Column("voltage", "kV"), Column("displacement", "mm"),
            Column("rest", "s", required=False), Column("film_voltage", "kV", required=False),
            Column("current", "uA", required=False))
_LOOP_COLUMNS = (Column.labels("specimen"), Column("voltage", "kV"), Column("deflection", "mm"))


#: File of the variables of states, beside transient.csv.
_STATES = "states.csv"


def _read_states(file: Path) -> pd.DataFrame:
    """Read a file of states as :func:`write_rows` wrote it; columns of no variable are dropped."""
    columns = {key: column_of(key) for key in ("t_s", *VARIABLES)}
    there = pd.read_csv(file)
    found = {key: column.factor(column.title) * there[column.title]
             for key, column in columns.items() if column.title in there}
    return pd.DataFrame({"specimen": there["specimen"].astype(str)} | found)


def unclosed(loop: pd.DataFrame) -> list[str]:
    """Warn where a loop does not close."""
    y = loop["deflection"].to_numpy()
    if abs(y[-1] - y[0]) <= _CLOSED * np.ptp(y):
        return []
    return [f"the last period ends {1e6 * (y[-1] - y[0]):+.3g} um from where it began: the film "
            "still creeps; more periods (--count) close the loop"]


def settling_time(time: Array, deflection: Array) -> float:
    """Find the time [s] of the last oscillation above 5 % of the largest swing.

    It is counted from time[0]; nan where there is no oscillation, or it has not settled yet. An
    oscillation is about the slow motion through the midpoints of neighbouring extremes, as one
    would draw it by eye: the membrane continues to creep long after the oscillation has died away.
    """
    turning = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) != 0) + 1
    if len(turning) < 3:
        return float("nan")
    heights, times = deflection[turning], time[turning]
    swing = np.abs(np.diff(heights)) / 2
    if swing.max() < 1e-9 * np.abs(deflection).max():
        return float("nan")
    large = np.flatnonzero(swing > _SETTLED * swing.max())
    if large[-1] == len(swing) - 1 and time[-1] - times[-1] < 2 * (times[-1] - times[-2]):
        return float("nan")
    return float((times[large[-1]] + times[large[-1] + 1]) / 2 - time[0])


def sample_count(end: float, interval: float, runs: int = 1) -> int:
    """Count the samples of a response up to ``end``, with an interval [s].

    An :class:`InputError` where ``runs`` responses have more than a million samples.
    """
    if runs * end / interval > _MOST:
        raise InputError(f"would give more than {_MOST} samples", key="--interval",
                         given=f"{interval:g} s")
    return max(2, round(end / interval) + 1)


def with_rest(signal: Signal, time: Array, voltage: Array, deflection: Array, before: float
              ) -> tuple[Array, Array, Array]:
    """Prepend a sample at rest to times [s], voltages [V] and deflections [m] where it is missing.

    A run of a dataset begins at rest under its first voltage. Where the signal jumps at time 0, its
    first sample is already after the jump. Then a sample at rest is put in front: ``before`` [m].
    """
    if voltage[0] == signal.first:
        return time, voltage, deflection
    early = time[0] - _EARLY * (time[1] - time[0])
    return (np.append(early, time), np.append(signal.first, voltage),
            np.append(before, deflection))


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Response of a film to a signal, from any model.

    ``samples`` has the columns of transient.csv in SI units, as the rig's sensor shows them.
    ``loop`` is the last period of a periodic signal, with the columns of hysteresis.csv. ``films``
    holds surfaces by time. ``states`` has the columns ``specimen``, ``t_s`` and the keys of the
    :data:`~tympan.studies.variables.VARIABLES` of states at the samples, in SI, where they were
    asked for.
    """

    file: ClassVar[str]
    writer: ClassVar[str]
    #: File types of moving pictures of the response.
    drawn: ClassVar[tuple[str, ...]] = ()

    specimen: Annotated[str, Key("name of the specimen")]
    mass_kg: Annotated[float, Key("nominal load on the plate")]
    status: Annotated[MotionStatus, Key(
        "why it ended: the signal did, or what the film did before")]
    first_voltage_V: Annotated[float, Key("voltage with which the signal begins")]
    first_m: Annotated[float, Key("deflection at its beginning")]
    last_m: Annotated[float, Key("deflection at its end")]
    lowest_m: Annotated[float, Key("smallest deflection, between steps too")]
    highest_m: Annotated[float, Key("largest deflection, between steps too")]
    range_m: Annotated[float, Key("difference of the largest and the smallest")]
    settling_time_s: Annotated[float | None, Key("of a step: until the oscillation is gone")]
    hysteresis_area_V_m: Annotated[float | None, Key("area of the last loop, of a signal that "
                                                     "repeats")]
    warnings: Warnings
    samples: pd.DataFrame = field(default_factory=pd.DataFrame, repr=False, compare=False)
    loop: pd.DataFrame | None = field(default=None, repr=False, compare=False)
    films: Mapping[float, FilmSurface] = field(default_factory=dict, repr=False, compare=False)
    states: pd.DataFrame | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, signal: Signal, when: Array, deflection: Array, low: float, high: float,
           settles: bool, **others: Any) -> Self:
        """Make the response from deflections at times [s] and its extremes [m].

        ``settles``: an oscillation decays after the signal. ``others``: all other fields.
        """
        settled = settling_time(when, deflection) if settles else np.nan
        return cls(first_voltage_V=signal.first, first_m=float(deflection[0]),
                   last_m=float(deflection[-1]), lowest_m=low, highest_m=high, range_m=high - low,
                   settling_time_s=settled if np.isfinite(settled) else None, **others)

    @classmethod
    def load(cls, folder: Path) -> Responses:
        """Load a saved response; a missing, damaged or wrong file is an InputError."""
        file = folder / cls.file
        content = read_json(file)
        if not isinstance(content, dict) or not content.get("responses"):
            raise InputError(f"is not of {cls.writer}: run it again", file=file)
        samples = pd.DataFrame(read_own_sheet(folder / "transient.csv", _COLUMNS)).dropna(
            axis="columns", how="all")
        loops: dict[Any, pd.DataFrame] = {}
        if (folder / "hysteresis.csv").exists():
            periods = pd.DataFrame(read_own_sheet(folder / "hysteresis.csv", _LOOP_COLUMNS))
            loops = dict(iter(periods.groupby("specimen")))
        states: dict[Any, pd.DataFrame] = {}
        if (folder / _STATES).exists():
            states = dict(iter(_read_states(folder / _STATES).groupby("specimen")))
        listed = from_json(tuple[Any, ...], content["responses"], file, "responses")
        numbers = (from_json(cls, item, file, f"responses[{place}]")
                   for place, item in enumerate(listed))
        return Responses(tuple(
            replace(response, samples=samples[samples["specimen"] == response.specimen],
                    loop=loops.get(response.specimen), states=states.get(response.specimen))
            for response in numbers))


@dataclass(frozen=True, eq=False)
class Responses:
    """Responses of one actuator each, all to the same signal and from the same command.

    With ``specimens``, on a ``rig``, the saved files are a dataset.
    """

    responses: tuple[Response, ...]
    specimens: Sequence[Specimen] = ()
    rig: Rig = Rig()

    @property
    def rows(self) -> pd.DataFrame:
        """Samples of all responses."""
        samples = pd.concat([response.samples for response in self.responses], ignore_index=True)
        return samples.rename(columns={"mass": "mass_kg", "t": "t_s", "voltage": "voltage_V",
                                       "displacement": "displacement_m"})

    @property
    def key_numbers(self) -> dict[str, Any]:
        """Deflections, and times and areas that a response has, of each film."""
        names = ("status", "first_m", "last_m", "lowest_m", "highest_m", "stroke_m",
                 "settling_time_s", "hysteresis_area_V_m")
        return named_apart({response.specimen: {name: getattr(response, name, None)
                                                for name in names}
                            for response in self.responses})

    @property
    def films(self) -> tuple[Mapping[float, FilmSurface], ...]:
        """Surfaces of each film by time [s]."""
        return tuple(response.films for response in self.responses)

    @property
    def pictures(self) -> tuple[str, ...]:
        """File names of the moving pictures of the responses."""
        return tuple(f"{response.specimen}.{kind}" for response in self.responses
                     for kind in response.drawn)

    def json(self) -> dict[str, Any]:
        """Convert the responses to a JSON object, without samples."""
        return {"responses": to_json(self.responses)}

    def save(self, folder: Path) -> None:
        """Write the numbers, transient.csv, dataset.toml, and for loops hysteresis.csv.

        Films are written as a VTK series NAME.pvd. The numbers are written last, so their presence
        means that the other files are complete.
        """
        first = self.responses[0]
        for response in self.responses:
            if response.drawn:
                save_series(folder, response.specimen, list(response.films.items()))
        remove(folder, first.file, "hysteresis.csv", _STATES)
        samples = pd.concat([response.samples for response in self.responses])
        write_sheet(folder / "transient.csv",
                    [column for column in _COLUMNS if column.name in samples], samples)
        loops = [response.loop.assign(specimen=response.specimen) for response in self.responses
                 if response.loop is not None]
        if loops:
            write_sheet(folder / "hysteresis.csv", _LOOP_COLUMNS, pd.concat(loops))
        states = [response.states for response in self.responses if response.states is not None]
        if states:
            write_rows(folder / _STATES, pd.concat(states).to_dict("series"))
        if self.specimens:
            with suppress(InputError):  # an existing dataset stays as it is
                write_text(folder / "dataset.toml", toml({
                    "name": "simulated", "source": first.writer, "rig": write(self.rig),
                    "specimen": [specimen_content(specimen) for specimen in self.specimens]}))
        write_json(folder / first.file, self.json())

    def as_stored(self) -> Responses:
        """Round the result to the digits of its files."""
        return replace(self, responses=tuple(
            replace(response, samples=_as_written(response.samples, _COLUMNS),
                    loop=None if response.loop is None
                    else _as_written(response.loop, _LOOP_COLUMNS))
            for response in self.responses))


def _as_written(table: pd.DataFrame, columns: Sequence[Column]) -> pd.DataFrame:
    there = [column for column in columns if column.name in table]
    return pd.DataFrame(as_written(there, table))
