"""Electrodes of any outline: the area they cover, the mesh at their edge, their capacitance, and
what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
import skfem
from scipy.constants import epsilon_0

from tests.support.models import model
from tests.support.specimens import PATCH_TOML, ROOT5, circular
from tympan.base.errors import InputError
from tympan.fem.discretisation.isoparametric import folded
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.library import load_specimen
from tympan.fem.results.fields import edge_fields
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Plate, Region, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.export import export

#: Outlines on a frame of radius 45 mm around a plate of radius 10 mm, and the planes of symmetry
#: they leave.
REGIONS = {
    "around the plate": (Region(Ellipse((30e-3, 20e-3))), "xy"),
    "off centre around the plate": (Region(Circle(20e-3), (5e-3, 4e-3)), ""),
    "across the plate's edge": (Region(Circle(20e-3), (15e-3, 0.0)), "y"),
    "beside the plate": (Region(Ellipse((6e-3, 12e-3)), (25e-3, 5e-3)), ""),
    "beyond the frame": (Region(Ellipse((30e-3, 20e-3)), (0.0, 30e-3)), "x"),
    "beyond the frame and across the plate": (Region(Ellipse((30e-3, 15e-3)), (30e-3, 0.0)), "y"),
    "a strip across both": (Region(Ellipse((60e-3, 8e-3))), "xy"),
    "larger than the film": (Region(Circle(60e-3)), "xy"),
}
MARGINS = {"no margins": (0.0, 0.0), "margins": (3e-3, 2e-3)}


def specimen(region: Region, margins: tuple[float, float] = (0.0, 0.0)) -> Specimen:
    return replace(circular(), electrode=Electrode(*margins, outline=region))


def chord(outline: Circle | Ellipse, offset: tuple[float, float],
          x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends in y of the outline's chord at each x; an empty one where it has none."""
    a, b = outline.semi_axes
    half = b * np.sqrt(np.maximum(1 - ((x - offset[0]) / a) ** 2, 0))
    return offset[1] - half, offset[1] + half


def chord_area(region: Region, frame: float, plate: float) -> float:
    """Area of region ∩ circle(frame) − circle(plate), by chords of convex outlines; no mesh, no
    CAD."""
    # Chords grow like a square root at their ends; sin makes the integrand smooth at the region's
    # own ends.
    (a, _), (x0, _) = region.outline.semi_axes, region.offset
    angle = (np.arange(400_000) + 0.5) / 400_000 * np.pi - np.pi / 2
    x = x0 + a * np.sin(angle)
    low, high = chord(region.outline, region.offset, x)
    outer, inner = (chord(Circle(radius), (0.0, 0.0), x) for radius in (frame, plate))
    low, high = np.maximum(low, outer[0]), np.minimum(high, outer[1])
    hole = np.maximum(np.minimum(high, inner[1]) - np.maximum(low, inner[0]), 0)
    return float(((np.maximum(high - low, 0) - hole) * a * np.cos(angle)).mean() * np.pi)


def covered_area(item: Specimen, settings: Settings) -> float:
    film = build_model(item, settings).discretisation
    return float((film.basis.dx * film.covered).sum()) * film.mirrored


@pytest.mark.parametrize("margins", MARGINS)
@pytest.mark.parametrize("name", REGIONS)
def test_covered_area(name: str, margins: str) -> None:
    region, planes = REGIONS[name]
    frame, plate = MARGINS[margins]
    item = specimen(region, (frame, plate))
    assert item.mirror_planes == frozenset(planes)
    exact = chord_area(region, 45e-3 - frame, 10e-3 + plate)
    assert covered_area(item, Settings()) == pytest.approx(exact, rel=2e-6)
    made = build_model(item, Settings())
    assert folded(made.discretisation.mesh) == 0
    whole = float(made.discretisation.basis.dx.sum()) * made.discretisation.mirrored
    assert whole == pytest.approx(np.pi * (45e-3**2 - 10e-3**2), rel=2e-6)


