"""Derivatives by lengths and of pull-in: against the axisymmetric equations, new meshes, and
scikit-fem's geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.support.models import deflection_gradient, model, pressed_model
from tests.support.specimens import ROOT5, circular, skewed
from tympan.base.errors import InputError
from tympan.base.paths import with_change
from tympan.fem.derivatives.residual_derivative import ResidualDerivative, Stiffness
from tympan.fem.derivatives.sensitivity import limit_gradient, parameters
from tympan.fem.derivatives.shape import edge_nodes, velocity
from tympan.fem.discretisation.isoparametric import isoparametric
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.loading import Loading
from tympan.geometry.outlines import (
    Circle,
    Ellipse,
    Outline,
    Rotated,
    RoundedRectangle,
    Stadium,
    Superellipse,
    examples,
)
from tympan.geometry.specimen import Electrode, Plate, Region, Specimen

FORCE, VOLTAGE = 0.2, 3000.0
FILM = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(25e3), 4.7)


def slope(function: Callable[[float], float], value: float, step: float) -> float:
    """Derivative by differences of order four."""
    near, far = (function(value + d) - function(value - d) for d in (step, 2 * step))
    return (8 * near - far) / (12 * step)


def test_radii_against_the_axisymmetric_equations() -> None:
    film = model(circular())
    slopes = deflection_gradient(film, equilibrium(film, FORCE, VOLTAGE),
                                 ["plate.outline.radius", "frame.radius"])

    def heave(**radius: float) -> float:
        return axisymmetric.solve_load(replace(FILM, **radius), FORCE, VOLTAGE).deflection

    assert slopes["plate.outline.radius"] == pytest.approx(slope(lambda a: heave(inner=a), 10e-3,
                                                                 1e-5), rel=1e-5)
    assert slopes["frame.radius"] == pytest.approx(slope(lambda b: heave(outer=b), 45e-3, 5e-5),
                                                   rel=1e-5)


def test_pull_in_against_the_axisymmetric_equations() -> None:
    """Without any solve: from the critical mode alone."""
    force = 17.9e-3 * 9.81
    film = pressed_model(circular(Ogden((15e3,), (2.0,))))
    outcome = equilibrium(film, force, 7e3)
    assert outcome.critical is not None
    soft = replace(FILM, material=axisymmetric.neo_hooke(15e3))

    def pull_in(load: float = force, **changes: float) -> float:
        return axisymmetric.pull_in_voltage(replace(soft, **changes), load)

    expected = {"plate.outline.radius": slope(lambda a: pull_in(inner=a), 10e-3, 1e-5),
                "membrane.thickness": slope(lambda t: pull_in(thickness=t), 1e-3, 1e-6),
                "force": slope(pull_in, force, 1e-3 * force)}
    by_name = parameters(film)
    slopes = limit_gradient(film, outcome.critical, "voltage",
                            {name: by_name[name] for name in expected})
    voltage = np.sqrt(outcome.critical.state.voltage_squared)
    for name, value in expected.items():
        assert slopes[name] / (2 * voltage) == pytest.approx(value, rel=3e-4), name
    with pytest.raises(InputError, match="is the load that has the limit"):
        limit_gradient(film, outcome.critical, "voltage", {"voltage": by_name["voltage"]})
    with pytest.raises(InputError, match="no smooth limit"):
        limit_gradient(film, replace(outcome.critical, rate=1e9), "voltage", {})


@pytest.mark.parametrize("name", ["plate.offset.0", "electrode.margin_plate"])
def test_lengths_against_new_meshes(name: str) -> None:
    """Meshes made anew differ by their own error, which fourth-order elements keep small."""
    def heave(change: float) -> float:
        film = model(with_change(skewed(), name.split("."), change), order=4)
        return equilibrium(film, FORCE, VOLTAGE).state.plate.deflection

    film = model(skewed(), order=4)
    derivative = deflection_gradient(film, equilibrium(film, FORCE, VOLTAGE), [name])[name]
    assert derivative == pytest.approx(slope(heave, 0.0, 3e-4), rel=1e-4)


def test_geometry_is_that_of_scikit_fem_and_its_derivative() -> None:
    film = model(skewed(), refine=0.7, order=3)
    mesh = film.discretisation
    nodes = mesh.reference[:, :2][mesh.connectivity]
    gradients, areas = isoparametric(mesh.mesh.order, mesh.basis.X, nodes)
    np.testing.assert_allclose(gradients, mesh.gradients, rtol=1e-9,
                               atol=1e-8 * np.abs(gradients).max())
    np.testing.assert_allclose(areas * mesh.basis.W, mesh.weights, rtol=1e-10)
    path = ("frame", "semi_axes", "0")
    motion = velocity(mesh, film.specimen, path)[mesh.connectivity]
    slopes = isoparametric(mesh.mesh.order, mesh.basis.X,
                           nodes + 1e-30j * motion)[1].imag / 1e-30
    # The film's area πab − πr² grows with a by πb.
    assert (slopes * mesh.basis.W).sum() == pytest.approx(np.pi * 45e-3, rel=1e-5)


@pytest.mark.parametrize("name",
                         ["plate.offset.0", "plate.outline.radius", "frame.semi_axes.0", "voltage",
                                  "electrode.margin_plate", "electrode.stiffness",
                                  "membrane.prestretch.0",
                                  "membrane.thickness"])
def test_the_work_changes_as_the_forces_do(name: str) -> None:
    """Along a motion, against the residual of the complex model itself."""
    film = replace(model(skewed(), refine=0.7,
                 order=3), loading=Loading(arm=(1e-3, 2e-3), gravity=9.81))
    film = replace(film, specimen=replace(film.specimen,
                                      electrode=replace(film.specimen.electrode, stiffness=2e3)))
    state = equilibrium(film, FORCE, VOLTAGE, 15.0).state
    rng = np.random.default_rng(1)
    motion = (rng.normal(size=film.discretisation.free_count),
              rng.normal(size=6) * [1, 1, 1, 20, 20, 20])
    other, stepped = parameters(film)[name].changed(film, state, 1e-30j)
    inner, plate = other.residual(other.nodal_forces(stepped), stepped)
    expected = (motion[0] @ inner + motion[1] @ plate).imag
    derivative = ResidualDerivative(Stiffness(film, state), [motion])
    assert derivative.by(other, stepped)[0] == pytest.approx(expected, rel=1e-9)


def electrode(outline: Region) -> Specimen:
    return replace(circular(), electrode=Electrode(outline=outline))


def test_an_electrode_within_the_film_moves() -> None:
    film = model(electrode(Region(Ellipse((8e-3, 6e-3)), (25e-3, 5e-3))), order=2)
    state = equilibrium(film, FORCE, VOLTAGE).state
    names = ["electrode.outline.outline.semi_axes.0", "electrode.outline.offset.1", "frame.radius"]
    exact = deflection_gradient(film, state, names)
    for name in names:
        errors = []
        for step in (4e-4, 2e-4):
            ends = []
            for change in (step, -step):
                solution = newton(*parameters(film)[name].changed(film, state, change))
                assert solution.converged
                ends.append(solution.state.plate.deflection)
            errors.append(abs((ends[0] - ends[1]) / (2 * step) - exact[name]))
        assert errors[1] < 1e-3 * abs(exact[name])
        assert errors[0] / errors[1] > 3.5 or errors[1] < 1e-7 * abs(exact[name])


def test_an_electrode_across_the_frame_is_refused() -> None:
    film = model(electrode(Region(Circle(20e-3), (40e-3, 0.0))), order=2)
    state = equilibrium(film, FORCE, VOLTAGE).state
    with pytest.raises(InputError, match="away from plate, frame and margins"):
        deflection_gradient(film, state, ["frame.radius"])
    assert deflection_gradient(film, state, ["force"])["force"] > 0


@pytest.mark.parametrize(("frame", "plate", "name"), [
    (Stadium((75e-3, 45e-3)), Plate(Circle(10e-3)), "frame.semi_axes.0"),
    (RoundedRectangle((75e-3, 45e-3), 20e-3), Plate(Circle(10e-3)), "frame.semi_axes.0"),
    (RoundedRectangle((75e-3, 45e-3), 20e-3), Plate(Circle(10e-3)), "frame.corner_radius"),
    (Ellipse((75e-3, 45e-3)), Plate(RoundedRectangle((20e-3, 10e-3), 4e-3)),
     "plate.outline.corner_radius"),
    (Superellipse((75e-3, 45e-3), 3.0), Plate(Circle(10e-3)), "frame.exponent"),
    (examples()["spline"], Plate(Circle(10e-3), (3e-3, 2e-3)), "frame.through.1.1"),
    (Rotated(Stadium((75e-3, 45e-3)), 0.3), Plate(Ellipse((20e-3, 10e-3))), "frame.rotation")])
def test_outlines_of_pieces_against_new_meshes(frame: Outline, plate: Plate, name: str) -> None:
    base = replace(circular(), frame=frame, plate=plate)

    def heave(change: float) -> float:
        film = model(with_change(base, name.split("."), change), refine=2, order=4)
        return equilibrium(film, FORCE, VOLTAGE).state.plate.deflection

    film = model(base, refine=2, order=4)
    derivative = deflection_gradient(film, equilibrium(film, FORCE, VOLTAGE), [name])[name]
    # The frame's corners hardly matter: over a short step a new mesh changes the heave by more than
    # they do.
    step = {"frame.exponent": 3e-2, "frame.rotation": 6e-3, "frame.corner_radius": 2e-3}.get(name,
                                                                                             3e-4)
    assert derivative == pytest.approx(slope(heave, 0.0, step), rel=1e-4)


def test_sharp_corners_into_the_film_are_refused_and_named() -> None:
    film = model(replace(circular(), plate=Plate(RoundedRectangle((20e-3, 10e-3), 0.0))), order=2)
    with pytest.raises(InputError, match=r"sharp corner at 20, -?10 mm"):
        edge_nodes(film.discretisation, film.specimen)
    film = model(replace(circular(), frame=RoundedRectangle((45e-3, 40e-3), 0.0)), order=2)
    edge_nodes(film.discretisation, film.specimen)
