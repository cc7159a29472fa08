"""Wrong labels of readings that nothing explains: exchanged ones, or shifted by a row.

Each way in which labels may be wrong gives every written row another label. That label may be the
right one for a part of the rows: all rows, those of a specimen, of a mass, of both, or some
consecutive rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Hypothesis
from tympan.studies.diagnosis.inference.weighing import LABELS, LINES, most_of_noise
from tympan.studies.diagnosis.reading_table import ReadingTable, States

#: Largest share of χ² beyond noise that other labels may leave: a third of the residuals.
_LEFT = 0.1
#: For each way, number of relabelled parts that are refitted: those with the least χ² to first
#: order.
_FITTED = 3
#: Rounds in which rows between two lines are chosen with the factors of the round before.
_ASKED = 2
#: Largest root mean square residual of changed rows, over that of the others.
_ALIKE = 3.0

#: Columns whose labels may be wrong.
Labels = Literal["specimen", "mass", "voltage"]


@dataclass(frozen=True)
class RelabelledPart:
    """Some rows in words: those of a specimen, under a mass, or of some lines of a file.

    All rows if nothing is said.
    """

    specimen: str = ""
    mass: str = ""
    file: str = ""
    lines: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Relabelling:
    """Labels of a ``column`` that look wrong in a ``part`` of the rows.

    ``pair``: two labels that were exchanged, or empty where all are ``rows`` too far down (1) or up
    (-1); ``lines`` of ``file`` are those concerned; ``before`` and ``after``: χ² of the hypothesis
    with the stated and with the corrected labels.
    """

    column: Labels
    pair: tuple[str, str] | tuple[()]
    rows: int
    part: RelabelledPart
    file: str
    lines: tuple[int, ...]
    before: float
    after: float
    hypothesis: Hypothesis

    @property
    def plain(self) -> bool:
        """Whether the part has a name, so that no other part is needed."""
        return not self.part.file


@dataclass(frozen=True, eq=False)
class _Way:
    """Other labels of all rows: states with them, rows that change, and rows that lose a label.

    ``rows``: by how many rows the stated labels are shifted; 0 if two of them are exchanged.
    """

    column: Labels
    pair: tuple[str, str] | tuple[()]
    rows: int
    states: States
    changed: Mask
    lost: Mask


def relabelling_of(simulation: ReadingModel, table: ReadingTable, fitted: Fit
                   ) -> Relabelling | None:
    """Find the other labels that leave least of a fit's misfit; None if none leave little.

    ``fitted`` is a fit of any hypothesis; each part with other labels is refitted with the same
    one.
    """
    names = [specimen.name for specimen in simulation.setup.specimens]
    tried = [one for way in _ways(table, names)
             for one in _Search.of(simulation, table, fitted, way).tried(names) if one.alike]
    best = min(tried, key=_left, default=None)
    if best is None or _left(best) > fitted.chi_squared - LABELS:
        return None
    # Labels of some lines, or an effect in addition, fit too easily: they must leave noise alone.
    much = bool(best.part.file or fitted.hypothesis)
    beyond = best.chi_squared - most_of_noise(len(table))
    if beyond > (0.0 if much else _LEFT * (fitted.chi_squared - len(table))):
        return None
    rows = best.rows & (best.way.changed | best.way.lost)
    return Relabelling(best.way.column, best.way.pair, best.way.rows, best.part,
                       str(table.file[rows][0]), tuple(np.unique(table.line[rows]).tolist()),
                       fitted.chi_squared, best.chi_squared, fitted.hypothesis)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A part with other labels, refitted.

    ``alike``: several rows change, and their residuals are then as small as those of the others.
    """

    way: _Way
    part: RelabelledPart
    rows: Mask
    reached: Fit
    chi_squared: float
    alike: bool


def _left(tried: _Tried) -> float:
    """Compute χ² that is left, with the price of rows between two lines, which have no name."""
    return tried.chi_squared + LINES * bool(tried.part.file)


