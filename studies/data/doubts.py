"""Doubts about numbers of a table: their sign, their zero, and what its rows are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.circles import MembraneCircle

#: Correlation from which numbers rise or fall with others.
_CORRELATED = 0.5
#: Share of the largest reading of a ramp that counts as zero.
_NOTHING = 0.02
#: Ratio of two masses from which the deflections under them must differ.
_HEAVIER = 1.5
#: Least power of the mass with which deflections grow: films stiffen at most to a cubic force.
_STIFFENS = 1 / 3
#: Number of deflections at which a film's force is computed.
_PLACES = 1001
#: Largest deflection at which a film's force is computed, over the frame's radius: no film goes as
#: far.
_WIDTHS = 3.0
#: Readings of one state from which a range of frequencies is a sweep: repeats are fewer.
_SWEEP = 4
#: Share of the largest frequency below which readings of one state may differ by noise.
_SCATTERED = 0.3
#: Fewest evenly spaced times that come from a recorder: a few are even by chance.
_EVEN = 8
#: Share of a step within which times count as evenly spaced: a clock's last digit.
_EVENLY = 0.01
#: Least time between two states in a list of states [s].
_QUICK = 2.0


def groups_of(columns: Sequence[Sequence[str]], count: int) -> Numbers:
    """Assign numbers to groups of rows that have the same cells in each of some columns."""
    if not columns:
        return np.zeros(count, np.int64)
    rows = list(zip(*columns, strict=True))
    numbers = {row: number for number, row in enumerate(dict.fromkeys(rows))}
    return np.array([numbers[row] for row in rows], np.int64)


def rises(values: Array, along: Array, groups: Numbers) -> bool | None:
    """Check if numbers rise along others within groups, or fall; None where this is unclear."""
    ok = np.isfinite(values) & np.isfinite(along)
    if ok.sum() < 2:
        return None
    here = np.unique(groups[ok], return_inverse=True)[1].ravel()
    count = np.bincount(here)
    rests = [column[ok] - (np.bincount(here, column[ok]) / count)[here]
             for column in (values, along)]
    sizes = [float(np.sqrt(np.mean(rest**2))) for rest in rests]
    if not all(size > 1e-9 * np.abs(column[ok]).max()
               for size, column in zip(sizes, (values, along), strict=True)):
        return None
    correlation = float(np.mean(rests[0] * rests[1]) / (sizes[0] * sizes[1]))
    return None if abs(correlation) <= _CORRELATED else correlation > 0


def swept(values: Array, groups: Numbers) -> bool:
    """Check if readings of one state cover a range, as in a sweep of a drive."""
    for number in np.unique(groups):
        here = values[(groups == number) & np.isfinite(values)]
        if len(here) >= _SWEEP and np.ptp(here) > _SCATTERED * np.abs(here).max():
            return True
    return False


def all_negative(values: Array) -> bool:
    """Check that no number is positive and some are negative."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and finite.max() <= 0 > finite.min())


def from_rest(values: Array, voltage: Array, groups: Numbers) -> bool:
    """Check if readings are zero at the lowest of several voltages, although a mass hangs there."""
    for number in np.unique(groups):
        here = (groups == number) & np.isfinite(values) & np.isfinite(voltage)
        if not here.any() or not np.ptp(voltage[here]):
            continue
        lowest = here & (np.abs(voltage) == np.abs(voltage[here]).min())
        if np.abs(values[lowest]).max() <= _NOTHING * np.abs(values[here]).max():
            return True
    return False


def hardly_grow(values: Array, mass: Array, groups: Numbers) -> bool:
    """Check if readings grow less with the mass than those of a film that is flat without mass."""
    said = []
    for number in np.unique(groups):
        here = np.flatnonzero((groups == number) & np.isfinite(values) & (mass > 0))
        if not len(here):
            continue
        light, heavy = here[mass[here].argmin()], here[mass[here].argmax()]
        ratio = float(mass[heavy] / mass[light])
        if ratio >= _HEAVIER:
            said.append(abs(values[heavy])
                        < ratio**_STIFFENS * max(abs(values[light]), 1e-300))
    return bool(said) and all(said)


def usual_deflections(film: Specimen, masses: Array) -> Array:
    """Compute deflections [m] of a film without voltage under masses [kg], as a circle of its area.

    They are inf beyond three times the film's width, and zero without a mass.
    """
    radius = float(np.sqrt(np.prod(film.frame.semi_axes)))
    circle = MembraneCircle(film, radius)
    deflections = np.linspace(0.0, _WIDTHS * radius, _PLACES)
    forces = np.maximum.accumulate(circle.elastic(deflections)[1])
    return np.interp(masses * Rig().gravity, forces, deflections, right=np.inf)


def run_back(times: Array, groups: Numbers) -> int | None:
    """Find the first row whose time is before that of the row above in its group."""
    for number in np.unique(groups):
        rows = np.flatnonzero((groups == number) & np.isfinite(times))
        back = np.flatnonzero(np.diff(times[rows]) < 0)
        if len(back):
            return int(rows[back[0] + 1])
    return None


def even(times: Array) -> bool:
    """Check if times are a recorder's: many, and evenly spaced but for where it restarted."""
    steps = np.diff(times[np.isfinite(times)])
    steps = steps[steps > 0]
    return len(steps) >= _EVEN - 1 and bool(
        np.mean(np.abs(steps - np.median(steps)) <= _EVENLY * np.median(steps)) > 0.9)


def quick(times: Array) -> bool:
    """Check if the times [s] are closer than readings of equilibria."""
    steps = np.diff(times[np.isfinite(times)])
    steps = steps[steps > 0]
    return bool(len(steps)) and float(np.median(steps)) < _QUICK


def numbers_rows(cells: Sequence[str], states: Sequence[tuple[str, ...]]) -> bool:
    """Check if cells of a column of names number the rows: each once, while the states change.

    Numbers with decimals are no names either.
    """
    if any(not cell.lstrip("+-").replace(".", "", 1).isdigit() for cell in cells):
        return False
    if any("." in cell for cell in cells):
        return True
    return len(cells) > 2 and len(set(cells)) == len(cells) and len(set(states)) > 1


def numbered(cells: Sequence[str]) -> bool:
    """Check if cells number rows one after the other, where a few may be blank."""
    said = [cell for cell in cells if cell]
    return (len(said) > 2 and 0 < len(cells) - len(said) < len(said)
            and all(cell.isdigit() for cell in said)
            and [int(cell) - int(said[0]) for cell in said] == list(range(len(said))))


def forces_are_weights(forces: Sequence[str], voltages: Sequence[str]) -> bool:
    """Check if the same few forces occur at several voltages each: then they are weights."""
    by_force: dict[str, set[str]] = {}
    for force, voltage in zip(forces, voltages, strict=True):
        by_force.setdefault(force, set()).add(voltage)
    return 2 * len(by_force) <= len(forces) and all(len(said) > 1 for said in by_force.values())
