"""Force-displacement curves against the axisymmetric equations; loads against other searches."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import simpson
from scipy.optimize import brentq

import tympan
from tests.oracles import axisymmetric
from tests.oracles.laws import gent
from tests.support.specimens import NEO_HOOKE, circular, reference_film, specimen_toml
from tympan.cli import main
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.laws import Gent, NeoHooke, Ogden
from tympan.fem.membrane.biases import Magnet, Spring
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.state import FREEDOMS
from tympan.fem.rig import Rig
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.reports.figures.force import draw_force_curves
from tympan.studies.case import Case, Settings, build_model, solve
from tympan.studies.force import ForceCase, ForceResult
from tympan.studies.force import force as force_of
from tympan.studies.force.result import ForceCurve
from tympan.studies.limits import limits

STIFF = Ogden((30e3, 2e3), (1.3, 5.5))
#: Exact: material, displacement [mm], voltage [kV], force [N], elastic stress at the rim [kPa].
HELD = [
    (NEO_HOOKE, 5, 0, 0.51826859, 137.6593), (NEO_HOOKE, 5, 3, 0.47914090, 138.5683),
    (NEO_HOOKE, 15, 0, 1.55855384, 247.3867), (STIFF, 5, 0, 1.07485662, 289.2795),
    (STIFF, 15, 0, 4.01666125, 624.2382)]
FINE = Settings(MeshSettings().refined(4.0))
SOFT = Ogden((15e3,), (2.0,))
EXACT = reference_film(SOFT)


@pytest.mark.parametrize(("material", "place", "kilovolt", "expected", "stress"), HELD)
def test_force_and_stress_are_those_of_the_equations(material, place, kilovolt, expected,
                                                     stress) -> None:
    curve, = tympan.force(circular(material), to=f"{place} mm", voltage=[f"{kilovolt} kV"],
                          points=11, settings=FINE).curves
    assert curve.displacement_m[-1] == place * 1e-3
    assert curve.force_N[-1] == pytest.approx(expected, rel=1e-6)
    if not kilovolt:  # the largest true stress has no Maxwell part
        assert curve.max_true_stress_Pa[-1] == pytest.approx(stress * 1e3, rel=1e-4)


@pytest.fixture(scope="module")
def family() -> ForceResult:
    """At 7 kV the film carries no 17.9 g any more: that voltage is beyond its pull-in."""
    return force_of(ForceCase(circular(SOFT), voltages=(7e3, 0.0, 5e3, 6e3), to=12e-3, points=25),
                    Settings())


def test_a_family_of_curves_is_that_of_the_equations(family: ForceResult) -> None:
    assert [curve.voltage_V for curve in family.curves] == [0.0, 5e3, 6e3, 7e3]
    assert [len(curve.force_N) for curve in family.curves[:2]] == [25, 25]
    for curve in family.curves:
        for place, force, slope in list(zip(curve.displacement_m, curve.force_N,
                                            curve.stiffness_N_per_m, strict=True))[1:-1:3]:
            exact = axisymmetric.solve_deflection(EXACT, place, curve.voltage_V)
            assert force == pytest.approx(exact.force, rel=2e-6)
            assert slope == pytest.approx(exact.stiffness, rel=2e-4)


def test_a_curve_ends_where_the_film_does(family: ForceResult) -> None:
    """Where the equations lose hoop tension at the rim, a neo-Hookean film has no width."""
    def hoop(place: float, voltage: float) -> float:
        exact = axisymmetric.solve_deflection(EXACT, place, voltage)
        field = voltage / 1e-3 * exact.lambda1(10e-3) * exact.lambda2(10e-3)
        return float(exact.sigma2(10e-3) - EXACT.eps0 * 4.7 * field**2)

    for curve, most in zip(family.curves[2:], (13e-3, 8e-3), strict=True):
        assert curve.ended is not None
        assert curve.ended.kind == "instability"
        assert [limit.kind for limit in curve.limits] == ["tension", "instability"]
        exact = brentq(hoop, 1e-3, most, args=(curve.voltage_V,))
        assert curve.ended.displacement_m == pytest.approx(exact, rel=5e-3)
        assert curve.displacement_m[-1] == curve.ended.displacement_m
        there = axisymmetric.solve_deflection(EXACT, curve.ended.displacement_m, curve.voltage_V)
        assert curve.stiffness_N_per_m[-1] == pytest.approx(there.stiffness, rel=1e-3)
        assert np.hypot(curve.ended.x_m, curve.ended.y_m) == pytest.approx(10e-3)


def test_a_curve_goes_on_past_the_loss_of_tension() -> None:
    film = circular(Gent(20e3, 60.0), prestretch=(1.3, 1.3))
    exact = axisymmetric.Film(10e-3, 45e-3, 1e-3, 1.3, gent(20e3, 60.0), 4.7, relaxed=True)
    curve, = force_of(ForceCase(film, voltages=(9e3,), to=35e-3, points=36), Settings()).curves
    loose = curve.limits[0]
    assert loose.kind == "tension"
    beyond = [number for number, tense in enumerate(curve.tense[:-1]) if not tense]
    assert all(curve.displacement_m[number] > loose.displacement_m for number in beyond)
    for number in beyond[:4]:
        force = axisymmetric.shoot_deflection(exact, curve.displacement_m[number], 9e3).force
        assert curve.force_N[number] == pytest.approx(force, rel=1e-4)


def test_the_picture_has_the_blocked_force_between_the_outer_curves(family: ForceResult) -> None:
    axes = Figure().subplots()
    draw_force_curves(axes, family)
    bar, = (line for line in axes.lines if str(line.get_label()).startswith("blocked force"))
    place, forces = bar.get_data()
    assert place == pytest.approx([1e3 * family.blocked_displacement_m] * 2)
    assert forces[0] - forces[1] == pytest.approx(1e3 * family.blocked_force_N)


def test_the_blocked_force_is_the_fall_of_the_force_of_a_held_plate(family: ForceResult) -> None:
    ends = [family.curves[number] for number in (0, -1)]
    falls = [first - last for first, last in zip(*(curve.force_N for curve in ends), strict=False)]
    place = ends[0].displacement_m.index(family.blocked_displacement_m)
    assert family.blocked_force_N == falls[place] == max(falls[:len(ends[1].force_N) - 1])


@pytest.fixture(scope="module")
def loaded() -> ForceResult:
    return force_of(ForceCase(circular(SOFT), voltages=(0.0, 3e3, 5e3, 7e3), to=10e-3,
                              masses=(17.9e-3, 8e-3), rig=Rig(gravity=9.81)), Settings())


def test_a_load_line_crosses_where_the_load_is_in_equilibrium(loaded: ForceResult) -> None:
    for line in loaded.loads:
        for crossing in line.crossings:
            case = Case(circular(SOFT), mass=line.mass_kg, voltage=crossing.voltage_V,
                        rig=Rig(gravity=9.81))
            solved = solve(case, Settings())
            assert crossing.displacement_m == pytest.approx(solved.deflection_m, rel=1e-6)
            assert crossing.stable
            assert crossing.reached
    # 17.9 g is carried to 6.4 kV only.
    assert [crossing.voltage_V for crossing in loaded.loads[0].crossings] == [0.0, 3e3, 5e3]
    end = limits(Case(circular(SOFT), mass=17.9e-3, rig=Rig(gravity=9.81)), Settings()).end
    assert end is not None
    assert 5e3 < end.voltage_V < 7e3
    assert loaded.loads[0].stroke_m is loaded.stroke_m is None
    assert loaded.loads[1].stroke_m is not None


def test_work_is_the_area_in_the_picture(loaded: ForceResult) -> None:
    """The electrical energies are differences of states; curves alone give the same area."""
    line = loaded.loads[1]
    low, *_, high = (crossing.displacement_m for crossing in line.crossings)
    assert line.stroke_m == high - low
    assert line.work_J == pytest.approx(8e-3 * 9.81 * (high - low), rel=1e-12)
    first, last = (tympan.force(circular(SOFT), from_=low, to=high, voltage=[voltage],
                                points=21).curves[0] for voltage in (0.0, 7e3))
    area = simpson(np.array(first.force_N) - np.array(last.force_N), x=first.displacement_m)
    assert line.ideal_work_J == pytest.approx(area, rel=1e-6)
    assert line.electrical_in_J - line.electrical_out_J == pytest.approx(area, rel=1e-6)
    assert line.coupling == pytest.approx(area / line.electrical_in_J, rel=1e-6)
    assert 0 < line.efficiency < 1
    volume = np.pi * (45e-3**2 - 10e-3**2) * 1e-3 / 5
    assert line.work_J_per_m3 == pytest.approx(line.work_J / volume, rel=1e-6)
    assert line.work_J_per_kg is None  # no density was given


def test_electrical_energy_under_the_load_is_that_of_small_steps() -> None:
    """∫U dQ along equilibria under the load, by Simpson's rule over U."""
    film, mass = circular(SOFT, density=960.0), 8e-3
    result = force_of(ForceCase(film, voltages=(0.0, 6e3), to=8e-3, masses=(mass,)), Settings())
    line = result.loads[0]
    voltages = np.linspace(0.0, 6e3, 25)
    charge = []
    for voltage in voltages:
        capacitance = solve(Case(film, mass=mass, voltage=voltage), Settings()).capacitance_F
        charge.append(capacitance * voltage)
    spent = voltages[-1] * charge[-1] - simpson(charge, x=voltages)
    assert line.efficiency == pytest.approx(line.work_J / spent, rel=1e-5)
    assert line.work_J_per_kg == pytest.approx(line.work_J_per_m3 / 960.0)


