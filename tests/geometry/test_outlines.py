"""What every registered outline must satisfy, alone and as frame and plate of a film."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.special import ellipe

from tests.support.specimens import ROOT5
from tympan.base.errors import InputError
from tympan.fem.discretisation.isoparametric import folded
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.library import MATERIALS
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import (
    Circle,
    Ellipse,
    Outline,
    Rotated,
    RoundedRectangle,
    Stadium,
    Superellipse,
    area,
    examples,
    perimeter,
)
from tympan.geometry.outlines.pieces import direction
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import Settings, build_model

EXAMPLES = examples()
FILM = Film(1e-3, (ROOT5, ROOT5), MATERIALS["vhb-4910"].material, 4.7)
COARSE = Settings(MeshSettings(order=4))


def film(frame: Outline, plate: Plate | None = None) -> Specimen:
    return Specimen("film", frame, plate or Plate(Circle(10e-3)), FILM)


@pytest.fixture(params=EXAMPLES)
def outline(request: pytest.FixtureRequest) -> Outline:
    return EXAMPLES[request.param]


def test_points_run_counterclockwise_once_around(outline: Outline) -> None:
    x, y = outline.points(997)
    assert x.shape == (997,)
    angle = np.unwrap(np.arctan2(np.roll(y, -1) - y, np.roll(x, -1) - x))
    turned = angle[-1] - angle[0] + np.mod(angle[0] - angle[-1] + np.pi, 2 * np.pi) - np.pi
    assert turned == pytest.approx(2 * np.pi)
    steps = np.hypot(np.roll(x, -1) - x, np.roll(y, -1) - y)
    assert steps.max() < 4 * 2 * np.pi * max(outline.semi_axes) / 997
    assert steps.min() > 0


def test_what_is_sent_to_another_process_is_its_numbers_alone(outline: Outline) -> None:
    assert np.isfinite(outline.level(*outline.points(50))).all()
    sent = pickle.dumps(outline)
    assert len(sent) < 3000
    again = pickle.loads(sent)
    assert again == outline
    assert np.array_equal(again.points(97), outline.points(97))


def test_area_and_length_are_those_of_fine_polygons(outline: Outline) -> None:
    areas, lengths = [], []
    for count in (4000, 8000):
        x, y = outline.points(count)
        areas.append(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)
        lengths.append(np.hypot(np.roll(x, -1) - x, np.roll(y, -1) - y).sum())
    assert area(outline) == pytest.approx(areas[1], rel=2e-6)
    assert outline.curve.length == pytest.approx(lengths[1], rel=2e-6)


def test_length_and_area_of_an_ellipse() -> None:
    a, b = 75e-3, 45e-3
    assert perimeter(Ellipse((a, b))) == pytest.approx(4 * a * ellipe(1 - (b / a) ** 2), rel=1e-10)
    stepped = perimeter(Ellipse((a + 1e-40j, b))).imag / 1e-40
    ends = [4 * (a + d) * ellipe(1 - (b / (a + d)) ** 2) for d in (1e-6, -1e-6)]
    assert stepped == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-7)
    assert area(Ellipse((a, b + 1e-40j))).imag / 1e-40 == pytest.approx(np.pi * a, rel=1e-9)


def test_level_is_the_distance_near_the_curve(outline: Outline) -> None:
    x, y = outline.points(313)
    size = max(outline.semi_axes)
    assert np.abs(outline.level(x, y)).max() < 1e-14
    edge = outline.curve
    foot = edge.foot(np.column_stack([x, y]))
    inner = (foot[1] > 1e-6) & (foot[1] < 1 - 1e-6)
    value, slope = edge.at((foot[0][inner], foot[1][inner]))
    normal = np.column_stack([slope[:, 1], -slope[:, 0]]) / np.linalg.norm(slope, axis=1,
                                                                           keepdims=True)
    for distance in (1e-5 * size, -1e-5 * size):
        assert np.allclose(outline.level(*(value + distance * normal).T), distance, rtol=1e-4)
    assert outline.level(np.zeros(1), np.zeros(1))[0] < 0 < outline.level(np.array([2 * size]),
                                                                          np.zeros(1))[0]


@given(st.floats(-1, 1), st.floats(-1, 1), st.sampled_from(sorted(EXAMPLES)))
@settings(max_examples=60, deadline=None)
def test_level_has_the_sign_of_a_winding_number(u: float, v: float, name: str) -> None:
    x, y = 80e-3 * u, 80e-3 * v
    level = float(EXAMPLES[name].level(np.array([x]), np.array([y]))[0])
    points = EXAMPLES[name].points(2000)
    angle = np.arctan2(points[1] - y, points[0] - x)
    winding = np.sum(np.mod(np.roll(angle, -1) - angle + np.pi, 2 * np.pi) - np.pi) / (2 * np.pi)
    if abs(level) > 1e-5:
        assert (winding > 0.5) == (level < 0)


def test_semi_axes_are_those_of_the_centred_box(outline: Outline) -> None:
    for turned in (outline, Rotated(outline, 0.7)):
        x, y = turned.points(20000)
        a, b = turned.semi_axes
        extents = np.array([x.max(), -x.min(), y.max(), -y.min()])
        assert extents == pytest.approx([a, a, b, b], rel=1e-6)


def test_mirror_planes_are_true_and_all_there_are(outline: Outline) -> None:
    x, y = outline.points(300)
    for plane, image in (("x", (-x, y)), ("y", (x, -y))):
        off = np.abs(outline.level(*image)).max() / max(outline.semi_axes)
        assert off < 1e-12 if plane in outline.mirror_planes else off > 1e-3
    assert Rotated(outline, 0.3).mirror_planes == (frozenset("xy") if outline.shape == "circle"
                                                   else frozenset())


@pytest.mark.parametrize("part", ["frame", "plate"])
def test_every_outline_meshes_and_solves(outline: Outline, part: str) -> None:
    """As a frame with the symmetry it has, and turned and off centre as the plate of a circle."""
    plate = Plate(Rotated(outline, 0.5), (5e-3, -8e-3))
    specimen = film(outline) if part == "frame" else film(Circle(130e-3), plate)
    model = build_model(specimen, COARSE)
    assert folded(model.discretisation.mesh) == 0
    whole = model.discretisation.basis.dx.sum() * 2 ** len(model.discretisation.planes)
    assert whole == pytest.approx(area(specimen.frame) - area(specimen.plate.outline), rel=1e-6)
    outcome = equilibrium(model, 17.9e-3 * 9.80665, 3500.0)
    assert outcome.status == "equilibrium"
    assert 0.1e-3 < outcome.state.plate.deflection < 6e-3


def test_a_superellipse_of_exponent_two_is_an_ellipse() -> None:
    axes = (75e-3, 45e-3)
    assert np.abs(Superellipse(axes,
                               2.0).curve.level(*Ellipse(axes).points(2000))).max() < 1e-9 * 75e-3
    assert area(Superellipse(axes, 2.0)) == pytest.approx(np.pi * 75e-3 * 45e-3, rel=1e-9)


@given(st.floats(2, 20))
@example(15.96875)  # of a spline whose error changes its sign half way between two knots
@settings(max_examples=20, deadline=None)
def test_superellipses_satisfy_their_equation(exponent: float) -> None:
    from scipy.special import gamma

    curve = Superellipse((75e-3, 45e-3), exponent)
    x, y = np.abs(curve.points(3001)) / np.array([[75e-3], [45e-3]])
    assert np.abs((x**exponent + y**exponent) ** (1 / exponent) - 1).max() < 1e-9
    exact = 4 * 75e-3 * 45e-3 * gamma(1 + 1 / exponent) ** 2 / gamma(1 + 2 / exponent)
    assert area(curve) == pytest.approx(exact, rel=1e-9)


def test_a_stadium_without_straight_lines_is_a_circle() -> None:
    round_one, near = Stadium((45e-3, 45e-3)), Stadium((45.1e-3, 45e-3))
    assert np.abs(round_one.level(*Circle(45e-3).points(500))).max() < 1e-16
    assert np.abs(near.level(*Circle(45e-3).points(500))).max() < 0.11e-3
    heaves = [equilibrium(build_model(film(frame), COARSE), 0.17, 3e3).state.plate.deflection
              for frame in (round_one, Circle(45e-3))]
    assert heaves[0] == pytest.approx(heaves[1], rel=1e-10)


def test_a_rotated_ellipse_behaves_as_an_ellipse() -> None:
    upright = replace(film(Rotated(Ellipse((60e-3, 45e-3)), np.pi / 2)))
    lying = film(Ellipse((60e-3, 45e-3)))
    heaves = [equilibrium(build_model(specimen, COARSE), 0.17, 3e3).state.plate.deflection
              for specimen in (upright, lying)]
    assert heaves[0] == pytest.approx(heaves[1], rel=1e-6)
    assert upright.frame.semi_axes == pytest.approx((45e-3, 60e-3))


def test_electrode_margins_follow_every_outline(outline: Outline) -> None:
    """Steiner's formula for the area of the band along the frame; a mesh without folds."""
    specimen = replace(film(outline), electrode=Electrode(margin_frame=3e-3, margin_plate=2e-3))
    model = build_model(specimen, COARSE)
    assert folded(model.discretisation.mesh) == 0
    mesh = model.discretisation
    covered = float((mesh.weights * mesh.covered).sum()) * mesh.mirrored
    inner = area(outline) - 3e-3 * outline.curve.length + np.pi * 3e-3**2
    assert covered == pytest.approx(inner - np.pi * 12e-3**2, rel=1e-6)


