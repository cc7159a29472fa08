"""Films cut along axes into closed curves, against cadquery's kernel and closed forms."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import skfem

from tests.support.specimens import circular
from tympan.fem.discretisation.isoparametric import folded
from tympan.fem.equilibrium.solve import equilibrium
from tympan.geometry import mesher
from tympan.geometry.cad.membrane import membrane_faces
from tympan.geometry.mesh import from_flat, unfold
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.outlines import (
    Circle,
    Ellipse,
    Outline,
    Polygon,
    RoundedRectangle,
    examples,
)
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.sectors import sectors
from tympan.geometry.specimen import Electrode, Plate, Region, Specimen
from tympan.studies.case import Settings, build_model

EXAMPLES = examples()
ELECTRODES = {"whole": Electrode(), "bands": Electrode(3e-3, 2e-3), "frame's": Electrode(2e-3),
              "plate's": Electrode(margin_plate=4e-3)}
#: A frame with two arms: an axis through one of them comes to the other again.
ARMS = Polygon(((0, 0), (90e-3, 0), (90e-3, 80e-3), (60e-3, 80e-3), (60e-3, 30e-3),
                (30e-3, 30e-3), (30e-3, 80e-3), (0, 80e-3)), 3e-3)


def film(frame: Outline, offset: tuple[float, float], electrode: Electrode = ELECTRODES["whole"]
         ) -> Specimen:
    return replace(circular(), frame=frame, plate=Plate(Ellipse((9e-3, 6e-3)), offset),
                   electrode=electrode)


@pytest.mark.parametrize("electrode", ELECTRODES.values(), ids=ELECTRODES)
@pytest.mark.parametrize("frame", EXAMPLES.values(), ids=EXAMPLES)
def test_parts_are_those_that_the_kernel_cuts(frame: Outline, electrode: Electrode) -> None:
    """Every quadrant's area, covered and bare, of a plate off centre in both directions.

    All together against Steiner's formula, which the kernel's own areas miss by up to 1e-5; where
    it cuts a spline, some of a part goes to its neighbour.
    """
    specimen = film(frame, (3e-3, -2e-3), electrode)
    loops = sectors(specimen, frozenset())
    assert loops is not None
    outside, inside = frame.curve, specimen.plate.outline.curve
    within, beyond = electrode.margin_frame, electrode.margin_plate
    covered = (outside.area - within * outside.length + np.pi * within**2
               - inside.area - beyond * inside.length - np.pi * beyond**2)
    assert sum(Curve(loop).area for loop in loops["covered"]) == pytest.approx(covered, rel=1e-8)
    for name, faces in membrane_faces(specimen, frozenset()).items():
        built = [Curve(loop).area * 1e6 for loop in loops[name]]
        assert min(built, default=1.0) > 0
        assert sorted(built) == pytest.approx(sorted(face.Area() for face in faces), rel=1e-4)


@pytest.mark.parametrize("planes", [set(), {"x"}, {"y"}], ids=["whole", "right", "upper"])
@pytest.mark.parametrize("electrode", ELECTRODES.values(), ids=ELECTRODES)
def test_meshes_of_parts_have_their_areas(electrode: Electrode, planes: set[str]) -> None:
    """By Steiner's formula, with no element folded and every boundary where it belongs."""
    offset = (0.0 if "x" in planes else 4e-3, 0.0 if "y" in planes else -3e-3)
    specimen = replace(film(Circle(45e-3), offset, electrode), plate=Plate(Circle(8e-3), offset))
    assert specimen.mirror_planes >= planes
    part = from_flat(mesh_film(specimen, MeshSettings(), frozenset(planes)))
    assert folded(part) == 0
    covered = np.pi * ((45e-3 - electrode.margin_frame)**2 - (8e-3 + electrode.margin_plate)**2)
    whole = np.pi * (45e-3**2 - 8e-3**2)
    for elements, exact in ((part.subdomains["covered"], covered), (None, whole)):
        assert _area(part, elements) * 2**len(planes) == pytest.approx(exact, rel=1e-6)
    mesh = unfold(part, frozenset(planes))[0]
    outside = np.concatenate([mesh.boundaries["frame"], mesh.boundaries["plate"]])
    assert np.array_equal(np.sort(outside), np.sort(mesh.boundary_facets()))