def test_chord_area_against_closed_forms() -> None:
    assert chord_area(Region(Circle(20e-3)), 45e-3, 10e-3) == pytest.approx(np.pi * 3e-4, rel=1e-8)
    r, d = 20e-3, 40e-3  # a circle of radius r whose centre is d from that of the frame, R
    R = 45e-3
    lens = (r**2 * np.arccos((d**2 + r**2 - R**2) / (2 * d * r)) + R**2
            * np.arccos((d**2 + R**2 - r**2) / (2 * d * R))
            - np.sqrt((-d + r + R) * (d + r - R) * (d - r + R) * (d + r + R)) / 2)
    assert chord_area(Region(Circle(r), (d, 0.0)), R, 10e-3) == pytest.approx(lens, rel=1e-8)


@pytest.mark.parametrize(("order", "rate"), [(1, 1.7), (2, 3.0), (3, 3.5)])
def test_area_converges_with_the_order_of_the_mesh(order: int, rate: float) -> None:
    region = Region(Ellipse((32e-3, 21e-3)), (30e-3, 5e-3))
    exact = chord_area(region, 45e-3, 10e-3)
    errors = [abs(covered_area(specimen(region), Settings(MeshSettings(order).refined(refine)))
                  / exact - 1)
              for refine in (2.0, 8.0)]
    assert errors[1] < errors[0] / 4**rate


@pytest.mark.parametrize("refine", [0.5, 1.0, 2.0])
def test_default_order_is_exact_to_eight_digits(refine: float) -> None:
    region = Region(Ellipse((32e-3, 21e-3)), (30e-3, 5e-3))
    area = covered_area(specimen(region), Settings(MeshSettings().refined(refine)))
    assert area == pytest.approx(chord_area(region, 45e-3, 10e-3), rel=1e-8)


@pytest.mark.parametrize("name", REGIONS)
def test_mesh_changes_from_covered_to_bare_at_the_outline_only(name: str) -> None:
    region = REGIONS[name][0]
    mesh = build_model(specimen(region), Settings()).discretisation.mesh
    basis = skfem.CellBasis(mesh, mesh.elem(), intorder=4)
    x, y = np.asarray(basis.global_coordinates())
    inside = region.level(x, y) < 0
    covered = np.zeros(mesh.nelements, dtype=bool)
    covered[mesh.subdomains["covered"]] = True
    assert np.array_equal(inside, np.broadcast_to(covered[:, None], inside.shape))


@pytest.mark.parametrize("name", REGIONS)
def test_symmetry_changes_nothing(name: str) -> None:
    item = specimen(REGIONS[name][0])
    part, whole = (made.capacitance(made.mounted()) for made in (
        build_model(item, Settings(symmetry=symmetry)) for symmetry in (True, False)))
    assert part == pytest.approx(whole, rel=1e-12)


def test_capacitance_of_the_flat_film() -> None:
    item = specimen(REGIONS["beyond the frame and across the plate"][0])
    made = model(item)
    exact = epsilon_0 * 4.7 * chord_area(item.electrode.outline, 45e-3, 10e-3) / (1e-3 / ROOT5**2)
    assert made.capacitance(made.mounted()) == pytest.approx(exact, rel=2e-6)


def test_a_patch_beside_the_plate_pulls_it_sideways_and_tilts_it() -> None:
    """The film under the patch expands, so the plate moves away from it; at rest nothing is skewed.
    """
    load = 17.9e-3 * 9.80665
    made = model(specimen(Region(Circle(8e-3), (25e-3, 0.0))))
    plate = equilibrium(made, load, 3000.0).state.plate
    rest = equilibrium(made, load, 0.0).state.plate
    assert rest.translation[0] == pytest.approx(0, abs=1e-9)
    assert plate.translation[0] < -5e-5
    assert abs(plate.tilt) > abs(rest.tilt) + 1e-4


def test_elliptical_plate_off_centre_balances_its_load() -> None:
    """Force and moment of the tractions on both edges, integrated from the stress: independent of
    the nodal forces."""
    load = 17.9e-3 * 9.80665
    made = model(replace(circular(), plate=Plate(Ellipse((14e-3, 7e-3)), (8e-3, -4e-3))), refine=2)
    state = equilibrium(made, load, 3000.0).state
    hub = made.centre + np.array([0, 0, state.plate.deflection])
    for edge in ("plate", "frame"):
        fields, weights = edge_fields(made, state, edge, 12, quadrature=True)
        force = fields.plate_traction * weights[:, None]
        arm = fields.position + fields.displacement - hub
        assert force.sum(axis=0) == pytest.approx([0, 0, load], abs=1e-4 * load)
        assert np.abs(np.cross(arm, force).sum(axis=0)).max() < 1e-4 * load * 10e-3


