"""Capacitance against deflection, and deflection from capacitance, as stored results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.studies.case import SpecimenRecord, UnknownCount, WallTime, Warnings
from tympan.studies.columns import write_rows
from tympan.studies.files import remove, write_text
from tympan.studies.force.result import ForceLimit
from tympan.studies.rows import column_of_part, rows_in
from tympan.studies.sense.inverse import Inverse
from tympan.studies.sense.plate import PlateSense


@dataclass(frozen=True, kw_only=True)
class SenseCurve:
    """The capacitance at one voltage; a number of each list for each deflection.

    The change of the sensed deflection is none where the capacitance does not rise.
    """

    voltage_V: Annotated[float, Key("nominal voltage")]
    capacitance_F: Annotated[tuple[float, ...], Key("capacitance of the film, ascending")]
    displacement_m: Annotated[tuple[float, ...], Key("deflections of the plate there, ascending")]
    force_N: Annotated[tuple[float, ...], Key("force that holds the plate there")]
    tense: Annotated[tuple[bool, ...], Key("whether no part of the film has lost tension")]
    per_capacitance_m_per_F: Annotated[tuple[float | None, ...], Key(
        "change of the sensed deflection by a capacitance read too large")]
    per_percent_prestretch_m: Annotated[tuple[float | None, ...], Key(
        "the same by a film that is prestretched 1 % more along both axes")]
    per_percent_permittivity_m: Annotated[tuple[float | None, ...], Key(
        "the same by a permittivity that is 1 % higher")]
    segment_capacitances_F: Annotated[Mapping[str, tuple[float, ...]], Key(
        "capacitance of each segment of the electrode there, by its name: charge over its own "
        "voltage; empty for an electrode in one piece")] = field(default_factory=dict)
    ended: Annotated[ForceLimit | None, Key(
        "where the film ends before the last deflection; none where it reaches that")]


@dataclass(frozen=True, kw_only=True)
class SensedState:
    """An equilibrium under a load at a voltage."""

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    voltage_V: Annotated[float, Key("nominal voltage")]
    displacement_m: Annotated[float, Key("deflection")]
    capacitance_F: Annotated[float, Key("capacitance there")]
    sensed_m: Annotated[float | None, Key(
        "deflection that the polynomial tells from it; none beyond its range")]


@dataclass(frozen=True, kw_only=True)
class SenseResult(SpecimenRecord):
    """Capacitance against deflection of one specimen, and the inverse, SI."""

    ending = "-sense"
    writer = "tympan sense"
    indexed = ("voltage_V", "displacement_m")
    kinds = ("csv", "json", "c")
    drawn = ("png", "svg")

    curves: Annotated[tuple[SenseCurve, ...], Key("a curve for each voltage, ascending")]
    inverse: Annotated[Inverse, Key("deflection from capacitance and voltage")]
    table_error_m: Annotated[float, Key(
        "largest error of the table between its rows, straight in the root of the capacitance over "
        "its first")]
    states: Annotated[tuple[SensedState, ...], Key("equilibria under the loads")] = ()
    plates: Annotated[tuple[PlateSense, ...], Key(
        "deflection and tilts from the capacitances of segments, at each voltage; empty without "
        "three segments")] = ()
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings = ()

    def sensed(self, capacitance: Any, voltage: Any) -> Array:
        """Compute the deflection [m] from capacitances [F] and nominal voltages [V] by polynomial.

        It is NaN beyond the curves.
        """
        return self.inverse.deflection(capacitance, voltage)

    def sensed_plate(self, capacitances: Mapping[str, Any], voltage: float) -> dict[str, Array]:
        """Sense the plate from the capacitances of segments [F] by their names, at a voltage [V].

        The result has ``deflection_m``, ``tilt_x_rad`` and ``tilt_y_rad``, which are NaN beyond the
        range.

        Raises
        ------
        InputError
            When the voltage is none of those that were solved, or a capacitance is missing.
        """
        plate = next((each for each in self.plates if np.isclose(each.voltage_V, voltage)), None)
        if plate is None:
            known = ", ".join(f"{each.voltage_V:g} V" for each in self.plates) or "none"
            raise InputError(f"must be one of the solved voltages: {known}", key="voltage",
                             given=f"{voltage:g} V")
        for name in plate.segments:
            if name not in capacitances:
                raise InputError(f"must have the capacitance of {name}", key="capacitances",
                                 given=", ".join(capacitances))
        given = np.stack(np.broadcast_arrays(*(capacitances[name] for name in plate.segments)), -1)
        found = plate.sensed(given.reshape(-1, len(plate.segments))).reshape(*given.shape[:-1], 3)
        return dict(zip(("deflection_m", "tilt_x_rad", "tilt_y_rad"), np.moveaxis(found, -1, 0),
                        strict=True))

    @property
    def rows(self) -> dict[str, Array]:
        """The curves, a row for each deflection, with what the polynomial makes of each."""
        found = rows_in(self.curves, specimen=self.specimen)
        sensed = self.sensed(found["capacitance_F"], found["voltage_V"])
        rows: dict[str, Array] = {}
        found |= {column_of_part("capacitance_F", name): np.concatenate(
            [curve.segment_capacitances_F[name] for curve in self.curves])
            for name in self.curves[0].segment_capacitances_F}
        for name, values in found.items():
            rows[name] = values
            if name == "tense":
                rows["by_polynomial_m"] = sensed
        return rows

    def save(self, folder: Path) -> None:
        """Write ``NAME-sense.json``, ``.csv`` and ``.c``, the polynomial as C99."""
        remove(folder, *(f"{self.specimen}-sense.{kind}" for kind in self.kinds))
        super().save(folder)
        write_rows(folder / f"{self.specimen}-sense.csv", self.rows)
        write_text(folder / f"{self.specimen}-sense.c", self.inverse.c_source(self.specimen))
