"""Reduced films from field models: their states, shapes and points, and their error.

A film for motion in time is made from a few runs of its field model: equilibria under some loads,
and one motion there and back. Its error is measured in other runs, under other masses and signals.
Films that differ by edits of their specimen, including outlines, share a :class:`Reduction`. It is
made from states of some of them on one mesh that moves with the outlines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
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
from tympan.studies.films.film import NoBalance, ReducedFilm, arms_of
from tympan.studies.films.motion import ReducedMotion
from tympan.studies.films.tilting import TURNS, Tilting, motions_by_tilt, slides_of
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces, Signal, Sine, ramp, random_steps, step

#: Largest part of a deformation that the shapes do not contain, over the largest deformation. It is
#: some 0.5 µm for a deflection of 5 mm, less than the accuracy of real films.
_MOTION_LEFT_OUT = 1e-4

#: Largest number of shapes: the cost of a step grows with its square.
_MOST_SHAPES = 8

#: Part of the virtual work that the points do not reproduce; as small as that of the shapes.
_WORK_LEFT_OUT = 1e-4

#: Duration of the constant voltage in the motion for the reduction, in times of the slowest branch.
_LONG = 3.0

#: Shares of the first force for equilibria without voltage: they show how shapes change with the
#: load.
_LIGHTER = (0.3, 0.65)
#: Shares of the highest voltage for equilibria under each force, in addition to the full voltage.
_BETWEEN = (0.0, 0.7)

#: Lowest voltage of the test runs, as a share of the highest.
_LOW = 0.05
#: Highest voltage of steps and sines of the test runs, as a share: different from the one the film
#: was made with.
_HIGH = 0.85
#: Number of levels of the run with random steps.
_LEVELS = 5
#: Seed of the random levels; its value is arbitrary.
_SEED = 7
#: Number of times at which deflections are compared. Set by trial.
_SAMPLES = 401

#: Error of the deflection over its range above which a film does not follow its field model: a
#: third of a motion is useless.
_ASTRAY = 0.3

#: Number of the only film.
_ALONE = np.zeros(1, dtype=np.int64)

#: Work to make a film with its motions, in equilibria. It is a few hundred tangents, and the budget
#: is ten times as large.
IN_TIME = 100


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A state of a model and the memory of its branches; None without memory.

    ``rates``: further motions of the nodes about the state that films may make, (rates, nodes, 3)
    [m], for example due to a change of a load.
    """

    model: Model
    state: State
    memory: Memory | None = None
    rates: tuple[Array, ...] = ()


