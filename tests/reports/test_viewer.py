"""Films that can be turned within a page: the data are the film's, the browser draws them."""

from __future__ import annotations

import json
import re
import tomllib
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps
from numpy.typing import NDArray

from benchmarks.explore.browser import pixels
from tests.support.specimens import circular, specimen_toml
from tympan.base.arrays import AnyArray, Array
from tympan.base.toml_reader import Table
from tympan.fem.film.library import load_specimen
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse, Polygon
from tympan.geometry.specimen import Plate
from tympan.reports import look
from tympan.reports.colouring import COLOURINGS, MOST_MARGIN
from tympan.reports.scales import round_scale
from tympan.reports.template import text_of
from tympan.reports.viewer import viewer
from tympan.reports.viewer.payload import coarsened, payload, plate_triangles, rim_edges
from tympan.studies.case import Case, Settings, solve
from tympan.studies.film_surface import FilmSurface
from tympan.studies.study import default_study

COARSE = Settings(MeshSettings(order=2, around_plate=8, growth=1, across=1))


def filmed(specimen: Any, mass: float = 17.9e-3, voltage: float = 3e3,
           settings: Settings = COARSE) -> FilmSurface:
    """The film of a specimen under a load."""
    film = solve(Case(specimen, mass=mass, voltage=voltage), settings, film=True).film
    assert film is not None
    return film


@pytest.fixture(scope="module")
def films() -> dict[str, FilmSurface]:
    """An ellipse whose long axis is y and a circle, of a film whose strength is known."""
    oval = load_specimen(Table("oval.toml", tomllib.loads(specimen_toml())))
    standing = replace(oval, frame=Ellipse((45e-3, 60e-3)))
    circle = replace(oval, frame=Circle(45e-3))
    return {name: filmed(item) for name, item in (("</script>", standing), ("circle", circle))}


def decoded(item: dict[str, Any], columns: int = 1) -> AnyArray:
    """An array as the page has it."""
    values = np.frombuffer(b64decode(item["data"]), np.dtype(item["type"]).newbyteorder("<"))
    return values.reshape(-1, columns) if columns > 1 else values


def test_a_page_has_every_point_triangle_and_value(films: dict[str, FilmSurface]) -> None:
    record = json.loads(payload(films))
    assert list(record["quantities"]) == list(COLOURINGS)
    for item, (name, film) in zip(record["films"], films.items(), strict=True):
        assert item["name"] == name
        assert np.array_equal(decoded(item["triangles"], 3), film.triangles)
        assert np.array_equal(decoded(item["tension"]), film.values["tension"])
        for key, values, columns in (("mounted", film.mounted[:, :2], 2),
                                     ("displaced", film.values["displacement"], 3)):
            step = item[key]["step"]
            assert step == pytest.approx(1e3 * np.abs(values).max() / 32767, rel=1e-12)
            given = step * decoded(item[key], columns)
            assert np.abs(given - 1e3 * values).max() <= 0.5001 * step
        for key, quantity in COLOURINGS.items():
            values, part = quantity.of(film), item["values"][key]
            given = part["low"] + decoded(part) / 65535 * (part["high"]
                                                                         - part["low"])
            assert np.abs(given - values).max() <= 0.5001 * np.ptp(values) / 65535 + 1e-12


def test_quantities_are_the_fields_in_the_units_that_are_said(
        films: dict[str, FilmSurface]) -> None:
    quantities = json.loads(payload(films))["quantities"]
    si = {"kPa": ("stress_1", 1e3), "MV/m": ("electric_field", 1e6), "µm": ("thickness", 1e-6)}
    for film in films.values():
        for key, unit in (("stress", "kPa"), ("field", "MV/m"), ("thickness", "µm")):
            name, factor = si[unit]
            assert quantities[key]["unit"] == unit
            assert COLOURINGS[key].of(film) * factor == pytest.approx(film.values[name], rel=1e-12)
        margin = COLOURINGS["margin"].of(film)
        assert (margin < MOST_MARGIN).all()
        assert margin * film.values["breakdown_share"] == pytest.approx(1, rel=1e-12)
        depth = 1e3 * (film.points - film.mounted)[:, 2]
        assert COLOURINGS["deflection"].of(film) == pytest.approx(depth, abs=1e-12)
        assert depth.max() > 1  # downwards


def test_colours_and_scale_are_those_of_the_still(films: dict[str, FilmSurface]) -> None:
    stress = json.loads(payload(films))["quantities"]["stress"]
    values = np.concatenate([film.values["stress_1"] / 1e3 for film in films.values()])
    scale = round_scale(float(values.min()), float(values.max()))
    assert (stress["low"], stress["high"]) == (scale.low, scale.high)
    assert [tick["text"] for tick in stress["ticks"]] == [scale.text(tick) for tick in scale.ticks]
    table = 255 * colormaps[look.COLOURS](np.arange(256))[:, :3]
    assert decoded(stress["colours"], 3) == pytest.approx(table, abs=0.5)


