"""Equilibria of the plates of films, by the forces on them at every deflection."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.fem.membrane.biases import Bias, acting
from tympan.fem.membrane.loading import Guide, Loading
from tympan.studies.case import solved_loading
from tympan.studies.diagnosis.hypothesis import (
    PERMITTIVITY,
    SIZES,
    STIFFNESS,
    Hypothesis,
    parameters_of,
    sizes_of,
)
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.diagnosis.reduced.force_law import BEYOND, ForceSurface, continued, in_powers
from tympan.studies.diagnosis.reduced.in_time import charged
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms
from tympan.studies.diagnosis.reduced.sampling import coarse
from tympan.studies.effects import Setup

#: Force and its derivative by deflection, at deflections, shape (..., states) each.
RestBalance = Callable[[Array], tuple[Array, Array]]

#: Negative deflection down to which a force law is valid, as a share of the largest.
_BELOW = 0.2

#: Least stiffness that divides a missing force, as a share of the flat film's, so that the
#: continuation stays near.
_SOFT = 0.1
#: Least stiffness [N/m], to avoid division by 0.
_LEAST = 1e-6
#: Least deflection of a film at its limit, as a share of a linear film's: voltage softens it.
_LINEAR = 1.0

#: Step of U² for derivatives, as a share of the largest.
_TINY = 1e-4

#: Number of places between which a crossing is sought.
_PLACES = 17

#: Halvings that exhaust a bracket, by the digits of a number.
_HALVINGS = 60
#: Step of Newton's method [m] after which the next one, its square, is negligible.
_SMALL = 1e-9

#: Differences of deflections below this are zero [m].
_STAYS = 1e-10


class FilmsAtRest:
    """States of films at some unknowns: the forces on their plates, and their equilibria.

    Force laws reach a little beyond their grids; from there they are continued by lines. A state
    without equilibrium is ``extended`` in proportion to the force that is missing at its limit
    point. So a fit can come back from unknowns without equilibrium.
    """

    def __init__(self, films: ReducedFilms, hypothesis: Hypothesis, unknowns: Array,
                 states: States, like: FilmsAtRest | None = None) -> None:
        """Prepare the states; ``like`` has the same films under nearly the same voltages."""
        self.films, self.hypothesis, self.states = films, hypothesis, states
        self.unknowns, self._like = unknowns, like
        self.stiffness = float(np.exp(unknowns[STIFFNESS]))
        self.permittivity = float(np.exp(unknowns[PERMITTIVITY]))
        alike = like is not None and np.array_equal(like.unknowns[SIZES], unknowns[SIZES])
        self.setup: Setup = like.setup if like and alike else films.outer(hypothesis, unknowns)
        self.rig = self.setup.rig
        self._reached: _Reach = like._reached if like is not None else _Reach.of(films, states)
        self.low, self.high, self.top = self._reached.low, self._reached.high, self._reached.top
        self.free = np.isnan(states.deflection)

    @cached_property
    def load(self) -> Array:
        """Pull on each plate other than film, springs and friction [N], shape (states,).

        On a film without plate it is the gas pressure along the deflection [Pa].
        """
        areas = np.array([specimen.plate_area if self.rig.plate_pressure else 0.0
                          for specimen in self.films.setup.specimens])
        load: Array = np.where(self._plate, self.rig.force(
            self.states.mass, areas[self.states.specimen]), -self.rig.gas_pressure)
        if self.films.masses is not None:
            load = load + self.films.masses.weight(self.setup)[self.states.specimen]
        return load

    @cached_property
    def _plate(self) -> Mask:
        """States of films with a plate; mechanisms act only on these."""
        there = np.array([specimen.plate is not None for specimen in self.films.setup.specimens])
        return there[self.states.specimen]

    @cached_property
    def _film_weight(self) -> Array | float:
        """Share of its film's own weight that each plate carries, minus lifting gas [N], (states,).

        It does not grow with the film's stiffness; the sampled force does not include it.
        """
        if self.films.masses is None:
            return 0.0
        masses = self.films.masses
        return (masses.film_weight - self.rig.gas_pressure * masses.lifted_area)[
            self.states.specimen]

    @cached_property
    def hardening(self) -> Array | float:
        """Factor on the stiffness by the films' memory."""
        if self.films.memory is None:
            return 1.0
        return self.films.memory.hardening(self.setup, self.states, self.load, self.stiffness,
                                           self.permittivity)

    @cached_property
    def voltage_squared(self) -> Array:
        """U² [V²] at which nominal films have the same state, shape (states,)."""
        seen = np.asarray(self.rig.film_voltage(self.states.voltage,
                                                self.states.voltage_direction))
        return (self.permittivity / self.stiffness / self.hardening
                * charged(self.states, self.rig, seen**2, self.capacitance))

    @property
    def capacitance(self) -> Array:
        """Approximate capacitance of the film of each state [F]: that of the flat film."""
        return self.permittivity * self.films.capacitance[self.states.specimen]

    @cached_property
    def surfaces(self) -> list[tuple[Numbers, ForceSurface]]:
        """States and film of each specimen that is read."""
        if self._like is not None:
            return self._like.surfaces
        return [(rows, self.films.surface(number, self.hypothesis, self.unknowns))
                for number, rows in enumerate(self.states.of_specimen) if len(rows)]

    @cached_property
    def powers(self) -> Array:
        """Coefficients of the films' forces by powers of the deflection's coordinate.

        The shape is (powers, states).
        """
        if self._like is None:
            return self._powers(self.voltage_squared)
        further = self.voltage_squared - self._like.voltage_squared
        return self._like.powers + self._like.powers_by_voltage * further

    def _powers(self, voltage_squared: Array) -> Array:
        powers = np.empty((len(self.low), self.films.laws[0].grid.deflections))
        for rows, surface in self.surfaces:
            powers[rows] = continued(surface, self.of_segments(rows, voltage_squared[rows]))
        return (powers @ in_powers(powers.shape[1])).T

    def of_segments(self, rows: Numbers, voltage_squared: Array) -> Array:
        """Compute U² [V²] of the segments of states of one film from that of each state.

        The shape is (states, segments); it is (states,) for an electrode in one piece.
        """
        electrode = self.setup.specimens[int(self.states.specimen[rows[0]])].electrode
        if not electrode.segments:
            return voltage_squared
        shares = self.states.shares_of(electrode)[rows]
        reaching = np.stack(electrode.arriving(list(shares.T)), 1)
        squared: Array = voltage_squared[:, None] * reaching**2
        return squared if len(electrode.segments) > 1 else squared[:, 0]

    @cached_property
    def powers_by_voltage(self) -> Array:
        """Derivatives of these coefficients by U², shape (powers, states)."""
        tiny = _TINY * self.top
        return (self._powers(self.voltage_squared + tiny)
                - self._powers(self.voltage_squared - tiny)) / (2 * tiny)

    def changes_films(self, number: int) -> bool:
        """Check whether an unknown changes the films' force laws, not only through the voltage."""
        if number >= SIZES.start and parameters_of(self.hypothesis)[number - SIZES.start].switch:
            return True
        if number == STIFFNESS:
            return any(parameter.dimension == "stress" for cause in self.hypothesis
                       if cause.name not in self.films.outer_effects
                       for parameter in cause.effect.parameters)
        return number >= SIZES.start and not any(
            cause.name in self.films.outer_effects
            for cause in self.hypothesis
            if sizes_of(self.hypothesis, cause).start <= number
            < sizes_of(self.hypothesis, cause).stop)

    @cached_property
    def _came(self) -> tuple[Numbers, Array, Array, Mask]:
        """Index and direction as in ``came``; equilibria in that direction; whether they exist."""
        states = self.states
        rubs = any(cause.name in self.films.rubbing_effects for cause in self.hypothesis)
        if not (rubs or self.rig.friction):
            return np.arange(len(states)), np.zeros(len(states)), *self._resting(0.0)
        (first, above), (last, below) = self._resting(1.0), self._resting(-1.0)
        place, way = play(first, np.where(below, last, np.inf), states.of_run,
                          np.where(states.direction < 0, -1.0, 1.0))
        return (place, np.where(self.free, way, 0.0), np.where(way > 0, first, last),
                np.where(way > 0, above, below))

    @property
    def came(self) -> tuple[Numbers, Array]:
        """Index of the state whose deflection a sticking plate keeps, and its direction of motion.

        The direction is 1 down, -1 up; without friction it is 0, and the index is the state's own.
        """
        return self._came[:2]

    def _resting(self, way: float) -> tuple[Array, Mask]:
        return resting_place(partial(self.balance, way=way), self.low, self.high)

    @cached_property
    def _rest(self) -> tuple[Array, Mask]:
        """Equilibria of plates within the laws' reach in deflection, or the nearest to it.

        They are those of moving plates: one with friction may stay where it was.
        """
        _, _, at, rests = self._came
        return np.where(self.free, at, self.states.deflection), rests | ~self.free

    @cached_property
    def possible(self) -> Mask:
        """States of stable equilibrium within the force laws' reach."""
        return self._rest[1][self._came[0]] & (self.voltage_squared <= self.top)

    @cached_property
    def short(self) -> Mask:
        """States without equilibrium, which may have one if force laws reach further."""
        at, rests = self._rest
        ended = ~rests & ((at <= self.low) | (at >= self.high))
        return ended[self._came[0]] | (self.voltage_squared > self.top)

    @cached_property
    def deflection(self) -> Array:
        """Deflection of each state [m], nan where it is not possible."""
        return np.where(self.possible, self.extended_deflection, np.nan)

    @cached_property
    def extended_deflection(self) -> Array:
        """Deflection of each state [m]; without equilibrium its continuation."""
        return self._moved[self._came[0]]

    @cached_property
    def _moved(self) -> Array:
        """Deflection of each state if the plate moves there [m], or its continuation."""
        at, rests = self._rest
        if rests.all():
            return at
        # Where pull-in comes at smaller and smaller deflection, force is missing at a constant one.
        flat = self._flat_stiffness
        least = -_LINEAR * self.balance(np.zeros_like(at))[0] / flat
        beyond = np.where(least > 0, np.maximum(at, np.minimum(least, self.high)),
                          np.minimum(at, np.maximum(least, self.low)))
        at = np.where(rests, at, beyond)
        force, rate = self.balance(at)
        return np.where(rests, at, at - force / np.maximum(rate, _SOFT * flat))

    @property
    def _flat_stiffness(self) -> Array:
        """Stiffness of the flat film without voltage [N/m], positive, shape (states,)."""
        stiffness = np.empty(len(self.low))
        for rows, surface in self.surfaces:
            stiffness[rows] = surface.flat_stiffness
        return np.maximum(self.stiffness * stiffness, _LEAST)

    @property
    def tension(self) -> Array:
        """Stiffness of the flat films under voltage, over the nominal films' without, (states,)."""
        flat = np.zeros(len(self.low))
        outer = self.rig.spring + float(acting(self._biases, np.zeros(()))[2])
        stiffness = self.balance(flat, 0.0)[1] - outer * self._plate
        return np.maximum(stiffness / self.films.flat_stiffness[self.states.specimen], _SOFT)

    def stiffness_at(self, deflection: Array) -> Array:
        """Compute the stiffness of film and rig at deflections [m] [N/m], positive, (states,)."""
        return np.maximum(self.balance(deflection, 0.0)[1], _LEAST)

    @cached_property
    def _about(self) -> tuple[Array, Array]:
        """Missing force at the deflections of moving plates [N], and positive stiffness [N/m]."""
        force, stiffness = self.balance(self._moved)
        return force, np.maximum(stiffness, _LEAST)

    def shift(self, there: FilmsAtRest) -> Array:
        """Compute the change of deflections to those at nearby unknowns [m], shape (states,).

        At an equilibrium it follows from the implicit function theorem: only the balance of forces
        at fixed deflections is differenced.
        """
        (place, way, *_), (force, stiffness) = self._came, self._about
        missing = there.balance(self._moved, way)[0] - force
        shift = np.where(self.free, -missing / stiffness, 0.0)[place]
        rests = self._rest[1][place]
        if rests.all():
            return shift
        return np.where(rests, shift, there.extended_deflection - self.extended_deflection)

    def balance(self, deflection: Array, way: Array | float | None = None) -> tuple[Array, Array]:
        """Compute the missing force [N], and the stiffness of film and rig [N/m].

        The deflections [m] of the states have the shape (..., states). A plate with friction moves
        to them down (1) or up (-1); by default as it came to its own.
        """
        force, rate = self._film_force(deflection)
        stiffness = self.stiffness * self.hardening
        force = stiffness * force + (stiffness - 1) * self._film_weight
        _, push, bend = acting(self._biases, deflection)
        push, bend = push + self.rig.spring * deflection, bend + self.rig.spring
        load = self.rig.rubbed(self.load, self._came[1] if way is None else way)
        if not self._plate.all():
            push, bend = self._plate * push, self._plate * bend
            load = np.where(self._plate, load, self.load)
        return force + push - load, stiffness * rate + bend

    @cached_property
    def _biases(self) -> tuple[Bias, ...]:
        """Mechanisms between plate and ground, without the rig's spring."""
        return _mechanisms(self.rig.biases, self.rig.guide, self.rig.gravity, self.setup.formula)

    def _film_force(self, deflection: Array) -> tuple[Array, Array]:
        """Compute the force of films of nominal stiffness [N], and its derivative [N/m]."""
        at = np.clip(deflection, self.low, self.high)
        reach, odd = self._reached.deflection, self._reached.odd
        share = at / reach
        x = 2 * share - 1 if odd is None else np.where(odd, 2 * share**2, 2 * share) - 1
        force, rate = np.broadcast_to(self.powers[-1], x.shape), np.zeros_like(x)
        for power in self.powers[-2::-1]:
            rate = rate * x + force
            force = force * x + power
        rate = rate * (2.0 if odd is None else np.where(odd, 4 * share, 2.0)) / reach
        if odd is not None:
            rate = np.where(odd, force + at * rate, rate)
            force = np.where(odd, at * force, force)
        return force + rate * (deflection - at), rate


