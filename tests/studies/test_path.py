"""The branch command: limit points, lost tension, bias mechanisms and files, against the
axisymmetric equations."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.oracles import axisymmetric
from tests.oracles.unstable import branch_voltage, slack_voltage
from tests.support.checks.json_schema import printed_record
from tests.support.specimens import ROOT5, ROUND, circular, elliptical, specimen_toml
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.breakdown import ConstantStrength
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.biases import Magnet
from tympan.fem.rig import Rig
from tympan.studies.case import Case, Settings
from tympan.studies.limits import limits
from tympan.studies.path import PathResult, path

G = 9.80665
SOFT = circular(NeoHooke(15e3))
ORACLE = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
FORCE = 17.9e-3 * G
SOFT_TOML = specimen_toml("soft", ROUND, 'material = { law = "neo_hooke", mu = "15 kPa" }', ROOT5)


@pytest.fixture(scope="module")
def voltage_branch() -> PathResult:
    """Followed beyond where the film thins, as the equations follow a film that cannot wrinkle."""
    return path(Case(SOFT, mass=17.9e-3, voltage=0.0), Settings(), "voltage", beyond=True)


def event(result: PathResult, what: str):  # type: ignore[no-untyped-def]
    entry, = (item for item in result.events if item.what == what)
    return entry


def test_pull_in_and_loss_of_tension_are_where_the_equations_have_them(voltage_branch) -> None:
    assert event(voltage_branch,
                 "pull_in").value == pytest.approx(axisymmetric.pull_in_voltage(ORACLE, FORCE),
                                                 rel=2e-5)
    # Stress at the rim is less exact than force: 2e-4 of it.
    assert event(voltage_branch,
                 "tension").value == pytest.approx(slack_voltage(ORACLE, FORCE, 6800.0),
                                                        rel=5e-4)


def test_stations_beyond_pull_in_are_the_unstable_branch(voltage_branch) -> None:
    limit = event(voltage_branch, "pull_in").station.deflection_m
    beyond = [station for station in voltage_branch.stations if station.deflection_m > limit
              * 1.005]
    assert len(beyond) >= 4
    for station in beyond:
        assert not station.stable
        assert not station.tense
        assert station.voltage_V == pytest.approx(branch_voltage(ORACLE, FORCE,
                                                                 station.deflection_m), rel=1e-3)
    before = [station for station in voltage_branch.stations if station.deflection_m < limit
              * 0.995]
    assert all(station.stable for station in before)
    assert voltage_branch.warnings[0].startswith("followed to")


@pytest.mark.parametrize("along", ["voltage", "charge"])
def test_a_path_ends_where_the_film_thins_unless_it_is_asked_what_lies_beyond(
        voltage_branch, along) -> None:
    """Up to there the two are the same; a film kept from wrinkling is not what the film does."""
    ends = path(Case(SOFT, mass=17.9e-3, voltage=0.0), Settings(), along)
    assert [each.what for each in ends.events] == ["tension", "instability"]
    gone = ends.events[-1].station
    assert ends.stations[-1] == gone
    assert gone.voltage_V == pytest.approx(event(voltage_branch, "instability").station.voltage_V,
                                           rel=1e-6)
    assert all(station.stable for station in ends.stations[:-1])
    assert ends.warnings[0].endswith('"beyond" follows it on as one kept from wrinkling')


def test_voltage_and_charge_follow_the_same_branch(voltage_branch) -> None:
    """Cutting off the source removes the limit point: along the charge the voltage passes its
    largest value."""
    charged = path(Case(SOFT, mass=17.9e-3, voltage=0.0), Settings(), "charge", beyond=True)
    assert [item.what for item in charged.events] == ["tension", "instability"]
    charges = [station.charge_C for station in charged.stations]
    assert charges == sorted(charges)
    voltages = [station.voltage_V for station in charged.stations]
    assert max(voltages) == pytest.approx(event(voltage_branch, "pull_in").value, rel=1e-3)
    assert voltages[-1] < 0.99 * max(voltages)


def test_charge_of_a_nearly_flat_film_is_a_plate_capacitor_s() -> None:
    """Q = ε₀ε_r A/t U with the mounted area and thickness."""
    light = path(Case(SOFT, mass=0.1e-3, voltage=100.0), Settings(), "voltage").stations[0]
    flat = 8.8541878128e-12 * 4.7 * np.pi * (45e-3**2 - 10e-3**2) * 5 / 1e-3
    assert light.charge_C == pytest.approx(flat * 100.0, rel=1e-3)


def test_magnet_makes_the_plate_snap_where_its_stiffness_is_the_film_s() -> None:
    """At the limit point the film's stiffness at that voltage, by the equations, equals the
    magnet's negative one."""
    magnet = Magnet(1.2, 12e-3, 6e-3)
    case = Case(SOFT, mass=5e-3, voltage=0.0, rig=Rig(biases=(magnet,)))
    result = path(case, Settings(), "voltage")
    limit = next(item for item in result.events if item.what in ("pull_in", "snap_through")).station
    heave, step = limit.deflection_m, 1e-5
    up, here, down = (axisymmetric.solve_deflection(ORACLE, heave + change, limit.voltage_V).force
                      for change in (step, 0.0, -step))
    _, slope, stiffness = magnet.derivatives(heave)
    assert here + slope == pytest.approx(5e-3 * G, rel=1e-4)
    assert (up - down) / (2 * step) == pytest.approx(-stiffness, rel=1e-3)
    assert result.warnings == ("followed until the voltage fell back to zero",)


