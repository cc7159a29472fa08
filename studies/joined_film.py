"""The force of another film whose plate a rod joins to this one, from its own equilibria.

The force is a function of the deflection alone. It is solved at places that do not depend on the
order of questions; between them it is a polynomial, with energy, force and stiffness consistent.
The film has no inertia, and its branches are relaxed.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from tympan.base.errors import InputError
from tympan.fem.equilibrium.held_path import with_tangent
from tympan.fem.equilibrium.newton import Solution, moved
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import still_slack
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.biases import Interval, JoinedFilm
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.quintics import CUBIC, HALVINGS, Known, cubic_miss, powers_of, values
from tympan.fem.results.firmness import least_firmness

#: First distance between solved places, over the frame's half extent: within it a film's force is
#: nearly a polynomial.
_STEP = 1 / 16

@dataclass(frozen=True, eq=False)
class _Rung:
    """A film held at a deflection [m], with force [N] and stiffness [N/m]."""

    place: float
    force: float
    stiffness: float
    solution: Solution

    @property
    def known(self) -> Known:
        return self.place, self.force, self.stiffness


@dataclass(frozen=True, eq=False)
class _Piece:
    """The force between two deflections [m]: powers of the share of the way, and the energy [J]."""

    low: float
    high: float
    powers: tuple[float, ...]
    stored: float

    def derivatives(self, place: Any) -> tuple[Any, Any, Any]:
        span = self.high - self.low
        energy, force, stiffness = values(self.powers, (place - self.low) / span, span)
        return self.stored + energy, force, stiffness


class _Side:
    """Known pieces of a film's force on one side of its start, ``way`` 1 or -1."""

    def __init__(self, way: int, start: _Rung) -> None:
        self.way = way
        self.rungs = [start]
        self.pieces: list[_Piece] = []
        self.ends: list[float] = []
        self.energy = 0.0
        self.ended = False


