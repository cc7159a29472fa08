"""Numbers of an electrode's segments in solved states: capacitance, field, margin to breakdown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.film.density import maxwell
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State


def segment_capacitances(model: Model, states: Sequence[State]) -> AnyArray:
    """Compute −2 ∂E/∂U_i² of every segment in each state [F], shape (states, segments).

    It is the segment's charge over its own voltage. The film's capacitance, its charge at one
    voltage U with the same energy, is the sum of these times the squares of the shares U_i/U. An
    electrode in one piece has no segments, nor has a film in closed form.
    """
    electrode, mesh = model.specimen.electrode, model.discretisation
    if not electrode.segments or not model.meshed:
        return np.zeros((len(states), 0))
    found = np.zeros((len(states), len(electrode.segments)))
    unit = maxwell(model.specimen, 1.0, model.covered / model.relative_thickness**2)
    for row, state in zip(found, states, strict=True):
        material = model.density(state.voltage_squared).material
        first, second, _ = material.stretches(*model.stretches(state.positions))
        each = -2 * (unit.derivatives(first, second)[0] * model.volumes).sum(axis=1)
        for image in mesh.images:
            row += np.bincount(image, each, len(row))
    return found


def largest_in_segments(model: Model, values: AnyArray) -> AnyArray:
    """Find the largest value of a positive field in each segment, shape (segments,).

    ``values`` are at the nodes of every element, one element after the other.
    """
    mesh = model.discretisation
    each = values.reshape(mesh.mesh.nelements, -1).max(axis=1) * (mesh.covered[:, 0] > 0)
    found = np.zeros(len(model.specimen.electrode.segments))
    for image in mesh.images:
        np.maximum.at(found, image, each)
    return found