def test_a_path_ends_far_beyond_the_film_s_strength() -> None:
    """Three times its strength no film bears; what comes then is asked for by ``beyond``."""
    weak = replace(SOFT, membrane=replace(SOFT.membrane, strength=ConstantStrength(8e6)))
    case = Case(weak, mass=5e-3, voltage=0.0)
    near, far = (path(case, Settings(), "voltage", beyond=beyond) for beyond in (False, True))
    assert near.warnings[0].startswith("followed until the electric field was 3")
    assert [each.what for each in near.events] == ["breakdown"]
    assert {"breakdown", "tension"} < {each.what for each in far.events}
    assert event(near, "breakdown").value == pytest.approx(event(far, "breakdown").value)
    assert near.stations[-1].values["breakdown_share"] > 3
    assert near.stations[-2].values["breakdown_share"] < 3
    listed = limits(case, Settings())
    assert listed.reached == (listed.breakdown,)
    assert limits(case, Settings(), beyond=True).tension is not None


def test_a_flat_film_that_no_voltage_moves_has_its_limits_on_its_path() -> None:
    """Tension of a flat film is lost at the stretch's stress, whatever its outline."""
    held = Case(elliptical(60e-3), mass=5e-3, voltage=1e3, rig=Rig(guide="fixed"))
    result = path(held, Settings(), "voltage")
    first = result.stations[0]
    assert first.voltage_V == 1e3
    assert first.deflection_m == 0.0
    assert result.warnings[0].startswith("no pull-in was found: the film stays flat")
    found = limits(held, Settings())
    assert [(each.what, each.value) for each in result.events] == [
        (limit.kind, pytest.approx(limit.voltage_V)) for limit in found.reached]
    film = held.specimen.membrane
    stretch = film.prestretch[0]
    _, slope, *_ = film.material.derivatives(stretch, stretch)
    field = np.sqrt(stretch * slope / (8.8541878128e-12 * film.relative_permittivity))
    assert event(result, "tension").value == pytest.approx(field * film.thickness / stretch**2,
                                                           rel=1e-5)


def test_growing_mass_is_read_as_the_rig_weighs_it() -> None:
    rig = Rig(unaccounted_mass=2e-3, plate_pressure=50.0)
    result = path(Case(elliptical(60e-3), mass=5e-3, voltage=2000.0, rig=rig), Settings(), "mass")
    first, last = result.stations[0], result.stations[-1]
    area = np.pi * 10e-3**2
    assert first.force_N == pytest.approx(7e-3 * G + 50.0 * area, rel=1e-9)
    assert last.force_N > 10 * first.force_N
    assert {station.voltage_V for station in result.stations} == {2000.0}


def test_a_start_without_equilibrium_is_refused() -> None:
    with pytest.raises(InputError, match="thins without bound"):
        path(Case(SOFT, mass=17.9e-3, voltage=9000.0), Settings(), "voltage")


