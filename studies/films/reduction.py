"""Reduced films from field models: from which states, with what shapes and points, how near.

A film in time is made from a few runs of its field model: at rest under some loads, and one motion
there and back. How near it comes is measured on other runs, under other masses and signals. Films
that differ by edits of their specimen, their outlines included, share a :class:`Reduction`: states
of some of them on one mesh, which moves with the outlines, make the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.derivatives.shape import with_plate
from tympan.fem.equilibrium.newton import WORK, Budget
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.density import principal_stretches
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, PlateMotion, State
from tympan.fem.transient.ends import Stopped
from tympan.fem.transient.film_memory import first_memory, virgin_strain
from tympan.fem.transient.integrate import Moment, StepSettings, Transient
from tympan.geometry.specimen import Specimen
from tympan.studies.films.film import NoBalance, ReducedFilm
from tympan.studies.films.motion import ReducedMotion
from tympan.studies.signals import Pieces, Signal, Sine, ramp, random_steps, step

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

#: The error of the deflection, over its range, from which on a film does not follow its field
#: model: a third of a motion is no answer.
_ASTRAY = 0.3

#: How many loads at rest the making of a film takes as much work as, motions included: a few
#: hundred tangents, and ten times as many are left to it.
IN_TIME = 100


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A state of a model, and what its branches remember, None of one without.

    ``rates``: further motions of the nodes about the state that films may make, (rates, nodes, 3)
    [m], such as those by a change of a load.
    """

    model: Model
    state: State
    memory: Memory | None = None
    rates: tuple[Array, ...] = ()


def reduced_film(model: Model, forces: Sequence[float], voltage: float,
                 path: PathSettings = PathSettings()) -> ReducedFilm:
    """The film of a model, for forces [N] up to a voltage across it [V], and how near it comes.

    Made under the first force, and from states at rest under all; held against the model under the
    last.

    Raises
    ------
    InputError
        When the film pulls in at such loads, the reduced one does not follow it there, or the field
        model takes more work than it may.
    """
    path = path.bounded(model, followed=True, loads=IN_TIME)
    film = film_of_runs(model, forces, voltage, path)
    errors = {name: error_of(film, model, forces[-1], signal, path)
              for name, signal in held_out(model, voltage).items()}
    astray = [name for name, error in errors.items() if not error < _ASTRAY]
    if astray:
        raise InputError("has no reduced film that follows it in time under such loads: take lower "
                         "voltages, or `tympan transient`", key=model.specimen.name,
                         given=", ".join(astray))
    return replace(film, errors=errors)


def film_of_runs(model: Model, forces: Sequence[float], voltage: float,
                 path: PathSettings = PathSettings()) -> ReducedFilm:
    """Reduce as :func:`reduced_film`, without a check against the model."""
    _require_even(model.specimen)
    path = path.bounded(model, followed=True, loads=IN_TIME)
    run = _there_and_back(model, voltage)
    snapshots = [*_at_rest(model, forces, voltage, path), *_in_motion(model, forces[0], run, path)]
    return Reduction.of(snapshots).film(model)


def _require_even(specimen: Specimen) -> None:
    """Refuse a film that is not alike everywhere: few points do not stand for all of it."""
    gradient, patches = specimen.membrane.thickness_gradient, specimen.electrode.patches
    if gradient != (0.0, 0.0):
        raise InputError("must be 0, 0 for a reduced film", key="membrane.thickness_gradient",
                         given=gradient)
    if patches:
        raise InputError("must not be there for a reduced film", key="electrode.patch",
                         given=str(patches[0]))


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
    return [Snapshot(model, outcome.state) for outcome in outcomes
            if outcome.status == "equilibrium"]


def _in_motion(model: Model, force: float, signal: Signal, path: PathSettings) -> list[Snapshot]:
    try:
        return [Snapshot(model, moment.state, moment.memory)
                for moment in _field_motion(model, force, signal, path)]
    except Stopped as ending:
        raise InputError(f"pull-in after {ending.time:.4g} s at the highest voltage: "
                         "take a lower one", key="voltage",
                         given=f"{signal.peak / 1e3:.5g} kV") from None


