"""An annular film of neo-Hookean law and viscous branches in time, by its axisymmetric equations.

Radius and height of the film are polynomials of the mounted radius; at every moment its potential
energy is least, and the branches' C_v, whose axes are those of the film, follow their equation by a
Runge–Kutta method of order eight. Nothing of the program is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

from tympan.base.arrays import Array

_VACUUM = 8.8541878128e-12


@dataclass
class CreepingFilm:
    """Radii of plate and frame, virgin thickness [m], prestretch, moduli [Pa], time [s].

    ``others``: moduli and times of more branches beside the one.
    """

    plate: float
    frame: float
    thickness: float
    prestretch: float
    modulus: float
    branch: float
    time: float
    permittivity: float
    degree: int = 14
    spring: float = 0.0  #: beside the film [N/m]
    mounted: float = np.inf  #: time since it was stretched [s]
    logarithmic: bool = False  #: whether C_v follows by logarithms instead
    others: tuple[tuple[float, float], ...] = ()
    pull: float = 0.0  #: of the film on the plate, at the last state [N]

    @property
    def branches(self) -> tuple[tuple[float, float], ...]:
        return ((self.branch, self.time), *self.others)

    def _basis(self) -> tuple[Array, Array, Array, Array]:
        """Mounted radii, weights, shapes (points, degree) that vanish at both ends, and slopes."""
        nodes, weights = legendre.leggauss(3 * self.degree)
        width = self.frame - self.plate
        # (1 - x²) P_k, and its derivative by the radius.
        polynomials = legendre.legvander(nodes, self.degree - 1)
        slopes = np.stack([legendre.legval(nodes, legendre.legder(row))
                           for row in np.eye(self.degree)], axis=1)
        bubble = 1 - nodes**2
        shapes = bubble[:, None] * polynomials
        by_radius = (bubble[:, None] * slopes - 2 * nodes[:, None] * polynomials) * 2 / width
        radius = self.plate + width * (nodes + 1) / 2
        return radius, weights * width / 2, shapes, by_radius

    def at_rest(self, force: float, voltage: float, memory: Any, start: Any = None,
                fixed: bool = False) -> tuple[Array, Array, Array]:
        """Coefficients of the least energy, and the squared stretches I, J along and around.

        ``memory``: C_v along and around, shape (branches, 2, points); None: all are relaxed.
        ``fixed``: the plate stays where it is at the start.
        """
        radius, weights, shapes, slopes = self._basis()
        count, width = self.degree, self.frame - self.plate
        none = np.zeros_like(shapes)
        # By the coefficients of radius, height, and the plate's heave.
        fall = np.full((len(radius), 1), -1 / width)
        along_r = np.hstack([slopes, none, 0 * fall])
        along_z = np.hstack([none, slopes, fall])
        around = np.hstack([shapes, none, 0 * fall]) / radius[:, None]
        measure = 2 * np.pi * radius * weights * self.thickness / self.prestretch**2
        field = _VACUUM * self.permittivity * (voltage / self.thickness) ** 2
        x = np.zeros(2 * count + 1) if start is None else start.copy()
        pull = np.zeros(2 * count + 1)
        pull[-1] = force
        squared = self.prestretch**2
        for _ in range(60):
            r, z, hoop = 1 + along_r @ x, along_z @ x, 1 + around @ x
            i, j = squared * (r**2 + z**2), squared * hoop**2
            first, second = self._derivatives(i, j, memory, field)
            di = 2 * squared * (r[:, None] * along_r + z[:, None] * along_z)
            dj = 2 * squared * hoop[:, None] * around
            gradient = (measure * first[0]) @ di + (measure * first[1]) @ dj - pull
            hessian = (di.T @ ((measure * second[0])[:, None] * di)
                       + dj.T @ ((measure * second[2])[:, None] * dj)
                       + di.T @ ((measure * second[1])[:, None] * dj)
                       + dj.T @ ((measure * second[1])[:, None] * di)
                       + 2 * squared * (along_r.T @ ((measure * first[0])[:, None] * along_r)
                                        + along_z.T @ ((measure * first[0])[:, None] * along_z)
                                        + around.T @ ((measure * first[1])[:, None] * around)))
            self.pull = float(gradient[-1] + force)
            gradient[-1] += self.spring * x[-1]
            hessian[-1, -1] += self.spring
            free = slice(0, 2 * count if fixed else None)
            step = np.zeros(len(x))
            step[free] = -np.linalg.solve(hessian[free, free], gradient[free])
            x = x + step * min(1.0, 0.2 * width / np.abs(step).max())
            if np.abs(step).max() < 1e-13:
                return x, i, j
        raise ArithmeticError("no equilibrium")

    def _derivatives(self, i: Array, j: Array, memory: Any, field: float) -> tuple[Any, Any]:
        """First and second derivatives of the energy per virgin volume by I and J."""
        third = 1 / (i * j)
        first = [self.modulus / 2 * (1 - third / i) - field * j / 2,
                 self.modulus / 2 * (1 - third / j) - field * i / 2]
        second = [self.modulus * third / i**2, self.modulus / 2 * third**2 - field / 2,
                  self.modulus * third / j**2]
        for (modulus, _), (v, w) in zip(self.branches, () if memory is None else memory,
                                        strict=memory is not None):
            first[0] = first[0] + modulus / 2 * (1 / v - v * w * third / i)
            first[1] = first[1] + modulus / 2 * (1 / w - v * w * third / j)
            second = [second[0] + modulus * v * w * third / i**2,
                      second[1] + modulus / 2 * v * w * third**2,
                      second[2] + modulus * v * w * third / j**2]
        return first, second

    def history(self, before: tuple[float, float], after: tuple[float, float], times: Array
                ) -> Array:
        """Deflections [m] at times [s] of a film at rest for ever under one force and voltage.

        At time 0 it gets the others.
        """
        start, i, j = self.at_rest(*before, None)
        points = len(i)

        def rate(_: float, flat: Array) -> Array:
            nonlocal start
            memory = flat.reshape(-1, 2, points)
            start, i, j = self.at_rest(*after, memory, start)
            return self._flow(i, j, memory)

        memory = np.tile(np.concatenate([i, j]), len(self.branches))
        # The loads at once, in steps that Newton can take.
        for share in np.linspace(0.0, 1.0, 9)[1:]:
            force = before[0] + share * (after[0] - before[0])
            voltage = np.sqrt(before[1]**2 + share * (after[1]**2 - before[1]**2))
            start, *_ = self.at_rest(force, float(voltage), memory.reshape(-1, 2, points), start)
        result = [start[-1]]
        done = solve_ivp(rate, (0.0, times[-1]), memory, "DOP853", t_eval=times, rtol=1e-9,
                         atol=1e-10)
        for column in done.y.T:
            result.append(self.at_rest(*after, column.reshape(-1, 2, points), start)[0][-1])
        return np.array(result)

    def staircase(self, force: float, voltages: Array, dwell: float) -> Array:
        """Deflections [m] at the ends of voltages held one after the other for a time [s].

        The force comes on the flat film with the first.
        """
        holds = [(voltage, np.array([dwell])) for voltage in voltages.tolist()]
        return np.concatenate(self.followed(force, holds))

    def followed(self, force: float, holds: list[tuple[float, Array]]) -> list[Array]:
        """Deflections [m] under voltages, each at times [s] since it came, held until the last.

        The force comes on the flat film with the first.
        """
        start, i, _ = self.at_rest(0.0, 0.0, None)
        points, memory, last, ends = len(i), self._begun(), (0.0, 0.0), []
        for voltage, times in holds:
            # The loads at once, in steps that Newton can take.
            for share in np.linspace(0.0, 1.0, 9)[1:]:
                squared = last[1] + share * (voltage**2 - last[1])
                start, *_ = self.at_rest(last[0] + share * (force - last[0]), squared**0.5,
                                         memory.reshape(-1, 2, points), start)
            last = force, voltage**2

            def rate(_: float, flat: Array, voltage: float = voltage) -> Array:
                nonlocal start
                now = flat.reshape(-1, 2, points)
                start, i, j = self.at_rest(force, voltage, now, start)
                return self._flow(i, j, now)

            done = solve_ivp(rate, (0.0, times[-1]), memory, "DOP853", t_eval=times, rtol=1e-6,
                             atol=1e-8)
            memory = done.y[:, -1]
            heaves = []
            for column in done.y.T:
                start, *_ = self.at_rest(force, voltage, column.reshape(-1, 2, points), start)
                heaves.append(start[-1])
            ends.append(np.array(heaves))
        return ends

    def _begun(self) -> Array:
        """C_v of the flat film so long after it was stretched, relaxed where that is for ever."""
        points, squared = 3 * self.degree, self.prestretch**2
        count = len(self.branches)
        if self.mounted == np.inf:
            return np.full(2 * points * count, squared)
        flat = np.array([squared])
        done = solve_ivp(lambda _, c: self._flow(flat, flat, c.reshape(-1, 2, 1)),
                         (0.0, self.mounted), np.ones(2 * count), "LSODA", rtol=1e-9, atol=1e-10)
        return np.repeat(done.y[:, -1], points)

    def _flow(self, i: Array, j: Array, memory: Array) -> Array:
        """Rates of C_v along and around [1/s], one after the other, branch by branch."""
        rates = list[Array]()
        for (_, time), (v, w) in zip(self.branches, memory, strict=True):
            stretch = i / v + j / w + v * w / (i * j)
            rates += ([v * np.log(i / v) / time, w * np.log(j / w) / time] if self.logarithmic
                      else [(i - stretch * v / 3) / time, (j - stretch * w / 3) / time])
        return np.concatenate(rates)

    def swing(self, mass: float, force: float, voltage: float, times: Array, damper: float = 0.0
              ) -> Array:
        """Deflections [m] at times [s] of a plate of that mass, at rest until time 0.

        Under the force; from then on also under the voltage. Without mass the ``damper`` [N s/m]
        alone holds it.
        """
        start, i, j = self.at_rest(force, 0.0, None)
        points = len(i)

        def rate(_: float, flat: Array) -> Array:
            nonlocal start
            heave, speed, memory = flat[0], flat[1], flat[2:].reshape(-1, 2, points)
            start = np.append(start[:-1], heave)
            start, i, j = self.at_rest(force, voltage, memory, start, fixed=True)
            flow = self._flow(i, j, memory)
            push = force - self.pull
            moved = [push / damper, 0.0] if not mass else [speed, (push - damper * speed) / mass]
            return np.concatenate([moved, flow])

        relaxed = np.tile(np.concatenate([i, j]), len(self.branches))
        begin = np.concatenate([[start[-1], 0.0], relaxed])
        done = solve_ivp(rate, (0.0, times[-1]), begin, "DOP853", t_eval=times, rtol=1e-9,
                         atol=1e-11)
        return np.asarray(done.y[0])
