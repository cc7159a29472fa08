"""Scalar results of an equilibrium: their values, and their derivatives by film and plate motion.

A functional works for complex models and states (:mod:`tympan.fem.derivatives.sensitivity`), so
its own dependence on material, loads and shape needs no further code. :data:`FUNCTIONALS` has those
with a name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.fem.complex_step import STEP, complex_step
from tympan.fem.discretisation.assembly import element_forces
from tympan.fem.discretisation.isoparametric import deformation
from tympan.fem.film.density import principal_stretches
from tympan.fem.membrane.model import Model, Parts, cauchy_green
from tympan.fem.membrane.state import State
from tympan.fem.results.firmness import EdgeSpot, Spot, StrainSource


@dataclass(frozen=True)
class Functional:
    """A scalar result of the whole film, the same for a state and its mirror image but for a sign.

    ``value`` computes it [SI], complex for a complex model or state; ``slope`` its derivative by
    the free nodal components and the plate's allowed freedoms; ``unit`` is its SI unit, "1" of
    plain numbers. ``odd``: its sign changes in a mirror, so that half a film does not show how it
    grows with what is no mirror image.
    """

    value: Callable[[Model, State], Any]
    slope: Callable[[Model, State], Parts]
    unit: str
    odd: bool = False


def _tilt_slope(model: Model, state: State) -> Parts:
    """Differentiate the tilt θ: with n the normal, δn = ω × n, and cos θ = n_z."""
    x, y, _ = state.plate.rotation[:, 2]
    sine = float(np.hypot(x, y))
    if sine < 1e-9:
        raise InputError("has no derivative where the plate does not tilt", key="quantity",
                         given="tilt")
    return _of_plate(model, {3: -y / sine, 4: x / sine})


def _slope_along(axis: int) -> Functional:
    """Make the plate's slope along x or y."""
    return Functional(lambda model, state: state.plate.slope[axis],
                      lambda model, state: model.sloped(state, axis), "rad", odd=True)


def _shift_along(axis: int) -> Functional:
    """Make the motion of the plate's centre along x or y."""
    return Functional(lambda model, state: state.plate.translation[axis],
                      lambda model, state: _of_plate(model, {axis: 1.0}), "m", odd=True)


def _reaction_slope(model: Model, state: State) -> Parts:
    """Multiply the film's tangent by a lift of the plate's edge, by a complex step."""
    lift = np.zeros(state.positions.shape)
    lift[model.discretisation.plate_nodes, 2] = 1.0
    return _of_nodes(model, state, complex_step(
        lambda positions: model.nodal_forces(replace(state, positions=positions)),
        state.positions, lift))


def _capacitance_slope(model: Model, state: State) -> Parts:
    """Compute −2 ∂forces/∂U²."""
    factor, (inner, plate) = -2 * model.discretisation.mirrored, model.by_load(state, "voltage")
    return factor * inner, factor * plate


#: Power of the norm that approximates a largest value: at 64 it is 2 to 10 % too small.
_POWER = 64
#: A field at quadrature points, from model, U² and C of the mounted film.
PositiveField = Callable[[Model, Any, tuple[Any, Any, Any]], Any]


