"""A solved motion of a lumped actuator with derivatives: dense in time, its error known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """States at the nodes of a mesh, dense in time by Hermite's quintics of y, ẏ, ÿ.

    ``ends`` are y, ẏ, ÿ at both ends of every step, shape (2, 3, steps), and ``slopes`` their
    derivatives by p constants, (2, 3, steps, p): where the voltage jumps at a node there are two
    accelerations. ``breaks`` says of the inner nodes where the voltage has a jump or a kink.
    ``stages`` are the states within the steps, (steps, 3, size), ``stage_slopes`` their
    derivatives, (steps, 3, size, p), and ``creep`` how fast the branches move at the nodes.
    """

    time: Array
    nodes: Array
    ends: Array
    slopes: Array
    breaks: NDArray[np.bool_]
    stages: Array
    stage_slopes: Array
    creep: Array

    def deflection(self, time: Array) -> tuple[Array, Array, Array]:
        """y [m], ẏ [m/s], (times,), and y's derivatives, (times, p); at rest beyond the mesh."""
        step, basis, moving = self._place(time)
        y, speed = (np.einsum("ekn,ekn->n", part, self.ends[:, :, step])
                    for part in (basis, moving))
        slopes = np.zeros((len(step), self.slopes.shape[-1]))
        for end in range(2):
            for order in range(3):
                slopes += basis[end, order][:, None] * self.slopes[end, order, step]
        return y, speed, slopes

    def state(self, time: Array) -> Array:
        """States at times, shape (times, size): y and ẏ by the quintic, the branches by cubics."""
        y, speed, _ = self.deflection(time)
        at = np.clip(time, self.time[0], self.time[-1])
        step = np.clip(np.searchsorted(self.time, at, "right") - 1, 0, len(self.time) - 2)
        h = np.diff(self.time)[step][:, None]
        s = (at - self.time[step])[:, None] / h
        r = 1 - s
        before, after = self.nodes[step, 2:], self.nodes[step + 1, 2:]
        branches = (r**2 * ((1 + 2 * s) * before + h * s * self.creep[step])
                    + s**2 * ((1 + 2 * r) * after - h * r * self.creep[step + 1]))
        return np.column_stack([y, speed, branches])

    @property
    def errors(self) -> Array:
        """How far the quintic of each step may be off [m], by how its fifth derivative changes."""
        width = np.diff(self.time)
        (y0, v0, a0), (y1, v1, a1) = self.ends
        fifth = 120 * (6 * (y1 - y0) - 3 * width * (v0 + v1) + width**2 * (a1 - a0) / 2) / width**5
        sixth = np.where(self.breaks, 0.0, np.abs(np.diff(fifth)) / ((width[1:] + width[:-1]) / 2))
        for _ in range(2):
            sixth = np.maximum(sixth,
                               np.maximum(np.append(sixth[1:], 0.0), np.append(0.0, sixth[:-1])))
        return np.asarray(np.maximum(np.append(sixth, 0.0), np.append(0.0, sixth)) * width**6
                          / 46080)

    def _place(self, time: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """The step of each time, the basis of y, ẏ, ÿ at its ends, (2, 3, times), its slope."""
        at = np.clip(time, self.time[0], self.time[-1])
        step = np.clip(np.searchsorted(self.time, at, "right") - 1, 0, len(self.time) - 2)
        h = np.diff(self.time)[step]
        s = (at - self.time[step]) / h
        r = 1 - s
        basis = np.array([
            [r**3 * (1 + 3 * s + 6 * s**2), h * r**3 * s * (1 + 3 * s), h**2 * r**3 * s**2 / 2],
            [s**3 * (1 + 3 * r + 6 * r**2), -h * s**3 * r * (1 + 3 * r), h**2 * s**3 * r**2 / 2]])
        bump = 30 * s**2 * r**2 / h
        moving = np.array([
            [-bump, r**2 * (1 + 2 * s - 15 * s**2), h * r**2 * s * (2 - 5 * s) / 2],
            [bump, s**2 * (1 + 2 * r - 15 * r**2), -h * s**2 * r * (2 - 5 * r) / 2]])
        return step, basis, moving * ((time >= self.time[0]) & (time <= self.time[-1]))
