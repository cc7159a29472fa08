"""Strokes of many films from no voltage to theirs: blocked force, work and energies, by a family.

A stroke's cycle has four corners: the film under its load without voltage, with it, and with the
plate held at the end of the other one. Their energies, charges and forces are those of the reduced
film, and work and energies follow from them as :mod:`tympan.studies.force.cycle` has it for finite
elements. Forces are small differences, so each corner is corrected once more than a row's state.

What errors of deflections do to a stroke is their difference between two corners, as those of one
film have one cause and cancel where the voltage is low.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.studies.films.many_films import Films
from tympan.studies.films.population import FilmGrid, Population
from tympan.studies.force.cycle import Corner, PlateLoad, exchanged

#: How far deflections are from 0 to that with voltage, at which curves of finite elements end.
WIDER = 1.1

#: How far a film's least tension is from none in a row that is not left to finite elements, over
#: its largest stress: between nodes it may be less than at these.
TENSE = 0.01

#: Estimated error of a row's numbers, as a share of them, beyond which finite elements have it. Of
#: 2,200 rows of six sweeps the others were off by 8e-5 at most, with 1e-4 here one by 1.07e-4.
ESTIMATED = 7e-5


@dataclass(frozen=True, eq=False)
class Strokes:
    """Numbers of each row's stroke, (rows,), nan of those that are not ``sure``.

    ``blocked`` force [N], ``work`` under the load, ``ideal`` work, energy ``given`` [J].
    """

    blocked: AnyArray
    work: AnyArray
    ideal: AnyArray
    given: AnyArray
    sure: Mask


def strokes(grid: FilmGrid) -> Strokes:
    """Strokes of all films under all loads, masses first; without voltage there is none."""
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
    """Mask of some rows whose numbers have a small error, as far as estimates say.

    Of each film under each mass, a ``group``, the highest voltage says so. Where the error is large
    there, every row has its own.
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
    """Estimated errors of rows' numbers, relative: the largest of the forces' and of the work's."""
    family, films = population.family, population.every
    errors = [family.error(films, number, corner.q, corner.force, corner.squared, corner.stiffness)
              for corner in corners]
    apart = [corner.stiffness * error for corner, error in zip(corners, errors, strict=True)]
    first, charged, moved, discharged = corners
    fall, rise = first.force - charged.force, discharged.force - moved.force
    # Above a gas they have had either sign, with and without voltage.
    longer = errors[2] + errors[0] if films.gas else errors[2] - errors[0]
    with np.errstate(all="ignore"):
        # A longer stroke adds to the ideal work what the forces differ by at its end.
        shares = [(apart[0] - apart[1]) / fall, (apart[3] - apart[2]) / rise,
                  longer * rise / ideal]
    return np.asarray(np.abs(shares).max(0))


def _tense(population: Population, number: AnyArray, corner: _States) -> Mask:
    """Mask of states in which the film is in tension everywhere and firm."""
    films = population.every
    places = films.at(population.family.looked_at)
    extremes = films.extremes(places, number, corner.q, corner.squared)
    return np.asarray((extremes.tension > TENSE * extremes.stress) & extremes.sound)


@dataclass(frozen=True, eq=False)
class _States:
    """States q of films, (states, shapes), at U² [V²], nan where they are none.

    ``force`` on the plate [N], that of a spring included, and the plate's ``stiffness`` [N/m].
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
        """Some of the states."""
        return _States(self.q[chosen], self.squared[chosen], self.force[chosen],
                       self.stiffness[chosen])

    @classmethod
    def held(cls, films: Films, number: AnyArray, near: AnyArray, squared: AnyArray) -> _States:
        """Films whose plates are held where states have them."""
        balance = films.balanced(number, np.zeros(len(number)), squared, near, held=True)
        q = np.where(balance.sound[:, None], balance.q, np.nan)
        return cls._corrected(films, number, q, squared, None)

    @classmethod
    def loaded(cls, films: Films, number: AnyArray, near: AnyArray, squared: AnyArray,
               load: AnyArray
               ) -> _States:
        """Films under loads [N], from their states."""
        return cls._corrected(films, number, near, squared, load)

    @classmethod
    def _corrected(cls, films: Films, number: AnyArray, q: AnyArray, squared: AnyArray,
                   load: AnyArray | None
                   ) -> _States:
        """States corrected once by their own tangents, with plates held where there is no load."""
        q, force, stiffness = q.copy(), *np.full((2, len(q)), np.nan)
        for part in films.parts(number, len(films.points.sites.cells)):
            with np.errstate(all="ignore"):
                pull, tangent = films.pull(number[part], q[part], squared[part])
            # What acts on the plate acts where its weight does, and turns it.
            acting = pull[:, :1] / films.lever if load is None else load[part, None]
            other, turned = pull[:, 1:] - acting * films.lift[1:], tangent[:, 1:]
            if load is None:
                turned = turned - films.leverage[1:, None] * tangent[:, :1]
            beside = np.linalg.solve(turned[..., 1:], np.stack([other, turned[..., 0]], -1))
            with_plate = tangent[:, 0, 1:]
            force[part] = (pull[:, 0] - (with_plate * beside[..., 0]).sum(1)) / films.lever
            stiffness[part] = (
                tangent[:, 0, 0] - (with_plate * beside[..., 1]).sum(1)) / films.lever
            q[part, 1:] -= beside[..., 0]
            if load is not None:
                rise = (load[part] - force[part]) / stiffness[part]
                q[part, 0] += rise
                q[part, 1:] -= rise[:, None] * beside[..., 1]
        return cls(q, squared, force if load is None else load, stiffness)

    def energies(self, films: Films, number: AnyArray) -> Corner:
        """The films at a corner of the cycle, their weight and gas included."""
        capacitance, energy = films.stored(number, self.q, self.squared)
        potential = energy - (films.weight[number] * self.q).sum(1)
        if films.gas:
            potential -= films.pressure[number] * films.volume.value(number, films.along(self.q))
        return Corner.of(potential, capacitance, np.sqrt(self.squared))
