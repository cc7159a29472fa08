"""Whether a reported equilibrium is one: forces and moments summed again, without the solver's own.

Stresses come from a singular value decomposition of the deformation gradient and the law's first
derivatives, gas pressure acts along the deformed film's normal, the weight at its arm: none of
tympan.fem.film.density, tympan.fem.membrane.enclosed_volume, tympan.fem.membrane.loading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import default_rng
from scipy.constants import epsilon_0

from tests.oracles.potential import potential
from tympan.base.arrays import Array
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.biases import Magnet, Spring
from tympan.fem.membrane.loading import GUIDES
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import FREEDOMS, PlateMotion, State
from tympan.fem.results.fields import whole

_STEP = 1e-30


@dataclass(frozen=True)
class Balance:
    """What is left over in the whole film, relative to the largest nodal force; moments over the
    frame's half extent.

    ``nodes``: on the free nodes. ``force`` and ``moment``: on the plate, along the motions its
    guide allows. ``slope``: of the potential along random motions of film and plate, over force
    times motion. ``plate_stable``: in all motions of the plate, also those that a mirrored part of
    the film cannot make. ``film_modes``: negative eigenvalues of the film with the plate held.
    """

    nodes: float
    force: float
    moment: float
    slope: float
    plate_stable: bool
    film_modes: int

    @property
    def worst(self) -> float:
        """The largest of the left-over forces and moments."""
        return max(self.nodes, self.force, self.moment)


def balance(part: Model, state_of_part: State) -> Balance:
    """Forces and moments left over at a state, on the whole film also where a mirrored part was
    solved."""
    model, state = whole(part, state_of_part)
    forces = nodal_forces(model, state)
    scale = float(np.abs(forces).max())
    frame = model.discretisation.boundary_nodes("frame")
    free = np.ones(len(forces), dtype=bool)
    free[np.concatenate([frame, model.discretisation.plate_nodes])] = False
    force, moment = plate_balance(model, state, forces[model.discretisation.plate_nodes])
    allowed = np.array([name in GUIDES[model.loading.guide] for name in FREEDOMS])
    tangent = Tangent(model, model.linearised(state), state)
    return Balance(float(np.abs(forces[free]).max()) / scale,
                   float(np.abs(force[allowed[:3]]).max(initial=0)) / scale,
                   float(np.abs(moment[allowed[3:]]).max(initial=0)) / scale / model.size,
                   slope(model, state, forces), tangent.stable, tangent.wrinkling)


def nodal_forces(model: Model, state: State) -> Array:
    """What it takes to hold the nodes against film, its weight and the gas on it [N], shape (nodes,
    3)."""
    deformation = model.discretisation.deformation(state.positions)
    density, shapes = model.specimen.membrane.density, model.discretisation.shapes
    piola = _nominal_stress(model, state, deformation)
    elements = np.einsum("epij,eplj,ep->eli", piola, model.discretisation.gradients, model.volumes)
    elements[..., 2] -= density * model.loading.gravity * np.einsum("ep,pl->el", model.volumes,
                                                                    shapes)
    normal = np.cross(deformation[..., 0], deformation[..., 1])
    elements += state.pressure * np.einsum("epi,pl,ep->eli", normal, shapes,
                                           model.discretisation.basis.dx)
    result = np.zeros_like(state.positions)
    np.add.at(result, model.discretisation.connectivity, elements)
    return result


def _nominal_stress(model: Model, state: State, deformation: Array) -> Array:
    """Derivative of the energy per virgin volume by F of the mounted film [Pa]."""
    film, electrode = model.specimen.membrane, model.specimen.electrode
    stretched = np.array(film.prestretch)

    def film_stress(l1: Array, l2: Array) -> tuple[Array, Array]:
        _, w1, w2, *_ = film.material.derivatives(l1, l2)
        j, n = l1 * l2, film.permittivity_exponent
        permittivity = epsilon_0 * film.relative_permittivity * (j / film.area_prestretch) ** -n
        maxwell = ((1 - n / 2) * permittivity * state.voltage_squared / film.thickness**2
                   * j**2 * model.covered)
        return w1 - maxwell / l1, w2 - maxwell / l2

    def electrode_stress(l1: Array, l2: Array) -> tuple[Array, Array]:
        stiffness, l3 = electrode.stiffness * model.covered, 1 / (l1 * l2)
        return stiffness * (l1 - l3**2 / l1), stiffness * (l2 - l3**2 / l2)

    def together(l1: Array, l2: Array) -> tuple[Array, Array]:
        if stretched[0] != stretched[1]:
            return film_stress(l1, l2)
        parts = zip(film_stress(l1, l2), electrode_stress(l1 / stretched[0], l2 / stretched[0]),
                    strict=True)
        first, second = (stress + more / stretched[0] for stress, more in parts)
        return first, second

    def along_axes(f: Array, stress: Callable[[Array, Array], tuple[Array, Array]]) -> Array:
        left_vectors, values, right_vectors = np.linalg.svd(f, full_matrices=False)
        principal = np.stack(stress(values[..., 0], values[..., 1]), axis=-1)
        return np.einsum("...ik,...k,...kj->...ij", left_vectors, principal, right_vectors)

    residual = float(model.density(0.0).material.residual)
    result = along_axes(deformation * stretched,
                        lambda l1, l2: wrinkled(together, residual, l1, l2)) * stretched
    if stretched[0] != stretched[1]:
        result = result + along_axes(deformation, electrode_stress)
    return result


def wrinkled(stress: Callable[[Array, Array], tuple[Array, Array]], residual: float,
             l1: Array, l2: Array) -> tuple[Array, Array]:
    """Nominal stresses of a film whose second Piola–Kirchhoff tension is never below a residual.

    Where it would be, the width is the one at which it is not, by bisection; where there is none,
    the film is left pressed.
    """
    plain = stress(l1, l2)
    loose = plain[1] < residual * l2
    if not loose.any():
        return plain

    def bisected(tension: Callable[[Array], Array], low: Array, high: Array) -> Array:
        high = np.where(tension(high) > 0, high, np.nan)
        for _ in range(80):
            middle = (low + high) / 2
            above = tension(middle) > 0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return high

    width = bisected(lambda x: stress(l1, x)[1] - residual * x, l2, l1)
    slack = stress(l1, l1)[0] < residual * l1
    first = np.where(slack, residual * l1, stress(l1, width)[0])
    loose &= ~np.isnan(first)
    return (np.where(loose, first, plain[0]), np.where(loose, residual * l2, plain[1]))


def plate_balance(model: Model, state: State, rim: Array) -> tuple[Array, Array]:
    """Force [N] and moment about its centre [N m] left over on the plate, from what it takes to
    hold its edge."""
    plate, loading = state.plate, model.loading
    edge = model.discretisation.reference[model.discretisation.plate_nodes]
    arms = (edge - model.centre) @ plate.rotation.T
    weight = np.array([0.0, 0.0, state.force])
    hung = plate.rotation @ np.array([*loading.arm, 0.0])
    gas = -state.pressure * model.plate_area * plate.rotation[:, 2]
    push = np.array([0.0, 0.0, sum(_pull(bias, plate.deflection) for bias in loading.biases)])
    return weight + gas + push - rim.sum(axis=0), np.cross(hung, weight) - np.cross(arms,
                                                                                    rim).sum(axis=0)


def _pull(bias: object, heave: float) -> float:
    """Force of a bias mechanism along the load [N]."""
    if isinstance(bias, Spring):
        return bias.stiffness * (bias.rest - heave)
    assert isinstance(bias, Magnet)
    return bias.force / (1 + (bias.gap - heave) / bias.decay) ** bias.power


def slope(model: Model, state: State, forces: Array, tries: int = 3) -> float:
    """Largest slope of the potential along random motions, over the largest force times the
    motion's length.

    By a complex step, which has no error of truncation: near a law's locking stretch, or across a
    gap far narrower than the frame, a difference's would be larger than the forces left over.
    """
    random, largest = default_rng(5), 0.0
    for _ in range(tries):
        nodes = random.standard_normal(model.discretisation.free_count) * model.size
        motion = np.zeros(6)
        motion[list(model.plate_freedoms)] = random.standard_normal(len(model.plate_freedoms))
        motion[:3] *= model.size
        length = np.sqrt((nodes**2).sum() + (motion[:3] ** 2).sum() + (motion[3:] ** 2).sum()
                         * model.size**2)
        stepped = displaced(model, state, nodes, motion, _STEP * 1j)
        rise = complex(potential(model, stepped)).imag / _STEP
        largest = max(largest, abs(rise) / float(length * np.abs(forces).max()))
    return largest


def displaced(model: Model, state: State, nodes: Array, motion: Array, step: complex) -> State:
    """The state after a step along a motion of free nodal components and plate; the rotation to the
    first order."""
    positions = state.positions + 0 * step
    positions[model.discretisation.free] += step * nodes
    turn = np.eye(3) + step * np.cross(motion[3:], np.eye(3)).T
    plate = PlateMotion(state.plate.translation + step * motion[:3], turn @ state.plate.rotation)
    return replace(state, positions=model.place(positions, plate), plate=plate)
