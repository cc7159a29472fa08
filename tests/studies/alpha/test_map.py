"""The map's formula: found from a coarse grid, it holds where it was not fitted and says where it
does not."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from tests.support.checks.json_schema import faults, schema_of
from tympan.paper.loads import MAP
from tympan.reports.figures.alpha import draw_map
from tympan.studies.alpha import LoadGrid
from tympan.studies.alpha.map import (
    AlphaMap,
    Formula,
    MapReading,
    alpha_map,
    map_readings,
)
from tympan.studies.shipped import actuators

FILM = actuators()[0].membrane
COARSE = replace(MAP, loads=LoadGrid((17.9e-3,), (0.0, 3e3)), aspects=(1.1, 1.4, 1.8, 2.5),
                     ratios=(0.1, 0.3, 0.6), inside=6, outside=4)


@pytest.fixture(scope="module")
def made() -> AlphaMap:
    return alpha_map(FILM, COARSE)


def test_what_is_printed_is_as_declared(made: AlphaMap) -> None:
    assert list(faults(json.loads(json.dumps(made.json())), schema_of("map"))) == []


def test_the_formula_holds_inside_and_not_outside(made: AlphaMap) -> None:
    worst = made.json()["worst_error"]
    assert worst["grid"] < 2e-3
    assert worst["inside"] < 3e-3
    assert worst["outside"] > worst["grid"]
    assert not any((*made.of("grid")["trouble"], *made.of("inside")["trouble"]))
    for name, holds in (("inside", True), ("outside", False)):
        places = zip(made.of(name)["aspect"], made.of(name)["plate_over_short"], strict=True)
        (shortest, longest), (smallest, largest) = made.formula.aspects, made.formula.ratios
        assert all((shortest <= aspect <= longest and smallest <= ratio <= largest) == holds
                   for aspect, ratio in places)


def test_materials_of_the_test_are_others_than_the_fit_s(made: AlphaMap) -> None:
    assert set(made.of("grid")["material"]) == {"vhb-4910"}
    assert len(set(made.of("inside")["material"])) > 2


def test_a_small_plate_sees_the_conformal_radius_of_the_ellipse(made: AlphaMap) -> None:
    """The circle as stiff as the ellipse has, for small plates, the conformal radius of the
    ellipse.

    w = √k sn(2K/π · asin(z/c)), of nome q = ((a − b)/(a + b))², maps the ellipse of foci ±c on the
    unit disc, so that |dw/dz| at the centre is √k 2K/(π c).
    """
    aspect, ratio = 1.8, 0.02
    nome = ((aspect - 1) / (aspect + 1)) ** 2
    n = np.arange(1, 40)
    theta_2 = 2 * nome**0.25 * (1 + (nome ** (n * (n + 1.0))).sum())
    theta_3 = 1 + 2 * (nome ** (n**2.0)).sum()
    modulus = (theta_2 / theta_3) ** 2
    quarter = ellipk(modulus**2)
    radius = np.pi * np.sqrt(aspect**2 - 1) / (2 * np.sqrt(modulus) * quarter)
    assert ellipj(quarter, modulus**2)[0] == pytest.approx(1)
    same, short, long = (1 / np.log(size / ratio) for size in (radius, 1.0, aspect))
    expected = (same - long) / (short - long)
    light = replace(COARSE, loads=LoadGrid((1e-5,), (0.0,)))
    read, = map_readings(FILM, [MapReading(aspect, ratio)], light)
    assert read.alpha_1 == pytest.approx(expected, abs=2e-3)
    assert made.formula(np.array(aspect), np.array(ratio)) == pytest.approx(expected, abs=5e-3)


def test_circle_and_strip_are_the_formula_s_ends() -> None:
    formula = Formula((2.0, 0.0, 0.0, 0.0), (1.1, 2.5), (0.1, 0.6))
    assert formula(np.array(1 + 1e-7), np.array(0.2)) == pytest.approx(0.5, abs=0.1)
    far = formula(np.array(1e9), np.array(0.2))
    same, short, long = (1 / np.log(size / 0.2) for size in (4 / np.pi, 1.0, 1e9))
    assert far == pytest.approx((same - long) / (short - long), rel=1e-9)


@pytest.mark.study(seconds=4)
def test_workers_change_nothing() -> None:
    places = COARSE.places()["inside"][:2]
    assert map_readings(FILM, places, COARSE) == map_readings(FILM, places, COARSE,
                                                              workers=2)


def test_a_place_without_equilibrium_is_a_reading() -> None:
    charged = replace(COARSE, loads=LoadGrid((17.9e-3,), (20e3,)))
    read, = map_readings(FILM, [MapReading(1.5, 0.3)], charged)
    assert np.isnan(read.alpha_1)
    assert "no equilibrium" in read.trouble


def test_the_map_is_stored_and_drawn(made: AlphaMap, tmp_path) -> None:
    made.save(tmp_path)
    record = json.loads((tmp_path / "alpha-map.json").read_text(encoding="utf-8"))
    assert record["places"] == {"grid": 12, "inside": 6, "outside": 4}
    assert len((tmp_path / "alpha-map.csv").read_text(encoding="utf-8").splitlines()) == 23
    files = draw_map(made, tmp_path)
    assert files == [tmp_path / "alpha-map.png", tmp_path / "alpha-map.svg"]


def test_the_map_is_drawn_alike_from_what_is_stored(made: AlphaMap, tmp_path) -> None:
    for folder, result in (("made", made), ("loaded", made)):
        result.save(tmp_path / folder)
        drawn = result if folder == "made" else AlphaMap.load(tmp_path / folder)
        draw_map(drawn, tmp_path / folder)
    made_svg, loaded_svg = ((tmp_path / folder / "alpha-map.svg").read_bytes()
                            for folder in ("made", "loaded"))
    assert made_svg == loaded_svg
    assert AlphaMap.load(tmp_path / "made").json()["places"] == made.json()["places"]
