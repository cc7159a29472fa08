"""Deflection-voltage curves under several masses, up to the film's last limit."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import Key
from tympan.base.progress import Progress
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import (
    Band,
    Case,
    CaseResult,
    Limits,
    Settings,
    SpecimenRecord,
    UnknownCount,
    WallTime,
    Warnings,
    summaries,
    voltage_ramp,
)
from tympan.studies.columns import Column, as_written, read_own_sheet, write_sheet
from tympan.studies.limits.voltages import Rise, StrokeToLimit, rise
from tympan.studies.path import SMOOTH
from tympan.studies.rows import named_apart

#: Columns of a curve's CSV. ``asked`` is 1 at requested voltages and 0 at points on the way to the
#: limit. ``beyond`` is the most severe limit that the voltage exceeds, blank up to the first limit.
CURVES: tuple[Column, ...] = (
    Column("mass", "g"),
    Column("voltage", "kV"),
    Column("asked"),
    Column.labels("status"),
    Column("deflection", "mm", required=False),
    Column("stroke", "mm", required=False),
    Column("capacitance", "pF", required=False),
    Column("slack_share", required=False),
    Column("breakdown_margin", required=False),
    Column.labels("beyond", LIMIT_STATES, required=False),
)

#: Relative difference of equal masses: files have 12 digits.
_SAME = 1e-9


@dataclass(frozen=True, kw_only=True)
class MassCurve:
    """Curve under one mass: its limits and its stroke."""

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    limits: Annotated[Limits, Key("limits of the film under this mass")]
    stroke_m: StrokeToLimit = None
    band_voltage_V: Annotated[tuple[float, ...], Key(
        "voltages at which films made to the tolerances were solved; empty without these")] = ()
    band_deflection_m: Annotated[tuple[Band | None, ...], Key(
        "spread of their deflections there; none where more than 5 % of the films do not reach "
        "the voltage")] = ()

    @property
    def banded(self) -> tuple[tuple[float, Band], ...]:
        """Voltages [V] that have a band, with their bands."""
        both = zip(self.band_voltage_V, self.band_deflection_m, strict=True)
        return tuple((voltage, band) for voltage, band in both if band is not None)


@dataclass(frozen=True, kw_only=True)
class CurveResult(SpecimenRecord):
    """Curves of one specimen; ``table`` has the columns of :data:`CURVES`, in SI.

    The rows of a mass follow the film to its limit; then come the rows of the requested voltages.
    """

    ending = "-curve"
    writer = "tympan curve"
    indexed = ("specimen", "mass", "voltage")
    kinds = ("csv", "json")
    drawn = ("png", "svg")

    curves: Annotated[tuple[MassCurve, ...], Key("one curve for each mass")]
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings = ()
    table: Mapping[str, Array] = field(default_factory=dict, repr=False, compare=False)

    @property
    def rows(self) -> Mapping[str, Array]:
        """Table with a row for each voltage of each mass."""
        return self.table

    @property
    def key_numbers(self) -> dict[str, Any]:
        """Stroke and first limit under each mass."""
        found: dict[str, dict[str, Any]] = {}
        for each in self.curves:
            first = each.limits.limit
            found[f"{1e3 * each.mass_kg:.6g} g"] = {
                "stroke_m": each.stroke_m, **({} if first is None
                                              else {f"{first.kind}_V": first.voltage_V})}
        return {"specimen": self.specimen} | named_apart(found)

    def asked(self, mass: float) -> list[tuple[float, float | None, str]]:
        """List requested voltages [V] under a mass [kg], with the deflection [m] at each.

        The text is the label of the most severe limit that the voltage exceeds, or "". A deflection
        is None where there is no equilibrium.
        """
        rows = (self.table["asked"] == 1) & np.isclose(self.table["mass"], mass, rtol=_SAME)
        cells = (self.table[name][rows].tolist() for name in ("voltage", "deflection", "beyond"))
        return [(voltage, None if np.isnan(deflection) else deflection,
                 str(LIMIT_STATES[kind].label) if kind else "")
                for voltage, deflection, kind in zip(*cells, strict=True)]

    def save(self, folder: Path) -> None:
        """Write ``NAME-curve.csv`` and ``.json``."""
        super().save(folder)
        write_sheet(folder / f"{self.specimen}-curve.csv", CURVES, self.table)

    def as_stored(self) -> Self:
        """Round the result to the digits of its file."""
        return replace(self, table=as_written(CURVES, self.table))

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        result = super().load(folder, name)
        table = read_own_sheet(folder / f"{result.specimen}-curve.csv", CURVES)
        return replace(result, table=table)


def curve(specimen: Specimen, masses: Sequence[float], settings: Settings, rig: Rig = Rig(),
          voltages: Sequence[float] = (), progress: Progress = lambda words: None,
          beyond: bool = False) -> CurveResult:
    """Follow a film under each mass [kg] while its voltage rises to its limit.

    Each of the ``voltages`` [V] adds a row; beyond the limit the row has no values of the film.
    ``progress`` is called before each mass and at each voltage. ``beyond``: if a wrinkled film
    thins without bound, continue to the pull-in of a film that cannot wrinkle.
    """
    began = time.perf_counter()
    curves: list[MassCurve] = []
    cells: list[tuple[Any, ...]] = []
    dofs = 0
    for mass in masses:
        progress(f"{specimen.name}: {mass * 1e3:g} g")
        ascent = rise(Case(specimen, mass=mass, rig=rig), settings, beyond=beyond, step=SMOOTH)
        dofs = ascent.model.unknowns
        # The model changes where the film continues as one that cannot wrinkle.
        for model, way in groupby(zip(ascent.cases, ascent.stops, strict=True),
                                  lambda pair: pair[1].film.model):
            solved = ((case, Outcome("equilibrium", stop.film.point.solution))
                      for case, stop in way)
            cells += [_row(False, result, ascent)
                      for result, _ in summaries(model, solved, 0.0)]
        curves.append(MassCurve(mass_kg=mass, limits=ascent.limits, stroke_m=ascent.stroke))
        for result in _asked(ascent, mass, rig, voltages, settings):
            progress(f"{specimen.name}: {mass * 1e3:g} g, {result.voltage_V / 1e3:g} kV")
            cells.append(_row(True, result, ascent))
    heaviest = Case.greatest(specimen, masses, voltages, rig)
    table = {column.name: np.array([row[number] for row in cells],
                                   float if column.choices is None else str)
             for number, column in enumerate(CURVES)}
    return CurveResult(specimen=specimen.name, curves=tuple(curves), dofs=dofs,
                       wall_s=time.perf_counter() - began, warnings=heaviest.remarks, table=table)


def _row(asked: bool, result: CaseResult, ascent: Rise) -> tuple[Any, ...]:
    """Build the row of :data:`CURVES` for a result."""
    beyond = ascent.limits.beyond(result.voltage_V)
    stroke = (None if result.deflection_m is None or ascent.rest is None
              else result.deflection_m - ascent.rest)
    return (result.mass_kg, result.voltage_V, asked, result.status, result.deflection_m, stroke,
            result.capacitance_F, result.slack_share, result.breakdown_margin,
            beyond.kind if beyond else "")


def _asked(ascent: Rise, mass: float, rig: Rig, voltages: Sequence[float], settings: Settings
           ) -> Iterator[CaseResult]:
    """Yield results at the requested voltages; none is solved beyond the film's end."""
    model, end = ascent.model, ascent.limits.end
    highest = np.inf if end is None else end.voltage_V
    within = [voltage for voltage in voltages if voltage <= highest]
    for result, _ in summaries(model, voltage_ramp(model, mass, within, rig, settings.path),
                               0.0):
        yield result
    for voltage in voltages[len(within):]:
        yield CaseResult(specimen=model.specimen.name, mass_kg=mass, voltage_V=voltage,
                         status="no_equilibrium", limit=end, dofs=model.unknowns, wall_s=0.0,
                         warnings=(ascent.limits.ended, *rig.remarks))