def _field_motion(model: Model, force: float, signal: Signal, path: PathSettings) -> list[Moment]:
    """The field model's moments; relaxed under force and first voltage, or mounted and flat."""
    state, steps = model.mounted(), StepSettings(newton=path.newton)
    if model.specimen.membrane.mounted is None:
        outcome = equilibrium(model, force, signal.first, settings=path)
        path.require_work(model.specimen.name)
        if outcome.status != "equilibrium":
            raise Stopped("pull_in", 0.0)
        state = outcome.state
    memory = first_memory(model, state)
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


def error_of(film: ReducedFilm, model: Model, force: float, signal: Signal,
             path: PathSettings = PathSettings()) -> float:
    """The largest error of the deflection under a force [N] and a signal, over the field's range.

    The range includes the deflection before the signal begins. Infinite where a film pulls in, or
    the reduced one has no equilibrium there.
    """
    when = np.linspace(float(signal.breaks[0]), float(signal.breaks[-1]), _SAMPLES)
    motion = ReducedMotion(film, force, signal, model.loading.biases, budget=Budget(WORK))
    try:
        field = _field_motion(model, force, signal, path)
        moments = list(motion.moments())
    except (NoBalance, Stopped):
        return float("inf")
    from tympan.studies.trace import Trace  # imports pandas, which films of a sweep do not need

    exact = Trace(np.array([moment.time for moment in field])).at(
        np.array([moment.state.plate.deflection for moment in field]), when)
    near = Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.heave for moment in moments]), when)
    before = motion.begin.heave
    return float(np.abs(near - exact).max() / np.ptp(np.append(exact, before)))


@dataclass(frozen=True, eq=False)
class Reduction:
    """Shapes and points of films on one mesh, which may move with their outlines.

    ``shapes``: of the nodes, that of the heave first, shape (shapes, nodes, 3); ``points``: numbers
    of quadrature points that stand for all, each for ``shares`` times its own volume. ``bends``:
    how nodes move by the squares of the plate's turns, (3, nodes, 3), of which none may be there.
    """

    shapes: Array
    points: Numbers
    shares: Array
    bends: Array

    @property
    def every(self) -> Array:
        """Shapes of the nodes and their bends."""
        return np.concatenate([self.shapes, self.bends])

    @classmethod
    def of(cls, snapshots: Sequence[Snapshot], motion_left_out: float = _MOTION_LEFT_OUT,
           work_left_out: float = _WORK_LEFT_OUT, most: int = _MOST_SHAPES,
           softening: float = 0.0, turning: bool = False) -> Reduction:
        """Reduction by snapshots of films that all move so that it leaves out little of these.

        With ``softening`` the points also reproduce what snapshots resist the motion that they
        resist least, to ``work_left_out`` over ``softening`` of the resistance that is left. With
        ``turning`` plates that tilt stay rigid to the second order.
        """
        bends = turned(snapshots[0].model)[: None if turning else 0]
        motions = []
        for shot in snapshots:
            motion = shot.state.positions - shot.model.discretisation.reference
            rest = _rigid(shot.model, motion, bends)
            others = (_rigid(shot.model, motion + rate, bends) for rate in shot.rates)
            motions += [rest, *((there - rest[0], heave - rest[1]) for there, heave in others)]
        moved, heave = (np.array(part) for part in zip(*motions, strict=True))
        shares = _shapes(snapshots, moved, heave, motion_left_out, most)
        shapes = np.tensordot(shares, moved, 1)
        squared = max(shot.state.voltage_squared for shot in snapshots)
        every = np.concatenate([shapes, bends])
        works = np.concatenate([_works(every, shot, squared) for shot in snapshots])
        if softening:
            works = np.concatenate([works, *(softening * _softest(shapes, shot, softening)
                                             for shot in snapshots)])
        return cls(shapes, *_cubature(works, work_left_out), bends)

    def film(self, model: Model) -> ReducedFilm:
        """A film on the mesh, or on that moved; an :class:`InputError` if it is uneven."""
        _require_even(model.specimen)
        mesh = model.discretisation
        volumes = model.volumes.ravel()[self.points] * mesh.mirrored
        covered = np.broadcast_to(mesh.covered, model.volumes.shape).ravel()[self.points]
        return ReducedFilm(model.specimen, self.shares * volumes, covered,
                           _gradients(model, self.shapes)[:, self.points])


