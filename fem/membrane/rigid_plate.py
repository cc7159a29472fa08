"""The plate as a rigid body: its mass matrix, and its inertia over a step of time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.membrane.damped_rule import end_weights
from tympan.fem.membrane.state import HEAVE, PlateMotion, turned
from tympan.geometry.outlines import Outline, area_moments


@dataclass(frozen=True, eq=False)
class RigidPlate:
    """Load of the plate: ``mass`` [kg] and ``inertia`` about its centre [kg m²], (3, 3).

    ``arm`` leads from the plate's centre to the centre of mass [m]. Inertia and arm belong to the
    mounted position and turn with the plate.
    """

    mass: float
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    arm: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def uniform(cls, outline: Outline, mass: float, point_mass: float = 0.0,
                arm: tuple[float, float] = (0.0, 0.0)) -> RigidPlate:
        """Make a thin plate that fills its outline, ``point_mass`` of its ``mass`` at one point.

        The rest, spread evenly, has the outline's second moments about its centroid, regarded as
        those about the centre of mass, wherever ``arm`` puts that. The thickness does not count,
        nor the height of the weight above the film.

        Examples
        --------
        >>> from tympan.geometry.outlines import Circle
        >>> plate = RigidPlate.uniform(Circle(0.01), 0.02)
        >>> plate.inertia.diagonal().round(10)  # m r²/4, m r²/4, m r²/2
        array([5.e-07, 5.e-07, 1.e-06])
        """
        if not 0 <= point_mass <= mass:
            raise InputError("the plate's mass must not be negative, and its point-like part not "
                             "larger than it",
                             key="mass", given=f"{mass:g} kg, {point_mass:g} kg of it point-like")
        area, _, second = area_moments(outline)
        (xx, xy), (_, yy) = (mass - point_mass) / area * second
        inertia = np.array([[yy, -xy, 0], [-xy, xx, 0], [0, 0, xx + yy]])
        return cls(mass, inertia, arm)

    def matrix(self, plate: PlateMotion) -> Array:
        """Compute the mass matrix of the six freedoms where the plate is, shape (6, 6)."""
        centre = plate.gradient(np.array([[*self.arm, 0.0]]))[0]
        result = self.mass * centre.T @ centre
        result[3:, 3:] += plate.rotation @ self.inertia @ plate.rotation.T
        return np.asarray(result)


def carried_along(velocity: Array, momentum: Array) -> Array:
    """Compute the moment that turns momentum about a moving centre, on the six freedoms [N, N m].

    Angular momentum about the plate's centre changes by moments minus v × p, which is not zero if
    the centre of mass is elsewhere.
    """
    (u, v, w), (a, b, c) = velocity[:3], momentum[:3]  # np.cross takes twenty times as long
    return np.array([0.0, 0.0, 0.0, v * c - w * b, w * a - u * c, u * b - v * a])


@dataclass(frozen=True, eq=False)
class Swing:
    """The plate's inertia and damper over a step of a ``duration`` [s].

    ``velocity`` is that of the six freedoms at the step's start [m/s, rad/s], ``momentum`` their
    momentum [kg m/s, kg m²/s] and ``rate`` its rate [N, N m], all of shape (6,). ``mass`` is the
    predicted mass matrix at the step's end and ``damping`` that of the damper [kg, N s/m], shape
    (6, 6). So at the step's end the plate is pulled back as by a spring whose rest is where it
    would move by itself. The rule is the trapezoidal one, damped where the damper stops motions
    within the step (:mod:`tympan.fem.membrane.damped_rule`); for that ``film`` is about the film's
    stiffness against deflection [N/m].
    """

    origin: PlateMotion
    velocity: Array
    momentum: Array
    rate: Array
    mass: Array
    damping: Array
    duration: float
    film: float = 0.0

    def motion(self, plate: PlateMotion) -> Array:
        """Compute the motion of the plate over the step, shape (6,)."""
        return np.concatenate([plate.translation - self.origin.translation,
                               turned(plate, self.origin)])

    def after(self, plate: PlateMotion) -> tuple[Array, Array]:
        """Compute velocity and the momentum's rate at the step's end."""
        motion, momentum = self._ends
        velocity = self.motion(plate) / self.duration - (1 - motion) * self.velocity
        velocity = velocity / motion
        rate = (self.mass @ velocity - self.momentum) / self.duration - (1 - momentum) * self.rate
        return velocity, rate / momentum

    def on_plate(self, plate: PlateMotion) -> tuple[Any, Array, Array]:
        """Compute a potential [J] and its derivatives by the six freedoms, if these do not turn."""
        motion, (velocity, rate) = self.motion(plate), self.after(plate)
        stiffness = self.stiffness
        first = rate + self.damping @ velocity + carried_along(velocity, self.mass @ velocity)
        return motion @ (first - stiffness @ motion / 2), first, stiffness

    def rounding(self, size: float) -> Array:
        """Estimate forces of rounding for a plate within a size [m] of its rest, shape (6,)."""
        lengths = np.array([size, size, size, 1.0, 1.0, 1.0])
        return np.asarray(np.finfo(float).eps * (np.abs(self.stiffness) @ lengths))

    @property
    def stiffness(self) -> Array:
        """Derivative of the restoring forces by the plate's motion [N/m, N m], shape (6, 6)."""
        motion, momentum = self._ends
        return (self.mass / (momentum * self.duration) + self.damping) / (motion * self.duration)

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Weights of the end in the step's motion and in its change of momentum."""
        return end_weights(self.duration, self.film, float(self.damping[HEAVE, HEAVE]),
                           float(self.mass[HEAVE, HEAVE]))