@lru_cache(maxsize=32)
def _mechanisms(biases: tuple[Bias, ...], guide: Guide, gravity: float, formula: str | None
                ) -> tuple[Bias, ...]:
    """Solve the joined films of mechanisms once, since a fit needs them thousands of times."""
    return solved_loading(Loading(biases, guide=guide, gravity=gravity), coarse(formula)).biases


@dataclass(frozen=True, eq=False)
class _Reach:
    """Reach of the force laws at the states, shape (states,) each.

    ``deflection`` [m] and ``top``, a U² [V²], are the largest; ``low`` and ``high`` [m] bound where
    the laws are valid. ``odd`` marks states whose force changes its sign with the deflection;
    None for no such state.
    """

    deflection: Array
    odd: Mask | None
    low: Array
    high: Array
    top: Array

    @classmethod
    def of(cls, films: ReducedFilms, states: States) -> _Reach:
        """Find the reach of each state's film."""
        grids = [law.grid for law in films.laws]
        deflection = np.array([grid.deflection for grid in grids])[states.specimen]
        odd = np.array([grid.odd for grid in grids])[states.specimen]
        voltage_squared = np.array([grid.voltage_squared for grid in grids])[states.specimen]
        # An odd force is known on both sides.
        high = (1 + BEYOND) * deflection
        return cls(deflection, odd if odd.any() else None,
                   -np.where(odd, high, _BELOW * deflection), high, (1 + BEYOND) * voltage_squared)


