"""A film whose plate is displaced at one voltage: its equilibria, and the limits on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.held_path import HeldSpan, held_path, held_stiffness, with_tangent
from tympan.fem.equilibrium.newton import Solution, newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.span import Span
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import FREEDOMS, State
from tympan.fem.results.fields import largest, node_fields
from tympan.fem.results.limit_states import (
    INSTABILITY,
    TENSION,
    LimitState,
    Sign,
    begun,
    passed,
)
from tympan.fem.roots import NoValueHere, root_between
from tympan.studies.force.result import NOT_FOLLOWED, ForceCurve, ForceLimit
from tympan.studies.walk.film_point import HeldPoint

#: Accuracy of the displacement at a limit, relative to the frame. It is far below the
#: discretisation error of a mesh.
_SHARP = 1e-6
#: Number of states summarised at once; more would exceed the cache.
_TOGETHER = 12


@dataclass(frozen=True, eq=False)
class FollowedForce:
    """Equilibria of a model whose plate is displaced, at a nominal ``voltage`` [V].

    ``stiffness``: slope of the force [N/m]. ``firm``: whether each equilibrium is stable with the
    plate held. ``limits``: limits reached on the way. ``ended``: where the curve ends before its
    last displacement.
    """

    model: Model
    voltage: float
    states: list[State] = field(default_factory=list)
    stiffness: list[float] = field(default_factory=list)
    firm: list[bool] = field(default_factory=list)
    limits: list[ForceLimit] = field(default_factory=list)
    ended: ForceLimit | None = None

    @property
    def displacement(self) -> Array:
        """Displacements of the plate [m]."""
        return np.array([self.model.deflection(state) for state in self.states])

    @property
    def force(self) -> Array:
        """Forces on the plate [N]."""
        return np.array([state.force for state in self.states])

    @property
    def segment_voltages(self) -> dict[str, float]:
        """Nominal voltages of the electrode's segments by name [V]."""
        return self.model.specimen.electrode.voltages(self.voltage)

    @property
    def curve(self) -> ForceCurve:
        """Curve as it is stored."""
        stable = [firm and slope > 0 for firm, slope in zip(self.firm, self.stiffness, strict=True)]
        return ForceCurve(
            voltage_V=self.voltage, segment_voltages_V=self.segment_voltages,
            displacement_m=tuple(self.displacement.tolist()),
            force_N=tuple(self.force.tolist()), stable=tuple(stable),
            stiffness_N_per_m=tuple(self.stiffness), limits=tuple(self.limits), ended=self.ended,
            **self._of_fields(), **self._of_guide())

    def _of_guide(self) -> dict[str, Any]:
        """Collect the stored forces and moments of the guide on the plate."""
        held = np.array([self.model.guiding(state) for state in self.states]).reshape(-1, 6)
        names = {"x": "force_x_N", "y": "force_y_N", "rx": "moment_x_Nm", "ry": "moment_y_Nm"}
        return {name: tuple(held[:, FREEDOMS.index(freedom)].tolist())
                for freedom, name in names.items()}

    def _of_fields(self) -> dict[str, tuple[Any, ...]]:
        """Collect the stored values of the film at each displacement."""
        numbers: dict[str, list[Any]] = {name: [] for name in (
            "tense", "max_stretch", "max_true_stress_Pa", "breakdown_share", "capacitance_F")}
        for start in range(0, len(self.states), _TOGETHER):
            states = self.states[start : start + _TOGETHER]
            for fields in node_fields(self.model, states):
                numbers["tense"].append(bool((fields.tension == Tension.TAUT).all()))
                numbers["max_stretch"].append(largest(fields.stretch_1))
                numbers["max_true_stress_Pa"].append(largest(fields.stress_1))
                numbers["breakdown_share"].append(largest(fields.breakdown_share))
            numbers["capacitance_F"] += self.model.integrals(states)[1].tolist()
        return {name: tuple(values) for name, values in numbers.items()}


