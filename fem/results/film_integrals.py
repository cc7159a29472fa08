"""Reaction, capacitance and energy of the film at several states of one model at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import STEP
from tympan.fem.membrane.model import Model, cauchy_green
from tympan.fem.membrane.state import State

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class FilmIntegrals:
    """Of the whole film, one for each state: all of shape (states,)."""

    reaction: Array  #: force that pulls the plate back [N], positive against the load
    capacitance: Array  #: charge over voltage [F], −2 ∂energy/∂U²
    energy: Array  #: stored, counted from the virgin film, at constant voltage [J]


def film_integrals(model: Model, states: Sequence[State]) -> FilmIntegrals:
    """From one evaluation of the film's density, at U² with an imaginary step.

    The reaction is the work of the stresses when the plate's edge is lifted by one, nothing else
    moving.
    """
    mesh = model.discretisation
    f = mesh.deformation(np.stack([state.positions for state in states]))
    squared = np.array([state.voltage_squared for state in states])[:, None, None]
    density = model.density(squared + 1j * STEP)(cauchy_green(f), tangent=False)
    energy = (density.energy * model.volumes).sum(axis=(1, 2)) * mesh.mirrored
    stress = density.stress.real * model.volumes[..., None]
    edge = np.zeros(len(mesh.reference))
    edge[mesh.plate_nodes] = 1.0
    lift = np.matmul(mesh.gradients.swapaxes(-1, -2),
                     edge[mesh.connectivity][:, None, :, None])[..., 0]
    work = np.einsum("sepi,sepij,epj->s", f[..., 2, :], stress[..., [[0, 2], [2, 1]]], lift)
    return FilmIntegrals(work * mesh.mirrored, -2 * energy.imag / STEP, energy.real)
