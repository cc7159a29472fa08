"""Shape optimisation: gradients by Taylor's test, optima by their own conditions, by neighbours and
finer meshes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from scipy.special import ellipe

from tests.support.elements import element_space, vary
from tests.support.specimens import NEO_HOOKE, elliptical
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.geometry import outlines
from tympan.geometry.errors import InputError
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse, Outline, area, perimeter
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.case import Case, Settings, solve
from tympan.studies.design.elements.evaluator import DesignEvaluator, check_derivatives
from tympan.studies.design.elements.optimise import OptimiseResult, optimise, run_from
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.requirements import Requirements, held_words
from tympan.studies.design.sqp import DescentSettings, Linearisation, maximise
from tympan.studies.limits import limits
from tympan.studies.limits.loads import usual_masses

#: The limit and the voltage that a c belongs to.
Owner = tuple[str, float | None]

COARSE = Settings()
AXES = (vary("frame.semi_axes.0", 40e-3, 80e-3), vary("frame.semi_axes.1", 30e-3, 80e-3))
PROBLEM = """
specimen = "elliptical-large"
mass = "17.9 g"
voltage = "6.5 kV"
[vary]
"frame.semi_axes.0" = ["40 mm", "11 cm"]
"frame.semi_axes.1" = ["30 mm", "8 cm"]
"plate.radius" = ["6 mm", "20 mm"]
[limits]
breakdown_margin = 2.23
[[start]]
"plate.radius" = "18 mm"
"frame.semi_axes.0" = "50 mm"
"""


def read_space(file: Path) -> ElementSpace:
    return ElementSpace.of(Requirements.read(file))


def shipped() -> ElementSpace:
    return ElementSpace.of(Requirements.shipped())


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The problem of these tests."""
    path = tmp_path_factory.mktemp("optimise") / "ovals.toml"
    path.write_text(PROBLEM, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def result(file: Path) -> OptimiseResult:
    """Its optimum on a coarse mesh."""
    return optimise(read_space(file), COARSE)


def remainders(problem: ElementSpace, values: np.ndarray, direction: np.ndarray,
               steps: tuple[float, ...], settings: Settings = COARSE) -> np.ndarray:
    """What a first-order expansion of the stroke and of limits at each voltage misses, on one mesh
    moved, shape (steps, 1 + limits)."""
    evaluator = DesignEvaluator(problem, settings)
    x, direction = (values - problem.lows) / problem.widths, direction / problem.widths
    here = evaluator.at(x, renew=True)
    assert here is not None
    assert evaluator.last is not None
    owners, missed = evaluator.last.owners, []
    for step in steps:
        there = evaluator.at(x + step * direction)
        assert there is not None
        beyond = np.abs(there.limits - here.limits - step * here.limit_slopes @ direction)
        kinds = [max(beyond[[other == owner for other in owners]]) for owner in unique(owners)]
        missed.append([abs(there.value - here.value - step * here.slope @ direction) / here.value,
                       *kinds])
    return np.array(missed)


def unique(owners: Sequence[Owner]) -> list[Owner]:
    return list(dict.fromkeys(owners))


def test_stroke_and_every_limit_have_exact_slopes(file: Path) -> None:
    """Halving the step quarters what the expansion misses, with a plate off the centre and all
    kinds of limits."""
    more = 'pull_in_margin = 1.2\nmax_true_stress = "120 kPa"\nmax_field = "40 MV/m"\ngap = "15 mm"'
    text = PROBLEM.replace("[limits]", f"[limits]\n{more}")
    other = file.parent / "all.toml"
    other.write_text(text, encoding="utf-8")
    problem = read_space(other)
    moved = replace(problem.specimen, plate=Plate(Ellipse((12e-3, 9e-3)), (4e-3, 0.0)))
    problem = replace(problem, specimen=moved,
                      variables=(*AXES, vary("plate.semi_axes.1", 5e-3, 2e-2)))
    missed = remainders(problem, np.array([70e-3, 45e-3, 9e-3]), np.array([2e-3, -3e-3, 1e-3]),
                        (0.2, 0.1), Settings(MeshSettings().refined(1.2)))
    # Without voltage field and margin to breakdown bound nothing.
    assert (~missed.any(axis=0)).sum() == 2
    missed = missed[:, missed.any(axis=0)]
    # Stroke, margin to the end and gap; stress at two voltages, field and breakdown at one.
    assert missed.shape[1] == 7
    assert missed[1].min() > 1e-8
    np.testing.assert_allclose(missed[0] / missed[1], 4, rtol=0.25)


def known_outlines() -> dict[str, Outline]:
    """The examples of all registered outlines."""
    examples = getattr(outlines, "examples", None)
    return examples() if examples else {"circle": Circle(45e-3), "ellipse": Ellipse((60e-3, 45e-3))}


@pytest.mark.parametrize("shape", sorted(known_outlines()))
def test_every_number_of_an_outline_has_its_slope_or_is_refused(shape: str) -> None:
    from tympan.geometry.paths import at, numbers

    outline = known_outlines()[shape]
    specimen = replace(elliptical(60e-3), frame=outline)
    for name in numbers(outline, "frame")[:4]:
        value = float(at(specimen, name.split(".")))
        variable = vary(name, value - 0.1 * abs(value) - 1e-9, value + 0.1 * abs(value) + 1e-9)
        problem = element_space(specimen, 17.9e-3, 4e3, (variable,))
        refused = ""
        try:
            check_derivatives(problem, COARSE)
        except InputError as error:
            refused = str(error)
        if refused:
            assert "no derivative" in refused
            continue
        missed = remainders(problem, np.array([value]), np.array([0.05 * value]), (0.4, 0.2))
        assert missed[0, 0] / missed[1, 0] == pytest.approx(4, rel=0.3) or missed[0, 0] < 1e-7


@dataclass(frozen=True)
class _Rounded(Circle):
    """A circle whose radius comes in whole millimetres, so that it has no derivative."""

    shape: ClassVar[str] = "rounded"

    def points(self, count: int) -> np.ndarray:
        return Circle(round(float(np.real(self.radius)), 3)).points(count)


def test_a_number_without_derivative_is_refused() -> None:
    specimen = replace(elliptical(60e-3), frame=_Rounded(45e-3))
    problem = element_space(specimen, 17.9e-3, 4e3,
                      (vary("frame.radius", 4e-2, 5e-2),))
    with pytest.raises(InputError, match="no derivative"):
        check_derivatives(problem, COARSE)


def test_the_optimum_keeps_its_conditions(result: OptimiseResult) -> None:
    """Karush, Kuhn and Tucker's: balance of slopes, limits kept, multipliers positive, both starts
    the same."""
    [optimum] = result.record["optima"]
    assert not result.record["failed"]
    assert [run["status"] for run in optimum["starts"]] == ["optimum"] * 2
    assert optimum["kkt_residual"] < 1e-3
    limit = optimum["limits"]["breakdown_margin"]
    assert limit["active"]
    assert limit["multiplier"] > 0
    # The descent limits a norm; the largest nodal value differs from it a little.
    assert limit["value"] == pytest.approx(2.23, rel=5e-4)
    assert optimum["starts_apart_stroke"] < 0.01
    assert optimum["starts_apart_variables"] < 0.01
    of_best = result.trials["start"] == optimum["best_start"]
    assert of_best.sum() > 3


def test_the_optimum_holds_on_a_finer_mesh_and_beats_the_reference(result: OptimiseResult) -> None:
    [optimum] = result.record["optima"]
    finer = optimum["finer"]
    assert finer["stroke_m"] == pytest.approx(optimum["stroke_m"], rel=2e-3)
    assert finer["limited"]["breakdown_margin"] == pytest.approx(2.23, rel=2e-3)
    assert optimum["gain"] > 0.2
    assert finer["frame_area"] == pytest.approx(np.pi * 75e-3 * 45e-3, rel=1e-9)


def test_no_neighbour_is_better(result: OptimiseResult, file: Path) -> None:
    """Solved on their own, by the command's own function: neighbours of the same area and margin
    have less stroke."""
    [optimum] = result.record["optima"]
    problem = read_space(file)

    def stroke(specimen: Specimen) -> float:
        ends = [solve(replace(problem.case, specimen=specimen, voltage=voltage),
                      COARSE).deflection_m for voltage in (problem.case.voltage, 0.0)]
        assert ends[0] is not None
        assert ends[1] is not None
        return ends[0] - ends[1]

    a, b, radius = optimum["variables"].values()
    for ratio, grown in ((1.1, 1.0), (0.9, 1.0), (1.0, 1.05)):
        other = problem.built(np.array([a * ratio, b / ratio, radius * grown]))
        assert stroke(other) < optimum["stroke_m"] * (1 - 1e-4)


def test_the_maximiser_finds_a_known_vertex_and_its_multipliers() -> None:
    """Maximise x + 2 y under x² + y² ≤ 1/2 and y ≤ 0.6, where nothing is known beyond x = 0.45."""
    class Disc:
        asked = 0

        def at(self, x: np.ndarray, renew: bool = False) -> Linearisation | None:
            self.asked += 1
            if x[0] > 0.45:
                return None
            return Linearisation(x[0] + 2 * x[1], np.array([1.0, 2.0]),
                                 np.array([x @ x - 0.5, x[1] - 0.6]),
                                 np.array([2 * x, [0.0, 1.0]]))

        def held(self, x: np.ndarray) -> tuple[float, np.ndarray]:
            return 0.0, np.zeros(2)

    maximum = maximise(Disc(), np.array([0.1, 0.1]), DescentSettings(radius=0.3, widest=1.0))
    root = np.sqrt(0.5 - 0.36)
    assert maximum.status == "optimum"
    np.testing.assert_allclose(maximum.x, [root, 0.6], atol=3e-5)
    assert maximum.multipliers is not None
    np.testing.assert_allclose(maximum.multipliers.limits, [1 / (2 * root), 2 - 1.2 / (2 * root)],
                               rtol=1e-3)


def test_designs_without_equilibrium_are_backed_away_from() -> None:
    """Without limits the stroke grows to pull-in, beyond which there is nothing."""
    specimen = elliptical(60e-3)
    problem = element_space(specimen, 17.9e-3, 6.5e3,
                      (vary("plate.radius", 2e-3, 2e-2),))
    film = replace(specimen.membrane, material=replace(NEO_HOOKE, mu=(16e3,)))
    problem = replace(problem, specimen=replace(specimen, membrane=film))
    run = run_from(problem, "area", 0, np.array([12e-3]), COARSE,
                   DescentSettings(radius=0.3, iterations=10))
    assert run.descent.missing > 0
    assert run.best.stroke > 1.2 * run.trials[0].stroke
    assert any("thins" in trial.reason or "pulls in" in trial.reason for trial in run.trials)


def test_a_start_without_equilibrium_is_told() -> None:
    specimen = elliptical(60e-3)
    problem = element_space(specimen, 17.9e-3, 30e3, AXES[:1])
    record = optimise(problem, COARSE).record
    assert not record["optima"]
    assert record["failed"][0]["status"] == "no_start"
    assert "thins without bound" in record["failed"][0]["reason"]


def test_a_frame_out_of_reach_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = PROBLEM.split("[limits]",
                          maxsplit=1)[0].replace('"11 cm"', '"8 cm"').replace('"8 cm"]', '"76 mm"]')
    far = small.replace("[vary]",
                        'reference = "circular"\nhold = "area"\n[vary]').replace('["40 mm"',
                                                                                 '["70 mm"')
    (tmp_path / "far.toml").write_text(far, encoding="utf-8")
    assert main(["design", str(tmp_path / "far.toml"), "-o", str(tmp_path / "out"),
                 "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["optima"] == []
    assert "no design within the bounds has the area" in printed["failed"][0]["reason"]
    assert (tmp_path / "out" / "path.csv").exists()


@pytest.mark.study
def test_the_shipped_problem_with_the_film_s_end_as_the_active_limit() -> None:
    record = optimise(shipped()).record
    assert not record["failed"]
    for optimum in record["optima"]:
        assert [run["status"] for run in optimum["starts"]] == ["optimum"] * 2
        assert optimum["starts_apart_stroke"] < 0.01
        assert optimum["finer"]["stroke_m"] == pytest.approx(optimum["stroke_m"], rel=1e-3)
        assert optimum["finer"]["limited"]["pull_in_margin"] == pytest.approx(1.2, rel=1e-3)
        assert optimum["end"] == optimum["finer"]["end"] == "thinning"
        assert optimum["gain"] > 0.14


def test_length_and_area_of_an_ellipse() -> None:
    a, b = 75e-3, 45e-3
    assert perimeter(Ellipse((a, b))) == pytest.approx(4 * a * ellipe(1 - (b / a) ** 2), rel=1e-10)
    stepped = perimeter(Ellipse((a + 1e-40j, b))).imag / 1e-40
    ends = [4 * (a + d) * ellipe(1 - (b / (a + d)) ** 2) for d in (1e-6, -1e-6)]
    assert stepped == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-7)
    assert area(Ellipse((a, b + 1e-40j))).imag / 1e-40 == pytest.approx(np.pi * a, rel=1e-9)


@pytest.mark.parametrize(("old", "new", "match"), [
    ('"plate.radius" = ["6 mm"', '"plate.width" = ["6 mm"', "vary.plate.width.*must be one of"),
    ('["6 mm", "20 mm"]', '["20 mm", "6 mm"]', "vary.plate.radius.*larger upper"),
    ('["6 mm", "20 mm"]', '["11 mm", "20 mm"]', "specimen's own value, 0.01"),
    ('["6 mm", "20 mm"]', '["6 g", "20 mm"]', "vary.plate.radius"),
    ("breakdown_margin = 2.23", "pull_in_margin = 0.5", "limits.pull_in_margin.*from 1 to 10"),
    ("breakdown_margin = 2.23", "pull_in = 1.22", r"limits\.pull_in: .*did you mean"),
    ('"plate.radius" = "18 mm"', '"plate.radius" = "30 mm"', "start.0.plate.radius.*bounds"),
    ('voltage = "6.5 kV"', 'voltage = "6.5 kV"\nhold = "volume"', "hold.*area, perimeter"),
    ('specimen = "elliptical-large"', 'specimen = "round"',
     "specimen.*one of circular, elliptical-small"),
    ('voltage = "6.5 kV"', 'voltage = "6.5 kV"\nhald = "area"', "did you mean 'hold'"),
])
def test_bad_problems_are_refused(tmp_path: Path, old: str, new: str, match: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(PROBLEM.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=match):
        read_space(path)


def test_a_margin_to_breakdown_needs_a_strength(tmp_path: Path) -> None:
    from tympan.fem.toml_writer import specimen_to_toml

    film = replace(elliptical(60e-3).membrane, strength=None)
    (tmp_path / "weak.toml").write_text(specimen_to_toml(replace(elliptical(60e-3), membrane=film)),
                                        encoding="utf-8")
    (tmp_path / "bad.toml").write_text(PROBLEM.replace('"elliptical-large"', '"weak.toml"'),
                                       encoding="utf-8")
    with pytest.raises(InputError, match=r"breakdown_margin.*strength is known"):
        read_space(tmp_path / "bad.toml")


def test_the_command_stores_what_solve_reads(file: Path, tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    short = PROBLEM.split("[[start]]", maxsplit=1)[0].replace("2.23", "2").replace(
        '["6 mm", "20 mm"]', '["9 mm", "20 mm"]')
    (tmp_path / "short.toml").write_text(short, encoding="utf-8")
    command = ["design", str(tmp_path / "short.toml"), "-o", str(tmp_path / "out"), "--json",
               "--refine", "0.5"]
    assert main(command) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "out" / "optimum.json").read_text(encoding="utf-8"))
    (optimum,) = printed["optima"]
    assert optimum["at_bounds"] == ["plate.radius"]
    assert optimum["gain"] > 0.1
    specimen = load_specimen(tmp_path / "out" / "optimum.toml")
    assert specimen.plate.outline.semi_axes[0] == pytest.approx(9e-3, rel=1e-9)
    assert (tmp_path / "out" / "optimum.png").stat().st_size > 10_000
    rows = (tmp_path / "out" / "path.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("held,start,trial,accepted,frame.semi_axes.0_mm")
    assert len(rows) > 3


def test_what_is_left_out_is_the_specimen_s_own(tmp_path: Path) -> None:
    """The reference is the specimen itself, loads suit it, and no measure need be held."""
    file = tmp_path / "free.toml"
    file.write_text('specimen = "elliptical-small"\nhold = "nothing"\n[vary]\n'
                    '"plate.radius" = ["5 mm", "15 mm"]\n')
    problem = read_space(file)
    assert problem.reference == problem.specimen
    assert problem.requirements.mass == usual_masses(problem.specimen, Settings())[0]
    first = limits(Case(problem.specimen, mass=problem.requirements.mass), Settings()).limit
    assert first is not None
    assert 0.5 < problem.requirements.voltage / first.voltage_V < 0.7
    miss, slopes = problem.held_slopes("nothing", np.array([10e-3]))
    assert (miss, slopes.tolist()) == (0.0, [0.0])
    assert held_words("nothing") == "free"


def test_the_shipped_problem_reads() -> None:
    problem = shipped()
    assert problem.requirements.held == ("area", "perimeter")
    assert problem.reference.name == "elliptical-large"
    assert len(problem.starts) == 2