def test_small_strokes_are_those_of_two_linear_springs() -> None:
    """A taut film under a light load: F = 2πN w/ln(b/a), and all areas are triangles."""
    voltages = (0.0, 4e3)
    film, exact = circular(NEO_HOOKE), reference_film(NEO_HOOKE)
    force = 1e-3 * 9.80665 * 0.02
    low, high = (force / exact.small_deflection_force(1.0, voltage) for voltage in voltages)
    result = force_of(ForceCase(film, voltages=voltages, to=2 * high, points=5,
                                masses=(0.02e-3,)), Settings())
    line = result.loads[0]
    assert [each.displacement_m for each in line.crossings] == pytest.approx([low, high], rel=1e-6)
    assert line.work_J == pytest.approx(force * (high - low), rel=1e-5)
    fall = force / low - force / high
    assert line.ideal_work_J == pytest.approx(fall * (high**2 - low**2) / 2, rel=1e-5)
    assert result.blocked_force_N == pytest.approx(fall * low, rel=1e-5)
    assert result.blocked_displacement_m == line.crossings[0].displacement_m


@pytest.mark.study(seconds=3)
def test_a_bias_makes_a_film_bistable() -> None:
    rig = Rig(biases=(Magnet(force=6.0, gap=12e-3, decay=3e-3), Spring(120.0, 4e-3)))
    case = ForceCase(circular(NEO_HOOKE), voltages=(0.0, 3e3), to=11.9e-3, rig=rig)
    line, = force_of(case, Settings()).loads
    assert line.load == "magnet and spring"
    for voltage in case.voltages:
        there = [each for each in line.crossings if each.voltage_V == voltage]
        assert [each.stable for each in there] == [True, False]
        assert [each.reached for each in there] == [True, False]
        solved = solve(Case(case.specimen, voltage=voltage, rig=rig), Settings())
        assert there[0].displacement_m == pytest.approx(solved.deflection_m, rel=1e-6)
        # The other one: the film's force is the pull of magnet and spring.
        unstable = there[1].displacement_m
        pull = -sum(bias.derivatives(unstable)[1] for bias in rig.biases)
        exact = axisymmetric.solve_deflection(reference_film(NEO_HOOKE), unstable, voltage).force
        assert exact == pytest.approx(pull, rel=1e-5)


