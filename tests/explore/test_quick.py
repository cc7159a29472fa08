"""Curve, limits and blocked force of a view by reduced films, against finite elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from tests.support.costs import dear
from tests.support.specimens import elliptical
from tympan.explore.curve import drawn_curve
from tympan.explore.latest import Pause
from tympan.explore.numbers import blocked_rows, curve_rows, limit_rows, result_rows
from tympan.explore.quick import Neighbours, QuickCurve, by_family
from tympan.explore.session import Bands, Session
from tympan.explore.view import FilmView, changed
from tympan.fem.film.breakdown import ConstantStrength
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.reports.figures.curve import voltage_curves
from tympan.studies.case import Settings, solve
from tympan.studies.films import rise as rises
from tympan.studies.films.family import FilmFamily
from tympan.studies.films.first_limits import FilmMargins
from tympan.studies.films.rise import FamilyRise, rise
from tympan.studies.limits.curve import curve
from tympan.studies.tolerance import bands
from tympan.studies.tolerance.bands import banded
from tympan.studies.tolerance.given import LengthScatter, Scatter, Tolerances

OVAL = FilmView(elliptical(60e-3), mass=0.0179, voltage=2000.0)

#: Films here and the finite elements they are held to have one mesh, so that a coarse one will do.
COARSE = Settings(MeshSettings(order=2).refined(0.8))

#: Scatter of the oval.
TOLERANCES = Tolerances(stiffness=Scatter(batch=0.1), thickness=Scatter(film=0.03),
                        offset=LengthScatter(film=0.0))

#: Where the oval ends [V].
END = 8.2e3


def neighbours(view: FilmView, tolerances: Tolerances | None = None) -> Neighbours:
    """The films near a view, coarsely meshed."""
    films = Neighbours.of(view, END, tolerances)
    assert films is not None
    return replace(films, settings=COARSE)


@pytest.fixture(scope="module")
def family() -> FilmFamily:
    """The films near the oval."""
    films = neighbours(OVAL)
    made = films.family()
    assert made is not None
    return made


@pytest.fixture
def quick(family: FilmFamily, monkeypatch: pytest.MonkeyPatch
          ) -> Callable[[Any], Iterator[QuickCurve]]:
    """What answers views near the oval."""
    films = Neighbours.of(OVAL, END)
    assert films is not None
    monkeypatch.setattr(Neighbours, "family", lambda _: family)
    return by_family(films)


@pytest.mark.study(seconds=4, only=("voltage-3500.0", "mass-0.005"))
@pytest.mark.parametrize(("key", "value"), [
    ("voltage", 3500.0), ("mass", 0.005), ("mass", 0.03), ("stiffness", 0.85),
    ("membrane.prestretch.0", 2.05), ("membrane.relative_permittivity", 5.2),
    ("membrane.thickness", 0.85e-3), ("frame.semi_axes.0", 56e-3), ("plate.outline.radius", 9e-3)])
def test_a_moved_control_gives_the_curve_the_limits_and_the_force_of_finite_elements(
        key: str, value: float, quick: Callable[[Any], Iterator[QuickCurve]]) -> None:
    view = changed(OVAL, key, value)
    answer, = quick(view)
    assert answer.curve is not None
    assert answer.blocked is not None
    assert answer.curve.off is not None
    line, = voltage_curves(answer.curve.curve)
    assert line.voltage[0] == 0
    for voltage in (0.0, view.voltage):
        exact = solve(replace(view, voltage=voltage).case, COARSE).deflection_m
        assert exact is not None
        assert line.at(voltage / 1e3) == pytest.approx(1e3 * exact, abs=2e-3 * line.deflection[-1])
    # At points of the curve there is no interpolation.
    number = len(line.voltage) // 2
    exact = solve(replace(view, voltage=1e3 * line.voltage[number]).case, COARSE).deflection_m
    assert exact is not None
    assert 1e-3 * line.deflection[number] == pytest.approx(exact, rel=5e-4)
    expected = curve(view.actuator, [view.mass], COARSE, view.rig).curves[0].limits
    first, found = expected.limit, line.limits.limit
    assert first is not None
    assert found is not None
    assert found.kind == first.kind
    assert found.voltage_V == pytest.approx(first.voltage_V, rel=max(
        found.spread, first.spread))
    session = Session(COARSE)
    session.scene(view)
    blocked = session.blocked(view).force
    assert answer.blocked.force == pytest.approx(blocked, rel=2e-3)
    shown, = blocked_rows(answer.blocked)
    assert str(shown["text"]).endswith(" mN")


@pytest.mark.parametrize("change", [
    {"mass": 0.025}, {"mass": 0.008}, {"stiffness": 0.85}, {"membrane.prestretch.0": 2.4},
    {"membrane.thickness": 1.15e-3}, {"frame.semi_axes.0": 66e-3},
    {"plate.outline.radius": 9e-3, "stiffness": 1.15}])
def test_a_film_found_from_another_is_the_one_that_a_search_finds(
        change: dict[str, float], family: FilmFamily, monkeypatch: pytest.MonkeyPatch) -> None:
    films = Neighbours.of(OVAL, END)
    assert films is not None
    view = OVAL
    for key, value in change.items():
        view = changed(view, key, value)

    def risen(of: FilmView, last: FamilyRise | None = None) -> FamilyRise:
        row = films.row(of)
        assert row is not None
        made = rise(family, row, 9.81 * of.mass, last)
        assert made is not None
        return made

    searched, start = risen(view), risen(OVAL)
    monkeypatch.setattr(rises, "first_limits", None)  # nothing is searched any more
    found = risen(view, start)
    assert found.whole == searched.whole
    assert found.limits.keys() == searched.limits.keys()
    for kind, limit in found.limits.items():
        assert limit.squared == pytest.approx(searched.limits[kind].squared, abs=limit.off)
    # The last one before the top is less of its U² away from it than U² is known to.
    inner = slice(1, -2)
    exact = family.states(films.row(view), 9.81 * view.mass, found.squared[None, inner] ** 0.5,
                          check=False).deflection[0]
    assert found.deflection[inner] == pytest.approx(exact, abs=2e-4 * found.deflection[-1])


def test_what_a_reduced_film_does_not_know_is_open(
        quick: Callable[[Any], Iterator[QuickCurve]]) -> None:
    answer, = quick(OVAL)
    assert answer.curve is not None
    rows = {row["key"]: row for row in (*limit_rows(answer.curve), *curve_rows(
        answer.curve, 2.5e-3))}
    assert "±" in str(rows["tension"]["text"])
    assert rows["pull_in"]["text"] == "…"
    assert rows["pull_in"]["stale"]
    assert str(rows["first"]["text"]).startswith("loss of tension at ")


def test_a_film_that_keeps_its_tension_is_followed_to_its_pull_in(
        quick: Callable[[Any], Iterator[QuickCurve]], monkeypatch: pytest.MonkeyPatch) -> None:
    # Finite elements, too, tell the pull-in of a film that is kept from wrinkling, if asked.
    view = replace(OVAL, mass=0.015)
    found = FilmFamily.margins

    def taut(family: FilmFamily, *where: Any) -> FilmMargins:
        margins = found(family, *where)
        never = 0 * margins.by_kind["tension"] + 1
        return replace(margins, by_kind={**margins.by_kind, "tension": never},
                       firm=np.ones(len(never), dtype=bool))

    monkeypatch.setattr(FilmFamily, "margins", taut)
    expected = curve(view.actuator, [view.mass], COARSE, view.rig,
                     beyond=True).curves[0].limits.pull_in
    answer, = quick(view)
    assert answer.curve is not None
    assert answer.curve.off is not None
    assert answer.curve.off.whole
    limits = answer.curve.curve.curves[0].limits
    assert limits.first == "pull_in"
    assert limits.pull_in is not None
    assert expected is not None
    assert limits.pull_in.voltage_V == pytest.approx(expected.voltage_V, rel=5e-4)
    assert "not reached" in {row["text"] for row in limit_rows(answer.curve)}


@pytest.fixture(scope="module")
def scattering() -> tuple[Neighbours, FilmFamily]:
    """The films near the oval, and those that scatter about each of them."""
    films = neighbours(OVAL, TOLERANCES)
    made = films.family()
    assert made is not None
    return films, made


@pytest.fixture
def _fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bands of 256 films instead of 512: the same ones on either side, so that no less is seen."""
    monkeypatch.setattr(bands, "_FILMS", 256)


