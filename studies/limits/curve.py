"""Deflection-voltage curves under several masses, up to the film's last limit."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, product
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np

from tympan.base.arrays import Array, Mask
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
from tympan.studies.driven import in_proportion
from tympan.studies.limits.voltages import Rise, StrokeToLimit, rise
from tympan.studies.path import SMOOTH
from tympan.studies.rows import named_apart
from tympan.studies.segments import share_words

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

#: Columns of the segments of an electrode stand behind this one.
_DRIVEN = "voltage"

#: Relative difference of equal masses: files have 12 digits.
_SAME = 1e-9


@dataclass(frozen=True, kw_only=True)
class MassCurve:
    """Curve under one mass, in one proportion of the segments' voltages: limits and stroke."""

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    segment_shares: Annotated[Mapping[str, float], Key(
        "voltages of the segments over that of the film, by their names; empty for an electrode in "
        "one piece")] = field(default_factory=dict)
    limits: Annotated[Limits, Key("limits of the film under this mass")]
    stroke_m: StrokeToLimit = None
    band_voltage_V: Annotated[tuple[float, ...], Key(
        "voltages at which films made to the tolerances were solved; empty without these")] = ()
    band_deflection_m: Annotated[tuple[Band | None, ...], Key(
        "spread of their deflections there; none where more than 5 % of the films do not reach "
        "the voltage")] = ()

    @property
    def drive(self) -> str:
        """Proportion of the segments' voltages, where they differ: "A 100 %, B 50 %"; else ""."""
        return share_words(self.segment_shares)

    @property
    def load(self) -> str:
        """Mass, and the proportion of the segments' voltages where they differ."""
        return ", ".join(filter(None, (f"{1e3 * self.mass_kg:.6g} g", self.drive)))

    @property
    def banded(self) -> tuple[tuple[float, Band], ...]:
        """Voltages [V] that have a band, with their bands."""
        both = zip(self.band_voltage_V, self.band_deflection_m, strict=True)
        return tuple((voltage, band) for voltage, band in both if band is not None)


