"""Equilibria under load and voltage: adaptive ramps, and what lies at their end when there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from fem.model import Model
from fem.newton import NewtonSettings, Solution, extrapolate, newton
from fem.state import State, Unknown

Status = Literal["equilibrium", "no_equilibrium", "not_converged"]


@dataclass(frozen=True)
class PathSettings:
    """Steps of a ramp.

    ``first``: first step as a share of the ramp; ``shortest``: step, relative to the load or U² reached, below which
    the ramp is followed by the heave instead; ``lift``: step of the heave relative to the heave reached; ``reach``:
    heave, relative to the frame's half extent, at which a search for equilibrium ends.
    """

    newton: NewtonSettings = field(default_factory=NewtonSettings)
    first: float = 1.0
    shortest: float = 2e-4
    lift: float = 0.08
    reach: float = 1.5


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a search for an equilibrium ended.

    ``solution`` is the equilibrium, or the last one before the ramp ended. With status "no_equilibrium" the film
    pulled in: ``limit`` is the largest U² [V²] or force [N], as ``limited`` says, that has an equilibrium on this path.
    """

    status: Status
    solution: Solution
    advice: str = ""
    limit: float | None = None
    limited: Unknown | None = None

    @property
    def state(self) -> State:
        """The state of the solution."""
        return self.solution.state


def equilibrium(model: Model, force: float, voltage: float, spring: float = 0.0, start: Solution | None = None,
                settings: PathSettings = PathSettings()) -> Outcome:
    """The equilibrium under a force on the plate and a voltage across the film.

    Parameters
    ----------
    force
        On the plate along the load [N].
    voltage
        Across the film [V].
    spring
        Stiffness of a linear spring against the heave [N/m].
    start
        A converged solution to start from; by default the flat mounted film, loaded first and then charged.

    Returns
    -------
    Outcome
        "equilibrium" is stable under force and voltage and connected to the start without passing a limit point.
    """
    solution = start or _first(model, spring, settings)
    outcome = Outcome("equilibrium" if solution.converged else "not_converged", solution, solution.advice)
    targets: tuple[tuple[Unknown, float], ...] = (("force", force), ("voltage", voltage**2))
    for unknown, target in targets:
        if outcome.status == "equilibrium":
            outcome = ramp(model, outcome.solution, unknown, target, spring, settings)
    return outcome


def _first(model: Model, spring: float, settings: PathSettings) -> Solution:
    """The flat mounted film; or, where that is not taut, the film with the plate already pushed out.

    An unstressed flat membrane has no stiffness across its plane, so its load path cannot start there.
    """
    flat = newton(model, State.mounted(model), "heave", spring, settings.newton)
    if flat.converged and flat.stable and flat.tangent is not None and flat.tangent.wrinkling == 0:
        return flat
    x, y, _ = model.reference.T
    to_frame, to_plate = np.abs(model.specimen.frame.level(x, y)), np.abs(model.specimen.plate.level(x, y))
    heave = 0.2 * model.size
    positions = model.reference.copy()
    positions[:, 2] = heave * to_frame / (to_frame + to_plate)
    pushed = State(positions, flat.state.plate.raised_to(heave))
    found = newton(model, pushed, "force", spring, settings.newton)
    if found.converged and found.state.force > 0:
        return found
    advice = "the film is slack when mounted, and still when the plate is pushed out"
    return replace(found, converged=False, advice=advice)


def voltage_path(model: Model, force: float, voltages: list[float], spring: float = 0.0,
                 settings: PathSettings = PathSettings()) -> Iterator[Outcome]:
    """Equilibria at voltages [V] under one force, each started from the last one found.

    Voltages at or above one that has no equilibrium have none either and are not searched.
    """
    outcome: Outcome | None = None
    start: Solution | None = None
    failed = np.inf
    for voltage in voltages:
        if outcome is None or voltage < failed:
            outcome = equilibrium(model, force, voltage, spring, start, settings)
            if outcome.status == "equilibrium":
                start = outcome.solution
            else:
                failed = voltage
        yield outcome


def held(model: Model, heave: float, voltage: float = 0.0, start: Solution | None = None,
         settings: PathSettings = PathSettings()) -> Outcome:
    """The film with the plate held at a heave [m] and a voltage [V]; ``state.force`` is what holds it [N]."""
    solution = start or newton(model, State.mounted(model), "force", 0.0, settings.newton)
    origin, charge = solution.state.plate.heave, solution.state.voltage_squared
    advice = solution.advice
    done, step = (0.0, 1.0) if (heave, voltage**2) != (origin, charge) else (1.0, 0.0)
    while solution.converged and done < 1:
        share = min(1.0, done + step)
        guess = extrapolate(model, solution, heave=origin + share * (heave - origin))
        guess = replace(guess, voltage_squared=charge + share * (voltage**2 - charge))
        trial = newton(model, guess, "force", 0.0, settings.newton)
        if trial.converged:
            solution, done, step = trial, share, 2 * step
        elif (step := step / 2) < settings.shortest:
            advice = trial.advice
            break
    return Outcome("equilibrium" if done == 1 else "not_converged", solution, advice)


