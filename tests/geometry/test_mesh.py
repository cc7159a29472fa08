"""Meshes: exact areas, tags by place, mirror images, and gmsh left as it was found."""

from __future__ import annotations

import os
import pickle
import resource
import subprocess
import sys
from dataclasses import replace

import cadquery as cq
import gmsh
import numpy as np
import pytest
import skfem
from scipy.spatial import cKDTree

from tests.support.specimens import circular, elliptical, skewed
from tympan.base.errors import InputError
from tympan.fem.discretisation.isoparametric import folded
from tympan.fem.results.fields import cell_fields
from tympan.geometry import mesher
from tympan.geometry.cad.wires import pieces_wire, planar
from tympan.geometry.mesh import ELEMENTS, facets_of, from_bytes, from_flat, to_bytes, unfold
from tympan.geometry.mesher import MeshSettings, _widths, mesh_film
from tympan.geometry.outlines import Circle, Ellipse, Outline, Superellipse, examples
from tympan.geometry.sectors import sectors
from tympan.geometry.specimen import Electrode, Plate, Region, Specimen
from tympan.studies.case import Settings, build_model

SPECIMENS = {
    "circle": circular(),
    "large ellipse": elliptical(75e-3),
    "upright ellipse": replace(elliptical(30e-3)),
    "off centre": replace(elliptical(60e-3), plate=Plate(Circle(10e-3), (12e-3, 0.0))),
    "skewed": skewed(),
}

#: Frames and plates of two mirror planes, with lines, arcs, arcs of ellipses and splines.
QUARTERED = {name: frame for name, frame in examples().items() if frame.mirror_planes == {"x", "y"}}
QUARTERED_PLATES = {"round": Circle(10e-3), "upright": Ellipse((8e-3, 12e-3)),
                    "long": Ellipse((12e-3, 8e-3)),
                    "superellipse": Superellipse((12e-3, 9e-3), 3.5), "none": None}


def area(mesh: skfem.Mesh, cells: object = None) -> float:
    basis = skfem.CellBasis(mesh, mesh.elem(), elements=cells, intorder=8)
    return float(basis.dx.sum())


@pytest.mark.parametrize("order", sorted(ELEMENTS))
@pytest.mark.parametrize("name", SPECIMENS)
def test_area_and_boundaries(name: str, order: int) -> None:
    specimen = SPECIMENS[name]
    planes = specimen.mirror_planes
    part = from_flat(mesh_film(specimen, MeshSettings(order), planes))
    mesh = unfold(part, planes)[0]
    exact = np.pi * (np.prod(specimen.frame.semi_axes) - 0.01**2)
    tolerance = {1: 8e-2, 2: 1e-3, 3: 2e-4, 4: 2e-6}[order]
    assert area(mesh) == pytest.approx(exact, rel=tolerance)
    # One orientation inside every element: none folds over.
    determinants = skfem.CellBasis(mesh, mesh.elem(), intorder=8).mapping.detDF(
        skfem.CellBasis(mesh, mesh.elem(), intorder=8).X)
    assert np.all(np.sign(determinants) == np.sign(determinants[:, :1]))
    basis = skfem.CellBasis(mesh, mesh.elem(), intorder=2)
    for boundary, level in (("frame", specimen.frame.level), ("plate", specimen.plate.level)):
        x, y = basis.doflocs[:, basis.get_dofs(mesh.boundaries[boundary]).flatten()]
        assert len(x) > 8
        assert np.abs(level(x, y)).max() < 1e-8
    outside = np.concatenate([mesh.boundaries["frame"], mesh.boundaries["plate"]])
    assert np.array_equal(np.sort(outside), np.sort(mesh.boundary_facets()))
    for axis, coordinate in (("axis_x", 1), ("axis_y", 0)):
        nodes = basis.doflocs[:, basis.get_dofs(mesh.boundaries[axis]).flatten()]
        assert np.abs(nodes[coordinate] - specimen.plate.offset[coordinate]).max() < 1e-9