def _gradients(model: Model, shapes: Array) -> Array:
    """∂φ/∂X of shapes at all points, shape (shapes, points, 3, 2)."""
    mesh = model.discretisation
    flat = mesh.deformation(mesh.reference)
    return np.array([(mesh.deformation(mesh.reference + shape) - flat).reshape(-1, 3, 2)
                     for shape in shapes])


def _rigid(model: Model, motion: Array, bends: Array) -> tuple[Array, float]:
    """A motion of the nodes [m], that of the plate's edge to first order; the plate's heave in it.

    Without a plate that of the film's centre. Less the ``bends`` by its turns. What is left of a
    tilt, its square where there are no bends, would be a shape of its own, in which the plate
    stretches.
    """
    if model.specimen.plate is None:
        return motion, float(motion[model.centre_node, HEAVE])
    edge, freedoms = model.discretisation.plate_nodes, plate_freedoms(model, motion)
    moved = motion.copy()
    if len(bends):
        moved -= np.tensordot(squares_of(freedoms[TURNS]), bends, 1)
    rigid = PlateMotion.rest().gradient(model.arms)
    moved[edge] = rigid @ freedoms
    return moved, float(freedoms[HEAVE])


#: Which of the plate's freedoms tilt it.
TURNS = slice(3, 5)


def squares_of(turns: Array) -> Array:
    """Squares of turns about x and y, (..., 2), by which nodes bend, (..., 3)."""
    x, y = turns[..., 0], turns[..., 1]
    return np.stack([x * x, y * y, x * y], -1)


def turned(model: Model) -> Array:
    """Motions of the nodes by the squares of the plate's turns, (3, nodes, 3) [m]; of none, (0, …).

    Half of ω × (ω × r) on the plate's edge, and smoothly to nothing at the others.
    """
    mesh, arms = model.discretisation, model.arms[:, :2]
    if not set(range(6)[TURNS]) & set(model.plate_freedoms):
        return np.zeros((0, *mesh.reference.shape))
    bends = np.zeros((3, *mesh.reference.shape))
    ways = np.array([[[0.0, 0.0], [0.0, -0.5]], [[-0.5, 0.0], [0.0, 0.0]],
                     [[0.0, 0.5], [0.5, 0.0]]])
    for bend, way in zip(bends, ways, strict=True):
        bend[:, :2] = with_plate(mesh, arms @ way.T)
    return bends


def plate_freedoms(model: Model, motion: Array) -> Array:
    """The plate's six freedoms to first order in a motion of the nodes, shape (6,) [m, rad]."""
    edge = model.discretisation.plate_nodes
    rigid = PlateMotion.rest().gradient(model.arms).reshape(-1, 6)
    return np.asarray(np.linalg.lstsq(rigid, motion[edge].ravel(), rcond=None)[0])


def _shapes(snapshots: Sequence[Snapshot], displaced: Array, heave: Array, precision: float,
            most: int) -> Array:
    """The heave's shape and those that snapshots deviate by from it, as sums of the snapshots'.

    Shape (shapes, snapshots), by what deforms the first of the films. The others are as large as
    the heave's, so that all q are alike.
    """
    root = np.sqrt(snapshots[0].model.volumes)[..., None, None]
    mesh = snapshots[0].model.discretisation
    flat = mesh.deformation(mesh.reference)
    deformed = np.array([(root * (mesh.deformation(mesh.reference + moved) - flat)).ravel()
                         for moved in displaced])
    first = heave / (heave @ heave)
    apart = np.eye(len(heave)) - np.multiply.outer(heave, first)
    ways, sizes = _principal(apart @ deformed)
    largest = np.linalg.norm(deformed, axis=1).max()
    count = min(int((sizes > precision * largest).sum()), most - 1)
    unit = np.linalg.norm(first @ deformed)
    others = (ways[:, :count] * (unit / sizes[:count])).T @ apart
    return np.concatenate([first[None], others])


