"""Capacitance against deflection, and deflection from capacitance, as stored results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import Key
from tympan.studies.case import SpecimenRecord, Unknowns, WallTime, Warnings
from tympan.studies.columns import write_sheet
from tympan.studies.files import remove, write_text
from tympan.studies.force.result import ForceLimit
from tympan.studies.sense.inverse import Inverse
from tympan.tables.columns import Column

#: Columns of the CSV: the table of the inverse, one row for each deflection and voltage.
COLUMNS: tuple[Column, ...] = (
    Column.labels("specimen"),
    Column("voltage", "kV"),
    Column("capacitance", "pF"),
    Column("displacement", "mm"),
    Column("force", "mN"),
    Column("tense"),
    Column("by_polynomial", "mm"),
    Column("per_capacitance", "mm_per_pF", required=False),
    Column("per_percent_prestretch", "mm", required=False),
    Column("per_percent_permittivity", "mm", required=False),
)


@dataclass(frozen=True, kw_only=True)
class SenseCurve:
    """The capacitance at one voltage; a number of each list for each deflection.

    The change of the sensed deflection is none where the capacitance does not rise.
    """

    voltage_V: Annotated[float, Key("nominal voltage")]
    displacement_m: Annotated[tuple[float, ...], Key("deflections of the plate, ascending")]
    capacitance_F: Annotated[tuple[float, ...], Key("capacitance of the film there, ascending")]
    force_N: Annotated[tuple[float, ...], Key("force that holds the plate there")]
    tense: Annotated[tuple[bool, ...], Key("whether no part of the film has lost tension")]
    per_capacitance_m_per_F: Annotated[tuple[float | None, ...], Key(
        "change of the sensed deflection by a capacitance read too large")]
    per_percent_prestretch_m: Annotated[tuple[float | None, ...], Key(
        "the same by a film that is prestretched 1 % more along both axes")]
    per_percent_permittivity_m: Annotated[tuple[float | None, ...], Key(
        "the same by a permittivity that is 1 % higher")]
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
    kinds = ("csv", "json", "c")
    drawn = ("png", "svg")

    curves: Annotated[tuple[SenseCurve, ...], Key("a curve for each voltage, ascending")]
    inverse: Annotated[Inverse, Key("deflection from capacitance and voltage")]
    table_error_m: Annotated[float, Key(
        "largest error of the table between its rows, straight in the root of the capacitance over "
        "its first")]
    states: Annotated[tuple[SensedState, ...], Key("equilibria under the loads")] = ()
    dofs: Unknowns
    wall_s: WallTime
    warnings: Warnings = ()

    def sensed(self, capacitance: Any, voltage: Any) -> Array:
        """Compute the deflection [m] from capacitances [F] and nominal voltages [V] by polynomial.

        It is NaN beyond the curves.
        """
        return self.inverse.deflection(capacitance, voltage)

    @property
    def table(self) -> dict[str, Array]:
        """Curves by the names of :data:`COLUMNS`, in SI."""
        names = {"capacitance": "capacitance_F", "displacement": "displacement_m",
                 "force": "force_N", "tense": "tense",
                 "per_capacitance": "per_capacitance_m_per_F",
                 "per_percent_prestretch": "per_percent_prestretch_m",
                 "per_percent_permittivity": "per_percent_permittivity_m"}
        rows = {name: np.concatenate([np.array(getattr(curve, key), float)
                                      for curve in self.curves]) for name, key in names.items()}
        rows["tense"] = rows["tense"].astype(bool)
        counts = [len(curve.force_N) for curve in self.curves]
        voltage = np.repeat([curve.voltage_V for curve in self.curves], counts)
        return {"specimen": np.full(sum(counts), self.specimen), "voltage": voltage, **rows,
                "by_polynomial": self.sensed(rows["capacitance"], voltage)}

    def save(self, folder: Path) -> None:
        """Write ``NAME-sense.json``, ``.csv`` and ``.c``, the polynomial as C99."""
        remove(folder, *(f"{self.specimen}-sense.{kind}" for kind in self.kinds))
        super().save(folder)
        write_sheet(folder / f"{self.specimen}-sense.csv", COLUMNS, self.table)
        write_text(folder / f"{self.specimen}-sense.c", self.inverse.c_source(self.specimen))