def test_gas_and_an_offset_weight_act_in_the_curves_too() -> None:
    rig = Rig(gas_pressure=-30.0, weight_offset=(2e-3, 1e-3), biases=(Spring(20.0),))
    result = force_of(ForceCase(circular(NEO_HOOKE), voltages=(0.0, 2e3), to=6e-3, points=13,
                                masses=(10e-3,), rig=rig),
                      Settings(MeshSettings().refined(0.7)))
    for crossing in result.loads[0].crossings:
        solved = solve(Case(circular(NEO_HOOKE), mass=10e-3, voltage=crossing.voltage_V, rig=rig),
                       Settings(MeshSettings().refined(0.7)))
        assert crossing.displacement_m == pytest.approx(solved.deflection_m, rel=1e-6)
    assert result.curves[0].force_N[0] < 0  # the gas sucks: at 0 the tester holds the plate up


def test_a_film_pulled_up_is_that_pulled_down_in_the_mirror() -> None:
    curve, = force_of(ForceCase(circular(STIFF), voltages=(2e3,), start=-4e-3, to=4e-3, points=9,
                                rig=Rig(gravity=9.81)), Settings()).curves
    assert np.allclose(curve.force_N, -np.array(curve.force_N)[::-1], atol=1e-8)
    assert np.allclose(curve.stiffness_N_per_m, curve.stiffness_N_per_m[::-1], rtol=1e-6)


