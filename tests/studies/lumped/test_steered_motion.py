"""Steered plates in motion: feed-forward, feedback, margins, controller as C and FMU, circles."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import tympan
from tests.support.steered import LOAD, SUPPLY, model, quarters, shifting, small_film
from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings
from tympan.studies.films import segmented
from tympan.studies.films.film import FilmLoads, ReducedFilm
from tympan.studies.films.segmented import driven_model, error_at_once, segmented_film
from tympan.studies.lumped.control.controller import Method
from tympan.studies.lumped.plants import FieldPlant, FilmPlant
from tympan.studies.lumped.steered.export import export_steering_fmu, steering_source
from tympan.studies.lumped.steered.forward import Forward, moving_voltages
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.law import SteeredDesign, SteeredLaw, design_law
from tympan.studies.lumped.steered.loop import Feedback
from tympan.studies.lumped.steered.model import SteeredModel
from tympan.studies.lumped.steered.path import SteeredPath, circle_path, read_path
from tympan.studies.lumped.steered.run import (
    Steered,
    SteerSettings,
    full_model,
    place_of,
    run,
    steerable,
    steered,
)

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")

TILT = 2e-3


def path_of(made: SteeredModel, interval: float, frequency: float = 1.0, tilt: float = TILT
            ) -> SteeredPath:
    middle = made.rest(np.full(4, SUPPLY**2 / 2))[made.steered]
    middle[1:] = 0.0
    return circle_path(middle, tilt, frequency, 1.0, interval)


def driven(made: SteeredModel, start: Array, squared: Array, interval: float) -> Array:
    """Places of the lumped model itself at the samples under U² that hold for a sample each."""
    x, reached = made.resting(start), []
    for u in squared:
        reached.append(x[made.steered])
        x = solve_ivp(lambda _, x, u=u: made.rates(x, u), (0.0, interval), x, method="DOP853",
                      rtol=1e-9, atol=1e-13).y[:, -1]
    return np.array(reached)


@cache
def inverse_of(shifts: bool = False) -> tuple[SteeredModel, SteeredInverse]:
    made = shifting() if shifts else model()
    return made, SteeredInverse.of(made, path_of(made, 0.01).spread(24), SUPPLY)


def error_of(shifts: bool, interval: float, damped: float = 2e-5) -> float:
    """Largest distance of the tilt from the circle, over it; the swing is damped as on a bench."""
    made, inverse = inverse_of(shifts)
    made = replace(made, damping=made.damping + np.diag([0, damped, damped, 0][:made.count]))
    path = path_of(made, interval, 2.0)
    padded = np.concatenate([path.wanted[:1], path.wanted])
    squared = np.array(list(moving_voltages(made, inverse, padded, interval)))
    reached = driven(made, inverse.squared(path.wanted[0]), squared, interval)
    return float(np.abs(reached - path.now)[path.late, 1:].max() / TILT)


@pytest.mark.parametrize("shifts", [False, True])
def test_the_lumped_model_follows_the_circle_as_samples_get_shorter(shifts: bool) -> None:
    """The error is that of voltages that hold for a sample: of second order."""
    coarse, fine = (error_of(shifts, interval) for interval in (0.02, 0.01))
    assert fine < 6e-3
    assert coarse / fine > 3


@pytest.mark.parametrize("shifts", [False, True])
def test_the_linear_feed_forward_is_the_models_to_second_order(shifts: bool) -> None:
    made, inverse = inverse_of(shifts)
    forward, off = Forward.of(made, inverse, 0.01), []
    for tilt in (TILT / 4, TILT / 8):
        path = path_of(made, 0.01, tilt=tilt)
        padded = np.concatenate([path.wanted[:1], path.wanted])
        exact = np.array(list(moving_voltages(made, inverse, padded, 0.01)))
        memory, asked = forward.rest @ (path.wanted[0] - inverse.centre), []
        for ahead in path.wanted[1:] - inverse.centre:
            asked.append(forward.c @ memory + forward.d @ ahead)
            memory = forward.a @ memory + forward.b @ ahead
        # Places in units of U²: the polynomials of the inverse have an error of their own.
        slopes = np.linalg.pinv(made.linearise(inverse.squared(inverse.centre)).gain)
        linear = inverse.squared(inverse.centre) + np.array(asked) @ slopes.T
        off.append(np.abs(linear - exact).max())
    assert off[0] / off[1] == pytest.approx(4, rel=0.2)


@cache
def designed(method: Method = "lqg", lag: float = 0.0) -> SteeredDesign:
    made, inverse = inverse_of()
    rests = [inverse.squared(place) for place in (inverse.centre,
                                                  *path_of(made, 0.01).spread(4))]
    return design_law(made, inverse, rests, 0.01, 1.0, method, lag)


def looped(found: SteeredDesign, channel: int, factor: float) -> float:
    """Largest pole where the error of one channel is multiplied by a factor."""
    feedback = found.law.feedback
    assert feedback is not None
    scaled = np.ones(3)
    scaled[channel] = factor
    changed = replace(feedback, b=feedback.b * scaled, d=feedback.d * scaled)
    return max(plant.largest_pole(changed) for plant in found.plants)


@pytest.mark.parametrize("method", ["lqg", "pi"])
def test_the_gain_margin_is_where_the_first_channel_gets_unstable(method: Method) -> None:
    found = designed(method)
    assert looped(found, 0, 1.0) < 1
    assert found.margins.sensitivity <= 1.6 * 1.005
    ends = []
    for channel in range(3):
        factors = np.geomspace(1, 1.3 * found.margins.gain, 40)
        poles = [looped(found, channel, factor) for factor in factors]
        over = next((number for number, pole in enumerate(poles) if pole > 1 + 1e-9), None)
        if over:
            ends.append(brentq(lambda f, own=channel: looped(found, own, f) - 1 - 1e-9,
                               factors[over - 1], factors[over]))
    assert min(ends) == pytest.approx(found.margins.gain, rel=0.05)


def test_the_sensitivity_is_the_largest_answer_to_a_swing_of_the_reading() -> None:
    """The loop is stepped as a controller steps it: e = y − r + n, n a swing of the reading."""
    found = designed()
    plant, feedback, scale = found.plants[0], found.law.feedback, found.law.inverse.scale
    assert feedback is not None
    largest = 0.0
    for omega in (3.0, 30.0, 60.0, 120.0):
        turn = np.exp(1j * omega * 0.01)
        answers = np.array([_answer(plant.a, plant.b, plant.c, feedback, turn, way * scale)
                            for way in np.eye(3)]).T / scale[:, None]
        largest = max(largest, float(np.linalg.norm(answers, 2)))
    assert 1.05 < largest <= found.margins.sensitivity * 1.001


def _answer(a: Array, b: Array, c: Array, feedback: Feedback, turn: complex, noise: Array) -> Array:
    x, s = np.zeros(len(a), complex), np.zeros(len(feedback.a), complex)
    for number in range(6000):
        error = c @ x + noise * turn**number
        asked = feedback.c @ s + feedback.d @ error
        x, s = a @ x + b @ asked, feedback.a @ s + feedback.b @ error
    return np.asarray(error / turn**number)


def followed(law: SteeredLaw, path: SteeredPath, made: SteeredModel, lag: float) -> Array:
    """Largest distance of the lumped model's tilts from a path, with a sensor that lags."""
    rig = Rig(sensor_lag=lag)
    x = made.resting(law.inverse.squared(path.wanted[0]))
    shown = x[made.steered]
    memory, reached = law.resting(path.wanted[0], shown), []
    for ahead in path.wanted[1:]:
        before = x[made.steered]
        reached.append(before)
        given, memory = law.voltages(memory, ahead, shown)
        x = solve_ivp(lambda _, x, u=given**2: made.rates(x, u), (0, 0.01), x, method="DOP853",
                      rtol=1e-6, atol=1e-11).y[:, -1]
        shown = rig.lagged(shown, before, x[made.steered], 0.01)
    return np.abs(np.array(reached) - path.now)[path.late, 1:].max(axis=0) / TILT


