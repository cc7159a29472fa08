"""Equilibrium of the film at a prescribed deflection of its plate or its centre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import Solution, moved, newton, simplified_newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import SLACK, Outcome, still_slack
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, State

#: First deflection of the plate, or of the centre, of a film that is slack when mounted; relative
#: to the frame's half extent.
_PUSHED = 0.2
#: Message for a taut film if a mechanism drives the plate away.
_DRIVEN = ("a mechanism of the rig drives the plate away from the flat film, and nothing stops it; "
           "use a weaker one, or a stiffer film")


def held(model: Model, deflection: float, voltage: float = 0.0, start: Solution | None = None,
         settings: PathSettings = PathSettings(), pressure: float | None = None) -> Outcome:
    """Solve for the film at a voltage [V], its plate held at a deflection [m].

    ``state.force`` [N] holds the plate. Without a plate ``state.pressure`` [Pa] holds the film's
    centre. With a plate, ``pressure`` [Pa] may prescribe a gas pressure; the default is the
    pressure of the start. The tangent of the solution may belong to a state on the way to it, if
    corrections by that tangent converge fast enough.
    """
    settings = settings.bounded(model)
    free = (model.pushed_by,)
    solution = start or _held_first(model, deflection, settings)
    origin, squared = model.deflection(solution.state), solution.state.voltage_squared
    begun = solution.state.pressure
    rise = 0.0 if pressure is None else pressure - begun
    advice = solution.advice
    there = (deflection, voltage**2, 0.0) == (origin, squared, rise)
    done, step = (1.0, 0.0) if there else (0.0, 1.0)
    while solution.converged and done < 1:
        share = min(1.0, done + step)
        target = origin + share * (deflection - origin)
        guess, tangent = solution.state, solution.tangent
        if tangent is not None and tangent.free != free:
            tangent = None  # in it the force does not follow the deflection
        if tangent is not None:
            motion, loads = tangent.along()
            guess = moved(model, guess, motion, target - model.deflection(guess), loads)
        guess = guess.under(voltage=squared + share * (voltage**2 - squared))
        if rise:
            guess = guess.under(pressure=begun + share * rise)
        problem = model, guess, free, (held_plate(target),), settings.newton
        trial = None if tangent is None else simplified_newton(*problem, tangent)
        if trial is None:
            solution.release()
            trial = newton(*problem)
        if trial.converged:
            solution, done, step = trial, share, 2 * step
        elif (step := step / 2) < settings.shortest:
            advice = trial.advice
            break
    return Outcome("equilibrium" if done == 1 else "not_converged", solution, advice)


def _held_first(model: Model, deflection: float, settings: PathSettings) -> Solution:
    """Solve for the mounted film with its plate held at zero deflection.

    A film slack when mounted is pushed out in the direction of the given deflection instead.
    """
    if model.slack_when_mounted:
        return first_shape(model, settings, -1 if deflection < 0 else 1)
    return newton(model, model.mounted(), (model.pushed_by,), (held_plate(0.0),), settings.newton)


def first_shape(model: Model, settings: PathSettings, sense: int) -> Solution:
    """Solve for the flat mounted film; if it is slack, for the film pushed out.

    The film is pushed out at its plate or at its centre. An unstressed flat membrane has no
    stiffness normal to its plane, so its load path cannot start there. ``sense``: 1 pushes along
    the load, -1 against it.
    """
    flat = newton(model, model.mounted(), settings=settings.newton)
    if flat.converged and flat.stable and model.in_tension(flat.state):
        return flat
    pushed_by = model.pushed_by
    if pushed_by == "force" and HEAVE not in model.plate_freedoms:
        return replace(flat, converged=False,
                       advice="the film is slack when mounted, and its plate cannot move")
    deflection = _PUSHED * model.size
    way = -sense if pushed_by == "pressure" else sense
    while True:
        target = sense * deflection
        solution = newton(model, _cone(model, target), (pushed_by,), (held_plate(target),),
                          settings.newton)
        pushed = solution.converged and way * solution.state.load(pushed_by) > 0
        if pushed and not still_slack(model, solution.state):
            return solution
        if deflection >= settings.reach * model.high:
            return replace(solution, converged=False, advice=(
                SLACK.format("when it is pushed out") if model.slack_when_mounted else _DRIVEN))
        deflection = min(2 * deflection, settings.reach * model.high)


def _cone(model: Model, deflection: float) -> State:
    """Build a cone from the frame to the raised plate; without a plate, a dome."""
    cone, plate = model.mounted(), model.specimen.plate
    x, y, _ = cone.positions.T
    to_frame = np.abs(model.specimen.frame.level(x, y))
    if plate is None:
        share = to_frame / to_frame[model.centre_node]
        cone.positions[:, 2] = deflection * share * (2 - np.minimum(share, 1.0))
        return cone
    to_plate = np.abs(plate.level(x, y))
    cone.positions[:, 2] = deflection * to_frame / (to_frame + to_plate)
    return replace(cone, plate=cone.plate.raised_to(deflection))
