"""A sweep's table for its page: keys that vary, results, and units that people write."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import xarray as xr

from tympan.base.units import BENCH, DIMENSIONS, unit_factor
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.studies.sweep.asked import QUESTIONS
from tympan.studies.sweep.plan import voltage_of
from tympan.studies.sweep.run import SweepResult
from tympan.studies.sweep.table import LOAD_UNITS, beyond_limits


@dataclass(frozen=True)
class Measure:
    """A column of the table: its name there, its label, its unit, and the SI value of the unit."""

    name: str
    label: str
    unit: str
    size: float

    @classmethod
    def of(cls, array: xr.DataArray) -> Measure:
        """Describe a coordinate, or a result, whose name ends with its unit."""
        name, si = str(array.name), array.attrs.get("units")
        for key, dimension in DIMENSIONS.items():
            if dimension.si == si:
                unit, factor = BENCH.get(si, (dimension.symbol, 1.0))
                size = 1 / factor
                if dimension.usual:
                    unit = dimension.usual[0]
                    size = unit_factor(unit, key)
                label = name.removesuffix(dimension.suffix)
                return cls(name, label if "." in name else label.replace("_", " "), unit, size)
        return cls(name, name if "." in name else name.replace("_", " "), "", 1.0)

    @property
    def heading(self) -> str:
        """The label with the unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def text(self, value: object) -> str:
        """Write a value with its unit."""
        return (f"{value / self.size:.4g} {self.unit}".strip()
                if isinstance(value, float) else str(value))


@dataclass(frozen=True, eq=False)
class SweepView:
    """A sweep's result, finished or not, at one voltage: ``at``, else the result's own choice."""

    result: SweepResult
    at: float | str | None = None

    @cached_property
    def table(self) -> xr.Dataset:
        return self.result.table

    @cached_property
    def shown(self) -> dict[str, float]:
        """Mass and voltage of the results shown: the first mass, the chosen voltage."""
        values = {load: float(self.table[load][0]) for load in self.loads}
        if "voltage" in values:
            chosen = self.result.at_V if self.at is None else self.at
            values["voltage"] = voltage_of(self.table["voltage"].values.tolist(), chosen)
        return values

    def shown_words(self, *loads: str) -> str:
        """Write these of the loads of the results shown."""
        return ", ".join(Measure.of(self.table[load]).text(self.shown[load]) for load in loads)

    @property
    def name(self) -> str:
        """Name of the specimens' material."""
        return ", ".join(dict.fromkeys(map(str, self.table["base"].values.tolist())))

    @cached_property
    def keys(self) -> tuple[Measure, ...]:
        """Keys that differ between cases."""
        table, axes = self.table, self.table["status"].dims
        names = [name for name, values in table.coords.items() if len(values.dims) == 1
                 and name != "specimen" and (values.dims == ("specimen",) or name in axes)]
        return tuple(Measure.of(table[name]) for name in names
                     if len(pd.unique(table[name].values)) > 1)

    @cached_property
    def loads(self) -> tuple[str, ...]:
        """Mass and voltage, if they are the same for all specimens."""
        return tuple(load for load in LOAD_UNITS if load in self.table.dims)

    @cached_property
    def columns(self) -> tuple[Measure, ...]:
        """Results that have values to map."""
        names = ["deflection_m", "stroke_m", "breakdown_margin", *(
            name for quantity in QUESTIONS.known.values() for name in quantity.shown)]
        return tuple(Measure.of(self.table[name]) for name in names
                     if name in self.table and bool(np.isfinite(self.table[name]).any()))

    @cached_property
    def explained(self) -> list[tuple[str, list[tuple[str, str]]]]:
        """Meanings of the quantities wanted, each with headings and meanings of its columns."""
        headings = {column.name: column.heading for column in self.columns}
        found = [(quantity.meaning.replace("`", ""),
                  [(headings[name], quantity.meaning_of(name)) for name in quantity.shown
                   if name in headings]) for quantity in QUESTIONS.known.values()]
        return [(meaning, columns) for meaning, columns in found if columns]

    @cached_property
    def beyond(self) -> dict[str, list[bool]]:
        """Cases beyond each limit, by its label, at their voltage or before."""
        return {LIMIT_STATES[limit].label: cases.values.ravel().tolist()
                for limit, cases in beyond_limits(self.table).items()}

    @cached_property
    def rows(self) -> pd.DataFrame:
        """Rows of the table, one per case; ``label`` names its specimen."""
        axes = [str(axis) for axis in self.table["status"].dims]
        rows = self.table.to_dataframe(dim_order=axes).reset_index()
        varied = [axis for axis in axes if axis not in ("specimen", *LOAD_UNITS)]
        grid = [Measure.of(self.table[axis]) for axis in varied]
        values = zip(*(rows[key.name].map(key.text) for key in grid), strict=True)
        labels = [f"{name} ({', '.join(those)})" for name, those in zip(
            rows["specimen"], values, strict=True)] if grid else rows["specimen"]
        return rows.assign(label=labels, beyond=[", ".join(
            limit for limit, fails in self.beyond.items() if fails[number])
            for number in range(len(rows))])

    def at_shown(self, *loads: str) -> pd.DataFrame:
        """Select the rows under these of the loads shown."""
        rows = self.rows
        for load in set(loads) & set(self.loads):
            rows = rows[rows[load] == self.shown[load]]
        return rows