def _works(shapes: Array, snapshot: Snapshot, voltage_squared: float) -> Array:
    """Work of each point of a model in what those kept are to reproduce, shape (rows, points).

    The virtual work of law, voltage and branches in each shape apart, the capacitance, the volume.
    Rows are relative to what they would be if nothing in them cancelled.
    """
    model = snapshot.model
    c = model.cauchy_green(snapshot.state.positions)
    at_rest = _stress(model, c)
    stresses = [at_rest, _stress(model, c, voltage_squared) - at_rest]
    if snapshot.memory is not None:
        flow = snapshot.memory.step(virgin_strain(model, snapshot.state), 0.0)
        stresses.append(_stress(replace(model, flow=flow), c) - at_rest)
    slope = _slopes(_gradients(model, shapes),
                    model.discretisation.deformation(snapshot.state.positions))
    rows = [np.einsum("kip,pi->kp", slope, stress) for stress in stresses]
    stretches = principal_stretches(c, model.specimen.membrane.prestretch)
    charged = model.density(1.0).maxwell.derivatives(*stretches)[0].ravel()
    works = np.concatenate([*rows, charged[None], np.ones((1, len(charged)))])
    works *= model.volumes.ravel() * model.discretisation.mirrored
    sizes = np.abs(works).sum(1)
    return np.asarray(works[sizes > 0] / sizes[sizes > 0, None])


def _softest(shapes: Array, snapshot: Snapshot, least: float) -> Array:
    """Forces of each point against the motion that a state resists least, shape (shapes, points).

    Relative to what is left of the resistance: it is small where that of law and tension and that
    of the voltage nearly cancel, near a pull-in. ``least``: as small as that is looked at.
    """
    model = snapshot.model
    density = model.density(snapshot.state.voltage_squared)(
        model.cauchy_green(snapshot.state.positions))
    gradients = _gradients(model, shapes)
    slope = _slopes(gradients, model.discretisation.deformation(snapshot.state.positions))
    bent = np.einsum("kip,pij->kjp", slope, np.asarray(density.tangent).reshape(-1, 3, 3))
    pulled = np.einsum("kpca,pab->kpcb", gradients,
                       np.asarray(density.stress).reshape(-1, 3)[:, _MATRIX])
    tangent = np.einsum("kjp,ljp->klp", bent, slope) + np.einsum("kpcb,lpcb->klp", pulled,
                                                                 gradients)
    tangent *= model.volumes.ravel()
    # As parts of what they would be if nothing in them cancelled.
    sizes = np.sqrt(np.abs(np.einsum("kkp->kp", tangent)).sum(1))
    tangent /= np.multiply.outer(sizes, sizes)[..., None]
    resistances, motions = np.linalg.eigh(tangent.sum(2))
    cancelled = (1 - resistances[0]) / max(resistances[0], least)
    return np.asarray(cancelled * np.einsum("klp,l->kp", tangent, motions[:, 0]))


#: Numbers of the components of S in Voigt form, as a matrix.
_MATRIX = np.array([[0, 2], [2, 1]])


def _stress(model: Model, c: Any, voltage_squared: float = 0.0) -> Array:
    """S of the film at the model's points [Pa], shape (points, 3)."""
    return np.asarray(model.density(voltage_squared)(c, tangent=False).stress).reshape(-1, 3)


def _slopes(gradients: Array, f: Array) -> Array:
    """∂E/∂q in Voigt form at F, shape (shapes, 3, points)."""
    along, across = f.reshape(-1, 3, 2).transpose(2, 0, 1)
    first, second = gradients[..., 0], gradients[..., 1]
    return np.stack([(first * along).sum(-1), (second * across).sum(-1),
                     (first * across + second * along).sum(-1)], 1)


def _cubature(works: Array, precision: float) -> tuple[Numbers, Array]:
    """Few points, and what each of them counts, that give the sums of all rows.

    Non-negative least squares on the rows' principal directions: as many points, at most, as there
    are of these.
    """
    ways, sizes = _principal(works)
    matrix = ways[:, sizes > precision * sizes[0]].T @ works
    count = len(matrix)
    shares, _ = nnls(matrix, matrix.sum(1), maxiter=50 * count)
    points = np.flatnonzero(shares)
    return points, shares[points]


def _principal(rows: Array) -> tuple[Array, Array]:
    """Principal directions of rows, (rows, rows), and how far these reach, the farthest first.

    By their products with one another, since they are much longer than many: what reaches less than
    1e-8 of the farthest is rounding.
    """
    squares, ways = np.linalg.eigh(rows @ rows.T)
    return ways[:, ::-1], np.sqrt(np.maximum(squares[::-1], 0.0))
