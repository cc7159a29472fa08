"""Plates that a mechanism makes jump: equilibria and snaps against closed forms and equations."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.optimize import brentq, minimize_scalar

import tympan
from tests.oracles import axisymmetric
from tests.support.costs import dear
from tests.support.specimens import NEO_HOOKE, circular, reference_film
from tympan.cli import main
from tympan.fem.equilibrium import snap
from tympan.fem.equilibrium.held_path import with_tangent
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.biases import Bistable, BuckledBeam, ForceTable, Magnet, Spring
from tympan.fem.rig import Rig
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import ViscousBranch
from tympan.reports.figures.curve import voltage_curves
from tympan.studies.case import Case, Settings, build_model, equilibrate, solve
from tympan.studies.force import ForceCase
from tympan.studies.force import force as force_of
from tympan.studies.limits import limits, solve_within
from tympan.studies.limits.curve import curve
from tympan.studies.path import path
from tympan.studies.signals import Pieces
from tympan.studies.transient import TransientCase, history

FILM, EXACT = circular(NEO_HOOKE), reference_film(NEO_HOOKE)
#: It takes more force back than over: without voltage the plate stays where it snapped to.
STAYS = Rig(biases=(Bistable(force=0.62, travel=9e-3, rest=-1e-3, back=0.9),))
MASS = 70e-3
COARSE = Settings(MeshSettings().refined(0.5))


@dataclass(frozen=True)
class Cubic:
    """A taut film under small deflections and a symmetric bistable mechanism.

    The film is a linear spring k(U) = k₀ − s U², the mechanism a x³ − b x about its middle, and the
    weight such that this is an equilibrium at 4 kV: a x³ + (k − b) x + (k − k_m) m = 0.
    """

    travel: float

    @property
    def film(self) -> tuple[float, float]:
        """k₀ and s."""
        first, second = (EXACT.small_deflection_force(1.0, voltage) for voltage in (0.0, 1e3))
        return first, (first - second) / 1e6

    @property
    def middle(self) -> float:
        return self.travel / 2

    @property
    def held(self) -> float:
        """k_m."""
        return self.film[0] - self.film[1] * 4e3**2

    @property
    def factors(self) -> tuple[float, float]:
        """a and b."""
        return 4 * 1.2 * self.held / self.travel**2, 1.2 * self.held

    @property
    def case(self) -> Case:
        largest = self.factors[1] * self.travel / 3 / np.sqrt(3)
        rig = Rig(gravity=9.81, biases=(Bistable(force=largest, travel=self.travel),))
        return Case(FILM, mass=self.held * self.middle / 9.81, rig=rig)

    @property
    def snaps(self) -> tuple[float, float]:
        """Voltages at which the discriminant vanishes: through and back."""
        (first, falls), (a, b), k = self.film, self.factors, Polynomial([0.0, 1.0])
        vanishing = 4 * a * (k - b) ** 3 + 27 * a**2 * ((k - self.held) * self.middle) ** 2
        roots = vanishing.roots()
        through, back = sorted(roots.real[np.abs(roots.imag) < 1e-9 * np.abs(roots)])[-2:]
        return np.sqrt((first - through) / falls), np.sqrt((first - back) / falls)

    def deflections(self, voltage: float) -> list[float]:
        """Stable and unstable equilibria."""
        (first, falls), (a, b) = self.film, self.factors
        k = first - falls * voltage**2
        roots = Polynomial([(k - self.held) * self.middle, k - b, 0.0, a]).roots()
        return sorted((self.middle + roots.real[np.abs(roots.imag) < 1e-12]).tolist())


SMALL = Cubic(0.1e-3)


@pytest.mark.study(seconds=3)
def test_snaps_are_where_the_discriminant_of_the_cubic_vanishes() -> None:
    reached = limits(SMALL.case, Settings())
    through, back = SMALL.snaps
    assert 3e3 < back < 4e3 < through < 5e3
    assert reached.snap_through.voltage_V == pytest.approx(through, rel=3e-6)
    assert reached.snap_back.voltage_V == pytest.approx(back, rel=3e-6)
    assert (reached.first, reached.limit) == ("snap_through", reached.snap_through)
    assert reached.snap_back not in reached.reached


def test_stable_equilibria_are_the_roots_of_the_cubic() -> None:
    through, back = SMALL.snaps
    for voltage, others in ((0.0, 0), (back + 5, 1), (4e3, 1), (through - 5, 1), (5e3, 0)):
        result = solve(replace(SMALL.case, voltage=voltage), Settings())
        exact = SMALL.deflections(voltage)
        assert len(exact) == 1 + 2 * others
        assert result.status == "equilibrium"
        near = 1e-3 if voltage in (through - 5, back + 5) else 2e-5
        assert result.deflection_m == pytest.approx(exact[0], rel=near)
        told = result.equilibria
        assert [each.deflection_m for each in told] == pytest.approx(
            exact[::2] if others else [], rel=near)
        # From below the lower one is reached, and it is that of all other numbers.
        assert [each.reached for each in told] == [True, False][:len(told)]
        assert not told or told[0].deflection_m == result.deflection_m


def test_solve_says_that_the_voltage_is_beyond_a_snap() -> None:
    for voltage in (5e3, 6e3):
        result = solve_within(Case(FILM, mass=MASS, voltage=voltage, rig=STAYS), COARSE)
        assert result.status == "equilibrium"
        assert (result.limit is result.limits.snap_through) == (voltage > 5.5e3)
        assert len(result.equilibria) == (0 if voltage > 5.5e3 else 2)


def voltage_squared(case: Case, deflection: float) -> float:
    """U² at which a film held at a deflection carries what acts on it, by displacement control."""
    model = build_model(case.specimen, Settings())
    push = sum(bias.derivatives(deflection)[1] for bias in case.rig.biases)
    load = case.rig.force(case.mass) - push
    start = held(model, deflection).solution
    return brentq(lambda squared: held(model, deflection, squared**0.5, start).state.force - load,
                  0.0, 49e6, rtol=1e-13)


@pytest.mark.study(seconds=3)
def test_snaps_by_arc_length_and_by_displacement_control_are_the_same() -> None:
    wide = Cubic(0.4e-3).case
    reached = limits(wide, Settings())
    branch = path(wide, Settings(), "voltage")
    snaps = branch.events[:2]
    assert [event.what for event in snaps] == ["snap_through", "snap_back"]
    for event, limit, sign in zip(snaps, (reached.snap_through, reached.snap_back), (-1, 1),
                                  strict=True):
        assert event.value == pytest.approx(limit.voltage_V, rel=1e-6)
        place = event.station.deflection_m
        turn = minimize_scalar(lambda at, sign=sign: sign * voltage_squared(wide, at),
                               bounds=(place - 2e-5, place + 2e-5), method="bounded",
                               options={"xatol": 1e-8})
        assert event.value == pytest.approx(np.sqrt(sign * turn.fun), rel=1e-6)
    # Between the two, and nowhere else, the branch is unstable.
    ends = [event.station.deflection_m for event in snaps]
    for station in branch.stations:
        if all(abs(station.deflection_m - end) > 1e-6 for end in ends):
            beyond = station.voltage_V > 10e3
            assert beyond or station.stable != (ends[0] < station.deflection_m < ends[1])


def test_a_snap_without_a_way_back_is_the_same_by_displacement_control() -> None:
    case = Case(FILM, mass=MASS, rig=STAYS)
    reached = limits(case, Settings())
    place = path(case, Settings(), "voltage").events[0].station.deflection_m
    turn = minimize_scalar(lambda at: -voltage_squared(case, at), method="bounded",
                           bounds=(place - 2e-4, place + 2e-4), options={"xatol": 1e-8})
    assert reached.snap_through.voltage_V == pytest.approx(np.sqrt(-turn.fun), rel=1e-6)
    assert reached.snap_back is None
    # Beyond the jump the film has limits of its own.
    assert [limit.kind for limit in reached.reached] == [
        "snap_through", "tension", "instability"]


def test_equilibria_beyond_the_folds_are_those_of_the_equations() -> None:
    """Of film and mechanism together, at each voltage three."""
    voltages = (0.0, 3e3, 5e3)
    line, = force_of(ForceCase(FILM, voltages=voltages, start=-2e-3, to=12e-3, masses=(MASS,),
                               rig=STAYS), Settings(MeshSettings().refined(2.0))).loads
    bias, = STAYS.biases

    def missing(at: float, voltage: float) -> float:
        film = axisymmetric.solve_deflection(EXACT, at, voltage).force
        return film + bias.derivatives(at)[1] - STAYS.force(MASS)

    for voltage in voltages:
        found = [each for each in line.crossings if each.voltage_V == voltage]
        assert [each.stable for each in found] == [True, False, True]
        assert [each.reached for each in found] == [True, False, False]
        for each in found:
            at = each.displacement_m
            exact = brentq(missing, at - 1e-4, at + 1e-4, args=(voltage,), xtol=1e-12)
            assert at == pytest.approx(exact, rel=2e-5)
            assert each.force_N == pytest.approx(STAYS.force(MASS) - bias.derivatives(exact)[1],
                                                 rel=1e-5)


BEAMS = BuckledBeam(30e-3, 4e-3, 0.13e-3, 1.5e9, 0.4e-3, 3, 3e-3)


@pytest.mark.parametrize(("rig", "mass"), [
    (STAYS, 40e-3), (STAYS, 80e-3), (Rig(biases=(BEAMS,)), 20e-3),
    (Rig(biases=(BEAMS, Spring(20.0))), 20e-3), (Rig(biases=(BEAMS, Spring(200.0))), 20e-3)])
def test_solve_tells_the_stable_crossings_of_the_load_line(rig: Rig, mass: float) -> None:
    """Two searches: one holds the loaded plate, one the film alone."""
    line, = force_of(ForceCase(FILM, voltages=(0.0, 4e3), start=-8e-3, to=12e-3, points=61,
                               masses=(mass,), rig=rig), Settings()).loads
    for voltage in (0.0, 4e3):
        stable = [each for each in line.crossings if each.stable and each.voltage_V == voltage]
        result = solve(Case(FILM, mass=mass, voltage=voltage, rig=rig), Settings())
        told = result.equilibria
        assert len(told) == (len(stable) if len(stable) > 1 else 0)
        assert [each.deflection_m for each in told] == pytest.approx(
            [each.displacement_m for each in stable] if told else [], rel=1e-6)
        there = next(each for each in stable if each.reached)
        assert result.deflection_m == pytest.approx(there.displacement_m, rel=1e-6)
        assert [each.reached for each in told] == ([each is there for each in stable]
                                                   if told else [])


def test_a_weight_may_make_the_plate_snap() -> None:
    rising = path(Case(FILM, rig=STAYS), Settings(), "mass")
    over = rising.events[0]
    assert over.what == "snap_through"
    assert over.station.deflection_m < 2e-3
    before, beyond = (equilibrate(Case(FILM, mass=over.value + more, rig=STAYS), Settings())[1]
                      for more in (-1e-4, 1e-4))
    assert (before.snapped, beyond.snapped) == (False, True)
    assert before.state.plate.deflection < 2e-3 < 7e-3 < beyond.state.plate.deflection
    # There is no way back by the voltage then, and none is told.
    reached = limits(Case(FILM, mass=80e-3, rig=STAYS), Settings())
    assert reached.snap_through is reached.snap_back is None
    assert reached.tension is not None


def test_a_magnet_that_nothing_stops_pulls_the_plate_in() -> None:
    rig = Rig(biases=(Magnet(force=6.0, gap=12e-3, decay=3e-3), Spring(120.0, 4e-3)))
    reached = limits(Case(FILM, mass=25e-3, rig=rig), Settings(), beyond=True)
    assert reached.snap_through is None
    assert reached.pull_in is not None


def test_a_rig_that_cannot_snap_is_looked_at_no_further(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even beyond a pull-in."""
    monkeypatch.setattr(snap, "held_path", None)
    monkeypatch.setattr(snap, "with_tangent", None)
    case = Case(circular(), mass=17.9e-3, voltage=3e3, rig=Rig(spring=5.0))
    assert solve_within(case, COARSE).equilibria == ()
    assert limits(case, COARSE).end is not None
    assert solve(Case(circular(), mass=17.9e-3, voltage=40e3), COARSE).status == "no_equilibrium"