def test_a_quarter_has_the_same_area_with_a_bare_band() -> None:
    for frame in (Ellipse((30e-3, 50e-3)), Superellipse((60e-3, 45e-3), 3.0)):
        whole = replace(circular(), frame=frame)
        built, cut = (from_flat(mesh_film(specimen, MeshSettings(), frozenset("xy")))
                      for specimen in (whole, replace(whole, electrode=Electrode(3e-3))))
        assert area(built) == pytest.approx(area(cut), rel=1e-6)
        assert area(built) == pytest.approx((frame.curve.area - np.pi * 10e-3**2) / 4, rel=1e-5)


@pytest.mark.parametrize("plate", QUARTERED_PLATES.values(), ids=QUARTERED_PLATES)
@pytest.mark.parametrize("frame", QUARTERED.values(), ids=QUARTERED)
def test_a_quarter_built_in_gmsh_is_the_one_of_cadquerys_kernel(
        frame: Outline, plate: Outline | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Area, extents, and every point of the mesh, of the same pieces by the other way."""
    film = replace(circular(), frame=frame, plate=None if plate is None else Plate(plate))
    loops = sectors(film, frozenset("xy"))
    assert loops is not None
    face = cq.Face(planar(pieces_wire(loops["covered"][0])))
    mesh = mesh_film(film, MeshSettings(), frozenset("xy"))
    assert area(from_flat(mesh)) * 1e6 == pytest.approx(face.Area(), rel=2e-6)
    box = face.BoundingBox()
    extents = [*mesh.points.min(0), *mesh.points.max(0)]
    assert np.allclose(extents, np.array([box.xmin, box.ymin, box.xmax, box.ymax]) / 1e3,
                       atol=1e-9)
    if plate is None:  # elements of one size have ties, which the last digit decides
        return
    monkeypatch.setattr(mesher, "_built", lambda gmsh, *_: mesher._imported(
        gmsh, {"covered": [face.wrapped], "bare": []}, []))
    other = mesh_film(film, MeshSettings(), frozenset("xy"))
    assert len(other.points) == len(mesh.points)
    assert cKDTree(other.points).query(mesh.points)[0].max() < 1e-12


def test_electrode_margins_have_their_areas() -> None:
    specimen = replace(circular(), electrode=Electrode(margin_frame=3e-3, margin_plate=2e-3))
    mesh = from_flat(mesh_film(specimen, MeshSettings(), frozenset("xy")))
    assert 4 * area(mesh,
                    mesh.subdomains["covered"]) == pytest.approx(np.pi * (42e-3**2 - 12e-3**2),
                                                                 rel=1e-6)
    assert 4 * area(mesh, mesh.subdomains["bare"]) == pytest.approx(
        np.pi * (45e-3**2 - 42e-3**2 + 12e-3**2 - 10e-3**2), rel=1e-6)


def test_a_margin_that_the_electrode_does_not_reach_costs_no_elements() -> None:
    disc = Region(Circle(30e-3))
    far, none = (replace(circular(), electrode=Electrode(margin, outline=disc))
                 for margin in (1e-3, 0.0))
    meshes = [from_flat(mesh_film(specimen, MeshSettings(), frozenset("xy")))
              for specimen in (far, none)]
    assert meshes[0].nelements == meshes[1].nelements
    assert area(meshes[0], meshes[0].subdomains["covered"]) == pytest.approx(
        np.pi / 4 * (30e-3**2 - 10e-3**2), rel=1e-6)


def test_an_electrode_cut_by_its_margin_has_its_area() -> None:
    """A disc off centre, of which a margin of the frame cuts a lens."""
    radius, away, rim = 30e-3, 15e-3, 42e-3
    specimen = replace(circular(), electrode=Electrode(
        45e-3 - rim, outline=Region(Circle(radius), (away, 0.0))))
    mesh = from_flat(mesh_film(specimen, MeshSettings(), frozenset("y")))
    angles = [np.arccos((away**2 + a**2 - b**2) / (2 * away * a))
              for a, b in ((radius, rim), (rim, radius))]
    lens = sum(r**2 * (angle - np.sin(2 * angle) / 2)
               for r, angle in zip((radius, rim), angles, strict=True))
    assert 2 * area(mesh, mesh.subdomains["covered"]) == pytest.approx(
        lens - np.pi * 10e-3**2, rel=1e-6)
    assert 2 * area(mesh) == pytest.approx(np.pi * (45e-3**2 - 10e-3**2), rel=1e-6)


@pytest.mark.parametrize(("frame", "plate"),
                         [(17, 17), (16, 16), (25, 8), (34, 0), (0, 34), (3, 2), (0.5, 0.5)])
def test_no_band_folds_its_elements(frame: float, plate: float) -> None:
    """A flat film is stretched alike everywhere, however narrow the bands: folded elements would
    show."""
    specimen = replace(circular(), electrode=Electrode(frame * 1e-3, plate * 1e-3))
    model = build_model(specimen, Settings())
    assert folded(model.discretisation.mesh) == 0
    stretch = cell_fields(model, [model.mounted()], ELEMENTS[4].doflocs.T)[0].stretch_1
    assert np.allclose(stretch, 5**0.5, rtol=1e-12)


@pytest.mark.parametrize(("electrode", "radius", "words"), [
    (Electrode(margin_frame=1e-6), 10e-3, "at least 1 %"), (Electrode(34.9e-3), 10e-3, "98 %"),
    (Electrode(), 44.99e-3, "gap")])
def test_slivers_are_refused(electrode: Electrode, radius: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(circular(), plate=Plate(Circle(radius)), electrode=electrode)


def test_folding_is_seen() -> None:
    mesh = from_flat(mesh_film(circular(), MeshSettings(), frozenset("xy")))
    assert folded(mesh) == 0
    inner = np.flatnonzero(np.hypot(*mesh.doflocs) < 12e-3)[0]
    places = mesh.doflocs.copy()
    places[:, inner] *= 2.0
    assert folded(replace(mesh, doflocs=places)) > 0


def test_mirrored_mesh_is_symmetric_and_knows_its_origin() -> None:
    part = from_flat(mesh_film(elliptical(60e-3), MeshSettings(), frozenset("xy")))
    whole, origin, signs = unfold(part, frozenset("xy"))
    assert whole.nelements == 4 * part.nelements
    assert np.allclose(whole.doflocs, signs * part.doflocs[:, origin], atol=1e-15)
    assert area(whole) == pytest.approx(4 * area(part), rel=1e-13)


def test_half_meshes_for_plates_off_centre_along_one_axis() -> None:
    specimen = SPECIMENS["off centre"]
    assert specimen.mirror_planes == {"y"}
    part = from_flat(mesh_film(specimen, MeshSettings(), specimen.mirror_planes))
    assert part.doflocs[1].min() > -1e-12


def test_facets_are_found_by_their_ends() -> None:
    mesh = from_flat(mesh_film(circular(), MeshSettings(), frozenset("xy")))
    numbers = np.array([5, 0, 17])
    assert np.array_equal(facets_of(mesh, mesh.facets[::-1, numbers].T), numbers)


def test_gmsh_is_finalised_and_its_options_do_not_leak() -> None:
    first = mesh_film(circular(), MeshSettings(), frozenset("xy"))
    assert not gmsh.isInitialized()
    mesh_film(circular(), MeshSettings(order=2, around_plate=40), frozenset())
    again = mesh_film(circular(), MeshSettings(), frozenset("xy"))
    assert np.array_equal(first.points, again.points)


def test_elements_shrink_towards_the_plate() -> None:
    mesh = from_flat(mesh_film(elliptical(75e-3), MeshSettings(), frozenset("xy")))
    centres = mesh.p[:, mesh.t].mean(axis=1)
    size = np.sqrt(skfem.CellBasis(mesh, mesh.elem(), intorder=4).dx.sum(axis=1))
    near = np.hypot(*centres) < 0.016
    assert size[near].mean() < 0.5 * size[~near].mean()


def test_meshing_leaves_a_broken_pipe_an_error() -> None:
    """gmsh makes it lethal; a server that meshes, in any thread, must outlive a client that hangs
    up."""
    script = """
import os, pickle, sys, threading
from tympan.geometry.mesher import MeshSettings, _widths, mesh_film

specimen = pickle.load(sys.stdin.buffer)
def mesh():
    mesh_film(specimen, MeshSettings(order=1), frozenset("xy"))

def broken():
    reader, writer = os.pipe()
    os.close(reader)
    try:
        os.write(writer, b"x")
    except BrokenPipeError:
        print("alive", flush=True)

thread = threading.Thread(target=mesh)
thread.start()
thread.join()
broken()
mesh()
broken()
"""
    done = subprocess.run([sys.executable, "-c", script], input=pickle.dumps(circular()),
                          capture_output=True,
                          check=False,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    assert (done.returncode, done.stdout) == (0, b"alive\n" * 2), done.stderr.decode()


def test_no_room_for_temporary_files_is_said_where_one_is_needed() -> None:
    """Only for what cadquery cuts."""
    cut = replace(circular(), electrode=Electrode(outline=Region(Circle(30e-3))))
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, unlimited[1]))
    try:
        mesh_film(circular(), MeshSettings(2), frozenset())
        with pytest.raises(InputError, match="no room for temporary files"):
            mesh_film(cut, MeshSettings(2), frozenset())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)


@pytest.mark.parametrize("specimen", [circular(), skewed(), replace(
    elliptical(60e-3), electrode=Electrode(2e-3, 1e-3))], ids=["round", "skewed", "bands"])
def test_a_mesh_is_read_back_to_the_last_bit(specimen: Specimen) -> None:
    for order in (2, 4):
        mesh = from_flat(mesh_film(specimen, MeshSettings(order), specimen.mirror_planes))
        again = from_bytes(to_bytes(mesh))
        assert type(again) is type(mesh)
        assert again.order == order
        for name in ("doflocs", "t", "facets", "t2f"):
            assert np.array_equal(getattr(again, name), getattr(mesh, name))
        for tags, others in ((again.boundaries, mesh.boundaries),
                             (again.subdomains, mesh.subdomains)):
            assert tags.keys() == others.keys()
            assert all(np.array_equal(tags[name], others[name]) for name in others)
            assert all(tags[name].dtype == others[name].dtype for name in others)


def test_a_film_is_as_wide_as_its_normals_are_long() -> None:
    """Of an ellipse xᵀAx = 1 the normal n = Ax at x meets it again at x − 2 n (xᵀAn)/(nᵀAn)."""
    places, widths = _widths(Ellipse((60e-3, 20e-3)).points(720))
    axes = np.array([60e-3, 20e-3]) ** -2.0
    normals = places * axes
    exact = 2 * (places * axes * normals).sum(axis=1) / (axes * normals**2).sum(axis=1)
    assert len(places) == 90
    assert widths == pytest.approx(exact * np.hypot(*normals.T), rel=3e-3)


def test_a_tight_end_is_fine_without_the_whole_edge_being_so() -> None:
    """Twelve elements go around a circle of the end, of radius b²/a; flanks have larger ones."""
    frame = Ellipse((90e-3, 6e-3))
    film = replace(circular(), frame=frame, plate=Plate(Circle(2e-3)))
    part = from_flat(mesh_film(film, MeshSettings(), frozenset("xy")))
    corners = part.p[:, part.t]  # (2, 3, elements)
    sides = corners - np.roll(corners, 1, axis=1)
    sizes = np.hypot(*sides).max(axis=0)
    x = corners[0].mean(axis=0)
    tight = 2 * np.pi / 12 * 6e-3**2 / 90e-3
    assert sizes[x > 89.7e-3].max() < 2 * tight
    assert np.median(sizes[(x > 20e-3) & (x < 60e-3)]) > 10 * tight
    assert part.nelements < 400
