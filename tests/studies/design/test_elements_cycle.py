"""Limits of an optimum over a cycle of the voltage: solved anew on a grid of voltages and a finer
mesh; a limit that is nearest between the ends; what the output says of it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.support.elements import asked, element_space
from tests.support.specimens import elliptical
from tympan.cli import main
from tympan.fem.film.laws import Gent
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, solve
from tympan.studies.design.elements.optimise import OptimiseResult, optimise
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.limits.cycle import cycle_voltages, kept_limit
from tympan.studies.design.limits.kinds import DesignLimit
from tympan.studies.design.limits.state import DesignState, Evaluation, MeshMemory
from tympan.studies.design.requirements import Requirements

#: A film whose stress without voltage exceeds that at the working voltage by a fifth.
SPECIMEN = """
name = "el"
[frame]
shape = "ellipse"
semi_axes = ["53.9 mm", "37.3 mm"]
[plate]
shape = "circle"
radius = "8.3 mm"
[membrane]
thickness = "0.83 mm"
prestretch = 2.03
relative_permittivity = 3.1
[membrane.material]
law = "gent"
mu = "31.7 kPa"
j_lim = 47.3
range = [0.5, 3.2]
"""
PROBLEM = """
name = "odd"
specimen = "el.toml"
mass = "31.3 g"
voltage = "7.9 kV"
hold = "perimeter"
[vary]
"frame.semi_axes.0" = ["38 mm", "66 mm"]
"frame.semi_axes.1" = ["29 mm", "60 mm"]
"plate.radius" = ["3.7 mm", "19 mm"]
[limits]
max_true_stress = "155 kPa"
gap = "12 mm"
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cycle")
    (folder / "el.toml").write_text(SPECIMEN, encoding="utf-8")
    (folder / "odd.toml").write_text(PROBLEM, encoding="utf-8")
    return folder / "odd.toml"


@pytest.fixture(scope="module")
def result(file: Path) -> OptimiseResult:
    return optimise(ElementSpace.of(Requirements.read(file)))


def test_the_optimum_keeps_its_limits_at_every_voltage(file: Path, result: OptimiseResult) -> None:
    """Its specimen by itself, each voltage alone, on a mesh of half the element size."""
    [optimum] = result.record["optima"]
    assert optimum["status"] == "optimum"
    [specimen] = result.specimens.values()
    finer = Settings(MeshSettings().refined(2))
    stresses = [solve(Case(specimen, mass="31.3 g", voltage=volts), finer).max_true_stress_Pa
                for volts in (0.0, 2e3, 4e3, 6e3, 7e3, 7.9e3)]
    assert max(stresses) == stresses[0] == pytest.approx(155e3, rel=1e-3)
    assert stresses[-1] < 0.95 * 155e3  # at the working voltage alone the limit would not bind
    limit = optimum["limits"]["max_true_stress"]
    assert limit["value"] == pytest.approx(stresses[0], rel=1e-3)
    assert limit["finer"] == pytest.approx(stresses[0], rel=1e-4)
    assert (limit["at_V"], limit["active"], limit["active_V"]) == (0.0, True, [0.0])
    assert limit["multiplier"] > 0
    assert optimum["finer"]["limited_at_V"] == {"max_true_stress": 0.0, "gap": None}


def test_a_limit_that_no_design_keeps_without_voltage_is_told(file: Path, tmp_path: Path,
                                                              capsys) -> None:
    """131 kPa is kept at 7.9 kV by a film that has 160 kPa without voltage."""
    (tmp_path / "el.toml").write_text(SPECIMEN, encoding="utf-8")
    other = tmp_path / "OPT2.toml"
    other.write_text(PROBLEM.replace("155 kPa", "131 kPa"), encoding="utf-8")
    assert main(["design", str(other), "-o", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "equal frame perimeter: infeasible" in printed
    assert "no design within the bounds was found that keeps all limits" in printed
    assert "kPa of 131 kPa, worst at 0 kV  active at 0 kV: " in printed
    # Each state has this warning, with other numbers.
    assert printed.count("is used outside its range") == 1
    stored = json.loads((tmp_path / "out" / "optimum.json").read_text())
    assert stored["optima"][0]["limits"]["max_true_stress"]["value"] > 140e3
    assert (tmp_path / "out" / "optimum.png").exists()


def states_of(problem: ElementSpace) -> list[DesignState]:
    """A design in its states, from none to the working voltage, with nothing to differentiate by.
    """
    from tympan.studies.case import build_model, voltage_ramp

    settings = Settings(MeshSettings(order=2).refined(0.6))
    given = problem.requirements
    model = build_model(problem.specimen, settings, given.rig.loading)
    ramp = voltage_ramp(model, given.mass, cycle_voltages(given.voltage, between=True),
                        given.rig, settings.path)
    ends = list(ramp)
    return [DesignState(case, model, outcome, {}, MeshMemory(), settings.path, ends[0][1].state)
            for case, outcome in ends]


@dataclass(frozen=True)
class Hump:
    """A load that is largest, and 0, at some voltage, and falls unevenly on both sides."""

    volts: float

    def load(self, state: DesignState) -> float:
        away = (state.case.voltage**2 - self.volts**2) / 4e3**2
        return -(away**2) * (1 + 0.3 * away)

    def evaluate(self, state: DesignState, bound: float) -> Evaluation:
        load = self.load(state)
        return Evaluation(load, np.array([load - bound]), np.zeros((1, 0)))


@pytest.mark.parametrize(("volts", "between"), [
    (0.0, False), (2.1e3, True), (3e3, True), (3.7e3, True), (6e3, False)])
def test_a_limit_nearest_between_the_ends_is_found_there(volts: float, between: bool) -> None:
    specimen = elliptical(60e-3, Gent(25e3, 60.0))
    problem = element_space(specimen, 17.9e-3, 4e3, ())
    hump = Hump(volts)
    kept = kept_limit(DesignLimit(hump.evaluate, load=hump.load), states_of(problem), 0.1)
    ends = [hump.load(state) for state in states_of(problem)[::4]]
    assert kept.between == between
    assert kept.voltages[:2] == (0.0, 4e3)
    assert kept.c[:2] == pytest.approx(np.array(ends) - 0.1)
    if between:
        assert kept.at_V == pytest.approx(volts, rel=0.02)
        assert kept.value == pytest.approx(0.0, abs=1e-4)  # by samples alone up to 0.016 less
    else:
        assert kept.value == max(ends)
    assert kept.c[2] == pytest.approx(kept.value - 0.1)


def test_what_vanishes_without_voltage_is_kept_there(file: Path) -> None:
    """A field, and a margin to breakdown, bound nothing where there is no voltage."""
    problem = asked(ElementSpace.of(Requirements.read(file)), bounds={"max_field": 40e6})
    from tympan.studies.design.elements.evaluator import DesignEvaluator

    evaluator = DesignEvaluator(problem, Settings(MeshSettings(order=2).refined(0.6)))
    x = (np.array(problem.starts[0]) - problem.lows) / problem.widths
    here = evaluator.at(x, renew=True)
    assert here is not None
    assert evaluator.last is not None
    field = evaluator.last.kept["max_field"]
    assert field.voltages == (0.0, 7.9e3, 7.9e3)
    assert field.c[0] == -1
    assert np.isfinite(here.limits).all()
    assert field.at_V == 7.9e3
