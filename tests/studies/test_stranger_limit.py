"""A limit state that a test alone registers is met, stored and printed as the program's own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from tests.oracles import axisymmetric
from tests.support.specimens import ROOT5, ROUND, circular, specimen_toml
from tests.support.tolerances import STILL
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.fem.results.limit_states import LIMIT_STATES, BranchPoint, LimitState, least
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.reports.schema import class_keys
from tympan.studies.case import Case, CaseResult, Settings
from tympan.studies.force import ForceCase, force
from tympan.studies.force.result import ForceResult
from tympan.studies.limits import LimitsResult, limits, solve_within
from tympan.studies.limits.curve import CurveResult, curve
from tympan.studies.limits.voltages import first_limit
from tympan.studies.parallel import serial
from tympan.studies.path import PathResult, path
from tympan.studies.sweep.asked import QUESTIONS
from tympan.studies.sweep.plan import read_sweep
from tympan.studies.sweep.run import run_sweep
from tympan.studies.tolerance.given import (
    Scatter,
    causes,
)
from tympan.studies.tolerance.tolerance import DrawnFilms, ToleranceCase

SOFT, MASS = circular(NeoHooke(15e3)), 17.9e-3
SOFT_TOML = specimen_toml("soft", ROUND, 'material = { law = "neo_hooke", mu = "15 kPa" }', ROOT5)
ORACLE = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
COARSE = Settings(MeshSettings().refined(0.7))
#: Largest stretch that the film may reach.
LARGEST = 2.5


def left(point: BranchPoint) -> np.ndarray:
    """What the stretch lacks of the largest one."""
    return LARGEST - point.fields.stretch_1


#: Electric field that another limit forbids [V/m].
HIGH = 5e6


def weak(point: BranchPoint) -> np.ndarray:
    """What the field lacks of the highest one."""
    return HIGH - point.fields.electric_field


@pytest.fixture(autouse=True)
def stranger() -> Iterator[LimitState]:
    state = LimitState("stranger", "stranger", "first stretch of 2.5", left, left,
                       (least(left),), "*", strained=True)
    LIMIT_STATES.register(state)
    yield state
    del LIMIT_STATES["stranger"]


def exact_voltage() -> float:
    """Voltage at which the film is stretched so far at its plate, by the equations."""
    def missing(voltage: float) -> float:
        film = axisymmetric.solve_load(ORACLE, MASS * 9.80665, voltage)
        return float(film.lambda1(ORACLE.inner)) - LARGEST

    return float(brentq(missing, 5e3, 6.5e3, xtol=0.1))


def test_it_is_met_as_the_voltage_rises_and_read_back(tmp_path: Path) -> None:
    found = LimitsResult.of(Case(SOFT, mass=MASS), COARSE)
    met = found.limits.stranger
    assert met is not None
    assert abs(met.voltage_V / exact_voltage() - 1) < met.spread < 0.03
    assert met in found.limits.reached
    record = found.json()
    assert record["stranger"]["voltage_V"] == met.voltage_V
    found.save(tmp_path)
    result = solve_within(Case(SOFT, mass=MASS, voltage=met.voltage_V + 1), COARSE)
    assert result.limits == found.limits
    assert result.limit == met
    result.save(tmp_path)
    assert CaseResult.load(tmp_path, SOFT.name).limits == result.limits
    keys = {key.path: key for key in class_keys(CaseResult)}
    assert keys["limits.stranger"].meaning == "first stretch of 2.5"
    assert '"stranger"' in keys["limits.first"].kind


def test_paths_and_force_curves_pass_it_at_the_same_state(tmp_path: Path) -> None:
    met = limits(Case(SOFT, mass=MASS), COARSE).stranger
    assert met is not None
    branch = path(Case(SOFT, mass=MASS), COARSE, "voltage")
    event, = (each for each in branch.events if each.what == "stranger")
    assert event.value == pytest.approx(met.voltage_V, rel=1e-7)  # found from other steps
    assert event.station.max_stretch == pytest.approx(LARGEST, abs=1e-4)
    branch.save(tmp_path)
    assert PathResult.load(tmp_path).events == branch.events
    there = event.station.deflection_m
    pulled = force(ForceCase(SOFT, voltages=(met.voltage_V,), start=there - 3e-3, to=there + 3e-3,
                             points=7), COARSE)
    passed, = (each for each in pulled.curves[0].limits if each.kind == "stranger")
    assert passed.displacement_m == pytest.approx(there, rel=1e-5)
    assert passed.force_N == pytest.approx(MASS * 9.80665, rel=1e-5)
    pulled.save(tmp_path)
    assert ForceResult.load(tmp_path).curves[0].limits == pulled.curves[0].limits


@pytest.mark.parametrize("prestretch", [2.0, 2.6])
def test_flat_films_that_no_voltage_moves_have_it_where_they_are(
        prestretch: float) -> None:
    """Without plate, or with a fixed one: beyond the stretch already when mounted, or never. A
    limit of the field is reached where the field of a flat film is that high."""
    field = LimitState("high_field", "high-field", "field of 5 MV/m", weak, weak, (least(weak),),
                       "P")
    LIMIT_STATES.register(field)
    try:
        film = replace(SOFT, membrane=replace(SOFT.membrane, prestretch=(prestretch, prestretch)))
        for case in (Case(replace(film, plate=None)), Case(film, mass=MASS,
                                                           rig=Rig(guide="fixed"))):
            found = limits(case, COARSE)
            met = found.by_kind.get("stranger")
            assert (None if met is None else met.voltage_V) == (0.0 if prestretch > 2.5 else None)
            assert found.first == ("stranger" if prestretch > 2.5 else "high_field")
            thickness = 1e-3 / prestretch**2
            assert found.high_field.voltage_V == pytest.approx(HIGH * thickness, rel=1e-6)
    finally:
        del LIMIT_STATES["high_field"]


def test_curves_are_read_back_beyond_it(tmp_path: Path) -> None:
    drawn = curve(SOFT, [MASS], COARSE)
    assert drawn.curves[0].limits.stranger is not None
    drawn.save(tmp_path)
    again = CurveResult.load(tmp_path, SOFT.name)
    assert again.curves[0].limits == drawn.curves[0].limits
    assert "stranger" in set(again.table["beyond"])


def test_reduced_films_meet_it_first_too() -> None:
    """A family of films of one scatter, each against finite elements."""
    given = replace(STILL, stiffness=Scatter(film=0.1))
    case = ToleranceCase(SOFT, films=200, tolerances=given)
    drawn = DrawnFilms.of(case, causes(SOFT, given)[0], MASS, 4e3, COARSE)
    found = drawn.limits()
    assert found.record().kinds == {"stranger": 1.0}
    member = drawn.family.box.member(drawn.films.rows[0])
    first = first_limit(Case(member, mass=MASS), COARSE)
    assert first is not None
    assert first.kind == "stranger"
    assert found.voltage[0] == pytest.approx(first.voltage_V, rel=3e-3)


@pytest.mark.parametrize("command", ["limits", "path", "force"])
def test_it_is_printed_by_its_label(command: str, tmp_path: Path,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    specimen = tmp_path / "soft.toml"
    specimen.write_text(SOFT_TOML)
    more = {"limits": ["--mass", "17.9 g"], "path": ["--mass", "17.9 g", "--along", "voltage"],
            "force": ["--voltage", "4 kV", "--to", "20 mm"]}[command]
    words = [command, str(specimen), "--refine", "0.5", *more]
    assert main(words) == 0
    assert "stranger" in capsys.readouterr().out
    assert main([*words, "--json"]) == 0
    assert '"stranger"' in json.dumps(json.loads(capsys.readouterr().out))


def test_a_sweep_that_asks_for_limits_has_its_columns(tmp_path: Path) -> None:
    """The columns are those of all limit states, also of one that is registered later."""
    coarsest = Settings(MeshSettings().refined(0.4))
    met = limits(Case(SOFT, mass=MASS), coarsest).stranger
    assert met is not None
    (tmp_path / "soft.toml").write_text(SOFT_TOML, encoding="utf-8")
    (tmp_path / "SWEEP.toml").write_text(
        'specimen = "soft.toml"\nmass = "17.9 g"\nvoltage = "2 kV"\nask = ["limits"]\n',
        encoding="utf-8")
    run_sweep(read_sweep(tmp_path / "SWEEP.toml", coarsest), tmp_path / "out", serial)
    row = pd.read_csv(tmp_path / "out" / "sweep.csv").iloc[0]
    assert row["stranger_V"] == pytest.approx(met.voltage_V, rel=1e-9)
    assert row["stranger_spread"] == pytest.approx(met.spread, rel=1e-6)
    assert QUESTIONS["limits"].meaning_of("stranger_V") == "nominal voltage of stranger"