def ramp(model: Model, start: Solution, name: Unknown, target: float, spring: float, settings: PathSettings) -> Outcome:
    """Change the force [N] or U² [V²] to a target in steps as long as Newton converges to a stable state."""
    origin = start.state.force if name == "force" else start.state.voltage_squared
    if target == origin:
        return Outcome("equilibrium", start)
    solution, done, step = start, 0.0, settings.first
    already = abs(origin / (target - origin))
    history = [_stiffness(start, name)]
    while done < 1:
        share = min(1.0, done + step)
        value = origin + share * (target - origin)
        trial = newton(model, _predicted(model, solution, name, value), "heave", spring, settings.newton)
        if trial.converged and trial.stable:
            solution, done, step = trial, share, 2 * step
            history.append(_stiffness(trial, name))
        elif (step := step / 2) < max(settings.shortest * (already + done), 1e-12):
            stalled = _stalled(Outcome("not_converged", solution, trial.advice), history, name, target)
            if stalled.status == "no_equilibrium":
                return stalled
            return _follow_heave(model, solution, name, target, spring, settings)
    return Outcome("equilibrium", solution)


def _stiffness(solution: Solution, name: Unknown) -> tuple[float, float]:
    assert solution.tangent is not None
    return _value(solution.state, name), solution.tangent.heave_stiffness


def _stalled(outcome: Outcome, history: list[tuple[float, float]], name: Unknown, target: float) -> Outcome:
    """Tell pull-in from mere failure at the end of a ramp whose steps have become tiny.

    Near a limit point the square of the heave's stiffness falls linearly to zero with the force or U². If it vanishes
    before the target, and has fallen to less than half or vanishes within 5 %, the film pulls in where it vanishes.
    This needs no state beyond the limit, where a film that has lost tension may have none that can be computed.
    """
    limits = []
    # Several pairs: once the film has wrinkled its stiffness is erratic, and the states before tell more.
    for (v0, k0), (v1, k1) in pairwise(history[-8:]):
        if v0 < v1 and 0 < k1 < k0:
            limit = v1 + k1**2 * (v1 - v0) / (k0**2 - k1**2)
            if history[-1][0] <= limit < target and (k1 < 0.5 * history[0][1] or limit < 1.05 * v1):
                limits.append((limit / v1, limit))
    if not limits:
        return outcome
    return _pulled_in(outcome.solution, name, min(limits)[1])


def _pulled_in(last: Solution, name: Unknown, limit: float) -> Outcome:
    word = {"force": "load", "voltage": "voltage"}[name]
    return Outcome("no_equilibrium", last, f"the film pulls in before the {word} is reached", limit, name)


def _predicted(model: Model, solution: Solution, name: Unknown, value: float) -> State:
    if name == "force":
        return extrapolate(model, solution, force=value)
    return extrapolate(model, solution, voltage_squared=value)


def _follow_heave(model: Model, start: Solution, name: Unknown, target: float, spring: float,
                  settings: PathSettings) -> Outcome:
    """Raise the heave and solve for the force or U², which passes limit points without trouble.

    Ends where the target is reached, where the path turns back (pull-in), or where nothing converges any more.
    """
    state, advice = start.state, "the path could not be followed"
    history = [(state.plate.heave, _value(state, name))]
    last = newton(model, state, name, spring, settings.newton)
    stable = start
    lift = settings.lift * max(state.plate.heave, 0.02 * model.size)
    shortest = lift / 256
    while last.converged and lift > shortest and last.state.plate.heave < settings.reach * model.size:
        trial = newton(model, extrapolate(model, last, heave=last.state.plate.heave + lift), name, spring,
                       settings.newton)
        if not trial.converged:
            lift, advice = lift / 2, trial.advice
            continue
        value = _value(trial.state, name)
        if value >= target:
            return _between(model, last, trial, name, target, spring, settings)
        if value < history[-1][1]:
            if lift > settings.lift * 0.1 * trial.state.plate.heave:
                lift /= 2
                continue
            limit = _parabola_top([*history, (trial.state.plate.heave, value)])
            return _pulled_in(stable, name, limit)
        history.append((trial.state.plate.heave, value))
        last = trial
        if trial.stable:
            stable = trial
    return Outcome("not_converged", stable, advice)


def _between(model: Model, below: Solution, above: Solution, name: Unknown, target: float, spring: float,
             settings: PathSettings) -> Outcome:
    """The equilibrium at a force or U² that two solutions bracket.

    The heave is sought first, with the force or U² free: near a limit point that is well conditioned and this is not.
    """

    def miss(heave: float) -> float:
        nearest = newton(model, extrapolate(model, below, heave=heave), name, spring, settings.newton)
        return _value(nearest.state, name) - target

    ends = below.state.plate.heave, above.state.plate.heave
    if not miss(ends[0]) <= 0 <= miss(ends[1]):
        return Outcome("not_converged", below, "the path could not be followed to the load asked for")
    heave = float(brentq(miss, *ends, xtol=1e-9 * model.size, rtol=1e-12, maxiter=50))
    near = newton(model, extrapolate(model, below, heave=heave), name, spring, settings.newton)
    found = newton(model, _set(near.state, name, target), "heave", spring, settings.newton)
    if found.converged and found.stable:
        return Outcome("equilibrium", found)
    return Outcome("not_converged", below, found.advice or "the state found is unstable")


def _value(state: State, name: Unknown) -> float:
    return state.force if name == "force" else state.voltage_squared


def _set(state: State, name: Unknown, value: float) -> State:
    return replace(state, force=value) if name == "force" else replace(state, voltage_squared=value)


def _parabola_top(history: list[tuple[float, float]]) -> float:
    """Largest value of the parabola through the last three points."""
    if len(history) < 3:
        return max(value for _, value in history)
    x, y = np.array(history[-3:]).T
    a, b, c = np.polyfit(x - x[1], y, 2)
    return float(c - b * b / (4 * a))
