"""The lumped model's motion and its exact derivatives by constants, solved over all steps of a record at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.identify.motion import Motion
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.signals import Pieces

Array = NDArray[np.float64]
#: An actuator of constants, and the derivatives of its rates by them, (size, p, points…), at states
#: and voltages.
Model = Callable[[Array], Actuator]
Slopes = Callable[[Array, Array, Array], Array]

# Gauss's collocation at three points, order 6, A-stable (Hairer and Wanner, *Solving Ordinary
# Differential Equations II*, 1996, IV.5), and the weights of the stages, less the start, in the
# step's end.
_ROOT = 15**0.5
_C = np.array([0.5 - _ROOT / 10, 0.5, 0.5 + _ROOT / 10])
_A = np.array([[5 / 36, 2 / 9 - _ROOT / 15, 5 / 36 - _ROOT / 30],
               [5 / 36 + _ROOT / 24, 2 / 9, 5 / 36 - _ROOT / 24],
               [5 / 36 + _ROOT / 30, 2 / 9 + _ROOT / 15, 5 / 36]])
_END = np.linalg.solve(_A.T, np.array([5 / 18, 4 / 9, 5 / 18]))

_PRECISION = 1e-10  # of the quintics [m]
_CLOSE = 1e-7  # [m]: from a change so small Newton's next step, the one with the derivatives, is exact
_NEWTON, _ROUNDS = 12, 8
_STEPS = 20_000  # of the first mesh


@dataclass(eq=False)
class Follower:
    """Solves one actuator's motion from rest, under one voltage, for one set of constants after the other.

    Newton's method runs over all steps at once, begun from the last motion and its derivatives;
    where it does not converge, over half of them. Derivatives are the same linear equations with
    other right sides. The mesh moves until its quintics are within 1e-10 m. ``began`` is the
    voltage of the rest it begins from [V].
    """

    model: Model
    by_constants: Slopes
    drive: Pieces
    began: float
    last: Motion | None = None
    constants: Array | None = None

    def solve(self, constants: Array, derivatives: bool = True) -> Motion:
        """The motion with some constants.

        Raises
        ------
        InputError
            When with them there is no rest to begin from, or the film is drawn in.
        """
        actuator = self.model(constants)
        start, slopes = self._start(actuator, constants, derivatives)
        time = self._first_mesh(actuator, start) if self.last is None else self.last.time
        for _ in range(_ROUNDS):
            mesh = _Mesh(actuator, self.drive, time)
            with np.errstate(all="ignore"):
                stages, _ = _solved(mesh, self._guess(mesh, constants), start)
                motion = _finished(mesh, stages, start, slopes,
                                   partial(self.by_constants, constants) if derivatives else None)
            self.last, self.constants = motion, constants.copy()
            errors = motion.errors
            if errors.max() < 4 * _PRECISION:
                break
            time = _moved(motion, errors, self.drive)
        return motion

    def _start(self, actuator: Actuator, constants: Array, derivatives: bool) -> tuple[Array,
                                                                                       Array]:
        """Rest at the voltage it began from, (size,), and its derivatives, (size, p)."""
        y = rest(actuator,
                 self.began).deflection if self.last is None else float(self.last.nodes[0, 0])
        for _ in range(20):
            force, stiffness = actuator.balance(y, self.began)
            y -= force / stiffness
            if abs(force / stiffness) < 1e-14:
                break
        if not stiffness > 0:
            raise InputError("has no stable rest to begin from with these constants",
                             key=actuator.specimen.name)
        state = actuator.rest(y)
        if not derivatives:
            return state, np.zeros((len(state), 0))
        pushed = self.by_constants(constants, state[:, None],
                                   np.array([self.began]))[1, :, 0] * actuator.moved
        tangent = np.array([1.0, 0.0, *(circle.stretch(y)[1] for circle in actuator.circles)])
        return state, np.outer(tangent, pushed / stiffness)

    def _guess(self, mesh: _Mesh, constants: Array) -> Array | None:
        """States within the steps from the last motion, shape (steps, 3, size); None where there is none."""
        if self.last is None or self.constants is None:
            return None
        if self.last.time is not mesh.time:
            return self.last.state(mesh.within.ravel()).reshape(len(mesh.width), 3, -1)
        if not self.last.stage_slopes.shape[-1]:
            return self.last.stages
        return np.asarray(self.last.stages + self.last.stage_slopes @ (constants - self.constants))

    def _first_mesh(self, actuator: Actuator, start: Array) -> Array:
        """Even steps, two for a radian of the fastest pole at the start."""
        breaks = self.drive.breaks
        fastest = float(np.abs(np.linalg.eigvals(actuator.jacobian(start, self.began))).max())
        wide = max(0.5 / fastest, float(np.ptp(breaks)) / _STEPS)
        least = 6 if len(breaks) < 100 else 1
        parts = [np.linspace(left, right, max(least, round((right - left) / wide)) + 1)[:-1]
                 for left, right in pairwise(breaks)]
        return np.concatenate([*parts, breaks[-1:]])


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Steps of one motion, and the voltages at their ends and within; some of them in a row are a mesh too."""

    actuator: Actuator
    drive: Pieces
    time: Array

    @cached_property
    def width(self) -> Array:
        """Of every step [s]."""
        return np.diff(self.time)

    @cached_property
    def within(self) -> Array:
        """The times of the stages, shape (steps, 3)."""
        return np.asarray(self.time[:-1, None] + self.width[:, None] * _C)

    @cached_property
    def at_ends(self) -> Array:
        """Voltages at the steps' beginnings and ends, shape (2, steps), each on the piece of its step."""
        points, volts = self.drive.time, self.drive.voltage
        solid = np.flatnonzero(np.diff(points) > 0)
        middle = (self.time[1:] + self.time[:-1]) / 2
        left = solid[np.clip(np.searchsorted(points[solid], middle, "right") - 1, 0,
                             len(solid) - 1)]
        slope = (volts[left + 1] - volts[left]) / (points[left + 1] - points[left])
        return np.array([volts[left] + slope * (at - points[left])
                         for at in (self.time[:-1], self.time[1:])])

    @cached_property
    def volts(self) -> Array:
        """Voltages at the stages, shape (steps, 3)."""
        first, last = self.at_ends
        return np.asarray(first[:, None] + (last - first)[:, None] * _C)

    def part(self, first: int, last: int) -> _Mesh:
        """Some steps in a row."""
        return _Mesh(self.actuator, self.drive, self.time[first:last + 1])


