"""A closed loop on the lumped model: its parts against other ways, and what it must reach."""

from __future__ import annotations

import argparse
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, replace
from functools import cache
from itertools import count, pairwise
from pathlib import Path
from typing import Any, NoReturn, get_args

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.validation import validate_fmu
from scipy.signal import cont2discrete, detrend

import tympan
from tests.support.costs import dear
from tests.support.lumped import MODELS, OVAL, compiled_controller
from tests.support.specimens import elliptical
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.rig import Rig, Sensor
from tympan.geometry.specimen import ViscousBranch
from tympan.options import print_record
from tympan.paper.table1 import paper_actuators
from tympan.reports.tables import text
from tympan.studies.case import Settings, build_model
from tympan.studies.films.film import ReducedFilm
from tympan.studies.films.reduction import reduced_film
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.case import ChosenActuators, LumpedCase
from tympan.studies.lumped.control.controller import Controller, Method, StaticInverse
from tympan.studies.lumped.control.design import SENSITIVITY, ControllerDesign, design_controller
from tympan.studies.lumped.control.fmu import write_controller_fmu
from tympan.studies.lumped.control.lqg import _filter, _law, _regulator
from tympan.studies.lumped.control.result import ControlledFilm, ControlResult
from tympan.studies.lumped.control.run import (
    ControlSettings,
    Measured,
    _sensed,
    closed_loop,
    controlled,
    scattered_films,
    settled,
)
from tympan.studies.lumped.equilibria import rest, rest_curve
from tympan.studies.lumped.export.fmu import export_fmu
from tympan.studies.lumped.in_time import CirclesInTime, FilmInTime
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.model_file import STILL, LumpedModel, write_model
from tympan.studies.lumped.plants import FilmPlant, LumpedPlant
from tympan.studies.lumped.simulate import simulate
from tympan.studies.sense.inverse import Inverse
from tympan.studies.signals import Pieces, step, through

SUPPLY, INTERVAL = 7e3, 10e-3
#: Membrane circles of the paper's large ellipse, as `tympan lumped build` finds them.
MODEL = LumpedModel(OVAL, (45e-3, 75e-3), (0.61, 0.39), 2.2e-9, SUPPLY)


def actuator() -> Actuator:
    return MODEL.actuator(17.9e-3)


@cache
def designed(sensor_lag: float = 0.0, method: Method = "pi") -> ControllerDesign:
    return design_controller(actuator(), SUPPLY, INTERVAL, sensor_lag, method)


def test_the_inverse_tells_the_voltage_of_a_rest() -> None:
    for name in ("membrane circles", "permittivity that falls"):
        one = MODELS[name]
        inverse = StaticInverse.of(one, 4e3)
        voltages = np.linspace(0, 4e3, 23)
        squared = inverse.squared(rest_curve(one, voltages))
        assert squared == pytest.approx(voltages**2, abs=2e-6 * 4e3**2), name


def test_a_plant_moves_as_the_simulation_says() -> None:
    """Steps as long as samples against collocation over the whole run."""
    one, duration = actuator(), 0.6
    exact = simulate(one, step(2e3, 5e3, 0.0, duration)).deflection(
        np.linspace(0, duration, 61)[1:])
    plant, reached = LumpedPlant.resting(one, 2e3), []
    for _ in range(60):
        plant = plant.after(5e3, INTERVAL)
        reached.append(float(plant.deflection))
    assert reached == pytest.approx(exact, abs=1e-5 * float(np.ptp(exact)))


def test_several_films_move_as_each_alone() -> None:
    softer = np.array([1.0, 0.9, 1.1])
    many = LumpedPlant.resting(replace(actuator(), stiffness=softer), 1e3).after(4e3, INTERVAL)
    for number, factor in enumerate(softer):
        one = LumpedPlant.resting(replace(actuator(), stiffness=factor), 1e3).after(4e3, INTERVAL)
        assert many.deflection[number] == pytest.approx(float(one.deflection), rel=1e-11)