def reduced_film(model: Model, forces: Sequence[float], voltage: float,
                 path: PathSettings = PathSettings()) -> ReducedFilm:
    """Reduce a model for forces [N] up to a voltage across the film [V], and test the result.

    The reduction uses a motion under the first force and equilibria under all forces. The tests
    compare it with the model under the last force.

    Raises
    ------
    InputError
        If the film pulls in at such loads, if the reduced film does not follow it, or if the field
        model takes more work than allowed.
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
    """Reduce a model as :func:`reduced_film` does, without tests against it."""
    _require_even(model.specimen)
    path = path.bounded(model, followed=True, loads=IN_TIME)
    run = _there_and_back(model, voltage)
    snapshots = [*_at_rest(model, forces, voltage, path), *_in_motion(model, forces[0], run, path)]
    return Reduction.of(snapshots).film(model)


def _require_even(specimen: Specimen) -> None:
    """Raise InputError for a film with thickness gradient or patches.

    A few points do not represent such a film.
    """
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
    """Solve for equilibria under parts of the loads, and under all loads."""
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
    """Compute the field model's moments.

    They start relaxed under force and first voltage, or flat if the film has a mounting time.
    """
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
    """Create the test signals by name.

    The branches' times determine their durations.
    """
    times = [branch.time for branch in model.specimen.membrane.branches]
    slow, middle = max(times), float(np.exp(np.mean(np.log(times))))
    low, high = _LOW * voltage, _HIGH * voltage
    return {"step": step(low, high, 0.0, slow),
            "sine": Sine((low + high) / 2, (high - low) / 2, middle, 2.0),
            "ramp": ramp(low, voltage, 2 * slow),
            "random": random_steps(low, voltage, middle / 2, _LEVELS, _SEED)}


def error_of(film: ReducedFilm, model: Model, force: float, signal: Signal,
             path: PathSettings = PathSettings()) -> float:
    """Compute the largest error of the deflection under a force [N] and a signal.

    It is relative to the deflection's range in the field model. The range includes the deflection
    before the signal begins. The error is infinite if a film pulls in, or if the reduced film has
    no equilibrium.
    """
    when = np.linspace(float(signal.breaks[0]), float(signal.breaks[-1]), _SAMPLES)
    motion = ReducedMotion(film, force, signal, model.loading.biases, budget=Budget(WORK))
    try:
        field = _field_motion(model, force, signal, path)
        moments = list(motion.moments())
    except (NoBalance, Stopped):
        return float("inf")
    exact = Trace(np.array([moment.time for moment in field])).at(
        np.array([moment.state.plate.deflection for moment in field]), when)
    near = Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.deflection for moment in moments]), when)
    before = motion.begin.deflection
    return float(np.abs(near - exact).max() / np.ptp(np.append(exact, before)))


@dataclass(frozen=True, eq=False)
class Reduction:
    """Shapes and points of films on one mesh, which may move with their outlines.

    ``shapes``: motions of the nodes, the deflection's shape first, (shapes, nodes, 3). ``points``:
    numbers of quadrature points that represent all points; each represents ``shares`` times its own
    volume. ``bends``: motions of the nodes that keep tilted plates rigid, (bends, nodes, 3); the
    array may be empty. ``arms``: nodes on the edge of the plate that shapes and bends belong to,
    relative to its centre [m], (nodes, 3). ``slides``: those of :func:`slides_of`. ``freedoms``:
    numbers of the plate's freedoms that the first shapes are.
    """

    shapes: Array
    points: Numbers
    shares: Array
    bends: Array
    arms: Array
    slides: Array
    freedoms: tuple[int, ...] = (HEAVE,)

    @property
    def every(self) -> Array:
        """Shapes of the nodes, followed by their bends."""
        return np.concatenate([self.shapes, self.bends])

    @classmethod
    def of(cls, snapshots: Sequence[Snapshot], motion_left_out: float = _MOTION_LEFT_OUT,
           work_left_out: float = _WORK_LEFT_OUT, most: int = _MOST_SHAPES,
           softening: float = 0.0, turning: bool = False,
           freedoms: tuple[int, ...] = (HEAVE,), balance: float = 0.0) -> Reduction:
        """Create a reduction that reproduces snapshots of moving films with a small error.

        With ``softening`` the points also reproduce each snapshot's forces against the motion of
        least resistance, to ``work_left_out`` over ``softening`` of the remaining resistance. With
        ``turning`` plates that tilt stay rigid to second order. ``freedoms``: numbers of the
        plate's freedoms that get a shape each, the deflection first; all others are parts of
        shapes. With ``balance`` the points also reproduce where the plate of each snapshot is in
        equilibrium, to ``work_left_out`` over ``balance`` of the range of each of these freedoms.
        """
        arms = snapshots[0].model.arms
        mirrored = bool(snapshots[0].model.discretisation.planes)
        slides = slides_of(arms[:, :2], [shot.model.arms[:, :2] for shot in snapshots], mirrored)
        bends = motions_by_tilt(snapshots[0].model, slides)[: None if turning else 0]
        motions = []
        for shot in snapshots:
            motion = shot.state.positions - shot.model.discretisation.reference
            tilting = Tilting.of(arms[:, :2], shot.model.arms[None, :, :2], slides, mirrored)
            rest = _rigid(shot.model, motion, bends, tilting)
            others = (_rigid(shot.model, motion + rate, bends, tilting) for rate in shot.rates)
            motions += [rest, *((there - rest[0], lifted - rest[1]) for there, lifted in others)]
        moved, plates = (np.array(part) for part in zip(*motions, strict=True))
        amplitudes = (plates * arms_of(snapshots[0].model.specimen))[:, freedoms]
        shares = _shapes(snapshots, moved, amplitudes, motion_left_out, most)
        shapes = np.tensordot(shares, moved, 1)
        squared = max(shot.state.voltage_squared for shot in snapshots)
        every = np.concatenate([shapes, bends])
        works = np.concatenate([_works(every, shot, squared) for shot in snapshots])
        if softening:
            works = np.concatenate([works, *(softening * _softest(shapes, shot, softening)
                                             for shot in snapshots)])
        every = np.arange(works.shape[1])
        whole = cls(shapes, every, np.ones(len(every)), bends, arms, slides, freedoms)
        if balance:
            weights = balance / np.ptp(amplitudes, axis=0)[:, None]
            works = np.concatenate([works, *(
                weights * whole._resting(shot, plate)[:len(freedoms)]
                for shot, plate in zip(snapshots, amplitudes, strict=True))])
        points, by_point = _cubature(works, work_left_out)
        return replace(whole, points=points, shares=by_point)

    def along(self, other: Reduction) -> Array:
        """Express the shapes of another reduction by these, as nearly as possible, (other, own)."""
        own, others = (each.shapes.reshape(len(each.shapes), -1) for each in (self, other))
        return np.asarray(np.linalg.lstsq(own.T, others.T, rcond=None)[0].T)

    def film(self, model: Model) -> ReducedFilm:
        """Create a film on the mesh, or on the moved mesh; InputError if it is uneven."""
        _require_even(model.specimen)
        mesh = model.discretisation
        volumes = model.volumes.ravel()[self.points] * mesh.mirrored
        covered = np.broadcast_to(mesh.covered, model.volumes.shape).ravel()[self.points]
        segments = np.broadcast_to(mesh.segments[:, None], model.volumes.shape).ravel()
        bends = self._bends(model)
        shapes = self.every if len(bends) else self.shapes
        return ReducedFilm(model.specimen, self.shares * volumes, covered,
                           _gradients(model, shapes)[:, self.points],
                           segments=segments[self.points], freedoms=self.freedoms, bends=bends)

    def _resting(self, snapshot: Snapshot, plate: Array) -> Array:
        """Compute the change of q in equilibrium by each point's share, (shapes, points).

        ``plate``: the plate's amplitudes in the snapshot.
        """
        model, bends = snapshot.model, self._bends(snapshot.model)
        if snapshot.memory is not None:
            flow = snapshot.memory.step(virgin_strain(model, snapshot.state), 0.0)
            model = replace(model, flow=flow)
        density = model.density(snapshot.state.voltage_squared)(
            model.cauchy_green(snapshot.state.positions))
        volumes = model.volumes.ravel() * model.discretisation.mirrored
        gradients = _gradients(model, self.every)
        count, led = len(self.shapes), len(self.freedoms)
        levers = np.zeros((len(gradients) - count, count))
        levers[:, :led] = np.einsum("bkl,l->bk", bends, plate) if len(bends) else 0.0
        along = gradients[:count] + np.tensordot(levers, gradients[count:], (0, 0))
        f = model.discretisation.deformation(snapshot.state.positions)
        stress = np.asarray(density.stress).reshape(-1, 3)
        work, tangent = _resistances(along, _slopes(along, f), density)
        whole = (tangent * volumes).sum(-1)
        if len(bends):
            held = np.einsum("bip,pi,p->b", _slopes(gradients[count:], f), stress, volumes)
            whole[:led, :led] += np.tensordot(held, bends, 1)
        return np.asarray(np.linalg.solve(whole, work * volumes))

    def _bends(self, model: Model) -> Array:
        """Compute the bends' second derivatives by the plate's amplitudes; none without tilts."""
        led, turns = len(self.freedoms), range(6)[TURNS]
        at = [self.freedoms.index(turn) for turn in turns if turn in self.freedoms]
        if not at or not len(self.bends):
            return np.zeros((0, led, led))
        some = [turn - TURNS.start for turn in turns if turn in self.freedoms]
        tilting = Tilting.of(self.arms[:, :2], model.arms[None, :, :2], self.slides,
                             bool(model.discretisation.planes))
        bends = np.zeros((len(self.bends), led, led))
        for row, turn in zip(at, some, strict=True):
            bends[:, row, at] = tilting.bends[0][:, turn, some]
        arms = arms_of(model.specimen)[list(self.freedoms)]
        return np.asarray(bends / np.outer(arms, arms))


def _gradients(model: Model, shapes: Array) -> Array:
    """Compute ∂φ/∂X of shapes at all points, shape (shapes, points, 3, 2)."""
    mesh = model.discretisation
    flat = mesh.deformation(mesh.reference)
    return np.array([(mesh.deformation(mesh.reference + shape) - flat).reshape(-1, 3, 2)
                     for shape in shapes])


def _rigid(model: Model, motion: Array, bends: Array, tilting: Tilting) -> tuple[Array, Array]:
    """Make the plate's edge rigid to first order in a motion [m]; return its freedoms, too.

    Without a plate the deflection is that of the film's centre. The ``bends`` due to the plate's
    tilts are subtracted. Otherwise the square of a tilt would be a shape of its own, in which the
    plate stretches.
    """
    if model.specimen.plate is None:
        return motion, motion[model.centre_node, HEAVE] * np.eye(6)[HEAVE]
    edge, freedoms = model.discretisation.plate_nodes, plate_freedoms(model, motion)
    moved = motion.copy()
    rigid = PlateMotion.rest().gradient(model.arms) @ freedoms
    if len(bends):
        turns = np.linalg.solve(tilting.slants[0], freedoms[TURNS])
        moved -= np.tensordot(tilting.amplitudes(_ALONE, turns[None])[0], bends, 1)
        rigid -= np.tensordot(tilting.leans[0] @ turns, bends[:, edge], 1)
    moved[edge] = rigid
    return moved, freedoms


def plate_freedoms(model: Model, motion: Array, arms: Array | None = None) -> Array:
    """Fit the plate's six freedoms to a motion of the nodes, to first order, (6,) [m, rad].

    ``arms``: those of the nodes on its edge, (nodes, 3); the default is the model's.
    """
    edge = model.discretisation.plate_nodes
    rigid = PlateMotion.rest().gradient(model.arms if arms is None else arms).reshape(-1, 6)
    return np.asarray(np.linalg.lstsq(rigid, motion[edge].ravel(), rcond=None)[0])


def _shapes(snapshots: Sequence[Snapshot], displaced: Array, plates: Array, precision: float,
            most: int) -> Array:
    """Compute the shapes of the plate's amplitudes and the deviations, as sums of snapshots.

    ``plates``: the amplitudes, (snapshots, amplitudes). The result is (shapes, snapshots).
    Deviations are measured by the deformation of the first film. They are scaled to the size of the
    deflection's shape, so that all q are of similar size.
    """
    root = np.sqrt(snapshots[0].model.volumes)[..., None, None]
    mesh = snapshots[0].model.discretisation
    flat = mesh.deformation(mesh.reference)
    deformed = np.array([(root * (mesh.deformation(mesh.reference + moved) - flat)).ravel()
                         for moved in displaced])
    first = np.linalg.pinv(plates)
    apart = np.eye(len(plates)) - plates @ first
    ways, sizes = _principal(apart @ deformed)
    largest = np.linalg.norm(deformed, axis=1).max()
    count = min(int((sizes > precision * largest).sum()), most - len(first))
    unit = np.linalg.norm(first[0] @ deformed)
    others = (ways[:, :count] * (unit / sizes[:count])).T @ apart
    return np.concatenate([first, others])


def _works(shapes: Array, snapshot: Snapshot, voltage_squared: float) -> Array:
    """Compute the work of each point in quantities to be reproduced, shape (rows, points).

    Rows are the virtual work of law, voltage and branches in each shape, the capacitance, and the
    volume. They are relative to their sums of absolute values.
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
    """Compute forces of each point against the motion of least resistance, (shapes, points).

    They are relative to the remaining resistance. It is small near a pull-in, where the parts of
    law and tension and of the voltage nearly cancel. ``least``: lower bound of this resistance.
    """
    model = snapshot.model
    density = model.density(snapshot.state.voltage_squared)(
        model.cauchy_green(snapshot.state.positions))
    gradients = _gradients(model, shapes)
    slope = _slopes(gradients, model.discretisation.deformation(snapshot.state.positions))
    tangent = _resistances(gradients, slope, density)[1] * model.volumes.ravel()
    # Parts are relative to their sums of absolute values.
    sizes = np.sqrt(np.abs(np.einsum("kkp->kp", tangent)).sum(1))
    tangent /= np.multiply.outer(sizes, sizes)[..., None]
    resistances, motions = np.linalg.eigh(tangent.sum(2))
    cancelled = (1 - resistances[0]) / max(resistances[0], least)
    return np.asarray(cancelled * np.einsum("klp,l->kp", tangent, motions[:, 0]))