def test_what_is_the_same_everywhere_is_not_offered() -> None:
    record = json.loads(payload({"flat": filmed(circular(), voltage=0.0)}))
    assert list(record["quantities"]) == ["stress", "thickness", "deflection"]


def test_rims_are_the_frame_and_the_plate(films: dict[str, FilmSurface]) -> None:
    for film, long in zip(films.values(), (60.0, 45.0), strict=True):
        frame, plate = (1e3 * film.mounted[edges, :2] for edges in rim_edges(film))
        on_frame = np.hypot(frame[..., 0] / 45, frame[..., 1] / long)
        assert on_frame == pytest.approx(1, abs=2e-3)  # its elements are quadratic
        assert np.hypot(*plate.reshape(-1, 2).T) == pytest.approx(10, abs=2e-2)
        for edges in rim_edges(film):  # closed: every point ends two of them
            assert (np.unique(edges, return_counts=True)[1] == 2).all()


def area_of(corners: Array) -> float:
    """Of triangles, shape (n, 3, 2)."""
    (x, y) = np.moveaxis(corners[:, 1:] - corners[:, :1], -1, 0)
    return float(0.5 * np.abs(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum())


def test_a_plate_is_filled_and_nothing_else() -> None:
    corners = ((-12e-3, -12e-3), (12e-3, -12e-3), (12e-3, 0.0), (0.0, 0.0), (0.0, 12e-3),
               (-12e-3, 12e-3))
    angle = Polygon(corners)
    film = filmed(replace(circular(), plate=Plate(angle)))
    mounted = film.mounted[:, :2]
    corners_of = mounted[plate_triangles(mounted, rim_edges(film)[1])]
    assert area_of(corners_of) == pytest.approx(0.75 * 24e-3**2, rel=1e-2)
    outside = (corners_of.mean(axis=1) > 0.1e-3).all(axis=1)
    assert not outside.any()


@pytest.mark.parametrize(("most", "share"), [(10**9, 1), (2000, 10 / 28), (10, 3 / 28)])
def test_many_films_are_cut_into_fewer_triangles(
        films: dict[str, FilmSurface], most: int, share: float) -> None:
    for film, thin in zip(films.values(), coarsened(list(films.values()), most), strict=True):
        assert len(thin.points) == pytest.approx(share * len(film.points))
        everywhere = {tuple(point) for point in film.points}
        assert all(tuple(point) in everywhere for point in thin.points)
        fine, coarse = (area_of(item.mounted[:, :2][item.triangles]) for item in (film, thin))
        assert coarse == pytest.approx(fine, rel=0.05)
        assert len(rim_edges(thin)) == 2


def test_the_papers_films_are_small() -> None:
    study = default_study()
    films = {item.name: filmed(item, voltage=3e3, settings=Settings()) for item in study.specimens}
    assert len(viewer(films)) < 1e6


def test_names_cannot_end_the_script(films: dict[str, FilmSurface]) -> None:
    text = viewer(films)
    assert len(re.findall("</script", text)) == 2
    assert "</script>" in json.loads(payload(films))["films"][0]["name"]
    for outside in ("http:", "https:", "import(", "fetch", "src=", "url("):
        assert outside not in text


@pytest.fixture(scope="module")
def file(films: dict[str, FilmSurface], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with a picture and the films."""
    page = tmp_path_factory.mktemp("viewer") / "page.html"
    page.write_text(f"<!DOCTYPE html><style>{text_of('reports/page.css')}</style><main><p>still"
                    f"</p>{viewer(films)}</main>", encoding="utf-8")
    return page


@pytest.fixture
def page(browser: Any, file: Path) -> Iterator[Any]:
    """The page, opened from the disk; it asks for nothing else and has no errors."""
    context = browser.new_context(viewport={"width": 900, "height": 900})
    shown, asked, errors = context.new_page(), [], []
    shown.on("request", lambda request: asked.append(request.url))
    shown.on("pageerror", lambda error: errors.append(str(error)))
    shown.on("console", lambda message: errors.append(message.text))
    shown.goto(file.as_uri())
    yield shown
    assert asked == [file.as_uri()]
    assert not errors
    context.close()


def settled(page: Any) -> NDArray[np.uint8]:
    """The canvas's picture, once it is drawn."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame("
                  "done)))")
    return pixels(page, "canvas")[4:-4, 4:-4]


def pressed(page: Any, *keys: str) -> NDArray[np.uint8]:
    """The picture after some keys."""
    page.locator("canvas").focus()
    for key in keys:
        page.keyboard.press(key)
    page.evaluate("() => document.activeElement.blur()")  # and its outline with it
    return settled(page)


def extent(picture: NDArray[np.uint8]) -> tuple[int, int, int, int]:
    """Left, top, width and height of what is not background."""
    rows, columns = (np.flatnonzero((picture < 250).any(axis=2).any(axis=axis))
                     for axis in (1, 0))
    return (int(columns[0]), int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1)


def test_a_film_seen_from_above_has_its_outline_and_its_colours(
        page: Any, films: dict[str, FilmSurface]) -> None:
    page.select_option("[name=depth]", "1")
    picture = pressed(page, *["ArrowUp"] * 10)
    west, top, width, height = extent(picture)
    # The long axis lies across, as in the still.
    assert width / height == pytest.approx(60 / 45, rel=0.02)
    film = next(iter(films.values()))
    quantity = json.loads(payload(films))["quantities"]["stress"]
    stress = (film.values["stress_1"] / 1e3 - quantity["low"]) / (quantity["high"]
                                                                  - quantity["low"])
    short, long = (picture[top + height // 8, west + width // 2],
                   picture[top + height // 2, west + width // 8])
    for seen, colour in ((short, look.SHORT), (long, look.LONG)):
        assert seen == pytest.approx([int(colour[at:at + 2], 16) for at in (1, 3, 5)], abs=25)
    per_mm, middle = width / 120, np.array([west + width / 2, top + height / 2])
    off = []
    for point in range(0, len(film.points), 7):
        x, y = 1e3 * film.points[point, :2]
        on_line = min(abs(x), abs(y), *(abs(c / 10 - round(c / 10)) * 10 for c in (x, y)))
        if np.hypot(x, y) < 12 or np.hypot(x / 45, y / 60) > 0.95 or on_line < 1:
            continue
        column, row = np.floor(middle + per_mm * np.array([y, x])).astype(int)
        expected = 255 * np.array(colormaps[look.COLOURS](stress[point])[:3])
        off.append(float(np.abs(picture[row, column] - expected).max()))
    assert len(off) > 50
    assert np.median(off) < 2
    assert max(off) < 12  # half a pixel aside


def test_keys_the_mouse_and_the_wheel_turn_and_zoom(page: Any) -> None:
    first = settled(page)
    assert (first < 250).any(axis=2).mean() > 0.1
    turned = pressed(page, "ArrowRight")
    assert (turned != first).any(axis=2).mean() > 0.01
    assert np.array_equal(pressed(page, "ArrowLeft"), first)
    assert extent(pressed(page, "-"))[2] == pytest.approx(extent(first)[2] / 1.2, rel=0.02)
    assert np.array_equal(pressed(page, "0"), first)
    side = pressed(page, *["ArrowDown"] * 7)
    assert extent(side)[3] < 0.8 * extent(first)[3]
    page.click("text=reset")
    assert np.array_equal(pressed(page), first)
    box = page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 260, box["y"] + 220)
    page.mouse.up()
    assert (pressed(page) != first).any(axis=2).mean() > 0.01


def test_choices_are_drawn_and_told(page: Any, films: dict[str, FilmSurface]) -> None:
    first = settled(page)
    thick = [film.values["thickness"] * 1e6 for film in films.values()]
    page.select_option("[name=quantity]", "thickness")
    assert (settled(page) != first).any(axis=2).mean() > 0.1
    assert page.inner_text(".words") == "thickness (µm)"
    page.select_option("[name=film]", "1")
    low, high = map(float, re.findall(r"\d+\.\d+", page.inner_text("output")))
    assert (low, high) == pytest.approx((thick[1].min(), thick[1].max()), rel=1e-3)
    assert "circle" in page.get_attribute("canvas", "aria-label")
    pressed(page, *["ArrowDown"] * 12)  # nearly from the side
    flat, deep = [], []
    for heights, depth in ((flat, "0"), (deep, "20")):
        page.select_option("[name=depth]", depth)
        heights.append(extent(settled(page))[3])
    assert flat[0] < 30
    assert deep[0] > 100


def test_film_without_tension_is_hatched(
        browser: Any, films: dict[str, FilmSurface], tmp_path: Path) -> None:
    film = list(films.values())[1]
    right = film.mounted[:, 0] > 1e-9
    loose = [replace(film, values={**film.values, "tension": np.where(right, state, 0.0)})
             for state in (0, 1, 2)]
    file = tmp_path / "loose.html"
    file.write_text(f"<style>{text_of('reports/page.css')}</style>"
                    f"{viewer(dict(zip('abc', loose, strict=True)))}", encoding="utf-8")
    shown = browser.new_page()
    shown.goto(file.as_uri())
    pictures = []
    for number in "012":
        shown.select_option("[name=film]", number)
        pictures.append(settled(shown))
    shown.close()
    middle = pictures[0].shape[1] // 2
    assert np.array_equal(pictures[0][:, :middle - 4], pictures[2][:, :middle - 4])
    drawn = (pictures[0] < 250).any(axis=2)[:, middle + 4:].sum()
    hatched, crossed = ((other != pictures[0]).any(axis=2)[:, middle + 4:].sum() / drawn
                        for other in pictures[1:])
    assert 0.1 < hatched < 0.6
    assert crossed > 1.4 * hatched


def test_without_scripts_there_is_no_viewer(browser: Any, file: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    still = context.new_page()
    still.goto(file.as_uri())
    assert still.locator("text=still").is_visible()
    assert not still.locator(".viewer").is_visible()
    context.close()