@pytest.mark.study(seconds=9)
@pytest.mark.usefixtures("_fewer")
@pytest.mark.parametrize("change", [
    {"mass": 0.022, "voltage": 4000.0, "stiffness": 1.12, "frame.semi_axes.0": 63e-3},
    dear({"mass": 0.024, "voltage": 4000.0}, seconds=7), dear({"stiffness": 1.19}, seconds=6),
    dear({"frame.semi_axes.0": 66e-3}, seconds=7)])
def test_bands_about_a_view_are_those_of_solve_and_curve(
        change: dict[str, float], scattering: tuple[Neighbours, FilmFamily],
        monkeypatch: pytest.MonkeyPatch) -> None:
    films, family = scattering
    monkeypatch.setattr(Neighbours, "family", lambda _: family)
    view = OVAL
    for key, value in change.items():
        view = changed(view, key, value)
    answer, *parts = by_family(films)(view)
    assert isinstance(answer, QuickCurve)
    assert answer.curve is not None
    assert isinstance(parts[0], Pause)  # controls that go on slide as if nothing scattered
    found = [part for part in parts if isinstance(part, Bands)][-1]
    settings = COARSE
    case = banded(solve(view.case, settings), view.actuator, TOLERANCES, view.rig, settings)
    for key, band in found.numbers.items():
        expected = case.bands[key]
        # Stresses of reduced films are less exact than what the plate shows.
        exact = 5e-3 if "stress" in key else 2e-3
        for name in ("low", "median", "high", "share"):
            assert getattr(band, name) == pytest.approx(getattr(expected, name), rel=exact)
    assert found.numbers.keys() == case.bands.keys() > {"deflection_m", "stroke_m", "capacitance_F"}
    line, = voltage_curves(banded(curve(view.actuator, [view.mass], settings, view.rig),
                                  view.actuator, TOLERANCES, view.rig, settings))
    places, *edges = answer.curve.banded(found).line.band
    told = np.isfinite(edges[0])
    assert told.sum() >= 5
    for mine, theirs in zip(edges, line.band[1:], strict=True):
        there = np.isfinite(theirs) & (line.band[0] <= places[told][-1])
        between = PchipInterpolator(places[told] ** 2, mine[told])(line.band[0][there] ** 2)
        # Nine voltages tell it between them; the edges themselves are known to 5 % of the width.
        assert between == pytest.approx(theirs[there], rel=1e-2)