def closed(controller_gain: float, voltage: float, sensor_lag: float) -> float:
    """Largest pole of the sampled loop, written out in state space, its gain so many times."""
    c = designed(sensor_lag).controller
    linear = linearise(actuator(), voltage, by="U2")
    a, b, out = linear.a, linear.b / linear.gain, linear.c
    if sensor_lag:
        a = np.block([[a, np.zeros((len(a), 1))], [out / sensor_lag, -1 / sensor_lag]])
        b, out = np.vstack([b, [[0.0]]]), np.eye(len(a))[-1:]
    ad, bd, *_ = cont2discrete((a, b, out, np.zeros((1, 1))), INTERVAL)
    assert c.filter_s is not None
    assert c.proportional is not None
    n, p = len(ad), 1 - np.exp(-INTERVAL / c.filter_s)
    # x, two lags of the reading and the integral; the reading is of the state before the step.
    whole = np.zeros((n + 3, n + 3))
    first, second, integral = (np.zeros(n + 3) for _ in range(3))
    first[:n], first[n] = p * out[0], 1 - p
    second[:] = p * first
    second[n + 1] += 1 - p
    kp, ki = controller_gain * c.proportional, controller_gain * c.integral_per_s
    integral[:] = -ki * INTERVAL * second
    integral[n + 2] += 1
    driven = integral - kp * second
    whole[:n, :n] = ad
    whole[:n] += bd * driven
    whole[n], whole[n + 1], whole[n + 2] = first, second, integral
    return float(np.abs(np.linalg.eigvals(whole)).max())


@pytest.mark.parametrize("lag", [0.0, 5e-3])
def test_margins_are_where_the_loop_turns_unstable(lag: float) -> None:
    margins = designed(lag).margins
    voltages = np.linspace(0, SUPPLY, 9).tolist()
    assert margins.sensitivity < 1.03 * SENSITIVITY  # between the frequencies of the search
    assert margins.phase > 2 * np.degrees(np.arcsin(0.5 / margins.sensitivity)) - 0.5
    assert max(closed(1.0, voltage, lag) for voltage in voltages) < 1
    assert max(closed(0.97 * margins.gain, voltage, lag) for voltage in voltages) < 1
    assert max(closed(1.03 * margins.gain, voltage, lag) for voltage in voltages) > 1


def test_lqg_is_the_filter_and_the_regulator_of_the_books() -> None:
    """Its two gains against iterated Riccati equations; the law step by step against both."""
    plant = designed(5e-3).plants[4]
    a, b, c, size = plant.a, plant.b, plant.c, len(plant.a)
    left = c.T @ c
    for _ in range(30_000):
        gain = (b.T @ left @ a) / (0.3 + b.T @ left @ b)
        left = c.T @ c + a.T @ left @ (a - b @ gain)
    big = np.block([[a, b], [np.zeros((1, size)), np.ones((1, 1))]])
    seen, noise = np.append(c, [[0.0]], axis=1), np.zeros((size + 1, size + 1))
    noise[:size, :size], noise[-1, -1] = 0.2 * b @ b.T, 1e-2
    spread = np.eye(size + 1)
    for _ in range(30_000):
        correction = spread @ seen.T / (seen @ spread @ seen.T + 1)
        spread = big @ (spread - correction @ seen @ spread) @ big.T + noise
    regulator, (moved, walked) = _regulator(plant, 0.3), _filter(plant, 0.2, 1e-2)
    assert regulator == pytest.approx(gain, rel=1e-6)
    assert np.append(moved, walked) == pytest.approx(correction[:, 0], rel=1e-6)
    a_, b_, c_, d_, g_ = _law(plant, regulator, moved, walked).arrays
    made = np.random.default_rng(1)
    foreseen, memory, still = *2 * [made.normal(size=size + 1)], np.linalg.solve(
        np.eye(size) - a, b)
    for wanted, reading, cut in made.normal(size=(5, 3)):
        now = foreseen + correction[:, 0] * (reading - foreseen[:size] @ c[0])
        asked = wanted - now[-1] - float((gain @ (now[:size] - wanted * still[:, 0]))[0])
        assert memory @ c_ + np.array([wanted, reading]) @ d_ == pytest.approx(asked, rel=1e-5)
        foreseen = np.append(a @ now[:size] + b[:, 0] * (asked + cut + now[-1]), now[-1])
        memory = a_ @ memory + b_ @ [wanted, reading] + g_ * cut
    assert memory == pytest.approx(foreseen, rel=1e-4, abs=1e-4)


