"""Capacitance against deflection by the axisymmetric equations, its inverse, what moves it."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import tympan
from tests.oracles import axisymmetric
from tests.support.checks.json_schema import printed_record
from tests.support.specimens import NEO_HOOKE, circular, elliptical, reference_film, specimen_toml
from tympan.cli import main
from tympan.fem.membrane.biases import Constant
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Electrode
from tympan.studies.case import Case, Settings, solve
from tympan.studies.sense import SenseCase, SenseResult, sense

FINE = Settings(MeshSettings().refined(2.0))
COARSE = Settings(MeshSettings(order=2).refined(0.6))
EXACT = reference_film(NEO_HOOKE)
VOLTAGES = (0.0, 2e3, 4e3)


@pytest.fixture(scope="module")
def sensed() -> SenseResult:
    return sense(SenseCase(circular(NEO_HOOKE), voltages=VOLTAGES, to=8e-3, points=9), FINE)


def capacitance(place: float, voltage: float) -> float:
    """C = ε ∫ (λ₁λ₂)² dA₀ / T over the virgin film, by the equations."""
    film = axisymmetric.solve_deflection(EXACT, place, voltage)

    def density(radius: float) -> float:
        # Radii are those of the mounted film, of which a virgin area is a fifth.
        return float((film.lambda1(radius) * film.lambda2(radius)) ** 2 * 2 * np.pi * radius / 5)

    area = quad(density, 1e-2, 4.5e-2, epsrel=1e-11, limit=400)[0]
    return float(8.854e-12 * 4.7 * area / 1e-3)


def test_capacitance_is_that_of_the_equations(sensed: SenseResult) -> None:
    for curve in sensed.curves:
        for place, found in list(zip(curve.displacement_m, curve.capacitance_F,
                                     strict=True))[1::3]:
            exact = capacitance(place, curve.voltage_V)
            # By its excess over the flat film's, as that is what tells the deflection.
            assert found - curve.capacitance_F[0] == pytest.approx(
                exact - capacitance(1e-9, curve.voltage_V), rel=1e-4)
            assert found == pytest.approx(exact, rel=2e-4)


def test_capacitance_and_force_have_one_potential(sensed: SenseResult) -> None:
    """∂C/∂y at a voltage is −2 ∂F/∂U² at a deflection."""
    place, voltage, step = 5e-3, 3e3, 30.0
    first, last = (tympan.force(circular(NEO_HOOKE), from_="4 mm", to="5 mm", points=2,
                                voltage=[voltage + way * step], settings=FINE).curves[0]
                   for way in (-1, 1))
    slope = -2 * (last.force_N[-1] - first.force_N[-1]) / (4 * voltage * step)
    row = sense(SenseCase(circular(NEO_HOOKE), voltages=[voltage], start=4e-3, to=6e-3, points=5),
                FINE).curves[0]
    number = row.displacement_m.index(place)
    assert 1 / row.per_capacitance_m_per_F[number] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("film", [
    circular(NEO_HOOKE), elliptical(60e-3),
    replace(circular(NEO_HOOKE), electrode=Electrode(margin_frame=8e-3))],
    ids=["circle", "ellipse", "margin"])
def test_inverse_returns_the_deflection_within_its_error(film: tympan.Specimen) -> None:
    """At deflections and voltages that were not solved for it, over the whole range."""
    found = sense(SenseCase(film, voltages=VOLTAGES, to=6e-3, points=13), COARSE)
    assert found.inverse.error_m < 2e-6
    for voltage in (*VOLTAGES, 1e3, 3e3, 3.7e3):
        curve, = tympan.force(film, from_="0.13 mm", to="5.9 mm", points=12, voltage=[voltage],
                              settings=COARSE).curves
        back = found.sensed(curve.capacitance_F, voltage)
        assert np.abs(back - curve.displacement_m).max() <= max(2 * found.inverse.error_m, 1e-9)
    rows = found.rows
    off = np.abs(rows["by_polynomial_m"] - rows["displacement_m"])
    assert off.max() <= found.inverse.error_m
    assert found.table_error_m < 1e-5


@pytest.mark.parametrize("name", ["prestretch", "permittivity"])
def test_derivatives_are_those_of_films_solved_again(name: str) -> None:
    """A film of another prestretch or permittivity, at the same deflection, sensed by the first."""
    film, share = circular(NEO_HOOKE), 1e-4
    case = SenseCase(film, voltages=[3e3], start=3e-3, to=6e-3, points=7)
    curve, = sense(case, COARSE).curves
    found = getattr(curve, f"per_percent_{name}_m")
    ends = []
    for way in (-1, 1):
        factor = 1 + way * share
        membrane = film.membrane
        changes = {
            "permittivity": {"relative_permittivity": factor * membrane.relative_permittivity},
            "prestretch": {"prestretch": tuple(factor * each for each in membrane.prestretch)}}
        other = replace(membrane, **changes[name])
        ends.append(np.array(tympan.force(
            replace(film, membrane=other), from_="3 mm", to="6 mm", points=7, voltage=[3e3],
            settings=COARSE).curves[0].capacitance_F))
    by_share = (ends[1] - ends[0]) / (2 * share)
    moved = 0.01 * by_share * np.array(curve.per_capacitance_m_per_F)
    assert found == pytest.approx(moved, rel=1e-5)
    slope = np.gradient(curve.capacitance_F, curve.displacement_m, edge_order=2)
    assert 1 / np.array(curve.per_capacitance_m_per_F) == pytest.approx(slope, rel=2e-3)


def test_a_flat_film_s_capacitance_tells_nothing(sensed: SenseResult) -> None:
    for curve in sensed.curves:
        assert curve.per_capacitance_m_per_F[0] is None
        assert curve.per_percent_permittivity_m[0] is None
        assert None not in curve.per_capacitance_m_per_F[1:]


def test_states_are_those_of_solve() -> None:
    film, rig = circular(NEO_HOOKE), Rig(amplifier_gain=0.02)
    found = sense(SenseCase(film, voltages=[0.0, 3e3], masses=[0.01, 0.02], points=5, rig=rig),
                  COARSE)
    assert [(state.mass_kg, state.voltage_V) for state in found.states] == [
        (0.01, 0.0), (0.01, 3e3), (0.02, 0.0), (0.02, 3e3)]
    for state in found.states:
        there = solve(Case(film, mass=state.mass_kg, voltage=state.voltage_V, rig=rig), COARSE)
        assert state.displacement_m == pytest.approx(there.deflection_m, rel=1e-6)
        assert state.capacitance_F == pytest.approx(there.capacitance_F, rel=1e-9)
        assert state.sensed_m == pytest.approx(state.displacement_m, abs=2e-6)
    reach = max(state.displacement_m for state in found.states)
    assert found.curves[0].displacement_m[-1] == pytest.approx(1.1 * reach)


def test_where_the_capacitance_falls_nothing_is_told() -> None:
    """Above the flat film a plate that goes down flattens it first."""
    found = sense(SenseCase(circular(NEO_HOOKE), start=-2e-3, to=4e-3, points=13), COARSE)
    assert found.curves[0].displacement_m[0] == pytest.approx(0, abs=1e-12)
    assert any("below that" in words for words in found.warnings)
    with pytest.raises(tympan.InputError, match="rises with the deflection"):
        sense(SenseCase(circular(NEO_HOOKE), start=-4e-3, to=-2e-3, points=13), COARSE)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_compiled_polynomial_is_ours(sensed: SenseResult, tmp_path: Path) -> None:
    sensed.save(tmp_path)
    source, library = tmp_path / "circle-sense.c", tmp_path / "sense.so"
    subprocess.run([str(shutil.which("cc")), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic",
                    "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True)
    function = ctypes.CDLL(str(library)).circle_sensed_deflection
    function.restype, function.argtypes = ctypes.c_double, (ctypes.c_double, ctypes.c_double)
    rows = sensed.rows
    loads = zip(rows["capacitance_F"], rows["voltage_V"], strict=True)
    in_c = [function(*each) for each in loads]
    assert in_c == pytest.approx(rows["by_polynomial_m"], rel=1e-9, abs=1e-12)
    assert in_c[1] == pytest.approx(rows["displacement_m"][1], abs=sensed.inverse.error_m + 1e-12)
    assert np.isfinite(in_c).all()
    head = source.read_text(encoding="utf-8").partition("#include")[0]
    for curve in sensed.curves:
        first, *_, last = curve.capacitance_F
        read = np.linspace(0.9 * first, 2 * last - first, 41)
        for voltage in (curve.voltage_V, 0.9 * curve.voltage_V, 1.001 * max(VOLTAGES)):
            ours = sensed.sensed(read, voltage)
            assert [function(each, voltage) for each in read] == pytest.approx(
                ours, rel=1e-9, abs=1e-12, nan_ok=True)
            within = voltage <= max(VOLTAGES)
            assert np.isnan(ours[read > 1.001 * last]).all()
            assert np.isfinite(ours[read <= 0.999 * last]).all() == within
            assert (ours[read < 0.99 * first] == sensed.inverse.start_m).all() == within
        assert f" * {curve.voltage_V:g} V: up to {1e12 * last:.6g} pF\n" in head
    assert np.isnan(function(np.nan, 0.0))
    assert np.isnan(sensed.sensed(np.nan, 0.0))


def test_below_the_lowest_voltage_nothing_is_told() -> None:
    """And a load beyond the table has no sensed deflection."""
    found = sense(SenseCase(circular(NEO_HOOKE), voltages=[2e3, 3e3], masses=[0.02], to=1e-3,
                            points=5), COARSE)
    assert np.isnan(found.sensed(found.curves[0].capacitance_F[2], [0.0, 1.9e3, 3.1e3])).all()
    assert np.isfinite(found.sensed(found.curves[0].capacitance_F[2], [2e3, 2.5e3, 3e3])).all()
    assert [state.displacement_m > 1e-3 for state in found.states] == [True, True]
    assert [state.sensed_m for state in found.states] == [None, None]


def test_both_doors_answer_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    folder = tmp_path / "out"
    assert main(["sense", str(tmp_path / "oval.toml"), "--mass", "20 g", "--voltage", "0 kV, 3 kV",
                 "--points", "5", "--json", "-o", str(folder)]) == 0
    printed = printed_record(capsys.readouterr().out)
    result = tympan.sense(tympan.load(tmp_path / "oval.toml"), mass=["20 g"], points=5,
                          voltage=["0 kV", "3 kV"])
    ours = json.loads(json.dumps(result.json()))
    assert printed | {"wall_s": 0} == ours | {"wall_s": 0}
    assert SenseResult.load(folder).inverse == result.inverse
    assert len(result.to_pandas()) == 10
    result.plot(tmp_path / "sense.png")
    for wrong, words in ((["--points", "4"], "--points"), (["--to", "-1 mm"], "to")):
        assert main(["sense", str(tmp_path / "oval.toml"), *wrong]) == 2
        assert words in capsys.readouterr().err


def test_a_plate_that_rests_above_is_sensed_by_its_mirror_image() -> None:
    """A pull of 0.3 N upwards under 10 g leaves what some 0.2 N leave below."""
    lifted = Rig(biases=(Constant(force=-0.3),))
    found = sense(SenseCase(circular(NEO_HOOKE), voltages=(0.0, 3e3), masses=(10e-3,), points=9,
                            rig=lifted), COARSE)
    assert all(state.displacement_m < 0 for state in found.states)
    for state in found.states:
        assert state.sensed_m == pytest.approx(state.displacement_m, abs=2e-6)
    assert any("does not tell on which side" in warning for warning in found.warnings)