def test_files_and_json(tmp_path: Path, capsys) -> None:
    specimen = tmp_path / "soft.toml"
    specimen.write_text(SOFT_TOML)
    out = tmp_path / "out"
    assert main(["path", str(specimen), "--mass", "17.9 g", "--beyond", "-o", str(out),
                 "--json"]) == 0
    printed = printed_record(capsys.readouterr().out)
    assert json.loads((out / "soft-path.json").read_text()) == printed
    rows = list(csv.DictReader((out / "soft-path.csv").read_text().splitlines()))
    assert len(rows) == len(printed["stations"])
    assert (out / "soft-path.png").stat().st_size > 10_000
    mesh = meshio.read(out / "soft-path-limit-1.vtu")
    mode = mesh.point_data["critical_mode"]
    # The critical mode pushes plate and film along the load most; it moves nothing at the frame.
    assert -mode[:, 2].min() > 1.5 * np.abs(mode[:, :2]).max()
    at_frame = np.hypot(*(mesh.points - mesh.point_data["displacement"])[:,
                                                                         :2].T) > 45e-3 * (1 - 1e-9)
    assert np.abs(mode[at_frame]).max() < 1e-12 * np.abs(mode).max()


def test_the_load_rests_along_the_critical_mode_while_the_plate_sinks(voltage_branch) -> None:
    result = voltage_branch
    film, = result.limits
    rim = np.hypot(*film.mounted[:, :2].T) < 10.01e-3
    assert film.values["critical_mode"][rim, 2].min() > 0
    limit, = (event for event in result.events if event.what == "pull_in")
    highest = max(station.voltage_V for station in result.stations)
    assert limit.value == pytest.approx(highest, rel=1e-9)


def test_fields_of_every_station_are_a_series(tmp_path: Path) -> None:
    import pyvista as pv

    (tmp_path / "soft.toml").write_text(SOFT_TOML, encoding="utf-8")
    words = ["path", str(tmp_path / "soft.toml"), "--mass", "17.9 g", "--refine", "0.5"]
    assert main([*words, "--fields", "-o", str(tmp_path / "out")]) == 0
    result = PathResult.load(tmp_path / "out")
    series = pv.PVDReader(tmp_path / "out" / "soft-path.pvd")
    assert series.time_values == list(range(len(result.stations)))
    assert len(result.films) == len(result.stations) > 8
    for number, (station, film) in enumerate(zip(result.stations, result.films, strict=True)):
        series.set_active_time_value(number)
        assert series.read()[0].points == pytest.approx(film.turned_over.points)
        depth = film.values["displacement"][:, 2]
        assert depth.max() == pytest.approx(station.deflection_m, rel=1e-9)
        assert film.values["stretch_1"].max() == pytest.approx(station.max_stretch, rel=2e-2)
        voltage = film.values["electric_field"] * film.values["thickness"]
        assert voltage == pytest.approx(station.voltage_V, rel=1e-6, abs=1e-3)
    assert main([*words, "-o", str(tmp_path / "out")]) == 0  # and none of the earlier run stays
    assert not list((tmp_path / "out").glob("soft-path-0*.vtu"))
    assert not (tmp_path / "out" / "soft-path.pvd").exists()


def test_fields_of_a_loop_are_a_series_in_time(tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    import pyvista as pv

    (tmp_path / "soft.toml").write_text(SOFT_TOML, encoding="utf-8")
    words = ["path", str(tmp_path / "soft.toml"), "--mass", "17.9 g", "--refine", "0.5", "--rate",
             "1 kV/s", "--turn", "3 kV", "--fields"]
    assert main([*words, "-o", str(tmp_path / "out")]) == 0
    series = pv.PVDReader(tmp_path / "out" / "soft.pvd")
    assert series.time_values == pytest.approx(np.linspace(0, 6, 25))
    depths = []
    for time in series.time_values:
        series.set_active_time_value(time)
        depths.append(-series.read()[0].points[:, 2].min())
    assert np.argmax(depths) == 12
    assert depths[0] == pytest.approx(depths[-1], rel=1e-6)
    assert main(words) == 2
    assert "-o" in capsys.readouterr().err
