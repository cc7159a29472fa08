"""The lumped model's motion and its exact derivatives by constants, over all steps at once.

One step of such a small model takes a few microseconds of arithmetic, and the Python calls take far
longer. So all steps are solved together, on a mesh of steps that moves as a whole. The rule is one
of :mod:`tympan.fem.transient.collocation`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.errors import InputError
from tympan.fem.transient.collocation import gauss, newton_matrix
from tympan.fem.transient.ends import Stopped
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.signals import Signal

#: Derivatives of an actuator's rates by p constants, (…, size, p), at states and voltages.
Slopes = Callable[[Array, Array], Array]

#: Rule of a step, of sixth order like the quintics between the step's ends. It does not damp
#: lossless oscillations.
_RULE = gauss(3)
#: Number of stages of a step.
_STAGES = len(_RULE.nodes)

#: Admissible error of the quintics [m].
_PRECISION = 1e-10
#: Change of the deflection [m] below which Newton's next step, the one with derivatives, is exact.
_CLOSE = 1e-7

#: Most Newton iterations over a whole mesh. If they do not converge, the halves of the mesh are
#: solved one after the other.
_NEWTON = 12
#: Fewest Newton iterations; the last of them changes nothing.
_PASSES = 2
#: Most meshes, each made by the errors on the one before. The number was found by trial.
_ROUNDS = 8

#: Largest growth of a step from mesh to mesh, at first. Later steps only shrink, so that the
#: refinement ends.
_GROWTH = 5.0
#: Steps of a first mesh, unless the signal has more pieces.
_STEPS = 20_000
#: Fewest steps of a piece, for a signal of few pieces.
_LEAST = 24


@dataclass(frozen=True, eq=False)
class CollocatedMotion:
    """States at the nodes of a mesh, dense in time by Hermite's quintics of y, ẏ, ÿ.

    ``ends`` holds y, ẏ, ÿ at both ends of every step, shape (2, 3, steps). ``slopes`` holds their
    derivatives by p constants, (2, 3, steps, p). Where the voltage jumps at a node, the node has
    two accelerations. ``breaks`` marks the inner nodes where the voltage has a jump or a kink.
    ``stages`` holds the states within the steps, (steps, 3, size), ``stage_slopes`` their
    derivatives, (steps, 3, size, p). ``creep`` holds the rates of the branches at the nodes.
    """

    time: Array
    nodes: Array
    ends: Array
    slopes: Array
    breaks: Mask
    stages: Array
    stage_slopes: Array
    creep: Array

    def deflection(self, time: Array) -> tuple[Array, Array, Array]:
        """Interpolate y [m], ẏ [m/s], shape (times,), and y's derivatives, (times, p).

        Beyond the mesh the plate is at rest.
        """
        step, h, s = self._within(time)
        r = 1 - s
        basis = np.array([
            [r**3 * (1 + 3 * s + 6 * s**2), h * r**3 * s * (1 + 3 * s), h**2 * r**3 * s**2 / 2],
            [s**3 * (1 + 3 * r + 6 * r**2), -h * s**3 * r * (1 + 3 * r), h**2 * s**3 * r**2 / 2]])
        bump = 30 * s**2 * r**2 / h
        moving = np.array([
            [-bump, r**2 * (1 + 2 * s - 15 * s**2), h * r**2 * s * (2 - 5 * s) / 2],
            [bump, s**2 * (1 + 2 * r - 15 * r**2), -h * s**2 * r * (2 - 5 * r) / 2]])
        moving *= (time >= self.time[0]) & (time <= self.time[-1])
        y, speed = (np.einsum("ekn,ekn->n", part, self.ends[:, :, step])
                    for part in (basis, moving))
        slopes = np.zeros((len(step), self.slopes.shape[-1]))
        for end in range(2):
            for order in range(3):
                slopes += basis[end, order][:, None] * self.slopes[end, order, step]
        return y, speed, slopes

    def state(self, time: Array) -> Array:
        """Interpolate states, (times, size): y and ẏ by the quintic, the branches by cubics."""
        y, speed, _ = self.deflection(time)
        step, h, s = self._within(time)
        h, s = h[:, None], s[:, None]
        r = 1 - s
        before, after = self.nodes[step, 2:], self.nodes[step + 1, 2:]
        branches = (r**2 * ((1 + 2 * s) * before + h * s * self.creep[step])
                    + s**2 * ((1 + 2 * r) * after - h * r * self.creep[step + 1]))
        return np.column_stack([y, speed, branches])

    @property
    def errors(self) -> Array:
        """Error of each step's quintic [m], from the change of its fifth derivative."""
        width = np.diff(self.time)
        (y0, v0, a0), (y1, v1, a1) = self.ends
        fifth = 120 * (6 * (y1 - y0) - 3 * width * (v0 + v1) + width**2 * (a1 - a0) / 2) / width**5
        sixth = np.where(self.breaks, 0.0, np.abs(np.diff(fifth)) / ((width[1:] + width[:-1]) / 2))
        for _ in range(2):
            sixth = np.maximum(sixth,
                               np.maximum(np.append(sixth[1:], 0.0), np.append(0.0, sixth[:-1])))
        return np.asarray(np.maximum(np.append(sixth, 0.0), np.append(0.0, sixth)) * width**6
                          / 46080)

    def _within(self, time: Array) -> tuple[Numbers, Array, Array]:
        """Find the step of each time, its width [s], and the share of it that has passed."""
        at = np.clip(time, self.time[0], self.time[-1])
        step = np.clip(np.searchsorted(self.time, at, "right") - 1, 0, len(self.time) - 2)
        width = np.diff(self.time)[step]
        return step, width, (at - self.time[step]) / width


