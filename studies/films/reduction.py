"""A reduced film from a field model: from which states, with what shapes and points, how near.

It is made from a few runs of the field model: the film at rest under some loads, and one motion
there and back. How near it comes is measured on other runs, under other masses and signals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from tympan.fem.equilibrium.newton import WORK, Budget
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.density import from_virgin, principal_stretches
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.transient.integrate import Moment, StepSettings, Stopped, Transient
from tympan.geometry.errors import InputError
from tympan.studies.films.film import NoBalance, ReducedFilm
from tympan.studies.films.motion import PulledIn, ReducedMotion
from tympan.studies.signals import Pieces, Signal, Sine, ramp, random_steps, step
from tympan.studies.trace import Trace

Array = NDArray[np.float64]

#: The largest part of a deformation that the shapes leave out, over the largest deformation: some
#: 0.5 µm of a heave of 5 mm, below what films are known to.
_MOTION_LEFT_OUT = 1e-4

#: Most shapes: the cost of a step grows with their square.
_MOST_SHAPES = 8

#: The part of the virtual work that the points leave out, as small as that of the shapes.
_WORK_LEFT_OUT = 1e-4

#: How long the voltage of the motion it is made from stays, in times of the slowest branch.
_LONG = 3.0

#: Shares of the first force under which the film is looked at without voltage: how shapes change
#: with the load.
_LIGHTER = (0.3, 0.65)
#: Shares of the highest voltage at which it is looked at under each force, beside the whole one.
_BETWEEN = (0.0, 0.7)

#: The lowest voltage of the runs that a film is held against, as a share of the highest.
_LOW = 0.05
#: The highest voltage of their steps and sines: other than the film was made with.
_HIGH = 0.85
#: Levels of the run with random steps.
_LEVELS = 5
#: Their seed: any number would do.
_SEED = 7
#: Times at which deflections are compared. Set by trial.
_SAMPLES = 401

#: How many loads at rest the making of a film takes as much work as, motions included: a few
#: hundred tangents, and ten times as many are left to it.
IN_TIME = 100


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A state of a film, and what its branches remember, None of one without."""

    state: State
    memory: Memory | None = None


def reduced_film(model: Model, forces: Sequence[float], voltage: float, spring: float = 0.0,
                 path: PathSettings = PathSettings()) -> ReducedFilm:
    """The film of a model, for forces [N] up to a voltage across it [V], and how near it comes.

    ``spring``: of the model's loading, if there is one on its plate [N/m]. Made under the first
    force, and from states at rest under all; held against the model under the last.

    Raises
    ------
    InputError
        When the film pulls in at such loads, the reduced one does not follow it there, or the field
        model takes more work than it may.
    """
    path = path.bounded(model, followed=True, loads=IN_TIME)
    film = film_of_runs(model, forces, voltage, path)
    errors = {name: error_of(film, model, forces[-1], signal, spring, path)
              for name, signal in held_out(model, voltage).items()}
    astray = [name for name, error in errors.items() if not np.isfinite(error)]
    if astray:
        raise InputError("has no reduced film that follows it in time under such loads: take lower "
                         "voltages, or `tympan transient`", key=model.specimen.name,
                         given=", ".join(astray))
    return replace(film, errors=errors)


def film_of_runs(model: Model, forces: Sequence[float], voltage: float,
                 path: PathSettings = PathSettings()) -> ReducedFilm:
    """As :func:`reduced_film`, and not held against the model."""
    gradient, patches = (model.specimen.membrane.thickness_gradient,
                         model.specimen.electrode.patches)
    if gradient != (0.0, 0.0):
        raise InputError("must be 0, 0 for a reduced film", key="membrane.thickness_gradient",
                         given=gradient)
    if patches:
        raise InputError("must not be there for a reduced film", key="electrode.patch",
                         given=str(patches[0]))
    path = path.bounded(model, followed=True, loads=IN_TIME)
    run = _there_and_back(model, voltage)
    snapshots = [*_at_rest(model, forces, voltage, path), *_in_motion(model, forces[0], run, path)]
    return reduced(model, snapshots)


