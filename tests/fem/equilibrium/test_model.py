"""The discretised film against itself and against scikit-fem's own forms: energy, forces, tangent,
invariance."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from scipy.spatial.transform import Rotation
from skfem.helpers import ddot, grad

from tests.support.models import deformed, model
from tests.support.specimens import NEO_HOOKE, circular, elliptical, skewed
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, PlateMotion, State
from tympan.geometry.mesh import unfold

VOLTAGE_SQUARED = 2500.0**2


def test_forces_are_the_energy_s_derivative_by_the_complex_step(skewed_model: Model) -> None:
    positions, _ = deformed(skewed_model)
    direction = np.random.default_rng(1).normal(size=positions.shape)
    step = 1e-30
    by_step = skewed_model.energy(positions + 1j * step * direction, VOLTAGE_SQUARED).imag / step
    forces = skewed_model.forces(positions, VOLTAGE_SQUARED)
    assert np.sum(forces * direction) == pytest.approx(by_step, rel=1e-12)


def test_voltage_forces_are_the_forces_derivative(skewed_model: Model) -> None:
    positions, plate = deformed(skewed_model)
    change = (skewed_model.forces(positions, VOLTAGE_SQUARED)
              - skewed_model.forces(positions, 0.0)) / VOLTAGE_SQUARED
    inner, border = skewed_model.by_load(State(positions, plate, VOLTAGE_SQUARED), "voltage")
    assert np.allclose(inner, change[skewed_model.discretisation.free],
                       rtol=0, atol=1e-10 * np.abs(change).max())
    assert np.allclose(border, skewed_model.on_freedoms(change, plate)[1], rtol=0,
                       atol=1e-10 * np.abs(change).max())


def test_tangent_is_the_forces_derivative_by_the_complex_step(skewed_model: Model) -> None:
    positions, plate = deformed(skewed_model)
    part = skewed_model.linearised(State(positions, plate, VOLTAGE_SQUARED))
    direction = (np.random.default_rng(2).normal(size=positions.shape)
                 * skewed_model.discretisation.unknowns.movable)
    step = 1e-30
    change = skewed_model.forces(positions + 1j * step * direction, VOLTAGE_SQUARED).imag / step
    scale = np.abs(change).max()
    free = skewed_model.discretisation.free
    assert np.allclose(part.inner @ direction[free], change[free], rtol=0, atol=1e-11 * scale)
    assert np.allclose(part.border.T @ direction[free], skewed_model.on_freedoms(change, plate)[1],
                       rtol=0,
                       atol=1e-11 * scale * 0.1)
    assert abs(part.inner - part.inner.T).max() < 1e-13 * abs(part.inner).max()


def test_taylor_order_two_in_all_unknowns_and_the_plate_s_rotations(skewed_model: Model) -> None:
    """Energy minus its quadratic model falls with the third power of the step, plate rotations
    included."""
    film = skewed_model
    positions, plate = deformed(film)
    part = film.linearised(State(positions, plate, VOLTAGE_SQUARED))
    rng = np.random.default_rng(3)
    free = 1e-3 * rng.normal(size=film.discretisation.free_count)
    border = np.array([1e-3, -1e-3, 2e-3, 0.2, 0.3, -0.2])
    at = film.energy(positions, VOLTAGE_SQUARED)
    slope = (part.forces[film.discretisation.free] @ free
             + film.on_freedoms(part.forces, plate)[1] @ border)
    bend = (free @ (part.inner @ free)
            + 2 * free @ (part.border @ border)
            + border @ part.corner @ border)
    errors = []
    for t in (0.04, 0.02, 0.01):
        moved = positions.copy()
        moved[film.discretisation.free] += t * free
        motion = plate.moved(t * border)
        energy = film.energy(film.place(moved, motion), VOLTAGE_SQUARED)
        errors.append(abs(energy - at - t * slope - t * t * bend / 2))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(rates > 2.8), rates


def test_assembly_agrees_with_scikit_fem_forms() -> None:
    """The slow way as oracle: skfem's form language on the same mesh, neo-Hooke written in F
    directly."""
    film = model(circular(), symmetry=False, order=2, refine=0.7)
    positions, plate = deformed(film)
    mesh = film.discretisation.mesh
    vector = skfem.CellBasis(mesh, skfem.ElementVector(mesh.elem(), 3), intorder=4)
    mu, jp, thickness = 25e3, 5.0, 1e-3
    x = np.zeros(vector.N)
    nodes = vector.split_indices()
    for axis in range(3):
        x[nodes[axis]] = positions[:, axis]

    def piola(f):  # type: ignore[no-untyped-def]
        c = np.einsum("ki...,kj...->ij...", f, f)
        det = c[0, 0] * c[1, 1] - c[0, 1] ** 2
        inverse = np.array([[c[1, 1], -c[0, 1]], [-c[0, 1], c[0, 0]]]) / det
        return mu * jp * np.einsum("ki...,ij...->kj...", f,
                                   np.eye(2)[..., None, None] - inverse / (jp**3 * det))

    @skfem.LinearForm
    def forces(v, w):  # type: ignore[no-untyped-def]
        return thickness / jp * ddot(piola(grad(w["x"])), grad(v))

    assembled = forces.assemble(vector, x=vector.interpolate(x))
    expected = np.column_stack([assembled[nodes[axis]] for axis in range(3)])
    got = film.forces(positions, 0.0)
    assert np.allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())

    # The tangent: skfem's bilinear form with the derivative of P by the complex step in every
    # gradient component.
    @skfem.BilinearForm
    def tangent(u, v, w):  # type: ignore[no-untyped-def]
        f, step = grad(w["x"]), 1e-30
        return thickness / jp * ddot(piola(f + 1j * step * grad(u)).imag / step, grad(v))

    matrix = tangent.assemble(vector, x=vector.interpolate(x))
    order = np.stack(nodes, axis=1)[film.discretisation.free]
    inner = film.linearised(State(positions, plate)).inner
    assert abs(matrix[order][:, order] - inner).max() < 1e-12 * abs(inner).max()


def test_rigid_motions_store_nothing(skewed_model: Model) -> None:
    positions, _ = deformed(skewed_model)
    turn = Rotation.from_rotvec([0.4, -0.3, 0.8]).as_matrix()
    moved = positions @ turn.T + np.array([0.01, 0.02, -0.03])
    assert skewed_model.energy(moved, VOLTAGE_SQUARED) == pytest.approx(
        skewed_model.energy(positions, VOLTAGE_SQUARED), rel=1e-13)
    forces = skewed_model.forces(positions, VOLTAGE_SQUARED)
    scale = np.abs(forces).sum()
    assert np.abs(forces.sum(axis=0)).max() < 1e-12 * scale
    assert np.abs(np.cross(positions, forces).sum(axis=0)).max() < 1e-12 * scale * skewed_model.size


def test_plate_gradient_and_curvature() -> None:
    arms = np.random.default_rng(0).normal(size=(7, 3))
    plate = PlateMotion.rest().moved(np.array([0.1, 0, 0, 0.5, -0.2, 0.3]))
    forces = np.random.default_rng(1).normal(size=(7, 3))
    direction = np.array([0.3, -0.1, 0.2, 0.7, 0.5, -0.4])

    def work(t: float) -> float:
        return float(np.sum(forces * plate.moved(t * direction).positions(np.zeros(3), arms)))

    slope = np.einsum("ni,nip,p->", forces, plate.gradient(arms), direction)
    bend = direction @ plate.curvature(arms, forces) @ direction
    t = 1e-3
    assert slope == pytest.approx((work(t) - work(-t)) / (2 * t), rel=1e-6)
    assert bend == pytest.approx((work(t) - 2 * work(0) + work(-t)) / t**2, rel=1e-5)


def test_symmetry_leaves_the_freedoms_it_must() -> None:
    assert model(circular()).plate_freedoms == (HEAVE,)
    assert len(model(circular(), symmetry=False).plate_freedoms) == 6
    from dataclasses import replace

    from tympan.geometry.outlines import Circle
    from tympan.geometry.specimen import Plate

    half = model(replace(elliptical(60e-3), plate=Plate(Circle(10e-3), (5e-3, 0.0))))
    assert half.discretisation.planes == {"y"}
    assert half.plate_freedoms == (0, 2, 4)


def test_a_mirrored_part_stores_its_share_of_the_whole() -> None:
    part = model(elliptical(60e-3, NEO_HOOKE))
    mesh, origin, signs = unfold(part.discretisation.mesh, part.discretisation.planes)
    whole = Model(Discretisation.of(mesh), part.specimen)
    reference = part.discretisation.reference
    bump = 3e-3 * np.cos(reference[:, :1] / 0.03) * np.cos(reference[:, 1:2] / 0.02) * [0, 0, 1]
    positions = reference + bump
    mirrored = positions[origin]
    mirrored[:, :2] *= signs.T
    assert 4 * part.energy(positions, 1e6) == pytest.approx(whole.energy(mirrored, 1e6), rel=1e-12)


def test_voltage_energy_gives_the_charge() -> None:
    """Q = −∂Π/∂U = C U with the capacitance of the recovered fields."""
    film = model(skewed(), refine=0.7, order=2)
    positions, plate = deformed(film)
    voltage, step = 2500.0, 1.0
    above, below = (film.energy(positions, (voltage + change) ** 2) for change in (step, -step))
    charge = -(above - below) / (2 * step)
    assert charge == pytest.approx(film.capacitance(State(positions, plate)) * voltage,
                                   rel=1e-7)