def test_what_crosses_an_axis_twice_or_is_cut_by_an_outline_is_left_to_the_kernel() -> None:
    region = film(Circle(45e-3), (3e-3, 2e-3), Electrode(outline=Region(Circle(30e-3))))
    assert sectors(region, frozenset()) is None
    below, within = (film(ARMS, offset) for offset in ((0.0, -25e-3), (-30e-3, 15e-3)))
    assert sectors(below, frozenset("x")) is not None
    assert sectors(within, frozenset()) is None
    for specimen in (below, within):
        mesh = from_flat(mesh_film(specimen, MeshSettings(), frozenset()))
        assert folded(mesh) == 0
        exact = specimen.frame.curve.area - np.pi * 9e-3 * 6e-3
        assert _area(mesh, None) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("beside", [0.0, 1e-16, 1e-14, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6,
                                    1e-5])
@pytest.mark.parametrize("sign", [-1, 1])
def test_an_axis_that_nearly_meets_two_pieces(beside: float, sign: int) -> None:
    """The frame's lines meet its arcs at 5 mm."""
    frame = RoundedRectangle((45e-3, 40e-3), 35e-3)
    specimen = film(frame, (5e-3 + beside * sign, 5e-3 - beside * sign))
    mesh = from_flat(mesh_film(specimen, MeshSettings(), frozenset()))
    assert folded(mesh) == 0
    assert mesh.nelements < 400
    assert _area(mesh, None) == pytest.approx(frame.curve.area - np.pi * 9e-3 * 6e-3, rel=1e-6)


@pytest.mark.parametrize("frame", EXAMPLES.values(), ids=EXAMPLES)
def test_part_of_a_piece_runs_along_it(frame: Outline) -> None:
    t = np.linspace(0, 1, 33)
    for piece in frame.curve.pieces:
        part = piece.part(0.13, 0.71)
        for ours, whole, scale in zip(part.at(t), piece.at(0.13 + 0.58 * t), (1, 0.58, 0.58**2),
                                      strict=True):
            assert np.allclose(ours, scale * whole, rtol=1e-9,
                               atol=1e-9 * np.abs(whole).max())


def test_kernels_of_both_ways_give_films_that_sink_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    specimen = film(EXAMPLES["superellipse"], (3e-3, -2e-3), ELECTRODES["bands"])
    settings = Settings(MeshSettings(around_plate=20))
    built = equilibrium(build_model(specimen, settings), 0.17, 3e3).state.plate.deflection
    monkeypatch.setattr(mesher, "sectors", lambda *_: None)
    monkeypatch.setenv("TYMPAN_CACHE", "")
    cut = equilibrium(build_model(specimen, settings), 0.17, 3e3).state.plate.deflection
    assert built == pytest.approx(cut, rel=1e-6)


def test_no_kernel_is_loaded_to_mesh_a_plate_off_centre_and_bands() -> None:
    script = """
import sys
sys.modules |= {"OCP": None, "cadquery": None}
from tympan.fem.film.laws import NeoHooke
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.outlines import Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
plate = Plate(Ellipse((9e-3, 6e-3)), (3e-3, 2e-3))
film = Film(1e-3, (2.0, 2.0), NeoHooke(20e3), 4.7)
specimen = Specimen("oval", Ellipse((60e-3, 45e-3)), plate, film, Electrode(3e-3, 2e-3))
assert mesh_film(specimen, MeshSettings(), frozenset()).points.size
"""
    subprocess.run([sys.executable, "-c", script], check=True,
                   env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))})


def _area(mesh: skfem.Mesh, elements: object) -> float:
    basis = skfem.CellBasis(mesh, mesh.elem(), elements=elements, intorder=8)
    return float(basis.dx.sum())