def test_margins_at_sharp_corners_are_refused() -> None:
    sharp = replace(film(RoundedRectangle((45e-3, 40e-3), 0.0)),
                    electrode=Electrode(margin_frame=3e-3))
    with pytest.raises(InputError, match="without sharp corners"):
        build_model(sharp, COARSE)


@pytest.mark.parametrize(("frame", "radius"), [
    (RoundedRectangle((12.7e-3, 12.7e-3), 0.3e-3), 0.3e-3),
    (RoundedRectangle((12.7e-3, 12.7e-3), 0.3e-3), 0.6e-3),
    (RoundedRectangle((25.4e-3, 25.4e-3), 0.3e-3), 0.3e-3),
    (Stadium((10e-3, 45e-3)), 0.5e-3), (Stadium((20e-3, 21e-3)), 5e-3),
], ids=str)
def test_small_corners_and_plates_mesh_where_there_is_room(frame: Outline, radius: float) -> None:
    model = build_model(film(frame, Plate(Circle(radius))), COARSE)
    assert folded(model.discretisation.mesh) == 0


@pytest.mark.parametrize(("x", "y", "dx", "dy"), [(1.0, 2.0, 0.3, -0.5), (-0.4, 0.1, 0.0, 1.0),
                                                  (0.2, -3.0, 1.0, 0.2)])
def test_the_direction_of_a_vector_turns_as_it_does(x: float, y: float, dx: float, dy: float
                                                    ) -> None:
    """By an imaginary step, against differences."""
    step = 1e-6
    ends = [np.arctan2(y + sign * step * dy, x + sign * step * dx) for sign in (-1, 1)]
    turned = direction(x + 1e-20j * dx, y + 1e-20j * dy)
    assert turned.real == direction(x, y) == np.arctan2(y, x)
    assert turned.imag / 1e-20 == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-8)
