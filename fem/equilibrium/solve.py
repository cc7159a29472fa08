"""The equilibrium under given loads, or with the plate held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.fem.equilibrium.constraints import difference, held_plate, length
from tympan.fem.equilibrium.newton import Solution, moved, newton, simplified_newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import SLACK, Outcome, Ramp, still_slack, without_mechanism
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, Load, State

#: How far the plate, or the centre, of a film that is slack when mounted is first pushed out,
#: relative to the frame's half extent.
_PUSHED = 0.2

#: Unknowns from which on elements of half the order find the start: below, they save little. Set by
#: trial.
_LARGE = 5_000
#: How far the equilibrium may be from such a start, relative to its motion. If it is further, the
#: film is beside a limit. Set by trial.
_ALIKE = 0.1

#: Iterations with which Newton's method makes a short step, if at all.
_FEW = 8


def equilibrium(model: Model, force: float, voltage: float, pressure: float = 0.0,
                start: Solution | None = None,
                settings: PathSettings = PathSettings()) -> Outcome:
    """The equilibrium under a force on the plate [N], a voltage [V] and a gas pressure [Pa].

    The force, which there is none of without a plate, pushes along the load; the gas below film and
    plate lifts them against it. ``start`` is a converged solution; by default the flat mounted
    film, loaded first and then charged. An "equilibrium" is stable under these loads and connected
    to the start without passing a limit point.
    """
    settings = settings.bounded(model)
    if start is None and (outcome := _nested(model, force, voltage, pressure, settings)):
        return outcome
    solution = start or _first(model, settings, _sense(model, force, pressure))
    outcome = Outcome("equilibrium" if solution.converged else "not_converged", solution,
                      solution.advice)
    if start is None and not solution.converged:
        outcome = replace(outcome, advice=without_mechanism(model, 0.0) or outcome.advice)
    targets: dict[Load, float] = {"force": force, "pressure": pressure, "voltage": voltage**2}
    # A film mounted slack starts pushed out by a force, which it may lose only once the gas holds
    # it.
    pushed = start is None and solution.state.load(model.pushed_by) != 0
    order: tuple[Load, ...] = ("force", "pressure", "voltage")
    for load in ("pressure", "force", "voltage") if pushed else order:
        if outcome.status == "equilibrium":
            unloads = abs(targets[load]) < abs(outcome.state.load(load))
            stepping = _unloading(settings) if unloads and model.slack_when_mounted else settings
            outcome = Ramp(model, load, targets[load], stepping).run(outcome.solution)
    changed = outcome.status == "equilibrium" and outcome.solution is not solution
    if changed and still_slack(model, outcome.state):
        return Outcome("not_converged", outcome.solution, SLACK.format("under its loads"))
    return outcome


def _nested(model: Model, force: float, voltage: float, pressure: float, settings: PathSettings
            ) -> Outcome | None:
    """A large film's equilibrium, from that of elements of half the order: nested iteration.

    None where the film is not like those: beside a limit, wrinkled, or where Newton's method goes
    astray.
    """
    fine = model.discretisation
    order = fine.mesh.order // 2
    if fine.free_count < _LARGE or order < 1:
        return None
    coarse = replace(model, discretisation=fine.of_order(order))
    alone = replace(settings, newton=replace(settings.newton, budget=None))
    outcome = equilibrium(coarse, force, voltage, pressure, settings=alone)
    outcome.solution.release()
    if outcome.status != "equilibrium":
        return None
    before = outcome.state.positions - coarse.discretisation.reference
    guess = replace(outcome.state, positions=fine.reference
                    + fine.interpolated(coarse.discretisation, before))
    solution = newton(model, guess, settings=settings.newton)
    if solution.converged and solution.stable and model.in_tension(solution.state):
        gone, missed = (length(model, difference(model, solution.state, state))
                        for state in (model.mounted(), guess))
        if missed <= _ALIKE * gone and not still_slack(model, solution.state):
            return Outcome("equilibrium", solution)
    solution.release()
    return None


def _unloading(settings: PathSettings) -> PathSettings:
    """Settings to unload a film slack when mounted: short steps, soon given up.

    Where such a film goes slack, Newton's method uses all its iterations and fails.
    """
    return replace(settings, handover=1.0, arc=replace(settings.arc, longest=settings.arc.first),
                   newton=replace(settings.newton, iterations=_FEW))


def _sense(model: Model, force: float, pressure: float) -> int:
    """The way a film goes that resists nothing yet: 1 along the load, -1 where the gas lifts it.

    A film pushed in carries what acts on its plate, the gas on it included, and about half of the
    gas on itself.
    """
    mesh = model.discretisation
    film_area = float(mesh.weights.sum() * mesh.mirrored)
    film_weight = float((model.pull * mesh.weights).sum() * mesh.mirrored)
    lifting = pressure * (float(model.plate_area) + film_area / 2)
    return -1 if lifting > force + film_weight / 2 else 1


def _first(model: Model, settings: PathSettings, sense: int) -> Solution:
    """The flat mounted film; or, where that is slack, the film pushed out at plate or centre.

    An unstressed flat membrane has no stiffness across its plane, so its load path cannot start
    there. ``sense``: 1 to push it along the load, -1 against it.
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
            return replace(solution, converged=False,
                           advice=SLACK.format("when it is pushed out"))
        deflection = min(2 * deflection, settings.reach * model.high)


def _cone(model: Model, deflection: float) -> State:
    """A cone from the frame to the lifted plate; without a plate a dome."""
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


def held(model: Model, deflection: float, voltage: float = 0.0, start: Solution | None = None,
         settings: PathSettings = PathSettings(), pressure: float | None = None) -> Outcome:
    """The film under a voltage [V], its plate held at a deflection [m] by ``state.force`` [N].

    Without a plate its centre, by ``state.pressure`` [Pa]; with one a gas may have a ``pressure``
    [Pa], that of the start where it is left out. The tangent of the solution may be that of a state
    on the way there, if near enough to correct by.
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
    """The mounted film with its plate held; where that is slack, pushed the way it shall go."""
    if model.slack_when_mounted:
        return _first(model, settings, -1 if deflection < 0 else 1)
    return newton(model, model.mounted(), (model.pushed_by,), (held_plate(0.0),), settings.newton)
