"""Tests of strips and sheets of a film: coupon.csv."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import AnyArray, Array, Mask, Numbers
from tympan.base.errors import InputError
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.base.units import unit_factor
from tympan.studies.columns import Column, Sheet, read_sheet
from tympan.tables.layouts import Layout, Stated
from tympan.tables.meanings import (
    RUNS,
    SET_VOLTAGES,
    SPECIMENS,
    STRESSES,
    STRETCHES,
    TEMPERATURES,
    TIMES,
    VOLTAGES,
)

#: The second in-plane stretch of each mode as a power of the first.
MODES = {"uniaxial": -0.5, "equibiaxial": 1.0, "pure_shear": 0.0}
#: Name of a file that ends with the mode of its tests.
OF_MODE = re.compile(rf"(?P<specimen>.*?)[_ -]*(?P<mode>{'|'.join(MODES)})", re.IGNORECASE)
_STRETCH: Rule = (lambda x: 0.05 <= x <= 20, "must be a stretch from 0.05 to 20")
_STRESS: Rule = (lambda x: abs(x) <= 1e12, "must be within 1e9 kPa")
_VOLTAGE: Rule = (lambda x: 0 <= x <= 1e6, "must be from 0 to 1000 kV; the film's pull has no "
                                            "sign: write voltages without one")
_CELSIUS: Rule = (lambda x: -200 <= x <= 500, "must be from -200 to 500 degrees Celsius")

#: Temperature at which material constants are stated, assumed for coupons without one [°C].
USUAL_CELSIUS = 20.0

#: The columns of coupon.csv. ``voltage`` is on the film, ``sigma`` the standard deviation of the
#: stress.
COLUMNS: tuple[Column, ...] = (
    Column.labels("mode", tuple(MODES)),
    Column("stretch", rule=_STRETCH, also=STRETCHES),
    Column("nominal_stress", "kPa", _STRESS, also=STRESSES),
    Column.labels("specimen", required=False, also=SPECIMENS),
    Column("t", "s", required=False, also=(TIMES,)),
    Column.labels("run", required=False, also=RUNS),
    Column("voltage", "kV", _VOLTAGE, required=False, also=(SET_VOLTAGES, VOLTAGES)),
    Column("temperature_C", rule=_CELSIUS, required=False, also=(TEMPERATURES,)),
    Column("sigma", "kPa", POSITIVE, required=False),
)
#: Attributes that are None where a file does not have the column.
_OPTIONAL = {"voltage": "voltage", "celsius": "temperature_C", "sigma": "sigma"}


@dataclass(frozen=True, eq=False)
class Coupons:
    """Readings of coupon tests, one entry each: mode, stretch, nominal stress [Pa].

    Nominal stress is force over virgin cross-section; in equibiaxial tests it is that of one axis.
    ``time`` [s] is nan, ``specimen`` and ``run`` are "" where not given. ``voltage`` [V] on the
    film, ``celsius`` [°C] of the film and ``sigma`` [Pa], standard deviation of the stress, are
    None where a file has no such column, nan where a cell is blank.
    """

    mode: NDArray[np.str_]
    stretch: Array
    stress: Array
    specimen: NDArray[np.str_]
    run: NDArray[np.str_]
    time: Array
    voltage: Array | None = None
    celsius: Array | None = None
    sigma: Array | None = None
    #: Lines of the readings in their files, if there are files.
    lines: Numbers | None = None
    #: Names of the files of the readings.
    files: NDArray[np.str_] | None = None
    #: Remarks on headings of the files that were read as one of these columns, if they differ.
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, sheet: Sheet) -> Coupons:
        """Build the readings of a file with the columns of :data:`COLUMNS`."""
        more = {name: sheet[column] if np.isfinite(sheet[column]).any() else None
                for name, column in _OPTIONAL.items()}
        return cls(mode=sheet["mode"], stretch=sheet["stretch"], stress=sheet["nominal_stress"],
                   specimen=sheet["specimen"], run=sheet["run"], time=sheet["t"], **more,
                   lines=sheet.line, files=np.full(len(sheet), sheet.file.name),
                   remarks=sheet.remarks)

    def __len__(self) -> int:
        return len(self.stretch)

    def __getitem__(self, choice: Any) -> Coupons:
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return replace(self, **{name: value[choice] for name, value in values.items()
                                if isinstance(value, np.ndarray)})

    @classmethod
    def joined(cls, parts: Sequence[Coupons]) -> Coupons:
        """Join the readings of several files."""
        if len(parts) == 1:
            return parts[0]
        every = {item.name: [getattr(part, item.name) for part in parts] for item in fields(cls)
                 if item.name != "remarks"}
        columns: dict[str, Any] = {
            name: np.concatenate([np.full(len(part), np.nan) if value is None else value
                                  for part, value in zip(parts, values, strict=True)])
            for name, values in every.items() if any(value is not None for value in values)}
        return cls(**columns, remarks=sum((part.remarks for part in parts), ()))

    @property
    def columns(self) -> dict[str, AnyArray]:
        """The readings by the columns of :data:`COLUMNS`."""
        none = np.full(len(self), np.nan)
        more = {column: getattr(self, name) for name, column in _OPTIONAL.items()}
        return {"mode": self.mode, "stretch": self.stretch, "nominal_stress": self.stress,
                "specimen": self.specimen, "t": self.time, "run": self.run,
                **{name: none if values is None else values for name, values in more.items()}}

    @property
    def line(self) -> Numbers:
        """Line of each reading in its file, 0 where there is no file."""
        return np.zeros(len(self), np.int64) if self.lines is None else self.lines

    @property
    def file(self) -> NDArray[np.str_]:
        """Name of the file of each reading."""
        return np.full(len(self), "coupon.csv") if self.files is None else self.files

    @property
    def volts(self) -> Array:
        """Voltage on the film [V], 0 where none is given."""
        none = np.zeros(len(self))
        return none if self.voltage is None else np.nan_to_num(self.voltage)

    @property
    def degrees(self) -> Array:
        """Temperature [°C], :data:`USUAL_CELSIUS` where none is given."""
        usual = np.full(len(self), USUAL_CELSIUS)
        return usual if self.celsius is None else np.where(
            np.isnan(self.celsius), USUAL_CELSIUS, self.celsius)

    @property
    def modes(self) -> tuple[str, ...]:
        return tuple(mode for mode in MODES if mode in self.mode)

    @cached_property
    def in_plane(self) -> tuple[Array, Array]:
        """λ₁ along the test and λ₂ across it."""
        powers = np.array([MODES[mode] for mode in self.mode])
        return self.stretch, self.stretch**powers

    @cached_property
    def series(self) -> dict[str, Numbers]:
        """Numbers of the readings of each run, by specimen and run."""
        names = np.array([" ".join(filter(None, pair)) for pair in
                          zip(self.specimen.tolist(), self.run.tolist(), strict=True)])
        return {name: np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())}

    @cached_property
    def timed_runs(self) -> dict[str, Numbers]:
        """Numbers of the readings of each run that has times, in order, by specimen and run.

        Raises
        ------
        InputError
            Where times are negative or do not ascend within a run, or it changes its mode.
        """
        timed = np.isfinite(self.time)
        runs = {name: part[timed[part]] for name, part in self.series.items()}
        runs = {name: part for name, part in runs.items() if len(part)}
        for name, run in runs.items():
            time = self.time[run]
            if (np.diff(time) < 0).any() or time[0] < 0:
                raise InputError("must not be negative, and ascend within a run, which "
                                 "specimen and run name", key="t_s",
                                 given=f"run {name!r}")
            if len(set(self.mode[run].tolist())) > 1:
                raise InputError("must be the same in all readings of a run, which specimen "
                                 "and run name", key="mode",
                                 given=f"run {name!r}")
        return runs

    def thinned(self, most: int = 150) -> Coupons:
        """Thin each timed run to about ``most`` readings, and keep all other readings.

        Two thirds of them are evenly spaced. The others are where the stretch deviates most from
        linear interpolation in time, down to 0.5 % of its range.
        """
        kept = np.ones(len(self), bool)
        for run in self.timed_runs.values():
            if len(run) > most:
                kept[run] = False
                kept[run[_corners(self.time[run], self.stretch[run], most)]] = True
        return self if kept.all() else self[kept]

    @property
    def in_time(self) -> bool:
        """Whether some run has readings at several times."""
        return any(np.ptp(self.time[run]) > 0 for run in self.timed_runs.values())

    @property
    def stretch_range(self) -> tuple[float, float]:
        """Smallest and largest principal stretch of the tests, with thickness and virgin state."""
        l1, l2 = self.in_plane
        every = np.concatenate([l1, l2, 1 / (l1 * l2), [1.0]])
        return float(every.min()), float(every.max())


def _corners(time: Array, stretch: Array, most: int) -> Mask:
    """Select points of a history to keep; see :meth:`Coupons.thinned`."""
    kept = np.zeros(len(time), bool)
    kept[np.linspace(0, len(time) - 1, 2 * most // 3).round().astype(int)] = True
    for _ in range(most // 3):
        off = np.abs(np.interp(time, time[kept], stretch[kept]) - stretch)
        off[kept] = 0
        if off.max() <= 0.005 * np.ptp(stretch):
            break
        kept[off.argmax()] = True
    return kept


def read_coupons(*files: Path | str, layout: Layout = Layout()) -> Coupons:
    """Read files with the columns of :data:`COLUMNS`, in any of the formats.

    ``layout`` adds what the headings of a file do not state, such as the length of the strip. A
    mode at the end of a file's name holds for its readings where they do not state one.
    """
    return Coupons.joined([Coupons.of(read_sheet(file, COLUMNS, layout=layout,
                                                 usual=named_mode(Path(file)))) for file in files])


def coupon_layout(mode: str | None = None, unit: str | None = None,
                  area: float | str | None = None, length: float | str | None = None,
                  decimal: Literal[",", "."] | None = None) -> Layout:
    """Build the layout of a table from what its headings do not state.

    ``unit`` is that of stresses; ``area`` and ``length`` are the strip's before the test.
    """
    if mode is not None and mode not in MODES:
        raise InputError(f"must be one of {', '.join(MODES)}", key="mode", given=mode)
    if unit is not None:
        try:
            unit_factor(unit, "stress")
        except InputError as error:
            raise error.located(key="unit") from None
    return Layout(area=area, length=length, decimal=decimal, unit=unit or "",  # type: ignore[arg-type]
                  columns=() if mode is None else (Stated("mode", value=mode),))


def named_mode(file: Path) -> dict[str, str]:
    """Find the mode that a file's name ends with, if any."""
    match = OF_MODE.fullmatch(file.stem)
    return {"mode": match["mode"].lower()} if match else {}
