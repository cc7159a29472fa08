"""Totals over the film at several states of one model at once: reaction, capacitance and energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.model import Model, cauchy_green
from tympan.fem.membrane.state import State

Array = NDArray[Any]

_STEP = 1e-30


@dataclass(frozen=True, eq=False)
class Totals:
    """Of the whole film, one for each state: all of shape (states,)."""

    reaction: Array  #: force with which the film pulls the plate back [N], positive against the load
    capacitance: Array  #: charge over voltage [F], −2 ∂energy/∂U²
    energy: Array  #: stored, counted from the virgin film, at constant voltage [J]


def totals(model: Model, states: Sequence[State]) -> Totals:
    """All three from one evaluation of the film's density, at U² with an imaginary step.

    The reaction is the work of the stresses when the plate's edge is lifted by one, nothing else
    moving.
    """
    local = np.stack([state.positions for state in states])[:, model.connectivity].swapaxes(-1, -2)
    f = np.matmul(local[:, :, None], model.gradients)
    squared = np.array([state.voltage_squared for state in states])[:, None, None]
    density = model.density(squared + 1j * _STEP)(cauchy_green(f), tangent=False)
    energy = (density.energy * model.volumes).sum(axis=(1, 2)) * model.mirrored
    stress = density.stress.real * model.volumes[..., None]
    edge = np.zeros(len(model.reference))
    edge[model.plate_nodes] = 1.0
    lift = np.matmul(model.gradients.swapaxes(-1, -2),
                     edge[model.connectivity][:, None, :, None])[..., 0]
    rise = f[..., 2, :]
    work = (stress[..., 0] * rise[..., 0] + stress[..., 2] * rise[..., 1]) * lift[..., 0]
    work += (stress[..., 2] * rise[..., 0] + stress[..., 1] * rise[..., 1]) * lift[..., 1]
    return Totals(work.sum(axis=(1, 2)) * model.mirrored, -2 * energy.imag / _STEP, energy.real)
