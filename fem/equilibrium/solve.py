"""Equilibrium under given loads."""

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

#: Distance from an unstable equilibrium, relative to the frame, below which the plate counts as at
#: it.
_AT_IT = 1e-9

#: Number of unknowns above which elements of half the order find the start. For smaller films they
#: save little. Set by trial.
_LARGE = 5_000
#: Largest distance of an equilibrium from its guess, relative to its motion. A larger one means
#: that the film is near a limit. Set by trial.
_ALIKE = 0.1

#: Largest number of iterations for a short step; if more are needed, the step fails.
_FEW = 8


def equilibrium(model: Model, force: float, voltage: float, pressure: float = 0.0,
                start: Solution | None = None, settings: PathSettings = PathSettings(),
                ends: bool = True) -> Outcome:
    """Solve for the equilibrium under a force [N], a voltage [V] and a gas pressure [Pa].

    The force acts on the plate in the direction of the load; a film without a plate has none. The
    gas below film and plate lifts them against the load. ``start`` is a converged solution. The
    default start is the flat mounted film, which is first loaded and then charged.

    An "equilibrium" is stable under these loads and connected to the start without passing a limit
    point. If a mechanism makes the plate jump at a limit point, the path continues from the new
    equilibrium, and the outcome is ``snapped``. Without ``ends`` two searches are omitted: for the
    limit of a film without equilibrium, and for an equilibrium close to that limit.
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
    # A force pushes out a film that is slack when mounted. It is removed only after the gas holds
    # the film.
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
    """Solve for the first shape.

    If a mechanism moves the plate away at once, the first shape is the equilibrium that it reaches.
    """
    if model.loading.softening and not model.slack_when_mounted:
        flat = newton(model, model.mounted(), settings=settings.newton)
        if flat.converged and not flat.stable:
            # The plate is mounted at 0, near this equilibrium or at it.
            beside = -model.deflection(flat.state)
            way = beside if abs(beside) > _AT_IT * model.size else sense
            if (rest := landed(model, flat, way, settings)) is not None:
                return rest
    return first_shape(model, settings, sense)


def _ramped(ramp: LoadRamp, start: Solution) -> Outcome:
    """Change a load to its target; continue after each jump that a mechanism causes."""
    outcome = ramp.run(start)
    while outcome.critical is not None and not outcome.thins:
        landed = snapped(ramp.model, outcome.critical, ramp.settings)
        if landed is None:
            break
        outcome = replace(ramp.run(landed), snapped=True)
    return outcome


def _nested(model: Model, force: float, voltage: float, pressure: float, settings: PathSettings
            ) -> Outcome | None:
    """Solve for a large film from the solution with elements of half the order.

    This is nested iteration. None if the coarse film is no good guess: near a limit, wrinkled, or
    where Newton's method fails.
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
    """Solve for the equilibrium near a guess, under its loads; None if there is none.

    Newton's method may fail, or the film may be near a limit or wrinkled. ``alike``: largest
    distance from the guess, relative to the film's motion.
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
    """Create settings to unload a film slack when mounted: short steps, few iterations.

    Where such a film goes slack, Newton's method would use all its iterations and fail.
    """
    return replace(settings, handover=1.0, arc=replace(settings.arc, longest=settings.arc.first),
                   newton=replace(settings.newton, iterations=_FEW))


def _sense(model: Model, force: float, pressure: float) -> int:
    """Find the direction in which a slack film moves: 1 along the load, -1 if the gas lifts it.

    A film that is pushed in carries the load and the gas pressure on its plate, and about half of
    the gas pressure on itself.
    """
    mesh = model.discretisation
    film_area = float(mesh.weights.sum() * mesh.mirrored)
    film_weight = float((model.pull * mesh.weights).sum() * mesh.mirrored)
    lifting = pressure * (float(model.plate_area) + film_area / 2)
    return -1 if lifting > force + film_weight / 2 else 1
