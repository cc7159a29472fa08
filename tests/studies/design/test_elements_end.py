"""The margin of a design to its film's first end: that of `tympan limits`, of every kind of end,
with slopes that differences of ends on moved meshes confirm."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.elements import asked, element_space, vary
from tests.support.specimens import elliptical
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke, Yeoh
from tympan.fem.membrane.biases import Magnet
from tympan.fem.results.limit_states import INSTABILITY
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import Limit, Settings
from tympan.studies.design.elements.evaluator import Design, DesignEvaluator
from tympan.studies.design.elements.optimise import OptimiseResult, optimise
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.limits import end as ends
from tympan.studies.design.requirements import Requirements
from tympan.studies.design.sqp import Linearisation
from tympan.studies.limits import limits, voltages
from tympan.studies.limits.voltages import End, first_end

BOUND = 1.2
OVAL = Ellipse((36e-3, 28e-3))
SOFTENING = Specimen("yeoh", OVAL, Plate(Circle(7.3e-3)), Film(
    0.83e-3, (1.93, 1.93), Yeoh((13.1e3, -210.0, 9.3)), 3.1, permittivity_exponent=-0.6))
GREASED = replace(SOFTENING, electrode=Electrode(stiffness=2e3),
                  membrane=replace(SOFTENING.membrane, prestretch=(2.0, 1.9)))
BARE = Specimen("bare", Ellipse((36e-3, 31.7e-3)), Plate(Circle(7.3e-3)), Film(
    0.61e-3, (1.09, 1.09), NeoHooke(23e3), 3.1), Electrode(margin_frame=11.3e-3,
                                                         margin_plate=2.9e-3))
BESIDE = replace(elliptical(60e-3), plate=Plate(Circle(10e-3), (5e-3, 3e-3)))
MAGNET = Rig(biases=(Magnet(1.0, 8e-3, 5e-3),))

#: Specimen, mass [kg], voltage [V], rig, and how the film ends.
FILMS = {
    "thins where it loses tension": (elliptical(60e-3), 17.9e-3, 6e3, Rig(), "thinning"),
    "and its plate is off centre": (BESIDE, 17.9e-3, 6e3, Rig(), "thinning"),
    "under an amplifier that sags": (elliptical(60e-3), 17.9e-3, 6e3,
                                     Rig(amplifier_gain=0.05, sag_voltage=30e3), "thinning"),
    "thins after it has wrinkled": (BARE, 28e-3, 8e3, Rig(), "thinning"),
    "gives way in itself": (SOFTENING, 58e-3, 4.4e3, Rig(), "instability"),
    "gave way below the voltage": (SOFTENING, 58e-3, 5.4e3, Rig(), "instability"),
    "gives way line by line": (GREASED, 58e-3, 4.6e3, Rig(), "instability"),
    "pulls in": (elliptical(60e-3), 17.9e-3, 4.5e3, MAGNET, "pull_in")}
#: Of a film's lengths, how far a difference goes either way.
STEP = 2e-3


def posed(name: str) -> tuple[ElementSpace, str]:
    """A film that may be longer, wider, and have another plate."""
    specimen, mass, voltage, rig, end = FILMS[name]
    lengths = (vary("frame.semi_axes.0", 20e-3, 90e-3),
               vary("frame.semi_axes.1", 20e-3, 90e-3), vary("plate.radius", 3e-3, 2e-2))
    return element_space(specimen, mass, voltage, lengths, {"pull_in_margin": BOUND}, ("nothing",),
                         rig), end


class Films:
    """Designs on one mesh, moved."""

    def __init__(self, problem: ElementSpace, settings: Settings = Settings()) -> None:
        self.evaluator = DesignEvaluator(problem, settings)
        self.x = (np.array(problem.starts[0]) - problem.lows) / problem.widths
        self.here, self.design = self.at(np.zeros(3), renew=True)

    def at(self, step: np.ndarray, renew: bool = False) -> tuple[Linearisation, Design]:
        there, design = self.evaluator.at(self.x + step, renew), self.evaluator.last
        assert there is not None
        assert design is not None
        return there, design


def reached(problem: ElementSpace, settings: Settings) -> Limit:
    """The first end that `tympan limits` finds on the same mesh."""
    return min((limit for limit in limits(problem.case, settings).reached if limit.state.ends),
               key=lambda limit: limit.voltage_V)


@pytest.mark.parametrize("name", FILMS)
def test_the_margin_is_that_of_limits_and_its_slopes_those_of_moved_meshes(name: str) -> None:
    problem, end = posed(name)
    films = Films(problem)
    margin, c = films.design.limited["pull_in_margin"], films.here.limits
    assert films.design.end == end
    assert margin == pytest.approx(reached(problem, Settings()).voltage_V / problem.case.voltage,
                                   rel=1e-6)
    assert c.max() == pytest.approx(1 - margin / BOUND, abs=1e-7)
    near = c > c.max() - 0.02
    for number, width in enumerate(problem.widths):
        step = STEP * problem.starts[0][number] / width * np.eye(3)[number]
        (after, one), (before, other) = films.at(step), films.at(-step)
        assert one.end == other.end == end
        measured = (after.limits - before.limits) / (2 * step[number])
        slopes = films.here.limit_slopes[:, number]
        scale = np.abs(films.here.limit_slopes[near]).max()
        np.testing.assert_allclose(slopes[near], measured[near], atol=2e-4 * scale)
        # What limits the design is the first of all places, wherever it moves.
        margins = [design.limited["pull_in_margin"] for design in (one, other)]
        assert [after.limits.max(), before.limits.max()] == pytest.approx(
            [1 - margin / BOUND for margin in margins], abs=2e-4)


@pytest.mark.parametrize("name", ["thins where it loses tension", "gives way in itself",
                                  "gave way below the voltage", "pulls in"])
def test_differences_stand_in_where_an_end_has_no_slope_of_its_own(
        name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """They agree with those of the ends that have, of the place that is first."""
    problem, end = posed(name)
    exact = Films(problem)

    def moving_by_itself(*arguments: Any) -> tuple[End | None, float]:
        met, followed = first_end(*arguments)
        if met is None or met.stop.event is None:
            return met, followed
        return replace(met, stop=replace(met.stop, sign=INSTABILITY.signs[1])), followed

    def no_mode(*arguments: Any) -> dict[str, float]:
        raise InputError("has no smooth limit", key="limit")

    monkeypatch.setattr(ends, "first_end", moving_by_itself)
    monkeypatch.setattr(ends, "limit_gradient", no_mode)
    differences = Films(problem)
    assert differences.design.end == end
    first = int(exact.here.limits.argmax())
    assert len(differences.here.limits) == len(exact.here.limits)
    assert differences.here.limits[0] == pytest.approx(exact.here.limits[first], abs=1e-7)
    np.testing.assert_allclose(differences.here.limit_slopes[0], exact.here.limit_slopes[first],
                               rtol=2e-3)
    assert not differences.here.limit_slopes[1:].any()


def test_a_margin_without_an_end_within_reach_is_that_or_more() -> None:
    problem, _ = posed("thins where it loses tension")
    films = Films(asked(problem, voltage=1e3))
    assert films.design.end is None
    assert films.design.limited["pull_in_margin"] == pytest.approx(1.5 * BOUND)
    assert films.here.limits.max() == pytest.approx(-0.5)
    assert not films.here.limit_slopes.any()


def test_a_film_that_is_not_followed_has_the_margin_it_was_followed_to(
        monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = posed("thins where it loses tension")
    monkeypatch.setattr(voltages, "stops", lambda *arguments: iter(()))
    films = Films(problem)
    assert films.design.end is None
    assert films.design.limited["pull_in_margin"] == pytest.approx(1.0, rel=1e-12)
    assert films.here.limits.max() == pytest.approx(1 - 1 / BOUND)


def test_a_film_that_has_given_way_before_any_voltage_has_no_margin() -> None:
    """One that softens more gives way by the weight alone."""
    problem, _ = posed("gives way in itself")
    film = replace(SOFTENING.membrane, material=Yeoh((13.1e3, -600.0, 14.0)))
    soft = replace(SOFTENING, membrane=film)
    films = Films(replace(asked(problem, voltage=100.0), specimen=soft))
    assert reached(films.evaluator.space, Settings()).voltage_V == 0
    assert films.design.end == "instability"
    assert films.design.limited["pull_in_margin"] == 0
    assert films.here.limits.max() == 1


def shortened() -> ElementSpace:
    """The shipped problem for one measure from one start."""
    return asked(ElementSpace.of(Requirements.shipped()), held=("area",), starts=())


@pytest.fixture(scope="module")
def result() -> OptimiseResult:
    return optimise(shortened())


def test_the_optimum_s_margin_is_confirmed_by_its_own_specimen(result: OptimiseResult) -> None:
    """By `tympan limits` on the default mesh, within what that says it may be off."""
    [optimum], [specimen] = result.record["optima"], result.specimens.values()
    problem = replace(shortened(), specimen=specimen)
    first = reached(problem, Settings())
    assert optimum["end"] == optimum["finer"]["end"] == "thinning"
    assert optimum["limits"]["pull_in_margin"]["active"]
    stated = optimum["limits"]["pull_in_margin"]["value"]
    assert stated == pytest.approx(1.2, rel=3e-4)
    assert first.kind == "instability"
    assert abs(first.voltage_V / problem.case.voltage - stated) < first.spread * stated
    assert optimum["gain"] > 0.14


def test_a_film_that_gives_way_in_itself_has_an_optimum_before_that() -> None:
    """The circle, and a larger plate: a margin that was 1.19 is 1.25, as its own specimen says."""
    problem, end = posed("gives way in itself")
    problem = asked(problem, bounds={"pull_in_margin": 1.25}, held=("area",))
    best = optimise(problem)
    [optimum], [specimen] = best.record["optima"], best.specimens.values()
    assert (optimum["status"], optimum["end"]) == ("optimum", end)
    assert best.record["given"]["limited"]["pull_in_margin"] < 1.2
    first = reached(replace(problem, specimen=specimen), Settings())
    assert optimum["limits"]["pull_in_margin"]["value"] == pytest.approx(1.25, rel=3e-4)
    assert abs(first.voltage_V / problem.case.voltage - 1.25) < first.spread * 1.25
    a, b, radius = optimum["variables"].values()
    assert a / b == pytest.approx(1, abs=0.02)
    assert radius > 1.1 * 7.3e-3


def test_no_design_with_that_margin_on_a_finer_mesh_is_better(result: OptimiseResult) -> None:
    """Neighbours of the same area whose margin is made the same by their plate's radius."""
    [optimum] = result.record["optima"]
    problem = shortened()
    a, b, radius = optimum["variables"].values()
    finer = Settings(MeshSettings().refined(1.5))

    def stroke(ratio: float) -> float:
        """Of a frame so much longer, with the plate that gives it the optimum's margin."""
        def solved(radius: float) -> tuple[float, float]:
            evaluator = DesignEvaluator(problem, finer)
            values = np.array([a * ratio, b / ratio, radius])
            evaluator.at((values - problem.lows) / problem.widths, renew=True)
            assert evaluator.last is not None
            return evaluator.last.limited["pull_in_margin"], evaluator.last.stroke

        radii = radius * np.array([0.98, 1.02])
        margins, strokes = np.array([solved(each) for each in radii]).T
        at_bound = np.interp(stated, margins, radii)
        return float(np.interp(at_bound, radii, strokes))

    evaluator = DesignEvaluator(problem, finer)
    evaluator.at((np.array([a, b, radius]) - problem.lows) / problem.widths, renew=True)
    assert evaluator.last is not None
    stated = evaluator.last.limited["pull_in_margin"]
    best = stroke(1.0)
    assert best == pytest.approx(evaluator.last.stroke, rel=1e-3)
    for ratio in (0.9, 1.1):
        assert stroke(ratio) < best * (1 - 1e-3)