def _there_and_back(model: Model, voltage: float) -> Pieces:
    length = _LONG * max(branch.time for branch in model.specimen.membrane.branches)
    return Pieces(length * np.array([0.0, 0.0, 1.0, 1.0, 2.0]),
                  voltage * np.array([0.0, 1.0, 1.0, 0.0, 0.0]))


def _at_rest(model: Model, forces: Sequence[float], voltage: float, path: PathSettings
             ) -> list[Snapshot]:
    """Equilibria under parts of the loads, and under all."""
    loads = [*((share * forces[0], 0.0) for share in _LIGHTER),
             *((force, share * voltage) for force in forces for share in (*_BETWEEN, 1.0))]
    outcomes = [equilibrium(model, *load, settings=path) for load in loads]
    path.require_work(model.specimen.name)
    return [Snapshot(outcome.state) for outcome in outcomes if outcome.status == "equilibrium"]


def _in_motion(model: Model, force: float, signal: Signal, path: PathSettings) -> list[Snapshot]:
    try:
        return [Snapshot(moment.state, moment.memory)
                for moment in _field_motion(model, force, signal, path)]
    except Stopped as ending:
        raise InputError(f"the film pulls in after {ending.time:.4g} s at the highest voltage: "
                         "take a lower one", key="voltage",
                         given=f"{signal.peak / 1e3:.5g} kV") from None


def _field_motion(model: Model, force: float, signal: Signal, path: PathSettings) -> list[Moment]:
    """The field model's moments; relaxed under force and first voltage, or mounted and flat."""
    film, state = model.specimen.membrane, model.mounted()
    steps = StepSettings(newton=path.newton)
    if film.mounted is None:
        outcome = equilibrium(model, force, signal.first, settings=path)
        path.require_work(model.specimen.name)
        if outcome.status != "equilibrium":
            raise Stopped("pull_in", 0.0)
        state = outcome.state
        memory = Memory.relaxed(film, from_virgin(model.cauchy_green(state.positions),
                                                  film.prestretch))
    else:
        memory = Memory.mounted(film, model.volumes.shape)
    try:
        return list(Transient(model, force, signal, settings=steps).moments(state, memory))
    except Stopped:
        path.require_work(model.specimen.name)
        raise


def held_out(model: Model, voltage: float) -> dict[str, Signal]:
    """Signals that it is held against, by name; as long as the branches' times say."""
    times = [branch.time for branch in model.specimen.membrane.branches]
    slow, middle = max(times), float(np.exp(np.mean(np.log(times))))
    low, high = _LOW * voltage, _HIGH * voltage
    return {"step": step(low, high, 0.0, slow),
            "sine": Sine((low + high) / 2, (high - low) / 2, middle, 2.0),
            "ramp": ramp(low, voltage, 2 * slow),
            "random": random_steps(low, voltage, middle / 2, _LEVELS, _SEED)}


def error_of(film: ReducedFilm, model: Model, force: float, signal: Signal, spring: float = 0.0,
             path: PathSettings = PathSettings()) -> float:
    """The largest error of the deflection under a force [N] and a signal, over the field's range.

    The range includes the deflection before the signal begins. Infinite where a film pulls in, or
    the reduced one has no equilibrium there.
    """
    when = np.linspace(float(signal.breaks[0]), float(signal.breaks[-1]), _SAMPLES)
    motion = ReducedMotion(film, force, signal, spring, budget=Budget(WORK))
    try:
        field = _field_motion(model, force, signal, path)
        moments = list(motion.moments())
    except (NoBalance, PulledIn, Stopped):
        return float("inf")
    exact = Trace(np.array([moment.time for moment in field])).at(
        np.array([moment.state.plate.deflection for moment in field]), when)
    near = Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.heave for moment in moments]), when)
    before = motion.begin.heave
    return float(np.abs(near - exact).max() / np.ptp(np.append(exact, before)))