def test_a_curve_jumps_and_goes_on() -> None:
    asked = (5e3, 6e3)
    result = curve(FILM, (MASS,), Settings(), STAYS, asked)
    table, reached = result.table, result.curves[0].limits
    way = table["asked"] == 0
    voltage, deflection = table["voltage"][way], table["deflection"][way]
    jump = int(np.argmax(np.diff(deflection)))
    assert voltage[jump] == voltage[jump + 1] == reached.snap_through.voltage_V
    assert deflection[jump] < 1.1e-3 < 8e-3 < deflection[jump + 1]
    assert table["status"][~way].tolist() == ["equilibrium", "equilibrium"]
    assert table["beyond"][~way].tolist() == ["", "snap_through"]
    for at, place in zip(asked, table["deflection"][~way], strict=True):
        solved = solve(Case(FILM, mass=MASS, voltage=at, rig=STAYS), Settings())
        assert place == pytest.approx(solved.deflection_m, rel=1e-6)
    drawn, = voltage_curves(result)
    # The line is whole up to the film's own first limit, beyond the jump too.
    assert drawn.line[0][drawn.parts[0]].max() == pytest.approx(reached.tension.voltage_V / 1e3)
    assert drawn.end.startswith("snap-through at 5.459 kV")


CREEPS = circular(NEO_HOOKE, branches=(ViscousBranch(10e3, 0.5),))


