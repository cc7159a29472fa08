"""Strokes of many films from 0 V to their voltages: blocked force, work and energies, by a family.

A stroke's cycle has four corners. The film is under its load without voltage; the plate is held
there while the voltage is applied; the film is under its load with voltage; the plate is held there
while the voltage is removed. Energies, charges and forces at the corners are those of the reduced
film. Work and energies follow from them as for finite elements in
:mod:`tympan.studies.force.cycle`. Forces are small differences, so each corner is corrected once
more than a row's state.

The error of a stroke is the difference between the errors of deflection at two corners, since the
errors of one film have one cause, and cancel where the voltage is low.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.studies.films.many_films import Films
from tympan.studies.films.population import FilmGrid, Population
from tympan.studies.force.cycle import Corner, PlateLoad, exchanged

#: End of the curves by finite elements, over the deflection with voltage; they begin at 0.
WIDER = 1.1

#: Smallest tension of a film over its largest stress, in a row that is not left to finite elements:
#: between nodes the tension may be less than at the nodes.
TENSE = 0.01

#: Largest estimated relative error of a row's numbers; other rows are left to finite elements. In
#: 2,200 rows of six sweeps the largest error was 8e-5; with 1e-4 here one row had 1.07e-4.
ESTIMATED = 7e-5


@dataclass(frozen=True, eq=False)
class Strokes:
    """Numbers of each row's stroke, (rows,); nan in rows that are not ``sure``.

    ``blocked`` force [N], ``work`` under the load, ``ideal`` work and energy ``given`` [J].
    """

    blocked: AnyArray
    work: AnyArray
    ideal: AnyArray
    given: AnyArray
    sure: Mask


def strokes(grid: FilmGrid) -> Strokes:
    """Compute the strokes of all films under all loads, masses first; nan without voltage."""
    population, films = grid.films, grid.films.every
    rest = population.family.states(films, grid.forces, 0.0, check=False)
    count, several = grid.voltages.shape[1], grid.states.holds.shape[1]
    voltage = np.tile(grid.across, grid.masses.shape[1]).ravel()
    tense = rest.holds & rest.sound & (rest.tension > TENSE * rest.stress)
    known = (grid.states.holds & np.repeat(tense, count, axis=1)).ravel() & (voltage != 0)
    some = np.flatnonzero(known)
    blocked, work, ideal, given = np.full((4, len(voltage)), np.nan)
    found = Strokes(blocked, work, ideal, given, np.zeros(len(voltage), dtype=bool))
    if not len(some):
        return found
    number, squared = some // several, voltage[some] ** 2
    load = np.repeat(grid.forces, count, axis=1).ravel()[some]
    starts = np.repeat(rest.q, count, axis=1).reshape(len(voltage), -1)[some]
    ends = grid.states.q.reshape(len(voltage), -1)[some]
    none = np.zeros(len(some))
    first = _States.loaded(films, number, starts, none, load)
    charged = _States.held(films, number, first.q, squared)
    moved = _States.loaded(films, number, ends, squared, load)
    discharged = _States.held(films, number, moved.q, none)
    corners = [first, charged, moved, discharged]
    held = [_tense(population, number, corner) for corner in (charged, discharged)]
    into, out = exchanged([corner.energies(films, number) for corner in corners])
    begin, end = first.deflection, moved.deflection
    blocked[some] = first.force - charged.force
    work[some] = np.abs(PlateLoad(population.rig.loading.biases, load).work(begin, end))
    ideal[some], given[some] = into - out, into
    sure = held[0] & held[1] & (into > 0)
    sure &= (begin * end >= 0) & (np.abs(begin) <= WIDER * np.abs(end))
    sure[sure] = _exact(population, number, corners, into - out, np.flatnonzero(sure),
                        some // count)
    found.sure[some] = sure
    return found


def _exact(population: Population, number: AnyArray, corners: list[_States], ideal: AnyArray,
           some: AnyArray, group: AnyArray) -> Mask:
    """Find the rows whose numbers have a small estimated error: a mask of some rows.

    For each film under each mass, a ``group``, the error at the highest voltage decides for all its
    rows. Where that error is large, each row has its own.
    """
    def off(chosen: AnyArray) -> AnyArray:
        states = [corner.some(chosen) for corner in corners]
        return _off(population, number[chosen], states, ideal[chosen])

    highest = np.flatnonzero(np.diff(group[some], append=-1))
    share = np.repeat(off(some[highest]), np.diff(highest, prepend=-1))
    large = ~(share <= ESTIMATED)
    share[large] = off(some[large])
    return np.asarray(share <= ESTIMATED)


def _off(population: Population, number: AnyArray, corners: list[_States], ideal: AnyArray
         ) -> AnyArray:
    """Estimate the relative errors of rows' numbers: the largest of the forces' and the work's."""
    family, films = population.family, population.every
    errors = [family.error(films, number, corner.q, corner.force, corner.squared, corner.stiffness)
              for corner in corners]
    apart = [corner.stiffness * error for corner, error in zip(corners, errors, strict=True)]
    first, charged, moved, discharged = corners
    fall, rise = first.force - charged.force, discharged.force - moved.force
    # Above a gas the two errors have had either sign.
    longer = errors[2] + errors[0] if films.gas else errors[2] - errors[0]
    with np.errstate(all="ignore"):
        # A longer stroke adds to the ideal work the difference of the forces at its end.
        shares = [(apart[0] - apart[1]) / fall, (apart[3] - apart[2]) / rise,
                  longer * rise / ideal]
    return np.asarray(np.abs(shares).max(0))


