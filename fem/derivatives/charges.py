"""Charges of an electrode's segments by their voltages, where film and plate are free to move.

With the energy E(x, s_1, …, s_k) of film and actions at constant voltages, s_j = U_j², the charge
of segment i is Q_i = −∂E/∂U_i = C_i U_i, C_i = −2 ∂E/∂s_i. Film and plate follow a voltage by
K dx/ds_j = −r_j, r_j = ∂²E/∂x∂s_j, so that

    ∂Q_i/∂U_j = δ_ij C_i + 4 U_i U_j r_iᵀ K⁻¹ r_j,

symmetric, and positive definite where the equilibrium is stable. Where the film wrinkles, its
energy is not linear in s_i even if nothing moves, which adds 2 U_i² ∂C_i/∂s_i.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.residual_derivative import Stiffness
from tympan.fem.derivatives.sensitivity import nearby_tangent, solve_adjoint
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.membrane.model import Model
from tympan.fem.results.fields import whole


def charges_by_voltages(model: Model, solution: Solution) -> AnyArray:
    """Differentiate the charges of segments by their voltages [F], shape (segments, segments).

    Loads, gas pressure and the other voltages stay. The mesh must have elements.
    """
    half = bool(model.discretisation.planes)
    # One segment alone breaks the symmetry: the whole film has to move.
    model, state = whole(model, solution.state)
    nearby = nearby_tangent(model, state if half else solution)
    stiffness = Stiffness(model, state)
    electrode, segments = model.specimen.electrode, model.discretisation.segments
    shares = np.array([np.real(segment.share) for segment in electrode.segments])
    voltages = shares * np.sqrt(max(state.voltage_squared, 0.0))
    # Under one voltage, which differs between elements, each segment has its own.
    apart = replace(model, specimen=replace(model.specimen,
                                            electrode=electrode.even))
    pulls, own = [], []
    for number in range(len(shares)):
        squared = voltages[segments, None] ** 2 + 1j * STEP * (segments == number)[:, None]
        forces = apart.forces(state.positions, squared).imag / STEP
        pulls.append(model.on_freedoms(forces, state.plate))
        own.append(_charged(apart, squared, state.positions, segments == number))
    motions = [solve_adjoint(stiffness, nearby, pull) for pull in pulls]
    coupled = np.array([[inner @ motion[0] + plate @ motion[1] for motion in motions]
                        for inner, plate in pulls])
    capacitance, change = np.array(own).T
    matrix = 4 * np.outer(voltages, voltages) * (coupled + coupled.T) / 2
    return np.asarray(matrix + np.diag(capacitance + 2 * voltages**2 * change))


def _charged(model: Model, squared: AnyArray, positions: AnyArray, within: AnyArray
             ) -> tuple[float, float]:
    """Compute −2 ∂E/∂s of some elements [F], and its derivative by s at these places [F/V²]."""
    density = model.density(squared)
    first, second, _ = density.material.stretches(*model.stretches(positions))
    slope = (model.density(1.0).maxwell.derivatives(first, second)[0] * model.volumes)[within].sum()
    return float(-2 * np.real(slope)), float(-2 * np.imag(slope) / STEP)