def follow(model: Model, voltage: float, displacements: Sequence[float], start: Solution,
           settings: PathSettings) -> FollowedForce:
    """Follow a film from a state held at the first of some displacements [m], ascending."""
    first = with_tangent(model, start, settings)
    curve = FollowedForce(model, voltage, [first.state], [held_stiffness(first)], [_firm(first)])
    before = HeldPoint.of(model, first)
    curve.limits.extend(_limit(before, state) for state in begun(before))
    if any(limit.kind == INSTABILITY.kind for limit in curve.limits):
        return FollowedForce(model, voltage, ended=curve.limits[-1])
    for step in held_path(model, displacements[1:], first, settings):
        after = HeldPoint.of(model, step.span.end)
        events = [(_limit(film, state), film.point.solution)
                  for state, _, film in passed(before, after,
                                               partial(_where, step.span, before, after))]
        events.sort(key=lambda event: event[0].displacement_m)
        gone = next((event for event in events if event[0].kind == INSTABILITY.kind), None)
        gone = gone and (gone[0], with_tangent(model, gone[1]))
        _add(curve, step, gone)
        if gone is not None:
            curve.limits.extend(limit for limit, _ in events if limit.displacement_m
                                <= gone[0].displacement_m and limit != gone[0])
            loose = any(limit.kind == TENSION.kind for limit in curve.limits)
            if not loose and HeldPoint.of(model, gone[1]).thins:  # it wrinkles before it thins
                curve.limits.append(replace(gone[0], kind=TENSION.kind))
            curve.limits.append(gone[0])
            return replace(curve, ended=gone[0])
        curve.limits.extend(limit for limit, _ in events)
        before = after
    if len(curve.states) < len(displacements):
        last = curve.states[-1]
        return replace(curve, ended=ForceLimit(
            kind=NOT_FOLLOWED, displacement_m=model.deflection(last), force_N=last.force))
    return curve


def at_displacement(curve: FollowedForce, displacement: float, settings: PathSettings
                    ) -> Solution | None:
    """Solve for the film held at a displacement [m] of its curve; None outside the curve."""
    where = curve.displacement
    if not len(where) or not where[0] <= displacement <= where[-1]:
        return None
    solution = newton(curve.model, near(curve, displacement), ("force",),
                      (held_plate(displacement),), settings.newton)
    return solution if solution.converged else None


def near(curve: FollowedForce, displacement: float) -> State:
    """Interpolate a curve's state at a displacement linearly between two states."""
    where = curve.displacement
    number = int(np.clip(np.searchsorted(where, displacement), 1, len(where) - 1))
    before, after = curve.states[number - 1 : number + 1]
    share = (displacement - where[number - 1]) / (where[number] - where[number - 1])
    positions = before.positions + share * (after.positions - before.positions)
    closer = after if share > 0.5 else before
    return replace(closer, positions=positions, plate=closer.plate.raised_to(displacement),
                   force=before.force + share * (after.force - before.force))


def _add(curve: FollowedForce, step: HeldSpan, gone: tuple[ForceLimit, Solution] | None) -> None:
    """Add a step to a curve, up to the film's instability."""
    span, model = step.span, curve.model
    solutions = list(step.solutions)
    places, _, slopes = step.forces
    slopes = slopes[1:]
    firm = curve.firm[-1], _firm(span.end)
    firms = [firm[1]] * len(solutions) if firm[0] == firm[1] else [
        _firm(with_tangent(model, solution)) for solution in solutions]
    if gone is not None:
        kept = [number for number, place in enumerate(places[1:])
                if place < gone[0].displacement_m]
        solutions = [*(solutions[number] for number in kept), gone[1]]
        slopes = np.array([*(slopes[number] for number in kept), held_stiffness(gone[1])])
        firms = [*(firms[number] for number in kept), firm[0]]  # up to there
    curve.states.extend(solution.state for solution in solutions)
    curve.stiffness.extend(slopes.tolist())
    curve.firm.extend(firms)


def _firm(solution: Solution) -> bool:
    """Check whether a state is stable with the plate held.

    Holding the plate removes one motion, the deflection.
    """
    assert solution.tangent is not None
    return bool(solution.tangent.negative == (held_stiffness(solution) < 0))


def _where(span: Span, before: HeldPoint, after: HeldPoint, sign: Sign) -> HeldPoint | None:
    """Find the film between two points of a step at which a sign changes; None if not found."""
    low, high = span.ends
    films = {low: before, high: after}

    def value(place: float) -> float:
        if place not in films:
            solution = span.at(place) or newton(
                span.model, span.foretold(place), ("force",), (held_plate(place),), span.newton)
            if not solution.converged:
                raise NoValueHere
            if sign.needs != "state":
                solution = with_tangent(span.model, solution)
            films[place] = HeldPoint.of(span.model, solution)
        return sign.value(films[place])

    root = root_between(value, low, high, xtol=_SHARP * span.model.size)
    return None if root is None else films[min(films, key=lambda place: abs(place - root))]


def _limit(film: HeldPoint, state: LimitState) -> ForceLimit:
    x, y = film.place(state)
    return ForceLimit(kind=state.kind, displacement_m=film.deflection,
                      force_N=film.point.state.force, x_m=x, y_m=y, segment=film.segment(state))