@pytest.mark.study(seconds=4, only=("swinging", "damped"))
@pytest.mark.parametrize(("film", "rig", "inertia"), [
    (FILM, STAYS, False), (CREEPS, STAYS, False),
    dear(FILM, Rig(biases=STAYS.biases, plate_damping=20.0), False, seconds=4, name="damped"),
    (FILM, Rig(biases=STAYS.biases, plate_damping=20.0), True)],
    ids=["elastic", "creeping", None, "swinging"])
def test_a_step_over_the_snap_ends_on_the_other_branch(film, rig, inertia) -> None:
    through = limits(Case(film, mass=MASS, rig=rig), COARSE).snap_through.voltage_V
    steps = StepSettings(error=1e-7 if rig.plate_damping else 1e-8)
    for share in (1.03,) if rig.plate_damping else (0.97, 1.03):
        voltage = share * through
        signal = Pieces(np.array([0.0, 0.0, 20.0]), np.array([0.0, voltage, voltage]))
        done = history(TransientCase(film, signal, mass=MASS, rig=rig, inertia=inertia,
                                     steps=steps), COARSE)
        assert done.stopped is None
        there = solve(Case(film, mass=MASS, voltage=voltage, rig=rig), COARSE).deflection_m
        assert (there > 7e-3) == (share > 1)
        assert done.deflection[-1] == pytest.approx(there, rel=1e-6)
        balance = done.balance
        work = balance.load_work_J + balance.electrical_work_J
        assert abs(balance.unexplained_J) < 1e-8 * work


