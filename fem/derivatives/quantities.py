"""Scalar results of an equilibrium: their values, and how they change when film and plate move.

A quantity works for complex models and states (:mod:`tympan.fem.derivatives.parameters`), so its
own dependence on material, loads and shape needs no further code. :data:`QUANTITIES` has those with
a name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import STEP, complex_step
from tympan.fem.discretisation.assembly import element_forces
from tympan.fem.film.density import principal_stretches
from tympan.fem.membrane.model import Model, Parts, cauchy_green
from tympan.fem.membrane.plate import HEAVE
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError

Array = NDArray[Any]


@dataclass(frozen=True)
class Quantity:
    """A scalar result of the whole film.

    ``value`` gives it [SI], complex for a complex model or state; ``slope`` its derivative by the
    free nodal components and the plate's allowed freedoms. ``even``: whether the mirror image of a
    state has the same value, so that a change and its opposite do the same.
    """

    value: Callable[[Model, State], Any]
    slope: Callable[[Model, State], Parts]
    even: bool = True


def _tilt_slope(model: Model, state: State) -> Parts:
    """With n the normal, δn = ω × n, and cos θ = n_z."""
    x, y, _ = state.plate.rotation[:, 2]
    sine = float(np.hypot(x, y))
    if sine < 1e-9:
        raise InputError("has no derivative where the plate does not tilt", key="quantity",
                         given="tilt")
    return _of_plate(model, {3: -y / sine, 4: x / sine})


def _reaction_slope(model: Model, state: State) -> Parts:
    """The film's tangent times a lift of the plate's edge, by a complex step."""
    lift = np.zeros(state.positions.shape)
    lift[model.discretisation.plate_nodes, 2] = 1.0
    return _of_nodes(model, state, complex_step(
        lambda positions: model.forces(positions, state.voltage_squared), state.positions, lift))


def _energy(model: Model, state: State) -> Any:
    return model.energy(state.positions, state.voltage_squared) * model.discretisation.mirrored


def _energy_slope(model: Model, state: State) -> Parts:
    return _of_nodes(model, state, model.forces(state.positions, state.voltage_squared))


def _capacitance(model: Model, state: State) -> Any:
    if model.wrinkles:
        raise InputError("has derivatives only for films that do not wrinkle", key="quantity",
                         given="capacitance")
    return model.capacitance(state)


def _capacitance_slope(model: Model, state: State) -> Parts:
    """−2 ∂forces/∂U²."""
    forces = complex_step(lambda squared: model.forces(state.positions, squared),
                          state.voltage_squared)
    return _of_nodes(model, state, -2 * forces)


#: A field at quadrature points from model, U² and C of the mounted film.
Field = Callable[[Model, Any, tuple[Any, Any, Any]], Any]


def larger_stretch(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """λ₁, from the virgin film."""
    return principal_stretches(c, model.specimen.membrane.prestretch)[0]


def larger_stress(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Larger principal true stress, elastic minus Maxwell [Pa]: the larger eigenvalue of S C."""
    s = np.moveaxis(model.density(voltage_squared)(c, tangent=False).stress, -1, 0)
    mean = (s[0] * c[0] + s[1] * c[1]) / 2 + s[2] * c[2]
    return mean + np.sqrt(mean**2 - (s[0] * s[1] - s[2] ** 2) * (c[0] * c[1] - c[2] ** 2))


