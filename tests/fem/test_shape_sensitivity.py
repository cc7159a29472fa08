"""Derivatives by lengths and of pull-in: against the axisymmetric equations, new meshes, and
scikit-fem's geometry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.support.models import deflection_gradient, model, pressed_model
from tests.support.specimens import ROOT5, circular, skewed
from tympan.base.errors import InputError
from tympan.base.paths import with_change, with_numbers
from tympan.fem.derivatives.quantities import FUNCTIONALS
from tympan.fem.derivatives.residual_derivative import ResidualDerivative, Stiffness
from tympan.fem.derivatives.sensitivity import (
    gradient_many,
    limit_gradient,
    parameters,
    shape_names,
)
from tympan.fem.derivatives.shape import edge_nodes, edges_of, motion_between, velocity
from tympan.fem.discretisation.isoparametric import folded, isoparametric
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.electrode import Segment
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


def test_an_electrode_across_the_frame_moves_along_it() -> None:
    """Nodes where both cross slide along both: against the moved mesh and new meshes."""
    base = electrode(Region(Circle(20e-3), (40e-3, 0.0)))
    film = model(base, refine=2)
    state = equilibrium(film, FORCE, VOLTAGE).state
    names = ["frame.radius", "electrode.outline.offset.0"]
    exact = deflection_gradient(film, state, names)

    def heave(name: str, change: float) -> float:
        other = model(with_change(base, name.split("."), change), refine=2)
        return equilibrium(other, FORCE, VOLTAGE).state.plate.deflection

    for name in names:
        found = slope(partial(heave, name), 0.0, 4e-4)
        assert exact[name] == pytest.approx(found, rel=1e-3), name


def test_edges_that_touch_and_do_not_move_alike_are_refused() -> None:
    """The electrode's outline touches the frame from within, all around at one place."""
    film = model(electrode(Region(Circle(20e-3), (25e-3, 0.0))), order=2)
    state = equilibrium(film, FORCE, VOLTAGE).state
    with pytest.raises(InputError, match="lie on each other or touch"):
        deflection_gradient(film, state, ["frame.radius"])
    assert deflection_gradient(film, state, ["force"])["force"] > 0


def sector(name: str, start: float, end: float, **more: Any) -> Segment:
    return Segment(name=name, sector=(np.radians(start), np.radians(end)), **more)


def segmented(**more: Any) -> Specimen:
    """Sectors with gaps, one of them cut by a band; the plate off centre: without symmetry."""
    segments = (sector("A", 0, 80, band=(3e-3, 20e-3)), sector("B", 90, 180, share=0.5),
                sector("C", 185, 262, share=0.2), sector("D", 270, 360, share=0.7))
    electrode = Electrode(gap=4e-3, segments=segments)
    return replace(circular(), electrode=electrode, plate=Plate(Circle(10e-3), (1e-3, -2e-3)))


QUANTITIES = {name: FUNCTIONALS[name] for name in ("heave", "tilt_x", "tilt_y", "capacitance")}
#: Steps of lengths [m] and angles [rad] for differences.
STEP, TURN = 4e-4, 0.02


def values(film: Model, state: State) -> np.ndarray:
    return np.array([float(quantity.value(film, state)) for quantity in QUANTITIES.values()])


def gradients(film: Model, state: State, names: Sequence[str]) -> dict[str, np.ndarray]:
    slopes = gradient_many(film, state, QUANTITIES, parameters(film, names))
    return {name: np.array([slopes[quantity][name] for quantity in QUANTITIES]) for name in names}


@pytest.mark.study(seconds=25)
def test_edges_of_segments_move_to_second_order() -> None:
    """Every length of a segmented film, by Taylor's formula on the moved mesh."""
    film = model(segmented())
    state = equilibrium(film, FORCE, VOLTAGE).state
    names = shape_names(film.specimen)
    assert {"electrode.gap", "electrode.segments.0.sector.1", "electrode.segments.0.band.0",
            "electrode.segments.0.band.1"} <= {*names}
    assert "electrode.segments.1.band.0" not in names
    exact = gradients(film, state, names)
    scale = {kind: np.max([np.abs(slopes) for name, slopes in exact.items()
                           if ("sector" in name) == kind], axis=0) for kind in (True, False)}
    for name in names:
        step, errors = TURN if "sector" in name else STEP, []
        for change in (step, step / 2):
            ends = []
            for signed in (change, -change):
                other, start = parameters(film)[name].changed(film, state, signed)
                solution = newton(other, start)
                assert solution.converged
                ends.append(values(other, solution.state))
            errors.append(np.abs((ends[0] - ends[1]) / (2 * change) - exact[name])
                          / scale["sector" in name])
        # The third derivative by the plate's place is large; the order is what is tested.
        assert (errors[1] < 3e-3).all(), name
        assert ((errors[0] > 3.5 * errors[1]) | (errors[1] < 1e-6)).all(), name


