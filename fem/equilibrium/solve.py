"""The equilibrium under given loads."""

from __future__ import annotations

from dataclasses import replace

from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.held import first_shape
from tympan.fem.equilibrium.held import held as held
from tympan.fem.equilibrium.newton import Solution, newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import SLACK, LoadRamp, Outcome, still_slack, without_mechanism
from tympan.fem.equilibrium.snap import landed, snapped
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State

#: Distance from an unstable equilibrium, relative to the frame, below which a plate is at it.
_AT_IT = 1e-9

#: Unknowns from which on elements of half the order find the start: below, they save little. Set by
#: trial.
_LARGE = 5_000
#: How far an equilibrium may be from a guess of it, relative to its motion. If it is further, the
#: film is beside a limit. Set by trial.
_ALIKE = 0.1

#: Iterations with which Newton's method makes a short step, if at all.
_FEW = 8


def equilibrium(model: Model, force: float, voltage: float, pressure: float = 0.0,
                start: Solution | None = None, settings: PathSettings = PathSettings(),
                ends: bool = True) -> Outcome:
    """The equilibrium under a force on the plate [N], a voltage [V] and a gas pressure [Pa].

    The force, which there is none of without a plate, pushes along the load; the gas below film and
    plate lifts them against it. ``start`` is a converged solution; by default the flat mounted
    film, loaded first and then charged. An "equilibrium" is stable under these loads and connected
    to the start without passing a limit point; a plate that a mechanism makes jump at one goes on
    from where it comes to rest, and the outcome is ``snapped``. Without ``ends`` it is not sought
    where a film without equilibrium ends, nor whether it has one close to its end.
    """
    settings = settings.bounded(model)
    if start is None and (outcome := _nested(model, force, voltage, pressure, settings)):
        return outcome
    solution = start or _begun(model, settings, _sense(model, force, pressure))
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
            before = outcome.snapped
            ramp = LoadRamp(model, load, targets[load], stepping, ends)
            outcome = _ramped(ramp, outcome.solution)
            outcome = replace(outcome, snapped=outcome.snapped or before)
    changed = outcome.status == "equilibrium" and outcome.solution is not solution
    if changed and still_slack(model, outcome.state):
        return Outcome("not_converged", outcome.solution, SLACK.format("under its loads"))
    return outcome


def _begun(model: Model, settings: PathSettings, sense: int) -> Solution:
    """The first shape; of a plate that a mechanism drives off at once, where it comes to rest."""
    if model.loading.softening and not model.slack_when_mounted:
        flat = newton(model, model.mounted(), settings=settings.newton)
        if flat.converged and not flat.stable:
            # It is mounted at 0, beside this equilibrium or at it.
            beside = -model.deflection(flat.state)
            way = beside if abs(beside) > _AT_IT * model.size else sense
            if (rest := landed(model, flat, way, settings)) is not None:
                return rest
    return first_shape(model, settings, sense)


def _ramped(ramp: LoadRamp, start: Solution) -> Outcome:
    """A load changed to its target; where a mechanism makes the plate jump, on from there."""
    outcome = ramp.run(start)
    while outcome.critical is not None and not outcome.thins:
        landed = snapped(ramp.model, outcome.critical, ramp.settings)
        if landed is None:
            break
        outcome = replace(ramp.run(landed), snapped=True)
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
    solution = equilibrium_near(model, guess, settings)
    return None if solution is None else replace(outcome, solution=solution)


def equilibrium_near(model: Model, guess: State, settings: PathSettings, alike: float = _ALIKE
                     ) -> Solution | None:
    """The equilibrium under the loads of a guess near it; None where the film is not like that.

    Such a film is beside a limit or wrinkled, or Newton's method goes astray. ``alike``: how far it
    may be from the guess, relative to its motion.
    """
    solution = newton(model, guess, settings=settings.newton)
    if solution.converged and solution.stable and model.in_tension(solution.state):
        gone, missed = (length(model, difference(model, solution.state, state))
                        for state in (model.mounted(), guess))
        if missed <= alike * gone and not still_slack(model, solution.state):
            return solution
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