def test_what_is_saved_is_loaded_and_is_a_tester_s_file(loaded: ForceResult, tmp_path: Path
                                                       ) -> None:
    loaded.save(tmp_path)
    assert ForceResult.load(tmp_path) == loaded
    lines = (tmp_path / "circle-force.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("specimen,voltage_kV,displacement_mm,force_mN,")
    assert len(lines) == 1 + sum(len(curve.force_N) for curve in loaded.curves)
    table = tympan.Result(loaded).to_pandas()
    assert table["force_N"].to_list() == [force for curve in loaded.curves
                                          for force in curve.force_N]
    axes = tympan.Result(loaded).plot(str(tmp_path / "a.png"))
    assert axes.get_xlabel() == "displacement (mm)"
    assert axes.get_ylabel() == "force (mN)"


ROUND = specimen_toml("round", 'shape = "circle"\nradius = "4.5 cm"')


@pytest.mark.parametrize(("options", "said"), [
    (("--to", "80 mm"), "--to"), (("--to", "2 mm", "--from", "3 mm"), "--to"),
    (("--to", "2 mm", "--from", "-90 mm"), "--from"), (("--to", "2 kV"), "--to"),
    (("--to", "2 mm", "--voltage", "1 kV, 1 kV"), "--voltage"),
    (("--to", "2 mm", "--mass", "900 kg"), "--mass"),
    (("--to", "2 mm", "--voltage", ""), "--voltage"), (("--to", "inf mm"), "--to"),
    (("--to", "2 mm", "--rate", "0 mm/s"), "--rate"),
    (("--to", "2 mm", "--rate", "1 N"), "--rate")])
def test_what_cannot_be_is_one_message(options, said, tmp_path: Path, capsys) -> None:
    file = tmp_path / "round.toml"
    file.write_text(ROUND, encoding="utf-8")
    assert main(["force", str(file), *options]) == 2
    printed = capsys.readouterr()
    assert said in printed.err
    assert len(printed.err.strip().splitlines()) == 1
    assert not printed.out


def test_json_has_what_was_agreed(tmp_path: Path, capsys) -> None:
    file = tmp_path / "round.toml"
    file.write_text(ROUND, encoding="utf-8")
    assert main(["force", str(file), "--voltage", "0 kV, 3 kV", "--from", "1 mm", "--to", "6 mm",
                 "--mass", "20 g", "--refine", "0.5", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert {"specimen", "curves", "loads", "stroke_m", "work_J", "blocked_force_N"} <= set(printed)
    for curve in printed["curves"]:
        assert (curve["displacement_m"][0], curve["displacement_m"][-1]) == (1e-3, 6e-3)
        assert len(curve["stable"]) == len(curve["force_N"]) == 61
        assert curve["ended"] is None
    assert printed["loads"][0]["load"] == "20 g"
    assert printed["stroke_m"] > 0


def test_a_plate_that_is_fixed_and_a_film_without_plate_are_refused() -> None:
    with pytest.raises(tympan.InputError, match="guide"):
        tympan.force(circular(), to=1e-3, rig=Rig(guide="fixed"))
    with pytest.raises(tympan.InputError, match="plate"):
        tympan.force(replace(circular(), plate=None), to=1e-3)


def test_a_slack_film_begins_where_it_is_taut() -> None:
    slack = circular(NEO_HOOKE, prestretch=(0.9, 0.9))
    with pytest.raises(tympan.InputError, match="slack"):
        tympan.force(slack, to="20 mm")
    curve, = tympan.force(slack, from_="25 mm", to="32 mm", points=9).curves
    assert len(curve.force_N) == 9
    assert min(curve.force_N) > 0
    assert not any(curve.tense)


VISCOUS = circular(NeoHooke(20e3), branches=(ViscousBranch(20e3, 0.5),))


@pytest.fixture(scope="module")
def loops() -> ForceResult:
    return force_of(ForceCase(VISCOUS, voltages=(0.0, 3e3), to=5e-3, points=11, rate=1e-3,
                              cycles=3), Settings())


@pytest.mark.study(seconds=6)
def test_the_area_of_a_loop_is_the_heat_of_its_branches(loops: ForceResult) -> None:
    for loop in loops.loops:
        assert len(loop.area_J) == 3
        assert loop.area_J[2] == pytest.approx(loop.heat_J[2], rel=1e-4)
        assert loop.area_J[0] > loop.area_J[2]  # some is stored in the first one
        assert loop.stopped_s is None


@pytest.mark.study(seconds=6)
def test_a_loop_is_told_at_the_points_of_the_curve(loops: ForceResult) -> None:
    for loop, curve in zip(loops.loops, loops.curves, strict=True):
        assert np.allclose(loop.displacement_m[:11], curve.displacement_m)
        assert np.allclose(loop.displacement_m[10:21], curve.displacement_m[::-1])
        assert loop.time_s[-1] == pytest.approx(30.0)
        out, back = np.array(loop.force_N[1:10]), np.array(loop.force_N[11:20])[::-1]
        assert (out > np.array(curve.force_N[1:10])).all()
        assert (out > back).all()


def test_a_slow_loop_and_one_without_branches_enclose_nothing() -> None:
    elastic, slow = (force_of(ForceCase(film, voltages=(3e3,), to=5e-3, points=11, rate=rate),
                              Settings()) for film, rate in (
        (circular(NeoHooke(20e3)), 1e-3), (VISCOUS, 1e-7)))
    work = np.trapezoid(elastic.curves[0].force_N, elastic.curves[0].displacement_m)
    assert abs(elastic.loops[0].area_J[0]) < 1e-8 * work
    assert elastic.loops[0].heat_J == (0.0,)
    # A ten thousandth of the speed of the loops above, and so of their area.
    assert 0 < slow.loops[0].area_J[0] < 5e-7 * work
    assert np.allclose(slow.loops[0].force_N[:11], slow.curves[0].force_N, rtol=1e-6, atol=1e-9)


def test_force_in_time_is_that_of_the_equations() -> None:
    """At once a branch is a second spring beside the law, unstrained in the flat film.

    Then the film is as it is under the sum of both energies (:mod:`tests.oracles`).
    """
    film = circular(NeoHooke(20e3), branches=(ViscousBranch(10e3, 1e6),))
    fast = force_of(ForceCase(film, to=5e-3, points=3, rate=1.0), Settings()).loops[0]
    flat = film.membrane.prestretch[0]

    def added(l1, l2):
        """The branch's W, from the flat film's stretches on."""
        a, b = l1 / flat, l2 / flat
        return 5e3 * (a**2 + b**2 + (a * b) ** -2.0 - 3)

    law = axisymmetric.EnergyFunction(
        lambda l1, l2: axisymmetric.neo_hooke(20e3).energy(l1, l2) + added(l1, l2),
        lambda l1, l2: axisymmetric.neo_hooke(20e3).w1(l1, l2) + 1e4 * (
            l1 / flat - (l1 / flat) ** -3.0 * (l2 / flat) ** -2.0) / flat,
        lambda l1, l2: axisymmetric.neo_hooke(20e3).w2(l1, l2) + 1e4 * (
            l2 / flat - (l2 / flat) ** -3.0 * (l1 / flat) ** -2.0) / flat)
    exact = axisymmetric.solve_deflection(replace(reference_film(NEO_HOOKE), material=law), 5e-3)
    assert fast.force_N[2] == pytest.approx(exact.force, rel=1e-5)


def test_loops_are_saved_as_a_tester_s_file(loops: ForceResult, tmp_path: Path) -> None:
    loops.save(tmp_path)
    assert ForceResult.load(tmp_path) == loops
    lines = (tmp_path / "circle-loops.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "specimen,voltage_kV,displacement_mm,force_mN,run,direction,t_s"
    assert [line.split(",")[4:6] for line in lines[1:22]] == [
        *[["1", "out"]] * 11, *[["1", "back"]] * 10]
    replace(loops, loops=()).save(tmp_path)
    assert not (tmp_path / "circle-loops.csv").exists()


def test_what_is_left_out_is_told() -> None:
    case = ForceCase(VISCOUS, to=1e-3, points=2, rig=Rig(friction=1e-3, lag_voltage=10.0))
    warnings = " ".join(force_of(case, Settings(MeshSettings().refined(0.5))).warnings)
    assert all(word in warnings for word in ("friction", "lag_voltage", "--rate"))


def quarters(driven: str = "A") -> Specimen:
    """Four sectors with gaps, of which only some have a voltage."""
    segments = tuple(Segment(name=name, sector=(number * np.pi / 2, (number + 1) * np.pi / 2),
                             share=float(name in driven)) for number, name in enumerate("ABCD"))
    return replace(circular(), electrode=Electrode(gap=2e-3, segments=segments))


def guided(specimen: Specimen, guide: str = "vertical") -> ForceCurve:
    """At 4 kV, out to 4 mm, with a guide."""
    curve, = tympan.force(specimen, to="4 mm", voltage=["4 kV"], points=5,
                          rig=Rig(guide=guide)).curves  # type: ignore[arg-type]
    return curve


def test_a_guide_holds_the_moment_of_a_driven_quarter() -> None:
    """It is the derivative of the film's energy by a tilt; the opposite quarter reverses it."""
    curve, opposite = guided(quarters("A")), guided(quarters("C"))
    held = ("force_x_N", "force_y_N", "moment_x_Nm", "moment_y_Nm")
    for name in held:
        values = np.array(getattr(curve, name))
        largest = np.abs(values).max()
        assert largest > (1e-2 if "force" in name else 1e-5)
        np.testing.assert_allclose(np.array(getattr(opposite, name)), -values,
                                   atol=1e-5 * largest)
    # The quarter lies on the diagonal, whose mirror exchanges both axes.
    np.testing.assert_allclose(curve.moment_x_Nm, [-each for each in curve.moment_y_Nm],
                               rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(curve.force_x_N, curve.force_y_N, rtol=1e-4)
    # The driven quarter pulls less on its side, which then would be deflected further.
    assert guided(quarters("AB")).moment_x_Nm[-1] < 0
    for specimen, guide in ((quarters("A"), "free"), (quarters("ABCD"), "vertical")):
        other = guided(specimen, guide)
        assert [getattr(other, name) for name in held] == [(0.0,) * 5] * 4
    level = guided(quarters("A"), "level")
    assert level.force_x_N == (0.0,) * 5
    assert level.moment_x_Nm[-1] < 0


def test_moments_of_a_guide_are_derivatives_of_the_energy() -> None:
    """By a complex step at fixed film, and by virtual work with the film relaxed anew."""
    model = build_model(quarters(), Settings(), Loading(guide="vertical"))
    outcome = held(model, 4e-3, 4e3)
    state = outcome.state
    reactions = model.guiding(state)
    curve = guided(quarters())
    assert reactions[[0, 1, 3, 4]] == pytest.approx(
        [curve.force_x_N[-1], curve.force_y_N[-1], curve.moment_x_Nm[-1],
         curve.moment_y_Nm[-1]], rel=1e-6)

    def relaxed(freedom: int, change: float) -> float:
        moved = state.plate.moved(change * np.eye(6)[freedom])
        start = replace(state, plate=moved, positions=model.place(state.positions, moved))
        solution = newton(model, start, ("force",), (held_plate(4e-3),))
        assert solution.converged
        there = solution.state
        return float(model.energy(there.positions, there.voltage_squared))

    for freedom, name in enumerate(FREEDOMS[:5]):
        if name == "z":
            continue
        unit = np.eye(6)[freedom]
        lift = state.plate.gradient(model.arms) @ unit
        positions = state.positions.astype(complex)
        positions[model.discretisation.plate_nodes] += 1e-30j * lift
        exact = float(model.energy(positions, state.voltage_squared).imag / 1e-30)
        assert reactions[freedom] == pytest.approx(exact, rel=1e-9), name
        step = 1e-4 if freedom < 3 else 5e-3
        work = (relaxed(freedom, step) - relaxed(freedom, -step)) / (2 * step)
        assert reactions[freedom] == pytest.approx(work, rel=2e-4), name