def reduced(model: Model, snapshots: Sequence[Snapshot]) -> ReducedFilm:
    """The film of a model, reduced to what its snapshots do."""
    mesh = model.discretisation
    volumes = model.volumes.ravel() * mesh.mirrored
    covered = np.broadcast_to(mesh.covered, model.volumes.shape).ravel()
    flat = mesh.deformation(mesh.reference)
    moved = np.array([(mesh.deformation(snapshot.state.positions) - flat).reshape(-1, 3, 2)
                      for snapshot in snapshots])
    heave = np.array([snapshot.state.plate.deflection for snapshot in snapshots])
    gradients = _shapes(moved, heave, volumes)
    whole = ReducedFilm(model.specimen, volumes, covered, gradients)
    squared = max(snapshot.state.voltage_squared for snapshot in snapshots)
    works = np.concatenate([_works(whole, model, snapshot, squared) for snapshot in snapshots])
    weights = _cubature(works, volumes, _WORK_LEFT_OUT)
    kept = np.flatnonzero(weights)
    return ReducedFilm(model.specimen, weights[kept], covered[kept], gradients[:, kept])


def _shapes(moved: Array, heave: Array, volumes: Array) -> Array:
    """∂φ/∂X of the heave's shape and of those that the snapshots deviate by from it."""
    first = np.tensordot(heave, moved, 1) / (heave @ heave)
    root = np.sqrt(volumes)[:, None, None]
    apart = (moved - np.multiply.outer(heave, first)) * root
    _, sizes, rows = np.linalg.svd(apart.reshape(len(moved), -1), full_matrices=False)
    largest = np.sqrt(((moved * root) ** 2).sum((1, 2, 3)).max())
    count = min(int((sizes > _MOTION_LEFT_OUT * largest).sum()), _MOST_SHAPES - 1)
    # As large as the heave's shape, so that all q are alike.
    unit = np.linalg.norm(first * root)
    others = unit * rows[:count].reshape(count, *first.shape) / root
    return np.concatenate([first[None], others])


def _works(film: ReducedFilm, model: Model, snapshot: Snapshot, voltage_squared: float) -> Array:
    """What each point of the model adds to what those kept are to reproduce, shape (rows, points).

    The virtual work of law, voltage and branches in each shape apart, the capacitance, the volume.
    Rows are relative to what they would be if nothing in them cancelled.
    """
    c = model.cauchy_green(snapshot.state.positions)
    at_rest = _stress(model, c)
    stresses = [at_rest, _stress(model, c, voltage_squared) - at_rest]
    if snapshot.memory is not None:
        flow = snapshot.memory.step(from_virgin(c, model.specimen.membrane.prestretch), 0.0)
        stresses.append(_stress(replace(model, flow=flow), c) - at_rest)
    slope = _slopes(film, model.discretisation.deformation(snapshot.state.positions))
    rows = [np.einsum("kip,pi->kp", slope, stress) for stress in stresses]
    stretches = principal_stretches(c, model.specimen.membrane.prestretch)
    charged = model.density(1.0).maxwell.derivatives(*stretches)[0].ravel()
    works = np.concatenate([*rows, charged[None], np.ones((1, len(charged)))]) * film.volumes
    sizes = np.abs(works).sum(1)
    return np.asarray(works[sizes > 0] / sizes[sizes > 0, None])


def _stress(model: Model, c: Any, voltage_squared: float = 0.0) -> Array:
    """S of the film at the model's points [Pa], shape (points, 3)."""
    return np.asarray(model.density(voltage_squared)(c, tangent=False).stress).reshape(-1, 3)


def _slopes(film: ReducedFilm, f: Array) -> Array:
    """∂E/∂q in Voigt form at F, shape (shapes, 3, points)."""
    along, across = f.reshape(-1, 3, 2).transpose(2, 0, 1)
    first, second = film.gradients[..., 0], film.gradients[..., 1]
    return np.stack([(first * along).sum(-1), (second * across).sum(-1),
                     (first * across + second * along).sum(-1)], 1)


def _cubature(works: Array, volumes: Array, precision: float) -> Array:
    """Volumes of few points that give the sums of all rows, 0 at the others, shape (points,).

    Non-negative least squares on the rows' principal directions: as many points, at most, as there
    are of these.
    """
    _, sizes, rows = np.linalg.svd(works, full_matrices=False)
    count = int((sizes > precision * sizes[0]).sum())
    matrix = sizes[:count, None] * rows[:count]
    shares, _ = nnls(matrix, matrix.sum(1), maxiter=50 * count)
    return np.asarray(shares * volumes)