def resting_place(balance: RestBalance, low: Array, high: Array) -> tuple[Array, Mask]:
    """Find the first equilibria of plates released at no deflection, and which of them have one.

    ``balance`` is the force that holds the plate minus the load [N]; ``low`` < 0 < ``high`` [m],
    shape (states,), bound the search. Without equilibrium the result is the deflection at which the
    least force is missing: a limit point, or ``low`` or ``high``.
    """
    shares, far, way = np.linspace(0.0, 1.0, _PLACES)[:, None], high, np.ones_like(high)

    def along(share: Array) -> tuple[Array, Array]:
        force, rate = balance(share * far)
        return np.where(np.isnan(force), -np.inf, way * force), way * rate * far

    force, rate = along(shares)
    if np.any(force[0] > 0):
        way = np.where(force[0] > 0, -1.0, 1.0)
        far = np.where(force[0] > 0, low, high)
        force, rate = along(shares)
    crossed = force >= 0
    rests: Mask = np.any(crossed, axis=0)
    place = np.where(rests, crossed.argmax(0), force.argmax(0))
    earlier = np.maximum(place - 1, 0)
    before, after = shares[earlier, 0], shares[place, 0]
    last, rising = place == _PLACES - 1, rate >= 0
    limited = ~rests & np.where(last, ~rising[-1], rising[0] | (place > 0))
    if limited.any():
        def falling(share: Array) -> tuple[Array, Array]:
            tiny = 1e-5
            ahead, behind = along(share + tiny)[1], along(share - tiny)[1]
            return -along(share)[1], -(ahead - behind) / (2 * tiny)

        beyond = shares[np.minimum(place + 1, _PLACES - 1), 0]
        nearest = np.where(limited, before, after)
        farthest = np.where(limited, beyond, after)
        after = crossing(falling, nearest, farthest, after)
        rests = rests | (limited & (along(after)[0] >= 0))
    before = np.where(rests, before, after)
    start, end = np.take_along_axis(force, np.stack([earlier, place]), 0)
    with np.errstate(all="ignore"):
        secant = before + start / (start - end) * (after - before)
    return crossing(along, before, after, secant) * far, rests


