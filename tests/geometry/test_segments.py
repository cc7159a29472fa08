"""Segments of an electrode: their regions, mirrors, meshes, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.specimens import circular, elliptical, quarters
from tympan.base.errors import InputError
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.geometry.mesh import SEGMENT, from_flat, segmented, unfold
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Region, Segment, Specimen

QUARTER = pi / 2


def areas(specimen: Specimen) -> dict[str, float]:
    """Areas of the parts of a film's mesh [m²]."""
    mesh = Discretisation.of(segmented(from_flat(mesh_film(specimen, MeshSettings(), frozenset())),
                                       specimen))
    size = mesh.weights.sum(axis=1)
    return {name: float(size[cells].sum()) for name, cells in mesh.mesh.subdomains.items()}


@given(start=st.floats(-10, 10), width=st.floats(0.02, 6.26), radius=st.floats(0.011, 0.044),
       angle=st.floats(0, 6.28))
def test_a_place_is_in_a_sector_if_its_direction_is(start: float, width: float, radius: float,
                                                    angle: float) -> None:
    sector = Segment(name="A", sector=(start, start + width))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    inside = (angle - start) % (2 * pi) < width
    to_edge = min(abs((angle - edge + pi) % (2 * pi) - pi) for edge in (start, start + width))
    if to_edge > 1e-6:
        assert (sector.level(np.array([x]), np.array([y]), Circle(0.045))[0] < 0) == inside


@given(width=st.floats(0.05, 6.2), gap=st.floats(1e-4, 3e-3), side=st.sampled_from([0, 1]))
def test_a_sector_ends_half_a_gap_before_its_edge(width: float, gap: float, side: int) -> None:
    """Places at half a gap from the edge, far from the centre, are on the border."""
    sector = Segment(name="A", sector=(0.3, 0.3 + width))
    angle, inwards = ((0.3, 1), (0.3 + width, -1))[side]
    away = inwards * (gap / 2 + np.array([-1e-5, 1e-5]))
    x, y = (4e-2 * np.array([[np.cos(angle)], [np.sin(angle)]])
            + away * np.array([[-np.sin(angle)], [np.cos(angle)]]))
    clear = 4e-2 * np.sin(min(width, 2 * pi - width) / 2) > 4 * gap
    if clear:
        assert (sector.level(x, y, Circle(0.045), gap) < 0).tolist() == [False, True]


def test_meshes_have_the_areas_of_segments_and_gaps() -> None:
    """A sector with a gap g loses strips of width g/2 along both edges, from plate to frame."""
    film = np.pi * (45e-3**2 - 10e-3**2)
    for gap in (0.0, 1e-3):
        found = areas(quarters(gap))
        strips = 4 * gap * (45e-3 - 10e-3)
        assert found.get("bare", 0.0) == pytest.approx(strips, rel=2e-3, abs=1e-9)
        each = [found[f"{SEGMENT}{number}"] for number in range(4)]
        assert each == pytest.approx([(film - strips) / 4] * 4, rel=1e-4)
        assert sum(each) == pytest.approx(found["covered"], rel=1e-12)


def test_bands_and_outlines_are_segments_too() -> None:
    band = Segment(name="rim", band=(0.0, 10e-3))
    spot = Segment(name="spot", outline=Region(Ellipse((8e-3, 6e-3)), (20e-3, 0.0)))
    found = areas(replace(circular(), electrode=Electrode(segments=(band, spot), gap=1e-3)))
    assert found[f"{SEGMENT}0"] == pytest.approx(np.pi * (45e-3**2 - 35.5e-3**2), rel=1e-5)
    assert found[f"{SEGMENT}1"] == pytest.approx(np.pi * 8e-3 * 6e-3, rel=1e-5)


def test_margins_and_outline_of_the_electrode_hold_for_its_segments() -> None:
    whole = quarters()
    bounded = replace(whole, electrode=replace(whole.electrode, margin_frame=5e-3))
    assert areas(bounded)["covered"] == pytest.approx(np.pi * (40e-3**2 - 10e-3**2), rel=1e-5)


def test_mirror_planes_are_those_of_the_voltages() -> None:
    assert quarters().mirror_planes == {"x", "y"}
    assert quarters(shares=(1, 0, 0, 1)).mirror_planes == {"y"}
    assert quarters(shares=(1, 1, 0, 0)).mirror_planes == {"x"}
    assert quarters(shares=(1, 0, 1, 0)).mirror_planes == frozenset()
    assert quarters(start=0.2).mirror_planes == frozenset()
    assert quarters(start=QUARTER / 2, shares=(1, 0, 0, 0)).mirror_planes == {"x"}
    assert not quarters().axisymmetric
    rings = Electrode(segments=(Segment(name="A", band=(0.0, 0.01)),
                                Segment(name="B", band=(0.01, float("inf")), share=0.0)))
    assert replace(circular(), electrode=rings).axisymmetric
    aside = Electrode(segments=(Segment(name="A", outline=Region(Circle(5e-3), (25e-3, 0.0))),))
    assert replace(circular(), electrode=aside).mirror_planes == {"y"}


def test_a_mirrored_part_has_the_segments_of_its_places() -> None:
    part = from_flat(mesh_film(quarters(), MeshSettings(), frozenset("xy")))
    assert set(segmented(part, quarters()).subdomains) == {"covered", f"{SEGMENT}0"}
    whole = segmented(unfold(part, frozenset("xy"))[0], quarters())
    assert [len(whole.subdomains[f"{SEGMENT}{number}"]) for number in range(4)] == (
        4 * [len(part.t.T)])


@pytest.mark.parametrize(("segments", "gap", "said"), [
    ([Segment(name="A", sector=(0, 2)), Segment(name="B", sector=(1.9, 3))], 0.0,
     "must not overlap A: both cover x"),
    ([Segment(name="A", sector=(0, 2)), Segment(name="A", sector=(2, 3))], 0.0,
     "must have different names"),
    ([Segment(name="A", outline=Region(Circle(5e-3), (0.1, 0.0)))], 0.0,
     "must cover some of the film"),
    ([], 1e-3, "the electrode has no segments")])
def test_what_cannot_be_is_refused(segments: list[Segment], gap: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        replace(elliptical(60e-3), electrode=Electrode(segments=tuple(segments), gap=gap))


@pytest.mark.parametrize(("region", "said"), [
    ({}, "needs a region"), ({"sector": (0.0, 0.001)}, "from 1 to 359 degrees"),
    ({"band": (0.02, 0.01)}, "the smaller first")])
def test_a_segment_without_region_is_refused(region: dict[str, tuple[float, float]], said: str
                                             ) -> None:
    with pytest.raises(InputError, match=said):
        Segment(name="A", **region)


@pytest.mark.parametrize("name", ["none", "from", "count", "1A"])
def test_words_of_voltages_and_leads_are_no_names(name: str) -> None:
    with pytest.raises(InputError, match="must be a word"):
        Segment(name=name, sector=(0.0, 1.0))


def test_voltages_become_shares() -> None:
    electrode, top = quarters().electrode.driven({"A": 3e3, "C": 1.5e3})
    assert top == 3e3
    assert [segment.share for segment in electrode.segments] == [1.0, 0.0, 0.5, 0.0]
    assert electrode.share(np.array([2, 0, 1])).tolist() == [0.5, 1.0, 0.0]
    with pytest.raises(InputError, match="A, B, C, D"):
        electrode.driven({"E": 1.0})
    with pytest.raises(InputError, match="no segments"):
        Electrode().driven({"A": 1.0})
    with pytest.raises(InputError, match="does not feel the sign"):
        electrode.driven({"A": -1.0})