@pytest.mark.parametrize(("method", "lag"), [("lqg", 0.0), ("lqg", 5e-3), ("pi", 5e-3)])
def test_feedback_on_the_model_itself_has_nothing_to_do(method: Method, lag: float) -> None:
    """Wanted places lag as the reading does, so a late sensor is not taken for a late plate."""
    made, _ = inverse_of()
    assert followed(designed(method, lag).law, path_of(made, 0.01), made, lag).max() < 0.02


def test_feedback_takes_an_error_of_the_film_off() -> None:
    made, _ = inverse_of()
    softer = replace(made, elastic=0.95 * made.elastic, electric=1.03 * made.electric,
                     force=0.95 * made.force)
    path, law = path_of(made, 0.01), designed().law
    alone = followed(replace(law, feedback=None), path, softer, 0.0).max()
    assert alone > 0.05
    assert followed(law, path, softer, 0.0).max() < alone / 3


def test_a_law_stays_within_the_supply_and_comes_back() -> None:
    """Anti-windup: after a place out of reach the plate is back as soon as that is wanted."""
    made, inverse = inverse_of()
    made, law = replace(made, damping=made.damping + np.diag([0, 2e-5, 2e-5])), designed().law
    far = inverse.centre + np.array([0.0, 0.04, 0.0])
    wanted = np.array([*[far] * 100, *[inverse.centre] * 60])
    x = made.resting(inverse.squared(inverse.centre))
    memory, reached = law.resting(inverse.centre, inverse.centre), []
    for ahead in wanted:
        given, memory = law.voltages(memory, ahead, x[:3])
        assert given.min() >= 0
        assert given.max() <= SUPPLY
        x = solve_ivp(lambda _, x, u=given**2: made.rates(x, u), (0, 0.01), x, rtol=1e-6).y[:, -1]
        reached.append(x[1])
    assert max(reached) > 2 * TILT
    assert np.abs(reached[-20:]).max() < max(reached) / 10