@pytest.mark.usefixtures("_fewer")
def test_a_voltage_alone_has_no_new_bands_of_the_curve(
        scattering: tuple[Neighbours, FilmFamily], monkeypatch: pytest.MonkeyPatch) -> None:
    films, family = scattering
    monkeypatch.setattr(Neighbours, "family", lambda _: family)
    answers = by_family(films)
    first = [part for part in answers(OVAL) if isinstance(part, Bands)]
    other = replace(OVAL, voltage=3000.0)
    second = [part for part in answers(other) if isinstance(part, Bands)]
    assert {part.deflections for part in second} == {first[-1].deflections}
    assert len(second) < len(first)
    text = {row["key"]: str(row["text"]) for row in result_rows(
        Session(COARSE).scene(other), second[-1].numbers)}["deflection_m"]
    band = second[-1].numbers["deflection_m"]
    assert text.endswith(f" mm ({1e3 * band.low:.3g} to {1e3 * band.high:.3g})")
    followed_curve = next(iter(answers(other))).curve
    assert 'class="band"' in drawn_curve(followed_curve.banded(second[-1]), None)
    assert 'class="band"' not in drawn_curve(followed_curve, None)


def test_breakdown_before_the_end_is_that_of_finite_elements() -> None:
    film = replace(OVAL.specimen.membrane, strength=ConstantStrength(40e6))
    view = replace(OVAL, specimen=replace(OVAL.specimen, membrane=film))
    films = neighbours(view)
    answer, = by_family(films)(view)
    assert answer.curve is not None
    found = answer.curve.curve.curves[0].limits
    expected = curve(view.actuator, [view.mass], COARSE, view.rig).curves[0].limits
    assert found.first == expected.first == "breakdown"
    for kind in ("breakdown", "tension"):
        limit, known = getattr(found, kind), getattr(expected, kind)
        assert limit.voltage_V == pytest.approx(known.voltage_V, rel=max(
            limit.spread, known.spread))


@pytest.mark.parametrize("view", [
    changed(OVAL, "frame.semi_axes.0", 80e-3), changed(OVAL, "plate.offset.0", 2e-3),
    replace(OVAL, mass=0.04), replace(OVAL, rig=Rig(spring=1.0))])
def test_other_films_are_left_to_finite_elements(view: FilmView) -> None:
    films = Neighbours.of(OVAL, END)
    assert films is not None
    assert films.row(OVAL) is not None
    assert films.row(view) is None


def test_a_rig_that_no_reduced_film_has_has_none() -> None:
    assert Neighbours.of(replace(OVAL, rig=Rig(guide="fixed")), END) is None


@pytest.mark.study(seconds=4)
def test_a_film_above_gas_is_that_of_finite_elements() -> None:
    """Some of the weight is borne by the gas; its plate still sinks with the voltage."""
    view = replace(OVAL, rig=Rig(gas_pressure=5.0))
    films = neighbours(view)
    made, row = films.family(), films.row(view)
    assert made is not None
    assert row is not None
    risen = rise(made, row, float(view.case.force(view.specimen.plate_area)))
    assert risen is not None
    place = float(np.interp(view.case.film_voltage**2, risen.squared, risen.deflection))
    assert place == pytest.approx(solve(view.case, COARSE).deflection_m, rel=1e-3)