def true_field(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """U over the stretched thickness under the electrode, 0 outside [V/m]."""
    film = model.specimen.membrane
    area = np.sqrt(c[0] * c[1] - c[2] ** 2) * film.area_prestretch
    return model.discretisation.covered * np.sqrt(voltage_squared) * area / film.thickness


def largest(field: Field, power: int = 64) -> Quantity:
    """A smooth largest value of a positive field: (mean of hᵖ over the mounted film)^(1/p).

    From the quadrature points; below the true maximum, which it nears as p grows, and which has no
    derivative where two places share it.
    """
    def value(model: Model, state: State) -> Any:
        return _norm(_at_points(field, model, state), model.discretisation.weights, power)

    def slope(model: Model, state: State) -> Parts:
        weights = model.discretisation.weights
        h = _at_points(field, model, state)
        slopes = (h / _norm(h, weights, power)) ** (power - 1)
        return _by_strain(model, state, field, slopes * (weights / weights.sum()))

    return Quantity(value, slope)


def at_point(field: Field, place: tuple[float, float]) -> Quantity:
    """A field at the quadrature point nearest to a place on the mounted film [m].

    With the mesh, that point moves.
    """
    def nearest(model: Model) -> tuple[np.intp, ...]:
        mesh = model.discretisation
        nodes = mesh.reference.real[mesh.connectivity, :2]
        away = np.einsum("pl,elc->epc", mesh.shapes, nodes) - place
        return np.unravel_index(np.argmin((away**2).sum(axis=-1)), mesh.weights.shape)

    def slope(model: Model, state: State) -> Parts:
        only = np.zeros(model.discretisation.weights.shape)
        only[nearest(model)] = 1.0
        return _by_strain(model, state, field, only)

    return Quantity(lambda model, state: _at_points(field, model, state)[nearest(model)], slope,
                    even=False)


#: Quantities by name: the plate's deflection along the load [m]; the angle between its normal and
#: the load [rad], without derivatives where it is zero; the force with which the film pulls the
#: whole plate back [N]; charge over voltage [F]; energy stored at constant voltage, counted from
#: the virgin film [J]; and largest values.
QUANTITIES: dict[str, Quantity] = {
    "heave": Quantity(lambda model, state: state.plate.deflection,
                      lambda model, state: _of_plate(model, {HEAVE: 1.0})),
    "tilt": Quantity(lambda model, state: state.plate.tilt, _tilt_slope),
    "reaction": Quantity(Model.reaction, _reaction_slope),
    "capacitance": Quantity(_capacitance, _capacitance_slope),
    "energy": Quantity(_energy, _energy_slope),
    "max_stretch": largest(larger_stretch),
    "max_true_stress": largest(larger_stress),
    "max_field": largest(true_field),
}


def named_quantity(name: str) -> Quantity:
    """The quantity of a name.

    Raises
    ------
    InputError
        For a name nobody registered.
    """
    if name not in QUANTITIES:
        raise InputError(f"must be one of {', '.join(QUANTITIES)}", key="quantity", given=name)
    return QUANTITIES[name]


def _at_points(field: Field, model: Model, state: State) -> Array:
    h = field(model, state.voltage_squared, model.cauchy_green(state.positions))
    return np.broadcast_to(h, model.discretisation.weights.shape)


def _norm(h: Any, weights: Array, power: int) -> Any:
    scale = np.abs(np.real(h)).max()
    if scale == 0:
        raise InputError("has no derivative where it is zero all over", key="quantity",
                         given="a largest value")
    return scale * ((weights * (h / scale) ** power).sum() / weights.sum()) ** (1 / power)


def _of_plate(model: Model, values: dict[int, float]) -> Parts:
    """Derivatives by plate freedoms alone."""
    plate = np.array([values.get(freedom, 0.0) for freedom in model.plate_freedoms])
    return np.zeros(model.discretisation.free_count), plate


def _of_nodes(model: Model, state: State, forces: Array) -> Parts:
    """From derivatives of this mesh's part by its nodes; the plate's edge follows the plate."""
    return model.on_freedoms(forces * model.discretisation.mirrored, state.plate)


def _by_strain(model: Model, state: State, field: Field, weights: Array) -> Parts:
    """Derivative of Σ weights · field at the quadrature points."""
    mesh = model.discretisation
    f = mesh.deformation(state.positions)
    c = cauchy_green(f)

    def along(component: int) -> Any:
        stepped: list[Any] = list(c)
        stepped[component] = stepped[component] + 1j * STEP
        changed = field(model, state.voltage_squared, (stepped[0], stepped[1], stepped[2]))
        return weights * np.imag(changed) / STEP

    stress = np.stack([2 * along(0), 2 * along(1), along(2)], axis=-1)
    # A mean over the part is one over the whole: what a node does, its mirror images do.
    return model.on_freedoms(mesh.scatter(element_forces(mesh.gradients, f, stress)), state.plate)