@needs_compiler
@pytest.mark.parametrize("method", ["lqg", "pi"])
def test_the_controllers_c_gives_the_voltages_of_the_law(method: Method, tmp_path: Path) -> None:
    law, made = designed(method).law, model()
    source = tmp_path / "law.c"
    source.write_text(steering_source(law, made), encoding="utf-8")
    subprocess.run(["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared",
                    "-fPIC", str(source), "-o", str(tmp_path / "law.so"), "-lm"], check=True)
    library, vector = ctypes.CDLL(str(tmp_path / "law.so")), ctypes.POINTER(ctypes.c_double)

    def call(name: str, *parts: Array) -> None:
        getattr(library, name)(*(part.ctypes.data_as(vector) for part in parts))

    memory, given = np.empty(len(law.parts[0])), np.empty(4)
    random = np.random.default_rng(7)
    wanted, reading = (law.inverse.centre + each for each in 1e-3 * random.normal(size=(2, 3)))
    call("quarters_steering_rest", memory, wanted, reading)
    own = law.resting(wanted, reading)
    np.testing.assert_allclose(memory, own, rtol=1e-12, atol=1e-18)
    for size in (*[0.1] * 20, *[3.0] * 10, *[0.1] * 10):  # through both ends of the supply
        wanted, reading = law.inverse.centre + size * law.inverse.scale * random.normal(size=(2, 3))
        call("quarters_steering_voltages", memory, wanted, reading, given)
        expected, own = law.voltages(own, wanted, reading)
        np.testing.assert_allclose(given, expected, rtol=1e-9, atol=1e-6)


