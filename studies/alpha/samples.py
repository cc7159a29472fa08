"""Equilibria α is fitted to: force, deflection, voltage, and where around the plate force is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import edge_fields
from tympan.fem.rig import Rig
from tympan.geometry.fields import Key
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, failure_reason, voltage_ramp

Array = NDArray[np.float64]

#: Directions around the plate that are told apart.
_DIRECTIONS = 7200


@dataclass(frozen=True)
class LoadGrid:
    """Masses and voltages, every combination."""

    masses: Annotated[tuple[float, ...], Key("nominal loads", "mass")]
    voltages: Annotated[tuple[float, ...], Key("nominal voltages", "voltage")]


@dataclass(frozen=True, eq=False)
class Samples:
    """Equilibria: force on the film [N], deflection [m], film voltage [V], shares (n, parts)."""

    force: Array
    deflection: Array
    voltage: Array
    shares: Array

    def __len__(self) -> int:
        return len(self.force)


def equilibria(model: Model, loads: LoadGrid, rig: Rig, settings: Settings, parts: int,
               warnings: list[str]) -> Samples:
    """Equilibria of a model under every load that has one; ``warnings`` gets the others."""
    part_of = parts_of(model.specimen, parts)
    rows: list[tuple[float, float, float]] = []
    shares: list[Array] = []
    for mass in loads.masses:
        for _, outcome in voltage_ramp(model, mass, loads.voltages, rig, settings.path):
            state = outcome.state
            if outcome.status != "equilibrium":
                warnings.append(f"{mass * 1e3:g} g: {failure_reason(outcome)}; loads beyond are "
                                "left out")
                break
            if state.plate.deflection <= 1e-6 * model.size:
                warnings.append(f"{mass * 1e3:g} g: the plate hardly sinks; this load is left out")
                break
            rows.append((model.reaction(state), state.plate.deflection,
                         float(np.sqrt(state.voltage_squared))))
            shares.append(part_shares(model, state, part_of))
    force, deflection, voltage = np.array(rows).reshape(-1, 3).T
    return Samples(force, deflection, voltage, np.array(shares).reshape(-1, parts))


def frame_distances(specimen: Specimen) -> Array:
    """Distance from the plate's centre to the frame [m] in equally spaced directions."""
    x, y = specimen.frame.points(2 * _DIRECTIONS) - np.array(specimen.plate.offset)[:, None]
    angle = np.arctan2(y, x) % (2 * np.pi)
    order = np.argsort(angle)
    distance = np.hypot(x, y)[order]
    directions = 2 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    return np.asarray(np.interp(directions, angle[order], distance, period=2 * np.pi))


def parts_of(specimen: Specimen, count: int) -> NDArray[np.int64]:
    """The part of ``count`` of equal angle each direction belongs to, 0 where the frame is nearest.

    An ellipse's two parts are the sectors within 45° of its short and of its long axis.
    """
    # Rounded, so that mirror images of a direction, alike but for the last bit, stay together.
    distance = frame_distances(specimen).round(12)
    rank = np.argsort(np.argsort(distance, kind="stable"), kind="stable")
    return np.asarray(rank * count // len(rank), dtype=np.int64)


def concentric(specimen: Specimen) -> bool:
    """Whether the frame is equally far from the plate's centre in all directions."""
    distance = frame_distances(specimen)
    return bool(np.ptp(distance) < 1e-6 * distance.max())


def part_shares(model: Model, state: State, part_of: NDArray[np.int64]) -> Array:
    """Shares of the plate's vertical edge force carried in the parts of :func:`parts_of`.

    The force is the integral of the first Piola traction along the mounted edge; angles are those
    of the mounted edge around the plate's centre.
    """
    parts = 1 + int(part_of.max())
    if parts == 1:
        return np.ones(1)
    fields, weights = edge_fields(model, state, "plate", 24, quadrature=True)
    arm = fields.position - model.centre
    angle = np.arctan2(arm[:, 1], arm[:, 0]) % (2 * np.pi)
    order = np.argsort(angle)
    force = (fields.plate_traction[:, 2] * weights)[order]
    # Midpoint rule of the cumulative force, so that a part may end between two points of an edge.
    cumulative, total = np.cumsum(force) - force / 2, force.sum()
    angles = np.concatenate([angle[order] - 2 * np.pi, angle[order], angle[order] + 2 * np.pi])
    ends = np.interp(2 * np.pi * np.arange(_DIRECTIONS + 1) / _DIRECTIONS, angles,
                     np.concatenate([cumulative - total, cumulative, cumulative + total]))
    return np.asarray(np.bincount(part_of, np.diff(ends), parts) / total)