def test_lqg_damps_the_swing_that_pi_waits_for() -> None:
    """The same step, as robust: less than 1.6 of sensitivity at all voltages of the design."""
    one = actuator()
    low, high = rest(one, 3e3), rest(one, 4.5e3)
    times = []
    for method in get_args(Method):
        made = designed(0.0, method)
        assert made.margins.sensitivity < 1.03 * SENSITIVITY
        assert made.largest_pole(scattered_films(one, 100, seed=45)).max() < 1
        run = closed_loop(made.controller, LumpedPlant.resting(one, 3e3), low, np.full(400, high))
        times.append(settled(run.deflection, high, 0.02 * (high - low), INTERVAL))
        assert run.deflection[-1] == pytest.approx(high, abs=5e-3 * (high - low))
    pi, lqg = times
    assert pi is not None
    assert lqg is not None
    assert lqg < 0.75 * pi


def test_a_late_sensor_reads_what_the_equation_says() -> None:
    lag, slope = 20e-3, 3.0
    sensor, shown, times = Sensor(sensor_lag=lag), 0.0, np.linspace(0, 0.1, 11)
    for before, now in pairwise(times):
        shown = sensor.lagged(shown, slope * before, slope * now, now - before)
    # The solution of r' = (s t - r)/T from 0.
    exact = slope * (times[-1] - lag * (1 - np.exp(-times[-1] / lag)))
    assert shown == pytest.approx(exact, rel=1e-12)
    assert sensor.recorded(times, slope * times)[-1] == pytest.approx(exact, rel=1e-12)


def chosen() -> ChosenActuators:
    return ChosenActuators(LumpedCase((), (MODEL,)), (actuator(),), ())


def test_a_film_that_does_not_bear_the_supply_says_so() -> None:
    with pytest.raises(InputError, match=r"given '9 kV': .*of the supply, 9 kV: give a lower one"):
        tympan.lumped.control(OVAL, mass="17.9 g", high="1 kV", duration="2 s", supply="9 kV")