@needs_compiler
def test_the_controllers_fmu_samples_as_the_law(tmp_path: Path) -> None:
    law, interval = designed().law, 0.01
    file = export_steering_fmu(law, model(), tmp_path)
    assert validate_fmu(str(file)) == []
    listed = [each.name for each in fmpy.read_model_description(str(file)).modelVariables]
    assert listed == [*(f"{word}[{number}]" for word in ("wanted", "measured")
                        for number in (1, 2, 3)), *(f"voltage[{number}]" for number in range(1, 5))]
    path = path_of(model(), interval)
    ahead, reading = path.wanted[1:41], path.wanted[:40] * 1.01
    slave = fmpy.fmi2.FMU2Slave(
        guid=fmpy.read_model_description(str(file)).guid, instanceName="law",
        unzipDirectory=fmpy.extract(str(file), str(tmp_path / "fmu")),
        modelIdentifier="quarters_steering")
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    memory = law.resting(ahead[0], reading[0])
    for number, (wanted, read) in enumerate(zip(ahead, reading, strict=True)):
        slave.setReal(list(range(6)), [*wanted, *read])
        expected, memory = law.voltages(memory, wanted, read)
        np.testing.assert_allclose(slave.getReal([6, 7, 8, 9]), expected, rtol=1e-9)
        slave.doStep(interval * number, interval)
    slave.terminate()
    slave.freeInstance()


@cache
def on_film() -> Steered:
    """The small film of finite elements."""
    settings = SteerSettings(mass=LOAD / 9.80665, supply=SUPPLY, tilt=TILT, turns=1.0)
    return steered(small_film(), settings, Rig(plate_damping=0.05))


def varied(film: ReducedFilm, stiffer: float = 1.0, permittivity: float = 1.0) -> ReducedFilm:
    membrane = film.specimen.membrane
    assert isinstance(membrane.material, NeoHooke)
    changed = replace(membrane, material=NeoHooke(stiffer * membrane.material.mu),
                      relative_permittivity=permittivity * membrane.relative_permittivity)
    return replace(film, specimen=replace(film.specimen, membrane=changed), table=None)


@pytest.mark.parametrize(("stiffer", "permittivity"), [(1.0, 1.0), (1.03, 0.97)])
def test_the_normal_draws_a_circle_on_the_film_in_time(stiffer: float, permittivity: float
                                                       ) -> None:
    """At 1 Hz within 5 % of its radius, on the film of the design and on one 6 % less moved."""
    film = varied(small_film(), stiffer, permittivity)
    error = run(on_film(), film).summary.radius_error
    assert error is not None
    assert error < 0.05


def test_what_feeds_forward_the_motion_is_better_than_the_static_inverse() -> None:
    static, motion = (run(on_film(), drive=drive).summary.radius_error
                      for drive in ("static", "motion"))
    assert static is not None
    assert motion is not None
    assert static > 0.25
    assert motion < 0.1


def same_with_equal_voltages(made: SteeredModel, film: ReducedFilm, alone: ReducedFilm,
                             bound: float) -> None:
    """Compare rests and a step with the film of one voltage, over the range of the deflection."""
    rig, mass, step = Rig(plate_damping=0.05), made.force / 9.80665, 0.7 * made.supply
    rests = [made.rest(np.full(4, voltage**2))[0] for voltage in (0.0, step, made.supply)]
    near = bound * (rests[2] - rests[0])
    one, all_same = (FilmPlant.resting(each, mass, rig) for each in (alone, film))
    for plant in (one, all_same):
        for voltage, rest in zip((0.0, step, made.supply), rests, strict=True):
            assert plant.rested(voltage).deflection == pytest.approx(rest, abs=near)
    x, squared = made.resting(np.zeros(4)), np.full(4, step**2)
    for _ in range(10):
        one, all_same = one.after(step, 0.05), all_same.after(np.full(4, step), 0.05)
        x = solve_ivp(lambda _, x: made.rates(x, squared), (0, 0.05), x, rtol=1e-8,
                      atol=1e-12).y[:, -1]
        assert all_same.deflection == pytest.approx(one.deflection, abs=near)
        assert x[0] == pytest.approx(one.deflection, abs=near)


