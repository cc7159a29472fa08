"""Memory of films in their runs, as hardening: for a while a film acts like a stiffer one.

A film with viscous branches that follows a voltage's history has, at any time, the deflection of a
film at rest that is 1 + η times as stiff. η comes from the film reduced to a few points
(:mod:`tympan.studies.films.film`) with its own law, branches and voltages in time. The deflection
at rest comes from the force law, with all effects of a hypothesis. So a hypothesis that does not
change branches needs no run, and a film without memory has its readings at rest.

η depends on a branch's modulus and time, and on the time since mounting. It is solved where needed
on a lattice of their logarithms, and interpolated by cubics; small moduli, to which η is
proportional, are spaced linearly. The joint effect of two branches beyond that of each alone is
small, and interpolated linearly. On load and voltage η depends less: every node has a slope by
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import chain, combinations, product
from math import inf, prod
from typing import TypeVar

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.membrane.biases import Spring
from tympan.fem.rig import Rig
from tympan.fem.transient.ends import Stopped
from tympan.geometry.specimen import Film, Specimen, ViscousBranch
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.history import WEIGHTS, Passages, VoltageHistory
from tympan.studies.diagnosis.hypothesis import with_factors
from tympan.studies.diagnosis.reading_table import ReadingTable, StateKey, States
from tympan.studies.effects import Setup
from tympan.studies.films.film import FilmLoads, NoBalance, ReducedFilm
from tympan.studies.films.motion import ReducedMotion
from tympan.studies.films.reduction import film_of_runs
from tympan.studies.motion import Trace
from tympan.studies.signals import JointSignal, Supplied

#: Spacing of the lattice in logarithms, a factor of two. Set by trial.
_SPACING = 0.7
#: Largest modulus of a branch over the law's: a stiffer branch holds the film just as well.
_STIFFEST = 1e4
#: Shortest and longest time of a branch over those of the runs: beyond these it relaxes at once or
#: never.
_TIMES = (1e-2, 1e3)

#: Lowest index of the lattice, that of the softest modulus.
_FIRST = -4
#: Lowest index of the lattice where two branches act. Below it their joint effect is taken as
#: proportional to both moduli: for softer ones it is less than the runs' own errors.
_FIRST_OF_TWO = -2
#: Softest modulus of a branch over the law's: the effect of a softer one is proportional to it.
_SOFTEST = 5e-3

_ADDED = np.exp(_SPACING * _FIRST) - _SOFTEST

#: Relative change of load, voltage and modulus for slopes.
_CHANGE = 0.02
#: Largest change, in logarithms, over which slopes are used.
_FAR = 0.5

#: Shares of the highest voltage for the reduced film, tried until it does not pull in.
_HIGHEST = (1.03, 1.0, 0.9, 0.75, 0.5)

#: Number of corrections of η for a deflection.
_ROUNDS = 4

#: Most additional branches whose joint effect counts: that of three is hardly more than that of
#: every two of them.
_SIDE_BY_SIDE = 2
#: Nodes on each axis of the lattice, by the number of additional branches: cubics, and lines for
#: the joint effect of two beyond that of each alone, which is a tenth of it.
_NODES = (4, 4, 2)

_Corner = tuple[int, ...]
_Item = TypeVar("_Item")


@dataclass(frozen=True, eq=False)
class RememberingFilm:
    """A specimen's reduced film and its runs.

    ``runs`` are masses [kg] with histories; ``asked`` is the run of each state, and ``passages``
    are its readings; ``rig`` is the nominal one; ``branch`` is a modulus of the size of the law's
    [Pa].
    """

    film: ReducedFilm
    runs: tuple[tuple[float, VoltageHistory], ...]
    asked: Numbers
    passages: Passages
    rig: Rig
    branch: float
    nodes: dict[tuple[tuple[_Corner, ...], _Corner], Array] = field(default_factory=dict)

    @property
    def specimen(self) -> Specimen:
        return self.film.specimen

    @cached_property
    def shortest(self) -> float:
        """Shortest time that matters [s]."""
        signals = [history.whole for _, history in self.runs]
        steps = np.concatenate([np.diff(signal.breaks) for signal in signals])
        parts = self.passages[self.passages.end > self.passages.switched]
        reads = np.maximum(parts.end - parts.begin, parts.begin - parts.switched)
        return float(max(min([*steps, *reads]), 1e-4))

    @cached_property
    def longest(self) -> float:
        """Duration of the longest run [s]."""
        return max(float(history.whole.end) for _, history in self.runs)

    def hardening(self, branches: Sequence[ViscousBranch], mounted: float | None, scale: float
                  ) -> Array:
        """Compute η and its slopes by the logarithms of load, U² and moduli, shape (4, asked).

        ``branches`` are the nominal ones and more; ``scale`` multiplies the moduli of the latter.
        """
        nominal = self.specimen.membrane.branches
        if tuple(branches[:len(nominal)]) != nominal:
            return self.solved(tuple(branches), mounted)
        total = np.zeros((4, len(self.asked)))
        for some in _fewer(tuple(branches[len(nominal):]), _SIDE_BY_SIDE):
            if some or nominal:
                total += self._interpolated(some, mounted, scale)
        return total

    def _interpolated(self, extra: Sequence[ViscousBranch], mounted: float | None, scale: float
                      ) -> Array:
        """Interpolate the joint hardening by additional branches beyond that of fewer of them."""
        ratios, axes = [branch.modulus * scale / self.branch for branch in extra], []
        first = _FIRST if len(extra) < 2 else _FIRST_OF_TWO
        for branch, ratio in zip(extra, ratios, strict=True):
            axes += [(max(min(ratio, _STIFFEST) + _ADDED, _place(first)), first),
                     (min(max(branch.time, _TIMES[0] * self.shortest),
                          _TIMES[1] * self.longest), -inf)]
        if mounted is not None:
            axes.append((max(mounted, _TIMES[0] * self.shortest), -inf))
        total = np.zeros((4, len(self.asked)))
        for corner, weight in _corners(tuple(axes), _NODES[len(extra)]):
            pairs, age = corner[:2 * len(extra)], corner[2 * len(extra):]
            places = tuple(zip(pairs[::2], pairs[1::2], strict=True))
            total += weight * self._node(places, age)
        # The effect of a branch is proportional to its modulus.
        return prod(ratios) * total

    def _node(self, places: tuple[_Corner, ...], age: _Corner) -> Array:
        """Compute that hardening at nodes of modulus and time of each branch, over their moduli.

        Without additional branches it is that of the nominal ones. ``age`` is the node of the time
        since mounting, if it is an axis.
        """
        key = tuple(sorted(places)), age
        if key not in self.nodes:
            nominal = self.specimen.membrane.branches
            branches = [ViscousBranch(_ratio(modulus) * self.branch, _place(time))
                        for modulus, time in places]
            whole = self.solved((*nominal, *branches), _place(*age) if age else None)
            for some in _fewer(places, len(places) - 1):
                if some or nominal:
                    whole = whole - prod(_ratio(place[0]) for place in some) * self._node(some, age)
            self.nodes[key] = whole / prod(_ratio(place[0]) for place in places)
        return self.nodes[key]

    def solved(self, branches: tuple[ViscousBranch, ...], mounted: float | None) -> Array:
        """Solve :meth:`hardening` of any branches, by runs with exactly these."""
        film = self._with(branches, mounted)
        result = np.zeros((4, len(self.asked)))
        for numbers in self._alike():
            asked = np.flatnonzero(np.isin(self.asked, numbers))
            result[:3, asked] = self._hardened(film, numbers, asked)
        if self.specimen.membrane.branches:
            stiffer = tuple(replace(branch, modulus=(1 + _CHANGE) * branch.modulus)
                            for branch in branches)
            film = self._with(stiffer, mounted)
            for numbers in self._alike():
                asked = np.flatnonzero(np.isin(self.asked, numbers))
                result[3, asked] = (self._hardened(film, numbers, asked)[0]
                                    - result[0, asked]) / np.log1p(_CHANGE)
        return result

    def _with(self, branches: tuple[ViscousBranch, ...], mounted: float | None) -> ReducedFilm:
        membrane = replace(self.specimen.membrane, branches=branches, mounted=mounted)
        return replace(self.film, specimen=replace(self.specimen, membrane=membrane))

    @cached_property
    def _relaxed(self) -> ReducedFilm:
        return self._with((), None)

    def _alike(self) -> list[list[int]]:
        """Group the numbers of runs that may share their steps."""
        groups: dict[tuple[bytes, float], list[int]] = {}
        for number, (_, history) in enumerate(self.runs):
            groups.setdefault((history.whole.breaks.tobytes(), history.rest), []).append(number)
        return list(groups.values())

    def _hardened(self, film: ReducedFilm, numbers: list[int], asked: Numbers) -> Array:
        """Compute η of some runs' states, slopes by the logarithms of load and U²: (3, asked)."""
        histories = [self.runs[number][1] for number in numbers]
        mounted = film.specimen.membrane.mounted
        if mounted is not None and histories[0].rest == inf:
            # The film has been under load since it was mounted.
            histories = [replace(history, rest=mounted) for history in histories]
            film = self._with(film.specimen.membrane.branches, 0.0)
        motion = self._motion(film, numbers, histories)
        begin = None if histories[0].rest == inf else motion.flat
        try:
            moments = list(motion.moments(begin))
        except (NoBalance, Stopped):
            return np.zeros((3, len(asked)))
        time = np.array([moment.time for moment in moments])
        # The axes are time, variant and run.
        deflection = np.array([moment.deflection for moment in moments]).reshape(len(time), 3, -1)
        lines = np.array([numbers.index(run) for run in self.asked[asked].tolist()])
        times = self.passages.times[asked] + histories[0].begins
        times = times.clip(time[0], time[-1])
        path = Trace(time).at(deflection, times.ravel())
        path = path.reshape(*times.shape, *deflection.shape[1:])
        values = WEIGHTS @ path[np.arange(len(asked)), :, :, lines]
        force = motion.force.reshape(3, -1)[:, lines].T
        squared = np.multiply.outer(self._squares[asked], [1.0, 1.0, 1 + _CHANGE])
        etas = self._eta(values.ravel(), force.ravel(), squared.ravel()).reshape(-1, 3).T
        etas[1:] = (etas[1:] - etas[0]) / np.log1p(_CHANGE)
        return etas

    @property
    def _springs(self) -> tuple[Spring, ...]:
        return (Spring(self.rig.spring),) if self.rig.spring else ()

    @cached_property
    def _squares(self) -> Array:
        """Mean U² across the film in each passage [V²]."""
        return self.passages.squared(self.rig)

    def _motion(self, film: ReducedFilm, numbers: list[int], histories: Sequence[VoltageHistory]
                ) -> ReducedMotion:
        """Set up the motion of runs three times: as they are, under more load, under more U²."""
        stronger = replace(self.rig, amplifier_gain=(1 + self.rig.amplifier_gain)
                           * (1 + _CHANGE)**0.5 - 1)
        force = np.array([float(self.rig.force(self.runs[number][0])) for number in numbers])
        signals = [Supplied(history.whole, rig) for rig in (self.rig, self.rig, stronger)
                   for history in histories]
        return ReducedMotion(film, np.concatenate([force, (1 + _CHANGE) * force, force]),
                             JointSignal(signals), self._springs)

    @cached_property
    def _tangents(self) -> tuple[Array, Array] | None:
        """Tangents at each state's equilibrium, relaxed; and the part that a branch of 1 Pa adds.

        Shapes are (asked, shapes, shapes); None if one of the states has no equilibrium.
        """
        force = np.array([float(self.rig.force(self.runs[run][0])) for run in self.asked.tolist()])
        film, probe = self._relaxed, self._with((ViscousBranch(self.branch, 1.0),), None)
        try:
            q = film.at_rest(FilmLoads(force, self._squares, self._springs))
        except NoBalance:
            return None
        relaxed = film.pull(q, self._squares)[1]
        flow = probe.relaxed(q).step(probe.strain(q), 0.0)
        return relaxed, (probe.pull(q, self._squares, flow)[1] - relaxed) / self.branch

    def swing(self, branches: Sequence[ViscousBranch], scale: float, rate: Array) -> Array:
        """Compute the complex dynamic stiffness over that at rest at angular rates [1/s], (asked,).

        It is that against deflection. ``scale`` multiplies the branches' moduli.
        """
        if self._tangents is None:
            return np.ones(len(rate), complex)
        relaxed, added = self._tangents
        moduli = sum(scale * branch.modulus * 1j * rate * branch.time
                     / (1 + 1j * rate * branch.time) for branch in branches)
        whole = relaxed + np.asarray(moduli)[:, None, None] * added
        return np.linalg.inv(relaxed)[:, 0, 0] / np.linalg.inv(whole)[:, 0, 0]

    def _eta(self, deflection: Array, force: Array, squared: Array) -> Array:
        """Find the relative stiffening that gives a film's equilibrium this deflection."""
        film, eta = self._relaxed, np.zeros(len(deflection))
        load = force - self.rig.spring * deflection
        q = np.zeros((len(deflection), film.count))
        for _ in range(_ROUNDS):
            q[:, 0] = deflection
            under = FilmLoads(0.0, squared / (1 + eta))
            q = film.balanced(q, under, clamped=1)
            pull = film.pull(q, under.voltage_squared)[0][:, 0]
            capacitive = film.pull(q, 0.0 * squared)[0][:, 0]
            # (1 + η) F(y, U²/(1 + η)) = load; F is nearly a line in U².
            step = (load - (1 + eta) * pull) / np.where(np.abs(capacitive) > 0, capacitive, 1.0)
            eta = np.maximum(eta + step, -0.9)
            if np.abs(step).max() < 1e-9:
                break
        return eta