def _passed(mesh: _Mesh, stages: Array, start: Array, sources: Array) -> tuple[Array, Array]:
    """One step of Newton's method over all steps: nodes (steps + 1, size, 1 + p) and stages (steps, 3, size, 1 + p).

    ``start`` (size, 1 + p) holds the state and its derivatives, ``sources`` (steps, 3, size, p)
    what drives those. Every stage is affine in the state its step begins with, so only that is
    handed on from step to step.
    """
    steps, _, size = stages.shape
    state = np.moveaxis(stages, -1, 0)
    rates, slopes = mesh.actuator.linear(state, mesh.volts)
    rates, slopes = np.moveaxis(rates, 0, -1), np.moveaxis(slopes, (0, 1), (-2, -1))
    reach = mesh.width[:, None, None] * _A
    matrix = np.eye(3 * size).reshape(3, size, 3, size) \
        - reach[:, :, None, :, None] * np.moveaxis(slopes, 1, 2)[:, None]
    free = rates - (slopes @ stages[..., None])[..., 0]
    driven = np.concatenate([free[..., None], sources], axis=-1).reshape(steps, 3, -1)
    driven = (reach @ driven).reshape(steps, 3, size, -1)
    follow = np.broadcast_to(np.tile(np.eye(size), (3, 1)).reshape(3, size, size),
                             (steps, 3, size, size))
    right = np.concatenate([follow, driven], axis=-1).reshape(steps, 3 * size, -1)
    solved = np.linalg.solve(matrix.reshape(steps, 3 * size, 3 * size), right).reshape(steps, 3,
                                                                                       size, -1)
    end = np.tensordot(_END, solved, (0, 1))
    nodes = _chained(end[..., :size] + (1 - _END.sum()) * np.eye(size), end[..., size:], start)
    return nodes, solved[..., :size] @ nodes[:-1, None] + solved[..., size:]