class HeldForce:
    """The force of a film by the deflection at which its plate is held, under one voltage [V].

    It is solved as far as needed, from a ``start`` outwards, and ends where the film becomes
    unstable or is far beyond its frame.

    Raises
    ------
    InputError
        When the film has no equilibrium at the start.
    """

    def __init__(self, model: Model, voltage: float, start: float) -> None:
        self.model, self.voltage = model, voltage
        self.settings = PathSettings()
        self._step = _STEP * model.size
        outcome = held(model, start, 0.0, settings=self.settings)
        if outcome.status != "equilibrium" or still_slack(model, outcome.state):
            raise InputError("must be one with which the other film has a shape: it holds that "
                             f"film's plate at {1e3 * start:.4g} mm; {outcome.advice or 'slack'}",
                             key="bias.rod")
        first = self._solved(start, outcome.solution)
        if first is None:
            raise InputError("must be one that the other film bears with its plate at "
                             f"{1e3 * start:.4g} mm", key="bias.voltage",
                             given=f"{voltage / 1e3:g} kV")
        self._start = first
        self._sides = {way: _Side(way, first) for way in (1, -1)}

    @property
    def places(self) -> tuple[float, ...]:
        """Deflections [m] between which its force is one polynomial, over the whole range."""
        most = int(2 * self.settings.reach * self.model.size / self._step)
        return tuple(self._start.place + number * self._step for number in range(-most, most + 1))

    def derivatives(self, place: Any) -> tuple[Any, Any, Any]:
        """Compute energy from the start [J], force [N], stiffness [N/m] at a deflection [m].

        They are nan where the film has none. The deflection may be complex.
        """
        piece = self._piece(float(np.real(place)))
        return (np.nan, np.nan, np.nan) if piece is None else piece.derivatives(place)

    def by_voltage(self, place: float) -> tuple[float, float]:
        """Differentiate energy and force by the voltage [J/V, N/V] at a deflection [m]."""
        side = self._side(place)
        near = min(side.rungs, key=lambda rung: abs(rung.place - place))
        there = self._solved(place, near.solution)
        if there is None:
            return np.nan, np.nan
        model, state = self.model, there.solution.state
        assert there.solution.tangent is not None
        film, plate = there.solution.tangent.along()[0]
        inner, outer = model.by_load(state, "voltage")
        mirrored = model.discretisation.mirrored
        capacitance = model.capacitance(state) - model.capacitance(self._start.solution.state)
        return (-self.voltage * float(capacitance),
                2 * self.voltage * mirrored * float(inner @ film + outer @ plate))

    def _side(self, place: float) -> _Side:
        return self._sides[1 if place >= self._start.place else -1]

    def _piece(self, place: float) -> _Piece | None:
        side = self._side(place)
        far = abs(place - self._start.place)
        if not far <= 2 * self.settings.reach * self.model.size:
            return None
        while not side.ended and (not side.ends or side.ends[-1] < far):
            self._extend(side)
        number = bisect(side.ends, far)
        if number == len(side.ends):
            number -= bool(side.ends) and far == side.ends[-1]
        return side.pieces[number] if number < len(side.pieces) else None

    def _extend(self, side: _Side) -> None:
        """Extend a side by one step, or up to the film's end."""
        near = side.rungs[-1]
        known: dict[float, _Rung | None] = {}
        place = self._start.place + side.way * len(side.rungs) * self._step
        spans, last, side.ended = self._spans(near, place, known, 0)
        for inner, middle, outer in spans:
            piece = _piece(*((inner, middle, outer) if side.way > 0 else (outer, middle, inner)))
            # The energy is counted from the start.
            end = piece.derivatives(outer.place)[0] - piece.derivatives(inner.place)[0]
            low = side.energy if side.way > 0 else side.energy + end
            side.pieces.append(replace(piece, stored=low))
            side.ends.append(abs(outer.place - self._start.place))
            side.energy += end
        for rung in (near, *known.values()):
            if rung is not None and rung is not last:
                rung.solution.release()
        side.rungs.append(last)

    def _spans(self, near: _Rung, place: float, known: dict[float, _Rung | None], halved: int
               ) -> tuple[list[tuple[_Rung, _Rung, _Rung]], _Rung, bool]:
        """List intervals up to a deflection, with middles; the last place; whether it ends."""
        middle = (near.place + place) / 2
        for where in (place, middle):
            if where not in known:
                known[where] = self._solved(where, near.solution)
        inner, outer = known[middle], known[place]
        if inner is not None and outer is not None:
            if halved == HALVINGS or cubic_miss(near.known, inner.known, outer.known) <= CUBIC:
                return [(near, inner, outer)], outer, False
        elif halved == HALVINGS:
            return [], near, True
        spans, last, ended = self._spans(near, middle, known, halved + 1)
        if ended:
            return spans, last, True
        if outer is None:
            known.pop(place)  # it may be found from a nearer place
        more, last, ended = self._spans(last, place, known, halved + 1)
        return spans + more, last, ended

    def _solved(self, place: float, start: Solution) -> _Rung | None:
        """Solve the film held at a deflection [m]; None if it has no stable equilibrium there."""
        model = self.model
        if abs(place) > self.settings.reach * model.size:
            return None
        outcome = held(model, place, self.voltage, start, self.settings)
        if outcome.status != "equilibrium":
            return None
        solution = self._exact(with_tangent(model, outcome.solution, self.settings), place)
        if solution is None or solution.tangent is None:
            return None
        stiffness = float(solution.tangent.along()[1]["force"])
        # With the plate held there is one motion less, the deflection.
        firm = solution.tangent.negative == (stiffness < 0)
        if not firm or not least_firmness(model, solution.state) > 0:
            return None
        return _Rung(place, float(solution.state.force), stiffness, solution)


    def _exact(self, solution: Solution, place: float) -> Solution | None:
        """Correct a solution once more by the state's own tangent, and give it a new tangent.

        Newton's method leaves errors of the force that would show between neighbouring places.
        """
        model, state, tangent = self.model, solution.state, solution.tangent
        if tangent is None:
            return None
        residual = model.residual(model.nodal_forces(state), state)
        motion, loads = tangent.correct(residual, [model.deflection(state) - place])
        exact = moved(model, state, motion, 1.0, loads)
        return with_tangent(model, replace(solution, state=exact), self.settings)


def _piece(low: _Rung, middle: _Rung, high: _Rung) -> _Piece:
    powers = powers_of(low.known, middle.known, high.known)
    return _Piece(low.place, high.place, tuple(powers.tolist()), 0.0)


@dataclass(frozen=True, eq=False)
class SolvedFilm:
    """A joined film as a mechanism; the numbers of ``given`` may be complex."""

    law: ClassVar[str] = JoinedFilm.law
    softening: ClassVar[tuple[Interval, ...]] = JoinedFilm.softening
    given: JoinedFilm
    curve: HeldForce

    @classmethod
    def of(cls, given: JoinedFilm, model: Model) -> Self:
        """Join a film with a model of it, loaded only by its own weight."""
        return cls(given, HeldForce(model, given.voltage, given.other(0.0)))

    @property
    def kinks(self) -> tuple[float, ...]:
        """Deflections [m] of this plate between which its force is one polynomial."""
        shift = float(np.real(self.given.other(0.0)))
        return tuple(place - shift for place in self.curve.places)

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        place = self.given.other(deflection)
        energy, force, stiffness = self.curve.derivatives(place)
        if np.iscomplexobj(self.given.voltage):
            change = 1j * np.imag(self.given.voltage)
            by_energy, by_force = self.curve.by_voltage(float(np.real(place)))
            energy, force = energy + change * by_energy, force + change * by_force
        return energy, force, stiffness


def with_films(loading: Loading, solved: Callable[[JoinedFilm], SolvedFilm]) -> Loading:
    """Replace each joined film among the actions by its solved film."""
    if not any(isinstance(bias, JoinedFilm) for bias in loading.biases):
        return loading
    return replace(loading, biases=tuple(solved(bias) if isinstance(bias, JoinedFilm) else bias
                                         for bias in loading.biases))