def _fewer(items: tuple[_Item, ...], most: int) -> Iterator[tuple[_Item, ...]]:
    """List all choices of at most this number of items."""
    return chain.from_iterable(combinations(items, count) for count in range(most + 1))


def _place(number: int) -> float:
    """Compute a coordinate of the lattice."""
    return float(np.exp(_SPACING * number))


def _ratio(number: int) -> float:
    """Compute the modulus at a lattice index, over the law's."""
    return float(_place(number) - _ADDED)


@lru_cache(maxsize=1024)
def _corners(axes: tuple[tuple[float, float], ...], nodes: int
             ) -> tuple[tuple[_Corner, float], ...]:
    """Find lattice points about a place with the weights of polynomials through ``nodes`` points.

    ``axes`` has the place and the lattice's lowest index for each axis.
    """
    parts = []
    for value, first in axes:
        number = float(np.log(value)) / _SPACING
        low = int(max(np.floor(number) + 1 - nodes // 2, first))
        x = number - low
        parts.append([(low + k, prod((x - j) / (k - j) for j in range(nodes) if j != k))
                      for k in range(nodes)])
    corners = []
    for combined in product(*parts):
        places = tuple(place for place, _ in combined)
        corners.append((places, prod(weight for _, weight in combined)))
    return tuple(corners)


@dataclass(frozen=True, eq=False)
class FilmMemory:
    """The films of a setup with memory of the runs of a table, about a fit.

    ``stiffness`` and ``permittivity`` are factors of the fit; ``films`` by specimen, None without
    runs; ``places`` are the indices of states by their keys.
    """

    films: tuple[RememberingFilm | None, ...]
    places: dict[StateKey, int]
    nominal: Rig
    stiffness: float
    permittivity: float

    @classmethod
    def of(cls, setup: Setup, table: ReadingTable, settings: Settings, stiffness: float,
           permittivity: float) -> FilmMemory:
        """Set up memory for the states in time of a table, with films scaled by a fit's factors."""
        states, places = table.states, dict[StateKey, int]()
        films: list[RememberingFilm | None] = []
        for number, specimen in enumerate(setup.specimens):
            runs = dict[tuple[float, VoltageHistory], int]()
            asked, chosen = list[int](), list[int]()
            for row, key in enumerate(states.keys_in_time):
                if key[0] == number and key not in places:
                    places[key] = len(asked)
                    asked.append(runs.setdefault((key[1], key[2]), len(runs)))
                    chosen.append(row)
            fitted = replace(specimen, membrane=with_factors(specimen.membrane, stiffness,
                                                             permittivity))
            films.append(_remembering(fitted, setup.rig, tuple(runs), np.array(asked),
                                      states.passages[np.array(chosen)], settings)
                         if asked else None)
        return cls(tuple(films), places, setup.rig, stiffness, permittivity)

    def hardening(self, setup: Setup, states: States, load: Array, stiffness: float,
                  permittivity: float) -> Array:
        """Compute 1 + η of each state, (states,), under a setup, loads [N] and factors of a fit."""
        result, scale = np.ones(len(states)), self.stiffness / stiffness
        for film, membrane, rows, place in self._of(setup, states):
            eta, by_load, by_square, by_modulus = film.hardening(
                membrane.branches, membrane.mounted, scale)[:, place]
            nominal = self.nominal.force(states.mass[rows])
            heavier = np.log(np.maximum(load[rows], 1e-12) / np.maximum(nominal, 1e-12))
            highest = float(np.abs(states.voltage[rows]).max(initial=1.0)) or 1.0
            gain = np.log(np.abs(setup.rig.film_voltage(highest))
                          / np.abs(self.nominal.film_voltage(highest)))
            stronger = 2 * gain + np.log(permittivity / self.permittivity)
            change = (by_load * _limited(heavier + np.log(scale))
                      + by_square * _limited(stronger + np.log(scale))
                      + by_modulus * _limited(np.log(scale)))
            result[rows] = np.maximum(1 + eta + change, 0.1)
        return result

    def swing(self, setup: Setup, states: States, stiffness: float, rate: Array) -> Array:
        """Compute complex stiffness against deflection over that at rest; rates [1/s]."""
        result = np.ones(len(states), complex)
        for film, membrane, rows, place in self._of(setup, states):
            rates = np.zeros(len(film.asked))
            rates[place] = rate[rows]
            result[rows] = film.swing(membrane.branches, self.stiffness / stiffness, rates)[place]
        return result

    def _of(self, setup: Setup, states: States
            ) -> Iterator[tuple[RememberingFilm, Film, Numbers, Numbers]]:
        """List films with branches, with the states they have and the places of these."""
        place = np.array([self.places.get(key, -1) for key in states.keys_in_time], dtype=np.int64)
        for number, film in enumerate(self.films):
            membrane = setup.specimens[number].membrane
            if film is None or not membrane.branches:
                continue
            there = (place >= 0) & (states.specimen[states.in_time] == number)
            if there.any():
                yield film, membrane, states.in_time[there], place[there]


def _limited(change: Array | float) -> Array:
    return np.clip(change, -_FAR, _FAR)


def _remembering(specimen: Specimen, rig: Rig, runs: tuple[tuple[float, VoltageHistory], ...],
                 asked: Numbers, passages: Passages, settings: Settings
                 ) -> RememberingFilm:
    stretches = [np.array([stretch]) for stretch in specimen.membrane.prestretch]
    slope = np.real(specimen.membrane.material.derivatives(*stretches)[1])
    modulus = float(slope[0] / stretches[0][0])
    length = max(float(history.signal.end) for _, history in runs)
    branches = specimen.membrane.branches or (ViscousBranch(modulus, length / 3),)
    even = replace(specimen, membrane=replace(
        specimen.membrane, branches=branches, mounted=None, thickness_gradient=(0.0, 0.0)),
        electrode=replace(specimen.electrode, patches=()))
    model = build_model(even, settings, rig.loading)
    forces = sorted({float(rig.force(mass)) for mass, _ in runs}, reverse=True)
    highest = max(float(np.abs(rig.film_voltage(np.abs(history.signal.voltage))).max())
                  for _, history in runs)
    for share in _HIGHEST:
        try:
            film = film_of_runs(model, forces, max(share * highest, 1.0))
            break
        except InputError:
            continue
    else:
        raise InputError("pull-in under the voltages of transient.csv", key="specimen",
                         given=specimen.name)
    return RememberingFilm(replace(film, specimen=specimen), runs, asked, passages, rig, modulus)