@dataclass(frozen=True, kw_only=True)
class CurveResult(SpecimenRecord):
    """Curves of one specimen; ``table`` has the columns of :func:`curve_columns`, in SI.

    The rows of a curve follow the film to its limit; then come the rows of the requested voltages.
    """

    ending = "-curve"
    writer = "tympan curve"
    indexed = ("specimen", "mass", "voltage")
    kinds = ("csv", "json")
    drawn = ("png", "svg")

    curves: Annotated[tuple[MassCurve, ...], Key(
        "one curve for each mass and proportion of the segments' voltages")]
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
            found[each.load] = {
                "stroke_m": each.stroke_m, **({} if first is None
                                              else {f"{first.kind}_V": first.voltage_V})}
        return {"specimen": self.specimen} | named_apart(found)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the table."""
        return curve_columns(self.curves)

    def rows_of(self, curve: MassCurve) -> Mask:
        """Find the rows of a curve."""
        rows: Mask = np.isclose(self.table["mass"], curve.mass_kg, rtol=_SAME)
        return rows & (self.table["drive"] == curve.drive) if curve.segment_shares else rows

    def asked(self, curve: MassCurve) -> list[tuple[float, float | None, str]]:
        """List requested voltages [V] of a curve, with the deflection [m] at each.

        The text is the label of the most severe limit that the voltage exceeds, or "". A deflection
        is None where there is no equilibrium.
        """
        rows = (self.table["asked"] == 1) & self.rows_of(curve)
        cells = (self.table[name][rows].tolist() for name in ("voltage", "deflection", "beyond"))
        return [(voltage, None if np.isnan(deflection) else deflection,
                 str(LIMIT_STATES[kind].label) if kind else "")
                for voltage, deflection, kind in zip(*cells, strict=True)]

    def save(self, folder: Path) -> None:
        """Write ``NAME-curve.csv`` and ``.json``."""
        super().save(folder)
        write_sheet(folder / f"{self.specimen}-curve.csv", self.columns, self.table)

    def as_stored(self) -> Self:
        """Round the result to the digits of its file."""
        return replace(self, table=as_written(self.columns, self.table))

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        result = super().load(folder, name)
        table = read_own_sheet(folder / f"{result.specimen}-curve.csv", result.columns)
        return replace(result, table=table)


def curve_columns(curves: Sequence[MassCurve]) -> tuple[Column, ...]:
    """List the columns of curves: :data:`CURVES`, and those of the segments of their electrode.

    These are the voltage of each segment, and ``drive``, the proportion of a curve.
    """
    names = curves[0].segment_shares if curves else ()
    if not names:
        return CURVES
    place = [column.name for column in CURVES].index(_DRIVEN) + 1
    return (*CURVES[:place], Column.labels("drive", required=False),
            *(Column(f"{_DRIVEN}_{name}", "kV") for name in names), *CURVES[place:])


def curve(specimen: Specimen, masses: Sequence[float], settings: Settings, rig: Rig = Rig(),
          voltages: Sequence[float] = (), progress: Progress = lambda words: None,
          beyond: bool = False, segment_voltages: Sequence[Mapping[str, float]] = ()
          ) -> CurveResult:
    """Follow a film under each mass [kg] while its voltage rises to its limit.

    Each of the ``voltages`` [V] adds a row; beyond the limit the row has no values of the film.
    ``segment_voltages`` are those of the segments by name, a set for each voltage; there is a curve
    for each of their proportions. ``progress`` is called before each mass and at each voltage.
    ``beyond``: if a wrinkled film thins without bound, continue to the pull-in of a film that
    cannot wrinkle.
    """
    began = time.perf_counter()
    curves: list[MassCurve] = []
    cells: list[dict[str, Any]] = []
    dofs = 0
    films = in_proportion(specimen, voltages, segment_voltages)
    for mass, (film, marked) in product(masses, films):
        progress(f"{specimen.name}: {mass * 1e3:g} g")
        ascent = rise(Case(film, mass=mass, rig=rig), settings, beyond=beyond, step=SMOOTH)
        dofs = ascent.model.unknowns
        drawn = MassCurve(mass_kg=mass, limits=ascent.limits, stroke_m=ascent.stroke,
                          segment_shares=film.electrode.voltages(1.0))
        curves.append(drawn)
        # The model changes where the film continues as one that cannot wrinkle.
        for model, way in groupby(zip(ascent.cases, ascent.stops, strict=True),
                                  lambda pair: pair[1].film.model):
            solved = ((case, Outcome("equilibrium", stop.film.point.solution))
                      for case, stop in way)
            cells += [_row(False, result, ascent, drawn)
                      for result, _ in summaries(model, solved, 0.0)]
        for result in _asked(ascent, mass, rig, marked, settings):
            progress(f"{specimen.name}: {drawn.load}, {result.voltage_V / 1e3:g} kV")
            cells.append(_row(True, result, ascent, drawn))
    heaviest = Case.greatest(specimen, masses, voltages, rig)
    table = {column.name: np.array([row[column.name] for row in cells],
                                   float if column.choices is None else str)
             for column in curve_columns(curves)}
    return CurveResult(specimen=specimen.name, curves=tuple(curves), dofs=dofs,
                       wall_s=time.perf_counter() - began, warnings=heaviest.remarks, table=table)


def _row(asked: bool, result: CaseResult, ascent: Rise, curve: MassCurve) -> dict[str, Any]:
    """Build the row of a curve for a result, by the names of columns."""
    beyond = ascent.limits.beyond(result.voltage_V)
    stroke = (None if result.deflection_m is None or ascent.rest is None
              else result.deflection_m - ascent.rest)
    of_segments = {f"{_DRIVEN}_{name}": share * result.voltage_V
                   for name, share in curve.segment_shares.items()}
    return of_segments | {
        "mass": result.mass_kg, "voltage": result.voltage_V, "drive": curve.drive, "asked": asked,
        "status": result.status, "deflection": result.deflection_m, "stroke": stroke,
        "capacitance": result.capacitance_F, "slack_share": result.slack_share,
        "breakdown_margin": result.breakdown_margin, "beyond": beyond.kind if beyond else ""}


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