@pytest.mark.parametrize(("region", "words"), [
    (Region(Circle(5e-3), (2e-3, 0.0)), "cover some of the film"),
    (Region(Circle(5e-3), (60e-3, 0.0)), "cover some of the film"),
    (Region(Circle(10e-3)), "cover some of the film"),
    (Region(Circle(10.1e-3)), "no slivers"),
    (Region(Circle(44.9e-3)), "no slivers"),
    (Region(Circle(10e-3), (54.9e-3, 0.0)), "no slivers"),
    (Region(Circle(20e-3), (25e-3, 0.0)), "too little room"),
])
def test_what_cannot_be_meshed_is_refused(region: Region, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        build_model(specimen(region), Settings())
    assert "electrode" in str(caught.value.key)
    assert (caught.value.key != "electrode.outline"
            or f"{region.offset[0] * 1e3:g}, 0 mm" in str(caught.value))


@pytest.mark.parametrize("radius", [10.5e-3, 11e-3, 44e-3, 44.5e-3])
def test_narrow_bands_are_meshed_without_folds(radius: float) -> None:
    made = build_model(specimen(Region(Circle(radius))), Settings())
    assert folded(made.discretisation.mesh) == 0
    quarter = float((made.discretisation.basis.dx * made.discretisation.covered).sum())
    assert quarter * 4 == pytest.approx(np.pi * (radius**2 - 1e-4), rel=1e-6)


def test_export_writes_the_electrode_for_a_mask(tmp_path: Path) -> None:
    region = REGIONS["beyond the frame"][0]
    files = list(export(specimen(region), MeshSettings(), tmp_path))
    assert {file.name for file in files if "electrode" in file.name} == {"circle-electrode.step",
                                                                         "circle-electrode.dxf",
                                                                         "circle-electrode.svg"}
    mask = cq.importers.importStep(str(tmp_path / "circle-electrode.step"))
    area = sum(face.Area() for face in mask.faces().vals())
    assert area == pytest.approx(chord_area(region, 45e-3, 10e-3) * 1e6, rel=1e-6)
    drawn = cq.importers.importDXF(str(tmp_path / "circle-electrode.dxf"))
    assert sum(face.Area() for face in drawn.faces().vals()) == pytest.approx(area, rel=1e-5)


def test_outline_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "patch.toml"
    file.write_text(PATCH_TOML)
    assert load_specimen(file).electrode == Electrode(0.0, 1e-3, 0.0,
                                                      Region(Ellipse((30e-3, 20e-3)), (10e-3, 0.0)))


@pytest.mark.parametrize(("old", "new", "key", "words"), [
    ('"3 cm", ', "", "electrode.outline.semi_axes", "list of 2"),
    ('"ellipse"\nsemi', '"heart"\nsemi', "electrode.outline.shape", "circle, drawn"),
    ("offset", "ofset", "electrode.outline.ofset", "did you mean 'offset'"),
    ('["1 cm", "0 mm"]', '["1 kg", "0 mm"]', "electrode.outline.offset", "wrong dimension"),
    ('["1 cm", "0 mm"]', '["1 m", "0 mm"]', "electrode.outline", "cover some of the film"),
    ("[electrode.outline]", "[electrode.outlin]", "electrode.outlin", "did you mean 'outline'"),
])
def test_bad_outlines_are_named(tmp_path: Path, old: str, new: str, key: str, words: str) -> None:
    file = tmp_path / "patch.toml"
    assert old in PATCH_TOML
    file.write_text(PATCH_TOML.replace(old, new))
    with pytest.raises(InputError, match=words) as caught:
        load_specimen(file)
    assert (caught.value.file, caught.value.key) == (file, key)


@pytest.mark.parametrize(("region", "even"), [
    (Region(Circle(20e-3)), True), (Region(Circle(20e-3), (5e-3, 0.0)), False),
    (Region(Ellipse((30e-3, 20e-3))), False)])
def test_only_a_round_electrode_about_the_centre_leaves_a_film_axisymmetric(region: Region,
                                                                            even: bool) -> None:
    assert specimen(region).axisymmetric is even