def play(first: Array, last: Array, runs: Iterable[Numbers],
         begun: Array) -> tuple[Numbers, Array]:
    """Find the state whose deflection a plate with friction keeps, and its direction of motion.

    ``first`` and ``last`` are the deflections between which it sticks, shape (states,). The
    ``runs`` are states in their order; ``begun`` is the direction of the first one: 1 down, -1 up.
    """
    at, way = np.arange(len(first)), np.ones(len(first))
    for run in runs:
        deflection, before = 0.0, -1
        for state, lower, upper in zip(run.tolist(), first[run].tolist(), last[run].tolist(),
                                       strict=True):
            if before < 0:
                way[state] = begun[state]
            elif deflection < lower - _STAYS:
                way[state] = 1.0
            elif deflection > upper + _STAYS:
                way[state] = -1.0
            else:
                at[state], way[state] = at[before], way[before]
                continue
            deflection, before = (lower if way[state] > 0 else upper), state
    return at, way


def crossing(function: RestBalance, low: Array, high: Array, start: Array) -> Array:
    """Find roots below ``high`` of functions not positive at ``low``: Newton in brackets.

    ``function`` computes values and derivatives, shape (n,) each. The search begins at ``start``
    where that is between the bounds.
    """
    lower, upper = low.copy(), high.copy()
    point = np.where((start >= low) & (start <= high), start, (low + high) / 2)
    with np.errstate(all="ignore"):
        for _ in range(_HALVINGS):
            value, slope = function(point)
            lower, upper = np.where(value < 0, point, lower), np.where(value < 0, upper, point)
            following = point - np.where(value == 0, 0.0, value / slope)
            inside = (following >= lower) & (following <= upper)
            following = np.where(inside, following, (lower + upper) / 2)
            moved, point = np.abs(following - point), following
            if not np.any(moved > _SMALL):
                break
    return point