def test_a_signal_without_an_upper_end_follows_the_supply(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a supply below the usual 3.5 kV too, by both doors; one that is given stays."""
    peaks: list[float] = []

    def controlled(_: ChosenActuators, signal: Pieces, *others: object) -> NoReturn:
        peaks.append(signal.peak)
        raise InputError("is not run here")

    monkeypatch.setattr("tympan.studies.lumped.control.run.controlled", controlled)
    write_model(tmp_path / "oval.lumped.toml", MODEL)
    line = ["lumped", "control", "--model", str(tmp_path / "oval.lumped.toml"), "--mass", "17.9 g"]
    for supply, high in ((2e3, None), (7e3, None), (2e3, 1.5e3)):
        given = {} if high is None else {"high": high}
        with pytest.raises(InputError, match="is not run here"):
            tympan.lumped.control(MODEL, mass="17.9 g", supply=supply, **given)
        assert main([*line, "--supply", f"{supply} V", *(["--high", f"{high} V"] if given else [])]
                    ) == 2
        assert peaks[-2:] == [high or supply / 2] * 2


def test_a_slow_loop_is_followed_until_it_is_done() -> None:
    """Without feedback the mass moves the plate by ``open_m``; the loop takes it off, by 1/K_i."""
    film, = controlled(chosen(), step(0.0, 3e3, 0.0, 3.0), ControlSettings(interval=1.0)).films
    disturbance = film.disturbance
    assert 0.1 < disturbance.largest_m / disturbance.open_m <= 1
    assert disturbance.settled_s is not None
    assert 1 < disturbance.settled_s * film.controller.integral_per_s < 20


def test_the_largest_pole_of_films_is_that_of_each_alone() -> None:
    """Of an array, against the loop of one that is written out, with and without a late sensor."""
    films = scattered_films(actuator(), 3)
    none = np.ones(2)
    for lag in (0.0, 5e-3):
        plain = replace(actuator(), stiffness=none)
        worst = max(closed(1.0, voltage, lag) for voltage in np.linspace(0, SUPPLY, 9).tolist())
        assert designed(lag).largest_pole(plain) == pytest.approx(worst * none, abs=1e-9)
        at_once = designed(lag).largest_pole(films)
        for number, pole in enumerate(at_once):
            one = replace(
                films, stiffness=films.stiffness[number], mass=films.mass[number],
                permittivity=films.permittivity[number], viscous=Viscous(
                    *(each[number] for each in astuple(films.viscous))))
            assert designed(lag).largest_pole(one) == pytest.approx(pole, abs=1e-9)


def test_a_thousand_scattered_films_are_stable_and_a_loop_without_margin_is_not() -> None:
    films = scattered_films(actuator(), 1000, seed=45)
    made = designed()
    assert made.largest_pole(films).max() < 1
    one, gain = made.controller, made.margins.gain
    assert one.filter_s is not None
    assert one.proportional is not None
    hard = Controller.pi(one.inverse, SUPPLY, INTERVAL, one.filter_s, gain * one.proportional,
                         gain * one.integral_per_s)
    unstable = (replace(made, controller=hard).largest_pole(films) >= 1).mean()
    assert 0.2 < unstable < 0.95  # at the limit of the film of the design


@pytest.mark.parametrize("count", [50, pytest.param(1000, marks=pytest.mark.study)])
def test_scattered_films_are_held(count: int) -> None:
    """Stable in time, and without offset."""
    films, one = scattered_films(actuator(), count, seed=45), actuator()
    levels = [rest(one, voltage) for voltage in (3e3, 4.5e3, 3.5e3)]
    wanted = np.repeat(levels, 600)
    run = closed_loop(designed().controller, LumpedPlant.resting(films), rest(one, 0.0), wanted)
    late, voltage = (values.reshape(3, 600, count)[:, -50:] for values in (
        np.abs(run.deflection - wanted[:, None]), run.voltage))
    within = ((voltage > 10) & (voltage < SUPPLY - 10)).all(axis=1)
    assert within.mean() > 0.8  # the others cannot reach it with this supply
    assert late.max(axis=1)[within].max() < 0.02 * (levels[1] - levels[0])
    # Those creep on; nor do they swing about that.
    assert np.ptp(detrend(late, axis=1), axis=1).max() < 0.005 * (levels[1] - levels[0])


@pytest.mark.parametrize("method", get_args(Method))
def test_the_integral_does_not_wind_up(method: Method) -> None:
    """A deflection beyond the supply, for long; then one within, reached as soon as ever."""
    controller, one = designed(0.0, method).controller, actuator()
    low, high = rest(one, 2e3), rest(one, 4e3)
    beyond = 2 * rest(one, SUPPLY)
    state = controller.resting(low, low)
    for _ in range(3000):
        voltage, state = controller.voltage(state, beyond, high)
    assert voltage == pytest.approx(SUPPLY, rel=1e-5)
    for _ in range(40):
        voltage, state = controller.voltage(state, low, high)
    assert voltage < 4e3


@pytest.mark.study(seconds=4)
@pytest.mark.parametrize("mass", [17.9e-3, dear(22.45e-3, seconds=6)])
def test_the_swing_explains_which_shape_has_the_quickest_loop(mass: float) -> None:
    """K_i of the paper's three shapes goes with 2 ζ ω over the share at once."""
    explained = []
    for shape, specimen in enumerate(paper_actuators(9.735)):
        one = Actuator.of(specimen, mass, (0.413, 0.587) if shape else None)
        film, = controlled(ChosenActuators(LumpedCase((specimen,), ()), (one,), ()),
                           step(0.0, 3e3, 0.0, 0.1), ControlSettings()).films
        explained.append(film.controller.integral_per_s / film.swing_allows)
        assert film.scattered.stable == film.scattered.films
    assert np.ptp(explained) < 0.05 * min(explained)  # shares, damping, speed differ by 10 to 20 %


@cache
def branched_model() -> LumpedModel:
    """The large ellipse with the film that was fitted to the paper's Table 2, in time."""
    plain = elliptical(75e-3, NeoHooke(27.7e3))
    specimen = replace(plain, membrane=replace(
        plain.membrane, branches=(ViscousBranch(4.3e6, 14.0),), relative_permittivity=8.41))
    film = reduced_film(build_model(specimen, Settings()), (0.1755, 0.22), SUPPLY)
    return LumpedModel(specimen, (45e-3, 75e-3), (0.608, 0.392), 3.83e-9, SUPPLY,
                       viscous=STILL, film=film)


DAMPED = Rig(plate_damping=0.1)


def film_plant(film: ReducedFilm | None, voltage: float, mass: float = 17.9e-3) -> FilmPlant:
    assert film is not None
    return FilmPlant.resting(film, mass, DAMPED, voltage)


def test_a_film_moves_as_its_motion_says() -> None:
    """Sample by sample against steps of its own length."""
    model = branched_model()
    plant = film_plant(model.film, 2e3)
    signal, times = step(2e3, 5e3, 0.0, 0.5), np.linspace(0, 0.5, 51)
    whole = FilmInTime(model, plant.mass, plant.rig).driven(signal, times)
    reached = [plant.deflection]
    for _ in range(50):
        plant = plant.after(5e3, INTERVAL)
        reached.append(plant.deflection)
    assert np.array(reached) == pytest.approx(whole, abs=2e-3 * float(np.ptp(whole)))
    # It creeps on, so that ever less voltage holds where it is.
    assert not plant.holds(plant.rested(5e3).deflection, 5e3)
    assert plant.holds(plant.rested(2e3).deflection, 5e3)


def test_circles_creep_as_the_film_they_stand_for() -> None:
    model, times = branched_model(), np.linspace(0, 60, 241)
    creeps = FilmInTime(model, 17.9e-3, DAMPED)
    circles = CirclesInTime(creeps.circles(3.5e3))
    signal = step(3e3, 4e3, 0.0, 60.0)
    film, lumped = (each.driven(signal, times) for each in (creeps, circles))
    assert lumped == pytest.approx(film, abs=0.05 * float(np.ptp(film)))


def assert_prints_what_is_known(film: ControlledFilm, capsys: pytest.CaptureFixture[str]) -> None:
    """A ratio to a film that does not settle is a bound; a voltage that may be 0 is 0."""
    fine = film.controller.resolution_V
    assert 0 < fine < 1e-2 * SUPPLY
    for lowest, words in ((0.1 * fine, "voltage 0 kV to"), (2e3, "voltage 2 kV to")):
        for without, sooner in ((None, "> 47.6 ×"), (9.0, " 47.6 ×")):
            step = replace(film.steps[0], times_as_soon=47.6, open_settled_s=without,
                           soonest_s=0.0)
            result = ControlResult((replace(film, lowest_V=lowest, steps=(step,)),))
            print_record(argparse.Namespace(command="lumped_control", json=False), result.json(),
                         result=result)
            printed = capsys.readouterr().out
            assert words in printed
            assert sooner in printed
            assert ("> 47.6" in printed) == (without is None)
            assert "at once" in printed


@pytest.mark.study(seconds=5)
def test_a_controller_of_circles_holds_films_in_time(
        capsys: pytest.CaptureFixture[str]) -> None:
    """The film of the design, then films that differ in stiffness, permittivity and mass."""
    model = branched_model()
    case = ChosenActuators(LumpedCase((), (model,)), (model.actuator(17.9e-3, DAMPED),), ())
    signal = through(np.array([0, 3, 3, 6, 6, 9.0]), np.repeat([3e3, 4.5e3, 3.5e3], 2))
    result, = controlled(case, signal, ControlSettings()).films
    assert result.lowest_V >= 0
    assert result.highest_V <= SUPPLY
    assert [each.times_as_soon is not None and each.times_as_soon >= 3
            for each in result.steps] == [True, True]
    assert result.disturbance.settled_s is not None
    above = text(ControlResult((result,))).split("\n\n")[0]
    assert f"gain_margin       {result.margins.gain:.6g}\n" in above
    assert_prints_what_is_known(result, capsys)
    wanted = result.samples["wanted"].to_numpy()
    height, film = abs(result.steps[1].to_m - result.steps[1].from_m), model.film
    assert film is not None
    membrane, made = film.specimen.membrane, np.random.default_rng(45)
    for softer, stronger, heavier in np.exp([0.1, 0.1, 0.05] * made.normal(size=(2, 3))):
        other = replace(film, specimen=replace(film.specimen, membrane=replace(
            membrane, material=scaled(membrane.material, float(softer)),
            branches=tuple(replace(each, modulus=each.modulus * float(softer))
                           for each in membrane.branches),
            relative_permittivity=membrane.relative_permittivity * float(stronger))))
        plant = film_plant(other, 3e3, 17.9e-3 * float(heavier))
        run = closed_loop(result.controller, plant, float(wanted[0]), wanted)
        late = slice(len(wanted) - 50, None)
        inside = (run.voltage[late] > 10).all() and (run.voltage[late] < SUPPLY - 10).all()
        missed = np.abs(run.deflection - wanted)[late]
        assert not inside or missed.max() < 0.02 * height
        assert np.ptp(detrend(missed)) < 0.005 * height


needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")

#: Through both ends of the supply.
LEVELS = (4e3, 6.9e3, 0.0, 3e3)


def wanted_levels() -> np.ndarray:
    return np.repeat([rest(actuator(), voltage) for voltage in LEVELS], 60)


def assert_drives_as_ours(controller: Controller, voltage_of: Callable[[float, float], float],
                          sensed: Inverse | None = None) -> None:
    """A loop that something else drives, by wanted and read value; the two never see each other."""
    plant = LumpedPlant.resting(actuator(), 2e3)
    ours = closed_loop(controller, plant, float(plant.deflection), wanted_levels(),
                       sensed=sensed).voltage
    driven = []
    for each in wanted_levels():
        driven.append(voltage_of(each, float(plant.capacitance if sensed else plant.deflection)))
        plant = plant.after(driven[-1], INTERVAL)
    assert ours.max() > 0.999 * SUPPLY
    assert ours.min() < 10
    assert driven == pytest.approx(ours, rel=1e-9, abs=1e-9 * SUPPLY)


@needs_compiler
@pytest.mark.parametrize("method", get_args(Method))
def test_the_c_gives_the_same_voltages_in_the_loop(tmp_path: Path, method: Method) -> None:
    controller = designed(0.0, method).controller
    assert_drives_as_ours(controller, compiled_controller(
        controller, rest(actuator(), 2e3), tmp_path))


@contextmanager
def instance(kind: type, use: str, fmu: Path, folder: Path) -> Iterator[Any]:
    """An FMU's instance by fmpy, begun at time 0."""
    description = fmpy.read_model_description(str(fmu))
    made = kind(guid=description.guid, unzipDirectory=fmpy.extract(str(fmu), str(folder)),
                modelIdentifier=getattr(description, use).modelIdentifier)
    made.instantiate()
    made.setupExperiment(startTime=0.0)
    made.enterInitializationMode()
    made.exitInitializationMode()
    yield made
    made.terminate()
    made.freeInstance()


@needs_compiler
def test_beyond_the_sensor_s_range_the_highest_deflection_is_read(tmp_path: Path) -> None:
    """The C is given NaN there, and its voltage is that of the run in Python."""
    controller = designed(0.0, "pi").controller
    last = actuator().capacitance(0.7 * controller.inverse.highest_m)
    sensed = replace(_sensed(actuator(), controller), largest_F=(float(last),))
    in_c = compiled_controller(controller, rest(actuator(), 2e3), tmp_path)
    read = []

    def voltage_of(wanted: float, capacitance: float) -> float:
        read.append(float(sensed.deflection(capacitance, 0.0)))
        return in_c(wanted, read[-1])

    assert_drives_as_ours(controller, voltage_of, sensed)
    assert 0 < np.isnan(read).sum() < len(read)


@needs_compiler
@pytest.mark.parametrize("sensor", get_args(Measured))
@pytest.mark.parametrize("method", get_args(Method))
def test_the_fmu_gives_the_same_voltages_in_the_loop(tmp_path: Path, method: Method,
                                                     sensor: Measured) -> None:
    """By co-simulation and by model exchange; the FMU is valid and compiles without warnings."""
    controller = designed(0.0, method).controller
    sensed = _sensed(actuator(), controller) if sensor == "capacitance" else None
    write_controller_fmu(tmp_path, "2 ovals", controller, sensed)
    fmu = tmp_path / "2 ovals-control.fmu"
    assert validate_fmu(str(fmu)) == []
    names = {each.name: each.causality for each in
             fmpy.read_model_description(str(fmu)).modelVariables}
    assert names == {"wanted_deflection": "input", f"measured_{sensor}": "input",
                     "voltage": "output"}
    with instance(FMU2Slave, "coSimulation", fmu, tmp_path / "slave") as slave:
        numbers = count()

        def by_steps(wanted: float, read: float) -> float:
            slave.setReal([0, 1], [wanted, read])
            voltage: float = slave.getReal([2])[0]
            slave.doStep(INTERVAL * next(numbers), INTERVAL)
            return voltage

        assert_drives_as_ours(controller, by_steps, sensed)
    with instance(FMU2Model, "modelExchange", fmu, tmp_path / "model") as model:
        events = [0.0]

        def by_events(wanted: float, read: float) -> float:
            model.setTime(events[-1])
            model.enterEventMode()
            model.setReal([0, 1], [wanted, read])
            needed, _, _, _, defined, following = model.newDiscreteStates()
            assert (needed, defined) == (False, True)
            events.append(following)
            model.enterContinuousTimeMode()
            model.setReal([0, 1], [0.0, 0.0])  # not looked at until the next event
            return float(model.getReal([2])[0])

        assert_drives_as_ours(controller, by_events, sensed)
        assert events == pytest.approx(INTERVAL * np.arange(len(events)), rel=1e-12)
    source = next((tmp_path / "slave" / "sources").glob("*_fmu.c"))
    subprocess.run(["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only",
                    str(source)], check=True)


@needs_compiler
def test_the_fmu_samples_at_its_own_interval(tmp_path: Path) -> None:
    """Communicating four times as often, inputs astray between samples; then a third as often."""
    controller, wanted = designed().controller, rest(actuator(), 3e3)
    write_controller_fmu(tmp_path, "oval", controller, None)
    reading, state, ours = 0.9 * wanted, controller.resting(0.9 * wanted, 0.9 * wanted), []
    for _ in range(12):
        voltage, state = controller.voltage(state, wanted, reading)
        ours.append(float(voltage))
    with instance(FMU2Slave, "coSimulation", tmp_path / "oval-control.fmu", tmp_path) as slave:
        for number, expected in enumerate(ours[:6]):
            for quarter in range(4):
                slave.setReal([0, 1], [wanted, 0.0 if quarter else reading])
                assert slave.getReal([2])[0] == pytest.approx(expected, rel=1e-9)
                slave.doStep(INTERVAL * (number + quarter / 4), INTERVAL / 4)
        slave.setReal([0, 1], [wanted, reading])
        slave.doStep(6 * INTERVAL, 3 * INTERVAL)
        for number, expected in enumerate(ours[9:], 9):
            assert slave.getReal([2])[0] == pytest.approx(expected, rel=1e-9)
            slave.doStep(number * INTERVAL, INTERVAL)


@needs_compiler
def test_the_fmus_of_film_and_controller_make_the_loop(tmp_path: Path) -> None:
    """Nothing of Python is in it but the clock."""
    controller, one, wanted = designed().controller, actuator(), wanted_levels()
    write_controller_fmu(tmp_path, "oval", controller, None)
    film_fmu = export_fmu(MODEL, tmp_path, float(one.mass))
    states = one.rest(rest(one, 2e3), 2e3)
    ours = closed_loop(controller, LumpedPlant.resting(one, 2e3), float(states[0]), wanted)
    reached, (*_, voltage, deflection) = [], range(len(states) * 2 + 3)
    with (instance(FMU2Slave, "coSimulation", film_fmu, tmp_path / "film") as film,
          instance(FMU2Slave, "coSimulation", tmp_path / "oval-control.fmu",
                   tmp_path / "controller") as control):
        film.setReal(list(range(len(states))), states.tolist())
        for number, each in enumerate(wanted):
            reached.append(film.getReal([deflection])[0])
            control.setReal([0, 1], [each, reached[-1]])
            film.setReal([voltage], control.getReal([2]))
            for part in (control, film):
                part.doStep(INTERVAL * number, INTERVAL)
    assert reached == pytest.approx(ours.deflection, abs=1e-5 * float(np.ptp(wanted)))


@needs_compiler
@pytest.mark.parametrize("use", ["ModelExchange", "CoSimulation"])
def test_the_fmu_runs_in_a_simulator(tmp_path: Path, use: str) -> None:
    """A reading that stays, from a time that is not 0."""
    controller, wanted = designed().controller, rest(actuator(), 3e3)
    write_controller_fmu(tmp_path, "oval", controller, None)
    state, ours = controller.resting(wanted, wanted), []
    motion = fmpy.simulate_fmu(
        str(tmp_path / "oval-control.fmu"), fmi_type=use, start_time=5.0, stop_time=5.2,
        output_interval=INTERVAL / 2, output=["voltage"],
        start_values={"wanted_deflection": 1.01 * wanted, "measured_deflection": wanted})
    for _ in range(20):
        voltage, state = controller.voltage(state, 1.01 * wanted, wanted)
        ours.append(float(voltage))
    assert ours[-1] > ours[0] + 10
    between = np.abs((motion["time"] - 5) / INTERVAL % 1 - 0.5) < 0.1
    assert motion["voltage"][between] == pytest.approx(ours, rel=1e-9)


def test_settling() -> None:
    way = np.array([0.0, 0.9, 1.1, 1.01, 0.99, 1.0])
    assert settled(way, 1.0, 0.02, 0.5) == 1.5
    assert settled(way, 1.0, 0.2, 0.5) == 0.5
    assert settled(way, 2.0, 0.02, 0.5) is None


@pytest.mark.study(seconds=3)
def test_capacitance_is_as_good_a_sensor_as_long_as_it_is_known() -> None:
    """The same run by either; then a capacitance that is a thousandth more than the model's."""
    signal = step(3e3, 4.5e3, 0.0, 2.0)
    films = [controlled(chosen(), signal, ControlSettings(sensor=sensor, sensor_lag=2e-3)).films[0]
             for sensor in get_args(Measured)]
    direct, told = (film.samples["displacement"].to_numpy() for film in films)
    assert told == pytest.approx(direct, abs=1e-3 * float(np.ptp(direct)))
    sensed, one = films[1].sensed, actuator()
    assert sensed is not None
    more = replace(sensed, base_F=(sensed.base_F[0] / 1.001,))
    wanted = np.full(300, rest(one, 4.5e3))
    run = closed_loop(films[1].controller, LumpedPlant.resting(one, 4.5e3), float(wanted[0]),
                      wanted, sensed=more)
    # It reads C/C₀ − 1, which goes with y², a thousandth too large, and takes that off.
    excess = float(one.capacitance(wanted[0]) / one.capacitance(0.0)) - 1
    expected = wanted[0] * (1 - np.sqrt(1 - 1e-3 / excess))
    assert wanted[0] - run.deflection[-1] == pytest.approx(expected, rel=0.1)


def test_python_and_files(tmp_path: Path) -> None:
    write_model(tmp_path / "oval.lumped.toml", MODEL)
    result = tympan.lumped.control(tmp_path / "oval.lumped.toml", mass="17.9 g", high="3 kV",
                                   duration="1 s")
    assert result.films[0].sensed is None
    result.save(tmp_path)
    again = ControlResult.load(tmp_path)
    assert again.json() == result.json()
    assert len(again.films[0].samples) == 101
    assert list(result.to_pandas()["limited_by"]) == [again.films[0].steps[0].limited_by]
    assert not list(tmp_path.glob("*.fmu"))
    if shutil.which("cc"):
        for fmu in (True, False):  # one that an earlier controller left goes
            replace(result.numbers, fmu=fmu).save(tmp_path)
            assert len(list(tmp_path.glob("*-control.fmu"))) == fmu
    with pytest.raises(InputError, match="within the supply"):
        tympan.lumped.control(tmp_path / "oval.lumped.toml", mass="17.9 g", high="6 kV",
                              supply="5 kV")
