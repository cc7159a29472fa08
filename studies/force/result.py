"""Force-displacement curves, and loads on them, as they are stored."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import Key, Printed
from tympan.base.units import place_text, segment_words
from tympan.fem.results.limit_states import LIMIT_STATES, PULL_IN, LimitState
from tympan.studies.case import Band, SpecimenRecord, UnknownCount, WallTime, Warnings
from tympan.studies.columns import Column, write_rows, write_sheet
from tympan.studies.files import remove
from tympan.studies.rows import rows_in
from tympan.studies.segments import Driven

#: Columns of the CSV of loops; they have the names of a dataset's force.csv. ``run`` is the cycle.
LOOP_COLUMNS: tuple[Column, ...] = (
    Column.labels("specimen"),
    Column("voltage", "kV"),
    Column("displacement", "mm"),
    Column("force", "mN"),
    Column.labels("run"),
    Column.labels("direction", ("out", "back")),
    Column("t", "s"),
)

#: Largest force or moment of a guide over that along the load that is rounding or the mesh's error.
_ROUNDING = 1e-6
#: Kind of a curve's end beyond which no equilibrium was found.
NOT_FOLLOWED = "not_followed"
#: Kinds of events on a curve: limits of the film, and ``NOT_FOLLOWED``.
CURVE_EVENTS: Mapping[str, LimitState | None] = ChainMap[str, Any](
    {NOT_FOLLOWED: None}, LIMIT_STATES)


@dataclass(frozen=True, kw_only=True)
class ForceLimit:
    """Limit of the film that a force-displacement curve reaches, or its end."""

    kind: Annotated[str, Key(
        "what happens there: loss of tension, breakdown or instability of the film; pull_in, where "
        "the force turns, so that a weight goes on by itself; or no equilibrium was found beyond"),
        Printed(choices=CURVE_EVENTS)]
    displacement_m: Annotated[float, Key("displacement of the plate")]
    force_N: Annotated[float, Key("force on the plate")]
    x_m: Annotated[float | None, Key("where in the mounted film; none where it is not known")] = (
        None)
    y_m: Annotated[float | None, Key("y of the same place")] = None
    segment: Annotated[str | None, Key(
        "segment of the electrode there, or the nearest ones, after commas; none of an electrode "
        "in one piece")] = None

    @property
    def words(self) -> str:
        """Description of the event."""
        if self.kind == NOT_FOLLOWED:
            return "no equilibrium found beyond"
        if self.kind == PULL_IN.kind:
            return f"{PULL_IN.label}, the force turns: a weight goes on by itself"
        return str(LIMIT_STATES[self.kind].label)

    @property
    def place(self) -> str:
        """Place in the film where it begins, in millimetres; "" for an event of the plate."""
        if self.x_m is None or self.y_m is None or self.kind == PULL_IN.kind:
            return ""
        return place_text(self.x_m, self.y_m) + segment_words(self.segment)


@dataclass(frozen=True, kw_only=True)
class ForceCurve(Driven):
    """Force on the plate at one voltage; each list has one value for each displacement.

    The fields are the columns of the CSV, in this order.
    """

    displacement_m: Annotated[tuple[float, ...], Key("displacements of the plate, ascending")]
    force_N: Annotated[tuple[float, ...], Key(
        "force that holds the plate there, positive along the displacement")]
    stiffness_N_per_m: Annotated[tuple[float, ...], Key("slope of the curve")]
    capacitance_F: Annotated[tuple[float, ...], Key("capacitance of the film as it is")]
    stable: Annotated[tuple[bool, ...], Key("whether it is stable under a constant force, too")]
    tense: Annotated[tuple[bool, ...], Key("whether no part of the film has lost tension")]
    max_stretch: Annotated[tuple[float | None, ...], Key(
        "largest principal stretch, from the virgin film; none of a film without fields")]
    max_true_stress_Pa: Annotated[tuple[float | None, ...], Key(
        "largest principal true stress; none of a film without fields")]
    breakdown_share: Annotated[tuple[float | None, ...], Key(
        "largest field over strength; 0 where the strength is unknown, none of a film without "
        "fields")]
    force_x_N: Annotated[tuple[float, ...], Key(
        "force along x with which a guide keeps the plate from shifting; 0 where it may shift")]
    force_y_N: Annotated[tuple[float, ...], Key("the same along y")]
    moment_x_Nm: Annotated[tuple[float, ...], Key(
        "moment about the x axis through the plate's centre with which a guide keeps the plate "
        "from tilting, positive where alone it would deflect the side at +y further; 0 where the "
        "plate may tilt")]
    moment_y_Nm: Annotated[tuple[float, ...], Key(
        "the same about the y axis, positive where alone it would deflect the side at -x further")]
    limits: Annotated[tuple[ForceLimit, ...], Key("limits that the curve passes, in order")]
    ended: Annotated[ForceLimit | None, Key(
        "where the curve ends before the last displacement; none where it reaches that")]
    band_force_N: Annotated[tuple[Band | None, ...], Key(
        "spread of the force between films made to the tolerances, for each displacement; empty "
        "without tolerances, none where more than 5 % of the films have no equilibrium")] = ()

    @property
    def guided(self) -> bool:
        """Whether a guide holds forces across the load or moments, beyond rounding."""
        lengths = max(map(abs, self.displacement_m), default=0.0)
        largest = max(map(abs, self.force_N), default=0.0)
        across = (*self.force_x_N, *self.force_y_N)
        moments = (*self.moment_x_Nm, *self.moment_y_Nm)
        return (max(map(abs, across), default=0.0) > _ROUNDING * largest
                or max(map(abs, moments), default=0.0) > _ROUNDING * largest * lengths)

    @property
    def banded(self) -> tuple[tuple[float, Band], ...]:
        """Displacements [m] that have a band, with their bands."""
        both = zip(self.displacement_m, self.band_force_N, strict=False)
        return tuple((place, band) for place, band in both if band is not None)


@dataclass(frozen=True, kw_only=True)
class Crossing(Driven):
    """Crossing of a load line and a curve: an equilibrium under that load at that voltage."""

    displacement_m: Annotated[float, Key("displacement of the plate")]
    force_N: Annotated[float, Key("force that the film carries there")]
    stable: Annotated[bool, Key("whether it is stable under the load")]
    reached: Annotated[bool, Key(
        "whether the plate comes to it: from the mounted film at the lowest voltage, then from "
        "voltage to voltage")]


@dataclass(frozen=True, kw_only=True)
class LoadLine:
    """A load on the plate, its equilibria, and the work of a cycle between two voltages."""

    load: Annotated[str, Key("the weight, and what else acts between plate and ground")]
    mass_kg: Annotated[float, Key("nominal mass")]
    displacement_m: Annotated[tuple[float, ...], Key("displacements at which its line is drawn")]
    force_N: Annotated[tuple[float, ...], Key("force with which it pulls the film there")]
    crossings: Annotated[tuple[Crossing, ...], Key("equilibria, by voltage and displacement")]
    stroke_m: Annotated[float | None, Key(
        "displacement from the lowest to the highest voltage; none where one has no equilibrium "
        "that is reached")] = None
    work_J: Annotated[float | None, Key(
        "work that the load exchanges in one stroke: the area under its line; of a weight, weight "
        "times stroke")] = None
    work_J_per_kg: Annotated[float | None, Key(
        "the same per mass of film and electrodes; none where they have no density")] = None
    work_J_per_m3: Annotated[float | None, Key("the same per volume of the film")] = None
    ideal_work_J: Annotated[float | None, Key(
        "work of the cycle that changes the voltage at both ends of the stroke with the plate "
        "held: the area between the curves")] = None
    electrical_in_J: Annotated[float | None, Key("energy that the supply gives in that "
                                                 "cycle")] = None
    electrical_out_J: Annotated[float | None, Key("energy that it gets back")] = None
    coupling: Annotated[float | None, Key("ideal work over the energy given")] = None
    efficiency: Annotated[float | None, Key(
        "work of a stroke under the load over the energy that the supply gives for it, with none "
        "got back; none where the plate snaps")] = None

    def reached_at(self, voltage: float, segments: Mapping[str, float]) -> float | None:
        """Find the displacement [m] that the plate comes to at a voltage [V] of a curve.

        ``segments``: voltages of the segments by name. None where it comes to none.
        """
        return next((crossing.displacement_m for crossing in self.crossings if crossing.reached and
                     (crossing.voltage_V, crossing.segment_voltages_V) == (voltage, segments)),
                    None)


@dataclass(frozen=True, kw_only=True)
class ForceLoop(Driven):
    """Motion of the plate out and back at a speed, at one voltage."""

    rate_m_per_s: Annotated[float, Key("speed of the plate")]
    leg_s: Annotated[float, Key("time of one way, half a cycle")]
    time_s: Annotated[tuple[float, ...], Key("times, from the beginning of the motion")]
    displacement_m: Annotated[tuple[float, ...], Key("displacements at these times")]
    force_N: Annotated[tuple[float, ...], Key("force that holds the plate at them")]
    area_J: Annotated[tuple[float, ...], Key(
        "work that the tester does in each cycle: the area of the loop")]
    heat_J: Annotated[tuple[float, ...], Key(
        "heat of the branches in each cycle; once cycles repeat themselves it is the area")]
    stopped_s: Annotated[float | None, Key(
        "when the film ended, by pull-in or thinning, before the end; none where it did not")] = (
            None)


@dataclass(frozen=True, kw_only=True)
class ForceResult(SpecimenRecord):
    """Force-displacement curves of one specimen, and loads on them, in SI."""

    ending = "-force"
    writer = "tympan force"
    indexed = ("voltage_V", "displacement_m")
    kinds = ("csv", "json")
    drawn = ("png", "svg")

    curves: Annotated[tuple[ForceCurve, ...], Key("a curve for each voltage, ascending")]
    loads: Annotated[tuple[LoadLine, ...], Key("loads whose lines are drawn over the curves")] = ()
    loops: Annotated[tuple[ForceLoop, ...], Key("loops in time, where they were asked for")] = ()
    stroke_m: Annotated[float | None, Key("stroke of the first load")] = None
    work_J: Annotated[float | None, Key("its work in a stroke")] = None
    blocked_force_N: Annotated[float | None, Key(
        "by how much the force falls from the lowest to the highest voltage, the plate held; none "
        "of one voltage")] = None
    blocked_displacement_m: Annotated[float | None, Key(
        "where: at the first load's equilibrium at the lowest voltage; without a load, where it is "
        "largest")] = None
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings = ()

    @property
    def rows(self) -> dict[str, Array]:
        """Table of the curves, a row for each displacement; a dataset's force.csv begins so."""
        return rows_in(self.curves, specimen=self.specimen)

    @property
    def loop_table(self) -> dict[str, Array]:
        """Table of the loops with the names of :data:`LOOP_COLUMNS`, in SI."""
        rows: list[tuple[Any, ...]] = []
        for loop in self.loops:
            turn = loop.leg_s
            for t, place, force in zip(loop.time_s, loop.displacement_m, loop.force_N, strict=True):
                # A turning point is the last point of its leg.
                way = max(int(np.ceil(t / turn - 1e-9)) - 1, 0)
                rows.append((self.specimen, loop.voltage_V, place, force, str(way // 2 + 1),
                             ("out", "back")[way % 2], t))
        return {column.name: np.array([row[number] for row in rows])
                for number, column in enumerate(LOOP_COLUMNS)}

    def save(self, folder: Path) -> None:
        """Write ``NAME-force.csv`` and ``.json``; with loops also ``NAME-loops.csv``."""
        loops = f"{self.specimen}-loops.csv"
        remove(folder, loops)
        super().save(folder)
        write_rows(folder / f"{self.specimen}-force.csv", self.rows)
        if self.loops:
            write_sheet(folder / loops, LOOP_COLUMNS, self.loop_table)