def _chained(across: Array, added: Array, start: Array) -> Array:
    """x of x_{n+1} = ``across``_n x_n + ``added``_n from a start, (steps + 1, …): pairs of steps are one step twice."""
    nodes = np.empty((len(across) + 1, *start.shape))
    nodes[0] = start
    if len(across) == 1:
        nodes[1] = across[0] @ start + added[0]
    elif len(across):
        even = len(across) // 2 * 2
        first, second = slice(0, even, 2), slice(1, even, 2)
        nodes[:even + 1:2] = _chained(across[second] @ across[first],
                                      across[second] @ added[first] + added[second],
                                      start)
        nodes[1::2] = across[::2] @ nodes[:len(across):2] + added[::2]
    return nodes


def _newton(mesh: _Mesh, stages: Array, start: Array) -> tuple[Array, Array] | None:
    """Stages and last state of a mesh; None where Newton's method does not get there."""
    before = np.inf
    for _ in range(_NEWTON):
        nodes, new = _passed(mesh, stages, start[:, None], np.zeros((*stages.shape, 0)))
        change = float(np.abs(new[..., 0, 0] - stages[..., 0]).max())
        if not np.isfinite(new).all() or change > max(10 * before, mesh.actuator.reach):
            return None
        stages, before = new[..., 0], change
        if change < _CLOSE:
            return stages, nodes[-1, :, 0]
    return None


def _solved(mesh: _Mesh, guess: Array | None, start: Array) -> tuple[Array, Array]:
    """The same, by halves where it does not get there at once."""
    steps = len(mesh.width)
    first = np.broadcast_to(start, (steps, 3, len(start))) if guess is None else guess
    found = _newton(mesh, first, start)
    if found is not None:
        return found
    if steps == 1:
        raise InputError("is drawn in with these constants: its motion goes beyond the model's reach",
                         key=mesh.actuator.specimen.name, given=f"after {mesh.time[0]:.4g} s")
    half = steps // 2
    left, middle = _solved(mesh.part(0, half), None if guess is None else guess[:half], start)
    right, end = _solved(mesh.part(half, steps), None if guess is None else guess[half:], middle)
    return np.concatenate([left, right]), end


def _finished(mesh: _Mesh, stages: Array, start: Array, slopes: Array,
              by_constants: Callable[[Array, Array], Array] | None) -> Motion:
    """A last step of Newton's method, with the derivatives, and what is dense in time."""
    count = slopes.shape[1]
    sources = np.zeros((*stages.shape, 0)) if by_constants is None \
        else np.moveaxis(by_constants(np.moveaxis(stages, -1, 0), mesh.volts), (0, 1), (-2, -1))
    nodes, stages = _passed(mesh, stages, np.concatenate([start[:, None], slopes], axis=1), sources)
    ends, end_slopes = np.empty((2, 3, len(mesh.width))), np.empty((2, 3, len(mesh.width), count))
    for side, at in enumerate((nodes[:-1], nodes[1:])):
        state, volts = at[..., 0].T, mesh.at_ends[side]
        ends[side] = *state[:2], mesh.actuator.rates(state, volts)[1]
        end_slopes[side, 0], end_slopes[side, 1] = at[:, 0, 1:], at[:, 1, 1:]
        if by_constants is not None:
            by_state = mesh.actuator.jacobian(state, volts)[1]
            end_slopes[side, 2] = np.einsum("ln,nlp->np", by_state,
                                            at[..., 1:]) + by_constants(state, volts)[1].T
    breaks = np.isin(mesh.time[1:-1], mesh.drive.breaks)
    return Motion(mesh.time, nodes[..., 0], ends, end_slopes, breaks, stages[..., 0],
                  stages[..., 1:])


def _moved(motion: Motion, errors: Array, drive: Pieces) -> Array:
    """A mesh whose steps all err alike: as many as each piece of the voltage needs for it."""
    width = np.diff(motion.time)
    wanted = width * np.clip(0.8 * (_PRECISION / np.maximum(errors, 1e-30)) ** (1 / 6), 0.1, 5.0)
    share = np.append(0.0, np.cumsum(width / wanted))
    pieces = []
    for left, right in pairwise(np.searchsorted(motion.time, drive.breaks)):
        count = int(np.ceil(share[right] - share[left]))
        even = np.linspace(share[left], share[right], max(count, 1) + 1)
        pieces.append(np.interp(even, share[left:right + 1], motion.time[left:right + 1])[:-1])
    return np.concatenate([*pieces, motion.time[-1:]])