@pytest.mark.study(seconds=3, only=("creeping",))
@pytest.mark.parametrize("film", [FILM, CREEPS], ids=["elastic", "creeping"])
def test_a_slow_ramp_snaps_where_limits_say(film) -> None:
    """A plate without inertia jumps at once; its film's branches hold it for a little longer."""
    through = limits(Case(film, mass=MASS, rig=STAYS), COARSE).snap_through.voltage_V
    signal = Pieces(np.array([0.0, 100.0, 200.0]), np.array([0.0, 6e3, 5e3]))
    done = history(TransientCase(film, signal, mass=MASS, rig=STAYS,
                                 steps=StepSettings(error=1e-8)), COARSE)
    at, = (number for number in np.flatnonzero(np.diff(done.time) == 0) if done.time[number] < 99)
    assert done.voltage[at] == pytest.approx(through, rel=1e-6 if film is FILM else 1e-4)
    assert done.voltage[at] > through * (1 - 1e-6)
    assert done.deflection[at + 1] > 7e-3 > done.deflection[at]
    assert done.deflection[-1] > 7e-3  # as the voltage falls it stays
    balance = done.balance
    work = balance.load_work_J + balance.electrical_work_J
    assert abs(balance.unexplained_J) < 1e-8 * work
    assert balance.jumps_J > 0