def larger_stretch(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Compute λ₁, counted from the virgin film."""
    return principal_stretches(c, model.specimen.membrane.prestretch)[0]


def larger_stress(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Compute the larger principal true stress, elastic minus Maxwell [Pa]: eigenvalue of S C."""
    stress = model.density(voltage_squared)(c, tangent=False).stress
    s11, s22, s12 = np.moveaxis(stress, -1, 0)
    c11, c22, c12 = c
    mean = (s11 * c11 + s22 * c22) / 2 + s12 * c12
    product = (s11 * s22 - s12**2) * (c11 * c22 - c12**2)
    return mean + np.sqrt(mean**2 - product)


def true_field(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Compute U over the stretched thickness under the electrode, 0 outside [V/m]."""
    film = model.specimen.membrane
    area = np.sqrt(c[0] * c[1] - c[2] ** 2) * film.area_prestretch
    thickness = film.thickness * model.relative_thickness
    return model.covered * model.shares * np.sqrt(voltage_squared) * area / thickness


def largest(field: PositiveField, unit: str) -> Functional:
    """Approximate the largest value of a positive field smoothly: (mean of hᵖ over the film)^(1/p).

    The mean is over the quadrature points of the mounted film. The result is below the true
    maximum, which it approaches as p grows. The maximum itself has no derivative where two places
    share it.
    """
    def norm(h: Any, weights: AnyArray) -> Any:
        scale = np.abs(np.real(h)).max()
        if scale == 0:
            raise InputError("has no derivative where it is zero all over", key="quantity",
                             given="a largest value")
        return scale * ((weights * (h / scale) ** _POWER).sum() / weights.sum()) ** (1 / _POWER)

    def value(model: Model, state: State) -> Any:
        h = field(model, state.voltage_squared, model.cauchy_green(state.positions))
        return norm(h, model.discretisation.weights)

    def slope(model: Model, state: State) -> Parts:
        mesh = model.discretisation
        if not model.meshed:
            raise InputError("has no derivatives: a film in closed form has no fields",
                             key="quantity", given="a largest value")
        f = mesh.deformation(state.positions)
        c = cauchy_green(f)
        h = field(model, state.voltage_squared, c)
        slopes = (h / norm(h, mesh.weights)) ** (_POWER - 1)
        shares = slopes * (mesh.weights / mesh.weights.sum())

        def by(component: int) -> Any:
            stepped: list[Any] = list(c)
            stepped[component] = stepped[component] + 1j * STEP
            changed = field(model, state.voltage_squared, (stepped[0], stepped[1], stepped[2]))
            return shares * np.imag(changed) / STEP

        stress = np.stack([2 * by(0), 2 * by(1), by(2)], axis=-1)
        forces = mesh.scatter(element_forces(mesh.gradients, f, stress))
        # The mesh is part of the film: its mirror images move alike, and the mean is the same.
        return model.on_freedoms(forces, state.plate)

    return Functional(value, slope, unit)


def firmness_at(spot: Spot | EdgeSpot) -> Functional:
    """Make the film's firmness at a spot [Pa] a functional; it is zero where the film gives way."""
    def value(model: Model, state: State) -> Any:
        sources = spot.sources(model.discretisation)
        strains = [combined(source, cauchy_green(deformed(source, model, state)))
                   for source in sources]
        return spot.value(model, state.voltage_squared, strains)

    def deformed(source: StrainSource, model: Model, state: State) -> AnyArray:
        nodes = model.discretisation.connectivity[source.elements]
        return deformation(source.gradients, state.positions[nodes])

    def combined(source: StrainSource, c: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        first, second, shear = ((source.weights * part).sum() for part in c)
        return first, second, shear

    def slope(model: Model, state: State) -> Parts:
        mesh = model.discretisation
        sources = spot.sources(mesh)
        deformations = [deformed(source, model, state) for source in sources]
        strains = [combined(source, cauchy_green(f))
                   for source, f in zip(sources, deformations, strict=True)]

        def by(number: int, component: int) -> float:
            stepped = [list(strain) for strain in strains]
            stepped[number][component] += 1j * STEP
            changed = spot.value(model, state.voltage_squared,
                                 [(first, second, shear) for first, second, shear in stepped])
            return float(np.imag(changed)) / STEP

        forces: Any = 0.0
        for number, (source, f) in enumerate(zip(sources, deformations, strict=True)):
            stress = source.weights[..., None] * np.array(
                [2 * by(number, 0), 2 * by(number, 1), by(number, 2)])
            forces = forces + mesh.scatter(element_forces(source.gradients, f, stress),
                                           mesh.connectivity[source.elements])
        return model.on_freedoms(forces, state.plate)

    return Functional(value, slope, "Pa")


#: Functionals by name: the plate's deflection along the load; the angle between its normal and the
#: load, which has no derivatives where it is zero; its slopes and its motion along x and y; the
#: force with which the film pulls the whole plate back; charge over voltage; energy stored at
#: constant voltage, counted from the virgin film; and largest values.
FUNCTIONALS: dict[str, Functional] = {
    "heave": Functional(Model.deflection, lambda model, state: model.lift, "m"),
    "tilt": Functional(lambda model, state: state.plate.tilt, _tilt_slope, "rad"),
    "tilt_x": _slope_along(0),
    "tilt_y": _slope_along(1),
    "shift_x": _shift_along(0),
    "shift_y": _shift_along(1),
    "reaction": Functional(lambda model, state: model.reaction(state), _reaction_slope, "N"),
    "capacitance": Functional(lambda model, state: model.capacitance(state), _capacitance_slope,
                              "F"),
    "energy": Functional(
        lambda model, state: (model.energy(state.positions, state.voltage_squared)
                              * model.discretisation.mirrored),
        lambda model, state: _of_nodes(model, state,
                                       model.forces(state.positions, state.voltage_squared)),
        "J"),
    "max_stretch": largest(larger_stretch, "1"),
    "max_true_stress": largest(larger_stress, "Pa"),
    "max_field": largest(true_field, "V/m"),
}


def named_functional(name: str) -> Functional:
    """Find a functional by its name; InputError for an unknown name."""
    if name not in FUNCTIONALS:
        raise InputError(f"must be one of {', '.join(FUNCTIONALS)}", key="quantity", given=name)
    return FUNCTIONALS[name]


def _of_plate(model: Model, values: dict[int, float]) -> Parts:
    plate = np.array([values.get(freedom, 0.0) for freedom in model.plate_freedoms])
    return np.zeros(model.discretisation.free_count), plate


def _of_nodes(model: Model, state: State, forces: AnyArray) -> Parts:
    """Assemble derivatives by this mesh's nodes; nodes on the plate's edge follow the plate."""
    return model.on_freedoms(forces * model.discretisation.mirrored, state.plate)