@dataclass(frozen=True, eq=False)
class _Search:
    """Search for parts of the rows that fit better with other labels.

    ``residual`` and ``jacobian``: of all rows with these labels, over the noise, at a fit with the
    stated ones.
    """

    simulation: ReadingModel
    table: ReadingTable
    fitted: Fit
    way: _Way
    residual: Array
    jacobian: Array

    @classmethod
    def of(cls, simulation: ReadingModel, table: ReadingTable, fitted: Fit, way: _Way) -> _Search:
        """Compute the residuals with the other labels, before any refit."""
        relabelled = replace(table, states=way.states)
        shown = simulation.prediction(fitted.hypothesis, fitted.unknowns, relabelled)
        return cls(simulation, table, fitted, way,
                   table.noise.whitened(table.value - shown.extended),
                   table.noise.whitened(shown.jacobian))

    def tried(self, names: Sequence[str]) -> list[_Tried]:
        """Refit the parts, and consecutive rows, that leave little with the other labels."""
        parts = _parts(self.table, self.way, names)
        rough = [self.roughly(rows) for _, rows in parts]
        tried = [self.fit(*parts[number]) for number in np.argsort(rough)[:_FITTED].tolist()]
        # Which rows improve is judged with the factors found with some labels corrected.
        for start in (self.fitted, min(tried, key=_left).reached):
            unknowns = start.unknowns
            for _ in range(_ASKED):
                rows = self.block(unknowns)
                if not (rows & self.way.changed).any():
                    break
                tried.append(self.fit(_lines(self.table, rows & self.way.changed), rows))
                unknowns = tried[-1].reached.unknowns
        return tried

    def roughly(self, rows: Mask) -> float:
        """Compute χ² to first order where a part has the other labels."""
        there = rows & self.way.changed
        stay = ~(rows & self.way.lost)
        missed = np.where(there, self.residual, self.fitted.residual)[stay]
        slopes = np.where(there[:, None], self.jacobian, self.fitted.jacobian)[stay]
        step = np.linalg.lstsq(slopes, missed, rcond=None)[0]
        return float(np.sum((missed - slopes @ step) ** 2)) + float((~stay).sum())

    def fit(self, part: RelabelledPart, rows: Mask) -> _Tried:
        """Refit with the other labels in a part; a lost row counts as noise."""
        changed, lost = rows & self.way.changed, rows & self.way.lost
        moved = np.zeros(len(self.table.states), bool)
        moved[self.table.state[changed]] = True
        since = self.table.since[changed]
        moved[since[since >= 0]] = True
        states = _where(moved, self.way.states, self.table.states)
        table = replace(self.table, states=states)[~lost]
        reached = fit(self.simulation, self.fitted.hypothesis, table, self.fitted.unknowns)
        squares = np.zeros(len(lost))
        squares[~lost] = reached.residual**2
        others = squares[~changed & ~lost]
        typical = max(float(np.mean(others)), 1.0) if len(others) else np.inf
        alike = changed.sum() > 1 and bool(np.mean(squares[changed]) <= _ALIKE**2 * typical)
        left = reached.chi_squared + float(lost.sum()) if reached.possible else np.inf
        return _Tried(self.way, part, rows, reached, left, alike)

    def block(self, unknowns: Array) -> Mask:
        """Find the consecutive rows for which the other labels fit best at some unknowns."""
        table, way = self.table, self.way
        stated, other = (table.noise.whitened(table.value - self.simulation.prediction(
            self.fitted.hypothesis, unknowns, replace(table, states=states)).extended)
            for states in (table.states, way.states))
        gain = np.where(way.changed, stated**2 - other**2, 0.0)
        concerned = np.flatnonzero(way.changed | way.lost)
        order = concerned[np.lexsort((table.line[concerned], table.file[concerned]))]
        sums = np.concatenate([[0.0], np.cumsum(gain[order])])
        end = int(np.argmax(sums - np.minimum.accumulate(sums)))
        rows = np.zeros(len(table), bool)
        rows[order[int(np.argmin(sums[: end + 1])):end]] = True
        return rows


def _where(rows: Mask, states: States, others: States) -> States:
    """Combine states of two sets by a mask of rows."""
    return replace(others, specimen=np.where(rows, states.specimen, others.specimen),
                   mass=np.where(rows, states.mass, others.mass),
                   voltage=np.where(rows, states.voltage, others.voltage))


def _ways(table: ReadingTable, names: Sequence[str]) -> Iterator[_Way]:
    """Yield all ways in which labels may be wrong."""
    yield from _exchanges(table, names)
    yield from _shifts(table)


def _exchanges(table: ReadingTable, names: Sequence[str]) -> Iterator[_Way]:
    """Yield exchanges of two labels, where both were read under some other label."""
    states = table.states
    specimens = np.array(names)[states.specimen]
    masses = np.array([_grams(mass) for mass in states.mass.tolist()])
    columns: tuple[tuple[Labels, NDArray[np.str_], NDArray[np.str_]], ...] = (
        ("specimen", specimens, masses), ("mass", masses, specimens))
    for column, labels, others in columns:
        for pair in combinations(np.unique(labels).tolist(), 2):
            one, other = (labels == label for label in pair)
            if not np.intersect1d(others[one], others[other]).size:
                continue
            place = np.arange(len(labels))
            place[one], place[other] = np.flatnonzero(other)[0], np.flatnonzero(one)[0]
            values: dict[str, Any] = {column: getattr(states, column)[place]}
            yield _Way(column, pair, 0, replace(states, **values),
                       (one | other)[table.state], np.zeros(len(table), bool))


