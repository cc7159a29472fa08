"""Actions on film and plate: weight and its arm, guide, mechanisms, gas.

The weight pulls along z. The gas lies below film and plate and loses volume where they move along
z. Counted from the flat film it has V = −∫ z n_z da = −∫ z (x,₁ y,₂ − x,₂ y,₁) dX over the film,
and minus the plate's area times its normal's z times its deflection. The virtual work of a uniform
pressure p is p δV: the tangent is symmetric, and a positive pressure lifts film and plate. The sign
of the gas is set here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.biases import BIASES as BIASES
from tympan.fem.membrane.biases import Bias, Interval
from tympan.fem.membrane.rigid_plate import Swing
from tympan.fem.membrane.state import HEAVE, PlateMotion, State

#: Motions that a guide leaves the plate: all; all but tilting; up and down only; none.
Guide = Literal["free", "level", "vertical", "fixed"]

GUIDES: dict[Guide, frozenset[str]] = {
    "free": frozenset({"x", "y", "z", "rx", "ry", "rz"}),
    "level": frozenset({"x", "y", "z", "rz"}),
    "vertical": frozenset({"z"}),
    "fixed": frozenset(),
}

#: Unit vector of the deflection among the plate's six freedoms.
_UP = np.eye(6)[HEAVE]

#: Largest step across an interval of negative stiffness, as a part of it: so both ends, and the
#: limit point at each, are found.
_PART = 0.125

#: Change of gas volume by a deflection along the weight, per volume swept.
_GAS = -1.0


@dataclass(frozen=True)
class Loading:
    """Actions on film and plate besides force, voltage and gas pressure.

    ``arm`` is where the force is applied, from the plate's centre in the mounted state [m]; it
    moves with the plate. ``gravity`` acts on the film's own mass, along the load [m/s²]. ``swing``
    is a step of time of the plate's motion, None at rest.
    """

    biases: tuple[Bias, ...] = ()
    arm: tuple[float, float] = (0.0, 0.0)
    guide: Guide = "free"
    gravity: float = 0.0
    swing: Swing | None = None

    def ended(self, deflection: float) -> tuple[str, ...]:
        """List the laws of mechanisms that do not reach a deflection [m], as beyond a table."""
        return tuple(bias.law for bias in self.biases
                     if not np.isfinite(bias.derivatives(deflection)).all())

    @cached_property
    def softening(self) -> tuple[Interval, ...]:
        """Deflections [m] between which a mechanism's stiffness may be negative, in order."""
        merged: list[Interval] = []
        # A mechanism of a package may be older than this property: no snap is sought for it.
        for low, high in sorted(each for bias in self.biases
                                for each in getattr(bias, "softening", ())):
            if merged and low <= merged[-1][1]:
                merged[-1] = merged[-1][0], max(high, merged[-1][1])
            else:
                merged.append((low, high))
        return tuple(merged)

    def step(self, deflection: float) -> float:
        """Limit the step [m] of a plate so that it jumps over no interval of negative stiffness."""
        return min((max(low - deflection, deflection - high, 0.0) + _PART * (high - low)
                    for low, high in self.softening), default=np.inf)

    def lift(self, plate: PlateMotion) -> AnyArray:
        """Differentiate the height of the weight by the plate's six freedoms."""
        x, y, _ = plate.rotation @ [*self.arm, 0.0]
        return np.array([0.0, 0.0, 1.0, y, -x, 0.0])

    def on_plate(self, state: State, centre: AnyArray, area: float) -> tuple[Any, AnyArray,
                 AnyArray]:
        """Compute the potential of all actions on the plate [J], and derivatives by its freedoms.

        These are force, bias mechanisms, and the gas pressure on the plate's ``area`` [m²], which
        lifts it.
        """
        plate = state.plate
        height = centre[HEAVE] + plate.translation[HEAVE] + plate.rotation[HEAVE, :2] @ self.arm
        energy = -state.force * height
        first = -state.force * self.lift(plate)
        second = np.zeros((6, 6))
        if any(self.arm):
            arm, weight = np.array([[*self.arm, 0.0]]), np.array([[0.0, 0.0, -state.force]])
            second = plate.curvature(arm, weight)
        for bias in self.biases:
            stored, push, stiffness = bias.derivatives(plate.deflection)
            energy, first = energy + stored, first + push * _UP
            second = second + stiffness * np.outer(_UP, _UP)
        if self.swing is not None:
            inertia, by, bend = self.swing.on_plate(plate)
            energy, first, second = energy + inertia, first + by, second + bend
        if state.pressure:
            volume, by, bend = plate_volume(area, plate)
            energy = energy - state.pressure * volume
            first, second = first - state.pressure * by, second - state.pressure * bend
        return energy, first, second