def test_equal_voltages_move_the_plate_as_the_film_does() -> None:
    """At rest by finite elements, and in time on the reduced film, which has few points."""
    made, step = on_film().model, 2e3
    whole = full_model(quarters(), Settings(MeshSettings().refined(0.4)))
    rests = [made.rest(np.full(4, voltage**2))[0] for voltage in (0.0, step, SUPPLY)]
    near = 0.06 * (rests[2] - rests[0])
    for voltage, rest in zip((0.0, step, SUPPLY), rests, strict=True):
        wired, top = driven_model(whole, dict.fromkeys("ABCD", voltage))
        exact = equilibrium(wired, LOAD, top).state.plate.deflection
        assert rest == pytest.approx(exact, abs=near)
    x, squared = made.resting(np.zeros(4)), np.full(4, step**2)
    plant = FilmPlant.resting(small_film(), LOAD / 9.80665, Rig(plate_damping=0.05))
    for _ in range(10):
        plant = plant.after(np.full(4, step), 0.05)
        x = solve_ivp(lambda _, x: made.rates(x, squared), (0, 0.05), x, rtol=1e-8,
                      atol=1e-12).y[:, -1]
        assert x[0] == pytest.approx(plant.deflection, abs=near)


@pytest.mark.study(seconds=200)
@pytest.mark.parametrize(("method", "other"), [("lqg", 0.08), ("pi", 0.15)])
def test_the_whole_film_draws_the_circle(method: Method, other: float) -> None:
    """The film of ``tympan lumped steer`` in docs/howto/segments.md, and films that differ.

    Films that differ are beyond the 5 %, above all with PI, which does not learn the swing.
    """
    film = replace(quarters(), membrane=tympan.Film("1 mm", 3.0, "vhb-4910-viscous"))
    actuator, errors = steerable(film, SteerSettings(method=method), Rig(plate_damping=0.05))
    assert max(errors.values()) < 0.03
    static, motion = (run(actuator, drive=drive).summary.radius_error
                      for drive in ("static", "motion"))
    assert static is not None
    assert motion is not None
    assert static > 0.3
    assert motion < 0.05
    for stiffer, permittivity in ((1.0, 1.0), (1.03, 0.97), (0.97, 1.03)):
        error = run(actuator, varied(actuator.film, stiffer, permittivity)).summary.radius_error
        assert error is not None
        assert error < (0.05 if stiffer == 1.0 else other)
    built = tympan.lumped.build(film, mass="15 g", voltage="0 kV..2.8 kV", count=3)
    alone = built.models[0].film
    assert alone is not None
    same_with_equal_voltages(actuator.model, actuator.film, alone, 0.02)


@pytest.mark.study(seconds=120)
def test_the_circle_is_drawn_on_finite_elements_in_time() -> None:
    """The controller is designed on a reduced film; what it drives is the film itself."""
    mesh = Settings(MeshSettings().refined(0.5))
    film = replace(quarters(), membrane=tympan.Film("1 mm", 3.0, "vhb-4910-viscous"))
    actuator, _ = steerable(film, SteerSettings(turns=1), Rig(plate_damping=0.05), mesh)
    drawn = run(actuator, full_model(film, mesh))
    assert drawn.summary.radius_error is not None
    assert drawn.summary.radius_error < 0.05
    reduced = run(actuator)
    apart = np.abs(drawn.reached - reduced.reached)[:, 1:].max()
    assert apart < 0.03 * 3e-3