@pytest.mark.study(seconds=4)
def test_the_terminal_and_json_tell_snaps_and_equilibria(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "disc.toml").write_text("""
name = "disc"
[frame]
shape = "circle"
radius = "4.5 cm"
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.2360679775, 2.2360679775]
relative_permittivity = 4.7
[membrane.material]
law = "neo_hooke"
mu = "25 kPa"
""", encoding="utf-8")
    (tmp_path / "rig.toml").write_text("""
[[bias]]
law = "bistable"
force = "0.62 N"
back = "0.9 N"
travel = "9 mm"
rest = "-1 mm"
""", encoding="utf-8")
    given = [str(tmp_path / "disc.toml"), "--mass", "70 g", "--rig", str(tmp_path / "rig.toml")]
    assert main(["limits", *given]) == 0
    assert "snap-through    5.459 kV" in capsys.readouterr().out
    assert main(["limits", *given, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["first"] == record["snap_through"]["kind"] == "snap_through"
    assert record["snap_back"] is None
    assert main(["solve", *given, "--voltage", "4 kV"]) == 0
    text = capsys.readouterr().out
    near, far = solve(Case(FILM, mass=MASS, voltage=4e3, rig=STAYS), Settings()).equilibria
    assert f"stable at {1e3 * near.deflection_m:.4g} mm (reached from the mounted plate)" in text
    assert f"stable at {1e3 * far.deflection_m:.4g} mm\n" in text
    assert main(["solve", *given, "--voltage", "4 kV", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [each["reached"] for each in record["equilibria"]] == [True, False]
    assert record["equilibria"][0]["deflection_m"] == record["deflection_m"]
    assert main(["path", *given]) == 0
    assert "snap-through    5.4589 kV" in capsys.readouterr().out


def test_the_python_door_has_the_same() -> None:
    result = tympan.solve(FILM, mass=MASS, voltage="4 kV", rig=STAYS)
    assert len(result.equilibria) == 2
    model, outcome = equilibrate(Case(FILM, mass=MASS, voltage=4e3, rig=STAYS), Settings())
    both = snap.resting(model, outcome.solution, Settings().path)
    assert [each.deflection_m for each in result.equilibria] == pytest.approx(
        [model.deflection(each.state) for each in both], rel=1e-9)
    # The other one is at rest under the same loads, and stiff there.
    other = both[1]
    assert other.state.force == outcome.state.force
    assert other.state.voltage_squared == outcome.state.voltage_squared
    assert with_tangent(model, other).tangent.along()[1]["force"] > 0


def test_a_plate_driven_off_its_mounted_place_rests_at_the_first_place_that_holds_it() -> None:
    """Film and mechanism together hold it at 1.5 and at 4.5 mm, and not where it is mounted."""
    stiffness = EXACT.small_deflection_force(1.0, 0.0)
    places = np.array([-3, -1.5, -0.75, 0, 0.75, 1.5, 2.25, 3, 3.75, 4.5, 6, 8, 10]) * 1e-3
    together = np.array([-0.5, 0, 0.06, 0, -0.06, 0, 0.06, 0, -0.06, 0, 0.3, 1, 2])
    rig = Rig(biases=(ForceTable(displacement=tuple(places.tolist()), force=tuple(
        (together - stiffness * places).tolist())),))
    for mass in (0.0, 1e-3):
        result = solve(Case(FILM, mass=mass, rig=rig), COARSE)
        stable = [each.deflection_m for each in result.equilibria]
        assert len(stable) == 3
        assert result.deflection_m == stable[1]
        assert stable[1] == pytest.approx(1.5e-3, abs=0.3e-3)