def test_the_end_is_told_and_stored_and_older_files_are_read(
        result: OptimiseResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "oval.toml").write_text(specimen_to_toml(elliptical(60e-3)), encoding="utf-8")
    (tmp_path / "OPTIMISE.toml").write_text(
        'specimen = "oval.toml"\nhold = "nothing"\nmass = "17.9 g"\nvoltage = "6 kV"\n'
        '[vary]\n"plate.radius" = ["9 mm", "11 mm"]\n[limits]\npull_in_margin = 1.45\n',
        encoding="utf-8")
    command = ["design", str(tmp_path / "OPTIMISE.toml"), "-o", str(tmp_path / "out"),
               "--refine", "0.6"]
    assert main(command) == 0
    assert "the film thins without bound  " in capsys.readouterr().out.replace("\n", "  ")
    stored = json.loads((tmp_path / "out" / "optimum.json").read_text(encoding="utf-8"))
    assert stored["given"]["end"] == stored["optima"][0]["end"] == "thinning"
    rows = (tmp_path / "out" / "path.csv").read_text(encoding="utf-8").splitlines()
    place = rows[0].split(",").index("end")
    assert {row.split(",")[place] for row in rows[1:]} == {"thinning"}
    older = [",".join(field for number, field in enumerate(row.split(",")) if number != place)
             for row in rows]
    (tmp_path / "out" / "path.csv").write_text("\n".join(older) + "\n", encoding="utf-8")
    assert main(["report", str(tmp_path / "out")]) == 0
    trials = OptimiseResult.load(tmp_path / "out").trials
    assert len(trials["stroke"]) == len(rows) - 1
    assert set(result.trials["end"]) == {"thinning"}