def _resistances(gradients: Array, slope: Array, density: Any) -> tuple[Array, Array]:
    """Compute work and its derivative in each shape at points, per volume.

    ``slope`` is ∂E/∂q. Shapes (shapes, points) and (shapes, shapes, points).
    """
    stress = np.asarray(density.stress).reshape(-1, 3)
    bent = np.einsum("kip,pij->kjp", slope, np.asarray(density.tangent).reshape(-1, 3, 3))
    pulled = np.einsum("kpca,pab->kpcb", gradients, stress[:, _MATRIX])
    tangent = np.einsum("kjp,ljp->klp", bent, slope) + np.einsum("kpcb,lpcb->klp", pulled,
                                                                 gradients)
    return np.einsum("kip,pi->kp", slope, stress), tangent


#: Numbers of the components of S in Voigt form, as a matrix.
_MATRIX = np.array([[0, 2], [2, 1]])


def _stress(model: Model, c: Any, voltage_squared: float = 0.0) -> Array:
    """Compute S of the film at the model's points [Pa], shape (points, 3)."""
    return np.asarray(model.density(voltage_squared)(c, tangent=False).stress).reshape(-1, 3)


def _slopes(gradients: Array, f: Array) -> Array:
    """Compute ∂E/∂q in Voigt form at F, shape (shapes, 3, points)."""
    along, across = f.reshape(-1, 3, 2).transpose(2, 0, 1)
    first, second = gradients[..., 0], gradients[..., 1]
    return np.stack([(first * along).sum(-1), (second * across).sum(-1),
                     (first * across + second * along).sum(-1)], 1)


def _cubature(works: Array, precision: float) -> tuple[Numbers, Array]:
    """Choose few points and their weights that reproduce the sums of all rows.

    Non-negative least squares on the rows' principal directions: there are at most as many points
    as directions.
    """
    if len(works) > len(works.T):  # many rows: directions of the points instead, which are fewer
        ways, sizes = _principal(works.T)
        matrix = (ways * sizes)[:, sizes > precision * sizes[0]].T
    else:
        ways, sizes = _principal(works)
        matrix = ways[:, sizes > precision * sizes[0]].T @ works
    count = len(matrix)
    shares, _ = nnls(matrix, matrix.sum(1), maxiter=50 * count)
    points = np.flatnonzero(shares)
    return points, shares[points]


def _principal(rows: Array) -> tuple[Array, Array]:
    """Compute principal directions of rows, (rows, rows), and their sizes, the largest first.

    They come from the rows' products, since rows are long and few. Sizes below 1e-8 of the largest
    are rounding.
    """
    squares, ways = np.linalg.eigh(rows @ rows.T)
    return ways[:, ::-1], np.sqrt(np.maximum(squares[::-1], 0.0))