@dataclass(eq=False)
class CollocationSolver:
    """Solver of an actuator's motion under one signal, for one set of constants after another.

    Newton's method runs over all steps at once, begun from the last motion and its derivatives.
    Where it does not converge, it runs over half of them. Derivatives solve the same linear
    equations with other right sides. The mesh moves until its quintics are within ``precision``
    [m]. A motion that takes more than ``most`` evaluations of the rates is an InputError.
    """

    signal: Signal
    precision: float = _PRECISION
    last: CollocatedMotion | None = None
    constants: Array | None = None
    evaluations: int = 0
    most: float = np.inf

    def solve(self, actuator: Actuator, start: Array, mesh: Array | None = None,
              constants: Array | None = None, by_constants: Slopes | None = None
              ) -> CollocatedMotion:
        """Solve the motion from a state and its derivatives by constants, ``start`` (size, 1 + p).

        ``mesh`` holds the times [s] of the first mesh, by default those of the last motion, or of
        :func:`first_mesh`. ``by_constants`` gives the derivatives of the rates by the constants.

        Raises
        ------
        Stopped
            Where the motion leaves the model's range: its time is the last at which it is inside.
        InputError
            Where it takes more evaluations of the rates than allowed.
        """
        time = mesh
        if time is None:
            time = self.last.time if self.last is not None else \
                first_mesh(actuator, start[:, 0], self.signal)
        for number in range(_ROUNDS):
            steps = _Mesh(actuator, self.signal, time)
            with np.errstate(all="ignore"):
                stages, _ = self._solved(steps, self._guess(steps, constants), start[:, 0])
                motion = _finished(steps, stages, start, by_constants)
            self.last, self.constants = motion, None if constants is None else constants.copy()
            errors = motion.errors
            if errors.max() < 4 * self.precision:
                break
            time = self._moved(motion, errors, _GROWTH if number < _ROUNDS // 2 else 1.0)
        return motion

    def check(self, steps: int) -> None:
        """Refuse the motion if ``steps`` more steps would take too many evaluations."""
        if self.evaluations + _PASSES * _STAGES * steps > self.most:
            raise InputError("takes too many steps: make it shorter or with fewer bends",
                             key="signal", given=f"{len(self.signal.breaks)} bends in "
                                                 f"{self.signal.end:g} s")

    def _guess(self, mesh: _Mesh, constants: Array | None) -> Array | None:
        last = self.last
        if last is None or last.time[0] != mesh.time[0] or last.time[-1] != mesh.time[-1]:
            return None
        if last.time is not mesh.time:
            return last.state(mesh.within.ravel()).reshape(len(mesh.width), _STAGES, -1)
        if constants is None or self.constants is None or not last.stage_slopes.shape[-1]:
            return last.stages
        return np.asarray(last.stages + last.stage_slopes @ (constants - self.constants))

    def _solved(self, mesh: _Mesh, guess: Array | None, start: Array) -> tuple[Array, Array]:
        steps = len(mesh.width)
        begun = np.broadcast_to(start, (steps, _STAGES, len(start))) if guess is None else guess
        solution = self._newton(mesh, begun, start)
        if solution is not None:
            return solution
        if steps == 1:
            raise Stopped("drawn_in", float(mesh.time[0]))
        half = steps // 2
        guesses = (None, None) if guess is None else (guess[:half], guess[half:])
        before, middle = self._solved(mesh.part(0, half), guesses[0], start)
        after, end = self._solved(mesh.part(half, steps), guesses[1], middle)
        return np.concatenate([before, after]), end

    def _newton(self, mesh: _Mesh, stages: Array, start: Array) -> tuple[Array, Array] | None:
        before = np.inf
        for _ in range(_NEWTON):
            self.evaluations += stages.shape[0] * stages.shape[1]
            self.check(0)
            nodes, new = _passed(mesh, stages, start[:, None], np.zeros((*stages.shape, 0)))
            change = float(np.abs(new[..., 0, 0] - stages[..., 0]).max())
            if not np.isfinite(new).all() or change > max(10 * before, mesh.actuator.reach):
                return None
            stages, before = new[..., 0], change
            if change < _CLOSE:
                return stages, nodes[-1, :, 0]
        return None

    def _moved(self, motion: CollocatedMotion, errors: Array, growth: float) -> Array:
        """Make a mesh whose steps have equal errors, with as many steps per piece as this needs.

        No step grows by more than ``growth``.
        """
        width, breaks = np.diff(motion.time), self.signal.breaks
        share = 0.8 * (self.precision / np.maximum(errors, 1e-30)) ** (1 / 6)
        place = np.append(0.0, np.cumsum(1 / np.clip(share, 0.1, growth)))
        inside = breaks[(breaks > motion.time[0]) & (breaks < motion.time[-1])]
        edges = [0, *np.searchsorted(motion.time, inside).tolist(), len(width)]
        pieces = []
        for low, high in pairwise(edges):
            count = max(int(np.ceil(place[high] - place[low])), 1)
            even = np.linspace(place[low], place[high], count + 1)
            pieces.append(np.interp(even, place[low:high + 1], motion.time[low:high + 1])[:-1])
        return np.concatenate([*pieces, motion.time[-1:]])


def first_mesh(actuator: Actuator, start: Array, signal: Signal) -> Array:
    """Make the first mesh [s]: after each break two steps for a radian of the fastest pole.

    As the motion decays the steps grow, for their error goes as its amplitude and the sixth power
    of the step.
    """
    breaks = signal.breaks
    poles = np.linalg.eigvals(actuator.linear(start, signal.first)[1])
    fastest = complex(max(poles, key=abs))
    # A film that charges is resolved from its first moments: the rule does not damp what a step
    # skips.
    first = 0.5 / abs(fastest)
    if not actuator.charges:
        first = max(first, float(np.ptp(breaks)) / _STEPS)
    least = _LEAST if len(breaks) < 100 else 1
    return np.concatenate([*(begin + _graded(end - begin, first, abs(fastest.real), least)[:-1]
                             for begin, end in pairwise(breaks)), breaks[-1:]])


def _graded(length: float, first: float, decay: float, least: int) -> Array:
    """Grade times from 0 to a length [s], steps ``first`` exp(``decay`` t/6), ``least`` or more."""
    widest, rate = max(length / least, first), decay / 6
    grown = min(length, np.log(widest / first) / rate) if rate * length > 1e-6 else 0.0
    if grown == 0:
        return np.linspace(0.0, length, max(least, round(length / first)) + 1)
    share = -np.expm1(-rate * grown)
    count = max(least, int(np.ceil(share / (rate * first))))
    times = -np.log1p(-share * np.linspace(0, 1, count + 1)) / rate
    times[-1] = grown
    if grown == length:
        return np.asarray(times)
    even = np.linspace(grown, length, int(np.ceil((length - grown) / widest)) + 1)
    return np.concatenate([times, even[1:]])


@dataclass(frozen=True, eq=False)
class _Mesh:
    actuator: Actuator
    signal: Signal
    time: Array

    @cached_property
    def width(self) -> Array:
        return np.diff(self.time)

    @cached_property
    def within(self) -> Array:
        return np.asarray(self.time[:-1, None] + self.width[:, None] * _RULE.nodes)

    @cached_property
    def piece(self) -> Numbers:
        middle = (self.time[1:] + self.time[:-1]) / 2
        return np.searchsorted(self.signal.breaks, middle, "right") - 1

    @cached_property
    def at_ends(self) -> Array:
        return np.array([self.signal.within(self.piece, at)
                         for at in (self.time[:-1], self.time[1:])])

    @cached_property
    def volts(self) -> Array:
        return np.asarray(self.signal.within(self.piece[:, None], self.within))

    def part(self, first: int, last: int) -> _Mesh:
        return _Mesh(self.actuator, self.signal, self.time[first:last + 1])


def _passed(mesh: _Mesh, stages: Array, start: Array, sources: Array) -> tuple[Array, Array]:
    """Take one Newton step: nodes (steps + 1, size, 1 + p), stages (steps, 3, size, 1 + p).

    ``start`` (size, 1 + p) holds the state and its derivatives, ``sources`` (steps, 3, size, p) the
    right side for the derivatives. Every stage is affine in the state at the start of its step, so
    only that state is passed on from step to step.
    """
    steps, _, size = stages.shape
    rates, slopes = mesh.actuator.linear(stages, mesh.volts)
    weights = mesh.width[:, None, None] * _RULE.matrix
    free = rates - (slopes @ stages[..., None])[..., 0]
    driven = np.concatenate([free[..., None], sources], axis=-1).reshape(steps, _STAGES, -1)
    driven = (weights @ driven).reshape(steps, _STAGES, size, -1)
    follow = np.broadcast_to(np.eye(size), (steps, _STAGES, size, size))
    right = np.concatenate([follow, driven], axis=-1).reshape(steps, _STAGES * size, -1)
    solved = np.linalg.solve(newton_matrix(weights, slopes), right)
    solved = solved.reshape(steps, _STAGES, size, -1)
    end = np.tensordot(_RULE.end, solved, (0, 1))
    across = end[..., :size] + (1 - _RULE.end.sum()) * np.eye(size)
    nodes = _chained(across, end[..., size:], start)
    return nodes, solved[..., :size] @ nodes[:-1, None] + solved[..., size:]


def _chained(across: Array, added: Array, start: Array) -> Array:
    """Solve x_{n+1} = ``across``_n x_n + ``added``_n, (steps + 1, …), by joining pairs of steps."""
    nodes = np.empty((len(across) + 1, *start.shape))
    nodes[0] = start
    if len(across) == 1:
        nodes[1] = across[0] @ start + added[0]
    elif len(across):
        even = len(across) // 2 * 2
        first, second = slice(0, even, 2), slice(1, even, 2)
        nodes[:even + 1:2] = _chained(across[second] @ across[first],
                                      across[second] @ added[first] + added[second], start)
        nodes[1::2] = across[::2] @ nodes[:len(across):2] + added[::2]
    return nodes


def _finished(mesh: _Mesh, stages: Array, start: Array, by_constants: Slopes | None
              ) -> CollocatedMotion:
    count = start.shape[1] - 1
    sources = np.zeros((*stages.shape, 0)) if by_constants is None \
        else by_constants(stages, mesh.volts)
    nodes, stages = _passed(mesh, stages, start, sources)
    ends, end_slopes = np.empty((2, 3, len(mesh.width))), np.empty((2, 3, len(mesh.width), count))
    creep = np.empty((len(nodes), nodes.shape[1] - 2))
    for side, at in enumerate((nodes[:-1], nodes[1:])):
        state, volts = at[..., 0], mesh.at_ends[side]
        rates, by_state = mesh.actuator.linear(state, volts)
        ends[side] = state[:, 0], state[:, 1], rates[:, 1]
        creep[side:len(nodes) - 1 + side] = rates[:, 2:]
        end_slopes[side, 0], end_slopes[side, 1] = at[:, 0, 1:], at[:, 1, 1:]
        if by_constants is not None:
            driven = by_constants(state, volts)[:, 1]
            end_slopes[side, 2] = np.einsum("nl,nlp->np", by_state[:, 1], at[..., 1:]) + driven
    breaks = np.isin(mesh.time[1:-1], mesh.signal.breaks)
    return CollocatedMotion(mesh.time, nodes[..., 0], ends, end_slopes, breaks, stages[..., 0],
                  stages[..., 1:], creep)