def _tense(population: Population, number: AnyArray, corner: _States) -> Mask:
    """Find the states with a film in tension everywhere and stable in itself: a mask."""
    films = population.every
    places = films.at(population.family.looked_at)
    extremes = films.extremes(places, number, corner.q, corner.squared)
    return np.asarray((extremes.tension > TENSE * extremes.stress) & extremes.sound)


@dataclass(frozen=True, eq=False)
class _States:
    """States q of films, (states, shapes), at U² [V²], nan where there is no state.

    ``force`` on the plate [N], a spring's force included, and the plate's ``stiffness`` [N/m].
    """

    q: AnyArray
    squared: AnyArray
    force: AnyArray
    stiffness: AnyArray

    @property
    def deflection(self) -> AnyArray:
        """Deflections of the plates [m]."""
        return np.asarray(self.q[:, 0])

    def some(self, chosen: AnyArray) -> _States:
        """Select some of the states."""
        return _States(self.q[chosen], self.squared[chosen], self.force[chosen],
                       self.stiffness[chosen])

    @classmethod
    def held(cls, films: Films, number: AnyArray, near: AnyArray, squared: AnyArray) -> _States:
        """Solve films whose plates are held at the deflections of states."""
        balance = films.balanced(number, np.zeros(len(number)), squared, near, held=True)
        q = np.where(balance.sound[:, None], balance.q, np.nan)
        return cls._corrected(films, number, q, squared, None)

    @classmethod
    def loaded(cls, films: Films, number: AnyArray, near: AnyArray, squared: AnyArray,
               load: AnyArray
               ) -> _States:
        """Solve films under loads [N], starting at their states."""
        return cls._corrected(films, number, near, squared, load)

    @classmethod
    def _corrected(cls, films: Films, number: AnyArray, q: AnyArray, squared: AnyArray,
                   load: AnyArray | None
                   ) -> _States:
        """Correct states once by their own tangents; without a load the plates are held."""
        q, force, stiffness = q.copy(), *np.full((2, len(q)), np.nan)
        for part in films.parts(number, len(films.points.sites.cells)):
            with np.errstate(all="ignore"):
                pull, tangent = films.pull(number[part], q[part], squared[part])
            # A force on the plate acts at the point of its weight, and turns it.
            lever, lift = films.lever(number[part]), films.lift(number[part])[:, 1:]
            acting = pull[:, :1] / lever[:, None] if load is None else load[part, None]
            other, turned = pull[:, 1:] - acting * lift, tangent[:, 1:]
            if load is None:
                turned = turned - (lift / lever[:, None])[..., None] * tangent[:, :1]
            beside = np.linalg.solve(turned[..., 1:], np.stack([other, turned[..., 0]], -1))
            with_plate = tangent[:, 0, 1:]
            force[part] = (pull[:, 0] - (with_plate * beside[..., 0]).sum(1)) / lever
            stiffness[part] = (
                tangent[:, 0, 0] - (with_plate * beside[..., 1]).sum(1)) / lever
            q[part, 1:] -= beside[..., 0]
            if load is not None:
                rise = (load[part] - force[part]) / stiffness[part]
                q[part, 0] += rise
                q[part, 1:] -= rise[:, None] * beside[..., 1]
        return cls(q, squared, force if load is None else load, stiffness)

    def energies(self, films: Films, number: AnyArray) -> Corner:
        """Compute the films' energies at a corner of the cycle, with their weight and gas."""
        capacitance, energy = films.stored(number, self.q, self.squared)
        potential = energy - (films.weight[number] * self.q).sum(1)
        if films.gas:
            swept = films.volume.value(number, films.along(number, self.q))
            potential -= films.pressure[number] * swept
        return Corner.of(potential, capacitance, np.sqrt(self.squared))