def _shifts(table: ReadingTable) -> Iterator[_Way]:
    """Yield labels of a column one row further down or up: along a file, and along each ramp."""
    states = table.states
    # A run in time has its voltages from its own clock, and a scan has many places in one state.
    plain = ((table.since < 0) & (table.point < 0)
             & ~np.isin(table.state, states.in_time))
    rows = np.flatnonzero(plain)
    if not len(rows):
        return
    files = np.unique(table.file[rows], return_inverse=True)[1]
    ramp = np.unique(np.stack([table.specimen[rows], table.mass[rows],
                               states.run[table.state[rows]]], 1), axis=0,
                     return_inverse=True)[1].ravel()
    columns: tuple[Labels, ...] = ("voltage", "mass", "specimen")
    for column in columns:
        seen = list[Array]()
        for group in (files, (ramp.max() + 1) * files + ramp):
            for shift in (1, -1):
                way = _shifted(table, rows, group, column, shift)
                labels = np.where(way.lost, np.nan, getattr(way.states, column)[table.state])
                if way.changed.any() and not any(
                        np.array_equal(labels, other, equal_nan=True) for other in seen):
                    seen.append(labels)
                    yield way


def _shifted(table: ReadingTable, rows: Numbers, group: Numbers, column: Labels, shift: int
             ) -> _Way:
    """Build labels from the line before (1) or after (-1) in the file, within groups of rows."""
    labels: Array = getattr(table.states, column)
    moved, lost = labels.copy(), np.zeros(len(table), bool)
    for number in range(int(group.max()) + 1):
        some = rows[group == number]
        line, first, place = np.unique(table.line[some], return_index=True, return_inverse=True)
        written = labels[table.state[some[first]]]
        source = np.arange(len(line)) - shift
        there = (source >= 0) & (source < len(line))
        ready = np.where(there, written[np.clip(source, 0, len(line) - 1)], written)
        moved[table.state[some]] = ready[place.ravel()]
        lost[some] = ~there[place.ravel()]
    changed = (moved != labels)[table.state] & ~lost
    values: dict[str, Any] = {column: moved}
    states = replace(table.states, **values)
    # A label that stands too far up belongs to the next line.
    return _Way(column, (), -shift, states, changed, lost)


def _parts(table: ReadingTable, way: _Way, names: Sequence[str]
           ) -> list[tuple[RelabelledPart, Mask]]:
    """List parts with a name in which labels may be wrong; all rows are one of them."""
    specimens = np.array(names)[table.specimen]
    masses = np.array([_grams(mass) for mass in table.mass.tolist()])
    parts = [(RelabelledPart(), np.full(len(table), True))]
    parts += [(RelabelledPart(specimen=name), specimens == name)
              for name in np.unique(specimens).tolist()]
    parts += [(RelabelledPart(mass=mass), masses == mass)
              for mass in np.unique(masses).tolist()]
    parts += [(RelabelledPart(name, mass), (specimens == name) & (masses == mass))
              for name in np.unique(specimens).tolist() for mass in np.unique(masses).tolist()]
    if way.pair:
        # A part is kept only if both exchanged labels occur in it.
        parts = [(part, rows) for part, rows in parts
                 if not (part.specimen if way.column == "specimen" else part.mass)]
    kept, seen = list[tuple[RelabelledPart, Mask]](), list[Mask]()
    for part, rows in parts:
        changed = rows & way.changed
        if changed.any() and not any(np.array_equal(changed, other) for other in seen):
            seen.append(changed)
            kept.append((part, rows))
    return kept


def _lines(table: ReadingTable, rows: Mask) -> RelabelledPart:
    """Find the first and the last line of some rows, in the file of the first row."""
    file = str(table.file[rows][0]) if rows.any() else ""
    lines = table.line[rows & (table.file == file)]
    ends = (int(lines.min()), int(lines.max())) if len(lines) else (0, 0)
    return RelabelledPart(file=file, lines=ends)


def _grams(mass: float) -> str:
    return f"{1e3 * mass:.4g} g"
