"""Runs in time in the verdict, made by the axisymmetric membrane and Runge and Kutta's method."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.oracles.readings import runs_in_time
from tests.oracles.readings.round_actuators import Hidden
from tests.oracles.readings.runs_in_time import Run
from tests.support.costs import dear
from tympan.base.errors import InputError
from tympan.geometry.specimen import ViscousBranch
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import Calibration, calibrated
from tympan.studies.diagnosis.diagnose import diagnose, judge_dataset
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reading_table import ReadingTable, rows
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.transients.ringing import ringing

#: Of those that show in time.
EFFECTS = ("creep", "series_resistance", "sensor_lag", "plate_damping")
SLOW = Run(shapes=("middle", "large"), rate=40.0)
FAST = Run(voltage=3.5e3, length=3.0, rate=1000.0, before=400, shapes=("small", "middle"),
           swings=True)


def calibration(folder: Path, hidden: Hidden, run: Run, seed: int = 1) -> Calibration:
    readings = prepared_readings(read_dataset(runs_in_time.write(folder, hidden, run, seed)))
    return calibrated(readings.setup, readings.table)


def fitted(nominal: Calibration, *effects: str) -> Fit:
    """Effects together, from usual sizes on."""
    sizes = [0.0 if item.spread else 0.5 * item.deviation
             for effect in effects for item in Cause(effect).effect.parameters]
    return fit(nominal.simulation, tuple(map(Cause, effects)), nominal.table,
               np.r_[nominal.fit.unknowns, sizes])


@pytest.mark.study(seconds=70)
def test_creep_is_named(tmp_path: Path) -> None:
    diagnosis = diagnose(read_dataset(runs_in_time.write(
        tmp_path / "d", Hidden(branch=20e3), SLOW, seed=1))).json()
    assert diagnosis["verdict"] == "named"
    cause = diagnosis["causes"][0]
    assert cause["effect"] == "creep"
    assert cause["parameters"]["mu"]["low"] < 20 < cause["parameters"]["mu"]["high"]
    assert cause["parameters"]["tau"]["low"] < 5 < cause["parameters"]["tau"]["high"]
    assert any("became" in remark for remark in diagnosis["warnings"])


@pytest.mark.study(seconds=3)
@pytest.mark.parametrize(("branch", "time"), [(60e3, 2.0), dear(100e3, 1.0, seconds=7)])
def test_creep_of_other_sizes_and_times(tmp_path: Path, branch: float, time: float) -> None:
    """Both within their limits, what is left is noise, and the readings at rest keep theirs."""
    nominal = calibration(tmp_path / "d", Hidden(branch=branch, time=time), SLOW)
    best, count = fitted(nominal, "creep"), len(nominal.table)
    assert nominal.fit.chi_squared > best.chi_squared + 25
    assert best.chi_squared < count + 4 * (2 * count) ** 0.5
    stiffness, _, low, high = best.unknowns[0], *interval(best, 2)
    assert stiffness == pytest.approx(np.log(1.05), abs=3e-3)
    assert low < branch < high
    _, low, high = (10 * np.exp(size) for size in interval(best, 3))
    assert low < time < high


#: On which two branches show: what is read with 3 µm.
LONG = Run(shapes=("middle", "large"), masses=(2e-2,), voltage=5e3, length=60.0, rate=40.0,
           noise=3e-6)


@pytest.mark.parametrize("hidden", [
    dear(Hidden(branch=100e3, time=20.0, others=((100e3, 0.5),)), seconds=42),
    dear(Hidden(branch=100e3, time=5.0), seconds=24)])
def test_a_second_branch_is_found_where_there_is_one(tmp_path: Path, hidden: Hidden) -> None:
    """Fast and slow within their limits, and noise is left; of a single one no second is told."""
    diagnosis = diagnose(read_dataset(runs_in_time.write(tmp_path / "d", hidden, LONG, 1))).json()
    assert diagnosis["verdict"] == "named"
    named = [cause for cause in diagnosis["causes"] if cause["named"]]
    assert {cause["effect"] for cause in named} == {"creep"}
    truth = [(hidden.branch, hidden.time), *hidden.others]
    assert [cause["again"] for cause in named] == [False, True][:len(truth)]
    found = sorted((cause["parameters"] for cause in named), key=lambda one: one["tau"]["value"])
    for sizes, (modulus, time) in zip(found, sorted(truth, key=lambda one: one[1]), strict=True):
        assert sizes["mu"]["low"] < modulus / 1e3 < sizes["mu"]["high"]
        assert sizes["tau"]["low"] < time < sizes["tau"]["high"]


def test_what_hangs_on_a_late_clock_is_left_out(tmp_path: Path) -> None:
    """All runs by 0.3 s, known within 50 ms: blocks while the plate swings do not count."""
    data = runs_in_time.write(tmp_path / "d", Hidden(damping=0.1), replace(
        FAST, length=8.0, rate=200.0, before=200), seed=3)
    whole = prepared_readings(read_dataset(data)).table
    file = data / "transient.csv"
    head, *lines = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines()]
    column, moved = head.index("voltage_kV"), list[list[str]]()
    for key in dict.fromkeys((line[0], line[1]) for line in lines):
        own = [line for line in lines if (line[0], line[1]) == key]
        later = [*(line[column] for line in own[60:]), *[own[-1][column]] * 60]
        moved += [[*line[:column], voltage, *line[column + 1:]]
                  for line, voltage in zip(own, later, strict=True)]
    file.write_text("\n".join(map(",".join, [head, *moved])) + "\n", encoding="utf-8")
    dataset = read_dataset(data)
    shifts = [late for checked in dataset.runs for late in checked.late]
    assert len(shifts) == len(dataset.runs)
    assert all(shift.low_s < 0.3 < shift.high_s for shift in shifts)
    fewer = prepared_readings(dataset).table

    def times(table: ReadingTable) -> np.ndarray:
        after = (table.kind == "displacement") & (table.since >= 0)
        return np.asarray(table.states.elapsed[table.state[after]])

    early, late = ([np.sum(part(times(table))) for table in (fewer, whole)]
                   for part in (lambda time: time < 1.5, lambda time: time > 3.0))
    assert early[0] < 0.6 * early[1]
    assert late[0] > 0.9 * late[1]


@pytest.mark.study(seconds=5)
def test_nothing_hidden_is_nothing_found(tmp_path: Path) -> None:
    data = runs_in_time.write(tmp_path / "d", Hidden(), SLOW, seed=2)
    assert judge_dataset(read_dataset(data))[1].verdict == "nothing"


@pytest.mark.parametrize(("effect", "size", "hidden"), [
    ("plate_damping", 0.1, Hidden(damping=0.1)),
    dear("series_resistance", 20e6, Hidden(damping=0.1, resistance=20e6), seconds=9),
    dear("sensor_lag", 8e-3, Hidden(damping=0.1, lag=8e-3), seconds=7),
    ("added_mass", 1e-3, Hidden(damping=0.1, added=1e-3))])
def test_what_the_swing_after_a_jump_tells(tmp_path: Path, effect: str, size: float,
                                           hidden: Hidden) -> None:
    """Beside a damping of the plate, without which it never comes to rest."""
    nominal = calibration(tmp_path / "d", hidden, FAST)
    others = [other for other in (*EFFECTS, "added_mass") if other != "plate_damping"]
    fits = {other: fitted(nominal, *dict.fromkeys(("plate_damping", other))) for other in others}
    fits["plate_damping"] = fitted(nominal, "plate_damping")
    best = min(fits, key=lambda name: fits[name].chi_squared
               + 4 * (name != "plate_damping"))
    assert best == effect
    assert fits[best].unknowns[-1] == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize(("effect", "size", "hidden", "run"), [
    dear("plate_damping", 0.1, Hidden(damping=0.1), replace(FAST, hum=(30e-6, 50.0)), seconds=3),
    ("sensor_lag", 8e-3, Hidden(damping=0.1, lag=8e-3), replace(FAST, hum=(50e-6, 60.0))),
    ("sensor_lag", 12e-3, Hidden(damping=0.1, lag=12e-3),
     replace(FAST, rate=200.0, before=200, share=0.02, hum=(30e-6, 50.0)))])
def test_hum_hides_no_effect(tmp_path: Path, effect: str, size: float, hidden: Hidden, run: Run
                             ) -> None:
    """Beside a damping of the plate; the noise of a block is that of the rest."""
    nominal = calibration(tmp_path / "d", hidden, run)
    alone, best = fitted(nominal, "plate_damping"), fitted(nominal, *dict.fromkeys(
        ("plate_damping", effect)))
    assert nominal.fit.chi_squared > alone.chi_squared + 25
    assert alone.chi_squared >= best.chi_squared + 25 * (effect != "plate_damping")
    assert best.chi_squared < len(nominal.table) + 5 * (2 * len(nominal.table)) ** 0.5
    assert best.unknowns[-1] == pytest.approx(size, rel=0.15)


@pytest.mark.parametrize("share", [0.02, 0.98])
def test_a_jump_is_at_no_time_within_a_sample(tmp_path: Path, share: float) -> None:
    """What comes half a sample before or after the middle is no sensor that is late."""
    nominal = calibration(tmp_path / "d", Hidden(damping=0.1), replace(
        FAST, rate=200.0, before=200, share=share, hum=(30e-6, 50.0)))
    alone, late = fitted(nominal, "plate_damping"), fitted(nominal, "plate_damping", "sensor_lag")
    assert alone.chi_squared < late.chi_squared + 6
    assert alone.unknowns[-1] == pytest.approx(0.1, rel=0.1)


def test_readings_are_those_without_hum(tmp_path: Path) -> None:
    """30 um at 50 Hz, which samples of 40 Hz show at 10 Hz: means and noise are as without."""
    run = replace(SLOW, share=0.02, before=100)
    plain, loud = (prepared_readings(read_dataset(runs_in_time.write(
        tmp_path / str(size), Hidden(), replace(run, hum=(size, 50.0))))).table
        for size in (0.0, 30e-6))
    assert len(plain) == len(loud)
    assert np.abs(plain.value - loud.value).max() < 2e-6
    assert np.mean(np.abs(plain.value - loud.value) / plain.sigma) < 0.2
    assert loud.sigma == pytest.approx(plain.sigma, rel=0.25)


@pytest.mark.study(seconds=3)
def test_hum_is_told_and_a_late_trigger_and_neither_is_an_effect(tmp_path: Path) -> None:
    """Of four runs that hum the plate of one moves 1 s after the voltage that is written."""
    run = replace(SLOW, before=200, late=40, hum=(30e-6, 50.0))
    found = diagnose(read_dataset(runs_in_time.write(tmp_path / "d", Hidden(), run, seed=2)))
    assert found.verdict == "nothing"
    assert [hum.frequency_Hz for hum in found.hum] == [50.0] * 4
    assert all(hum.high_um and hum.low_um - 1 < 30 < hum.high_um + 1 for hum in found.hum)
    (late,) = found.late_runs
    assert (late.specimen, late.mass_kg) == ("middle", 0.01)
    assert late.low_s <= 1.0 <= late.high_s
    for words in ("mains hum at 50 Hz", "in all 4 runs", "later than the voltage says"):
        assert any(words in warning for warning in found.warnings)


def test_derivatives_of_what_is_read_in_time(tmp_path: Path) -> None:
    """Against differences of predictions."""
    nominal = calibration(tmp_path / "d", Hidden(damping=0.1), FAST)
    hypothesis = tuple(map(Cause, (*EFFECTS, "parallel_spring")))
    centre = np.r_[0.05, -0.03, 8e3, 0.3, 5e6, 4e-3, 0.08, 2.0]
    jacobian = Prediction(nominal.simulation, hypothesis, centre, nominal.table).jacobian
    for number, step in enumerate(1e-3 * np.abs(centre)):
        ends = [nominal.simulation.predict(hypothesis, centre + sign * step
                                           * np.eye(len(centre))[number], nominal.table)
                for sign in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        for kind, some in nominal.table.rows_of.items():
            assert jacobian[some, number] == pytest.approx(
                slope[some], rel=2e-2, abs=5e-3 * np.abs(slope[some]).max() + 1e-9), kind


@pytest.mark.study(seconds=3)
def test_a_branch_stiffens_and_damps_a_swing_as_the_whole_film_does(tmp_path: Path) -> None:
    """Frequency and fading of a film whose branch relaxes within half a swing, by its equations in
    time: 0.5 % above that at rest, where a tenth of it matters."""
    plain = Hidden(stiffness=1.0, permittivity=1.0)
    film = runs_in_time.film_of("middle", replace(plain, branch=40e3, time=0.05))
    when = np.arange(1, 601) / 1000
    rung = ringing(when, film.swing(2e-2, 2e-2 * runs_in_time.GRAVITY, 1.5e3, when))
    assert rung is not None
    run = replace(SLOW, voltage=1.5e3, length=1.0, rate=200.0, shapes=("middle",))
    nominal = calibration(tmp_path / "d", plain, run)
    states = nominal.table.states
    last = np.flatnonzero((states.mass == 2e-2) & (states.voltage > 1e3))[-1:]
    unknowns = np.r_[0.0, 0.0, 40e3, np.log(0.05 / 10)]
    frequency, decay = (nominal.simulation.predict((Cause("creep"),), unknowns, rows(
        states[last], kind, 1.0))[0] for kind in ("frequency", "decay"))
    assert frequency == pytest.approx(rung.frequency, rel=5e-4)
    assert decay == pytest.approx(rung.decay, rel=0.05)


@pytest.mark.study(seconds=4)
def test_what_a_film_remembers_of_any_branch_is_between_those_that_are_solved(tmp_path: Path
                                                                              ) -> None:
    """Against a run with that very branch: to 1e-5 of the stiffness and 1e-3 of what it adds, be it
    soft or stiff, fast or slow; to 2e-5 and 1e-2 with another beside it."""
    memory = calibration(tmp_path / "d", Hidden(), SLOW).simulation.memory
    assert memory is not None
    film = next(film for film in memory.films if film is not None)
    for share, time in [(1e-3, 1.0), (0.02, 3.0), (0.1, 0.3), (0.5, 5.0), (2.2, 0.05),
                        (7.0, 30.0), (0.3, 400.0), (40.0, 2.0)]:
        branch = ViscousBranch(share * film.branch, time)
        between, solved = film.hardening((branch,), None, 1.0), film.solved((branch,), None)
        most = float(np.abs(solved[0]).max())
        assert most > 1e-3 * share / (1 + share)
        near = 1e-5 + 1e-3 * most
        assert between[0] == pytest.approx(solved[0], rel=0, abs=near), (share, time)
        assert between[1:3] == pytest.approx(solved[1:3], rel=0, abs=3 * near), (share, time)
    for (share, time), (other, slow) in [((0.05, 0.3), (0.1, 20.0)), ((2.2, 2.0), (0.3, 5.0)),
                                         ((5.0, 0.5), (3.0, 8.0))]:
        both = ViscousBranch(share * film.branch, time), ViscousBranch(other * film.branch, slow)
        between, solved = film.hardening(both, None, 1.0), film.solved(both, None)
        alone = sum(film.hardening((branch,), None, 1.0)[0] for branch in both)
        near = 2e-5 + 1e-2 * float(np.abs(solved[0]).max())
        assert between[0] == pytest.approx(solved[0], rel=0, abs=near), (share, other)
        assert between[1:3] == pytest.approx(solved[1:3], rel=0, abs=3 * near), (share, other)
        assert share < 1 or np.abs(alone - solved[0]).max() > 2 * near


@pytest.mark.parametrize(("column", "factor", "words"), [
    ("displacement_mm", 1e3, "transient.csv"), ("voltage_kV", 1e-3, "transient.csv"),
    ("t_s", 1e3, "are its times in the unit")])
def test_a_channel_in_another_unit_is_told_before_any_physics(tmp_path: Path, column: str,
                                                             factor: float, words: str) -> None:
    data = runs_in_time.write(tmp_path / "d", Hidden(damping=0.1),
                          replace(FAST, shapes=("middle",), masses=(2e-2,)))
    (data / "static.csv").unlink()
    head, *lines = (data / "transient.csv").read_text().split()
    place = head.split(",").index(column)
    cells = [line.split(",") for line in lines]
    wrong = [",".join([*row[:place], repr(factor * float(row[place])), *row[place + 1:]])
             for row in cells]
    (data / "transient.csv").write_text("\n".join([head, *wrong]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=words):
        prepared_readings(read_dataset(data))


@pytest.mark.study
@pytest.mark.parametrize(("hidden", "run", "effects"), [
    (Hidden(damping=0.03), FAST, {"plate_damping"}),
    (Hidden(damping=0.3), FAST, {"plate_damping"}),
    (Hidden(damping=0.1, resistance=40e6), FAST, {"plate_damping", "series_resistance"}),
    (Hidden(damping=0.1, lag=15e-3), FAST, {"plate_damping", "sensor_lag"}),
    (Hidden(damping=0.1, added=2e-3), FAST, {"plate_damping", "added_mass"}),
    (Hidden(branch=40e3, time=1.0), SLOW, {"creep"}),
    (Hidden(branch=100e3, time=10.0), SLOW, {"creep"})])
def test_hidden_things_are_named(tmp_path: Path, hidden: Hidden, run: Run, effects: set[str]
                                 ) -> None:
    diagnosis = diagnose(read_dataset(runs_in_time.write(tmp_path / "d", hidden, run, 3))).json()
    assert diagnosis["verdict"] == "named"
    assert {cause["effect"] for cause in diagnosis["causes"] if cause["named"]} == effects


def staircase(folder: Path, dwell: bool, noise: float = 3e-6) -> Path:
    """Up and down in steps of 20 s, read at the end of each, of a film that creeps in 30 s."""
    hidden, random = Hidden(branch=100e3, time=30.0), np.random.default_rng(4)
    run = Run(shapes=("middle", "large"), masses=(1e-2, 2e-2), noise=noise)
    runs_in_time.write(folder, hidden, run)
    (folder / "transient.csv").unlink()
    ramp = np.r_[0.0, 2e3, 3.3e3, 4.2e3, 5e3, 4.2e3, 3.3e3, 2e3, 0.0]
    lines = ["specimen,mass_g,voltage_kV,displacement_mm,direction,order" + ",dwell_s" * dwell]
    for name in run.shapes:
        for mass in run.masses:
            film, load = runs_in_time.film_of(name, hidden), mass * runs_in_time.GRAVITY
            read = film.staircase(load, ramp, 20.0)
            ways = ["up"] * 5 + ["down"] * 4
            lines += [f"{name},{1e3 * mass!r},{u / 1e3!r},"
                      f"{1e3 * (y + noise * random.standard_normal()):.7g},{way},{len(lines) + k}"
                      + ",20" * dwell
                      for k, (u, y, way) in enumerate(zip(ramp.tolist(), read, ways,
                                                        strict=True))]
    (folder / "static.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.mark.study(seconds=25)
def test_a_ramp_with_its_dwell_creeps_and_is_no_hysteresis(tmp_path: Path) -> None:
    """Ways up and down differ as creep makes them differ; read at rest that is called something
    else, which leaves more."""
    fits = {}
    for dwell in (True, False):
        readings = prepared_readings(read_dataset(staircase(tmp_path / f"{dwell}", dwell)))
        nominal = calibrated(readings.setup, readings.table)
        causes = {cause.name for cause in readings.causes}
        assert ("creep" in causes) is dwell
        fits[dwell] = {name: fitted(nominal, name).chi_squared
                       for name in ("creep", "hysteresis") if name in causes}
        count = len(nominal.table)
    assert fits[True]["creep"] < count + 4 * (2 * count) ** 0.5
    assert fits[True]["hysteresis"] > fits[True]["creep"] + 25
    assert fits[False]["hysteresis"] > fits[True]["creep"] + 25