def film_volume(mesh: Discretisation, positions: AnyArray, *, second: bool = False
                ) -> tuple[Any, AnyArray, AnyArray | None]:
    """Compute the gas volume below the film [m³], its first and, if wanted, second derivatives.

    It is 0 where the film is flat, less where it deflects along the load. ``positions`` of the
    nodes have shape (nodes, 3) [m]. The derivatives are by those of the elements' nodes, shapes
    (elements, local, 3) [m²] and (elements, 3 local, 3 local), node-major [m].
    """
    f, shapes = mesh.deformation(positions), mesh.shapes
    g1, g2 = mesh.gradients[..., 0], mesh.gradients[..., 1]
    weights = _GAS * mesh.weights
    below = weights * (positions[mesh.connectivity, 2] @ shapes.T)
    # x,₁ y,₂ − x,₂ y,₁ is the area on the frame's plane per mounted area. Its derivatives by x and
    # y of each node have the shape (elements, points, local).
    x1, x2 = f[..., 0, 0], f[..., 0, 1]
    y1, y2 = f[..., 1, 0], f[..., 1, 1]
    shadow = x1 * y2 - x2 * y1
    slopes = (g1 * y2[..., None] - g2 * y1[..., None],
              g2 * x1[..., None] - g1 * x2[..., None])
    across = [np.matmul(below[:, None], slope)[:, 0] for slope in slopes]
    first = np.stack([*across, (weights * shadow) @ shapes], axis=-1)
    value = (below * shadow).sum()
    if not second:
        return value, first, None
    elements, _, local = g1.shape
    result = np.zeros((elements, local, 3, local, 3))
    turned = np.matmul((g1 * below[..., None]).transpose(0, 2, 1), g2)
    turned = turned - turned.transpose(0, 2, 1)
    result[:, :, 0, :, 1] = turned
    result[:, :, 1, :, 0] = turned.transpose(0, 2, 1)
    for axis, slope in enumerate(slopes):
        part = np.matmul((slope * weights[..., None]).transpose(0, 2, 1), shapes)
        result[:, :, axis, :, 2] = part
        result[:, :, 2, :, axis] = part.transpose(0, 2, 1)
    return value, first, result.reshape(elements, 3 * local, 3 * local)


def plate_volume(area: float, plate: PlateMotion) -> tuple[float, AnyArray, AnyArray]:
    """Compute the volume of the gas below the plate [m³], and its derivatives by the six freedoms.

    The sign is that of :func:`film_volume`; ``area`` is that of the plate [m²].
    """
    deflection, normal, area = plate.translation[HEAVE], plate.rotation[:, 2], _GAS * area
    turn = np.zeros(6, dtype=normal.dtype)
    turn[3:] = np.cross(np.eye(3), normal)[:, 2]
    first = area * (normal[2] * _UP + deflection * turn)
    second = np.outer(_UP, turn) + np.outer(turn, _UP)
    moment = np.outer((0.0, 0.0, 1.0), normal)
    second[3:, 3:] += deflection * ((moment + moment.T) / 2 - np.eye(3) * normal[2])
    return area * normal[2] * deflection, first, area * second