@pytest.mark.study(seconds=12)
@pytest.mark.parametrize("refine", [1.0, 4.0])
@pytest.mark.parametrize("name", [
    "electrode.gap", "electrode.segments.0.sector.1", "electrode.segments.0.band.1",
    "plate.outline.radius", "plate.offset.0", "frame.radius"])
def test_edges_of_segments_against_new_meshes(name: str, refine: float) -> None:
    film = model(segmented(), refine=refine)
    exact = gradients(film, equilibrium(film, FORCE, VOLTAGE).state, [name])[name]
    step, ends = TURN if "sector" in name else 2 * STEP, []
    for signed in (step, -step, step / 2, -step / 2):
        other = model(with_change(film.specimen, name.split("."), signed), refine=refine)
        ends.append(values(other, equilibrium(other, FORCE, VOLTAGE).state))
    far, near = (ends[0] - ends[1]) / (2 * step), (ends[2] - ends[3]) / step
    # New meshes change each value by their own errors, which differ from mesh to mesh.
    close = 6e-3 if refine < 2 else 1e-3
    allowed = close * np.abs(exact)
    allowed[1:3] += close / 5 * np.abs(exact[1:3]).max()
    assert (np.abs((4 * near - far) / 3 - exact) <= allowed).all()


def test_a_mirrored_part_has_the_derivatives_of_the_whole_by_its_segments() -> None:
    """One sector's edge alone has no mirror image: a quarter of the film has its share."""
    segments = tuple(sector(name, start + 5, start + 85)
                     for name, start in zip("ABCD", (0, 90, 180, 270), strict=True))
    film = replace(circular(), electrode=Electrode(gap=3e-3, segments=segments))
    part, whole = model(film, refine=4), model(film, refine=4, symmetry=False)
    assert part.discretisation.planes == {"x", "y"}
    names = ["electrode.gap", "electrode.segments.0.sector.1", "electrode.segments.2.sector.0"]
    found = [deflection_gradient(each, equilibrium(each, FORCE, VOLTAGE), names)
             for each in (part, whole)]
    for name in names:
        assert found[0][name] == pytest.approx(found[1][name], rel=1e-7)


def test_moved_nodes_are_on_the_other_films_edges() -> None:
    base = segmented()
    wide = with_numbers(base, {
        "plate.outline.radius": 10.7e-3, "plate.offset.0": 0.6e-3, "electrode.gap": 3.7e-3,
        "electrode.segments.0.sector.1": np.radians(78.0), "frame.radius": 46e-3,
        "electrode.segments.0.band.1": 20.5e-3})
    film = model(base)
    mesh = film.discretisation
    moved = mesh.moved(motion_between(mesh, base, wide))
    assert not folded(moved.mesh)
    for name, nodes in edge_nodes(mesh, base).items():
        edge, places = edges_of(wide)[name], moved.reference[nodes, :2]
        assert np.abs(edge.at(edge.foot(places)) - places).max() < 1e-12, name
    # It is the film of a new mesh.
    there = replace(film, discretisation=moved, specimen=wide)
    own = model(wide)
    found, known = (values(each, equilibrium(each, FORCE, VOLTAGE).state) for each in (there, own))
    np.testing.assert_allclose(found, known, rtol=1e-3)
    # To first order it is the velocity.
    near = with_change(base, ("electrode", "gap"), 1e-7)
    rate = velocity(mesh, base, ("electrode", "gap"))
    np.testing.assert_allclose(motion_between(mesh, base, near) / 1e-7, rate, atol=1e-5)


def test_edges_that_segments_share_do_not_move_alone() -> None:
    halves = (sector("A", 0, 180), sector("B", 180, 360, share=0.0))
    film = replace(circular(), electrode=Electrode(segments=halves))
    assert not [name for name in shape_names(film) if "segments" in name or "gap" in name]
    alone = replace(circular(), electrode=Electrode(segments=halves[:1]))
    assert "electrode.segments.0.sector.1" in shape_names(alone)
    free = model(alone)
    exact = gradients(free, equilibrium(free, FORCE, VOLTAGE).state, shape_names(alone))
    assert exact["electrode.segments.0.sector.1"][0] == pytest.approx(
        -exact["electrode.segments.0.sector.0"][0], rel=1e-3)


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