def test_a_film_swings_as_finite_elements_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a jump of one segment; and a film that does not is told by the error that is printed.

    Inertia pushes a plate in other ways than voltages do.
    """
    mesh = Settings(MeshSettings().refined(0.4))
    whole, rig = full_model(quarters(), mesh), Rig(plate_damping=0.05)
    film = segmented_film(whole, LOAD, SUPPLY)
    mass, before = LOAD / 9.80665, dict.fromkeys("ABCD", 2e3)
    wired, top = film.driven(before)
    reduced = replace(FilmPlant.resting(wired, mass, rig, top), film=film.tabulated)
    exact = FieldPlant.resting(whole, mass, rig, before)
    tilts = []
    for _ in range(6):
        reduced, exact = (each.after(np.array([2.2e3, 2e3, 2e3, 2e3]), 0.01)
                          for each in (reduced, exact))
        tilts.append([place_of(reduced)[1:], place_of(exact)[1:]])
    near, true = np.swapaxes(np.array(tilts), 0, 1)
    assert np.ptp(true[:, 0]) > 5e-4
    assert np.abs(near - true).max() < 0.05 * np.ptp(true)
    change = [{**before, "A": 2.2e3}]
    assert error_at_once(film, whole, LOAD, before, change) < 0.05
    monkeypatch.setattr(segmented, "_swings", lambda *given: ())
    without = segmented_film(whole, LOAD, SUPPLY)
    assert error_at_once(without, whole, LOAD, before, change) > 0.3


def test_springs_on_the_plate_are_part_of_the_lumped_model() -> None:
    """The plate rests where the film and the spring hold it, and tilts as far as without."""
    film, rig = small_film(), Rig(spring=20.0, plate_damping=0.05)
    sprung = SteeredModel.of(film, _plate(film), LOAD, SUPPLY, biases=rig.loading.biases)
    for squared in (np.zeros(4), np.full(4, SUPPLY**2 / 2), np.array([0.8, 0.4, 0.2, 0.6]) * 9e6):
        wired, top = film.driven(dict(zip("ABCD", np.sqrt(squared).tolist(), strict=True)))
        q = wired.at_rest(FilmLoads(LOAD, top**2, rig.loading.biases), 1e-7)
        place = sprung.rest(squared)
        assert place[0] == pytest.approx(q[0], abs=1e-5)
        free = wired.at_rest(FilmLoads(LOAD, top**2), 1e-7)
        assert free[0] - q[0] > 2e-4


def _plate(film: ReducedFilm) -> RigidPlate:
    return RigidPlate.uniform(film.specimen.needed_plate().outline, 0.015)


def test_a_path_is_read_from_a_table(tmp_path: Path) -> None:
    file, middle = tmp_path / "path.csv", np.array([2e-3, 0.0, 0.0])
    file.write_text("t_s,tilt_x_mrad\n0,0\n0.1,1\n0.2,0\n", encoding="utf-8")
    path = read_path(file, middle, 0.05)
    np.testing.assert_allclose(path.wanted[:, 1], [0, 5e-4, 1e-3, 5e-4, 0, 0], atol=1e-15)
    assert (path.wanted[:, 0] == middle[0]).all()
    assert path.period is None
    assert len(path.spread(3)) == 3


@pytest.mark.parametrize(("text", "words"), [
    ("t_s\n0\n1\n", "must have one column at least"),
    ("t_s,tilt_x_mrad\n0,1\n", "at least two rows"),
    ("t_s,tilt_x_mrad\n0,1\n0,2\n", "must be after the line before"),
    ("t_s,tilt_x_mrad\n0,1\n1,\n", "must not be blank"),
    ("t_s,tilt_x_mrad\n0,1\n1,x\n", "number")])
def test_a_path_that_cannot_be_read_is_one_message(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_path(file, np.zeros(3), 0.01)


def test_settings_are_checked() -> None:
    for wrong, key in (({"turns": 0.5}, "turns"), ({"method": "pid"}, "method"),
                       ({"tilt": "3 mm"}, "tilt"), ({"interval": "0 s"}, "interval")):
        with pytest.raises(InputError) as caught:
            SteerSettings(**wrong)
        assert caught.value.key == key
    with pytest.raises(InputError, match="8 times a turn"):
        circle_path(np.zeros(3), 1e-3, 20.0, 1.0, 0.01)
