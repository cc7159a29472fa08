"""Segments of an electrode in every answer: solve, limits, path, sense, pictures, exports."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from matplotlib.figure import Figure

import tympan
from tests.support.segmented import DRIVES, driven_quarters
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.fem.toml_writer import specimen_content
from tympan.geometry.cad.membrane import segment_parts
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.sectors import covered_share
from tympan.geometry.specimen import Specimen
from tympan.reports.look import segment_colours
from tympan.studies.case import Case, CaseResult, Limit, Settings
from tympan.studies.export.parts import export
from tympan.studies.limits import limits, solve_within
from tympan.studies.path import path
from tympan.studies.sense import SenseCase, sense

DRIVE = DRIVES[3]
SETTINGS = Settings(mesh=MeshSettings().refined(0.6))
SECTOR = 'name = "%s"\nsector = ["%s deg", "%s deg"]\n'


def case(voltages: dict[str, float] = DRIVE) -> Case:
    return Case(driven_quarters(voltages, gap=1e-3), mass=20e-3, voltage=max(voltages.values()))


@pytest.fixture(scope="module")
def result() -> CaseResult:
    return solve_within(case(), SETTINGS, film=True)


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    made = tmp_path_factory.mktemp("film") / "quarters.toml"
    made.write_text(_text())
    return made


def _text() -> str:
    segments = "".join("[[electrode.segment]]\n" + SECTOR % (name, 90 * number, 90 * (number + 1))
                       for number, name in enumerate("ABCD"))
    return ('name = "quarters"\n[frame]\nshape = "circle"\nradius = "4.5 cm"\n[plate]\n'
            'shape = "circle"\nradius = "1 cm"\n[membrane]\nthickness = "1 mm"\n'
            'prestretch = 2.236\nrelative_permittivity = 4.7\n'
            'material = { law = "neo_hooke", mu = "25 kPa" }\n'
            '[electrode]\ngap = "1 mm"\n' + segments)


def test_a_solved_case_lists_its_segments(result: CaseResult) -> None:
    assert [(each.name, each.voltage_V) for each in result.segments] == [*DRIVE.items()]
    shares = np.array([each.share for each in result.segments])
    alone = np.array([each.capacitance_F for each in result.segments])
    assert alone @ shares**2 == pytest.approx(result.capacitance_F, rel=1e-12)
    assert max(each.max_field_V_per_m for each in result.segments) == result.max_field_V_per_m
    assert np.shape(result.charge_by_voltage_F) == (4, 4)
    assert (np.diag(result.charge_by_voltage_F) > alone * (1 - 1e-9)).all()
    again = tympan.Result(result).to_pandas()
    assert again["capacitance_B_F"][0] == alone[1]
    assert again["charge_A_by_voltage_B_F"][0] == result.charge_by_voltage_F[0][1]
    json.dumps(result.json(), allow_nan=False)


def test_an_electrode_in_one_piece_has_none_of_it() -> None:
    whole = replace(case().specimen, electrode=Electrode())
    found = solve_within(Case(whole, mass=20e-3, voltage=3e3), SETTINGS)
    assert found.segments == found.charge_by_voltage_F == ()
    assert found.limits is not None
    for limit in found.limits.told:
        assert (limit.segment, limit.segment_voltages_V, limit.drive) == (None, {}, "")
        assert "segment" not in limit.place


def test_every_limit_names_its_segment_and_the_voltages_of_all(result: CaseResult) -> None:
    assert result.limits is not None
    told = result.limits.told
    assert told
    for limit in told:
        near = case().specimen.segment_near(limit.x_m, limit.y_m)
        assert limit.segment is not None
        assert near is not None
        assert limit.segment in near
        assert limit.place.startswith("x ")
        assert f", segment {limit.segment}" in limit.place
        proportion = limit.voltage_V / 3e3
        assert limit.segment_voltages_V == pytest.approx(
            {name: proportion * voltage for name, voltage in DRIVE.items()})
        assert limit.drive.startswith(f"A {limit.voltage_V / 1e3:.4g} kV, B ")


def test_the_limit_of_the_other_segment_names_the_other() -> None:
    for name in "BD":
        found = limits(case({name: 3e3}), SETTINGS).limit
        assert found is not None
        assert found.segment == name


def test_a_place_names_what_is_nearest() -> None:
    film = driven_quarters(gap=1e-3)
    places = {(0.02, 0.02): "A", (-0.02, 0.02): "B", (0.02, 0.0): "A, D", (0.02, 4e-4): "A",
              (0.0, -0.02): "C, D"}
    assert {place: film.segment_near(*place) for place in places} == places
    assert replace(film, electrode=Electrode()).segment_near(0.02, 0.02) is None
    touching = driven_quarters()
    assert touching.segment_near(0.02, 0.0) == "A, D"
    assert touching.segment_near(0.02, 1e-5) == "A"
    limit = Limit(kind="tension", voltage_V=6.2e3, x_m=17.1e-3, y_m=0.0).of(touching)
    assert limit.place == "x 17.1 mm, y 0.0 mm, segments A and D"
    assert limit.drive == ""


def test_a_path_has_columns_of_each_segment_and_its_events_name_one() -> None:
    found = path(case(DRIVES[1]), SETTINGS, "voltage")
    assert {event.segment for event in found.events} == {"A"}
    rows = found.rows
    shares = np.array([1, 1, 1 / 3, 1 / 3])
    alone = np.array([rows[f"capacitance_{name}_F"] for name in DRIVE])
    assert shares**2 @ alone == pytest.approx(rows["capacitance_F"], rel=1e-12)
    assert rows["voltage_B_V"] == pytest.approx(rows["voltage_V"])
    assert rows["voltage_C_V"] == pytest.approx(rows["voltage_V"] / 3)


def test_a_sensed_film_has_the_capacitance_of_each_segment() -> None:
    film = case().specimen
    found = sense(SenseCase(film, voltages=(0.0, 3e3), to=4e-3, points=5), SETTINGS)
    shares = np.array([segment.share for segment in film.electrode.segments])
    rows = found.rows
    alone = np.array([rows[f"capacitance_{name}_F"] for name in DRIVE])
    assert shares**2 @ alone == pytest.approx(rows["capacitance_F"], rel=1e-12)


def test_solve_prints_a_line_for_each_segment(file: Path, capsys) -> None:
    assert main(["solve", str(file), "--mass", "20 g", "--voltage", "A = 3 kV, B = 1 kV",
                 "--refine", "0.6"]) == 0
    text = capsys.readouterr().out
    for words in ("segment A  3 kV  ", "segment B  1 kV  ", "segment C  0 kV  ",
                  "a row a segment, columns A, B, C, D", ", segment A", "                with A "):
        assert words in text, text


@pytest.mark.parametrize(("segments", "words", "key"), [
    (SECTOR % ("A", 0, 100) + "[[electrode.segment]]\n" + SECTOR % ("B", 90, 180),
     "must not overlap A", "electrode.segment.1"),
    ('name = "A"\n', "segment A needs a region", "electrode.segment.0.sector"),
    ('name = "A"\nband = ["2 cm", "1 cm"]\n', "the smaller first", "electrode.segment.0.band"),
    ('name = "A"\noutline = { shape = "circle", radius = "5 mm" }\n', "must cover some of the film",
     "electrode.segment.0"),
    ('name = "A"\noutline = { shape = "circle", radius = "5 mm", offset = ["8 cm", "0 cm"] }\n',
     "must cover some of the film", "electrode.segment.0"),
    ('name = "A"\nband = ["0 mm", "5 mm"]\n[electrode]\ngap = "12 mm"\n',
     "make the gap smaller", "electrode.gap"),
    ('name = "left part"\nsector = ["0 deg", "90 deg"]\n', "must be a word",
     "electrode.segment.0.name"),
    (SECTOR % ("A", 0, 90) + "share = 2\n", "from 0", "electrode.segment.0.share"),
    (SECTOR % ("A", 0, 360), "from 1 to 359 degrees apart", "electrode.segment.0.sector"),
    ('name = "A"\nsector = [0, 90]\n', "must be an angle", "electrode.segment.0.sector"),
])
def test_a_wrong_segment_is_refused_in_one_sentence(segments: str, words: str, key: str,
                                                    tmp_path: Path) -> None:
    text = _text()
    head = text[:text.index("[electrode]")]
    wrong = tmp_path / "wrong.toml"
    gap = segments[segments.index("[electrode]"):] if "[electrode]" in segments else "[electrode]\n"
    parts = segments.removesuffix(gap)
    wrong.write_text(f"{head}{gap}[[electrode.segment]]\n{parts}")
    with pytest.raises(InputError, match=words) as refused:
        load_specimen(wrong)
    assert refused.value.key == key
    assert str(wrong) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_band_along_sharp_corners_says_how_to_round_them(tmp_path: Path) -> None:
    square = ('shape = "polygon"\nvertices = [["-4 cm", "-4 cm"], ["4 cm", "-4 cm"], '
              '["4 cm", "4 cm"], ["-4 cm", "4 cm"]]')
    text = _text().replace('shape = "circle"\nradius = "4.5 cm"', square)
    text = text.replace('sector = ["0 deg", "90 deg"]', 'band = ["0 mm", "1 cm"]')
    (tmp_path / "wrong.toml").write_text(text)
    with pytest.raises(InputError, match="without sharp corners: round them") as refused:
        load_specimen(tmp_path / "wrong.toml")
    assert refused.value.key == "electrode.segment.0.band"


def test_an_unknown_name_in_a_voltage_lists_the_names(file: Path, capsys) -> None:
    assert main(["solve", str(file), "--mass", "20 g", "--voltage", "E = 3 kV"]) == 2
    assert capsys.readouterr().err == (
        "tympan: --voltage: given 'E': must be the name of a segment: A, B, C, D\n")


def test_a_drawing_has_a_colour_and_a_line_of_the_legend_for_each(tmp_path: Path) -> None:
    axes = tympan.draw(driven_quarters(gap=1e-3), voltage="A = 3 kV, B = 2 kV")
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "A  3 kV", "B  2 kV", "C  0 kV", "D  0 kV"]
    assert {text.get_text() for text in axes.texts} > set("ABCD")
    picture = _pixels(axes.get_figure())
    for colour in segment_colours(4):
        rgb = [int(colour[at:at + 2], 16) for at in (1, 3, 5)]
        share = (np.abs(picture - rgb).max(axis=-1) < 3).mean()
        assert share > 0.02
    tympan.draw(driven_quarters(gap=1e-3), tmp_path / "film.png", voltage="3 kV")
    assert (tmp_path / "film.png").stat().st_size > 10_000


def _pixels(figure: object) -> np.ndarray:
    assert isinstance(figure, Figure)
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)  # type: ignore[attr-defined]


def test_a_film_has_lines_around_its_segments(result: CaseResult) -> None:
    film = result.film
    assert film is not None
    assert film.segments == 4
    for number in range(4):
        lines = film.flat.segment_edges(number)
        length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=-1).sum()
        # Two radial edges and two arcs, of a sector without half the gap on both sides.
        radii, half = np.array([10e-3, 45e-3]), 0.5e-3
        exact = (radii * (np.pi / 2 - 2 * np.arcsin(half / radii))).sum() + 2 * np.diff(
            np.sqrt(radii**2 - half**2))[0]
        assert length == pytest.approx(exact, rel=2e-3)
        x, y, _ = lines.mean(axis=(0, 1))
        assert (x > 0, y > 0) == ((True, True), (False, True), (False, False), (True, False))[
            number]
    outer, inner = film.flat.segment_edges(0), film.flat.segment_edges(0, 0.5e-3)
    moved = np.linalg.norm(inner - outer, axis=-1)
    assert moved == pytest.approx(np.full(moved.shape, 0.5e-3))
    x, y, _ = inner.reshape(-1, 3).T
    assert (film_segment(x, y) == 0).all()


def film_segment(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    film = driven_quarters(gap=1e-3)
    return film.electrode.segment_at(x, y, film.frame)


def test_results_with_segments_are_drawn(result: CaseResult, tmp_path: Path) -> None:
    axes = tympan.Result(result).plot(tmp_path / "film.png")
    legend = axes.get_legend()
    assert legend is not None
    assert legend.get_texts()[1].get_text() == "B  2 kV"
    tympan.Result(result).save(tmp_path / "saved")
    loaded = tympan.Result.load(tmp_path / "saved")
    assert loaded.segments == result.segments
    assert loaded.film.segments == 4
    assert loaded.charge_by_voltage_F == result.charge_by_voltage_F


def test_masks_of_segments_have_their_areas_and_layers(tmp_path: Path) -> None:
    ring = Segment(name="ring", band=(20e-3, 25e-3))
    film = driven_quarters(gap=1e-3, margin_frame=2e-3)
    quarter = [replace(segment, band=(0.0, 20e-3)) for segment in film.electrode.segments]
    film = replace(film, electrode=replace(film.electrode, segments=(*quarter, ring)))
    areas = {name: 1e-6 * part.Area() for name, part in segment_parts(film).items()}
    assert [*areas] == ["A", "B", "C", "D", "ring"]
    assert areas["ring"] == pytest.approx(np.pi * (24.5e-3**2 - 20.5e-3**2), rel=1e-6)
    assert areas["A"] == pytest.approx(_quarter(25.5e-3, 43e-3, 0.5e-3), rel=1e-6)
    whole = np.pi * (45e-3**2 - 10e-3**2)
    assert covered_share(film) == pytest.approx(sum(areas.values()) / whole, abs=5e-3)
    files = {file.name for file in export(film, MeshSettings().refined(0.5), tmp_path)}
    for name in (*areas, ""):
        for kind in ("dxf", "svg", "step"):
            assert f"circle-electrode{'-' * bool(name)}{name}.{kind}" in files
    layers = {entity.dxf.layer for entity in
              ezdxf.readfile(tmp_path / "circle-electrode.dxf").modelspace()}
    assert layers == {*areas}


def _quarter(inner: float, outer: float, half: float) -> float:
    """Area of a quarter ring whose straight edges are ``half`` from the axes."""
    x = np.linspace(half, outer, 400_001)
    low = np.maximum(np.sqrt(np.maximum(inner**2 - x**2, 0.0)), half)
    high = np.sqrt(np.maximum(outer**2 - x**2, 0.0))
    return float(np.trapezoid(np.maximum(high - low, 0.0), x))


def test_exported_layers_are_read_back_as_the_same_segments(tmp_path: Path) -> None:
    """The masks' drawing, with the frame in it, makes the film again."""
    film = driven_quarters(gap=1e-3)
    [*export(film, MeshSettings().refined(0.5), tmp_path)]
    drawing = ezdxf.readfile(tmp_path / "circle-electrode.dxf")
    drawing.modelspace().add_circle((0, 0), 45.0, dxfattribs={"layer": "FRAME"})
    drawing.saveas(tmp_path / "all.dxf")
    text = _text().replace('shape = "circle"\nradius = "4.5 cm"',
                           'shape = "dxf"\nfile = "all.dxf"\nlayer = "FRAME"')
    for number, name in enumerate("ABCD"):
        text = text.replace(f'sector = ["{90 * number} deg", "{90 * number + 90} deg"]',
                            f'outline = {{ shape = "dxf", file = "all.dxf", layer = "{name}" }}')
    (tmp_path / "again.toml").write_text(text)
    again = load_specimen(tmp_path / "again.toml")
    random = np.random.default_rng(0)
    angle, away = random.uniform(0, 2 * np.pi, 5000), random.uniform(10.1e-3, 44.9e-3, 5000)
    x, y = away * np.cos(angle), away * np.sin(angle)
    assert (again.electrode.segment_at(x, y, again.frame)
            == film.electrode.segment_at(x, y, film.frame)).all()


def test_a_written_specimen_keeps_its_segments(result: CaseResult) -> None:
    from tympan.base.toml_reader import Table

    film: Specimen = case().specimen
    assert load_specimen(Table("", specimen_content(film))).electrode == film.electrode
